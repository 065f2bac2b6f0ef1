# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random scenes in random moving frames, with the true positions of all bodies.

Rotations and translations are complex numbers; no code is shared with the package. Times are
seconds since a scene's beginning.
"""

from bisect import bisect_right
import cmath
from random import Random
from typing import NamedTuple

from builders import SECOND, serialised, transforms
import numpy as np

FIXED = 'odom'
# Child and parent. Bodies in 'map' need the inverse transform.
TREE = {'base': 'odom', 'odom': 'map', 'pan': 'laser'}
STATIC = {'laser': ('base', 0.5 + 0.25j, 2.0)}
FRAMES = 'odom', 'base', 'map', 'laser', 'pan'
OUTLINE = (0.6 + 0.4j, -0.6 + 0.4j, -0.6 - 0.4j, 0.2 - 0.4j)
WINDOW, WINDOWS, INSTANCES = 0.5, 6, 6
# The greatest delay of transforms and bodies; by the end of a window all have arrived.
LATE = 0.1


class Event(NamedTuple):
    """When a message arrives, and on which topic."""

    time: float
    topic: str
    data: bytes


class MovingScene:
    """
    One scene, sent in frames that move, and in the fixed frame.

    Attributes
    ----------
    moving, fixed : list of Event
        In the order of their arrival.
    truth : list of dict
        At the end of each window the corners of each body as complex numbers, by its name: the
        robot's, or the id of an obstacle.

    """

    def __init__(self, seed, start):
        self._random = random = Random(seed)
        self._start = start
        self._tracks = {child: self._track() for child in TREE}
        sent = [Event(0.0, '/tf_static', transforms(*(
            (parent, child, 0, place.real, place.imag, turn)
            for child, (parent, place, turn) in STATIC.items())))]
        for child, track in self._tracks.items():
            late = random.uniform(0.0, LATE)
            sent += [Event(time + random.uniform(0.0, late), '/tf', transforms(
                (TREE[child], child, self.stamp(time), place.real, place.imag, turn)))
                for time, place, turn in track]
        self.moving, self.fixed, self.truth = sent, list(sent), []
        bodies = {}
        for window in range(WINDOWS):
            names = ['robot', *range(1, INSTANCES + 1)]
            random.shuffle(names)
            for name in names:
                if window == 0 or random.random() < 0.7:
                    time = (window + 0.05 + random.uniform(0.0, 0.3)) * WINDOW
                    bodies[name] = ring = self._body()
                    self._send(name, ring, time, time + random.uniform(0.0, LATE))
            self.truth.append(dict(bodies))
        for events in (self.moving, self.fixed):
            events.sort(key=lambda event: event.time)

    def stamp(self, time):
        return self._start + round(time * SECOND)

    def outline(self, time):
        """Return the outline at the newest pose of 'base' that has arrived by a time."""
        came = {data: event_time for event_time, topic, data in self.moving if topic == '/tf'}
        newest = max(at for at, place, turn in self._tracks['base'] if came[transforms(
            ('odom', 'base', self.stamp(at), place.real, place.imag, turn))] <= time)
        place, turned = self._pose('base', newest)
        return [place + turned * corner for corner in OUTLINE]

    def _track(self):
        """Return times, positions and headings of a frame that drives around."""
        random = self._random
        rate, phase = random.uniform(12.0, 100.0), random.uniform(0.0, 6.0)
        speed, turning = random.uniform(-2.0, 2.0), random.uniform(-3.0, 3.0)
        times = [k / rate for k in range(int((WINDOW * WINDOWS + 0.3) * rate))]
        return [(time, cmath.rect(speed, 0.3 * time) + 0.7 * speed * time * 1j,
                 phase + turning * time) for time in times]

    def _pose(self, frame, time):
        """Return the position of a frame in the fixed one, and the unit by which it is rotated."""
        place, turned = 0j, 1 + 0j
        while frame not in (FIXED, 'map'):
            if frame in STATIC:
                frame, there, turn = STATIC[frame]
            else:
                there, turn = self._at(frame, time)
                frame = TREE[frame]
            unit = cmath.exp(1j * turn)
            place, turned = there + unit * place, unit * turned
        if frame == 'map':
            there, turn = self._at(FIXED, time)
            unit = cmath.exp(-1j * turn)
            place, turned = unit * (place - there), unit * turned
        return place, turned

    def _at(self, child, time):
        track = self._tracks[child]
        k = bisect_right(track, time, key=lambda one: one[0])
        (begin, place, turn), (end, other, next_turn) = track[k - 1:k + 1] if k < len(track) else (
            track[-1], (track[-1][0] + 1.0, *track[-1][1:]))
        share = (self.stamp(time) - self.stamp(begin)) / (self.stamp(end) - self.stamp(begin))
        return place + share * (other - place), turn + share * (next_turn - turn)

    def _body(self):
        """Return a polygon near the origin."""
        random = self._random
        middle = complex(random.uniform(-2.5, 2.5), random.uniform(-2.5, 2.5))
        count = random.choice((1, 2, 3, 4, 5, 8))
        return [middle + cmath.rect(random.uniform(0.3, 1.2), cmath.tau * k / count)
                for k in range(count)]

    def _send(self, name, ring, time, arrival):
        topic, instance = ('/footprint', None) if name == 'robot' else ('/obstacles', name)
        frame = self._random.choice(FRAMES)
        place, turned = self._pose(frame, time)
        for events, frame_id, points in (
                (self.fixed, FIXED, ring),
                (self.moving, frame, [(point - place) / turned for point in ring])):
            events.append(Event(arrival, topic, serialised(
                [(point.real, point.imag) for point in points], self.stamp(time), frame_id,
                instance)))


def corners(vertices):
    """Return vertices as complex numbers in the order of their angle round their middle."""
    points = [complex(x, y) for x, y in np.asarray(vertices).tolist()]
    middle = sum(points) / len(points)
    return sorted(points, key=lambda point: (cmath.phase(point - middle), abs(point - middle)))

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The polygons that take longest: to take from a message, to decide and to measure.

With as many vertices as the node accepts in this process's kernel; its tables of
docs/reliability.md are replaced. Each figure is the processor time for the worst pair of shapes
and places, the least of several runs. Contacts that begin one by one are timed, too, because each
might cost more the more there are.
"""

import itertools
import time

from _shared import ROOT, table
from builders import serialised
import numpy as np
from page_parts import replace_part
from sat_collision import intersects, Polygon, separation
from sat_collision.geometry.body.polygon import max_in_time, Packer
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.messages.cdr import decode
from scene import monitor_of
from traffic import regular

MAX_VERTICES = 1024
# The offset of a second body from the first, in sizes of the body, and its rotation.
_PLACES = ((2.1, 0.0, 0.0), (0.9, 0.4, 0.0), (0.3, 0.2, 0.5), (0.01, 0.003, 0.0),
           (0.0, 0.0, np.pi), (0.02, 0.01, 1.6))
_TURNS = 0.0, 0.7, 2.0
_CONTACTS = 1_000, 10_000


def shapes(count, rng):
    """
    Return outlines by name.

    The vertices of a star have random distances from the middle; bays have many reflex vertices;
    spiral and crescent are bands that wind around the middle; the teeth of a saw lean, each under
    the next.
    """
    def polar(angle, radius):
        return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])

    def band(turns, inner, width):
        angle, radius = (np.linspace(*ends, count // 2) for ends in (
            (0.0, 2.0 * np.pi * turns), (inner, 1.0)))
        return np.vstack([polar(angle, radius), polar(angle, radius - width)[::-1]])

    around, k = 2.0 * np.pi * np.arange(count) / count, np.arange(count - 2)
    comb = np.column_stack([1.0 - np.repeat(np.arange(count // 2), 2) / (count // 4),
                            np.tile([0.1, 1.0, 1.0, 0.1], count // 4)])
    comb[[0, -1]] = [1.0, 0.0], [comb[-1, 0], 0.0]
    zigzag = np.column_stack([np.linspace(-1.0, 1.0, count // 2),
                              np.where(np.arange(count // 2) % 2, 0.5, -0.5)])
    teeth = np.column_stack([k / count + np.where(k % 2, 0.8, 0.0) - 1.0, k % 2 + 1e-3 * k])
    return {'star': polar(around, rng.uniform(0.2, 1.0, count)), 'comb': comb,
            'lying comb': comb[:, ::-1] * [2.0, 0.5] - [1.0, 0.0],
            'zigzag': np.vstack([zigzag, zigzag[::-1] + [0.0, 0.2]]),
            'bays': polar(around, 1.0 - 0.6 * np.abs(np.sin(4.0 * around))),
            'four bays': polar(around, 1.0 - 0.6 * np.abs(np.sin(2.0 * around))),
            'spiral': band(5.0, 0.2, 0.05), 'crescent': band(0.75, 1.0, 0.05),
            'saw': np.vstack([teeth, [[0.0, -0.5], [-1.0, -0.5]]])}


def _placed(outline, x, y, turn):
    cosine, sine = np.cos(turn), np.sin(turn)
    return outline @ np.array([[cosine, sine], [-sine, cosine]]) + [x, y]


def _best(function, *arguments, repeats=5):
    """Return the least processor time in ms of several calls."""
    times = []
    for _ in range(repeats):
        begun = time.thread_time()
        function(*arguments)
        times.append(time.thread_time() - begun)
    return 1e3 * min(times)


def measure():
    """Return for each shape its times, and its worst counterpart."""
    packer = Packer(MAX_VERTICES)
    outlines = shapes(max_in_time(MAX_VERTICES), np.random.default_rng(1))
    found = {}
    for name, outline in outlines.items():
        messages = [decode(serialised(_placed(outline, 0.0, 0.0, turn), 0), False)[2]
                    for turn in _TURNS]
        taking = max(_best(packer.pack, points) for points in messages)
        deciding, measuring = (0.0, ''), (0.0, '')
        for other, its in outlines.items():
            for place, turn in itertools.product(_PLACES, _TURNS):
                body = Polygon(_placed(outline, 0.0, 0.0, turn))
                that = Polygon(_placed(_placed(its, *place), 0.0, 0.0, turn))
                deciding = max(deciding, (_best(intersects, body, that), other))
                measuring = max(measuring, (_best(separation, body, that), other))
        found[name] = [taking, deciding[0], *measuring]
    return found


def contacts(count):
    """Return the ms until a footprint has met a number of obstacles, one message each."""
    monitor = monitor_of(count)
    now = 10**18
    monitor.receive('footprint', serialised(regular(4, 0.0, 0.0, 2.0 * count), now), now)
    messages = [serialised(regular(4, float(k), 0.0, 0.4), now) for k in range(count)]

    def meet_all():
        for message in messages:
            monitor.receive('obstacles', message, now)
            monitor.scene.take_changes()
    time_taken = _best(meet_all, repeats=1)
    assert len(monitor.scene.state('footprint').contacts) == count
    return time_taken


def main():
    kernel = 'compiled' if COMPILED else 'in plain Python'
    contacts(10)  # whatever has to be compiled is compiled now
    parts = {
        f'hard shapes {kernel}': table(
            ['shape', 'to take [ms]', 'to decide [ms]', 'to measure [ms]', 'against'],
            [[name, *(f'{value:.1f}' for value in times), against]
             for name, (*times, against) in measure().items()]),
        f'contacts {kernel}': table(['', *(f'{count:,} contacts' for count in _CONTACTS)], [
            [kernel, *(f'{contacts(count):.0f} ms' for count in _CONTACTS)]])}
    for name, part in parts.items():
        replace_part(ROOT / 'docs' / 'reliability.md', name, part)


if __name__ == '__main__':
    main()

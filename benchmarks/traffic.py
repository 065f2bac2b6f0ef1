# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages sent to a node under test and received from it: one footprint and its obstacles."""

import collections
import itertools
import struct
import time
from typing import NamedTuple

import _shared  # noqa: F401
from builders import collection, serialised
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import numpy as np
import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Float64

_FRAME = 'map'
# Bytes up to the end of the stamp.
STAMPED = 12
_VARIANTS = 8
_PAUSE = 50e-6
_AFTERMATH = 0.2
ROBOT = (-0.5, -0.4), (0.9, -0.4), (0.9, 0.4), (-0.5, 0.4)
FOOTPRINT_RATE = 50.0
SET_RATE = 10.0
_TIMEOUT = 60.0


class Form(NamedTuple):
    """How the obstacles of a source are sent: in sets, one polygon a message."""

    source: str
    topic: str
    has_marks: bool = True  # whether an empty polygon ends each set
    has_ids: bool = False
    is_counted: bool = True  # whether a node receives each message once
    is_whole: bool = False  # whether a set is one message


_MARKED = Form('obstacle', 'obstacles')


def head(stamp):
    """Return the beginning of a message, with the stamp, in ns."""
    return struct.pack('<4sII', b'\0\1\0\0', *divmod(stamp, 10**9))


def tail(points, instance=None):
    """Return the rest of a PolygonStamped after the stamp, or of one with an id."""
    return serialised(points, 0, _FRAME, instance)[STAMPED:]


def regular(count, x, y, radius):
    """Return the vertices of a regular polygon."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


def until(condition, step=lambda: time.sleep(_PAUSE)):
    """Repeat a step until a condition holds."""
    end = time.monotonic() + _TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError('the node under test does not answer')
        step()


class Traffic:
    """
    A node that sends footprints and obstacles and awaits the flag.

    The obstacles are shared out among `forms`. The robot is in turns on an obstacle about the
    origin, of one form at a time, and far from all; the others are scattered around, elsewhere in
    each set.
    `footprint_at` takes a stamp in ns and returns the rest of the message after it, whether the
    footprint is on an obstacle, and whether a stay there, or far from all, begins. By the
    monotonic clock, `changes` has when stays began, `received` when flags came, and `times`, if it
    is `timed`, when the node published times to collision.
    """

    def __init__(self, obstacles, vertices, timed=False, forms=(_MARKED,)):
        rng = np.random.default_rng(1)
        self._forms = forms
        # The form whose obstacle the robot meets.
        self._met = 0
        # By variant and by form that is met: the form and the rest of each message of a set.
        self._sets = [[[] for _ in forms] for _ in range(_VARIANTS)]
        centres = rng.uniform(-100.0, 100.0, (obstacles // len(forms), 2))
        # None is near the robot but the first one.
        centres[:, 0] += np.copysign(5.0, centres[:, 0])
        for variant in self._sets:
            moved = centres + rng.uniform(-0.1, 0.1, centres.shape)
            for met, messages in enumerate(variant):
                for form in forms:
                    moved[0] = 0.0 if form is forms[met] else (-500.0, 0.0)
                    outlines = [regular(vertices, x, y, 0.5) for x, y in moved]
                    if form.is_whole:
                        messages.append((form, collection(outlines, 0, _FRAME)[STAMPED:]))
                        continue
                    outlines += [np.empty((0, 2))] * form.has_marks
                    messages += [(form, tail(outline, k if form.has_ids else None))
                                 for k, outline in enumerate(outlines, 1)]
        self._per_set = len(self._sets[0][0])
        footprints = itertools.cycle((tail(np.add(ROBOT, (x, 0.0))), hit, True)
                                     for x, hit in ((0.0, True), (1000.0, False)))
        self.footprint_at = lambda stamp: next(footprints)
        self.changes, self.received, self.times = [], [], []
        self.node = rclpy.create_node('traffic')
        self._footprint = self.node.create_publisher(PolygonStamped, 'footprint', 10)
        self._obstacles = {form: self._new_publisher(form) for form in forms}
        self._flags = self.node.create_subscription(
            Bool, '/footprint_monitor/collision', lambda flag: None, 100)
        self._times = timed and self.node.create_subscription(
            Float64, '/footprint_monitor/footprint/time_to_collision', lambda time: None, 100)
        self._reports = self.node.create_subscription(
            DiagnosticArray, '/diagnostics', lambda report: None, 10)

    def close(self):
        self.node.destroy_node()

    def _new_publisher(self, form):
        kind = PolygonInstanceStamped if form.has_ids else PolygonStamped
        if form.is_whole:
            # Not every environment has it.
            from polygon_msgs.msg import Polygon2DCollection as kind
        return self.node.create_publisher(kind, form.topic, QoSProfile(depth=1000))

    def restart(self):
        """Let the robot meet an obstacle of the next form, whose publisher is replaced."""
        self._met = (self._met + 1) % len(self._forms)
        form = self._forms[self._met]
        self.node.destroy_publisher(self._obstacles[form])
        self._obstacles[form] = self._new_publisher(form)
        until(self._obstacles[form].get_subscription_count)

    def connect(self, nodes=1):
        """Wait until traffic and a number of nodes see each other and a footprint is answered."""
        def is_answered():
            stamp = time.time_ns()
            for form, obstacle in self._sets[0][self._met]:
                self._obstacles[form].publish(head(stamp) + obstacle)
            body, hit, _ = self.footprint_at(stamp)
            self._footprint.publish(head(stamp) + body)
            time.sleep(0.2)
            flags = [flag.data for _, flag in _published(self._flags, Bool)]
            return hit in flags and all(publisher.get_subscription_count() >= nodes
                                        for publisher in (*self._obstacles.values(),
                                                          self._footprint))
        until(is_answered)

    def run(self, seconds, burst=False, rate=SET_RATE):
        """
        Send footprints and `rate` sets of obstacles a second, which are spread or come in a burst.

        Return how many footprints and counted obstacles were sent, and the seconds from before the
        publish() of each footprint that changes the flag to the flag's arrival.
        """
        latencies = []
        unanswered = collections.deque()
        footprints = obstacles = counted = 0
        if self._times:
            # Discard those of the pause since the last run.
            _published(self._times, Float64)
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < seconds + _AFTERMATH:
            for _, flag in _published(self._flags, Bool):
                self.received.append((begun + now, flag.data))
                latencies += _answer(unanswered, flag.data, now)
            if self._times:
                self.times += [(when, seconds.data)
                               for when, seconds in _published(self._times, Float64)]
            if now < seconds and footprints / FOOTPRINT_RATE <= now:
                stamp = time.time_ns()
                body, hit, changes = self.footprint_at(stamp)
                if changes:
                    sent = time.monotonic()
                    unanswered.append((sent - begun, hit))
                    self.changes.append((sent, hit))
                self._footprint.publish(head(stamp) + body)
                footprints += 1
            elif now < seconds and obstacles - burst * (
                    obstacles % self._per_set) <= now * rate * self._per_set:
                number, k = divmod(obstacles, self._per_set)
                if k == 0:
                    beginning = head(time.time_ns())
                form, obstacle = self._sets[number % _VARIANTS][self._met][k]
                self._obstacles[form].publish(beginning + obstacle)
                obstacles += 1
                counted += form.is_counted
            else:
                time.sleep(_PAUSE)
        return footprints, counted, latencies

    def send(self, seconds):
        """Send as `run` does; return how many messages."""
        return sum(self.run(seconds)[:2])

    def taken(self):
        """Return how many counted obstacles the node has received, once two new reports agree."""
        entries = [f'{form.source}: received' for form in self._forms if form.is_counted]
        counts = []
        _published(self._reports, DiagnosticArray)  # older ones

        def is_steady():
            for _, report in _published(self._reports, DiagnosticArray):
                values = {value.key: value.value for value in report.status[0].values}
                counts.append(sum(int(values.get(entry, 0)) for entry in entries))
            return len(counts) > 1 and counts[-1] == counts[-2]
        until(is_steady, lambda: time.sleep(0.1))
        return counts[-1]


def _published(subscription, message_type):
    """Return when messages that have arrived were published, by the monotonic clock, and these."""
    found = []
    with subscription.handle:
        while taken := subscription.handle.take_message(message_type, True):
            age = (time.time_ns() - taken[1]['source_timestamp']) / 1e9
            found.append((time.monotonic() - age, deserialize_message(taken[0], message_type)))
    return found


def _answer(unanswered, flag, now):
    """Return the latency of the footprint that a flag answers: none if the flag is repeated."""
    while len(unanswered) > 1 and unanswered[0][1] != flag:
        unanswered.popleft()  # superseded before the node processed it
    if unanswered and unanswered[0][1] == flag:
        return [now - unanswered.popleft()[0]]
    return []

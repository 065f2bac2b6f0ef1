# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Messages sent to a node under test and received from it: one footprint and its obstacles."""

import collections
import itertools
import struct
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped
import numpy as np
import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from std_msgs.msg import Bool, Float64

_FRAME = 'map'
_VARIANTS = 8
_PAUSE = 50e-6
_AFTERMATH = 0.2
ROBOT = (-0.5, -0.4), (0.9, -0.4), (0.9, 0.4), (-0.5, 0.4)
FOOTPRINT_RATE = 50.0
SET_RATE = 10.0
_TIMEOUT = 60.0
# The entry of /diagnostics with the number of obstacles that a node has received.
RECEIVED = 'obstacle: received'


def _head(stamp):
    """Return the beginning of a PolygonStamped, with the stamp, in ns."""
    return struct.pack('<4sII', b'\0\1\0\0', *divmod(stamp, 10**9))


def tail(points):
    """Return the rest of a PolygonStamped after the stamp, for (n, 2) points."""
    spatial = np.pad(points, ((0, 0), (0, 1))).astype(np.float32)
    return struct.pack('<I4sI', 4, _FRAME.encode() + b'\0', len(points)) + spatial.tobytes()


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

    The robot is in turns on the first obstacle, which stays about the origin, and far from all;
    the others are scattered around, elsewhere in each set. An empty polygon ends each set.
    `footprint_at` takes a stamp in ns and returns the rest of the message after it, whether the
    footprint is on an obstacle, and whether a stay there, or far from all, begins. By the
    monotonic clock, `changes` has when stays began, `received` when flags came, and `times`, if it
    is `timed`, when the node published times to collision.
    """

    def __init__(self, obstacles, vertices, timed=False):
        rng = np.random.default_rng(1)
        centres = rng.uniform(-100.0, 100.0, (obstacles, 2))
        centres[0] = 0.0
        self._per_set = obstacles + 1
        self._sets = []
        for _ in range(_VARIANTS):
            moved = centres + rng.uniform(-0.1, 0.1, centres.shape)
            outlines = [regular(vertices, x, y, 0.5) for x, y in moved]
            self._sets.append([tail(outline) for outline in (*outlines, np.empty((0, 2)))])
        footprints = itertools.cycle((tail(np.add(ROBOT, (x, 0.0))), hit, True)
                                     for x, hit in ((0.0, True), (1000.0, False)))
        self.footprint_at = lambda stamp: next(footprints)
        self.changes, self.received, self.times = [], [], []
        self.node = rclpy.create_node('traffic')
        self._footprint = self.node.create_publisher(PolygonStamped, 'footprint', 10)
        self._obstacle = self._new_publisher()
        self._flags = self.node.create_subscription(
            Bool, '/footprint_monitor/collision', lambda flag: None, 100)
        self._times = timed and self.node.create_subscription(
            Float64, '/footprint_monitor/footprint/time_to_collision', lambda time: None, 100)

    def close(self):
        self.node.destroy_node()

    def _new_publisher(self):
        return self.node.create_publisher(PolygonStamped, 'obstacles', QoSProfile(depth=1000))

    def restart(self):
        """Replace the publisher of obstacles by another one."""
        self.node.destroy_publisher(self._obstacle)
        self._obstacle = self._new_publisher()
        until(self._obstacle.get_subscription_count)

    def connect(self, nodes=1):
        """Wait until traffic and a number of nodes see each other and a footprint is answered."""
        def is_answered():
            stamp = time.time_ns()
            for obstacle in self._sets[0]:
                self._obstacle.publish(_head(stamp) + obstacle)
            body, hit, _ = self.footprint_at(stamp)
            self._footprint.publish(_head(stamp) + body)
            time.sleep(0.2)
            flags = [flag for _, flag in _published(self._flags, Bool)]
            return hit in flags and all(publisher.get_subscription_count() >= nodes
                                        for publisher in (self._obstacle, self._footprint))
        until(is_answered)

    def run(self, seconds, burst=False, rate=SET_RATE):
        """
        Send footprints and `rate` sets of obstacles a second, which are spread or come in a burst.

        Return how many footprints and obstacles were sent, and the seconds from before the
        publish() of each footprint that changes the flag to the flag's arrival.
        """
        latencies = []
        unanswered = collections.deque()
        footprints = obstacles = 0
        if self._times:
            # Discard those of the pause since the last run.
            _published(self._times, Float64)
        begun = time.monotonic()
        while (now := time.monotonic() - begun) < seconds + _AFTERMATH:
            for _, flag in _published(self._flags, Bool):
                self.received.append((begun + now, flag))
                latencies += _answer(unanswered, flag, now)
            if self._times:
                self.times += _published(self._times, Float64)
            if now < seconds and footprints / FOOTPRINT_RATE <= now:
                stamp = time.time_ns()
                body, hit, changes = self.footprint_at(stamp)
                if changes:
                    sent = time.monotonic()
                    unanswered.append((sent - begun, hit))
                    self.changes.append((sent, hit))
                self._footprint.publish(_head(stamp) + body)
                footprints += 1
            elif now < seconds and obstacles - burst * (
                    obstacles % self._per_set) <= now * rate * self._per_set:
                number, k = divmod(obstacles, self._per_set)
                if k == 0:
                    head = _head(time.time_ns())
                self._obstacle.publish(head + self._sets[number % _VARIANTS][k])
                obstacles += 1
            else:
                time.sleep(_PAUSE)
        return footprints, obstacles, latencies

    def send(self, seconds):
        """Send as `run` does; return how many messages."""
        return sum(self.run(seconds)[:2])


def _published(subscription, message_type):
    """Return the values that have arrived, and when they were published by the monotonic clock."""
    values = []
    with subscription.handle:
        while taken := subscription.handle.take_message(message_type, True):
            age = (time.time_ns() - taken[1]['source_timestamp']) / 1e9
            values.append((time.monotonic() - age,
                           deserialize_message(taken[0], message_type).data))
    return values


def _answer(unanswered, flag, now):
    """Return the latency of the footprint that a flag answers: none if the flag is repeated."""
    while len(unanswered) > 1 and unanswered[0][1] != flag:
        unanswered.popleft()  # superseded before the node processed it
    if unanswered and unanswered[0][1] == flag:
        return [now - unanswered.popleft()[0]]
    return []


class Reader:
    """Reads on /diagnostics how many obstacles the node under test has received."""

    def __init__(self):
        self._node = rclpy.create_node('counts')
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._receive, 10)
        self._counts = []

    def _receive(self, message):
        values = {value.key: value.value for value in message.status[0].values}
        self._counts.append(int(values.get(RECEIVED, 0)))

    def steady(self):
        """Return the count once two new reports agree, so that all messages are processed."""
        rclpy.spin_once(self._node, timeout_sec=0.0)
        self._counts.clear()
        until(lambda: len(self._counts) > 1 and self._counts[-1] == self._counts[-2],
              lambda: rclpy.spin_once(self._node, timeout_sec=0.1))
        return self._counts[-1]

    def close(self):
        self._node.destroy_node()

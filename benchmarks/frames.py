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

"""
The cost of frames: /tf, and a message in another frame.

Of two monitors, which receive the same messages at once and share a core, one ignores the bytes of
/tf that it receives: the floor. Run as a program, this is such a monitor. Messages are passed in
serialised form, so another type replaces TFMessage where tf2_msgs is missing.
"""

import contextlib
import statistics
import sys
import time
import types

import _shared  # noqa: F401
from builders import box, SECOND, serialised, transforms
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import node
import numpy as np
import rclpy
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF
from std_msgs.msg import Bool
from traffic import until


RATE = 100
SIZES = 1, 5, 20
ROBOTS = 20
_PARAMETERS = {'frame_id': 'odom', 'footprint.timeout': '0.0', 'obstacle.timeout': '0.0',
               'obstacle.type': 'polygon_instance'}
_OUTLINE = {'footprint.points': '[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]',
            'footprint.frame_id': 'base'}

node.NODES |= {'frames': [__file__], 'frames floor': [__file__, '--floor']}


def message(stamp, children, x=0.0):
    """Return a serialised TFMessage with some children at x."""
    return transforms(*(('odom', child, stamp, x, 0.0) for child in children))


def polygon(stamp, frame_id, x, instance):
    """Write the message of a square that is an obstacle."""
    return serialised(box(x), stamp, frame_id, instance)


class Publisher:
    """Publishes /tf, and receives the flags of one node."""

    def __init__(self, readers):
        self._node = rclpy.create_node('frames')
        self.flags = []
        self._node.create_subscription(Bool, '/footprint_monitor/footprint/collision',
                                       lambda flag: self.flags.append(flag.data), 100)
        self._publisher = self._node.create_publisher(PolygonStamped, '/tf', 100)
        self._obstacles = self._node.create_publisher(PolygonInstanceStamped, '/obstacles', 10)
        self.until(lambda: self.flags and all(
            publisher.get_subscription_count() == readers
            for publisher in (self._publisher, self._obstacles)))

    def until(self, condition):
        """Receive flags until a condition holds."""
        until(condition, lambda: rclpy.spin_once(self._node, timeout_sec=0.01))

    def publish(self, children, x=0.0):
        self._publisher.publish(message(time.time_ns(), children, x))

    def clear(self):
        """Publish a map of one obstacle, and a robot far from it until its flag is clear."""
        self._obstacles.publish(polygon(time.time_ns(), 'odom', -5.0, 0))

        def is_clear():
            self.publish(['base'], 9.0)
            return not self.flags[-1]
        self.until(is_clear)

    def run(self, groups, seconds):
        """Publish a message for each group of children RATE times a second; return how many."""
        begin = time.monotonic()
        for k in range(round(seconds * RATE)):
            for i, children in enumerate(groups):
                due = begin + (k + i / len(groups)) / RATE
                time.sleep(max(due - time.monotonic(), 0.0))
                self.publish(children)
        return round(seconds * RATE) * len(groups)

    def close(self):
        self._node.destroy_node()


def together(groups, seconds, repeats, **parameters):
    """Return processor time in us a message of the monitor and of the floor, and of a core."""
    def start(stack, nodes):
        publisher = stack.enter_context(contextlib.closing(Publisher(nodes)))
        return lambda seconds: publisher.run(groups, seconds)
    us, floor, ratio = node.together([
        ('frames', {**_PARAMETERS, **parameters}), ('frames floor', _PARAMETERS)],
        start, seconds, repeats)
    return {'monitor_us': us, 'floor_us': floor, 'ratio': ratio,
            'core': us * RATE * len(groups) / 1e6}


def latency(repeats):
    """Return ms from publishing a transform to the flag that follows."""
    with node.running('frames', {**_PARAMETERS, **_OUTLINE}), \
            contextlib.closing(Publisher(1)) as publisher:
        raised = False
        times = []
        publisher.clear()
        for _ in range(repeats):
            raised = not raised
            time.sleep(0.03)
            begin = time.perf_counter()
            publisher.publish(['base'], -5.0 if raised else 9.0)
            publisher.until(lambda: publisher.flags[-1] == raised)
            times.append(1e3 * (time.perf_counter() - begin))
    return {'p50_ms': float(np.percentile(times, 50)), 'p99_ms': float(np.percentile(times, 99))}


def in_other_frame(repeats, count=5000):
    """Return us a message of the fixed frame, and of another one whose map is cached."""
    settings = Settings(
        frame_id='odom', footprints=(FootprintSettings('robot', TF, timeout=0.0),),
        obstacles=(ObstacleSettings('seen', '/seen', type='polygon_instance', timeout=0.0),))
    monitor = Monitor(settings, transforms=True)
    now = 1000 * SECOND
    for k in range(10):
        now += SECOND // 100
        monitor.receive_transforms(TF, message(now, ['base'], k / 8), now)
    seen = {frame: polygon(now - SECOND // 200, frame, 20.0, 1) for frame in ('odom', 'base')}
    costs = {frame: [] for frame in seen}
    for _ in range(repeats + 1):
        for frame, data in seen.items():
            begin = time.process_time()
            for _ in range(count):
                monitor.receive('seen', data, now)
            costs[frame].append(1e6 * (time.process_time() - begin) / count)
    if monitor.rejected or monitor.waiting.counts():
        raise RuntimeError('the messages were not taken')
    return {'fixed_us': statistics.median(costs['odom'][1:]),
            'more_us': statistics.median(other - one for one, other in zip(
                costs['odom'][1:], costs['base'][1:]))}


def measure(seconds, repeats):
    """Return all figures."""
    children = [f'frame{k}' for k in range(ROBOTS)]
    return {
        'sizes': [{'transforms': size, **together([['base', *children[1:size]]], seconds, repeats)}
                  for size in SIZES],
        'outline': together([['base']], seconds, repeats, **_OUTLINE),
        'robots': together([[child] for child in children], seconds, repeats),
        'other_frame': in_other_frame(5 * repeats),
        'latency': latency(100 * repeats)}


def run_monitor():
    """Run the monitor; with --floor one that ignores transforms."""
    messages = types.ModuleType('tf2_msgs.msg')
    messages.TFMessage = PolygonStamped
    sys.modules.update({'tf2_msgs': types.ModuleType('tf2_msgs'), 'tf2_msgs.msg': messages})
    from sat_collision.node.__main__ import main
    arguments = sys.argv[1:]
    if arguments[0] == '--floor':
        del arguments[0]
        Monitor.receive_transforms = lambda *_: ()
    return main(arguments)


if __name__ == '__main__':
    sys.exit(run_monitor())

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Nodes to compare the monitor with: one that only receives and publishes, one that uses shapely.

`floor` has raw subscriptions, callbacks that look at a byte at most, and the same publishes, in
rclpy's events executor; `floor/floor.cpp` is the same in C++. `shapely` has typed messages, one
flag, and checks only intersection. `frames` is the monitor itself with a stand-in for TFMessage,
as tf2_msgs may be missing and only bytes are passed; `frames_floor` is the same, but ignores the
bytes of /tf that it receives.
"""

import sys
import time
import types

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sat_collision.node.footprint_monitor import flag_qos
from sat_collision.node.signals import end_on_signals, Signalled
import shapely
from std_msgs.msg import Bool

_SIGN_OF_FIRST_X = 27
_TICK = 0.1


class Peer(Node):
    """Counts its obstacles, and reports once a second how many there were, as the monitor does."""

    def __init__(self):
        super().__init__('footprint_monitor')
        self.received = 0
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._next_report = 0.0

    def report(self):
        if time.monotonic() >= self._next_report:
            self._next_report = time.monotonic() + 1.0
            count = KeyValue(key='obstacle: received', value=str(self.received))
            self._diagnostics.publish(
                DiagnosticArray(status=[DiagnosticStatus(values=[count])]))


class Floor(Peer):
    """Answers a footprint by the sign of its first x, with as many flags as the monitor has."""

    obstacles = PolygonStamped

    def __init__(self):
        super().__init__()
        self._flags = [serialize_message(Bool(data=raised)) for raised in (False, True)]
        self._flag = self._flags[0]
        # Not _publishers, which is rclpy's own list of all that a node has.
        self._flag_publishers = [
            self.create_publisher(Bool, topic, flag_qos())
            for topic in ('~/collision', '~/footprint/collision')]
        self.create_subscription(PolygonStamped, 'footprint', self._answer, 1, raw=True)
        self.create_subscription(self.obstacles, 'obstacles', self._count,
                                 QoSProfile(depth=1000), raw=True)
        self.create_timer(_TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _answer(self, data):
        self._flag = self._flags[data[_SIGN_OF_FIRST_X] > 127]
        self._publish()

    def _count(self, data):
        self.received += 1

    def _tick(self):
        self._publish()
        self.report()

    def _publish(self):
        for publisher in self._flag_publishers:
            publisher.publish(self._flag)


class Shapely(Peer):
    """
    Checks each footprint against all obstacles in one vectorised call.

    Obstacles of one stamp are a set, which replaces the set before.
    """

    def __init__(self):
        super().__init__()
        self._publisher = self.create_publisher(Bool, '~/collision', 10)
        self._before, self._obstacles = [], []
        self._stamp = None
        self.create_timer(1.0, self.report)
        self.create_subscription(PolygonStamped, 'footprint', self._check, 1)
        self.create_subscription(PolygonStamped, 'obstacles', self._add, 1000)

    def _check(self, message):
        obstacles = self._obstacles + self._before[len(self._obstacles):]
        hit = bool(obstacles) and bool(shapely.intersects(_polygon(message), obstacles).any())
        self._publisher.publish(Bool(data=hit))

    def _add(self, message):
        self.received += 1
        if message.header.stamp != self._stamp:
            self._stamp = message.header.stamp
            self._before, self._obstacles = self._obstacles, []
        self._obstacles.append(_polygon(message))


def _polygon(message):
    return shapely.Polygon([(point.x, point.y) for point in message.polygon.points])


def run_floor(takes_collections=False):
    """Run the floor until a signal is received."""
    if takes_collections:
        from polygon_msgs.msg import Polygon2DCollection
        Floor.obstacles = Polygon2DCollection
    end_on_signals()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Floor()
    ended = Signalled()
    executor = EventsExecutor(context=node.context)
    executor.add_node(node)
    while not ended():
        # Waiting for a future that is never done costs less a message than `spin_once`.
        executor.spin_until_future_complete(Future(), timeout_sec=0.2)
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()


def run_shapely():
    """Run the node of shapely as a plain program does."""
    rclpy.init()
    rclpy.spin(Shapely())


def run_monitor(ignores_transforms=False):
    """Run the monitor with the arguments of this program."""
    messages = types.ModuleType('tf2_msgs.msg')
    messages.TFMessage = PolygonStamped
    sys.modules.update({'tf2_msgs': types.ModuleType('tf2_msgs'), 'tf2_msgs.msg': messages})
    from sat_collision.monitor import Monitor
    from sat_collision.node.__main__ import main
    if ignores_transforms:
        Monitor.receive_transforms = lambda *_: ()
    return main(sys.argv[2:])


if __name__ == '__main__':
    sys.exit({'floor': run_floor, 'whole_floor': lambda: run_floor(True), 'shapely': run_shapely,
              'frames': run_monitor, 'frames_floor': lambda: run_monitor(True)}[sys.argv[1]]())

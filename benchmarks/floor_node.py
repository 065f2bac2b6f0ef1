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
What no node in Python can do without: the same publishes, and nothing else.

EventsExecutor, raw subscriptions, callbacks that look at a byte at most.
"""

import sys

import counts
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sat_collision.node import executors
from std_msgs.msg import Bool

_SIGN_OF_FIRST_X = 27


class Floor(Node):
    """Answers a footprint by the sign of its first x, with as many flags as the monitor has."""

    def __init__(self):
        super().__init__('footprint_monitor')
        self._flags = [serialize_message(Bool(data=raised)) for raised in (False, True)]
        self._flag = self._flags[0]
        self._received = 0
        self._publishers = [self.create_publisher(Bool, topic, 10)
                            for topic in ('~/footprint/collision', '~/collision')]
        self.create_subscription(PolygonStamped, 'footprint', self._answer, 1, raw=True)
        self.create_subscription(PolygonStamped, 'obstacles', self._count,
                                 QoSProfile(depth=1000), raw=True)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(0.1, self._publish, clock=steady)
        self._counts = counts.Counts(self)
        self.create_timer(1.0, lambda: self._counts.publish(self._received), clock=steady)

    def _answer(self, data):
        self._flag = self._flags[data[_SIGN_OF_FIRST_X] > 127]
        self._publish()

    def _count(self, data):
        self._received += 1

    def _publish(self):
        for publisher in self._publishers:
            publisher.publish(self._flag)


def main():
    executors.interrupt_on_signals()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Floor()
    executor = executors.create(executors.available(executors.EVENTS), node.context)
    executor.add_node(node)
    executors.spin_until_signal(executor)
    executor.remove_node(node)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    sys.exit(main())

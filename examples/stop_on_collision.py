# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Passes cmd_vel_nav on to cmd_vel while the flag says clear, otherwise stops the robot."""

from contextlib import suppress
import time

from geometry_msgs.msg import Twist
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Bool


class StopOnCollision(Node):
    """Lets the robot move only while the latest flag is false and younger than 0.3 s."""

    def __init__(self, **options):
        super().__init__('stop_on_collision', **options)
        self.clear_until = 0.0
        self.command = self.create_publisher(Twist, 'cmd_vel', 1)
        self.create_subscription(Bool, 'footprint_monitor/collision', self.note, 1)
        self.create_subscription(Twist, 'cmd_vel_nav', self.drive, 1)
        self.create_timer(0.05, self.watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def note(self, flag):
        """Note a flag; that none has come for 0.3 s counts as a raised one."""
        self.clear_until = 0.0 if flag.data else time.monotonic() + 0.3

    def drive(self, twist):
        """Pass a command on."""
        if time.monotonic() < self.clear_until:
            self.command.publish(twist)

    def watch(self):
        """Stop the robot, whether there are commands or not."""
        if time.monotonic() >= self.clear_until:
            self.command.publish(Twist())


if __name__ == '__main__':
    rclpy.init()
    node = StopOnCollision()
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()

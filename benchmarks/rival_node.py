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
Shapely in a callback: typed messages, one flag, nothing checked but intersection.

Obstacles of one stamp are a set, which replaces the set before. Each footprint is checked against
all obstacles in one vectorised call.
"""

import sys

import counts
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
import shapely
from std_msgs.msg import Bool


class Rival(Node):
    """Checks footprints against obstacles."""

    def __init__(self):
        super().__init__('footprint_monitor')
        self._publisher = self.create_publisher(Bool, '~/collision', 10)
        self._footprint = None
        self._before = []
        self._obstacles = []
        self._stamp = None
        self._received = 0
        self._counts = counts.Counts(self)
        self.create_timer(1.0, lambda: self._counts.publish(self._received))
        self.create_subscription(PolygonStamped, 'footprint', self._check, 1)
        self.create_subscription(PolygonStamped, 'obstacles', self._add, 1000)

    def _check(self, message):
        footprint = to_polygon(message)
        obstacles = self._obstacles + self._before[len(self._obstacles):]
        hit = bool(obstacles) and bool(shapely.intersects(footprint, obstacles).any())
        self._publisher.publish(Bool(data=hit))

    def _add(self, message):
        self._received += 1
        stamp = message.header.stamp
        if stamp != self._stamp:
            self._stamp = stamp
            self._before = self._obstacles
            self._obstacles = []
        self._obstacles.append(to_polygon(message))


def to_polygon(message):
    return shapely.Polygon([(point.x, point.y) for point in message.polygon.points])


def main():
    rclpy.init()
    try:
        rclpy.spin(Rival())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == '__main__':
    sys.exit(main())

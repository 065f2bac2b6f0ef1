# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Publish something to try the node with: a robot that drives into a post and out again.

Its topics are those of a node without parameters: `footprint`, and `obstacles`, where an empty
polygon ends each set.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import count
import math
import sys
import time

from sat_collision.extras import missing

_PERIOD = 0.05
_ROBOT = (-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3)
_POST = (1.0, -0.1), (1.2, -0.1), (1.2, 0.1), (1.0, 0.1)


def main() -> int:
    """Publish until the process is interrupted; return the exit status."""
    try:
        from geometry_msgs.msg import Point32, PolygonStamped
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ModuleNotFoundError as error:
        print(f'cannot publish: {missing(error)}', file=sys.stderr)
        return 1
    # Signals end the loop themselves: rclpy would end the context under a publisher.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('robot_and_post')
    footprints, obstacles = (node.create_publisher(PolygonStamped, topic, 10)
                             for topic in ('footprint', 'obstacles'))
    with suppress(KeyboardInterrupt):
        for step in count():
            x = 0.5 - 0.5 * math.cos(step * _PERIOD)
            for publisher, outline, shift in ((footprints, _ROBOT, x), (obstacles, _POST, 0.0),
                                              (obstacles, (), 0.0)):
                message = PolygonStamped()
                message.header.stamp = node.get_clock().now().to_msg()
                message.header.frame_id = 'map'
                message.polygon.points = [Point32(x=a + shift, y=b) for a, b in outline]
                publisher.publish(message)
            time.sleep(_PERIOD)
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())

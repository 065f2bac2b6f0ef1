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
polygon ends each set. What the node says of the robot is printed.
"""

from __future__ import annotations

import argparse
import math
import signal
import sys
import time

from sat_collision.extras import missing

_PERIOD = 0.05
_ROBOT = (-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3)
_POST = (1.0, -0.1), (1.2, -0.1), (1.2, 0.1), (1.0, 0.1)


def main() -> int:
    """Publish until a signal arrives; return the exit status."""
    # Arguments of ROS are for rclpy.
    argparse.ArgumentParser('python -m sat_collision.demo.publish',
                            description=__doc__).parse_known_args()
    try:
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import Point32, PolygonStamped
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    except ModuleNotFoundError as error:
        print(f'cannot publish: {missing(error)}', file=sys.stderr)
        return 1
    # Signals end the loop below: rclpy would end the context under a publisher.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('robot_and_post')
    footprints, obstacles = (node.create_publisher(PolygonStamped, topic, 10)
                             for topic in ('footprint', 'obstacles'))
    start = time.monotonic()
    said = ''
    has_ended = False

    def publish() -> None:
        x = 0.5 - 0.5 * math.cos(time.monotonic() - start)
        for publisher, outline, shift in ((footprints, _ROBOT, x), (obstacles, _POST, 0.0),
                                          (obstacles, (), 0.0)):
            message = PolygonStamped()
            message.header.stamp = node.get_clock().now().to_msg()
            message.header.frame_id = 'map'
            message.polygon.points = [Point32(x=a + shift, y=b) for a, b in outline]
            publisher.publish(message)

    def tell(states: DiagnosticArray) -> None:
        nonlocal said
        if (now := states.status[0].message) != said:
            said = now
            print(f'/footprint_monitor: {now}', flush=True)

    def end(*_: object) -> None:
        nonlocal has_ended
        has_ended = True

    node.create_timer(_PERIOD, publish)
    node.create_subscription(DiagnosticArray, 'footprint_monitor/state', tell, 10)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    print('publishing /footprint, of a robot, and /obstacles, of a post; the node says of the '
          'robot:', flush=True)
    while not has_ended:
        rclpy.spin_once(node)
    rclpy.shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())

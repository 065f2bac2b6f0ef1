# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Start an installed footprint_monitor, publish a touching pair, and await the raised flag."""

import os
import subprocess
import sys
import time

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)

from geometry_msgs.msg import Point32, PolygonStamped  # noqa: E402, I100
import rclpy  # noqa: E402
from std_msgs.msg import Bool  # noqa: E402


def square(node, x):
    message = PolygonStamped()
    message.header.frame_id = 'map'
    message.header.stamp = node.get_clock().now().to_msg()
    message.polygon.points = [Point32(x=x + dx, y=dy)
                              for dx, dy in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))]
    return message


def main():
    monitor = subprocess.Popen([sys.argv[1], '--ros-args', '-p', 'unknown_is_collision:=false'])
    rclpy.init()
    node = rclpy.create_node('pair')
    flags = []
    node.create_subscription(Bool, '/footprint_monitor/collision',
                             lambda flag: flags.append(flag.data), 10)
    topics = {name: node.create_publisher(PolygonStamped, name, 10)
              for name in ('footprint', 'obstacles')}
    deadline = time.monotonic() + 120.0
    while True not in flags and time.monotonic() < deadline and monitor.poll() is None:
        topics['footprint'].publish(square(node, 0.0))
        topics['obstacles'].publish(square(node, 1.0))
        rclpy.spin_once(node, timeout_sec=0.1)
    rclpy.shutdown()
    monitor.terminate()
    status = monitor.wait(timeout=30)
    print(f'flag raised: {True in flags}; node ended with status {status}')
    return 0 if True in flags and status == 0 else 1


if __name__ == '__main__':
    sys.exit(main())

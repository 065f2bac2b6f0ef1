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

"""How many obstacles a node under test has received, reported on /diagnostics once a second."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import rclpy

_KEY = 'obstacle: received'
_PATIENCE = 30.0


class Counts:
    """Reports the count as the monitor does, for nodes that have nothing else to report."""

    def __init__(self, node):
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)

    def publish(self, count):
        self._publisher.publish(DiagnosticArray(status=[
            DiagnosticStatus(values=[KeyValue(key=_KEY, value=str(count))])]))


class Reader:
    """Reads the count of the node under test."""

    def __init__(self):
        self._node = rclpy.create_node('counts')
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._hear, 10)
        self._heard = []

    def _hear(self, message):
        values = {value.key: value.value for value in message.status[0].values}
        self._heard.append(int(values.get(_KEY, 0)))

    def steady(self):
        """Return the count once two reports from now on agree: all that was sent is dealt with."""
        rclpy.spin_once(self._node, timeout_sec=0.0)
        self._heard.clear()
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            rclpy.spin_once(self._node, timeout_sec=0.1)
            if len(self._heard) > 1 and self._heard[-1] == self._heard[-2]:
                return self._heard[-1]
        raise TimeoutError('no steady count from the node under test')

    def close(self):
        self._node.destroy_node()

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A subscriber of a monitor's flag, and the processes that it watches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
from pathlib import Path
import subprocess
import threading
import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool

ROOT = Path(__file__).resolve().parents[2]
# README's rule for subscribers: without a flag for this time, it counts as raised, in s.
TOO_OLD = 0.3
_TIMEOUT = 120.0


class Witness:
    """
    A node that receives flags in a thread of its own, and processes that end with it.

    `flags` has when each flag came, by `time_of`, and whether it is raised.
    """

    def __init__(self, domain: int, qos: QoSProfile | int, **options: Any) -> None:
        self.domain = domain
        self.flags: list[tuple[float, bool]] = []
        self._processes: list[subprocess.Popen[bytes]] = []
        self._context = rclpy.Context()
        self._context.init(domain_id=domain)
        self.node = rclpy.create_node('witness', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.node.create_subscription(
            Bool, '/footprint_monitor/collision', self._receive, qos, **options)
        self._is_open = True
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def time_of(self, info: dict[str, int]) -> float:
        """Return when a message was published, since this process may be late."""
        return info['source_timestamp'] / 1e9

    def run(self, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Run a process until all is closed."""
        self._processes.append(subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, 'ROS_DOMAIN_ID': str(self.domain)}))
        return self._processes[-1]

    def until(self, condition: Callable[[], object], timeout: float = _TIMEOUT) -> float:
        """Wait for a condition, and return for how long; fail if it never holds."""
        begun = time.monotonic()
        while not condition():
            if time.monotonic() - begun > timeout:
                raise TimeoutError('what was awaited did not happen')
            time.sleep(0.002)
        return time.monotonic() - begun

    def close(self) -> None:
        """
        Stop all threads and processes.

        The node leaves first: Fast DDS 2.14.5 ends a process whose participant leaves within
        about a second after one that it shares memory with was killed while sending.
        """
        self._is_open = False
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.shutdown()
        for process in self._processes:
            process.kill()
            process.wait()

    def _spin(self) -> None:
        while self._is_open:
            self._executor.spin_once(timeout_sec=0.1)

    def _receive(self, flag: Bool, info: dict[str, int]) -> None:
        self.flags.append((self.time_of(info), flag.data))

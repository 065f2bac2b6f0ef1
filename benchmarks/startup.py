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

"""Start-up: from the start of the process to the arrival of the first flag."""

import os
import subprocess
import sys
import tempfile
import time

from node import running
import numpy as np
import rclpy
from std_msgs.msg import Bool

_PATIENCE = 300.0


def measure(repeats):
    """Return seconds to the first flag: kernels to compile, kernels cached, and of the floor."""
    with tempfile.TemporaryDirectory() as cache:
        cold = _first_flag('monitor', NUMBA_CACHE_DIR=cache)
        subprocess.run([sys.executable, '-m', 'sat_collision.replay.kernels'], check=True,
                       stdout=subprocess.DEVNULL, env={**os.environ, 'NUMBA_CACHE_DIR': cache})
        warm, floor = [], []
        for _ in range(repeats):
            warm.append(_first_flag('monitor', NUMBA_CACHE_DIR=cache))
            floor.append(_first_flag('floor'))
    return {'cold_s': cold, 'warm_s': float(np.median(warm)), 'floor_s': float(np.median(floor))}


def _first_flag(kind, **environment):
    node = rclpy.create_node('listener')
    flags = []
    node.create_subscription(Bool, '/footprint_monitor/collision', flags.append, 10)
    start = time.monotonic()
    with running(kind, **environment):
        while not flags and time.monotonic() < start + _PATIENCE:
            rclpy.spin_once(node, timeout_sec=0.1)
        seconds = time.monotonic() - start
    node.destroy_node()
    if not flags:
        raise TimeoutError(f'no flag from {kind}')
    return seconds

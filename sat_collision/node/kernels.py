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

"""Kernels made ready at the start, so that no message waits for a compilation."""

from __future__ import annotations

import subprocess
import sys
import time

from rclpy.impl.rcutils_logger import RcutilsLogger
from sat_collision.geometry import warm_up
from sat_collision.geometry.jit import cache_problem, KERNEL


class Kernels:
    """
    Has ready, before the first flag, what messages of convex bodies need, and then the rest.

    The first start after an installation compiles them. A second process takes part in that; what
    it has compiled is loaded from disk here.

    Parameters
    ----------
    logger : rclpy.impl.rcutils_logger.RcutilsLogger

    """

    def __init__(self, logger: RcutilsLogger) -> None:
        self._logger = logger
        self._begun = time.monotonic()
        self._other: subprocess.Popen[str] | None = None
        if warm_up.is_prepared():
            logger.info(f'preparing kernels ({KERNEL})')
        else:
            logger.info(f'preparing kernels ({KERNEL}); '
                        'the first start after an installation compiles them')
            self._other = subprocess.Popen([sys.executable, '-m', warm_up.__name__],
                                           stdout=subprocess.PIPE,
                                           stderr=subprocess.DEVNULL, text=True)
        warm_up.prepare_contacts()
        if self._other and self._other.stdout:
            self._other.stdout.readline()
        warm_up.prepare_packing()
        if not self._other:
            self._finish()

    def load_rest(self) -> None:
        """Load what the second process has compiled, once it is done; called at each tick."""
        if self._other and self._other.poll() is not None:
            self.close()
            self._finish()

    def close(self) -> None:
        """End the second process, if it has not ended yet."""
        if self._other:
            self._other.terminate()
            self._other.communicate()
            self._other = None

    def _finish(self) -> None:
        warm_up.prepare_rest()
        self._logger.info(f'kernels ({KERNEL}) ready after {time.monotonic() - self._begun:.1f} s')
        if problem := cache_problem():
            self._logger.warning(problem)

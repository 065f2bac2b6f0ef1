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
"""What is compiled, or loaded, when a node starts: said, and counted in seconds."""

from __future__ import annotations

from collections.abc import Callable
import subprocess
import sys
import time

from sat_collision.geometry import warm_up
from sat_collision.geometry.compilation import kernel_problem, say_nothing
from sat_collision.geometry.jit import KERNEL


class Preparation:
    """
    Compiles or loads the kernels of node and replay; says so, and warns of what is wrong.

    Once it is made all is ready that decides. What measures distances is ready then, too, unless
    this is the first start after an installation, which compiles: a second process takes half of
    what decides, then goes on with what measures. That is loaded from disk here once it is done.
    The second process ends with this one, however this one ends.

    Parameters
    ----------
    say, warn : callable
        Take words.

    """

    def __init__(self, say: Callable[[str], object], warn: Callable[[str], object]) -> None:
        self._say = say
        self._begun = time.monotonic()
        self._other: subprocess.Popen[bytes] | None = None
        say_nothing()
        if warm_up.is_prepared() or kernel_problem():
            say(f'preparing kernels ({KERNEL})')
        else:
            say(f'preparing kernels ({KERNEL}); the first start after an installation compiles '
                'them')
            self._other = subprocess.Popen(
                [sys.executable, '-m', warm_up.__name__], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        warm_up.prepare_contacts()
        warm_up.prepare_parts()
        if self._other and self._other.stdout:
            self._other.stdout.readline()
        warm_up.prepare_packing()
        if not self._other:
            warm_up.prepare_distances()
        say(f'kernels ({KERNEL}) ready after {self._seconds()}'
            + ('; distances are measured later' if self._other else ''))
        if problem := kernel_problem():
            warn(problem)

    def is_complete(self) -> bool:
        """Return whether what measures distances is ready; to be called again and again."""
        if self._other and self._other.poll() is not None:
            self.complete()
        return not self._other

    def complete(self) -> None:
        """Have what measures distances ready, however long that takes."""
        if self._other:
            self._other.wait()
            self._other.communicate()
            self._other = None
            warm_up.prepare_distances()
            self._say(f'distances are measured after {self._seconds()}')

    def _seconds(self) -> str:
        return f'{time.monotonic() - self._begun:.1f} s'

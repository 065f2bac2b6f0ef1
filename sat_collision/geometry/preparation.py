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
"""All kernels of a node made ready at its start, so that no message waits for a compilation."""

from __future__ import annotations

from collections.abc import Callable
import subprocess
import sys
import time

from sat_collision.geometry import warm_up
from sat_collision.geometry.compilation import was_said
from sat_collision.geometry.jit import KERNEL
from sat_collision.geometry.kernel_problem import kernel_problem


def prepare(say: Callable[[str], object], warn: Callable[[str], object]) -> None:
    """
    Compile or load the kernels that the node needs; say so, and warn of what is wrong with them.

    The first start after an installation compiles them. A second process takes half of that; what
    it has compiled is loaded from disk here. It ends with this one, however this one ends.
    """
    begun = time.monotonic()
    other = None
    was_said()
    if warm_up.is_prepared() or kernel_problem():
        say(f'preparing kernels ({KERNEL})')
    else:
        say(f'preparing kernels ({KERNEL}); the first start after an installation compiles them')
        other = subprocess.Popen(
            [sys.executable, '-m', warm_up.__name__], stdin=subprocess.PIPE,
            stderr=subprocess.DEVNULL)
    warm_up.prepare_contacts()
    warm_up.prepare_distances()
    if other:
        other.wait()
        other.communicate()
    warm_up.prepare_packing()
    warm_up.prepare_parts()
    say(f'kernels ({KERNEL}) ready after {time.monotonic() - begun:.1f} s')
    if problem := kernel_problem():
        warn(problem)

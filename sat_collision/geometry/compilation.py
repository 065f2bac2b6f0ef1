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
"""Compiling takes many seconds: said before it begins, once in a process."""

from __future__ import annotations

import logging

_is_said = False


def say_compiling(kept_in: str) -> None:
    """Say that kernels are being compiled and where they are kept, unless that was said before."""
    global _is_said
    if not _is_said:
        logging.getLogger(__name__).warning(
            'sat_collision: compiling kernels, up to half a minute once after an installation; '
            f'they are kept in {kept_in}. prepare_kernels does it ahead, and with '
            'NUMBA_DISABLE_JIT=1 all is done in plain Python')
    _is_said = True


def was_said() -> None:
    """Take note that somebody else has said it, to whom it may concern."""
    global _is_said
    _is_said = True

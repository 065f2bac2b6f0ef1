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
"""What keeps kernels from being compiled, or kept: said once, in one line."""

from __future__ import annotations

import logging

_problems: list[str] = []


def kernel_problem() -> str | None:
    """Return in one line what is wrong with compiled kernels, None if nothing is."""
    return _problems[0] if _problems else None


def report_problem(problem: str) -> None:
    """Record a problem and log it, if it is the first: each kernel may have the same."""
    problem = ' '.join(problem.split())
    if not _problems:
        logging.getLogger(__name__).warning(problem)
    _problems.append(problem)

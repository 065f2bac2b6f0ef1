# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Whether kernels are compiled, and messages to users about it; does not need numba."""

from functools import lru_cache
import hashlib
import logging
import os
from pathlib import Path

# The folder of `sat_collision.geometry`.
GEOMETRY = Path(__file__).parents[1]
_SWITCH = 'NUMBA_DISABLE_JIT'

_is_said = False
_is_reported_elsewhere = False
_problems: list[str] = []


def is_plain_python_chosen() -> bool:
    """Return whether the environment disables compilation, read as numba reads it."""
    try:
        return int(os.environ.get(_SWITCH, 0)) != 0
    except ValueError:
        return False


def use_plain_python() -> None:
    """Compile nothing, here and in child processes; call it before any kernel is imported."""
    os.environ[_SWITCH] = '1'


@lru_cache
def digest_of(folder: Path) -> str:
    """Return a digest of all sources below a folder, whose kernels may call each other."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob('*.py')):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def say_compiling(name: str, kept_in: str) -> None:
    """Say that a kernel is being compiled, to be kept in a folder."""
    global _is_said
    if _is_reported_elsewhere:
        return
    words = f'sat_collision: compiling kernels, for {name}'
    if not _is_said:
        words += (', some seconds once after an installation; '
                  f'they are kept in {kept_in}. prepare_kernels does it ahead, and with '
                  'NUMBA_DISABLE_JIT=1 all is done in plain Python')
    logging.getLogger(__name__).warning(words)
    _is_said = True


def say_nothing() -> None:
    """Disable `say_compiling`: the caller reports that kernels are compiled."""
    global _is_reported_elsewhere
    _is_reported_elsewhere = True


def kernel_problem() -> str | None:
    """Return the first problem with compiled kernels in one line, None if there is none."""
    return _problems[0] if _problems else None


def report_problem(problem: str) -> None:
    """Record a problem; log only the first, because each kernel may have the same."""
    problem = ' '.join(problem.split())
    if not _problems:
        logging.getLogger(__name__).warning(problem)
    _problems.append(problem)

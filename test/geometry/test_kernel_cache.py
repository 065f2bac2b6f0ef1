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
"""Compiled kernels on disk: used while good, compiled again when not, never run when damaged."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest
from sat_collision.geometry.jit import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

GEOMETRY = Path(__file__).resolve().parents[2] / 'sat_collision' / 'geometry'
# A kernel whose own file never changes, and calls one whose file does.
CALLER = """
from sat_collision.geometry.jit import kernel
from sat_collision.geometry.plane import length

@kernel
def twice(x):
    return 2.0 * length(x, 0.0)
"""
PROGRAM = """
from sat_collision.geometry.caller import twice
from sat_collision.geometry.jit import cache_problem
print(twice(3.0), sum(twice.stats.cache_hits.values()), cache_problem())
"""


@pytest.fixture
def package(tmp_path):
    """Copy the kernels to where they may be changed, without what is compiled of them."""
    folder = tmp_path / 'sat_collision' / 'geometry'
    shutil.copytree(GEOMETRY, folder, ignore=shutil.ignore_patterns('__pycache__'))
    (tmp_path / 'sat_collision' / '__init__.py').touch()
    (folder / 'caller.py').write_text(CALLER)
    return folder


def run(package, **environment):
    """Return in a new process: twice 3, how often it came from disk, and what was wrong."""
    result = subprocess.run(
        [sys.executable, '-c', PROGRAM], capture_output=True, text=True, cwd=package.parents[1],
        env={**os.environ, 'PYTHONPATH': '', 'NUMBA_CACHE_DIR': '', **environment})
    assert result.returncode == 0, result.stderr
    answer, hits, problem = result.stdout.split(maxsplit=2)
    return float(answer), int(hits), problem.strip()


def test_a_change_in_a_called_kernel_is_noticed(package):
    """The caller's own file stays as it is, yet what was compiled of it is out of date."""
    assert run(package) == (6.0, 0, 'None')
    assert run(package) == (6.0, 1, 'None')
    plane = package / 'plane.py'
    plane.write_text(plane.read_text().replace('math.sqrt(x * x + y * y) / scale', '7.0'))
    assert run(package) == (14.0, 0, 'None')


def one_bit_wrong(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1:]


def cut_short(data):
    return data[:len(data) // 2]


@pytest.mark.parametrize('files, damage', [('*.nbc', one_bit_wrong), ('*.nbi', cut_short)])
def test_damaged_files_are_replaced(package, tmp_path, files, damage):
    """Machine code with a wrong bit, an index cut short: compiled again, which is said once."""
    environment = {'NUMBA_CACHE_DIR': str(tmp_path / 'kept')}
    run(package, **environment)
    damaged = list((tmp_path / 'kept').rglob(files))
    assert damaged
    for path in damaged:
        path.write_bytes(damage(path.read_bytes()))
    answer, hits, problem = run(package, **environment)
    assert (answer, hits) == (6.0, 0) and 'damaged' in problem
    assert run(package, **environment) == (6.0, 1, 'None')


def test_nowhere_to_keep_them(package, tmp_path):
    """Neither the package nor the user's cache can be written to: all is compiled each time."""
    (package / '__pycache__').touch()
    (tmp_path / 'home').touch()
    environment = {'HOME': str(tmp_path / 'home'), 'XDG_CACHE_HOME': str(tmp_path / 'home')}
    for _ in range(2):
        answer, hits, problem = run(package, **environment)
        assert (answer, hits) == (6.0, 0) and 'NUMBA_CACHE_DIR' in problem

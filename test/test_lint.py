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
"""The sources keep to the ament style and carry the licence."""

from pathlib import Path
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [path for folder in ('sat_collision', 'test', 'benchmarks', 'launch')
           for path in sorted((ROOT / folder).rglob('*.py'))]


@pytest.mark.linter
def test_flake8_and_pep257_find_nothing():
    """Style and docstrings follow ament_flake8 and ament_pep257, whose settings setup.cfg has."""
    pytest.importorskip('flake8')
    result = subprocess.run(
        [sys.executable, '-m', 'flake8', '--config', str(ROOT / 'setup.cfg'), str(ROOT)],
        capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.linter
@pytest.mark.parametrize('path', SOURCES, ids=lambda path: path.name)
def test_source_carries_the_licence(path):
    """Every source file begins with the copyright and the Apache-2.0 notice."""
    head = path.read_text().splitlines()[:4]
    assert head[0].startswith('# Copyright ') and head[0].endswith('The sat_collision Authors')
    assert head[2].startswith('# Licensed under the Apache License, Version 2.0')

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""The sources follow the style of ament and carry the licence."""

import hashlib
import importlib
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ('sat_collision', 'test', 'benchmarks', 'docs', 'examples', 'launch')
SOURCES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob('*.py'))]
BUILT = ('.venv', 'build', 'install', 'log')

pytestmark = pytest.mark.linter


def ament(name):
    """Return the main module of an ament linter, None if it is not installed."""
    try:
        return importlib.import_module(f'{name}.main')
    except ImportError:
        return None


def test_style(monkeypatch, cache):
    """
    Flake8 as ament_flake8 runs it; otherwise with the same rules from setup.cfg.

    A file is not read again until it, the rules or flake8 change.
    """
    monkeypatch.chdir(ROOT)
    if linter := ament('ament_flake8'):
        status, errors = linter.main_with_errors(argv=['--exclude', *BUILT])
        assert status == 0, '\n'.join(errors)
    else:
        pytest.importorskip('flake8')
        flake8 = [sys.executable, '-m', 'flake8', '--config', 'setup.cfg']
        rules = subprocess.check_output([*flake8, '--version']) + Path('setup.cfg').read_bytes()
        right = {str(path): hashlib.sha256(rules + path.read_bytes()).hexdigest()
                 for path in Path().rglob('*.py') if path.parts[0] not in BUILT}
        before = cache.get('style/right', {})
        changed = [path for path, digest in right.items() if before.get(path) != digest]
        # Without a name, flake8 would read all.
        result = subprocess.run([*flake8, 'setup.py', *changed], capture_output=True, text=True)
        assert result.returncode == 0, result.stdout + result.stderr
        cache.set('style/right', right)


def test_docstrings(monkeypatch, capfd):
    """
    PEP 257 as ament_pep257 checks it; without that it is part of the style.

    Except for D401, which takes properties for functions, and D417, which overlooks parameters
    that numpydoc describes together or by type alone.
    """
    monkeypatch.chdir(ROOT)
    linter = ament('ament_pep257') or pytest.skip('apt install ros-jazzy-ament-pep257')
    status = linter.main(argv=['--add-ignore', 'D401', 'D417', '--', 'setup.py', *FOLDERS])
    assert status == 0, capfd.readouterr()


def test_licence_of_the_package(monkeypatch, capfd):
    """As ament_copyright reads LICENSE, CONTRIBUTING.md and every source."""
    monkeypatch.chdir(ROOT)
    linter = ament('ament_copyright') or pytest.skip('apt install ros-jazzy-ament-copyright')
    assert linter.main(argv=['--exclude', *BUILT, '--', '.']) == 0, capfd.readouterr()


def test_sources_carry_the_licence():
    """Every source file begins with the copyright and the Apache-2.0 notice."""
    notice = re.compile(r'# Copyright \d+ The sat_collision Authors\n#\n'
                        r'# Licensed under the Apache License, Version 2\.0')
    assert SOURCES and not [path for path in SOURCES if not notice.match(path.read_text())]

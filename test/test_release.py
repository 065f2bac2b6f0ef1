# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The check before a release."""

from pathlib import Path
import runpy

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETUP = "from setuptools import setup\nsetup(name='sat_collision', version='{}')\n"
PACKAGE = '<package><version>1.2.3</version>{}</package>'
URLS = ''.join(f'<url type="{name}">https://example.org</url>'
               for name in ('website', 'bugtracker', 'repository'))
CHANGES = '{}\n------\n* News\n\n1.2.2 (2026-01-01)\n------\n* Older news\n'


@pytest.mark.parametrize('package, setup, changes, expected', [
    (URLS, '1.2.3', '1.2.3 (2026-11-25)', []),
    ('', '1.2.3', '1.2.3 (2026-11-25)', ['website', 'bugtracker', 'repository']),
    (URLS, '1.2.2', '1.2.3 (2026-11-25)', ['setup.py has 1.2.2']),
    (URLS, '1.2.3', 'Forthcoming', ['CHANGELOG.rst has Forthcoming'])])
def test_release_check_names_what_is_missing(tmp_path, package, setup, changes, expected):
    """Addresses, and where the version is another one."""
    (tmp_path / 'package.xml').write_text(PACKAGE.format(package))
    (tmp_path / 'setup.py').write_text(SETUP.format(setup))
    (tmp_path / 'CHANGELOG.rst').write_text(CHANGES.format(changes))
    problems = runpy.run_path(str(ROOT / '.ci' / 'release_check.py'))['problems']
    found = problems(tmp_path)
    assert len(found) == len(expected)
    assert all(words in line for line, words in zip(found, expected)), found


def test_versions_of_the_tree_agree():
    """That of package.xml is that of setup.py, whatever the change log says."""
    problems = runpy.run_path(str(ROOT / '.ci' / 'release_check.py'))['problems']
    assert not [line for line in problems(ROOT) if line.startswith('setup.py')]

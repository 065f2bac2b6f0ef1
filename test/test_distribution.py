# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What is released: the source distribution, the wheel built from it, and the check before."""

from pathlib import Path
import runpy
import subprocess
import sys
import tarfile
import zipfile

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOT_DISTRIBUTED = ('.github/', '.gitignore', '.pre-commit-config.yaml')


@pytest.fixture(scope='module')
def files():
    """Return the paths of all files that git tracks."""
    if not (ROOT / '.git').exists():
        pytest.skip('only a clone says which files there are')
    listed = subprocess.run(['git', 'ls-files', '-z'], cwd=ROOT, check=True, capture_output=True)
    return {name for name in listed.stdout.decode().split('\0')[:-1]
            if not name.startswith(NOT_DISTRIBUTED)}


@pytest.fixture(scope='module')
def sdist(files, tmp_path_factory):
    """Return the unpacked source distribution, made from a copy of these files."""
    copy = tmp_path_factory.mktemp('copy')
    for name in files:
        path = copy / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes((ROOT / name).read_bytes())
    with tarfile.open(build('sdist', copy)) as archive:
        archive.extractall(copy / 'unpacked')
    unpacked, = (copy / 'unpacked').iterdir()
    return unpacked


def build(kind, folder):
    """Build a distribution of a folder there; return the path of its file."""
    program = f'from setuptools import build_meta; print(build_meta.build_{kind}("dist"))'
    done = subprocess.run([sys.executable, '-c', program], cwd=folder, capture_output=True,
                          text=True)
    assert done.returncode == 0, done.stderr
    return folder / 'dist' / done.stdout.splitlines()[-1]


def test_sdist_has_all_files(files, sdist):
    """Tests and documents, too, so that a packager can run them."""
    assert not sorted(name for name in files if not (sdist / name).is_file())


def test_wheel_has_package_and_shared_files(files, sdist):
    """All of the package, and what ROS looks for in share."""
    pytest.importorskip('wheel')  # setuptools before 70.1 needs it
    with zipfile.ZipFile(build('wheel', sdist)) as wheel:
        names = wheel.namelist()
        metadata = wheel.read(next(one for one in names if one.endswith('/METADATA'))).decode()
    assert {name for name in files if name.startswith('sat_collision/')} <= {*names}
    shared = {name.partition('/data/share/sat_collision/')[2] for name in names}
    folders = ('config/', 'examples/', 'foxglove/', 'launch/', 'rviz/')
    assert {'package.xml', *(name for name in files if name.startswith(folders))} <= shared
    assert any(name.endswith('/ament_index/resource_index/packages/sat_collision')
               for name in names)
    assert (ROOT / 'README.md').read_text() in metadata


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

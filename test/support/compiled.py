# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Kernels in tests, and processes with them: in plain Python, or without write permission."""

import ctypes
import os
from pathlib import Path
import shutil
import subprocess
import sys

from sat_collision.geometry.compiled.jit import kernel

PACKAGE = Path(__file__).resolve().parents[2] / 'sat_collision'
GEOMETRY_TESTS = Path(__file__).resolve().parents[1] / 'geometry'
# Files below the package: all that is compiled, and the mark that all is.
COMPILED_FILES = ('__pycache__',)
MARK = 'prepared-*'
# The kernels by which a node finds those for distances compiled.
FOR_DISTANCES = 'contact.*.nb?', 'path.*.nb?'
_DROP_FROM_BOUNDING_SET = 24
_WRITE_ANYWHERE, _READ_ANYWHERE, _CHANGE_ANYWHERE = 1, 2, 3


def callable_here(*functions):
    """Return the same kernels, compiled so that Python may call them."""
    return [kernel(getattr(function, 'py_func', function)) for function in functions]


def copy_package(folder, absent):
    """Copy the package into a folder, with what is compiled here except for the absent files."""
    shutil.copytree(PACKAGE, folder / 'sat_collision', ignore=shutil.ignore_patterns(*absent))
    (folder / 'home').mkdir()


def plain_python(**more):
    """
    Return an environment of processes in plain Python, with some more variables.

    They start in a third of the time of those that load numba, with the same answers.
    """
    return {**os.environ, 'NUMBA_DISABLE_JIT': '1', **more}


def run_beside_tests(program, **more):
    """Run a program that can import the tests of geometry, with some more variables."""
    path = [str(PACKAGE.parent), str(Path(__file__).parent), str(GEOMETRY_TESTS),
            os.environ.get('PYTHONPATH', '')]
    return subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(path), **more})


def without_privileges():
    """Make this process, and the program it becomes, obey file permissions even as root."""
    prctl = ctypes.CDLL(None).prctl
    for capability in (_WRITE_ANYWHERE, _READ_ANYWHERE, _CHANGE_ANYWHERE):
        prctl(_DROP_FROM_BOUNDING_SET, capability)


def forbid_writing(folder):
    """Remove write permission from a folder and everything in it; the owner may delete."""
    for path in (folder, *Path(folder).rglob('*')):
        if not path.is_symlink():
            os.chmod(path, path.stat().st_mode & 0o555)


def allow_writing(folder):
    """Restore write permission of folders, so that they can be deleted."""
    os.chmod(folder, 0o755)
    for path in Path(folder).rglob('*'):
        if path.is_dir():
            os.chmod(path, 0o755)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Compiled kernels on disk: reused if valid, compiled again if outdated or damaged."""

import os
from pathlib import Path
import pickle
import random
import shutil
import subprocess
import sys

from compiled import allow_writing, forbid_writing, without_privileges
import pytest
from sat_collision.geometry import preparation
from sat_collision.geometry.compiled.jit import COMPILED, HAS_OWN_CACHE, numba

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

GEOMETRY = Path(__file__).resolve().parents[2] / 'sat_collision' / 'geometry'
# A kernel whose file never changes, but which calls one in a file that does.
CALLER = """
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.numeric.vectors import length

@kernel
def twice(x):
    return 2.0 * length(x, 0.0)
"""
PROGRAM = """
from sat_collision.geometry.caller import twice
from sat_collision.geometry.compiled.compilation import kernel_problem
hits = getattr(twice, 'stats', None)
print(twice(3.0), sum(hits.cache_hits.values()) if hits else 0, kernel_problem())
"""
# Makes numba look like a version that was not tried.
UNKNOWN = 'import numba\nnumba.version_info = numba.version_info._replace(short=(0, 999))\n'
BOTH_NUMBAS = pytest.mark.parametrize('before', ['', UNKNOWN], ids=['tried', 'unknown'])


@pytest.fixture
def package(tmp_path):
    """Copy the kernels without anything compiled, so that they may be changed."""
    folder = tmp_path / 'sat_collision' / 'geometry'
    shutil.copytree(GEOMETRY, folder, ignore=shutil.ignore_patterns('__pycache__'))
    (tmp_path / 'sat_collision' / '__init__.py').touch()
    (folder / 'caller.py').write_text(CALLER)
    return folder


def run(package, program=PROGRAM, preexec_fn=None, **environment):
    """Return from another process: twice 3, how often it came from disk, and the problem."""
    result = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, cwd=package.parents[1],
        preexec_fn=preexec_fn,
        env={**os.environ, 'PYTHONPATH': '', 'NUMBA_CACHE_DIR': '', **environment})
    assert result.returncode == 0, result.stderr
    answer, hits, problem = result.stdout.split(maxsplit=2)
    # Each compilation is announced; a problem is reported once, in one line.
    lines = result.stderr.splitlines()
    problems = [line for line in lines if 'compiling kernels' not in line]
    assert problems == ([] if problem.strip() == 'None' else [problem.strip()]), result.stderr
    return float(answer), int(hits), problem.strip()


def check_problem(words, package, **options):
    """Check that kernels are right, but not from disk, and why."""
    answer, hits, problem = run(package, **options)
    assert (answer, hits) == (6.0, 0) and words in problem


def change_called_kernel(package):
    vectors = package / 'numeric' / 'vectors.py'
    vectors.write_text(vectors.read_text().replace('math.sqrt(x * x + y * y) / scale', '7.0'))


@pytest.mark.long
@BOTH_NUMBAS
def test_change_of_a_called_kernel_is_noticed(package, before):
    """The file of the caller does not change; numba itself keeps kernels if it was not tried."""
    problem = (f'numba {numba.__version__} is used as it is, so a first start takes about '
               'twice as long: it was tried with numba 0.59 to 0.68') if before else 'None'
    assert run(package, before + PROGRAM) == (6.0, 0, problem)
    assert run(package, before + PROGRAM) == (6.0, 1, problem)
    change_called_kernel(package)
    assert run(package, before + PROGRAM) == (14.0, 0, problem)


@pytest.mark.long
def test_old_code_behind_a_new_index_is_not_used(package):
    """A process was killed between writing the two, after an upgrade."""
    run(package)
    kept = {path: path.read_bytes() for path in package.glob('__pycache__/caller.*.nbc')}
    change_called_kernel(package)
    assert run(package) == (14.0, 0, 'None')
    for path, data in kept.items():
        assert path.read_bytes() != data
        path.write_bytes(data)
    assert run(package) == (14.0, 0, 'None')
    assert run(package) == (14.0, 1, 'None')


@pytest.mark.long
def test_kernels_of_another_processor_are_not_those_of_this_one(package):
    program = PROGRAM.replace('print(twice(3.0), sum', 'from sat_collision.geometry.compiled '
                              'import kernel_cache\nprint(kernel_cache.is_kept(twice) + 0, sum')
    run(package)
    assert run(package, program)[0] == 1.0
    assert run(package, program, NUMBA_CPU_NAME='generic', NUMBA_CPU_FEATURES='')[0] == 0.0


@pytest.mark.long
@BOTH_NUMBAS
def test_change_of_a_kernel_in_another_folder_is_noticed(package, before):
    beside = package.parent / 'motion'
    beside.mkdir()
    (beside / '__init__.py').touch()
    callee = beside / 'callee.py'
    callee.write_text('from sat_collision.geometry.compiled.jit import kernel\n\n'
                      '@kernel\ndef length(x, y):\n    return x\n')
    (beside / 'caller.py').write_text(CALLER.replace('geometry.numeric.vectors', 'motion.callee'))
    program = before + PROGRAM.replace('geometry.caller', 'motion.caller')
    assert run(package, program)[:2] == (6.0, 0)
    assert run(package, program)[:2] == (6.0, 1)
    callee.write_text(callee.read_text().replace('return x', 'return 7.0'))
    assert run(package, program)[:2] == (14.0, 0)


def test_called_kernels_are_compiled_only_with_their_callers(package):
    run(package)
    kept = {path.name.split('-')[0] for path in package.rglob('*.nbc')}
    assert 'caller.twice' in kept and not any(name.startswith('vectors.') for name in kept)


def one_bit_wrong(data):
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1:]


# What is in a file's place, made of its bytes, or at its path.
CONTENTS = {
    'one bit wrong': one_bit_wrong,
    'cut short': lambda data: data[:len(data) // 2],
    'empty': lambda data: b'',
    'one byte': lambda data: data[:1],
    'first bytes gone': lambda data: data[7:],
    'more behind': lambda data: data + b'x',
    'zeros': lambda data: bytes(len(data)),
    'noise': lambda data: random.Random(1).randbytes(len(data)),
    'another pickle': lambda data: pickle.dumps({'not': 'what it should be'}),
    'a pickle that ends the process': lambda data: b'cos\n_exit\n(I7\ntR.',
}
REPLACEMENTS = {'a folder': Path.mkdir, 'a link to itself': lambda path: path.symlink_to(path)}
DAMAGES = *CONTENTS.values(), *REPLACEMENTS.values()
MANY = """
from sat_collision.geometry.compiled.jit import kernel
""" + ''.join(f"""
@kernel
def kernel_{k}_(x):
    return {k}.0 * x
""" for k in range(len(DAMAGES)))
PROGRAM_OF_MANY = """
from sat_collision.geometry import caller
from sat_collision.geometry.compiled.compilation import kernel_problem
kernels = [getattr(caller, f'kernel_{k}_') for k in range(%d)]
print(sum(one(1.0) for one in kernels), sum(sum(one.stats.cache_hits.values()) for one in kernels),
      kernel_problem())
""" % len(DAMAGES)


@pytest.mark.long
@pytest.mark.parametrize('files', ['*.nb[ci]', '*.nbc', '*.nbi'])
def test_damaged_files_are_replaced(package, files):
    """They are compiled again, which is reported once."""
    (package / 'caller.py').write_text(MANY)
    right = float(sum(range(len(DAMAGES))))
    assert run(package, PROGRAM_OF_MANY) == (right, 0, 'None')
    for k, damage in enumerate(DAMAGES):
        damaged = list(package.rglob(f'caller.kernel_{k}_{files}'))
        assert damaged
        for path in damaged:
            data = path.read_bytes()
            path.unlink()
            path.write_bytes(damage(data)) if k < len(CONTENTS) else damage(path)
    answer, hits, problem = run(package, PROGRAM_OF_MANY)
    assert (answer, hits) == (right, 0) and 'damaged' in problem
    assert run(package, PROGRAM_OF_MANY) == (right, len(DAMAGES), 'None')


@pytest.mark.long
@pytest.mark.parametrize('files', ['*.nbc', '*.nbi'])
def test_missing_files_are_replaced(package, files):
    run(package)
    for path in package.rglob(files):
        path.unlink()
    assert run(package) == (6.0, 0, 'None')
    assert run(package) == (6.0, 1, 'None')


@pytest.mark.long
def test_full_disk(package, tmp_path):
    """Kernels are compiled in each process, and no temporary files are left."""
    disk = tmp_path / 'disk'
    disk.mkdir()
    mounted = subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=100k', 'none', str(disk)],
                             capture_output=True)
    if mounted.returncode:
        pytest.skip('run as root, who may mount a disk')
    try:
        (disk / 'full').write_bytes(bytes(90_000))
        for _ in range(2):
            check_problem('cannot be kept', package, NUMBA_CACHE_DIR=str(disk))
        assert not list(disk.rglob('*.tmp.*'))
    finally:
        subprocess.run(['umount', str(disk)], check=True)


def test_failing_writes(package):
    """Each write fails, as on a full disk."""
    (package / 'caller.py').write_text(
        'import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n'
        'resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n' + CALLER)
    check_problem('cannot be kept', package)


BROKEN = {
    'missing library': "raise OSError('Could not find libllvmlite.so')",
    'missing module': "raise ModuleNotFoundError('no llvmlite', name='llvmlite')",
    'incompatible version': "raise ImportError('Numba needs NumPy 2.3 or less')",
    'failure on compilation': 'def njit(function):\n    raise RuntimeError("no LLVM")',
}


@pytest.mark.parametrize('where', ['numba', 'llvmlite'])
@pytest.mark.parametrize('how', BROKEN)
def test_broken_compiler(package, where, how):
    """Plain Python is used, and the reason is reported once."""
    broken = package.parents[1] / where
    broken.mkdir()
    (broken / '__init__.py').write_text(BROKEN[how])
    check_problem('plain Python', package)


def test_damaged_library_of_the_compiler(package):
    """The shared library of llvmlite is truncated."""
    import llvmlite
    copy = package.parents[1] / 'llvmlite'
    shutil.copytree(Path(llvmlite.__file__).parent, copy,
                    ignore=shutil.ignore_patterns('*.so', '__pycache__', 'tests'))
    (copy / 'binding' / 'libllvmlite.so').write_bytes(b'\x7fELF')
    check_problem('plain Python', package)


def test_missing_compiler_is_no_problem(package):
    (package.parents[1] / 'numba.py').write_text(
        "raise ModuleNotFoundError('no numba', name='numba')")
    assert run(package) == (6.0, 0, 'None')


@pytest.mark.long
def test_user_without_write_access(package, tmp_path):
    """To the package and to the home folder."""
    (tmp_path / 'home').mkdir()
    forbid_writing(tmp_path)
    try:
        check_problem('NUMBA_CACHE_DIR', package, preexec_fn=without_privileges,
                      HOME=str(tmp_path / 'home'), XDG_CACHE_HOME='')
    finally:
        allow_writing(tmp_path)


@pytest.mark.long
def test_no_folder_for_the_cache(package, tmp_path):
    """Kernels are compiled in each process."""
    (package / '__pycache__').touch()
    (tmp_path / 'home').touch()
    for _ in range(2):
        check_problem('NUMBA_CACHE_DIR', package, HOME=str(tmp_path / 'home'),
                      XDG_CACHE_HOME=str(tmp_path / 'home'))


def test_versions_tried_include_the_one_here():
    """So kernels are linked and kept as in all other tests."""
    assert HAS_OWN_CACHE


def test_first_start_runs_nothing_of_the_current_folder(tmp_path, monkeypatch):
    """Where modules have the names of those that it needs."""
    for name in ('numpy', 'gc', 'sat_collision'):
        (tmp_path / f'{name}.py').write_text('raise SystemExit(7)')
    monkeypatch.chdir(tmp_path)
    with preparation._process('packing') as process:
        assert process.stdout.readline() == b'packing\n'


def test_kernel_of_collections_is_prepared():
    """In a process of its own, where no test has called it."""
    program = ('from sat_collision.geometry.preparation import prepare_packing\n'
               'from sat_collision.geometry.sets.run import find_polygons\n'
               'prepare_packing()\n'
               'assert find_polygons.signatures')
    subprocess.run([sys.executable, '-c', program], check=True, timeout=100)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Kernels and plain Python agree bit by bit, and answer in no other floating-point mode."""

import contextlib
import ctypes
import json
import os
from pathlib import Path
import platform
import shutil
import subprocess
import sys

from compiled import plain_python, run_beside_tests
import families
import numpy as np
import pytest
from sat_collision import (
    closest_points, contact, first_contact_along, intersects, intersects_many, intersects_pairs,
    Polygon, PolygonSet, separation, time_of_contact, time_to_contact)
from sat_collision.geometry.compiled import floating_point
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.geometry.numeric.predicates import orient
from sat_collision.geometry.sets.packed_set import PackedSet

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ('import json, sat_collision, test_jit as t; '
           'print(json.dumps([sat_collision.KERNEL, t.library_answers()]))')


def moved_messages(seed):
    """Yield points of messages, convex or not, and affine maps to other frames."""
    rng = np.random.default_rng(seed)
    for name, family in families.ALL.items():
        for ring, _ in family(rng, 10, 9) if name != 'extreme_scales' else ():
            points = np.column_stack([ring, ring[:, 0]]).astype(np.float32)
            angle = rng.uniform(-np.pi, np.pi)
            cosine, sine = float(np.cos(angle)), float(np.sin(angle))
            x, y = (rng.normal(size=2) * 10.0 ** rng.integers(0, 5)).tolist()
            try:
                Polygon(points)
            except ValueError:
                continue
            yield (points.tobytes(), 0, len(points)), (cosine, -sine, x, sine, cosine, y)


def library_answers():
    """Return results of all queries for some pairs of each family."""
    answers = {}
    for name, family in families.ALL.items():
        rng = np.random.default_rng(7)
        pairs = family(rng, 60, 9) + family(rng, 40, 24)
        sets = [PolygonSet(pair[k] for pair in pairs) for k in (0, 1)]
        answers[name] = intersects_pairs(*sets).tolist()
        for p, q in family(rng, 20, 9):
            packed = np.asarray(Polygon(p).packed[0])
            answers[name] += [intersects(p, q), separation(p, q).hex(),
                              packed.tobytes().hex(), *Polygon(q).centroid.tolist(),
                              time_of_contact(p + 2 * np.ptp(q), p, q * [1, 0.75], q),
                              *(time_to_contact(p + 2 * np.ptp(q), (*twist, 1.5), [q, p], 2.0,
                                                [twist, (0, 0)]).hex()
                                for twist in np.ptp(q, axis=0) * [(-1, 0), (1, -2)]),
                              *(np.asarray(one).tobytes().hex() for one in contact(p, q)),
                              first_contact_along(p, np.outer(
                                  np.arange(-1, 3), [*np.ptp(q, axis=0), 2.5]), [q])]
    answers['moved'] = [np.asarray(Polygon.from_float32(*message, affine=affine).packed[0])
                        .tobytes().hex() for message, affine in moved_messages(9)]
    return json.loads(json.dumps(answers))


@pytest.mark.long
def test_compiled_kernels_and_plain_python_agree():
    """In another process without numba."""
    result = run_beside_tests(PROGRAM, NUMBA_DISABLE_JIT='1')
    assert result.returncode == 0, result.stderr
    kernel, answers = json.loads(result.stdout)
    assert kernel == 'plain Python'
    for name, expected in library_answers().items():
        assert answers[name] == expected, name


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='this is plain Python')
@pytest.mark.parametrize('name', ['test_box_index.py', 'test_sharing.py'])
def test_short_tests_pass_in_plain_python(name):
    # The tests of compiled kernels are skipped there, which no gate needs to list.
    result = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-p', 'no:cacheprovider', '-m', 'not long',
         Path(__file__).with_name(name)],
        capture_output=True, text=True, env=plain_python(ALLOWED_SKIPS=''))
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize('arguments, plain', [
    (('-c', 'import sat_collision; dir(sat_collision), sat_collision.__version__'), '0'),
    (('-m', 'sat_collision.replay', '--help'), '0'),
    (('-m', 'sat_collision.replay', '--nonsense'), '0'),
    (('-m', 'sat_collision.node', '--help'), '0'),
    (('-m', 'sat_collision.node', 'nonsense'), '0'),
    (('-c', 'import sat_collision; assert sat_collision.intersects([(0, 0)], [(0, 0)])'), '1'),
])
def test_numba_is_not_imported_until_a_kernel_needs_it(arguments, plain):
    """Its import is slow and takes memory."""
    result = subprocess.run(
        [sys.executable, '-X', 'importtime', *arguments], cwd=ROOT, capture_output=True, text=True,
        env={**os.environ, 'NUMBA_DISABLE_JIT': plain})
    imported = {line.rpartition('|')[2].strip() for line in result.stderr.splitlines()}
    assert 'sat_collision' in imported and 'Traceback' not in result.stderr
    assert not {'numba', 'llvmlite'} & imported


WITH_MODES = pytest.mark.skipif(
    platform.machine() != 'x86_64' or platform.libc_ver()[0] != 'glibc',
    reason='modes are set as in glibc on x86-64')
# Bits of MXCSR, which ends glibc's fenv_t.
MODES = {'flush to zero': 0x8000, 'denormals are zero': 0x0040, 'down': 0x2000, 'up': 0x4000,
         'towards zero': 0x6000}
FLUSHING = 'flush to zero', 'denormals are zero'


@contextlib.contextmanager
def rounding(mode):
    """Set the floating-point mode of this thread."""
    libm = ctypes.CDLL('libm.so.6')
    usual, changed = ctypes.create_string_buffer(32), ctypes.create_string_buffer(32)
    libm.fegetenv(usual)
    word = int.from_bytes(usual.raw[28:], sys.byteorder) | MODES[mode]
    changed.raw = usual.raw[:28] + word.to_bytes(4, sys.byteorder)
    libm.fesetenv(changed)
    try:
        yield
    finally:
        libm.fesetenv(usual)


def refusal(mode):
    return 'flushes' if mode in FLUSHING else 'does not round to nearest'


BOX = np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)])
POLYGON, OTHER = Polygon(BOX), Polygon(BOX + 0.5)
SET = PackedSet([POLYGON, OTHER])
QUESTIONS = {
    'Polygon': lambda: Polygon(BOX),
    'from_float32': lambda: Polygon.from_float32(np.zeros(9, np.float32).tobytes(), 0, 3),
    'intersects': lambda: intersects(POLYGON, OTHER),
    'intersects_many': lambda: intersects_many(POLYGON, SET),
    'intersects_pairs': lambda: intersects_pairs(SET, SET),
    'separation': lambda: separation(POLYGON, OTHER),
    'closest_points': lambda: closest_points(POLYGON, OTHER),
    'contact': lambda: contact(POLYGON, OTHER),
    'time_of_contact': lambda: time_of_contact(BOX, BOX, BOX + 2.0, BOX),
    'first_contact': lambda: SET.first_contact(POLYGON, (1, 0, 1), 1.0),
    'intersecting_rows': lambda: SET.intersecting_rows(POLYGON),
    'rows_within': lambda: SET.rows_within(POLYGON, 1.0),
    'nearest': lambda: SET.nearest(POLYGON),
    'place': lambda: SET.place(0, POLYGON.packed, SET),
    'place with a margin': lambda: SET.place(0, POLYGON.packed, SET, 1.0),
}


@WITH_MODES
@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('question', QUESTIONS)
def test_no_answer_in_another_mode(question, mode):
    """No query answers, although the bodies were made before; it does again after a reset."""
    QUESTIONS[question]()
    with rounding(mode), pytest.raises(FloatingPointError, match=refusal(mode)):
        QUESTIONS[question]()
    QUESTIONS[question]()


@WITH_MODES
@pytest.mark.parametrize('mode, points', [
    ('flush to zero', (1.5 * 2.0**-1022, 0, 0, 1, 2.0**-1022, 0)),
    ('denormals are zero', (0, 0, 1, 0, 0, 2.0**-1074)),
])
def test_kernel_would_be_wrong_in_another_mode(mode, points):
    """It would consider three points collinear that are not."""
    points = tuple(map(float, points))
    assert orient(*points) == 1
    with rounding(mode):
        assert orient(*points) == 0


@WITH_MODES
@pytest.mark.parametrize('mode, plain', [
    ('flush to zero', '0'), ('down', '1'),
    pytest.param('flush to zero', '1', marks=pytest.mark.long),
    pytest.param('down', '0', marks=pytest.mark.long)])
def test_import_is_refused_in_another_mode(mode, plain, tmp_path):
    """Nothing compiled in that mode is cached."""
    program = (f'import ctypes\nmode = {MODES[mode]}\n'
               'libm, env = ctypes.CDLL("libm.so.6"), ctypes.create_string_buffer(32)\n'
               'libm.fegetenv(env)\n'
               'env[28:] = (int.from_bytes(env[28:], "little") | mode).to_bytes(4, "little")\n'
               'libm.fesetenv(env)\n'
               'from sat_collision import intersects')
    environment = {'NUMBA_DISABLE_JIT': plain, 'NUMBA_CACHE_DIR': str(tmp_path)}
    result = run_beside_tests(program, **environment)
    assert result.returncode == 1
    assert 'FloatingPointError: floating point' in result.stderr
    assert refusal(mode) in result.stderr
    result = run_beside_tests('from sat_collision import intersects', **environment)
    assert result.returncode == 0


@WITH_MODES
@pytest.mark.parametrize('plain', '01')
def test_library_that_sets_the_mode_on_loading(tmp_path, plain):
    """As one linked with -ffast-math; noticed compiled and in plain Python."""
    if not shutil.which('gcc'):
        pytest.skip('install gcc')
    source, library = tmp_path / 'fast.c', tmp_path / 'fast.so'
    source.write_text('')
    subprocess.run(['gcc', '-shared', '-fPIC', '-ffast-math', source, '-o', library], check=True)
    result = run_beside_tests(
        'import ctypes\n'
        'from sat_collision.geometry.compiled.floating_point import require_nearest\n'
        f'ctypes.CDLL({str(library)!r})\n'
        'if 2.0**-1060 * float("0.5") == 0.0:\n'
        '    require_nearest(0)\n'
        'else:\n    print("not set")',
        NUMBA_DISABLE_JIT=plain, NUMBA_CACHE_DIR=str(tmp_path))
    if 'not set' in result.stdout:
        pytest.skip('install gcc 12 or older: this one does not set it')
    assert 'FloatingPointError: floating point flushes' in result.stderr


@WITH_MODES
@pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')
def test_fused_multiply_add_is_noticed(monkeypatch):
    """The same source compiled with permission to contract."""
    import numba
    if 'fma' not in Path('/proc/cpuinfo').read_text():
        pytest.skip('this processor has no fused multiply-add')
    fused = numba.njit(fastmath={'contract'})(floating_point.problem.py_func)
    floating_point.require_proved()
    monkeypatch.setattr(floating_point, 'problem', fused)
    with pytest.raises(FloatingPointError, match='fused'):
        floating_point.require_proved()

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Queries are refused in a thread whose floating-point mode differs from that of the proofs."""

import contextlib
import ctypes
from pathlib import Path
import platform
import shutil
import subprocess
import sys

from compiled import run_beside_tests
import numpy as np
import pytest
from sat_collision import (
    closest_points, contact, intersects, intersects_many, intersects_pairs, Polygon,
    separation, time_of_contact)
from sat_collision.geometry.compiled import floating_point
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.geometry.numeric.predicates import orient
from sat_collision.geometry.sets.packed_set import PackedSet

if not (platform.machine() == 'x86_64' and platform.libc_ver()[0] == 'glibc'):
    pytest.skip('modes are set as in glibc on x86-64', allow_module_level=True)

LIBM = ctypes.CDLL('libm.so.6')
# Bits of MXCSR, which ends glibc's fenv_t.
MODES = {'flush to zero': 0x8000, 'denormals are zero': 0x0040, 'down': 0x2000, 'up': 0x4000,
         'towards zero': 0x6000}
FLUSHING = 'flush to zero', 'denormals are zero'


@contextlib.contextmanager
def rounding(mode):
    """Set the floating-point mode of this thread."""
    usual, changed = ctypes.create_string_buffer(32), ctypes.create_string_buffer(32)
    LIBM.fegetenv(usual)
    word = int.from_bytes(usual.raw[28:], sys.byteorder) | MODES[mode]
    changed.raw = usual.raw[:28] + word.to_bytes(4, sys.byteorder)
    LIBM.fesetenv(changed)
    try:
        yield
    finally:
        LIBM.fesetenv(usual)


def message(mode):
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


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('question', QUESTIONS)
def test_no_answer_in_another_mode(question, mode):
    """No query answers, although the bodies were made before; it does again after a reset."""
    QUESTIONS[question]()
    with rounding(mode), pytest.raises(FloatingPointError, match=message(mode)):
        QUESTIONS[question]()
    QUESTIONS[question]()


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
    assert message(mode) in result.stderr
    result = run_beside_tests('from sat_collision import intersects', **environment)
    assert result.returncode == 0


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

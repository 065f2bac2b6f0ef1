# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Compiled kernels and plain Python give the same results, bit by bit."""

import json
import os
from pathlib import Path
import subprocess
import sys

from compiled import plain_python, run_beside_tests
import families
import numpy as np
import pytest
from sat_collision import (
    contact, first_contact_along, intersects, intersects_pairs, Polygon, PolygonSet, separation,
    time_of_contact, time_to_contact)
from sat_collision.geometry.compiled.jit import COMPILED

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

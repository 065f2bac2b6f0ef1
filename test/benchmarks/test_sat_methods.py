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

"""The methods of the report against the oracle, and the paper's mistakes on two examples."""

from functools import partial
from pathlib import Path
import sys

import families
import numpy as np
import oracle
import pytest

from sat_collision import intersects

sys.path += [str(Path(__file__).resolve().parents[2] / 'benchmarks' / 'report')]

import sat_methods  # noqa: E402

# Nearest B = (6, 7) of P is an end of two edges, but the edge that separates, from (0, 1) to
# (5, 4), is not one of them.
APART = np.array([[0, 1], [5, 4], [6, 7.0]]), np.array([[4, 3], [11, 5], [11, 6.0]])
# The centre line crosses the edges (4, 1)-(1, 8) and (8, 9)-(3, 4), whose ends are apart along it;
# but the vertex (2, 1) of Q, which is not one of the four, lies within P.
OVERLAPPING = np.array([[0, 2], [4, 1], [1, 8.0]]), np.array([[2, 1], [8, 9], [3, 4.0]])


@pytest.fixture
def rng():
    return np.random.default_rng(2)


def traditional(p, q):
    return sat_methods.traditional_axes(p, q)[0]


def boxed(p, q):
    return sat_methods.boxed_axes(p, q, sat_methods.bounds(p), sat_methods.bounds(q))[0]


def published(kernel, p, q):
    """Return the answer of a reading of the paper, which starts from the centres of gravity."""
    return kernel(p, q, sat_methods.centre_of_gravity(p), sat_methods.centre_of_gravity(q))[0]


def answers(method, pairs):
    return np.array([method(p, q) for p, q in pairs])


@pytest.mark.parametrize('n', [3, 4, 7, 16, 40])
@pytest.mark.parametrize('method', [traditional, boxed])
@pytest.mark.parametrize('family', [families.clear, families.near, families.deep])
def test_traditional_is_complete_away_from_contact(method, family, n, rng):
    pairs = family(rng, 200, n)
    np.testing.assert_array_equal(answers(method, pairs), oracle.intersects_pairs(pairs)[0])


def test_traditional_decides_points_and_segments_that_coordinates_decide():
    bodies = [np.array(body, float) for body in (
        [[0, 0]], [[2, 0]], [[0, 0], [2, 0]], [[3, 0], [4, 0]], [[1, -1], [1, 1]],
        [[0, 0], [2, 2]], [[3, 3], [4, 4]], [[0, 1]], [[0, 0], [4, 0], [0, 4]])]
    pairs = [(p, q) for p in bodies for q in bodies]
    truth, _ = oracle.intersects_pairs(pairs)
    np.testing.assert_array_equal(answers(traditional, pairs), truth)


def test_float32_arrays_are_computed_with_in_float32(rng):
    """The traditional method is wrong in float32 on pairs that it decides in float64."""
    pairs = families.float32_round_trip(rng, 1000, 4)
    truth, _ = oracle.intersects_pairs(pairs)
    single = [(p.astype(np.float32), q.astype(np.float32)) for p, q in pairs]
    wrong, wrong_single = (np.sum(answers(traditional, bodies) != truth)
                           for bodies in (pairs, single))
    assert wrong < wrong_single / 10


def test_published_a_calls_separate_bodies_colliding():
    assert not oracle.intersects(*APART)
    assert not traditional(*APART)
    assert not intersects(*APART)
    assert published(sat_methods.published_a_axes, *APART)


def test_published_b_misses_a_collision():
    assert oracle.intersects(*OVERLAPPING)
    assert traditional(*OVERLAPPING)
    assert intersects(*OVERLAPPING)
    assert not published(sat_methods.published_b_axes, *OVERLAPPING)


@pytest.mark.parametrize('n', [4, 16, 64])
def test_published_a_errs_one_way_and_b_both(n, rng):
    """Every axis that A accepts separates; B is wrong in both ways."""
    pairs = families.near(rng, 2000, n)
    truth, _ = oracle.intersects_pairs(pairs)
    a, b = (answers(partial(published, kernel), pairs)
            for kernel in (sat_methods.published_a_axes, sat_methods.published_b_axes))
    assert (a & ~truth).any()
    assert not (~a & truth).any()
    assert (b & ~truth).any()
    assert (~b & truth).any()


def test_axes_are_counted(rng):
    """Deciding a deep collision takes traditional all axes, the published methods a few."""
    for p, q in families.deep(rng, 50, 9):
        centres = sat_methods.centre_of_gravity(p), sat_methods.centre_of_gravity(q)
        bounds = sat_methods.bounds(p), sat_methods.bounds(q)
        assert sat_methods.traditional_axes(p, q) == (True, 18)
        assert sat_methods.boxed_axes(p, q, *bounds) == (True, 20)
        assert sat_methods.published_a_axes(p, q, *centres) == (True, 9)
        assert sat_methods.published_b_axes(p, q, *centres)[1] <= 3

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
"""Separation and closest points against rational arithmetic, and in agreement with intersects."""

import numpy as np
import pytest
from rationals import exact_depth, exact_distance
from sat_collision import closest_points, intersects, Polygon, separation

ULP = 2.0 ** -52


def random_convex(rng, count):
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    return Polygon(np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(0.5, 2))


@pytest.mark.parametrize('count', [3, 4, 9, 40])
@pytest.mark.parametrize('offset', [0.0, 1e3, 1e6])
def test_convex_pairs_are_accurate_to_a_few_ulp(count, offset):
    """Random pairs apart and overlapping, also far from the origin."""
    rng = np.random.default_rng(count)
    signs = set()
    for _ in range(25):
        a = Polygon(random_convex(rng, count).vertices + offset)
        b = Polygon(random_convex(rng, count).vertices + offset + rng.uniform(-3, 3, 2))
        value = separation(a, b)
        expected = -exact_depth(a, b) if intersects(a, b) else exact_distance(a, b)
        assert abs(value - expected) <= 4 * ULP * (offset + 5.0)
        assert abs(value - separation(b, a)) <= 8 * ULP * (offset + 5.0)
        signs.add(value > 0)
    assert signs == {True, False}


def test_closest_points_realise_the_separation():
    """Apart they are that far apart; overlapping, the move between them just ends the overlap."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        a, b = random_convex(rng, 6), random_convex(rng, 9)
        b = Polygon(b.vertices + rng.uniform(-3, 3, 2))
        value = separation(a, b)
        p, q = closest_points(a, b)
        assert np.hypot(*(q - p)) == pytest.approx(abs(value), abs=1e-14)
        if value < 0:
            assert abs(separation(a.vertices + (q - p), b)) < 1e-13
        else:
            assert separation([p], a) < 1e-14 and separation([q], b) < 1e-14


@pytest.mark.parametrize('a, b, expected', [
    ([(0, 0)], [(3, 4)], 5.0),
    ([(0, 0)], [(0, 0)], 0.0),
    ([(0, 0), (1, 0)], [(3, 0), (4, 0)], 2.0),
    ([(0, 0), (2, 0)], [(1, 0), (3, 0)], 0.0),
    ([(0, 0), (2, 0)], [(1, 0), (1, 1)], 0.0),
    ([(0, 0), (2, 0)], [(1, -1), (1, 1)], -1.0),
    ([(0.5, 0.25)], [(0, 0), (1, 0), (1, 1), (0, 1)], -0.25),
    ([(1, 0.25)], [(0, 0), (1, 0), (1, 1), (0, 1)], 0.0),
    ([(0, 0), (1, 0), (1, 1), (0, 1)], [(1, 1), (2, 1), (2, 2), (1, 2)], 0.0),
    ([(0, 0), (1, 0), (1, 1), (0, 1)], [(4, 5), (5, 5), (5, 6), (4, 6)], 5.0),
    ([(0, 0), (4, 0), (4, 4), (0, 4)], [(1, 1), (2, 1), (2, 2), (1, 2)], -2.0),
], ids=['points', 'same point', 'collinear apart', 'collinear overlap', 'T', 'cross',
        'point inside', 'point on edge', 'corner to corner', 'diagonal', 'contained'])
def test_small_cases_are_exact(a, b, expected):
    """Points, segments and boxes whose separation is plain to see, both ways round."""
    assert separation(a, b) == expected
    assert separation(b, a) == expected


def test_notch_of_an_l():
    """A box in the notch of an L is apart from it by the narrower gap."""
    shape = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)]
    assert separation(shape, [(1.5, 1.25), (2, 1.25), (2, 2), (1.5, 2)]) == 0.25
    assert separation(shape, [(3, 0.5), (5, 0.5), (5, 3), (3, 3)]) == -0.5


def test_sign_agrees_with_intersects_where_rounding_cannot_tell():
    """Beside a slanted edge, one ulp apart, the values are rounded but the signs are not."""
    rng = np.random.default_rng(9)
    seen = set()
    for _ in range(2000):
        a = random_convex(rng, 5)
        start, end = a.vertices[0], a.vertices[1]
        vertex = start + rng.uniform(0.1, 0.9) * (end - start)
        vertex += rng.integers(-2, 3, 2) * np.spacing(vertex)
        outside = vertex + np.array([end[1] - start[1], start[0] - end[0]])
        b = Polygon([vertex, outside + 0.1, outside - 0.1])
        apart = separation(a, b) > 0
        assert apart is not intersects(a, b)
        seen.add(apart)
    assert seen == {True, False}

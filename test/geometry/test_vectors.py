# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Lengths and centroids against rationals at all scales."""

from fractions import Fraction
import math

import numpy as np
import pytest
from sat_collision import Polygon, separation
from sat_collision.geometry.numeric.vectors import centroid, length
import shapes

SCALES = -1060, -600, -2, 0, 300, 600, 1020


@pytest.mark.parametrize('exponent', SCALES)
def test_length_is_right_to_an_ulp(exponent):
    """Also if squares overflow or underflow."""
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(300, 2)) * [1.0, 10.0 ** rng.integers(-12, 1)]
    for x, y in np.ldexp(vectors, exponent).tolist():
        square = Fraction(x) ** 2 + Fraction(y) ** 2
        ulp = Fraction(math.ulp(length(x, y)))
        assert (Fraction(length(x, y)) - ulp) ** 2 < square < (Fraction(length(x, y)) + ulp) ** 2
    assert length(0.0, 0.0) == 0.0
    assert length(-3.0, 4.0) == length(4.0, 3.0) == 5.0


@pytest.mark.parametrize('exponent', SCALES)
def test_centroid_is_right_to_a_few_ulp_of_the_extent(exponent):
    rng = np.random.default_rng(2)
    for ring in np.ldexp(np.concatenate([shapes.polygons(rng, 20, n)[:, :9] for n in (9, 40)]),
                         exponent):
        x, y = exact_centroid(ring)
        found = centroid(ring.ravel(), len(ring))
        tolerance = 16 * math.ulp(abs(ring).max())
        assert abs(Fraction(found[0]) - x) <= tolerance
        assert abs(Fraction(found[1]) - y) <= tolerance


def exact_centroid(ring):
    points = [(Fraction(x), Fraction(y)) for x, y in ring.tolist()]
    area = x = y = 0
    for (ax, ay), (bx, by) in zip(points, points[1:] + points[:1]):
        cross = ax * by - ay * bx
        area, x, y = area + cross, x + cross * (ax + bx), y + cross * (ay + by)
    return x / (3 * area), y / (3 * area)


@pytest.mark.parametrize('ring, centre', [
    ([[2, 3]], (2, 3)), ([[0, 0], [2, 4]], (1, 2)), ([[0, 0], [3, 0], [0, 3]], (1, 1)),
    ([[0, 0], [4, 0], [4, 2], [0, 2]], (2, 1)),
    ([[0, 0], [1e-310, 0], [1e-310, 1e-310]], (2e-310 / 3, 1e-310 / 3)),
    ([[-1.7e308, -1.7e308], [1.7e308, -1.7e308], [1.7e308, 1.7e308], [-1.7e308, 1.7e308]],
     (0, 0)),
])
def test_simple_centroids(ring, centre):
    assert centroid(np.array(ring, float).ravel(), len(ring)) == pytest.approx(
        centre, rel=1e-12, abs=math.ulp(np.abs(ring).max()))


SLIVER = [(0.0, 254.4994643777963), (354.8568311893048, -376.71156683469275),
          (463.8794122799391, -570.6383840387703), (529.7585769268337, -687.822701197935),
          (1.836e-320, 254.4994643777963)]


def test_centroid_of_a_sliver_is_in_its_bounds():
    """Its area is below rounding, so that a quotient exceeded the largest double."""
    polygon = Polygon(SLIVER)
    min_x, min_y, max_x, max_y = polygon.bounds
    for x, y in (polygon.centroid, polygon.packed[0][:2]):
        assert min_x <= x <= max_x and min_y <= y <= max_y
    assert separation(polygon, [(0.0, 0.0)]) > 0.0

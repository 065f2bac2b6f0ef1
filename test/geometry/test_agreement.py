# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Different queries about two bodies agree at every magnitude.

Coordinates have all exponents, also within a body, so that some products overflow and others
underflow; the expected answers come from integers and rationals.
"""

from fractions import Fraction
import math

import numpy as np
import oracle
import pytest
from rationals import exact_depth, exact_distance
from sat_collision import (
    closest_points, intersects, Polygon, PolygonError, PolygonSet, separation, time_of_contact)
import shapes

EDGES_OF_RANGES = [-1074, -1022, -600, -540, -301, -300, 0, 300, 301, 490, 511, 512, 600, 1019]
LARGEST = Fraction(2) ** 1024


def random_shape(rng):
    """Return a point, a segment, a triangle, a comb, a star or a chevron, most of integers."""
    kind = rng.integers(6)
    if kind < 3:
        return rng.integers(-8, 9, (kind + 1, 2)).astype(float)
    if kind == 3:
        return shapes.comb(2) + rng.integers(-8, 9, 2)
    if kind == 4:
        return shapes.at_angles(np.sort(rng.uniform(0, 6.28, 6)), rng.uniform(0.2, 5, 6))
    return np.array([(-1, 0), (0, 0.5), (1, 0), (0, 3)]) * rng.integers(1, 4)


def random_exponents(rng):
    """Return exponents for x and y of both bodies: common, per body, or per coordinate."""
    one, two = rng.choice(EDGES_OF_RANGES, 2)
    if rng.random() < 0.5:
        one = two = rng.integers(-1074, 1020)
    return [(one, one), ((one, two), (one, two)), ((one, two), (two, one))][rng.integers(3)]


def random_pairs(seed, count):
    rng = np.random.default_rng(seed)
    while count > 0:
        a, b = random_shape(rng), random_shape(rng)
        first, second = random_exponents(rng)
        if rng.random() < 0.2:
            first, second = (rng.integers(-1074, 1020, body.shape) for body in (a, b))
        try:
            with np.errstate(all='ignore'):
                a, b = np.ldexp(a, first), np.ldexp(b, second)
            yield a, b, Polygon(a), Polygon(b)
            count -= 1
        except PolygonError:  # beyond the largest double, or self-intersecting after rounding
            pass


def exact_separation(p, q):
    """Return the separation of bodies in rationals."""
    if not oracle.intersects(p.vertices, q.vertices):
        return exact_distance(p, q)
    return -max(exact_depth(a, b) for a in p.parts for b in q.parts
                if oracle.intersects(a.vertices, b.vertices))


@pytest.mark.parametrize('seed', range(3))
def test_all_answers_agree(seed):
    """On intersection, separation, nearest rows, margins and times of contact."""
    met = apart = 0
    for a, b, p, q in random_pairs(seed, 100):
        value = separation(p, q)
        meet = intersects(p, q)
        assert meet is oracle.intersects(p.vertices, q.vertices) is not (value > 0.0)
        bodies = PolygonSet([p])
        assert bodies.nearest(q)[:2] == (0, value)
        assert time_of_contact(a, a, b, b) == (0.0 if meet else None)
        for margin in (5e-324, abs(value), math.nextafter(abs(value), 0.0), 1.0):
            if 0.0 < margin < math.inf:
                within = value <= margin
                assert bodies.rows_within(q, margin).tolist() == [0] * within
                assert time_of_contact(a, a, b, b, margin=margin) == (0.0 if within else None)
        met += meet
        apart += not meet
    assert met > 10 and apart > 10


@pytest.mark.parametrize('seed', range(2))
def test_separations_against_rationals(seed):
    """Within the usual bound, and infinite only beyond the largest double."""
    for _, _, p, q in random_pairs(seed, 60):
        value = separation(p, q)
        exact = exact_separation(p, q)
        if abs(exact) >= LARGEST:
            assert abs(value) == math.inf
            continue
        reach = Fraction(float(max(abs(p.vertices).max(), abs(q.vertices).max())))
        assert abs(Fraction(value) - exact) <= (
            abs(exact) / 2 ** 52 + reach / 2 ** 96 + Fraction(5e-324))
        assert np.isfinite(closest_points(p, q)).all()


def test_beyond_the_largest_double():
    """Such bodies are infinitely far apart, but the nearest one is still found."""
    far, origin = [(1.7e308, 1.7e308)], [(-1.7e308, 0.0)]
    assert separation(far, origin) == math.inf
    assert PolygonSet([far]).nearest(origin)[:2] == (0, math.inf)
    assert PolygonSet([far, [(0.0, 0.0)]]).nearest(origin)[:2] == (1, 1.7e308)
    assert PolygonSet([far]).rows_within(origin, 1.7e308).tolist() == []


def test_margin_of_the_smallest_double():
    a, b = [(0.0, 1e300), (5e-324, 1e300)], [(1e-323, 1e300)]
    assert separation(a, b) == 5e-324
    assert PolygonSet([a]).rows_within(b, 5e-324).tolist() == [0]
    assert PolygonSet([a]).nearest(b)[:2] == (0, 5e-324)
    assert time_of_contact(a, a, b, b, margin=5e-324) == 0.0

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The orientation of three points and the intersection of two segments, against rationals."""

from fractions import Fraction
import math
import random

import pytest
from sat_collision.geometry.numeric.predicates import orient, segments_meet


def orientation(a, b, c):
    return orient(*map(float, (*a, *b, *c)))


def exact_orientation(a, b, c):
    (ax, ay), (bx, by), (cx, cy) = (map(Fraction, p) for p in (a, b, c))
    determinant = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    return (determinant > 0) - (determinant < 0)


def point_of_any_size(rng):
    """Return a point whose coordinates range over all exponents of a double."""
    return tuple(rng.choice((-1, 1)) * math.ldexp(rng.uniform(0.5, 1), rng.randint(-1073, 1023))
                 for _ in range(2))


def unit_point(rng):
    return rng.uniform(-1, 1), rng.uniform(-1, 1)


def lattice_point(rng):
    return rng.randint(-3, 3) * 0.1, rng.randint(-3, 3) * 0.1


@pytest.mark.parametrize('point', [unit_point, lattice_point, point_of_any_size])
def test_orientation_is_exact(point):
    """For random, lattice and extreme points, a third of them nearly collinear."""
    rng = random.Random(1)
    for _ in range(5000):
        a, b, c = point(rng), point(rng), point(rng)
        if rng.random() < 0.3:
            t = rng.choice((0.5, 0.25, 2, 1 / 3))
            c = tuple(p + t * (q - p) for p, q in zip(a, b))
        if not all(map(math.isfinite, c)):
            continue
        expected = exact_orientation(a, b, c)
        assert orientation(a, b, c) == expected, (a, b, c)
        assert orientation(b, a, c) == -expected, (a, b, c)


def test_orientation_one_ulp_off_a_line():
    """The plain determinant is often wrong there."""
    wrong_when_plain = 0
    for i in range(64):
        for j in range(64):
            a = (0.5 + i * 2.0 ** -53, 0.5 + j * 2.0 ** -53)
            b, c = (12.0, 12.0), (24.0, 24.0)
            expected = exact_orientation(a, b, c)
            assert orientation(a, b, c) == expected
            plain = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            wrong_when_plain += (plain > 0) - (plain < 0) != expected
    assert wrong_when_plain > 100


def test_orientation_with_overflow_and_underflow():
    """With the largest and the smallest doubles."""
    huge, tiny = 1.7e308, 5e-324
    points = [(x, y) for x in (-huge, -tiny, 0.0, tiny, huge) for y in (-huge, 0.0, tiny, huge)]
    for a in points:
        for b in points:
            for c in points:
                assert orientation(a, b, c) == exact_orientation(a, b, c), (a, b, c)


def test_segments_meet_on_a_lattice():
    """Crossing, T, end to end, overlapping and apart; segments and points."""
    rng = random.Random(2)
    seen = set()
    for _ in range(20000):
        a, b, c, d = [(rng.randint(0, 3), rng.randint(0, 3)) for _ in range(4)]
        expected = _share_a_point(a, b, c, d)
        seen.add(expected)
        assert segments_meet(*map(float, a + b + c + d)) == expected, (a, b, c, d)
    assert seen == {True, False}


def _share_a_point(a, b, c, d):
    """Solve a + s (b - a) = c + t (d - c) in rational numbers, for s and t in [0, 1]."""
    u = (Fraction(b[0] - a[0]), Fraction(b[1] - a[1]))
    v = (Fraction(d[0] - c[0]), Fraction(d[1] - c[1]))
    w = (Fraction(c[0] - a[0]), Fraction(c[1] - a[1]))
    determinant = u[1] * v[0] - u[0] * v[1]
    if determinant != 0:
        s = (w[1] * v[0] - w[0] * v[1]) / determinant
        t = (u[0] * w[1] - u[1] * w[0]) / determinant
        return 0 <= s <= 1 and 0 <= t <= 1
    if u == (0, 0) and v == (0, 0):
        return a == c
    along = u if u != (0, 0) else v
    if along[0] * w[1] - along[1] * w[0] != 0:
        return False
    first = sorted(p[0] * along[0] + p[1] * along[1] for p in (a, b))
    second = sorted(p[0] * along[0] + p[1] * along[1] for p in (c, d))
    return first[0] <= second[1] and second[0] <= first[1]

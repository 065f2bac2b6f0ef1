# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Orientations, meeting segments, lengths, centroids and separating axes, in exact numbers."""

from fractions import Fraction
import itertools
import math
import random

from compiled import callable_here
import families
import numpy as np
import oracle
import pytest
from sat_collision import intersects, Polygon, separation
from sat_collision.geometry.body.layout import Packed
from sat_collision.geometry.numeric.predicates import orient, segments_meet
from sat_collision.geometry.numeric.vectors import centroid, length
from sat_collision.geometry.pair import separating_axis
from sat_collision.geometry.pair.separating_axis import MEET, SEPARATE, UNCERTAIN
import shapes

SCALES = -1060, -600, -2, 0, 300, 600, 1020


def orientation(a, b, c):
    return orient(*map(float, (*a, *b, *c)))


def exact_orientation(a, b, c):
    determinant = oracle.orientation(*([*map(Fraction, point)] for point in (a, b, c)))
    return (determinant > 0) - (determinant < 0)


COORDINATES = {
    'units': lambda rng: rng.uniform(-1, 1),
    'a lattice': lambda rng: rng.randint(-3, 3) * 0.1,
    'all exponents': lambda rng: rng.choice((-1, 1)) * math.ldexp(
        rng.uniform(0.5, 1), rng.randint(-1073, 1023)),
}


@pytest.mark.parametrize('number', COORDINATES.values(), ids=COORDINATES)
def test_orientation_is_exact(number):
    """Also of points a third of which are nearly collinear."""
    rng = random.Random(1)
    for _ in range(5000):
        a, b, c = ((number(rng), number(rng)) for _ in range(3))
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
            plain = oracle.orientation(a, b, c)
            wrong_when_plain += (plain > 0) - (plain < 0) != expected
    assert wrong_when_plain > 100


def test_orientation_with_overflow_and_underflow():
    """With the largest and the smallest doubles."""
    huge, tiny = 1.7e308, 5e-324
    points = [(x, y) for x in (-huge, -tiny, 0.0, tiny, huge) for y in (-huge, 0.0, tiny, huge)]
    for a, b, c in itertools.product(points, repeat=3):
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


@pytest.mark.parametrize('exponent', SCALES)
def test_length_is_right_to_an_ulp(exponent):
    """Also if squares overflow or underflow."""
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(300, 2)) * [1.0, 10.0 ** rng.integers(-12, 1)]
    for x, y in np.ldexp(vectors, exponent).tolist():
        square = Fraction(x) ** 2 + Fraction(y) ** 2
        ulp = Fraction(math.ulp(length(x, y)))
        assert (Fraction(length(x, y)) - ulp) ** 2 < square < (Fraction(length(x, y)) + ulp) ** 2
    assert [length(0.0, 0.0), length(-3.0, 4.0), length(4.0, 3.0)] == [0.0, 5.0, 5.0]


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
    ([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], (1.1, 1.1)),
    ([[5e5, 5e6], [5e5 + 3, 5e6], [5e5, 5e6 + 3]], (5e5 + 1, 5e6 + 1)),
    ([[0, 0], [1e-310, 0], [1e-310, 1e-310]], (2e-310 / 3, 1e-310 / 3)),
    ([[-1.7e308, -1.7e308], [1.7e308, -1.7e308], [1.7e308, 1.7e308], [-1.7e308, 1.7e308]],
     (0, 0)),
])
def test_simple_centroids(ring, centre):
    assert centroid(np.array(ring, float).ravel(), len(ring)) == pytest.approx(
        centre, rel=1e-15, abs=math.ulp(np.abs(ring).max()))


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


boxes_apart, find_separating_axis, hill_climb, support = callable_here(
    separating_axis.boxes_apart, separating_axis.find_separating_axis,
    separating_axis.hill_climb, separating_axis.support)
CONVEX = {**families.CONVEX, **families.EXTREME}
# Each double is a multiple of one over this.
WHOLE = 2 ** 1074


def packed(polygon):
    return Packed(polygon.packed[0], 0, polygon.packed[1])


@pytest.mark.parametrize('n', [4, 24])
@pytest.mark.parametrize('name', CONVEX)
def test_proved_answers_are_true(name, n):
    pairs = CONVEX[name](np.random.default_rng(1), 200, n)
    truth, _ = oracle.intersects_pairs(pairs)
    for (a, b), meet in zip(pairs, truth):
        p, q = packed(Polygon(a)), packed(Polygon(b))
        if boxes_apart(p, q):
            assert not meet
        else:
            assert find_separating_axis(p, q)[0] in (UNCERTAIN, MEET if meet else SEPARATE)


def test_most_pairs_take_few_axes():
    """Random pairs within 0.1 of touching are decided by doubles with about three axes."""
    for n in (4, 16, 64):
        pairs = families.near(np.random.default_rng(2), 300, n)
        found = [find_separating_axis(packed(Polygon(a)), packed(Polygon(b))) for a, b in pairs]
        assert UNCERTAIN not in [verdict for verdict, _, _, _ in found]
        assert np.mean([queries for _, _, _, queries in found]) < 4


def axes(rng, vertices):
    """Return axes at random, along the coordinates, and perpendicular to edges up to an ulp."""
    found = [*rng.normal(size=(4, 2)), (0.0, 1.0), (-1.0, 0.0), (0.0, -2.0 ** -500)]
    for i in rng.integers(0, len(vertices), 6):
        with np.errstate(over='ignore'):
            edge = vertices[i] - vertices[i - 1]
        for axis in (edge[::-1] * [1, -1], edge[::-1] * [-1, 1]):
            found += [axis, np.nextafter(axis, rng.choice([-1, 1], 2) * np.inf), axis * 2.0**-60]
    found = np.asarray(found, float)
    return found[np.isfinite(found).all(axis=1) & found.any(axis=1)].tolist()


def whole(number):
    """Return a double times WHOLE."""
    numerator, denominator = number.as_integer_ratio()
    return numerator * (WHOLE // denominator)


@pytest.mark.parametrize('n', [9, 24, 90])
@pytest.mark.parametrize('name', ['near', 'far_offsets', 'flat_arcs', *families.EXTREME])
def test_support_is_within_its_bound(name, n):
    """
    4 u M for few vertices, 25 u M for many, see docs/exactness.md.

    All is computed in integers.
    """
    rng = np.random.default_rng(3)
    certain = 0
    for pair in CONVEX[name](rng, 12, n):
        polygon = Polygon(pair[0])
        vertices = polygon.vertices
        exact = [(whole(x), whole(y)) for x, y in vertices.tolist()]
        largest = [max(abs(v[k]) for v in exact) for k in (0, 1)]
        for ux, uy in axes(rng, vertices) if len(vertices) > 2 else []:
            place = support(packed(polygon), ux, uy)
            if place < 0:
                continue
            certain += 1
            ux, uy = whole(ux), whole(uy)
            along = [x * ux + y * uy for x, y in exact]
            i = (place - len(polygon.packed[0])) // 2
            reach = abs(ux) * largest[0] + abs(uy) * largest[1]
            # The search proves nothing by a reach that overflows.
            if reach < 2 ** 1023 * WHOLE ** 2:
                bound = (4 if len(vertices) <= 16 else 25) * reach
                least = WHOLE ** 2 >> 1070
                assert (max(along) - along[i] - least) * 2 ** 53 <= bound
    assert certain > 50


def test_climb_does_not_stop_at_the_minimum():
    """Underflowing edges hide on which side of the boundary it began."""
    pairs = families.tiny_edges(np.random.default_rng(4), 2000, 24)
    assert [intersects(*pair) for pair in pairs] == oracle.intersects_pairs(pairs)[0].tolist()


@pytest.mark.parametrize('points, axis', [
    ([(-1.0, 1.0), (0.0, 0.0), (1.0, -1.0 + 2.0**-53), (3.0, 3.0)], (1.0, 1.0)),
    ([(-1.0, 0.0), (0.0, -2.0**-1060), (1.0, 0.0), (0.0, 3.0)], (0.0, 1.0))],
    ids=['rounding', 'underflow'])
def test_climb_from_a_flat_minimum_is_not_certain(points, axis):
    """Whether the edges there rise is lost; from elsewhere it leads to the summit."""
    polygon = Polygon(points)
    places = len(polygon.packed[0]) + np.arange(-2 * len(points), 0, 2)
    ends = [hill_climb(packed(polygon), place, *axis) for place in places.tolist()]
    assert {*ends} == {-1, places[np.argmax(polygon.vertices @ axis)]}


@pytest.mark.parametrize('count', [8192, 8224, 20000])
def test_more_vertices_than_the_table_can_index(count):
    """Most of them are on a short arc; points are just inside and outside."""
    angle = np.concatenate([np.linspace(3.2, 3.3, count - 32), np.linspace(3.3, 9.4, 33)[1:]])
    polygon = Polygon(shapes.at_angles(angle, 20.0), max_vertices=20000)
    vertices = polygon.vertices
    assert len(vertices) > 0.9 * count
    for i in (0, 1, len(vertices) // 2, len(vertices) - 40, *range(-34, 0)):
        edge = (vertices[i] + vertices[i - 1]) / 2
        assert intersects(polygon, [edge * (1 - 1e-9)])
        assert not intersects(polygon, [edge * (1 + 1e-9)])

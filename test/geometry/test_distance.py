# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Separation and closest points against rational arithmetic and `intersects`."""

from fractions import Fraction
import functools
import math

import families
import numpy as np
import oracle
import pytest
from rationals import exact_depth, exact_distance
from sat_collision import (
    closest_points, intersects, Polygon, PolygonError, PolygonSet, separation, time_of_contact)
from sat_collision.geometry.body.layout import Packed
from sat_collision.geometry.body.polygon import as_polygon
from sat_collision.geometry.pair.convex_distance import of_all_features
import separations
import shapes

U = Fraction(2.0 ** -53)
L_SHAPE = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)]


def random_convex(rng, count):
    angles = np.sort(rng.uniform(0, 2 * np.pi, count))
    return Polygon(shapes.at_angles(angles) * rng.uniform(0.5, 2))


def test_closest_points_realise_the_separation():
    """Apart, it is their distance; overlapping, the offset ends the overlap, up to 6 u reach."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        a, b = random_convex(rng, 6), random_convex(rng, 9)
        b = Polygon(b.vertices + rng.uniform(-3, 3, 2))
        value = separation(a, b)
        p, q = closest_points(a, b)
        assert np.hypot(*(q - p)) == pytest.approx(abs(value), abs=1e-14)
        if value < 0:
            move = [Fraction(t) - Fraction(s) for s, t in zip(p.tolist(), q.tolist())]
            moved = [(Fraction(x) + move[0], Fraction(y) + move[1])
                     for x, y in a.vertices.tolist()]
            assert -1e-13 < exact_depth(moved, b) <= 6 * U * math.ceil(abs(b.vertices).max() + 2)
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
    (L_SHAPE, [(1.5, 1.25), (2, 1.25), (2, 2), (1.5, 2)], 0.25),
    (L_SHAPE, [(3, 0.5), (5, 0.5), (5, 3), (3, 3)], -0.5),
], ids=['points', 'same point', 'collinear apart', 'collinear overlap', 'T', 'cross',
        'point inside', 'point on edge', 'corner to corner', 'diagonal', 'contained',
        'apart by the narrower gap in the corner of an L', 'on an arm of an L'])
def test_small_cases_are_exact(a, b, expected):
    """In either order."""
    assert separation(a, b) == expected
    assert separation(b, a) == expected


def test_sign_agrees_with_intersects_beside_a_slanted_edge():
    """Within an ulp the values are rounded, but the signs are exact."""
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


def error(a, b):
    """Return the error of a separation relative to the bound of lemmas 17 and 18."""
    p, q = as_polygon(a), as_polygon(b)
    value = separation(p, q)
    exact = -exact_depth(p, q) if intersects(p, q) else exact_distance(p, q)
    reach = Fraction(float(max(abs(p.vertices).max(), abs(q.vertices).max())))
    bound = 2 * U * abs(exact) + reach / 2 ** 96 + Fraction(5e-324)
    return float(abs(Fraction(value) - exact) / bound)


def errors(pairs):
    return [error(a, b) for a, b in pairs]


@pytest.mark.parametrize('a, b', [
    ([(0.9971251086117328, -0.2832643917770374), (0.2816151457115305, -0.9973103812128625)],
     [(-0.9973103812128692, 0.9729795531031207)]),
    ([(0.0, 0.0), (1.0, 1.0 + 2.0 ** -52), (0.5, 2.0)], [(1e8, 1e8 + 2.0 ** -26)]),
    ([(1e8, 0.1), (1e8 + 3.0, 0.1 + 2.0 ** -50), (1e8, 7.0)], [(1e8 + 1.0, 0.1 - 2.0 ** -55)]),
], ids=['segment and point', 'far away', 'almost on the edge'])
def test_error_is_relative_to_the_separation(a, b):
    """The first case erred by 9.8 ulp of the largest coordinate when an edge was rounded."""
    assert error(a, b) <= 1


@pytest.mark.parametrize('name, count, n', [
    *((name, 25, 4) for name in families.CONVEX),
    *((name, 60, 12) for name in families.EXTREME),
    *(pytest.param(name, 25, 20, marks=pytest.mark.long) for name in families.CONVEX)])
def test_every_family_is_accurate_to_two_u(name, count, n):
    family = {**families.CONVEX, **families.EXTREME}[name]
    assert max(errors(family(np.random.default_rng(3), count, n))) <= 1


@pytest.mark.parametrize('exponent', [-1060, -1000, -400, 400, 1015, 1021])
def test_accuracy_is_the_same_at_every_scale(exponent):
    """Squares of coordinates underflow or overflow."""
    for name in ('near', 'containment', 'hair_gaps'):
        pairs = families.CONVEX[name](np.random.default_rng(4), 15, 7)
        assert max(errors([np.ldexp(pair, exponent) for pair in pairs])) <= 1


def nearly_flat_pairs(rng, count):
    """Return bodies facing each other with edges and angles of very different sizes."""
    pairs = []
    for _ in range(count):
        steps = 10.0 ** rng.uniform(-9, 0, (2, 4))
        bodies = []
        for x, turn in zip(steps, 10.0 ** rng.uniform(-12, -1, (2, 4))):
            slope = np.cumsum(turn) - rng.uniform(0, turn.sum())
            arc = np.cumsum(np.stack([x, x * slope], axis=1), axis=0)
            bodies.append(np.concatenate([[[0, 0]], arc, [[rng.uniform(0, 1), 1.0]]]))
        a, b = bodies
        b = rng.normal(0, 1e-4, 2) - b - [0, 10.0 ** rng.uniform(-6, 0)]
        pairs.append((shapes.hull(a), shapes.hull(b[:rng.choice([1, 2, 6])])))
    return pairs


def test_nearly_flat_edges():
    """If a step of the search gains less than rounding, it continues until the end is proved."""
    flat = [(0, 0), (.5, -1), (1, .9e-8), (1e-5, .89e-8)]
    assert separation(flat, [(0, 1)]) == pytest.approx(0.99999999115, rel=1e-15)
    assert max(errors(nearly_flat_pairs(np.random.default_rng(5), 300))) <= 1


def test_exhaustive_search_gives_the_same():
    """It is the fallback if the search proves nothing."""
    for a, b in nearly_flat_pairs(np.random.default_rng(6), 100):
        if not intersects(a, b):
            p, q = (Packed(body.packed[0], 0, body.packed[1]) for body in (Polygon(a), Polygon(b)))
            assert of_all_features(p, q).distance == separation(a, b)


@pytest.mark.parametrize('name', [
    'vertex_on_vertex', 'vertex_on_edge', 'edge_on_edge', 'rectangles_on_edge', 'near', 'one_ulp',
    'flat_arcs', 'points_and_segments', 'notched', 'interlocked_combs'])
def test_start_vertex_and_order_do_not_matter(name):
    """Bit by bit; touching bodies are 0 apart."""
    for a, b in families.ALL[name](np.random.default_rng(8), 100, 8):
        value = separation(a, b)
        points = np.array(closest_points(a, b))
        assert (value > 0) is not intersects(a, b)
        if value <= 0 and name in families.CONVEX:
            assert (value == 0) == (exact_depth(Polygon(a), Polygon(b)) == 0)
        for start in range(1, len(a)):
            assert separation(np.roll(a, start, axis=0), np.roll(b, 1, axis=0)) == value
        assert separation(b, a) == separation(b[::-1], a[::-1]) == value
        np.testing.assert_array_equal(closest_points(b, a), points[::-1])


def comb(rng, teeth):
    """Return a comb with teeth of random lengths, rotated and moved."""
    points = [(teeth, -1.0), (0.0, -1.0)]
    for k in range(teeth):
        points += [(k + 0.1, 0.0), (k + 0.5, rng.uniform(1.0, 9.0)), (k + 0.9, 0.0)]
    turn = rng.uniform(0.0, 6.3)
    rotation = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    return Polygon(np.array(points) @ rotation + rng.uniform(-8.0, 8.0, 2))


def brought_near(p, q):
    """Return positions of Q to the right of P where it just does not touch, and just does."""
    apart, near = q + [200.0, 0.0], q
    for _ in range(60):
        middle = (apart + near) / 2.0
        if intersects(p, middle):
            near = middle
        else:
            apart = middle
    return apart, near


@functools.cache
def pairs_of_combs(offset):
    """Return combs as they come, and where they just do not touch, and just do."""
    rng = np.random.default_rng(11)
    pairs = [[comb(rng, 9).vertices + offset for _ in range(2)] for _ in range(12)]
    return [(p, other) for p, q in pairs for other in (q, *brought_near(p, q))]


@pytest.mark.parametrize('offset', [0.0, 1e7])
@pytest.mark.parametrize('exponent', [-1072, -1060, -500, 0, 1000])
def test_separation_of_combs_is_that_of_their_parts(exponent, offset):
    """
    The boxes of parts exclude most pairs, but not the nearest or deepest.

    If products underflow, or rounding hides the gap, signs are still exact.
    """
    signs = set()
    for pair in pairs_of_combs(offset):
        a, b = (Polygon(np.ldexp(body, exponent)) for body in pair)
        value = separation(a, b)
        pairs = [separation(one, other) for one in a.parts for other in b.parts]
        assert value == min(pairs)
        assert (value > 0.0) is not intersects(a, b)
        signs.add(value > 0.0)
    assert signs == {True, False}


@pytest.mark.parametrize('chevron, triangle', [
    ([(-1.3470257304131207e+154, -1.9409088326164138e+154),
      (5.534778072850378e+153, -7.70939757822501e+153),
      (-5.3949860400449216e+153, -8.968405492341773e+153),
      (-5.027433780509143e+153, 2.9770378788302638e+153)],
     [(-1.3057823310169016e+154, -1.8315520586149776e+154),
      (-2.0079532640899622e+154, -1.5448405273359234e+154),
      (-2.346929348121509e+154, -1.296537767120873e+154)]),
    ([(-2.2689946580414223e+153, 1.2790628796182141e+154),
      (7.558167086309859e+153, 2.8707665967624867e+153),
      (3.721586521291773e+153, -5.630356855812684e+153),
      (1.9570647904739153e+154, 7.336913177613135e+153)],
     [(1.758489876996393e+154, 5.712227360182661e+153),
      (1.9539660555749752e+154, -6.04691597291164e+152),
      (3.5146132175943033e+154, 5.374045818774084e+153)]),
])
def test_touching_parts_with_overflowing_products(chevron, triangle):
    """One product overflows and another just does not."""
    assert intersects(chevron, triangle)
    assert separation(chevron, triangle) <= 0.0
    assert PolygonSet([chevron]).rows_within(triangle, 1.0).tolist() == [0]


@pytest.mark.parametrize('name', families.CONVEX)
def test_closest_points_and_axis_agree_with_the_separation(name):
    for a, b in families.CONVEX[name](np.random.default_rng(6), 15, 6):
        x = np.concatenate([Polygon(a).vertices, Polygon(b).vertices])
        for which in (separations.WAY, separations.AXIS):
            assert separations.exact(which, x.ravel(), len(Polygon(a).vertices)) <= 1


# Different queries about two bodies agree at every magnitude: coordinates have all exponents, also
# within a body, so that some products overflow and others underflow.
EDGES_OF_RANGES = [-1074, -1022, -600, -540, -301, -300, 0, 300, 301, 490, 511, 512, 600, 1019]


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


@pytest.mark.parametrize('seed', range(3))
def test_all_answers_agree(seed):
    """On intersection, separation, nearest rows, margins and times of contact."""
    met = apart = 0
    for a, b, p, q in random_pairs(seed, 100):
        value = separation(p, q)
        meet = intersects(p, q)
        assert meet is oracle.intersects(p.vertices, q.vertices) is not (value > 0.0)
        assert np.isfinite(closest_points(p, q)).all()
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

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The search for a separating axis proves only true answers; supports are within their bounds."""

from compiled import callable_here
import families
import numpy as np
import oracle
import pytest
from sat_collision import intersects, Polygon
from sat_collision.geometry.body.layout import Packed
from sat_collision.geometry.pair import separating_axis
from sat_collision.geometry.pair.separating_axis import MEET, SEPARATE, UNCERTAIN
import shapes

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

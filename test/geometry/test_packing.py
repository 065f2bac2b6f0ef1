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

"""Packed polygons: the disc is inside, the table points near, bytes and points pack alike."""

from fractions import Fraction

import families
import numpy as np
import oracle
import pytest
from rationals import twice_area
from sat_collision import intersects, Polygon
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.layout import (
    BOUNDS, FINGERPRINT, HEADER, near_support, Packed, packed_size, table_sector)
from sat_collision.geometry.packing import pack_convex
from sat_collision.geometry.polygon_set import PackedSet
import shapes


CONVEX = {**families.CONVEX, **families.EXTREME}


def disc(polygon):
    packed = np.asarray(polygon.packed[0])
    return packed[0], packed[1], packed[6]


@pytest.mark.parametrize('name', CONVEX)
def test_the_disc_is_inside(name):
    """Its centre is at least the radius away from the line of every edge, in rationals."""
    for pair in CONVEX[name](np.random.default_rng(1), 60, 7):
        for polygon in map(Polygon, pair):
            x, y, radius = map(Fraction, disc(polygon))
            ring = [(Fraction(a), Fraction(b)) for a, b in polygon.vertices.tolist()]
            for (ax, ay), (bx, by) in zip(ring, ring[1:] + ring[:1]):
                turn = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                square = (bx - ax) ** 2 + (by - ay) ** 2
                assert turn >= 0 and turn ** 2 >= radius ** 2 * square


def test_there_is_no_disc_where_a_height_overflows():
    """The height over the long edge is not known: no collision follows from the other two."""
    triangle = Polygon([(0, 0), (1e155, 1e155), (-1e150, 1e150)])
    assert disc(triangle)[2] == 0.0
    rng = np.random.default_rng(6)
    for point in rng.normal(size=(500, 2)) * 10.0 ** rng.uniform(149, 156, (500, 1)):
        body = point + np.array([(0, 0), (1e152, 0), (0, 1e152)])
        assert intersects(triangle, body) == oracle.intersects(triangle.vertices, body)


def test_there_is_no_disc_where_the_length_of_an_edge_is_not_known():
    """Of an edge of a few of the smallest doubles it is rounded to one of them, or to two."""
    tiny = 2.0 ** -1074
    polygon = Polygon([(-2.0**80, -2.0**80), (0, 0), (tiny, tiny * 2), (2.0**79, 2.0**81),
                       (-2.0**80, 2.0**80)])
    assert len(polygon.vertices) == 5 and polygon.is_convex
    assert disc(polygon)[2] == 0.0


def test_a_centre_near_the_largest_double():
    """The centroid is finite, and inside, where sums of coordinates are not."""
    polygon = Polygon([(1.2e308, 1.2e308), (1.7e308, 1.2e308), (1.7e308, 1.7e308)])
    assert disc(polygon)[:2] == pytest.approx(polygon.centroid)
    assert polygon.centroid == pytest.approx([1.7e308 - 5e307 / 3, 1.2e308 + 5e307 / 3])
    assert intersects(polygon, polygon.centroid[None])


def test_the_disc_of_a_full_body_is_worth_having():
    assert disc(Polygon([(0, 0), (4, 0), (4, 2), (0, 2)])) == pytest.approx((2, 1, 1))


@pytest.mark.parametrize('count', [17, 128, 129, 1000])
def test_the_table_points_near_the_support(count):
    """From where it points no more than a few of many vertices are left to climb."""
    polygon = Polygon(shapes.polygons(np.random.default_rng(2), 1, count)[0])
    vertices, packed = polygon.vertices, Packed(polygon.packed[0], 0, count)
    first = packed_size(count) - 2 * count
    for ux, uy in shapes.directions(np.random.default_rng(3), 300).tolist():
        near = (near_support(packed, table_sector(count, ux, uy)) - first) // 2
        support = int((vertices @ [ux, uy]).argmax())
        assert min((near - support) % count, (support - near) % count) <= max(2, count // 20)


def test_bytes_and_points_pack_alike():
    """Also what is not convex or refused: 0 vertices."""
    rng = np.random.default_rng(4)
    for kind in range(200):
        points = rng.integers(-9, 9, (rng.integers(1, 6), 3)).astype(np.float32)
        data = b'head' + points.tobytes()
        array = np.empty(packed_size(len(points)))
        count = pack_convex(data, 4, len(points), indexable(array), 1000)
        try:
            polygon = Polygon.from_float32(data, 4, len(points))
        except ValueError:
            assert count == 0
            continue
        assert polygon.vertices.tolist() == Polygon(points[:, :2]).vertices.tolist()
        assert count == (polygon.packed[1] if polygon.is_convex else 0)
        if count:
            assert array[:packed_size(count)].tolist() == list(polygon.packed[0])


def test_what_is_not_convex_ends_with_its_outline():
    outline = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
    polygon = Polygon(outline)
    packed = np.asarray(polygon.packed[0])
    assert packed[BOUNDS].tolist() == [0, 0, 3, 3]
    assert packed[int(packed[0]):int(packed[1])].reshape(-1, 2).tolist() == outline
    assert len(packed) == packed[1] and polygon.packed[1] == -len(polygon.parts)
    assert sum(twice_area(part.vertices) for part in polygon.parts) == twice_area(outline)


def test_equal_polygons_have_equal_fingerprints_and_others_not():
    rng = np.random.default_rng(5)
    rings = shapes.polygons(rng, 300, 6)
    prints = [np.asarray(Polygon(ring).packed[0])[FINGERPRINT] for ring in rings]
    assert prints == [np.asarray(Polygon(ring).packed[0])[FINGERPRINT] for ring in rings]
    assert len(set(prints)) == len(rings)
    assert HEADER > FINGERPRINT


def test_bodies_with_other_notches_have_other_fingerprints():
    """Two L-shapes with the same bounds and first vertex are different obstacles of one set."""
    shapes = [Polygon([(0, 0), (3, 0), (3, 3), (x, 3), (x, 1), (0, 1)]) for x in (1, 2)]
    first, second = (shape.packed[0][FINGERPRINT] for shape in shapes)
    assert first != second
    assert first == Polygon(shapes[0].vertices).packed[0][FINGERPRINT]


@pytest.mark.parametrize('corner', [8e306, -1.7e308, 1.7e308])
def test_fingerprints_of_large_bodies_are_numbers(corner):
    """Else the same body in a row would never be recognised, NaN being equal to nothing."""
    for ring in ([(0, 0), (1, 0), (1, -1)], [(0, 0), (1, 0), (1, 1), (0.5, 0.25)]):
        polygon = Polygon(np.array(ring) * corner)
        assert np.isfinite(polygon.packed[0][FINGERPRINT])
        again = Polygon(polygon.vertices).packed
        assert PackedSet([polygon]).place(0, again, PackedSet()) is None

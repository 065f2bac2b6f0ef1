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
"""A set of bodies answers like shapely while it grows, shrinks and is replaced in place."""

from bodies import as_shapely, random_body
import numpy as np
import pytest
from sat_collision import Polygon, PolygonError, PolygonSet
from sat_collision.geometry.polygon_set import PackedSet


def test_hits_follow_every_change_of_the_set():
    """Hundreds of bodies appended, replaced by larger and smaller ones, and removed."""
    rng = np.random.default_rng(1)
    bodies = PolygonSet()
    expected = {}
    for step in range(1500):
        action = rng.integers(3)
        if action == 0 or not expected:
            polygon = random_body(rng)
            row = bodies.append(polygon)
            assert row not in expected
            expected[row] = as_shapely(polygon)
        elif action == 1:
            row = int(rng.choice(list(expected)))
            polygon = random_body(rng)
            bodies.replace(row, polygon)
            expected[row] = as_shapely(polygon)
        elif rng.random() < 0.8:
            row = int(rng.choice(list(expected)))
            bodies.remove(row)
            del expected[row]
        assert len(bodies) == len(expected)
        if step % 10 == 0:
            footprint = random_body(rng)
            shape = as_shapely(footprint)
            assert bodies.intersecting_rows(footprint).tolist() == sorted(
                row for row, body in expected.items() if body.intersects(shape))


def test_memory_stays_bounded_while_bodies_are_replaced():
    """Ten bodies that change size ten thousand times need no more memory than at first."""
    rng = np.random.default_rng(2)
    sizes = (3, 40, 7, 120)
    circles = [Polygon(np.column_stack([np.cos(a), np.sin(a)]))
               for a in (np.linspace(0, 6, n) for n in sizes)]
    bodies = PolygonSet(circles[i % 4] for i in range(10))
    for i in range(1000):
        bodies.replace(i % 10, circles[rng.integers(4)])
    settled = bodies.nbytes
    for _ in range(10000):
        row = int(rng.integers(10))
        bodies.remove(row)
        assert bodies.append(circles[rng.integers(4)]) == row
    assert bodies.nbytes <= settled


def test_points_are_taken_for_bodies():
    """Wherever a set takes a body it takes its points, and says what is wrong with them."""
    near, far = np.array([(0, 0), (1, 0), (0, 1)]), [(8.0, 8.0), (9.0, 8.0), (8.0, 9.0)]
    bodies = PolygonSet([near, Polygon(far), near.astype(np.float32)])
    assert bodies.append(far) == 3
    bodies.replace(2, [(0.5, 0.25)])
    assert bodies.intersecting_rows(near).tolist() == [0, 2]
    assert bodies.intersects([(9, 8)]).tolist() == [False, True, False, True]
    assert bodies.rows_within([(1, 1)], 0.95).tolist() == [0, 2]
    assert bodies.nearest([(8, 7)])[:2] == (1, 1.0)
    with pytest.raises(PolygonError, match='vertex 1 is not finite'):
        PolygonSet([near, [(0, 0), (0, float('nan'))]])


def test_unchanged_body_is_recognised():
    """Placing the very same vertices again says so; one that differs by an ulp is another."""
    body = Polygon([(0, 0), (4, 0), (4, 4), (2, 1)])
    moved = Polygon([(0, 0), (4, 0), (4, 4), (2, np.nextafter(1, 2))])
    bodies = PackedSet([body])
    others = PolygonSet([[(3, 1)], [(9, 9)]])
    assert bodies.place(0, body.packed, others) is None
    assert bodies.place(0, moved.packed, others) == [0]
    assert bodies.polygon(0).vertices.tolist() == moved.vertices.tolist()
    assert bodies.place(0, body.packed, others, 9.0) == [0, 1]


def test_hidden_rows_meet_nothing_until_they_are_filled_anew():
    """They stay in use: no other body is given their rows."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    bodies = PackedSet([square, square, square])
    bodies.hide([0, 2])
    assert bodies.intersecting_rows(square).tolist() == [1]
    assert bodies.append(square) == 3
    bodies.place(2, Polygon(square).packed, bodies)
    assert bodies.intersecting_rows(square).tolist() == [1, 2, 3]


@pytest.mark.parametrize('row', [2, 9, 100000, -1, -2])
@pytest.mark.parametrize('use', [lambda bodies, row: bodies.replace(row, [(0, 0)]),
                                 PolygonSet.remove, PolygonSet.polygon])
def test_rows_that_are_not_there_are_refused(use, row):
    """With the row and how many there are; the set stays as it is."""
    bodies = PolygonSet([[(0, 0)], [(1, 1)]])
    with pytest.raises(IndexError, match=f'no row {row} in a set of 2 rows'):
        use(bodies, row)
    assert bodies.intersects([(0, 0), (1, 1)]).tolist() == [True, True]


def test_rows_without_a_body_are_refused():
    """A row that is removed twice is given to one later body only, and none is lost."""
    bodies = PolygonSet([[(0, 0)], [(1, 1)]])
    bodies.remove(0)
    for use in (PolygonSet.remove, PolygonSet.polygon,
                lambda bodies, row: bodies.replace(row, [(0, 0)])):
        with pytest.raises(IndexError, match='row 0 of a set of 2 rows has no body'):
            use(bodies, 0)
    assert [bodies.append([(2, 2)]), bodies.append([(3, 3)])] == [0, 2]
    assert len(bodies) == 3
    with pytest.raises(TypeError, match='integer'):
        bodies.remove(0.5)
    bodies.remove(np.int32(2))
    assert bodies.intersecting_rows([(0, 0), (4, 4)]).tolist() == [0, 1]


def test_a_body_that_is_refused_changes_nothing():
    """Neither a row nor the number of rows."""
    bodies = PolygonSet([[(0, 0)]])
    for use in (bodies.append, lambda body: bodies.replace(0, body)):
        with pytest.raises(PolygonError, match='no points'):
            use([])
    assert len(bodies) == 1 and bodies.intersects([(0, 0)]).tolist() == [True]


def test_what_trusts_its_caller_is_not_public():
    """Rows are checked in all that a user of the library sees."""
    assert not {'place', 'place_run', 'hide', 'new_row'} & {*dir(PolygonSet)}
    assert not hasattr(Polygon, 'of_packed')

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Sets of bodies: changes, pairs with another set, and queries by one body."""

import math

from bodies import as_shapely, random_body
import numpy as np
import pytest
from sat_collision import (
    intersects, intersects_many, intersects_pairs, Polygon, PolygonError, PolygonSet, separation)
from sat_collision.geometry.body.layout import packed_sizes
from sat_collision.geometry.body.packing import workspace
from sat_collision.geometry.body.polygon import UNMOVED
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.geometry.sets.run import IN_ONE_MESSAGE
import shapely
import shapes

SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]


def test_random_changes_of_a_set():
    """Bodies are appended, replaced by larger and smaller ones, and removed."""
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


def test_memory_is_bounded_while_bodies_are_replaced():
    rng = np.random.default_rng(2)
    circles = [Polygon(shapes.at_angles(np.linspace(0, 6, n))) for n in (3, 40, 7, 120)]
    bodies = PolygonSet(circles[i % 4] for i in range(10))
    for i in range(1000):
        bodies.replace(i % 10, circles[rng.integers(4)])
    settled = bodies.nbytes
    for _ in range(10000):
        row = int(rng.integers(10))
        bodies.remove(row)
        assert bodies.append(circles[rng.integers(4)]) == row
    assert bodies.nbytes <= settled


def test_points_are_accepted_as_bodies():
    """In all methods that take a body."""
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


@pytest.mark.parametrize('skipped', [np.array([False, False, True]), [0.0], ['0'], [None]])
def test_rows_to_skip_are_integers(skipped):
    """A mask would leave out rows 0 and 1."""
    bodies = PolygonSet([[(0, 0)], [(1, 0)], [(50, 0)]])
    with pytest.raises(TypeError):
        bodies.nearest([(0, 0)], skipped)
    assert bodies.nearest([(0, 0)], [np.uint8(0), -1, 2**70, 7])[0] == 1


def test_unchanged_body_is_recognised():
    """A difference of an ulp is a change."""
    body = Polygon([(0, 0), (4, 0), (4, 4), (2, 1)])
    moved = Polygon([(0, 0), (4, 0), (4, 4), (2, np.nextafter(1, 2))])
    bodies = PackedSet([body])
    others = PolygonSet([[(3, 1)], [(9, 9)]])
    assert bodies.place(0, body.packed, others) is None
    assert bodies.place(0, moved.packed, others) == [0]
    assert bodies.polygon(0).vertices.tolist() == moved.vertices.tolist()
    assert bodies.place(0, body.packed, others, 9.0) == [0, 1]


def test_hidden_rows_have_no_contacts_until_placed():
    """No other body is given their rows."""
    bodies = PackedSet([SQUARE] * 3)
    bodies.hide(indexable(np.array([0, -1, 2])))
    assert bodies.intersecting_rows(SQUARE).tolist() == [1]
    assert bodies.append(SQUARE) == 3
    bodies.place(2, Polygon(SQUARE).packed, bodies)
    assert bodies.intersecting_rows(SQUARE).tolist() == [1, 2, 3]


def test_rows_keep_their_space_while_the_set_grows():
    """Those that are hidden, or wait for their first body; those that were removed may lose it."""
    bodies = PackedSet([SQUARE] * 3)
    bodies.hide(indexable(np.array([0])))
    bodies.remove(2)
    waiting, = bodies.new_rows(np.array([50]))
    for k in range(200):
        bodies.append([(k, 5), (k + 1, 5), (k, 6)])
    assert [int(bodies._rows.space[row]) for row in (0, 1, waiting)] == packed_sizes(
        np.array([4, 4, 50])).tolist()
    assert bodies.intersecting_rows(SQUARE).tolist() == [1]


def test_runs_take_the_same_polygons_as_are_taken_one_by_one():
    """Also where points are repeated or on a line but for rounding, and where edges overflow."""
    rng = np.random.default_rng(3)
    bodies, none = PackedSet(), PackedSet()
    rows = {room: indexable(np.array(bodies.new_rows(np.array([room])))) for room in (12, 20)}
    taken = 0
    for _ in range(5000):
        most, room = int(rng.choice([5, 20])), int(rng.choice([*rows]))
        kind = rng.integers(3)
        if kind == 0:
            points = rng.integers(-2, 3, (rng.integers(1, 7), 2)).astype(float)
        elif kind == 1:
            points = shapes.regular(rng, 1, int(rng.integers(3, 22)))[0]
        else:
            line = rng.integers(1, 99, 2) + np.outer([1, 2, 9], rng.integers(1, 999, 2))
            points = np.vstack([0.1 * line, line[0] + (0, 9999)])
        points = points[::rng.choice([1, -1])] * rng.choice([1.0, -1.0, 5e-324, 1e-200, 7e303])
        if rng.random() < 0.2:
            points = np.vstack([points, points[:1]])
        spans = indexable(np.array([0, len(points)]))
        unmoved = 1.0, 0.0, -0.0, 0.0, 1.0, -0.0
        run = points.tobytes(), spans, 0, IN_ONE_MESSAGE, unmoved, most, workspace(most)
        bodies.hide(rows[room])
        if bodies.place_run(run, rows[room], 0, 1, none, 0.0):
            body = bodies.polygon(rows[room][0])
            alone = Polygon(points, most)
            assert body == alone and alone.is_convex and len(body.vertices) <= room
            assert str(body.bounds) == str(alone.bounds)
            assert not np.signbit(body.vertices[body.vertices == 0.0]).any()
            taken += 1
        elif len(points) <= min(room, most + 1):
            try:
                assert not Polygon(points, most).is_convex
            except PolygonError:
                pass
    assert 2000 < taken < 4500


def test_run_with_a_workspace_that_is_too_small_is_refused():
    """Beyond it there is other memory."""
    points = np.array([(0, 0), (1, 0), (0, 1)], float)
    polygons = points.tobytes(), indexable(np.array([0, 3])), 0, IN_ONE_MESSAGE, UNMOVED
    bodies = PackedSet()
    where = indexable(np.array(bodies.new_rows(np.array([3])))), 0, 1, PackedSet(), 0.0
    with pytest.raises(ValueError, match='workspace'):
        bodies.place_run((*polygons, 64, workspace(3)), *where)
    assert bodies.place_run((*polygons, 3, workspace(3)), *where) == 1


@pytest.mark.parametrize('row, error, words', [
    *((row, TypeError, 'integer') for row in (1.0, True, np.True_)),
    *((row, IndexError, f'no row {row} in a set of 2 rows') for row in (2, 9, 100000, -1, -2)),
    pytest.param(0, IndexError, 'row 0 of a set of 2 rows has no body', id='removed')])
@pytest.mark.parametrize('use', [
    lambda bodies, row: bodies.replace(row, [(0, 0)]), PolygonSet.remove, PolygonSet.polygon])
def test_invalid_rows_are_refused(use, row, error, words):
    """The set does not change; a row removed twice is reused once."""
    bodies = PolygonSet([[(0, 0)], [(1, 1)]])
    bodies.remove(np.int32(0))
    with pytest.raises(error, match=words):
        use(bodies, row)
    assert bodies.intersects([(0, 0), (1, 1)]).tolist() == [False, True]
    assert [bodies.append([(2, 2)]), bodies.append([(3, 3)])] == [0, 2] and len(bodies) == 3


def test_refused_body_changes_nothing():
    bodies = PolygonSet([[(0, 0)]])
    for use in (bodies.append, lambda body: bodies.replace(0, body)):
        with pytest.raises(PolygonError, match='no points'):
            use([])
    assert len(bodies) == 1 and bodies.intersects([(0, 0)]).tolist() == [True]


def test_unchecked_methods_are_not_public():
    assert not {'place', 'place_run', 'hide', 'new_row'} & {*dir(PolygonSet)}
    assert not hasattr(Polygon, 'of_packed')


@pytest.mark.parametrize('paired', [PolygonSet.intersects_pairs, PolygonSet.separations])
def test_pairs_are_of_two_sets_of_one_length(paired):
    bodies = [SQUARE] * 3
    with pytest.raises(ValueError, match='3 rows cannot be paired with 2'):
        paired(PolygonSet(bodies), PolygonSet(bodies[1:]))
    with pytest.raises(TypeError, match='a list, but .* a PolygonSet'):
        paired(PolygonSet(bodies), bodies)


def test_pairs_with_few_and_many_vertices():
    """Both kinds of search, several batches, and removed rows."""
    rng = np.random.default_rng(8)

    def body(_):
        if rng.random() < 0.2:
            return random_body(rng)
        ring = shapes.regular(rng, 1, rng.choice([3, 16, 17, 40, 129, 300]))[0]
        return Polygon(rng.uniform(0, 20, 2) + rng.uniform(1, 8) * ring)

    a, b = (list(map(body, range(700))) for _ in range(2))
    expected = np.array([intersects(p, q) for p, q in zip(a, b)])
    assert 200 < expected.sum() < 500
    first, second = PolygonSet(a), PolygonSet(b)
    answers = intersects_pairs(first, second)
    assert answers.dtype == np.bool_ and answers.tolist() == expected.tolist()
    for rows, bodies in ((range(0, 700, 7), first), (range(5, 700, 11), second)):
        for row in rows:
            bodies.remove(row)
            expected[row] = False
    np.testing.assert_array_equal(intersects_pairs(first, second), expected)


def test_intersects_many_accepts_a_set_or_points():
    rng = np.random.default_rng(4)
    others = [random_body(rng) for _ in range(300)]
    footprint = Polygon([(5, 5), (15, 5), (15, 8), (5, 8)])
    expected = [as_shapely(footprint).intersects(as_shapely(other)) for other in others]
    assert 0 < sum(expected) < 300
    assert intersects_many(footprint, PolygonSet(others)).tolist() == expected
    assert intersects_many(footprint.vertices,
                           [other.vertices for other in others]).tolist() == expected
    assert intersects_many(footprint, []).shape == (0,)


def test_nearest_and_within_a_margin():
    """In sets with removed rows."""
    rng = np.random.default_rng(5)
    apart = set()
    for _ in range(40):
        bodies = PolygonSet()
        others = {}
        for _ in range(30):
            other = random_body(rng)
            others[bodies.append(other)] = other
        for row in rng.choice(30, 12, replace=False).tolist():
            bodies.remove(row)
            del others[row]
        footprint = Polygon(rng.uniform(0, 20, 2) + [(0, 0), (0.3, 0), (0, 0.3)])
        expected = {row: separation(footprint, other) for row, other in others.items()}
        row, least, on_row, on_footprint = bodies.nearest(footprint)
        assert math.dist(on_row, on_footprint) == pytest.approx(abs(least), abs=1e-14)
        assert least == pytest.approx(min(expected.values()), abs=1e-14)
        assert expected[row] == pytest.approx(least, abs=1e-14)
        for margin in (0.0, 0.75, 4.0):
            assert bodies.rows_within(footprint, margin).tolist() == sorted(
                row for row, value in expected.items() if value <= margin)
        apart.add(least > 0)
    assert apart == {True, False}


@pytest.mark.parametrize('number', [np.float64, np.float32, np.int16, object])
@pytest.mark.parametrize('n', [1, 2, 3, 17, 300])
def test_sets_from_an_array(number, n):
    """As one by one, with and without z."""
    rng = np.random.default_rng(6)
    points = 100 * (rng.uniform(0, 50, (40, 1, 2)) + shapes.regular(rng, 40, n))
    points = points.astype(number)
    points[:n] += points[:n, ::-1]
    try:
        expected = PolygonSet(list(points))
    except PolygonError as error:
        with pytest.raises(PolygonError) as other:
            PolygonSet.from_array(points)
        assert (str(other.value), other.value.reason) == (str(error), error.reason)
        return
    bodies = PolygonSet.from_array(points)
    assert bodies == expected and len(bodies) == 40
    if n != 2:
        assert PolygonSet.from_array(np.append(points, points[..., :1], axis=2)) == expected
    assert bodies.append(points[0]) == 40
    bodies.replace(3, [(0, 0), (9, 0), (9, 9), (8, 1)])
    assert bodies.polygon(4) == expected.polygon(4)


def test_sets_from_a_ragged_array():
    """Not convex ones among them, and what shapely makes of them."""
    rng = np.random.default_rng(7)
    bodies = [random_body(rng) for _ in range(200)]
    expected = PolygonSet(bodies)
    points = np.concatenate([body.vertices for body in bodies])
    offsets = np.cumsum([0] + [len(body.vertices) for body in bodies])
    assert PolygonSet.from_array(points, offsets) == expected
    assert PolygonSet.from_array(points, offsets[50:]) == PolygonSet(bodies[50:])
    shapes = [as_shapely(body) for body in bodies]
    for kind in ('Polygon', 'LineString', 'Point'):
        some = [shape for shape in shapes if shape.geom_type == kind]
        assert len(some) > 5
        _, *ragged = shapely.to_ragged_array(some)
        assert PolygonSet.from_array(*ragged) == PolygonSet(some)
    assert len(PolygonSet.from_array(np.empty((0, 4, 2)))) == 0
    assert len(PolygonSet.from_array(np.empty((0, 2)), [0])) == 0


SQUARES = np.array([SQUARE] * 5, float)
BOW_TIE = np.insert(SQUARES, 3, [(0, 0), (1, 1), (1, 0), (0, 1)], axis=0)
NOT_FINITE = np.where(np.arange(5)[:, None, None] == 2, np.nan, SQUARES)


@pytest.mark.parametrize('arguments, words', [
    ((BOW_TIE,), 'body 3: the edge from .* meets the edge'),
    ((NOT_FINITE,), 'body 2: vertex 0 is not finite'),
    ((NOT_FINITE.reshape(-1, 2), [0, 4, 8, 11, 20]), 'body 2: vertex 0 is not finite'),
    ((BOW_TIE.astype(object),), 'body 3: the edge from'),
    ((np.where(SQUARES == 1, np.array(10 ** 400, object), 0),), 'body 0: a coordinate is beyond'),
    ((SQUARES.astype(str),), 'body 0: coordinates that are not numbers but str'),
    (([(0, 0, 0), (1, 1, 0), (0, 0, 0), (None, 1, 0)], [0, 2, 4]), 'body 1: .* not numbers'),
    ((np.ma.masked_equal(SQUARES, 1),), 'body 0: a masked array'),
    ((np.ones((4, 3, 5)),), r'body 0: points of shape \(3, 5\)'),
    ((np.empty((4, 0, 2)),), 'body 0: no points'),
    ((np.empty((0, 2)), [0, 0]), 'body 0: no points'),
    ((SQUARES[0], [0, 3, 3]), 'body 1: no points'),
    ((shapes.regular(np.random.default_rng(0), 3, 1025),), 'body 0: 1025 vertices, .* 1024'),
    (([[(0, 0)], [(0, 0), (1, 1)]],), 'not an array: .*inhomogeneous'),
    ((np.empty((3, 4, 0)),), r'an array of shape \(3, 4, 0\)'),
    ((SQUARES[0],), r'an array of shape \(4, 2\), expected \(m, n, 2\)'),
    ((SQUARES, [0, 4]), r'an array of shape \(5, 4, 2\)'),
    (shapely.to_ragged_array([shapely.box(0, 0, 1, 1), shapely.box(0, 0, 3, 3)
                              - shapely.box(1, 1, 2, 2)])[1:], 'body 1: .* holes'),
])
def test_invalid_arrays_are_refused(arguments, words):
    """The message names the body, as that of an invalid list does."""
    with pytest.raises(PolygonError, match=words):
        PolygonSet.from_array(*arguments)
    if len(arguments) == 1 and words[:4] == 'body':
        with pytest.raises(PolygonError, match=words):
            PolygonSet([*arguments[0]])


@pytest.mark.parametrize('offsets', [
    [0, 4, 3], [0, 5], [-1, 4], [0.0, 4.0], [], 3, [[0, 4]], ([0, 4], [0, 2]), ('0', '4'),
    ([0, 4], [0, 1], [0, 1])])
def test_invalid_offsets_are_refused(offsets):
    with pytest.raises(ValueError, match='offsets') as error:
        PolygonSet.from_array(SQUARES[0], offsets)
    assert not isinstance(error.value, PolygonError)

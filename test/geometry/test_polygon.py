# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Polygons: which rings are accepted, how they are cleaned, and their convex parts."""

import itertools
import re

import numpy as np
import oracle
from published import load
import pytest
from rationals import twice_area
from sat_collision import Polygon, PolygonError, Reason
import shapes

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
BOW_TIE = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]


def reason(points, **options):
    with pytest.raises(PolygonError) as error:
        Polygon(points, **options)
    return error.value.reason, str(error.value)


def test_counter_clockwise_square_is_kept():
    """The vertices are read-only doubles in the same order."""
    polygon = Polygon(SQUARE)
    assert polygon.vertices.tolist() == [list(p) for p in SQUARE]
    assert polygon.vertices.dtype == np.float64
    assert polygon.is_convex and polygon.parts == (polygon,)
    assert (*polygon.bounds, *polygon.centroid) == (0.0, 0.0, 2.0, 2.0, 1.0, 1.0)


def test_polygon_is_immutable():
    """Through its vertices, its attributes, or the array it was made from."""
    points = np.array(SQUARE)
    polygon = Polygon(points)
    points[0] = 9.0
    assert polygon.vertices[0].tolist() == [0.0, 0.0]
    with pytest.raises(ValueError):
        polygon.vertices[0, 0] = 1.0
    with pytest.raises(AttributeError):
        polygon.vertices = points
    with pytest.raises(AttributeError):
        polygon.colour = 'red'


REFUSED = {
    Reason.EMPTY: [[], [[]], np.zeros((0, 2)), np.zeros((0, 3), np.float32)],
    Reason.WRONG_SHAPE: [
        [1.0, 2.0], [[1.0]], [[1.0, 2.0, 3.0, 4.0]], [[1.0, 2.0], [3.0]], 'square', None, {},
        np.zeros((2, 2, 2)), [['a', 'b']], [[1j, 0]]],
    Reason.SELF_INTERSECTING: [
        [(0, 0), (4, 0), (4, 2), (4, 1), (0, 1)],  # a spike
        [(0, 0), (2, 0), (1, 0), (1, 1)],  # a spike along an edge
        [(0, 0), (4, 0), (2, 2), (4, 4), (0, 4), (2, 2)],  # touches itself in a vertex
        [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)],  # touches an edge
        [(0, 0), (2, 0), (1, 2), (0, 0), (2, 0), (1, 2), (1, 1)],  # twice around
        # A pentagram turns only to the left.
        shapes.at_angles(4 * np.pi / 5 * np.arange(5))]}


@pytest.mark.parametrize('expected, points', [
    (kind, points) for kind, bodies in REFUSED.items() for points in bodies])
def test_points_that_make_no_polygon_are_refused(expected, points):
    assert reason(points)[0] is expected


@pytest.mark.parametrize('points, expected, words', [
    ([(10 ** 400, 0)], Reason.NOT_FINITE, 'beyond the largest double'),
    (np.ma.array(SQUARE, mask=[(False, True)] * 4), Reason.WRONG_SHAPE, 'masked'),
    *(([*SQUARE[:3], (0.0, value)], Reason.NOT_FINITE, 'vertex 3')
      for value in (np.nan, np.inf, -np.inf)),
    (BOW_TIE, Reason.SELF_INTERSECTING, '(0.5, 0.5)')])
def test_message_names_what_is_wrong(points, expected, words):
    kind, message = reason(points)
    assert kind is expected and words in message


def test_limit_of_vertices_counts_cleaned_ones():
    """The closing vertex does not count."""
    circle = shapes.at_angles(np.linspace(0, 2 * np.pi, 1024, endpoint=False))
    assert len(Polygon(np.vstack([circle, circle[:1]])).vertices) == 1024
    kind, message = reason(shapes.at_angles(np.linspace(0, 2 * np.pi, 1025, endpoint=False)))
    assert kind is Reason.TOO_MANY_VERTICES and '1024' in message
    assert reason(SQUARE, max_vertices=3)[0] is Reason.TOO_MANY_VERTICES
    assert Polygon(SQUARE, 10 ** 30) == Polygon(SQUARE)


@pytest.mark.parametrize('order', [*itertools.permutations(range(4))])
def test_crossing_is_reported_with_its_edges(order):
    """Also for the edge back to the first vertex."""
    corners = [(5, 5), (6, 5), (6, 6), (5, 6)]
    points = [corners[k] for k in order]
    try:
        Polygon(points)
    except PolygonError as error:
        found = re.findall(r'\((\S+), (\S+)\)', str(error))
        ends = [tuple(map(float, point)) for point in found[:4]]
        assert sorted(ends) == corners[:1] + [corners[3]] + corners[1:3]
        assert tuple(map(float, found[4])) == (5.5, 5.5)
    else:
        assert abs(order[0] - order[2]) == 2


def crosses(ring):
    """Tell in integers whether two non-adjacent edges share a point, or one folds back."""
    grid, = oracle.integers(ring)
    edges = list(zip(grid, grid[1:] + grid[:1]))
    for i, (a, b) in enumerate(edges):
        c = edges[(i + 1) % len(edges)][1]
        if oracle.orientation(a, b, c) == 0 and any(
                (p - q) * (r - q) > 0 for p, q, r in zip(a, b, c)):
            return True
        for j in range(i + 2, len(edges) - (i == 0)):
            if oracle._segments_meet(a, b, *edges[j]):
                return True
    return False


@pytest.mark.parametrize('points, vertices', [
    (SQUARE[::-1], 4),
    (SQUARE + SQUARE[:1], 4),
    ([p for p in SQUARE for _ in range(3)], 4),
    ([(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2), (0, 1)], 4),
    ([(1, 0), (2, 0), (2, 2), (0, 2), (0, 0)], 4),
    ([(x, y, float('nan')) for x, y in SQUARE], 4),
    ([(x, y, None) for x, y in SQUARE], 4),
    (np.array(SQUARE, np.float32), 4),
    (np.array(SQUARE, int), 4),
    ([(1, 1)], 1),
    ([(1, 1)] * 5, 1),
    ([(0, 0), (1, 1)], 2),
    ([(0, 0), (1, 1), (0, 0)], 2),
    ([(1, 1), (3, 3), (0, 0), (2, 2)], 2),
    ([(-0.0, 0.0), (0.0, -0.0)], 1),
], ids=['clockwise', 'closed', 'repeated', 'collinear', 'first collinear', 'z ignored', 'no z',
        'float32', 'integers', 'point', 'repeated point', 'segment', 'there and back',
        'collinear only', 'signed zeros'])
def test_rings_are_cleaned(points, vertices):
    """Superfluous vertices are dropped, and the order becomes counter-clockwise."""
    polygon = Polygon(points)
    assert len(polygon.vertices) == vertices
    assert polygon.is_convex
    if vertices < 4:
        assert polygon.vertices.tolist() == [list(min(points)), list(max(points))][:vertices]
    else:
        assert sorted(polygon.vertices.tolist()) == sorted(map(list, SQUARE))
        assert twice_area(polygon.vertices) == 8


@pytest.mark.parametrize('ring', [
    SQUARE, [(0, 0), (4, 0), (4, 4), (2, 1)], [(1, 1), (0, 3), (0, 2)], [(2, 1), (0, 0)],
    [(1, 1), (3, 3), (0, 0), (2, 2)]],
    ids=['square', 'non-convex', 'two leftmost', 'segment', 'collinear'])
def test_smallest_vertex_comes_first(ring):
    """The packed polygon does not depend on the start or the direction."""
    expected = np.asarray(Polygon(ring).packed[0]).tolist()
    assert Polygon(ring).vertices[0].tolist() == list(min(ring))
    for start in range(len(ring)):
        for step in (1, -1):
            again = Polygon(np.roll(np.array(ring, float), start, axis=0)[::step])
            assert np.asarray(again.packed[0]).tolist() == expected


def test_crossing_by_one_ulp_is_found():
    """A vertex just inside the opposite edge is valid, on the edge it is not."""
    below = np.nextafter(1.0, 0.0)
    ring = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0)]
    assert Polygon([*ring[:2], (4.0, 1.0), (2.0, 5e-324), (0.0, 1.0)]).is_convex is False
    assert reason([*ring[:2], (4.0, 1.0), (2.0, 0.0), (0.0, 1.0)])[0] is Reason.SELF_INTERSECTING
    assert len(Polygon([*ring[:3], (2.0, below), (0.0, 1.0)]).vertices) == 5


@pytest.mark.parametrize('span', [4, 12, 1000])
@pytest.mark.parametrize('count', [4, 7, 12])
def test_random_rings(count, span):
    """On a lattice, where many rings touch themselves."""
    rng = np.random.default_rng(count)
    answers = set()
    for _ in range(400):
        ring = rng.integers(0, span, (count, 2)).astype(float)
        if rng.random() < 0.5:
            ring = ring[np.argsort(np.arctan2(*(ring - ring.mean(axis=0)).T), kind='stable')]
        ring = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
        if len(ring) < 3 or np.linalg.matrix_rank(ring - ring[0]) < 2:
            continue
        expected = crosses(ring)
        answers.add(expected)
        if expected:
            assert reason(ring)[0] is Reason.SELF_INTERSECTING
        else:
            assert twice_area(Polygon(ring).vertices) == abs(twice_area(ring))
    assert answers == {True, False}


def check_parts(polygon, own):
    """Check that parts are convex, have no new vertices and exactly the area of the whole."""
    own = set(map(tuple, np.asarray(own).tolist()))
    for part in polygon.parts:
        assert part.is_convex and set(map(tuple, part.vertices.tolist())) <= own
    total = sum(twice_area(part.vertices) for part in polygon.parts)
    assert total == twice_area(polygon.vertices)
    return total / 2


@pytest.mark.parametrize('count', [5, 9, 40])
def test_parts_of_random_stars(count):
    """They are few."""
    rng = np.random.default_rng(count)
    for _ in range(20):
        angles = (np.arange(count) + rng.uniform(0, 0.9, count)) * 2 * np.pi / count
        radii = rng.uniform(0.2, 1.0, count)
        star = Polygon(shapes.at_angles(angles, radii))
        check_parts(star, star.vertices)
        edges = np.roll(star.vertices, -1, axis=0) - star.vertices
        after = np.roll(edges, -1, axis=0)
        reflex = int((edges[:, 0] * after[:, 1] < edges[:, 1] * after[:, 0]).sum())
        assert len(star.parts) <= 2 * reflex + 1


def test_parts_of_an_l_shape_and_of_published_outlines():
    """With holes cut open, recesses and spirals."""
    polygon = Polygon(L_SHAPE)
    assert not polygon.is_convex and len(polygon.parts) == 2
    assert check_parts(polygon, L_SHAPE) == 5
    for case in load('outlines')['simple']:
        points = np.array(case['polygon'], float)
        area = check_parts(Polygon(points, max_vertices=len(points)), points)
        assert area == abs(twice_area(points)) / 2 and float(area) == pytest.approx(case['area'])

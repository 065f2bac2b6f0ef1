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

"""From received points to a clean ring: what is dropped, and what is refused."""

import numpy as np
import oracle
import pytest
from rationals import twice_area
from sat_collision import Polygon, PolygonError, Reason

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]


def crosses(ring):
    """Tell in integers whether two edges that are no neighbours share a point, or fold back."""
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


def reason(points):
    with pytest.raises(PolygonError) as error:
        Polygon(points)
    return error.value.reason


@pytest.mark.parametrize('points, vertices', [
    (SQUARE[::-1], 4),
    (SQUARE + SQUARE[:1], 4),
    ([p for p in SQUARE for _ in range(3)], 4),
    ([(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2), (0, 1)], 4),
    ([(1, 0), (2, 0), (2, 2), (0, 2), (0, 0)], 4),
    ([(x, y, float('nan')) for x, y in SQUARE], 4),
    (np.array(SQUARE, np.float32), 4),
    (np.array(SQUARE, int), 4),
    ([(1, 1)], 1),
    ([(1, 1)] * 5, 1),
    ([(0, 0), (1, 1)], 2),
    ([(0, 0), (1, 1), (0, 0)], 2),
    ([(1, 1), (3, 3), (0, 0), (2, 2)], 2),
    ([(-0.0, 0.0), (0.0, -0.0)], 1),
], ids=['clockwise', 'closed', 'repeated', 'collinear', 'first collinear', 'z ignored', 'float32',
        'integers', 'point', 'repeated point', 'segment', 'there and back', 'collinear only',
        'signed zeros'])
def test_what_is_cleaned(points, vertices):
    """Superfluous vertices go, the order becomes counter-clockwise, points and segments stay."""
    polygon = Polygon(points)
    assert len(polygon.vertices) == vertices
    assert polygon.is_convex
    if vertices == 4:
        assert sorted(polygon.vertices.tolist()) == sorted(map(list, SQUARE))
        assert twice_area(polygon.vertices) == 8


@pytest.mark.parametrize('ring', [
    SQUARE, [(0, 0), (4, 0), (4, 4), (2, 1)], [(1, 1), (0, 3), (0, 2)], [(2, 1), (0, 0)]],
    ids=['square', 'notched', 'two leftmost', 'segment'])
def test_the_least_vertex_goes_first(ring):
    """Whatever the start and the order, the packed polygon is the same to the last bit."""
    expected = np.asarray(Polygon(ring).packed[0]).tolist()
    assert Polygon(ring).vertices[0].tolist() == list(min(ring))
    for start in range(len(ring)):
        for step in (1, -1):
            again = Polygon(np.roll(np.array(ring, float), start, axis=0)[::step])
            assert np.asarray(again.packed[0]).tolist() == expected


def test_collinear_points_become_the_whole_segment():
    """The ends of a segment are the extreme points, wherever they stand in the message."""
    assert Polygon([(1, 1), (3, 3), (0, 0), (2, 2)]).vertices.tolist() == [[0, 0], [3, 3]]


@pytest.mark.parametrize('points', [
    [(0, 0), (4, 0), (4, 2), (4, 1), (0, 1)],
    [(0, 0), (2, 0), (1, 0), (1, 1)],
    [(0, 0), (4, 0), (2, 2), (4, 4), (0, 4), (2, 2)],
    [(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)],
    [(0, 0), (2, 0), (1, 2), (0, 0), (2, 0), (1, 2), (1, 1)],
    [(np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)) for k in range(5)],
], ids=['spike', 'spike along an edge', 'touches in a vertex', 'touches an edge',
        'twice around', 'pentagram'])
def test_boundary_that_meets_itself_is_refused(points):
    """All turns may be to the left, as in a pentagram, and yet the boundary crosses itself."""
    assert reason(points) is Reason.SELF_INTERSECTING


def test_crossing_by_one_ulp_is_found():
    """A vertex a hair inside the opposite edge is fine, on it or beyond it is not."""
    below = np.nextafter(1.0, 0.0)
    ring = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0)]
    assert Polygon([*ring[:2], (4.0, 1.0), (2.0, 5e-324), (0.0, 1.0)]).is_convex is False
    assert reason([*ring[:2], (4.0, 1.0), (2.0, 0.0), (0.0, 1.0)]) is Reason.SELF_INTERSECTING
    assert len(Polygon([*ring[:3], (2.0, below), (0.0, 1.0)]).vertices) == 5


@pytest.mark.parametrize('span', [4, 12, 1000])
@pytest.mark.parametrize('count', [4, 7, 12])
def test_random_rings(count, span):
    """On a lattice, where many only touch themselves: refused just when two edges meet."""
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
            assert reason(ring) is Reason.SELF_INTERSECTING
        else:
            assert twice_area(Polygon(ring).vertices) == abs(twice_area(ring))
    assert answers == {True, False}

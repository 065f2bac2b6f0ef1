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

"""What makes a polygon, what does not, and what is told of one."""

import itertools
import re

import numpy as np
import pytest
from sat_collision import Polygon, PolygonError, Reason

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
BOW_TIE = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)]


def reason(points, **options):
    with pytest.raises(PolygonError) as error:
        Polygon(points, **options)
    return error.value.reason, str(error.value)


def test_counter_clockwise_square_is_kept_as_it_is():
    """Nothing to clean: the same vertices in the same order, as read-only doubles."""
    polygon = Polygon(SQUARE)
    assert polygon.vertices.tolist() == [list(p) for p in SQUARE]
    assert polygon.vertices.dtype == np.float64
    assert polygon.is_convex and polygon.parts == (polygon,)
    assert polygon.bounds == (0.0, 0.0, 2.0, 2.0)
    assert polygon.centroid.tolist() == [1.0, 1.0]


def test_polygon_cannot_be_changed():
    """Neither through its vertices, nor its attributes, nor the array it was made from."""
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


@pytest.mark.parametrize('points', [[], [[]], np.zeros((0, 2)), np.zeros((0, 3), np.float32)])
def test_empty_is_refused(points):
    """No points at all."""
    assert reason(points)[0] is Reason.EMPTY


@pytest.mark.parametrize('points', [
    [1.0, 2.0], [[1.0]], [[1.0, 2.0, 3.0, 4.0]], [[1.0, 2.0], [3.0]], 'square', None, {},
    np.zeros((2, 2, 2)), [['a', 'b']], [[1j, 0]]])
def test_wrong_shape_is_refused(points):
    """What is not an array of points in the plane or in space."""
    assert reason(points)[0] is Reason.WRONG_SHAPE


def test_what_no_double_holds_is_refused():
    """Neither an OverflowError nor a guess at what stands behind a mask."""
    assert reason([(10 ** 400, 0)])[0] is Reason.NOT_FINITE
    kind, message = reason(np.ma.array(SQUARE, mask=[(False, True)] * 4))
    assert kind is Reason.WRONG_SHAPE and 'masked' in message


@pytest.mark.parametrize('value', [float('nan'), float('inf'), -float('inf')])
def test_vertex_that_is_not_finite_is_named(value):
    """The message tells which of the received vertices it is."""
    kind, message = reason([*SQUARE[:3], (0.0, value)])
    assert kind is Reason.NOT_FINITE and 'vertex 3' in message


def test_crossing_is_named():
    """A bow-tie's two edges meet in its middle."""
    kind, message = reason(BOW_TIE)
    assert kind is Reason.SELF_INTERSECTING and '(0.5, 0.5)' in message


def test_limit_on_vertices_counts_what_is_left():
    """1024 vertices by default; the closing vertex does not count."""
    angles = np.linspace(0, 2 * np.pi, 1024, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    assert len(Polygon(np.vstack([circle, circle[:1]])).vertices) == 1024
    angles = np.linspace(0, 2 * np.pi, 1025, endpoint=False)
    kind, message = reason(np.column_stack([np.cos(angles), np.sin(angles)]))
    assert kind is Reason.TOO_MANY_VERTICES and '1024' in message
    assert reason(SQUARE, max_vertices=3)[0] is Reason.TOO_MANY_VERTICES


def test_centroid_of_an_offset_triangle_and_of_a_segment():
    """The area centroid of a triangle is the mean of its vertices, of a segment its middle."""
    offset = np.array([500000.0, 5000000.0])
    assert np.allclose(Polygon(offset + [(0, 0), (3, 0), (0, 3)]).centroid, offset + 1.0,
                       rtol=0, atol=1e-9)
    assert Polygon([(1, 1), (3, 5)]).centroid.tolist() == [2.0, 3.0]
    assert Polygon(L_SHAPE).centroid.tolist() == pytest.approx([1.1, 1.1])


@pytest.mark.parametrize('order', [*itertools.permutations(range(4))])
def test_a_crossing_is_told_with_the_vertices_of_its_edges(order):
    """Of the edge back to the first vertex, too."""
    corners = [(5, 5), (6, 5), (6, 6), (5, 6)]
    points = [corners[k] for k in order]
    try:
        Polygon(points)
    except PolygonError as error:
        told = re.findall(r'\((\S+), (\S+)\)', str(error))
        ends = [tuple(map(float, point)) for point in told[:4]]
        assert sorted(ends) == corners[:1] + [corners[3]] + corners[1:3]
        assert tuple(map(float, told[4])) == (5.5, 5.5)
    else:
        assert abs(order[0] - order[2]) == 2

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

"""The one way to make a body: a checked, immutable polygon."""

import enum

import numpy as np

from sat_collision import ring
from sat_collision.decomposition import convex_parts
from sat_collision.jit import indexable
from sat_collision.record import BOUNDS, build, HEADER, record_size, unpack

MAX_VERTICES = 1024
_POINT_BYTES = 12


class Reason(enum.Enum):
    """Why points do not make a polygon."""

    EMPTY = 'empty'
    NOT_FINITE = 'not finite'
    SELF_INTERSECTING = 'self-intersecting'
    WRONG_SHAPE = 'wrong shape'
    TOO_MANY_VERTICES = 'too many vertices'


class PolygonError(ValueError):
    """
    Points that do not make a polygon.

    Attributes
    ----------
    reason : Reason
        What is wrong; the message names the vertex or the crossing.

    """

    def __init__(self, reason, message):
        super().__init__(message)
        self.reason = reason


class Polygon:
    """
    An immutable simple polygon, segment or point: a closed set in the plane.

    Repeated vertices, the closing vertex and collinear ones are dropped, clockwise order is
    reversed. Points that all lie on one line become a segment, equal points a single point; both
    are legal bodies.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array_like
        Vertices in order, in metres in the caller's frame; z is ignored.
    max_vertices : int, optional
        The most vertices accepted, counted after dropping the superfluous ones.

    Attributes
    ----------
    block : tuple
        What the kernels read, see `exact`: (flat float64 array, count). Not to be changed.

    Raises
    ------
    PolygonError
        Empty, wrong shape, a coordinate that is not finite, a boundary that crosses, touches or
        folds back on itself, or too many vertices.

    """

    __slots__ = ('block', '_outline', '_parts')

    def __init__(self, points, max_vertices=MAX_VERTICES):
        flat, width = _flat(points)
        record = np.empty(record_size(len(flat) // width))
        self._take(record, build(indexable(flat), width, indexable(record), max_vertices),
                   max_vertices)

    @classmethod
    def unpack(cls, data, max_vertices=MAX_VERTICES):
        """
        Make a polygon of what a message holds, without a detour by an array.

        Parameters
        ----------
        data : bytes
            x, y and z of each vertex as float32 in this machine's byte order.
        max_vertices : int, optional
            As for the constructor, as are the errors raised.

        """
        count = len(data) // _POINT_BYTES
        if count == 0:
            raise _empty()
        record = np.empty(record_size(count))
        polygon = cls.__new__(cls)
        values = indexable(np.frombuffer(data, np.float32))
        polygon._take(record, unpack(values, indexable(record), max_vertices), max_vertices)
        return polygon

    @classmethod
    def of_record(cls, record, count):
        """Make a convex polygon of the record that `record.build` has made of it."""
        polygon = cls.__new__(cls)
        polygon.block = record, count
        polygon._outline = polygon._parts = None
        return polygon

    def _take(self, record, built, max_vertices):
        """Become what was built, or raise what is wrong with it."""
        verdict, count, i, j, first = built
        end = first + 2 * count
        if end != len(record):
            record = record[:end]
        if verdict == ring.CONVEX:
            self.block = record, count
            self._outline = self._parts = None
        elif verdict == ring.NON_CONVEX:
            self._outline = record[first:]
            self._parts = _decompose(self._outline)
            self.block = _pack(record[:HEADER], self._parts), -len(self._parts)
        elif verdict == ring.TOO_MANY:
            raise PolygonError(Reason.TOO_MANY_VERTICES,
                               f'{count} vertices, but at most {max_vertices} are accepted')
        else:
            raise _error(verdict, record.reshape(-1, 2).tolist(), i, j)

    @property
    def vertices(self):
        """Vertices as a read-only (n, 2) float64 array, counter-clockwise; no closing vertex."""
        block, count = self.block
        outline = block[-2 * count:] if self._outline is None else self._outline
        vertices = outline.reshape(-1, 2)
        vertices.flags.writeable = False
        return vertices

    @property
    def parts(self):
        """Convex polygons that cover this one, without new vertices: a tuple, itself if convex."""
        # Made on demand: a polygon that held itself would be freed by the garbage collector only.
        return self._parts or (self,)

    @property
    def is_convex(self):
        """Whether the polygon is convex; points and segments are."""
        return self._parts is None

    @property
    def centroid(self):
        """Centre of gravity (x, y), (2,) array; of a segment its middle (paper section 2.2)."""
        first, *others = self.vertices
        if len(others) < 2:
            return first + (others[0] - first) / 2 if others else first.copy()
        fan = np.array(others) - first
        double_areas = fan[:-1, 0] * fan[1:, 1] - fan[:-1, 1] * fan[1:, 0]
        weights = double_areas / double_areas.sum()
        return first + weights @ (fan[:-1] + fan[1:]) / 3

    @property
    def bounds(self):
        """Bounding box (min_x, min_y, max_x, max_y) in metres."""
        return tuple(self.block[0][BOUNDS].tolist())

    def __repr__(self):
        return f'Polygon({self.vertices.tolist()})'


def _decompose(flat):
    vertices = flat.reshape(-1, 2)
    corners, ends = convex_parts(indexable(flat))
    return tuple(Polygon(vertices[part], len(part)) for part in np.split(corners, ends[:-1]))


def _pack(header, parts):
    """Return the block of a body that is not convex: header, table of parts, their records."""
    records = [part.block[0] for part in parts]
    starts = HEADER + 2 * len(parts) + np.cumsum([0] + [len(record) for record in records[:-1]])
    table = np.column_stack([starts, [part.block[1] for part in parts]])
    return np.concatenate([header, table.ravel(), *records])


def as_polygon(body):
    """Return a Polygon as it is, and make one from points."""
    return body if isinstance(body, Polygon) else Polygon(body)


def _flat(points):
    """Return the points' coordinates as a flat float64 array, and how many each point has."""
    try:
        array = np.asarray(points, dtype=None if hasattr(points, 'dtype') else np.float64)
        if array.size == 0 and array.ndim <= 2:
            raise _empty()
        if array.ndim != 2 or array.shape[1] not in (2, 3):
            raise PolygonError(Reason.WRONG_SHAPE,
                               f'points of shape {array.shape}, expected (n, 2) or (n, 3)')
        return array.astype(np.float64).ravel(), array.shape[1]
    except (TypeError, ValueError) as error:
        if isinstance(error, PolygonError):
            raise
        raise PolygonError(Reason.WRONG_SHAPE, f'not an array of points: {error}') from error


def _empty():
    return PolygonError(Reason.EMPTY, 'no points')


def _error(verdict, vertices, i, j):
    """Put into words what `ring.clean` found wrong."""
    if verdict == ring.NOT_FINITE:
        return PolygonError(Reason.NOT_FINITE, f'vertex {i} is not finite')
    if verdict == ring.SPIKE:
        x, y = vertices[i]
        return PolygonError(Reason.SELF_INTERSECTING,
                            f'the boundary folds back on itself at ({x:.9g}, {y:.9g})')
    a, b, c, d = (vertices[k % len(vertices)] for k in (i, i + 1, j, j + 1))
    x, y = _crossing(a, b, c, d)
    return PolygonError(
        Reason.SELF_INTERSECTING,
        f'the edge from ({a[0]:.9g}, {a[1]:.9g}) to ({b[0]:.9g}, {b[1]:.9g}) meets the edge from '
        f'({c[0]:.9g}, {c[1]:.9g}) to ({d[0]:.9g}, {d[1]:.9g}) at ({x:.9g}, {y:.9g})')


def _crossing(a, b, c, d):
    """Return where two segments that meet do so, rounded, for a message."""
    determinant = (b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0])
    if determinant == 0.0:
        return sorted((a, b, c, d))[1]
    t = ((c[0] - a[0]) * (d[1] - c[1]) - (c[1] - a[1]) * (d[0] - c[0])) / determinant
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])

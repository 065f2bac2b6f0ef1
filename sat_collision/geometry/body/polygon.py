# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bodies: validated, immutable polygons, segments and points; and the points of messages."""

from __future__ import annotations

import enum
import math
from numbers import Number
from operator import index
import sys
from typing import Any, Protocol, SupportsIndex, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sat_collision.geometry.body.convex_parts import convex_parts
from sat_collision.geometry.body.layout import BOUNDS, HEADER, packed_size
from sat_collision.geometry.body.packing import (
    CONVEX, moved_points, NON_CONVEX, NOT_FINITE, pack, pack_convex, SPIKE, TOO_MANY, TRIPLE,
    WORD, workspace)
from sat_collision.geometry.compiled.jit import COMPILED, indexable, KERNEL
from sat_collision.geometry.numeric.vectors import centroid

MAX_VERTICES = 1024
# As many as plain Python cuts into convex parts and measures in time, see docs/reliability.md.
_MAX_IN_TIME = 128
NOT_CONVEX = 'of a polygon that is not convex'
# Messages with more points than this times the max vertices are refused unread.
_POINTS_FOR_A_VERTEX = 8

# A packed polygon, see `layout`, and its count: the number of vertices if convex, else minus that
# of the convex parts. The array may be longer than the polygon.
PackedBody: TypeAlias = tuple[NDArray[np.float64], int]

# The affine map of (x, y) to (a x + b y + c, d x + e y + f) as a, b, c, d, e, f; c, f in metres.
Affine2D: TypeAlias = tuple[float, float, float, float, float, float]
UNMOVED: Affine2D = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)

# Bytes, the offset of the points in them, their number, and the numbers of each in this machine's
# byte order: PAIR, x and y as float64, or TRIPLE, x, y and z as float32. The offset is a multiple
# of a number's size.
Points: TypeAlias = tuple[bytes, int, int, int]


class Reason(enum.Enum):
    """
    Why points do not make a polygon.

    Examples
    --------
    >>> [reason.value for reason in Reason][:2]
    ['empty', 'not finite']

    """

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

    Examples
    --------
    >>> Polygon([(0, 0), (1, 1), (1, 0), (0, float('nan'))])
    Traceback (most recent call last):
    sat_collision.geometry.body.polygon.PolygonError: vertex 3 is not finite

    """

    def __init__(self, reason: Reason, message: str) -> None:
        super().__init__(message)
        self.reason = reason

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.reason, *self.args), self.__dict__


class Geometry(Protocol):
    """A geometry of shapely or another library that converts itself to one GeoJSON geometry."""

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """Type and coordinates."""


class Polygon:
    """
    An immutable simple polygon, segment or point: a closed set in the plane.

    Polygons are equal if their vertices are, and can be pickled.

    Repeated vertices, the closing vertex and vertices at which the boundary goes straight on are
    dropped, clockwise order is reversed, and the lexicographically least vertex (by x, then y)
    goes first. Points that all lie on one line become a segment, equal points a single point; both
    are valid bodies.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array_like, or geometry
        Vertices in order, in metres in the caller's frame; z is ignored. Or anything with a
        `__geo_interface__`, such as shapely's geometries: a Polygon without holes, a LinearRing, a
        LineString of two points or a Point. A Polygon of this library is copied.
    max_vertices : int, optional
        The most vertices accepted, counted after redundant ones are dropped.

    Attributes
    ----------
    packed : PackedBody
        The body as the kernels read it, see `layout`. Do not change it.

    Raises
    ------
    PolygonError
        No points, a wrong shape, values that are not numbers or not finite, holes, a boundary that
        crosses, touches or folds back on itself, or too many vertices.
    TypeError
        `max_vertices` is not an integer, such as holes, the second argument of shapely's Polygon.

    Examples
    --------
    >>> Polygon([(0, 2), (2, 2), (2, 0), (0, 0), (0, 2)])
    Polygon([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])

    """

    __slots__ = ('packed',)

    packed: PackedBody

    def __init__(self, points: BodyLike, max_vertices: int = MAX_VERTICES) -> None:
        try:
            limit = _limit_of(max_vertices)
        except TypeError:
            raise TypeError(f'max_vertices has to be an integer, but is {max_vertices!r}; holes '
                            'cannot be given: a body is all that its outline encloses') from None
        self._pack(points.vertices.copy() if isinstance(points, Polygon) else coordinates(points),
                   limit, limit)

    @classmethod
    def from_float32(cls, data: bytes, start: int, count: int, max_vertices: int = MAX_VERTICES,
                     max_non_convex: int | None = None, affine: Affine2D = UNMOVED) -> Polygon:
        """
        Make a polygon from the points of a serialised message.

        Parameters
        ----------
        data : bytes
        start, count : int
            Where in the data the points start, and how many there are: x, y and z of each as
            float32 in this machine's byte order.
        max_vertices : int, optional
            As for the constructor, which raises the same errors.
        max_non_convex : int, optional
            The most vertices accepted of a non-convex polygon, if fewer.
        affine : Affine2D, optional
            The affine map of the points to another frame.

        Raises
        ------
        ValueError
            The points are not all in the data.

        """
        size = TRIPLE * WORD * count
        if not 0 <= start <= start + size <= len(data):
            raise ValueError(f'{count} points from byte {start} on are not in {len(data)} bytes')
        limit = _limit_of(max_vertices)
        return cls._of_bytes((bytes(data[start:start + size]), 0, count, TRIPLE), limit,
                             limit if max_non_convex is None else _limit_of(max_non_convex),
                             affine)

    @classmethod
    def _of_bytes(cls, points: Points, max_vertices: int, max_non_convex: int,
                  affine: Affine2D) -> Polygon:
        """Make a polygon of points in bytes, moved by an affine map."""
        if points[2] == 0:
            raise _empty()
        polygon = cls.__new__(cls)
        polygon._pack(vertices_of(points, affine), max_vertices, max_non_convex)
        return polygon

    @classmethod
    def _of_packed(cls, packed: NDArray[np.float64], count: int) -> Polygon:
        """Make a polygon from a copy of the packed body at the start of an array."""
        polygon = cls.__new__(cls)
        polygon.packed = indexable(packed[:size_of((packed, count))].copy()), count
        return polygon

    def _pack(self, points: NDArray[np.float64], max_vertices: int, max_non_convex: int) -> None:
        """Pack (n, 2) points; raise `PolygonError` if they do not make a polygon."""
        array = np.empty(packed_size(len(points)))
        verdict, count, i, j, first = pack(indexable(points.ravel()), indexable(array),
                                           max_vertices, max_non_convex)
        end = first + 2 * count
        if verdict == CONVEX:
            self.packed = indexable(array[:end] if end != len(array) else array), count
        elif verdict == NON_CONVEX:
            self.packed = _packed_parts(array[:HEADER], array[first:end])
        elif verdict == TOO_MANY:
            limit = str(max_vertices)
            if count <= max_vertices:
                limit = f'{max_non_convex} {NOT_CONVEX}, in {KERNEL},'
            raise PolygonError(Reason.TOO_MANY_VERTICES,
                               f'{count} vertices, but at most {limit} are accepted')
        else:
            raise _error(verdict, array[:2 * count].reshape(-1, 2).tolist(), i, j)

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Vertices as a read-only (n, 2) float64 array, counter-clockwise; no closing vertex."""
        packed, count = self.packed
        packed = np.asarray(packed)
        outline = packed[-2 * count:] if count > 0 else packed[int(packed[0]):]
        vertices = outline.reshape(-1, 2)
        vertices.flags.writeable = False
        return vertices

    @property
    def parts(self) -> tuple[Polygon, ...]:
        """Convex polygons that cover this one, without new vertices; itself if it is convex."""
        packed, count = self.packed
        if count > 0:
            return self,
        array = np.asarray(packed)
        table = array[HEADER:HEADER - 2 * count].reshape(-1, 2).astype(int).tolist()
        return tuple(Polygon._of_packed(array[start:], part) for start, part in table)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The body as a GeoJSON geometry, for shapely's `shape` and other libraries."""
        ring = tuple(map(tuple, self.vertices.tolist()))
        if len(ring) > 2:
            return {'type': 'Polygon', 'coordinates': ((*ring, ring[0]),)}
        if len(ring) == 2:
            return {'type': 'LineString', 'coordinates': ring}
        return {'type': 'Point', 'coordinates': ring[0]}

    @property
    def is_convex(self) -> bool:
        """Whether the polygon is convex; points and segments are."""
        return self.packed[1] > 0

    @property
    def centroid(self) -> NDArray[np.float64]:
        """Centroid (x, y), (2,) array; for a segment its midpoint (paper section 2.2)."""
        vertices = self.vertices
        return np.array(centroid(indexable(vertices.flatten()), len(vertices)))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Bounding box (min_x, min_y, max_x, max_y) in metres."""
        min_x, min_y, max_x, max_y = self.packed[0][BOUNDS].tolist()
        return min_x, min_y, max_x, max_y

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Polygon):
            return NotImplemented
        return self.vertices.tobytes() == other.vertices.tobytes()

    def __hash__(self) -> int:
        return hash(self.vertices.tobytes())

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.vertices, len(self.vertices))

    def __repr__(self) -> str:
        return f'Polygon({self.vertices.tolist()})'


# What is accepted as a body: a Polygon, (n, 2) or (n, 3) points, or a geometry.
BodyLike: TypeAlias = Polygon | ArrayLike | Geometry


def max_in_time(max_vertices: int) -> int:
    """Return the max vertices of a non-convex polygon for a node, given those of any polygon."""
    return max_vertices if COMPILED else min(max_vertices, _MAX_IN_TIME)


class Packer:
    """Packs the points of messages, convex ones into an array used again each time."""

    def __init__(self, max_vertices: int, max_non_convex: int | None = None) -> None:
        self.max_vertices = max_vertices
        self._max_non_convex = max_vertices if max_non_convex is None else max_non_convex
        self.array = workspace(max_vertices)

    def pack(self, points: Points, affine: Affine2D = UNMOVED) -> PackedBody:
        """Return the body of points moved by an affine map, valid until the next call."""
        count = points[2]
        # One more, for a closing point; messages with even more points may be slow.
        if 0 < count <= self.max_vertices + 1:
            vertices = pack_convex(*points, self.array, self.max_vertices, affine)
            if vertices:
                return self.array, vertices
        limit = _POINTS_FOR_A_VERTEX * self.max_vertices
        if count > limit:
            raise PolygonError(Reason.TOO_MANY_VERTICES,
                               f'{count} points, of which at most {limit} are looked at')
        return Polygon._of_bytes(points, self.max_vertices, self._max_non_convex, affine).packed


def vertices_of(points: Points, affine: Affine2D | None = None) -> NDArray[np.float64]:
    """Return points in the order sent as (n, 2) array, moved by an affine map if given."""
    return np.asarray(moved_points(*points, affine or UNMOVED)).reshape(-1, 2)


def _packed_parts(header: NDArray[np.float64], outline: NDArray[np.float64]) -> PackedBody:
    """Pack a non-convex body: header, table of its convex parts, the parts, the outline."""
    vertices = outline.reshape(-1, 2)
    corners, ends = convex_parts(indexable(outline))
    parts = [Polygon(vertices[part], len(part)).packed for part in np.split(corners, ends[:-1])]
    arrays = [np.asarray(array) for array, _ in parts]
    starts = HEADER + 2 * len(parts) + np.cumsum([0] + [len(array) for array in arrays])
    table = np.column_stack([starts[:-1], [count for _, count in parts]])
    joined = np.concatenate([header, table.ravel(), *arrays, outline])
    joined[:2] = starts[-1], len(joined)
    return indexable(joined), -len(parts)


def size_of(body: PackedBody) -> int:
    """Return how many doubles of its array a packed body takes."""
    packed, count = body
    return int(packed_size(count) if count > 0 else packed[1])


def as_polygon(body: BodyLike) -> Polygon:
    """Return a Polygon unchanged; make one from any other body."""
    return body if isinstance(body, Polygon) else Polygon(body)


def coordinates(points: BodyLike) -> NDArray[np.float64]:
    """Return x and y of points in the order given, (n, 2); raise `PolygonError` if that fails."""
    if isinstance(points, Polygon):
        raise _wrong('a Polygon, which has dropped and reordered vertices: give its points')
    if is_geometry(points):
        points = _of_geometry(points)
    try:
        array = array_of(points)
    except ValueError as error:
        raise _wrong(str(error)) from error
    if array.size == 0 and array.ndim <= 2:
        raise _empty()
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise _wrong(f'points of shape {array.shape}, expected (n, 2) or (n, 3)')
    if array.shape == (2, 3):
        raise _wrong('points of shape (2, 3), which might be three points in columns: transpose '
                     'them, or give two points without z')
    try:
        return doubles(array[:, :2])
    except OverflowError as error:
        raise PolygonError(Reason.NOT_FINITE, f'a coordinate is {error}') from error
    except ValueError as error:
        raise _wrong(f'coordinates that are {error}') from error


def integer(value: SupportsIndex) -> int:
    """Return an integer; raise `TypeError` for any other value, True and False among them."""
    if isinstance(value, bool):
        raise TypeError(f'{value} is not an integer')
    return index(value)


def _limit_of(vertices: SupportsIndex) -> int:
    """Return how many vertices are accepted, an integer that kernels can take."""
    return min(integer(vertices), sys.maxsize)


def array_of(values: Any) -> NDArray[Any]:
    """Return what a user gives as an array; raise `ValueError` if it is none, or is masked."""
    if isinstance(values, np.ma.MaskedArray):
        raise ValueError('a masked array: fill what is masked, or drop it')
    try:
        return np.asarray(values)
    except Exception as error:  # raised by objects that pretend to be arrays
        raise ValueError(f'not an array: {error}') from error


def doubles(array: NDArray[Any]) -> NDArray[np.float64]:
    """
    Return numbers as doubles.

    Raise `ValueError` for what is not real numbers, such as text and truth values, and
    `OverflowError` for integers beyond the largest double.
    """
    if array.dtype.kind not in 'fiu' and not (array.dtype == object and all(
            isinstance(x, Number) and not isinstance(x, bool) for x in array.flat)):
        raise ValueError(f'not numbers but {array.dtype.name}')
    try:
        return array.astype(np.float64)
    except OverflowError as error:
        raise OverflowError(f'beyond the largest double: {error}') from error
    except TypeError as error:  # complex numbers among others
        raise ValueError(f'not real numbers: {error}') from error


def double(value: Any) -> float:
    """Return a number as a double, maybe infinite; NaN for what `doubles` refuses."""
    try:
        array = array_of(value)
        return math.nan if array.ndim else float(doubles(array))
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    except ValueError:
        return math.nan


def ends_of(offsets: Any, count: int) -> NDArray[np.int64]:
    """Return where points of bodies begin and the last ones end, see `PolygonSet.from_array`."""
    ends = np.arange(count + 1)
    levels: tuple[Any, ...] = offsets if isinstance(offsets, tuple) else (offsets,)
    for level in map(np.asarray, levels):
        if (len(levels) > 2 or level.ndim != 1 or level.dtype.kind not in 'iu' or not len(level)
                or level[0] < 0 or level[-1] >= len(ends) or (level[1:] < level[:-1]).any()):
            raise ValueError(f'offsets {offsets!r}, but they have to be ascending indices of '
                             'points, or as shapely has them for polygons, lines or points')
        ends = ends[level]
    if len(levels) == 2 and (holes := np.flatnonzero(np.diff(levels[1]) > 1)).size:
        raise PolygonError(Reason.WRONG_SHAPE, f'body {holes[0]}: a polygon with holes')
    return ends


def is_geometry(body: Any) -> bool:
    """Return whether an object has a `__geo_interface__`, even if reading it fails."""
    try:
        return hasattr(body, '__geo_interface__')
    except Exception:  # raised by the object
        return True


def _of_geometry(body: Any) -> list[Any]:
    """Return the points of a geometry that is one body, without z."""
    try:
        geometry = body.__geo_interface__
        kind = geometry['type']
        if kind not in ('Polygon', 'LinearRing', 'LineString', 'Point'):
            raise _wrong(f'a {kind}, but a body is one Polygon, LinearRing, LineString or Point')
        at = geometry['coordinates']
        if kind == 'Polygon':
            if len(at) > 1:
                raise _wrong('a polygon with holes: a body is all that its outline encloses; cut '
                             'it into polygons without holes')
            at = at[0] if len(at) else ()
        elif kind == 'Point':
            at = (at,) if len(at) else ()
        elif kind == 'LineString' and len(at) > 2:
            raise _wrong(f'a LineString of {len(at)} points: only segments are bodies, give each')
        return [tuple(point)[:2] for point in at]
    except PolygonError:
        raise
    except Exception as error:  # whatever another library does wrong
        raise _wrong('a __geo_interface__ that is not that of a GeoJSON geometry '
                     f'({type(error).__name__}: {error})') from error


def _wrong(message: str) -> PolygonError:
    return PolygonError(Reason.WRONG_SHAPE, message)


def _empty() -> PolygonError:
    return PolygonError(Reason.EMPTY, 'no points')


def _error(verdict: int, vertices: list[list[float]], i: int, j: int) -> PolygonError:
    """Return the error that says what `pack` found wrong."""
    if verdict == NOT_FINITE:
        return PolygonError(Reason.NOT_FINITE, f'vertex {i} is not finite')
    if verdict == SPIKE:
        x, y = vertices[i]
        return PolygonError(Reason.SELF_INTERSECTING,
                            f'the boundary folds back on itself at ({x:.9g}, {y:.9g})')
    a, b, c, d = (vertices[k % len(vertices)] for k in (i, i + 1, j, j + 1))
    x, y = _crossing(a, b, c, d)
    return PolygonError(
        Reason.SELF_INTERSECTING,
        f'the edge from ({a[0]:.9g}, {a[1]:.9g}) to ({b[0]:.9g}, {b[1]:.9g}) meets the edge from '
        f'({c[0]:.9g}, {c[1]:.9g}) to ({d[0]:.9g}, {d[1]:.9g}) at ({x:.9g}, {y:.9g})')


def _crossing(a: list[float], b: list[float], c: list[float],
              d: list[float]) -> tuple[float, float]:
    """Return the point at which two segments meet, rounded, for a message."""
    determinant = (b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0])
    if determinant == 0.0:
        x, y = sorted((a, b, c, d))[1]
        return x, y
    t = ((c[0] - a[0]) * (d[1] - c[1]) - (c[1] - a[1]) * (d[0] - c[0])) / determinant
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A body that moves between two poses, each vertex on a straight line at constant speed.

It is covered by the convex parts that it is cut into in one pose, each taken at any time as the
convex hull of its vertices. No point of the body is ever left out: its outline is the sum of the
parts' outlines, as edges that parts share are traversed in both directions; so if it winds around
a point, the outline of some part does, and the hull of that part has the point. The hulls cover
nothing else while the parts stay convex: always, if the body is rigid or convex all the way.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.convex_parts import convex_parts
from sat_collision.geometry.body.layout import convex_part, first_vertex
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.compiled.jit import (
    elements, indexable, inlined, inner, kernel, scratch, scratch_integers)
from sat_collision.geometry.numeric.predicates import orient
from sat_collision.geometry.numeric.vectors import bounds_of, joined, scale_to_one

# Doubles that a vertex takes: x and y at time 0, then at time 1.
STRIDE = 4
# Brings any coordinates to where nothing overflows.
_LEAST_SCALE = 2.0 ** -1000


class MovingBody(NamedTuple):
    """A moving body as the kernels of `sweep` read it."""

    # Flat array of float64: part after part, x, y at time 0 and x, y at time 1 of each vertex.
    array: Any
    ends: Any  # (k,) array of int64: the index at which each part ends


class Part(NamedTuple):
    """A convex part of a moving body, see `MovingBody`."""

    array: Any  # flat array of float64, or its `elements`: has its vertices, and maybe others
    first: int  # the indices at which they start and end
    end: int


def moving_body(start: NDArray[np.float64], end: NDArray[np.float64],
                polygon0: Polygon, polygon1: Polygon) -> MovingBody:
    """
    Return a moving body, cut into the convex parts of the pose that has more of them.

    A body that is flat or convex in one pose may not be so in the other. Given are its vertices at
    times 0 and 1, (n, 2) each, and the polygons that they make; `ValueError` if n differs.
    """
    if len(start) != len(end):
        raise ValueError(f'{len(start)} vertices at time 0, but {len(end)} at time 1: each '
                         'vertex needs a position at both')
    both = np.hstack([start, end])
    parts0, parts1 = (max(1, -polygon.packed[1]) for polygon in (polygon0, polygon1))
    polygon, pose = (polygon1, end) if parts1 > parts0 else (polygon0, start)
    if polygon.is_convex:
        ends = np.array([both.size])
    else:
        rows, ends = _rows_of_parts(pose, polygon)
        both = both[rows]
        ends = STRIDE * ends
    return MovingBody(indexable(both.ravel()), indexable(ends))


def _rows_of_parts(points: NDArray[np.float64],
                   polygon: Polygon) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the row of each point of each convex part, and where among them each part ends."""
    # A writable copy: for a read-only array kernels would be compiled again.
    outline = indexable(polygon.vertices.flatten())
    corners, ends = convex_parts(outline)
    points = indexable(points.ravel())
    rows = [np.flatnonzero(on_boundary(outline, indexable(part), points))
            for part in np.split(corners, ends[:-1])]
    return np.concatenate(rows), np.cumsum([len(part) for part in rows])


@kernel
def on_boundary(vertices, part, points):
    """Return for each point whether it is on the boundary of a part of the vertices; exact."""
    found = np.zeros(len(points) // 2, np.bool_)
    for k in range(len(part)):
        a = 2 * part[k - 1 if k > 0 else len(part) - 1]
        b = 2 * part[k]
        ax, ay = vertices[a], vertices[a + 1]
        bx, by = vertices[b], vertices[b + 1]
        for i in range(len(found)):
            x, y = points[2 * i], points[2 * i + 1]
            if (min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by)
                    and orient(ax, ay, bx, by, x, y) == 0):
                found[i] = True
    return found


@inner
def boxes_stay_apart(p, q, apart):
    """
    Return whether a horizontal or vertical strip is between two parts at all times.

    It is wider than `apart` and moves with them; exact if `apart` is 0.
    """
    p = Part(elements(p.array), p.first, p.end)
    q = Part(elements(q.array), q.first, q.end)
    return (_is_below(p, q, 0, apart) or _is_below(q, p, 0, apart)
            or _is_below(p, q, 1, apart) or _is_below(q, p, 1, apart))


@inner
def _is_below(p, q, axis, apart):
    """Return whether P is below Q by more than `apart` along axis 0 or 1 at times 0 and 1."""
    for k in (axis, axis + 2):
        most = -math.inf
        for i in range(p.first + k, p.end, STRIDE):
            most = max(most, p.array[i])
        for j in range(q.first + k, q.end, STRIDE):
            if not q.array[j] - most > apart:
                return False
    return True


@inner
def relative(a, b):
    """
    Return moving bodies, given by their arrays, relative to their least x and y at time 0.

    If the result is of extreme magnitude it is multiplied by a power of two, so that nothing
    overflows, and underflow has no visible effect. Returned with the arrays are the greatest
    relative coordinate before the multiplication, maybe infinite, and the power of two.
    """
    x = min(_least_coordinate(a, 0), _least_coordinate(b, 0))
    y = min(_least_coordinate(a, 1), _least_coordinate(b, 1))
    box = joined(bounds_of(a, len(a) // 2), *bounds_of(b, len(b) // 2))
    extent = max(box[2] - x, box[3] - y)
    scale = scale_to_one(extent) if extent < math.inf else _LEAST_SCALE
    return _relative_to(x, y, a, scale), _relative_to(x, y, b, scale), extent, scale


@inner
def parts_about(p, x, y, scale):
    """
    Return the convex parts of a packed body relative to x, y, times a power of two.

    They are as in a `MovingBody`, but without the places at time 1: only ends count those, too.
    """
    count = max(1, -p.n)
    ends = scratch_integers(count)
    end = 0
    for i in range(count):
        end += STRIDE * convex_part(p, i).n
        ends[i] = end
    array = scratch(end // 2)
    place = 0
    for i in range(count):
        part = convex_part(p, i)
        first = first_vertex(part)
        place = write_relative(Part(part.array, first, first + 2 * part.n), x, y, scale, array,
                               place)
    return MovingBody(array, ends)


@inlined
def write_relative(points, x, y, scale, array, place):
    """Write points, given as a Part, relative to x, y, times a power of two; return their end."""
    v = points.array
    before, after = min(scale, 1.0), max(scale, 1.0)
    for k in range(points.first, points.end, 2):
        array[place] = (v[k] * before - x * before) * after
        array[place + 1] = (v[k + 1] * before - y * before) * after
        place += 2
    return place


@inner
def _least_coordinate(array, k):
    """Return the least of the numbers at offset k of each vertex."""
    least = array[k]
    for i in range(k + STRIDE, len(array), STRIDE):
        least = min(least, array[i])
    return least


@inner
def _relative_to(x, y, array, scale):
    """Return the coordinates relative to x, y, multiplied by a power of two."""
    moved = scratch(len(array))
    write_relative(Part(array, 0, len(array)), x, y, scale, moved, 0)
    return moved

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

"""
Contacts of two bodies, touching or not: the normal, the points of contact, and the depth.

The normal is that of `distance.measure`: for two convex bodies the direction from the origin to
the nearest point on the boundary of their Minkowski difference, whether the origin is outside it
or inside. It is computed from an edge or from two vertices, so it is defined however near the
bodies are.

Where an edge of each faces the other, the edges are clipped against each other, as in physics
engines (E. Catto, Box2D); the two ends are the points of contact.

Non-convex bodies have the points of contact of their nearest, or deepest, pair of convex parts.
For the depth all pairs count: moved along a direction, each pair overlaps for an interval of
lengths, and the first length that is in no interval ends every overlap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.convex_distance import reach_of
from sat_collision.geometry.distance import goes_first, measure, open_pairs
from sat_collision.geometry.floating_point import require_nearest
from sat_collision.geometry.jit import inner, kernel, scratch
from sat_collision.geometry.layout import (
    convex_part, first_vertex, packed_polygon, vertex_after)
from sat_collision.geometry.plane import unit
from sat_collision.geometry.polygon import as_polygon, BodyLike
from sat_collision.geometry.separating_axis import support

# Sine of the greatest angle at which an edge counts as perpendicular to the normal: 1 cm per m.
FACING = 0.01
# Bound of the rounding error of a length, relative to the largest coordinate.
_ROUNDING = 2.0 ** -48
_LEAST = 5e-324
# How many of the deepest pairs of parts have their normals tried as directions out, and how many
# pushes, each along the normal of a pair, are added up for one more direction.
_WAYS = 16
_PUSHES = 16


class Contact(NamedTuple):
    """
    The contact of two bodies a and b, touching or not.

    Attributes
    ----------
    separation : float
        As returned by `separation`, metres: negative if they overlap.
    normal : (2,) ndarray
        Unit vector from b to a; defined for touching bodies, too.
    depth : float
        Metres, 0 unless they overlap: moved by depth * normal, a only touches b, up to rounding
        (2^-46 of the largest coordinate). For convex bodies it is minus the separation, and no
        shorter move suffices. For others it is the shortest move in the directions tried; none is
        shorter than minus the separation, the depth of the deepest pair of convex parts. A body
        that fits exactly into a notch has depth 0, a slightly larger one may have a large depth.
    points_a, points_b : (k, 2) ndarray
        One or two points of a, and of b, on the nearest or deepest pair of convex parts. Each is
        a vertex or a point of an edge, to 2^-50 of the largest coordinate: 1e-9 m at 1e6. Two if
        an edge of each is perpendicular to the normal, within 0.01 rad: the ends of the stretch
        that these share, in the order of the normal turned left. The offset from a point of b to
        that of a is along the normal of the two parts; for one of them it is the separation.

    Examples
    --------
    >>> contact([(0, 0), (2, 0)], [(1, 1), (3, 1)]).points_a
    array([[1., 0.],
           [2., 0.]])

    """

    separation: float
    normal: NDArray[np.float64]
    depth: float
    points_a: NDArray[np.float64]
    points_b: NDArray[np.float64]


def contact(a: BodyLike, b: BodyLike) -> Contact:
    """
    Return how two bodies touch, or would if they came nearer: normal, points and depth.

    A small change of the bodies changes the result little, except for the number of points, and
    where two moves out are equally short or two features equally near: the normal is one of both.

    Parameters
    ----------
    a, b : Polygon, (n, 2) array_like or geometry
        Polygons, segments or points, convex or not, in one frame; metres, below 8e307.

    Returns
    -------
    Contact
        For two points at the same place the normal is (-1, 0).

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    Examples
    --------
    >>> contact([(0, 0), (2, 0), (2, 2), (0, 2)], [(1, 1.75), (4, 1.75), (4, 5)]).depth
    0.25

    """
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    separation, depth, nx, ny, count, pairs = contact_of_arrays(p, n, q, m)
    points = np.array(pairs).reshape(2, 2, 2)[:count]
    return Contact(separation, np.array([nx, ny]) + 0.0, depth, points[:, 0], points[:, 1])


@kernel
def contact_of_arrays(p, n, q, m):
    """
    Return the contact of two packed bodies, each in an array of its own, with counts n and m.

    Returned are separation, depth and normal as in `Contact`, the number of points of contact,
    and the points: two tuples of x, y on P and x, y on Q.
    """
    require_nearest(n)
    p = packed_polygon(p, n)
    q = packed_polygon(q, m)
    # The bodies are put in a fixed order, so that ties do not depend on which is named first.
    if not goes_first(q, p):
        return _contact(p, q)
    least, depth, nx, ny, count, (one, other) = _contact(q, p)
    return least, depth, -nx, -ny, count, (_exchanged(other), _exchanged(one))


@inner
def _contact(p, q):
    """Return the contact of two bodies in this order."""
    least, a, b, found = _deciding_parts(p, q)
    nx = -found[4]
    ny = -found[5]
    count, pairs = _points_of_contact(a, b, found)
    depth = -least if least < 0.0 else 0.0
    if least <= 0.0 and (p.n < 0 or q.n < 0):
        depth, nx, ny = _way_out(p, q, depth)
    return least, depth, nx, ny, count, pairs


@inner
def _deciding_parts(p, q):
    """Return the separation, the convex parts that realise it, and their points and normal."""
    least, found = measure(p, q)
    if p.n > 0 and q.n > 0:
        return least, p, q, found
    parts = max(1, -q.n)
    best = math.inf
    a = convex_part(p, 0)
    b = convex_part(q, 0)
    # The next double, to include pairs whose boxes are exactly that far apart.
    for pair in open_pairs(p, q, np.nextafter(least, math.inf)):
        one = convex_part(p, pair // parts)
        other = convex_part(q, pair % parts)
        value, points = measure(one, other)
        if value < best:
            best = value
            found = points
            a = one
            b = other
    return least, a, b, found


@inner
def _points_of_contact(p, q, found):
    """
    Return the number of points of contact of two convex polygons, and two (the same if it is 1).

    They are the ends of the stretch where an edge of each faces the other, if both edges are
    perpendicular to the normal to within `FACING`, else the closest points.
    """
    x, y, qx, qy, ux, uy = found
    closest = (x, y, qx, qy)
    a, b = _level_edge(p, ux, uy)
    c, d = _level_edge(q, -ux, -uy)
    if a < 0 or c < 0:
        return 1, (closest, closest)
    # Positions along u turned left, relative to the closest points, which are both at 0.
    v = p.array
    w = q.array
    start = (v[a] - x) * -uy + (v[a + 1] - y) * ux
    end = (v[b] - x) * -uy + (v[b + 1] - y) * ux
    other_start = (w[c] - x) * -uy + (w[c + 1] - y) * ux
    other_end = (w[d] - x) * -uy + (w[d + 1] - y) * ux
    if not max(start, other_end) < min(end, other_start):
        return 1, (closest, closest)
    if start > other_end:
        low = _opposite(v, a, w, c, d, (start - other_start) / (other_end - other_start))
    else:
        low = _exchanged(_opposite(w, d, v, a, b, (other_end - start) / (end - start)))
    if end < other_start:
        high = _opposite(v, b, w, c, d, (end - other_start) / (other_end - other_start))
    else:
        high = _exchanged(_opposite(w, c, v, a, b, (other_start - start) / (end - start)))
    # The normal is from Q to P, opposite to u, so the order is reversed.
    return 2, (high, low)


@inner
def _level_edge(p, ux, uy):
    """Return start and end of the edge of P that faces u best; -1, -1 if none does to FACING."""
    v = p.array
    first = first_vertex(p)
    least = FACING
    start = end = -1
    for a in range(first, first + 2 * p.n if p.n > 1 else first, 2):
        b = vertex_after(p, a)
        ex, ey = unit(v[b] - v[a], v[b + 1] - v[a + 1])
        slant = abs(ex * ux + ey * uy)
        if ey * ux - ex * uy > 0.0 and slant <= least:
            least = slant
            start = a
            end = b
    return start, end


@inner
def _opposite(v, k, w, start, end, share):
    """Return a vertex of one body and the point at a fraction of an edge of the other."""
    return (v[k], v[k + 1], w[start] + share * (w[end] - w[start]),
            w[start + 1] + share * (w[end + 1] - w[start + 1]))


@inner
def _exchanged(pair):
    """Return a pair of points in reverse order."""
    return pair[2], pair[3], pair[0], pair[1]


@inner
def _way_out(p, q, depth):
    """
    Return the length and direction x, y of the shortest move found that takes P out of Q.

    The directions tried are the normals of the pairs of parts that overlap deepest, and that of
    their combined pushes. The depth is that of the deepest pair.
    """
    pairs = open_pairs(p, q, _LEAST)
    parts = max(1, -q.n)
    pushes = scratch(3 * len(pairs))
    count = 0
    for pair in pairs:
        a = convex_part(p, pair // parts)
        b = convex_part(q, pair % parts)
        value, found = measure(a, b)
        if value <= 0.0:
            pushes[count] = -value
            pushes[count + 1] = -found[4]
            pushes[count + 2] = -found[5]
            count += 3
    rounding = _ROUNDING * reach_of(p, q)
    best = math.inf
    ux, uy = unit(*_pushed(pushes, count))
    if ux != 0.0 or uy != 0.0:
        best = _length_out(p, q, ux, uy, rounding)
    for _ in range(min(_WAYS, count // 3)):
        deepest = 0
        for k in range(3, count, 3):
            if pushes[k] > pushes[deepest]:
                deepest = k
        pushes[deepest] = -1.0
        x = pushes[deepest + 1]
        y = pushes[deepest + 2]
        out = _length_out(p, q, x, y, rounding)
        if out < best:
            best, ux, uy = out, x, y
    return (depth if best <= depth + rounding else best), ux, uy


@inner
def _pushed(pushes, count):
    """Return the sum of pushes, each by the pair that overlaps most after those before."""
    x = 0.0
    y = 0.0
    for _ in range(_PUSHES):
        most = 0.0
        strongest = 0
        for k in range(0, count, 3):
            left = pushes[k] - (x * pushes[k + 1] + y * pushes[k + 2])
            if left > most:
                most = left
                strongest = k
        x += most * pushes[strongest + 1]
        y += most * pushes[strongest + 2]
    return x, y


@inner
def _length_out(p, q, ux, uy, rounding):
    """Return how far P has to be moved along a direction until no part overlaps one of Q."""
    rows = max(1, -p.n)
    columns = max(1, -q.n)
    intervals = scratch(2 * rows * columns)
    count = 0
    for i in range(rows):
        a = convex_part(p, i)
        for j in range(columns):
            enter, leave = _overlap_along(a, convex_part(q, j), ux, uy, rounding)
            if max(enter, 0.0) < leave:
                intervals[count] = enter
                intervals[count + 1] = leave
                count += 2
    out = 0.0
    moved = True
    while moved:
        moved = False
        for k in range(0, count, 2):
            # An interval that begins where another ends continues it, as for adjacent parts.
            if intervals[k] <= out + rounding and intervals[k + 1] > out:
                out = intervals[k + 1]
                moved = True
    return out


@inner
def _overlap_along(a, b, ux, uy, rounding):
    """Return the lengths between which A, moved along u, overlaps B; equal if it never does."""
    enter = -math.inf
    leave = math.inf
    if a.n == 1 and b.n == 1:
        return enter, enter
    for side, p, q in ((1.0, a, b), (-1.0, b, a)):
        v = p.array
        w = q.array
        first = first_vertex(p)
        for k in range(first, first + 2 * p.n if p.n > 1 else first, 2):
            end = vertex_after(p, k)
            ex, ey = unit(v[end] - v[k], v[end + 1] - v[k + 1])
            j = _furthest(q, -ey, ex)
            # How far Q reaches behind this edge, and by how much that grows per metre.
            reach = ex * (w[j + 1] - v[k + 1]) - ey * (w[j] - v[k])
            growth = side * (ux * ey - uy * ex)
            if reach <= rounding and growth <= 0.0:
                return leave, leave
            if growth > 0.0:
                enter = max(enter, (rounding - reach) / growth)
            elif growth < 0.0:
                leave = min(leave, -reach / growth)
    return enter, leave


@inner
def _furthest(p, ux, uy):
    """Return the index of the vertex of P furthest along u, up to rounding."""
    summit = support(p, ux, uy)
    if summit < 0:
        v = p.array
        summit = first_vertex(p)
        for k in range(summit, summit + 2 * p.n, 2):
            if (v[k] - v[summit]) * ux + (v[k + 1] - v[summit + 1]) * uy > 0.0:
                summit = k
    return summit

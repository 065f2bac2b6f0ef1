# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Contacts of two bodies, touching or not: the normal, the points of contact, and the depth.

The normal is the direction from the origin to the nearest point on the boundary of the bodies'
Minkowski difference, whether the origin is outside it or inside. For convex bodies, and others
that are apart, it is that of `distance.measure`, for others that overlap see `way_out`. It is
computed from an edge or from two vertices, so it is defined however near the bodies are.

Where an edge of each faces the other, the edges are clipped against each other, as in physics
engines (E. Catto, Box2D); the two ends are the points of contact.

Non-convex bodies have the points of contact of their nearest, or deepest, pair of convex parts.
If they only touch, cuts between parts must not count: a side is sought that they touch on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.layout import (
    convex_part, first_vertex, outline_of, packed_polygon, vertex_after, vertex_before)
from sat_collision.geometry.body.polygon import as_polygon, BodyLike
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import inlined, inner, kernel, scratch
from sat_collision.geometry.numeric.predicates import orient
from sat_collision.geometry.numeric.vectors import LEAST, unit
from sat_collision.geometry.pair.distance import goes_first, measure_parts
from sat_collision.geometry.pair.way_out import way_out

# Sine of the greatest angle at which an edge counts as perpendicular to the normal: 1 cm per m.
FACING = 0.01


class Contact(NamedTuple):
    """
    The contact of two bodies a and b, touching or not.

    Attributes
    ----------
    separation : float
        As returned by `separation`, metres: negative if they overlap.
    normal : (2,) ndarray
        Unit vector from b to a; defined for touching bodies, too. Of bodies that are not convex
        and only touch it is the normal of a side, outwards from b or inwards to a, on which a
        vertex of the other body is: of several such sides, one that is least against the others.
    depth : float
        Metres, 0 unless they overlap, that is, have more in common than their boundaries: moved by
        depth * normal, a only touches b. No shorter move suffices, in any direction, except into
        places into which a fits exactly. Up to rounding: with S the longer side of the bounding
        box of both, they share no point once moved further by 2^-45 S, and no shorter move leaves
        them 2^-44 S apart. For convex bodies it is minus the separation, for others no less.

        Only if more than about 4,000 pairs of convex parts are within reach, as may happen above
        64 vertices, do not all directions count: it is then the shortest move, along an axis or
        the normal of a side, after which a straight line lies between the bodies.
    points_a, points_b : (k, 2) ndarray
        One or two points of a, and of b, on the nearest or deepest pair of convex parts, or on
        the side that they touch on. Each is a vertex or a point of an edge, or of a cut between
        parts, to 2^-50 of the largest coordinate: 1e-9 m at 1e6. Two if an edge of each is
        perpendicular to the normal, within 0.01 rad: the ends of the stretch that these share, in
        the order of the normal turned left. The offset from a point of b to that of a is along
        the normal of the two parts, which for overlapping bodies that are not convex may be
        another one than `normal`; for one of them it is the separation.

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

    Two bodies of 64 vertices take at most about 20 ms. Two of 1,024 vertices take less than that,
    too, unless nearly all their parts are triangles: 60 ms. Other threads go on meanwhile.

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
    p, q = packed_polygon(p, n), packed_polygon(q, m)
    # The bodies are put in a fixed order, so that ties do not depend on which is named first.
    if not goes_first(q, p):
        return _contact(p, q)
    least, depth, nx, ny, count, (one, other) = _contact(q, p)
    return least, depth, -nx, -ny, count, (_exchanged(other), _exchanged(one))


@inner
def _contact(p, q):
    """Return the contact of two bodies in this order."""
    least, found, pair = measure_parts(p, q)
    depth = -least if least < 0.0 else 0.0
    x, y, qx, qy, ux, uy = found
    nx, ny = -ux, -uy
    convex = p.n > 0 and q.n > 0
    if least == 0.0 and not convex and not (_is_on_cut(p, q) or _is_on_cut(q, p)):
        nx, ny, count, pairs = _touch(p, q)
        return least, depth, nx, ny, count, pairs
    parts = max(1, -q.n)
    a, b = convex_part(p, pair // parts), convex_part(q, pair % parts)
    count, pairs = _clipped(a.array, _level_edge(a, ux, uy), b.array, _level_edge(b, -ux, -uy),
                            (x, y, qx, qy), ux, uy)
    if least <= 0.0 and not convex:
        out, nx, ny = way_out(p, q)
        depth = max(out, max(depth, LEAST))
    return least, depth, nx, ny, count, pairs


@inner
def _is_on_cut(p, q):
    """
    Return whether P, a point or segment in no interior of a part of Q, is in the interior of Q.

    It is, where it runs along a cut: an edge of one part that is opposite to one of another.
    """
    if not 0 < p.n <= 2 or q.n > 0:
        return False
    for i in range(-q.n):
        a = convex_part(q, i)
        first = first_vertex(a)
        for k in range(first, first + 2 * a.n, 2):
            up, ax, ay, bx, by = _along(p, a, k)
            for j in range(-q.n if up > 0 else 0):
                b = convex_part(q, j)
                other = first_vertex(b)
                for m in range(other, other + 2 * b.n, 2):
                    down, cx, cy, dx, dy = _along(p, b, m)
                    if down < 0 and _rises(ax, ay, dx, dy) and _rises(cx, cy, bx, by):
                        return True
    return False


@inner
def _along(p, a, k):
    """
    Return 1 if P, a point or segment, is along the edge at k of A, -1 if it runs down, else 0.

    Up means to larger x or, if x is the same, y. Returned with it are the ends, the lower first.
    """
    v, w = a.array, p.array
    m = vertex_after(a, k)
    up = _rises(v[k], v[k + 1], v[m], v[m + 1])
    low = k if up else m
    high = m if up else k
    ends = v[low], v[low + 1], v[high], v[high + 1]
    # A packed segment begins with its lower end.
    start = first_vertex(p)
    end = vertex_after(p, start)
    along = (_rises(ends[0], ends[1], w[end], w[end + 1])
             and _rises(w[start], w[start + 1], ends[2], ends[3])
             and orient(*ends, w[start], w[start + 1]) == 0
             and orient(*ends, w[end], w[end + 1]) == 0)
    return ((1 if up else -1) if along else 0), *ends


@inlined
def _rises(ax, ay, bx, by):
    return ax < bx or (ax == bx and ay < by)


@inner
def _touch(p, q):
    """
    Return the normal, and the points as `_clipped` does, of bodies that only touch.

    The normal is that of a side on which a vertex of the other body is, with its neighbours on
    the line or beyond. Of several it is one that is least against the others.
    """
    p, q = outline_of(p), outline_of(q)
    # At most two sides of a body are at a vertex of the other.
    sides = scratch(10 * (p.n + q.n))
    split = _write_touched(q, p, 1.0, sides, 0)
    count = _write_touched(p, q, -1.0, sides, split)
    best, chosen = -math.inf, 0
    for i in range(0, count, 5):
        least = math.inf
        for k in range(0, count, 5):
            least = min(least, sides[i] * sides[k] + sides[i + 1] * sides[k + 1])
        if least > best:
            best, chosen = least, i
    nx, ny = sides[chosen], sides[chosen + 1]
    a, b, k = int(sides[chosen + 2]), int(sides[chosen + 3]), int(sides[chosen + 4])
    v, w = p.array, q.array
    if chosen < split:
        other = _level_edge_at(p, k, -nx, -ny)
        count, pairs = _clipped(v, other, w, (a, b), (v[k], v[k + 1], v[k], v[k + 1]), -nx, -ny)
    else:
        other = _level_edge_at(q, k, nx, ny)
        count, pairs = _clipped(v, (a, b), w, other, (w[k], w[k + 1], w[k], w[k + 1]), -nx, -ny)
    return nx, ny, count, pairs


@inner
def _write_touched(p, q, sign, sides, place):
    """
    Write the sides of an outline P that have a vertex of Q on them, and no neighbour behind them.

    Each is the outward normal times a sign, and the indices of the side's ends and the vertex.
    Return where they end.
    """
    v, w = p.array, q.array
    first, other_first = first_vertex(p), first_vertex(q)
    for a in range(first, first + 2 * p.n if p.n > 1 else first, 2):
        b = vertex_after(p, a)
        ax, ay, bx, by = v[a], v[a + 1], v[b], v[b + 1]
        for k in range(other_first, other_first + 2 * q.n, 2):
            if (min(ax, bx) <= w[k] <= max(ax, bx) and min(ay, by) <= w[k + 1] <= max(ay, by)
                    and orient(ax, ay, bx, by, w[k], w[k + 1]) == 0):
                i, j = vertex_before(q, k), vertex_after(q, k)
                # At a reflex vertex the body reaches behind the line between its neighbours.
                if (orient(w[i], w[i + 1], w[k], w[k + 1], w[j], w[j + 1]) >= 0
                        and orient(ax, ay, bx, by, w[i], w[i + 1]) <= 0
                        and orient(ax, ay, bx, by, w[j], w[j + 1]) <= 0):
                    ex, ey = unit(bx - ax, by - ay)
                    sides[place], sides[place + 1] = sign * ey, -sign * ex
                    sides[place + 2], sides[place + 3], sides[place + 4] = a, b, k
                    place += 5
    return place


@inner
def _clipped(v, edge, w, other_edge, closest, ux, uy):
    """
    Return the number of points of contact of two bodies, and two (the same if it is 1).

    They are the ends of the stretch where an edge of each faces the other, if both have such an
    edge, see `_level_edge`, else the closest points.
    """
    x, y, _, _ = closest
    a, b = edge
    c, d = other_edge
    if a < 0 or c < 0:
        return 1, (closest, closest)
    # Positions along u turned left, relative to the closest points, which are both at 0.
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
    first = first_vertex(p)
    least = FACING
    start = end = -1
    for a in range(first, first + 2 * p.n if p.n > 1 else first, 2):
        b = vertex_after(p, a)
        slant = _slant(p.array, a, b, ux, uy)
        if slant <= least:
            least, start, end = slant, a, b
    return start, end


@inner
def _level_edge_at(p, k, ux, uy):
    """Return the same of the two edges at a vertex."""
    before, after = vertex_before(p, k), vertex_after(p, k)
    slant, other = _slant(p.array, before, k, ux, uy), _slant(p.array, k, after, ux, uy)
    if min(slant, other) > FACING:
        return -1, -1
    return (before, k) if slant <= other else (k, after)


@inner
def _slant(v, a, b, ux, uy):
    """Return how much an edge that faces u runs along it, relative to its length; else 2."""
    ex, ey = unit(v[b] - v[a], v[b + 1] - v[a + 1])
    return abs(ex * ux + ey * uy) if ey * ux - ex * uy > 0.0 else 2.0


@inner
def _opposite(v, k, w, start, end, share):
    """Return a vertex of one body and the point at a fraction of an edge of the other."""
    return (v[k], v[k + 1], w[start] + share * (w[end] - w[start]),
            w[start + 1] + share * (w[end + 1] - w[start + 1]))


@inner
def _exchanged(pair):
    return pair[2], pair[3], pair[0], pair[1]

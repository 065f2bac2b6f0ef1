# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Distance or depth of two convex polygons, to twice the precision of a double.

The distance of disjoint polygons is between their nearest features: a vertex and an edge, or two
vertices. The point of their Minkowski difference Q - P nearest to the origin is sought with its
support vertices (GJK: E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing
the distance between complex objects in three-dimensional space", 1988), first in plain doubles.
The result is checked with double-doubles: no vertex may lie on the origin's side of the line
through the point found, perpendicular to the axis. If one does, the search continues from it. If
the search does not end, all pairs of features are tried. See docs/exactness.md, lemmas 16 and 17.

The depth of polygons that meet is the length of the shortest move after which they only touch. It
is along the normal of an edge of one of them, as far as the other polygon reaches behind that
edge. All edges are tried in plain doubles, and those that might have the least depth again with
double-doubles: see lemma 18.

An axis of double-doubles is given as x and y, each a head and a tail, see `double_double`.
Coordinates are below 2^301 in magnitude, and the largest is above 2^-301, see `distance`.
"""

import math
from typing import Any, NamedTuple

from sat_collision.geometry.body.layout import first_vertex, vertex_after, vertex_before
from sat_collision.geometry.compiled.jit import inlined, inner, kernel, scratch
from sat_collision.geometry.numeric.double_double import (
    cross, difference, dot, negative, plus, quotient, scaled, square_root, times)
from sat_collision.geometry.numeric.vectors import nearest_of_segment, scale_to_one, unit
from sat_collision.geometry.pair.separating_axis import support

# Largest excess of the rough distance over its bound, relative to the largest coordinate: 4 u.
_TOLERANCE = 2.0 ** -51
# Largest relative excess of the distance found over its lower bound: u / 2.
_NEGLIGIBLE = 2.0 ** -54
# Error bound of a scalar product of double-doubles, relative to its products' magnitudes.
_HIDDEN = 16.0 * 2.0 ** -106
# Exceeds what underflow takes from a scalar product, or from coordinates that were scaled down.
_LOST = 2.0 ** -1022
# The direction of an edge below this length may be an artefact of underflow.
SHORT = 2.0 ** -900
# Exceeds the rounding error of a distance along an axis, relative to the largest coordinate: see
# docs/exactness.md, lemma 20.
ROUNDING = 2.0 ** -47
# Offsets along an edge up to this, relative to the largest coordinate, count as zero.
_NO_OFFSET = 2.0 ** -92


class Features(NamedTuple):
    """A segment between vertices of each body, at least one of them a vertex, and the distance."""

    distance: float
    pa: int  # indices of the ends of P's segment in its array, and of Q's
    pb: int
    qa: int
    qb: int
    nx: Any  # the direction from P to Q: an axis of any length, of double-doubles
    ny: Any


@kernel
def nearest_features(p, q):
    """Return the nearest features of two disjoint convex polygons."""
    v, w = p.array, q.array
    pa, pb, qa, qb = _roughly_nearest(p, q)
    best = _of_segments(v, w, pa, pb, qa, qb)
    for _ in range(p.n + q.n):
        i = furthest(p, best.pa, best.nx, best.ny)
        j = furthest(q, best.qa, negative(best.nx), negative(best.ny))
        beyond = plus(along(w, best.qa, j, best.nx, best.ny),
                      negative(along(v, best.pa, i, best.nx, best.ny)))
        height = dot(*offset(v, w, best.pa, best.qa), best.nx, best.ny)
        if beyond[0] >= -_NEGLIGIBLE * height[0]:
            return best
        on_a = _of_segments(v, w, best.pa, i, best.qa, j)
        on_b = _of_segments(v, w, best.pb, i, best.qb, j)
        best = on_a if on_a.distance <= on_b.distance else on_b
    return of_all_features(p, q)


@kernel
def of_all_features(p, q):
    """Return the nearest features of two convex polygons by trying all pairs."""
    v, w = p.array, q.array
    first, other_first = first_vertex(p), first_vertex(q)
    best = _of_segment(v, w, first, first, other_first, other_first)
    for i in range(p.n):
        a = first + 2 * i
        for j in range(q.n):
            c = other_first + 2 * j
            found = _of_segments(v, w, a, vertex_after(p, a), c, vertex_after(q, c))
            if found.distance < best.distance:
                best = found
    return best


@kernel
def closest_of(p, q, features):
    """Return x, y, x, y of the nearest points, rounded once, and the unit vector from P to Q."""
    v, w = p.array, q.array
    _, pa, pb, qa, qb, nx, ny = features
    size = square_root(dot(nx, ny, nx, ny))
    if size[0] == 0.0:
        return v[pa], v[pa + 1], w[qa], w[qa + 1], 1.0, 0.0
    ux, uy = quotient(nx, size)[0], quotient(ny, size)[0]
    if pa == pb and qa == qb:
        return v[pa], v[pa + 1], w[qa], w[qa + 1], ux, uy
    ex, ey = _edge(v, w, pa, pb, qa, qb)
    back = negative(dot(*offset(v, w, pa, qa), ex, ey))
    share = quotient(back, plus(back, dot(*offset(v, w, pb, qb), ex, ey)))
    return *_between(v, pa, pb, share), *_between(w, qa, qb, share), ux, uy


@inner
def offset(v, w, i, j):
    """Return the offset from the vertex at i of one body to that at j of another, exactly."""
    return difference(w[j], v[i]), difference(w[j + 1], v[i + 1])


@inner
def _edge(v, w, pa, pb, qa, qb):
    """Return how the offset from P to Q changes along features, one of them a vertex; scaled."""
    return _line(w, qa, qb) if pa == pb else _line(v, pb, pa)


@inner
def _line(v, a, b):
    """Return the offset from the vertex at a to that at b, multiplied by a power of two."""
    x, y = offset(v, v, a, b)
    return scaled(x, y, scale_to_one(max(abs(x[0]), abs(y[0]))))


@inner
def _between(v, a, b, share):
    """Return x, y of the point at a share of the way from one vertex to another, rounded once."""
    x, y = offset(v, v, a, b)
    return plus((v[a], 0.0), times(share, x))[0], plus((v[a + 1], 0.0), times(share, y))[0]


@inner
def _roughly_nearest(p, q):
    """Return vertices pa, pb, qa, qb between which the nearest points are, by plain doubles."""
    v, w = p.array, q.array
    pa = pb = first_vertex(p)
    qa = qb = first_vertex(q)
    ux, uy = w[q.start] - v[p.start], w[q.start + 1] - v[p.start + 1]
    pw, qw = support(p, ux, uy), support(q, -ux, -uy)
    if pw < 0 or qw < 0:
        return pa, pb, qa, qb
    pa = pb = pw
    qa = qb = qw
    near, ux, uy = _near_segment(v, w, pa, qa, pb, qb)
    enough = _TOLERANCE * reach_of(p, q)
    for _ in range(p.n + q.n):
        pw, qw = support(p, ux, uy), support(q, -ux, -uy)
        if pw < 0 or qw < 0:
            break
        if (w[qw] - v[pw]) * ux + (w[qw + 1] - v[pw + 1]) * uy >= near - enough:
            break
        to_a, ax, ay = _near_segment(v, w, pa, qa, pw, qw)
        to_b, bx, by = _near_segment(v, w, pw, qw, pb, qb)
        if to_a <= to_b:
            near, ux, uy = to_a, ax, ay
            pb, qb = pw, qw
        else:
            near, ux, uy = to_b, bx, by
            pa, qa = pw, qw
    return pa, pb, qa, qb


@inner
def _near_segment(p, q, pa, qa, pb, qb):
    """Return `nearest_of_segment` of the segment from q[qa] - p[pa] to q[qb] - p[pb]."""
    return nearest_of_segment(q[qa] - p[pa], q[qa + 1] - p[pa + 1],
                              q[qb] - p[pb], q[qb + 1] - p[pb + 1])


@kernel
def reach_of(p, q):
    """Return the greatest magnitude of a coordinate of two packed polygons."""
    a, b = p.array, q.array
    i, j = p.start, q.start
    return max(max(max(-a[i + 2], a[i + 4]), max(-a[i + 3], a[i + 5])),
               max(max(-b[j + 2], b[j + 4]), max(-b[j + 3], b[j + 5])))


@inner
def _of_segments(v, w, pa, pb, qa, qb):
    """Return the nearest features of disjoint segments of P and Q, given by vertices."""
    best = _of_segment(v, w, pa, pb, qa, qa)
    if qa != qb:
        found = _of_segment(v, w, pa, pa, qa, qb)
        best = found if found.distance < best.distance else best
        if pa != pb:
            found = _of_segment(v, w, pa, pb, qb, qb)
            best = found if found.distance < best.distance else best
            found = _of_segment(v, w, pb, pb, qa, qb)
            best = found if found.distance < best.distance else best
    return best


@inner
def _of_segment(v, w, pa, pb, qa, qb):
    """Return the nearest features of two segments, one of which is a vertex."""
    ax, ay = offset(v, w, pa, qa)
    if pa == pb and qa == qb:
        return _of_vertices(pa, qa, ax, ay)
    ex, ey = _edge(v, w, pa, pb, qa, qb)
    if not dot(ax, ay, ex, ey)[0] < 0.0:
        return _of_vertices(pa, qa, ax, ay)
    bx, by = offset(v, w, pb, qb)
    if not dot(bx, by, ex, ey)[0] > 0.0:
        return _of_vertices(pb, qb, bx, by)
    height = cross(ax, ay, ex, ey)
    if height[0] < 0.0:
        height = negative(height)
        ex, ey = negative(ex), negative(ey)
    distance = quotient(height, square_root(dot(ex, ey, ex, ey)))[0]
    return Features(distance, pa, pb, qa, qb, ey, negative(ex))


@inner
def _of_vertices(i, j, x, y):
    """Return two vertices as features, given the offset between them."""
    scale = scale_to_one(max(abs(x[0]), abs(y[0])))
    x, y = scaled(x, y, scale)
    return Features(square_root(dot(x, y, x, y))[0] / scale, i, i, j, j, x, y)


@inner
def furthest(p, i, nx, ny):
    """Return the index of the vertex of P furthest along n, to 2^-99 |n| R; start at i."""
    v = p.array
    ahead = vertex_after(p, i)
    rise_ahead = _rise(v, i, ahead, nx, ny)
    while rise_ahead > 0:
        i = ahead
        ahead = vertex_after(p, i)
        rise_ahead = _rise(v, i, ahead, nx, ny)
    behind = vertex_before(p, i)
    rise_behind = _rise(v, i, behind, nx, ny)
    while rise_behind > 0:
        i = behind
        behind = vertex_before(p, i)
        rise_behind = _rise(v, i, behind, nx, ny)
        ahead = i
        rise_ahead = -1
    if p.n > 1 and ((rise_ahead == 0 and not _runs_left(v, i, ahead, nx[0], ny[0]))
                    or (rise_behind == 0 and not _runs_left(v, behind, i, nx[0], ny[0]))):
        # At the lowest vertex, or where underflow hides the direction of edges.
        i = first = first_vertex(p)
        most = along(v, first, first, nx, ny)
        for k in range(first, first + 2 * p.n, 2):
            found = along(v, first, k, nx, ny)
            if plus(found, negative(most))[0] > 0.0:
                most = found
                i = k
    return i


@inlined
def along(v, i, k, nx, ny):
    """Return the component along n of the offset from the vertex at i to that at k."""
    return dot(*offset(v, v, i, k), nx, ny)


@inner
def _rise(v, i, k, nx, ny):
    """Return the sign of `along`, 0 if it is not certain."""
    rise = along(v, i, k, nx, ny)[0]
    bound = _HIDDEN * (abs((v[k] - v[i]) * nx[0]) + abs((v[k + 1] - v[i + 1]) * ny[0])) + _LOST
    return (rise > bound) - (-rise > bound)


@inner
def _runs_left(v, i, k, nx, ny):
    """Return whether an edge of uncertain rise runs to the left of n, and is not short."""
    return nx * (v[k + 1] - v[i + 1]) - ny * (v[k] - v[i]) > SHORT


@kernel
def penetration(p, q):
    """
    Return the depth of two convex polygons that meet, and the points that realise it.

    The depth is rounded, and infinite if both are points, or like points by underflow. Moving P
    from its point to that of Q takes it out of Q; the unit vector is the opposite direction.
    """
    slack = 2.0 * ROUNDING * reach_of(p, q)
    depth, edge, vertex = _least_reach(p, q, slack)
    other_depth, other_edge, other_vertex = _least_reach(q, p, slack)
    if other_depth < depth:
        bx, by, ax, ay, ux, uy = _move(q, p, other_edge, other_vertex)
        return other_depth[0], (ax, ay, bx, by, -ux, -uy)
    if depth[0] == math.inf:
        v = p.array
        i = first_vertex(p)
        return depth[0], (v[i], v[i + 1], v[i], v[i + 1], 1.0, 0.0)
    return depth[0], _move(p, q, edge, vertex)


@inner
def _least_reach(p, q, slack):
    """
    Find the edge of P behind which Q reaches least far.

    Returned are this depth as a double-double (infinite if P is a point, or like one by
    underflow), and the vertices at which the edge starts and up to which Q reaches.
    """
    v, w = p.array, q.array
    first = first_vertex(p)
    count = p.n if p.n > 1 else 0
    rough = scratch(count)
    least = math.inf
    for i in range(count):
        a = first + 2 * i
        b = vertex_after(p, a)
        ex, ey = v[b] - v[a], v[b + 1] - v[a + 1]
        long = max(abs(ex), abs(ey)) > SHORT
        ex, ey = unit(ex, ey)
        j = support(q, -ey, ex)
        rough[i] = -math.inf
        if long and j >= 0:
            rough[i] = ex * (w[j + 1] - v[a + 1]) - ey * (w[j] - v[a])
            least = min(least, rough[i])
    depth, edge, vertex = (math.inf, 0.0), first, first_vertex(q)
    for i in range(count):
        if rough[i] > least + slack:
            continue
        a = first + 2 * i
        ex, ey = _line(v, a, vertex_after(p, a))
        if ex[0] == 0.0 and ey[0] == 0.0:
            continue
        # No vertex of P is beyond its edge, unless this is so short that underflow turns it.
        k = furthest(p, a, ey, negative(ex))
        j = furthest(q, first_vertex(q), negative(ey), ex)
        reach = cross(ex, ey, *offset(v, w, k, j))
        found = quotient(reach, square_root(dot(ex, ey, ex, ey)))
        if found < depth:
            depth, edge, vertex = found, a, j
    return depth, edge, vertex


@inner
def _move(p, q, a, j):
    """
    Return a point of P, one of Q as far behind P's edge at a as its vertex at j, and the normal.

    The vertex need not be opposite that edge if another vertex of either body is as far along the
    normal, or nearly: the boundary of the Minkowski difference is followed from the edge on to
    where a point of Q is opposite one of P. Each coordinate is rounded once.
    """
    v, w = p.array, q.array
    i, c = a, vertex_after(p, a)
    ex, ey = _line(v, i, c)
    size = square_root(dot(ex, ey, ex, ey))
    ux, uy = quotient(ey, size)[0], -quotient(ex, size)[0]
    k = d = j
    forward = dot(ex, ey, *offset(v, w, a, j))[0] >= 0.0
    if not forward:
        i, c = c, i
        ex, ey = negative(ex), negative(ey)
    slack = _NO_OFFSET * size[0] * reach_of(p, q)
    left = dot(ex, ey, *offset(v, w, c, d))
    for _ in range(p.n + q.n):
        if left[0] <= slack:
            break
        i, k = c, d
        c = vertex_after(p, i) if forward else vertex_before(p, i)
        d = vertex_after(q, k) if forward else vertex_before(q, k)
        fx, fy = offset(v, v, i, c)
        gx, gy = offset(w, w, k, d)
        turn = cross(fx, fy, gx, gy)[0]
        # If both next edges lead on, the one that turns less comes first.
        if not dot(ex, ey, gx, gy)[0] < 0.0 or (
                dot(ex, ey, fx, fy)[0] > 0.0 and (turn <= 0.0 if forward else turn >= 0.0)):
            d = k
        else:
            c = i
        left = dot(ex, ey, *offset(v, w, c, d))
    share = 1.0, 0.0
    if left[0] < 0.0:
        begin = dot(ex, ey, *offset(v, w, i, k))
        share = quotient(begin, plus(begin, negative(left)))
    return *_between(v, i, c, share), *_between(w, k, d, share), ux, uy

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
How far apart two bodies are, or how deep they overlap.

Between convex bodies apart, the point of their Minkowski difference Q - P nearest to the origin is
sought with its support vertices (E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure
for computing the distance between complex objects in three-dimensional space", 1988). Where they
overlap, the depth is the least over the edges of both of how far the other body reaches beyond
the edge. Values are rounded, to a few ulp of the coordinates; signs are exact.
"""

import math

from sat_collision.geometry.intersection import convex_meet, interiors_apart
from sat_collision.geometry.jit import kernel
from sat_collision.geometry.layout import convex_part, first_vertex, Packed
from sat_collision.geometry.plane import length
from sat_collision.geometry.separating_axis import support

_LEAST = 5e-324
_DOUBTFUL = 1e-12


@kernel
def measure_arrays(p, n, q, m):
    """Return the same as `measure` of bodies that an array each holds, with counts n and m."""
    return measure(Packed(p, 0, n), Packed(q, 0, m))


@kernel
def measure(p, q):
    """Return separation and closest points x, y, x, y of two packed polygons, convex or not."""
    least = math.inf
    found = (0.0, 0.0, 0.0, 0.0)
    meeting = False
    for i in range(max(1, -p.n)):
        a = convex_part(p, i)
        for j in range(max(1, -q.n)):
            b = convex_part(q, j)
            meet = convex_meet(a, b)
            if meeting and not meet:
                continue
            if meet:
                value, points = _penetration(a, b)
            else:
                value, points = _distance(a, b)
            if value < least or (meet and not meeting):
                least = value
                found = points
            meeting = meeting or meet
    return least, found[0], found[1], found[2], found[3]


@kernel
def _furthest(p, ux, uy):
    """Return where the vertex of P furthest along u stands."""
    i = support(p, ux, uy)
    if i >= 0:
        return i
    v = p.array
    first = first_vertex(p)
    i = first
    for k in range(first, first + 2 * p.n, 2):
        if v[k] * ux + v[k + 1] * uy > v[i] * ux + v[i + 1] * uy:
            i = k
    return i


@kernel
def _distance(p, q):
    """
    Return distance and closest points of two convex polygons without a common point.

    A segment a b of the Minkowski difference, given by the vertices that make its ends, comes
    nearer to the origin with every step, until no support vertex is beyond it.
    """
    v = p.array
    w = q.array
    ux = w[q.start] - v[p.start]
    uy = w[q.start + 1] - v[p.start + 1]
    pa = pb = _furthest(p, ux, uy)
    qa = qb = _furthest(q, -ux, -uy)
    distance, share, ux, uy = _nearest_of_segment(v, w, pa, qa, pb, qb)
    for _ in range(p.n + q.n):
        pw = _furthest(p, ux, uy)
        qw = _furthest(q, -ux, -uy)
        to_a = _nearest_of_segment(v, w, pa, qa, pw, qw)
        to_b = _nearest_of_segment(v, w, pw, qw, pb, qb)
        if min(to_a[0], to_b[0]) >= distance:
            break
        if to_a[0] <= to_b[0]:
            pb = pw
            qb = qw
            distance, share, ux, uy = to_a
        else:
            pa = pw
            qa = qw
            distance, share, ux, uy = to_b
    return max(distance, _LEAST), (
        v[pa] + share * (v[pb] - v[pa]), v[pa + 1] + share * (v[pb + 1] - v[pa + 1]),
        w[qa] + share * (w[qb] - w[qa]), w[qa + 1] + share * (w[qb + 1] - w[qa + 1]))


@kernel
def _nearest_of_segment(p, q, pa, qa, pb, qb):
    """
    Return how near a segment of the Minkowski difference comes to the origin.

    It runs from q[qa] - p[pa] to q[qb] - p[pb]. Returned are the distance, the nearest point's
    share of the way, and a direction from the origin to it.
    """
    ax = q[qa] - p[pa]
    ay = q[qa + 1] - p[pa + 1]
    ex = (q[qb] - p[pb]) - ax
    ey = (q[qb + 1] - p[pb + 1]) - ay
    size = length(ex, ey)
    if size == 0.0:
        return length(ax, ay), 0.0, ax, ay
    ex /= size
    ey /= size
    along = -(ax * ex + ay * ey)
    if along <= 0.0:
        return length(ax, ay), 0.0, ax, ay
    if along >= size:
        bx = q[qb] - p[pb]
        by = q[qb + 1] - p[pb + 1]
        return length(bx, by), 1.0, bx, by
    height = ax * ey - ay * ex
    if height < 0.0:
        return -height, along / size, -ey, ex
    return height, along / size, ey, -ex


@kernel
def _penetration(p, q):
    """Return minus the depth, or 0 if they only touch, and the points that realise it."""
    depth, x, y, ux, uy = _least_reach(p, q)
    other_depth, other_x, other_y, vx, vy = _least_reach(q, p)
    size = max(max(abs(p.array[p.start + 2]), abs(p.array[p.start + 4])),
               max(abs(p.array[p.start + 3]), abs(p.array[p.start + 5])))
    flipped = other_depth < depth
    if flipped:
        depth, x, y, ux, uy = other_depth, other_x, other_y, vx, vy
    if depth == math.inf or (depth <= _DOUBTFUL * size and interiors_apart(p, q)):
        return 0.0, (x, y, x, y)
    depth = max(depth, _LEAST)
    if flipped:
        return -depth, (x, y, x + depth * ux, y + depth * uy)
    return -depth, (x + depth * ux, y + depth * uy, x, y)


@kernel
def _least_reach(p, q):
    """
    Return how far Q reaches beyond the edge of P behind which it reaches least.

    Returned are this depth (infinite if P is a point), the vertex x, y of Q that reaches so far,
    and the edge's outward normal.
    """
    v = p.array
    w = q.array
    first = first_vertex(p)
    best = (math.inf, v[first], v[first + 1], 0.0, 0.0)
    for i in range(p.n if p.n > 1 else 0):
        a = first + 2 * i
        b = first + 2 * (i + 1 if i + 1 < p.n else 0)
        ex = v[b] - v[a]
        ey = v[b + 1] - v[a + 1]
        size = length(ex, ey)
        ux = ey / size
        uy = -ex / size
        j = _furthest(q, -ux, -uy)
        depth = (v[a] - w[j]) * ux + (v[a + 1] - w[j + 1]) * uy
        if depth < best[0]:
            best = (depth, w[j], w[j + 1], ux, uy)
    return best

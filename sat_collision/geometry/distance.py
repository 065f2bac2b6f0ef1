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
for computing the distance between complex objects in three-dimensional space", 1988). For any
unit axis u the distance is at least the least w . u of the difference: the search stops when that
is within TOLERANCE of the distance found, and where it does not get there all pairs of edges are
tried. Where bodies overlap, the depth is the least over the edges of both of how far the other
body reaches beyond the edge.

Values are rounded, to less than 8 ulp of the largest coordinate; signs are exact. Rings begin with
their least vertex, and the bodies are put in order before: each start vertex and either order of
the bodies gives the same bits.
"""

import math

from sat_collision.geometry.arithmetic import require_nearest
from sat_collision.geometry.edges import height, to_segment
from sat_collision.geometry.intersection import convex_meet, interiors_apart
from sat_collision.geometry.jit import inner, kernel
from sat_collision.geometry.layout import body_size, convex_part, first_vertex, Packed
from sat_collision.geometry.part_axes import is_beyond_edge, limit_of, reaches
from sat_collision.geometry.part_boxes import may_be_less, nearest_boxes, open_pairs, overlap
from sat_collision.geometry.plane import nearest_of_segment, unit
from sat_collision.geometry.separating_axis import support

# How far, in parts of the largest coordinate, the distance may be from its lower bound: 4 u.
TOLERANCE = 2.0 ** -51
# Where the depth, in parts of the largest coordinate, may be nothing but rounding.
_DOUBTFUL = 1e-12
_LEAST = 5e-324
# A prime beyond any number of pairs, so that steps of it come to each of them.
_STRIDE = 2 ** 61 - 1


@kernel
def measure_arrays(p, n, q, m):
    """Return the same as `measure` of bodies that an array each holds, with counts n and m."""
    require_nearest(n)
    return measure(Packed(p, 0, n), Packed(q, 0, m))


@kernel
def measure(p, q):
    """Return separation and closest points x, y, x, y of two packed polygons, convex or not."""
    if _goes_first(q, p):
        value, bx, by, ax, ay = _measure_parts(q, p)
    else:
        value, ax, ay, bx, by = _measure_parts(p, q)
    return value, ax, ay, bx, by


@inner
def _goes_first(p, q):
    """Tell whether the numbers of P come before those of Q in lexicographic order."""
    size = body_size(p)
    other_size = body_size(q)
    for k in range(min(size, other_size)):
        a = p.array[p.start + k]
        b = q.array[q.start + k]
        if a != b:
            return a < b
    return size < other_size


@inner
def _measure_parts(p, q):
    """Measure the pairs of parts of which it is open whether they are nearest, or deepest."""
    if p.n > 0 and q.n > 0:
        _, least, found = _measure_pair(p, q)
        return least, found[0], found[1], found[2], found[3]
    parts = max(1, -q.n)
    reach = _reach(p, q)
    first = nearest_boxes(p, q)
    meeting, least, found = _measure_pair(
        convex_part(p, first // parts), convex_part(q, first % parts))
    limit = limit_of(least, reach)
    along, back = _along(p, q, meeting, found)
    pairs = open_pairs(p, q, least, meeting)
    count = len(pairs)
    stride = _STRIDE % max(count, 1)
    place = 0
    for _ in range(count):
        pair = pairs[place]
        # Here and there, not in a row, where each might be a little nearer than the one before.
        place += stride if place + stride < count else stride - count
        i = pair // parts
        j = pair % parts
        if pair == first or -along[i] - back[j] > limit:
            continue
        a = convex_part(p, i)
        b = convex_part(q, j)
        if (not may_be_less(overlap(a, b), least, meeting)
                or is_beyond_edge(a, b, limit) or is_beyond_edge(b, a, limit)):
            continue
        meet, value, points = _measure_pair(a, b)
        if (meeting and not meet) or not (value < least or (meet and not meeting)):
            continue
        least = value
        found = points
        meeting = meet
        limit = limit_of(least, reach)
        along, back = _along(p, q, meeting, found)
    return least, found[0], found[1], found[2], found[3]


@inner
def _along(p, q, meeting, points):
    """Return how far the parts of P reach along the axis that was found, and those of Q back."""
    ux, uy = unit(points[2] - points[0], points[3] - points[1])
    if meeting:
        # What ends an overlap takes P away from Q.
        ux = -ux
        uy = -uy
    return reaches(p, ux, uy), reaches(q, -ux, -uy)


@inner
def _measure_pair(a, b):
    """Return whether two convex polygons meet, their separation and what realises it."""
    meet = convex_meet(a, b)
    if meet:
        value, points = _penetration(a, b)
    else:
        value, points = _distance(a, b)
    return meet, value, points


@kernel
def _reach(p, q):
    """Return the greatest magnitude of a coordinate."""
    a = p.array
    b = q.array
    i = p.start
    j = q.start
    return max(max(max(-a[i + 2], a[i + 4]), max(-a[i + 3], a[i + 5])),
               max(max(-b[j + 2], b[j + 4]), max(-b[j + 3], b[j + 5])))


@inner
def _furthest(p, ux, uy):
    """Return where the vertex of P furthest along u stands, but for what rounding hides."""
    v = p.array
    first = first_vertex(p)
    last = first + 2 * p.n - 2
    i = support(p, ux, uy)
    if i < 0:
        i = first
        for k in range(first, last + 2, 2):
            if (v[k] - v[i]) * ux + (v[k + 1] - v[i + 1]) * uy > 0.0:
                i = k
    # Steps that rise for all that can be seen, if not for certain.
    for _ in range(p.n):
        k = i + 2 if i < last else first
        if not (v[k] - v[i]) * ux + (v[k + 1] - v[i + 1]) * uy > 0.0:
            break
        i = k
    for _ in range(p.n):
        k = i - 2 if i > first else last
        if not (v[k] - v[i]) * ux + (v[k + 1] - v[i + 1]) * uy > 0.0:
            break
        i = k
    return i


@inner
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
    near, ux, uy = _near_segment(v, w, pa, qa, pb, qb)
    enough = TOLERANCE * _reach(p, q)
    for _ in range(p.n + q.n):
        pw = _furthest(p, ux, uy)
        qw = _furthest(q, -ux, -uy)
        least = (w[qw] - v[pw]) * ux + (w[qw + 1] - v[pw + 1]) * uy
        if max(least, 0.0) >= near - enough:
            value, points = _of_edges(p, q, pa, pb, qa, qb)
            # Below zero the axis tells nothing, but no distance is.
            if least >= near - enough or value <= enough:
                return value, points
        to_a, ax, ay = _near_segment(v, w, pa, qa, pw, qw)
        to_b, bx, by = _near_segment(v, w, pw, qw, pb, qb)
        if to_a <= to_b:
            near, ux, uy = to_a, ax, ay
            pb = pw
            qb = qw
        else:
            near, ux, uy = to_b, bx, by
            pa = pw
            qa = qw
    return _of_all_edges(p, q)


@inner
def _near_segment(p, q, pa, qa, pb, qb):
    """Return `nearest_of_segment` of the one from q[qa] - p[pa] to q[qb] - p[pb]."""
    return nearest_of_segment(q[qa] - p[pa], q[qa + 1] - p[pa + 1],
                              q[qb] - p[pb], q[qb + 1] - p[pb + 1])


@kernel
def _of_all_edges(p, q):
    """Return distance and closest points by trying all pairs of edges."""
    first = first_vertex(p)
    other_first = first_vertex(q)
    best, points = _of_edges(p, q, first, first, other_first, other_first)
    for i in range(p.n):
        a = first + 2 * i
        b = first + 2 * (i + 1 if i + 1 < p.n else 0)
        for j in range(q.n):
            c = other_first + 2 * j
            d = other_first + 2 * (j + 1 if j + 1 < q.n else 0)
            value, found = _of_edges(p, q, a, b, c, d)
            if value < best:
                best, points = value, found
    return best, points


@inner
def _of_edges(p, q, a, b, c, d):
    """Return distance and closest points of the segments from a to b of P and from c to d of Q."""
    v = p.array
    w = q.array
    best = (math.inf, 0.0, 0.0, 0.0, 0.0)
    for k in (c, d):
        value, x, y = to_segment(v, a, b, w[k], w[k + 1])
        if value < best[0]:
            best = (value, x, y, w[k], w[k + 1])
    for k in (a, b):
        value, x, y = to_segment(w, c, d, v[k], v[k + 1])
        if value < best[0]:
            best = (value, v[k], v[k + 1], x, y)
    return max(best[0], _LEAST), best[1:]


@inner
def _penetration(p, q):
    """Return minus the depth, or 0 if they only touch, and the points that realise it."""
    depth, x, y, ux, uy = _least_reach(p, q)
    other_depth, other_x, other_y, vx, vy = _least_reach(q, p)
    flipped = other_depth < depth
    if flipped:
        depth, x, y, ux, uy = other_depth, other_x, other_y, vx, vy
    if depth == math.inf or (depth <= _DOUBTFUL * _reach(p, q) and interiors_apart(p, q)):
        return 0.0, (x, y, x, y)
    depth = max(depth, _LEAST)
    if flipped:
        return -depth, (x, y, x + depth * ux, y + depth * uy)
    return -depth, (x + depth * ux, y + depth * uy, x, y)


@inner
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
        ex, ey = unit(v[b] - v[a], v[b + 1] - v[a + 1])
        j = _furthest(q, -ey, ex)
        depth = height(v, a, b, w[j], w[j + 1])
        if depth < best[0]:
            best = (depth, w[j], w[j + 1], ey, -ex)
    return best

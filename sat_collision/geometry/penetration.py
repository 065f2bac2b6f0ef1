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
Penetration depth of two convex polygons: the shortest move after which they only touch.

It is along the normal of an edge of one of them, as far as the other polygon reaches behind that
edge. All edges are tried in plain doubles, and those that might have the least depth again with
double-doubles: see docs/exactness.md, lemma 18.
"""

import math

from sat_collision.geometry.double_double import (
    cross, difference, dot, negative, plus, quotient, scaled, square_root)
from sat_collision.geometry.jit import inner, kernel, scratch
from sat_collision.geometry.layout import first_vertex
from sat_collision.geometry.nearest_features import between, furthest, offset, reach_of, SHORT
from sat_collision.geometry.part_bounds import ROUNDING
from sat_collision.geometry.plane import scale_to_one, unit
from sat_collision.geometry.separating_axis import support

# Offsets along an edge up to this, relative to the largest coordinate, count as zero.
_NEGLIGIBLE = 2.0 ** -92


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
        return other_depth[0], ax, ay, bx, by, -ux, -uy
    if depth[0] == math.inf:
        v = p.array
        i = first_vertex(p)
        return depth[0], v[i], v[i + 1], v[i], v[i + 1], 1.0, 0.0
    ax, ay, bx, by, ux, uy = _move(p, q, edge, vertex)
    return depth[0], ax, ay, bx, by, ux, uy


@inner
def _least_reach(p, q, slack):
    """
    Find the edge of P behind which Q reaches least far.

    Returned are this depth as a double-double (infinite if P is a point, or like one by
    underflow), and the indices of the vertex at which the edge starts and of the vertex of Q that
    reaches so far.
    """
    v = p.array
    w = q.array
    first = first_vertex(p)
    count = p.n if p.n > 1 else 0
    rough = scratch(count)
    least = math.inf
    for i in range(count):
        a = first + 2 * i
        b = _after(p, a)
        ex = v[b] - v[a]
        ey = v[b + 1] - v[a + 1]
        long = max(abs(ex), abs(ey)) > SHORT
        ex, ey = unit(ex, ey)
        j = support(q, -ey, ex)
        rough[i] = -math.inf
        if long and j >= 0:
            rough[i] = ex * (w[j + 1] - v[a + 1]) - ey * (w[j] - v[a])
            least = min(least, rough[i])
    depth = (math.inf, 0.0)
    edge = first
    vertex = first_vertex(q)
    for i in range(count):
        if rough[i] > least + slack:
            continue
        a = first + 2 * i
        ex, ey = _edge(p, a)
        if ex[0] == 0.0 and ey[0] == 0.0:
            continue
        # No vertex of P is beyond its edge, unless this is so short that underflow turns it.
        k = furthest(p, a, ey, negative(ex))
        j = furthest(q, first_vertex(q), negative(ey), ex)
        reach = cross(ex, ey, difference(w[j], v[k]), difference(w[j + 1], v[k + 1]))
        found = quotient(reach, square_root(dot(ex, ey, ex, ey)))
        if found < depth:
            depth = found
            edge = a
            vertex = j
    return depth, edge, vertex


@inner
def _after(p, a):
    """Return the index of the vertex after that at a."""
    first = first_vertex(p)
    return a + 2 if a < first + 2 * p.n - 2 else first


@inner
def _edge(p, a):
    """Return the edge of P that starts at a, multiplied by a power of two."""
    v = p.array
    b = _after(p, a)
    ex = difference(v[b], v[a])
    ey = difference(v[b + 1], v[a + 1])
    return scaled(ex, ey, scale_to_one(max(abs(ex[0]), abs(ey[0]))))


@inner
def _before(p, a):
    """Return the index of the vertex before that at a."""
    first = first_vertex(p)
    return a - 2 if a > first else first + 2 * p.n - 2


@inner
def _move(p, q, a, j):
    """
    Return a point of P, one of Q as far behind P's edge at a as its vertex at j, and the normal.

    The vertex need not be opposite that edge if another vertex of either body is as far along the
    normal, or nearly: the boundary of the Minkowski difference is followed from the edge on to
    where a point of Q is opposite one of P. Each coordinate is rounded once.
    """
    v = p.array
    w = q.array
    ex, ey = _edge(p, a)
    size = square_root(dot(ex, ey, ex, ey))
    ux = quotient(ey, size)[0]
    uy = -quotient(ex, size)[0]
    i, c = a, _after(p, a)
    k = d = j
    forward = dot(ex, ey, *offset(v, w, a, j))[0] >= 0.0
    if not forward:
        i, c = c, i
        ex, ey = negative(ex), negative(ey)
    slack = _NEGLIGIBLE * size[0] * reach_of(p, q)
    left = dot(ex, ey, *offset(v, w, c, d))
    for _ in range(p.n + q.n):
        if left[0] <= slack:
            break
        i, k = c, d
        c = _after(p, i) if forward else _before(p, i)
        d = _after(q, k) if forward else _before(q, k)
        fx, fy = difference(v[c], v[i]), difference(v[c + 1], v[i + 1])
        gx, gy = difference(w[d], w[k]), difference(w[d + 1], w[k + 1])
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
    return (between(v[i], v[c], share), between(v[i + 1], v[c + 1], share),
            between(w[k], w[d], share), between(w[k + 1], w[d + 1], share), ux, uy)

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
Other methods: binary-search SAT and GJK in plain floating point, and exact orientations.

All take two convex polygons as counter-clockwise (n, 2) arrays, and for each a head made in
advance, its bounding box and centre of gravity; all begin with the boxes. A kernel returns the
answer and how many axes or edges it tried, with a test of the boxes counted as two.

Two convex polygons are apart iff some edge of one has every vertex of the other strictly on its
outer side. *filtered orientations* tests each edge with the semi-static filter of CGAL's kernel
(Melquiond and Pion 2007), and exactly if that fails. It begins with the vertex that refuted the
edge before, which makes most pairs O(n).
"""

import math

from sat_collision.geometry.jit import kernel
from sat_collision.geometry.predicates import orient, segments_meet

# The support vertex of bodies with up to so many vertices is found by a linear scan.
_SCANNED = 8

# GJK counts bodies nearer than this as touching, relative to the largest difference between their
# vertices; it ends after so many steps, and then counts them as touching, too.
GJK_TOLERANCE = 1e-10
_MOST_STEPS = 64

# The constants of CGAL's Orientation_2: error of the determinant of 2 x 2 rounded differences,
# and the magnitudes between which neither the bound underflows nor the determinant overflows.
_CGAL_ERROR = 8.8872057372592798e-16
_CGAL_LEAST = 1e-146
_CGAL_MOST = 1e153


@kernel
def binary_axes(p, q, head_p, head_q):
    """Try the normal of each edge by the support vertex of the other body (O'Rourke 1998, 7.9)."""
    if boxes_apart(head_p, head_q):
        return False, 2
    axes = 2
    for body, other in ((p, q), (q, p)):
        for i in range(len(body)):
            axes += 1
            x = body[i, 1] - body[i - 1, 1]
            y = body[i - 1, 0] - body[i, 0]
            k = support(other, -x, -y)
            reach = max(body[i - 1, 0] * x + body[i - 1, 1] * y, body[i, 0] * x + body[i, 1] * y)
            if other[k, 0] * x + other[k, 1] * y > reach:
                return False, axes
    return True, axes


@kernel
def gjk_axes(p, q, head_p, head_q):
    """
    Walk to the point of Q - P nearest to the origin, as van den Bergen (1999) does.

    Each step adds the support vertex along the nearest point found so far, and ends once that
    point is an axis that separates, or is as good as the origin.
    """
    if boxes_apart(head_p, head_q):
        return False, 2
    axes = 2
    x = head_q[4] - head_p[4]
    y = head_q[5] - head_p[5]
    ax = bx = x
    ay = by = y
    points = 1
    largest = math.sqrt(x * x + y * y)
    for _ in range(_MOST_STEPS):
        axes += 1
        length = math.sqrt(x * x + y * y)
        if length <= GJK_TOLERANCE * largest:
            return True, axes
        i = support(p, x, y)
        j = support(q, -x, -y)
        wx = q[j, 0] - p[i, 0]
        wy = q[j, 1] - p[i, 1]
        largest = max(largest, math.sqrt(wx * wx + wy * wy))
        if wx * x + wy * y > GJK_TOLERANCE * length * largest:
            return False, axes
        if points == 2 and _holds_origin(ax, ay, bx, by, wx, wy):
            return True, axes
        # The nearest point of the triangle lies on one of the two edges at the new vertex.
        x, y, ax, ay = _nearer_edge(ax, ay, bx, by, wx, wy)
        bx = wx
        by = wy
        points = 2
    return True, axes


@kernel
def boxes_apart(head_p, head_q):
    """Return whether two bounding boxes share no point."""
    return ((head_p[0] > head_q[2]) | (head_q[0] > head_p[2])
            | (head_p[1] > head_q[3]) | (head_q[1] > head_p[3]))


@kernel
def support(body, x, y):
    """Return the vertex furthest along an axis, up to rounding; vertices are counter-clockwise."""
    count = len(body)
    if count <= _SCANNED:
        best = 0
        most = body[0, 0] * x + body[0, 1] * y
        for k in range(1, count):
            along = body[k, 0] * x + body[k, 1] * y
            if along > most:
                best = k
                most = along
        return best
    low = 0
    high = count
    rises = _rise(body, 0, x, y) > 0
    if not rises and _rise(body, -1, x, y) > 0:
        return 0
    while high - low > 1:
        middle = (low + high) // 2
        ahead = _rise(body, middle, x, y)
        if ahead <= 0 and _rise(body, middle - 1, x, y) > 0:
            return middle
        higher = ((body[low, 0] - body[middle, 0]) * x
                  + (body[low, 1] - body[middle, 1]) * y) > 0
        if rises:
            before = ahead <= 0 or higher
        else:
            before = ahead <= 0 and not higher
        if before:
            high = middle
        else:
            low = middle
            rises = ahead > 0
    return low


@kernel
def _rise(body, i, x, y):
    """Return how far the edge from vertex i on goes along an axis."""
    k = i + 1 if i + 1 < len(body) else 0
    return (body[k, 0] - body[i, 0]) * x + (body[k, 1] - body[i, 1]) * y


@kernel
def _holds_origin(ax, ay, bx, by, cx, cy):
    """Return whether a triangle, in either winding, contains the origin."""
    ab = ax * by - ay * bx
    bc = bx * cy - by * cx
    ca = cx * ay - cy * ax
    return (ab >= 0 and bc >= 0 and ca >= 0) or (ab <= 0 and bc <= 0 and ca <= 0)


@kernel
def _nearer_edge(ax, ay, bx, by, wx, wy):
    """Return the nearest point to the origin on a w or b w, and the other end of that edge."""
    x, y = _nearest_on_segment(ax, ay, wx, wy)
    other_x, other_y = _nearest_on_segment(bx, by, wx, wy)
    if x * x + y * y <= other_x * other_x + other_y * other_y:
        return x, y, ax, ay
    return other_x, other_y, bx, by


@kernel
def _nearest_on_segment(ax, ay, bx, by):
    """Return the point of a segment that is nearest to the origin."""
    x = bx - ax
    y = by - ay
    square = x * x + y * y
    along = -(ax * x + ay * y)
    if not along > 0.0:
        return ax, ay
    if along >= square:
        return bx, by
    return ax + along / square * x, ay + along / square * y


@kernel
def filtered_axes(p, q, head_p, head_q):
    """Decide by orientations that are each filtered: the method labelled filtered orientations."""
    if boxes_apart(head_p, head_q):
        return False, 2
    if len(p) <= 2 and len(q) <= 2:
        return _segments_meet(p, q), 3
    apart, axes = _some_edge_separates(p, q)
    if not apart:
        apart, more = _some_edge_separates(q, p)
        axes += more
    return not apart, axes + 2


@kernel
def _some_edge_separates(body, other):
    k = 0
    for i in range(len(body) if len(body) > 1 else 0):
        separates = True
        for _ in range(len(other)):
            if semi_static_orient(body[i - 1, 0], body[i - 1, 1], body[i, 0], body[i, 1],
                                  other[k, 0], other[k, 1]) >= 0:
                separates = False
                break
            k = k + 1 if k + 1 < len(other) else 0
        if separates:
            return True, i + 1
    return False, len(body)


@kernel
def _segments_meet(p, q):
    return segments_meet(p[0, 0], p[0, 1], p[-1, 0], p[-1, 1],
                         q[0, 0], q[0, 1], q[-1, 0], q[-1, 1])


@kernel
def semi_static_orient(ax, ay, bx, by, cx, cy):
    """Return the sign of the turn a, b, c through CGAL's semi-static filter."""
    abx = bx - ax
    aby = by - ay
    acx = cx - ax
    acy = cy - ay
    determinant = abx * acy - aby * acx
    x = max(abs(abx), abs(acx))
    y = max(abs(aby), abs(acy))
    least = min(x, y)
    if least == 0.0:
        return 0
    if least > _CGAL_LEAST and max(x, y) < _CGAL_MOST:
        bound = _CGAL_ERROR * x * y
        if determinant > bound:
            return 1
        if determinant < -bound:
            return -1
    return orient(ax, ay, bx, by, cx, cy)

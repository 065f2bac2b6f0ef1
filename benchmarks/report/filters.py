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
Rivals that are exact: filters of two kinds in front of exact orientations.

Two convex polygons are apart iff some edge of one has every vertex of the other strictly on its
outer side. *filtered orientations* asks this of each edge, CGAL's way: every orientation goes
through the semi-static filter of CGAL's kernel (Melquiond and Pion 2007) and is computed exactly
where that fails. *interval filter* asks the same in interval arithmetic, and where an edge stays
undecided gives the whole pair to the exact orientations.

Both begin with the boxes, and try first the vertex that refuted the edge before, which makes most
pairs O(n). The exact stage is `predicates.orient`, the same that `improved` has. A kernel returns
the answer and how many edges it asked about, a test of the boxes counted as two.
"""

from rivals import boxes_apart
from sat_collision.geometry.jit import kernel
from sat_collision.geometry.predicates import orient, segments_meet

# Twice the error of one rounding, relative and where numbers are no longer normal.
_ROUNDING = 2.0 ** -52
_SMALLEST = 2.0 ** -1074
# Below this products of differences do not overflow.
_LARGEST = 2.0 ** 500
# The constants of CGAL's Orientation_2: error of the determinant of 2 x 2 rounded differences,
# and between which magnitudes neither the bound underflows nor the determinant overflows.
_CGAL_ERROR = 8.8872057372592798e-16
_CGAL_LEAST = 1e-146
_CGAL_MOST = 1e153

_APART = -1
_UNDECIDED = 0
_REFUTED = 1


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
def interval_axes(p, q, head_p, head_q):
    """Decide in interval arithmetic, else by `filtered_axes`: the method named interval filter."""
    if boxes_apart(head_p, head_q):
        return False, 2
    axes = 2
    decided = len(p) > 2 or len(q) > 2
    for k in range(4):
        decided = decided and abs(head_p[k]) < _LARGEST and abs(head_q[k]) < _LARGEST
    for body, other in ((p, q), (q, p)):
        k = 0
        for i in range(len(body) if len(body) > 1 else 0):
            if decided:
                axes += 1
                verdict, k = _edge_interval(body[i - 1, 0], body[i - 1, 1],
                                            body[i, 0], body[i, 1], other, k)
                if verdict == _APART:
                    return False, axes
                decided = verdict == _REFUTED
    if decided:
        return True, axes
    collides, more = filtered_axes(p, q, head_p, head_q)
    return collides, axes + more


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


@kernel
def _edge_interval(ax, ay, bx, by, other, k):
    """Return whether an edge separates, as far as intervals tell, and the vertex that refuted."""
    verdict = _APART
    x_low, x_high = _difference(bx, ax)
    y_low, y_high = _difference(by, ay)
    for _ in range(len(other)):
        u_low, u_high = _difference(other[k, 0], ax)
        v_low, v_high = _difference(other[k, 1], ay)
        left_low, left_high = _product(x_low, x_high, v_low, v_high)
        right_low, right_high = _product(y_low, y_high, u_low, u_high)
        low = _down(left_low - right_high)
        high = _up(left_high - right_low)
        if low >= 0.0:
            return _REFUTED, k
        if not high < 0.0:
            verdict = _UNDECIDED
        k = k + 1 if k + 1 < len(other) else 0
    return verdict, k


@kernel
def _difference(a, b):
    return _down(a - b), _up(a - b)


@kernel
def _product(a_low, a_high, b_low, b_high):
    first = a_low * b_low
    second = a_low * b_high
    third = a_high * b_low
    fourth = a_high * b_high
    return (_down(min(min(first, second), min(third, fourth))),
            _up(max(max(first, second), max(third, fourth))))


@kernel
def _down(x):
    """Return a number below what was rounded to x."""
    return x - (abs(x) * _ROUNDING + _SMALLEST)


@kernel
def _up(x):
    return x + (abs(x) * _ROUNDING + _SMALLEST)

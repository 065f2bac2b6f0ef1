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
The improved separating axis method: the paper's first moves, continued until proved.

Let w = q - p range over the Minkowski difference of Q and P. An axis u separates P from Q when
w . u > 0 for all its vertices. Where discs inside the polygons overlap, so do they. Otherwise the
search starts with the centre line u = d (paper section 3.2), which gives the potential nearest
points and the w between them (section 3.1). The paper tries the axis along this w next. But d,
between two inner points, is a w too, and the normal of the segment between the two bounds the cone
of axes still possible: trying it instead needs fewer axes. So on, until an axis separates, or
three w hold the origin in their triangle: a common point.

Each sign is taken from plain doubles when it exceeds a forward error bound. Where one does not
(touching, collinear, hair-thin gaps) the search says so, and `exact` decides.
"""

from sat_collision.geometry.jit import inlined
from sat_collision.geometry.layout import (
    HEADER, near_support, SCAN_LIMIT, table_sector, table_size)
from sat_collision.geometry.predicates import UNDERFLOW_BOUND

SEPARATE = -1
UNCERTAIN = 0
MEET = 1
OPEN = 2

# A sum of two products of rounded differences has an error of at most (4 u + O(u^2)) times the
# sum of the products' magnitudes, u = 2^-53; twice that is taken.
PRODUCT_BOUND = 8.0 * 2.0 ** -53
# What the support vertices of both polygons may fall short of the true ones, see `support`, and
# what up to 2^19 edges may hide in underflow.
SUPPORT_BOUND = 64.0 * 2.0 ** -53
SUPPORT_UNDERFLOW = 2.0 ** -1040

MOST_QUERIES = 48


@inlined
def boxes_apart(p, p_start, q, q_start):
    """Tell whether the bounding boxes of two packed polygons share no point."""
    # Bitwise, to be one branch and not four that a processor cannot foresee.
    return ((p[p_start + 2] > q[q_start + 4]) | (q[q_start + 2] > p[p_start + 4])
            | (p[p_start + 3] > q[q_start + 5]) | (q[q_start + 3] > p[p_start + 5]))


@inlined
def find_separating_axis(p, p_start, n, q, q_start, m):
    """
    Search for a separating axis or a common point of two convex polygons in plain doubles.

    Parameters
    ----------
    p, q : flat arrays of float64
        Hold the packed polygons (see `layout`), from p_start and q_start on.
    n, m : int
        Their numbers of vertices, at least one.

    Returns
    -------
    verdict : int
        SEPARATE and MEET are proved. Otherwise UNCERTAIN.
    i, j : int
        Where the last support vertices of P and Q stand in p and q; meaningless when UNCERTAIN.
    queries : int
        How many axes were tried.

    """
    verdict, ux, uy, reach_x, reach_y = first_axis(p, p_start, q, q_start)
    ax = bx = ux
    ay = by = uy
    i = j = 0
    queries = 0
    while verdict == OPEN and queries < MOST_QUERIES:
        queries += 1
        i = support(p, p_start, n, ux, uy)
        j = support(q, q_start, m, -ux, -uy)
        verdict, ax, ay, bx, by, ux, uy = refine(p, i, q, j, ax, ay, bx, by, ux, uy,
                                                   reach_x, reach_y)
    return UNCERTAIN if verdict == OPEN else verdict, i, j, queries


@inlined
def first_axis(p, p_start, q, q_start):
    """
    Compare the discs inside two polygons, and choose the first axis.

    Returns
    -------
    verdict : int
        MEET or OPEN.
    ux, uy : float
        The first axis, and both sides of the cone.
    reach_x, reach_y : float
        The greatest magnitudes of coordinates.

    """
    reach_x = max(max(-p[p_start + 2], p[p_start + 4]), max(-q[q_start + 2], q[q_start + 4]))
    reach_y = max(max(-p[p_start + 3], p[p_start + 5]), max(-q[q_start + 3], q[q_start + 5]))
    ux = q[q_start] - p[p_start]
    uy = q[q_start + 1] - p[p_start + 1]
    inner = p[p_start + 6] + q[q_start + 6]
    verdict = OPEN
    if ux * ux + uy * uy < inner * inner or (ux == 0.0 and uy == 0.0):
        verdict = MEET
    return verdict, ux, uy, reach_x, reach_y


@inlined
def refine(p, i, q, j, ax, ay, bx, by, ux, uy, reach_x, reach_y):
    """
    Judge an axis u by the support vertices along it, and choose the next one.

    Parameters
    ----------
    p, q : flat arrays of float64
    i, j : int
        Where the support vertices stand, see `support`.
    ax, ay, bx, by : float
        The cone of axes still possible, {u: u . a > 0, u . b > 0}, a to b a left turn.
    ux, uy : float
        The axis.
    reach_x, reach_y : float
        The greatest magnitudes of coordinates.

    Returns
    -------
    verdict : int
        SEPARATE, MEET, UNCERTAIN, or OPEN: another axis has to be tried.
    ax, ay, bx, by, ux, uy : float
        What remains of the cone, and the next axis; meaningless unless OPEN.

    """
    verdict = UNCERTAIN
    if i >= 0 and j >= 0:
        wx = q[j] - p[i]
        wy = q[j + 1] - p[i + 1]
        from_a = _turn(ax, ay, wx, wy)
        to_b = _turn(wx, wy, bx, by)
        gap = _gap(wx, wy, ux, uy, reach_x, reach_y)
        if gap > 0:
            verdict = SEPARATE
        elif gap < 0:
            if from_a < 0 and to_b < 0:
                verdict = MEET
            elif from_a > 0 and to_b < 0:
                verdict = OPEN
                bx = wx
                by = wy
            elif from_a < 0 and to_b > 0:
                verdict = OPEN
                ax = wx
                ay = wy
    return verdict, ax, ay, bx, by, by - ay, ax - bx


@inlined
def support(v, start, count, ux, uy):
    """
    Return where in v the vertex furthest along u stands, or -1 where that is not certain.

    What it may fall short by is bounded in terms of M = |ux| max|x| + |uy| max|y|, u = 2^-53. Of a
    few vertices all are projected, each with an error of 2 u M. On many the boundary is climbed
    until no neighbour is seen to be further. One of the two edges there must be seen to fall for
    certain: then the edges whose rise could not be told are part of the arc around the summit
    that is perpendicular to u but for rounding. Each rises by less than 12 u (|ux dx| + |uy dy|),
    and all together, inside a box of sides 2 max|x| and 2 max|y|, by less than 24 u M.
    """
    if count <= SCAN_LIMIT:
        i = start + HEADER
        summit = i
        most = v[i] * ux + v[i + 1] * uy
        for _ in range(1, count):
            i += 2
            along = v[i] * ux + v[i + 1] * uy
            summit = i if along > most else summit
            most = along if along > most else most
        return summit
    i = near_support(v, start, count, table_sector(count, ux, uy))
    return hill_climb(v, start, count, i, ux, uy)


@inlined
def hill_climb(v, start, count, i, ux, uy):
    """Climb from the vertex at i to the one furthest along u, see `support`."""
    first = start + HEADER + table_size(count)
    last = first + 2 * count - 2
    ahead = i + 2 if i < last else first
    behind = i - 2 if i > first else last
    rise_ahead = _rise(v, i, ahead, ux, uy)
    rise_behind = _rise(v, i, behind, ux, uy)
    summit = i if rise_ahead < 0 or rise_behind < 0 else -1
    while rise_ahead > 0:
        summit = ahead
        ahead = summit + 2 if summit < last else first
        rise_ahead = _rise(v, summit, ahead, ux, uy)
        rise_behind = 0
    while rise_behind > 0:
        summit = behind
        behind = summit - 2 if summit > first else last
        rise_behind = _rise(v, summit, behind, ux, uy)
    return summit


@inlined
def _rise(v, i, k, ux, uy):
    """Return the sign of the step along u from the vertex at i to that at k, 0 if not certain."""
    along_x = (v[k] - v[i]) * ux
    along_y = (v[k + 1] - v[i + 1]) * uy
    rise = along_x + along_y
    bound = PRODUCT_BOUND * (abs(along_x) + abs(along_y)) + UNDERFLOW_BOUND
    return int(rise > bound) - int(-rise > bound)


@inlined
def _gap(wx, wy, ux, uy, reach_x, reach_y):
    """Return the sign of w . u for the true support vertices, 0 if not certain."""
    along_x = wx * ux
    along_y = wy * uy
    gap = along_x + along_y
    bound = (PRODUCT_BOUND * (abs(along_x) + abs(along_y))
             + SUPPORT_BOUND * (abs(ux) * reach_x + abs(uy) * reach_y) + SUPPORT_UNDERFLOW)
    # Strict, so that overflow (infinity > infinity) and NaN prove nothing.
    return int(gap > bound) - int(-gap > bound)


@inlined
def _turn(ax, ay, bx, by):
    """Return the sign of the cross product of two rounded differences, 0 if not certain."""
    left = ax * by
    right = ay * bx
    cross = left - right
    bound = PRODUCT_BOUND * (abs(left) + abs(right)) + UNDERFLOW_BOUND
    return int(cross > bound) - int(-cross > bound)

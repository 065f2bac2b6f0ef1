# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The improved separating axis method: the paper's first steps, continued until there is a proof.

Let w = q - p range over the Minkowski difference of Q and P. An axis u separates P from Q if
w . u > 0 for all its vertices. If discs inside the polygons overlap, so do they. Otherwise the
search starts with the centre line u = d (paper section 3.2), which gives the potential nearest
points and the w between them (section 3.1). The paper tries the axis along this w next. But d,
between two inner points, is a w too; the axes still possible form the cone u . d > 0, u . w > 0,
and trying the normal of the segment from d to w, which lies in it, needs fewer axes. The cone
shrinks until an axis separates, or the origin is in the triangle of three w: a common point.

A sign from plain doubles counts if the value exceeds a forward error bound. If one does not
(touching, collinear, hair-thin gaps) the verdict is UNCERTAIN, and `intersection` decides exactly.
The bounds and verdicts are proved in docs/exactness.md, lemmas 4 to 10.
"""

import math
from typing import NamedTuple

from sat_collision.geometry.body.layout import (
    first_vertex, HEADER, near_support, SCAN_LIMIT, table_sector)
from sat_collision.geometry.compiled.jit import inlined
from sat_collision.geometry.numeric.predicates import UNDERFLOW_BOUND

SEPARATE = -1
UNCERTAIN = 0
MEET = 1
OPEN = 2

# Relative to the sum of the products' magnitudes; lemmas 4 and 5.
PRODUCT_BOUND = 8.0 * 2.0 ** -53
# By how much both support vertices together may fall short of the true ones; lemma 8.
SUPPORT_BOUND = 64.0 * 2.0 ** -53
# Above this, underflow does not affect whether an edge counts as level; lemma 7.
_LEAST_LEVEL = 2.0 ** -1000

MAX_QUERIES = 48


class Search(NamedTuple):
    """The state of a search between two axes."""

    # The cone of axes still possible, {u: u . a > 0, u . b > 0}, a to b a left turn.
    ax: float
    ay: float
    bx: float
    by: float
    ux: float  # the axis to try next
    uy: float
    reach_x: float  # the greatest magnitudes of coordinates
    reach_y: float


@inlined
def boxes_apart(p, q):
    """Return whether the bounding boxes of two packed polygons share no point."""
    a, b = p.array, q.array
    # Bitwise, to have one branch instead of four that would be mispredicted.
    return ((a[p.start + 2] > b[q.start + 4]) | (b[q.start + 2] > a[p.start + 4])
            | (a[p.start + 3] > b[q.start + 5]) | (b[q.start + 3] > a[p.start + 5]))


@inlined
def find_separating_axis(p, q):
    """
    Search for a separating axis or a common point of two convex polygons in plain doubles.

    Returned are the verdict, SEPARATE or MEET if proved, else UNCERTAIN; the indices of the last
    support vertices of P and Q, 0 or -1 if there are none; and how many axes were tried.
    """
    verdict, search = first_axis(p, q)
    i = j = queries = 0
    while verdict == OPEN and queries < MAX_QUERIES:
        queries += 1
        i, j = support(p, search.ux, search.uy), support(q, -search.ux, -search.uy)
        verdict, search = refine(p.array, i, q.array, j, search)
    return UNCERTAIN if verdict == OPEN else verdict, i, j, queries


@inlined
def first_axis(p, q):
    """Compare the discs inside two polygons; return MEET or OPEN, and the Search to start with."""
    a, b = p.array, q.array
    i, j = p.start, q.start
    reach_x = max(max(-a[i + 2], a[i + 4]), max(-b[j + 2], b[j + 4]))
    reach_y = max(max(-a[i + 3], a[i + 5]), max(-b[j + 3], b[j + 5]))
    ux, uy = b[j] - a[i], b[j + 1] - a[i + 1]
    inner = a[i + 6] + b[j + 6]
    verdict = OPEN
    if ux * ux + uy * uy < inner * inner or (ux == 0.0 and uy == 0.0):
        verdict = MEET
    return verdict, Search(ux, uy, ux, uy, ux, uy, reach_x, reach_y)


@inlined
def refine(p, i, q, j, search):
    """
    Evaluate an axis u by the support vertices along it, at i and j in their arrays.

    Return the verdict, SEPARATE, MEET, UNCERTAIN or OPEN, and, if OPEN, the Search to go on with.
    """
    ax, ay, bx, by, ux, uy, reach_x, reach_y = search
    verdict = UNCERTAIN
    if i >= 0 and j >= 0:
        wx, wy = q[j] - p[i], q[j + 1] - p[i + 1]
        from_a = _turn(ax, ay, wx, wy)
        to_b = _turn(wx, wy, bx, by)
        gap = _gap(wx, wy, search)
        if gap > 0:
            verdict = SEPARATE
        elif gap < 0:
            if from_a < 0 and to_b < 0:
                verdict = MEET
            elif from_a > 0 and to_b < 0:
                verdict = OPEN
                bx, by = wx, wy
            elif from_a < 0 and to_b > 0:
                verdict = OPEN
                ax, ay = wx, wy
    return verdict, Search(ax, ay, bx, by, by - ay, ax - bx, reach_x, reach_y)


@inlined
def support(p, ux, uy):
    """
    Return the index of the vertex of P furthest along u, or -1 if that is not certain.

    Few vertices are all projected, on many the boundary is climbed, see `hill_climb`. The vertex
    falls short of the true one by less than half of what SUPPORT_BOUND allows, see
    docs/exactness.md, lemmas 6 and 7.
    """
    if p.n <= SCAN_LIMIT:
        v = p.array
        i = p.start + HEADER
        summit = i
        most = v[i] * ux + v[i + 1] * uy
        for _ in range(1, p.n):
            i += 2
            along = v[i] * ux + v[i + 1] * uy
            summit = i if along > most else summit
            most = along if along > most else most
        return summit
    return hill_climb(p, near_support(p, table_sector(p.n, ux, uy)), ux, uy)


@inlined
def hill_climb(p, i, ux, uy):
    """
    Climb from the vertex at i to the one furthest along u; -1 if that is not certain.

    Only steps that rise for certain are taken. If there is none, each of the two edges has to fall
    for certain or to be level, see `_is_level`; then the vertex is the summit, or so little below
    it that it does not matter, by docs/exactness.md, lemma 7.
    """
    v = p.array
    first = first_vertex(p)
    last = first + 2 * p.n - 2
    summit = i
    ahead = i + 2 if i < last else first
    behind = i - 2 if i > first else last
    rise_ahead = _rise(v, i, ahead, ux, uy)
    rise_behind = _rise(v, i, behind, ux, uy)
    while rise_ahead > 0:
        summit = ahead
        ahead = summit + 2 if summit < last else first
        rise_ahead = _rise(v, summit, ahead, ux, uy)
        rise_behind = -1
    while rise_behind > 0:
        summit = behind
        behind = summit - 2 if summit > first else last
        rise_behind = _rise(v, summit, behind, ux, uy)
        rise_ahead = -1
    if ((rise_ahead == 0 and not _is_level(v, summit, ahead, ux, uy))
            or (rise_behind == 0 and not _is_level(v, behind, summit, ux, uy))):
        return -1
    return summit


@inlined
def _is_level(v, i, k, ux, uy):
    """
    Return whether an edge of uncertain rise is perpendicular to u, and runs to its left.

    Perpendicular up to rounding, which is unknown if underflow or overflow hides the rise; to the
    left, as edges do near the summit, not near the lowest vertex (docs/exactness.md, lemma 7).
    """
    dx, dy = v[k] - v[i], v[k + 1] - v[i + 1]
    size = abs(dx * ux) + abs(dy * uy)
    return ((_LEAST_LEVEL < size < math.inf or (ux == 0.0 and dy == 0.0)
             or (uy == 0.0 and dx == 0.0))
            and ux * dy - uy * dx > 0.0)


@inlined
def _rise(v, i, k, ux, uy):
    """Return the sign of the step along u from the vertex at i to that at k, 0 if not certain."""
    along_x, along_y = (v[k] - v[i]) * ux, (v[k + 1] - v[i + 1]) * uy
    rise = along_x + along_y
    bound = PRODUCT_BOUND * (abs(along_x) + abs(along_y)) + UNDERFLOW_BOUND
    return (rise > bound) - (-rise > bound)


@inlined
def _gap(wx, wy, search):
    """Return the sign of w . u for the true support vertices, 0 if not certain."""
    along_x, along_y = wx * search.ux, wy * search.uy
    gap = along_x + along_y
    bound = (PRODUCT_BOUND * (abs(along_x) + abs(along_y))
             + SUPPORT_BOUND * (abs(search.ux) * search.reach_x + abs(search.uy) * search.reach_y)
             + UNDERFLOW_BOUND)
    # Strict, so that overflow (infinity > infinity) and NaN prove nothing.
    return (gap > bound) - (-gap > bound)


@inlined
def _turn(ax, ay, bx, by):
    """Return the sign of the cross product of two rounded differences, 0 if not certain."""
    left, right = ax * by, ay * bx
    cross = left - right
    bound = PRODUCT_BOUND * (abs(left) + abs(right)) + UNDERFLOW_BOUND
    return (cross > bound) - (-cross > bound)

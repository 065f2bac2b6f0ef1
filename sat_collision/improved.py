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

Let w = q - p range over the vertices of the Minkowski difference of Q and P. An axis u separates
P from Q when w . u > 0 for all of them. The search starts with the centre line (paper section
3.2), goes on with the line through the potential nearest points (section 3.1), and then with the
normal of the segment between the two w that bound the cone of axes still possible, until an axis
separates, or three w hold the origin in their triangle: a common point.

Each sign is taken from plain doubles when it exceeds a forward error bound. Where one does not
(touching, collinear, hair-thin gaps) the answer comes from exact orientations.
"""

from sat_collision.jit import kernel
from sat_collision.predicates import orient, segments_meet, UNDERFLOW_BOUND
from sat_collision.ring import HEADER

# A sum of two products of rounded differences has an error of at most (4 u + O(u^2)) times the
# sum of the products' magnitudes, u = 2^-53; twice that is taken.
PRODUCT_BOUND = 8.0 * 2.0 ** -53
# What the support vertices of both polygons may fall short of the true ones, see `_support`, and
# what up to 2^19 edges may hide in underflow.
SUPPORT_BOUND = 64.0 * 2.0 ** -53
SUPPORT_UNDERFLOW = 2.0 ** -1040

_SCAN_LIMIT = 16
_MOST_QUERIES = 48


@kernel
def bodies_meet(p, p_start, n, q, q_start, m):
    """
    Tell exactly whether two bodies share a point; touching counts.

    Parameters
    ----------
    p, q : flat arrays of float64
        Hold the bodies' blocks, from p_start and q_start on: of a convex polygon its record (see
        `ring`), of another its bounds in a record's header and then, for each convex part, where
        the part's record starts in the block and its number of vertices.
    n, m : int
        The number of vertices, or minus the number of parts.

    """
    if (p[p_start + 2] > q[q_start + 4] or q[q_start + 2] > p[p_start + 4]
            or p[p_start + 3] > q[q_start + 5] or q[q_start + 3] > p[p_start + 5]):
        return False
    if n > 0 and m > 0:
        return convex_meet(p, p_start, n, q, q_start, m)
    for i in range(max(1, -n)):
        a, a_count = _part(p, p_start, n, i)
        for j in range(max(1, -m)):
            b, b_count = _part(q, q_start, m, j)
            if convex_meet(p, a, a_count, q, b, b_count):
                return True
    return False


@kernel
def _part(block, start, count, i):
    """Return where the record of convex part i starts and its number of vertices."""
    if count > 0:
        return start, count
    entry = start + HEADER + 2 * i
    return start + int(block[entry]), int(block[entry + 1])


@kernel
def convex_meet(p, p_start, n, q, q_start, m):
    """
    Tell exactly whether two convex polygons share a point; touching counts.

    Parameters
    ----------
    p, q : flat arrays of float64
        Hold the records of the polygons (see `ring`), from p_start and q_start on.
    n, m : int
        Their numbers of vertices; points (1) and segments (2) are allowed.

    """
    verdict, i, j = search(p, p_start, n, q, q_start, m)
    if verdict == 0:
        return meet_exactly(p, p_start, n, q, q_start, m, i, j)
    return verdict > 0


@kernel
def search(p, p_start, n, q, q_start, m):
    """
    Search for a separating axis or a common point in plain doubles.

    Returns
    -------
    verdict : int
        1 a common point is proved, -1 a separating axis is, 0 undecided.
    i, j : int
        The last support vertices of P and Q.

    """
    reach_x = max(max(-p[p_start + 2], p[p_start + 4]), max(-q[q_start + 2], q[q_start + 4]))
    reach_y = max(max(-p[p_start + 3], p[p_start + 5]), max(-q[q_start + 3], q[q_start + 5]))
    ps = p_start + HEADER
    qs = q_start + HEADER
    ux = q[q_start] - p[p_start]
    uy = q[q_start + 1] - p[p_start + 1]
    if ux == 0.0 and uy == 0.0:
        ux = 1.0
    i = _support(p, ps, n, ux, uy, 0)
    j = _support(q, qs, m, -ux, -uy, 0)
    ax = q[qs + 2 * j] - p[ps + 2 * i]
    ay = q[qs + 2 * j + 1] - p[ps + 2 * i + 1]
    if _separates(ax, ay, ux, uy, reach_x, reach_y):
        return -1, i, j
    i = _support(p, ps, n, ax, ay, i)
    j = _support(q, qs, m, -ax, -ay, j)
    bx = q[qs + 2 * j] - p[ps + 2 * i]
    by = q[qs + 2 * j + 1] - p[ps + 2 * i + 1]
    if _separates(bx, by, ax, ay, reach_x, reach_y):
        return -1, i, j
    side = _turn(ax, ay, bx, by)
    if side == 0:
        return 0, i, j
    if side < 0:
        ax, ay, bx, by = bx, by, ax, ay
    for _ in range(_MOST_QUERIES):
        # a to b is a left turn, so this normal of the segment a b has u . a = u . b > 0.
        ux = by - ay
        uy = ax - bx
        i = _support(p, ps, n, ux, uy, i)
        j = _support(q, qs, m, -ux, -uy, j)
        wx = q[qs + 2 * j] - p[ps + 2 * i]
        wy = q[qs + 2 * j + 1] - p[ps + 2 * i + 1]
        if _separates(wx, wy, ux, uy, reach_x, reach_y):
            return -1, i, j
        from_a = _turn(ax, ay, wx, wy)
        to_b = _turn(wx, wy, bx, by)
        if from_a < 0 and to_b < 0:
            return 1, i, j
        if from_a > 0 and to_b < 0:
            bx = wx
            by = wy
        elif from_a < 0 and to_b > 0:
            ax = wx
            ay = wy
        else:
            break
    return 0, i, j


@kernel
def _support(v, start, count, ux, uy, i):
    """
    Return the vertex of a convex polygon that is furthest along u; i is where to start looking.

    What it may fall short by is bounded in terms of M = |ux| max|x| + |uy| max|y|, u = 2^-53. Of a
    few vertices all are projected, each with an error of 2 u M. On many the boundary is climbed
    from the best of a sample, until no neighbour is seen to be further. One of the two edges
    there must be seen to fall for certain: then the edges whose rise could not be told are part
    of the arc around the summit that is perpendicular to u but for rounding. Each rises by less
    than 12 u (|ux dx| + |uy dy|), and all together, inside a box of sides 2 max|x| and 2 max|y|,
    by less than 24 u M.
    """
    if count > _SCAN_LIMIT:
        i = _climb(v, start, count, ux, uy, _furthest(v, start, count, count // 8, ux, uy, i))
        if i >= 0:
            return i
    return _furthest(v, start, count, 1, ux, uy, 0)


@kernel
def _furthest(v, start, count, stride, ux, uy, i):
    """Return the furthest along u of vertex i and every stride-th one."""
    most = v[start + 2 * i] * ux + v[start + 2 * i + 1] * uy
    for k in range(0, count, stride):
        along = v[start + 2 * k] * ux + v[start + 2 * k + 1] * uy
        if along > most:
            most = along
            i = k
    return i


@kernel
def _climb(v, start, count, ux, uy, i):
    """Return the local summit reached from vertex i along u, or -1 where it is not certain."""
    ahead = i + 1 if i + 1 < count else 0
    behind = i - 1 if i > 0 else count - 1
    step = 1 if _rise(v, start, i, ahead, ux, uy) > 0 else -1
    for _ in range(count):
        rise_ahead = _rise(v, start, i, ahead, ux, uy)
        rise_behind = _rise(v, start, i, behind, ux, uy)
        if step > 0 and rise_ahead > 0:
            behind = i
            i = ahead
            ahead = i + 1 if i + 1 < count else 0
        elif step < 0 and rise_behind > 0:
            ahead = i
            i = behind
            behind = i - 1 if i > 0 else count - 1
        elif rise_ahead < 0 or rise_behind < 0:
            return i
        else:
            return -1
    return -1


@kernel
def _rise(v, start, i, k, ux, uy):
    """Return the sign of the step along u from vertex i to vertex k, 0 where not certain."""
    along_x = (v[start + 2 * k] - v[start + 2 * i]) * ux
    along_y = (v[start + 2 * k + 1] - v[start + 2 * i + 1]) * uy
    rise = along_x + along_y
    bound = PRODUCT_BOUND * (abs(along_x) + abs(along_y)) + UNDERFLOW_BOUND
    if rise > bound:
        return 1
    if -rise > bound:
        return -1
    return 0


@kernel
def _separates(wx, wy, ux, uy, reach_x, reach_y):
    """Tell whether w . u > 0 is proved for the true support vertices too."""
    # Strict, so that overflow (infinity > infinity) and NaN prove nothing.
    return (wx * ux + wy * uy
            > PRODUCT_BOUND * (abs(wx * ux) + abs(wy * uy))
            + SUPPORT_BOUND * (abs(ux) * reach_x + abs(uy) * reach_y) + SUPPORT_UNDERFLOW)


@kernel
def _turn(ax, ay, bx, by):
    """Return the sign of the cross product of two rounded differences, 0 where not proved."""
    left = ax * by
    right = ay * bx
    cross = left - right
    bound = PRODUCT_BOUND * (abs(left) + abs(right)) + UNDERFLOW_BOUND
    if cross > bound:
        return 1
    if -cross > bound:
        return -1
    return 0


@kernel
def meet_exactly(p, p_start, n, q, q_start, m, i, j):
    """
    Decide by exact orientations; i and j are vertices near the contact, if there is one.

    Two convex polygons are separate iff some edge of one has every vertex of the other strictly
    outside it (a segment counts as two edges, there and back). Two bodies without area may be
    separate along their common line only, so those are compared as segments. Most touching pairs
    are recognised by their edges next to i and j.
    """
    ps = p_start + HEADER
    qs = q_start + HEADER
    for a in ((i + n - 1) % n, i):
        b = (a + 1) % n
        for c in ((j + m - 1) % m, j):
            d = (c + 1) % m
            if segments_meet(p[ps + 2 * a], p[ps + 2 * a + 1], p[ps + 2 * b], p[ps + 2 * b + 1],
                             q[qs + 2 * c], q[qs + 2 * c + 1], q[qs + 2 * d], q[qs + 2 * d + 1]):
                return True
    if n <= 2 and m <= 2:
        return False
    return not (_some_edge_separates(p, ps, n, q, qs, m, i, j)
                or _some_edge_separates(q, qs, m, p, ps, n, j, i))


@kernel
def _some_edge_separates(p, ps, n, q, qs, m, i, j):
    """Tell whether an edge of P has all of Q strictly on its right; exact."""
    if n < 2:
        return False
    inside = j
    for s in range(n):
        a = (i + n - 1 + s) % n
        b = (a + 1) % n
        separates = True
        for t in range(m):
            k = (inside + t) % m
            if orient(p[ps + 2 * a], p[ps + 2 * a + 1], p[ps + 2 * b], p[ps + 2 * b + 1],
                      q[qs + 2 * k], q[qs + 2 * k + 1]) >= 0:
                inside = k
                separates = False
                break
        if separates:
            return True
    return False

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
Normalisation of received points to a clean counter-clockwise ring, or what is wrong with them.

All decisions are exact: they compare coordinates or take the sign of `predicates.orient`.
"""

from sat_collision.geometry.jit import inner, kernel, scratch, scratch_integers
from sat_collision.geometry.predicates import orient, segments_meet

CONVEX = 0
NON_CONVEX = 1
NOT_FINITE = 2
SPIKE = 3
CROSSING = 4
TOO_MANY = 5


@kernel
def clean(points, ring, max_vertices, max_non_convex):
    """
    Turn points into a clean counter-clockwise ring.

    Repeated points, the closing point and vertices at which the boundary goes straight on are
    dropped, clockwise order is reversed, and the lexicographically least vertex goes first, so
    equal polygons have equal rings. Points that all lie on one line become a segment, equal points
    one vertex.

    Parameters
    ----------
    points : (2 n,) flat array of float64, n >= 1
        x, y of each point as received.
    ring : (2 n,) flat array of float64
        Receives the clean vertices; its tail may stay unused.
    max_vertices, max_non_convex : int
        The most vertices accepted of a convex and of a non-convex ring; larger ones are not
        examined any further.

    Returns
    -------
    verdict : int
        CONVEX or NON_CONVEX (the ring is valid), or NOT_FINITE, SPIKE, CROSSING or TOO_MANY.
    count : int
        Vertices in the ring.
    i, j : int
        NOT_FINITE: i is the index of the received point. SPIKE: i is the vertex of the ring at
        which the boundary folds back on itself. CROSSING: the edges that start at vertices i and
        j of the ring share a point.

    """
    verdict, count, clockwise, i = _classify(points, ring)
    j = i
    if count > max_vertices or (verdict == NON_CONVEX and count > max_non_convex):
        return TOO_MANY, count, i, j
    if verdict == NON_CONVEX:
        i, j = _first_crossing(ring, count)
        if i >= 0:
            return CROSSING, count, i, j
    if clockwise and (verdict == CONVEX or verdict == NON_CONVEX):
        _reverse(ring, count)
    return verdict, count, i, j


@inner
def _classify(points, ring):
    """
    Write the clean ring; return verdict, vertex count, clockwise and index.

    It is convex if and only if it turns only left, or only right, and exactly one vertex is
    lexicographically smaller than both neighbours (docs/exactness.md, lemma 12). A ring that is
    NON_CONVEX here has still to be checked for crossings.
    """
    walk, count, least = _drop_repeated(points)
    if count < 0:
        return NOT_FINITE, 0, False, -1 - count
    if count == 1:
        ring[0] = walk[0]
        ring[1] = walk[1]
        return CONVEX, 1, False, -1
    kept = 0
    left = 0
    minima = 0
    spike = -1
    turn_at_least = 0
    before = least - 1 if least > 0 else count - 1
    before_x = walk[2 * before]
    before_y = walk[2 * before + 1]
    for k in range(count):
        i = least + k if least + k < count else least + k - count
        x = walk[2 * i]
        y = walk[2 * i + 1]
        after = i + 1 if i + 1 < count else 0
        after_x = walk[2 * after]
        after_y = walk[2 * after + 1]
        rises_to = before_x < x or (before_x == x and before_y < y)
        rises_from = x < after_x or (x == after_x and y < after_y)
        turn = orient(before_x, before_y, x, y, after_x, after_y)
        if turn == 0 and rises_to != rises_from:
            spike = i
        if rises_from and not rises_to:
            minima += 1
        if k == 0:
            turn_at_least = turn
        if turn != 0:
            ring[2 * kept] = x
            ring[2 * kept + 1] = y
            kept += 1
            left += turn > 0
        before_x = x
        before_y = y
    if kept == 0:
        _span(walk, count, ring)
        return CONVEX, 2, False, -1
    if spike >= 0:
        ring[0] = walk[2 * spike]
        ring[1] = walk[2 * spike + 1]
        return SPIKE, 1, False, 0
    convex = minima == 1 and (left == kept or left == 0)
    return (CONVEX if convex else NON_CONVEX), kept, turn_at_least < 0, -1


@inner
def _drop_repeated(points):
    """
    Return the points without consecutive repetitions, their number and the index of the least.

    The number is -1 - i if point i is not finite; the least point is so by x, then y.
    """
    received = len(points) // 2
    walk = scratch(2 * received)
    count = 0
    least = 0
    for i in range(received):
        # Adding zero turns -0.0 into 0.0, so that equal vertices have equal bytes.
        x = points[2 * i] + 0.0
        y = points[2 * i + 1] + 0.0
        if x - x != 0.0 or y - y != 0.0:
            return walk, -1 - i, 0
        if count == 0 or x != walk[2 * count - 2] or y != walk[2 * count - 1]:
            walk[2 * count] = x
            walk[2 * count + 1] = y
            if x < walk[2 * least] or (x == walk[2 * least] and y < walk[2 * least + 1]):
                least = count
            count += 1
    while count > 1 and walk[0] == walk[2 * count - 2] and walk[1] == walk[2 * count - 1]:
        count -= 1
    return walk, count, least


@inner
def _span(walk, count, ring):
    """Write the two ends of collinear points into the ring."""
    low = 0
    high = 0
    for i in range(count):
        x = walk[2 * i]
        y = walk[2 * i + 1]
        if x < walk[2 * low] or (x == walk[2 * low] and y < walk[2 * low + 1]):
            low = i
        if x > walk[2 * high] or (x == walk[2 * high] and y > walk[2 * high + 1]):
            high = i
    for k in range(2):
        ring[k] = walk[2 * low + k]
        ring[2 + k] = walk[2 * high + k]


@inner
def _first_crossing(ring, count):
    """
    Return two edges of the ring that share a point without being neighbours, or (-1, -1).

    Edges are swept in order of their least x. Neighbours meet in their common vertex only,
    because neither spikes nor collinear vertices are left.
    """
    least = scratch(count)
    for i in range(count):
        after = i + 1 if i + 1 < count else 0
        least[i] = min(ring[2 * i], ring[2 * after])
    order = _sorted(least, count)
    for s in range(count):
        i = order[s]
        i_end = i + 1 if i + 1 < count else 0
        ax = ring[2 * i]
        ay = ring[2 * i + 1]
        bx = ring[2 * i_end]
        by = ring[2 * i_end + 1]
        max_x = max(ax, bx)
        min_y = min(ay, by)
        max_y = max(ay, by)
        for t in range(s + 1, count):
            j = order[t]
            if least[j] > max_x:
                break
            j_end = j + 1 if j + 1 < count else 0
            cy = ring[2 * j + 1]
            dy = ring[2 * j_end + 1]
            if (cy < min_y and dy < min_y) or (cy > max_y and dy > max_y):
                continue
            if (i_end != j and j_end != i
                    and segments_meet(ax, ay, bx, by, ring[2 * j], cy, ring[2 * j_end], dy)):
                return i, j
    return -1, -1


@inner
def _sorted(keys, count):
    """Return the indices of count keys in the order of the keys (Shell sort)."""
    order = scratch_integers(count)
    for i in range(count):
        order[i] = i
    gap = count // 2
    while gap > 0:
        for i in range(gap, count):
            moved = order[i]
            k = i
            while k >= gap and keys[order[k - gap]] > keys[moved]:
                order[k] = order[k - gap]
                k -= gap
            order[k] = moved
        # Not halved: that might compare odd indices only with each other until the last pass.
        gap = (5 * gap - 1) // 11 if gap > 2 else gap // 2
    return order


@inner
def _reverse(ring, count):
    """Reverse the order of the vertices, keeping the first one first."""
    i = 1
    j = count - 1
    while i < j:
        for k in range(2):
            a = 2 * i + k
            b = 2 * j + k
            ring[a], ring[b] = ring[b], ring[a]
        i += 1
        j -= 1

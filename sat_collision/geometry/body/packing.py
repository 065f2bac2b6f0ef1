# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Packed polygons, see `layout`, made from received points, or what is wrong with these.

All decisions are exact: they compare coordinates or take the sign of `predicates.orient`.
"""

import math
from typing import Any

import numpy as np
from sat_collision.geometry.body.layout import (
    ENTRY_BITS, entry_step, HEADER, packed_size, table_place, table_size)
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import (
    indexable, inlined, inner, kernel, numbers_of, scratch, scratch_integers)
from sat_collision.geometry.numeric.ascending import sort
from sat_collision.geometry.numeric.predicates import (
    orient, ORIENTATION_BOUND, segments_meet, UNDERFLOW_BOUND)
from sat_collision.geometry.numeric.vectors import bounds_of, centroid, length, NOWHERE

# Verdicts on points.
CONVEX = 0
NON_CONVEX = 1
NOT_FINITE = 2
SPIKE = 3
CROSSING = 4
TOO_MANY = 5

# Numbers of a point in bytes: x, y as float64, or x, y, z as float32; and their sizes.
PAIR = 2
TRIPLE = 3
WORD = 4
DOUBLE = 8
# Bytes of a point.
SIZES = {PAIR: PAIR * DOUBLE, TRIPLE: TRIPLE * WORD}

# The disc's radius is shortened by 2^-45 of the radius and the extent, which exceeds all rounding
# errors; there is no disc if an edge or the radius is so short that underflow might exceed this.
# See docs/exactness.md, lemma 10.
_SHORTER = 2.0 ** -45
_LEAST_EDGE = 2.0 ** -500
_LEAST_RADIUS = 1e-140


def workspace(max_vertices: int) -> Any:
    """Return the array in which kernels pack polygons of up to so many vertices, see `Run`."""
    # For the packed polygon, its points, ring, and points without repetitions; each may be closed.
    return indexable(np.empty(4 * packed_size(max_vertices + 1)))


@kernel
def pack(points, packed, max_vertices, max_non_convex):
    """
    Pack a polygon given by received points x, y, ..., see `layout`; one point at least.

    A convex polygon of more than `max_vertices`, or another of more than `max_non_convex`, is not
    examined any further. The packed array has room for as many vertices as there are points.

    Returned are the verdict, CONVEX or NON_CONVEX if the points are valid; the number of vertices
    in the ring; two indices that explain other verdicts; and where vertices start in the array,
    0 if the points are not valid. Of a non-convex polygon only bounds and vertices are written.

    NOT_FINITE: the first index is that of the received point. SPIKE: it is that of the vertex of
    the ring at which the boundary folds back on itself. CROSSING: the edges that start at both
    indices of the ring share a point.
    """
    require_nearest(len(points))
    ring = scratch(len(points))
    found = write_packed(points, len(points) // 2, ring, scratch(len(points)), packed,
                         max_vertices, max_non_convex)
    if found[0] == CONVEX:
        write_inner_disc(ring, found[1], packed)
    return found


@inner
def write_packed(points, received, ring, walk, packed, max_vertices, max_non_convex):
    """
    Pack some points as `pack` does, with room for as many in ring and walk.

    The ring is that of the polygon then. A convex polygon gets no disc, see `write_inner_disc`.
    """
    verdict, count, clockwise, i = _classify(points, received, ring, walk)
    j = i
    first = 0
    if count > max_vertices or (verdict == NON_CONVEX and count > max_non_convex):
        verdict = TOO_MANY
    elif verdict == NON_CONVEX:
        i, j = _first_crossing(ring, count)
        if i >= 0:
            verdict = CROSSING
    if verdict == CONVEX or verdict == NON_CONVEX:
        if clockwise:
            _reverse(ring, count)
        first = HEADER + table_size(count)
        packed[0], packed[1], packed[6] = ring[0], ring[1], 0.0
        packed[2], packed[3], packed[4], packed[5] = bounds_of(ring, count)
        if verdict == CONVEX:
            _write_table(ring, count, packed)
    for k in range(2 * count):
        packed[first + k] = ring[k]
    return verdict, count, i, j, first


@inlined
def plain_turn(points, received):
    """
    Return which way a polygon turns, 1 for left, -1 for right, its least point and its bounds.

    The least point may be -1, the last one. The turn is 0 unless the first test of `orient` shows
    each to be the same way, and only one point is less than both neighbours (docs/exactness.md,
    lemma 12): most convex polygons need no further examination.
    """
    least = minima = left = right = 0
    min_x, min_y, max_x, max_y = NOWHERE
    x, y = points[2 * received - 2], points[2 * received - 1]
    before = max(received - 2, 0)
    ex, ey = x - points[2 * before], y - points[2 * before + 1]
    rises_to = ex > 0.0 or (ex == 0.0 and ey > 0.0)
    for i in range(received):
        fx, fy = points[2 * i] - x, points[2 * i + 1] - y
        x, y = points[2 * i], points[2 * i + 1]
        rises_from = fx > 0.0 or (fx == 0.0 and fy > 0.0)
        product, other = ex * fy, ey * fx
        bound = ORIENTATION_BOUND * (abs(product) + abs(other)) + UNDERFLOW_BOUND
        left += product - other > bound
        right += other - product > bound
        if rises_from and not rises_to:
            minima += 1
            least = i - 1
        rises_to = rises_from
        ex, ey = fx, fy
        min_x = x if x < min_x else min_x
        min_y = y if y < min_y else min_y
        max_x = x if x > max_x else max_x
        max_y = y if y > max_y else max_y
    turn = 0 if minima != 1 else 1 if left == received else -1 if right == received else 0
    return turn, least, (min_x + 0.0, min_y + 0.0, max_x + 0.0, max_y + 0.0)


@kernel
def pack_convex(data, start, received, step, packed, max_vertices, affine):
    """Pack `moved_points` if they make a convex polygon to accept; return its count or 0."""
    points = moved_points(data, start, received, step, affine)
    verdict, count, _, _, _ = pack(points, packed, max_vertices, 0)
    return count if verdict == CONVEX else 0


@kernel
def moved_points(data, start, received, step, affine):
    """Return x, y of points, given as `polygon.Points`, as a flat array."""
    points = scratch(2 * received)
    _, floats, doubles = numbers_of(data)
    if step == PAIR:
        move(doubles, start // DOUBLE, step, received, affine, points)
    else:
        move(floats, start // WORD, step, received, affine, points)
    return points


@inlined
def move(values, first, step, received, affine, points):
    """
    Write x, y of points transformed by an affine map, of values from an index on.

    A point takes `step` values, x and y first. Each coordinate is rounded four times, see
    docs/exactness.md, lemma 14; not at all by UNMOVED.
    """
    a, b, c, d, e, f = affine
    for i in range(received):
        x, y = values[first + step * i], values[first + step * i + 1]
        points[2 * i] = a * x + b * y + c
        points[2 * i + 1] = d * x + e * y + f


@inner
def write_inner_disc(ring, count, packed):
    """
    Write the centroid (paper section 2.2) if it is proved to lie in the polygon, and its disc.

    The proofs need a point of the polygon. For slivers, segments and points, where rounding may
    put the centroid outside, the vertex that was written before stays. The disc around it touches
    the nearest edge, up to `_SHORTER`.
    """
    if count < 3:
        return
    x, y = centroid(ring, count)
    extent = (packed[4] - packed[2]) + (packed[5] - packed[3])
    radius = math.inf
    certain = True
    for i in range(count):
        k = i + 1 if i + 1 < count else 0
        if orient(ring[2 * i], ring[2 * i + 1], ring[2 * k], ring[2 * k + 1], x, y) < 0:
            return
        ex, ey = ring[2 * k] - ring[2 * i], ring[2 * k + 1] - ring[2 * i + 1]
        size = length(ex, ey)
        height = (ex * (y - ring[2 * i + 1]) - ey * (x - ring[2 * i])) / size
        certain = certain and height < math.inf and _LEAST_EDGE < size
        radius = min(radius, height)
    packed[0], packed[1] = x, y
    radius -= _SHORTER * (radius + extent)
    if certain and _LEAST_RADIUS < radius:
        packed[6] = radius


@inner
def _write_table(ring, count, packed):
    """March around the boundary once while the axis turns once, sector by sector."""
    size = table_size(count)
    i = 0
    for k in range(count):
        if ring[2 * k + 1] < ring[2 * i + 1]:
            i = k
    for sector in range(4 * size):
        turn = sector / size
        uy = turn - 1.0 if turn < 2.0 else 3.0 - turn
        ux = 1.0 - abs(uy) if turn < 2.0 else abs(uy) - 1.0
        for _ in range(count):
            k = i + 1 if i + 1 < count else 0
            if ((ring[2 * k] - ring[2 * i]) * ux + (ring[2 * k + 1] - ring[2 * i + 1]) * uy
                    <= 0.0):
                break
            i = k
        place = table_place(0, sector)
        if sector % 4 == 0:
            packed[place] = 0.0
        packed[place] += float((i // entry_step(count)) << (ENTRY_BITS * (sector % 4)))


@inner
def _classify(points, received, ring, walk):
    """
    Write the ring, cleaned as `Polygon` says; return verdict, count, whether clockwise, and index.

    It is convex if and only if it turns only left, or only right, and exactly one vertex is
    lexicographically smaller than both neighbours (docs/exactness.md, lemma 12). A ring that is
    NON_CONVEX here has still to be checked for crossings.
    """
    count, least = _drop_repeated(points, received, walk)
    if count < 0:
        return NOT_FINITE, 0, False, -1 - count
    if count == 1:
        ring[0], ring[1] = walk[0], walk[1]
        return CONVEX, 1, False, -1
    kept = left = minima = turn_at_least = 0
    spike = -1
    before = least - 1 if least > 0 else count - 1
    before_x, before_y = walk[2 * before], walk[2 * before + 1]
    for k in range(count):
        i = least + k if least + k < count else least + k - count
        x, y = walk[2 * i], walk[2 * i + 1]
        after = i + 1 if i + 1 < count else 0
        after_x, after_y = walk[2 * after], walk[2 * after + 1]
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
            ring[2 * kept], ring[2 * kept + 1] = x, y
            kept += 1
            left += turn > 0
        before_x, before_y = x, y
    if kept == 0:
        _span(walk, count, least, ring)
        return CONVEX, 2, False, -1
    if spike >= 0:
        ring[0], ring[1] = walk[2 * spike], walk[2 * spike + 1]
        return SPIKE, 1, False, 0
    convex = minima == 1 and (left == kept or left == 0)
    return (CONVEX if convex else NON_CONVEX), kept, turn_at_least < 0, -1


@inner
def _drop_repeated(points, received, walk):
    """
    Write points without consecutive repetitions; return their number and the index of the least.

    The number is -1 - i if point i is not finite; the least point is so by x, then y.
    """
    count = least = 0
    for i in range(received):
        # Adding zero turns -0.0 into 0.0, so that equal vertices have equal bytes.
        x, y = points[2 * i] + 0.0, points[2 * i + 1] + 0.0
        if x - x != 0.0 or y - y != 0.0:
            return -1 - i, 0
        if count == 0 or x != walk[2 * count - 2] or y != walk[2 * count - 1]:
            walk[2 * count], walk[2 * count + 1] = x, y
            if x < walk[2 * least] or (x == walk[2 * least] and y < walk[2 * least + 1]):
                least = count
            count += 1
    while count > 1 and walk[0] == walk[2 * count - 2] and walk[1] == walk[2 * count - 1]:
        count -= 1
    return count, least


@inner
def _span(walk, count, least, ring):
    """Write the two ends of collinear points into the ring, given the index of the least."""
    most = least
    for i in range(count):
        x = walk[2 * i]
        if x > walk[2 * most] or (x == walk[2 * most] and walk[2 * i + 1] > walk[2 * most + 1]):
            most = i
    for k in range(2):
        ring[k] = walk[2 * least + k]
        ring[2 + k] = walk[2 * most + k]


@inner
def _first_crossing(ring, count):
    """
    Return two edges of the ring that share a point without being neighbours, or (-1, -1).

    Edges are swept in order of their least x. Neighbours meet in their common vertex only,
    because neither spikes nor collinear vertices are left.
    """
    least = scratch(count)
    order = scratch_integers(count)
    for i in range(count):
        after = i + 1 if i + 1 < count else 0
        least[i] = min(ring[2 * i], ring[2 * after])
        order[i] = i
    sort(least, order, count)
    for s in range(count):
        i = order[s]
        i_end = i + 1 if i + 1 < count else 0
        ax, ay = ring[2 * i], ring[2 * i + 1]
        bx, by = ring[2 * i_end], ring[2 * i_end + 1]
        max_x = max(ax, bx)
        min_y, max_y = min(ay, by), max(ay, by)
        for t in range(s + 1, count):
            if least[t] > max_x:
                break
            j = order[t]
            j_end = j + 1 if j + 1 < count else 0
            cy, dy = ring[2 * j + 1], ring[2 * j_end + 1]
            if (cy < min_y and dy < min_y) or (cy > max_y and dy > max_y):
                continue
            if (i_end != j and j_end != i
                    and segments_meet(ax, ay, bx, by, ring[2 * j], cy, ring[2 * j_end], dy)):
                return i, j
    return -1, -1


@inner
def _reverse(ring, count):
    """Reverse the order of the vertices, keeping the first one first."""
    for i in range(1, (count + 1) // 2):
        j = count - i
        for k in range(2):
            ring[2 * i + k], ring[2 * j + k] = ring[2 * j + k], ring[2 * i + k]

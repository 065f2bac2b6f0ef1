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
From a ring of received points to a clean counter-clockwise one, or to what is wrong with it.

A polygon is kept as one flat *record* of doubles, so that one array holds all that a collision
decision reads: centroid x, y; bounds min x, min y, max x, max y; then the vertices x, y, x, y, ...
All decisions here are exact: they compare coordinates or take the sign of `predicates.orient`.
"""

import numpy as np

from sat_collision.jit import kernel, scratch
from sat_collision.predicates import orient, segments_meet

HEADER = 6

CONVEX = 0
NON_CONVEX = 1
NOT_FINITE = 2
SPIKE = 3
CROSSING = 4


@kernel
def build(points, record):
    """
    Clean a ring of points into a record.

    Repeated points, the closing point and collinear vertices are dropped, clockwise order is
    reversed. Points that all lie on one line become a segment, equal points one vertex.

    Parameters
    ----------
    points : (2 n,) flat array of float64, n >= 1
        x, y, x, y, ... as received.
    record : (HEADER + 2 n,) flat array of float64
        Receives the record; its tail may stay unused.

    Returns
    -------
    verdict : int
        CONVEX or NON_CONVEX (the record is valid), or NOT_FINITE, SPIKE or CROSSING.
    count : int
        Vertices in the record.
    i, j : int
        NOT_FINITE: i is the index of the received point. SPIKE: i is the vertex of the record at
        which the boundary folds back on itself. CROSSING: the edges that start at vertices i and
        j of the record share a point.

    """
    verdict, count, clockwise, place = _classify(points, record)
    other = place
    if verdict == NON_CONVEX:
        place, other = _first_crossing(record, count)
        if place >= 0:
            return CROSSING, count, place, other
    if verdict == CONVEX or verdict == NON_CONVEX:
        if clockwise:
            _reverse(record, count)
        _measure(record, count)
    return verdict, count, place, other


@kernel
def _classify(points, record):
    """
    Write the clean ring into the record; return verdict, vertex count, clockwise and place.

    A closed walk that only turns left, or only right, and has just one vertex that is
    lexicographically smaller than both neighbours turns once around: it is convex, and therefore
    simple. What is not convex is NON_CONVEX here and has still to be checked for crossings.
    """
    ring, count = _drop_repeated(points)
    if count < 0:
        return NOT_FINITE, 0, False, -1 - count
    if count <= 2:
        for i in range(2 * count):
            record[HEADER + i] = ring[i]
        return CONVEX, count, False, -1
    kept = 0
    left = 0
    minima = 0
    spike = -1
    lowest = 0
    lowest_turn = 0
    before_x = ring[2 * count - 2]
    before_y = ring[2 * count - 1]
    for i in range(count):
        x = ring[2 * i]
        y = ring[2 * i + 1]
        after = i + 1 if i + 1 < count else 0
        after_x = ring[2 * after]
        after_y = ring[2 * after + 1]
        rises_to = before_x < x or (before_x == x and before_y < y)
        rises_from = x < after_x or (x == after_x and y < after_y)
        turn = orient(before_x, before_y, x, y, after_x, after_y)
        if turn == 0 and rises_to != rises_from:
            spike = i
        if rises_from and not rises_to:
            minima += 1
            low_x = ring[2 * lowest]
            if minima == 1 or x < low_x or (x == low_x and y < ring[2 * lowest + 1]):
                lowest = i
                lowest_turn = turn
        if turn != 0:
            record[HEADER + 2 * kept] = x
            record[HEADER + 2 * kept + 1] = y
            kept += 1
            left += turn > 0
        before_x = x
        before_y = y
    if kept == 0:
        _span(ring, count, record)
        return CONVEX, 2, False, -1
    if spike >= 0:
        record[HEADER] = ring[2 * spike]
        record[HEADER + 1] = ring[2 * spike + 1]
        return SPIKE, 1, False, 0
    convex = minima == 1 and (left == kept or left == 0)
    return (CONVEX if convex else NON_CONVEX), kept, lowest_turn < 0, -1


@kernel
def _drop_repeated(points):
    """Return the ring without consecutive repetitions and its length, or -1 - i: i not finite."""
    received = len(points) // 2
    ring = scratch(2 * received)
    count = 0
    for i in range(received):
        # Adding zero turns -0.0 into 0.0, so that equal vertices have equal bytes.
        x = points[2 * i] + 0.0
        y = points[2 * i + 1] + 0.0
        if x - x != 0.0 or y - y != 0.0:
            return ring, -1 - i
        if count == 0 or x != ring[2 * count - 2] or y != ring[2 * count - 1]:
            ring[2 * count] = x
            ring[2 * count + 1] = y
            count += 1
    while count > 1 and ring[0] == ring[2 * count - 2] and ring[1] == ring[2 * count - 1]:
        count -= 1
    return ring, count


@kernel
def _span(ring, count, record):
    """Write the two ends of collinear points into the record."""
    low = 0
    high = 0
    for i in range(count):
        x = ring[2 * i]
        y = ring[2 * i + 1]
        if x < ring[2 * low] or (x == ring[2 * low] and y < ring[2 * low + 1]):
            low = i
        if x > ring[2 * high] or (x == ring[2 * high] and y > ring[2 * high + 1]):
            high = i
    for k in range(2):
        record[HEADER + k] = ring[2 * low + k]
        record[HEADER + 2 + k] = ring[2 * high + k]


@kernel
def _first_crossing(record, count):
    """
    Return two edges of the ring that share a point they should not, or (-1, -1).

    Edges are swept in order of their least x. Neighbours meet in their common vertex only,
    because neither spikes nor collinear vertices are left.
    """
    least = scratch(count)
    for i in range(count):
        after = i + 1 if i + 1 < count else 0
        least[i] = min(record[HEADER + 2 * i], record[HEADER + 2 * after])
    order = np.argsort(least, kind='mergesort')
    for s in range(count):
        i = order[s]
        i_end = i + 1 if i + 1 < count else 0
        ax = record[HEADER + 2 * i]
        ay = record[HEADER + 2 * i + 1]
        bx = record[HEADER + 2 * i_end]
        by = record[HEADER + 2 * i_end + 1]
        for t in range(s + 1, count):
            j = order[t]
            if least[j] > max(ax, bx):
                break
            j_end = j + 1 if j + 1 < count else 0
            if (i_end != j and j_end != i and segments_meet(
                    ax, ay, bx, by, record[HEADER + 2 * j], record[HEADER + 2 * j + 1],
                    record[HEADER + 2 * j_end], record[HEADER + 2 * j_end + 1])):
                return i, j
    return -1, -1


@kernel
def _reverse(record, count):
    """Reverse the order of the vertices, keeping the first one first."""
    i = 1
    j = count - 1
    while i < j:
        for k in range(2):
            a = HEADER + 2 * i + k
            b = HEADER + 2 * j + k
            record[a], record[b] = record[b], record[a]
        i += 1
        j -= 1


@kernel
def _measure(record, count):
    """
    Write bounds and centroid into the record.

    The centroid is the mean of the triangles' centroids weighted by area (paper section 2.2), of
    a segment its middle. It only steers the search for an axis, so its rounding decides nothing.
    """
    x0 = record[HEADER]
    y0 = record[HEADER + 1]
    min_x = max_x = x0
    min_y = max_y = y0
    area = 0.0
    for i in range(1, count):
        x = record[HEADER + 2 * i]
        y = record[HEADER + 2 * i + 1]
        min_x = min(min_x, x)
        max_x = max(max_x, x)
        min_y = min(min_y, y)
        max_y = max(max_y, y)
        if i + 1 < count:
            area += _cross(record, i)
    x_sum = 0.0
    y_sum = 0.0
    if area > 0.0 and area - area == 0.0:
        for i in range(1, count - 1):
            weight = _cross(record, i) / area / 3.0
            x_sum += weight * ((record[HEADER + 2 * i] - x0) + (record[HEADER + 2 * i + 2] - x0))
            y_sum += weight * ((record[HEADER + 2 * i + 1] - y0)
                               + (record[HEADER + 2 * i + 3] - y0))
    else:
        for i in range(1, count):
            x_sum += (record[HEADER + 2 * i] - x0) / count
            y_sum += (record[HEADER + 2 * i + 1] - y0) / count
    record[0] = x0 + x_sum
    record[1] = y0 + y_sum
    record[2] = min_x
    record[3] = min_y
    record[4] = max_x
    record[5] = max_y


@kernel
def _cross(record, i):
    """Return twice the signed area of the triangle of vertices 0, i and i + 1."""
    x0 = record[HEADER]
    y0 = record[HEADER + 1]
    return ((record[HEADER + 2 * i] - x0) * (record[HEADER + 2 * i + 3] - y0)
            - (record[HEADER + 2 * i + 1] - y0) * (record[HEADER + 2 * i + 2] - x0))

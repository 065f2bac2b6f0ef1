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
What a polygon knows once, laid out for the collision decision in one flat array of doubles.

A *record* of a convex polygon is a point of the polygon, its centroid where that is certain (x,
y); its bounds (min x, min y, max x, max y); the radius of a disc around that point inside the
polygon; for more than SCAN_LIMIT vertices a table from the direction of an axis to a support
vertex near by; and the vertices x, y, x, y, ...

The table cuts the directions into sectors, four for each double: a double holds four integers of
13 bits without loss. It only says where to start looking, so rounding in it decides nothing.
"""

import math

from sat_collision.jit import inlined, kernel, scratch
from sat_collision.predicates import orient
from sat_collision.ring import clean, CONVEX, NON_CONVEX

HEADER = 7
BOUNDS = slice(2, 6)
SCAN_LIMIT = 16
LARGEST_TABLE = 128

# The disc's radius is shortened by more than the rounding in it and in comparing it, and is zero
# where its square might underflow.
_SHORTER = 2.0 ** -45
_LEAST_RADIUS = 1e-140

_ENTRY_BITS = 13
_ENTRY_MASK = (1 << _ENTRY_BITS) - 1
_INFINITY = float('inf')


@inlined
def table_size(count):
    """Return how many doubles the table of a polygon with count vertices takes."""
    if count <= SCAN_LIMIT:
        return 0
    return 32 if count <= 128 else LARGEST_TABLE


@inlined
def record_size(count):
    """Return how many doubles the record of a polygon with count vertices takes."""
    return HEADER + table_size(count) + 2 * count


@kernel
def build(points, width, record, most):
    """
    Make a record from received points.

    Parameters
    ----------
    points : (width * n,) flat array of float64, n >= 1
        x, y and, if width is 3, z of each point as received.
    width : int
        2 or 3.
    record : flat array of float64
        Receives the record; of `record_size(n)` at least.
    most : int
        The most vertices accepted.

    Returns
    -------
    verdict, count, i, j : int
        As `ring.clean` says. When the points are refused the record holds the vertices in the
        ring's order from the start on; of a polygon that is not convex it has no meaning but for
        its bounds and its vertices.
    first : int
        Where the vertices start in the record.

    """
    ring = scratch(2 * (len(points) // width))
    verdict, count, i, j = clean(points, width, ring, most)
    first = 0
    if verdict == CONVEX or verdict == NON_CONVEX:
        first = HEADER + table_size(count)
        record[0] = ring[0]
        record[1] = ring[1]
        record[6] = 0.0
        _write_bounds(ring, count, record)
        if verdict == CONVEX:
            _write_inner_disc(ring, count, record)
            _write_table(ring, count, record)
    for k in range(2 * count):
        record[first + k] = ring[k]
    return verdict, count, i, j, first


@kernel
def unpack(values, record, most):
    """Make a record as `build` does, from a flat array of float32: x, y, z of each point."""
    points = scratch(len(values) // 3 * 2)
    for i in range(len(values) // 3):
        points[2 * i] = values[3 * i]
        points[2 * i + 1] = values[3 * i + 1]
    return build(points, 2, record, most)


@kernel
def fingerprint(block):
    """Return a number that is the same for equal blocks, and seldom for others."""
    return (block[0] + 3.0 * block[1] + 0.7 * block[2] + 1.9 * block[3] + 5.3 * block[4]
            + 11.0 * block[5] + 0.4 * block[6])


@kernel
def _write_bounds(ring, count, record):
    min_x = max_x = ring[0]
    min_y = max_y = ring[1]
    for i in range(1, count):
        min_x = min(min_x, ring[2 * i])
        max_x = max(max_x, ring[2 * i])
        min_y = min(min_y, ring[2 * i + 1])
        max_y = max(max_y, ring[2 * i + 1])
    record[2] = min_x
    record[3] = min_y
    record[4] = max_x
    record[5] = max_y


@kernel
def _write_inner_disc(ring, count, record):
    """
    Write the centroid (paper section 2.2) where it is proved to lie in the polygon.

    That makes it a point to reason with, not only a direction. Of slivers, segments and points,
    where rounding may put it outside, the vertex that stands there already serves instead.
    """
    x0 = ring[0]
    y0 = ring[1]
    area = 0.0
    for i in range(1, count - 1):
        area += _cross(ring, i)
    if not 0.0 < area < _INFINITY:
        return
    x = x0
    y = y0
    for i in range(1, count - 1):
        weight = _cross(ring, i) / area / 3.0
        x += weight * ((ring[2 * i] - x0) + (ring[2 * i + 2] - x0))
        y += weight * ((ring[2 * i + 1] - y0) + (ring[2 * i + 3] - y0))
    radius = _INFINITY
    for i in range(count):
        k = i + 1 if i + 1 < count else 0
        if orient(ring[2 * i], ring[2 * i + 1], ring[2 * k], ring[2 * k + 1], x, y) < 0:
            return
        ex = ring[2 * k] - ring[2 * i]
        ey = ring[2 * k + 1] - ring[2 * i + 1]
        radius = min(radius, (ex * (y - ring[2 * i + 1]) - ey * (x - ring[2 * i]))
                     / math.hypot(ex, ey))
    record[0] = x
    record[1] = y
    radius -= _SHORTER * (radius + (record[4] - record[2]) + (record[5] - record[3]))
    if _LEAST_RADIUS < radius < _INFINITY:
        record[6] = radius


@kernel
def _cross(ring, i):
    """Return twice the signed area of the triangle of vertices 0, i and i + 1."""
    return ((ring[2 * i] - ring[0]) * (ring[2 * i + 3] - ring[1])
            - (ring[2 * i + 1] - ring[1]) * (ring[2 * i + 2] - ring[0]))


@kernel
def _write_table(ring, count, record):
    """March around the boundary once while the direction turns once, sector by sector."""
    size = table_size(count)
    i = 0
    for sector in range(4 * size):
        turn = sector / size
        if turn < 2.0:
            uy = turn - 1.0
            ux = 1.0 - abs(uy)
        else:
            uy = 3.0 - turn
            ux = abs(uy) - 1.0
        if sector == 0:
            for k in range(count):
                if ring[2 * k + 1] < ring[2 * i + 1]:
                    i = k
        for _ in range(count):
            k = i + 1 if i + 1 < count else 0
            if ((ring[2 * k] - ring[2 * i]) * ux + (ring[2 * k + 1] - ring[2 * i + 1]) * uy
                    <= 0.0):
                break
            i = k
        if sector % 4 == 0:
            record[HEADER + sector // 4] = 0.0
        entry = min(i, _ENTRY_MASK)
        record[HEADER + sector // 4] += float(entry << (_ENTRY_BITS * (sector % 4)))


@inlined
def table_sector(count, ux, uy):
    """Return in which sector of the table of a polygon with count vertices an axis lies."""
    size = table_size(count)
    length = abs(ux) + abs(uy)
    if not 0.0 < length < _INFINITY:
        return 0
    # A quarter of the directions, from -y to +x and on, for each unit of turn.
    turn = 1.0 + uy / length if ux >= 0.0 else 3.0 - uy / length
    return min(int(turn * size), 4 * size - 1)


@inlined
def table_place(start, sector):
    """Return where the entry of a sector stands, given where the record starts."""
    return start + HEADER + (sector >> 2)


@inlined
def near_support(record, start, count, sector):
    """
    Return where in the array a vertex near the support along the axes of a sector stands.

    For more than SCAN_LIMIT vertices: it is looked up in the table.
    """
    entries = int(record[table_place(start, sector)])
    entry = (entries >> (_ENTRY_BITS * (sector & 3))) & _ENTRY_MASK
    return start + HEADER + table_size(count) + 2 * entry

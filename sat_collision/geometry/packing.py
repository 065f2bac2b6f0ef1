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

"""Packed polygons, see `layout`, made from received points."""

from sat_collision.geometry.arithmetic import require_nearest
from sat_collision.geometry.jit import float32_values, inner, kernel, scratch
from sat_collision.geometry.layout import ENTRY_BITS, entry_step, FINGERPRINT, HEADER, table_size
from sat_collision.geometry.plane import centroid, length
from sat_collision.geometry.predicates import orient
from sat_collision.geometry.ring import clean, CONVEX, NON_CONVEX

# The disc's radius is shortened by 2^-45 of the radius and the extent, which exceeds all rounding
# errors; there is no disc if an edge or the radius is so short that underflow might exceed this.
# See docs/exactness.md, lemma 10.
_SHORTER = 2.0 ** -45
_LEAST_EDGE = 2.0 ** -500
_LEAST_RADIUS = 1e-140

_INFINITY = float('inf')


@kernel
def pack(points, packed, max_vertices, max_non_convex):
    """
    Pack a polygon given by received points, see `layout`.

    Parameters
    ----------
    points : (2 n,) flat array of float64, n >= 1
        x, y of each point as received.
    packed : flat array of float64
        Receives the polygon; of `packed_size(n)` at least.
    max_vertices, max_non_convex : int
        The most vertices accepted, see `ring.clean`.

    Returns
    -------
    verdict, count, i, j : int
        As returned by `ring.clean`. If the points are refused, the array has the vertices in the
        ring's order from its start on; for a non-convex polygon only its bounds, fingerprint and
        vertices are valid.
    first : int
        The index at which the vertices start in the array.

    """
    require_nearest(len(points))
    ring = scratch(len(points))
    verdict, count, i, j = clean(points, ring, max_vertices, max_non_convex)
    first = 0
    if verdict == CONVEX or verdict == NON_CONVEX:
        first = HEADER + table_size(count)
        packed[0] = ring[0]
        packed[1] = ring[1]
        packed[6] = 0.0
        _write_bounds(ring, count, packed)
        if verdict == CONVEX:
            _write_inner_disc(ring, count, packed)
            _write_table(ring, count, packed)
        packed[FINGERPRINT] = _fingerprint(packed)
        if verdict == NON_CONVEX:
            # Many non-convex bodies have the same bounds and first vertex.
            for k in range(2 * count):
                packed[FINGERPRINT] = 0.7 * packed[FINGERPRINT] + 0.2 * ring[k]
    for k in range(2 * count):
        packed[first + k] = ring[k]
    return verdict, count, i, j, first


@kernel
def pack_convex(data, start, received, packed, max_vertices, affine):
    """
    Pack `moved_points`, if they make a convex polygon of no more vertices than are accepted.

    Returned is their number, 0 if they do not.
    """
    points = moved_points(data, start, received, affine)
    verdict, count, _, _, _ = pack(points, packed, max_vertices, 0)
    return count if verdict == CONVEX else 0


@kernel
def moved_points(data, start, received, affine):
    """
    Return the points of a message, transformed by an affine map.

    Each coordinate is rounded four times, see docs/exactness.md, lemma 14; not at all by UNMOVED.

    Parameters
    ----------
    data : bytes
    start, received : int
        Where in the data the points start, and how many there are, at least one: x, y and z of
        each as float32 in this machine's byte order.
    affine : Affine2D
        The affine map of the points to another frame.

    Returns
    -------
    (2 n,) flat array of float64
        x, y of each point.

    """
    a, b, c, d, e, f = affine
    values = float32_values(data, start)
    points = scratch(2 * received)
    for i in range(received):
        x = values[3 * i]
        y = values[3 * i + 1]
        points[2 * i] = a * x + b * y + c
        points[2 * i + 1] = d * x + e * y + f
    return points


@inner
def _fingerprint(packed):
    """Return a weighted sum; the weights add up to less than 1, so it is finite."""
    return (0.04 * packed[0] + 0.11 * packed[1] + 0.03 * packed[2] + 0.07 * packed[3]
            + 0.19 * packed[4] + 0.43 * packed[5] + 0.01 * packed[6])


@inner
def _write_bounds(ring, count, packed):
    min_x = max_x = ring[0]
    min_y = max_y = ring[1]
    for i in range(1, count):
        min_x = min(min_x, ring[2 * i])
        max_x = max(max_x, ring[2 * i])
        min_y = min(min_y, ring[2 * i + 1])
        max_y = max(max_y, ring[2 * i + 1])
    packed[2] = min_x
    packed[3] = min_y
    packed[4] = max_x
    packed[5] = max_y


@inner
def _write_inner_disc(ring, count, packed):
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
    radius = _INFINITY
    certain = True
    for i in range(count):
        k = i + 1 if i + 1 < count else 0
        if orient(ring[2 * i], ring[2 * i + 1], ring[2 * k], ring[2 * k + 1], x, y) < 0:
            return
        ex = ring[2 * k] - ring[2 * i]
        ey = ring[2 * k + 1] - ring[2 * i + 1]
        size = length(ex, ey)
        height = (ex * (y - ring[2 * i + 1]) - ey * (x - ring[2 * i])) / size
        certain = certain and height < _INFINITY and _LEAST_EDGE < size
        radius = min(radius, height)
    packed[0] = x
    packed[1] = y
    radius -= _SHORTER * (radius + extent)
    if certain and _LEAST_RADIUS < radius:
        packed[6] = radius


@inner
def _write_table(ring, count, packed):
    """March around the boundary once while the axis turns once, sector by sector."""
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
            packed[HEADER + sector // 4] = 0.0
        entry = i // entry_step(count)
        packed[HEADER + sector // 4] += float(entry << (ENTRY_BITS * (sector % 4)))

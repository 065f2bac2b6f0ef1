# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Lengths, directions and centroids: rounded, the same with and without numba, at any scale."""

import math

from sat_collision.geometry.compiled.jit import inlined, inner, kernel

# Between these magnitudes the third powers of coordinates neither overflow nor underflow; others
# are multiplied by a power of two, which is exact.
_LARGE = 2.0 ** 300
_SMALL = 2.0 ** -300
_MAX_SHIFT = 1000

# The least double above 0.
LEAST = 5e-324
# Exceeds what rounding takes from a gap between boxes and from a grown box, relative to both.
_ROUNDING = 2.0 ** -50
_LARGEST = 1.7976931348623157e308
# The box, min x, min y, max x, max y, of no points.
NOWHERE = math.inf, math.inf, -math.inf, -math.inf


@kernel
def length(x, y):
    """Return the length of a vector, to one ulp (`math.hypot` differs between libraries)."""
    scale = scale_to_one(max(abs(x), abs(y)))
    x, y = x * scale, y * scale
    return math.sqrt(x * x + y * y) / scale


@kernel
def unit(x, y):
    """Return the unit vector in the direction of a vector, to a few ulp; zero for zero."""
    scale = scale_to_one(max(abs(x), abs(y)))
    x, y = x * scale, y * scale
    size = math.sqrt(x * x + y * y)
    if size == 0.0:
        return x, y
    return x / size, y / size


@kernel
def nearest_of_segment(ax, ay, bx, by):
    """Return the distance of a segment a b from the origin and its nearest point's direction."""
    ex, ey = unit(bx - ax, by - ay)
    if not ax * ex + ay * ey < 0.0:
        ux, uy = unit(ax, ay)
        return length(ax, ay), ux, uy
    if not bx * ex + by * ey > 0.0:
        ux, uy = unit(bx, by)
        return length(bx, by), ux, uy
    height = ax * ey - ay * ex
    if height < 0.0:
        return -height, -ey, ex
    return height, ey, -ex


@inlined
def reach_along(points, first, end, ux, uy):
    """Return how far points x, y, ... between two indices of a flat array reach along u."""
    most = -math.inf
    for k in range(first, end, 2):
        along = points[k] * ux + points[k + 1] * uy
        most = along if along > most else most
    return most


@kernel
def centroid(ring, count):
    """
    Return x, y of the centroid of a polygon, for a segment its midpoint (paper section 2.2).

    The ring is a flat array that begins with so many vertices, counter-clockwise.
    """
    largest = 0.0
    for k in range(2 * count):
        largest = max(largest, abs(ring[k]))
    scale = scale_to_one(largest)
    x0, y0 = ring[0] * scale, ring[1] * scale
    area = moment_x = moment_y = 0.0
    for i in range(1, count - 1):
        ax, ay = ring[2 * i] * scale - x0, ring[2 * i + 1] * scale - y0
        bx, by = ring[2 * i + 2] * scale - x0, ring[2 * i + 3] * scale - y0
        double_area = ax * by - ay * bx
        area += double_area
        moment_x += double_area * (ax + bx)
        moment_y += double_area * (ay + by)
    if area > 0.0:
        # For slivers rounding may give anything, even an overflow.
        min_x, min_y, max_x, max_y = bounds_of(ring, count)
        return (min(max((x0 + moment_x / area / 3.0) / scale, min_x), max_x),
                min(max((y0 + moment_y / area / 3.0) / scale, min_y), max_y))
    # A point, a segment, or so thin that its area is lost.
    x1, y1 = ring[2 * count - 2] * scale, ring[2 * count - 1] * scale
    return (x0 + (x1 - x0) / 2.0) / scale, (y0 + (y1 - y0) / 2.0) / scale


@inner
def bounds_of(points, count):
    """Return min x, min y, max x, max y of so many points, given as a flat array."""
    box = NOWHERE
    for k in range(0, 2 * count, 2):
        box = joined(box, points[k], points[k + 1], points[k], points[k + 1])
    return box


@inlined
def joined(box, min_x, min_y, max_x, max_y):
    """Return the box of two boxes."""
    return min(box[0], min_x), min(box[1], min_y), max(box[2], max_x), max(box[3], max_y)


@inner
def grown(box, margin):
    """
    Return a finite box that meets all boxes whose gap to a box, as computed, is at most a margin.

    The margin may be infinite, and if it is negative that is how far boxes overlap at least.
    """
    largest = max(max(abs(box[0]), abs(box[1])), max(abs(box[2]), abs(box[3])))
    more = margin + _ROUNDING * (abs(margin) + largest)
    return (max(box[0] - more, -_LARGEST), max(box[1] - more, -_LARGEST),
            min(box[2] + more, _LARGEST), min(box[3] + more, _LARGEST))


@kernel
def scale_to_one(largest):
    """Return a power of two that scales a magnitude so that products are safe; 1 if they are."""
    if _SMALL < largest < _LARGE or largest in (0.0, math.inf):
        return 1.0
    _, exponent = math.frexp(largest)
    return math.ldexp(1.0, max(-_MAX_SHIFT, min(_MAX_SHIFT, -exponent)))

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
"""Which bodies of a `PolygonSet` are near a polygon, and which is nearest."""

import math

from sat_collision.distance import measure
from sat_collision.jit import kernel


@kernel
def within(bounds, rows, data, used, block, count, margin, found):
    """Write the rows no further than margin from a block, ascending; return how many there are."""
    # Boxes are compared with a little more, since their gap is rounded as the separation is.
    reach = margin * (1.0 + 1e-9)
    hits = 0
    for row in range(used):
        if (rows[1, row] != 0 and _box_gap(bounds, row, block) <= reach
                and measure(data, rows[0, row], rows[1, row], block, 0, count)[0] <= margin):
            found[hits] = row
            hits += 1
    return hits


@kernel
def nearest(bounds, rows, data, used, block, count):
    """Return the row nearest to a block or deepest in it, its separation and closest points."""
    # The body with the nearest box goes first, so that its separation spares most others.
    first = 0
    gap = math.inf
    for row in range(used):
        if rows[1, row] != 0 and _box_gap(bounds, row, block) < gap:
            gap = _box_gap(bounds, row, block)
            first = row
    best = first
    found = measure(data, rows[0, first], rows[1, first], block, 0, count)
    for row in range(used):
        if (row != first and rows[1, row] != 0
                and _box_gap(bounds, row, block) <= max(found[0], 0.0)):
            other = measure(data, rows[0, row], rows[1, row], block, 0, count)
            if other[0] < found[0]:
                found = other
                best = row
    return best, found[0], found[1], found[2], found[3], found[4]


@kernel
def _box_gap(bounds, row, block):
    """Return the distance between the bounding boxes of a row and a block."""
    return math.hypot(max(max(bounds[0, row] - block[4], block[2] - bounds[2, row]), 0.0),
                      max(max(bounds[1, row] - block[5], block[3] - bounds[3, row]), 0.0))

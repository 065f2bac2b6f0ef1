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

"""What is near a body, of rings as `kernels.describe` has them."""

import math

from sat_collision.geometry.distance import measure
from sat_collision.geometry.jit import kernel, scratch
from sat_collision.geometry.layout import Packed, packed_size
from sat_collision.geometry.packing import pack
from sat_collision.geometry.ring import CONVEX


@kernel
def rows_near(box, boxes, margin, rows):
    """Write which boxes are no further than a margin from one; return how many."""
    found = 0
    for i in range(len(boxes)):
        if _gap(box, boxes[i]) <= margin:
            rows[found] = i
            found += 1
    return found


@kernel
def measure_near(body, box, rows, rings, margin, out):
    """
    Measure how far a body is from rings, of all that may be nearest or within a margin.

    Parameters
    ----------
    body : (flat array of float64, int)
        The packed body and its count; 0 to measure nothing, where each ring has another body
        to be measured with.
    box : (4,) array of float64
        What bounds it.
    rows : (m,) array of int64
        The rings to be looked at.
    rings : tuple
        Boxes, points, firsts and counts of all, as `describe` has them.
    margin : float
        In metres.
    out : tuple
        What is written: near, gaps, values.
    near : (m,) array of int64
        Receives the rings.
    gaps : (m,) array of float64
        Receives how far the boxes are apart, which is never more than the bodies are.
    values : (m,) array of float64
        Receives the separations as `distance.measure` has them; NaN of what is not measured, or
        not convex.

    Returns
    -------
    int
        How many rings there are.

    """
    outline, n = body
    boxes, points, firsts, counts = rings
    near, gaps, values = out
    found = 0
    least = math.inf
    nearest = -1
    if n != 0:
        # What has the nearest box goes first, so that its separation spares most others.
        for row in rows:
            gap = _gap(box, boxes[row])
            if gap < least:
                least = gap
                nearest = row
        least = math.inf
    if nearest >= 0:
        value = _separation(outline, n, points, firsts[nearest], counts[nearest])
        near[0] = nearest
        gaps[0] = _gap(box, boxes[nearest])
        values[0] = value
        found = 1
        if value < least:
            least = value
    for row in rows:
        gap = _gap(box, boxes[row])
        if row == nearest or gap > max(margin, least):
            continue
        value = math.nan if n == 0 else _separation(
            outline, n, points, firsts[row], counts[row])
        near[found] = row
        gaps[found] = gap
        values[found] = value
        found += 1
        if value < least:
            least = value
    return found


@kernel
def _gap(box, other):
    """Return how far two boxes are apart: 0 just when they share a point."""
    x = max(max(other[0] - box[2], box[0] - other[2]), 0.0)
    y = max(max(other[1] - box[3], box[1] - other[3]), 0.0)
    return math.sqrt(x * x + y * y)


@kernel
def _separation(outline, n, points, first, count):
    """Return the separation of a packed body from a ring, NaN if that is not convex."""
    ring = scratch(2 * count)
    for k in range(count):
        ring[2 * k] = points[first + k, 0]
        ring[2 * k + 1] = points[first + k, 1]
    packed = scratch(packed_size(count))
    verdict, m, _, _, _ = pack(ring, packed, count, 0)
    if verdict != CONVEX:
        return math.nan
    return measure(Packed(outline, 0, n), Packed(packed, 0, m))[0]

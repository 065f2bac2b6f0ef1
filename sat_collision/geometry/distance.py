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
Signed distance of two bodies: the least of their pairs of convex parts.

Whether two parts meet is decided exactly, and so is the sign. Values are those of
`nearest_features` and `penetration`, which get coordinates of extreme magnitude multiplied by a
power of two. Rings begin with their least vertex and the bodies are put in a fixed order, so that
neither start vertices nor the order of the bodies change a bit of the result. For error bounds
see docs/exactness.md, lemmas 15 to 20.
"""

from sat_collision.geometry.arithmetic import require_nearest
from sat_collision.geometry.intersection import convex_meet, interiors_apart
from sat_collision.geometry.jit import elements, inner, kernel, scratch
from sat_collision.geometry.layout import (
    body_size, convex_part, Packed, packed_polygon, packed_size)
from sat_collision.geometry.nearest_features import closest_of, nearest_features, reach_of
from sat_collision.geometry.part_bounds import (
    is_beyond_edge, limit_of, may_be_less, nearest_boxes, open_pairs, overlap, reaches)
from sat_collision.geometry.penetration import penetration
from sat_collision.geometry.plane import scale_to_one

# Up to this depth, relative to the largest coordinate, an overlap may be a rounding error.
_DOUBTFUL = 2.0 ** -94
_LEAST = 5e-324
# A prime greater than any number of pairs, so that steps of it visit every pair.
_STRIDE = 2 ** 61 - 1


@kernel
def measure_arrays(p, n, q, m):
    """Return `measure` of two bodies, each in an array of its own, with counts n and m."""
    require_nearest(n)
    return measure(packed_polygon(p, n), packed_polygon(q, m))


@kernel
def measure(p, q):
    """Return separation and closest points x, y, x, y of two packed polygons, convex or not."""
    value, points = measure_with_normal(p, q)
    return value, points[0], points[1], points[2], points[3]


@kernel
def measure_with_normal(p, q):
    """
    Return the separation of two packed polygons, convex or not, and the points that realise it.

    Returns
    -------
    value : float
        As returned by `query.separation`.
    points : (float, float, float, float, float, float)
        A point x, y of P, one of Q, and the unit vector from P to Q along which they are apart, or
        Q leaves P; the offset from the first point to the second is the value times this vector.

    """
    p = Packed(elements(p.array), p.start, p.n)
    q = Packed(elements(q.array), q.start, q.n)
    if goes_first(q, p):
        value, points = _measure_parts(q, p)
        bx, by, ax, ay, ux, uy = points
        return value, (ax, ay, bx, by, -ux, -uy)
    return _measure_parts(p, q)


@inner
def goes_first(p, q):
    """Return whether the packed numbers of P are lexicographically before those of Q."""
    size = body_size(p)
    other_size = body_size(q)
    for k in range(min(size, other_size)):
        a = p.array[p.start + k]
        b = q.array[q.start + k]
        if a != b:
            return a < b
    return size < other_size


@inner
def _measure_parts(p, q):
    """Measure the pairs of parts that may be nearest, or deepest; return the least result."""
    if p.n > 0 and q.n > 0:
        _, least, found = _measure_pair(p, q)
        return least, found
    parts = max(1, -q.n)
    reach = reach_of(p, q)
    first = nearest_boxes(p, q)
    meeting, least, found = _measure_pair(
        convex_part(p, first // parts), convex_part(q, first % parts))
    limit = limit_of(least, reach)
    along = reaches(p, found[4], found[5])
    back = reaches(q, -found[4], -found[5])
    pairs = open_pairs(p, q, least)
    count = len(pairs)
    stride = _STRIDE % max(count, 1)
    place = 0
    for _ in range(count):
        pair = pairs[place]
        # In scattered order: in sequence each might be a little nearer than the one before.
        place += stride if place + stride < count else stride - count
        i = pair // parts
        j = pair % parts
        if pair == first or -along[i] - back[j] > limit:
            continue
        a = convex_part(p, i)
        b = convex_part(q, j)
        if (not may_be_less(overlap(a, b), least)
                or is_beyond_edge(a, b, limit) or is_beyond_edge(b, a, limit)):
            continue
        meet, value, points = _measure_pair(a, b)
        if (meeting and not meet) or not (value < least or (meet and not meeting)):
            continue
        least = value
        found = points
        meeting = meet
        limit = limit_of(least, reach)
        along = reaches(p, found[4], found[5])
        back = reaches(q, -found[4], -found[5])
    return least, found


@inner
def _measure_pair(a, b):
    """Return whether two convex polygons meet, their separation, and its points and normal."""
    meet = convex_meet(a, b)
    reach = reach_of(a, b)
    scale = scale_to_one(reach)
    if scale == 1.0:
        value, points = _measure_usual(meet, a, b)
    else:
        value, points = _measure_scaled(meet, a, b, scale, scratch(packed_size(a.n)),
                                        scratch(packed_size(b.n)))
        ax, ay = _within(a, points[0] / scale, points[1] / scale)
        bx, by = _within(b, points[2] / scale, points[3] / scale)
        points = ax, ay, bx, by, points[4], points[5]
    # Rounding must not contradict the boxes, by which bodies and parts are skipped.
    value = max(value / scale, -overlap(a, b))
    if not meet:
        return meet, max(value, _LEAST), points
    if -value <= _DOUBTFUL * reach and (interiors_apart(a, b) or max(a.n, b.n) == 1):
        return meet, 0.0, points
    return meet, min(value, -_LEAST), points


@inner
def _measure_usual(meet, p, q):
    """Return the separation of polygons, its points and normal, given whether they meet."""
    if meet:
        depth, ax, ay, bx, by, ux, uy = penetration(p, q)
        return -depth, (ax, ay, bx, by, ux, uy)
    features = nearest_features(p, q)
    return features.distance, closest_of(p, q, features)


@inner
def _measure_scaled(meet, p, q, scale, array, other_array):
    """Return the same of polygons multiplied by a power of two and written into arrays."""
    return _measure_usual(meet, _scaled(p, scale, array), _scaled(q, scale, other_array))


@inner
def _scaled(p, scale, array):
    """Return a convex polygon multiplied by a power of two; coordinates that underflow round."""
    for k in range(len(array)):
        array[k] = p.array[p.start + k]
    for k in range(2, 6):
        array[k] *= scale
    for k in range(packed_size(p.n) - 2 * p.n, packed_size(p.n)):
        array[k] *= scale
    for k in range(2):
        array[k] *= scale
    array[6] *= scale
    return packed_polygon(array, p.n)


@inner
def _within(p, x, y):
    """Return a point clamped to the bounds of a polygon, which it may leave by rounding."""
    a = p.array
    i = p.start
    return min(max(x, a[i + 2]), a[i + 4]), min(max(y, a[i + 3]), a[i + 5])

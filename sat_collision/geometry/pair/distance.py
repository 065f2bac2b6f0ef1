# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Signed distance of two bodies: the least of their pairs of convex parts.

Whether two parts meet is decided exactly, and so is the sign. Values are those of
`convex_distance`, which gets coordinates of extreme magnitude multiplied by a power of two. Rings
begin with their least vertex and the bodies are put in a fixed order, so that neither start
vertices nor the order of the bodies change a bit of the result. For error bounds see
docs/exactness.md, lemmas 15 to 20.

Pairs are skipped by lower bounds, which are much cheaper than measuring. Parts are no nearer than
their boxes, and overlap no deeper: a move that separates the boxes separates the parts. Rounded
separations are corrected so that this holds for them, too. Along any axis the gap between bodies
is at most their separation, and along the normal of an edge the overlap is at least their depth;
where rounding could invalidate this, nothing is concluded.
"""

import math

import numpy as np

from sat_collision.geometry.body.layout import (
    body_size, convex_part, first_vertex, HEADER, Packed, packed_polygon, packed_size,
    vertex_after)
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import COMPILED, elements, inner, kernel, scratch
from sat_collision.geometry.numeric.vectors import LEAST, length, reach_along, scale_to_one
from sat_collision.geometry.pair.convex_distance import (
    closest_of, nearest_features, penetration, reach_of, ROUNDING)
from sat_collision.geometry.pair.intersection import convex_meet, interiors_apart

# Up to this depth, relative to the largest coordinate, an overlap may be a rounding error.
_DOUBTFUL = 2.0 ** -94
# A prime greater than any number of pairs, so that steps of it visit every pair.
_STRIDE = 2 ** 61 - 1
# Below this magnitude underflow may have taken too much from products.
_LEAST_PRODUCT = 1e-290


@kernel
def measure_arrays(p, n, q, m):
    """Return `measure` of two bodies, each in an array of its own, with counts n and m."""
    require_nearest(n)
    return measure(packed_polygon(p, n), packed_polygon(q, m))


@kernel
def measure(p, q):
    """
    Return the separation of two packed polygons, convex or not, and the points that realise it.

    The points are six numbers: x, y of a point of P, those of one of Q, and the unit vector from P
    to Q along which they are apart, or Q leaves P; the offset from the first point to the second
    is the separation times this vector.
    """
    p = Packed(elements(p.array), p.start, p.n)
    q = Packed(elements(q.array), q.start, q.n)
    if goes_first(q, p):
        value, (bx, by, ax, ay, ux, uy), _ = measure_parts(q, p)
        return value, (ax, ay, bx, by, -ux, -uy)
    return measure_parts(p, q)[:2]


@inner
def goes_first(p, q):
    """Return whether the packed numbers of P are lexicographically before those of Q."""
    size, other_size = body_size(p), body_size(q)
    for k in range(min(size, other_size)):
        a, b = p.array[p.start + k], q.array[q.start + k]
        if a != b:
            return a < b
    return size < other_size


@inner
def measure_parts(p, q):
    """Return the least separation of pairs of parts, its points and pair, see `open_pairs`."""
    if p.n > 0 and q.n > 0:
        _, least, found = _measure_pair(p, q)
        return least, found, 0
    parts = max(1, -q.n)
    reach = reach_of(p, q)
    first = _nearest_boxes(p, q)
    meeting, least, found = _measure_pair(
        convex_part(p, first // parts), convex_part(q, first % parts))
    decided = first
    limit = _limit_of(least, reach)
    along, back = _reaches(p, found[4], found[5]), _reaches(q, -found[4], -found[5])
    pairs = open_pairs(p, q, least)
    count = len(pairs)
    stride = _STRIDE % max(count, 1)
    place = 0
    for _ in range(count):
        pair = pairs[place]
        # In scattered order: in sequence each might be a little nearer than the one before.
        place += stride if place + stride < count else stride - count
        i, j = pair // parts, pair % parts
        if pair == first or -along[i] - back[j] > limit:
            continue
        a, b = convex_part(p, i), convex_part(q, j)
        if (not -_overlap(a, b) < least
                or _is_beyond_edge(a, b, limit) or _is_beyond_edge(b, a, limit)):
            continue
        meet, value, points = _measure_pair(a, b)
        if (meeting and not meet) or not (value < least or (meet and not meeting)):
            continue
        least, found, decided, meeting = value, points, pair, meet
        limit = _limit_of(least, reach)
        along, back = _reaches(p, found[4], found[5]), _reaches(q, -found[4], -found[5])
    return least, found, decided


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
    value = max(value / scale, -_overlap(a, b))
    if not meet:
        return meet, max(value, LEAST), points
    if -value <= _DOUBTFUL * reach and (interiors_apart(a, b) or max(a.n, b.n) == 1):
        return meet, 0.0, points
    return meet, min(value, -LEAST), points


@inner
def _measure_usual(meet, p, q):
    """Return the separation of polygons, its points and normal, given whether they meet."""
    if meet:
        depth, points = penetration(p, q)
        return -depth, points
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
    for k in range(HEADER):
        array[k] *= scale
    for k in range(len(array) - 2 * p.n, len(array)):
        array[k] *= scale
    return packed_polygon(array, p.n)


@inner
def _within(p, x, y):
    """Return a point clamped to the bounds of a polygon, which it may leave by rounding."""
    a, i = p.array, p.start
    return min(max(x, a[i + 2]), a[i + 4]), min(max(y, a[i + 3]), a[i + 5])


@inner
def _limit_of(least, reach):
    """Return the gap along an axis above which no pair is nearer or deeper than least."""
    # Where products of coordinates may overflow or underflow, axes prove nothing.
    return least + ROUNDING * reach if scale_to_one(reach) == 1.0 else math.inf


@inner
def _is_beyond_edge(p, q, limit):
    """Return whether the gap from some edge of P to Q, < 0 if Q is inside it, is above a limit."""
    v, w = p.array, q.array
    first, other_first = first_vertex(p), first_vertex(q)
    for i in range(p.n if p.n > 2 else 0):
        a = first + 2 * i
        b = vertex_after(p, a)
        ex, ey = v[b] - v[a], v[b + 1] - v[a + 1]
        enough = -limit * length(ex, ey)
        beyond = abs(enough) > _LEAST_PRODUCT
        for k in range(other_first, other_first + 2 * q.n if beyond else other_first, 2):
            if not ex * (w[k + 1] - v[a + 1]) - ey * (w[k] - v[a]) < enough:
                beyond = False
                break
        if beyond:
            return True
    return False


@inner
def _reaches(p, ux, uy):
    """Return how far each convex part of a body reaches along an axis: an array."""
    found = np.empty(max(1, -p.n))
    for i in range(max(1, -p.n)):
        part = convex_part(p, i)
        first = first_vertex(part)
        found[i] = reach_along(part.array, first, first + 2 * part.n, ux, uy)
    return found


@inner
def _overlap(p, q):
    """Return the least move along x or y that parts the boxes of P and Q; minus a gap between."""
    a, b = p.array, q.array
    i, j = p.start, q.start
    return min(min(a[i + 4] - b[j + 2], b[j + 4] - a[i + 2]),
               min(a[i + 5] - b[j + 3], b[j + 5] - a[i + 3]))


if COMPILED:
    @inner
    def _nearest_boxes(p, q):
        """Return the first pair of parts, see `open_pairs`, with the greatest `_overlap`."""
        best, pair = -math.inf, 0
        parts = max(1, -q.n)
        for i in range(max(1, -p.n)):
            a = convex_part(p, i)
            if _overlap(a, q) > best:
                for j in range(parts):
                    found = _overlap(a, convex_part(q, j))
                    if found > best:
                        best, pair = found, i * parts + j
        return pair

    @inner
    def open_pairs(p, q, least):
        """
        Return the pairs of parts whose separation may be less than the least found: an array.

        Part i of P and part j of Q are the pair i m + j, where Q has m parts.
        """
        parts = max(1, -q.n)
        pairs = np.empty(max(1, -p.n) * parts, np.int64)
        count = 0
        for i in range(max(1, -p.n)):
            a = convex_part(p, i)
            if -_overlap(a, q) < least:
                for j in range(parts):
                    if -_overlap(a, convex_part(q, j)) < least:
                        pairs[count] = i * parts + j
                        count += 1
        return pairs[:count]
else:
    def _overlaps(p, q):
        """Return `_overlap` of all pairs of parts."""
        a = _boxes(p)[:, None]
        b = _boxes(q)
        return np.minimum(
            np.minimum(a[..., 2] - b[:, 0], b[:, 2] - a[..., 0]),
            np.minimum(a[..., 3] - b[:, 1], b[:, 3] - a[..., 1])).ravel()

    def _boxes(p):
        """Return the bounds of each part: (parts, 4)."""
        array = np.asarray(p.array)
        first = p.start + HEADER
        starts = [0] if p.n > 0 else array[first:first - 2 * p.n:2].astype(int)
        return array[p.start + np.add.outer(starts, np.arange(2, 6))]

    def _nearest_boxes(p, q):
        return int(np.argmax(_overlaps(p, q)))

    def open_pairs(p, q, least):
        """Return the pairs of parts whose separation may be less than the least found: a list."""
        gaps = _overlaps(p, q)
        return np.flatnonzero(-gaps < least).tolist()

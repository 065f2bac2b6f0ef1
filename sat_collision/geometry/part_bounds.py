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
Lower bounds of the separation of convex parts by boxes and axes, much cheaper than measuring.

Parts are no nearer than their boxes, and overlap no deeper: a move that separates the boxes
separates the parts. `distance` ensures that this is true of rounded separations, too.

Along any axis the gap between bodies is at most their separation, and along the normal of an edge
the overlap is at least their depth. Where rounding could invalidate this, nothing is concluded.
"""

import math

import numpy as np
from sat_collision.geometry.jit import COMPILED, inner
from sat_collision.geometry.layout import convex_part, first_vertex, HEADER
from sat_collision.geometry.plane import length, scale_to_one

# Exceeds the rounding error of a distance along an axis, relative to the largest coordinate: see
# docs/exactness.md, lemma 20.
ROUNDING = 2.0 ** -47
# Below this magnitude underflow may have taken too much from products.
_LEAST_PRODUCT = 1e-290


@inner
def limit_of(least, reach):
    """
    Return the gap along an axis above which a pair cannot be the nearest or deepest.

    Parameters
    ----------
    least : float
        The least separation found so far, negative where bodies overlap.
    reach : float
        The largest coordinate.

    """
    # Where products of coordinates may overflow or underflow, axes prove nothing.
    return least + ROUNDING * reach if scale_to_one(reach) == 1.0 else math.inf


@inner
def is_beyond_edge(p, q, limit):
    """Return whether the gap from some edge of P to Q, < 0 if Q is inside it, is above a limit."""
    v = p.array
    w = q.array
    first = first_vertex(p)
    other_first = first_vertex(q)
    for i in range(p.n if p.n > 2 else 0):
        a = first + 2 * i
        b = first + 2 * (i + 1 if i + 1 < p.n else 0)
        ex = v[b] - v[a]
        ey = v[b + 1] - v[a + 1]
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
def reaches(p, ux, uy):
    """Return how far each convex part of a body reaches along an axis: an array."""
    v = p.array
    found = np.empty(max(1, -p.n))
    for i in range(max(1, -p.n)):
        part = convex_part(p, i)
        first = first_vertex(part)
        furthest = -math.inf
        for k in range(first, first + 2 * part.n, 2):
            furthest = max(furthest, v[k] * ux + v[k + 1] * uy)
        found[i] = furthest
    return found


@inner
def overlap(p, q):
    """Return the least move along x or y that parts the boxes of P and Q; minus a gap between."""
    a = p.array
    b = q.array
    i = p.start
    j = q.start
    return min(min(a[i + 4] - b[j + 2], b[j + 4] - a[i + 2]),
               min(a[i + 5] - b[j + 3], b[j + 5] - a[i + 3]))


@inner
def may_be_less(gap, least):
    """Return whether a separation may be less than the one found, given the `overlap` of boxes."""
    return -gap < least


if COMPILED:
    @inner
    def nearest_boxes(p, q):
        """Return the first pair of parts, see `open_pairs`, with the greatest `overlap`."""
        best = -math.inf
        pair = 0
        parts = max(1, -q.n)
        for i in range(max(1, -p.n)):
            a = convex_part(p, i)
            if overlap(a, q) > best:
                for j in range(parts):
                    found = overlap(a, convex_part(q, j))
                    if found > best:
                        best = found
                        pair = i * parts + j
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
            if may_be_less(overlap(a, q), least):
                for j in range(parts):
                    if may_be_less(overlap(a, convex_part(q, j)), least):
                        pairs[count] = i * parts + j
                        count += 1
        return pairs[:count]
else:
    def _overlaps(p, q):
        """Return `overlap` of all pairs of parts."""
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

    def nearest_boxes(p, q):
        """Return the first pair of parts with the greatest `overlap`."""
        return int(np.argmax(_overlaps(p, q)))

    def open_pairs(p, q, least):
        """Return the pairs of parts whose separation may be less than the least found: a list."""
        gaps = _overlaps(p, q)
        return np.flatnonzero(-gaps < least).tolist()

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
What an axis tells of the separation of two convex parts, for much less than measuring it.

Along any axis bodies apart are no further from each other than they are, and along the normal of
an edge bodies that overlap no less deep. Nothing is told where rounding might deceive.
"""

import math

import numpy as np
from sat_collision.geometry.jit import inner
from sat_collision.geometry.layout import convex_part, first_vertex
from sat_collision.geometry.plane import length, scale_to_one

# More than what rounding makes of a distance along an axis, in parts of the largest coordinate:
# see docs/exactness.md, lemma 20.
ROUNDING = 2.0 ** -47
# Below this magnitude products may have lost what is below the smallest doubles.
_LEAST_PRODUCT = 1e-290


@inner
def limit_of(least, reach):
    """
    Return the separation from which on, seen along an axis, a pair cannot be what is sought.

    Parameters
    ----------
    least : float
        The least separation found so far, negative where bodies overlap.
    reach : float
        The largest coordinate.

    """
    # Where products of coordinates overflow or underflow axes prove nothing.
    return least + ROUNDING * reach if scale_to_one(reach) == 1.0 else math.inf


@inner
def is_beyond_edge(p, q, limit):
    """Return whether, from some edge of P, all of Q is so far outside, or not so deep inside."""
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

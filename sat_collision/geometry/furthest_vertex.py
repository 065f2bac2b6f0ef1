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
The support of a convex polygon, in twice the precision of doubles (docs/exactness.md, lemma 16).

An axis is given as x and y, each a head and a tail, see `double_double`.
"""

from sat_collision.geometry.double_double import difference, dot, negative, plus
from sat_collision.geometry.jit import inner
from sat_collision.geometry.layout import first_vertex

# Of the products' magnitudes: what a scalar product in twice the precision may be wrong by.
_HIDDEN = 16.0 * 2.0 ** -106
# More than what underflow takes from a scalar product, or from coordinates made smaller.
_LOST = 2.0 ** -1022
# Below this length an edge may be nothing but what underflow left of it.
SHORT = 2.0 ** -900


@inner
def furthest(p, i, nx, ny):
    """Return where the vertex of P furthest along n stands, but for 2^-99 R; begin at i."""
    v = p.array
    first = first_vertex(p)
    last = first + 2 * p.n - 2
    ahead = i + 2 if i < last else first
    rise_ahead = _rise(v, i, ahead, nx, ny)
    while rise_ahead > 0:
        i = ahead
        ahead = i + 2 if i < last else first
        rise_ahead = _rise(v, i, ahead, nx, ny)
    behind = i - 2 if i > first else last
    rise_behind = _rise(v, i, behind, nx, ny)
    while rise_behind > 0:
        i = behind
        behind = i - 2 if i > first else last
        rise_behind = _rise(v, i, behind, nx, ny)
        ahead = i
        rise_ahead = -1
    if p.n > 1 and ((rise_ahead == 0 and not _runs_left(v, i, ahead, nx[0], ny[0]))
                    or (rise_behind == 0 and not _runs_left(v, behind, i, nx[0], ny[0]))):
        # At the bottom, or where underflow hides how edges run.
        i = first
        most = along(v, first, first, nx, ny)
        for k in range(first, last + 2, 2):
            found = along(v, first, k, nx, ny)
            if plus(found, negative(most))[0] > 0.0:
                most = found
                i = k
    return i


@inner
def along(v, i, k, nx, ny):
    """Return the component along n of the way from the vertex at i to that at k."""
    return dot(difference(v[k], v[i]), difference(v[k + 1], v[i + 1]), nx, ny)


@inner
def _rise(v, i, k, nx, ny):
    """Return the sign of `_along`, 0 if it is not certain."""
    rise = along(v, i, k, nx, ny)[0]
    bound = (_HIDDEN * (abs((v[k] - v[i]) * nx[0]) + abs((v[k + 1] - v[i + 1]) * ny[0]))
             + _LOST)
    return int(rise > bound) - int(-rise > bound)


@inner
def _runs_left(v, i, k, nx, ny):
    """Return whether an edge whose rise is not certain runs to the left of n, and is not short."""
    return nx * (v[k + 1] - v[i + 1]) - ny * (v[k] - v[i]) > SHORT

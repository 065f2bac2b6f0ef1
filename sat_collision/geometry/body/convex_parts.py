# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Cut a simple polygon into convex parts without new vertices, so that nothing is rounded.

Ears are clipped (Meisters 1975), then the diagonals that no reflex vertex needs are removed
(Hertel and Mehlhorn 1983), which leaves at most four times the least number of parts. Every
decision is the exact sign of an orientation; see docs/exactness.md, lemma 13.
"""

import numpy as np

from sat_collision.geometry.compiled.jit import inner, kernel, scratch_integers
from sat_collision.geometry.numeric.predicates import orient

# Entries of `in_the_way` that are no vertices: nothing is known, or the vertex is reflex.
_UNKNOWN = -1
_REFLEX = -2


@kernel
def convex_parts(vertices):
    """
    Return the convex parts of a simple counter-clockwise ring x, y, ... without repeated vertices.

    Returned are the vertex indices of the parts, all counter-clockwise, and where each part ends.
    """
    corner_vertex, following, previous, diagonals = _triangulate(vertices)
    _merge(vertices, corner_vertex, following, previous, diagonals)
    total = len(corner_vertex)
    corners = np.empty(total, np.int64)
    ends = np.empty(total, np.int64)
    used = parts = 0
    for start in range(total):
        corner = start
        if following[corner] < 0:
            continue
        while following[corner] >= 0:
            corners[used] = corner_vertex[corner]
            used += 1
            after = following[corner]
            following[corner] = -1
            corner = after
        ends[parts] = used
        parts += 1
    return corners[:used], ends[:parts]


@inner
def _turn(vertices, i, j, k):
    return orient(vertices[2 * i], vertices[2 * i + 1], vertices[2 * j], vertices[2 * j + 1],
                  vertices[2 * k], vertices[2 * k + 1])


@inner
def _triangulate(vertices):
    """
    Clip ears until nothing is left.

    Returns the triangles' corners as linked rings (vertex of a corner, following and previous
    corner; a corner stands for the half-edge that leaves it) and the diagonals as pairs of the
    two half-edges that run along them. A clipped corner that is flat makes no triangle.
    """
    count = len(vertices) // 2
    after = scratch_integers(count)
    before = scratch_integers(count)
    # The half-edge, inside a triangle already clipped, along the ring's edge that leaves a vertex.
    twin = scratch_integers(count)
    # Why a vertex is no ear, valid until a neighbour, or the vertex in its triangle, is cut.
    in_the_way = scratch_integers(count)
    for j in range(count):
        after[j] = j + 1 if j + 1 < count else 0
        before[j] = j - 1 if j > 0 else count - 1
        twin[j] = -1
        in_the_way[j] = _UNKNOWN
    corner_vertex = np.empty(3 * count, np.int64)
    following = np.empty(3 * count, np.int64)
    previous = np.empty(3 * count, np.int64)
    diagonals = np.empty((count, 2), np.int64)
    corners = cuts = j = 0
    left = count
    while left > 2:
        i, k = before[j], after[j]
        known = in_the_way[j]
        if known == _REFLEX or (known >= 0 and after[known] >= 0):
            j = k
            continue
        turn = _turn(vertices, i, j, k)
        known = _UNKNOWN
        if turn < 0:
            known = _REFLEX
        elif turn > 0 and left > 3:
            known = _vertex_inside(vertices, after, i, j, k)
        if known != _UNKNOWN:
            in_the_way[j] = known
            j = k
            continue
        if turn > 0:
            for corner, vertex in ((0, i), (1, j), (2, k)):
                corner_vertex[corners + corner] = vertex
                following[corners + corner] = corners + (corner + 1) % 3
                previous[corners + corner] = corners + (corner + 2) % 3
                # The third edge is one of the ring's only in the last triangle.
                if twin[vertex] >= 0 and (corner < 2 or left == 3):
                    diagonals[cuts, 0] = corners + corner
                    diagonals[cuts, 1] = twin[vertex]
                    cuts += 1
            twin[i] = corners + 2
            corners += 3
        else:
            twin[i] = -1
        after[i] = k
        before[k] = i
        after[j] = -1
        in_the_way[i] = in_the_way[k] = _UNKNOWN
        left -= 1
        j = i
    return corner_vertex[:corners], following[:corners], previous[:corners], diagonals[:cuts]


@inner
def _vertex_inside(vertices, after, i, j, k):
    """Return a vertex of the remaining ring in the closed triangle i, j, k, _UNKNOWN if none."""
    ax, ay = vertices[2 * i], vertices[2 * i + 1]
    bx, by = vertices[2 * j], vertices[2 * j + 1]
    cx, cy = vertices[2 * k], vertices[2 * k + 1]
    min_x, max_x = min(ax, bx, cx), max(ax, bx, cx)
    min_y, max_y = min(ay, by, cy), max(ay, by, cy)
    v = after[k]
    while v != i:
        x, y = vertices[2 * v], vertices[2 * v + 1]
        if (min_x <= x <= max_x and min_y <= y <= max_y
                and orient(ax, ay, bx, by, x, y) >= 0 and orient(bx, by, cx, cy, x, y) >= 0
                and orient(cx, cy, ax, ay, x, y) >= 0):
            return v
        v = after[v]
    return _UNKNOWN


@inner
def _merge(vertices, corner_vertex, following, previous, diagonals):
    """Join the parts on both sides of each diagonal whose removal leaves both ends convex."""
    for d in range(len(diagonals)):
        out, back = diagonals[d, 0], diagonals[d, 1]
        out_next, back_next = following[out], following[back]
        out_before, back_before = previous[out], previous[back]
        a, c = corner_vertex[out], corner_vertex[back]
        if (_turn(vertices, corner_vertex[out_before], a,
                  corner_vertex[following[back_next]]) >= 0
                and _turn(vertices, corner_vertex[back_before], c,
                          corner_vertex[following[out_next]]) >= 0):
            following[out_before] = back_next
            previous[back_next] = out_before
            following[back_before] = out_next
            previous[out_next] = back_before
            following[out] = following[back] = -1

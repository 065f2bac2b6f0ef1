# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Packs the points of messages."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.layout import packed_size
from sat_collision.geometry.body.packing import pack_convex, PAIR
from sat_collision.geometry.body.polygon import (
    Affine2D, PackedBody, Points, Polygon, PolygonError, Reason, UNMOVED)
from sat_collision.geometry.compiled.jit import COMPILED, indexable

# Max vertices that plain Python cuts into convex parts and measures in time, see
# docs/reliability.md.
_MAX_NON_CONVEX = 128
# Messages with more points than this times the max vertices are refused unread.
_POINTS_FOR_A_VERTEX = 8


def max_non_convex(max_vertices: int) -> int:
    """Return the max vertices of a non-convex polygon, given those of any polygon."""
    return max_vertices if COMPILED else min(max_vertices, _MAX_NON_CONVEX)


class Packer:
    """Packs the points of messages, convex ones into an array used again each time."""

    def __init__(self, max_vertices: int) -> None:
        self.max_vertices = max_vertices
        self._max_non_convex = max_non_convex(max_vertices)
        # One more, for a closing point; messages with even more points may be slow.
        self._max_points = max_vertices + 1
        self.array = indexable(np.empty(packed_size(self._max_points)))

    def pack(self, points: Points, affine: Affine2D = UNMOVED) -> PackedBody:
        """Return the body of points moved by an affine map, valid until the next call."""
        count = points[2]
        if 0 < count <= self._max_points:
            vertices = pack_convex(*points, self.array, self.max_vertices, affine)
            if vertices:
                return self.array, vertices
        limit = _POINTS_FOR_A_VERTEX * self.max_vertices
        if count > limit:
            raise PolygonError(Reason.TOO_MANY_VERTICES,
                               f'{count} points, of which at most {limit} are looked at')
        return Polygon._of_bytes(points, self.max_vertices, self._max_non_convex, affine).packed


def vertices_of(points: Points, affine: Affine2D | None = None) -> NDArray[np.float64]:
    """Return points in the order sent as (n, 2) array, moved by an affine map if given."""
    data, start, count, step = points
    received = np.frombuffer(data, np.float64 if step == PAIR else np.float32, step * count,
                             start).reshape(-1, step)
    vertices = received[:, :2].astype(np.float64)
    if affine is None:
        return vertices
    a, b, x, c, d, y = affine
    moved: NDArray[np.float64] = vertices @ np.array([(a, c), (b, d)]) + (x, y)
    return moved

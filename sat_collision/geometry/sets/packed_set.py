# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A set of bodies whose user keeps track of rows."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.layout import packed_sizes
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.polygon_set import Point, PolygonSet
from sat_collision.geometry.sets.run import Run, write_run
from sat_collision.geometry.sets.set_kernels import hide_rows


class PackedSet(PolygonSet):
    """
    A PolygonSet for one thread that keeps track of rows itself: rows are not checked.

    A wrong row overwrites memory. Rows may be empty, and bodies are given packed.
    """

    # Not methods that call these: a call for each body takes time.
    new_row = PolygonSet._new_row
    place = PolygonSet._place
    remove = PolygonSet._remove
    polygon = PolygonSet._polygon
    first_met = PolygonSet._first_met

    def new_rows(self, counts: NDArray[np.int64]) -> list[int]:
        """Add rows without a body, with room for one of so many vertices each; return them."""
        added = [self._new_row() for _ in counts]
        self._make_room(added, packed_sizes(counts))
        return added

    def place_run(self, run: Run, rows: Any, first: int, limit: int, others: PackedSet,
                  margin: float) -> int:
        """Replace the bodies of rows by polygons of a run, see `write_run`; return how many."""
        if self._queries:
            self._forget_index()
        count: int = write_run(run, self._array, rows, first, limit, others._array, margin)
        return count

    def nearest_to(self, others: PackedSet, row: int, skipped: NDArray[np.int64]
                   ) -> tuple[int, float, Point, Point] | None:
        """Return what `nearest` does for a row of another set; `skipped` are ascending."""
        packed, count = others._body(row)
        body = indexable(packed), count
        return self._nearest(body, indexable(skipped))

    def nearest_rows(self, boxes: Iterable[tuple[float, float, float, float]], limit: int,
                     room: int) -> tuple[list[int], bool]:
        """
        Return the rows with a body whose bounds are nearest to any box, and whether these are all.

        Up to `limit`, for whose bodies no more doubles than `room` are reserved; or just one.
        """
        rows = np.flatnonzero(self._rows.n[:self._used_rows])
        min_x, min_y, max_x, max_y = (column[rows] for column in self._rows[:4])
        distances = np.full(len(rows), np.inf)
        for low_x, low_y, high_x, high_y in boxes:
            x = np.maximum(min_x - high_x, low_x - max_x).clip(0.0)
            y = np.maximum(min_y - high_y, low_y - max_y).clip(0.0)
            distances = np.minimum(distances, np.hypot(x, y))
        nearest = rows[np.argsort(distances, kind='stable')[:limit]]
        fitting = np.searchsorted(np.cumsum(self._rows.space[nearest]), room, 'right')
        nearest = nearest[:max(fitting, 1)]
        return nearest.tolist(), len(nearest) == len(rows)

    def hide(self, rows: Any) -> None:
        """Empty rows (-1: none); each stays in use until it is filled again or removed."""
        if self._queries:
            self._forget_index()
        hide_rows(self._array, rows)

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

"""Many bodies packed into flat arrays, so that one compiled call answers for all of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.batch import decide_rows
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.polygon import as_polygon, PackedBody, Polygon
from sat_collision.geometry.scan import (
    intersecting_rows, is_same, nearest_row, NO_ROOM, Rows, rows_within, UNCHANGED,
    write_and_intersect, write_and_measure)
from sat_collision.geometry.separating_axis import MEET

Point = tuple[float, float]

_FEWEST_ROWS = 16
_FEWEST_DOUBLES = 1024
_NOWHERE = np.array([np.inf, np.inf, -np.inf, -np.inf])
_NO_ROWS = np.empty(0, np.int64)


class PolygonSet:
    """
    A set of bodies by row number, that can grow, shrink and be replaced in place.

    The packed bodies (see `layout`) lie in one array, their bounds in another. The space of a
    removed or outgrown body is reused when a body fits it, or won back when the array is next
    repacked, which keeps it below four times what the bodies need.

    Parameters
    ----------
    bodies : iterable of Polygon or (n, 2) array_like, optional
        Bodies of rows 0, 1, 2, ..., in metres in one frame.

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    """

    def __init__(self, bodies: Iterable[Polygon | ArrayLike] = ()) -> None:
        self._bounds = np.empty((4, _FEWEST_ROWS))
        self._spans = np.empty((3, _FEWEST_ROWS), np.int64)
        self._packed = np.empty(_FEWEST_DOUBLES)
        self._found = np.empty(_FEWEST_ROWS, np.int64)
        self._used_rows = 0
        self._used_doubles = 0
        self._free: list[int] = []
        self._share_arrays()
        for body in bodies:
            self.append(body)

    def __len__(self) -> int:
        """Return the number of rows with a body."""
        return self._used_rows - len(self._free)

    @property
    def used_rows(self) -> int:
        """How many rows are, or were, in use."""
        return self._used_rows

    @property
    def nbytes(self) -> int:
        """Bytes of memory held by the arrays."""
        return sum(array.nbytes for array in (self._bounds, self._spans, self._packed,
                                              self._found))

    def append(self, body: Polygon | ArrayLike) -> int:
        """Add a body and return its row: the one freed last, if any."""
        row = self.new_row()
        self.replace(row, body)
        return row

    def new_row(self) -> int:
        """Add a row that has no body yet and return it: the one freed last, if any."""
        if self._free:
            return self._free.pop()
        row = self._used_rows
        if row == len(self._found):
            self._bounds = np.concatenate([self._bounds, np.empty_like(self._bounds)], axis=1)
            self._spans = np.concatenate([self._spans, np.empty_like(self._spans)], axis=1)
            self._found = np.empty(2 * len(self._found), np.int64)
        self._used_rows += 1
        self._spans[:, row] = 0
        self._bounds[:, row] = _NOWHERE
        self._share_arrays()
        return row

    def replace(self, row: int, body: Polygon | ArrayLike) -> None:
        """Put another body in place of that of a row."""
        self.place(row, as_polygon(body).packed, _EMPTY)

    def place(self, row: int, body: PackedBody, others: PolygonSet,
              margin: float = 0.0) -> list[int] | None:
        """
        Put a body in place of that of a row, and find which rows of another set it then meets.

        Parameters
        ----------
        row : int
        body : PackedBody
        others : PolygonSet
        margin : float, optional
            Metres up to which bodies apart count as meeting, see `rows_within`.

        Returns
        -------
        list of int or None
            Rows of the other set, ascending; None if this very body was in the row already.

        """
        packed, count = body
        while True:
            if margin == 0.0:
                outcome = write_and_intersect(self._arrays, row, packed, count, others._arrays,
                                              others._rows_found)
            else:
                outcome = write_and_measure(self._arrays, row, packed, count, others._arrays,
                                            margin, others._rows_found)
            if outcome == NO_ROOM:
                self._make_room(row, len(packed))
            elif outcome == UNCHANGED:
                return None
            else:
                return others._rows_found[:outcome].tolist() if outcome else []

    def remove(self, row: int) -> None:
        """Take the body of a row out; the row number may be given to a later body."""
        self._spans[1, row] = 0
        self._bounds[:, row] = _NOWHERE
        self._free.append(row)

    def is_same(self, row: int, body: PackedBody) -> bool:
        """Tell whether the body of a row is this one, in the very same vertices."""
        return bool(is_same(self._arrays, row, *body))

    def polygon(self, row: int) -> Polygon:
        """Return the body of a row."""
        start, count, space = self._spans[:, row].tolist()
        return Polygon.of_packed(self._packed[start:start + space], count)

    def intersecting_rows(self, body: Polygon | ArrayLike) -> NDArray[np.int64]:
        """
        Return the rows whose bodies share a point with a body, in ascending order; exact.

        Returns
        -------
        (k,) ndarray of int64

        """
        packed, count = as_polygon(body).packed
        found = intersecting_rows(self._arrays, packed, count, self._rows_found)
        return self._found[:int(found)].copy() if found else _NO_ROWS

    def rows_within(self, body: Polygon | ArrayLike, margin: float) -> NDArray[np.int64]:
        """
        Return the rows whose bodies are no further than margin (m) from a body, ascending.

        A margin of 0 means contact and is exact; otherwise the separation, rounded to a few ulp of
        the coordinates, is compared with it.
        """
        if margin == 0.0:
            return self.intersecting_rows(body)
        packed, count = as_polygon(body).packed
        found = rows_within(self._arrays, packed, count, margin, self._rows_found)
        rows: NDArray[np.int64] = self._found[:found].copy()
        return rows

    def nearest(self, body: Polygon | ArrayLike, skipped: Iterable[int] = ()
                ) -> tuple[int, float, Point, Point] | None:
        """
        Return what is nearest to a body, or deepest in it.

        Parameters
        ----------
        body : Polygon or (n, 2) array_like
        skipped : iterable of int, optional
            Rows to leave out.

        Returns
        -------
        int, float, (x, y), (x, y)
            The row, its separation from the body and the points that realise it, one of the row's
            body and one of the other, see `query.separation`. None if there is no row to choose.

        """
        packed, count = as_polygon(body).packed
        row, separation, ax, ay, bx, by = nearest_row(
            self._arrays, packed, count, indexable(np.fromiter(skipped, np.int64)))
        return None if row < 0 else (row, separation, (ax, ay), (bx, by))

    def intersects(self, body: Polygon | ArrayLike) -> NDArray[np.bool_]:
        """Return for each row whether its body shares a point with a body: (m,) bool."""
        answers = np.zeros(self._used_rows, np.bool_)
        answers[self.intersecting_rows(body)] = True
        return answers

    def intersects_pairs(self, other: PolygonSet) -> NDArray[np.bool_]:
        """
        Return for each row whether its body meets that of the same row of another set: (m,) bool.

        Raises
        ------
        ValueError
            The sets differ in length.

        """
        if self._used_rows != other._used_rows:
            raise ValueError(f'{self._used_rows} bodies cannot be paired with '
                             f'{other._used_rows}')
        answers = np.empty(self._used_rows, np.int8)
        decide_rows(self._arrays, other._arrays, answers)
        meet: NDArray[np.bool_] = answers == MEET
        return meet

    def _share_arrays(self) -> None:
        """Have ready what the kernels take: the arrays as they are now, see `scan`."""
        self._arrays = tuple(Rows(indexable(self._bounds), indexable(self._spans),
                                  indexable(self._packed), self._used_rows))
        self._rows_found = indexable(self._found)

    def _make_room(self, row: int, size: int) -> None:
        """Give a row space for a packed body, at the end of what is used."""
        self._spans[1, row] = 0
        if self._used_doubles + size > len(self._packed):
            self._repack(size)
        self._spans[0, row] = self._used_doubles
        self._spans[2, row] = size
        self._used_doubles += size

    def _repack(self, needed: int) -> None:
        """Move the bodies in use to the front of a new array with room for as much again."""
        rows = np.flatnonzero(self._spans[1, :self._used_rows])
        live = int(self._spans[2, rows].sum())
        packed = np.empty(max(_FEWEST_DOUBLES, 2 * (live + needed)))
        end = 0
        for row in rows:
            start, _, size = self._spans[:, row]
            packed[end:end + size] = self._packed[start:start + size]
            self._spans[0, row] = end
            end += size
        self._spans[2, self._spans[1] == 0] = 0
        self._packed = packed
        self._used_doubles = end
        self._share_arrays()


_EMPTY = PolygonSet()

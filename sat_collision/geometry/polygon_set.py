# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sets of bodies packed into one array, so that one compiled call answers for all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.layout import new_array, use_rows, views_of
from sat_collision.geometry.polygon import as_polygon, BodyLike, PackedBody, Polygon, size_of
from sat_collision.geometry.prediction import first_row_met, motion_of, ways_of
from sat_collision.geometry.run import Run, write_run
from sat_collision.geometry.scan import (
    decide_rows, intersecting_rows, measure_rows, near_rows, NEAREST, NO_ROOM, UNCHANGED,
    write_and_intersect, write_row)
from sat_collision.geometry.separating_axis import MEET

Point = tuple[float, float]

_FEWEST_ROWS = 16
_FEWEST_DOUBLES = 1024
_NO_ROWS = np.empty(0, np.int64)
_NO_ARRAY = indexable(np.empty(0))


class PolygonSet:
    """
    A set of bodies, each with a row number, that can be added, removed and replaced in place.

    All bodies are in one array. The space of a removed or outgrown body is reused when another
    fits, or freed when the array is next rebuilt, which keeps it below four times what the bodies
    need.

    Parameters
    ----------
    bodies : iterable of Polygon, (n, 2) array_like or geometry, optional
        Bodies of rows 0, 1, 2, ..., in metres in one frame.

    Raises
    ------
    PolygonError
        Points that do not make a polygon.
    TypeError
        One Polygon or geometry instead of several bodies.

    Examples
    --------
    >>> obstacles = PolygonSet([[(3, 0), (4, 0), (4, 5)], [(0.5, 0.5)]])
    >>> obstacles.intersecting_rows([(0, 0), (1, 0), (1, 1), (0, 1)])
    array([1])

    """

    def __init__(self, bodies: Iterable[BodyLike] = ()) -> None:
        self._used_rows = 0
        self._used_doubles = 0
        self._free: list[int] = []
        self._use(new_array(_FEWEST_ROWS, _FEWEST_DOUBLES))
        if isinstance(bodies, Polygon) or hasattr(bodies, '__geo_interface__'):
            raise TypeError(f'one {type(bodies).__name__}, but a set is made of several bodies: '
                            'put it into a list')
        for body in bodies:
            self.append(body)

    def _use(self, array: NDArray[np.float64]) -> None:
        use_rows(array, self._used_rows)
        self._array = indexable(array)
        self._rows = views_of(array)

    def __len__(self) -> int:
        """Return the number of rows with a body."""
        return self._used_rows - len(self._free)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        return int(self._array.nbytes)

    def append(self, body: BodyLike) -> int:
        """
        Add a body and return its row: the one freed last, if any.

        Raises
        ------
        PolygonError
            Points that do not make a polygon; the set is unchanged.

        """
        packed = as_polygon(body).packed
        row = self._new_row()
        self._place(row, packed, _EMPTY)
        return row

    def _new_row(self) -> int:
        """Add a row without a body and return it: the one freed last, if any."""
        if self._free:
            return self._free.pop()
        row = self._used_rows
        if row == len(self._rows.found):
            self._rebuild(2 * row, len(self._rows.packed))
        self._used_rows += 1
        use_rows(self._array, self._used_rows)
        return row

    def replace(self, row: int, body: BodyLike) -> None:
        """
        Replace the body of a row.

        Raises
        ------
        IndexError
            The row has no body.
        PolygonError
            Points that do not make a polygon; the set is unchanged.

        """
        self._place(self._checked(row), as_polygon(body).packed, _EMPTY)

    def _place(self, row: int, body: PackedBody, others: PolygonSet,
               margin: float = 0.0) -> list[int] | None:
        """
        Replace the body of a row; return which rows of another set are within a margin, ascending.

        None if the row had the same body already.
        """
        packed, count = body
        while True:
            if margin == 0.0:
                outcome = write_and_intersect(self._array, row, packed, count, others._array)
            else:
                outcome = write_row(self._array, row, packed, count)
                if outcome == 0:
                    outcome = near_rows(others._array, packed, count, margin, _NO_ROWS)[0]
            if outcome == NO_ROOM:
                self._make_room(row, size_of(body))
            elif outcome == UNCHANGED:
                return None
            else:
                return others._rows.found[:outcome].tolist() if outcome else []

    def remove(self, row: int) -> None:
        """
        Remove the body of a row; the row number may be given to a later body.

        Raises
        ------
        IndexError
            The row has no body.

        """
        self._remove(self._checked(row))

    def _remove(self, row: int) -> None:
        """Remove the body of a row, if it has one, and free the row for another."""
        self._rows.n[row] = 0
        self._free.append(row)

    def polygon(self, row: int) -> Polygon:
        """
        Return the body of a row.

        Raises
        ------
        IndexError
            The row has no body.

        """
        return self._polygon(self._checked(row))

    def _polygon(self, row: int) -> Polygon:
        """Return the body of a row that has one."""
        start = self._rows.start[row]
        return Polygon._of_packed(self._rows.packed[start:], int(self._rows.n[row]))

    def _checked(self, row: int) -> int:
        """Return a row as an int; raise `IndexError` if it has no body."""
        number = index(row)
        if not 0 <= number < self._used_rows:
            raise IndexError(f'no row {number} in a set of {self._used_rows} rows')
        if not self._rows.n[number]:
            raise IndexError(f'row {number} of a set of {self._used_rows} rows has no body: it '
                             'was removed')
        return number

    def intersecting_rows(self, body: BodyLike) -> NDArray[np.int64]:
        """
        Return the rows whose bodies share a point with a body, in ascending order; exact.

        Returns
        -------
        (k,) ndarray of int64

        """
        packed, count = as_polygon(body).packed
        found = intersecting_rows(self._array, packed, count)
        return self._rows.found[:int(found)].copy() if found else _NO_ROWS

    def rows_within(self, body: BodyLike, margin: float) -> NDArray[np.int64]:
        """
        Return the rows whose bodies are no further than margin (m) from a body, ascending.

        A margin of 0 means contact and is exact; otherwise the rows are those whose `separation`
        is no more than the margin.

        Raises
        ------
        ValueError
            A margin that is negative or not a number.

        Examples
        --------
        >>> PolygonSet([[(3, 0), (3, 1)], [(0, 5)]]).rows_within([(1, 0)], 2.0)
        array([0])

        """
        if not margin >= 0.0:
            raise ValueError(f'margin {margin}, but it has to be 0 or more')
        if margin == 0.0:
            return self.intersecting_rows(body)
        packed, count = as_polygon(body).packed
        found = near_rows(self._array, packed, count, float(margin), _NO_ROWS)[0]
        rows: NDArray[np.int64] = self._rows.found[:found].copy()
        return rows

    def nearest(self, body: BodyLike, skipped: Iterable[int] = ()
                ) -> tuple[int, float, Point, Point] | None:
        """
        Return the row whose body is nearest to a body, or deepest in it.

        Parameters
        ----------
        body : Polygon, (n, 2) array_like or geometry
        skipped : iterable of int, optional
            Rows to leave out; rows without a body are ignored.

        Returns
        -------
        int, float, (x, y), (x, y)
            The row, its separation from the body and the points that realise it, one of the row's
            body and one of the other, see `separation`. None if no row is left.

        Examples
        --------
        >>> PolygonSet([[(3, 0), (3, 1)], [(0, 5)]]).nearest([(1, 0)])
        (0, 2.0, (3.0, 0.0), (1.0, 0.0))

        """
        packed, count = as_polygon(body).packed
        row, separation, ax, ay, bx, by = near_rows(
            self._array, packed, count, NEAREST, _ascending(skipped))
        return None if row < 0 else (row, separation, (ax, ay), (bx, by))

    def first_contact(self, footprint: BodyLike, twist: ArrayLike, horizon: float,
                      velocities: ArrayLike | None = None, pose: ArrayLike = (0.0, 0.0, 0.0),
                      tolerance: float = 1e-3, margin: float = 0.0
                      ) -> tuple[int, float] | None:
        """
        Return which row a moving body meets first, or comes within a margin of, and when.

        Parameters
        ----------
        footprint, twist, horizon, velocities, pose, tolerance
            As for `time_to_contact`, which raises the same errors; one velocity per row, also for
            rows without a body.
        margin : float, optional
            Bodies no further apart than this count as in contact, metres.

        Returns
        -------
        int, float
            The row, the first in a tie, and the time in seconds. None if there is no contact
            within the horizon.

        Examples
        --------
        >>> row, time = PolygonSet([[(5, 0)], [(4, 0)]]).first_contact([(1, 0)], (2, 0, 0), 3.0)
        >>> row, round(time, 9)
        (1, 1.5)

        """
        motion = motion_of(twist, horizon, pose, tolerance, margin)
        return self._first_met(footprint, motion, velocities)

    def _first_met(self, footprint: BodyLike, motion: NDArray[np.float64],
                   velocities: ArrayLike | None = None,
                   skipped: Iterable[int] = ()) -> tuple[int, float] | None:
        """Return the same for a `prediction.Motion`, leaving out the rows skipped."""
        polygon = as_polygon(footprint)
        ways = ways_of(velocities, self._used_rows, motion[5])
        skipped = set(skipped)
        for row in self.rows_within(polygon, motion[-1]).tolist():
            if row not in skipped:
                return row, 0.0
        packed, count = polygon.packed
        row, time = first_row_met(self._array, packed, count, indexable(motion),
                                  indexable(ways), _ascending(skipped))
        return None if row < 0 else (row, time)

    def intersects(self, body: BodyLike) -> NDArray[np.bool_]:
        """Return for each row whether its body shares a point with a body: (m,) bool."""
        answers = np.zeros(self._used_rows, np.bool_)
        answers[self.intersecting_rows(body)] = True
        return answers

    def intersects_pairs(self, other: PolygonSet) -> NDArray[np.bool_]:
        """
        Return for each row whether its body meets that of the same row of another set: (m,) bool.

        Raises
        ------
        TypeError
            The other is not a PolygonSet.
        ValueError
            The sets differ in length.

        """
        self._require_pairs(other)
        answers = np.empty(self._used_rows, np.int8)
        decide_rows(self._array, other._array, answers)
        meet: NDArray[np.bool_] = answers == MEET
        return meet

    def separations(self, other: PolygonSet) -> NDArray[np.float64]:
        """
        Return for each row the signed distance of its body from that row's in another set, metres.

        Returns
        -------
        (m,) ndarray
            As returned by `separation`; infinite where a row has no body.

        Raises
        ------
        TypeError
            The other is not a PolygonSet.
        ValueError
            The sets differ in length.

        """
        self._require_pairs(other)
        values = np.empty(self._used_rows)
        measure_rows(self._array, other._array, indexable(values))
        return values

    def _require_pairs(self, other: PolygonSet) -> None:
        if not isinstance(other, PolygonSet):
            raise TypeError(f'a {type(other).__name__}, but rows are paired with those of a '
                            'PolygonSet: make one of the bodies')
        if self._used_rows != other._used_rows:
            raise ValueError(f'{self._used_rows} bodies cannot be paired with '
                             f'{other._used_rows}')

    def _make_room(self, row: int, size: int) -> None:
        """Reserve space for a packed body of a row, at the end of the space in use."""
        rows = self._rows
        rows.n[row] = 0
        if self._used_doubles + size > len(rows.packed):
            live = int(rows.space[rows.n != 0].sum())
            self._rebuild(len(rows.found), max(_FEWEST_DOUBLES, 2 * (live + size)))
        self._rows.start[row] = self._used_doubles
        self._rows.space[row] = size
        self._used_doubles += size

    def _rebuild(self, room: int, doubles: int) -> None:
        """Move everything to an array with other room, without gaps between bodies."""
        old = self._rows
        self._use(new_array(room, doubles))
        end = 0
        for row in np.flatnonzero(old.n):
            start, size = old.start[row], old.space[row]
            self._rows.packed[end:end + size] = old.packed[start:start + size]
            for name in ('min_x', 'min_y', 'max_x', 'max_y', 'n', 'space'):
                getattr(self._rows, name)[row] = getattr(old, name)[row]
            self._rows.start[row] = end
            end += size
        self._used_doubles = end


class PackedSet(PolygonSet):
    """
    A PolygonSet for callers that keep track of rows themselves: rows are not checked.

    A wrong row overwrites memory. Rows may be empty, and bodies are given packed.
    """

    new_row = PolygonSet._new_row
    place = PolygonSet._place
    remove = PolygonSet._remove
    polygon = PolygonSet._polygon
    first_met = PolygonSet._first_met

    def place_run(self, run: Run, rows: Any, first: int, limit: int, others: PackedSet,
                  margin: float) -> int:
        """Replace the bodies of rows by polygons of a run, see `write_run`; return how many."""
        count: int = write_run(run, self._array, rows, first, limit, others._array, margin)
        return count

    def check_run(self, run: Run, limit: int) -> int:
        """Return how many messages of a run `write_run` would accept; nothing is written."""
        count: int = write_run(run, _NO_ARRAY, _NO_ROWS, 0, limit, self._array, 0.0)
        return count

    def nearest_rows(self, boxes: Iterable[tuple[float, float, float, float]],
                     limit: int) -> list[int]:
        """Return up to `limit` rows with a body: those whose bounds are nearest to any box."""
        rows = np.flatnonzero(self._rows.n[:self._used_rows])
        min_x, min_y, max_x, max_y = (column[rows] for column in self._rows[:4])
        distances = np.full(len(rows), np.inf)
        for low_x, low_y, high_x, high_y in boxes:
            x = np.maximum(min_x - high_x, low_x - max_x).clip(0.0)
            y = np.maximum(min_y - high_y, low_y - max_y).clip(0.0)
            distances = np.minimum(distances, np.hypot(x, y))
        nearest: list[int] = rows[np.argsort(distances, kind='stable')[:limit]].tolist()
        return nearest

    def hide(self, rows: Sequence[int]) -> None:
        """Empty rows; each stays in use until it is filled again or removed."""
        self._rows.n[rows] = 0


def _ascending(rows: Iterable[int]) -> NDArray[np.int64]:
    """Return rows in ascending order, as an array that kernels read."""
    array: NDArray[np.int64] = indexable(np.sort(np.fromiter(rows, np.int64)))
    return array


_EMPTY = PolygonSet()

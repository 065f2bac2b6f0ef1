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

from collections.abc import Callable, Iterable
from sys import getrefcount
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.body.box_index import build_index
from sat_collision.geometry.body.layout import (
    new_array, packed_sizes, slices_of, USED, value_of, views_of)
from sat_collision.geometry.body.packing import DOUBLE, PAIR, workspace
from sat_collision.geometry.body.polygon import (
    as_polygon, BodyLike, coordinates, double, ends_of, integer, is_geometry, MAX_VERTICES,
    PackedBody, Polygon, PolygonError, Reason, size_of, UNMOVED)
from sat_collision.geometry.compiled.jit import COMPILED, indexable
from sat_collision.geometry.motion.prediction import first_row_met, motion_of, ways_of
from sat_collision.geometry.pair.separating_axis import MEET
from sat_collision.geometry.sets.run import ALONE, IN_ONE_MESSAGE, write_run
from sat_collision.geometry.sets.set_kernels import (
    decide_rows, intersecting_rows, measure_rows, near_rows, NEAREST, NO_ROOM, UNCHANGED,
    write_and_intersect, write_row)

Point = tuple[float, float]

_FEWEST_ROWS = 16
_FEWEST_DOUBLES = 1024
# From so many rows on a set gets an index, once it has answered so many queries unchanged: with
# fewer a scan is as fast, and building the index takes as long as these queries do.
_FEWEST_INDEXED = 500
_QUERIES = 200 if COMPILED else 2 ** 62
NO_ROWS = np.empty(0, np.int64)


class PolygonSet:
    """
    A set of bodies, each with a row number, that can be added, removed and replaced in place.

    All bodies are in one array. The space of a removed or outgrown body is reused when another
    fits, or freed when the array is next rebuilt, which keeps it below four times what the largest
    body of each row needed.

    Any number of threads may use a set. A query answers for the set as it is when the query
    begins; a change meanwhile is made in a copy. A process that is forked while another thread
    uses a set has to make one of its own. Sets are equal if they have the same rows, removed ones
    among them, with equal bodies; as they can change, they have no hash. They can be pickled.

    Methods raise `PolygonError` for points that do not make a polygon, and `IndexError` for a row
    without a body; the set is unchanged then.

    Parameters
    ----------
    bodies : iterable of Polygon, (n, 2) array_like or geometry, optional
        Bodies of rows 0, 1, 2, ..., in metres in one frame.

    Raises
    ------
    PolygonError
        Points that do not make a polygon; the message begins with the row.
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
        self._lock = Lock()
        # What queries take to read, the array and whether it has an index, 1 or 0, which kernels
        # take faster than a bool; None if `_snapshot` has to see to it.
        self._shared: tuple[Any, int] | None = None
        # How many queries there were since the last change; 0 of a set too small for an index.
        self._queries = 0
        self._use(new_array(_FEWEST_ROWS, _FEWEST_DOUBLES))
        if isinstance(bodies, Polygon) or is_geometry(bodies):
            raise TypeError(f'one {type(bodies).__name__}, but a set is made of several bodies: '
                            'put it into a list')
        for row, body in enumerate(bodies):
            self.append(_body_of_row(row, body))

    @classmethod
    def from_array(cls, points: ArrayLike, offsets: Any = None) -> PolygonSet:
        """
        Make a set of bodies whose points are in one array, which is fast if they are convex.

        Parameters
        ----------
        points : (m, n, 2) or (m, n, 3) array_like; with offsets (k, 2) or (k, 3)
            The n points of each of m bodies, in metres in one frame; or the points of all bodies,
            one body after another. z is ignored.
        offsets : (m + 1,) array_like of int, or tuple of such, optional
            The index at which the points of each body begin, and that at which the last ones end;
            or the offsets of polygons, line strings of two points, or points, as
            `shapely.to_ragged_array` returns them. A longer line string is taken for a polygon.

        Raises
        ------
        PolygonError
            Points that do not make a polygon; the message begins with the row.
        ValueError
            Offsets that are not integers, that decrease, or that are not indices of points.

        Examples
        --------
        >>> PolygonSet.from_array([[(0, 0), (2, 2)], [(3, 0), (3, 1)]]).intersecting_rows([(1, 1)])
        array([0])
        >>> PolygonSet.from_array([(0, 0), (2, 2), (3, 0)], [0, 2, 3]).polygon(1)
        Polygon([[3.0, 0.0]])

        """
        try:
            array = np.asanyarray(points)
        except Exception as error:  # raised by objects that pretend to be arrays
            raise PolygonError(Reason.WRONG_SHAPE, f'not an array: {error}') from error
        if array.ndim != 3 - (offsets is not None) or not array.shape[-1]:
            raise PolygonError(Reason.WRONG_SHAPE, f'an array of shape {array.shape}, expected '
                               '(m, n, 2), or (k, 2) with offsets')
        if offsets is None:
            ends = array.shape[1] * np.arange(len(array) + 1)
            array = array.reshape(-1, array.shape[2])
        else:
            ends = ends_of(offsets, len(array))
        array = array[:, :2] if array.shape[1] == 3 else array
        bodies = cls()
        try:
            doubles = coordinates(array)
        except PolygonError:
            # One by one, to say which row it is.
            for row, (start, end) in enumerate(zip(ends, ends[1:])):
                bodies.append(_body_of_row(row, array[start:end]))
        else:
            bodies._fill(len(ends) - 1, np.arange(len(ends) - 1), doubles, ends, MAX_VERTICES)
        return bodies

    def _fill(self, used: int, rows: NDArray[np.int64], points: NDArray[np.float64],
              ends: NDArray[np.int64], limit: int) -> None:
        """Put bodies of up to `limit` vertices into rows of an empty set, all in one call."""
        counts = np.diff(ends)
        sizes = packed_sizes(counts.clip(max=limit + 1))
        self._used_rows = used
        self._used_doubles = int(sizes.sum())
        self._use(new_array(max(_FEWEST_ROWS, used), max(_FEWEST_DOUBLES, self._used_doubles)))
        self._rows.start[rows] = np.cumsum(sizes) - sizes
        self._rows.space[rows] = sizes
        data = points.tobytes()
        spans = indexable(np.column_stack([PAIR * DOUBLE * ends[:-1], counts]).ravel())
        space = workspace(limit)
        others: list[tuple[int, PackedBody]] = []
        done = 0
        while True:
            run = data, spans, done, IN_ONE_MESSAGE, UNMOVED, limit, space
            done += write_run(run, self._array, indexable(rows), done, len(rows), _EMPTY._array,
                              ALONE)
            if done == len(rows):
                break
            # It is not convex, or not valid.
            body = points[ends[done]:ends[done + 1]]
            others.append((int(rows[done]), _body_of_row(done, body, limit).packed))
            done += 1
        for row, packed in others:
            self._place(row, packed, _EMPTY)

    def _use(self, array: NDArray[np.float64]) -> None:
        array[USED] = self._used_rows
        self._rows = views_of(array)
        # A view of its own, so that only queries refer to it as well.
        self._array = indexable(array[:])
        self._forget_index()

    def _change(self, change: Callable[[], Any]) -> Any:
        """Call a function that changes the set, in a copy if queries are reading the array."""
        with self._lock:
            self._shared = None
            if getrefcount(self._array) > _REFERENCES:
                self._use(np.array(self._array))
            self._queries = 0
            return change()

    def _forget_index(self) -> None:
        self._shared = None
        self._queries = 0

    def _snapshot(self) -> tuple[Any, int]:
        """Return the array, unchanged while it is referred to, and whether it has an index."""
        if shared := self._shared:
            return shared
        with self._lock:
            if not self._shared:
                if self._used_rows >= _FEWEST_INDEXED:
                    self._queries += 1
                    return self._build_index() if self._queries >= _QUERIES else (self._array, 0)
                self._shared = self._array, 0
            return self._shared

    def _build_index(self) -> tuple[Any, int]:
        self._queries = _QUERIES
        self._shared = self._array, build_index(self._array)
        return self._shared

    def index(self) -> None:
        """
        Build an index now, with which queries by one body need not look at all rows.

        Answers stay the same. A set of many rows that has not changed for some hundred queries
        builds it by itself; a change drops it.

        Examples
        --------
        >>> obstacles = PolygonSet([(k, 0)] for k in range(1000))
        >>> obstacles.index()
        >>> obstacles.intersecting_rows([(7, -1), (7, 1)])
        array([7])

        """
        with self._lock:
            if not (self._shared and self._shared[1]):
                self._build_index()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PolygonSet):
            return NotImplemented
        values = value_of(self._snapshot()[0]), value_of(other._snapshot()[0])
        return all(np.array_equal(one, another) for one, another in zip(*values))

    def __reduce__(self) -> tuple[Any, ...]:
        with self._lock:
            array, free = self._array, self._free.copy()
        return _restored, (type(self), free, *value_of(array))

    def __len__(self) -> int:
        """Return the number of rows with a body."""
        return self._used_rows - len(self._free)

    @property
    def nbytes(self) -> int:
        """Bytes of memory held."""
        return int(self._array.nbytes)

    def append(self, body: BodyLike) -> int:
        """Add a body and return its row: the one freed last, if any."""
        packed = as_polygon(body).packed

        def add() -> int:
            self._place(row := self._new_row(), packed, _EMPTY)
            return row
        return int(self._change(add))

    def _new_row(self) -> int:
        """Add a row without a body and return it: the one freed last, if any."""
        if self._free:
            return self._free.pop()
        row = self._used_rows
        if row == len(self._rows.n):
            self._rebuild(2 * row, len(self._rows.packed))
        self._used_rows += 1
        self._array[USED] = self._used_rows
        return row

    def replace(self, row: int, body: BodyLike) -> None:
        """Replace the body of a row."""
        packed = as_polygon(body).packed
        self._change(lambda: self._place(self._checked(row), packed, _EMPTY))

    def _place(self, row: int, body: PackedBody, others: PolygonSet,
               margin: float = 0.0) -> list[int] | None:
        """
        Replace the body of a row; return which rows of another set are within a margin, ascending.

        None if the row had the same body already.
        """
        packed, count = body
        if self._queries:
            self._forget_index()
        while True:
            other_array, indexed = others._shared or others._snapshot()
            if margin == 0.0:
                outcome, found = write_and_intersect(self._array, row, packed, count,
                                                     other_array, indexed)
            else:
                outcome = write_row(self._array, row, packed, count)
                if outcome == 0:
                    found = near_rows(other_array, indexed, packed, count, margin, NO_ROWS)[-1]
            if outcome == NO_ROOM:
                self._make_room([row], np.array([size_of(body)]))
            elif outcome == UNCHANGED:
                return None
            else:
                return [] if found is None else found.tolist()

    def remove(self, row: int) -> None:
        """Remove the body of a row; the row number may be given to a later body."""
        self._change(lambda: self._remove(self._checked(row)))

    def _remove(self, row: int) -> None:
        """Remove the body of a row, if it has one, and free the row for another."""
        if self._queries:
            self._forget_index()
        self._rows.n[row] = 0
        self._free.append(row)

    def polygon(self, row: int) -> Polygon:
        """Return the body of a row."""
        with self._lock:
            return self._polygon(self._checked(row))

    def _polygon(self, row: int) -> Polygon:
        return Polygon._of_packed(*self._body(row))

    def _body(self, row: int) -> PackedBody:
        """Return the body of a row as it is in the array, until the set changes."""
        return self._rows.packed[self._rows.start[row]:], int(self._rows.n[row])

    def _checked(self, row: int) -> int:
        """Return a row as an int; raise `IndexError` if it has no body."""
        number = integer(row)
        if not 0 <= number < self._used_rows:
            raise IndexError(f'no row {number} in a set of {self._used_rows} rows')
        if not self._rows.n[number]:
            raise IndexError(f'row {number} of a set of {self._used_rows} rows has no body: it '
                             'was removed')
        return number

    def intersecting_rows(self, body: BodyLike) -> NDArray[np.int64]:
        """Return the rows whose bodies share a point with a body, ascending: (k,) int64; exact."""
        packed, count = as_polygon(body).packed
        array, indexed = self._shared or self._snapshot()
        found = intersecting_rows(array, indexed, packed, count)
        return NO_ROWS if found is None else np.asarray(found)

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
        apart = double(margin)
        if not apart >= 0.0:
            raise ValueError(f'margin {margin}, but it has to be a number, 0 or more')
        return rows_within(*self._snapshot(), as_polygon(body), apart)

    def nearest(self, body: BodyLike, skipped: Iterable[int] = ()
                ) -> tuple[int, float, Point, Point] | None:
        """
        Return the row whose body is nearest to a body, or deepest in it.

        Parameters
        ----------
        body : Polygon, (n, 2) array_like or geometry
        skipped : iterable of int, optional
            Rows to leave out; numbers that no row has are ignored.

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
        rows = sorted(row for row in map(integer, skipped) if 0 <= row < 2 ** 63)
        return self._nearest(as_polygon(body).packed, indexable(np.array(rows, np.int64)))

    def _nearest(self, body: PackedBody, skipped: NDArray[np.int64] = NO_ROWS
                 ) -> tuple[int, float, Point, Point] | None:
        """Return the same for a packed body; `skipped` are in ascending order."""
        row, separation, ax, ay, bx, by, _ = near_rows(
            *(self._shared or self._snapshot()), *body, NEAREST, skipped)
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
                   skipped: NDArray[np.int64] = NO_ROWS) -> tuple[int, float] | None:
        """Return the same for a `prediction.Motion`; leave out the rows skipped, ascending."""
        polygon = as_polygon(footprint)
        array, indexed = self._snapshot()
        ways = ways_of(velocities, int(array[USED]), motion[5])
        near = rows_within(array, indexed, polygon, float(motion[-1]))
        if len(near) and len(near := near[~np.isin(near, skipped)]):
            return int(near[0]), 0.0
        packed, count = polygon.packed
        row, time = first_row_met(array, indexed * (velocities is None), packed, count,
                                  indexable(motion), indexable(ways), indexable(skipped))
        return None if row < 0 else (row, time)

    def intersects(self, body: BodyLike) -> NDArray[np.bool_]:
        """Return for each row whether its body shares a point with a body: (m,) bool."""
        array, indexed = self._snapshot()
        answers = np.zeros(int(array[USED]), np.bool_)
        answers[rows_within(array, indexed, as_polygon(body), 0.0)] = True
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
        array, other_array, used = self._paired(other)
        answers = np.empty(used, np.int8)
        decide_rows(array, other_array, answers)
        meet: NDArray[np.bool_] = answers == MEET
        return meet

    def separations(self, other: PolygonSet) -> NDArray[np.float64]:
        """
        Return for each row the `separation` of its body from that row's in another set: (m,), m.

        It is infinite where a row has no body. The errors are those of `intersects_pairs`.
        """
        array, other_array, used = self._paired(other)
        values = np.empty(used)
        measure_rows(array, other_array, indexable(values))
        return values

    def _paired(self, other: PolygonSet) -> tuple[Any, Any, int]:
        """Return the arrays of two sets of as many rows, and how many these are."""
        if not isinstance(other, PolygonSet):
            raise TypeError(f'a {type(other).__name__}, but rows are paired with those of a '
                            'PolygonSet: make one of the bodies')
        array, other_array = self._snapshot()[0], other._snapshot()[0]
        used, other_used = int(array[USED]), int(other_array[USED])
        if used != other_used:
            raise ValueError(f'{used} rows cannot be paired with {other_used}; '
                             'removed rows count, too')
        return array, other_array, used

    def _make_room(self, rows: list[int], sizes: NDArray[np.int64]) -> None:
        """Reserve space for bodies of some rows, after all others; free rows may lose theirs."""
        table, size = self._rows, int(sizes.sum())
        table.n[rows] = table.space[rows] = 0
        if self._used_doubles + size > len(table.packed):
            live = int(table.space.sum() - table.space[self._free].sum())
            self._rebuild(len(table.n), max(_FEWEST_DOUBLES, 2 * (live + size)))
        self._rows.start[rows] = self._used_doubles + np.cumsum(sizes) - sizes
        self._rows.space[rows] = sizes
        self._used_doubles += size

    def _rebuild(self, room: int, doubles: int) -> None:
        """Move everything to an array with other room, without gaps between bodies."""
        old = self._rows
        rows = np.setdiff1d(np.flatnonzero(old.space), self._free)
        sizes = old.space[rows]
        self._use(new_array(room, doubles))
        for name in ('min_x', 'min_y', 'max_x', 'max_y', 'n', 'space'):
            getattr(self._rows, name)[rows] = getattr(old, name)[rows]
        self._rows.start[rows] = np.cumsum(sizes) - sizes
        self._used_doubles = int(sizes.sum())
        self._rows.packed[:self._used_doubles] = slices_of(old.packed, old.start[rows], sizes)


def _body_of_row(row: int, body: BodyLike, limit: int = MAX_VERTICES) -> Polygon:
    """Return a body as a Polygon; an error begins with the row."""
    try:
        return body if isinstance(body, Polygon) else Polygon(body, limit)
    except PolygonError as error:
        raise PolygonError(error.reason, f'body {row}: {error}') from error


def _restored(kind: type[PolygonSet], free: list[int], used: int, rows: NDArray[np.int64],
              vertices: NDArray[np.float64], ends: NDArray[np.int64]) -> PolygonSet:
    bodies = kind()
    bodies._fill(used, rows, vertices, ends, int(np.diff(ends).max(initial=1)))
    bodies._free = free
    return bodies


def rows_within(array: Any, indexed: int, body: Polygon, margin: float) -> NDArray[np.int64]:
    """Return the rows of a set that are no further than a margin from a body."""
    packed, count = body.packed
    found = (intersecting_rows(array, indexed, packed, count) if margin == 0.0
             else near_rows(array, indexed, packed, count, margin, NO_ROWS)[-1])
    return NO_ROWS if found is None else np.asarray(found)


_EMPTY = PolygonSet()
_REFERENCES = getrefcount(_EMPTY._array)

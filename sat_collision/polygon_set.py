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

import numpy as np

from sat_collision import proximity
from sat_collision.exact import bodies_meet, quick_verdict
from sat_collision.improved import MEET, SEPARATE
from sat_collision.jit import COMPILED, indexable, kernel, unowned
from sat_collision.pairwise import pairwise
from sat_collision.polygon import Polygon
from sat_collision.record import BOUNDS, record_size

_FEWEST_ROWS = 16
_FEWEST_DOUBLES = 1024
_NO_ROWS = np.empty(0, np.int64)
_NOWHERE = np.array([np.inf, np.inf, -np.inf, -np.inf])


class PolygonSet:
    """
    A set of bodies by row number, that can grow, shrink and be replaced in place.

    The blocks of all bodies (see `exact.bodies_meet`) lie in one array, their bounds in
    another. The space of a removed or outgrown block is reused when a block fits it, or won back
    when the array is next repacked, which keeps it below four times what the bodies need.

    Parameters
    ----------
    polygons : iterable of Polygon, optional
        Bodies of rows 0, 1, 2, ...

    Attributes
    ----------
    bounds : (4, r) array of float64
        For the kernels: bounds of each row; which rows have a body, `rows` says.
    rows : (3, r) array of int64
        Where the block of each row starts, the block's count (0: no body), and its space.
    blocks : flat array of float64
        The blocks.
    used_rows : int
        How many rows are, or were, in use.

    """

    def __init__(self, polygons=()):
        self.bounds = np.empty((4, _FEWEST_ROWS))
        self.rows = np.empty((3, _FEWEST_ROWS), np.int64)
        self.blocks = np.empty(_FEWEST_DOUBLES)
        self.used_rows = 0
        self._used_data = 0
        self._free = []
        for polygon in polygons:
            self.append(polygon)

    def __len__(self):
        """Return the number of rows with a body."""
        return self.used_rows - len(self._free)

    @property
    def nbytes(self):
        """Bytes of memory held by the arrays."""
        return self.bounds.nbytes + self.rows.nbytes + self.blocks.nbytes

    def append(self, polygon):
        """Add a body and return its row: the one freed last, if any."""
        if self._free:
            row = self._free.pop()
        else:
            row = self.used_rows
            if row == self.bounds.shape[1]:
                self.bounds = np.concatenate([self.bounds, np.empty_like(self.bounds)], axis=1)
                self.rows = np.concatenate([self.rows, np.empty_like(self.rows)], axis=1)
            self.used_rows += 1
            self.rows[:, row] = 0
        self.replace(row, polygon)
        return row

    def replace(self, row, polygon):
        """Put another body in place of that of a row."""
        block, count = polygon.block
        if not put(self.bounds, self.rows, self.blocks, row, block, count):
            self._make_room(row, len(block))
            put(self.bounds, self.rows, self.blocks, row, block, count)

    def remove(self, row):
        """Take the body of a row out; the row number may be given to a later body."""
        self.rows[1, row] = 0
        self.bounds[:, row] = _NOWHERE
        self._free.append(row)

    def holds(self, row, polygon):
        """Tell whether the body of a row is a polygon, in the very same vertices."""
        block, count = polygon.block
        return _holds(indexable(self.rows), indexable(self.blocks), row, indexable(block), count)

    def convex_polygon(self, row):
        """Return the body of a row, which is convex, as a Polygon."""
        start, count, _ = self.rows[:, row].tolist()
        return Polygon.of_record(self.blocks[start:start + record_size(count)].copy(), count)

    def _make_room(self, row, size):
        """Give a row space for a block, at the end of what is used."""
        self.rows[1, row] = 0
        if self._used_data + size > len(self.blocks):
            self._repack(size)
        self.rows[0, row] = self._used_data
        self.rows[2, row] = size
        self._used_data += size

    def _repack(self, needed):
        """Move the blocks in use to the front of a new array with room for as much again."""
        rows = np.flatnonzero(self.rows[1, :self.used_rows])
        live = int(self.rows[2, rows].sum())
        data = np.empty(max(_FEWEST_DOUBLES, 2 * (live + needed)))
        end = 0
        for row in rows:
            start, _, size = self.rows[:, row]
            data[end:end + size] = self.blocks[start:start + size]
            self.rows[0, row] = end
            end += size
        self.rows[2, self.rows[1] == 0] = 0
        self.blocks = data
        self._used_data = end

    def hits(self, polygon):
        """
        Return the rows whose bodies share a point with a polygon, in ascending order; exact.

        Returns
        -------
        (k,) ndarray of int64

        """
        block, count = polygon.block
        rows = np.empty(self.used_rows, np.int64)
        if COMPILED:
            found = hit_rows(self.bounds, self.rows, self.blocks, self.used_rows, block, count,
                             rows)
            return rows[:found] if found else _NO_ROWS
        bounds = self.bounds[:, :self.used_rows]
        rows = np.flatnonzero((bounds[0] <= block[4]) & (bounds[2] >= block[2])
                              & (bounds[1] <= block[5]) & (bounds[3] >= block[3]))
        data = indexable(self.blocks)
        block = indexable(block)
        starts, counts, _ = self.rows[:, rows].tolist()
        return rows[[bodies_meet(data, start, n, block, 0, count)
                     for start, n in zip(starts, counts)]]

    def within(self, polygon, margin):
        """
        Return the rows whose bodies are no further than margin (m) from a polygon, ascending.

        A margin of 0 means contact and is exact; otherwise the separation, rounded to a few ulp of
        the coordinates, is compared with it.
        """
        if margin == 0.0:
            return self.hits(polygon)
        block, count = polygon.block
        rows = np.empty(self.used_rows, np.int64)
        found = proximity.within(*self._indexable(), self.used_rows, indexable(block), count,
                                 margin, indexable(rows))
        return rows[:found]

    def nearest(self, polygon):
        """
        Return what is nearest to a polygon, or deepest in it; some row must have a body.

        Returns
        -------
        int, float, (x, y), (x, y)
            The row, its separation from the polygon and the points that realise it, one of the
            row's body and one of the polygon, see `distance`.

        """
        block, count = polygon.block
        row, separation, ax, ay, bx, by = proximity.nearest(
            *self._indexable(), self.used_rows, indexable(block), count)
        return row, separation, (ax, ay), (bx, by)

    def _indexable(self):
        return indexable(self.bounds), indexable(self.rows), indexable(self.blocks)

    def intersects(self, polygon):
        """Return for each row whether its body shares a point with a polygon: (m,) bool."""
        answers = np.zeros(self.used_rows, np.bool_)
        answers[self.hits(polygon)] = True
        return answers

    def intersects_pairwise(self, other):
        """Return for each row whether its body meets that of the same row of another set."""
        if self.used_rows != other.used_rows:
            raise ValueError(f'{self.used_rows} bodies cannot be paired with '
                             f'{other.used_rows}')
        answers = np.empty(self.used_rows, np.int8)
        pairwise(indexable(self.rows), indexable(self.blocks), indexable(other.rows),
                 indexable(other.blocks), answers)
        return answers == MEET


@kernel
def put(bounds, rows, data, row, block, count):
    """
    Write a body into its row if the row has the space; return whether it has.

    The arrays are those of a PolygonSet, and block and count those of a Polygon, here and below.
    """
    size = len(block)
    if size > rows[2, row]:
        return False
    start = rows[0, row]
    for k in range(size):
        data[start + k] = block[k]
    rows[1, row] = count
    for k in range(4):
        bounds[k, row] = block[BOUNDS.start + k]
    return True


@kernel
def _holds(rows, blocks, row, block, count):
    start = rows[0, row]
    if rows[1, row] != count or rows[2, row] < len(block):
        return False
    for k in range(len(block)):
        if blocks[start + k] != block[k]:
            return False
    return True


@kernel
def hit_rows(bounds, rows, data, used, block, count, found):
    """Write the rows that a block hits into found, (used,), ascending; return their number."""
    candidates = _candidates(bounds, rows, data, used, block, count, found)
    hits = 0
    for k in range(candidates):
        row = found[k]
        if row < 0:
            row = -1 - row
            if not bodies_meet(data, rows[0, row], rows[1, row], block, 0, count):
                continue
        found[hits] = row
        hits += 1
    return hits


@kernel
def _candidates(bounds, rows, data, used, block, count, found):
    """Write the rows that a block hits, and -1 - row where that has to be decided exactly."""
    bounds = unowned(bounds)
    rows = unowned(rows)
    data = unowned(data)
    block = unowned(block)
    found = unowned(found)
    min_x = block[2]
    min_y = block[3]
    max_x = block[4]
    max_y = block[5]
    near = 0
    for row in range(used):
        # No branch, which a processor could not foresee: what is not near is overwritten.
        found[near] = row
        near += ((bounds[0, row] <= max_x) & (bounds[2, row] >= min_x)
                 & (bounds[1, row] <= max_y) & (bounds[3, row] >= min_y))
    candidates = 0
    for k in range(near):
        row = found[k]
        verdict = quick_verdict(data, rows[0, row], rows[1, row], block, 0, count)
        if verdict != SEPARATE:
            found[candidates] = row if verdict == MEET else -1 - row
            candidates += 1
    return candidates

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
One body against all rows of a set: which it meets, which are within a margin, what is nearest.

The kernels that Python calls take the arrays of a set as a plain tuple, which numba takes three
times faster than a NamedTuple (0.6 us a call to 1.5), and name what is in it first.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.distance import measure
from sat_collision.geometry.intersection import bodies_meet, filtered_verdict
from sat_collision.geometry.jit import borrowed, COMPILED, inlined, kernel
from sat_collision.geometry.layout import body_size, BOUNDS, Packed
from sat_collision.geometry.plane import length
from sat_collision.geometry.separating_axis import MEET, SEPARATE

UNCHANGED = -1
NO_ROOM = -2


class Rows(NamedTuple):
    """
    The arrays of a `PolygonSet`.

    Attributes
    ----------
    bounds : (4, r) array of float64
        Bounds of each row: min x, min y, max x, max y.
    spans : (3, r) array of int64
        Where the packed body of each row starts, its count (0: no body), and its space.
    packed : flat array of float64
        The packed bodies.
    used : int
        How many rows are, or were, in use.

    """

    bounds: NDArray[np.float64]
    spans: NDArray[np.int64]
    packed: NDArray[np.float64]
    used: int


@kernel
def write_row(rows, row, body, count):
    """
    Write a packed body into a row.

    Returns
    -------
    int
        UNCHANGED if the very same body is there already, NO_ROOM if the row has not the space for
        it, else 0.

    """
    rows = Rows(*rows)
    packed = borrowed(rows.packed)
    body = borrowed(body)
    size = body_size(Packed(body, 0, count))
    start = rows.spans[0, row]
    if size > rows.spans[2, row]:
        return NO_ROOM
    same = rows.spans[1, row] == count
    for k in range(size):
        if same and packed[start + k] != body[k]:
            same = False
        packed[start + k] = body[k]
    if same:
        return UNCHANGED
    rows.spans[1, row] = count
    for k in range(4):
        rows.bounds[k, row] = body[BOUNDS.start + k]
    return 0


@kernel
def write_and_intersect(rows, row, body, count, others, found):
    """Write a body as `write_row` does, and find the others it meets: return how many, if put."""
    outcome = write_row(rows, row, body, count)
    return intersecting_rows(others, body, count, found) if outcome == 0 else outcome


@kernel
def write_and_measure(rows, row, body, count, others, margin, found):
    """Do the same as `write_and_intersect` with all rows within a margin."""
    outcome = write_row(rows, row, body, count)
    return rows_within(others, body, count, margin, found) if outcome == 0 else outcome


@kernel
def is_same(rows, row, body, count):
    """Tell whether the body of a row is this one, number by number."""
    rows = Rows(*rows)
    size = body_size(Packed(body, 0, count))
    start = rows.spans[0, row]
    if rows.spans[1, row] != count or rows.spans[2, row] < size:
        return False
    for k in range(size):
        if rows.packed[start + k] != body[k]:
            return False
    return True


@kernel
def intersecting_rows(rows, body, count, found):
    """Write the rows that share a point with a body into found, ascending; return how many."""
    rows = Rows(*rows)
    candidates = _candidates(rows, body, count, found)
    hits = 0
    for k in range(candidates):
        row = found[k]
        if row < 0:
            row = -1 - row
            if not bodies_meet(_body(rows, row), Packed(body, 0, count)):
                continue
        found[hits] = row
        hits += 1
    return hits


@kernel
def _candidates(rows, body, count, found):
    """Write the rows that meet a body, and -1 - row where that has to be decided exactly."""
    spans = borrowed(rows.spans)
    packed = borrowed(rows.packed)
    body = borrowed(body)
    found = borrowed(found)
    near = _near_rows(rows.bounds, rows.used, body, found)
    candidates = 0
    for k in range(near):
        row = found[k]
        verdict = filtered_verdict(Packed(packed, spans[0, row], spans[1, row]),
                                   Packed(body, 0, count))
        if verdict != SEPARATE:
            found[candidates] = row if verdict == MEET else -1 - row
            candidates += 1
    return candidates


if COMPILED:
    @kernel
    def _near_rows(bounds, used, body, found):
        """Write the rows whose bounds overlap a body's into found, ascending; return how many."""
        bounds = borrowed(bounds)
        found = borrowed(found)
        min_x = body[2]
        min_y = body[3]
        max_x = body[4]
        max_y = body[5]
        near = 0
        for row in range(used):
            # No branch, which a processor could not foresee: what is not near is overwritten.
            found[near] = row
            near += ((bounds[0, row] <= max_x) & (bounds[2, row] >= min_x)
                     & (bounds[1, row] <= max_y) & (bounds[3, row] >= min_y))
        return near
else:
    def _near_rows(bounds, used, body, found):
        """Write the rows whose bounds overlap a body's into found, ascending; return how many."""
        bounds = np.asarray(bounds)[:, :used]
        rows = np.flatnonzero((bounds[0] <= body[4]) & (bounds[2] >= body[2])
                              & (bounds[1] <= body[5]) & (bounds[3] >= body[3]))
        np.asarray(found)[:len(rows)] = rows
        return len(rows)


@kernel
def rows_within(rows, body, count, margin, found):
    """Write the rows no further than margin from a body, ascending; return how many there are."""
    rows = Rows(*rows)
    # Boxes are compared with a little more, since their gap is rounded as the separation is.
    reach = margin * (1.0 + 1e-9)
    hits = 0
    for row in range(rows.used):
        if (rows.spans[1, row] != 0 and _box_gap(rows.bounds, row, body) <= reach
                and measure(_body(rows, row), Packed(body, 0, count))[0] <= margin):
            found[hits] = row
            hits += 1
    return hits


@kernel
def nearest_row(rows, body, count, skipped):
    """
    Find what is nearest to a body, or deepest in it, among the rows that are not skipped.

    Returns
    -------
    row : int
        -1 if there is none.
    separation, ax, ay, bx, by : float
        As `distance.measure` has them: points of the row's body, and of the other.

    """
    rows = Rows(*rows)
    # The body with the nearest box goes first, so that its separation spares most others.
    best = -1
    gap = math.inf
    for row in range(rows.used):
        if (rows.spans[1, row] != 0 and _box_gap(rows.bounds, row, body) < gap
                and not _contains(skipped, row)):
            gap = _box_gap(rows.bounds, row, body)
            best = row
    if best < 0:
        return best, gap, 0.0, 0.0, 0.0, 0.0
    first = best
    found = measure(_body(rows, first), Packed(body, 0, count))
    for row in range(rows.used):
        if (row != first and rows.spans[1, row] != 0
                and _box_gap(rows.bounds, row, body) <= max(found[0], 0.0)
                and not _contains(skipped, row)):
            other = measure(_body(rows, row), Packed(body, 0, count))
            if other[0] < found[0]:
                found = other
                best = row
    return best, found[0], found[1], found[2], found[3], found[4]


@inlined
def _body(rows, row):
    return Packed(rows.packed, rows.spans[0, row], rows.spans[1, row])


@kernel
def _contains(numbers, number):
    for k in range(len(numbers)):
        if numbers[k] == number:
            return True
    return False


@kernel
def _box_gap(bounds, row, body):
    """Return the distance between the bounding boxes of a row and a body."""
    return length(max(max(bounds[0, row] - body[4], body[2] - bounds[2, row]), 0.0),
                  max(max(bounds[1, row] - body[5], body[3] - bounds[3, row]), 0.0))

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
Queries of one body on a set: which rows it meets, which are within a margin, which is nearest.

A set is given as its array, see `layout`, and a body as a packed polygon and its count.
"""

import math

import numpy as np
from sat_collision.geometry.arithmetic import require_nearest
from sat_collision.geometry.distance import measure
from sat_collision.geometry.intersection import bodies_meet, filtered_verdict
from sat_collision.geometry.jit import COMPILED, elements, inlined, inner, kernel
from sat_collision.geometry.layout import body_of, body_size, Packed, rows_of
from sat_collision.geometry.separating_axis import MEET, SEPARATE

UNCHANGED = -1
NO_ROOM = -2


@kernel
def write_row(set_array, row, body, count):
    """
    Write a packed body into a row.

    Returned is UNCHANGED if the row has the same body, NO_ROOM if its space is too small, else 0.
    """
    require_nearest(row)
    rows = rows_of(set_array)
    packed = rows.packed
    body = elements(body)
    size = body_size(Packed(body, 0, count))
    start = rows.start[row]
    if size > rows.space[row]:
        return NO_ROOM
    same = rows.n[row] == count
    for k in range(size):
        if same and packed[start + k] != body[k]:
            same = False
        packed[start + k] = body[k]
    if same:
        return UNCHANGED
    rows.n[row] = count
    rows.min_x[row] = body[2]
    rows.min_y[row] = body[3]
    rows.max_x[row] = body[4]
    rows.max_y[row] = body[5]
    return 0


@kernel
def write_and_intersect(set_array, row, body, count, others):
    """Write a body as `write_row` does; if that returns 0, find its `intersecting_rows`."""
    outcome = write_row(set_array, row, body, count)
    return intersecting_rows(others, body, count) if outcome == 0 else outcome


@kernel
def intersecting_rows(set_array, body, count):
    """Write the rows that share a point with a body into found, ascending; return how many."""
    require_nearest(count)
    rows = rows_of(set_array)
    body = elements(body)
    found = rows.found
    candidates = _candidates(rows, body, count)
    hits = 0
    for k in range(candidates):
        row = found[k]
        if row < 0:
            row = -1 - row
            if not bodies_meet(body_of(rows, row), Packed(body, 0, count)):
                continue
        found[hits] = row
        hits += 1
    return hits


@inner
def _candidates(rows, body, count):
    """Write the rows that meet a body, and -1 - row if that is still to be decided exactly."""
    found = rows.found
    near = _near_rows(rows, body)
    candidates = 0
    for k in range(near):
        row = found[k]
        verdict = filtered_verdict(body_of(rows, row), Packed(body, 0, count))
        if verdict != SEPARATE:
            found[candidates] = row if verdict == MEET else -1 - row
            candidates += 1
    return candidates


if COMPILED:
    @inner
    def _near_rows(rows, body):
        """Write the rows whose bounds overlap a body's into found, ascending; return how many."""
        found = rows.found
        min_x = body[2]
        min_y = body[3]
        max_x = body[4]
        max_y = body[5]
        near = 0
        for row in range(rows.used):
            # Without a branch, which would be mispredicted: rows not near are overwritten.
            found[near] = row
            near += ((rows.min_x[row] <= max_x) & (rows.max_x[row] >= min_x)
                     & (rows.min_y[row] <= max_y) & (rows.max_y[row] >= min_y))
        return near
else:
    def _near_rows(rows, body):
        """Write the rows whose bounds overlap a body's into found, ascending; return how many."""
        min_x, min_y, max_x, max_y = (np.asarray(column)[:rows.used] for column in rows[:4])
        near = np.flatnonzero((min_x <= body[4]) & (max_x >= body[2])
                              & (min_y <= body[5]) & (max_y >= body[3]))
        np.asarray(rows.found)[:len(near)] = near
        return len(near)


@kernel
def rows_within(set_array, body, count, margin):
    """Write the rows no further than margin from a body, ascending; return how many there are."""
    require_nearest(count)
    rows = rows_of(set_array)
    body = elements(body)
    hits = 0
    for row in range(rows.used):
        if (rows.n[row] != 0 and box_gap(rows, row, body) <= margin
                and measure(body_of(rows, row), Packed(body, 0, count))[0] <= margin):
            rows.found[hits] = row
            hits += 1
    return hits


@kernel
def nearest_row(set_array, body, count, skipped):
    """
    Find the row nearest to a body, or deepest in it, among those that are not skipped.

    Returned are the row, -1 if there is none, and `distance.measure` of the row's body and the
    other.
    """
    require_nearest(count)
    rows = rows_of(set_array)
    body = elements(body)
    # The body with the nearest box goes first, so that most others need not be measured.
    best = -1
    gap = math.inf
    for row in range(rows.used):
        # The gap may be infinite, hence the test of `best`.
        if (rows.n[row] != 0 and (best < 0 or box_gap(rows, row, body) < gap)
                and not contains(skipped, row)):
            gap = box_gap(rows, row, body)
            best = row
    if best < 0:
        return best, gap, 0.0, 0.0, 0.0, 0.0
    first = best
    found = measure(body_of(rows, first), Packed(body, 0, count))
    for row in range(rows.used):
        if (row != first and rows.n[row] != 0
                and box_gap(rows, row, body) < found[0]
                and not contains(skipped, row)):
            other = measure(body_of(rows, row), Packed(body, 0, count))
            if other[0] < found[0]:
                found = other
                best = row
    return best, found[0], found[1], found[2], found[3], found[4]


@inlined
def contains(numbers, number):
    """Return whether a number is in an ascending array, by bisection."""
    begin, end = 0, len(numbers)
    while begin < end:
        middle = (begin + end) // 2
        if numbers[middle] < number:
            begin = middle + 1
        else:
            end = middle
    return begin < len(numbers) and numbers[begin] == number


@inlined
def box_gap(rows, row, body):
    """Return the gap of bounds along x or y, < 0 if none: a lower bound of the separation."""
    return max(max(rows.min_x[row] - body[4], body[2] - rows.max_x[row]),
               max(rows.min_y[row] - body[5], body[3] - rows.max_y[row]))

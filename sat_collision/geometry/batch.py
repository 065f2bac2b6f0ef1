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
Pairs by the thousand, from memory that the processor has to be asked for in time.

Most of the time of a pair that is not in the cache goes by waiting for it. So the headers are
asked for some rows ahead. Of polygons with many vertices only the few that the search visits are
worth fetching, and which these are is known one axis at a time: all pairs of a batch go on in
step, and what one reads next comes while the others are at work.
"""

from sat_collision.geometry.intersection import bodies_meet, meet_near
from sat_collision.geometry.jit import (
    borrowed, inlined, kernel, prefetch, scratch, scratch_integers, unchecked_view)
from sat_collision.geometry.layout import (
    HEADER, near_support, SCAN_LIMIT, table_place, table_sector)
from sat_collision.geometry.rows import rows_of
from sat_collision.geometry.separating_axis import (
    boxes_apart, find_separating_axis, first_axis, hill_climb, MEET, MOST_QUERIES, OPEN, refine,
    SEPARATE, UNCERTAIN)

_CACHE_LINE = 8
_AHEAD = 16
_BATCH = 128
# The doubles that a pair keeps between two axes: ax, ay, bx, by, ux, uy, reach_x, reach_y.
_STATE = 8


@kernel
def decide_rows(set_array, other_array, answers):
    """
    Decide for each row whether its body in one set meets that of the same row in the other; exact.

    Parameters
    ----------
    set_array, other_array : flat arrays of float64
        The arrays of both sets, see `rows`.
    answers : (r,) array of int8
        Receives MEET or SEPARATE.

    """
    rows = rows_of(borrowed(set_array))
    other_rows = rows_of(borrowed(other_array))
    data = unchecked_view(rows.packed)
    other_data = unchecked_view(other_rows.packed)
    state = scratch(_STATE * _BATCH)
    places = scratch_integers(2 * _BATCH)
    pending = scratch_integers(_BATCH)
    # Batch by batch, so that what has to be decided exactly is still in the cache.
    for start in range(0, len(answers), _BATCH):
        count = _begin(rows, data, other_rows, other_data, start, answers, state, pending, places)
        _go_on(rows, data, other_rows, other_data, start, answers, state, pending, count, places)
        for row in range(start, min(start + _BATCH, len(answers))):
            if answers[row] == UNCERTAIN or answers[row] == OPEN:
                answers[row] = MEET if _meet(
                    data, rows.start[row], rows.count[row],
                    other_data, other_rows.start[row], other_rows.count[row],
                    places[2 * (row - start)], places[2 * (row - start) + 1]) else SEPARATE


@inlined
def _meet(p, p_start, n, q, q_start, m, i, j):
    """Tell exactly whether two bodies meet; a search of convex ones ended at i and j."""
    if n > 0 and m > 0:
        return meet_near(p, p_start, n, q, q_start, m, i, j)
    return bodies_meet(p, p_start, n, q, q_start, m)


@kernel
def _begin(rows, data, other_rows, other_data, start, verdicts, state, pending, places):
    """Decide pairs with few vertices, begin with the others; list and count those still open."""
    data = unchecked_view(data)
    other_data = unchecked_view(other_data)
    used = len(verdicts)
    verdicts = unchecked_view(verdicts)
    state = unchecked_view(state)
    pending = unchecked_view(pending)
    places = unchecked_view(places)
    count = 0
    for row in range(start, min(start + _BATCH, used)):
        ahead = row + _AHEAD
        if ahead < used:
            _prefetch(data, rows.start[ahead], rows.count[ahead])
            _prefetch(other_data, other_rows.start[ahead], other_rows.count[ahead])
        p = rows.start[row]
        n = rows.count[row]
        q = other_rows.start[row]
        m = other_rows.count[row]
        slot = row - start
        if n == 0 or m == 0 or boxes_apart(data, p, other_data, q):
            verdicts[row] = SEPARATE
        elif n < 0 or m < 0:
            verdicts[row] = UNCERTAIN
        elif n <= SCAN_LIMIT or m <= SCAN_LIMIT:
            verdict, i, j, _ = find_separating_axis(data, p, n, other_data, q, m)
            verdicts[row] = verdict
            places[2 * slot] = i
            places[2 * slot + 1] = j
        else:
            verdict, ux, uy, reach_x, reach_y = first_axis(data, p, other_data, q)
            verdicts[row] = verdict
            if verdict == OPEN:
                s = _STATE * slot
                state[s] = state[s + 2] = state[s + 4] = ux
                state[s + 1] = state[s + 3] = state[s + 5] = uy
                state[s + 6] = reach_x
                state[s + 7] = reach_y
                pending[count] = row
                count += 1
    return count


@kernel
def _go_on(rows, data, other_rows, other_data, start, verdicts, state, pending, count, places):
    """Search on as `improved.search` does, all pending pairs one axis further in each round."""
    data = unchecked_view(data)
    other_data = unchecked_view(other_data)
    verdicts = unchecked_view(verdicts)
    state = unchecked_view(state)
    pending = unchecked_view(pending)
    places = unchecked_view(places)
    queries = 0
    while count > 0 and queries < MOST_QUERIES:
        queries += 1
        for k in range(count):
            row = pending[k]
            slot = row - start
            ux = state[_STATE * slot + 4]
            uy = state[_STATE * slot + 5]
            i = table_sector(rows.count[row], ux, uy)
            j = table_sector(other_rows.count[row], -ux, -uy)
            prefetch(data, table_place(rows.start[row], i))
            prefetch(other_data, table_place(other_rows.start[row], j))
            places[2 * slot] = i
            places[2 * slot + 1] = j
        for k in range(count):
            row = pending[k]
            slot = row - start
            i = near_support(data, rows.start[row], rows.count[row], places[2 * slot])
            j = near_support(other_data, other_rows.start[row], other_rows.count[row],
                             places[2 * slot + 1])
            _prefetch_neighbours(data, i)
            _prefetch_neighbours(other_data, j)
            places[2 * slot] = i
            places[2 * slot + 1] = j
        left = 0
        for k in range(count):
            row = pending[k]
            slot = row - start
            s = _STATE * slot
            ux = state[s + 4]
            uy = state[s + 5]
            i = hill_climb(data, rows.start[row], rows.count[row], places[2 * slot], ux, uy)
            j = hill_climb(other_data, other_rows.start[row], other_rows.count[row], places[2 * slot + 1],
                      -ux, -uy)
            verdict, ax, ay, bx, by, ux, uy = refine(
                data, i, other_data, j, state[s], state[s + 1], state[s + 2], state[s + 3],
                ux, uy, state[s + 6], state[s + 7])
            verdicts[row] = verdict
            places[2 * slot] = i
            places[2 * slot + 1] = j
            if verdict == OPEN:
                state[s] = ax
                state[s + 1] = ay
                state[s + 2] = bx
                state[s + 3] = by
                state[s + 4] = ux
                state[s + 5] = uy
                pending[left] = row
                left += 1
        count = left


@inlined
def _prefetch(packed, start, count):
    """Fetch a header, and the vertices where they are few."""
    end = HEADER + 2 * count if count <= SCAN_LIMIT else HEADER
    for k in range(0, end, _CACHE_LINE):
        prefetch(packed, start + k)
    prefetch(packed, start + end - 1)


@inlined
def _prefetch_neighbours(packed, i):
    """Fetch a vertex and those before and after it."""
    prefetch(packed, i - 2)
    prefetch(packed, i + 3)

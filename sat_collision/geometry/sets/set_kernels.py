# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Kernels on sets: which rows meet a body, or are near it, and queries on the paired rows of two.

A set is given as its array, see `layout`, and a body as a packed polygon and its count.

A pair of rows that is not in the cache mostly waits for memory, so headers are prefetched some
rows ahead. Of a polygon with many vertices only the few that the search visits are worth fetching,
and these become known one axis at a time. So all pairs of a batch advance in lockstep: the
vertices that one pair reads next are fetched while the others are computed.
"""

import math
from typing import Any, NamedTuple

from sat_collision.geometry.body.box_index import nearest_box, rows_near
from sat_collision.geometry.body.layout import (
    body_of, body_size, bounds_in, box_gap, HEADER, near_support, Packed, packed_polygon, Rows,
    rows_of, SCAN_LIMIT, table_place, table_sector)
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import (
    elements, inlined, inner, kernel, prefetch, scratch, scratch_integers)
from sat_collision.geometry.numeric.ascending import contains
from sat_collision.geometry.numeric.vectors import grown
from sat_collision.geometry.pair.distance import measure
from sat_collision.geometry.pair.intersection import bodies_meet, filtered_verdict, meet_near
from sat_collision.geometry.pair.separating_axis import (
    boxes_apart, find_separating_axis, first_axis, hill_climb, MAX_QUERIES, MEET, OPEN, refine,
    Search, SEPARATE, UNCERTAIN)

UNCHANGED = -1
NO_ROOM = -2
# In place of a margin, see `near_rows`.
NEAREST = -1.0

_CACHE_LINE = 8
_AHEAD = 16
_BATCH = 128
# Doubles that a pair keeps between two axes: the fields of a Search.
_STATE = 8


class Pairs(NamedTuple):
    """Two sets paired row by row, and the state of each pair."""

    rows: Rows
    others: Rows
    verdicts: Any  # per row: SEPARATE, MEET, UNCERTAIN, or OPEN
    searches: Any  # per batch
    places: Any  # per batch, two indices of a pair: of sectors or of support vertices
    pending: Any  # per batch: the open rows


@kernel
def write_row(set_array, row, body, count):
    """Write a packed body into a row; return 0, UNCHANGED if it was there, or NO_ROOM."""
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
    rows.min_x[row], rows.min_y[row] = body[2], body[3]
    rows.max_x[row], rows.max_y[row] = body[4], body[5]
    return 0


@kernel
def hide_rows(set_array, hidden):
    """Empty rows, which are given by number; -1 stands for none."""
    rows = rows_of(set_array)
    for k in range(len(hidden)):
        if hidden[k] >= 0:
            rows.n[hidden[k]] = 0


@kernel
def write_and_intersect(set_array, row, body, count, others, indexed):
    """Write a body as `write_row` does; if that returns 0, add its `intersecting_rows`."""
    outcome = write_row(set_array, row, body, count)
    if outcome != 0:
        return outcome, None
    return outcome, intersecting_rows(others, indexed, body, count)


@kernel
def intersecting_rows(set_array, indexed, body, count):
    """Return the rows that share a point with a body, ascending; None if there is none."""
    require_nearest(count)
    rows = rows_of(set_array)
    body = packed_polygon(body, count)
    found, near = rows_near(rows, indexed, bounds_in(body))
    hits = 0
    for k in range(near):
        row = found[k]
        verdict = filtered_verdict(body_of(rows, row), body)
        if verdict == MEET or (verdict == UNCERTAIN and bodies_meet(body_of(rows, row), body)):
            found[hits] = row
            hits += 1
    return _first(found, hits)


@inner
def _first(numbers, count):
    """Return the first of some integers, None for no integers."""
    if count == 0:
        return None
    first = scratch_integers(count)
    for k in range(count):
        first[k] = numbers[k]
    return first


@kernel
def near_rows(set_array, indexed, body, count, margin, skipped):
    """
    Return the rows no further than a margin from a body, ascending, as the last of seven values.

    If the margin is NEAREST, find instead the row nearest to the body, or deepest in it, of those
    that are not skipped, an ascending array; the first values are the row, -1 if there is none,
    and the separation and closest points x, y, x, y of its body and the other. One kernel does
    both, because `measure` takes a second to compile.
    """
    require_nearest(count)
    rows = rows_of(set_array)
    body = packed_polygon(body, count)
    box = bounds_in(body)
    nearest = -1
    least = margin
    points = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if margin == NEAREST:
        # The body with the nearest box goes first, so that most others need not be measured.
        nearest = nearest_box(rows, indexed, box, skipped)
        if nearest < 0:
            return nearest, 0.0, 0.0, 0.0, 0.0, 0.0, None
        least, points = measure(body_of(rows, nearest), body)
    first = nearest
    found, near = rows_near(rows, indexed, grown(box, least))
    hits = 0
    for k in range(near):
        row = found[k]
        if rows.n[row] == 0:
            continue
        if margin != NEAREST:
            if measure(body_of(rows, row), body)[0] <= margin:
                found[hits] = row
                hits += 1
        elif row != first and box_gap(rows, row, box) < least and not contains(skipped, row):
            value, others = measure(body_of(rows, row), body)
            if value < least:
                nearest, least, points = row, value, others
    if margin != NEAREST:
        return -1, 0.0, 0.0, 0.0, 0.0, 0.0, _first(found, hits)
    return nearest, least, *points[:4], None


@kernel
def decide_rows(set_array, other_array, answers):
    """Write for each row whether its bodies in the two sets MEET or are SEPARATE; exact."""
    require_nearest(len(answers))
    pairs = Pairs(rows_of(set_array), rows_of(other_array), answers,
                  scratch(_STATE * _BATCH), scratch_integers(2 * _BATCH), scratch_integers(_BATCH))
    # Batch by batch, so that pairs left to the exact test are still in the cache.
    for start in range(0, len(answers), _BATCH):
        end = min(start + _BATCH, len(answers))
        count = _begin(pairs, start, end, len(answers))
        _go_on(pairs, start, count)
        for row in range(start, end):
            if answers[row] == UNCERTAIN or answers[row] == OPEN:
                answers[row] = MEET if _meet(pairs, row, row - start) else SEPARATE


@kernel
def measure_rows(set_array, other_array, values):
    """Write for each row the separation of its bodies, infinity where a set has none."""
    require_nearest(len(values))
    rows, others = rows_of(set_array), rows_of(other_array)
    for row in range(len(values)):
        values[row] = math.inf
        if rows.n[row] != 0 and others.n[row] != 0:
            values[row] = measure(body_of(rows, row), body_of(others, row))[0]


@inlined
def _meet(pairs, row, slot):
    """Decide exactly whether bodies meet; the slot has where a search of convex ones ended."""
    p, q = body_of(pairs.rows, row), body_of(pairs.others, row)
    if p.n > 0 and q.n > 0:
        return meet_near(p, q, pairs.places[2 * slot], pairs.places[2 * slot + 1])
    return bodies_meet(p, q)


@inlined
def _unchecked(pairs):
    """Return the same with bare arrays, see `elements`, for use inside a hot loop."""
    return Pairs(pairs.rows, pairs.others, elements(pairs.verdicts), elements(pairs.searches),
                 elements(pairs.places), elements(pairs.pending))


@inner
def _begin(pairs, start, end, used):
    """Decide pairs with few vertices, start on the others; list and count those still open."""
    rows, others, verdicts, searches, places, pending = _unchecked(pairs)
    count = 0
    for row in range(start, end):
        ahead = row + _AHEAD
        if ahead < used:
            _prefetch(body_of(rows, ahead))
            _prefetch(body_of(others, ahead))
        p, q = body_of(rows, row), body_of(others, row)
        slot = row - start
        if p.n == 0 or q.n == 0 or boxes_apart(p, q):
            verdicts[row] = SEPARATE
        elif p.n < 0 or q.n < 0:
            verdicts[row] = UNCERTAIN
        elif p.n <= SCAN_LIMIT or q.n <= SCAN_LIMIT:
            verdicts[row], places[2 * slot], places[2 * slot + 1], _ = find_separating_axis(p, q)
        else:
            verdict, search = first_axis(p, q)
            verdicts[row] = verdict
            if verdict == OPEN:
                _store(searches, slot, search)
                pending[count] = row
                count += 1
    return count


@inner
def _go_on(pairs, start, count):
    """Continue as `find_separating_axis` does, all pending pairs by one axis per round."""
    rows, others, verdicts, searches, places, pending = _unchecked(pairs)
    queries = 0
    while count > 0 and queries < MAX_QUERIES:
        queries += 1
        for k in range(count):
            row = pending[k]
            slot = row - start
            ux, uy = searches[_STATE * slot + 4], searches[_STATE * slot + 5]
            i = table_sector(rows.n[row], ux, uy)
            j = table_sector(others.n[row], -ux, -uy)
            prefetch(rows.packed, table_place(rows.start[row], i))
            prefetch(others.packed, table_place(others.start[row], j))
            places[2 * slot], places[2 * slot + 1] = i, j
        for k in range(count):
            row = pending[k]
            slot = row - start
            i = near_support(body_of(rows, row), places[2 * slot])
            j = near_support(body_of(others, row), places[2 * slot + 1])
            _prefetch_neighbours(rows.packed, i)
            _prefetch_neighbours(others.packed, j)
            places[2 * slot], places[2 * slot + 1] = i, j
        left = 0
        for k in range(count):
            row = pending[k]
            slot = row - start
            search = _load(searches, slot)
            p, q = body_of(rows, row), body_of(others, row)
            i = hill_climb(p, places[2 * slot], search.ux, search.uy)
            j = hill_climb(q, places[2 * slot + 1], -search.ux, -search.uy)
            verdict, search = refine(p.array, i, q.array, j, search)
            verdicts[row] = verdict
            places[2 * slot], places[2 * slot + 1] = i, j
            if verdict == OPEN:
                _store(searches, slot, search)
                pending[left] = row
                left += 1
        count = left


@inlined
def _store(searches, slot, search):
    for k in range(_STATE):
        searches[_STATE * slot + k] = search[k]


@inlined
def _load(searches, slot):
    s = _STATE * slot
    return Search(searches[s], searches[s + 1], searches[s + 2], searches[s + 3],
                  searches[s + 4], searches[s + 5], searches[s + 6], searches[s + 7])


@inlined
def _prefetch(p):
    """Prefetch a header, and the vertices if there are few."""
    end = HEADER + 2 * p.n if p.n <= SCAN_LIMIT else HEADER
    for k in range(0, end, _CACHE_LINE):
        prefetch(p.array, p.start + k)
    prefetch(p.array, p.start + end - 1)


@inlined
def _prefetch_neighbours(packed, i):
    prefetch(packed, i - 2)
    prefetch(packed, i + 3)

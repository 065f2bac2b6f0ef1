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

"""Pairs by the thousand, from memory that the processor has to be asked for in time."""

from sat_collision.exact import bodies_meet, quick_verdict
from sat_collision.improved import boxes_apart, MEET, SEPARATE, UNSURE
from sat_collision.jit import inlined, kernel, prefetch, unowned
from sat_collision.record import HEADER, near_support, SCAN_LIMIT, table_size

_CACHE_LINE = 8
_FAR_AHEAD = 16
_NEAR_AHEAD = 8
_FETCHED_WHOLE = 64
_BATCH = 64


@kernel
def pairwise(rows, data, other_rows, other_data, answers):
    """
    Decide for each row whether its body in one set meets that of the same row in the other; exact.

    Parameters
    ----------
    rows, other_rows : (3, r) array of int64
        Where the block of each row starts, its count (0: no body), and its space.
    data, other_data : flat arrays of float64
        The blocks, see `exact.bodies_meet`.
    answers : (r,) array of int8
        Receives MEET or SEPARATE.

    """
    rows = unowned(rows)
    data = unowned(data)
    other_rows = unowned(other_rows)
    other_data = unowned(other_data)
    # Batch by batch, so that what has to be decided exactly is still in the cache.
    for start in range(0, len(answers), _BATCH):
        end = min(start + _BATCH, len(answers))
        _quick_verdicts(rows, data, other_rows, other_data, start, end, answers)
        for row in range(start, end):
            if answers[row] == UNSURE:
                answers[row] = MEET if bodies_meet(
                    data, rows[0, row], rows[1, row],
                    other_data, other_rows[0, row], other_rows[1, row]) else SEPARATE


@kernel
def _quick_verdicts(rows, data, other_rows, other_data, start, end, verdicts):
    rows = unowned(rows)
    data = unowned(data)
    other_rows = unowned(other_rows)
    other_data = unowned(other_data)
    verdicts = unowned(verdicts)
    used = len(verdicts)
    for row in range(start, end):
        # Most of the time of a pair that is not in the cache goes by waiting for it.
        far = row + _FAR_AHEAD
        if far < used:
            _prefetch(data, rows[0, far], 0, HEADER + 2 * min(rows[1, far], SCAN_LIMIT))
            _prefetch(other_data, other_rows[0, far], 0,
                      HEADER + 2 * min(other_rows[1, far], SCAN_LIMIT))
        near = row + _NEAR_AHEAD
        if near < used:
            _prefetch_vertices(data, rows[0, near], rows[1, near],
                               other_data, other_rows[0, near], other_rows[1, near])
        verdicts[row] = quick_verdict(data, rows[0, row], rows[1, row],
                                      other_data, other_rows[0, row], other_rows[1, row])


@inlined
def _prefetch(block, start, first, end):
    for k in range(first, end, _CACHE_LINE):
        prefetch(block, start + k)


@inlined
def _prefetch_vertices(p, p_start, n, q, q_start, m):
    """Fetch what the search will read: of many vertices those where it will begin to climb."""
    if n <= SCAN_LIMIT or m <= SCAN_LIMIT or boxes_apart(p, p_start, q, q_start):
        return
    first = HEADER + 2 * SCAN_LIMIT
    if n <= _FETCHED_WHOLE and m <= _FETCHED_WHOLE:
        _prefetch(p, p_start, first, HEADER + table_size(n) + 2 * n)
        _prefetch(q, q_start, first, HEADER + table_size(m) + 2 * m)
    else:
        ux = q[q_start] - p[p_start]
        uy = q[q_start + 1] - p[p_start + 1]
        i = near_support(p, p_start, n, ux, uy)
        j = near_support(q, q_start, m, -ux, -uy)
        _prefetch(p, p_start, i - 2, i + _CACHE_LINE)
        _prefetch(q, q_start, j - 2, j + _CACHE_LINE)

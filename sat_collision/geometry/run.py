# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Writing a run of messages, which differ only in their points, into a set in one call."""

from typing import Any, TypeAlias

from sat_collision.geometry.floating_point import require_nearest
from sat_collision.geometry.jit import inner, kernel, words_and_floats
from sat_collision.geometry.layout import rows_of
from sat_collision.geometry.packing import clean, CONVEX, moved, pack
from sat_collision.geometry.scan import box_gap, NO_ROOM, write_row

# Messages that differ only in their points: their bytes, joined; the end of each but the last, an
# array of int64; the number of the first message to write; the offset in a message of the number
# of its points, which follow it, x, y and z of each as float32 in this machine's byte order; the
# affine map of the points; the most vertices accepted; an array with room for one packed polygon.
# A plain tuple is passed to a kernel half a microsecond faster than a named one.
Run: TypeAlias = tuple[bytes, Any, int, int, tuple[float, float, float, float, float, float],
                       int, Any]

_WORD = 4
_POINT = 3


@kernel
def write_run(run, set_array, rows, row, limit, others, margin):
    """
    Write the polygons of a run into rows, as long as each is ordinary and not near another body.

    A message is ordinary if its bytes before the number of points are those of the first one, and
    its points make a convex polygon for which its row has room.

    Parameters
    ----------
    run : Run
    set_array, others : flat array of float64
        The set, and the one that the polygons must not be near to. If the first is empty the
        messages are only checked, and rows do not matter.
    rows : array of int64
        The row of each polygon, -1 for none.
    row, limit : int
        The index in rows for the first message to write, and how many messages may be written.
    margin : float
        Bounds no further apart than this are near, metres.

    Returns
    -------
    int
        How many were written: all before the first that is not ordinary, has no row, or is near.

    """
    data, ends, first, count_at, affine, max_vertices, packed = run
    require_nearest(count_at)
    words, values = words_and_floats(data)
    near = rows_of(others)
    header = count_at // _WORD
    begin = ends[first - 1] if first else 0
    model = begin // _WORD
    is_placed = len(set_array) > 0
    count = min(limit, len(ends) + 1 - first)
    if is_placed:
        count = min(count, len(rows) - row)
    for k in range(count):
        end = ends[first + k] if first + k < len(ends) else len(data)
        size = end - begin - count_at - _WORD
        if begin % _WORD or size <= 0 or size % (_POINT * _WORD) or (
                is_placed and rows[row + k] < 0):
            return k
        start = begin // _WORD
        begin = end
        received = size // (_POINT * _WORD)
        same = words[start + header] == received and received <= max_vertices + 1
        for i in range(header):
            same = same and words[start + i] == words[model + i]
        if not same:
            return k
        points = moved(values, start + header + 1, received, affine)
        if not is_placed:
            verdict, _, _, _ = clean(points, packed, max_vertices, 0)
            if verdict != CONVEX:
                return k
            continue
        verdict, vertices, _, _, _ = pack(points, packed, max_vertices, 0)
        if verdict != CONVEX or _is_near(near, packed, margin) or (
                write_row(set_array, rows[row + k], packed, vertices) == NO_ROOM):
            return k
    return count


@inner
def _is_near(rows, body, margin):
    """Return whether the bounds of a body are within a margin of those of any row."""
    for row in range(rows.used):
        if rows.n[row] != 0 and box_gap(rows, row, body) <= margin:
            return True
    return False

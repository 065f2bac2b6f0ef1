# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Writing a run of polygons into a set in one call.

They are in messages that differ only in their points, or in one message that has them all.
"""

from typing import Any, TypeAlias

from sat_collision.geometry.body.layout import (
    bounds_in, box_gap, HEADER, packed_polygon, packed_size, rows_of, SCAN_LIMIT)
from sat_collision.geometry.body.packing import (
    CONVEX, DOUBLE, move, PAIR, plain_turn, TRIPLE, WORD, write_inner_disc, write_packed)
from sat_collision.geometry.body.polygon import UNMOVED
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import (
    beyond, elements, inlined, inner, kernel, numbers_of)
from sat_collision.geometry.sets.set_kernels import NO_ROOM, write_row

# Messages that differ only in their points: their bytes, joined; the end of each but the last, an
# array of int64; the number of the first message to write; the offset in a message of the number
# of its points, which follow it, x, y and z of each as float32 in this machine's byte order; the
# affine map of the points; the most vertices accepted; and the `workspace` for so many.
# Or the polygons of one message: its bytes, from where their alignment counts; the offset and the
# number of the points of each polygon, x and y of each as float64, a flat array of int64; the
# number of the first polygon; IN_ONE_MESSAGE; and the rest as above.
# A plain tuple is passed to a kernel half a microsecond faster than a named one.
Run: TypeAlias = tuple[bytes, Any, int, int, tuple[float, float, float, float, float, float],
                       int, Any]

IN_ONE_MESSAGE = -1
# In place of a margin: there are no other bodies.
ALONE = -1.0


@kernel
def write_run(run, set_array, rows, row, limit, others, margin):
    """
    Write the polygons of a run into rows, as long as each is ordinary and not near another body.

    A polygon is ordinary if it is convex and its row has room for it; in a message of its own, if
    the bytes before the number of its points are those of the first one, too. It is near if its
    bounds are no further than the margin from those of a body in the set `others`.

    `rows` has the row of each polygon, -1 for none, from the index `row` on. Returned is how many
    were written, at most the limit: all before the first that is not ordinary, near or without a
    row. Only ALONE each gets a disc inside, which takes time, and is of use where bodies are near.
    """
    data, ends, first, count_at, affine, max_vertices, packed = run
    require_nearest(count_at)
    words, floats, doubles = numbers_of(data)
    table = rows_of(set_array)
    near = rows_of(others)
    in_one = count_at == IN_ONE_MESSAGE
    header = count_at // WORD
    begin = ends[first - 1] if first and not in_one else 0
    model = begin // WORD
    count = len(ends) // 2 - first if in_one else len(ends) + 1 - first
    count = min(count, limit, len(rows) - row)
    room = len(packed) // 4
    if room < packed_size(max_vertices + 1):
        raise ValueError('the workspace of a run is too small')
    packed = elements(packed)
    moved, ring, walk = beyond(packed, room), beyond(packed, 2 * room), beyond(packed, 3 * room)
    few = 0 if margin == ALONE else min(max_vertices, SCAN_LIMIT)
    as_received = in_one and affine == UNMOVED
    for k in range(count):
        if rows[row + k] < 0:
            return k
        if in_one:
            received = ends[2 * (first + k) + 1]
            same = 0 < received <= max_vertices + 1
            start = ends[2 * (first + k)] // DOUBLE
        else:
            end = ends[first + k] if first + k < len(ends) else len(data)
            size = end - begin - count_at - WORD
            if begin % WORD or size <= 0 or size % (TRIPLE * WORD):
                return k
            at = begin // WORD
            begin = end
            received = size // (TRIPLE * WORD)
            same = words[at + header] == received and received <= max_vertices + 1
            for i in range(header):
                same = same and words[at + i] == words[model + i]
            start = at + header + 1
        if not same:
            return k
        points = beyond(doubles, start) if as_received else moved
        if not in_one:
            move(floats, start, TRIPLE, received, affine, moved)
        elif not as_received:
            move(doubles, start, PAIR, received, affine, moved)
        if received <= few and _write_plain(points, received, table, rows[row + k], near, margin):
            continue
        verdict, vertices, _, _, _ = write_packed(points, received, ring, walk, packed,
                                                  max_vertices, 0)
        if margin == ALONE and verdict == CONVEX:
            write_inner_disc(ring, vertices, packed)
        if verdict != CONVEX or (
                _is_near(near, bounds_in(packed_polygon(packed, vertices)), margin)) or (
                write_row(set_array, rows[row + k], packed, vertices) == NO_ROOM):
            return k
    return count


@kernel
def find_polygons(data, at, spans):
    """
    Find the polygons of a message that has them all, given its bytes from where alignment counts.

    The number of points of the first one is at an offset that is a multiple of 4. The offset and
    the number of the points of each are written into spans. Returned is where the last one ends,
    or -1 - k if polygon k would end beyond the message.
    """
    words, _, _ = numbers_of(data)
    size = len(data)
    for k in range(len(spans) // 2):
        if at + WORD > size:
            return -1 - k
        count = int(words[at // WORD])
        at += WORD
        if count > 0:
            at = (at + DOUBLE - 1) // DOUBLE * DOUBLE
        if at + count * PAIR * DOUBLE > size:
            return -1 - k
        spans[2 * k] = at
        spans[2 * k + 1] = count
        at += count * PAIR * DOUBLE
    return at


@inlined
def _write_plain(points, received, rows, row, near, margin):
    """
    Write a polygon of few vertices into a row as `write_run` does, if `plain_turn` tells enough.

    Return whether it is written; if not, the row is as before.
    """
    turn, least, box = plain_turn(points, received)
    if turn == 0 or packed_size(received) > rows.space[row] or _is_near(near, box, margin):
        return False
    body = beyond(rows.packed, rows.start[row])
    ring = beyond(body, HEADER)
    for k in range(received):
        i = least + turn * k
        i = i - received if i >= received else i + received if i < 0 else i
        # Adding zero turns -0.0 into 0.0.
        ring[2 * k] = points[2 * i] + 0.0
        ring[2 * k + 1] = points[2 * i + 1] + 0.0
    body[0], body[1], body[6] = ring[0], ring[1], 0.0
    body[2], body[3], body[4], body[5] = box
    rows.n[row] = received
    rows.min_x[row], rows.min_y[row], rows.max_x[row], rows.max_y[row] = box
    return True


@inner
def _is_near(rows, box, margin):
    """Return whether bounds are within a margin of those of any row."""
    for row in range(rows.used):
        if rows.n[row] != 0 and box_gap(rows, row, box) <= margin:
            return True
    return False

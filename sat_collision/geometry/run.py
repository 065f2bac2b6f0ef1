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

"""A run of messages, which differ in nothing but their points, written into a set in one call."""

from typing import Any, NamedTuple

from sat_collision.geometry.arithmetic import require_nearest
from sat_collision.geometry.jit import borrowed, inner, kernel, scratch, words_and_floats
from sat_collision.geometry.packing import pack
from sat_collision.geometry.ring import CONVEX
from sat_collision.geometry.rows import rows_of
from sat_collision.geometry.scan import box_gap, NO_ROOM, write_row

_WORD = 4
_POINT = 3


class Run(NamedTuple):
    """
    Messages, one behind the other, and where their polygons are.

    Attributes
    ----------
    data : bytes
    ends : (m,) array of int64
        Where in the data each message ends.
    first : int
        The message that all others are to be like.
    begin : int
        The first message to write.
    count_at : int
        Where in a message the number of its points stands, behind which are the points: x, y and
        z of each as float32 in this machine's byte order.
    most : int
        The most vertices accepted.
    plane : PlaneMap
        Where the points are moved.
    packed : flat array of float64
        Room for one polygon, see `layout`.

    """

    data: bytes
    ends: Any
    first: int
    begin: int
    count_at: int
    most: int
    plane: tuple[float, float, float, float, float, float]
    packed: Any


@kernel
def write_run(run, set_array, rows, others, margin):
    """
    Write the polygons of a run into rows, as long as each is ordinary and near nothing.

    Ordinary is a message whose bytes before the number of points are those of the first one, and
    whose points make a convex polygon for which its row has room.

    Parameters
    ----------
    run : Run
    set_array : flat array of float64
        The set.
    rows : array of int64
        The rows of the messages to write; no more are written.
    others : flat array of float64
        The set that the polygons must not be near to.
    margin : float
        Metres up to which bounds apart are near.

    Returns
    -------
    int
        How many were written: all before the first that is not ordinary, or is near something.

    """
    require_nearest(run.count_at)
    words, values = words_and_floats(run.data)
    near = rows_of(borrowed(others))
    a, b, c, d, e, f = run.plane
    header = run.count_at // _WORD
    model = run.ends[run.first - 1] // _WORD if run.first else 0
    last = min(run.begin + len(rows), len(run.ends))
    for k in range(run.begin, last):
        begin = run.ends[k - 1]
        size = run.ends[k] - begin - run.count_at - _WORD
        if begin % _WORD or size <= 0 or size % (_POINT * _WORD):
            return k - run.begin
        begin //= _WORD
        received = size // (_POINT * _WORD)
        same = words[begin + header] == received and received <= run.most + 1
        for i in range(header):
            same = same and words[begin + i] == words[model + i]
        if not same:
            return k - run.begin
        points = scratch(2 * received)
        start = begin + header + 1
        for i in range(received):
            x = values[start + _POINT * i]
            y = values[start + _POINT * i + 1]
            points[2 * i] = a * x + b * y + c
            points[2 * i + 1] = d * x + e * y + f
        verdict, count, _, _, _ = pack(points, run.packed, run.most, 0)
        if verdict != CONVEX or _is_near(near, run.packed, margin) or (
                write_row(set_array, rows[k - run.begin], run.packed, count) == NO_ROOM):
            return k - run.begin
    return last - run.begin


@inner
def _is_near(rows, body, margin):
    """Tell whether the bounds of a body are within a margin of those of any row."""
    for row in range(rows.used):
        if rows.n[row] != 0 and box_gap(rows, row, body) <= margin:
            return True
    return False

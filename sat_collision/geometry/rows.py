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
Memory layout of a set of bodies, row by row.

A set is one flat array, because each array that Python passes to a kernel costs 70 ns, a good part
of the time of a message. It begins with the number of rows that there is room for and that are, or
were, in use. Then follow the table of rows, column by column, and the packed bodies.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.jit import beyond, elements, inlined, integers
from sat_collision.geometry.layout import Packed

_COLUMNS = 8
_HEAD = 2


class Rows(NamedTuple):
    """
    The parts of the array of a set: its columns, and the packed bodies.

    Attributes
    ----------
    min_x, min_y, max_x, max_y : (r,) array of float64
        Bounds.
    start, n, space : (r,) array of int64
        Where the packed body starts, its count (0: no body), and how many doubles it may take.
    found : (r,) array of int64
        Room for the rows that a scan finds.
    packed : flat array of float64
        The packed bodies.
    used : int
        How many rows are, or were, in use.

    """

    min_x: NDArray[np.float64]
    min_y: NDArray[np.float64]
    max_x: NDArray[np.float64]
    max_y: NDArray[np.float64]
    start: NDArray[np.int64]
    n: NDArray[np.int64]
    space: NDArray[np.int64]
    found: NDArray[np.int64]
    packed: NDArray[np.float64]
    used: int


@inlined
def rows_of(array):
    """Name the parts of the array of a set."""
    numbers = elements(array)
    whole = integers(numbers)
    room = int(numbers[0])
    a = _HEAD
    b = a + room
    c = b + room
    d = c + room
    e = d + room
    f = e + room
    g = f + room
    h = g + room
    return Rows(beyond(numbers, a), beyond(numbers, b), beyond(numbers, c), beyond(numbers, d),
                beyond(whole, e), beyond(whole, f), beyond(whole, g), beyond(whole, h),
                beyond(numbers, h + room), int(numbers[1]))


@inlined
def body_of(rows, row):
    """Return the packed body of a row."""
    return Packed(rows.packed, rows.start[row], rows.n[row])


def new_array(rows: int, doubles: int) -> NDArray[np.float64]:
    """Return the array of an empty set with room for so many rows, and doubles of bodies."""
    array = np.zeros(_HEAD + _COLUMNS * rows + doubles)
    array[0] = rows
    return array


def views_of(array: NDArray[np.float64]) -> Rows:
    """Return the parts of the array of a set as NumPy has them, for plain Python."""
    room = int(array[0])
    end = _HEAD + _COLUMNS * room
    columns = array[_HEAD:end].reshape(_COLUMNS, room)
    return Rows(*columns[:4], *columns[4:].view(np.int64), array[end:], int(array[1]))


def use_rows(array: NDArray[np.float64], used: int) -> None:
    """Set how many rows are in use."""
    array[1] = used

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Memory layout of packed polygons, and of sets of them: flat arrays of doubles that kernels read.

Every packed polygon begins with a header: two numbers whose meaning depends on the kind; the
bounds (min x, min y, max x, max y); and the radius of a disc inside the polygon, 0 for none.

The count of a *convex* polygon is its number of vertices. Its header begins with the centre of the
disc, a point of the polygon: the centroid if that is certain to lie inside. Then follow, if there
are more than SCAN_LIMIT vertices, a table that maps the direction of an axis to a vertex near its
support vertex; and the vertices x, y, x, y, ...

The count of a *non-convex* polygon is minus the number of its convex parts. Its header begins with
the indices at which its outline begins and ends. Then follow, for each part, the index at which it
starts in the packed polygon and its number of vertices; the packed parts; and, last, the outline.

The table divides directions into sectors, four per double: a double holds four integers of 13 bits
without loss. It only says where a search starts, so its rounding does not affect any result.

A set is one array, because each array that Python passes to a kernel costs 70 ns, a good part of
the time of a message. It begins with the number of rows that there is room for, the number that
are, or were, in use, and the size of an index of them. Then follow the table of rows, column by
column; the room of the index, see `box_index`, which may be built or not; and the packed bodies.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.compiled.jit import beyond, elements, inlined, integers, kernel

HEADER = 7
BOUNDS = slice(2, 6)
SCAN_LIMIT = 16
LARGEST_TABLE = 128
ENTRY_BITS = 13
ENTRY_MASK = (1 << ENTRY_BITS) - 1

# Where the array of a set has how many rows are, or were, in use.
USED = 1
# How many numbers a set has before its columns, and how many columns.
_HEAD = 3
_COLUMNS = 7

# Entries of a node of an index, and how many doubles it takes.
FANOUT = 16
NODE = 5 * FANOUT


class Packed(NamedTuple):
    """A packed polygon, as passed between kernels."""

    array: Any  # flat array of float64, or its `elements`: has the polygon, and maybe others
    start: int  # the index at which it starts
    n: int  # number of vertices if convex, else minus the number of convex parts


@kernel
def table_size(count):
    """Return how many doubles the table of a polygon with count vertices takes."""
    if count <= SCAN_LIMIT:
        return 0
    return 32 if count <= 128 else LARGEST_TABLE


@kernel
def packed_size(count):
    """Return how many doubles a packed convex polygon with count vertices takes."""
    return HEADER + table_size(count) + 2 * count


@inlined
def packed_polygon(array, n):
    """Return the packed polygon that an array begins with, for use inside kernels."""
    return Packed(elements(array), 0, n)


@inlined
def first_vertex(p):
    """Return the index at which the vertices of a convex polygon start."""
    return p.start + HEADER + table_size(p.n)


@inlined
def vertex_after(p, i):
    """Return the index of the vertex of a convex polygon after that at i."""
    first = first_vertex(p)
    return i + 2 if i < first + 2 * p.n - 2 else first


@inlined
def vertex_before(p, i):
    """Return the index of the vertex of a convex polygon before that at i."""
    first = first_vertex(p)
    return i - 2 if i > first else first + 2 * p.n - 2


@inlined
def table_sector(count, ux, uy):
    """Return the sector of an axis in the table of a polygon with count vertices."""
    size = table_size(count)
    length = abs(ux) + abs(uy)
    if not 0.0 < length < math.inf:
        return 0
    # One unit per quadrant, counter-clockwise from -y.
    turn = 1.0 + uy / length if ux >= 0.0 else 3.0 - uy / length
    return min(int(turn * size), 4 * size - 1)


@inlined
def table_place(start, sector):
    """Return the index of the entry of a sector, for a polygon that starts at an index."""
    return start + HEADER + (sector >> 2)


@inlined
def entry_step(count):
    """Return how many vertices a unit of a table entry counts, so that 13 bits suffice."""
    return 1 + (count >> ENTRY_BITS)


@inlined
def near_support(p, sector):
    """Return the index of a vertex near the support vertex for a sector, by the table."""
    entries = int(p.array[table_place(p.start, sector)])
    entry = (entries >> (ENTRY_BITS * (sector & 3))) & ENTRY_MASK
    return first_vertex(p) + 2 * entry * entry_step(p.n)


@kernel
def convex_part(p, i):
    """Return convex part i of a packed polygon, packed too; a convex polygon is its own part."""
    if p.n > 0:
        return p
    entry = p.start + HEADER + 2 * i
    return Packed(p.array, p.start + int(p.array[entry]), int(p.array[entry + 1]))


@kernel
def body_size(p):
    """Return how many doubles a packed polygon takes, convex or not."""
    return packed_size(p.n) if p.n > 0 else int(p.array[p.start + 1])


@inlined
def bounds_in(p):
    """Return the bounds of a packed polygon: min x, min y, max x, max y."""
    return beyond(p.array, p.start + 2)


@inlined
def outline_of(p):
    """Return the outline of a packed polygon as if it were one, of which only vertices count."""
    if p.n > 0:
        return p
    first = p.start + int(p.array[p.start])
    count = (p.start + int(p.array[p.start + 1]) - first) // 2
    return Packed(p.array, first - HEADER - table_size(count), count)


class Rows(NamedTuple):
    """The parts of the array of a set: its columns, and the packed bodies."""

    min_x: NDArray[np.float64]  # (r,): bounds
    min_y: NDArray[np.float64]
    max_x: NDArray[np.float64]
    max_y: NDArray[np.float64]
    start: NDArray[np.int64]  # (r,): the index at which the packed body starts
    n: NDArray[np.int64]  # (r,): its count, 0 for no body
    space: NDArray[np.int64]  # (r,): how many doubles are reserved for it
    nodes: NDArray[np.float64]  # flat: the index, if it is built
    packed: NDArray[np.float64]  # flat: the packed bodies
    used: int  # how many rows are, or were, in use


@inlined
def rows_of(array):
    """Return the parts of the array of a set."""
    numbers = elements(array)
    room = int(numbers[0])
    column = beyond(numbers, _HEAD)
    whole = integers(column)
    return Rows(column, beyond(column, room), beyond(column, 2 * room), beyond(column, 3 * room),
                beyond(whole, 4 * room), beyond(whole, 5 * room), beyond(whole, 6 * room),
                beyond(column, _COLUMNS * room), beyond(column, _COLUMNS * room + int(numbers[2])),
                int(numbers[USED]))


@inlined
def body_of(rows, row):
    return Packed(rows.packed, rows.start[row], rows.n[row])


@inlined
def box_gap(rows, row, box):
    """Return the gap of bounds along x or y, < 0 if none: a lower bound of the separation."""
    return max(max(rows.min_x[row] - box[2], box[0] - rows.max_x[row]),
               max(rows.min_y[row] - box[3], box[1] - rows.max_y[row]))


def packed_sizes(counts: NDArray[np.int64]) -> NDArray[np.int64]:
    kinds, places = np.unique(counts, return_inverse=True)
    return np.array([packed_size(kind) for kind in kinds.tolist()], np.int64)[places]


def new_array(rows: int, doubles: int) -> NDArray[np.float64]:
    """Return the array of an empty set with room for so many rows, and doubles for bodies."""
    index = NODE * sum(level_sizes(rows))
    array = np.zeros(_HEAD + _COLUMNS * rows + index + doubles)
    array[0] = rows
    array[2] = index
    return array


def level_sizes(rows: int) -> list[int]:
    """Return how many nodes the levels of an index of rows have, the leaves first."""
    sizes = [-(-rows // FANOUT)]
    while sizes[-1] > 1:
        sizes.append(-(-sizes[-1] // FANOUT))
    return sizes


def views_of(array: NDArray[np.float64]) -> Rows:
    """Return the parts of the array of a set as NumPy views, for use outside kernels."""
    room = int(array[0])
    end = _HEAD + _COLUMNS * room
    columns = array[_HEAD:end].reshape(_COLUMNS, room)
    packed = end + int(array[2])
    return Rows._make((*columns[:4], *columns[4:].view(np.int64), array[end:packed],
                       array[packed:], int(array[USED])))


def slices_of(array: NDArray[Any], starts: NDArray[np.int64],
              sizes: NDArray[np.int64]) -> NDArray[Any]:
    offsets = starts + sizes - np.cumsum(sizes)
    slices: NDArray[Any] = array[np.repeat(offsets, sizes) + np.arange(sizes.sum())]
    return slices


def value_of(array: Any) -> tuple[Any, ...]:
    """Return how many rows a set has, which have a body, their vertices, and where these end."""
    table = views_of(np.asarray(array))
    rows = np.flatnonzero(table.n)
    starts, counts = table.start[rows], table.n[rows]
    is_convex = counts > 0
    sizes = np.where(is_convex, packed_sizes(abs(counts)), table.packed[starts + 1]).astype(int)
    firsts = np.where(is_convex, sizes - 2 * counts, table.packed[starts]).astype(int)
    vertices = slices_of(table.packed, starts + firsts, sizes - firsts).reshape(-1, 2)
    return table.used, rows, vertices, np.append(0, np.cumsum(sizes - firsts) // 2)

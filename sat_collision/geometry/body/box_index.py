# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Which rows of a set have bounds near a box: by an index, or by a scan of all rows.

The index is a packed R-tree in the array of the set, the root first. A node has FANOUT entries,
column by column: min x, min y, max x, max y, and what each refers to, a row of the set, or minus
the place of another node. Entries that are not used have bounds that are nowhere.

Leaves are tiles: the rows are sorted by x and cut into slabs, and each slab is sorted by y and cut
into leaves. Every FANOUT nodes in this order make one of the next level. Bounds are only compared,
so the index finds the very rows that the scan finds.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.layout import box_gap, FANOUT, level_sizes, NODE, views_of
from sat_collision.geometry.compiled.jit import (
    beyond, COMPILED, elements, inlined, inner, scratch_integers)
from sat_collision.geometry.numeric.ascending import contains, sort
from sat_collision.geometry.numeric.vectors import joined, NOWHERE

# More than the entries that wait while a tree of 2^48 rows is searched.
_STACK = 256
# If more than this share of the rows is near, a scan is faster.
_SHARE = 64


def build_index(array: Any) -> int:
    """Write the index of a set into its array; return 0 if no row has a body, else 1."""
    table = views_of(np.asarray(array))
    rows = np.flatnonzero(table.n)
    min_x, min_y, max_x, max_y = (column[rows] for column in table[:4])
    places = rows[_tiles(min_x / 2.0 + max_x / 2.0, min_y / 2.0 + max_y / 2.0)]
    sizes = level_sizes(len(places))
    end = sum(sizes)
    nodes = table.nodes[:NODE * end].reshape(end, NODE // FANOUT, FANOUT)
    columns = [*table[:4], np.arange(len(table.n))]
    for count in sizes if len(places) else ():
        end -= count
        level = nodes[end:end + count]
        unused = FANOUT * count - len(places)
        places = np.append(places, places[:1].repeat(unused))
        for k, column in enumerate(columns):
            level[:, k] = column[places].reshape(count, FANOUT)
        level[-1, :4, FANOUT - unused:] = np.reshape(NOWHERE, (4, 1))
        places = np.arange(count)
        columns = [*level[:, :2].min(axis=2).T, *level[:, 2:4].max(axis=2).T,
                   -NODE * (end + places)]
    return int(len(rows) > 0)


def _tiles(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the indices of points in an order in which every FANOUT of them are close."""
    leaves = -(-len(x) // FANOUT)
    in_slab = FANOUT * math.isqrt(max(leaves - 1, 0)) + FANOUT
    unused = -len(x) % in_slab
    with np.errstate(over='ignore'):
        # Roughly is enough, and takes half the time.
        order = np.argsort((x - x.min(initial=math.inf)).astype(np.float32))
    order = np.append(order, np.zeros(unused, np.int64)).reshape(-1, in_slab)
    heights = y[order]
    heights[-1:, in_slab - unused:] = math.inf
    tiles: NDArray[np.int64] = np.take_along_axis(order, np.argsort(heights), 1).ravel()
    return tiles[:len(x)]


@inner
def bounds_of_index(rows):
    """Return min x, min y, max x, max y of all rows that are in the index."""
    box = NOWHERE
    for k in range(FANOUT):
        box = joined(box, rows.nodes[k], rows.nodes[FANOUT + k], rows.nodes[2 * FANOUT + k],
                     rows.nodes[3 * FANOUT + k])
    return box


@inner
def rows_near(rows, indexed, box):
    """
    Return the rows whose bounds meet a box, min x, min y, max x, max y, ascending.

    They are the first elements of an array, which comes with their number; some may have no body.
    """
    if indexed:
        found, near = _search(rows, box)
        if near >= 0:
            return found, near
    found = scratch_integers(rows.used)
    return found, _scan(rows, box, found)


@inner
def _search(rows, box):
    """Return the same by the index; the number is -1 if they are many."""
    found = scratch_integers(rows.used // _SHARE + _SHARE)
    waiting = scratch_integers(_STACK)
    waiting[0] = 0
    count = 1
    near = 0
    while count > 0:
        count -= 1
        node = beyond(rows.nodes, waiting[count])
        # Without a branch per entry, which would be mispredicted: those not near are overwritten.
        if node[4 * FANOUT] < 0.0:
            for k in range(FANOUT):
                waiting[count] = -int(node[4 * FANOUT + k])
                count += _meets(node, k, box)
        elif near + FANOUT > len(found):
            return found, -1
        else:
            for k in range(FANOUT):
                found[near] = int(node[4 * FANOUT + k])
                near += _meets(node, k, box)
    sort(found, found, near)
    return found, near


@inlined
def _meets(node, k, box):
    return ((node[k] <= box[2]) & (node[2 * FANOUT + k] >= box[0])
            & (node[FANOUT + k] <= box[3]) & (node[3 * FANOUT + k] >= box[1]))


if COMPILED:
    @inner
    def _scan(rows, box, found):
        """Write the rows by comparing all; return how many."""
        found = elements(found)
        min_x, min_y, max_x, max_y = box[0], box[1], box[2], box[3]
        near = 0
        for row in range(rows.used):
            found[near] = row
            near += ((rows.min_x[row] <= max_x) & (rows.max_x[row] >= min_x)
                     & (rows.min_y[row] <= max_y) & (rows.max_y[row] >= min_y))
        return near
else:
    def _scan(rows, box, found):
        min_x, min_y, max_x, max_y = (np.asarray(column)[:rows.used] for column in rows[:4])
        near = np.flatnonzero((min_x <= box[2]) & (max_x >= box[0])
                              & (min_y <= box[3]) & (max_y >= box[1]))
        np.asarray(found)[:len(near)] = near
        return len(near)


@inner
def nearest_box(rows, indexed, box, skipped):
    """Return the first row of least gap to a box that has a body and is not skipped, or -1."""
    first, least = -1, math.inf
    if indexed:
        waiting = scratch_integers(_STACK)
        waiting[0] = 0
        count = 1
        while count > 0:
            count -= 1
            node = beyond(rows.nodes, waiting[count])
            nearest, least_here = count, math.inf
            for k in range(FANOUT):
                gap = max(max(node[k] - box[2], box[0] - node[2 * FANOUT + k]),
                          max(node[FANOUT + k] - box[3], box[1] - node[3 * FANOUT + k]))
                place = int(node[4 * FANOUT + k])
                if not gap <= least or gap == math.inf:
                    continue
                if place < 0:
                    waiting[count] = -place
                    if gap < least_here:
                        nearest, least_here = count, gap
                    count += 1
                elif (gap < least or place < first) and not contains(skipped, place):
                    first, least = place, gap
            # The nearest goes first, so that most others need not be visited.
            if nearest < count - 1:
                waiting[nearest], waiting[count - 1] = waiting[count - 1], waiting[nearest]
    if first < 0:
        for row in range(rows.used):
            # The gap may be infinite, hence the test of `first`.
            if (rows.n[row] != 0 and (first < 0 or box_gap(rows, row, box) < least)
                    and not contains(skipped, row)):
                first, least = row, box_gap(rows, row, box)
    return first

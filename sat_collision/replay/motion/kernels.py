# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Operations on many rings of points: their bounds, and their motions from one set to the next.

A ring has the points of an outline as received, moved to the fixed frame.

Arrays are written to, not returned: numba takes a microsecond to return one to Python.
"""

import math

import numpy as np
from sat_collision.geometry.body.moving import STRIDE
from sat_collision.geometry.body.packing import CONVEX, pack, PAIR
from sat_collision.geometry.compiled.jit import kernel, numbers_of, scratch

# The bytes of a float32, and the float32s of a point in a message.
_WORD = 4
_NUMBERS = 3
# A key of these bits times the factor, plus any 32-bit word, fits into 64 bits.
_FACTOR = 1_000_003
_KEY_BITS = 2**42 - 1

# Columns of rings: where the points start, how many there are, the stamp, and whether the ring has
# moved to where it is.
FIRST, COUNT, STAMP, MOVED = range(4)
# Columns of motions: where the vertices end, when the motion begins, and when it ends.
END, START, FINISH = range(3)
# Columns of messages, or runs of them: the set, how many rings there are, where the data begins,
# the stamp, where in each message of a run points start, and the numbers of a point.
SET, RINGS, DATA, TIME, POINTS_AT, STEP = range(6)
# Columns of sets: where the rings begin and end, and the points; the first and the last stamp of a
# ring, 0 if there is none; whether two rings may be equal bit by bit as received (always 1 if two
# are); where the motions that lead to the set end, when the first begins, and when the last ends.
(ROW, ROWS_END, POINT, POINTS_END, EARLIEST, LATEST, MAY_REPEAT, MOTIONS, MOTIONS_BEGIN,
 MOTIONS_END) = range(10)


@kernel
def describe(data, messages, places, affines, out):
    """
    Write the points, rings and bounds of some sets.

    Parameters
    ----------
    data : bytes
        The data of all messages.
    messages : (m, 6) array of int64
        SET to STEP of each message or run, in the order of the sets. Points are x, y and z as
        float32, or x and y as float64, by STEP: TRIPLE or PAIR.
    places : array of int64
        Where in the data of each its rings are: where they end, with TRIPLE; with PAIR where each
        starts, and how many points it has.
    affines : (m, 6) array of float64
        The map of the rings of each to the common frame, as an Affine2D; empty if none is needed.
    out : tuple
        The arrays that are written: points, rings, boxes, sets.
    points : (v, 2) array of float64
    rings : (n, 4) array of int64
        FIRST, among the points of the set; COUNT, without a point that closes the ring; STAMP;
        and MOVED, which is 0 until the motion is known.
    boxes : (n, 4) array of float64
        min x, min y, max x, max y.
    sets : (s, 10) array of int64
        ROW to MAY_REPEAT are written; all must be 0 before.

    """
    words, values, doubles = numbers_of(data)
    points, rings, boxes, sets = out
    keys = np.empty(len(rings), np.int64)
    message = listed = i = start = 0
    for s in range(len(sets)):
        first, base = i, start
        while message < len(messages) and messages[message, SET] == s:
            stamp = messages[message, TIME]
            data_at = messages[message, DATA]
            # Words of a point, and of its x and y.
            is_double = messages[message, STEP] == PAIR
            size = 4 if is_double else _NUMBERS
            used = 4 if is_double else 2
            end = 0
            row = i + messages[message, RINGS]
            for i in range(i, row):
                if is_double:
                    at = places[listed]
                    length = places[listed + 1]
                    listed += 2
                else:
                    at = end + messages[message, POINTS_AT]
                    end = places[listed]
                    listed += 1
                    length = (end - at) // (_WORD * size)
                at = (data_at + at) // _WORD
                last = start + length - 1
                key = length
                left = bottom = math.inf
                right = top = -math.inf
                for k in range(start, last + 1):
                    for word in range(at, at + used):
                        key = (_FACTOR * key + np.int64(words[word])) & _KEY_BITS
                    if is_double:
                        x = doubles[at // 2]
                        y = doubles[at // 2 + 1]
                    else:
                        x = float(values[at])
                        y = float(values[at + 1])
                    at += size
                    if len(affines):
                        # As `packing.moved_points`.
                        a, b, c, d, e, f = affines[message]
                        x, y = a * x + b * y + c, d * x + e * y + f
                    points[k, 0] = x
                    points[k, 1] = y
                    left, bottom = min(left, x), min(bottom, y)
                    right, top = max(right, x), max(top, y)
                keys[i] = key
                boxes[i] = (left, bottom, right, top)
                closed = (last > start and points[start, 0] == points[last, 0]
                          and points[start, 1] == points[last, 1])
                rings[i, FIRST] = start - base
                rings[i, COUNT] = length - (1 if closed else 0)
                rings[i, STAMP] = stamp
                rings[i, MOVED] = 0
                start = last + 1
                sets[s, EARLIEST] = min(sets[s, EARLIEST], stamp) if i > first else stamp
                sets[s, LATEST] = max(sets[s, LATEST], stamp)
            i = row
            message += 1
        sets[s, ROW], sets[s, ROWS_END] = first, i
        sets[s, POINT], sets[s, POINTS_END] = base, start
        keys[first:i].sort()
        for k in range(first + 1, i):
            if keys[k] == keys[k - 1]:
                sets[s, MAY_REPEAT] = 1


@kernel
def follow(described, longest, motions):
    """
    Write the motions of the rings of each set to those of the next.

    `described` are points, rings, boxes and sets, as `describe` writes them; MOTIONS,
    MOTIONS_BEGIN and MOTIONS_END of the sets are written. A motion takes at most `longest` ns.
    `motions` receive the rows of matched rings in the one set and in the next, and array, times,
    boxes and moved, as `motions_between` writes them; in the array the motions from a set start at
    STRIDE times the start of its points.
    """
    points, rings, boxes, sets = described
    rows, next_rows, array, times, bounds, moved = motions
    count = 0
    places = _places(boxes[:sets[0, ROWS_END]])
    for s in range(1, len(sets)):
        first, row, end = sets[s - 1, ROW], sets[s, ROW], sets[s, ROWS_END]
        begin, point = sets[s - 1, POINT], sets[s, POINT]
        next_places = _places(boxes[row:end])
        found = _mutual(rings[first:row], places, rings[row:end], next_places, longest,
                        rows[count:], next_rows[count:])
        if found > 0:
            last, count = count, count + found
            sets[s, MOTIONS_BEGIN], sets[s, MOTIONS_END] = motions_between(
                points[begin:point], rings[first:row], rows[last:count],
                points[point:sets[s, POINTS_END]], rings[row:end], next_rows[last:count],
                (array[STRIDE * begin:STRIDE * point], times[last:count], bounds[last:count],
                 moved[last:count]))
        sets[s, MOTIONS] = count
        places = next_places


@kernel
def nearest_each(centres, own_order, others, order):
    """
    Return for each centre which of the others is nearest to it; -1 if there are none.

    The orders sort both by x, so that few of the others have to be looked at.
    """
    found = np.full(len(centres), -1, np.int64)
    behind = 0
    for i in own_order:
        x = centres[i, 0]
        y = centres[i, 1]
        while behind < len(order) and others[order[behind], 0] < x:
            behind += 1
        above = behind
        below = above - 1
        best = math.inf
        if i < len(others):
            # Most often the nearest has the same row, and the search ends soon.
            best = (others[i, 0] - x) ** 2 + (others[i, 1] - y) ** 2
            found[i] = i
        while True:
            down = x - others[order[below], 0] if below >= 0 else math.inf
            up = others[order[above], 0] - x if above < len(order) else math.inf
            if down == math.inf and up == math.inf or min(down, up) ** 2 > best:
                break
            if down <= up:
                j = order[below]
                below -= 1
            else:
                j = order[above]
                above += 1
            distance = (others[j, 0] - x) ** 2 + (others[j, 1] - y) ** 2
            if distance < best or (distance == best and j < found[i]):
                best = distance
                found[i] = j
    return found


@kernel
def mutual_nearest(rings, boxes, next_rings, next_boxes, longest, rows, next_rows):
    """
    Match the rings of two sets that are nearest to each other and have equally many points.

    Rings and boxes of the two sets are as `describe` writes them; distances are those of the
    centres of the boxes. The second ring must be later, by at most `longest` ns. Returned is the
    number of matches: `rows` and `next_rows` receive the rings of the one set and of the other.
    """
    return _mutual(rings, _places(boxes), next_rings, _places(next_boxes), longest, rows,
                   next_rows)


@kernel
def _mutual(rings, places, next_rings, next_places, longest, rows, next_rows):
    centres, order = places
    others, next_order = next_places
    there = nearest_each(centres, order, others, next_order)
    back = nearest_each(others, next_order, centres, order)
    found = 0
    for i in range(len(centres)):
        j = there[i]
        if (j >= 0 and back[j] == i and rings[i, COUNT] == next_rings[j, COUNT]
                and 0 < next_rings[j, STAMP] - rings[i, STAMP] <= longest):
            rows[found] = i
            next_rows[found] = j
            found += 1
    return found


@kernel
def _places(boxes):
    """Return the centres of boxes, and their order by x."""
    found = np.empty((len(boxes), 2))
    for i in range(len(boxes)):
        for axis in range(2):
            found[i, axis] = 0.5 * boxes[i, axis] + 0.5 * boxes[i, 2 + axis]
    order = np.argsort(found[:, 0]) if len(found) > 1 else np.zeros(len(found), np.int64)
    return found, order


@kernel
def motions_between(points, rings, rows, next_points, next_rings, next_rows, out):
    """
    Write the motions of rings from one set to the next, vertex by vertex.

    A ring may begin at any of its vertices, so those of two rings are matched by the cyclic shift
    with the least sum of squared distances, and of equal ones by the smallest. A ring whose
    orientation has changed is read backwards. MOVED is set for rings of the next set that have
    moved. Returned is when the first motion begins and when the last ends.

    Parameters
    ----------
    points, rings, next_points, next_rings : array
        Of each set, as `describe` writes them.
    rows, next_rows : (m,) array of int64
        Which ring becomes which; both have equally many points.
    out : tuple
        The arrays that are written: array, times, boxes, moved.
    array : flat array of float64
        x, y before and x, y after of each vertex, ring after ring, as in `moving.MovingBody`.
    times : (m, 3) array of int64
        Where in it each ring ends, and when each motion begins and ends, ns.
    boxes : (m, 4) array of float64
        The bounds of the whole motion.
    moved : (m,) array of float64
        How far the vertex that moves furthest goes, metres.

    """
    array, times, boxes, moved = out
    at = 0
    begin = rings[rows[0], STAMP]
    end = next_rings[next_rows[0], STAMP]
    for r in range(len(rows)):
        n = rings[rows[r], COUNT]
        p = rings[rows[r], FIRST]
        q = next_rings[next_rows[r], FIRST]
        step = 1
        if _twice_area(points, p, n) * _twice_area(next_points, q, n) < 0.0:
            step = -1
        shift = _least_motion(points, p, next_points, q, n, step)
        boxes[r] = (math.inf, math.inf, -math.inf, -math.inf)
        most = 0.0
        j = shift
        for k in range(n):
            x0 = points[p + k, 0]
            y0 = points[p + k, 1]
            x1 = next_points[q + j, 0]
            y1 = next_points[q + j, 1]
            j = _next(j, step, n)
            array[at] = x0
            array[at + 1] = y0
            array[at + 2] = x1
            array[at + 3] = y1
            at += STRIDE
            most = max(most, (x1 - x0) ** 2 + (y1 - y0) ** 2)
            boxes[r, 0] = min(boxes[r, 0], min(x0, x1))
            boxes[r, 1] = min(boxes[r, 1], min(y0, y1))
            boxes[r, 2] = max(boxes[r, 2], max(x0, x1))
            boxes[r, 3] = max(boxes[r, 3], max(y0, y1))
        moved[r] = math.sqrt(most)
        times[r, END] = at
        times[r, START] = rings[rows[r], STAMP]
        times[r, FINISH] = next_rings[next_rows[r], STAMP]
        begin = min(begin, times[r, START])
        end = max(end, times[r, FINISH])
        if moved[r] > 0.0:
            next_rings[next_rows[r], MOVED] = 1
    return begin, end


@kernel
def _twice_area(points, first, count):
    area = 0.0
    x = points[first, 0]
    y = points[first, 1]
    for k in range(first + 1, first + count - 1):
        area += ((points[k, 0] - x) * (points[k + 1, 1] - y)
                 - (points[k, 1] - y) * (points[k + 1, 0] - x))
    return area


@kernel
def _least_motion(points, first, next_points, next_first, count, step):
    """Return the start in the next ring with the least sum of squared distances."""
    best = math.inf
    found = 0
    for shift in range(count):
        total = 0.0
        j = shift
        for k in range(count):
            total += ((next_points[next_first + j, 0] - points[first + k, 0]) ** 2
                      + (next_points[next_first + j, 1] - points[first + k, 1]) ** 2)
            if total >= best:
                break
            j = _next(j, step, count)
        if total < best:
            best = total
            found = shift
    return found


@kernel
def _next(vertex, step, count):
    """Return the vertex that follows one in a ring; faster than a remainder."""
    vertex += step
    if vertex == count:
        return 0
    return count - 1 if vertex < 0 else vertex


@kernel
def pack_ring(points, first, count, packed):
    """Pack the polygon that a ring makes; return how many vertices it has, 0 if not convex."""
    ring = scratch(2 * count)
    for k in range(count):
        ring[2 * k] = points[first + k, 0]
        ring[2 * k + 1] = points[first + k, 1]
    verdict, n, _, _, _ = pack(ring, packed, count, 0)
    return n if verdict == CONVEX else 0

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Which bodies are near to a footprint: in one set, and in a batch of sets as it moves."""

import math

import numpy as np
from sat_collision.geometry.body.layout import Packed, packed_size
from sat_collision.geometry.body.moving import STRIDE
from sat_collision.geometry.compiled.jit import kernel, scratch
from sat_collision.geometry.pair.distance import measure
from sat_collision.replay.motion.kernels import (
    COUNT, EARLIEST, END, FINISH, FIRST, LATEST, MOTIONS, pack_ring, POINT, POINTS_END, ROW,
    ROWS_END, START)

# Bound of the rounding error of a separation or a motion, relative to the largest coordinate.
SLACK = 1e-12


@kernel
def rows_near(box, boxes, margin, rows):
    """Write which boxes are no further than a margin from one; return how many."""
    found = 0
    for i in range(len(boxes)):
        if _gap(box, boxes[i]) <= margin:
            rows[found] = i
            found += 1
    return found


@kernel
def measure_near(body, box, rows, bodies, margin, found):
    """
    Measure how far a body is from the rings that may be nearest or within a margin in metres.

    The body is packed, with its count, and has the box as bounds; with a count of 0 nothing is
    measured, because the body has another outline for each ring. `bodies` are boxes, points and
    rings as `describe` writes them, of which only `rows` are considered.

    Returned is the number of rings found. For each, `found`, (m, 3), receives the gap of the boxes
    (a lower bound of the separation), the row, and the separation as `distance.measure` returns
    it, NaN if it was not measured or the ring is not convex.
    """
    outline, n = body
    boxes, points, rings = bodies
    nearest = 0
    least = math.inf
    for k in range(len(rows)):
        gap = _gap(box, boxes[rows[k]])
        if gap < least:
            least = gap
            nearest = k
    count = 0
    least = math.inf
    # From the nearest box round to the one before it, so that most others need not be measured.
    for k in range(nearest - len(rows), nearest):
        row = rows[k]
        gap = _gap(box, boxes[row])
        if gap > max(margin, least):
            continue
        value = math.nan if n == 0 else _separation(outline, n, points, rings[row])
        found[count] = (gap, float(row), value)
        count += 1
        if value < least:
            least = value
    return count


@kernel
def _gap(box, other):
    """Return the distance of two boxes, 0 if they share a point."""
    x = max(max(other[0] - box[2], box[0] - other[2]), 0.0)
    y = max(max(other[1] - box[3], box[1] - other[3]), 0.0)
    return math.sqrt(x * x + y * y)


@kernel
def _separation(outline, n, points, ring):
    """Return the separation of a packed body from a ring, NaN if that is not convex."""
    packed = scratch(packed_size(ring[COUNT]))
    m = pack_ring(points, ring[FIRST], ring[COUNT], packed)
    if m == 0:
        return math.nan
    return measure(Packed(outline, 0, n), Packed(packed, 0, m))[0]


@kernel
def nearest_in_steps(trajectory, bodies, margin, steps, times, values):
    """
    Find the body nearest to a moving footprint in each step of a batch that is free of contacts.

    It looks at some times in each step: at each sample of the footprint for bodies that stand
    still, and at the end of the step for all.

    Parameters
    ----------
    trajectory, bodies : tuple
        The batches of the samples of the footprint and of the obstacles: points, rings, boxes and
        sets as `describe` writes them, then the arrays that `follow` writes.
    margin : float
        In metres.
    steps : (s, 4) array of int64
        Receives for the step to each set the index of its first look in `times`, or -1 if
        something may touch or the step is a special case; where its looks end; and the numbers of
        the footprint's samples at the ends of its first and of its last trajectory link.
    times : (n, 3) array of int64
        Receives for each look its time, the row of the nearest body, and 2 if that is in the later
        set; else it stands still in the earlier set: 1 if all bodies there do, 0 if not.
    values : (n,) array of float64
        Receives the least separation for each look.

    """
    own, own_rings, own_boxes, samples = trajectory[:4]
    points, rings, boxes, sets, rows, _, _, _, bounds, moved = bodies
    longest = 1
    for i in range(len(own_rings)):
        longest = max(longest, own_rings[i, COUNT])
    packed = scratch(packed_size(longest))
    for i in range(len(rings)):
        longest = max(longest, rings[i, COUNT])
    other = scratch(packed_size(longest))
    found = np.empty((len(boxes), 3))
    numbers = np.arange(len(boxes))
    still = np.empty(len(boxes), np.int64)
    low = 1
    looks = 0
    for s in range(1, len(sets)):
        steps[s, 0] = -1
        begin = sets[s - 1, EARLIEST]
        finish = sets[s, EARLIEST]
        motions, motions_end = sets[s - 1, MOTIONS], sets[s, MOTIONS]
        if (motions == motions_end or begin >= finish or sets[s - 1, LATEST] != begin
                or sets[s, LATEST] != finish):
            continue
        while low < len(samples) and samples[low, EARLIEST] <= begin:
            low += 1
        high = low
        while high < len(samples) and samples[high, EARLIEST] < finish:
            high += 1
        if (high >= len(samples) or samples[low - 1, EARLIEST] > begin
                or looks + high - low >= len(values)):
            continue
        box = around(own_boxes[low - 1], own_boxes[low])
        may_touch = False
        for k in range(low, high + 1):
            may_touch = may_touch or samples[k, MOTIONS] == samples[k - 1, MOTIONS]
            box = around(box, own_boxes[k])
        for k in range(motions, motions_end):
            may_touch = may_touch or _gap(box, bounds[k]) <= margin and not _stays_apart(
                trajectory, (low, high), bodies, s, k, (packed, other), margin)
        if may_touch:
            continue
        first, row, end = sets[s - 1, ROW], sets[s, ROW], sets[s, ROWS_END]
        point = sets[s, POINT]
        count = 0
        for k in range(motions, motions_end):
            if moved[k] == 0.0:
                still[count] = rows[k]
                count += 1
        at = looks
        if count > 0:
            before = boxes[first:row], points[sets[s - 1, POINT]:point], rings[first:row]
            for k in range(low, high):
                n = pack_ring(own, samples[k, POINT], own_rings[k, COUNT], packed)
                nearest, values[at] = _least((packed, n), own_boxes[k], still[:count], before,
                                             -math.inf, found)
                times[at] = (samples[k, EARLIEST], nearest, 1 if count == row - first else 0)
                may_touch = may_touch or math.isnan(values[at])
                at += 1
        n = _pack_at(trajectory, high, samples[high - 1, MOTIONS], finish, packed)
        after = boxes[row:end], points[point:sets[s, POINTS_END]], rings[row:end]
        nearest, values[at] = _least((packed, n), around(own_boxes[high - 1], own_boxes[high]),
                                     numbers[:end - row], after, margin, found)
        times[at] = (finish, nearest, 2)
        if not (may_touch or math.isnan(values[at]) or values[at] <= margin):
            steps[s] = (looks, at + 1, low, high)
            looks = at + 1


@kernel
def _stays_apart(trajectory, links, bodies, s, k, arrays, margin):
    """
    Return whether a footprint is certain to stay apart from an obstacle on motion k to a set.

    It is if on each of the trajectory's links, the first to the last, the two begin further apart
    than they can move, and end apart. They are packed into the arrays, which must have room.
    """
    samples, sets = trajectory[3], bodies[3]
    packed, other = arrays
    for link in range(links[0], links[1] + 1):
        own = samples[link - 1, MOTIONS]
        begin = max(samples[link - 1, EARLIEST], sets[s - 1, EARLIEST])
        end = min(samples[link, EARLIEST], sets[s, EARLIEST])
        # As `_Pair.most_motion`.
        moved = _motion(trajectory, own, end - begin) + _motion(bodies, k, end - begin)
        room = (SLACK * max(_farthest(trajectory[8][own]), _farthest(bodies[8][k]))
                + (1.0 + SLACK) * moved)
        for time in (begin, end):
            n = _pack_at(trajectory, link, own, time, packed)
            m = _pack_at(bodies, s, k, time, other)
            if n == 0 or m == 0:
                return False
            if measure(Packed(packed, 0, n), Packed(other, 0, m))[0] - margin <= room:
                return False
            room = 0.0
    return True


@kernel
def _motion(batch, k, passed):
    """Return how far a body moves at most in some ns."""
    times = batch[7]
    return batch[9][k] * passed / (times[k, FINISH] - times[k, START])


@kernel
def _farthest(box):
    return max(max(abs(box[0]), abs(box[1])), max(abs(box[2]), abs(box[3])))


@kernel
def _pack_at(batch, s, k, time, packed):
    """Pack a body at a time on motion k to a set; return its count, 0 if it is not convex then."""
    points, rings, _, sets, rows, next_rows, array, times, _, _ = batch
    i = rows[k] + sets[s - 1, ROW]
    first = sets[s - 1, POINT]
    start, finish = times[k, START], times[k, FINISH]
    if time <= start:
        return pack_ring(points, first + rings[i, FIRST], rings[i, COUNT], packed)
    if time >= finish:
        i = next_rows[k] + sets[s, ROW]
        return pack_ring(points, sets[s, POINT] + rings[i, FIRST], rings[i, COUNT], packed)
    n = rings[i, COUNT]
    at = STRIDE * first + (times[k - 1, END] if k > sets[s - 1, MOTIONS] else 0)
    share = (time - start) / (finish - start)
    ring = np.empty((n, 2))
    for v in range(n):
        for axis in range(2):
            x = array[at + STRIDE * v + axis]
            ring[v, axis] = x + share * (array[at + STRIDE * v + 2 + axis] - x)
    return pack_ring(ring, 0, n, packed)


@kernel
def _least(body, box, rows, bodies, margin, found):
    """Return the row nearest to a body, and its separation; NaN if something is not convex."""
    if body[1] == 0:
        return -1, math.nan
    least = nearest_gap = math.inf
    nearest = -1
    count = measure_near(body, box, rows, bodies, margin, found)
    for gap, row, value in found[:count]:
        # Of equal ones that with the nearest box counts, then the first.
        if value < least or value == least and (gap, row) < (nearest_gap, nearest):
            least, nearest_gap, nearest = value, gap, int(row)
    for gap, _, value in found[:count]:
        if math.isnan(value) and gap <= max(margin, least):
            return -1, value
    return nearest, least


@kernel
def around(box, other):
    """Return the bounds of two boxes."""
    return (min(box[0], other[0]), min(box[1], other[1]),
            max(box[2], other[2]), max(box[3], other[3]))

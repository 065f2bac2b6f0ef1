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
The ordinary message, from its bytes to its place in the scene, in one compiled call.

Nearly every obstacle message moves an obstacle of a set that is as long as the one before, and
the obstacle touches the same footprints as before, mostly none; nearly every footprint message
moves a footprint; nothing else changes. The kernels here take exactly these. Whatever they do not
take for one they leave untouched, and the message goes the general way, through `messages`,
`Polygon` and `Scene`, which decides alike: which way a message went makes no difference but in
time. Plain Python, which would gain nothing, always goes the general way.
"""

import sys

import numpy as np
from sat_collision.geometry.jit import kernel
from sat_collision.geometry.packing import fingerprint, packed_size, unpack
from sat_collision.geometry.polygon_set import intersecting_rows, put
from sat_collision.geometry.ring import CONVEX

NOT_ORDINARY = -2 ** 63

_FRAME_AT = 16
_POINT_BYTES = 12
_SECOND = 1_000_000_000
_LITTLE_ENDIAN = sys.byteorder == 'little'


@kernel
def move_obstacle(data, frame, most, now, last_time, set_start, set_window, begins, prints, place,
                  row, footprint_bounds, footprint_rows, footprint_blocks, footprints,
                  bounds, rows, blocks, obstacles):
    """
    Take an ordinary message of an obstacle.

    Parameters
    ----------
    data : bytes
        A serialised PolygonStamped.
    frame : bytes
        The scene's frame_id and a NUL.
    most : int
        The most vertices accepted.
    now, last_time : int
        Present time, and the time that the obstacle has counted from, in ns.
    set_start, set_window : int
        Stamp of the set that is coming in, and how far from it those of its messages lie, in ns.
    begins : bool
        Whether the message should begin the next set, else belong to this one.
    prints : (p,) array of float64
        The fingerprint of each member of the set so far. That of this one is added.
    place : int
        Which of the set this message is, less than p.
    row : int
        The row of the obstacle in that place.
    footprint_bounds, footprint_rows, footprint_blocks, footprints
        Arrays of the PolygonSet of all footprints, and its used rows.
    bounds, rows, blocks, obstacles
        Those of the obstacles.

    Returns
    -------
    int
        The time in ns that the obstacle counts from, which is the stamp if it begins a set; or
        NOT_ORDINARY.

    """
    stamp, record, count = _read(data, frame, most)
    time = min(stamp, now)
    if count == 0 or len(record) > rows[2, row] or stamp == 0 or time < last_time:
        return NOT_ORDINARY
    if begins:
        if stamp <= set_start + set_window or stamp > now:
            return NOT_ORDINARY
    elif abs(stamp - set_start) > set_window:
        return NOT_ORDINARY
    own = fingerprint(record)
    equal = 0
    for k in range(place):
        equal += prints[k] == own
    if equal:
        return NOT_ORDINARY
    before = blocks[rows[0, row]:rows[0, row] + rows[2, row]]
    if not _hits_the_same(footprint_bounds, footprint_rows, footprint_blocks, footprints, before,
                          rows[1, row], record, count):
        return NOT_ORDINARY
    put(bounds, rows, blocks, row, record, count)
    prints[place] = own
    return time


@kernel
def move_footprint(data, frame, most, row, found, bounds, rows, blocks, footprints,
                   obstacle_bounds, obstacle_rows, obstacle_blocks, obstacles):
    """
    Take an ordinary message of a footprint.

    Parameters
    ----------
    data, frame, most
        As for `move_obstacle`.
    row : int
        The row of the footprint.
    found : (obstacles,) array of int64
        Receives the rows of the obstacles that it hits.
    bounds, rows, blocks, footprints
        Arrays of the PolygonSet of all footprints, and its used rows.
    obstacle_bounds, obstacle_rows, obstacle_blocks, obstacles
        Those of the obstacles.

    Returns
    -------
    stamp : int
        In ns, or NOT_ORDINARY.
    hits : int
        How many rows were found.

    """
    stamp, record, count = _read(data, frame, most)
    if count == 0 or not put(bounds, rows, blocks, row, record, count):
        return NOT_ORDINARY, 0
    return stamp, intersecting_rows(obstacle_bounds, obstacle_rows, obstacle_blocks, obstacles, record,
                           count, found)


@kernel
def _hits_the_same(bounds, rows, blocks, used, before, count_before, after, count_after):
    """Tell whether two records hit the same rows of a set."""
    found = np.empty((2, used), np.int64)
    hits = intersecting_rows(bounds, rows, blocks, used, before, count_before, found[0])
    if intersecting_rows(bounds, rows, blocks, used, after, count_after, found[1]) != hits:
        return False
    for k in range(hits):
        if found[0, k] != found[1, k]:
            return False
    return True


@kernel
def _read(data, frame, most):
    """Return the stamp of a message, the record of its polygon, and how many vertices that has."""
    points_at, received = _find_points(data, frame)
    record = np.empty(packed_size(received))
    if received == 0:
        return 0, record, 0
    nanoseconds = _uint32(data, 8)
    points = np.frombuffer(data, np.uint8)[points_at:].view(np.float32)
    verdict, count, _, _, first = unpack(points, record, most)
    if verdict != CONVEX or nanoseconds >= _SECOND:
        return 0, record, 0
    return _int32(data, 4) * _SECOND + nanoseconds, record[:first + 2 * count], count


@kernel
def _find_points(data, frame):
    """
    Return where the points start in a PolygonStamped in little-endian CDR, and how many they are.

    None where the frame is another, or the lengths do not add up to the byte.
    """
    size = len(data)
    length = len(frame)
    count_at = (_FRAME_AT + length + 3) & ~3
    points_at = count_at + 4
    if (not _LITTLE_ENDIAN or points_at > size
            or data[0] != 0 or data[1] != 1 or data[2] != 0 or data[3] != 0
            or _uint32(data, 12) != length):
        return 0, 0
    for k in range(length):
        if data[_FRAME_AT + k] != frame[k]:
            return 0, 0
    count = _uint32(data, count_at)
    return (points_at, count) if points_at + _POINT_BYTES * count == size else (0, 0)


@kernel
def _uint32(data, at):
    return (np.int64(data[at]) | np.int64(data[at + 1]) << 8 | np.int64(data[at + 2]) << 16
            | np.int64(data[at + 3]) << 24)


@kernel
def _int32(data, at):
    number = _uint32(data, at)
    return number - ((number & 0x80000000) << 1)

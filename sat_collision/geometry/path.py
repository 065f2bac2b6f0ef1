# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Where a body that follows a path of poses first meets an obstacle.

Between two poses the body moves with the twist that is constant in its own frame, so each segment
of the path is a prediction with horizon 1, decided as every prediction is. First come boxes: those
of the whole path, of chunks of segments and of segments leave out what is far away.
"""

from __future__ import annotations

from collections.abc import Iterable
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.body.box_index import rows_near
from sat_collision.geometry.body.layout import box_gap, packed_polygon, rows_of, USED
from sat_collision.geometry.body.moving import MovingBody, parts_about
from sat_collision.geometry.body.packing import PAIR
from sat_collision.geometry.body.polygon import array_of, as_polygon, BodyLike, doubles, Polygon
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import indexable, inner, kernel, scratch, scratch_integers
from sat_collision.geometry.motion.prediction import (
    BEYOND, first_met, Motion, path_of, ROUNDING, ways_of)
from sat_collision.geometry.motion.sweep import limits
from sat_collision.geometry.numeric.ascending import contains
from sat_collision.geometry.numeric.vectors import joined, LEAST, length, NOWHERE
from sat_collision.geometry.sets.polygon_set import NO_ROWS, PolygonSet, rows_within

_TOLERANCE = 1e-3
# How many segments are compared with the obstacles at once.
_CHUNK = 8


class PathContact(NamedTuple):
    """
    Where a path first meets an obstacle.

    Attributes
    ----------
    pose : float
        3.25 is a quarter of the way from pose 3 to pose 4, counted from 0.
    distance : float
        How far the origin of the body's frame has moved until there, along its arcs; metres.
    row : int
        The obstacle's row in the set, or its place in the sequence.

    Examples
    --------
    >>> first_contact_along([(1, 0)], [(3, 0, 0)], [[(4, 0)]])
    PathContact(pose=0.0, distance=0.0, row=0)

    """

    pose: float
    distance: float
    row: int


def first_contact_along(body: BodyLike, poses: ArrayLike,
                        obstacles: PolygonSet | Iterable[BodyLike],
                        margin: float = 0.0) -> PathContact | None:
    """
    Return where a body that follows a path first shares a point with an obstacle.

    The body is checked at all places between the poses, too: from one to the next it moves with a
    velocity and an angular velocity that are constant in its own frame, the shorter way round. So
    its origin moves on a line if the yaw stays the same, else on an arc.

    Parameters
    ----------
    body : Polygon, (n, 2) array_like or geometry
        The body in its own frame, convex or not; metres.
    poses : (k, 3) array_like
        x, y (m) and yaw (rad) of the body's frame in the frame of the obstacles, one pose at
        least. Where yaw changes by half a turn, up to rounding, either way is taken.
    obstacles : PolygonSet or sequence of Polygon, (n, 2) array_like or geometry
        The bodies that it may meet, at rest.
    margin : float, optional
        Bodies no further apart than this count as in contact, metres.

    Returns
    -------
    PathContact or None
        None: it shares no point with any obstacle, anywhere on the path. Otherwise a place no
        later than the first contact: there the bodies are within 1 mm, or 2^-25 of |t| (s + |t| r)
        if that is more, where the body turns by t, its origin moves by s and its farthest vertex
        is at r from its origin; and within 2^-40 of these lengths and the distance of the obstacle
        in addition, which is all where it does not turn. Pose 0.0: they share a point at the first
        pose, if and only if `intersects` says so of the vertices of ``Polygon(body)`` placed there
        (with a margin: if and only if `separation` is no more): x cos yaw - y sin yaw + pose x,
        x sin yaw + y cos yaw + pose y, each step rounded. Of several obstacles within these
        distances any may be named.

    Raises
    ------
    PolygonError
        Points that do not make a polygon, or no longer do once they are rounded at the first pose.
    ValueError
        Poses that are not finite numbers, or not of shape (k, 3), k at least 1; a margin that is
        negative or not finite; a segment beyond the largest double, or a sixteenth of it.

    Examples
    --------
    >>> found = first_contact_along([(0, 0), (1, 0)], [(0, 0, 0), (2, 0, 0), (6, 0, 0)],
    ...                             [[(2, 5)], [(4, 0)]])
    >>> round(found.pose, 9), round(found.distance, 9), found.row
    (1.25, 3.0, 1)

    """
    path = _checked(poses)
    margin = limits(_TOLERANCE, margin)[1]
    polygon = as_polygon(body)
    bodies = obstacles if isinstance(obstacles, PolygonSet) else PolygonSet(obstacles)
    return first_of_rows(polygon, path, bodies, margin)


def first_of_rows(polygon: Polygon, path: NDArray[np.float64], bodies: PolygonSet, margin: float,
                  skipped: NDArray[np.int64] = NO_ROWS) -> PathContact | None:
    """Return what `first_contact_along` does, for valid poses; leave out rows, ascending."""
    array, indexed = bodies._snapshot()
    near = rows_within(array, indexed, _placed(polygon, path[0]), margin)
    if len(near) and len(near := near[~np.isin(near, skipped)]):
        return PathContact(0.0, 0.0, int(near[0]))
    row, segment, share, distance = first_row_met_on(
        array, indexed, *polygon.packed, indexable(np.append(path, margin)),
        indexable(ways_of(None, int(array[USED]), 1.0)), indexable(skipped))
    if row < 0:
        return None
    pose = segment + share
    if pose - segment > share:
        pose = math.nextafter(pose, 0.0)
    return PathContact(pose, distance, row)


def _checked(poses: ArrayLike) -> NDArray[np.float64]:
    """Return poses as an array; raise `ValueError` if they are not valid."""
    try:
        array = doubles(array_of(poses))
    except (OverflowError, ValueError) as error:
        raise ValueError(f'poses are {error}; they have to be x, y and yaw in rows') from error
    if array.ndim != 2 or array.shape[1] != 3 or not len(array):
        raise ValueError(f'poses of shape {array.shape}, but it has to be (k, 3): x and y in '
                         'metres, yaw in rad, one pose at least')
    if not np.isfinite(array).all():
        raise ValueError(f'pose {np.flatnonzero(~np.isfinite(array).all(axis=1))[0]} is not '
                         'finite')
    return array


def _placed(polygon: Polygon, pose: NDArray[np.float64]) -> Polygon:
    x, y, yaw = pose.tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    count = len(polygon.vertices)
    return Polygon._of_bytes((polygon.vertices.tobytes(), 0, count, PAIR), count, count,
                             (c, -s, x, s, c, y))


@kernel
def first_row_met_on(set_array, indexed, body, count, poses, ways, skipped):
    """
    Find which row of a set, none of which moves, a body meets first after the first of some poses.

    The body is packed, in its own frame, poses are a flat array with the margin at its end, ways
    all 0, for each row; the rows in `skipped`, ascending, are left out.
    Return the row, or -1, the segment, the share of it and the length of all of them until there.
    """
    require_nearest(count)
    rows = rows_of(set_array)
    own = parts_about(packed_polygon(body, count), 0.0, 0.0, 1.0)
    radius = 0.0
    for k in range(0, len(own.array), 2):
        radius = max(radius, length(own.array[k], own.array[k + 1]))
    segments = len(poses) // 3 - 1
    margin = poses[3 * segments + 3]
    boxes = scratch(4 * segments)
    for segment in range(segments):
        _write_box(poses, segment, _motion(poses, segment, margin), radius, boxes)
    # Row by row for the whole path, unless it is quick to find those of each chunk.
    everywhere = around = close = scratch_integers(0)
    total = some = few = 0
    if not indexed:
        everywhere, total = rows_near(rows, indexed, _box(boxes, 0, segments))
        around = scratch_integers(total)
        close = scratch_integers(total)
    travelled = 0.0
    for segment in range(segments):
        if segment % _CHUNK == 0:
            box = _box(boxes, segment, min(segment + _CHUNK, segments))
            if indexed:
                around, some = rows_near(rows, indexed, box)
                close = scratch_integers(some)
            else:
                some = _those_in(rows, box, everywhere, total, skipped, around)
        motion = _motion(poses, segment, margin)
        box = _box(boxes, segment, segment + 1)
        few = _those_in(rows, box, around, some, skipped, close)
        way = length(motion.vx, motion.vy)
        if few > 0:
            body_there = _turned(own, poses[3 * segment + 2])
            row, share = first_met(path_of(body_there, motion), rows, ways, close, few)
            if row >= 0:
                return row, segment, share, travelled + share * way
        travelled += way
    return -1, segments, 0.0, travelled


@inner
def _motion(poses, segment, margin):
    """Return the motion from one pose to the next, with a horizon of 1."""
    k = 3 * segment
    yaw = poses[k + 2]
    turn = poses[k + 5] - yaw
    if abs(turn) > math.pi:
        c, s = math.cos(yaw), math.sin(yaw)
        next_c, next_s = math.cos(poses[k + 5]), math.sin(poses[k + 5])
        turn = math.atan2(c * next_s - s * next_c, c * next_c + s * next_s)
        if turn == 0.0:
            # Only a body that rests may count as resting.
            turn = LEAST
    half = turn / 2.0
    along = half / math.sin(half) * math.cos(half) if half != 0.0 else 1.0
    dx, dy = poses[k + 3] - poses[k], poses[k + 4] - poses[k + 1]
    return Motion(poses[k], poses[k + 1], along * dx + half * dy, along * dy - half * dx, turn,
                  1.0, _TOLERANCE, margin)


@inner
def _write_box(poses, segment, motion, radius, boxes):
    """Write the box of a segment: that of its chord, grown by how far points may be from it."""
    k = 3 * segment
    way = length(motion.vx, motion.vy)
    grown = radius + abs(motion.turn) * way / 8.0 + motion.margin
    for axis in range(2):
        start = poses[k + axis]
        end = poses[k + 3 + axis]
        more = grown + ROUNDING * (abs(start) + way + grown)
        if not 8.0 * (way + more) < math.inf:
            raise ValueError(BEYOND)
        boxes[4 * segment + axis] = min(start, end) - more
        boxes[4 * segment + axis + 2] = max(start, end) + more


@inner
def _box(boxes, segment, end):
    """Return min x, min y, max x, max y of the boxes of some segments."""
    box = NOWHERE
    for k in range(4 * segment, 4 * end, 4):
        box = joined(box, boxes[k], boxes[k + 1], boxes[k + 2], boxes[k + 3])
    return box


@inner
def _those_in(rows, box, among, size, skipped, found):
    """Write which of so many rows have bodies whose boxes meet a box; return how many."""
    count = 0
    for k in range(size):
        if (rows.n[among[k]] != 0 and box_gap(rows, among[k], box) <= 0.0
                and not contains(skipped, among[k])):
            found[count] = among[k]
            count += 1
    return count


@inner
def _turned(body, yaw):
    """Return a body as `parts_about` gives it, turned about its origin."""
    c, s = math.cos(yaw), math.sin(yaw)
    array = scratch(len(body.array))
    for k in range(0, len(array), 2):
        array[k] = c * body.array[k] - s * body.array[k + 1]
        array[k + 1] = s * body.array[k] + c * body.array[k + 1]
    return MovingBody(array, body.ends)

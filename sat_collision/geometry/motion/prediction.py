# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
When a body that moves with a constant twist meets bodies that rest or move straight.

The path is cut into pieces in which the body turns by at most 0.1 rad. In a piece each vertex is
moved along its chord, as in `sweep`, and the sagitta, the greatest distance between an arc and its
chord, is added to the margin: if the chords are clear by that, so is the piece. If not, the piece
is cut finer from there on, until the sagitta is a fraction of the tolerance. So the time found is
never late, and the bodies are within the tolerance then (docs/exactness.md, lemma 22). A straight
path is one piece without a sagitta. Times are shares of the horizon and speeds are ways up to
it, so that only these can overflow.

Most bodies at rest near the path are beside it and are left out at once: a point of a body that
turns keeps its distance from the centre of rotation, and a point of one that moves straight its
distance from a line along the path.
"""

from functools import lru_cache
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.body.box_index import bounds_of_index, rows_near
from sat_collision.geometry.body.layout import body_of, packed_polygon, rows_of
from sat_collision.geometry.body.moving import MovingBody, parts_about
from sat_collision.geometry.body.polygon import array_of, double, doubles
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import (
    beyond, elements, inlined, inner, kernel, scratch, scratch_integers)
from sat_collision.geometry.motion.sweep import first_contact_of_moving, limits
from sat_collision.geometry.numeric.ascending import contains
from sat_collision.geometry.numeric.predicates import UNDERFLOW_BOUND
from sat_collision.geometry.numeric.vectors import (
    bounds_of, grown, joined, LEAST, length, NOWHERE, unit)

# Max angle by which a body turns in a piece, rad, unless that takes too many pieces.
_TURN = 0.1
_MAX_PIECES = 4096
_FINEST = 1.0 / _MAX_PIECES
# Bound of the rounding error of a gap, relative to the coordinates and paths of both bodies.
ROUNDING = 2.0 ** -44
_FARTHEST = 2.0 ** 1020
# A smaller share of the horizon is none.
_LEAST_SHARE = 2.0 ** -1000
BEYOND = 'a path, or its distance from a body, is beyond the largest double, or nearly'


class Motion(NamedTuple):
    """How a body moves, and the limits of the query."""

    x: float  # the origin of the body's frame at time 0, m
    y: float
    vx: float  # how far it would get by the horizon, straight on, m
    vy: float
    turn: float  # rad
    horizon: float  # s
    tolerance: float  # m
    margin: float


class Path(NamedTuple):
    """The path of a body up to the horizon."""

    motion: Motion
    body: MovingBody  # as `parts_about` gives it, relative to the origin
    speed: float  # an upper bound of the ways of the vertices, m; 0 if and only if the body rests
    # An upper bound of a vertex's distance from the origin and of the length of its path, m.
    reach: float
    pieces: int  # that the path is cut into
    # Flat array of float64: min x, min y, max x, max y of each piece, then of the whole path;
    # relative to the origin.
    boxes: Any
    # The least and the greatest distance of the body from the centre of rotation; of one that
    # moves straight from a line along its path, negative on the right; m.
    inner: float
    outer: float


def motion_of(twist: ArrayLike, horizon: float, pose: ArrayLike, tolerance: float,
              margin: float) -> NDArray[np.float64]:
    """Return a `Motion` as an array; raise `ValueError` if a value is not valid."""
    vx, vy, turn = _finite(twist, 'twist', 'vx and vy in m/s, omega in rad/s').tolist()
    x, y, yaw = _finite(pose, 'pose', 'x and y in metres, yaw in rad').tolist()
    given, horizon = horizon, double(horizon)
    if not 0.0 <= horizon < math.inf:
        raise ValueError(
            f'horizon {given}, but it has to be a number, 0 or more seconds, and finite')
    tolerance, margin = limits(tolerance, margin)
    _require_finite(max(abs(vx), abs(vy), abs(turn)), horizon)
    vx, vy, turn = (speed * horizon or math.copysign(LEAST if speed and horizon else 0.0, speed)
                    for speed in (vx, vy, turn))
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([x, y, c * vx - s * vy, s * vx + c * vy, turn, horizon, tolerance, margin])


def _require_finite(fastest: float, horizon: float) -> None:
    if not fastest * horizon < _FARTHEST:
        raise ValueError('a twist or velocity leads beyond the largest double, or nearly, within '
                         f'the horizon of {horizon} s')


def ways_of(velocities: ArrayLike | None, rows: int, horizon: float) -> NDArray[np.float64]:
    """Return how far velocities lead rows by the horizon, flat; `ValueError` if not valid."""
    if velocities is None:
        return _at_rest(rows)
    try:
        array = doubles(array_of(velocities))
        if not rows and not array.size:
            return _at_rest(0)
    except OverflowError as error:
        raise ValueError(f'a velocity is {error}') from error
    except ValueError as error:
        raise ValueError(f'velocities are {error}') from error
    if array.shape != (rows, 2):
        raise ValueError(f'velocities of shape {array.shape}, but for {rows} rows it has to be '
                         f'({rows}, 2)')
    if not np.isfinite(array).all():
        raise ValueError(f'velocity {np.flatnonzero(~np.isfinite(array).all(axis=1))[0]} is not '
                         'finite')
    speeds = array.ravel()
    _require_finite(float(abs(speeds).max(initial=0.0)), horizon)
    ways = speeds * horizon
    if 0.0 < horizon < 1.0:
        # Only 0 becomes 0.
        lost = (ways == 0.0) & (speeds != 0.0)
        ways[lost] = np.copysign(LEAST, speeds[lost])
    return ways


@lru_cache(1)
def _at_rest(rows: int) -> NDArray[np.float64]:
    """Return the ways of rows at rest; many zeros take longer to write than to leave unread."""
    return np.zeros(2 * rows)


def _finite(values: ArrayLike, name: str, meaning: str) -> NDArray[np.float64]:
    try:
        array = doubles(array_of(values))
    except (OverflowError, ValueError):
        array = np.empty(0)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f'{name} {values!r}, but it has to be three finite numbers: {meaning}')
    return array


@kernel
def first_row_met(set_array, indexed, body, count, motion, ways, skipped):
    """
    Find which row of a set a moving body meets first, of those that it does not meet at time 0.

    The body is packed, the motion is a `Motion` as an array, ways are x, y of each row up to the
    horizon, and the rows in `skipped`, ascending, are left out. The index may be used if all rows
    are at rest. Return the row, the first one in a tie, and the time in seconds, above 0; -1 and
    infinity if it meets none. Raise `ValueError` for what is beyond the largest double.
    """
    require_nearest(count)
    rows = rows_of(set_array)
    motion = Motion(motion[0], motion[1], motion[2], motion[3], motion[4], motion[5], motion[6],
                    motion[7])
    path = path_of(parts_about(packed_polygon(body, count), motion.x, motion.y, 1.0), motion)
    listed = -1
    if indexed:
        candidates, listed = rows_near(rows, indexed, _surroundings(path, rows))
    else:
        candidates = scratch_integers(rows.used)
    near = 0
    for k in range(rows.used if listed < 0 else listed):
        row = k if listed < 0 else candidates[k]
        if (rows.n[row] != 0 and _may_meet(path, path.pieces, rows, row, ways)
                and not contains(skipped, row)):
            candidates[near] = row
            near += 1
    return first_met(path, rows, ways, candidates, near)


@inner
def _surroundings(path, rows):
    """Return a box that meets those of all rows of an indexed set that `_may_meet` the path."""
    motion = path.motion
    reach = _extent(path, *bounds_of_index(rows)) + motion.margin
    # Twice the rounding that `_may_meet` allows for, as this rounds otherwise.
    margin = motion.margin + (2.0 * ROUNDING * (path.reach + reach) + UNDERFLOW_BOUND)
    # The box after those of the pieces is that of the whole path.
    box = beyond(elements(path.boxes), 4 * path.pieces)
    return grown((box[0] + motion.x, box[1] + motion.y, box[2] + motion.x, box[3] + motion.y),
                 margin)


@inner
def first_met(path, rows, ways, candidates, count):
    """Do what `first_row_met` does, among so many rows near the path, which are overwritten."""
    near = 0
    overflows = False
    for k in range(count):
        row = candidates[k]
        # Sums of a few such lengths must not overflow; if they do, boxes are never apart.
        reach = path.reach + _reach(path, rows, row, ways)
        overflows = overflows or not 8.0 * reach < math.inf
        if not _is_beside(path, rows, row, ways):
            candidates[near] = row
            near += 1
    if overflows:
        raise ValueError(BEYOND)
    first, share, piece = -1, math.inf, 0
    while first < 0 and piece < path.pieces:
        for k in range(near):
            row = candidates[k]
            if _may_meet(path, piece, rows, row, ways):
                found = _first_contact_in_piece(path, piece, rows, row, ways, share)
                if found < share:
                    first, share = row, found
        piece += 1
    if first < 0:
        return first, math.inf
    time = share * path.motion.horizon if share > _LEAST_SHARE else 0.0
    # Only a subnormal time may be rounded up by much, and only that becomes less.
    return first, max(time - LEAST, LEAST)


@inner
def path_of(body, motion):
    """Return the path of a body given as `parts_about` gives it, relative to the origin."""
    radius = 0.0
    for k in range(0, len(body.array), 2):
        radius = max(radius, length(body.array[k], body.array[k + 1]))
    speed = length(motion.vx, motion.vy) + abs(motion.turn) * radius
    if radius > 0.0 and motion.turn != 0.0:
        speed += LEAST
    if not 8.0 * (radius + speed) < math.inf:
        raise ValueError(BEYOND)
    pieces = max(1, int(math.ceil(min(abs(motion.turn) / _TURN, _MAX_PIECES))))
    boxes = scratch(4 * pieces + 4)
    path = Path(motion, body, speed, radius + speed, pieces, boxes, *_distances(body, motion))
    _bound(path)
    return path


@inner
def _distances(body, motion):
    """Return `inner` and `outer` of a path, or the same of a body at rest."""
    v = elements(body.array)
    size = len(body.array)
    least, most = math.inf, -math.inf
    if motion.turn == 0.0:
        ux, uy = unit(motion.vx, motion.vy)
        for k in range(0, size, 2):
            height = ux * v[k + 1] - uy * v[k]
            least = min(least, height)
            most = max(most, height)
        return least, most
    x, y = -motion.vy / motion.turn, motion.vx / motion.turn
    first = 0
    for i in range(len(body.ends)):
        end = body.ends[i] // 2
        nearest = math.inf
        nearest_x = nearest_y = 0.0
        # The part is on the left of each edge: if the centre is on the right, beyond its line.
        height = -math.inf
        ax, ay = v[end - 2] - x, v[end - 1] - y
        for k in range(first, end, 2):
            bx, by = v[k] - x, v[k + 1] - y
            away = length(bx, by)
            most = max(most, away)
            if away < nearest:
                nearest = away
                nearest_x, nearest_y = bx, by
            ux, uy = unit(bx - ax, by - ay)
            height = max(height, ay * ux - ax * uy)
            ax, ay = bx, by
        ux, uy = unit(nearest_x, nearest_y)
        for k in range(first, end, 2):
            nearest = min(nearest, (v[k] - x) * ux + (v[k + 1] - y) * uy)
        least = min(least, max(nearest, height))
        first = end
    return least, most


@inner
def _bound(path):
    """Write the boxes of the pieces of a path, and of the whole path."""
    chords = scratch(2 * len(path.body.array))
    whole = NOWHERE
    for piece in range(path.pieces):
        start, end = _times(path, piece)
        sagitta = _sagitta(path, end - start)
        _write_pose(path, start, chords, 0)
        _write_pose(path, end, chords, 2)
        min_x, min_y, max_x, max_y = bounds_of(chords, len(chords) // 2)
        box = min_x - sagitta, min_y - sagitta, max_x + sagitta, max_y + sagitta
        whole = joined(whole, box[0], box[1], box[2], box[3])
        for k in range(4):
            path.boxes[4 * piece + k] = box[k]
    for k in range(4):
        path.boxes[4 * path.pieces + k] = whole[k]


@inlined
def _times(path, piece):
    """Return when a piece of a path begins and ends; the piece after the last is all of it."""
    if piece == path.pieces:
        return 0.0, 1.0
    return piece / path.pieces, (piece + 1) / path.pieces


@inlined
def _sagitta(path, share):
    """Return the max distance of a vertex from its place on the chord of a share of the path."""
    return abs(path.motion.turn) * path.speed * share * share / 8.0


@inner
def _write_pose(path, time, chords, place):
    """Write x, y of each vertex at a time as the start (place 0) or end (2) of its chord."""
    motion = path.motion
    half = motion.turn * time / 2.0
    c, s = math.cos(half), math.sin(half)
    # A product with a subnormal number may be off by much.
    along = time * (s / half) if half != 0.0 else time
    x = along * (c * motion.vx - s * motion.vy)
    y = along * (s * motion.vx + c * motion.vy)
    # Turned by 2 half: cosine 1 - 2 s^2, sine 2 s c.
    v = elements(path.body.array)
    chords = elements(chords)
    for k in range(0, len(path.body.array), 2):
        chords[2 * k + place] = v[k] - 2.0 * s * (s * v[k] + c * v[k + 1]) + x
        chords[2 * k + place + 1] = v[k + 1] + 2.0 * s * (c * v[k] - s * v[k + 1]) + y


@inner
def _may_meet(path, piece, rows, row, ways):
    """Return whether, by their boxes, a piece of the path may come to the body of a row."""
    motion = path.motion
    start, end = _times(path, piece)
    vx, vy = ways[2 * row], ways[2 * row + 1]
    if path.speed == 0.0 and vx == 0.0 and vy == 0.0:
        return False
    margin = motion.margin + _rounding(path, rows, row, ways)
    box = 4 * piece
    return not (
        rows.min_x[row] - motion.x + min(vx * start, vx * end) - path.boxes[box + 2] > margin
        or rows.min_y[row] - motion.y + min(vy * start, vy * end) - path.boxes[box + 3] > margin
        or path.boxes[box] - (rows.max_x[row] - motion.x + max(vx * start, vx * end)) > margin
        or path.boxes[box + 1] - (rows.max_y[row] - motion.y + max(vy * start, vy * end)) > margin)


@inner
def _is_beside(path, rows, row, ways):
    """Return whether a row's body is at rest and beside the path, beyond the tolerances."""
    motion = path.motion
    if ways[2 * row] != 0.0 or ways[2 * row + 1] != 0.0:
        return False
    least, most = _distances(parts_about(body_of(rows, row), motion.x, motion.y, 1.0), motion)
    centre = length(motion.vx, motion.vy) / abs(motion.turn) if motion.turn != 0.0 else 0.0
    margin = (motion.margin + max(motion.tolerance, 4.0 * _sagitta(path, _FINEST))
              + ROUNDING * centre + _rounding(path, rows, row, ways))
    return least - path.outer > margin or path.inner - most > margin


@inlined
def _rounding(path, rows, row, ways):
    """Return a bound of the rounding error of a gap between the moving body and that of a row."""
    return ROUNDING * (path.reach + _reach(path, rows, row, ways)) + UNDERFLOW_BOUND


@inlined
def _reach(path, rows, row, ways):
    """Return what coordinates of a row's body, its way and the margin come to at most."""
    extent = _extent(path, rows.min_x[row], rows.min_y[row], rows.max_x[row], rows.max_y[row])
    return extent + (abs(ways[2 * row]) + abs(ways[2 * row + 1])) + path.motion.margin


@inlined
def _extent(path, min_x, min_y, max_x, max_y):
    """Return the greatest distance of bounds from the origin of a path, along x or y."""
    x = max(abs(min_x - path.motion.x), abs(max_x - path.motion.x))
    y = max(abs(min_y - path.motion.y), abs(max_y - path.motion.y))
    return max(x, y)


@inner
def _first_contact_in_piece(path, piece, rows, row, ways, before):
    """Return when in a piece the body meets that of a row; infinity if not before `before`."""
    vx, vy = ways[2 * row], ways[2 * row + 1]
    apart = path.motion.margin + _rounding(path, rows, row, ways)
    other = parts_about(body_of(rows, row), path.motion.x, path.motion.y, 1.0)
    chords = scratch(2 * len(path.body.array))
    other_chords = scratch(2 * len(other.array))
    start, end = _times(path, piece)
    step = end - start
    while start < end and start < before:
        stop = min(start + step, end)
        sagitta = _sagitta(path, stop - start)
        _write_pose(path, start, chords, 0)
        _write_pose(path, stop, chords, 2)
        for k in range(0, len(other.array), 2):
            other_chords[2 * k] = other.array[k] + vx * start
            other_chords[2 * k + 1] = other.array[k + 1] + vy * start
            other_chords[2 * k + 2] = other.array[k] + vx * stop
            other_chords[2 * k + 3] = other.array[k + 1] + vy * stop
        share = first_contact_of_moving(chords, path.body.ends, other_chords, other.ends, sagitta,
                                        sagitta + apart)
        if share == math.inf:
            start = stop
            step *= 2.0
            continue
        time = start + share * (stop - start)
        if time >= before or sagitta <= path.motion.tolerance / 4.0 or step <= _FINEST:
            return time
        # Go on from the time proved clear, but so that the next step ends no later than this one.
        step = max(step / 4.0, _FINEST)
        start = max(start, min(time, stop - step))
    return math.inf

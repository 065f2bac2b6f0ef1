# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bodies at one moment, in consecutive sets, and in linear motion between two moments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import copy
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.body.moving import STRIDE
from sat_collision.geometry.body.packing import DOUBLE, PAIR, SIZES, TRIPLE
from sat_collision.geometry.body.polygon import Affine2D, Polygon
from sat_collision.messages.ingest import Placement
from sat_collision.replay.motion.kernels import (
    COUNT, describe, EARLIEST, END, FINISH, FIRST, follow, LATEST, MAY_REPEAT, MOTIONS,
    MOTIONS_BEGIN, motions_between, MOTIONS_END, POINT, POINTS_END, ROW, ROWS_END, STAMP, START,
    STEP)
from sat_collision.scene.obstacles import ObstacleId

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Interval: TypeAlias = tuple[int, int]  # from one time to another, ns

# The longest motion that is interpolated, whatever the timeout, ns.
LONGEST = 10 * 10**9
_IDENTITY = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
_NO_PLANES = np.empty((0, len(_IDENTITY)))
_NO_PLACES = np.empty(0, np.int64)


class MotionArrays(NamedTuple):
    """The motions of m bodies from one set to the next, as `motions_between` writes them."""

    rows: Integers  # (m,)
    next_rows: Integers  # (m,)
    array: Floats
    times: Integers  # (m, 3)
    boxes: Floats  # (m, 4)
    moved: Floats  # (m,)

    @classmethod
    def of(cls, rows: Integers, next_rows: Integers, points: int) -> MotionArrays:
        """Allocate arrays for the motions of some rows with at most so many points in total."""
        count = len(rows)
        return cls(rows, next_rows, np.empty(STRIDE * points), np.empty((count, 3), np.int64),
                   np.empty((count, 4)), np.empty(count))


class SetBatch:
    """
    Sets of bodies, described in one call, with the motions from each set to the next.

    Sets are given by their messages. A motion takes at most `longest` ns; with 0 there are no
    motions. See `describe` and `follow` for the contents of the arrays.
    """

    def __init__(self, sets: Sequence[Sequence[Placement]], longest: int = 0) -> None:
        pieces = []
        places: list[ArrayLike] = [_NO_PLACES]
        messages: list[int] = []
        affines: list[Affine2D | None] = []
        rings = at = 0
        for number, placements in enumerate(sets):
            for _, stamp, _, (data, where, count, step), affine, *_ in placements:
                run, points_at = 1, 0
                if isinstance(where, int):
                    data = data[where:where + SIZES[step] * count]
                    places.append((0, count) if step == PAIR else (len(data),))
                elif step == PAIR:
                    run = len(where) // 2
                    places.append(where)
                else:
                    run, points_at = 1 + len(where), count
                    places += where, (len(data),)
                if step == PAIR and (gap := -at % DOUBLE):
                    pieces.append(bytes(gap))
                    at += gap
                messages += number, run, at, stamp, points_at, step
                affines.append(affine)
                rings += run
                at += len(data)
                pieces.append(data)
        maps: Floats = _NO_PLANES
        if any(affines):
            maps = np.array([affine or _IDENTITY for affine in affines])
        self.points = np.empty((at // SIZES[TRIPLE], 2))
        self.rings: Integers = np.empty((rings, 4), np.int64)
        self.boxes = np.empty((rings, 4))
        self.sets: Integers = np.zeros((len(sets), MOTIONS_END + 1), np.int64)
        described = self.points, self.rings, self.boxes, self.sets
        describe(b''.join(pieces), np.array(messages, np.int64).reshape(-1, STEP + 1),
                 np.concatenate(places), maps, described)
        if longest and len(sets):
            rows, next_rows = np.empty((2, rings), np.int64)
            self.motions = MotionArrays.of(rows, next_rows, len(self.points))
            follow(described, longest, tuple(self.motions))
        self.numbers: list[list[int]] = self.sets.tolist()


class Bodies:
    """
    The outlines of some bodies in a batch: one footprint, or the obstacles of a set.

    There may be more names than bodies. The frame is empty if the bodies are in different ones.
    With `is_between` the bodies were not received, but computed at a time between two messages.
    """

    def __init__(self, names: Sequence[ObstacleId], batch: SetBatch, number: int = 0,
                 frame_id: str = '', is_between: bool = False) -> None:
        self._described = batch
        self._numbers = numbers = batch.numbers[number]
        self._count = numbers[ROWS_END] - numbers[ROW]
        # None if the stamps are not those of the batch.
        self.batch: SetBatch | None = batch
        self.number = number
        self.names = names
        self.frame_id = frame_id
        self.is_between = is_between
        # The first and the last stamp, 0 if there are no bodies.
        self.begin, self.end = numbers[EARLIEST], numbers[LATEST]
        # Whether two outlines may be equal bit by bit as received.
        self.may_repeat = bool(numbers[MAY_REPEAT])

    def __len__(self) -> int:
        return self._count

    @cached_property
    def points(self) -> Floats:
        """The points of all bodies, see `describe`; so are the rings and boxes."""
        return self._described.points[self._numbers[POINT]:self._numbers[POINTS_END]]

    @cached_property
    def rings(self) -> Integers:
        return self._described.rings[self._numbers[ROW]:self._numbers[ROWS_END]]

    @cached_property
    def boxes(self) -> Floats:
        return self._described.boxes[self._numbers[ROW]:self._numbers[ROWS_END]]

    @cached_property
    def _polygons(self) -> dict[int, Polygon]:
        return {}

    @property
    def stamps(self) -> Integers:
        """The stamp of each body, ns."""
        return self.rings[:, STAMP]

    @property
    def middles(self) -> Floats:
        """The middle of each box, (n, 2)."""
        return 0.5 * self.boxes[:, :2] + 0.5 * self.boxes[:, 2:]

    @property
    def moments(self) -> Sequence[int]:
        """The stamps of the bodies; just one if all are equal."""
        return [self.begin] if self.begin == self.end else self.stamps.tolist()

    def at(self, times: Mapping[int, int]) -> Bodies:
        """Return the same bodies, some of the rows in the same places at other times."""
        other = copy.copy(self)
        other.batch = None
        other.rings = self.rings.copy()
        other.stamps[[*times]] = [*times.values()]
        other.begin, other.end = int(other.stamps.min()), int(other.stamps.max())
        return other

    def follows(self, before: Bodies) -> bool:
        """Return whether `before` is the set before this one in the same batch."""
        return (self.batch is not None and before.batch is self.batch
                and before.number == self.number - 1)

    @property
    def followed(self) -> int:
        """How many bodies of the set before it in the batch were matched to one of it."""
        assert self.batch is not None
        return self._numbers[MOTIONS] - self.batch.numbers[self.number - 1][MOTIONS]

    def ring(self, row: int) -> Floats:
        """Return the vertices of a body as received, (n, 2)."""
        first = self.rings[row, FIRST]
        return self.points[first:first + self.rings[row, COUNT]]

    def polygon(self, row: int) -> Polygon:
        found = self._polygons.get(row)
        if found is None:
            found = self._polygons[row] = _polygon(self.ring(row))
        return found


class LinearMotion:
    """
    Bodies that move from one moment to the next, each vertex on a straight line.

    There is at least one motion. The first one begins at `begin`, and the last one ends at `end`.
    """

    def __init__(self, before: Bodies, after: Bodies, motions: MotionArrays, begin: int,
                 end: int) -> None:
        self.before = before
        self.after = after
        self.begin, self.end = begin, end
        self.rows, self.next_rows, self._array, self._times, self.boxes, self.moved = motions

    @property
    def starts(self) -> Integers:
        """When each motion begins, ns."""
        return self._times[:, START]

    @property
    def finishes(self) -> Integers:
        """When each motion ends, ns."""
        return self._times[:, FINISH]

    def __len__(self) -> int:
        return len(self.rows)

    def ring(self, i: int, time: int) -> Floats:
        """Return the vertices of a body at a time, (n, 2)."""
        end, start, finish = self._times[i].tolist()
        first = self._times[i - 1, END] if i else 0
        moving: Floats = self._array[first:end].reshape(-1, STRIDE)
        if time <= start:
            return moving[:, :2]
        if time >= finish:
            return moving[:, 2:]
        moved: Floats = (time - start) / (finish - start) * (moving[:, 2:] - moving[:, :2])
        return moving[:, :2] + moved

    def polygon(self, i: int, time: int) -> Polygon:
        """Return a body at a time; PolygonError if its vertices make no valid polygon then."""
        if time <= self.starts[i] or not self.moved[i]:
            return self.before.polygon(int(self.rows[i]))
        if time >= self.finishes[i]:
            return self.after.polygon(int(self.next_rows[i]))
        return _polygon(self.ring(i, time))


def _polygon(ring: Floats) -> Polygon:
    """Return what a ring makes, whose number of vertices was checked when it was received."""
    return Polygon(ring, len(ring))


def motion_between(before: Bodies, after: Bodies, rows: Integers,
                   next_rows: Integers) -> LinearMotion:
    """Return the motion of bodies from one moment to another, given which row becomes which."""
    motions = MotionArrays.of(rows, next_rows, len(before.points))
    begin, end = motions_between(before.points, before.rings, rows, after.points, after.rings,
                                 next_rows, motions[2:])
    return LinearMotion(before, after, motions, int(begin), int(end))


def motion_in_batch(before: Bodies, after: Bodies) -> list[LinearMotion]:
    """Return the motion from the set before in the batch; nothing if no body was matched."""
    assert after.batch is not None
    motions = after.batch.motions
    last, own = after.batch.numbers[before.number:after.number + 1]
    if last[MOTIONS] == own[MOTIONS]:
        return []
    found = slice(last[MOTIONS], own[MOTIONS])
    return [LinearMotion(before, after, MotionArrays(
        motions.rows[found], motions.next_rows[found],
        motions.array[STRIDE * last[POINT]:STRIDE * own[POINT]], motions.times[found],
        motions.boxes[found], motions.moved[found]), own[MOTIONS_BEGIN], own[MOTIONS_END])]


def stay(bodies: Bodies, until: Mapping[int, int]) -> LinearMotion:
    """Return the motion of bodies that stand still, each of the rows until its time."""
    rows = np.array(list(until), np.int64)
    return motion_between(bodies, bodies.at(until), rows, rows)

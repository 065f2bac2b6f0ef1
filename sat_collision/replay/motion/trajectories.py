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

"""Bodies at a moment, between two moments, and the trajectory of a footprint."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
import copy
from functools import cached_property, reduce
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.layout import packed_size
from sat_collision.geometry.moving import STRIDE
from sat_collision.geometry.polygon import (
    MAX_VERTICES, PackedBody, PlaneMap, Polygon, PolygonError)
from sat_collision.messages.cdr import POINT_SIZE, Points
from sat_collision.messages.placement import Placement
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.replay.motion.kernels import (
    COUNT, describe, END, FINISH, FIRST, motions_between, MOVED, pack_ring, STAMP, START)
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import NEVER

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]

NUMBERS = 3  # a point's, in a message
IDENTITY = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
NO_PLANES = np.empty((0, len(IDENTITY)))


class Rings(NamedTuple):
    """
    The outlines of some bodies as received.

    Attributes
    ----------
    data : bytes
    starts, lengths : (n,) array of int
        Where in it the points of each are, and how many.
    stamps : (n,) or (1,) array of int
        When each was there, or all, ns.
    planes : (n, 6) array
        The map that takes each to the frame that all are in; empty if they are in it.

    """

    data: bytes
    starts: Integers
    lengths: Integers
    stamps: Integers
    planes: Floats


def rings_of(placements: Sequence[Placement]) -> Rings:
    """Return the outlines of all messages of some placements, in their order."""
    if len(placements) == 1 and placements[0].plane is None:
        _, stamp, _, _, (data, start, count), *_ = placements[0]
        if isinstance(start, int) or isinstance(count, int):
            start, count = np.array([[start], [count]])
        return Rings(data, start, count, np.array([stamp]), NO_PLANES)
    stamps: list[int] = []
    planes: list[PlaneMap | None] = []
    pieces, starts, lengths = [], [], []
    at = 0
    for placement in placements:
        data, start, count = placement.points
        pieces.append(data)
        number = 1
        if isinstance(start, int) or isinstance(count, int):
            starts.append(at + start)
            lengths.append(count)
        else:
            number = len(start)
            starts += (at + start).tolist()
            lengths += count.tolist()
        stamps += number * [placement.stamp]
        planes += number * [placement.plane]
        at += len(data)
    maps: Floats = NO_PLANES
    if any(plane is not None for plane in planes):
        maps = np.array([plane or IDENTITY for plane in planes])
    return Rings(b''.join(pieces), np.array(starts, np.int64), np.array(lengths, np.int64),
                 np.array(stamps, np.int64), maps)


class Bodies:
    """
    The outlines of some bodies: one footprint, or the obstacles of a set.

    Parameters
    ----------
    names : sequence of ObstacleId
    rings : Rings
    max_vertices : int, optional
    frame_id : str, optional
        The frame that all are in, empty if there is none.
    is_between : bool, optional
        Whether they were not received, but lie between what was.

    Attributes
    ----------
    begin, end : int
        When the first and the last one was there; 0 if there is none.
    points : (v, 2) array
        The points of all rings.
    rings : (n, 4) array of int
        What `describe` says of each.
    boxes : (n, 4) array
        min x, min y, max x, max y.
    may_repeat : bool
        Whether two outlines may be the same to the bit.

    """

    def __init__(self, names: Sequence[ObstacleId], rings: Rings,
                 max_vertices: int = MAX_VERTICES, frame_id: str = '',
                 is_between: bool = False) -> None:
        self.names = names
        self.frame_id = frame_id
        self.is_between = is_between
        count = len(rings.starts)
        self.points = np.empty((len(rings.data) // POINT_SIZE, 2))
        self.rings: Integers = np.empty((count, 4), np.int64)
        self.boxes = np.empty((count, 4))
        begin, end, self.may_repeat = describe(*rings, (self.points, self.rings, self.boxes))
        self.begin, self.end = int(begin), int(end)
        self._max_vertices = max_vertices
        self._polygons: dict[int, Polygon] = {}

    def __len__(self) -> int:
        return len(self.names)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, '_polygons': {}}

    @property
    def stamps(self) -> Integers:
        """When each was there, ns."""
        return self.rings[:, STAMP]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Which bodies are known to have come here from somewhere else."""
        moving: NDArray[np.bool_] = self.rings[:, MOVED] != 0
        return moving

    @property
    def middles(self) -> Floats:
        """The middle of each box, (n, 2)."""
        return 0.5 * self.boxes[:, :2] + 0.5 * self.boxes[:, 2:]

    @property
    def moments(self) -> Sequence[int]:
        """All times at which one of them was there."""
        return [self.begin] if self.begin == self.end else self.stamps.tolist()

    def at(self, stamps: Sequence[int]) -> Bodies:
        """Return the same bodies, in the same places at other times."""
        other = copy.copy(self)
        other.rings = self.rings.copy()
        other.rings[:, STAMP] = stamps
        other.begin, other.end = min(stamps), max(stamps)
        return other

    def ring(self, row: int) -> Floats:
        """Return the vertices of a body as received, (n, 2)."""
        first = self.rings[row, FIRST]
        return self.points[first:first + self.rings[row, COUNT]]

    def polygon(self, row: int) -> Polygon:
        """Return a body."""
        found = self._polygons.get(row)
        if found is None:
            found = self._polygons[row] = Polygon(self.ring(row), self._max_vertices)
        return found


class LinearMotion:
    """
    Bodies that move from one moment to the next, each vertex on a straight line.

    Parameters
    ----------
    before, after : Bodies
    rows, next_rows : (m,) array of int, m >= 1
        Which body becomes which; both have as many vertices.
    finishes : sequence of int, optional
        When each way ends in ns; that of the body that it leads to where none is given.

    Attributes
    ----------
    begin, end : int
        When the first one begins and the last one ends.
    boxes : (m, 4) array
        What bounds all of each way.
    moved : (m,) array
        How far the vertex goes that goes furthest, m.

    """

    def __init__(self, before: Bodies, after: Bodies, rows: Integers, next_rows: Integers,
                 finishes: Sequence[int] | None = None) -> None:
        self.before = before
        self.after = after
        self.rows = rows
        self.next_rows = next_rows
        count = len(rows)
        self._array = np.empty(STRIDE * len(before.points))
        self._ways = np.empty((count, 3), np.int64)
        self.boxes, self.moved = np.empty((count, 4)), np.empty(count)
        begin, end = motions_between(
            before.points, before.rings, rows, after.points, after.rings, next_rows,
            (self._array, self._ways, self.boxes, self.moved))
        self.begin, self.end = int(begin), int(end)
        if finishes is not None:
            self._ways[:, FINISH] = finishes
            self.end = max(finishes)

    @property
    def starts(self) -> Integers:
        """When each way begins, ns."""
        return self._ways[:, START]

    @property
    def finishes(self) -> Integers:
        """When each way ends, ns."""
        return self._ways[:, FINISH]

    def __len__(self) -> int:
        return len(self.rows)

    def ring(self, i: int, time: int) -> Floats:
        """Return the vertices of a body at a time on its way, (n, 2)."""
        end, start, finish = self._ways[i].tolist()
        first = self._ways[i - 1, END] if i else 0
        way: Floats = self._array[first:end].reshape(-1, STRIDE)
        if time <= start:
            return way[:, :2]
        if time >= finish:
            return way[:, 2:]
        moved: Floats = (time - start) / (finish - start) * (way[:, 2:] - way[:, :2])
        return way[:, :2] + moved

    def polygon(self, i: int, time: int) -> Polygon:
        """
        Return a body at a time on its way.

        Raises
        ------
        PolygonError
            If its vertices do not make one there.

        """
        if time <= self.starts[i] or not self.moved[i]:
            return self.before.polygon(int(self.rows[i]))
        if time >= self.finishes[i]:
            return self.after.polygon(int(self.next_rows[i]))
        return Polygon(self.ring(i, time))


def stay(bodies: Bodies, until: Mapping[int, int]) -> LinearMotion:
    """Return the motion of bodies that stand where they are, of each row until a time."""
    rows = np.array(list(until), np.int64)
    return LinearMotion(bodies, bodies, rows, rows, list(until.values()))


_ONE = np.zeros(1, np.int64)
# min x, min y, max x, max y.
Box: TypeAlias = tuple[float, float, float, float]


class Piece:
    """
    The way of a footprint from one sample to the next, or one sample alone.

    Parameters
    ----------
    before, after : Bodies

    Attributes
    ----------
    begin, end : int
        In ns.
    box : Box
        What bounds all of it.

    """

    def __init__(self, before: Bodies, after: Bodies) -> None:
        self.before = before
        self.after = after
        self.begin, self.end = before.begin, after.begin
        self.box: Box = tuple(before.boxes[0].tolist())
        if after is not before:
            self.box = _around(self.box, after.boxes[0].tolist())

    @cached_property
    def motion(self) -> LinearMotion:
        """The way, vertex by vertex."""
        return LinearMotion(self.before, self.after, _ONE, _ONE)

    def ring(self, time: int) -> Floats:
        """Return the vertices at a time on the way, (n, 2); those of a sample as received."""
        if self.begin < time < self.end:
            return self.motion.ring(0, time)
        return (self.before if time <= self.begin else self.after).ring(0)


def _around(box: Sequence[float], other: Sequence[float]) -> Box:
    (a, b, c, d), (e, f, g, h) = box, other
    return min(a, e), min(b, f), max(c, g), max(d, h)


class Trajectory:
    """
    The samples of a footprint, and the pieces of its way.

    A piece leads from one sample to the next if no refused footprint came between them, if they
    are no further apart in time than the timeout, and if they have as many vertices. A sample
    alone is a piece without length.

    Parameters
    ----------
    timeout : int or float
        In ns, or NEVER.
    longest : int
        Over how long a motion is made up at most, ns.

    Attributes
    ----------
    latest : int or None
        Stamp of the last sample.
    undetermined : int
        For how long the way is not known though the footprint was there, ns.

    """

    def __init__(self, timeout: float, longest: int) -> None:
        self._never_stale = timeout == NEVER
        self._longest = min(timeout, longest)
        self.latest: int | None = None
        self.undetermined = 0
        self._pieces: list[Piece] = []
        self._starts: list[int] = []
        self._last: tuple[int, Bodies] | None = None
        self._outline: tuple[int, Polygon | None] = -1, None

    def add(self, time: int, sample: Bodies) -> None:
        """Take a footprint as received; one that comes late tells nothing new."""
        begin, last = self._last or (None, sample)
        if begin is not None and begin - self._longest <= time < begin:
            return
        self._last, self.latest = (time, sample), time
        if begin is None or time < begin:
            self._append(Piece(sample, sample))
        elif time > begin:
            if time - begin <= self._longest and (
                    last.rings[0, COUNT] == sample.rings[0, COUNT]):
                self._append(Piece(last, sample))
            else:
                self.undetermined += round(min(time - begin, self._longest))
                self._append(Piece(sample, sample))

    def lose(self) -> None:
        """Mark that the footprint is nowhere until its next sample."""
        self._last = None

    def lose_way(self, until: int) -> None:
        """Mark that it is not known where the footprint was until its next sample."""
        if self._last is not None:
            self.undetermined += until - self._last[0]
        self.lose()

    def begin_of_way(self, until: int) -> int | None:
        """Return when the way began that leads to a sample at a time, None if none does."""
        if self._last is None or not 0 < until - self._last[0] <= self._longest:
            return None
        return self._last[0]

    def stand(self, until: int) -> None:
        """Let a footprint that never times out have stood where it is until a time."""
        if self._never_stale and self._last is not None and self._last[0] < until:
            self.add(until, self._last[1].at([until]))

    def drop_before(self, time: int) -> None:
        """Forget the pieces that end before a time."""
        while len(self._pieces) > 1 and self._pieces[0].end < time:
            del self._pieces[0], self._starts[0]

    def pieces(self, start: int, finish: int) -> list[tuple[int, int, Piece]]:
        """Return the beginning and the end of each piece between two times, with its way."""
        starts, pieces = self._starts, self._pieces
        k = max(bisect_right(starts, start) - 1, 0)
        if starts and starts[k] <= start < finish <= pieces[k].end and (
                not k or pieces[k - 1].end <= start):
            return [(start, finish, pieces[k])]
        # Pieces of no length may share their time with the end of the one before.
        while k > 0 and pieces[k - 1].end >= start:
            k -= 1
        found: list[tuple[int, int, Piece]] = []
        while k < len(starts) and starts[k] <= finish:
            begin, end = max(starts[k], start), min(pieces[k].end, finish)
            # An instant that is the end of the piece before, or begins the next, adds nothing.
            if begin < end or begin == end and not (found and found[-1][1] == end) and not (
                    k + 1 < len(starts) and max(starts[k + 1], start) == end
                    and end < min(pieces[k + 1].end, finish)):
                found.append((begin, end, pieces[k]))
            k += 1
        return found

    def bounds(self, start: int, finish: int) -> Box | None:
        """Return what bounds the footprint between two times, None if it is nowhere then."""
        if start == finish:
            piece = self._piece_at(start)
            return None if piece is None else piece.box
        boxes = [piece.box for _, _, piece in self.pieces(start, finish)]
        return reduce(_around, boxes) if boxes else None

    def samples(self, after: int, until: int) -> list[int]:
        """Return the stamps of the samples after one time and until another."""
        first, end = bisect_right(self._starts, after), bisect_right(self._starts, until)
        found = {piece.begin for piece in self._pieces[first:end] if not piece.before.is_between}
        if self.latest is not None and after < self.latest <= until:
            found.add(self.latest)
        return sorted(found)

    def way_from(self, time: int) -> LinearMotion | None:
        """Return the piece that begins at a time and leads on from there, None if none does."""
        for k in range(bisect_left(self._starts, time), bisect_right(self._starts, time)):
            if self._pieces[k].end > time:
                return self._pieces[k].motion
        return None

    def packed(self, time: int) -> PackedBody | None:
        """Return where the footprint was at a time as `outline` does, packed."""
        piece = self._piece_at(time)
        if piece is not None and self._outline[0] != time:
            ring = piece.ring(time)
            array = indexable(np.empty(packed_size(len(ring))))
            if count := pack_ring(ring, 0, len(ring), array):
                return array, count
        outline = self.outline(time)
        return None if outline is None else outline.packed

    def outline(self, time: int) -> Polygon | None:
        """Return where the footprint was at a time, None if that is not known."""
        if self._outline[0] != time:
            self._outline = time, self._find_outline(time)
        return self._outline[1]

    def _find_outline(self, time: int) -> Polygon | None:
        piece = self._piece_at(time)
        try:
            return None if piece is None else piece.motion.polygon(0, time)
        except PolygonError:
            return None

    def _piece_at(self, time: int) -> Piece | None:
        """Return the first piece that has a time; those that meet there end in one sample."""
        found = None
        for k in range(bisect_right(self._starts, time) - 1, -1, -1):
            if self._pieces[k].end < time:
                break
            found = self._pieces[k]
        return found

    def _append(self, piece: Piece) -> None:
        if self._starts and piece.begin < self._starts[-1]:
            # The clock of the stamps was set back: what was before belongs to another time.
            self._pieces.clear()
            self._starts.clear()
        self._pieces.append(piece)
        self._starts.append(piece.begin)


# How far a vertex may be from the straight line that stands for its way, in m: to this the sweep
# decides, too.
TOLERANCE = 1e-6

_SHORTEST = 4


class _UnknownError(Exception):
    """It is not known where the frame was at some time."""


class Poses:
    """
    The poses of an outline.

    Parameters
    ----------
    transforms : TransformListener
    frame_id : str
        That the outline is in.
    points : Points
        The outline.

    """

    def __init__(self, transforms: TransformListener, frame_id: str, points: Points) -> None:
        self._transforms = transforms
        self._frame_id = frame_id
        data, start, count = points
        self._vertices: Floats = np.frombuffer(data, np.float32, NUMBERS * count, start).reshape(
            -1, NUMBERS).astype(np.float64)
        # As the maps take them: x, y, 1.
        self._vertices[:, 2] = 1.0

    def between(self, begin: int, end: int) -> list[tuple[int, PlaneMap]] | None:
        """
        Return the times between two at which the outline must be placed, and the maps then.

        From each to the next the vertices move on straight lines, to TOLERANCE: there is one
        wherever a transform says where the frame was, and as many more as its turning needs.

        Parameters
        ----------
        begin, end : int
            In ns.

        Returns
        -------
        list of tuple or None
            None if it is not known where the frame was all the time.

        """
        times = [begin, *self._transforms.stamps(self._frame_id, begin, end), end]
        found: list[tuple[int, PlaneMap]] = []
        try:
            for one, other in zip(times, times[1:]):
                if one != begin:
                    found.append((one, self._plane(one)))
                self._refine(one, other, found)
        except _UnknownError:
            return None
        return found

    def _refine(self, begin: int, end: int, found: list[tuple[int, PlaneMap]]) -> None:
        """Add what is needed between two times."""
        if end - begin < _SHORTEST:
            return
        middle = (begin + end) // 2
        first, last = np.array(self._plane(begin)), np.array(self._plane(end))
        for time in ((begin + middle) // 2, middle, (middle + end) // 2):
            straight = first + (time - begin) / (end - begin) * (last - first)
            off = (np.array(self._plane(time)) - straight).reshape(2, NUMBERS) @ self._vertices.T
            if np.hypot(*off).max() > TOLERANCE:
                self._refine(begin, middle, found)
                found.append((middle, self._plane(middle)))
                self._refine(middle, end, found)
                return

    def _plane(self, time: int) -> PlaneMap:
        found = self._transforms.plane(self._frame_id, time, time, 0.0)
        if isinstance(found, NoTransform):
            raise _UnknownError
        return found.plane

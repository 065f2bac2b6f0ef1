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

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
import copy
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.moving import STRIDE
from sat_collision.geometry.polygon import MAX_VERTICES, PlaneMap, Polygon, PolygonError
from sat_collision.messages.cdr import Points
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.replay.motion.kernels import describe, motions_between
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.times import NEVER

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
# Points as received, and the map that takes them to the frame that all is in, if they are not.
Ring: TypeAlias = tuple[Points, PlaneMap | None]

NUMBERS = 3  # a point's, in a message
IDENTITY = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0
NO_PLANES = np.empty((0, len(IDENTITY)))


class Bodies:
    """
    The outlines of some bodies as told: one footprint, or the obstacles of a set.

    Parameters
    ----------
    names : sequence of ObstacleId
    stamps : sequence of int
        When each was there, ns.
    rings : sequence of Ring
    max_vertices : int, optional
    frame_id : str, optional
        The frame that all are in, empty if there is none.
    is_between : bool, optional
        Whether they were not told, but lie between what was.

    Attributes
    ----------
    points : (v, 2) array
        The points of all rings.
    firsts, counts : (n,) array
        Where each ring starts and how many points it has, without one that closes it.
    boxes : (n, 4) array
        min x, min y, max x, max y.
    centres : (n, 2) array
    moving : (n,) array of bool
        Which bodies are known to have come here from somewhere else.

    """

    def __init__(self, names: Sequence[ObstacleId], stamps: Sequence[int],
                 rings: Sequence[Ring], max_vertices: int = MAX_VERTICES,
                 frame_id: str = '', is_between: bool = False) -> None:
        self.names = names
        self.stamps = stamps
        self.frame_id = frame_id
        self.is_between = is_between
        self.moving = np.zeros(len(names), np.bool_)
        data = b''.join([data[start:start + 4 * NUMBERS * count]
                         for (data, start, count), _ in rings])
        planes = NO_PLANES
        if any(plane is not None for _, plane in rings):
            planes = np.array([plane or IDENTITY for _, plane in rings])
        values = np.frombuffer(data, np.float32)
        count = len(names)
        self.points = np.empty((len(values) // NUMBERS, 2))
        self.firsts, self.counts = np.empty(count, np.int64), np.empty(count, np.int64)
        self.boxes, self.centres = np.empty((count, 4)), np.empty((count, 2))
        describe(values, np.array([points[2] for points, _ in rings], np.int64), planes,
                 (self.points, self.firsts, self.counts, self.boxes, self.centres))
        self._max_vertices = max_vertices
        self._polygons: dict[int, Polygon] = {}

    def __len__(self) -> int:
        return len(self.names)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, '_polygons': {}}

    def at(self, stamps: Sequence[int]) -> Bodies:
        """Return the same bodies, in the same places at other times."""
        other = copy.copy(self)
        other.stamps = stamps
        return other

    def ring(self, row: int) -> Floats:
        """Return the vertices of a body as told, (n, 2)."""
        first = int(self.firsts[row])
        return self.points[first:first + int(self.counts[row])]

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
    rows, next_rows : (m,) array of int
        Which body becomes which; both have as many vertices.
    finishes : sequence of int, optional
        When each way ends in ns; that of the body that it leads to where none is given.

    Attributes
    ----------
    starts, finishes : list of int
        When each way begins and ends.
    rows, next_rows : list of int
    boxes : (m, 4) array
        What bounds all of each way.
    moved : list of float
        How far the vertex goes that goes furthest, m.

    """

    def __init__(self, before: Bodies, after: Bodies, rows: Integers, next_rows: Integers,
                 finishes: Sequence[int] | None = None) -> None:
        self.before = before
        self.after = after
        self.rows: list[int] = rows.tolist()
        self.next_rows: list[int] = next_rows.tolist()
        self._array = np.empty(STRIDE * int(before.counts[rows].sum()))
        self.boxes = np.empty((len(rows), 4))
        ends, moved = np.empty(len(rows), np.int64), np.empty(len(rows))
        motions_between((before.points, before.firsts, before.counts), rows,
                        (after.points, after.firsts, after.counts), next_rows,
                        (self._array, ends, self.boxes, moved))
        self._ends: list[int] = ends.tolist()
        self.moved: list[float] = moved.tolist()
        if after is not before:
            after.moving[next_rows] |= moved > 0.0
        self.starts = [before.stamps[row] for row in self.rows]
        self.finishes = [after.stamps[row] for row in self.next_rows] if finishes is None else (
            list(finishes))

    def __len__(self) -> int:
        return len(self.rows)

    def ring(self, i: int, time: int) -> Floats:
        """Return the vertices of a body at a time on its way, (n, 2)."""
        first = self._ends[i - 1] if i else 0
        way: Floats = self._array[first:self._ends[i]].reshape(-1, STRIDE)
        start, finish = self.starts[i], self.finishes[i]
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
            return self.before.polygon(self.rows[i])
        if time >= self.finishes[i]:
            return self.after.polygon(self.next_rows[i])
        return Polygon(self.ring(i, time))


def stay(bodies: Bodies, until: Mapping[int, int]) -> LinearMotion:
    """Return the motion of bodies that stand where they are, of each row until a time."""
    rows = np.array(list(until), np.int64)
    return LinearMotion(bodies, bodies, rows, rows, list(until.values()))


_ONE = np.zeros(1, np.int64)


class Trajectory:
    """
    The frames of a footprint, and the pieces of its way.

    A piece leads from one frame to the next if no refused footprint came between them, if they
    are no further apart in time than the timeout, and if they have as many vertices. A frame
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
        Stamp of the last frame.
    undetermined : int
        For how long the way is not known though the footprint was there, ns.

    """

    def __init__(self, timeout: float, longest: int) -> None:
        self._never_stale = timeout == NEVER
        self._longest = min(timeout, longest)
        self.latest: int | None = None
        self.undetermined = 0
        self._pieces: list[LinearMotion] = []
        self._starts: list[int] = []
        self._last: Bodies | None = None
        self._outline: tuple[int, Polygon | None] = -1, None

    def add(self, frame: Bodies) -> None:
        """Take a frame: a footprint as received; one that comes late tells nothing new."""
        time, last = frame.stamps[0], self._last
        if last is not None and last.stamps[0] - self._longest <= time < last.stamps[0]:
            return
        self._last, self.latest = frame, time
        if last is not None and time > last.stamps[0]:
            if time - last.stamps[0] <= self._longest and last.counts[0] == frame.counts[0]:
                self._append(LinearMotion(last, frame, _ONE, _ONE))
            else:
                self.undetermined += round(min(time - last.stamps[0], self._longest))
                self._append(LinearMotion(frame, frame, _ONE, _ONE))
        elif last is None or time < last.stamps[0]:
            self._append(LinearMotion(frame, frame, _ONE, _ONE))

    def lose(self) -> None:
        """Take note that the footprint is nowhere until its next frame."""
        self._last = None

    def lose_way(self, until: int) -> None:
        """Take note that it is not known where the footprint was until its next frame."""
        if self._last is not None:
            self.undetermined += until - self._last.stamps[0]
        self.lose()

    def begin_of_way(self, until: int) -> int | None:
        """Return when the way began that leads to a frame at a time, None if none does."""
        last = self._last
        if last is None or not 0 < until - last.stamps[0] <= self._longest:
            return None
        return last.stamps[0]

    def stand(self, until: int) -> None:
        """Let a footprint that never times out have stood where it is until a time."""
        last = self._last
        if self._never_stale and last is not None and last.stamps[0] < until:
            self.add(last.at([until]))

    def drop_before(self, time: int) -> None:
        """Forget the pieces that end before a time."""
        count = 0
        while count < len(self._pieces) - 1 and self._pieces[count].finishes[0] < time:
            count += 1
        if count:
            del self._pieces[:count], self._starts[:count]

    def pieces(self, start: int, finish: int) -> Iterator[tuple[int, int, LinearMotion]]:
        """Yield the beginning and the end of each piece between two times, with its way."""
        first = max(bisect_right(self._starts, start) - 1, 0)
        # Pieces of no length may share their time with the end of the one before.
        while first > 0 and self._pieces[first - 1].finishes[0] >= start:
            first -= 1
        found = [(max(piece.starts[0], start), min(piece.finishes[0], finish), piece)
                 for piece in self._pieces[first:bisect_right(self._starts, finish)]]
        reached = None
        for k, (begin, end, piece) in enumerate(found):
            # An instant that is the end of the piece before, or begins the next, adds nothing.
            begins_next = k + 1 < len(found) and found[k + 1][0] == end < found[k + 1][1]
            if begin < end or (begin == end != reached and not begins_next):
                yield begin, end, piece
                reached = end

    def bounds(self, start: int, finish: int) -> Floats | None:
        """Return what bounds the footprint between two times, None if it is nowhere then."""
        if start == finish:
            piece = self._piece_at(start)
            return None if piece is None else piece.boxes[0]
        boxes = [piece.boxes[0] for _, _, piece in self.pieces(start, finish)]
        if len(boxes) < 2:
            return boxes[0] if boxes else None
        box: Floats = np.concatenate([np.min(boxes, axis=0)[:2], np.max(boxes, axis=0)[2:]])
        return box

    def frames(self, after: int, until: int) -> list[int]:
        """Return the stamps of the frames after one time and until another."""
        first, end = bisect_right(self._starts, after), bisect_right(self._starts, until)
        found = [piece.starts[0] for piece in self._pieces[first:end]
                 if not piece.before.is_between]
        if self.latest is not None and after < self.latest <= until:
            found.append(self.latest)
        return sorted(set(found))

    def outline(self, time: int) -> Polygon | None:
        """Return where the footprint was at a time, None if that is not known."""
        if self._outline[0] != time:
            self._outline = time, self._find_outline(time)
        return self._outline[1]

    def _find_outline(self, time: int) -> Polygon | None:
        piece = self._piece_at(time)
        try:
            return None if piece is None else piece.polygon(0, time)
        except PolygonError:
            return None

    def _piece_at(self, time: int) -> LinearMotion | None:
        """Return the first piece that has a time; those that meet there end in one frame."""
        found = None
        for k in range(bisect_right(self._starts, time) - 1, -1, -1):
            if self._pieces[k].finishes[0] < time:
                break
            found = self._pieces[k]
        return found

    def _append(self, piece: LinearMotion) -> None:
        if self._starts and piece.starts[0] < self._starts[-1]:
            # The clock of the stamps was set back: what was before belongs to another time.
            self._pieces.clear()
            self._starts.clear()
        self._pieces.append(piece)
        self._starts.append(piece.starts[0])


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

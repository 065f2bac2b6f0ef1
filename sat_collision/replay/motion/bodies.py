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

"""What was seen at a moment, and what moves between two moments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import copy
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.moving import STRIDE
from sat_collision.geometry.packing import moved_points
from sat_collision.geometry.polygon import MAX_VERTICES, PlaneMap, Polygon
from sat_collision.messages.cdr import Points
from sat_collision.replay.motion.rings import describe, mutual_nearest, ways_between
from sat_collision.scene.obstacles import ObstacleId

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
# Points as received, and the map that takes them to the frame that all is in, if they are not.
Ring: TypeAlias = tuple[Points, PlaneMap | None]

NUMBERS = 3  # a point's, in a message


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
    moving : set of int
        The bodies that are known to have come here from somewhere else.

    """

    def __init__(self, names: Sequence[ObstacleId], stamps: Sequence[int],
                 rings: Sequence[Ring], max_vertices: int = MAX_VERTICES,
                 frame_id: str = '', is_between: bool = False) -> None:
        self.names = names
        self.stamps = stamps
        self.frame_id = frame_id
        self.is_between = is_between
        self.moving: set[int] = set()
        data = b''.join(data[start:start + 4 * NUMBERS * count]
                        for (data, start, count), _ in rings)
        self.points = np.frombuffer(data, np.float32).reshape(-1, NUMBERS)[:, :2].astype(
            np.float64)
        lengths = np.array([points[2] for points, _ in rings], np.int64)
        ends = np.cumsum(lengths)
        self.firsts = ends - lengths
        for (points, plane), first, end in zip(rings, self.firsts, ends):
            if plane is not None:
                self.points[first:end] = np.reshape(moved_points(*points, plane), (-1, 2))
        self.counts, self.boxes, self.centres = describe(self.points, ends)
        self._max_vertices = max_vertices
        self._polygons: dict[int, Polygon] = {}

    def __len__(self) -> int:
        return len(self.names)

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


class Ways:
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
        self._array: Floats
        self.boxes: Floats
        self._array, ends, self.boxes, moved = ways_between(
            before.points, before.firsts, before.counts, rows,
            after.points, after.firsts, next_rows)
        self._ends: list[int] = ends.tolist()
        self.moved: list[float] = moved.tolist()
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


def stay(bodies: Bodies, until: Mapping[int, int]) -> Ways:
    """Return the ways of bodies that stand where they are, of each row until a time."""
    rows = np.array(list(until), np.int64)
    return Ways(bodies, bodies, rows, rows, list(until.values()))


def followers(before: Bodies, after: Bodies) -> tuple[Integers, Integers]:
    """
    Return which body becomes which, where nobody says: rows of one set and of the next.

    They are those that are nearest to each other and have as many vertices.
    """
    rows, next_rows = mutual_nearest(before.centres, before.counts, after.centres, after.counts)
    return rows, next_rows

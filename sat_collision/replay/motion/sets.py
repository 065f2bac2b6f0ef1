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

"""Obstacles that come in sets, followed from one set to the next by who is nearest."""

from __future__ import annotations

import numpy as np
from sat_collision.replay.motion.bodies import Bodies, followers, Ring, stay, Ways
from sat_collision.replay.motion.encounters import Step
from sat_collision.replay.motion.trails import Emit, Trail
from sat_collision.scene.obstacles import Obstacle


class SetTrail(Trail):
    """
    Follows a source that publishes sets.

    A place in a set may be taken by another body each time, so bodies of two sets are the same
    where they are nearest to each other and have as many vertices.
    """

    def __init__(self, patience: int, max_vertices: int, emit: Emit) -> None:
        super().__init__(patience, max_vertices, emit)
        self._stamp: int | None = None
        self._last: Bodies | None = None
        self._last_stamp = 0
        # Of the last set: which row an obstacle has, which rows may be seen again, and until when
        # those that were forgotten have been there.
        self._rows: dict[Obstacle, int] = {}
        self._alive: set[int] = set()
        self._ends: dict[int, int] = {}

    def begin(self, stamp: int) -> None:
        """Take note that a set begins: the one before is all there."""
        self._close()
        self._stamp = stamp

    def place(self, obstacle: Obstacle, stamp: int, ring: Ring) -> None:
        """Take an obstacle of the set that comes in; a late one may be a set of its own."""
        if self._stamp is None:
            self._stamp = stamp
        self._coming.add(obstacle, stamp, ring)

    def forget(self, obstacle: Obstacle, now: int) -> None:
        """Take note that the scene holds an obstacle no longer; now in ns."""
        if obstacle not in self._rows and self._coming.holds(obstacle):
            self._close()
        row = self._rows.pop(obstacle, None)
        if row in self._alive:
            self._ends[row] = now

    def use_frame(self, frame_id: str) -> None:
        """Drop what is in another frame than this."""
        super().use_frame(frame_id)
        if self._last is not None and self._last.frame_id != frame_id:
            self._last = None

    def rest(self, now: int, is_over: bool = False) -> None:
        """Let what has not been seen for long, or all if that is all there is, have stood."""
        if self._stamp is not None and (is_over or now > self._stamp + self._patience):
            self._close()
        last = self._last
        if last is None or not self._alive or not (
                is_over or now > self._last_stamp + self._patience):
            return
        until = {row: self._ends.get(row, now) for row in self._alive
                 if row not in last.moving and self._ends.get(row, now) > last.stamps[row]}
        lost = [row for row in self._alive if row not in until]
        self.undecided += max([0, *(self._ends.get(row, now) - self._last_stamp for row in lost)])
        left = {row for row in until if row not in self._ends}
        self._emit(self, Step([stay(last, until)] if until else [], None,
                              [last.names[row] for row in self._alive - left],
                              max(until.values(), default=self._last_stamp)))
        self._last = last.at([now if row in left else stamp
                              for row, stamp in enumerate(last.stamps)])
        self._last_stamp = now
        self._alive = left
        self._ends = {}

    def _close(self) -> None:
        """Take the set that came in for whole, and follow the bodies of the one before to it."""
        stamp, self._stamp = self._stamp, None
        if stamp is None:
            return
        seen, places = self._coming.take(self._frame_id)
        last = self._last
        ways: list[Ways] = []
        until: dict[int, int] = {}
        if last is not None:
            rows, next_rows = followers(last, seen)
            passed = (np.array(seen.stamps, np.int64)[next_rows]
                      - np.array(last.stamps, np.int64)[rows])
            known = (passed > 0) & (passed <= self._patience)
            followed: set[int] = set()
            if known.any():
                ways.append(Ways(last, seen, rows[known], next_rows[known]))
                seen.moving = {row for row, moved in zip(ways[0].next_rows, ways[0].moved)
                               if moved}
                followed.update(ways[0].rows)
            until = {row: end for row, end in self._ends.items() if row not in followed
                     and row not in last.moving and end > last.stamps[row]}
            if until:
                ways.append(stay(last, until))
            if len(followed) < len(seen) or self._alive - followed - until.keys():
                self.undecided += min(max(stamp - self._last_stamp, 0), self._patience)
        self._emit(self, Step(ways, seen, None, max([stamp, *seen.stamps, *until.values()])))
        self._last, self._last_stamp = seen, stamp
        self._rows = places
        self._alive = set(range(len(seen)))
        self._ends = {}

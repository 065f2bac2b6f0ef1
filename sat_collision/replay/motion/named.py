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

"""Obstacles that the scene knows by an id or by their shape, followed one by one."""

from __future__ import annotations

from collections import defaultdict
from typing import NamedTuple

import numpy as np
from sat_collision.replay.motion.bodies import Bodies, Ring, stay, Ways
from sat_collision.replay.motion.encounters import Step
from sat_collision.replay.motion.trails import Emit, Trail
from sat_collision.scene.obstacles import Obstacle, ObstacleId

# Messages stamped so near each other, ns, are looked at together.
_TOGETHER = 10**8


class _Sighting(NamedTuple):
    """A body among those that were seen together."""

    bodies: Bodies
    row: int

    @property
    def stamp(self) -> int:
        return self.bodies.stamps[self.row]


class NamedTrail(Trail):
    """Follows bodies with ids, or that stand still because they are known by shape."""

    def __init__(self, patience: int, max_vertices: int, emit: Emit) -> None:
        super().__init__(patience, max_vertices, emit)
        self._seen: dict[ObstacleId, _Sighting] = {}
        self._forgotten: dict[ObstacleId, int] = {}
        self._rested = 0

    def place(self, obstacle: Obstacle, stamp: int, ring: Ring) -> None:
        """Take what was told of an obstacle."""
        coming = self._coming
        if coming and (obstacle.name in coming or self._forgotten
                       or abs(stamp - coming.first_stamp) > _TOGETHER):
            self._close()
        if self._forgotten:
            self._end_forgotten()
        coming.add(obstacle, stamp, ring)

    def forget(self, obstacle: Obstacle, now: int) -> None:
        """Take note that the scene holds an obstacle no longer; now in ns."""
        if obstacle.name in self._coming:
            self._close()
        if obstacle.name in self._seen:
            self._forgotten[obstacle.name] = now

    def use_frame(self, frame_id: str) -> None:
        """Drop what is in another frame than this."""
        super().use_frame(frame_id)
        self._seen = {name: sighting for name, sighting in self._seen.items()
                      if sighting.bodies.frame_id == frame_id}

    def rest(self, now: int, is_over: bool = False) -> None:
        """Let what has not been seen for long, or all if that is all there is, have stood."""
        if self._coming and (is_over or now > self._coming.first_stamp + self._patience):
            self._close()
        self._end_forgotten()
        if not is_over and now <= self._rested + self._patience:
            return
        self._rested = now
        since = now if is_over else now - self._patience
        standing: defaultdict[int, dict[int, int]] = defaultdict(dict)
        found: dict[int, Bodies] = {}
        for sighting in self._seen.values():
            if sighting.row not in sighting.bodies.moving and sighting.stamp < since:
                found[id(sighting.bodies)] = sighting.bodies
                standing[id(sighting.bodies)][sighting.row] = now
            elif is_over:
                self.undecided += max(now - sighting.stamp, 0)
        for key, until in standing.items():
            bodies = found[key]
            self._emit(self, Step([stay(bodies, until)], None, (), now))
            rested = bodies.at([until.get(row, stamp) for row, stamp in enumerate(bodies.stamps)])
            for row in until:
                self._seen[bodies.names[row]] = _Sighting(rested, row)

    def _close(self) -> None:
        """Follow the bodies that were seen together from where they were seen last."""
        seen, _ = self._coming.take(self._frame_id)
        followed: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)
        found: dict[int, Bodies] = {}
        undecided = 0
        for row, name in enumerate(seen.names):
            last = self._seen.get(name)
            if last is not None:
                passed = seen.stamps[row] - last.stamp
                if 0 < passed <= self._patience and (
                        last.bodies.counts[last.row] == seen.counts[row]):
                    found[id(last.bodies)] = last.bodies
                    followed[id(last.bodies)].append((last.row, row))
                else:
                    undecided = max(undecided, min(passed, self._patience))
            self._seen[name] = _Sighting(seen, row)
        self.undecided += undecided
        ways = []
        for key, pairs in followed.items():
            rows, next_rows = np.array(pairs, np.int64).T
            way = Ways(found[key], seen, np.ascontiguousarray(rows),
                       np.ascontiguousarray(next_rows))
            seen.moving.update(row for row, moved in zip(way.next_rows, way.moved) if moved)
            ways.append(way)
        if len(seen):
            self._emit(self, Step(ways, seen, (), max(seen.stamps)))

    def _end_forgotten(self) -> None:
        """Let what was forgotten have stood until then, if it is not known to move."""
        if not self._forgotten:
            return
        standing: defaultdict[int, dict[int, int]] = defaultdict(dict)
        found: dict[int, Bodies] = {}
        for name, end in self._forgotten.items():
            bodies, row = sighting = self._seen.pop(name)
            if row in bodies.moving:
                self.undecided += max(end - sighting.stamp, 0)
            elif end > sighting.stamp:
                found[id(bodies)] = bodies
                standing[id(bodies)][row] = end
        ways = [stay(found[key], until) for key, until in standing.items()]
        self._emit(self, Step(ways, None, list(self._forgotten), max(self._forgotten.values())))
        self._forgotten = {}

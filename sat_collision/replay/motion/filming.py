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

"""A film of recorded motion: footprints and obstacles on their ways from message to message."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

from sat_collision.replay.film import Film, FilmedBody
from sat_collision.replay.motion.bodies import Floats, Ways
from sat_collision.replay.motion.encounters import Step
from sat_collision.replay.motion.tracks import Track
from sat_collision.replay.motion.trails import Trail
from sat_collision.scene.obstacles import ObstacleId


class _Sight(NamedTuple):
    """Where and when an obstacle was seen last, and as what."""

    time: int
    name: str
    ring: Floats
    body: FilmedBody


class MotionFilm:
    """
    Films what recorded motion goes by, the same ways by which it decides.

    A body whose way is not known is shown where it was last, and marked so.

    Parameters
    ----------
    film : Film
        To be filled.

    """

    def __init__(self, film: Film) -> None:
        self._film = film
        self._sights: dict[Trail, dict[ObstacleId, _Sight]] = {}
        self._footprints: dict[str, FilmedBody] = {}
        self._next: dict[str, int] = {}

    def follow(self, trail: Trail, step: Step) -> None:
        """Film what a source tells of the time from one moment to the next."""
        sights = self._sights.setdefault(trail, {})
        arrived: dict[ObstacleId, FilmedBody] = {}
        for ways in step.ways:
            for i, row in enumerate(ways.rows):
                name = ways.before.names[row]
                sight = sights.get(name)
                if sight is None:
                    continue
                self._move(sight, ways, i)
                if ways.after is step.seen:
                    arrived[ways.after.names[ways.next_rows[i]]] = sight.body
                    del sights[name]
                else:
                    sights[name] = sight._replace(time=ways.finishes[i])
        seen = step.seen
        end = min(seen.stamps) if seen is not None and len(seen) else step.finish
        for name in list(sights) if step.gone is None else step.gone:
            if name in sights:
                self._hold(sights.pop(name), end if step.gone is None else step.finish)
        if seen is None:
            return
        for row, (name, stamp) in enumerate(zip(seen.names, seen.stamps)):
            body = arrived.get(name)
            if body is None and name in sights:
                self._hold(sights[name], stamp)
                body = sights[name].body
            sights[name] = _Sight(stamp, str(name), seen.ring(row), body or self._film.add())

    def walk(self, name: str, track: Track) -> None:
        """Film a footprint on its way, as far as that is known now."""
        if track.latest is None:
            return
        until = bisect_right(self._film.moments, track.latest)
        for number in range(self._next.get(name, 0), until):
            outline = track.outline(self._film.moments[number])
            if outline is not None:
                if name not in self._footprints:
                    self._footprints[name] = self._film.add(is_footprint=True)
                self._footprints[name].show(number, number + 1, name, outline.vertices)
            else:
                self._lose(name, number + 1)
        self._next[name] = max(until, self._next.get(name, 0))

    def finish(self, end: int) -> None:
        """Let what is left be where it was last until the end."""
        for sights in self._sights.values():
            for sight in sights.values():
                self._hold(sight, end + 1)
        for name in self._footprints:
            self._lose(name, len(self._film.moments))

    def _move(self, sight: _Sight, ways: Ways, i: int) -> None:
        start, finish = ways.starts[i], ways.finishes[i]
        first, end = self._film.number(start), self._film.number(finish)
        if not ways.moved[i]:
            sight.body.show(first, end, sight.name, ways.ring(i, start))
            return
        for number in range(first, end):
            ring = ways.ring(i, self._film.moments[number])
            sight.body.show(number, number + 1, sight.name, ring)

    def _hold(self, sight: _Sight, end: int) -> None:
        """Show an obstacle where it was last, until before a time."""
        first, until = self._film.number(sight.time), self._film.number(end)
        if first < until and self._film.moments[first] == sight.time:
            sight.body.show(first, first + 1, sight.name, sight.ring)
        sight.body.show(first, until, sight.name, sight.ring, known=False)

    def _lose(self, name: str, end: int) -> None:
        """Show a footprint where it was last, until before a moment."""
        body = self._footprints.get(name)
        if body is not None and body.spans:
            body.show(0, end, name, body.spans[-1].ring, known=False)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The states of a scene over time, as intervals: what the monitor would have reported."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from math import inf

from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.query import separation
from sat_collision.replay.model.keyframes import Floats, Keyframes, ShownBody
from sat_collision.replay.model.result import (
    Contact, FootprintResult, Least, Series, Unknowns)
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import NEVER


class SceneDrawing:
    """Fills keyframes with the scenes that were current at some moments, given in their order."""

    def __init__(self, scene: Scene, moments: Sequence[int]) -> None:
        self.keyframes = Keyframes([])
        self._scene = scene
        self._moments = moments
        self._drawn = 0  # for how many moments scenes were drawn
        # The last scene: its time, the depth of its contact, and footprints and obstacles.
        self._last: tuple[int, float, list[list[tuple[str, Floats]]]] | None = None
        # By name, whether it is a footprint, and a number: while a set is being received, two
        # obstacles may have the same name.
        self._shown: dict[tuple[str, bool, int], ShownBody] = {}

    def keep(self, now: int, depth: float = -inf) -> None:
        """Keep the current scene; of several at one time that with the deepest contact counts."""
        if self._last is not None:
            last, deepest, _ = self._last
            if last < now:
                self.draw_last(now)
            elif depth <= deepest:
                return
        self._last = now, depth, [
            [(str(name), polygon.vertices.copy()) for name, polygon in bodies]
            for bodies in (self._scene.footprints, self._scene.obstacles)]

    def draw_last(self, until: float = NEVER) -> None:
        """Draw the last scene if it is current at a moment before a time."""
        drawn, self._drawn = self._drawn, bisect_left(self._moments, until)
        if self._drawn == drawn or self._last is None:
            return
        time, _, scene = self._last
        number = len(self.keyframes.moments)
        self.keyframes.moments.append(time)
        for is_footprint, bodies in zip((True, False), scene):
            found: Counter[str] = Counter()
            for name, vertices in bodies:
                key = name, is_footprint, found[name]
                found[name] += 1
                if key not in self._shown:
                    self._shown[key] = self.keyframes.add(is_footprint)
                self._shown[key].show(number, number + 1, name, vertices)


class Timeline:
    """
    Follows a scene and records contacts, unknown times and separations in results of footprints.

    A drawing is given the scene at each sample, and where a contact is deepest.
    """

    def __init__(self, scene: Scene, footprints: list[FootprintResult],
                 drawing: SceneDrawing | None = None) -> None:
        self._scene = scene
        self._drawing = drawing
        self.contacts: list[Contact] = []
        self._unknowns = Unknowns()
        self.unknown = self._unknowns.intervals
        # The open contacts by footprint and obstacle, only for footprints that have any.
        self.touching: dict[str, dict[ObstacleId, Contact]] = {}
        self._results = {result.name: result for result in footprints}
        self._series = {result.name: Series(result.separation) for result in footprints}
        self._since: dict[str, tuple[int, Status]] = {}
        # Footprints whose contacts are to be measured, and the bodies last measured.
        self._moved: set[str] = set()
        self._measured: dict[tuple[str, ObstacleId], list[Polygon]] = {}

    def change(self, names: Iterable[str], now: int) -> None:
        """Record the new states of footprints."""
        for name in names:
            self._moved.add(name)
            state = self._scene.state(name)
            self._count_time(name, now)
            self._since[name] = now, state.status
            if state.status is not Status.UNKNOWN:
                self._results[name].ever_known = True
            self._unknowns.follow(
                name, state.reasons if state.status is Status.UNKNOWN else (), now)
            self._follow_contacts(name, state.contacts, now)

    def deepen(self, now: int) -> None:
        """Measure the open contacts of bodies that have moved."""
        self._moved |= self._scene.take_moved()
        for name, contacts in self.touching.items():
            for obstacle, *bodies in self._scene.contacts(name) if name in self._moved else ():
                contact = contacts.get(obstacle)
                if contact is None or self._measured.get((name, obstacle)) == bodies:
                    continue
                self._measured[name, obstacle] = bodies
                # Subtracted from 0.0 instead of negated, which would give -0.0 for touching.
                if contact.deepen(0.0 - separation(*bodies), now, *bodies):
                    self._results[name].note_least(contact.least)
                    if self._drawing:
                        self._drawing.keep(now, contact.depth)
        self._moved.clear()

    def sample(self, now: int) -> None:
        """Record how far each footprint is from the nearest obstacle, and keep the scene."""
        if self._drawing:
            self._drawing.keep(now)
        for name, series in self._series.items():
            found = None
            if self._since[name][1] is not Status.UNKNOWN:
                found = self._scene.nearest(name)
            series.add(now, found and found.separation)
            result = self._results[name]
            if found and result.is_least(found.separation):
                obstacle, distance, (ax, ay), (bx, by), _ = found
                result.least = Least(
                    distance + 0.0, now, str(obstacle), (ax + bx) / 2, (ay + by) / 2)

    def finish(self, now: int) -> None:
        """End all open contacts and intervals."""
        for name in self._results:
            self._count_time(name, now)
        for contacts in self.touching.values():
            for contact in contacts.values():
                contact.last = now
                contact.at_end = True
        self._unknowns.finish(now)
        if self._drawing:
            self._drawing.draw_last()

    def _count_time(self, name: str, now: int) -> None:
        if name in self._since:
            since, status = self._since[name]
            result = self._results[name]
            setattr(result, status.value, getattr(result, status.value) + now - since)
            self._since[name] = now, status

    def _follow_contacts(self, name: str, obstacles: Iterable[ObstacleId], now: int) -> None:
        contacts = self.touching.get(name, {})
        for obstacle in [obstacle for obstacle in contacts if obstacle not in obstacles]:
            contacts.pop(obstacle).last = now
            self._measured.pop((name, obstacle), None)
        for obstacle in obstacles:
            if obstacle not in contacts:
                contacts[obstacle] = Contact(name, str(obstacle), now, now)
                self.contacts.append(contacts[obstacle])
        if contacts:
            self.touching[name] = contacts
        else:
            self.touching.pop(name, None)

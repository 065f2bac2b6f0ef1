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

"""The states of a scene over time, joined to intervals: what the monitor would have said."""

from __future__ import annotations

from collections.abc import Iterable

from sat_collision.geometry.polygon import Polygon
from sat_collision.geometry.query import separation
from sat_collision.replay.film import Film
from sat_collision.replay.result import (
    Contact, FootprintResult, Least, middle_of_overlap, Unknown)
from sat_collision.replay.series import Series
from sat_collision.replay.unknowns import Unknowns
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.scene import Scene


class Timeline:
    """
    Follows a scene: told of every change, it notes contacts, unknown times and separations.

    Parameters
    ----------
    scene : Scene
    footprints : list of FootprintResult
        To be filled in.
    film : Film, optional
        To keep the scene where a contact is deepest.

    Attributes
    ----------
    contacts : list of Contact
        In the order of their beginning.
    footprints : list of FootprintResult
    notes : list of str
        What a reader should know.
    touching : dict
        The open Contacts by footprint and ObstacleId, only of footprints that have any.

    """

    def __init__(self, scene: Scene, footprints: list[FootprintResult],
                 film: Film | None = None) -> None:
        self._scene = scene
        self._film = film
        self.contacts: list[Contact] = []
        self.touching: dict[str, dict[ObstacleId, Contact]] = {}
        self.footprints = footprints
        self.notes: list[str] = []
        self._results = {result.name: result for result in self.footprints}
        self._series = {result.name: Series(result.separation) for result in self.footprints}
        self._since: dict[str, tuple[int, Status]] = {}
        self._unknowns = Unknowns()
        self._measured: dict[tuple[str, ObstacleId], list[Polygon]] = {}

    @property
    def unknown(self) -> list[Unknown]:
        """The Unknown intervals, in the order of their beginning."""
        return self._unknowns.intervals

    def change(self, names: Iterable[str], now: int) -> None:
        """Take the new states of footprints."""
        for name in names:
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
        for name, contacts in self.touching.items():
            for obstacle, *bodies in self._scene.contacts(name):
                contact = contacts.get(obstacle)
                if contact is None or self._measured.get((name, obstacle)) == bodies:
                    continue
                self._measured[name, obstacle] = bodies
                # Taken from 0.0 rather than negated, which would make -0.0 of touching.
                depth = 0.0 - separation(*bodies)
                if contact.deepest == 0 or depth > contact.depth:
                    contact.depth = depth
                    contact.deepest = now
                    contact.x, contact.y = middle_of_overlap(*bodies)
                    self._note_least(name, Least(0.0 - depth, now, contact.obstacle,
                                                 contact.x, contact.y))
                    if self._film:
                        self._film.keep(self._scene, now, depth)

    def sample(self, now: int) -> None:
        """Note how far each footprint is from what is nearest to it."""
        for name, series in self._series.items():
            found = None
            if self._since[name][1] is not Status.UNKNOWN:
                found = self._scene.nearest(name)
            series.add(now, found and found[1])
            if found:
                obstacle, distance, (ax, ay), (bx, by) = found
                self._note_least(name, Least(distance + 0.0, now, str(obstacle),
                                             (ax + bx) / 2, (ay + by) / 2))

    def finish(self, now: int) -> None:
        """End all that is open."""
        for name in self._results:
            self._count_time(name, now)
        for contacts in self.touching.values():
            for contact in contacts.values():
                contact.last = now
                contact.at_end = True
        self._unknowns.finish(now)

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

    def _note_least(self, name: str, found: Least) -> None:
        result = self._results[name]
        if result.least is None or found.separation < result.least.separation:
            result.least = found

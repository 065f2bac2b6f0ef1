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

"""What can be asked of a scene: states, bodies, and how far apart these are."""

from __future__ import annotations

from collections.abc import Set
from itertools import chain
from typing import TypeAlias

from sat_collision.geometry.polygon import Polygon
from sat_collision.geometry.polygon_set import Point
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.evaluations import Evaluations
from sat_collision.scene.footprints import Footprint, State, Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings
from sat_collision.scene.sources import Source


# An obstacle, its separation (m) from a footprint, and the closest points of the two.
Nearest: TypeAlias = tuple[ObstacleId, float, Point, Point]


class View:
    """
    A scene as it is seen from outside; `Scene` is what is told of events.

    Attributes
    ----------
    evaluations : Evaluations

    """

    evaluations: Evaluations
    _now: int
    _contacts: Contacts
    _deadlines: Deadlines
    _sources: dict[str, Source]
    _footprints: dict[str, Footprint]

    def settings_of(self, name: str) -> FootprintSettings | ObstacleSettings:
        """Return the settings of a footprint or source by its name."""
        source = self._sources.get(name)
        return source.settings if source else self._footprints[name].settings

    def doubts(self, name: str) -> tuple[str, ...]:
        """Return why it is not known what a footprint touches, whatever it is known to touch."""
        return self._footprints[name].doubts

    @property
    def source_faults(self) -> tuple[str, ...]:
        """Why sources of obstacles cannot be trusted, in sentences."""
        return tuple(chain.from_iterable(source.faults for source in self._sources.values()))

    def changes(self) -> list[str]:
        """Return the names of footprints whose state, age apart, changed since the last call."""
        return self.evaluations.changes()

    def status(self, name: str) -> Status:
        """Return the Status of a footprint."""
        return self._footprints[name].status

    def state(self, name: str) -> State:
        """Return the State of a footprint at the time that was passed last."""
        footprint = self._footprints[name]
        age = None if footprint.time is None else (self._now - footprint.time) / 1e9
        status, reasons = footprint.evaluation
        return State(status, footprint.contacts_reported, reasons, age)

    def origin(self, name: str) -> tuple[str, float | None]:
        """
        Return where the good footprint came from, '' if there is none.

        It is the name of the frame in which it was told, and the age in s of the transform that
        moved it from there, None if there was none or it holds for all times.
        """
        footprint = self._footprints[name]
        if footprint.time is None:
            return '', None
        if footprint.origin is None:
            return footprint.frame_id, None
        frame_id, at = footprint.origin
        return frame_id, None if at is None else (self._now - at) / 1e9

    @property
    def deadline(self) -> float:
        """The time in ns until which, at least, nothing changes by itself; NEVER if at no time."""
        earliest = self._deadlines.earliest
        for source in self._sources.values():
            if source.pause < earliest:
                earliest = source.pause
        return earliest

    @property
    def footprints(self) -> list[tuple[str, Polygon]]:
        """The (name, Polygon) of every footprint that is somewhere, be it stale."""
        return [(name, polygon) for name, footprint in self._footprints.items()
                if (polygon := footprint.polygon) is not None]

    @property
    def obstacles(self) -> list[tuple[ObstacleId, Polygon]]:
        """The (ObstacleId, Polygon) of every obstacle that is somewhere."""
        return [(obstacle.name, polygon) for source in self._sources.values()
                for obstacle in source.obstacles
                if (polygon := obstacle.polygon) is not None]

    def contacts(self, name: str) -> list[tuple[ObstacleId, Polygon, Polygon]]:
        """Return (ObstacleId, Polygon of the footprint, Polygon) of all that a footprint meets."""
        footprint = self._footprints[name]
        return [(obstacle.name, own, other) for obstacle in footprint.contacts
                if (own := footprint.polygon) and (other := obstacle.polygon)]

    def nearest(self, name: str, apart: bool = False) -> Nearest | None:
        """
        Return what is nearest to a footprint, None if one of the two is nowhere.

        It is an obstacle, its separation and the closest points, as `PolygonSet.nearest` has
        them; with `apart` the obstacles in contact are left out.
        """
        footprint = self._footprints[name]
        found = self._contacts.nearest(footprint, footprint.contacts if apart else ())
        return found and (found[0].name, *found[1:])

    def newer_by(self, name: str, obstacles: Set[ObstacleId]) -> dict[ObstacleId, float]:
        """
        Return by how many s obstacles are newer than a footprint; only those that are somewhere.

        Where two sets hold an obstacle of one name, that in contact counts, else the newer.
        """
        footprint = self._footprints[name]
        if footprint.time is None:
            return {}
        found: dict[ObstacleId, tuple[bool, float]] = {}
        # Once through all of a source, as all of them may be asked for.
        for source in {obstacle.source for obstacle in obstacles}:
            for one in self._sources[source].obstacles:
                if one.row is not None and one.name in obstacles:
                    known = one in footprint.contacts, one.time
                    found[one.name] = max(found.get(one.name, known), known)
        return {obstacle: (time - footprint.time) / 1e9 for obstacle, (_, time) in found.items()}

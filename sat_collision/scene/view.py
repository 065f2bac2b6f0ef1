# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What is known of a scene, to be shown: bodies, states and separations; nothing is changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
from itertools import chain
from typing import NamedTuple

from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.sets.polygon_set import Point
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint, State, Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.prediction import predict, Prediction, velocity_of
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
from sat_collision.scene.sources import Source
from sat_collision.scene.velocity import Velocity


class Nearest(NamedTuple):
    """The obstacle nearest to a footprint."""

    obstacle: ObstacleId
    separation: float  # m
    on_obstacle: Point  # the closest points
    on_footprint: Point
    newer_by: Callable[[], float]  # than the footprint, s; found when called: recordings do not


class SceneView:
    """The part of a Scene that only reads it."""

    settings: Settings
    _now: int
    _contacts: Contacts
    sources: dict[str, Source]  # by name
    _footprints: dict[str, Footprint]
    _receivers: dict[str, Footprint | Source]  # both

    @property
    def footprints(self) -> list[tuple[str, Polygon]]:
        """The (name, Polygon) of every footprint that is placed, even if stale."""
        return [(name, polygon) for name, footprint in self._footprints.items()
                if (polygon := footprint.polygon) is not None]

    def polygon(self, name: str) -> Polygon | None:
        """Return a footprint's body, None if it is not placed."""
        return self._footprints[name].polygon

    @property
    def obstacles(self) -> list[tuple[ObstacleId, Polygon]]:
        """The (ObstacleId, Polygon) of every obstacle that is placed."""
        return [(obstacle.name, polygon) for source in self.sources.values()
                for obstacle in source.store if (polygon := obstacle.polygon) is not None]

    def nearest_obstacles(self, limit: int,
                          room: int) -> tuple[list[tuple[ObstacleId, Polygon]], bool]:
        """
        Return obstacles as `obstacles` does, those nearest to footprints, and whether all.

        The limits are those of `PackedSet.nearest_rows`.
        """
        rows, are_all = self._contacts.nearest_rows(limit, room)
        return [(obstacle.name, polygon) for source in self.sources.values()
                for obstacle in source.store
                if obstacle.row in rows and (polygon := obstacle.polygon) is not None], are_all

    @property
    def source_faults(self) -> tuple[str, ...]:
        """Why sources of obstacles cannot be trusted, in sentences."""
        return tuple(chain.from_iterable(source.faults for source in self.sources.values()))

    def settings_of(self, name: str) -> FootprintSettings | ObstacleSettings:
        """Return the settings of a footprint or source by its name."""
        return self._receivers[name].settings

    def footprint_timeout(self, source: str) -> float:
        """Return the least timeout in s of enabled footprints that monitor a source, or 0.0."""
        return min((one.timeout for one in self.settings.footprints
                    if one.enabled and one.timeout and one.monitors(source)), default=0.0)

    def unknown_reasons(self, name: str) -> tuple[str, ...]:
        """Return why contacts of a footprint may be unknown, empty if all are known."""
        return self._footprints[name].unknown_reasons

    def faults_around(self, name: str) -> tuple[str, ...]:
        """Return why obstacles of a footprint may be unknown, wherever that is."""
        monitor_fault, source_faults = self._footprints[name].other_faults
        return (monitor_fault,) if monitor_fault else source_faults

    def is_placed(self, name: str) -> bool:
        """Return whether a footprint is placed, and not stale."""
        footprint = self._footprints[name]
        return footprint.time is not None and not footprint.stale

    def status(self, name: str) -> Status:
        return self._footprints[name].status

    def state(self, name: str) -> State:
        """Return the State of a footprint at the last time passed."""
        footprint = self._footprints[name]
        age = None if footprint.time is None else max(self._now - footprint.time, 0) / 1e9
        status, reasons = footprint.evaluation
        return State(status, footprint.contacts_reported, reasons, age)

    def origin(self, name: str) -> tuple[str, float | None]:
        """
        Return where the valid footprint came from: a frame, and the age of its transform in s.

        The frame is that in which it was sent, '' if there is no valid footprint; the age is None
        if it was not transformed, or by a static transform.
        """
        footprint = self._footprints[name]
        if footprint.time is None:
            return '', None
        if footprint.origin is None:
            return footprint.frame_id, None
        frame_id, at = footprint.origin
        return frame_id, None if at is None else (self._now - at) / 1e9

    def contacts(self, name: str) -> list[tuple[ObstacleId, Polygon, Polygon]]:
        """
        Return (ObstacleId, Polygon of the footprint, Polygon of the obstacle) per contact.

        They are sorted by name, and then by place: two sets may hold an obstacle of the same name.
        """
        footprint = self._footprints[name]
        return sorted(((obstacle.name, own, other) for obstacle in footprint.contacts
                       if (own := footprint.polygon) and (other := obstacle.polygon)),
                      key=lambda contact: (contact[0], contact[2].bounds))

    def nearest(self, name: str, apart: bool = False) -> Nearest | None:
        """
        Return the obstacle nearest to a footprint, None if either is not placed.

        The separation and the closest points are those of `PolygonSet.nearest`; with `apart` the
        obstacles in contact are left out.
        """
        footprint = self._footprints[name]
        found = self._contacts.nearest(footprint, footprint.contacts if apart else ())
        return found and Nearest(found[0].name, *found[1:], partial(footprint.newer_by, found[0]))

    def contacts_newer_by(self, name: str) -> dict[ObstacleId, float]:
        """Return by how many s obstacles in contact are newer; of those of one name the newest."""
        footprint = self._footprints[name]
        return dict(sorted((one.name, footprint.newer_by(one)) for one in footprint.contacts))

    def velocity(self, name: str) -> Velocity | str:
        """Return the velocity of a footprint since its stamp, or why it is unknown."""
        return velocity_of(self._footprints[name], self._now)

    def prediction(self, name: str) -> Prediction | None:
        """
        Return when a footprint will be in contact, as of the last time passed.

        None while its state or its velocity is unknown, and if nothing asks for predictions.
        """
        footprint = self._footprints[name]
        horizon = max(self.settings.horizon, footprint.settings.min_time_to_collision)
        return predict(footprint, self._contacts, self.sources.values(), self._now,
                       horizon) if horizon else None

    def lost(self) -> Counter[str]:
        """Return the number of messages that were sent but not received, by name."""
        return +Counter({name: one.stream.lost for name, one in self._receivers.items()})

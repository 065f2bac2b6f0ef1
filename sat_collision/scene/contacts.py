# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Which footprints meet which obstacles, updated one body at a time."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.polygon import PackedBody, Polygon
from sat_collision.geometry.motion.prediction import motion_of
from sat_collision.geometry.path import first_of_rows
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.geometry.sets.polygon_set import NO_ROWS, Point
from sat_collision.geometry.sets.run import Run
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacles import Body, Obstacle
from sat_collision.scene.velocity import Velocity, Vertices

_Kind = TypeVar('_Kind', bound=Body[Any])
_Other = TypeVar('_Other', bound=Body[Any])

# Max gap in m between a turning footprint and the obstacle it meets, at the time returned.
_TOLERANCE = 1e-3
# Where an obstacle is, and its vx and vy in m/s.
Course: TypeAlias = tuple[Polygon, Vertices]


class Contacts:
    """
    The placed footprints and obstacles, and which of them meet: bodies within the margin (m).

    Placing a body checks only that body against those of the other kind; all other contacts stay.
    """

    def __init__(self, margin: float = 0.0) -> None:
        self.changed: set[Footprint] = set()  # whose contacts have; emptied by the reader
        # Footprints in contact that have moved, or what they touch; a reader may empty it, too.
        self.moved: set[Footprint] = set()
        self.margin = margin
        self._footprints: _Placed[Footprint] = _Placed()
        self._obstacles = _PlacedObstacles()

    def use_margin(self, margin: float) -> None:
        """Decide all contacts again if the margin has changed."""
        if margin != self.margin:
            self.margin = margin
            for footprint in self._footprints.bodies.values():
                self.decide(footprint)

    def decide(self, footprint: Footprint) -> None:
        """Decide the contacts of a footprint again, if it is placed."""
        if footprint.row is not None:
            polygon = self._footprints.polygons.polygon(footprint.row)
            rows = self._obstacles.polygons.rows_within(polygon, self.margin).tolist()
            if update_contacts(footprint, self._monitored(footprint, rows)):
                self.changed.add(footprint)

    def place_footprint(self, footprint: Footprint, where: PackedBody) -> None:
        met = self._footprints.place(footprint, where, self._obstacles.polygons, self.margin)
        if met is not None and update_contacts(footprint, self._monitored(footprint, met)):
            self.changed.add(footprint)
        if met:
            self.moved.add(footprint)

    def place_obstacle(self, obstacle: Obstacle, where: PackedBody) -> None:
        met = self._obstacles.place(obstacle, where, self._footprints.polygons, self.margin)
        if met or met is not None and obstacle.contacts:
            footprints = self._footprints.bodies
            monitoring = [footprints[row] for row in met
                          if footprints[row].settings.monitors(obstacle.name.source)]
            self.changed.update(update_contacts(obstacle, monitoring))
            self.moved.update(monitoring)

    def reserve(self, obstacles: Sequence[Obstacle], counts: NDArray[np.int64]) -> list[int]:
        """Give rows to obstacles that runs will place, of so many vertices each."""
        return self._obstacles.reserve(obstacles, counts)

    def place_run(self, run: Run, rows: Any, first: int, limit: int) -> int:
        """Place a run until a body has no row or may meet a footprint; return how many."""
        return self._obstacles.polygons.place_run(
            run, rows, first, limit, self._footprints.polygons, self.margin)

    def remove_footprint(self, footprint: Footprint) -> None:
        if self._footprints.remove(footprint) and update_contacts(footprint, ()):
            self.changed.add(footprint)

    def remove_obstacle(self, obstacle: Obstacle) -> None:
        if self._obstacles.remove(obstacle) and obstacle.contacts:
            self.changed.update(update_contacts(obstacle, ()))

    def hide_obstacles(self, group: object, rows: Any) -> None:
        """Hide all obstacles of a group, which keep their rows (-1: none) to be placed again."""
        self._obstacles.polygons.hide(rows)
        for footprint in self._footprints.bodies.values():
            lost = {one for one in footprint.contacts if one.group is group}
            if lost:
                footprint.toggle(lost)
                self.changed.add(footprint)
                for obstacle in lost:
                    obstacle.contacts.discard(footprint)

    def nearest(self, footprint: Footprint, skipped: Iterable[Obstacle] = ()
                ) -> tuple[Obstacle, float, Point, Point] | None:
        """
        Return the nearest obstacle that a footprint monitors, None if there is none.

        It comes with its separation and the closest points, see `PolygonSet.nearest`; `skipped`
        obstacles are left out.
        """
        if footprint.row is None:
            return None
        found = self._obstacles.polygons.nearest_to(
            self._footprints.polygons, footprint.row, self._left_out(footprint, skipped))
        return found and (self._obstacles.bodies[found[0]], *found[1:])

    def nearest_rows(self, limit: int, room: int) -> tuple[set[int], bool]:
        """Return the `nearest_rows` of obstacles to footprints, and whether these are all."""
        rows, are_all = self._obstacles.polygons.nearest_rows(
            (polygon.bounds for one in self._footprints.bodies.values()
             if (polygon := one.polygon) is not None), limit, room)
        return {*rows}, are_all

    def first_contact(self, footprint: Footprint, velocity: Velocity, seconds: float,
                      moving: Mapping[Obstacle, Course] = {}) -> tuple[Obstacle, float] | None:
        """
        Return the obstacle that a footprint meets first within a time, and after how many s.

        Obstacles stand still, except those in `moving`. None if it meets none.
        """
        if footprint.polygon is None:
            return None
        motion = motion_of(velocity.twist, seconds, velocity.pose, _TOLERANCE, self.margin)
        found = self._obstacles.polygons.first_met(
            footprint.polygon, motion, skipped=self._left_out(footprint, moving))
        first = found and (self._obstacles.bodies[found[0]], found[1])
        if moving:
            polygons, velocities = zip(*moving.values())
            found = PackedSet(polygons).first_met(footprint.polygon, motion, velocities)
            if found and not (first and first[1] <= found[1]):
                first = [*moving][found[0]], found[1]
        return first

    def first_on_path(self, footprint: Footprint, outline: Polygon, poses: NDArray[np.float64]
                      ) -> tuple[Obstacle, float, float] | None:
        """Return the obstacle first met on a path, and where, see `first_contact_along`."""
        found = first_of_rows(outline, poses, self._obstacles.polygons, self.margin,
                              self._left_out(footprint))
        return found and (self._obstacles.bodies[found.row], found.pose, found.distance)

    def _left_out(self, footprint: Footprint, skipped: Iterable[Obstacle] = ()
                  ) -> NDArray[np.int64]:
        """Return the rows of obstacles that a footprint does not monitor, and of those skipped."""
        rows = (self._obstacles.rows_of_others(footprint.settings.monitors)
                if footprint.settings.obstacles else NO_ROWS)
        more = [one.row for one in skipped if one.row is not None]
        return np.sort(np.append(rows, np.array(more, np.int64))) if more else rows

    def _monitored(self, footprint: Footprint, rows: list[int]) -> list[Obstacle]:
        obstacles = self._obstacles.bodies
        return [obstacles[row] for row in rows
                if footprint.settings.monitors(obstacles[row].name.source)]


class _Placed(Generic[_Kind]):
    """The placed bodies of one kind, by row."""

    def __init__(self) -> None:
        self.polygons = PackedSet()
        self.bodies: dict[int, _Kind] = {}

    def place(self, body: _Kind, where: PackedBody, others: PackedSet,
              margin: float) -> list[int] | None:
        """Place or move a body; return the rows of others that it meets, None if it stayed."""
        row = body.row
        if row is None:
            self._take(row := self.polygons.new_row(), body)
        met = self.polygons.place(row, where, others, margin)
        if met is not None:
            body.moved()
        return met

    def reserve(self, bodies: Sequence[_Kind], counts: NDArray[np.int64]) -> list[int]:
        rows = self.polygons.new_rows(counts)
        for row, body in zip(rows, bodies):
            self._take(row, body)
        return rows

    def _take(self, row: int, body: _Kind) -> None:
        body.placed = self.polygons
        body.row = row
        self.bodies[row] = body

    def remove(self, body: _Kind) -> bool:
        """Remove a body; return whether it was placed."""
        if body.row is None:
            return False
        self.polygons.remove(body.row)
        del self.bodies[body.row]
        body.row = None
        body.moved()
        return True


class _PlacedObstacles(_Placed[Obstacle]):
    """The placed obstacles, and which row is of which source; a free row is of its last one."""

    def __init__(self) -> None:
        super().__init__()
        self._numbers: dict[str, int] = {}  # of the sources
        self._of_rows = array('l')

    def _take(self, row: int, body: Obstacle) -> None:
        super()._take(row, body)
        number = self._numbers.setdefault(body.name.source, len(self._numbers))
        self._of_rows[row:row + 1] = array('l', [number])

    def rows_of_others(self, monitors: Callable[[str], bool]) -> NDArray[np.int64]:
        """Return the rows of the sources that are not monitored, ascending."""
        is_other = np.array([not monitors(name) for name in self._numbers], np.bool_)
        return np.flatnonzero(is_other[np.asarray(self._of_rows)])


def update_contacts(body: Body[Any], others: Iterable[_Other]) -> set[_Other]:
    """Set the bodies that a body meets; return those gained or lost."""
    gained_or_lost = body.contacts.symmetric_difference(others)
    for other in gained_or_lost:
        other.toggle((body,))
    body.toggle(gained_or_lost)
    return gained_or_lost

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Obstacles and their names; bodies, which footprints are as well."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Generic, NamedTuple, TypeVar

from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.scene.velocity import MotionTracker

_Other = TypeVar('_Other', bound='Body[Any]')


class Body(Generic[_Other]):
    """A footprint or an obstacle: where it is, and its contacts."""

    __slots__ = ('row', 'contacts', 'placed', '_polygon')

    def __init__(self) -> None:
        # Its row in the set of placed bodies of its kind, None while it is nowhere; and that set.
        self.row: int | None = None
        self.placed: PackedSet | None = None
        self.contacts: set[_Other] = set()  # bodies of the other kind within the margin
        self._polygon: Polygon | None = None

    @property
    def polygon(self) -> Polygon | None:
        """Where the body is, None if nowhere; the same object until it moves."""
        if self._polygon is None and self.placed is not None and self.row is not None:
            self._polygon = self.placed.polygon(self.row)
        return self._polygon

    def moved(self) -> None:
        """Drop the polygon of its last place."""
        self._polygon = None

    def toggle(self, others: Collection[_Other]) -> None:
        """Add or remove contacts: those that are contacts end, the others begin."""
        self.contacts.symmetric_difference_update(others)


class ObstacleId(NamedTuple):
    source: str  # name of the source
    key: int  # its id, or without one its place among those received together
    number: int = 0  # tells apart bodies of one name that are there at one time; not shown

    def __str__(self) -> str:
        return f'{self.source}/{self.key}'


class Obstacle(Body[Body[Any]]):
    """
    An obstacle of a source; or, if `refused` says why, a stand-in for one that was refused.

    Its key identifies it in the group that holds it.
    """

    __slots__ = ('group', 'key', 'name', 'time', 'stamp', 'frame_id', 'refused', 'motion', 'sent')

    def __init__(self, group: Any, source: str, key: int) -> None:
        super().__init__()
        self.group = group
        self.key = key
        self.name = ObstacleId(source, key)
        self.time: float = 0  # that it counts from, in ns
        self.stamp = 0  # of its message in ns, as sent
        self.frame_id = ''
        self.refused: str | None = None
        self.sent: Any = None  # frame and points as sent, of a map in another frame
        self.motion: MotionTracker | None = None  # its last places, if those of its source move

    @property
    def polygon(self) -> Polygon | None:
        """Where the obstacle is, None if nowhere; the same Polygon while it stays there."""
        self.group.flush()
        return super().polygon

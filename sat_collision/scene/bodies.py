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

"""What footprints and obstacles have in common: a place, and what they touch there."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Generic, TypeVar

from sat_collision.geometry.polygon import Polygon
from sat_collision.geometry.polygon_set import PackedSet

_Other = TypeVar('_Other', bound='Body[Any]')


class Body(Generic[_Other]):
    """
    What can be placed: a footprint or an obstacle.

    Attributes
    ----------
    row : int or None
        Its row among the placed bodies of its kind, None while it is nowhere.
    contacts : set of Body
        The bodies of the other kind that share a point with it.
    placed : PackedSet or None
        The placed bodies of its kind.

    """

    __slots__ = ('row', 'contacts', 'placed', '_polygon')

    def __init__(self) -> None:
        self.row: int | None = None
        self.contacts: set[_Other] = set()
        self.placed: PackedSet | None = None
        self._polygon: Polygon | None = None

    @property
    def polygon(self) -> Polygon | None:
        """Where the body is, None if nowhere; the same Polygon while it stays there."""
        if self._polygon is None and self.placed is not None and self.row is not None:
            self._polygon = self.placed.polygon(self.row)
        return self._polygon

    def moved(self) -> None:
        """Take note that it is somewhere else now."""
        self._polygon = None

    def toggle(self, others: Collection[_Other]) -> None:
        """Take note that it meets each of these if it did not, and not if it did."""
        self.contacts.symmetric_difference_update(others)

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

"""Placements: the messages that were taken, as the input of recorded motion."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, cast, NamedTuple, TypeAlias

from sat_collision.geometry.polygon import Affine2D
from sat_collision.messages.cdr import POINT_SIZE, Points

# The bytes of the messages of a run; the end of each but the last, an array of int64; and where in
# each message the points start.
RunPoints: TypeAlias = tuple[bytes, Any, int]


class Placement(NamedTuple):
    """A message that was taken, or a run of messages that differ only in their points."""

    name: str  # of the footprint or source of obstacles
    stamp: int  # in ns, the time of reception if it has none
    is_stamped: bool
    frame_id: str  # after the map is applied
    points: Points | RunPoints  # as received
    affine: Affine2D | None  # the map of the points to that frame, None if they are in it
    instance: int | None  # the obstacle's id, of a source that gives ids

    @property
    def is_empty(self) -> bool:
        """Whether the message has no points, which ends a set or a map."""
        return not self.points[2]

    @property
    def single(self) -> Points:
        """The points of a single message."""
        return cast(Points, self.points)

    @property
    def shape(self) -> bytes:
        """The bytes of the points of a single message."""
        data, start, count = self.single
        return data[start:start + POINT_SIZE * count]

    def each(self) -> Iterator[Placement]:
        """Yield the messages of a run one by one."""
        data, ends, points_at = self.points
        if isinstance(ends, int):
            yield self
        else:
            for start, end in pairwise([0, *ends.tolist(), len(data)]):
                start += points_at
                yield self._replace(points=(data, start, (end - start) // POINT_SIZE))

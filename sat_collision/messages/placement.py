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

"""The places of bodies as of messages, the input of recorded motion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import cast, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.polygon import PlaneMap
from sat_collision.messages.cdr import POINT_SIZE, Points

# The bytes of a run, and two arrays: where in them the points of each message start, and how many
# there are.
RunPoints: TypeAlias = tuple[bytes, NDArray[np.int64], NDArray[np.int64]]


class Placement(NamedTuple):
    """A message that was taken, or a run of them, which differ in nothing but their points."""

    name: str  # of the footprint or source of obstacles
    stamp: int  # in ns, the time of reception if it has none
    is_stamped: bool
    frame_id: str  # after the map is applied
    points: Points | RunPoints  # as received
    plane: PlaneMap | None  # what takes the points to that frame, None if they are in it
    instance: int | None  # the obstacle's id, of a source that gives ids

    @property
    def is_empty(self) -> bool:
        """Whether the message has no points, which ends a set or a map."""
        return isinstance(self.points[2], int) and not self.points[2]

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
        data, starts, counts = self.points
        if isinstance(starts, int) or isinstance(counts, int):
            yield self
        else:
            for start, count in zip(starts.tolist(), counts.tolist()):
                yield self._replace(points=(data, start, count))


def points_of_run(messages: Sequence[bytes], points_at: int) -> RunPoints:
    """Return the points of a run of messages as a Placement has them; where in each they start."""
    return b''.join(messages), *_outlines(points_at, *map(len, messages))


@lru_cache(32)
def _outlines(points_at: int, *sizes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where points start, and how many they are, of messages one behind the other."""
    lengths = np.array(sizes, np.int64)
    starts = np.cumsum(lengths) - lengths + points_at
    return starts, (lengths - points_at) // POINT_SIZE

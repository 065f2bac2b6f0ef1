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

"""Obstacles and their names."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, TypeAlias

from sat_collision.scene.bodies import Body
from sat_collision.scene.deadlines import NEVER

# A place in a set; an id; a shape; or the name of a place that is none.
Key: TypeAlias = 'int | bytes | str'


class ObstacleId(NamedTuple):
    """
    The name of an obstacle.

    Attributes
    ----------
    source : str
        Name of the source.
    key : int
        Its place in the source's sets, or its id. Obstacles known by their shape alone (stamp 0,
        accumulate) have neither and are numbered -1, -2, ...

    """

    source: str
    key: int

    def __str__(self) -> str:
        return f'{self.source}/{self.key}'


class Owner(Protocol):
    """What an obstacle asks of what holds it."""

    timeout: float

    def forget(self, obstacle: Obstacle) -> None:
        """Drop an obstacle."""


class Obstacle(Body[Body[Any]]):
    """
    An obstacle of a source; or, if `refused` says why, the place of one that was refused.

    Attributes
    ----------
    held_by : Owner
    key : Key
        What it is known by there.
    name : ObstacleId
    time : int or float
        Time in ns that it counts from.
    frame_id : str
    refused : str or None
        Why the message that it stands for was refused.

    """

    __slots__ = ('held_by', 'key', 'name', 'time', 'frame_id', 'refused', 'watched')

    def __init__(self, held_by: Owner, source: str, key: Key, number: int,
                 time: float) -> None:
        super().__init__()
        self.held_by = held_by
        self.key = key
        self.name = ObstacleId(source, number)
        self.time = time
        self.frame_id = ''
        self.refused: str | None = None
        self.watched: float = NEVER

    @property
    def deadline(self) -> float:
        """Time in ns after which the obstacle is forgotten."""
        return self.time + self.held_by.timeout

    def expire(self) -> None:
        """Forget the obstacle, now that its deadline is past."""
        self.held_by.forget(self)

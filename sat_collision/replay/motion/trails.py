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

"""What a source of obstacles tells, as steps from one moment to the next."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeAlias

from sat_collision.replay.motion.bodies import Bodies, Ring
from sat_collision.replay.motion.encounters import Step
from sat_collision.scene.obstacles import Obstacle, ObstacleId

# No motion is made up over more than this, whatever the timeout, ns.
LONGEST = 10 * 10**9


class Coming:
    """
    Messages that come in, until they are seen together; of equal names the last counts.

    Parameters
    ----------
    max_vertices : int

    """

    def __init__(self, max_vertices: int) -> None:
        self._max_vertices = max_vertices
        self._messages: dict[ObstacleId, tuple[int, Ring, Obstacle, str]] = {}

    def __bool__(self) -> bool:
        return bool(self._messages)

    def __contains__(self, name: ObstacleId) -> bool:
        return name in self._messages

    @property
    def first_stamp(self) -> int:
        """The stamp of the first message, of which there must be one."""
        return next(iter(self._messages.values()))[0]

    def add(self, obstacle: Obstacle, stamp: int, ring: Ring) -> None:
        """Add what was told of an obstacle."""
        self._messages[obstacle.name] = stamp, ring, obstacle, obstacle.frame_id

    def holds(self, obstacle: Obstacle) -> bool:
        """Tell whether one of the messages is of this very obstacle."""
        message = self._messages.get(obstacle.name)
        return message is not None and message[2] is obstacle

    def take(self, frame_id: str) -> tuple[Bodies, dict[Obstacle, int]]:
        """Return what is in a frame, in any if it is empty, and each one's row; forget all."""
        found = {name: message for name, message in self._messages.items()
                 if message[3] == frame_id or not frame_id}
        self._messages = {}
        frames = {message[3] for message in found.values()}
        bodies = Bodies(list(found), [message[0] for message in found.values()],
                        [message[1] for message in found.values()], self._max_vertices,
                        frames.pop() if len(frames) == 1 else '')
        return bodies, {message[2]: row for row, message in enumerate(found.values())}


class Trail(ABC):
    """
    Follows bodies from one moment at which they were seen to the next.

    A body that is not seen again stands where it was until the scene forgets it, unless it is
    known to move.

    Parameters
    ----------
    patience : int
        Over how long a motion is made up at most, ns.
    max_vertices : int
    emit : callable
        Takes the trail and each Step.

    Attributes
    ----------
    undecided : int
        For how long it was not known how something moved, ns.

    """

    def __init__(self, patience: int, max_vertices: int, emit: Emit) -> None:
        self.undecided = 0
        self._patience = patience
        self._emit = emit
        self._frame_id = ''
        self._coming = Coming(max_vertices)

    @abstractmethod
    def place(self, obstacle: Obstacle, stamp: int, ring: Ring) -> None:
        """Take what was told of an obstacle; stamp in ns."""

    @abstractmethod
    def forget(self, obstacle: Obstacle, now: int) -> None:
        """Take note that the scene holds an obstacle no longer; now in ns."""

    def use_frame(self, frame_id: str) -> None:
        """Drop what is in another frame than this."""
        self._frame_id = frame_id

    @abstractmethod
    def rest(self, now: int, is_over: bool = False) -> None:
        """Let what has not been seen for long, or all if that is all there is, have stood."""


Emit: TypeAlias = Callable[[Trail, Step], None]

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

"""Messages that wait for a transform, in the order in which they came."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import enum
from typing import Generic, TypeVar

from sat_collision.scene.settings import NEVER

_Item = TypeVar('_Item')
_Outcome = TypeVar('_Outcome')


class Wait(enum.Enum):
    """The outcome of a message that must go on waiting."""

    WAIT = 'wait'


WAIT = Wait.WAIT


class Waiting(Generic[_Item, _Outcome]):
    """
    Queues of waiting items by name, each in order of arrival.

    `take` is called with a name, the first item, the present time in ns and whether it may go on
    waiting; it returns WAIT if it does, else an outcome.
    """

    def __init__(self, take: Callable[[str, _Item, int, bool], _Outcome | Wait | None]) -> None:
        self._take = take
        # The items and until when they may wait, by name; none is empty.
        self.queues: dict[str, deque[tuple[_Item, int]]] = {}
        # When the first of them must be taken.
        self.earliest = NEVER

    def __contains__(self, name: object) -> bool:
        """Return whether something waits under this name."""
        return name in self.queues

    def counts(self) -> dict[str, int]:
        """Return the number of waiting items by name."""
        return {name: len(queue) for name, queue in self.queues.items()}

    def add(self, name: str, item: _Item, now: int, timeout: int, limit: int) -> list[_Outcome]:
        """
        Append an item to the queue of its name, where it may wait until the timeout.

        Beyond `limit` items the oldest are taken at once; return their outcomes.
        """
        queue = self.queues.setdefault(name, deque())
        queue.append((item, now + timeout))
        outcomes: list[_Outcome] = []
        while len(queue) > limit:
            self._take_first(name, now, False, outcomes)
        self._find_earliest()
        return outcomes

    def take(self, now: int) -> list[_Outcome]:
        """Take the items that need not wait any more, and return their outcomes."""
        outcomes: list[_Outcome] = []
        for name, queue in [*self.queues.items()]:
            while queue and self._take_first(name, now, now <= queue[0][1], outcomes):
                pass
            if not queue:
                del self.queues[name]
        self._find_earliest()
        return outcomes

    def drop(self) -> None:
        """Drop all that waits."""
        self.queues.clear()
        self.earliest = NEVER

    def _take_first(self, name: str, now: int, may_wait: bool, outcomes: list[_Outcome]) -> bool:
        """Take the first item of a name, if it need not wait; return whether it was taken."""
        queue = self.queues[name]
        outcome = self._take(name, queue[0][0], now, may_wait)
        if isinstance(outcome, Wait):
            return False
        queue.popleft()
        if outcome is not None:
            outcomes.append(outcome)
        return True

    def _find_earliest(self) -> None:
        self.earliest = min((queue[0][1] for queue in self.queues.values()), default=NEVER)

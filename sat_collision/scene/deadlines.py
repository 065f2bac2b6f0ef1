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

"""Deadlines of many things, looked after at a cost that does not depend on how many there are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import heapq
import itertools
from typing import Protocol

NEVER = float('inf')


class Perishable(Protocol):
    """What has a deadline."""

    watched: float

    @property
    def deadline(self) -> float:
        """Time in ns, or NEVER."""

    def expire(self) -> None:
        """Do what is due when the deadline has passed."""


class Alarm:
    """
    A moment at which something is to be done; it can be put off at no cost.

    Parameters
    ----------
    ring : callable
        What is to be done.

    Attributes
    ----------
    deadline : int or float
        The moment in ns, or NEVER.

    """

    def __init__(self, ring: Callable[[], None]) -> None:
        self.deadline: float = NEVER
        self.watched: float = NEVER
        self._ring = ring

    def expire(self) -> None:
        """Do it."""
        self._ring()


class Deadlines:
    """
    Tells which things have let their deadline pass.

    A thing has `deadline`, in ns or NEVER, and `watched`, which is kept here and begins as NEVER.
    A deadline put off costs nothing: its entry in the queue is a lower bound, looked at again only
    when it comes up. To stop watching a thing, set its `watched` to NEVER.

    Attributes
    ----------
    earliest : int or float
        A lower bound of all deadlines in ns, NEVER if there are none.

    """

    def __init__(self) -> None:
        self.earliest: float = NEVER
        self._queue: list[tuple[float, int, Perishable]] = []
        self._order = itertools.count()
        self._most = 64

    def watch(self, thing: Perishable) -> None:
        """Look after a thing: to be called when it is new or its deadline may be earlier."""
        deadline = thing.deadline
        if deadline < thing.watched:
            thing.watched = deadline
            if len(self._queue) >= self._most:
                self._discard_dead()
            heapq.heappush(self._queue, (deadline, next(self._order), thing))
            self.earliest = self._queue[0][0]

    def missed(self, now: int) -> Iterator[Perishable]:
        """Yield the things whose deadline lies before now (ns), and watch these no longer."""
        queue = self._queue
        while queue and queue[0][0] < now:
            entry, _, thing = heapq.heappop(queue)
            if thing.watched == entry:
                thing.watched = NEVER
                if thing.deadline < now:
                    yield thing
                else:
                    self.watch(thing)
        self.earliest = queue[0][0] if queue else NEVER

    def _discard_dead(self) -> None:
        """Drop the entries that stand for nothing any more, so that they cannot pile up."""
        self._queue[:] = [item for item in self._queue if item[2].watched == item[0]]
        heapq.heapify(self._queue)
        self._most = 64 + 2 * len(self._queue)

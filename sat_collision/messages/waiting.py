# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages that wait for their transforms, and what must not overtake them."""

from __future__ import annotations

from bisect import bisect
from collections import deque
from collections.abc import Callable
from heapq import heappop, heappush
from itertools import islice, takewhile
from typing import NamedTuple

from sat_collision.messages.ingest import Ingest, Wait
from sat_collision.messages.rejections import Rejection
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import NEVER, ObstacleSettings, Settings

# Max messages that wait for transforms: of a footprint; of a source in multiples of max_count.
_FOOTPRINTS_WAIT = 100
_SETS_WAIT = 2
# Max bytes of them.
_BYTES_WAIT = 1 << 26


class Held(NamedTuple):
    """A queued message, or what happens to its stream after those before it."""

    data: bytes = b''
    number: int | None = None
    arrived: int = 0
    happens: Callable[[], None] | None = None
    until: int = 0  # when its wait ends
    end: float | None = None  # see `Ingest.end_of`


class _Queue:
    """Items in the order of their arrival, numbered, of which the first waits."""

    def __init__(self, first: int) -> None:
        self.first = first  # the number of the first item
        self.items: deque[Held] = deque()
        self.size = 0  # in bytes
        # The obstacles without a place, by frame a heap of stamp, number and bytes of each.
        self._unplaced: dict[str, list[tuple[int, int, bytes]]] = {}

    def append(self, held: Held, wait: Wait | None) -> None:
        """Add an item, with what its message waits for, if it does."""
        if wait:
            heap = self._unplaced.setdefault(wait.frame_id, [])
            heappush(heap, (wait.stamp, self.first + len(self.items), held.data))
        self.items.append(held)
        self.size += len(held.data)

    def pop(self) -> None:
        self.size -= len(self.items.popleft().data)
        self.first += 1

    def apply_placed(self, apply: Callable[[bytes, int], Wait | None]) -> bool:
        """Apply obstacles by bytes and number while they have a place; return whether any had."""
        is_any = False
        for heap in self._unplaced.values():
            while heap:
                _, number, data = heap[0]
                if number >= self.first and apply(data, number):
                    break
                heappop(heap)
                is_any = True
        return is_any

    @property
    def replaced(self) -> int:
        """How many of the first items a later listing replaces, all of which has its place."""
        ends = [k for k, held in enumerate(self.items) if held.end is not None]
        unplaced = sorted(k - self.first for heap in self._unplaced.values() for _, k, _ in heap)
        for before, end in zip(reversed(ends[:-1]), reversed(ends)):
            if bisect(unplaced, before) == bisect(unplaced, end):
                newest = self.items[end].end or NEVER
                return sum(1 for _ in takewhile(
                    lambda held: held.end is None or held.end <= newest,
                    islice(self.items, before + 1)))
        return 0


class WaitingItems:
    """
    Queues of waiting items by name, each in order of arrival.

    The first one of a queue waits for its transform. An obstacle behind it counts at once if it
    has its place, and a listing all of which has its place need not wait for those before it.
    The scene is told which item of a source is the first. Times are in ns.
    """

    def __init__(self, settings: Settings, ingest: Ingest, scene: Scene) -> None:
        self._ingest = ingest
        self._scene = scene
        self._queues: dict[str, _Queue] = {}  # by name; none is empty
        self._count = 0
        # The numbers of the first items by name, as last told to the scene.
        self._firsts: dict[str, int] = {}
        self.earliest = NEVER  # when the first of them must be applied
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        self._timeout = round(settings.transform_timeout * 1e9)

    def __contains__(self, name: object) -> bool:
        return name in self._queues

    def counts(self) -> dict[str, int]:
        """Return the number of waiting items by name."""
        return {name: len(queue.items) for name, queue in self._queues.items()}

    def hold(self, name: str, held: Held, now: int, wait: Wait | None = None) -> list[Rejection]:
        """
        Let an item wait; beyond a number of items or bytes the oldest are applied.

        `wait` is what it waits for if it is the first one.
        """
        settings = self._scene.settings_of(name)
        limit, end = _FOOTPRINTS_WAIT, None
        if isinstance(settings, ObstacleSettings):
            limit = _SETS_WAIT * settings.max_count
            end = None if held.happens else self._ingest.end_of(settings, held.data, now)
        queue = self._queues.get(name)
        if queue is None:
            queue = self._queues[name] = _Queue(self._count)
        elif not held.happens:
            wait = self._apply_early(name, held.data, now, queue.first + len(queue.items))
        self._count += 1
        queue.append(held._replace(until=now + self._timeout, end=end), wait)
        rejections: list[Rejection] = []
        excess = max(len(queue.items) - limit, 0 if end is None or wait else queue.replaced)
        applied = 0
        while applied < excess or len(queue.items) > 1 and queue.size > _BYTES_WAIT:
            self._apply_first(name, now, False, rejections)
            applied += 1
        if applied:
            rejections += self.apply(now)
        elif len(queue.items) == 1:
            self._note_firsts()
        return rejections

    def apply(self, now: int) -> list[Rejection]:
        """Apply the items that need not wait any more."""
        rejections: list[Rejection] = []
        for name, queue in [*self._queues.items()]:
            while self._apply_placed(name, queue, now, rejections):
                for _ in range(queue.replaced):
                    self._apply_first(name, now, False, rejections)
            if not queue.items:
                del self._queues[name]
        self._note_firsts()
        return rejections

    def renew(self, name: str) -> None:
        """Drop the messages of a name: they come again, or are not wanted."""
        source = self._scene.sources.get(name)
        for held in self._queues.pop(name, _Queue(0)).items:
            if held.happens:
                held.happens()
            elif source:
                source.stream.drop(held.number)
        self._note_firsts()

    def limit_times(self, now: int) -> None:
        """Let no item wait longer because the clock went back a little."""
        latest = now + self._timeout
        for queue in self._queues.values():
            queue.items = deque(held._replace(until=min(held.until, latest))
                                for held in queue.items)
        self._note_firsts()

    def clear(self, now: int) -> None:
        """Drop all messages: the clock was set. A map goes on without those, to be sent again."""
        queues, self._queues = self._queues, {}
        for name, queue in queues.items():
            settings = self._scene.settings_of(name)
            is_map = isinstance(settings, ObstacleSettings) and not settings.timeout
            for held in queue.items:
                if held.happens or is_map:
                    self._apply(name, held, now, False)
        self._note_firsts()

    def _note_firsts(self) -> None:
        """Find when an item is due, and tell the scene which ones wait."""
        self.earliest = min((queue.items[0].until for queue in self._queues.values()),
                            default=NEVER)
        firsts = {name: queue.first for name, queue in self._queues.items()}
        for name in firsts.keys() | self._firsts.keys():
            if firsts.get(name) != self._firsts.get(name):
                self._scene.wait(name, firsts.get(name, NEVER))
        self._firsts = firsts

    def _apply_placed(self, name: str, queue: _Queue, now: int,
                      rejections: list[Rejection]) -> bool:
        """Apply first items, and let others count; return whether a listing may have its place."""
        while queue.items and self._apply_first(
                name, now, now <= queue.items[0].until, rejections):
            pass
        return queue.apply_placed(lambda data, order: self._apply_early(name, data, now, order))

    def _apply_first(self, name: str, now: int, may_wait: bool,
                     rejections: list[Rejection]) -> bool:
        """Apply the first item of a name, if it need not wait; return whether that was done."""
        queue = self._queues[name]
        outcome = self._apply(name, queue.items[0], now, may_wait)
        if isinstance(outcome, Wait):
            return False
        queue.pop()
        if outcome is not None:
            rejections.append(outcome)
        return True

    def _apply(self, name: str, held: Held, now: int, may_wait: bool) -> Rejection | Wait | None:
        if held.happens:
            held.happens()
            return None
        return self._ingest.apply(self._scene.settings_of(name), held.data, held.number, now,
                                  held.arrived, may_wait)

    def _apply_early(self, name: str, data: bytes, now: int, order: int) -> Wait | None:
        """Let an obstacle count that is queued behind the first item, unless it has no place."""
        settings = self._scene.settings_of(name)
        return (self._ingest.apply_early(settings, data, now, order)
                if isinstance(settings, ObstacleSettings) else None)

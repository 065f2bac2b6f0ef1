# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The core that the node and the replay tool share: serialised messages in, states out."""

from __future__ import annotations

from bisect import bisect
from collections import Counter, deque
from collections.abc import Callable, Sequence
from functools import partial
from heapq import heappop, heappush
from itertools import islice, takewhile
from typing import NamedTuple, TypeAlias

from sat_collision.messages.ingest import Batch, Ingest, Placement, Wait
from sat_collision.messages.outlines import Commands, Outlines
from sat_collision.messages.paths import Paths
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, NEVER, ObstacleSettings, Settings
from sat_collision.scene.streams import Endpoint

# Max messages that wait for transforms: of a footprint; of a source in multiples of max_count.
_FOOTPRINTS_WAIT = 100
_SETS_WAIT = 2
# Max bytes of them.
_BYTES_WAIT = 1 << 26
_NOTHING: Sequence[Rejection] = ()

# A queued item: a message and its number, or what happens to its stream then.
_Item: TypeAlias = 'tuple[bytes, int | None] | Callable[[], None]'


class Monitor:
    """
    Receives serialised messages and updates the scene.

    An unusable message never raises: it is counted and returned as a Rejection. It counts in the
    scene, too, because it stands for a body at an unknown place.

    A message in another frame than the fixed one waits until the transform at its stamp has
    arrived; later messages of the same footprint or source queue behind it. After
    `transform_timeout` it is refused. Calls that end a wait also return the Rejections of the
    messages that had waited. A footprint that has an outline moves with its frame.

    Times are in ns by the clock of the header stamps. The number of a message is its sequence
    number among those of its publisher, None if unknown.

    Parameters
    ----------
    settings : Settings
    transforms : bool, optional
        Whether /tf is received; if not, messages in other frames are refused.
    placements : list of Placement, optional
        Receives the accepted messages.
    decides_contacts : bool, optional
        Whether the scene decides contacts; if not, only what is unknown is found.

    """

    def __init__(self, settings: Settings, transforms: bool = False,
                 placements: list[Placement] | None = None,
                 decides_contacts: bool = True) -> None:
        self.scene = Scene(settings, decides_contacts)
        # Number of messages by name of the footprint or source; for an outline, of its poses.
        self.received: Counter[str] = Counter()
        self.transforms = TransformListener(settings)
        has_transforms = transforms or any(one.odometry for one in settings.footprints)
        self.ingest = Ingest(settings, self.scene, self.transforms if has_transforms else None,
                             placements)
        # Number of refused messages, by (name, reason).
        self.rejected = self.ingest.rejected
        self.outlines = Outlines(settings, self.ingest, self.transforms, self.received)
        self.commands = Commands(settings, self.ingest, self.scene)
        self.paths = Paths(self.ingest, self.scene, self.transforms, self.outlines)
        self.waiting = WaitingItems(self._take_waiting, self._take_early)
        # The numbers of the first messages that wait, by name, as last told to the scene.
        self._firsts: dict[str, int] = {}
        self._timeout = round(settings.transform_timeout * 1e9)
        self._tolerance = round(settings.future_tolerance * 1e9)
        self._now = 0

    def update(self, settings: Settings) -> list[Rejection]:
        """Apply changed settings, with the same names, topics and types."""
        self._timeout = round(settings.transform_timeout * 1e9)
        self._tolerance = round(settings.future_tolerance * 1e9)
        self.transforms.configure(settings)
        self.outlines.configure(settings)
        self.scene.update(settings)
        self._request_maps(self._now)
        return self._follow(self._now)

    @property
    def lost(self) -> Counter[str]:
        """Number of messages that were sent but not received, by name."""
        return self.scene.lost()

    def receive(self, name: str, data: bytes, now: int,
                number: int | None = None) -> Rejection | None:
        """
        Receive a message for a footprint, source or command; ignore it if that is disabled.

        It is a serialised PolygonStamped, PolygonInstanceStamped, Odometry or TwistStamped.
        """
        rejections = self.receive_batch(name, (data,), now, number)
        return rejections[0] if rejections else None

    def receive_batch(self, name: str, messages: Sequence[bytes], now: int,
                      number: int | None = None) -> Sequence[Rejection]:
        """
        Receive consecutive messages of one publisher as `receive` does.

        The number is that of the first message.
        """
        self.received[name] += len(messages)
        if name in self.commands.names:
            return self.commands.receive(name, messages, now)
        if name in self.paths.names:
            self.paths.receive(name, messages[-1])
            return _NOTHING
        self._watch_clock(now)
        rejections: Sequence[Rejection] = _NOTHING
        batch = Batch(messages, number) if name in self.ingest.headers else None
        taken = 0
        while taken < len(messages):
            if batch and name not in self.waiting and (
                    run := self.ingest.take_run(name, batch, taken, now)):
                taken += run
            else:
                if refused := self._admit(name, messages[taken], number and number + taken, now):
                    rejections = [*rejections, *refused]
                taken += 1
        return rejections

    def receive_run(self, name: str, batch: Batch, begin: int, now: int) -> int:
        """
        Receive messages of a batch, from `begin` on, that only add to the set of the one before.

        Returns how many were taken. The next one must be received by itself.
        """
        self._watch_clock(now)
        taken = 0 if name in self.waiting else self.ingest.take_run(name, batch, begin, now)
        self.received[name] += taken
        return taken

    def receive_mixed(self, name: str, messages: Sequence[bytes],
                      now: int) -> Sequence[Rejection]:
        """
        Receive messages while one more publisher was matched with the topic.

        They may be of either, so obstacles count, but end and replace nothing.
        """
        if name not in self.scene.source_names:
            rejections = self.receive_batch(name, messages, now)
            self.interrupt(name)
            return rejections
        self._follow_stream(name, partial(self.scene.mix, name, True))
        rejections = self.receive_batch(name, messages, now)
        self._follow_stream(name, partial(self.scene.mix, name, False))
        return rejections

    def update_publishers(self, name: str, endpoints: list[Endpoint]) -> None:
        """Update the publishers of a footprint or source."""
        self._follow_stream(name, partial(self.scene.update_publishers, name, endpoints))

    def interrupt(self, name: str) -> None:
        """Record that the next message of a name is not known to continue the one before."""
        self._follow_stream(name, partial(self.scene.interrupt, name))

    def lose(self, name: str) -> None:
        """Record that messages were lost before the next one; for a source, as it is told so."""
        if name in self.scene.source_names:
            self._follow_stream(name, partial(self.scene.lose, name))

    def renew(self, name: str) -> None:
        """Start a source anew: a new subscription receives all that its publisher keeps."""
        for item in self.waiting.drop(name):
            if callable(item):
                item()
        self._note_waiting()
        self.scene.renew(name)

    def _follow_stream(self, name: str, happens: Callable[[], None]) -> None:
        """Let something happen to a stream, after the messages of it that wait."""
        if name in self.waiting:
            self._hold(self.scene.settings_of(name), happens, self._now)
        else:
            happens()

    def receive_transforms(self, topic: str, data: bytes, now: int,
                           number: int | None = None) -> list[Rejection]:
        """Receive a message of /tf or /tf_static, and take the messages that waited for it."""
        self._watch_clock(now)
        return self.transforms.receive(topic, data, now, number) + self._take_moved(now)

    def advance(self, now: int) -> list[Rejection]:
        """Let time pass, see `Scene.pass_time`, and refuse messages that waited too long."""
        self._watch_clock(now)
        rejections = self._follow(now) if self.outlines.deadline < now else []
        if self.waiting.earliest < now:
            rejections += self._take_waited(now)
        self.scene.pass_time(now)
        return rejections

    @property
    def deadline(self) -> float:
        """Earliest time in ns after which anything may change without a message, or NEVER."""
        deadline = min(self.scene.deadline, self.waiting.earliest)
        return min(deadline, self.outlines.deadline) if self.outlines.names else deadline

    def _take_moved(self, now: int) -> list[Rejection]:
        """Take messages whose transforms have arrived, and place outlines that have moved."""
        rejections = self._follow(now)
        if self.waiting.earliest < NEVER:
            rejections += self._take_waited(now)
        self._request_maps(now)
        self.ingest.follow_maps(now)
        return rejections

    def _take_waited(self, now: int) -> list[Rejection]:
        """Take the messages that need not wait any more."""
        rejections = self.waiting.take(now)
        self._note_waiting()
        return rejections

    def _note_waiting(self) -> None:
        """Tell the scene which messages wait."""
        firsts = self.waiting.firsts
        for name in firsts.keys() | self._firsts.keys():
            if firsts.get(name) != self._firsts.get(name):
                self.scene.wait(name, firsts.get(name, NEVER))
        self._firsts = firsts

    def _request_maps(self, now: int) -> None:
        """Request maps again that were refused for lack of a transform, once there is one."""
        for name, frame_id in [*self.ingest.untransformed.items()]:
            found = self.transforms.lookup_affine(frame_id, 0, now)
            if not isinstance(found, NoTransform):
                del self.ingest.untransformed[name]
                self.scene.request_history(name)

    def _follow(self, now: int) -> list[Rejection]:
        """Place the outlines that have moved, once there is a clock."""
        return self.outlines.follow(now) if now else []

    def _watch_clock(self, now: int) -> None:
        """
        Drop transforms, waiting messages and places of outlines if the clock was set back.

        When it starts, drop transforms of another clock: they would shut out those that follow.
        """
        if now < self._now - self._tolerance:
            self._forget_times(now)
        elif now < self._now:
            self.outlines.limit_times(now)
        elif now and not self._now:
            self.transforms.frames.clear(after=now + self._tolerance)
        self._now = now

    def set_clock(self, now: int) -> bool:
        """
        Begin anew, because the clock was set: times of before are those of another one.

        Return whether there was a time before.
        """
        if not self._now:
            return False
        self._forget_times(now)
        self._now = now
        self.scene.set_clock(now)
        self.scene.pass_time(now)
        return True

    def _forget_times(self, now: int) -> None:
        self.transforms.frames.clear()
        self.outlines.clear()
        self.paths.clear()
        for name in self.waiting.counts():
            # A map goes on: what of it waited is refused, and asked for again.
            is_map = name in self.scene.source_names and not self.scene.settings_of(name).timeout
            for item in self.waiting.drop(name):
                if callable(item) or is_map:
                    self._take_waiting(name, item, now, False)
        self._note_waiting()
        self.ingest.follow_maps(self._now)

    def _admit(self, name: str, data: bytes, number: int | None,
               now: int) -> Sequence[Rejection]:
        """Take a message or queue it: for a transform, or behind messages that wait for one."""
        settings = self.scene.settings_of(name)
        if not settings.enabled:
            return _NOTHING
        if name in self.outlines.names:
            if number is not None:
                self.scene.receive_number(name, number, now)
            return self.outlines.receive(name, data, now) + self._take_moved(now)
        wait = None
        if name not in self.waiting:
            outcome = self.ingest.take(settings, data, number, now)
            if not isinstance(outcome, Wait):
                return [outcome] if outcome else _NOTHING
            wait = outcome
        return self._hold(settings, (data, number), now, wait)

    def _hold(self, settings: FootprintSettings | ObstacleSettings, item: _Item,
              now: int, wait: Wait | None = None) -> list[Rejection]:
        """Queue a message, or what happens to its stream after it."""
        limit, end = _FOOTPRINTS_WAIT, None
        if isinstance(settings, ObstacleSettings):
            limit = _SETS_WAIT * settings.max_count
            end = None if callable(item) else self.ingest.end_of(settings, item[0])
        rejections = self.waiting.add(
            settings.name, _Held(item, now + self._timeout, end), now, limit, wait)
        self._note_waiting()
        return rejections

    def _take_waiting(self, name: str, item: _Item, now: int,
                      may_wait: bool) -> Rejection | Wait | None:
        """Take the first item queued for a footprint or source, if it need not wait longer."""
        settings = self.scene.settings_of(name)
        if callable(item):
            item()
        elif settings.enabled:
            return self.ingest.take(settings, *item, now, may_wait)
        return None

    def _take_early(self, name: str, data: bytes, now: int, order: int) -> Wait | None:
        """Let an obstacle count that is queued behind the first item, unless it has no place."""
        settings = self.scene.settings_of(name)
        if isinstance(settings, ObstacleSettings) and settings.enabled:
            return self.ingest.take_early(settings, data, now, order)
        return None


class _Held(NamedTuple):
    """A queued item."""

    item: _Item
    until: int  # when its wait ends, in ns
    end: float | None  # see `Ingest.end_of`


class _Queue:
    """Items in the order of their arrival, numbered, of which the first waits."""

    def __init__(self, first: int) -> None:
        self.first = first  # the number of the first item
        self.items: deque[_Held] = deque()
        self.size = 0  # in bytes
        # The obstacles without a place, by frame a heap of stamp, number and bytes of each.
        self._unplaced: dict[str, list[tuple[int, int, bytes]]] = {}

    def append(self, held: _Held, wait: Wait | None) -> None:
        """Add an item, with what its message waits for, if it does."""
        if wait and not callable(held.item):
            heap = self._unplaced.setdefault(wait.frame_id, [])
            heappush(heap, (wait.stamp, self.first + len(self.items), held.item[0]))
        self.items.append(held)
        self.size += _size_of(held.item)

    def pop(self) -> None:
        """Drop the first item."""
        self.size -= _size_of(self.items.popleft().item)
        self.first += 1

    def place(self, take: Callable[[bytes, int], Wait | None]) -> bool:
        """Take obstacles by bytes and number while they have a place; return whether any had."""
        is_any = False
        for heap in self._unplaced.values():
            while heap:
                _, number, data = heap[0]
                if number >= self.first and take(data, number):
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

    `take` is called with a name, the first item, the present time in ns and whether it may go on
    waiting; it returns a Wait if it does. `take_early` is called with the name, bytes and number
    of a message behind the first one, which counts at once unless a Wait is returned. A listing
    all of which has its place need not wait for those before it.
    """

    def __init__(self, take: Callable[[str, _Item, int, bool], Rejection | Wait | None],
                 take_early: Callable[[str, bytes, int, int], Wait | None]) -> None:
        self._take = take
        self._take_early = take_early
        # By name; none is empty.
        self._queues: dict[str, _Queue] = {}
        self._count = 0
        # When the first of them must be taken.
        self.earliest = NEVER

    def __contains__(self, name: object) -> bool:
        """Return whether something waits under this name."""
        return name in self._queues

    def counts(self) -> dict[str, int]:
        """Return the number of waiting items by name."""
        return {name: len(queue.items) for name, queue in self._queues.items()}

    @property
    def firsts(self) -> dict[str, int]:
        """The number of the first item by name."""
        return {name: queue.first for name, queue in self._queues.items()}

    def add(self, name: str, held: _Held, now: int, limit: int,
            wait: Wait | None = None) -> list[Rejection]:
        """
        Let an item wait; beyond `limit` items, or too many bytes, the oldest are taken.

        `wait` is what it waits for if it is the first one.
        """
        queue = self._queues.get(name)
        if queue is None:
            queue = self._queues[name] = _Queue(self._count)
        elif not callable(held.item):
            wait = self._take_early(name, held.item[0], now, queue.first + len(queue.items))
        self._count += 1
        queue.append(held, wait)
        self.earliest = min(self.earliest, queue.items[0].until)
        rejections: list[Rejection] = []
        excess = max(len(queue.items) - limit, 0 if held.end is None or wait else queue.replaced)
        taken = 0
        while taken < excess or len(queue.items) > 1 and queue.size > _BYTES_WAIT:
            self._take_first(name, now, False, rejections)
            taken += 1
        return rejections + self.take(now) if taken else rejections

    def take(self, now: int) -> list[Rejection]:
        """Take the items that need not wait any more."""
        rejections: list[Rejection] = []
        for name, queue in [*self._queues.items()]:
            while self._take_placed(name, queue, now, rejections):
                for _ in range(queue.replaced):
                    self._take_first(name, now, False, rejections)
            if not queue.items:
                del self._queues[name]
        self._find_earliest()
        return rejections

    def drop(self, name: str) -> list[_Item]:
        """Drop all that waits under a name and return it."""
        queue = self._queues.pop(name, None)
        self._find_earliest()
        return [held.item for held in queue.items] if queue else []

    def _find_earliest(self) -> None:
        self.earliest = min((queue.items[0].until for queue in self._queues.values()),
                            default=NEVER)

    def _take_placed(self, name: str, queue: _Queue, now: int,
                     rejections: list[Rejection]) -> bool:
        """Take first items, and let others count; return whether a listing may have its place."""
        while queue.items and self._take_first(name, now, now <= queue.items[0].until, rejections):
            pass
        return queue.place(lambda data, order: self._take_early(name, data, now, order))

    def _take_first(self, name: str, now: int, may_wait: bool,
                    rejections: list[Rejection]) -> bool:
        """Take the first item of a name, if it need not wait; return whether it was taken."""
        queue = self._queues[name]
        outcome = self._take(name, queue.items[0].item, now, may_wait)
        if isinstance(outcome, Wait):
            return False
        queue.pop()
        if outcome is not None:
            rejections.append(outcome)
        return True


def _size_of(item: _Item) -> int:
    """Return how many bytes of a message an item has."""
    return 0 if callable(item) else len(item[0])

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The node's event loop: takes messages in batches, shares time among topics, and ticks.

Like `rclpy.executors` it uses the wait set and the handles of subscriptions and services.
Everything but the messages of its inputs goes to the callbacks of rclpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import chain
import math
import time
from typing import Any, NamedTuple, Protocol, TypeAlias

from rclpy.event_handler import QoSLivelinessChangedInfo, QoSSubscriptionMatchedInfo
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from sat_collision.node.wait_set import WaitSet

# Max time in s for taking messages before anything else gets its turn: half for topics up to the
# last footprint and half for the others, shared evenly among those that may have some. Processing
# of a message is never interrupted.
_LONGEST_TURN = 0.01
# After a longer time, in s, the clock is read again before a batch's changes are published.
_LONG_TURN = 0.02
# With at least this many messages per rest, a rest costs less than the wake-ups it saves.
_WORTH_A_REST = 2.0
# If this many messages per rest could end it, none does: no rest would be left.
_TOO_OFTEN = 0.5
# So few messages since the last tick are not enough to estimate their rate.
_FEW = 5
# After a longer wait, in s, a message usually comes alone, and looking for another one would cost
# as much as taking it. If there is another, the next wait is short.
_LONG_WAIT = 1e-4
# Sizes of a batch. The limit in messages starts low and grows while they are quick to check; the
# limit in bytes keeps batches of long messages short, each of which may take long.
_FEWEST_TOGETHER = 4
_MAX_TOGETHER = 64
_MAX_BYTES = 8192
# The middleware's key for the sequence number of a message among those of its publisher.
_NUMBER = 'publication_sequence_number'
# And for that publisher, from Kilted on.
_PUBLISHER = 'publisher_gid'
_MATCHED = rclpy_implementation.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_MATCHED
_LIVELINESS = (
    rclpy_implementation.rcl_subscription_event_type_t.RCL_SUBSCRIPTION_LIVELINESS_CHANGED)
PublisherEvent: TypeAlias = QoSSubscriptionMatchedInfo | QoSLivelinessChangedInfo


class Backlog(NamedTuple):
    """How far behind a topic is: in seconds, and in messages (an estimate)."""

    seconds: float
    messages: int


class Receiver(Protocol):
    """The handlers of messages and ticks that the loop calls."""

    def receive(self, name: str, messages: Sequence[bytes], now: int, number: int | None,
                arrived: int) -> None:
        """
        Receive consecutive messages of one publisher on the topic of an input.

        `number` is the sequence number of the first message, None if it is unknown; `now` is the
        present time in ns, and `arrived` when the first message came.
        """

    def begin_stream(self, name: str) -> None:
        """Record that the next message of an input is the first of its publisher."""

    def change_publisher(self, name: str) -> None:
        """Record that the next message of an input is of another publisher than the last one."""

    def note_event(self, name: str, event: PublisherEvent) -> bool:
        """
        Record how many publishers are matched with an input, or live; return if one is new.

        Called before and after the messages of each batch are taken.
        """

    def receive_mixed(self, name: str, messages: Sequence[bytes], now: int,
                      arrived: int) -> None:
        """Receive messages of any publisher: one was matched while they were taken."""

    def advance(self, now: int) -> None:
        """Let time pass to the present: the messages of this turn have taken long."""

    def end_batch(self, messages: int, seconds: float) -> None:
        """Publish what a batch of messages changed, which took `seconds` to process."""

    def due(self, now: int, steady: float) -> float:
        """
        Return when the next tick is due, by the steady clock in s; messages may postpone it.

        `steady` is what that clock reads at `now`, in ns by the clock of the header stamps.
        """

    def tick(self, now: int) -> None:
        """Do what is due by time alone; `now` was read in this turn."""

    def go_on(self, now: int) -> bool:
        """Do a part of what messages come before; return whether there is more of that."""

    def present(self, steady: float) -> int:
        """
        Return the present time in ns by the clock of the header stamps.

        `steady` is what the steady clock reads, in s. Called before the messages of each turn,
        after those that took long, and before a tick.
        """


@dataclass
class Input:
    """
    A subscription, the name of its footprint or source, and whether a message ends a rest.

    A footprint's message does, so that it is handled at once. `topic` is the name before
    remapping, for the functions of rclpy that remap it themselves; `depth` is that of the queue
    unless a parameter overrides it.
    """

    name: str
    subscription: Subscription
    ends_rest: bool = False
    topic: str = ''
    depth: int = 0

    def events(self, kinds: Sequence[Any]) -> Iterator[PublisherEvent]:
        """Yield the events of some kinds, with what has changed since they were last read."""
        for handler in self.subscription.event_handlers:
            if handler.event_type in kinds:
                # Its status can be read at any time, not only when a wait set reports it.
                handler._ready_to_take_data = True
                if (event := handler.take_data()) is not None:
                    yield event


def unused(_: bytes) -> None:
    """Do nothing: the callback of a subscription whose messages the loop takes itself."""


class Loop:
    """
    Runs a node in this thread.

    Each turn waits for messages, takes those of one topic after another, each within a time
    budget, and has the changes published: those by footprints, which come first and again between
    any two batches, then those by all others. After a long wait it takes one message per topic.
    When messages are frequent it rests between turns instead of waiting, for fewer wake-ups and
    larger batches; a footprint's message ends the rest. Services and middleware events are
    checked once per tick, and after a wait that ends without a message, because each entity in
    the wait set costs time at every wake-up. Each turn ends with a part of what messages come
    before, and while there is more of that, the next one begins at once.

    Inputs are taken in the order given. `max_batch_delay` returns the max rest in s.
    """

    def __init__(self, node: Node, inputs: Sequence[Input], receiver: Receiver,
                 max_batch_delay: Callable[[], float]) -> None:
        self._node = node
        self._receiver = receiver
        self._max_batch_delay = max_batch_delay
        self._inputs = inputs
        # The topics up to the last one that ends rests, and the others.
        self._topics: tuple[list[_Topic], list[_Topic]] = [], []
        self._rest = 0.0
        self._rests_until = 0.0
        # Pointers of the subscriptions to check when a message ended a rest, and when none did.
        self._at_once: set[int] = set()
        self._gathered: set[int] = set()
        # By the name of an input of which the last turn left messages for lack of time.
        self.backlogs: dict[str, Backlog] = {}
        # Whether that turn left other things to do.
        self._has_more = False
        self._looks_at_others = True
        # The present time in ns and by the steady clock, as last read.
        self._present = 0
        self._read_at = 0.0
        self._next_tick = 0.0
        self._next_first = 0.0
        # Whether few enough messages come that end a rest.
        self._rest_may_end = True
        self._counted_since = time.monotonic()

    def run(self, ended: Callable[[], bool]) -> None:
        """Run until `ended()` is true, which is checked after each turn."""
        while not ended():
            self.backlogs.clear()
            with ExitStack() as held:
                topics = [_Topic(one, self._receiver, self.backlogs) for one in self._inputs]
                pointers = [topic.pointer for topic in topics]
                ending_rest = {topic.pointer for topic in topics if topic.ends_rest}
                every = {one.handle.pointer for one in self._node.subscriptions}
                self._gathered = every - ending_rest
                # Inputs before a footprint may have the transform that it needs.
                until = max((k for k, one in enumerate(pointers, 1) if one in ending_rest),
                            default=0)
                self._topics = topics[:until], topics[until:]
                self._at_once = every.difference(pointers[until:])
                wait_set = WaitSet(self._node, {*pointers}, ending_rest, held)
                # The entities waited for change rarely, for example with use_sim_time.
                while not ended() and not (self._looks_at_others and wait_set.is_outdated()):
                    self._turn(wait_set)

    def _turn(self, wait_set: WaitSet) -> None:
        """Rest or wait, take messages, have changes published, and do what else is due."""
        ready, was_long = self._wait(wait_set)
        begun = time.monotonic()
        late = begun - self._next_tick
        self._read_clock(begun)
        are_alone = was_long and late < 0.0
        taken = 0
        now = begun
        between = None
        for topics in self._topics:
            since, before = now, taken
            waiting = [topic for topic in topics
                       if late >= 0.0 or ready is None or topic.pointer in ready]
            for topic in waiting:
                taken += (topic.take_batch(1, self._present) if are_alone else topic.take(
                    _LONGEST_TURN / 2 / len(waiting), self._present, between))
            if taken > before:
                now = self._end_batch(taken - before, since)
            between = self._take_first
        wait_set.take_others(ready)
        wait_set.answer_calls()
        if late >= 0.0:
            self._read_clock(time.monotonic())
            self._receiver.tick(self._present)
            self._choose_rest(time.monotonic())
            self._looks_at_others = True
        had_more, self._has_more = self._has_more, self._receiver.go_on(self._present)
        if taken or late >= 0.0 or had_more:
            self._next_tick = self._receiver.due(self._present, self._read_at)
        if (self._rest and taken and not self.backlogs and not self._has_more
                and (late >= 0.0 or ready is not self._at_once)):
            self._rests_until = time.monotonic() + self._rest

    def _read_clock(self, steady: float) -> None:
        self._read_at = steady
        self._present = self._receiver.present(steady)

    def _end_batch(self, messages: int, since: float) -> float:
        """Have published what messages changed, taken since then; return when they were taken."""
        taken_at = time.monotonic()
        if taken_at - self._read_at > _LONG_TURN:
            # What was true then must not be published now.
            self._read_clock(taken_at)
            self._receiver.advance(self._present)
        self._receiver.end_batch(messages, taken_at - since)
        return taken_at

    def _take_first(self) -> int:
        """
        Take one message per footprint, and publish, between batches of other topics.

        It takes no more than half of their time: there may be many footprints. Return the present
        time, as last read.
        """
        begun = time.monotonic()
        if begun < self._next_first:
            return self._present
        if taken := sum(topic.take_batch(1, self._present) for topic in self._topics[0]):
            self._end_batch(taken, begun)
        ended = time.monotonic()
        self._next_first = ended + (ended - begun)
        return self._present

    def _wait(self, wait_set: WaitSet) -> tuple[set[int] | None, bool]:
        """Return pointers of subscriptions to check, None for all, and if the wait was long."""
        begun = time.monotonic()
        until_tick = max(self._next_tick - begun, 0.0)
        rest = min(self._rests_until - begun, until_tick)
        if rest > 0.0:
            if not self._rest_may_end:
                time.sleep(rest)
            elif wait_set.rest(rest):
                return self._at_once, False
            elif time.monotonic() - begun < rest:
                self._looks_at_others = True  # an event has ended it
            elif not self._looks_at_others:
                self._rests_until = 0.0
                return self._gathered, False
        look_at_all = self._rests_until > 0.0 or bool(self.backlogs)
        self._rests_until = 0.0
        if look_at_all and not self._looks_at_others:
            return None, False
        at_once = look_at_all or self._has_more
        ready = wait_set.wait(0.0 if at_once else until_tick, self._looks_at_others)
        waited = time.monotonic() - begun
        # An event ends every wait until it is handled.
        self._looks_at_others = not (ready or at_once or waited >= until_tick)
        return ready, not at_once and waited > _LONG_WAIT

    def _choose_rest(self, now: float) -> None:
        """Choose whether to rest between turns, by the rate of messages since the last choice."""
        delay = self._max_batch_delay()
        rests = max(now - self._counted_since, 1e-9) / delay if delay else math.inf
        taken = ending_rest = 0
        for topic in chain(*self._topics):
            taken += topic.count
            ending_rest += topic.count if topic.ends_rest else 0
            topic.count = 0
        self._rest = delay if taken > _FEW and taken >= _WORTH_A_REST * rests else 0.0
        self._rest_may_end = ending_rest < _TOO_OFTEN * rests
        self._counted_since = now


class _Topic:
    """One topic whose messages the loop takes."""

    def __init__(self, one: Input, receiver: Receiver, backlogs: dict[str, Backlog]) -> None:
        self._backlogs = backlogs
        self.pointer = one.subscription.handle.pointer
        self.ends_rest = one.ends_rest
        self.name = one.name
        self._receiver = receiver
        # Without a lease no liveliness can be lost.
        has_lease = one.subscription.qos_profile.liveliness_lease_duration.nanoseconds > 0
        self._events = partial(one.events, (_MATCHED, _LIVELINESS) if has_lease else (_MATCHED,))
        self._publisher: object = None
        self._depth = one.subscription.qos_profile.depth
        self._take: Callable[[], tuple[bytes, dict[str, Any]] | None] = partial(
            one.subscription.handle.take_message, one.subscription.msg_type, True)
        # A message already taken that does not follow the one before: it begins the next batch.
        self._next: tuple[bytes, dict[str, Any]] | None = None
        self._arrived = 0  # when the first message of the last batch came
        self._is_empty = True
        self.count = 0  # of messages since rests were chosen last
        self._limit = _FEWEST_TOGETHER

    def take(self, budget: float, now: int, between: Callable[[], int] | None = None) -> int:
        """
        Pass queued messages to the receiver, for `budget` s at most; return how many.

        `between` is called between two batches, and returns the present time.
        """
        self._backlogs.pop(self.name, None)
        end = time.monotonic() + budget
        total = 0
        while count := self.take_batch(self._limit, now):
            if not total:
                self._first = self._first_of_batch
            total += count
            is_late = time.monotonic() >= end
            if is_late:
                self._limit = _FEWEST_TOGETHER
            if self._is_empty:
                break
            if is_late:
                total += self.take_batch(1, now) if self._next else 0
                self._backlogs[self.name] = self._backlog(total)
                break
            self._limit = min(4 * self._limit, _MAX_TOGETHER)
            if between:
                now = between()
        return total

    def take_batch(self, limit: int, now: int) -> int:
        """Pass consecutive messages to the receiver, up to a limit; return how many."""
        self._has_new_publisher()
        taken, self._next = self._next or self._take(), None
        batch: list[bytes] = []
        size = 0
        while taken is not None:
            data, info = taken
            if not batch:
                self._first_of_batch = info
                first = number = info[_NUMBER]
                before, self._publisher = self._publisher, info.get(_PUBLISHER)
                if number == 1:
                    self._receiver.begin_stream(self.name)
                elif self._publisher != before:
                    self._receiver.change_publisher(self.name)
            elif info[_NUMBER] != number or info.get(_PUBLISHER) != self._publisher:
                self._next = taken
                break
            self._last = info
            batch.append(data)
            size += len(data)
            if len(batch) == limit or size >= _MAX_BYTES:
                break
            if number is not None:
                number += 1
            taken = self._take()
        self._is_empty = taken is None
        if batch:
            arrived = self._arrival(now)
            if self._has_new_publisher():
                self._receiver.receive_mixed(self.name, batch, now, arrived)
            else:
                self._receiver.receive(self.name, batch, now, first, arrived)
        self.count += len(batch)
        return len(batch)

    def _arrival(self, now: int) -> int:
        """
        Return when the first message of the batch came, by the clock of `now`.

        It has waited by the wall clock, for simulated time may have stood still meanwhile. A
        later message counts from no earlier time.
        """
        # Cyclone DDS gives 0.
        received = self._first_of_batch['received_timestamp']
        waited = max(time.time_ns() - received, 0) if received else 0
        self._arrived = min(max(now - waited, self._arrived), now)
        return self._arrived

    def _has_new_publisher(self) -> bool:
        """Return whether a publisher was matched, or lives again, since this was last called."""
        is_new = False
        for event in self._events():
            is_new |= self._receiver.note_event(self.name, event)
        return is_new

    def _backlog(self, count: int) -> Backlog:
        """Return how far behind the last message is, and how many wait, judging by their rate."""
        first, last = (info['received_timestamp'] for info in (self._first, self._last))
        behind = max(time.time_ns() - last, 0)
        waiting = 1 + round(behind * (count - 1) / max(last - first, 1))
        return Backlog(behind / 1e9, min(waiting, self._depth))

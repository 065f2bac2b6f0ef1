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

"""
The loop that runs the node: takes messages in batches, stays fair, ticks.

It stands on what `rclpy.executors` itself stands on, the wait set and the handles of
subscriptions, and leaves all that is no message of a footprint or obstacle to rclpy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
import time
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.subscription import Subscription
from sat_collision.node.receiver import Backlog, Receiver

# The longest that messages are taken for before all else has its turn, shared evenly among the
# topics, in s. A message that has been begun is finished.
_LONGEST_TURN = 0.01
# Where so many messages would come during a rest, a rest costs less than the wakes it spares.
_WORTH_A_REST = 2.0
# Fewer since the last tick say nothing of how often messages come.
_FEW = 5
# How often is looked at what is not waited for, such as that a publisher does not fit, in s.
_OTHERS_PERIOD = 0.5
# A process that comes so much too late was held up, and what was sent meanwhile may still be on
# its way to the queues, in s.
HELD_UP = 0.03


def is_supported() -> bool:
    """Tell whether this rclpy has the pieces that the loop stands on."""
    wait_set = getattr(rclpy_implementation, 'WaitSet', None)
    subscription = getattr(rclpy_implementation, 'Subscription', None)
    return all(hasattr(wait_set, name) for name in (
        'add_subscription', 'add_service', 'clear_entities', 'get_ready_entities', 'wait')
    ) and hasattr(subscription, 'take_message')


class Input(NamedTuple):
    """A subscription of a footprint or source of obstacles, and the name of that."""

    name: str
    subscription: Subscription


class Reserved(CallbackGroup):
    """Keeps executors from what the loop takes itself."""

    def can_execute(self, entity: Any) -> bool:
        """Return False for a subscription; its events are an executor's."""
        return not isinstance(entity, Subscription)

    def beginning_execution(self, entity: Any) -> bool:
        """Return False for a subscription."""
        return self.can_execute(entity)

    def ending_execution(self, entity: Any) -> None:
        """Do nothing: what is executed excludes nothing else."""


class Loop:
    """
    Runs a node in this thread.

    In each turn it waits for messages, takes those of each topic in turn, footprints first, for
    no longer than a budget, and has published once what has changed by all of them. Where
    messages are many it rests between turns: fewer wakes, larger batches. What else the node has
    is done by an executor of rclpy's, when a service is called and now and then.

    Parameters
    ----------
    node : rclpy.node.Node
    inputs : sequence of Input
        In the order in which they are taken; their callback group is a `Reserved` one.
    receiver : Receiver
    max_batch_delay : callable
        Returns the longest rest, in s.

    """

    def __init__(self, node: Node, inputs: Sequence[Input], receiver: Receiver,
                 max_batch_delay: Callable[[], float]) -> None:
        self._node = node
        self._receiver = receiver
        self._max_batch_delay = max_batch_delay
        self._topics = [_Topic(one, receiver) for one in inputs]
        self._budget = _LONGEST_TURN / len(inputs)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._rest = 0.0
        self._next_tick = 0.0
        self._was_held_up = False
        self._next_others = 0.0
        self._taken = 0
        self._counted_since = time.monotonic()

    def run(self, ended: Callable[[], bool]) -> None:
        """Run until `ended` is true, which is looked at after each turn."""
        while not ended():
            with ExitStack() as held:
                waiting = _Waiting(self._node, {topic.pointer for topic in self._topics}, held)
                # What is waited for changes seldom, such as with use_sim_time.
                while not ended() and waiting.is_current():
                    self._turn(waiting)

    def close(self) -> None:
        """End what belongs to the loop, once it runs no more."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()

    def _turn(self, waiting: _Waiting) -> None:
        """Wait, take and publish; do what else is due; rest."""
        ready = waiting.wait(0.0 if self._is_behind else self._until_tick())
        late = time.monotonic() - self._next_tick
        present = self._receiver.present()
        begun = time.perf_counter()
        taken = sum(topic.take(self._budget, present) for topic in self._topics
                    if late >= 0.0 or topic.is_behind or topic.pointer in ready)
        if taken:
            self._taken += taken
            self._receiver.end_batch(taken, time.perf_counter() - begun)
        now = time.monotonic()
        if waiting.do_others(ready) or now >= self._next_others:
            self._executor.spin_once(0.0)
            self._next_others = now + _OTHERS_PERIOD
        if late >= 0.0:
            self._was_held_up = late > HELD_UP and not self._was_held_up
            self._next_tick = now + self._receiver.tick(
                present, not (self._was_held_up or self._is_behind))
            self._choose_rest(now)
        if self._rest and taken and not self._is_behind:
            time.sleep(min(self._rest, self._until_tick()))

    @property
    def _is_behind(self) -> bool:
        """Whether messages wait that the last turn had no time for."""
        return any(topic.is_behind for topic in self._topics)

    def _until_tick(self) -> float:
        return max(self._next_tick - time.monotonic(), 0.0)

    def _choose_rest(self, now: float) -> None:
        """Rest between turns where messages came often enough since this was last chosen."""
        rate = self._taken / max(now - self._counted_since, 1e-9)
        delay = self._max_batch_delay()
        many = self._taken > _FEW and rate * delay >= _WORTH_A_REST
        self._rest = delay if many else 0.0
        self._taken = 0
        self._counted_since = now


class _Topic:
    """One topic whose messages the loop takes."""

    def __init__(self, one: Input, receiver: Receiver) -> None:
        self.is_behind = False
        self.pointer = one.subscription.handle.pointer
        self._name = one.name
        self._subscription = one.subscription
        self._receiver = receiver

    def take(self, budget: float, now: int) -> int:
        """Have what has come received, for so many s at most; return how many messages."""
        was_behind = self.is_behind
        self._first: dict[str, Any] | None = None
        count = self._receiver.receive(self._name, self._messages(time.monotonic() + budget), now)
        if self.is_behind:
            self._receiver.note_backlog(self._name, self._backlog(count))
        elif was_behind:
            self._receiver.note_backlog(self._name, None)
        return count

    def _messages(self, end: float) -> Iterator[tuple[bytes, int | None]]:
        """Take message by message until there is none or time has come to an end."""
        take_message = self._subscription.handle.take_message
        kind = self._subscription.msg_type
        self.is_behind = False
        while (taken := take_message(kind, True)) is not None:
            data, self._last = taken
            if self._first is None:
                self._first = self._last
            yield data, self._last['publication_sequence_number']
            if time.monotonic() >= end:
                self.is_behind = True
                break

    def _backlog(self, count: int) -> Backlog:
        """Return how far behind the last message is, and how many wait, going by their rate."""
        assert self._first is not None
        first, last = (info['received_timestamp'] for info in (self._first, self._last))
        behind = max(time.time_ns() - last, 0)
        waiting = 1 + round(behind * (count - 1) / max(last - first, 1))
        return Backlog(behind / 1e9, min(waiting, self._subscription.qos_profile.depth))


class _Waiting:
    """
    The subscriptions and services of a node, as they are now, to be waited for.

    Parameters
    ----------
    node : rclpy.node.Node
    taken_elsewhere : set of int
        Pointers of the subscriptions whose messages the loop takes itself.
    held : ExitStack
        Keeps what is waited for until it is closed.

    """

    def __init__(self, node: Node, taken_elsewhere: set[int], held: ExitStack) -> None:
        self._node = node
        self._entities = [*node.subscriptions, *node.services]
        held.enter_context(node.context.handle)
        for one in self._entities:
            held.enter_context(one.handle)
        self._subscriptions = [one.handle for one in node.subscriptions]
        self._services = [one.handle for one in node.services]
        self._wait_set = rclpy_implementation.WaitSet(
            len(self._subscriptions), 0, 0, 0, len(self._services), 0, node.context.handle)
        self._service_ready = False
        self._others = {one.handle.pointer: one for one in node.subscriptions
                        if one.handle.pointer not in taken_elsewhere}

    def is_current(self) -> bool:
        """Tell whether the node still has just these."""
        return self._entities == [*self._node.subscriptions, *self._node.services]

    def wait(self, seconds: float) -> set[int]:
        """Wait until something is ready; return the pointers of what is."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle in self._subscriptions:
            wait_set.add_subscription(handle)
        for handle in self._services:
            wait_set.add_service(handle)
        wait_set.wait(int(seconds * 1e9))
        self._service_ready = bool(wait_set.get_ready_entities('service'))
        return set(wait_set.get_ready_entities('subscription'))

    def do_others(self, ready: set[int]) -> bool:
        """Take what else has come, such as /clock; tell whether a service is ready."""
        for pointer in ready & self._others.keys():
            other = self._others[pointer]
            taken = other.handle.take_message(other.msg_type, other.raw)
            if taken is not None:
                other.callback(taken[0])
        return self._service_ready

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

"""What a node is waited for with: rclpy's wait set, as `rclpy.executors` itself uses it."""

from __future__ import annotations

from contextlib import ExitStack

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node


def is_supported() -> bool:
    """Tell whether this rclpy has the pieces that the loop stands on."""
    wait_set = getattr(rclpy_implementation, 'WaitSet', None)
    subscription = getattr(rclpy_implementation, 'Subscription', None)
    return all(hasattr(wait_set, name) for name in (
        'add_subscription', 'add_service', 'clear_entities', 'get_ready_entities', 'wait')
    ) and hasattr(subscription, 'take_message')


class Waiting:
    """
    The subscriptions and services of a node, as they are now, to be waited for.

    Attributes
    ----------
    is_service_called : bool
        Whether a service was found called by the last wait for services.

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
        self.is_service_called = False
        self._others = {one.handle.pointer: one for one in node.subscriptions
                        if one.handle.pointer not in taken_elsewhere}

    def is_outdated(self) -> bool:
        """Tell whether the node has other ones by now."""
        return self._entities != [*self._node.subscriptions, *self._node.services]

    def wait(self, seconds: float, for_services: bool) -> set[int]:
        """Wait until something is ready; return the pointers of the subscriptions that are."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle in self._subscriptions:
            wait_set.add_subscription(handle)
        for handle in self._services if for_services else ():
            wait_set.add_service(handle)
        wait_set.wait(int(seconds * 1e9))
        self.is_service_called = bool(for_services and wait_set.get_ready_entities('service'))
        return set(wait_set.get_ready_entities('subscription'))

    def take_others(self, ready: set[int] | None) -> None:
        """Take what else has come, such as /clock, of what is ready, None for of all."""
        for pointer, other in self._others.items():
            if ready is None or pointer in ready:
                taken = other.handle.take_message(other.msg_type, other.raw)
                if taken is not None:
                    other.callback(taken[0])

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Waits for the messages and events of a node with a wait set, as `rclpy.executors` does."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.service import Service


class WaitSet:
    """
    A wait set of the subscriptions, services and events that a node has now.

    Subscriptions are given by their pointers: `taken_elsewhere` if the loop takes their messages
    itself, `ending_rest` if these also end a rest. Entities are kept until `held` is closed.
    """

    def __init__(self, node: Node, taken_elsewhere: set[int], ending_rest: set[int],
                 held: ExitStack) -> None:
        self._node = node
        self._entities = self._entities_now()
        self._events = [one for one in node.waitables if isinstance(one, EventHandler)]
        held.enter_context(node.context.handle)
        for one in self._entities:
            held.enter_context(one.handle)
        for event in self._events:
            held.enter_context(event)
        self._subscriptions = [one.handle for one in node.subscriptions]
        self._ending_rest = [one for one in self._subscriptions if one.pointer in ending_rest]
        self._services: list[Service] = [*node.services]
        self._wait_set = rclpy_implementation.WaitSet(
            len(self._subscriptions), 0, 0, 0, len(self._services), len(self._events),
            node.context.handle)
        # Those that had a request when services were last checked.
        self._called: list[Service] = []
        self._others = {one.handle.pointer: one for one in node.subscriptions
                        if one.handle.pointer not in taken_elsewhere}

    def _entities_now(self) -> list[Any]:
        return [*self._node.subscriptions, *self._node.services]

    def is_outdated(self) -> bool:
        """Return whether the node has other subscriptions or services by now."""
        return self._entities != self._entities_now()

    def wait(self, seconds: float, for_others: bool) -> set[int]:
        """
        Wait until something is ready, for a limited time; return pointers of ready subscriptions.

        With `for_others` it also waits for services and events, and handles the events.
        """
        wait_set = self._wait_set
        wait_set.clear_entities()
        for handle in self._subscriptions:
            wait_set.add_subscription(handle)
        if for_others:
            for service in self._services:
                wait_set.add_service(service.handle)
            for event in self._events:
                event.add_to_wait_set(wait_set)
        wait_set.wait(int(seconds * 1e9))
        ready = set(wait_set.get_ready_entities('subscription'))
        if for_others:
            called = wait_set.get_ready_entities('service')
            self._called = [one for one in self._services if one.handle.pointer in called]
            for event in [one for one in self._events if one.is_ready(wait_set)]:
                if (info := event.take_data()) is not None:
                    event.callback(info)
        return ready

    def rest(self, seconds: float) -> bool:
        """Wait for a message that ends a rest; return whether there is one."""
        self._wait_set.clear_entities()
        for handle in self._ending_rest:
            self._wait_set.add_subscription(handle)
        self._wait_set.wait(int(seconds * 1e9))
        return bool(self._wait_set.get_ready_entities('subscription'))

    def answer_calls(self) -> None:
        """Answer a request of each service that had one when services were last checked."""
        called, self._called = self._called, []
        for service in called:
            kind = service.srv_type
            request, header = service.handle.service_take_request(kind.Request)
            if header is not None:
                response = kind.Response()
                try:
                    response = service.callback(request, response)
                except ValueError as error:  # a parameter of a type that is none
                    self._node.get_logger().warning(
                        f'a request of {service.srv_name} was refused: {error}')
                service.send_response(response, header)

    def take_others(self, ready: set[int] | None) -> None:
        """Take a message of each other ready subscription, such as /clock; None for all."""
        for pointer, other in self._others.items():
            if ready is None or pointer in ready:
                taken = other.handle.take_message(other.msg_type, other.raw)
                try:
                    if taken is not None:
                        other.callback(taken[0])
                except ValueError as error:  # a time before 1970, for which rclpy has none
                    self._node.get_logger().warning(
                        f'a message on {other.topic_name} was refused: {error}',
                        throttle_duration_sec=1.0)

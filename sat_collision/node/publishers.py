# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The publishers of a topic subscribed to, and whether they can be received."""

from __future__ import annotations

from rclpy.event_handler import QoSSubscriptionMatchedInfo
from rclpy.node import Node
from rclpy.qos import (
    qos_check_compatible, QoSCompatibility, QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy)
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sat_collision.messages.interfaces import type_name
from sat_collision.node.loop import Input
from sat_collision.scene.settings import TF
from sat_collision.scene.streams import Endpoint

_UNKNOWN = '_NODE_NAME_UNKNOWN_'
_PASSED = 'one that has gone'
# At least every so many looks publishers are queried, even if no change was reported.
_LOOKS = 10
# Max publishers of an input that are remembered once they have gone.
_MAX_MET = 1000


class Publishers:
    """Tracks the publishers of an input."""

    def __init__(self, node: Node, one: Input) -> None:
        self._node = node
        self._input = one
        self._looks = 0
        # Whether publishers may have changed, and those that were reported last.
        self.changed = True
        self.reported: list[Endpoint] | None = None
        # By the last look: how many there are; those that live; and the gids of all, in the order
        # first seen, of those that can be received, and of those that have lost their liveliness,
        # which the middleware still lists. It counts these, see `note_liveliness`.
        self._count: int | None = None
        self._seen: list[Endpoint] = []
        self._order: list[str] = []
        self._receivable: set[str] = set()
        self._dead: set[str] = set()
        self._count_dead: int | None = None
        # Since the subscription was made: how many are matched with it, how many were matched but
        # not seen, and the gids of those seen.
        self._matched: int | None = None
        self._unseen = 0
        self._met: set[str] = set()

    def note_matched(self, event: QoSSubscriptionMatchedInfo) -> None:
        """Record how many publishers are matched with the subscription."""
        self.changed = True
        self._matched = event.current_count
        self._unseen += event.total_count_change

    def note_liveliness(self, count: int, change: int) -> None:
        """
        Record how many publishers have lost their liveliness, if that has changed.

        Without a change the count may be wrong: after a subscription was made anew, Fast DDS
        still counts a publisher that has gone.
        """
        self.changed = True
        if change:
            self._count_dead = max(count, 0)  # Fast DDS may count to -1

    def forget_matched(self) -> None:
        """Reset the matched publishers: the input has a new subscription."""
        self.changed = True
        self._matched, self._unseen, self._met = None, 0, set()

    def lists_dead(self) -> bool:
        """Return whether publishers are listed that have lost their liveliness."""
        return not self._dead.isdisjoint(self._order)

    def news(self, is_behind: bool) -> list[Endpoint] | None:
        """
        Return the publishers if they have changed since the last call.

        That a publisher has gone is reported once all its messages are taken: not before the next
        call, and not while the input is behind, with messages still queued.
        """
        self._looks += 1
        return self._news(is_behind)

    def at_beginning(self) -> list[Endpoint] | None:
        """Return the publishers if they have changed, as the stream begins."""
        self.changed = True
        return self._news(True)

    def _news(self, is_behind: bool) -> list[Endpoint] | None:
        reported = self.reported
        before = seen = self._seen
        # By the handle, because the node would resolve the name of the topic each time.
        count = self._node.handle.get_count_publishers(self._input.subscription.topic_name)
        if self.changed or count != self._count or self._looks % _LOOKS == 0:
            self._count = count
            seen = self._seen = self._look()
            self.changed = any(not endpoint.node for endpoint in seen)
        if self._have_passed():
            # One came and went between two looks: report a placeholder for it.
            seen = [*(reported or ()), Endpoint(f'look {self._looks}', _PASSED)]
        elif is_behind:
            # A new publisher counts at once; those that have gone are kept for now.
            gids = {endpoint.gid for endpoint in seen}
            seen = [*(gone for gone in reported or () if gone.gid not in gids), *seen]
        elif {endpoint.gid for endpoint in before} - {endpoint.gid for endpoint in seen}:
            return None
        if seen == reported:
            return None
        self.reported = seen
        return seen

    def _have_passed(self) -> bool:
        """Return whether publishers were matched and have gone again without being seen."""
        if len(self._receivable) != self._matched:
            return False
        self._unseen -= len(self._receivable - self._met)
        self._met |= self._receivable
        if len(self._met) > _MAX_MET:
            self._met = {*self._receivable}
        if self._unseen <= 0:
            return False
        self._unseen = 0
        return True

    def _look(self) -> list[Endpoint]:
        """Return the live publishers, in a stable order."""
        infos = self._node.get_publishers_info_by_topic(self._input.topic)
        endpoints = [_endpoint(info, self._input) for info in infos]
        known = {gid: place for place, gid in enumerate(self._order)}
        endpoints.sort(key=lambda endpoint: known.get(endpoint.gid, len(known)))
        self._order = [endpoint.gid for endpoint in endpoints]
        receivable = [endpoint.gid for endpoint in endpoints if not endpoint.problem]
        self._receivable = {*receivable}
        if self._count_dead is not None:
            # The middleware does not report which ones have died: assume the oldest.
            self._dead, self._count_dead = {*receivable[:self._count_dead]}, None
        return [endpoint for endpoint in endpoints if endpoint.problem] + [
            endpoint for endpoint in endpoints
            if not endpoint.problem and endpoint.gid not in self._dead]


def faults_of(node: Node, one: Input) -> list[str]:
    """Return why publishers of a topic that may have several cannot be received, in sentences."""
    topic = one.subscription.topic_name
    endpoints = (_endpoint(info, one) for info in node.get_publishers_info_by_topic(one.topic))
    return [f'{topic} has a publisher, {endpoint.node}, {endpoint.problem}'
            for endpoint in endpoints if endpoint.problem]


def _endpoint(info: TopicEndpointInfo, one: Input) -> Endpoint:
    topic, qos = one.subscription.topic_name, one.subscription.qos_profile
    name = '' if info.node_name == _UNKNOWN else (
        f'{info.node_namespace.rstrip("/")}/{info.node_name}')
    problem = hint = loss = ''
    expected = type_name(one.subscription.msg_type)
    if info.topic_type != expected:
        problem = f'of another type, {info.topic_type}, where {expected} is expected'
    elif wrong := _incompatible(info.qos_profile, qos, topic):
        problem = f'which cannot be received: {wrong}'
    elif (info.qos_profile.durability is QoSDurabilityPolicy.TRANSIENT_LOCAL
          and qos.durability is not QoSDurabilityPolicy.TRANSIENT_LOCAL):
        hint = ('its publisher keeps what it has sent, of which nothing comes here: set '
                f'qos_overrides.{topic}.subscription.durability: transient_local')
    if info.qos_profile.reliability is QoSReliabilityPolicy.BEST_EFFORT:
        loss = ('its publisher is best effort, which loses messages: make it reliable, or '
                'send each set as one message')
    elif qos.depth < one.depth:
        loss = (f'the queue here holds {qos.depth} messages: set qos_overrides.{topic}'
                '.subscription.depth to one more than max_count')
    return Endpoint(bytes(info.endpoint_gid).hex(), name, problem, hint, loss)


def publishers_of_tf(node: Node) -> set[str]:
    """Return the full names of the nodes that publish /tf."""
    return {f'{one.node_namespace.rstrip("/")}/{one.node_name}'
            for one in node.get_publishers_info_by_topic(TF)}


def _incompatible(offered: QoSProfile, requested: QoSProfile, topic: str) -> str:
    """Return why QoS profiles are incompatible and what to do, empty if they are compatible."""
    compatibility, reason = qos_check_compatible(offered, requested)
    if compatibility != QoSCompatibility.ERROR:  # values of pybind11 enums are no singletons
        return ''
    override = f'set qos_overrides.{topic}.subscription'
    if (offered.reliability is QoSReliabilityPolicy.BEST_EFFORT
            and requested.reliability is QoSReliabilityPolicy.RELIABLE):
        return (f'it is best effort, the subscription reliable; make it reliable, or {override}'
                '.reliability: best_effort')
    if (offered.durability is QoSDurabilityPolicy.VOLATILE
            and requested.durability is QoSDurabilityPolicy.TRANSIENT_LOCAL):
        return (f'it is volatile, the subscription transient local; make it transient local, or '
                f'{override}.durability: volatile')
    reason = reason.removeprefix('ERROR: ').strip(' ;')
    return f'{reason}; change what it offers, or {override}.*'

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The publishers of the topics subscribed to, and whether they can be received."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

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
    """Tracks the publishers of each input."""

    def __init__(self, node: Node, inputs: Sequence[Input]) -> None:
        self._node = node
        self._inputs = inputs
        self._looks = 0
        # By name of an input: the gids of publishers that have lost their liveliness, which the
        # middleware still lists; how many it counts, if that is new; whether publishers may have
        # changed; and those that `news` reported last.
        self._dead: dict[str, set[str]] = {one.name: set() for one in inputs}
        self._count_dead: dict[str, int] = {}
        self.changed = {one.name for one in inputs}
        self.reported: dict[str, list[Endpoint]] = {}
        # By name of an input: how many publishers are matched with it; how many were matched since
        # its subscription was made but not seen; and the gids of those seen since then.
        self._matched: dict[str, int] = {}
        self._unseen: Counter[str] = Counter()
        self._receivable: dict[str, set[str]] = {}
        self._met: dict[str, set[str]] = {one.name: set() for one in inputs}
        self._counts: dict[str, int] = {}
        self._seen: dict[str, list[Endpoint]] = {}
        # By name: the gids of all publishers, those that died included, in the order first seen.
        self._order: dict[str, list[str]] = {}

    def note_matched(self, name: str, event: QoSSubscriptionMatchedInfo) -> None:
        """Record how many publishers are matched with the subscription of an input."""
        self.changed.add(name)
        self._matched[name] = event.current_count
        self._unseen[name] += event.total_count_change

    def note_liveliness(self, name: str, count: int, change: int) -> None:
        """
        Record how many publishers of an input have lost their liveliness, if that has changed.

        Without a change the count may be wrong: after a subscription was made anew, Fast DDS
        still counts a publisher that has gone.
        """
        self.changed.add(name)
        if change:
            self._count_dead[name] = max(count, 0)  # Fast DDS may count to -1

    def forget_matched(self, name: str) -> None:
        """Reset the matched publishers of an input, which has a new subscription."""
        self.changed.add(name)
        self._matched.pop(name, None)
        self._unseen[name] = 0
        self._met[name] = set()

    def lists_dead(self, name: str) -> bool:
        """Return whether publishers of an input are listed that have lost their liveliness."""
        return not self._dead[name].isdisjoint(self._order.get(name, ()))

    def news(self, behind: Iterable[str]) -> Iterator[tuple[str, list[Endpoint]]]:
        """
        Yield the inputs whose publishers have changed since the last call, with the publishers.

        That a publisher has gone is reported once all its messages are taken: not before the next
        call, and not while the input is `behind`, with messages still queued.
        """
        self._looks += 1
        for one in self._inputs:
            publishers = self._news_of(one, one.name in behind)
            if publishers is not None:
                yield one.name, publishers

    def at_beginning(self, name: str) -> list[Endpoint] | None:
        """Return the publishers of an input whose stream begins, None if there is no news."""
        for one in self._inputs:
            if one.name == name:
                self.changed.add(name)
                return self._news_of(one, True)
        return None

    def _news_of(self, one: Input, is_behind: bool) -> list[Endpoint] | None:
        """Return the publishers to report for an input, None if there is no news."""
        name = one.name
        reported = self.reported.get(name)
        before = seen = self._seen.get(name, [])
        # By the handle, because the node would resolve the name of the topic each time.
        count = self._node.handle.get_count_publishers(one.subscription.topic_name)
        if name in self.changed or count != self._counts.get(name) or self._looks % _LOOKS == 0:
            self._counts[name] = count
            self.changed.discard(name)
            seen = self._seen[name] = self._look(one)
            if any(not endpoint.node for endpoint in seen):
                self.changed.add(name)
        elif seen == reported:
            return None
        if self._have_passed(name):
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
        self.reported[name] = seen
        return seen

    def _have_passed(self, name: str) -> bool:
        """Return whether publishers were matched and have gone again without being seen."""
        if len(self._receivable[name]) != self._matched.get(name):
            return False
        met = self._met[name]
        self._unseen[name] -= len(self._receivable[name] - met)
        met |= self._receivable[name]
        if len(met) > _MAX_MET:
            met &= self._receivable[name]
        have_passed = self._unseen[name] > 0
        if have_passed:
            self._unseen[name] = 0
            self.changed.add(name)
        return have_passed

    def _look(self, one: Input) -> list[Endpoint]:
        """Return the live publishers, in a stable order."""
        infos = self._node.get_publishers_info_by_topic(one.topic)
        known = self._order.get(one.name, [])
        endpoints = [_endpoint(info, one) for info in infos]
        endpoints.sort(key=lambda endpoint: (
            known.index(endpoint.gid) if endpoint.gid in known else len(known)))
        self._order[one.name] = [endpoint.gid for endpoint in endpoints]
        receivable = [endpoint.gid for endpoint in endpoints if not endpoint.problem]
        self._receivable[one.name] = {*receivable}
        if (count := self._count_dead.pop(one.name, None)) is not None:
            # The middleware does not report which ones have died: assume the oldest.
            self._dead[one.name] = {*receivable[:count]}
        return [endpoint for endpoint in endpoints if endpoint.problem] + [
            endpoint for endpoint in endpoints
            if not endpoint.problem and endpoint.gid not in self._dead[one.name]]


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

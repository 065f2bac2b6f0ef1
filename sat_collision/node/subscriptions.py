# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The subscriptions of footprints, obstacles, transforms and commands, and their QoS events."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, TypeAlias

from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped, Twist, TwistStamped
from rclpy.event_handler import (
    EventHandler, QoSRequestedDeadlineMissedInfo, QoSRequestedIncompatibleQoSInfo,
    SubscriptionEventCallbacks, UnsupportedEventTypeError)
from rclpy.node import Node
from rclpy.qos import (
    qos_policy_name_from_kind, QoSDurabilityPolicy, QoSPolicyKind, QoSProfile,
    QoSReliabilityPolicy)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.utilities import get_rmw_implementation_identifier
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.node.health import Health
from sat_collision.node.loop import Input, PublisherEvent, unused
from sat_collision.node.publishers import Publishers
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import (
    CommandSettings, FootprintSettings, ObstacleSettings, PathSettings, POLYGON, POLYGON_2D,
    POLYGON_COLLECTION, POLYGON_INSTANCE, Settings, TF)

# QoS of transforms, as in tf2.
_TRANSFORM_DEPTH = 100
_DURABILITIES = {TF: QoSDurabilityPolicy.VOLATILE, TF_STATIC: QoSDurabilityPolicy.TRANSIENT_LOCAL}
_FOOTPRINT_DEPTH = 1
_SETS_IN_QUEUE = 2
_COLLECTION_DEPTH = 10
# Every pose is used.
_ODOMETRY_DEPTH = 100
# QoS policies that parameters can override.
_OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
                QoSPolicyKind.DURABILITY, QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS,
                QoSPolicyKind.LIVELINESS_LEASE_DURATION)
_POLYGON_TYPES: dict[str, type] = {
    POLYGON: PolygonStamped, POLYGON_INSTANCE: PolygonInstanceStamped}
_COMMAND_TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
# Only the last command counts, and nothing depends on having received all of them.
_COMMAND_QOS = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)
# Only the last path counts.
_PATH_QOS = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_AVAILABLE,
                       durability=QoSDurabilityPolicy.BEST_AVAILABLE)
_NO_PUBLISHER = 'has no publisher'
_Late: TypeAlias = CommandSettings | PathSettings


class _SupportedEvents(SubscriptionEventCallbacks):  # type: ignore[misc]
    """Handles the events that the middleware has; names of others are added to `unsupported`."""

    def __init__(self, unsupported: set[str], incompatible_qos: Callable[..., None],
                 **callbacks: Callable[..., object]) -> None:
        super().__init__(incompatible_qos=incompatible_qos)
        self._unsupported = unsupported
        self._callbacks = callbacks

    def create_event_handlers(self, *where: Any) -> list[EventHandler]:
        handlers: list[EventHandler] = super().create_event_handlers(*where)
        for name, callback in self._callbacks.items():
            one = SubscriptionEventCallbacks(use_default_callbacks=False, **{name: callback})
            try:
                handlers += one.create_event_handlers(*where)
            except UnsupportedEventTypeError:
                self._unsupported.add(name)
        return handlers


class Subscriptions:
    """
    Subscribes to the serialised messages of footprints, or of their odometry, and obstacles.

    Raises
    ------
    ParameterError
        If a topic cannot be subscribed to.

    """

    def __init__(self, node: Node, settings: Settings, health: Health,
                 note_event: Callable[[str, PublisherEvent], object]) -> None:
        self._node = node
        self._health = health
        self._note_event = note_event
        self._unsupported: set[str] = set()
        self.inputs: list[Input] = []
        # These take the QoS.
        self._create: dict[str, Callable[..., Subscription]] = {}
        self.configure(settings)
        for footprint in settings.footprints:
            if footprint.odometry:
                from nav_msgs.msg import Odometry
                self._subscribe(footprint, Odometry, _ODOMETRY_DEPTH, 'odometry')
            elif not footprint.has_outline:
                self._subscribe(footprint, _kind(footprint),
                                self._depths.get(footprint.topic, _FOOTPRINT_DEPTH))
        for source in settings.obstacles:
            self._subscribe(source, _kind(source), self._depths[source.topic])
        self.publishers = {one.name: Publishers(node, one) for one in self.inputs}
        if self._unsupported:
            events = ', '.join(sorted(self._unsupported))
            health.facts['events that the middleware lacks'] = events
            node.get_logger().warning(
                f'{get_rmw_implementation_identifier()} has no events of these kinds: {events}; '
                'what they would tell of publishers is noticed later, or not at all')

    def configure(self, settings: Settings) -> None:
        """Find how deep the queues must be."""
        # By topic: an override by parameters, and its default, are those of all its subscriptions.
        self._depths: dict[str, int] = {}
        for source in settings.obstacles:
            depth = (_COLLECTION_DEPTH if source.type == POLYGON_COLLECTION
                     else _SETS_IN_QUEUE * source.max_count)
            self._depths[source.topic] = max(depth, self._depths.get(source.topic, 0))

    def renew(self, one: Input, wants_history: bool) -> bool:
        """
        Subscribe again, to receive all that the publisher keeps for late subscribers.

        That is done if the history is wanted and the subscription is transient local, or if its
        queue must be deeper by now and no parameter overrides that; but not while a publisher that
        has lost its liveliness is listed: what it keeps would come, too. Return whether it was.
        """
        qos = one.subscription.qos_profile
        is_latched = qos.durability is QoSDurabilityPolicy.TRANSIENT_LOCAL
        publishers = self.publishers[one.name]
        if is_latched and publishers.lists_dead():
            return False
        depth = max(one.depth, self._depths.get(one.subscription.topic_name, 0))
        is_deeper = depth > one.depth == qos.depth
        one.depth = depth
        if not (is_deeper or is_latched and wants_history):
            return False
        if is_deeper:
            qos.depth = depth
        self._node.destroy_subscription(one.subscription)
        one.subscription = self._create[one.name](qos)
        publishers.forget_matched()
        return True

    def _subscribe(self, source: FootprintSettings | ObstacleSettings, kind: type, depth: int,
                   parameter: str = 'topic') -> None:
        events = _SupportedEvents(
            self._unsupported,
            incompatible_qos=partial(self._report_incompatible_qos, source.topic),
            deadline=partial(self._count_missed_deadlines, source.topic),
            matched=partial(self._note_event, source.name),
            liveliness=partial(self._note_event, source.name))
        # The settings have the remapped name, which must not be remapped again.
        topic = self._node.get_parameter(f'{source.name}.{parameter}').value
        self._create[source.name] = create = partial(
            self._node.create_subscription, kind, topic, unused, raw=True, event_callbacks=events)
        try:
            subscription = create(QoSProfile(depth=depth),
                                  qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE))
            self.inputs.append(Input(source.name, subscription,
                                     isinstance(source, FootprintSettings), topic, depth))
        except RuntimeError as error:
            raise ParameterError(
                f'{source.topic}: {error}: give {source.name} a topic that this node has in no '
                'other type, and QoS overrides that the middleware accepts') from error
        self._node.get_logger().info(f'{source.name}: {kind.__name__} on {source.topic}')

    def _report_incompatible_qos(self, topic: str, event: QoSRequestedIncompatibleQoSInfo) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._node.get_logger().error(
            f'{topic}: a publisher offers a {policy} that this node cannot accept, so nothing '
            f'from it arrives; set qos_overrides.{topic}.subscription.{policy.lower()} to what '
            'it offers, or change the publisher')

    def _count_missed_deadlines(self, topic: str, event: QoSRequestedDeadlineMissedInfo) -> None:
        self._health.count_event(topic, 'deadlines missed', event.total_count_change)


def _kind(settings: FootprintSettings | ObstacleSettings) -> type:
    """Return the class of the messages of an input; ParameterError if it is not installed."""
    if kind := _POLYGON_TYPES.get(settings.type):
        return kind
    try:
        from polygon_msgs import msg
    except ImportError as error:
        raise ParameterError(
            f'{settings.name}.type: {settings.type} needs polygon_msgs: apt install '
            'ros-jazzy-polygon-msgs, or build it from source beside this package') from error
    types: dict[str, type] = {POLYGON_2D: msg.Polygon2DStamped,
                              POLYGON_COLLECTION: msg.Polygon2DCollection}
    return types[settings.type]


def transform_type(node: Node, settings: Settings) -> type | None:
    """Return the class TFMessage; None if tf2_msgs is not installed or no fixed frame is set."""
    if not settings.frame_id:
        return None
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        lost = ', '.join(one.name for one in settings.footprints
                         if one.has_outline and not one.odometry)
        node.get_logger().warning(
            f'tf2_msgs is not installed (apt install ros-jazzy-tf2-msgs; pip has none): bodies '
            f'are taken only in {settings.frame_id} and in frames that odometry connects with it'
            + (f', and it is not known where {lost} is: give <name>.odometry' if lost else ''))
        return None
    return TFMessage  # type: ignore[no-any-return]


def subscribe_transforms(node: Node, kind: type) -> list[Input]:
    """Subscribe to serialised /tf and /tf_static; `kind` is the class TFMessage."""
    return [Input(topic, node.create_subscription(
        kind, topic, unused, QoSProfile(depth=_TRANSFORM_DEPTH, durability=durability),
        raw=True, qos_overriding_options=QoSOverridingOptions(_OVERRIDABLE)), topic=topic)
        for topic, durability in _DURABILITIES.items()]


class LateSubscriptions:
    """
    Subscribes to commands and paths once they have publishers, with a type that is published.

    Where others have come in place of all of these, or one that offers less, it subscribes anew.
    One in the loop's wait set exists until the loop renews the set, so one of another type on its
    topic can be made only at the next look at the publishers. `inputs` is kept up to date.
    """

    def __init__(self, node: Node, settings: Settings, inputs: list[Input]) -> None:
        self._node = node
        self._inputs = inputs
        self._wanted: list[tuple[_Late, dict[str, type], QoSProfile]] = []
        for one in settings.footprints:
            if command := one.command:
                self._wanted.append((command, _COMMAND_TYPES, _COMMAND_QOS))
            if path := one.path_settings:
                from nav_msgs.msg import Path
                self._wanted.append((path, {'nav_msgs/msg/Path': Path}, _PATH_QOS))
        # By name: each subscription, and the publishers that there were when it was made.
        self._subscribed: dict[str, tuple[Input, set[tuple[int, ...]]]] = {}
        # By name: why nothing can come, as a sentence; empty if something can.
        self.faults: dict[str, str] = {}

    def follow(self) -> Iterator[tuple[str, str]]:
        """Subscribe where that is due; yield each name, and why nothing can come, if so."""
        for settings, kinds, qos in self._wanted:
            name, fault = settings.name, self._follow(settings, kinds, qos)
            if fault not in ('', self.faults.get(name)) and _NO_PUBLISHER not in fault:
                self._node.get_logger().error(f'{name}: {fault}')
            self.faults[name] = fault
            yield name, fault

    def _follow(self, settings: _Late, kinds: dict[str, type], qos: QoSProfile) -> str:
        name = settings.name
        # The settings have the remapped name, which must not be remapped again.
        topic = self._node.get_parameter(name).value
        found = {tuple(one.endpoint_gid): one.topic_type
                 for one in self._node.get_publishers_info_by_topic(topic)}
        heard = {gid: kinds[kind] for gid, kind in found.items() if kind in kinds}
        if not heard:
            return (f'{settings.topic} is published as {", ".join(sorted({*found.values()}))}, '
                    f'but has to be {" or ".join(kinds)}' if found else
                    f'{settings.topic} {_NO_PUBLISHER}: publish there, or correct {name}')
        one, before = self._subscribed.get(name, (None, set()))
        if one and one.subscription.msg_type not in heard.values():
            self._unsubscribe(name)
        # Where one is not heard, what all offer is less than what those of before did.
        elif not one or before.isdisjoint(heard) or (
                not before >= heard.keys()
                and one.subscription.get_publisher_count() < len(heard)):
            kind = (one.subscription.msg_type if one
                    else kinds[min(kinds.keys() & found.values())])
            try:
                new = Input(name, self._node.create_subscription(
                    kind, topic, unused, qos, raw=True))
            except RuntimeError as error:  # as this process has one of another type
                return f'{settings.topic} cannot be subscribed to: {error}'
            self._unsubscribe(name)
            self._subscribed[name] = new, {*heard}
            self._inputs.append(new)
            self._node.get_logger().info(f'{name}: {kind.__name__} on {settings.topic}')
        return ''

    def _unsubscribe(self, name: str) -> None:
        if name in self._subscribed:
            one, _ = self._subscribed.pop(name)
            self._inputs.remove(one)
            self._node.destroy_subscription(one.subscription)

    def are_without_stamps(self, name: str) -> bool:
        """Return whether messages of an input are of type Twist, without a header."""
        return name in self._subscribed and (
            self._subscribed[name][0].subscription.msg_type is Twist)

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

"""The subscriptions of commands, which have the type in which they are published."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from sat_collision.messages.transform_listener import stamped
from sat_collision.node.loop import Input, leave
from sat_collision.scene.settings import CommandSettings, Settings

_TYPES = {'geometry_msgs/msg/Twist': Twist, 'geometry_msgs/msg/TwistStamped': TwistStamped}
# The last one counts, and nothing is proved by all of them.
_QOS = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)


class CommandSubscriptions:
    """
    Subscribes to commands once it is known in which type they are published.

    A participant cannot have two subscriptions of one topic and different types, and one that the
    loop waits for is not gone before it looks for new ones. So where another type is published
    from now on, the subscription is ended, and the next one is made when `follow` is called again.
    The inputs get the subscriptions that there are.
    """

    def __init__(self, node: Node, settings: Settings, group: CallbackGroup,
                 inputs: list[Input]) -> None:
        self._node = node
        self._group = group
        self._inputs = inputs
        self._commands = [one.command for one in settings.footprints if one.command]
        self._subscribed: dict[str, Input] = {}
        self._reported: dict[str, set[str]] = {}

    def with_stamps(self, name: str, messages: Sequence[bytes]) -> Sequence[bytes]:
        """Return messages of an input as they are, but commands of type Twist with a header."""
        one = self._subscribed.get(name)
        if one and one.subscription.msg_type is Twist:
            return [stamped(data) for data in messages]
        return messages

    def follow(self) -> None:
        """Subscribe to what is published, where nothing of the type subscribed to is."""
        for command in self._commands:
            one = self._subscribed.get(command.name)
            if not (one and one.subscription.get_publisher_count()):
                self._follow(command, one)

    def _follow(self, command: CommandSettings, one: Input | None) -> None:
        # The settings have the remapped name, which must not be remapped again.
        topic = self._node.get_parameter(command.name).value
        published = {info.topic_type for info in self._node.get_publishers_info_by_topic(topic)}
        types = published & _TYPES.keys()
        if published and not types and published != self._reported.get(command.name):
            self._node.get_logger().error(
                f'{command.name}: {command.topic} is published as {", ".join(sorted(published))}, '
                f'but a command has to be {" or ".join(_TYPES)}')
        self._reported[command.name] = published
        if one and types and not any(_TYPES[name] is one.subscription.msg_type for name in types):
            del self._subscribed[command.name]
            self._inputs.remove(one)
            self._node.destroy_subscription(one.subscription)
        elif types and not one:
            kind = _TYPES[min(types)]
            try:
                subscription = self._node.create_subscription(
                    kind, topic, leave, _QOS, raw=True, callback_group=self._group)
            except RuntimeError as error:  # another one of this process has another type
                self._node.get_logger().error(f'{command.name}: {command.topic}: {error}',
                                              throttle_duration_sec=1.0)
                return
            one = self._subscribed[command.name] = Input(command.name, subscription)
            self._inputs.append(one)
            self._node.get_logger().info(f'{command.name}: {kind.__name__} on {command.topic}')

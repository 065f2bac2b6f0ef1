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

"""The subscriptions of /tf and /tf_static."""

from __future__ import annotations

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.node.loop import Input, leave
from sat_collision.scene.settings import Settings, TF

# As tf2 has them.
_DEPTH = 100
_DURABILITIES = {TF: QoSDurabilityPolicy.VOLATILE, TF_STATIC: QoSDurabilityPolicy.TRANSIENT_LOCAL}


def transform_type(node: Node, settings: Settings) -> type | None:
    """Return the class TFMessage; None where tf2_msgs is not installed, or no frame is fixed."""
    if not settings.frame_id:
        return None
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        lost = ', '.join(one.name for one in settings.footprints
                         if one.has_outline and not one.odometry)
        node.get_logger().warning(
            f'tf2_msgs is not installed (apt install ros-jazzy-tf2-msgs; pip has none): bodies '
            f'are taken in {settings.frame_id} only'
            + (f', and it is not known where {lost} is: give <name>.odometry' if lost else ''))
        return None
    return TFMessage  # type: ignore[no-any-return]


def publishers_of_tf(node: Node) -> set[str]:
    """Return the full names of the nodes that publish /tf."""
    return {f'{one.node_namespace.rstrip("/")}/{one.node_name}'
            for one in node.get_publishers_info_by_topic(TF)}


def subscribe(node: Node, kind: type, group: CallbackGroup) -> list[Input]:
    """
    Subscribe to the bytes of /tf and /tf_static.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        The class TFMessage.
    group : rclpy.callback_groups.CallbackGroup

    Returns
    -------
    list of Input

    """
    return [Input(topic, node.create_subscription(
        kind, topic, leave, QoSProfile(depth=_DEPTH, durability=durability),
        raw=True, callback_group=group)) for topic, durability in _DURABILITIES.items()]

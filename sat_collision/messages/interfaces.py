# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The message classes and their serialisation: those of ROS, or without ROS those of rosbags.

The node needs ROS. The replay tool does not, and makes the same messages with the same code.
"""

from array import array
from typing import Any

try:
    from builtin_interfaces.msg import Duration, Time
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from geometry_msgs.msg import Point, Point32, PolygonStamped
    from rclpy.serialization import serialize_message as serialize
    from sensor_msgs.msg import PointCloud2, PointField
    from std_msgs.msg import Bool, ColorRGBA, Float64
    from visualization_msgs.msg import Marker, MarkerArray

    def octets(data: bytes) -> Any:
        """Return bytes as the value of a field of bytes."""
        return array('B', data)
except ImportError:
    from sat_collision.messages.rosbags_interfaces import message_classes, octets, serialize
    Duration, Time = message_classes('builtin_interfaces', 'Duration', 'Time')
    DiagnosticArray, DiagnosticStatus, KeyValue = message_classes(
        'diagnostic_msgs', 'DiagnosticArray', 'DiagnosticStatus', 'KeyValue')
    Point, Point32, PolygonStamped = message_classes(
        'geometry_msgs', 'Point', 'Point32', 'PolygonStamped')
    PointCloud2, PointField = message_classes('sensor_msgs', 'PointCloud2', 'PointField')
    Bool, ColorRGBA, Float64 = message_classes('std_msgs', 'Bool', 'ColorRGBA', 'Float64')
    Marker, MarkerArray = message_classes('visualization_msgs', 'Marker', 'MarkerArray')

__all__ = ['Bool', 'ColorRGBA', 'DiagnosticArray', 'DiagnosticStatus', 'Duration', 'Float64',
           'KeyValue', 'Marker', 'MarkerArray', 'Point', 'Point32', 'PointCloud2', 'PointField',
           'PolygonStamped', 'Time', 'octets', 'serialize', 'type_name']


def type_name(kind: type) -> str:
    """Return the name of a message class as ROS has it, such as std_msgs/msg/Bool."""
    return f'{kind.__module__.partition(".")[0]}/msg/{kind.__name__}'

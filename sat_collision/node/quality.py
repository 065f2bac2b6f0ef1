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

"""The quality of service that the node offers, and what users may ask of others."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import QoSLivelinessPolicy, QoSPolicyKind, QoSProfile
from sat_collision.scene.settings import Settings

# What can be overridden of the subscriptions.
OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
               QoSPolicyKind.DURABILITY, QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS,
               QoSPolicyKind.LIVELINESS_LEASE_DURATION)

# Flags are published within this time, or three of their periods if that is longer: what DDS
# promises to those who subscribe. After so much longer without one the monitor counts as dead.
_DEADLINE = 0.3
_LEASE = 0.5


def flag_qos(settings: Settings) -> QoSProfile:
    """Return what the publishers of flags offer: to be heard of often, or to be dead."""
    late = max(_DEADLINE, 3.0 / settings.publish_rate)
    return QoSProfile(
        depth=10, deadline=Duration(seconds=late), liveliness=QoSLivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=late + _LEASE - _DEADLINE))

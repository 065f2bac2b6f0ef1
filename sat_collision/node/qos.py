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

"""The QoS that the node offers, and what users may override of its subscriptions."""

from __future__ import annotations

from rclpy.duration import Duration
from rclpy.qos import QoSLivelinessPolicy, QoSPolicyKind, QoSProfile

# What can be overridden of the subscriptions.
OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
               QoSPolicyKind.DURABILITY, QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS,
               QoSPolicyKind.LIVELINESS_LEASE_DURATION)

# DDS guarantees to subscribers of flags, in s: one arrives within the deadline, or the monitor
# counts as dead after the lease.
_DEADLINE = 0.3
_LEASE = 0.5


def flag_qos() -> QoSProfile:
    """Return the QoS of the publishers of flags: with a deadline and a liveliness lease."""
    return QoSProfile(
        depth=10, deadline=Duration(seconds=_DEADLINE),
        liveliness=QoSLivelinessPolicy.MANUAL_BY_TOPIC,
        liveliness_lease_duration=Duration(seconds=_LEASE))

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
"""Exact collision checks between robot footprints and obstacles, for ROS 2."""

from sat_collision.geometry.arithmetic import require_proved
from sat_collision.geometry.jit import KERNEL
from sat_collision.geometry.polygon import Polygon, PolygonError, Reason
from sat_collision.geometry.polygon_set import PolygonSet
from sat_collision.geometry.query import (
    closest_points, intersects, intersects_many, intersects_pairs, separation)
from sat_collision.geometry.sweep import time_of_contact

__all__ = [
    'KERNEL',
    'Polygon',
    'PolygonError',
    'PolygonSet',
    'Reason',
    'closest_points',
    'intersects',
    'intersects_many',
    'intersects_pairs',
    'separation',
    'time_of_contact',
]

require_proved()

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

"""Obstacles: their names and how long they last."""

from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines, NEVER
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.sources import Source
from stage import INSTANCES, PATIENT_LIDAR, square


def placed(settings, key, time):
    """Return an obstacle that a source has placed, and the source."""
    source = Source(settings, Contacts(), Deadlines())
    assert source.place(square(0).packed, 'map', time, time, key) is None
    obstacle, = source.obstacles
    return obstacle, source


def test_names_are_sorted_by_source_and_number():
    """Numbers as numbers, not as text."""
    names = [ObstacleId('map', 10), ObstacleId('map', 9), ObstacleId('lidar', -1)]
    assert [str(name) for name in sorted(names)] == ['lidar/-1', 'map/9', 'map/10']


def test_obstacle_lasts_for_the_timeout_of_its_source():
    """When its deadline has passed, its source forgets it."""
    obstacle, source = placed(INSTANCES, 7, 1000)
    assert obstacle.name == ObstacleId('lidar', 7)
    assert obstacle.deadline == 1000 + 2 * 10**9
    obstacle.expire()
    assert not list(source.obstacles) and obstacle.polygon is None


def test_obstacle_of_a_source_without_timeout_lasts_for_ever():
    """As one of a latched map does."""
    obstacle, _ = placed(PATIENT_LIDAR, None, 1000)
    assert obstacle.deadline == NEVER

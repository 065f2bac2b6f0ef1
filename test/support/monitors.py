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

"""A monitor that has received a footprint and obstacles."""

import math

from builders import box, SECOND, serialised
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

NOW = 1000 * SECOND
SETTINGS = Settings(
    frame_id='map',
    footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons'),
               ObstacleSettings('tracks', '/tracks', type='polygon_instance', max_count=2)))
BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]
CIRCLE = [(math.cos(k / 500), math.sin(k / 500)) for k in range(2000)]


def clear_monitor(settings=SETTINGS):
    """Return a monitor with a footprint at 0, one message, and obstacles far from it, two each."""
    monitor = Monitor(settings)
    assert monitor.receive('robot', serialised(box(0)), NOW, 1) is None
    for number, points in ((1, box(10)), (2, ())):
        assert monitor.receive('lidar', serialised(points), NOW, number) is None
    if len(settings.obstacles) > 1:
        for number, points, stamp in ((1, (), NOW - 2 * SECOND), (2, box(20), NOW)):
            assert monitor.receive(
                'tracks', serialised(points, stamp, instance=1), NOW, number) is None
    assert status(monitor) == 'clear'
    return monitor


def status(monitor):
    return monitor.scene.state('robot').status.value

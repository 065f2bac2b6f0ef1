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

"""When something changes by time alone, whatever the stamps are."""

from builders import box, SECOND, serialised
from sat_collision.monitor import Monitor
from sat_collision.scene.footprints import Status
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

START = 1000 * SECOND


def test_set_that_is_older_than_the_one_before():
    """Its stamp is 1.8 s old when it comes: what it proves lasts for 0.2 s of a timeout of 2 s."""
    monitor = Monitor(Settings((FootprintSettings('robot', '/robot', timeout=0.0),),
                               (ObstacleSettings('lidar', '/polygons', timeout=2.0),)))
    monitor.receive('robot', serialised(box(0), START), START, 1)
    number = 0
    for now, stamp in ((START, START), (START + SECOND, START - 8 * SECOND // 10)):
        for points in (box(9), []):
            number += 1
            assert monitor.receive('lidar', serialised(points, stamp), now, number) is None
    for tenths, status in ((12, Status.CLEAR), (13, Status.UNKNOWN)):
        monitor.advance(START + tenths * SECOND // 10)
        assert monitor.scene.status('robot') is status

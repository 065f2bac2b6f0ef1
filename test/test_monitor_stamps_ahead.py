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

"""What is stamped ahead of the clock shuts out nothing that comes after it."""

from builders import box, odometry, SECOND, serialised, transforms
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.frames import Frames
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF

START = 1000 * SECOND
OUTLINE = (-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5)
BY_TF = FootprintSettings('robot', TF, points=OUTLINE, frame_id='base', rate=1000.0)
BY_ODOMETRY = FootprintSettings('robot', '/odom', points=OUTLINE, frame_id='base', rate=1000.0,
                                odometry='/odom')
PUBLISHED = FootprintSettings('robot', '/robot')


class World:
    """A monitor that receives a robot, whose x it knows; times are seconds since START."""

    def __init__(self, footprint):
        self.kind = footprint
        self.monitor = Monitor(Settings(
            (footprint,), (ObstacleSettings('lidar', '/lidar'),), frame_id='odom'), True)
        self.monitor.advance(START)

    def tell(self, time, x, ahead=0.0):
        """Tell where the robot is, with a stamp ahead of the clock."""
        now, stamp = (START + round(t * SECOND) for t in (time, time + ahead))
        self.monitor.advance(now)
        if self.kind is BY_TF:
            self.monitor.receive_transforms(TF, transforms(('odom', 'base', stamp, x, 0.0)), now)
        elif self.kind is BY_ODOMETRY:
            self.monitor.receive('robot', odometry('odom', 'base', stamp, x, 0.0), now)
        else:
            self.monitor.receive('robot', serialised(box(x - 0.5, -0.5), stamp, 'odom'), now)

    @property
    def x(self):
        polygon = dict(self.monitor.scene.footprints)['robot']
        return polygon.bounds[0] + 0.5


@pytest.mark.parametrize('footprint', [PUBLISHED, BY_TF, BY_ODOMETRY])
@pytest.mark.parametrize('is_first', [False, True])
def test_one_place_ahead_of_the_clock(footprint, is_first):
    """It counts as of now at most: each that comes after it counts when it comes."""
    world = World(footprint)
    if not is_first:
        world.tell(0.1, 1.0)
    world.tell(0.2, 5.0, ahead=0.9)
    for tenths in range(3, 15):
        world.tell(tenths / 10, float(tenths))
        assert world.x == tenths


@pytest.mark.parametrize('footprint', [PUBLISHED, BY_TF, BY_ODOMETRY])
def test_one_place_beyond_the_tolerance(footprint):
    """An hour ahead it is refused, and the next one heals."""
    world = World(footprint)
    world.tell(0.1, 1.0)
    world.tell(0.2, 5.0, ahead=3600.0)
    world.tell(0.3, 3.0)
    assert world.x == 3.0
    listener = world.monitor.transforms
    assert (world.monitor.rejected + listener.rejected).total() == 1


def test_age_counts_from_the_clock():
    """Of a transform ahead of it, where there is no other."""
    world = World(BY_TF)
    world.tell(0.2, 5.0, ahead=0.9)
    world.monitor.advance(START + 7 * SECOND // 10)
    assert world.monitor.scene.state('robot').age == 0.5


@pytest.mark.parametrize('now, at', [(23, 12), (24, 20), (29, 20), (30, 30), (99, 30)])
def test_the_newest_time_until_now(now, at):
    """The one until which each frame on the way has been received, whatever is above them."""
    frames = Frames(10 * SECOND)
    for parent, child, *stamps in (('odom', 'base', 12, 24, 36), ('odom', 'map', 10, 20, 30),
                                   ('earth', 'odom', 1, 2)):
        for stamp in stamps:
            frames.insert(parent, child, stamp, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    for target, source in (('map', 'base'), ('base', 'map')):
        found = frames.newest(target, source, now=now)
        assert found.at == at, found

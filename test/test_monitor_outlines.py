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

"""Footprints that nobody publishes: an outline goes where its frame goes."""

from dataclasses import replace
import math

from builders import box, odometry, SECOND, serialised
from monitors import nanoseconds, START, World
import pytest
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene import frames
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF

ROBOT = FootprintSettings('robot', TF, points=(-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5),
                          frame_id='base', rate=1000.0)
SOURCE = ObstacleSettings('lidar', '/polygons', type='polygon_instance', timeout=0.0)


class OutlineWorld(World):
    """A monitor in moving frames; one obstacle is far off."""

    def __init__(self, *footprints, transforms=True, **more):
        super().__init__(Settings(frame_id='odom', footprints=footprints or (ROBOT,),
                                  obstacles=(SOURCE,), **more), transforms)
        self.wait_until(0.0)
        self.send_map('lidar', box(50.0))


def test_an_outline_goes_where_its_frame_goes():
    world = OutlineWorld()
    assert world.state().reasons == ('footprint robot on /tf has not been received yet',)
    world.move(0.1, 1.0)
    assert world.bounds() == (0.5, -0.5, 1.5, 0.5) and world.status() == 'clear'
    world.move(0.2, 2.0, 3.0, math.pi / 2)
    assert world.bounds() == pytest.approx((1.5, 2.5, 2.5, 3.5), abs=1e-12)
    world.move(0.3, 49.5, 0.5)
    assert world.status() == 'collision'
    assert world.monitor.received['robot'] == 3 and not world.rejections


def test_its_age_is_that_of_the_transform():
    """And so is that which tells where it came from."""
    world = OutlineWorld()
    world.move(0.1, 1.0)
    world.wait_until(0.35)
    assert world.state().age == pytest.approx(0.25)
    assert world.scene.origin('robot') == ('base', pytest.approx(0.25))
    world.wait_until(1.1)
    assert world.status() == 'clear'
    world.wait_until(1.1000001)
    assert world.state().reasons == (
        'footprint robot on /tf is older than its timeout of 1 s',)


def test_it_is_as_old_as_the_oldest_transform_that_it_takes():
    """Localization is slower than odometry: the pose is that of the last time both know."""
    world = OutlineWorld()
    world.tell(TF_STATIC, ('map', 'wall', 0, 1.0, 0.0))
    world.move(0.1, 100.0, child='middle')
    world.move(0.1, 1.0, parent='middle')
    world.move(0.2, 2.0, parent='middle')
    assert world.bounds() == (100.5, -0.5, 101.5, 0.5) and world.state().age == pytest.approx(0.1)
    world.move(0.3, 3.0, parent='middle')
    world.time = 0.35
    world.tell(TF, ('odom', 'middle', nanoseconds(0.25), 200.0, 0.0))
    assert world.bounds() == pytest.approx((202.0, -0.5, 203.0, 0.5), abs=1e-9)
    assert world.state().age == pytest.approx(0.1)


def test_what_does_not_move_it_leaves_it_alone():
    world = OutlineWorld()
    world.move(0.1, 1.0)
    world.move(0.2, 9.0, child='other')
    assert world.monitor.received['robot'] == 1 and world.state().age == pytest.approx(0.1)


def test_it_is_placed_no_more_often_than_its_rate():
    """On the average; and what came too soon is placed when it is time, without a message."""
    world = OutlineWorld(replace(ROBOT, rate=10.0))
    for k in range(100):
        world.move(k / 100, k / 10)
    assert 10 <= world.monitor.received['robot'] <= 12
    assert world.bounds()[0] < 9.4 - 1e-6
    due = (world.monitor.deadline + 1 - START) / SECOND
    assert 0.99 < due <= 1.1
    world.wait_until(due)
    assert world.bounds() == pytest.approx((9.4, -0.5, 10.4, 0.5))


def test_regular_poses_at_its_rate_are_all_placed():
    """Though some come a little early."""
    world = OutlineWorld(replace(ROBOT, rate=50.0))
    for k in range(100):
        world.move(k / 50 + (k * 7 % 5) / 1000, k / 10)
    assert world.monitor.received['robot'] == 100


def test_in_a_static_frame_it_stays_known():
    """Nothing is ever told again, and nothing grows old."""
    world = OutlineWorld()
    world.tell(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    assert world.bounds() == (6.5, -0.5, 7.5, 0.5)
    for _ in range(1000):
        world.wait_until((world.monitor.deadline + 1 - START) / SECOND)
        assert world.status() == 'clear'
    assert world.time > 100 and world.scene.origin('robot') == ('base', None)


def test_without_a_timeout_a_static_frame_asks_for_nothing():
    world = OutlineWorld(replace(ROBOT, timeout=0.0))
    world.tell(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    world.wait_until(2.0)
    assert world.monitor.deadline > nanoseconds(1e6)


def test_why_it_is_nowhere_is_said_once():
    """After the time that a message would wait for a transform."""
    world = OutlineWorld()
    world.move(0.1, 1.0, child='arm')
    assert not world.rejections
    world.wait_until(0.3000001)
    assert world.reasons == [frames.UNKNOWN_FRAME]
    assert world.rejections[0].detail == (
        'no transform from base to odom: no good transform has named base yet')
    assert world.state().reasons == ('footprint robot on /tf was refused: unknown frame',)
    world.move(0.5, 1.0, child='arm')
    world.move(0.6, 1.0, child='base', parent='island')
    world.move(0.9, 1.0, child='base', parent='island')
    assert world.reasons == [frames.UNKNOWN_FRAME, frames.NOT_CONNECTED]
    world.move(1.1, 1.0)
    assert world.status() == 'clear'


def test_a_frame_that_tilts_is_nowhere():
    """At once, though it was somewhere."""
    world = OutlineWorld()
    world.move(0.1, 1.0)
    world.wait_until(0.2)
    half = math.radians(3)
    world.tell(TF, ('odom', 'base', world.now, 1, 0, 0, math.sin(half), 0, 0, math.cos(half)))
    assert world.reasons == [frames.TILTED] and world.status() == 'unknown'
    world.move(0.3, 1.0)
    assert world.status() == 'clear'


def test_another_outline_counts_at_once():
    """A load is picked up, and it reaches into something, before the robot moves on."""
    world = OutlineWorld()
    world.move(0.1, 49.0, 0.5)
    assert world.status() == 'clear'
    world.use(points='[[-0.5, -0.5], [1.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'collision' and world.state().age == 0.0
    world.use(points='[[-0.5, -0.5], [0.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'clear'


def test_another_outline_that_cannot_be_placed_is_unknown():
    """What was there before had another shape."""
    world = OutlineWorld()
    world.move(0.1, 49.0, 0.5)
    world.monitor.transforms.clear()
    world.use(points='[[-0.5, -0.5], [1.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'unknown' and world.reasons == [frames.UNKNOWN_FRAME]
    world.move(0.2, 49.0, 0.5)
    assert world.status() == 'collision'


def test_a_disc_is_covered():
    """By a polygon round it, in single precision too."""
    world = OutlineWorld(replace(ROBOT, points='', radius=0.3, radius_vertices=7))
    world.move(0.1, 0.0)
    (_, polygon), = world.scene.footprints
    assert len(polygon.vertices) == 7
    ends = zip(polygon.vertices, [*polygon.vertices[1:], polygon.vertices[0]])
    assert [abs(a[0] * b[1] - a[1] * b[0]) / math.dist(a, b) for a, b in ends] == (
        pytest.approx([0.3 * (1 + 1e-6)] * 7, abs=1e-7))
    assert min(abs(a[0] * b[1] - a[1] * b[0]) / math.dist(a, b) for a, b in zip(
        polygon.vertices, [*polygon.vertices[1:], polygon.vertices[0]])) > 0.3


def test_the_disabled_follow_nothing():
    world = OutlineWorld()
    world.move(0.1, 1.0)
    world.use(enabled=False)
    world.move(0.2, 2.0)
    assert world.status() == 'unknown' and world.monitor.received['robot'] == 1
    world.use(enabled=True)
    assert world.status() == 'clear'
    assert world.bounds() == (1.5, -0.5, 2.5, 0.5)


def test_it_lives_beside_footprints_that_are_told():
    world = OutlineWorld(ROBOT, FootprintSettings('cart', '/cart'))
    world.move(0.1, 1.0)
    world.monitor.receive('cart', serialised(box(49.5), world.now, 'odom'), world.now)
    assert (world.status('robot'), world.status('cart')) == ('clear', 'collision')
    assert world.scene.origin('cart') == ('odom', None)
    world.monitor.receive('cart', serialised(box(1.0), world.now, 'base'), world.now)
    assert world.bounds('cart') == (2.0, 0.0, 3.0, 1.0)
    assert world.scene.origin('cart') == ('base', 0.0)


def test_odometry_moves_it_without_tf():
    world = OutlineWorld(replace(ROBOT, topic='/odom', odometry='/odom'))
    world.report(0.1, 1.0, 2.0)
    assert world.bounds() == (0.5, 1.5, 1.5, 2.5) and world.status() == 'clear'
    world.report(0.3, 49.5)
    assert world.status() == 'collision'
    assert world.monitor.received['robot'] == 2 and not world.rejections


def test_odometry_moves_what_the_robot_sees_too():
    """In its own frame, without /tf; what is stamped later waits."""
    odometer = replace(ROBOT, topic='/odom', odometry='/odom')
    world = OutlineWorld(odometer, transforms=False)
    world.report(0.1, 1.0, 2.0)
    world.time = 0.15
    world.monitor.receive('lidar', serialised(box(0.25), world.now, 'base', 0), world.now)
    assert world.monitor.waiting.counts() == {'lidar': 1}
    world.report(0.2, 2.0, 2.0)
    assert world.status() == 'collision'
    (_, polygon), = world.scene.obstacles
    assert polygon.bounds == pytest.approx((1.75, 2.0, 2.75, 3.0), abs=1e-12)


def test_odometry_between_other_frames_is_of_no_use():
    """It says so, and which."""
    world = OutlineWorld(replace(ROBOT, topic='/odom', odometry='/odom'))
    world.report(0.1, 1.0, parent='earth')
    world.report(0.4, 1.0, parent='earth')
    assert world.status() == 'unknown'
    assert world.rejections[0].text.startswith(
        'robot: a message on /odom was rejected, unknown frame: no transform from base to odom: '
        'no good transform has named odom yet; ')


@pytest.mark.parametrize('data', [
    b'', odometry('odom', 'b' * 300, START, 0, 0), serialised(box(0), START, 'odom')])
def test_what_is_no_odometry_is_refused(data):
    world = OutlineWorld(replace(ROBOT, topic='/odom', odometry='/odom'))
    rejection = world.monitor.receive('robot', data, world.now)
    assert rejection.reason == 'undecodable' and rejection.name == 'robot'
    assert world.monitor.rejected == {('robot', 'undecodable'): 1}


def test_odometry_that_is_not_finite_is_refused():
    world = OutlineWorld(replace(ROBOT, topic='/odom', odometry='/odom'))
    world.report(0.1, math.nan)
    assert world.reasons == ['not finite or no rotation']


def test_a_jump_back_begins_anew():
    """A bag that loops: where the frame was belongs to another time."""
    world = OutlineWorld()
    world.wait_until(4.9)
    world.tell(TF_STATIC, ('base', 'tool', 0, 0.0, 0.0))
    for _ in range(3):
        for k in range(5):
            world.move(5.0 + k / 10, k)
            assert world.bounds()[0] == k - 0.5
        world.wait_until(0.0)
        assert world.status() == 'unknown'
    assert not world.rejections


def test_a_pose_in_a_gap_between_transforms_is_refused():
    """It would have to be made up."""
    world = OutlineWorld(max_tf_gap=0.2, transform_timeout=9.0)
    world.move(0.0, 0.0, parent='middle')
    world.time = 0.5
    world.tell(TF, ('middle', 'base', nanoseconds(0.5), 5.0, 0.0))
    world.tell(TF, ('odom', 'middle', nanoseconds(0.25), 0.0, 0.0))
    assert world.reasons == [frames.GAP] and world.status() == 'unknown'
    world.tell(TF, ('odom', 'middle', nanoseconds(0.5), 0.0, 0.0))
    assert world.status() == 'clear' and world.bounds() == (4.5, -0.5, 5.5, 0.5)


def test_its_velocity_is_that_of_the_transforms():
    """Tracked from when somebody asks: two places on, on an arc; none after a time jump."""
    world = OutlineWorld()
    world.move(0.1, 0.0)
    world.move(0.2, 0.1)
    assert world.scene.velocity('robot') == ''
    world.scene.tracks_motion = True
    world.move(0.3, 0.2)
    assert world.scene.velocity('robot') == ''
    world.move(0.4, 0.3, yaw=0.05)
    twist, pose, origin = world.scene.velocity('robot')
    assert twist[2] == pytest.approx(0.5) and pose == pytest.approx((0.3, 0.0, 0.0))
    assert math.hypot(*twist[:2]) == pytest.approx(1.0, rel=1e-3) and origin == 'transforms'
    world.wait_until(0.1)
    world.move(0.2, 5.0)
    assert world.scene.velocity('robot') == ''


def test_its_velocity_is_that_of_odometry():
    """In the frame that the message names, which another one may be fixed to."""
    world = OutlineWorld(replace(ROBOT, odometry='odometry', frame_id='body'))
    world.scene.tracks_motion = True
    world.tell(TF_STATIC, ('base', 'body', 0, 0.5, 0.0))
    world.report(0.1, 1.0, 2.0, 0.5, twist=(0.7, 0.1, -0.2))
    assert world.scene.velocity('robot') == (
        (0.7, 0.1, -0.2), pytest.approx((1.0, 2.0, 0.5)), 'odometry')
    world.report(0.2, 1.1, 2.0, 0.5, twist=(math.nan, 0.0, 0.0))
    assert world.scene.velocity('robot')[2] == 'transforms'


def test_an_outline_in_a_fixed_frame_stands():
    world = OutlineWorld()
    world.scene.tracks_motion = True
    world.tell(TF_STATIC, ('odom', 'base', 0, 3.0, 0.0))
    assert world.scene.velocity('robot').twist == (0, 0, 0)


def test_the_velocity_of_a_published_footprint_is_that_of_two_messages():
    """Of two of one shape and one publisher, also where vertices change their place in order."""
    monitor = Monitor(Settings(frame_id='', footprints=(FootprintSettings('robot', '/robot'),),
                               obstacles=(SOURCE,)))
    monitor.scene.tracks_motion = True

    def velocity(time, points):
        stamp = nanoseconds(time)
        assert monitor.receive('robot', serialised(points, stamp), stamp) is None
        return monitor.scene.velocity('robot')
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    assert velocity(0.0, square) == ''
    turned = [(1.1 - y, x) for x, y in square]
    assert velocity(0.5, turned).twist[2] == pytest.approx(math.pi)
    assert velocity(0.6, [(x + 0.1, y) for x, y in turned]) == (
        pytest.approx((1, 0, 0)), pytest.approx((0.7, 0.5, 0)), 'footprints')
    assert velocity(0.7, square[:3]) == ''


PUBLISHED = FootprintSettings('robot', '/robot')
BY_ODOMETRY = replace(ROBOT, topic='/odom', odometry='/odom')
EVERY_WAY = pytest.mark.parametrize('footprint', [PUBLISHED, ROBOT, BY_ODOMETRY],
                                    ids=['published', 'by /tf', 'by odometry'])


def place(world, time, x, ahead=0.0):
    """Let the robot be received at a place, with a stamp ahead of the clock."""
    world.wait_until(time)
    stamp = nanoseconds(time + ahead)
    footprint, = world.settings.footprints
    if footprint is ROBOT:
        world.tell(TF, ('odom', 'base', stamp, x, 0.0))
    elif footprint is BY_ODOMETRY:
        world.receive('robot', odometry('odom', 'base', stamp, x, 0.0))
    else:
        world.send('robot', box(x - 0.5, -0.5), time + ahead)


@EVERY_WAY
@pytest.mark.parametrize('is_first', [False, True])
def test_one_place_ahead_of_the_clock_shuts_out_none_after_it(footprint, is_first):
    """It counts as of now at most: each that comes after it counts when it comes."""
    world = OutlineWorld(footprint)
    if not is_first:
        place(world, 0.1, 1.0)
    place(world, 0.2, 5.0, ahead=0.9)
    for tenths in range(3, 15):
        place(world, tenths / 10, float(tenths))
        assert world.bounds()[0] == tenths - 0.5


@EVERY_WAY
def test_one_place_beyond_the_tolerance_is_refused(footprint):
    """An hour ahead; the next one heals."""
    world = OutlineWorld(footprint)
    place(world, 0.1, 1.0)
    place(world, 0.2, 5.0, ahead=3600.0)
    place(world, 0.3, 3.0)
    assert world.bounds()[0] == 2.5 and len(world.rejections) == 1


def test_age_of_a_transform_ahead_of_the_clock_counts_from_its_arrival():
    world = OutlineWorld()
    place(world, 0.2, 5.0, ahead=0.9)
    world.wait_until(0.7)
    assert world.state().age == 0.5

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Footprints given as an outline, which follows its frame."""

from dataclasses import replace
import math

from builders import box, odometry, SECOND, serialised, transforms
from monitors import MAP, MapWorld, nanoseconds, START, World
import pytest
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene import frames
from sat_collision.scene.settings import FootprintSettings, Settings, TF

ROBOT = FootprintSettings('robot', TF, points=(-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5),
                          frame_id='base', rate=1000.0)
BY_ODOMETRY = replace(ROBOT, topic='/odom', odometry='/odom')


class OutlineWorld(MapWorld):
    """A monitor with outlines and one far obstacle."""

    def __init__(self, *footprints, **more):
        super().__init__(footprints or (ROBOT,), box(50.0), **more)


def due(world):
    """Return when something changes without a message."""
    return (world.monitor.deadline + 1 - START) / SECOND


def test_outline_follows_its_frame():
    world = OutlineWorld()
    assert world.state().reasons == ('footprint robot on /tf has not been received yet',)
    assert world.move(0.1, 1.0).bounds() == (0.5, -0.5, 1.5, 0.5) and world.status() == 'clear'
    world.move(0.2, 2.0, 3.0, math.pi / 2)
    assert world.bounds() == pytest.approx((1.5, 2.5, 2.5, 3.5), abs=1e-12)
    assert world.move(0.3, 49.5, 0.5).status() == 'collision'
    assert world.monitor.received['robot'] == 3 and not world.rejections


def test_age_is_that_of_the_transform():
    world = OutlineWorld().move(0.1, 1.0)
    assert world.at(0.35).state().age == pytest.approx(0.25)
    assert world.scene.origin('robot') == ('base', pytest.approx(0.25))
    assert world.at(1.1).status() == 'clear'
    assert world.at(1.1000001).state().reasons == (
        'footprint robot on /tf is older than its timeout of 1 s',)


def test_age_is_that_of_the_oldest_transform_in_the_chain():
    """Localisation is slower than odometry: the pose is the last common one."""
    world = OutlineWorld()
    world.receive_transforms(TF_STATIC, ('map', 'wall', 0, 1.0, 0.0))
    world.move(0.1, 100.0, child='middle')
    world.move(0.1, 1.0, parent='middle')
    world.move(0.2, 2.0, parent='middle')
    assert world.bounds() == (100.5, -0.5, 101.5, 0.5) and world.state().age == pytest.approx(0.1)
    world.move(0.3, 3.0, parent='middle')
    world.time = 0.35
    world.receive_transforms(TF, ('odom', 'middle', nanoseconds(0.25), 200.0, 0.0))
    assert world.bounds() == pytest.approx((202.0, -0.5, 203.0, 0.5), abs=1e-9)
    assert world.state().age == pytest.approx(0.1)


def test_unrelated_transform_does_not_place_it():
    world = OutlineWorld().move(0.1, 1.0)
    world.move(0.2, 9.0, child='other')
    assert world.monitor.received['robot'] == 1 and world.state().age == pytest.approx(0.1)


def test_rate_limits_placements():
    """On average; a skipped pose is placed when it is due, without another message."""
    world = OutlineWorld(replace(ROBOT, rate=10.0, timeout=0.0))
    for k in range(100):
        world.move(k / 100, k / 10)
    assert 10 <= world.monitor.received['robot'] <= 12
    assert world.bounds()[0] < 9.4 - 1e-6
    assert 0.99 < due(world) <= 1.1
    assert world.at(due(world)).bounds() == pytest.approx((9.4, -0.5, 10.4, 0.5))


def test_regular_poses_at_its_rate_are_all_placed():
    """Even if some come a little early."""
    world = OutlineWorld(replace(ROBOT, rate=50.0))
    for k in range(100):
        world.move(k / 50 + (k * 7 % 5) / 1000, k / 10)
    assert world.monitor.received['robot'] == 100


def test_outline_in_a_static_frame_never_expires():
    """Although its transform is sent once."""
    world = OutlineWorld()
    world.receive_transforms(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    assert world.bounds() == (6.5, -0.5, 7.5, 0.5)
    assert due(world) == pytest.approx(1 / 3), 'before it is too old'
    for _ in range(1000):
        assert world.at(due(world)).status() == 'clear'
    assert world.time > 100 and world.scene.origin('robot') == ('base', None)


@pytest.mark.parametrize('topic', [TF, TF_STATIC])
@pytest.mark.parametrize('timeout', [0.0, 9.0])
def test_corrected_transform_counts_at_once(timeout, topic):
    """It has the stamp of the one before, or none that matters."""
    world = OutlineWorld(replace(ROBOT, timeout=timeout))
    for x in (1.0, 49.5):
        world.at(world.time + 0.1).receive_transforms(topic, ('odom', 'base', START, x, 0.0))
        assert world.bounds()[0] == x - 0.5
    assert world.status() == 'collision'
    received = world.monitor.received['robot']
    world.receive_transforms(topic, ('odom', 'base', START, x, 0.0))
    assert world.monitor.received['robot'] == received, 'it has not moved'


@pytest.mark.parametrize('parent', ['odom', 'site'])
def test_static_frame_that_begins_to_move_counts_at_once(parent):
    """Its first pose is from before it was placed; there may be none until its parent has one."""
    world = OutlineWorld()
    world.at(0.2).receive_transforms(TF_STATIC, ('odom', 'base', 0, 48.0, 0.0))
    world.receive_transforms(TF, (parent, 'base', nanoseconds(0.1), 49.5, 0.0))
    if parent == 'site':
        assert world.at(0.6).status() == 'clear' and world.monitor.deadline >= world.now
        world.receive_transforms(TF, ('odom', 'site', nanoseconds(0.1), 0.0, 0.0))
    assert world.status() == 'collision' and world.state().age == pytest.approx(world.time - 0.1)


def test_place_by_a_static_frame_that_moves_now_gives_way_to_an_older_one():
    """The frame above it lags behind it, and may have moved since it was thought to stand."""
    world = OutlineWorld()
    world.receive_transforms(TF_STATIC, ('odom', 'site', 0, 48.0, 0.0))
    for time in (0.1, 0.2):
        world.move(time, 0.0, parent='site')
    assert world.status() == 'clear'
    world.receive_transforms(TF, ('odom', 'site', nanoseconds(0.1), 49.5, 0.0))
    assert world.status() == 'collision' and world.state().age == pytest.approx(0.1)


def test_frame_that_becomes_static_where_it_is_does_not_expire():
    world = OutlineWorld().move(0.1, 7.0)
    world.receive_transforms(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    for _ in range(10):
        assert world.at(due(world)).status() == 'clear'
    assert world.time > 2


def test_static_frame_without_a_timeout_has_no_deadline():
    world = OutlineWorld(replace(ROBOT, timeout=0.0))
    world.receive_transforms(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    assert world.at(2.0).monitor.deadline > nanoseconds(1e6)


def test_missing_transform_is_reported_once():
    """After transform_timeout."""
    world = OutlineWorld().move(0.1, 1.0, child='arm')
    assert not world.rejections
    assert world.at(0.3000001).reasons == [frames.UNKNOWN_FRAME]
    assert world.rejections[0].detail == (
        'no transform from base to odom: no good transform has named base yet, only arm, odom')
    assert world.state().reasons == (
        f'footprint robot on /tf was refused: {world.rejections[0].detail}',)
    world.move(0.5, 1.0, child='arm')
    world.move(0.6, 1.0, child='base', parent='island')
    world.move(0.9, 1.0, child='base', parent='island')
    assert world.reasons == [frames.UNKNOWN_FRAME, frames.NOT_CONNECTED]
    assert world.move(1.1, 1.0).status() == 'clear'


@pytest.mark.parametrize('now, topic', [(START, TF), (START, TF_STATIC), (0, TF_STATIC)])
def test_missing_transform_is_reported_where_others_came_first(now, topic):
    """Before anything else, or before simulated time begins; no more need come."""
    monitor = Monitor(Settings(frame_id='odom', footprints=(ROBOT,), obstacles=(MAP,)), True)
    monitor.receive_transforms(topic, transforms(('odom', 'arm', START, 1.0, 0.0)), now)
    assert not monitor.advance(START)
    rejection, = monitor.advance(nanoseconds(0.2000001))
    assert rejection.reason == frames.UNKNOWN_FRAME


def test_tilted_frame_is_unknown_at_once():
    world = OutlineWorld().move(0.1, 1.0)
    half = math.radians(3)
    world.at(0.2).receive_transforms(
        TF, ('odom', 'base', world.now, 1, 0, 0, math.sin(half), 0, 0, math.cos(half)))
    assert world.reasons == [frames.TILTED] and world.status() == 'unknown'
    assert world.move(0.3, 1.0).status() == 'clear'


def test_changed_outline_counts_at_once():
    """Before the robot moves on."""
    world = OutlineWorld()
    assert world.move(0.1, 49.0, 0.5).status() == 'clear'
    world.use('robot', points='[[-0.5, -0.5], [1.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'collision' and world.state().age == 0.0
    assert world.use('robot', points='[[-0.5, -0.5], [0.5, 0.0], [-0.5, 0.5]]').status() == 'clear'


def test_changed_outline_that_cannot_be_placed_is_unknown():
    world = OutlineWorld().move(0.1, 49.0, 0.5)
    world.monitor.transforms.frames.clear()
    world.use('robot', points='[[-0.5, -0.5], [1.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'unknown' and world.reasons == [frames.UNKNOWN_FRAME]
    assert world.move(0.2, 49.0, 0.5).status() == 'collision'


def test_radius_is_covered_by_a_polygon():
    """Also after rounding to single precision."""
    world = OutlineWorld(replace(ROBOT, points='', radius=0.3, radius_vertices=7)).move(0.1, 0.0)
    corners = world.scene.polygon('robot').vertices.tolist()
    ends = zip(corners, [*corners[1:], corners[0]], strict=True)
    reach = [abs(a[0] * b[1] - a[1] * b[0]) / math.dist(a, b) for a, b in ends]
    assert reach == pytest.approx([0.3 * (1 + 1e-6)] * 7, abs=1e-7) and min(reach) > 0.3


def test_disabled_outline_is_not_placed():
    world = OutlineWorld().move(0.1, 1.0)
    world.use('robot', enabled=False)
    assert world.move(0.2, 2.0).status() == 'unknown' and world.monitor.received['robot'] == 1
    assert world.use('robot', enabled=True).status() == 'clear'
    assert world.bounds() == (1.5, -0.5, 2.5, 0.5)


def test_outline_beside_a_published_footprint():
    world = OutlineWorld(ROBOT, FootprintSettings('cart', '/cart')).move(0.1, 1.0)
    world.send('cart', box(49.5))
    assert (world.status('robot'), world.status('cart')) == ('clear', 'collision')
    assert world.scene.origin('cart') == ('odom', None)
    world.send('cart', box(1.0), frame_id='base')
    assert world.bounds('cart') == (2.0, 0.0, 3.0, 1.0)
    assert world.scene.origin('cart') == ('base', 0.0)


def test_outline_follows_odometry():
    world = OutlineWorld(BY_ODOMETRY).receive_odometry(0.1, 1.0, 2.0)
    assert world.bounds() == (0.5, 1.5, 1.5, 2.5) and world.status() == 'clear'
    assert world.receive_odometry(0.3, 49.5).status() == 'collision'
    assert world.monitor.received['robot'] == 2 and not world.rejections


def test_odometry_places_obstacles_in_the_robots_frame():
    """Without /tf; a later stamp waits for the next message."""
    world = World(Settings(frame_id='odom', footprints=(BY_ODOMETRY,), obstacles=(
        replace(MAP, timeout=2.0),)), transforms=False)
    world.receive_odometry(0.1, 1.0, 2.0)
    world.time = 0.15
    world.send('map', box(0.25), frame_id='base', instance=0)
    assert world.monitor.waiting.counts() == {'map': 1}
    assert world.receive_odometry(0.2, 2.0, 2.0).status() == 'collision'
    (_, polygon), = world.scene.obstacles
    assert polygon.bounds == pytest.approx((1.75, 2.0, 2.75, 3.0), abs=1e-12)


def test_odometry_between_other_frames_is_reported():
    world = OutlineWorld(BY_ODOMETRY).receive_odometry(0.1, 1.0, parent='earth')
    assert world.receive_odometry(0.4, 1.0, parent='earth').status() == 'unknown'
    assert world.rejections[0].text.startswith(
        'robot: a message on /odom was rejected, unknown frame: no transform from base to odom: '
        'no good transform has named odom yet, only base, earth; correct the frame_id, ')
    assert world.state().reasons == (
        'footprint robot on /odom was refused: no transform from base to odom: no good transform '
        'has named odom yet, only base, earth',)


@pytest.mark.parametrize('data, reason', [
    (b'', 'undecodable'), (odometry('odom', 'b' * 300, START, 0, 0), 'undecodable'),
    (serialised(box(0), START, 'odom'), 'undecodable'),
    (odometry('odom', 'base', START, math.nan, 0), 'not finite or no rotation')],
    ids=['nothing', 'long name', 'polygon', 'not finite'])
def test_odometry_that_cannot_be_used_is_refused(data, reason):
    world = OutlineWorld(BY_ODOMETRY)
    rejection = world.receive('robot', data)
    assert (rejection.name, rejection.reason) == ('robot', reason)
    assert world.monitor.rejected == {('robot', reason): 1}


def test_step_back_in_time_drops_poses():
    """A recording is played in a loop."""
    world = OutlineWorld()
    world.at(4.9).receive_transforms(TF_STATIC, ('base', 'tool', 0, 0.0, 0.0))
    for _ in range(3):
        for k in range(5):
            assert world.move(5.0 + k / 10, k).bounds()[0] == k - 0.5
        assert world.at(0.0).status() == 'unknown'
    assert not world.rejections


def test_pose_in_a_gap_between_transforms_is_refused():
    world = OutlineWorld(max_tf_gap=0.2, transform_timeout=9.0).move(0.0, 0.0, parent='middle')
    world.time = 0.5
    world.receive_transforms(TF, ('middle', 'base', nanoseconds(0.5), 5.0, 0.0))
    world.receive_transforms(TF, ('odom', 'middle', nanoseconds(0.25), 0.0, 0.0))
    assert world.reasons == [frames.GAP] and world.status() == 'unknown'
    world.receive_transforms(TF, ('odom', 'middle', nanoseconds(0.5), 0.0, 0.0))
    assert world.status() == 'clear' and world.bounds() == (4.5, -0.5, 5.5, 0.5)


@pytest.mark.parametrize('parent', ['odom', 'earth'])
def test_odometry_of_another_body_is_refused(parent):
    """The outline is placed by /tf; the velocity of another robot is not its own."""
    world = OutlineWorld(BY_ODOMETRY, tracks_motion=True)
    for time in (0.1, 0.2):
        world.receive_odometry(time, 9.0, child='other', parent=parent, twist=(5.0, 0.0, 0.0))
        world.move(time, time)
    assert world.scene.velocity('robot')[0] == pytest.approx((1.0, 0.0, 0.0))
    assert world.rejections[-1].text == (
        "robot: a message on /odom was rejected, odometry of another body: it is of 'other', with "
        "which 'base' does not move; give the topic that tells where the outline is, or publish "
        'the transform from its frame to this one')


@pytest.mark.parametrize('frame', ['odom', 'map'])
def test_odometry_does_not_move_an_outline_in_a_frame_above_it(frame):
    """The robot moves in odom, and that in the map; neither moves with the robot."""
    world = OutlineWorld(replace(BY_ODOMETRY, frame_id=frame))
    world.receive_transforms(TF_STATIC, ('map', 'odom', 0, 0.0, 0.0))
    assert world.receive_odometry(0.1, 1.0).reasons == ['odometry of another body']


PUBLISHED = FootprintSettings('robot', '/robot')
EVERY_INPUT = pytest.mark.parametrize('footprint', [PUBLISHED, ROBOT, BY_ODOMETRY],
                                      ids=['published', 'by /tf', 'by odometry'])


def place(world, time, x, ahead=0.0):
    """Receive a pose of the robot, with a stamp ahead of the clock, or (None) without one."""
    world.at(time)
    stamp = 0 if ahead is None else nanoseconds(time + ahead)
    footprint, = world.settings.footprints
    if footprint.odometry:
        world.receive('robot', odometry('odom', 'base', stamp, x, 0.0))
    elif footprint.has_outline:
        world.receive_transforms(TF, ('odom', 'base', stamp, x, 0.0))
    else:
        world.send('robot', box(x - 0.5, -0.5), 'none' if ahead is None else time + ahead)


@EVERY_INPUT
@pytest.mark.parametrize('is_first', [False, True])
def test_pose_stamped_ahead_does_not_block_later_ones(footprint, is_first):
    """It counts as of its arrival."""
    world = OutlineWorld(footprint)
    if not is_first:
        place(world, 0.1, 1.0)
    place(world, 0.2, 5.0, ahead=0.9)
    for tenths in range(3, 15):
        place(world, tenths / 10, float(tenths))
        assert world.bounds()[0] == tenths - 0.5


@EVERY_INPUT
@pytest.mark.parametrize('timeout, ahead', [(0.2, 0.9), (1.0, None)],
                         ids=['of a clock that is ahead', 'without a stamp'])
def test_poses_count_at_once_and_as_of_their_arrival(footprint, timeout, ahead):
    world = OutlineWorld(replace(footprint, timeout=timeout))
    for tenths in range(1, 15):
        place(world, tenths / 10, float(tenths), ahead)
        assert (world.bounds()[0], world.state().age) == (tenths - 0.5, 0.0)
    for later, status in ((timeout, 'clear'), (timeout + 0.001, 'unknown')):
        assert world.at(1.4 + later).status() == status


@pytest.mark.parametrize('footprint', [ROBOT, BY_ODOMETRY], ids=['by /tf', 'by odometry'])
@pytest.mark.parametrize('ahead', [0.0, 0.4, 0.9])
def test_obstacle_by_the_clock_of_the_transforms_has_its_place(footprint, ahead):
    """That clock is ahead of the monitor's."""
    world = World(Settings(frame_id='odom', footprints=(footprint,),
                           obstacles=(replace(MAP, timeout=2.0, set_end='none'),)))
    for tenths in range(1, 15):
        place(world, tenths / 10, float(tenths), ahead)
        world.send('map', box(3.0), world.time + ahead - 0.05 * (tenths > 1), 'base', 1)
        (_, polygon), = world.scene.obstacles
        assert polygon.bounds[0] == pytest.approx(tenths + 3 - 0.5 * (tenths > 1))


@EVERY_INPUT
def test_pose_beyond_the_tolerance_is_refused(footprint):
    """It is stamped an hour ahead; the next one counts."""
    world = OutlineWorld(footprint)
    place(world, 0.1, 1.0)
    place(world, 0.2, 5.0, ahead=3600.0)
    place(world, 0.3, 3.0)
    assert world.bounds()[0] == 2.5 and len(world.rejections) == 1


def test_pose_that_was_far_ahead_before_the_clock_began_does_not_block_later_ones():
    """A publisher by the system's clock, which the simulation's clock does not know yet."""
    world = World(OutlineWorld().settings)
    pose = 'odom', 'base', START + 3600 * SECOND, 5.0, 0.0
    world.monitor.receive_transforms(TF, transforms(pose), 0)
    place(world, 0.1, 1.0)
    place(world, 0.2, 2.0)
    assert world.bounds()[0] == 1.5 and not world.rejections


def test_transform_stamped_ahead_ages_from_its_arrival():
    """Also while other frames move."""
    world = OutlineWorld()
    place(world, 0.2, 5.0, ahead=0.9)
    assert world.move(0.7, 1.0, child='arm').state().age == 0.5
    world.move(1.3, 1.0, child='arm')
    assert world.status() == 'unknown' and world.state().age == pytest.approx(1.1)


def test_transform_without_a_stamp_of_before_the_clock_ran_is_dropped():
    """It would never grow old while other frames move; one that comes later counts."""
    world = World(OutlineWorld().settings)
    world.monitor.receive_transforms(TF, transforms(('odom', 'base', 0, 1.0, 0.0)), 0)
    for tenths in range(1, 4):
        assert not world.move(tenths / 10, 1.0, child='arm').scene.footprints
    place(world, 0.4, 2.0, ahead=None)
    assert world.bounds()[0] == 1.5


@EVERY_INPUT
@pytest.mark.parametrize('step', [1e-6, 0.9])
def test_small_step_back_of_the_clock_keeps_poses(footprint, step):
    """Their age is 0, and the next pose counts, whether its stamp went back with the clock."""
    for is_alike in (True, False):
        world = OutlineWorld(footprint)
        place(world, 1.0, 1.0)
        world.at(1.0 - step)
        assert (world.status(), world.state().age) == ('clear', 0.0)
        assert world.bounds()[0] == 0.5
        for k in range(2, 6):
            place(world, 1.0 - step + k * 0.02, float(k), 0.0 if is_alike else step)
            assert world.bounds()[0] == k - 0.5
    assert not world.rejections


@pytest.mark.parametrize('footprint', [ROBOT, BY_ODOMETRY], ids=['by /tf', 'by odometry'])
def test_poses_of_before_a_small_step_back_give_way(footprint):
    """Messages take 15 ms, so some of these poses are newer by their stamps than new ones."""
    world = OutlineWorld(footprint)
    for k in range(100):
        step = 0.505 if k >= 50 else 0.0
        place(world, 1.0 + k * 0.02 - step, float(k), ahead=-0.015)
        assert world.bounds()[0] == k - 0.5
        if k == 50:
            world.move(world.time, 1.0, child='arm')
            assert world.bounds()[0] == k - 0.5
        if k > 50:
            found = world.monitor.transforms.lookup_affine(
                'base', nanoseconds(world.time - 0.025), world.now)
            assert found.affine[2] == pytest.approx(k - 0.5)


@pytest.mark.parametrize('first', [0.0, -START / SECOND], ids=['set back', 'begins'])
def test_outline_in_a_static_frame_is_placed_by_a_new_clock(first):
    """Its transform is sent only once, here before the clock is set back or begins."""
    world = World(OutlineWorld().settings)
    world.at(first).receive_transforms(TF_STATIC, ('odom', 'base', 0, 7.0, 0.0))
    assert (world.status(), bool(world.scene.footprints)) == ('unknown', first == 0.0)
    assert world.at(-5.0).bounds()[0] == 6.5 and not world.rejections


def test_changed_outline_counts_where_its_frame_has_an_older_pose_only():
    """Its new parent is known only at a time before the last pose."""
    world = OutlineWorld().move(0.1, 48.0, parent='odom', child='map')
    world.move(0.1, 1.0, 0.5, parent='map')
    world.move(0.3, 1.0)
    world.move(0.4, 1.0, 0.5, parent='map')
    assert world.status() == 'clear' and world.bounds()[0] == 48.5
    world.use('robot', points='[[-0.5, -0.5], [1.5, 0.0], [-0.5, 0.5]]')
    assert world.status() == 'collision' and world.state().age == pytest.approx(0.3)

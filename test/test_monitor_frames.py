# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bodies in moving frames are placed in the fixed frame by the transform at their stamp."""

from dataclasses import replace
import math

from builders import box, serialised, transforms
from driving import Robot, robot_that_sees_nothing, SETTINGS
from monitors import nanoseconds, START
import pytest
from sat_collision.messages import transform_listener
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene import frames
from sat_collision.scene.frames import BAD_TRANSFORM
from sat_collision.scene.settings import BY_ANOTHER_CLOCK


@pytest.fixture
def robot():
    return robot_that_sees_nothing()


def test_obstacle_is_placed_by_the_pose_at_its_stamp(robot):
    """A point 2 m to the right of the laser's axis is ahead of the robot."""
    robot.see([(0, -2), (1, -2), (0, -3)], 0.35)
    assert robot.seen == [pytest.approx((3.35, 0.0, 4.35, 1.0), abs=1e-12)]
    robot.see([(0, -2), (1, -2), (0, -3)], 1.0)
    assert robot.seen == [pytest.approx((4.0, 0.0, 5.0, 1.0), abs=1e-12)]
    assert robot.status() == 'clear' and not robot.rejections


def test_footprint_in_a_moving_frame_is_placed():
    robot = Robot()
    robot.move(0.5)
    robot.move(1.0)
    robot.time = 1.0
    robot.send('robot', box(0), 0.5, 'base')
    robot.see(box(1.75), 1.0, 'odom')
    assert robot.status() == 'clear'
    robot.send('robot', box(0), 0.75, 'base')
    assert robot.status() == 'collision'


def test_messages_in_the_fixed_frame_need_no_transform():
    """They are accepted at once and unchanged."""
    robot = Robot()
    robot.stand(0)
    robot.see([(0.1, 0.3), (3, 7), (1 / 3, 5)], None, 'odom')
    (_, polygon), = robot.monitor.scene.obstacles
    assert polygon.vertices.tolist() == [
        [0.10000000149011612, 0.30000001192092896], [3, 7], [0.3333333432674408, 5]]
    assert 'lidar' not in robot.monitor.waiting


def test_non_convex_obstacle_is_placed(robot):
    robot.see([(0, 0), (4, 0), (4, 4), (2, 1)], 1.0, 'base')
    (_, polygon), = robot.monitor.scene.obstacles
    assert polygon.vertices.tolist() == [[1, 0], [5, 0], [5, 4], [3, 1]]
    assert robot.status() == 'collision'


def test_stamp_0_uses_the_newest_transform(robot):
    robot.see(box(1), 'none', 'base')
    assert robot.seen == [(2, 0, 3, 1)]


def test_stamp_0_refuses_a_newest_transform_past_the_timeout(robot):
    """The timeout of the source is 2 s."""
    assert robot.at(3.0).see(box(1), 'none', 'base') is None
    assert robot.at(3.001).see(box(1), 'none', 'base').reason == frames.OLD_LATEST
    assert 'past the timeout by 0.001 s' in robot.rejections[0].text
    assert 'lidar' not in robot.monitor.waiting


def test_footprint_without_a_stamp_is_as_old_as_its_transform(robot):
    """Its frame is last known at 1 s, and its timeout is 1 s."""
    assert robot.at(1.75).send('robot', box(0), 'none', 'base') is None
    assert (robot.bounds(), robot.state().age) == ((1.0, 0.0, 2.0, 1.0), 0.75)
    robot.see((), 1.75)
    assert robot.status() == 'clear'
    assert robot.at(2.000001).state().reasons == (
        'footprint robot on /footprint is older than its timeout of 1 s',)


def test_empty_polygon_needs_no_transform(robot):
    robot.at(2.5).see([], 2.5, 'camera')
    robot.at(4.5).stand(0)
    assert robot.status() == 'clear' and not robot.rejections


def test_settings_of_transforms_can_be_changed_live(robot):
    robot.monitor.update(replace(SETTINGS, transform_timeout=1.0, max_tf_gap=0.05, max_tilt=0.2))
    robot.see(box(9), 0.55)
    assert robot.reasons == [frames.GAP]
    robot.see(box(9), 1.05)
    assert robot.monitor.deadline == nanoseconds(2.0)


def test_without_transforms_other_frames_are_refused_at_once():
    """Without tf2_msgs, or without /tf in a recording."""
    rejection = Monitor(SETTINGS).receive('lidar', serialised(box(0), START, 'laser', 1), START)
    assert rejection.reason == 'other frame'


def test_refused_transform_is_reported_with_its_frame(robot):
    robot.receive_transforms(TF, ('odom', 'base', nanoseconds(1.1), math.nan, 0.0),
                             ('odom', 'arm', nanoseconds(1.1), 1, 2, 3, 0, 0, 0, 0),
                             ('odom', 'cart', nanoseconds(1.1), 5.0, 0.0))
    assert [one.text for one in robot.rejections] == [
        '/tf: a message on /tf was rejected, not finite or no rotation: the transform of '
        f"'{child}' in 'odom' by an unknown publisher is ({numbers}); the publisher must send "
        'finite numbers and a quaternion that is not zero'
        for child, numbers in (('base', 'nan, 0, 0, 0, 0, 0, 1'), ('arm', '1, 2, 3, 0, 0, 0, 0'))]
    assert robot.monitor.transforms.rejected == {
        ('base', BAD_TRANSFORM): 1, ('arm', BAD_TRANSFORM): 1}
    assert robot.see(box(0), 1.1, 'cart') is None and robot.seen == [(5, 0, 6, 1)]


def test_undecodable_transforms_are_reported(robot):
    robot.rejections += robot.monitor.receive_transforms(TF, b'\0\1\0\0\1\0\0\0', robot.now)
    assert robot.reasons == ['undecodable']
    assert robot.monitor.transforms.received == {TF: 12, TF_STATIC: 1}


@pytest.mark.parametrize('name', ('a\nb', '\x1b[31mred', 'c' * 200, "'; --"))
def test_control_characters_in_frame_names_are_escaped(robot, name):
    """And long names are cut."""
    robot.move(1.0)
    robot.receive_transforms(TF, (name, 'lost', nanoseconds(1.1), math.nan, 0.0),
                             ('lost', name, nanoseconds(1.1), math.nan, 0.0),
                             (name, 'island', robot.now, 0, 0), ('bay', name, robot.now, 0, 0),
                             ('island', 'bay', robot.now, 0, 0))
    robot.see(box(0), 1.0, name)
    robot.see(box(0), 1.0, 'island')
    robot.at(2.0)
    assert frames.LOOP in robot.reasons
    words = [one.text for one in robot.rejections]
    words += [child for child, _ in robot.monitor.transforms.rejected]
    words += robot.monitor.scene.state('robot').reasons
    assert len(words) > 6 and all(word.isprintable() and len(word) < 600 for word in words)


def test_very_long_frame_names_are_undecodable(robot):
    robot.receive_transforms(TF, ('odom', 'x' * 10**6, robot.now, 0.0, 0.0))
    assert robot.reasons == ['undecodable']
    assert robot.rejections[0].detail == 'a frame name of 1000001 bytes where 255 are accepted'


def test_memory_of_unknown_frames_is_bounded(robot):
    """Known frames are still received."""
    for k in range(110):
        robot.receive_transforms(TF, *(
            (f'odom{k}', f'frame{k}_{i}', robot.now, 0.0, 0.0) for i in range(100)))
    assert set(robot.reasons) == {'too many frames'}
    assert len(robot.monitor.transforms.rejected) <= 101
    robot.rejections.clear()
    for k in range(110):
        robot.receive_transforms(TF, *(
            (f'parent{k}_{i}', 'frame1_1', robot.now + 100 * k + i, 0.0, 0.0)
            for i in range(100)))
    assert set(robot.reasons) == {'too many frames'}
    robot.at(1.1).move(1.1)
    assert robot.see(box(9), 1.1) is None and 'lidar' not in robot.monitor.waiting


def test_frames_of_long_ago_make_room_for_new_ones(robot):
    """A tracker has sent one for each object that it ever saw, and each in one of its own."""
    for k in range(0, 10_000, 100):
        robot.receive_transforms(TF, *(
            (f'sight_{k + i}', f'object_{k + i}', robot.now, 0.0, 0.0) for i in range(100)))
    robot.rejections.clear()
    robot.at(32.0).move(32.0)
    robot.receive_transforms(TF_STATIC, ('base', 'hand', 0, 1.0, 0.0))
    robot.move(32.0, 5.0, 'arm')
    assert robot.see(box(9), 32.0, 'hand') is None and robot.see(box(9), 32.0, 'arm') is None
    assert 'lidar' not in robot.monitor.waiting and not robot.rejections


def test_two_publishers_of_a_frame_are_noticed(robot):
    """By their message numbers; a restart counts as one turn."""
    listener, now = robot.monitor.transforms, robot.now
    for number in (7, 8, 9, 1, 2, 3):
        listener.receive(TF, transforms(('odom', 'base', now, 0, 0)), now, number, now)
    assert listener.turns == {'base': 1}
    for number in (4, 100, 5, 101, 6):
        listener.receive(TF, transforms(('odom', 'base', now, 0, 0)), now, number, now)
    assert listener.turns == {'base': 3}


@pytest.mark.parametrize('reason, detail', [
    (frames.GAP, ''), ('from the future', ''),
    ('other frame', "it is in 'map', all else in 'base'"),
    ('too old', BY_ANOTHER_CLOCK)])
def test_advice_makes_nothing_worse(reason, detail):
    """No limit is raised for what may be one bad stamp, and no frame named that may be wrong."""
    text = Rejection('lidar', '/polygons', reason, detail).text
    assert 'raise' not in text and 'in that frame' not in text
    assert detail in text and text.count(';') == (detail != BY_ANOTHER_CLOCK)


def test_new_frames_count_again_after_a_flood_of_others(robot):
    """Once these have been silent for tf_cache_time, though only the new one is sent."""
    for k in range(frames._MAX_FRAMES):
        robot.receive_transforms(TF, ('odom', f'made up {k}', robot.now, 0.0, 0.0))
    robot.rejections.clear()
    for _ in range(12):
        robot.at(robot.time + 1.0).receive_transforms(TF, ('odom', 'real', robot.now, 0.0, 0.0))
    assert robot.reasons == 10 * [frames.TOO_MANY_FRAMES]


def test_numbers_of_made_up_frames_are_not_kept_for_ever(robot, monkeypatch):
    monkeypatch.setattr(transform_listener, '_MAX_NUMBERS', 50)
    for k in range(1, 200):
        for name in ('base', f'made up {k}'):
            data = transforms(('odom', name, robot.now, 0.0, 0.0))
            robot.monitor.receive_transforms(TF, data, robot.now, min(k, 150))
    listener = robot.monitor.transforms
    assert len(listener._numbers) <= 51 and listener.turns['base'] > 40

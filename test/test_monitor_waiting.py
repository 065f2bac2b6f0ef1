# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages wait for the transforms of their frames, and others behind them."""

from dataclasses import replace

from builders import box, serialised, transforms
from monitors import (
    BOW_TIE, CIRCLE, DRIVING, nanoseconds, Robot, robot_that_sees_nothing, SETS, with_changes)
import pytest
from sat_collision.scene import frames
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import ObstacleSettings, TF
from sat_collision.scene.streams import Endpoint


@pytest.fixture
def robot():
    return robot_that_sees_nothing()


def test_message_waits_for_its_transform(robot):
    """Until then the obstacles before it stay."""
    robot.see(box(0.5), 1.0, 'odom')
    assert robot.status() == 'collision'
    assert robot.at(1.05).see(box(9), frame_id='base') is None
    assert robot.status() == 'collision' and 'lidar' in robot.monitor.waiting
    assert robot.at(1.1).move(1.1).status() == 'clear' and 'lidar' not in robot.monitor.waiting
    assert robot.seen == [pytest.approx((10.05, 0, 11.05, 1))]


def test_obstacle_behind_a_waiting_one_counts_once_it_has_a_place(robot):
    """
    At once, or by its own transform, though one before it has a later stamp.

    Ids without meaning, 0, do not replace each other.
    """
    robot.at(1.05).see(box(9), frame_id='camera')
    for x, instance in ((20, 0), (21, 0), (0.5, 7)):
        robot.see(box(x), 1.05, 'odom', instance)
    assert robot.state().contacts == (ObstacleId('lidar', 7),)
    assert [x for x, *_ in robot.seen] == [20, 21, 0.5]
    robot.see(box(30), 1.2, 'base', 9)
    robot.see(box(-1.5), 1.05, 'base', 8)
    assert len(robot.seen) == 3
    robot.move(1.1)
    assert len(robot.seen) == 4 and 'lidar' in robot.monitor.waiting
    assert robot.state().contacts == (ObstacleId('lidar', 7), ObstacleId('lidar', 8))


@pytest.mark.parametrize('points', [BOW_TIE, CIRCLE])
def test_refused_message_behind_a_waiting_one_counts_at_once(robot, points):
    robot.at(1.05).see(box(9), frame_id='camera')
    robot.see(points, 1.05, 'odom', 2)
    assert 'sent what was refused' in robot.state().reasons[0]


def test_obstacle_that_was_queued_is_not_held_beside_itself(robot):
    """Even if something always waits: it goes where its newest message says."""
    for k in range(1, 20):
        robot.at(1.0 + k / 20).see(box(30), 1.0 + k / 20, 'base', 2)
        robot.see(box(0.5 if k < 5 else 9), 1.0 + k / 20, 'odom')
        robot.move(1.0 + (k - 1) / 20 + 0.01)
        assert 'lidar' in robot.monitor.waiting
        assert len(robot.seen) <= 4
    assert robot.stand(0).status() == 'clear'


def test_obstacle_that_was_refused_does_not_count_while_later_ones_wait(robot):
    """Its transform comes after its wait has ended, when one behind it still waits."""
    robot.at(1.1).see([(0.2, 1.4), (0.4, 1.4), (0.4, 1.8), (0.2, 1.8)], 1.1)  # on the robot
    robot.at(1.25).see(box(9), 1.25, 'camera', 2)
    robot.at(1.35).move(1.35)
    assert (len(robot.rejections), robot.monitor.waiting.counts()) == (1, {'lidar': 1})
    assert (robot.seen, robot.status()) == ([], 'unknown')


def test_obstacles_that_count_while_queued_are_bounded(robot):
    """By max_count, 5; beyond it the source is unknown until they were received."""
    robot.at(1.05).see(box(9), frame_id='camera')
    for k in range(6):
        robot.see(box(20 + k), 1.05, 'odom', 2 + k % 4)
    assert len(robot.seen) == 5 and 'too many obstacles' in robot.state().reasons[0]


MARKS = {'timeout': 5.0, 'set_end': 'empty_polygon'}


@pytest.mark.parametrize('source', [MARKS, {**MARKS, 'timeout': 0.0}, {'set_end': 'each_message'},
                                    {'type': 'polygon_collection'}],
                         ids=['marks', 'map', 'each message', 'collection'])
def test_later_whole_listing_needs_only_its_own_bodies_placed(source):
    """Also where the transform of its last one comes later; the body without one is refused."""
    for frame in 'odom', 'base':
        robot = Robot(replace(DRIVING, obstacles=(
            ObstacleSettings('lidar', '/polygons', **source),)))
        has_marks = 'timeout' in source
        robot.stand(0)
        robot.see(box(20), frame_id='camera')
        if has_marks:
            robot.see_all()
            robot.see(box(21), frame_id='odom')
        robot.see(box(22), frame_id=frame)
        if has_marks:
            assert robot.status() == 'unknown', 'its mark may end less than all'
            robot.see_all()
        if frame == 'base':
            assert robot.status() == 'unknown' and not robot.reasons
            robot.move(0.0)
        assert robot.status() == 'clear' and 'lidar' not in robot.monitor.waiting
        assert robot.reasons == [frames.UNKNOWN_FRAME]
        assert len(robot.seen) == 1 + has_marks


def test_mark_is_never_refused_for_its_frame():
    for frame in '', 'a' * 256, 'elsewhere':
        robot = Robot(SETS).stand(0)
        assert robot.see((), 0.0, frame) is None and robot.status() == 'clear'


def test_waiting_ends_after_transform_timeout(robot):
    """The refused obstacle makes the footprint unknown, with the reason."""
    robot.see(box(9), 1.0, 'odom')
    robot.at(1.05).see(box(9), frame_id='laser')
    assert robot.at(1.25).status() == 'clear'
    assert robot.at(1.2500001).status() == 'unknown' and robot.reasons == [frames.NO_TRANSFORM]
    text = robot.rejections[0].text
    assert text.startswith(
        'lidar: a message on /polygons was rejected, no transform: no transform from laser to odom'
        ' at its stamp: the newest of base is 0.05 s older; ')
    assert robot.scene.state('robot').reasons == (
        'obstacle source lidar on /polygons sent what was refused: no transform',)
    robot.move(1.3)
    robot.see(box(9), 1.25, 'laser')
    assert robot.status() == 'clear'


def test_deadline_of_a_waiting_message(robot):
    assert robot.monitor.deadline >= robot.now
    robot.at(1.05).see(box(9))
    assert robot.monitor.deadline == nanoseconds(1.25)


@pytest.mark.parametrize('name', ['robot', 'lidar'])
def test_message_from_the_future_in_another_frame_is_refused_at_once(robot, name):
    """As in the fixed frame, so the good ones behind it do not wait; the contact is seen."""
    instance = 1 if name == 'lidar' else None

    def outcome(frame):
        robot.rejections.clear()
        assert robot.send(name, box(9), 3600.0, frame, instance)
        return [one.text for one in robot.rejections], robot.state().reasons
    robot.see(box(0.5), None, 'odom')
    in_fixed = outcome('odom')
    assert outcome('base') == in_fixed and robot.status() != 'clear'
    assert robot.monitor.rejected == {(name, 'from the future'): 2}
    robot.see(box(0.5), 1.0, 'base')
    robot.send('robot', box(0), 1.0, 'base')
    assert robot.status() == 'collision' and not robot.monitor.waiting.counts()


def test_obstacle_from_the_future_behind_a_waiting_one_is_refused_at_once(robot):
    robot.see(box(9), 1.0, 'camera')
    robot.see(box(9), 2.01, 'base', 2)
    assert 'sent what was refused: from the future' in robot.state().reasons[0]


@pytest.mark.parametrize('time, frame, reasons', [
    (3600.0, 'odom', ['from the future']), (3600.0, 'base', ['from the future']),
    (-0.1, 'odom', [])], ids=['future', 'future, in another frame', 'older'])
def test_set_that_is_older_or_from_the_future_replaces_none_that_waits(time, frame, reasons):
    """The good one is placed once its transform comes."""
    robot = Robot(with_changes(SETS, 'lidar', timeout=2.0, set_end='each_message')).stand(0)
    robot.see(box(0.5), 0.0, 'base')
    robot.see(box(9), time, frame)
    assert robot.status() == 'unknown' and not robot.reasons
    assert robot.move(0.0).status() == 'collision' and robot.reasons == reasons


def test_map_behind_a_waiting_part_counts_whatever_its_stamp():
    """Its stamps are of before the clock was set back."""
    robot = Robot(with_changes(SETS, 'lidar', timeout=0.0)).stand(0)
    robot.see(box(9), 3600.0, 'camera')
    robot.see(box(0.5), 3600.0, 'odom')
    assert robot.monitor.waiting.counts() and robot.status() == 'collision'


def test_small_step_back_of_the_clock_makes_no_wait_longer(robot):
    robot.at(1.05).see(box(9))
    assert robot.at(0.65).monitor.deadline == nanoseconds(0.85)
    assert robot.at(0.8500001).reasons == [frames.NO_TRANSFORM]
    assert not robot.monitor.waiting.counts()


def test_waiting_counts_towards_the_age(robot):
    robot.at(1.05).see(box(9))
    robot.at(1.2).move(1.2)
    assert [len(robot.at(time).seen) for time in (1.2, 3.05, 3.0500001)] == [1, 1, 0]


@pytest.mark.parametrize('time, reason', [(-0.1, frames.NO_TRANSFORM), (1.3, frames.GAP)])
def test_transform_that_cannot_come_is_not_waited_for(robot, time, reason):
    robot.at(1.6).move(1.6)
    robot.see(box(9), time)
    assert robot.reasons == [reason] and 'lidar' not in robot.monitor.waiting
    assert robot.status() == 'unknown'


def test_footprint_waits_and_is_refused(robot):
    robot.see(box(9), 1.0, 'odom')
    robot.at(1.1).send('robot', box(0), 1.1, 'base')
    assert robot.status() == 'clear'
    assert robot.at(1.4).reasons == [frames.NO_TRANSFORM]
    assert robot.scene.state('robot').reasons == (
        'footprint robot on /footprint was refused: no transform',)


@pytest.mark.parametrize('most_bytes, waiting', [(10**6, 10), (400, 4)])
def test_messages_that_wait_are_limited_in_number_and_bytes(
        robot, monkeypatch, most_bytes, waiting):
    """To twice the max_count of a source; the first ones are refused, and the source unknown."""
    monkeypatch.setattr('sat_collision.messages.waiting._BYTES_WAIT', most_bytes)
    robot.at(1.01)
    for k in range(12):
        robot.see(box(9 + k), 1.01, instance=1 + k % 5)
    assert robot.monitor.waiting.counts() == {'lidar': waiting}
    assert robot.reasons == [frames.NO_TRANSFORM] * (12 - waiting)
    assert robot.monitor.rejected == {('lidar', frames.NO_TRANSFORM): 12 - waiting}
    assert robot.status() == 'unknown'


def test_loss_before_a_waiting_message():
    """It is counted when that message is received."""
    robot = Robot(SETS).move(0.0)
    robot.see(box(1), 0.1, 'base')
    robot.numbers['lidar'] += 1
    robot.see(box(2), 0.1, 'base')
    assert robot.monitor.scene.lost() == {}
    robot.time = 0.1
    robot.move(0.1)
    assert robot.monitor.scene.lost() == {'lidar': 1}
    assert len(robot.seen) == 2


def test_set_with_a_waiting_message_is_not_whole():
    """Even if its end has arrived."""
    robot = Robot(SETS).stand(0)
    robot.move(0.1)
    robot.at(0.1).see_all(box(0))
    robot.at(0.2).see(box(7), frame_id='odom')
    robot.see(box(0), 0.2, 'base')
    robot.see_all()
    assert robot.at(0.39).status() == 'collision'
    assert sorted(robot.seen) == [(0, 0, 1, 1), (7, 0, 8, 1)]
    robot.move(0.35, 0.2)
    # At 0.2 s, between 0.1 at 0.1 s and 0.2 at 0.35 s, the base was at 0.14.
    assert sorted(robot.seen) == [pytest.approx((0.14, 0, 1.14, 1)), (7, 0, 8, 1)]


def test_messages_received_together_do_not_overtake_one_that_waits():
    """Nothing numbers them; by their stamp they would end its set without it."""
    robot = Robot(with_changes(SETS, 'lidar', set_end='new_stamp', assume_no_loss=True))
    for frame in 5 * ['odom'] + ['base', 'odom']:
        robot.at(robot.time + 0.1).monitor.receive_batch(
            'lidar', 3 * [serialised(box(20), robot.now, frame)], robot.now)
    assert robot.monitor.waiting.counts() == {'lidar': 6}


def test_change_of_publishers_waits_for_their_messages():
    """The publisher has ended, but a set of it waits for a transform."""
    robot = Robot(SETS).stand(0)
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a')])
    robot.see_all(box(9), frame_id='base')
    robot.monitor.update_publishers('lidar', [])
    assert 'has no publisher' not in robot.scene.state('robot').reasons[0]
    assert robot.move(0.0).seen == [(9, 0, 10, 1)]
    assert 'has no publisher' in robot.scene.state('robot').reasons[0]


def test_messages_of_any_publisher_end_nothing_even_if_they_wait():
    """They came while a second publisher was matched, in a frame whose transform is late."""
    robot = Robot(SETS).stand(0)
    batch = [serialised(points, robot.now, 'base') for points in ((), box(9), ())]
    robot.monitor.receive_mixed('lidar', batch, robot.now)
    assert robot.move(0.0).seen == [(9, 0, 10, 1)]
    assert robot.status() == 'unknown'
    for number, points in ((7, ()), (8, box(8)), (9, ())):
        robot.monitor.receive('lidar', serialised(points, robot.now, 'odom'), robot.now, number)
    assert robot.status() == 'clear', 'all that follows is whole'


def test_footprint_of_stamp_0_behind_one_that_waits_counts_from_its_arrival(robot):
    """Not from when it leaves the queue, 0.2 s later: it is too old one timeout after it came."""
    robot.use('robot', timeout=0.5)
    robot.send('robot', box(0), 1.0, 'camera')
    robot.send('robot', box(0), 'none')
    for time, status in ((1.3, 'clear'), (1.51, 'unknown')):
        robot.at(time).see((), time)
        assert robot.status() == status


def test_obstacle_of_stamp_0_counts_from_its_arrival():
    """Not from when it is taken from the queue of the middleware."""
    robot = Robot(with_changes(SETS, 'robot', timeout=0.0)).stand(0)
    robot.at(3.0).monitor.receive_batch(
        'lidar', [serialised((), 0, 'odom')], robot.now, 1, arrived=nanoseconds(0.0))
    assert robot.status() == 'clear'
    assert robot.at(5.01).status() == 'unknown'


def test_transform_of_stamp_0_counts_from_its_arrival():
    robot = Robot()
    robot.at(1.0).monitor.receive_transforms(
        TF, transforms(('odom', 'base', 0, 1.0, 0.0)), robot.now, arrived=nanoseconds(0.25))
    assert robot.monitor.transforms.lookup_affine('base', 0, robot.now).at == nanoseconds(0.25)


def test_change_of_publishers_is_not_dropped_when_time_steps_back():
    """It waits behind messages, which are dropped; the middleware reports it only once."""
    robot = Robot(SETS)
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a'), Endpoint('b', '/b')])
    robot.see(box(9), 0.0, 'base')
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a')])
    assert 'has 2 publishers' in robot.scene.source_faults[0]
    assert 'publishers' not in robot.at(-5.0).scene.source_faults[0]


def test_disabled_source_drops_waiting_messages(robot):
    robot.at(1.05).see(box(9))
    robot.use('lidar', enabled=False)
    assert robot.move(1.1).seen == [] and not robot.rejections


@pytest.mark.parametrize('name', ['lidar', 'robot'])
def test_what_waited_before_it_was_disabled_never_counts(name):
    """Newer ones, which were ignored, may be in contact."""
    robot = Robot(with_changes(SETS, 'lidar', set_end='each_message', timeout=0.0))
    for other in {'lidar', 'robot'} - {name}:
        robot.send(other, box(0))
    robot.send(name, box(9), frame_id='base')
    robot.use(name, enabled=False)
    robot.send(name, box(0.5), frame_id='base')
    robot.use(name, enabled=True)
    assert robot.move(0.0).status() == 'unknown'
    robot.send(name, box(9))
    assert robot.status() == 'clear'


@pytest.mark.parametrize('steps', [[0.0], [0.5, 0.0]], ids=['one', 'two'])
def test_steps_back_in_time_drop_waiting_messages_and_transforms(robot, steps):
    """Static transforms stay."""
    robot.at(1.05).see(box(9))
    for time in steps:
        robot.at(time)
    assert 'lidar' not in robot.monitor.waiting
    robot.see((), -2.0)
    robot.see(box(9), 0.0, 'base')
    assert 'lidar' in robot.monitor.waiting
    assert robot.move(0.0, 100.0).seen == [(109, 0, 110, 1)]
    for time in (1.5, 3.1):
        assert robot.status() == 'unknown'
        robot.at(time).see(box(9), time, 'odom')
        robot.stand(0)
    assert robot.status() == 'clear' and not robot.rejections


def test_step_back_is_noticed_by_the_first_message(robot):
    """It is not placed by transforms from before the step."""
    robot.time = -0.5
    robot.see(box(9), -0.5, 'base')
    assert robot.seen == [] and 'lidar' in robot.monitor.waiting
    assert robot.at(-0.4).move(-0.5, 50.0).seen == [(59, 0, 60, 1)]

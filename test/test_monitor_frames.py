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

"""Bodies in frames that move: each is where it was at its own stamp, in the fixed frame."""

from dataclasses import replace
import math

from builders import box, serialised, transforms
from monitors import nanoseconds, START, World
import pytest
from sat_collision.messages.ingest import WAIT
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.monitor import Monitor, Waiting
from sat_collision.scene import frames
from sat_collision.scene.frames import BAD_TRANSFORM
from sat_collision.scene.settings import FootprintSettings, NEVER, ObstacleSettings, Settings
from sat_collision.scene.streams import Endpoint

SETTINGS = Settings(
    frame_id='odom', footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons', type='polygon_instance', max_count=5),))
SETS = replace(SETTINGS, obstacles=(ObstacleSettings('lidar', '/polygons', timeout=5.0),))


class Robot(World):
    """
    The monitor of a robot, whose fixed frame is odom.

    The robot moves by 1 m/s along x from 0 at 0 s and is as wide as a box of 1 m; its laser, 1 m
    before its origin, is turned to the left.
    """

    def __init__(self, settings=SETTINGS):
        super().__init__(settings)
        self.tell(TF_STATIC, ('base', 'laser', 0, 1.0, 0.0, math.pi / 2))

    def move(self, time, x=None):
        """Let the transform of the base at a time come now."""
        self.tell(TF, ('odom', 'base', nanoseconds(time), time if x is None else x, 0.0))

    def stand(self, x, time=None):
        """Send a footprint in the fixed frame."""
        assert self.send('robot', box(x), time) is None

    def know_all(self):
        """Receive of the source for its timeout until now."""
        for time in (self.time - 2.0, self.time):
            self.see((), time)

    def see(self, points, time, frame_id='laser', instance=1):
        return self.send('lidar', points, time, frame_id, instance)

    @property
    def seen(self):
        """The bounds of all obstacles."""
        return [polygon.bounds for _, polygon in self.scene.obstacles]


@pytest.fixture
def robot():
    """Return a robot whose place is known from 0 to 1 s, in an empty world."""
    robot = Robot()
    for k in range(11):
        robot.move(k / 10)
    robot.wait_until(1.0)
    robot.stand(0)
    robot.know_all()
    return robot


def test_an_obstacle_is_where_the_laser_was_at_its_stamp(robot):
    """What is 2 m to the right of the laser's axis lies ahead of the robot."""
    robot.see([(0, -2), (1, -2), (0, -3)], 0.35)
    assert robot.seen == [pytest.approx((3.35, 0.0, 4.35, 1.0), abs=1e-12)]
    robot.see([(0, -2), (1, -2), (0, -3)], 1.0)
    assert robot.seen == [pytest.approx((4.0, 0.0, 5.0, 1.0), abs=1e-12)]
    assert robot.status() == 'clear' and not robot.rejections


def test_a_footprint_in_its_own_frame_is_one_too():
    robot = Robot()
    robot.move(0.5)
    robot.move(1.0)
    robot.time = 1.0
    robot.know_all()
    robot.send('robot', box(0), 0.5, 'base')
    robot.see(box(1.75), 1.0, 'odom')
    assert robot.status() == 'clear'
    robot.send('robot', box(0), 0.75, 'base')
    assert robot.status() == 'collision'


def test_messages_in_the_fixed_frame_need_no_transform():
    """They are taken at once and bit for bit, whatever is known of frames."""
    robot = Robot()
    robot.stand(0)
    robot.see([(0.1, 0.3), (3, 7), (1 / 3, 5)], None, 'odom')
    (_, polygon), = robot.monitor.scene.obstacles
    assert polygon.vertices.tolist() == [
        [0.10000000149011612, 0.30000001192092896], [3, 7], [0.3333333432674408, 5]]
    assert 'lidar' not in robot.monitor.waiting


def test_what_is_not_convex_is_moved_too(robot):
    robot.see([(0, 0), (4, 0), (4, 4), (2, 1)], 1.0, 'base')
    (_, polygon), = robot.monitor.scene.obstacles
    assert polygon.vertices.tolist() == [[1, 0], [5, 0], [5, 4], [3, 1]]
    assert robot.status() == 'collision'


def test_a_message_waits_for_its_transform(robot):
    """What waits is not yet seen: what was there before stays."""
    robot.see(box(0.5), 1.0, 'odom')
    assert robot.status() == 'collision'
    robot.wait_until(1.05)
    assert robot.see(box(9), 1.05, 'base') is None
    assert robot.status() == 'collision' and 'lidar' in robot.monitor.waiting
    robot.wait_until(1.1)
    robot.move(1.1)
    assert robot.status() == 'clear' and 'lidar' not in robot.monitor.waiting
    assert robot.seen == [pytest.approx((10.05, 0, 11.05, 1))]


def test_messages_wait_in_order(robot):
    """The second one's frame is fixed, but it tells of later."""
    robot.wait_until(1.05)
    robot.see(box(9), 1.04, 'base')
    robot.see(box(0), 1.05, 'odom')
    assert robot.seen == []
    robot.wait_until(1.1)
    robot.move(1.1)
    assert robot.seen == [(0, 0, 1, 1)]


def test_patience_ends(robot):
    """The refused obstacle makes the footprint unknown, and says why."""
    robot.see(box(9), 1.0, 'odom')
    robot.wait_until(1.05)
    robot.see(box(9), 1.05, 'laser')
    robot.wait_until(1.25)
    assert robot.status() == 'clear'
    robot.wait_until(1.2500001)
    assert robot.status() == 'unknown' and robot.reasons == [frames.NO_TRANSFORM]
    text = robot.rejections[0].text
    assert text.startswith(
        'lidar: a message on /polygons was rejected, no transform: no transform from laser to odom'
        ' at its stamp: the newest of base is 0.05 s older; ')
    assert robot.monitor.scene.state('robot').reasons == (
        'obstacle source lidar on /polygons sent what was refused: no transform',)
    robot.move(1.3)
    robot.see(box(9), 1.25, 'laser')
    assert robot.status() == 'clear'


def test_waiting_ends_when_the_timeout_says_and_not_before(robot):
    assert robot.monitor.deadline >= robot.now
    robot.wait_until(1.05)
    robot.see(box(9), 1.05)
    assert robot.monitor.deadline == nanoseconds(1.25)


def test_waiting_is_part_of_the_age(robot):
    """An obstacle counts from its stamp, not from when it could be placed."""
    robot.wait_until(1.05)
    robot.see(box(9), 1.05)
    robot.wait_until(1.2)
    robot.move(1.2)
    assert robot.seen
    robot.wait_until(3.05)
    assert robot.seen
    robot.wait_until(3.0500001)
    assert not robot.seen


@pytest.mark.parametrize('time, reason', [(-0.1, frames.NO_TRANSFORM), (1.3, frames.GAP)])
def test_what_cannot_come_any_more_is_not_waited_for(robot, time, reason):
    robot.wait_until(1.6)
    robot.move(1.6)
    robot.see(box(9), time)
    assert robot.reasons == [reason] and 'lidar' not in robot.monitor.waiting
    assert robot.status() == 'unknown'


def test_tilted_frames_are_refused(robot):
    tilt = math.radians(6)
    robot.tell(TF_STATIC, ('base', 'ramp', 0, 0, 0, 0, 0, math.sin(tilt / 2), 0,
                           math.cos(tilt / 2)))
    robot.see(box(9), 1.0, 'ramp')
    assert robot.reasons == [frames.TILTED]
    assert 'ramp is tilted by 6.0 degrees in odom, more than 5' in robot.rejections[0].text


def test_a_frame_that_never_comes_is_named(robot):
    robot.see(box(9), 1.0, 'camera')
    robot.wait_until(1.3)
    assert robot.reasons == [frames.UNKNOWN_FRAME]
    assert 'no good transform has named camera yet' in robot.rejections[0].text


def test_a_footprint_waits_as_well_and_is_refused(robot):
    robot.see(box(9), 1.0, 'odom')
    robot.wait_until(1.1)
    robot.send('robot', box(0), 1.1, 'base')
    assert robot.status() == 'clear'
    robot.wait_until(1.4)
    assert robot.reasons == [frames.NO_TRANSFORM]
    assert robot.monitor.scene.state('robot').reasons == (
        'footprint robot on /footprint was refused: no transform',)


def test_stamp_zero_takes_the_newest_transform(robot):
    robot.see(box(1), 'none', 'base')
    assert robot.seen == [(2, 0, 3, 1)]


def test_stamp_zero_takes_no_newest_that_is_older_than_the_timeout(robot):
    """The timeout of the source is 2 s."""
    robot.wait_until(3.0)
    assert robot.see(box(1), 'none', 'base') is None
    robot.wait_until(3.001)
    assert robot.see(box(1), 'none', 'base').reason == frames.OLD_LATEST
    assert 'past the timeout by 0.001 s' in robot.rejections[0].text
    assert 'lidar' not in robot.monitor.waiting


def test_an_empty_polygon_is_nowhere_and_needs_no_transform(robot):
    robot.wait_until(2.5)
    robot.see([], 2.5, 'camera')
    robot.wait_until(4.5)
    robot.stand(0)
    assert robot.status() == 'clear' and not robot.rejections


def test_where_too_much_waits_the_first_are_refused(robot):
    """Of a source no more than twice its max_count waits."""
    robot.wait_until(1.01)
    for k in range(12):
        robot.see(box(9 + k), 1.01, instance=k % 5)
    assert robot.monitor.waiting.counts() == {'lidar': 10}
    assert robot.reasons == [frames.NO_TRANSFORM] * 2


def test_losses_count_where_they_happened():
    """What was lost before a message that waits is not before one that was there already."""
    robot = Robot(SETS)
    robot.move(0.0)
    robot.see(box(1), 0.1, 'base', None)
    robot.numbers['lidar'] += 1
    robot.see(box(2), 0.1, 'base', None)
    assert robot.monitor.lost == {}
    robot.time = 0.1
    robot.move(0.1)
    assert robot.monitor.lost == {'lidar': 1}
    assert len(robot.seen) == 2


def test_a_set_that_waits_is_not_whole():
    """One of it could be taken, and its end has come."""
    robot = Robot(SETS)
    robot.stand(0)
    robot.move(0.1)
    robot.wait_until(0.1)
    for points in (box(0), ()):
        robot.see(points, 0.1, 'odom', None)
    robot.wait_until(0.2)
    robot.see(box(7), 0.2, 'odom', None)
    robot.see(box(0), 0.2, 'base', None)
    robot.see((), 0.2, 'odom', None)
    robot.wait_until(0.39)
    assert robot.status() == 'collision'
    assert sorted(robot.seen) == [(0, 0, 1, 1), (7, 0, 8, 1)]
    robot.move(0.35, 0.2)
    # At 0.2 s, between 0.1 at 0.1 s and 0.2 at 0.35 s, the base was at 0.14.
    assert sorted(robot.seen) == [pytest.approx((0.14, 0, 1.14, 1)), (7, 0, 8, 1)]


def test_publishers_are_those_once_what_they_sent_is_taken():
    """The one that has ended sent a set that waits for a transform."""
    robot = Robot(SETS)
    robot.stand(0)
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a')])
    robot.see(box(9), 0.0, 'base', None)
    robot.see((), 0.0, 'odom', None)
    robot.monitor.update_publishers('lidar', [])
    assert 'has no publisher' not in robot.monitor.scene.state('robot').reasons[0]
    robot.move(0.0)
    assert robot.seen == [(9, 0, 10, 1)]
    assert 'has no publisher' in robot.monitor.scene.state('robot').reasons[0]


def test_the_disabled_receive_nothing_of_what_waited(robot):
    robot.wait_until(1.05)
    robot.see(box(9), 1.05)
    off = replace(SETTINGS.obstacles[0], enabled=False)
    robot.monitor.update(replace(SETTINGS, obstacles=(off,)))
    robot.move(1.1)
    assert robot.seen == [] and not robot.rejections


def test_a_jump_back_begins_anew(robot):
    """A bag that loops: what waits and what moves belongs to another time, the static stays."""
    robot.wait_until(1.05)
    robot.see(box(9), 1.05)
    robot.wait_until(0.0)
    assert 'lidar' not in robot.monitor.waiting
    robot.see((), -2.0)
    robot.see(box(9), 0.0, 'base')
    assert 'lidar' in robot.monitor.waiting
    robot.move(0.0, 100.0)
    assert robot.seen == [(109, 0, 110, 1)]
    robot.stand(0)
    assert robot.status() == 'clear' and not robot.rejections


def test_a_jump_back_is_seen_by_a_message_first(robot):
    """It must not be moved by what was received of that time before the jump."""
    robot.time = 0.5
    robot.see(box(9), 0.5, 'base')
    assert robot.seen == [] and 'lidar' in robot.monitor.waiting
    robot.wait_until(0.6)
    robot.move(0.5, 50.0)
    assert robot.seen == [(59, 0, 60, 1)]


def test_settings_change_while_it_runs(robot):
    robot.monitor.update(replace(SETTINGS, transform_timeout=1.0, max_tf_gap=0.05, max_tilt=0.2))
    robot.see(box(9), 0.55)
    assert robot.reasons == [frames.GAP]
    robot.see(box(9), 1.05)
    assert robot.monitor.deadline == nanoseconds(2.0)


def test_without_transforms_other_frames_are_refused_at_once():
    """Where there is no tf2_msgs, or no /tf in a recording."""
    monitor = Monitor(SETTINGS)
    rejection = monitor.receive('lidar', serialised(box(0), START, 'laser', 1), START)
    assert rejection.reason == 'other frame'


def test_a_refused_transform_is_told_with_its_frame(robot):
    robot.tell(TF, ('odom', 'base', nanoseconds(1.1), math.nan, 0.0),
               ('odom', 'arm', nanoseconds(1.1), 1, 2, 3, 0, 0, 0, 0),
               ('odom', 'cart', nanoseconds(1.1), 5.0, 0.0))
    assert [one.text for one in robot.rejections] == [
        '/tf: a message on /tf was rejected, not finite or no rotation: the transform of '
        f"'{child}' in 'odom' by an unknown publisher is ({numbers}); the publisher must send "
        'finite numbers and a quaternion that is not zero'
        for child, numbers in (('base', 'nan, 0, 0, 0, 0, 0, 1'),
                               ('arm', '1, 2, 3, 0, 0, 0, 0'))]
    assert robot.monitor.transforms.rejected == {
        ('base', BAD_TRANSFORM): 1, ('arm', BAD_TRANSFORM): 1}
    assert robot.see(box(0), 1.1, 'cart') is None and robot.seen == [(5, 0, 6, 1)]


def test_what_is_no_message_is_told(robot):
    robot.rejections += robot.monitor.receive_transforms(TF, b'\0\1\0\0\1\0\0\0', robot.now)
    assert robot.reasons == ['undecodable']
    assert robot.monitor.transforms.received == {TF: 12, TF_STATIC: 1}


@pytest.mark.parametrize('name', ('a\nb', '\x1b[31mred', 'c' * 200, "'; --"))
def test_names_of_strangers_reach_no_words_as_they_are(robot, name):
    """Neither a new line nor a colour, nor pages of letters."""
    robot.move(1.0)
    robot.tell(TF, (name, 'lost', nanoseconds(1.1), math.nan, 0.0),
               ('lost', name, nanoseconds(1.1), math.nan, 0.0), (name, 'island', robot.now, 0, 0),
               ('island', name, robot.now, 0, 0))
    robot.see(box(0), 1.0, name)
    robot.see(box(0), 1.0, 'island')
    robot.wait_until(2.0)
    assert frames.LOOP in robot.reasons
    words = [one.text for one in robot.rejections]
    words += [child for child, _ in robot.monitor.transforms.rejected]
    words += robot.monitor.scene.state('robot').reasons
    assert len(words) > 6 and all(word.isprintable() and len(word) < 600 for word in words)


def test_names_that_are_too_long_are_refused(robot):
    robot.tell(TF, ('odom', 'x' * 10**6, robot.now, 0.0, 0.0))
    assert robot.reasons == ['undecodable']
    assert robot.rejections[0].detail == 'a frame name of 1000001 bytes where 255 are accepted'


def test_who_makes_up_names_takes_a_bounded_part_of_the_memory(robot):
    """And frames that are known go on being received."""
    for k in range(110):
        robot.tell(TF, *((f'odom{k}', f'frame{k}_{i}', robot.now, 0.0, 0.0) for i in range(100)))
    assert set(robot.reasons) == {'too many frames'}
    assert len(robot.monitor.transforms.rejected) <= 101
    robot.wait_until(1.1)
    robot.move(1.1)
    assert robot.see(box(9), 1.1) is None and 'lidar' not in robot.monitor.waiting


def test_two_publishers_of_a_frame_are_noticed(robot):
    """By the numbers of their messages; one that begins again takes but one turn."""
    listener = robot.monitor.transforms
    for number in (7, 8, 9, 1, 2, 3):
        listener.receive(TF, transforms(('odom', 'base', robot.now, 0, 0)), robot.now, number)
    assert listener.turns == {'base': 1}
    for number in (4, 100, 5, 101, 6):
        listener.receive(TF, transforms(('odom', 'base', robot.now, 0, 0)), robot.now, number)
    assert listener.turns == {'base': 3}


class Desk:
    """Takes numbers that are at most `ready`, and notes what it is given."""

    def __init__(self):
        self.ready = 0
        self.taken = []
        self.waiting = Waiting(self.take)

    def take(self, name, item, now, may_wait):
        if item > self.ready and may_wait:
            return WAIT
        self.taken.append((name, item))
        return f'{item} gave up' if item > self.ready else None


def test_patience_ends_for_each_at_its_time():
    desk = Desk()
    desk.waiting.add('a', 5, 0, 10, 9)
    desk.waiting.add('a', 6, 4, 10, 9)
    assert desk.waiting.earliest == 10
    assert desk.waiting.take(10) == []
    assert desk.waiting.take(11) == ['5 gave up']
    assert desk.waiting.earliest == 14
    assert desk.waiting.take(15) == ['6 gave up']
    assert desk.waiting.earliest == NEVER


def test_what_is_dropped_is_not_taken():
    desk = Desk()
    desk.waiting.add('a', 5, 0, 10, 9)
    desk.waiting.drop()
    assert desk.waiting.take(99) == desk.taken == []
    assert desk.waiting.earliest == NEVER and 'a' not in desk.waiting

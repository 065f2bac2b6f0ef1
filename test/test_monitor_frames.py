# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bodies in moving frames are placed by the transform at their stamp; maps follow theirs."""

from dataclasses import replace
import math

from builders import box, serialised, transforms
from monitors import (
    DRIVING, nanoseconds, Robot, robot_that_sees_nothing, SETS, START, with_changes)
from moving_scenes import FIXED, MovingScene, OUTLINE, WINDOW, WINDOWS
import oracle
import pytest
from sat_collision.messages import transform_listener
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TF, TF_STATIC, TRANSFORM_TOPICS
from sat_collision.monitor import Monitor
from sat_collision.scene import frames
from sat_collision.scene.frames import BAD_TRANSFORM
from sat_collision.scene.settings import (
    BY_ANOTHER_CLOCK, FootprintSettings, ObstacleSettings, Settings)
from sat_collision.scene.streams import Endpoint


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
    robot = Robot().move(0.5)
    robot.move(1.0)
    robot.time = 1.0
    robot.see(box(1.75), 1.0, 'odom')
    for time, status in ((0.5, 'clear'), (0.75, 'collision')):
        robot.send('robot', box(0), time, 'base')
        assert robot.status() == status


def test_messages_in_the_fixed_frame_need_no_transform():
    """They are accepted at once and unchanged."""
    robot = Robot().stand(0)
    robot.see([(0.1, 0.3), (3, 7), (1 / 3, 5)], None, 'odom')
    (_, polygon), = robot.scene.obstacles
    assert polygon.vertices.tolist() == [
        [0.10000000149011612, 0.30000001192092896], [3, 7], [0.3333333432674408, 5]]
    assert 'lidar' not in robot.monitor.waiting


def test_non_convex_obstacle_is_placed(robot):
    robot.see([(0, 0), (4, 0), (4, 4), (2, 1)], 1.0, 'base')
    (_, polygon), = robot.scene.obstacles
    assert polygon.vertices.tolist() == [[1, 0], [5, 0], [5, 4], [3, 1]]
    assert robot.status() == 'collision'


def test_stamp_0_uses_the_newest_transform_until_it_is_past_the_timeout(robot):
    """The timeout of the source is 2 s."""
    robot.see(box(1), 'none', 'base')
    assert robot.seen == [(2, 0, 3, 1)]
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
    assert robot.at(4.5).stand(0).status() == 'clear' and not robot.rejections


def test_settings_of_transforms_can_be_changed_live(robot):
    robot.use(transform_timeout=1.0, max_tf_gap=0.05, max_tilt=0.2)
    robot.see(box(9), 0.55)
    assert robot.reasons == [frames.GAP]
    robot.see(box(9), 1.05)
    assert robot.monitor.deadline == nanoseconds(2.0)


def test_without_transforms_other_frames_are_refused_at_once():
    """Without tf2_msgs, or without /tf in a recording."""
    rejection = Monitor(DRIVING).receive('lidar', serialised(box(0), START, 'laser', 1), START)
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
    words += robot.scene.state('robot').reasons
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
    for numbers, turns in (((7, 8, 9, 1, 2, 3), 1), ((4, 100, 5, 101, 6), 3)):
        for number in numbers:
            listener.receive(TF, transforms(('odom', 'base', now, 0, 0)), now, number, now)
        assert listener.turns == {'base': turns}


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


# --- maps


MAP = with_changes(SETS, 'lidar', timeout=0.0)


def test_map_is_unknown_while_a_part_of_it_waits():
    """What waits may be in contact."""
    robot = Robot(MAP).stand(0)
    assert robot.see_all(box(9)).status() == 'clear'
    robot.see(box(0), 0.0, 'base')
    assert 'waits for the transform' in robot.state().reasons[0]
    assert robot.move(0.0, 30.0).status() == 'clear'


def map_robot(*link, settings=MAP):
    """Return a robot with a map that a frame with this transform has 50 m ahead of it."""
    robot = Robot(settings).stand(0)
    robot.receive_transforms(*link)
    assert robot.see_all(box(0), frame_id=link[1][1]).status() == 'clear'
    return robot


def test_map_follows_a_static_frame_that_is_corrected():
    robot = map_robot(TF_STATIC, ('odom', 'site', 0, 50.0, 0.0))
    robot.receive_transforms(TF_STATIC, ('odom', 'site', 0, 0.5, 0.0))
    assert robot.status() == 'collision' and robot.seen == [(0.5, 0, 1.5, 1)]
    assert robot.at(9.0).stand(0).status() == 'collision'


def test_map_follows_its_frame_though_many_of_as_many_polygons_came_before():
    """Those of a set would be received together by then."""
    robot = Robot(MAP).move(0.0)
    for _ in range(6):
        robot.see_all(box(9), box(19), box(29), frame_id='laser')
    before = robot.seen
    assert len(before) == 3
    robot.receive_transforms(TF_STATIC, ('base', 'laser', 0, 2.0, 0.0, math.pi / 2))
    assert [x for x, *_ in robot.seen] == pytest.approx([x + 1.0 for x, *_ in before])


def test_all_of_a_map_follows_when_a_transform_ahead_of_the_clock_comes_to_count():
    """The first part was placed before, by the transform before."""
    robot = Robot(MAP).stand(0)
    robot.move(0.0, 50.0, 'site')
    robot.move(0.5, 0.5, 'site')
    robot.see(box(0), frame_id='site')
    robot.at(0.6).see_all(box(9), frame_id='site')
    assert robot.status() == 'collision' and [x for x, *_ in robot.seen] == [0.5, 9.5]


def test_part_of_a_map_in_the_fixed_frame_stays():
    """Though its place in a set was before that of a part which followed its frame."""
    robot = map_robot(TF_STATIC, ('odom', 'site', 0, 50.0, 0.0))
    for frame_id in 3 * ['site'] + 3 * ['odom']:
        for x, sent_in in ((20, frame_id), (30, frame_id), (70, 'site')):
            robot.see(box(x), frame_id=sent_in)
        robot.see_all()
    robot.receive_transforms(TF_STATIC, ('odom', 'site', 0, 60.0, 0.0))
    assert [x for x, *_ in robot.seen] == [20, 30, 130]


def test_map_follows_a_moving_frame_and_is_unknown_without_it():
    """Once the last transform is older than the footprint's timeout, 1 s, and at a reset."""
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0))
    assert robot.at(1.0).stand(0).status() == 'clear'
    assert 'frame whose transform is too old' in robot.at(1.001).state().reasons[0]
    robot.at(1.2).move(1.1, 40.0, 'site')
    assert robot.status() == 'clear' and robot.seen == [(40, 0, 41, 1)]
    assert robot.move(1.2, 0.0, 'site').status() == 'collision'
    robot.at(-3.0).stand(20)
    assert 'is a map in another frame' in robot.state().reasons[0]


@pytest.mark.parametrize('link, changes, reason', [
    ((TF, ('odom', 'site', START, 50.0, 0.0)), {'name': 'robot', 'timeout': 0.5},
     'past the timeout by 0.4 s'),
    ((TF_STATIC, ('odom', 'site', 0, 50.0, 0.0, 0.0, 0.0, 0.04, 0.0, 0.9992)),
     {'max_tilt': 0.01}, 'tilted by')], ids=['timeout', 'tilt'])
def test_frame_of_a_map_counts_by_the_present_parameters(link, changes, reason):
    robot = map_robot(*link)
    robot.at(0.9).stand(0)
    before = robot.settings
    assert robot.use(**changes).status() == 'unknown' and reason in robot.state().reasons[0]
    robot.monitor.update(before)
    assert robot.status() == 'clear'


@pytest.mark.parametrize('enabled, status', [(True, 'unknown'), (False, 'clear')])
def test_enabled_footprints_limit_how_old_the_frame_of_a_map_may_be(enabled, status):
    cart = replace(MAP.footprints[0], name='cart', topic='/cart', timeout=0.2, enabled=enabled)
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0),
                      settings=replace(MAP, footprints=(*MAP.footprints, cart)))
    assert robot.at(0.9).stand(0).status() == status


def test_frame_in_which_a_map_was_sent_does_not_matter_for_the_next():
    """Though /tf is silent, so that nothing else tells of frames."""
    robot = map_robot(TF, ('odom', 'site', START, 50.0, 0.0))
    robot.at(2.0).stand(0)
    robot.see(box(9), frame_id='odom')
    assert 'too old' in ''.join(robot.state().reasons)
    assert robot.see_all().status() == 'clear'


@pytest.mark.parametrize('frame_id, topic, link', [
    ('laser', TF, ('odom', 'base')), ('map', TF_STATIC, ('odom', 'map'))])
def test_map_is_requested_again_once_its_transform_has_come(frame_id, topic, link):
    """A latched map is sent only once, and at the start transforms may come later."""
    robot = Robot(with_changes(DRIVING, 'lidar', timeout=0.0, set_end='empty_polygon'))
    robot.see(box(9), 'none', frame_id)
    robot.at(5.0).see((), 'none', frame_id)
    assert len(robot.reasons) == 1 and not robot.scene.wants_history('lidar')
    robot.receive_transforms(TF, ('odom', 'elsewhere', robot.now, 0.0, 0.0))
    assert not robot.scene.wants_history('lidar')
    robot.receive_transforms(topic, (*link, robot.now, 0.0, 0.0))
    assert robot.scene.wants_history('lidar')
    robot.scene.renew('lidar')
    robot.numbers['lidar'] = 0
    robot.send_map('lidar', box(9))
    assert not robot.scene.source_faults and not robot.scene.wants_history('lidar')


@pytest.mark.parametrize('is_disabled', [False, True], ids=['renewed', 'disabled'])
def test_older_map_does_not_stand_in_for_one_that_waited_when_it_was_dropped(is_disabled):
    """The new subscription receives both again, the older one first."""
    robot = Robot(MAP).stand(0)
    robot.monitor.update_publishers('lidar', [Endpoint('a', '/a')])

    def see(*numbers):
        for number in numbers:
            data = serialised((box(20), (), box(0.5), ())[number - 1], robot.now,
                              'base' if number == 3 else 'odom')
            robot.monitor.receive('lidar', data, robot.now, number)
    see(1, 2, 3, 4)
    for enabled in (False, True) if is_disabled else ():
        robot.use('lidar', enabled=enabled)
    robot.monitor.renew('lidar')
    see(1, 2)
    assert robot.status() == 'unknown'
    robot.move(0.0)
    see(3, 4)
    assert robot.status() == 'collision'


def test_older_map_does_not_stand_in_for_one_that_waited_when_time_stepped_back():
    """It is requested again once its transform has come."""
    robot = Robot(with_changes(MAP, 'lidar', set_end='each_message')).stand(0)
    robot.see(box(20), frame_id='odom')
    assert robot.status() == 'clear'
    robot.see(box(0.5), frame_id='base')
    assert robot.at(-5.0).stand(0).status() == 'unknown'
    assert not robot.scene.wants_history('lidar')
    robot.move(-5.0)
    assert robot.scene.wants_history('lidar')


# --- random scenes


BEGIN = 1_700_000_000 * 10**9
POINTS = tuple(number for corner in OUTLINE for number in (corner.real, corner.imag))
TWO_FOOTPRINTS = Settings(
    frame_id=FIXED, transform_timeout=1.0,
    footprints=(FootprintSettings('robot', '/footprint', timeout=0.0),
                FootprintSettings('cart', TF, timeout=0.0, frame_id='base', rate=1000.0,
                                  points=POINTS)),
    obstacles=(ObstacleSettings('seen', '/obstacles', type='polygon_instance', timeout=60.0,
                                assume_no_loss=True),))
NAMES = {'/footprint': 'robot', '/obstacles': 'seen'}


class Playback:
    """A monitor that receives events."""

    def __init__(self, events):
        self.monitor = Monitor(TWO_FOOTPRINTS, transforms=True)
        self.rejections = self.monitor.advance(BEGIN - 70 * 10**9)
        # The source is known from the start, by messages over its timeout and future_tolerance.
        for ago in (61.1, 30.0, 0.0):
            time = BEGIN - round(ago * 1e9)
            self.monitor.receive('seen', serialised((), time, FIXED, 0), time)
        self._events = list(reversed(events))

    def until(self, time):
        """Receive all events up to a time, and check the contacts after each."""
        while self._events and self._events[-1].time <= time:
            at, topic, data = self._events.pop()
            now = BEGIN + round(at * 1e9)
            if topic in TRANSFORM_TOPICS:
                self.rejections += self.monitor.receive_transforms(topic, data, now)
            else:
                self.monitor.receive(NAMES[topic], data, now)
            self.check_contacts()
        self.rejections += self.monitor.advance(BEGIN + round(time * 1e9))
        self.check_contacts()

    @property
    def bodies(self):
        """The vertices of footprints by name and of obstacles by id."""
        scene = self.monitor.scene
        return {**{name: polygon.vertices for name, polygon in scene.footprints},
                **{obstacle.key: polygon.vertices for obstacle, polygon in scene.obstacles}}

    def contacts(self, name):
        return {obstacle.key for obstacle in self.monitor.scene.state(name).contacts}

    def check_contacts(self):
        """
        Compare the contacts of each footprint with exact ones of the stored vertices.

        An obstacle that is queued behind one that waits counts beside the last one of its id.
        """
        obstacles = [*self.monitor.scene.obstacles]
        for name, polygon in self.monitor.scene.footprints:
            meet = obstacles and oracle.intersects_pairs(
                [(polygon.vertices, other.vertices) for _, other in obstacles])[0]
            assert self.contacts(name) == {
                obstacle.key for (obstacle, _), meets in zip(obstacles, meet) if meets}


def near(vertices, truth):
    """Tell whether each corner has a vertex near it, up to single precision."""
    points = [complex(x, y) for x, y in vertices.tolist()]
    return len(points) == len(truth) and all(
        min(abs(point - corner) for point in points) < 2e-4 for corner in truth)


@pytest.mark.parametrize('seed', [
    *range(6), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(6, 25))])
def test_states_are_those_of_the_fixed_frame(seed):
    """
    With any frames, rates of /tf, delays and orders of arrival.

    Once transforms and bodies have arrived, all bodies are where they truly were; contacts are
    exact for the stored vertices at all times.
    """
    scene = MovingScene(seed, BEGIN)
    moving, fixed = Playback(scene.moving), Playback(scene.fixed)
    touched, statuses = 0, set()
    for window in range(WINDOWS):
        end = (window + 1) * WINDOW
        moving.until(end)
        fixed.until(end)
        assert moving.monitor.waiting.counts() == {}
        truth = {**scene.truth[window], 'cart': scene.outline(end)}
        for playback in (moving, fixed):
            assert playback.bodies.keys() == truth.keys()
            assert all(near(playback.bodies[name], ring) for name, ring in truth.items())
        for name in ('robot', 'cart'):
            assert moving.contacts(name) == fixed.contacts(name)
            assert (moving.monitor.scene.status(name) is fixed.monitor.scene.status(name))
            touched += len(moving.contacts(name))
            statuses.add(moving.monitor.scene.status(name).value)
    assert touched and statuses == {'clear', 'collision'}
    assert not moving.rejections and not fixed.rejections
    assert not moving.monitor.rejected

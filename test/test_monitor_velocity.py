# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The velocity of a footprint: by transforms, odometry, its messages, or as it is commanded."""

from dataclasses import replace
import math

from bodies import first_contact, where
from builders import box, command, odometry, SECOND, serialised
from monitors import MAP, MapWorld, nanoseconds, OUTLINE, START
import numpy as np
import pytest
from sat_collision.messages.cdr import stamped
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene.parameters import check_outlines, ParameterError
from sat_collision.scene.settings import FootprintSettings, Settings, TF
from shapely import affinity
from shapely.geometry import Polygon
from test_monitor_outlines import BY_ODOMETRY, OutlineWorld, ROBOT


def test_velocity_by_transforms():
    """Tracked on request, after two poses, here on an arc; reset by a step back in time."""
    world = OutlineWorld().move(0.1, 0.0)
    assert world.move(0.2, 0.1).scene.velocity('robot') == ''
    world.scene.tracks_motion = True
    assert world.move(0.3, 0.2).scene.velocity('robot') == ''
    world.move(0.4, 0.3, yaw=0.05)
    twist, pose, origin, _ = world.scene.velocity('robot')
    assert twist[2] == pytest.approx(0.5) and pose == pytest.approx((0.3, 0.0, 0.0))
    assert math.hypot(*twist[:2]) == pytest.approx(1.0, rel=1e-3) and origin == 'transforms'
    world.at(-1.0).move(-0.9, 5.0)
    assert world.scene.velocity('robot') == ''


def test_velocity_by_odometry():
    """In the message's child frame, to which the outline's frame may be fixed."""
    world = OutlineWorld(replace(ROBOT, odometry='odometry', frame_id='body'), tracks_motion=True)
    world.receive_transforms(TF_STATIC, ('base', 'body', 0, 0.5, 0.0))
    world.receive_odometry(0.1, 1.0, 2.0, 0.5, twist=(0.7, 0.1, -0.2))
    assert world.scene.velocity('robot') == (
        (0.7, 0.1, -0.2), pytest.approx((1.0, 2.0, 0.5)), 'odometry', False)
    world.receive_odometry(0.2, 1.1, 2.0, 0.5, twist=(math.nan, 0.0, 0.0))
    assert world.scene.velocity('robot')[2] == 'transforms'


@pytest.mark.parametrize('by', [{'odometry': '/odom'}, {'cmd_vel': '/command'}, {}],
                         ids=['odometry', 'command', 'transforms'])
def test_velocity_in_a_frame_that_is_upside_down(by):
    """To the right and turning right, in a frame with y to the right and z down."""
    world = OutlineWorld(replace(ROBOT, **by), tracks_motion=True)
    world.receive_transforms(TF_STATIC, ('odom', 'ned', 0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    for time in (0.0, 0.1):
        if 'odometry' in by:
            world.receive_odometry(time, 0.0, time, 0.2 * time, parent='ned', twist=(0, 1.0, 0.2))
        else:
            world.move(time, 0.0, time, 0.2 * time, parent='ned')
    if 'cmd_vel' in by:
        world.monitor.receive('robot.cmd_vel', command(0, 1.0, 0.2, world.now), world.now)
    after = world.scene.velocity('robot').carry(world.scene.polygon('robot').vertices, 0.01)
    world.move(0.11, 0.0, 0.11, 0.022, parent='ned')
    assert after == pytest.approx(world.scene.polygon('robot').vertices, abs=1e-3)


def test_odometry_of_a_base_gives_no_velocity_of_what_turns_on_it():
    """The base stands, by its odometry, and a turret turns on it by 1 rad/s."""
    world = OutlineWorld(replace(ROBOT, odometry='odometry', frame_id='turret'),
                         tracks_motion=True)
    for k in range(5):
        time = 0.1 * k
        world.receive_transforms(TF, ('base', 'turret', nanoseconds(time), 0.0, 0.0, time))
        world.receive_odometry(time, 1.0, 2.0, twist=(0.0, 0.0, 0.0))
    twist, _, origin, _ = world.scene.velocity('robot')
    assert (twist, origin) == (pytest.approx((0.0, 0.0, 1.0), abs=1e-6), 'transforms')


def test_old_odometry_gives_no_velocity():
    """It said that the robot stands and is silent; another publisher moves its frame at 1 m/s."""
    world = OutlineWorld(replace(ROBOT, odometry='odometry'), tracks_motion=True)
    world.receive_odometry(0.0, 0.0, twist=(0.0, 0.0, 0.0))
    origins = []
    for k in range(1, 12):
        world.move(k / 5, k / 5)
        origins.append(world.scene.velocity('robot')[2])
    assert origins == 5 * ['odometry'] + 6 * ['transforms']


def test_changed_outline_is_no_motion():
    """It is shifted back by 0.1 m while the robot drives at 1 m/s."""
    world = OutlineWorld(tracks_motion=True)
    for k in range(3):
        world.move(k / 10, k / 10)
    world.use('robot', points=tuple(v - 0.1 * (k % 2 == 0) for k, v in enumerate(ROBOT.points)))
    assert world.scene.velocity('robot') == ''
    world.move(0.3, 0.3)
    assert world.scene.velocity('robot')[0] == pytest.approx((1.0, 0.0, 0.0), abs=1e-6)


def test_velocity_in_a_static_frame_is_0():
    world = OutlineWorld(tracks_motion=True)
    world.receive_transforms(TF_STATIC, ('odom', 'base', 0, 3.0, 0.0))
    assert world.scene.velocity('robot').twist == (0, 0, 0)


def test_velocity_of_a_published_footprint():
    """By two messages with the same shape, even if rotation changes the first vertex."""
    monitor = Monitor(Settings(frame_id='', footprints=(FootprintSettings('robot', '/robot'),),
                               obstacles=(MAP,)))
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
        pytest.approx((1, 0, 0)), pytest.approx((0.7, 0.5, 0)), 'footprints', False)
    assert velocity(0.7, square[:3]) == ''


def test_velocity_of_what_was_last_seen_long_ago_is_unknown():
    """However long the footprint itself counts; but not if it rests."""
    monitor = Monitor(Settings(frame_id='', obstacles=(MAP,), footprints=tuple(
        FootprintSettings(name, f'/{name}', timeout=0.0) for name in ('robot', 'resting'))))
    monitor.scene.tracks_motion = True
    for time in (0.0, 0.5):
        stamp = nanoseconds(time)
        for name, x in (('robot', time), ('resting', 3.0)):
            assert monitor.receive(name, serialised([(x, 0), (x + 1, 0), (x, 1)], stamp),
                                   stamp) is None
    for age, known in ((2.0, (pytest.approx((1, 0, 0)), (0, 0, 0))), (2.1, (None, (0, 0, 0)))):
        monitor.advance(nanoseconds(0.5 + age))
        found = [monitor.scene.velocity(name) for name in ('robot', 'resting')]
        assert tuple(getattr(one, 'twist', None) for one in found) == known
    assert found[0] == 'its last place is of 2.1 s ago'


def test_footprints_that_share_odometry_have_its_last_velocity():
    """
    Each receives every message; the first to do so moves both.

    One stamped ahead, or before the clock went back a little, does not shut out the next.
    """
    world = OutlineWorld(BY_ODOMETRY, replace(BY_ODOMETRY, name='load'), tracks_motion=True)
    for time, speed, ahead in ((1.1, 0.0, 0.9), (1.2, 1.0, 0.0), (0.9, 2.0, 0.0)):
        world.at(time)
        data = odometry('odom', 'base', nanoseconds(time + ahead), time, 0.0,
                        twist=(speed, 0.0, 0.0))
        for name in ('robot', 'load'):
            assert world.receive(name, data) is None
        for name in ('robot', 'load'):
            assert world.scene.velocity(name).twist == (speed, 0.0, 0.0)


# --- commands, which replace the measured velocity in predictions


COMMANDED = replace(ROBOT, points=OUTLINE, cmd_vel='/cmd_vel')


class Driven(MapWorld):
    """A monitor of a robot with commands among obstacles."""

    def __init__(self, *polygons, **robot):
        super().__init__((replace(COMMANDED, **robot),), *polygons, tracks_motion=True)

    def drive(self, *twist, age=None, **more):
        """Receive a command, stamped if it has an age in s; return why it is refused."""
        stamp = 0 if age is None else self.now - round(age * SECOND)
        return self.order(command(*twist, stamp=stamp, **more))

    def order(self, data):
        """Receive the bytes of a command; return why they are refused."""
        rejection = self.receive('robot.cmd_vel', data)
        return rejection and rejection.text

    @property
    def velocity(self):
        """The velocity in the values of ~/state."""
        return self.value('velocity')


AHEAD = box(2.5, -0.5)


def test_command_counts_instead_of_the_measured_velocity():
    """The robot drives away from the wall while it is commanded towards it, and vice versa."""
    world = Driven(AHEAD).move(0.0, 0.0)
    world.move(0.1, -0.1)
    assert world.prediction is None and world.velocity == 'unknown: no command on /cmd_vel yet'
    assert world.drive(0.5) is None
    assert world.prediction.seconds == math.inf
    assert world.drive(1.0) is None
    assert world.prediction.seconds == pytest.approx(2.1, abs=2e-3)
    assert world.velocity == '1.000 m/s, 0.000 m/s, 0.000 rad/s by command'
    assert world.drive(-1.0) is None
    assert world.move(0.2, 0.0).prediction.seconds == math.inf
    assert world.drive(0.0) is None
    assert world.prediction.seconds == math.inf
    assert world.velocity == '0.000 m/s, 0.000 m/s, 0.000 rad/s by command'


def test_command_is_in_the_frame_of_the_robot():
    """It faces along y, so its left is -x; one pose is enough."""
    world = Driven(box(-3.25, 0.0)).move(0.0, 0.0, yaw=math.pi / 2)
    world.drive(0.0, 1.0)
    assert world.prediction.seconds == pytest.approx(2.0, abs=2e-3)
    world.drive(1.0, 0.0)
    assert world.prediction.seconds == math.inf
    assert world.prediction.velocity.pose == pytest.approx((0.0, 0.0, math.pi / 2))


def test_command_before_the_first_pose():
    world = Driven(AHEAD)
    world.drive(1.0)
    assert world.prediction is None and world.velocity == 'unknown'
    assert world.move(0.1, 0.0).prediction.seconds == pytest.approx(2.0, abs=2e-3)


@pytest.mark.parametrize(('timeout', 'lasts'), [(0.5, 0.5), (1.0, 1.0), (9.0, 2.0), (0.0, 2.0)])
def test_command_expires(timeout, lasts):
    """After the footprint's timeout, but at most two seconds; commands of 0, too."""
    world = Driven(AHEAD, timeout=timeout, min_time_to_collision=5.0).move(0.0, 0.0)
    for speed in (1.0, 0.0):
        world.move(world.time + 0.1, 0.0)
        world.drive(speed)
        sent = world.time
        assert world.move(sent + lasts - 0.01, 0.0).prediction is not None
        assert world.status() == ('imminent' if speed else 'clear')
        assert world.scene.state('robot').reasons == ((
            'moving as it is told to, it is in contact within min_time_to_collision, 5 s',
        ) if speed else ())
        world.move(sent + lasts + 0.01, 0.0)
        assert world.status() == 'clear' and world.prediction is None
        assert world.velocity == f'unknown: no command on /cmd_vel for {lasts:.1f} s'


def test_command_expires_from_its_stamp():
    world = Driven(AHEAD, timeout=0.5).move(0.0, 0.0)
    assert world.drive(1.0, age=0.4) is None and world.prediction.seconds < 3.0
    world.move(0.2, 0.0)
    assert world.velocity == 'unknown: no command on /cmd_vel for 0.6 s'
    assert world.drive(1.0, age=-0.5) is None and world.prediction.seconds < 3.0
    assert world.move(0.65, 0.0).prediction.seconds < 3.0
    assert world.move(0.75, 0.0).prediction is None


# More than an hour after stamp 0.
LATER = START + 4000 * SECOND


@pytest.mark.parametrize(('data', 'reason', 'detail'), [
    (command(math.nan), 'no velocity of a robot', 'nan m/s, 0 m/s, 0 rad/s; the publisher must '),
    (command(0.0, -math.inf), 'no velocity of a robot', '0 m/s, -inf m/s, 0 rad/s; '),
    (command(0.0, 0.0, 1001.0), 'no velocity of a robot', '0 m/s, 0 m/s, 1001 rad/s; '),
    (command(1.0, frame_id='odom'), 'command in another frame',
     "it is in 'odom', the outline in 'base'; "),
    (command(1.0, stamp=LATER - SECOND), 'too old', 'its stamp is 1.100 s old, past the timeout '),
    (command(1.0, stamp=1), 'too old', 'more than an hour from the clock of this node'),
    (command(1.0, stamp=-1), 'too old', 'more than an hour from the clock of this node'),
    (command(1.0, stamp=LATER + 9 * SECOND), 'from the future', 'its stamp is 8.900 s ahead of '),
    (command(1.0)[:-1], 'undecodable', 'ends before its twist does'),
    (command(1.0) + bytes(4), 'undecodable', '72 bytes where the contents need 68'),
    (b'', 'undecodable', "0 bytes that begin with '' are not a message"),
    (stamped(b'\0\1\0\0' + bytes(40)), 'undecodable', 'ends before its twist does')],
    ids=['nan', 'infinite', 'too fast', 'frame', 'late', 'clock', 'before 0', 'future', 'cut off',
         'too long', 'nothing', 'cut off Twist'])
def test_refused_command_makes_the_velocity_unknown(data, reason, detail):
    """The previous command no longer counts, since the robot may have accepted this one."""
    world = Driven(AHEAD, min_time_to_collision=2.5).move(4000.1, 0.0)
    world.drive(1.0)
    assert world.status() == 'imminent'
    text = world.order(data)
    assert text.startswith(f'robot.cmd_vel: a message on /cmd_vel was rejected, {reason}: ')
    assert detail in text
    assert world.monitor.rejected == {('robot.cmd_vel', reason): 1}
    assert world.monitor.received['robot.cmd_vel'] == 2
    assert world.prediction is None and world.status() == 'clear'
    assert world.velocity == (f'unknown: the last command on /cmd_vel was refused: {reason}')
    world.drive(1.0, frame_id='base')
    assert world.status() == 'imminent'


def test_last_command_counts_whatever_its_stamp():
    """Several publishers may take turns, with different clocks."""
    world = Driven(AHEAD).move(0.1, 0.0)
    world.drive(0.0, age=0.0)
    world.drive(1.0, age=0.3)
    assert world.prediction.seconds < 3.0


def test_step_back_in_time_drops_commands():
    world = Driven(AHEAD).move(5.0, 0.0)
    world.drive(1.0)
    world.at(0.1).move(0.2, 0.0)
    assert world.prediction is None and world.velocity.endswith('no command on /cmd_vel yet')


def test_first_command_after_a_step_back_in_time_counts():
    world = Driven(AHEAD).move(5.0, 0.0)
    world.time = 0.1
    assert world.drive(1.0) is None
    world.move(0.2, 0.0)
    assert world.velocity.startswith('1.000 m/s')


def test_commands_of_a_disabled_footprint_are_ignored():
    world = Driven(AHEAD, enabled=False)
    assert world.drive(math.nan) is None and not world.monitor.rejected


def test_command_of_before_it_was_disabled_does_not_count():
    """It was told to stand; while it is disabled it is told to go on."""
    world = Driven(AHEAD, timeout=2.0).move(0.0, 0.0)
    world.drive(0.0)
    world.use('robot', enabled=False)
    world.drive(1.0)
    world.use('robot', enabled=True)
    world.move(0.3, 0.3)
    assert world.prediction is None and world.velocity.endswith('no command on /cmd_vel yet')


def test_commands_need_an_outline():
    with pytest.raises(ParameterError, match=r'give robot\.points or robot\.radius, and robot'):
        check_outlines(Settings(
            footprints=(FootprintSettings('robot', '/robot', cmd_vel='/cmd_vel'),),
            obstacles=(MAP,)))


@pytest.mark.parametrize('seed', range(6))
def test_no_time_by_command_is_late(seed):
    """Random commands, poses and ages, against small steps with shapely."""
    rng = np.random.default_rng(seed)
    obstacles = [Polygon(rng.uniform(-0.4, 0.4, (3, 2)) + rng.uniform(-4, 4, 2)).convex_hull
                 for _ in range(8)]
    world = Driven(*(list(one.exterior.coords)[:-1] for one in obstacles))
    obstacles = [Polygon(np.float32(one.exterior.coords)) for one in obstacles]
    found = 0
    for _ in range(40):
        x, y, yaw = *rng.uniform(-4, 4, 2), rng.uniform(-4, 4)
        vx, vy, omega = *rng.uniform(-2, 2, 2), rng.choice([0.0, rng.uniform(-2, 2)])
        if rng.random() < 0.5:
            world.drive(vx, vy, omega)
        world.move(world.time + 0.1, x, y, yaw)
        world.drive(vx, vy, omega)
        world.at(world.time + rng.uniform(0.0, 0.9))
        age = (world.now - world.scene._footprints['robot'].time) / SECOND
        if world.status() == 'collision':
            continue
        # In the frame of the robot.
        ahead = [affinity.rotate(affinity.translate(one.buffer(-2e-3), -x, -y), -yaw, (0, 0),
                                 use_radians=True) for one in obstacles]
        steps = np.arange(0.0, 3.0 + age, 0.02)
        own = where(Polygon(np.reshape(OUTLINE, (4, 2))), (vx, vy, omega), steps)
        touched = first_contact(steps, own, ahead)
        seconds = world.prediction.seconds
        if touched - age < 3.0:
            assert seconds <= max(touched - age, 0.0), 'late'
        if seconds < math.inf:
            found += 1
            there = world.prediction.velocity.carry(
                np.array(world.scene.footprints[0][1].vertices), world.prediction.duration)
            assert min(map(Polygon(there).distance, obstacles)) < 2e-3, 'early'
            assert touched == math.inf or touched - age - seconds <= 0.02 + 0.1, 'early'
    assert found > 5

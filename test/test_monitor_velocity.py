# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The velocity of a footprint: by transforms, odometry, commands or its messages."""

from dataclasses import replace
import math

from builders import command, odometry, serialised
from monitors import nanoseconds
import pytest
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, Settings, TF
from test_monitor_outlines import BY_ODOMETRY, OutlineWorld, ROBOT, SOURCE


def test_velocity_by_transforms():
    """Tracked on request, after two poses, here on an arc; reset by a step back in time."""
    world = OutlineWorld()
    world.move(0.1, 0.0)
    world.move(0.2, 0.1)
    assert world.scene.velocity('robot') == ''
    world.scene.tracks_motion = True
    world.move(0.3, 0.2)
    assert world.scene.velocity('robot') == ''
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
    world = OutlineWorld(replace(ROBOT, odometry='odometry', frame_id='turret'))
    world.scene.tracks_motion = True
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
        pytest.approx((1, 0, 0)), pytest.approx((0.7, 0.5, 0)), 'footprints', False)
    assert velocity(0.7, square[:3]) == ''


def test_velocity_of_what_was_last_seen_long_ago_is_unknown():
    """However long the footprint itself counts; but not if it rests."""
    monitor = Monitor(Settings(frame_id='', obstacles=(SOURCE,), footprints=tuple(
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

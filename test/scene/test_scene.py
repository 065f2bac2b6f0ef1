# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a scene of one or two footprints receives, and what it reports."""

from dataclasses import replace

from builders import box, SECOND, serialised
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.scene import OVERTAKEN
from sat_collision.scene.settings import FootprintSettings, Settings
from sat_collision.scene.sources import TOO_OLD as OLD_OBSTACLE
from stage import (
    CART, clear_stage, LIDAR, NOT_RECEIVED, NOTHING_SENT, RADAR, ROBOT, Stage, status_and_reasons,
    TOO_OLD, UNTIMED_LIDAR, UNTIMED_ROBOT)


def test_everything_is_unknown_before_any_message():
    stage = Stage()
    state = stage.state()
    assert stage.status() == 'unknown'
    assert state.contacts == ()
    assert state.reasons == (NOT_RECEIVED, NOTHING_SENT)
    assert state.age is None


def test_obstacle_moves_into_contact_and_away():
    stage = clear_stage()
    for time, x, status in ((0.1, 5, 'clear'), (0.2, 1, 'collision'), (0.3, 0.3, 'collision'),
                            (0.4, -1.01, 'clear')):
        stage.at(time).see(x)
        stage.end()
        assert stage.status() == status


def test_footprint_moves_into_contact_and_away():
    stage = Stage()
    stage.send(0, 4, 5)
    for x, keys in ((2, []), (3, [1]), (4.5, [1, 2]), (6.5, []), (0, [0])):
        stage.robot(x)
        assert stage.state().contacts == tuple(ObstacleId('lidar', key) for key in keys)
        assert stage.status() == ('collision' if keys else 'clear')


def test_contacts_are_sorted_by_source_and_key():
    stage = Stage(RADAR, LIDAR)
    stage.robot()
    stage.send(0.1, 9, 0.2, name='radar')
    stage.send(0.3)
    assert [str(obstacle) for obstacle in stage.state().contacts] == [
        'lidar/0', 'radar/0', 'radar/2']


def test_each_footprint_has_its_own_status():
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot(0)
    stage.robot(5, name='cart')
    stage.send(5.5)
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'collision')


def test_disabled_scene_is_unknown_but_still_receives():
    stage = clear_stage()
    stage.scene.update(replace(stage.settings, enabled=False))
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == ('checking is disabled',)
    stage.scene.update(stage.settings)
    assert stage.status() == 'collision'


def test_unknown_until_the_clock_starts():
    """With use_sim_time the time is 0 until /clock arrives; a map received before that is kept."""
    stage = Stage(UNTIMED_LIDAR, start=0.0)
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons[0].startswith('no clock yet')
    assert stage.state().reasons[0].endswith('publish /clock, or set use_sim_time to false')
    assert stage.scene.take_changes().changed == ['robot']
    stage.start = 1000.0
    assert stage.at(0.0).scene.take_changes().changed == ['robot']
    assert stage.state().reasons[0] == TOO_OLD
    stage.robot()
    assert stage.status() == 'collision'


def test_stamp_before_0_is_old():
    """Only 0 itself means that there is no stamp."""
    stage = clear_stage()
    assert stage.robot(1.0, stamp=-1005.0) == OVERTAKEN
    assert stage.see(0.5, stamp=-1005.0) == OLD_OBSTACLE
    stage.at(2.001).robot(stamp=-1005.0)
    assert stage.state().reasons == (
        TOO_OLD, 'obstacle source lidar on /polygons has sent nothing of use for longer than its '
        'timeout of 2 s: its stamps are older than that')


@pytest.mark.parametrize('steps', [(-1.001,), (-0.6, -1.001)])
def test_clock_that_goes_back_begins_anew(steps):
    """A recording starts again: what was told counts for one more timeout, and proves nothing."""
    stage = clear_stage(footprints=[UNTIMED_ROBOT])
    stage.send(0.5)
    for time in steps:
        assert stage.status() == 'collision'
        stage.at(time)
    assert stage.scene.footprints == []
    assert status_and_reasons(stage) == ('unknown', tuple(
        reason.replace('yet', 'since the clock was set')
        for reason in (NOT_RECEIVED, NOTHING_SENT)))
    stage.robot()
    assert stage.status() == 'collision'
    stage.at(0.5).send(20)
    assert stage.status() == 'collision', 'what comes was met in its middle'
    stage.send(20)
    assert stage.status() == 'collision'
    assert status_and_reasons(stage.at(0.9991)) == ('clear', ())


def test_clock_that_goes_back_by_little_changes_nothing():
    """By no more than future_tolerance; ages stop at 0."""
    stage = clear_stage(footprints=[UNTIMED_ROBOT])
    assert status_and_reasons(stage.at(-1.0)) == ('clear', ())
    assert stage.state().age == 0.0
    stage.send(0.5)
    assert stage.status() == 'collision'
    stage.send(10)
    assert stage.status() == 'clear'


def test_clock_that_goes_back_is_noticed_by_the_first_message():
    """It arrives before the next tick; the set before counts beside it for a timeout."""
    stage = clear_stage()
    stage.time = -5.0
    stage.see(20)
    assert stage.held == {0: (10, 20)}
    assert stage.state().reasons == (
        NOT_RECEIVED.replace('yet', 'since the clock was set'),
        'obstacle source lidar on /polygons has not sent a whole set since it was received from '
        'its middle on')


def test_nearest_obstacle():
    stage = Stage(footprints=(UNTIMED_ROBOT,))
    assert stage.scene.nearest('robot') is None
    stage.robot(10000)
    assert stage.scene.nearest('robot') is None
    stage.send(10004, 9997)
    obstacle, separation, *_ = stage.scene.nearest('robot')
    assert (obstacle, separation) == (ObstacleId('lidar', 1), 2.0)


START = 1000 * SECOND


def test_older_set_replaces_a_newer_one_and_expires_sooner():
    """Its stamp is 1.8 s old on arrival, so it keeps the source known for 0.2 s."""
    monitor = Monitor(Settings((FootprintSettings('robot', '/robot', timeout=0.0),), (LIDAR,)))
    monitor.receive('robot', serialised(box(0), START), START, 1)
    number = 0
    for now, stamp in ((START, START), (START + SECOND, START - 8 * SECOND // 10)):
        for points in (box(9), []):
            number += 1
            assert monitor.receive('lidar', serialised(points, stamp), now, number) is None
    for tenths, status in ((12, Status.CLEAR), (13, Status.UNKNOWN)):
        monitor.advance(START + tenths * SECOND // 10)
        assert monitor.scene.status('robot') is status

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

"""Sources of obstacles: identity by id, expiry, silence and settings."""

from dataclasses import replace

from sat_collision.scene.settings import ObstacleSettings
from sat_collision.scene.sources import TOO_OLD
from stage import EVERY_KIND, findings, INSTANCES, LIDAR, Stage, with_robot

DOUBT = 'obstacle source lidar on /polygons '


def test_instances_are_known_by_their_id():
    """A tracker numbers what it follows; stamps and order do not matter."""
    stage = Stage(INSTANCES)
    stage.see(10, instance=7)
    stage.see(20, instance=-3)
    stage.wait_until(0.5)
    stage.see(11, stamp=0.1, instance=7)
    assert stage.held == {7: 11, -3: 20}


def test_instances_with_equal_shapes_are_different_obstacles():
    """Two tracks of one body are two obstacles."""
    stage = Stage(INSTANCES)
    stage.see(10, instance=1)
    stage.see(10, instance=2)
    assert stage.held == {1: 10, 2: 10}


def test_instance_that_returns_to_a_former_place():
    """A door opens and closes: the same two shapes in turn under one id."""
    stage = with_robot(INSTANCES)
    for time, x, status in ((0.1, 0.5, 'collision'), (0.2, 9, 'clear'), (0.3, 0.5, 'collision')):
        stage.wait_until(time)
        stage.see(x, instance=1)
        assert stage.status() == status


@EVERY_KIND
def test_obstacle_not_refreshed_is_forgotten_while_its_source_lives(settings):
    """Heartbeats say that the source lives, not that what it saw is still there."""
    stage = with_robot(settings)
    stage.see(0.5, instance=1)
    stage.wait_until(1.5)
    stage.heartbeat(stamp='none')
    stage.wait_until(2.0)
    assert stage.status() == 'collision'
    stage.wait_until(2.001)
    assert stage.held == {}
    assert findings(stage) == ('clear', ())


@EVERY_KIND
def test_obstacle_lives_from_its_stamp_not_from_its_arrival(settings):
    """A message that took 1 s to arrive is 1 s old."""
    stage = Stage(settings)
    stage.wait_until(1.0)
    stage.see(10, stamp=0.0, instance=1)
    stage.wait_until(2.001)
    assert stage.held == {}


@EVERY_KIND
def test_stamp_in_the_future_does_not_prolong_a_life(settings):
    """The publisher's clock is a little ahead: its obstacles still last for the timeout."""
    stage = Stage(settings)
    stage.see(10, stamp=1.0, instance=1)
    stage.wait_until(2.0)
    assert len(stage.held) == 1
    stage.wait_until(2.001)
    assert stage.held == {}


@EVERY_KIND
def test_stamp_further_ahead_than_the_tolerance_is_refused(settings):
    """The publisher's clock is an hour ahead: nobody knows how long a message was on the way."""
    stage = with_robot(settings)
    stage.heartbeat()
    assert stage.status() == 'clear'
    assert stage.see(10, stamp=3600.0, instance=1) == 'from the future'
    assert findings(stage) == ('unknown', (DOUBT + 'sent what was refused: from the future',))
    for time in (0.1, 0.2):
        stage.wait_until(time)
        stage.see(10, instance=1)
        stage.whole()
    assert stage.status() == 'clear'


def test_older_polygon_of_an_id_expires_by_its_own_stamp():
    """The latest arrival counts, even with an older stamp: so it is also forgotten earlier."""
    stage = Stage(INSTANCES)
    stage.wait_until(1.5)
    stage.see(10, instance=1)
    stage.see(11, stamp=0.0, instance=1)
    assert stage.held == {1: 11}
    stage.wait_until(2.001)
    assert stage.held == {}


@EVERY_KIND
def test_timeout_0_keeps_what_was_heard(settings):
    """A latched map is sent once."""
    stage = with_robot(replace(settings, timeout=0.0))
    stage.see(10, instance=1)
    stage.wait_until(1e6)
    assert list(stage.held.values()) == [10]
    assert findings(stage) == ('clear', ())


@EVERY_KIND
def test_source_never_heard_is_in_trouble(settings):
    """Nobody has said that there is no obstacle, whether the source may fall silent or not."""
    for timeout in (2.0, 0.0):
        stage = with_robot(replace(settings, timeout=timeout))
        stage.wait_until(10.0)
        assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))


@EVERY_KIND
def test_silent_source_is_in_trouble_until_heard_again(settings):
    """The sensor is unplugged and plugged in again."""
    stage = with_robot(settings)
    stage.see(10, instance=1)
    stage.wait_until(2.0)
    assert stage.status() == 'clear'
    stage.wait_until(2.001)
    assert findings(stage) == (
        'unknown', (DOUBT + 'has been silent for longer than its timeout of 2 s',))
    stage.see(10, instance=1)
    stage.whole()
    assert findings(stage) == ('clear', ())
    stage.wait_until(4.1)
    assert stage.status() == 'unknown'


def test_messages_past_their_timeout_are_no_sign_of_life():
    """The publisher's clock is behind by more than the timeout: nothing it says is current."""
    stage = with_robot(LIDAR)
    assert stage.see(10, stamp=-2.001) == 'too old'
    assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))


def test_heartbeat_alone_is_enough():
    """A sensor that has never seen anything is heard all the same."""
    stage = with_robot(LIDAR)
    stage.heartbeat()
    assert findings(stage) == ('clear', ())


def test_source_that_sends_more_than_can_be_checked_is_in_trouble():
    """Until all that it sent has been looked at."""
    stage = with_robot(LIDAR)
    stage.see(10)
    stage.whole()
    stage.scene.overwhelm('lidar', True)
    assert findings(stage) == ('unknown', (
        DOUBT + 'sends more than can be checked: messages come too late or are lost',))
    stage.scene.overwhelm('lidar', False)
    assert findings(stage) == ('clear', ())


def test_timeout_given_to_a_source_that_had_none():
    """The source was trusted for ever; from now on its silence counts."""
    stage = with_robot(replace(LIDAR, timeout=0.0))
    stage.heartbeat()
    stage.scene.update(replace(stage.settings, obstacles=(LIDAR,)))
    stage.wait_until(2.0)
    assert stage.status() == 'clear'
    stage.wait_until(2.001)
    assert stage.status() == 'unknown'


def test_disabled_source_is_ignored_and_troubles_nobody():
    """A sensor is switched off on purpose, while another one serves."""
    stage = with_robot(LIDAR, ObstacleSettings('radar', '/radar'))
    stage.see(0.5)
    stage.see(50, name='radar')
    stage.whole('lidar')
    stage.whole('radar')
    assert stage.status() == 'collision'
    settings = stage.settings
    lidar, radar = settings.obstacles
    stage.scene.update(replace(settings, obstacles=(replace(lidar, enabled=False), radar)))
    assert findings(stage) == ('clear', ())
    assert stage.see(0.5) is None
    stage.refuse()
    assert findings(stage) == ('clear', ())
    assert [name.source for name, _ in stage.scene.obstacles] == ['radar']
    stage.scene.update(settings)
    assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))
    stage.see(0.5)
    assert stage.status() == 'collision'


def test_no_enabled_source_leaves_nothing_known():
    """With every source disabled, nobody can say that the robot is clear."""
    stage = with_robot(replace(LIDAR, enabled=False))
    assert findings(stage) == ('unknown', ('no obstacle source is enabled',))


def test_timeout_changed_while_running():
    """Shorter forgets at once; longer brings nothing back, neither obstacles nor trust."""
    stage = with_robot(LIDAR)
    stage.see(0.5)
    stage.wait_until(1.5)

    def set_timeout(seconds):
        stage.scene.update(replace(stage.settings, obstacles=(replace(LIDAR, timeout=seconds),)))

    set_timeout(10.0)
    stage.wait_until(9.0)
    assert stage.status() == 'collision'
    set_timeout(5.0)
    assert findings(stage) == (
        'unknown', (DOUBT + 'has been silent for longer than its timeout of 5 s',))
    set_timeout(0.0)
    assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))
    assert stage.held == {}
    stage.heartbeat()
    assert findings(stage) == ('clear', ())


@EVERY_KIND
def test_stamps_of_another_clock_are_told_from_silence(settings):
    """A recording of an hour ago is played, then one tells the time by /clock."""
    stage = Stage(settings, start=1e5)
    stage.robot()
    assert stage.see(5, stamp=-3600.0, instance=1) == TOO_OLD
    assert 'lidar on /polygons has not been heard yet' in stage.state().reasons[0]
    assert stage.see(5, stamp=-3600.1, instance=1) == TOO_OLD
    reason, = stage.state().reasons
    assert 'lidar on /polygons has stamps' in reason and 'use_sim_time: true' in reason
    stage.see(5, instance=1)
    stage.whole()
    assert stage.status() == 'clear'
    stage.wait_until(2.5)
    stage.robot()
    reason, = stage.state().reasons
    assert 'has been silent' in reason

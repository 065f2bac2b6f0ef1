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

"""Sources of obstacles: identity by id, refused messages, limits, expiry and silence."""

from dataclasses import replace

import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings
from sat_collision.scene.sources import Source
from stage import square, Stage

SETS = ObstacleSettings('lidar', '/polygons')
INSTANCES = ObstacleSettings('lidar', '/polygons', type='polygon_instance')
ACCUMULATED = ObstacleSettings('lidar', '/polygons', accumulate=True)
EVERY_KIND = pytest.mark.parametrize('settings', [SETS, INSTANCES, ACCUMULATED],
                                     ids=['sets', 'instances', 'accumulate'])
START = 1000 * 10**9
LIDAR = 'obstacle source lidar on /polygons '


def with_robot(*sources):
    """Return a stage with a footprint that stands at 0 and never ages."""
    stage = Stage(*sources, footprints=[FootprintSettings('robot', '/footprint', timeout=0.0)])
    stage.robot()
    return stage


def findings(stage):
    """Return the status in a word, and the reasons."""
    return stage.status(), stage.state().reasons


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
    """The publisher's clock is an hour ahead: its obstacles still last for the timeout."""
    stage = Stage(settings)
    stage.see(10, stamp=3600.0, instance=1)
    stage.wait_until(2.0)
    assert len(stage.held) == 1
    stage.wait_until(2.001)
    assert stage.held == {}


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
        assert findings(stage) == ('unknown', (LIDAR + 'has not been heard yet',))


@EVERY_KIND
def test_silent_source_is_in_trouble_until_heard_again(settings):
    """The sensor is unplugged and plugged in again."""
    stage = with_robot(settings)
    stage.see(10, instance=1)
    stage.wait_until(2.0)
    assert stage.status() == 'clear'
    stage.wait_until(2.001)
    assert findings(stage) == (
        'unknown', (LIDAR + 'has been silent for longer than its timeout of 2 s',))
    stage.see(10, instance=1)
    assert findings(stage) == ('clear', ())
    stage.wait_until(4.1)
    assert stage.status() == 'unknown'


def test_messages_past_their_timeout_are_no_sign_of_life():
    """The publisher's clock is behind by more than the timeout: nothing it says is current."""
    stage = with_robot(SETS)
    assert stage.see(10, stamp=-2.001) == 'too old'
    assert findings(stage) == ('unknown', (LIDAR + 'has not been heard yet',))


def test_heartbeat_alone_is_enough():
    """A sensor that has never seen anything is heard all the same."""
    stage = with_robot(SETS)
    stage.heartbeat()
    assert findings(stage) == ('clear', ())


@pytest.mark.parametrize('settings, message', [
    (SETS, {}), (SETS, {'stamp': 'none'}), (INSTANCES, {'instance': 4}), (ACCUMULATED, {})],
    ids=['set', 'stamp 0', 'instance', 'accumulate'])
def test_refused_obstacle_is_trouble_until_the_next_good_one(settings, message):
    """A polygon with a NaN stands for an obstacle somewhere; other sources are untouched."""
    stage = with_robot(settings, ObstacleSettings('radar', '/radar'))
    stage.see(9, name='radar')
    stage.refuse('not finite', **message)
    assert findings(stage) == ('unknown', (LIDAR + 'sent what was refused: not finite',))
    stage.see(0.5, name='radar')
    assert findings(stage) == ('collision', (LIDAR + 'sent what was refused: not finite',))
    stage.wait_until(0.1)
    stage.see(5, **message)
    assert findings(stage) == ('collision', ())


def test_refused_obstacle_takes_its_place_in_the_set():
    """The second of three polygons is bad: the others stay where they are in the order."""
    stage = with_robot(SETS)
    stage.see(10)
    stage.refuse()
    stage.see(30)
    assert stage.held == {0: 10, 2: 30}
    stage.wait_until(0.1)
    stage.burst(11)
    assert stage.status() == 'unknown'
    stage.burst(21, 31)
    assert stage.held == {0: 11, 1: 21, 2: 31}
    assert stage.status() == 'clear'


def test_refused_obstacle_that_the_set_no_longer_has_is_dropped_like_any_other():
    """The bad polygon was the last of its set, and the next sets are shorter."""
    stage = with_robot(SETS)
    stage.see(10)
    stage.refuse()
    stage.wait_until(0.1)
    stage.burst(11)
    assert stage.status() == 'unknown'
    stage.wait_until(0.2)
    stage.burst(12)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_refused_obstacle_expires_like_any_other(settings):
    """One bad polygon, and then only heartbeats."""
    stage = with_robot(settings)
    stage.refuse(instance=1)
    stage.wait_until(1.5)
    stage.heartbeat('none')
    assert stage.status() == 'unknown'
    stage.wait_until(2.001)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_undecodable_message_is_trouble_until_the_next_good_one(settings):
    """Neither stamp nor id is known of it: it counts as one more of the set."""
    stage = with_robot(settings)
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    assert findings(stage) == ('unknown', (LIDAR + 'sent what was refused: undecodable',))
    stage.wait_until(0.1)
    stage.see(10, instance=1)
    assert findings(stage) == ('clear', ())
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    assert stage.status() == 'unknown'
    assert list(stage.held.values()) == [10]


def test_reasons_for_refusal_are_named_once_each():
    """Two bad polygons of one kind and one of another make two sentences."""
    stage = with_robot(SETS)
    for reason in ('not finite', 'self-intersecting', 'not finite'):
        stage.refuse(reason)
    assert stage.state().reasons == (LIDAR + 'sent what was refused: not finite',
                                     LIDAR + 'sent what was refused: self-intersecting')
    stage.wait_until(0.1)
    stage.burst(10, 20)
    assert stage.state().reasons == (LIDAR + 'sent what was refused: not finite',)


def test_set_beyond_max_count_is_trouble_until_a_set_fits():
    """The scan has more obstacles than the limit: what was cut off may be anywhere."""
    stage = with_robot(replace(SETS, max_count=2))
    stage.burst(10, 20)
    assert stage.status() == 'clear'
    assert stage.see(30) == stage.see(40) == 'too many obstacles'
    assert stage.held == {0: 10, 1: 20}
    assert findings(stage) == ('unknown', (LIDAR + 'sent what was refused: too many obstacles',))
    stage.wait_until(0.1)
    stage.burst(11, 21)
    assert stage.status() == 'unknown'
    stage.wait_until(0.2)
    stage.burst(12, 22)
    assert findings(stage) == ('clear', ())


@pytest.mark.parametrize('settings', [INSTANCES, ACCUMULATED], ids=['instances', 'accumulate'])
def test_more_than_max_count_is_trouble_until_it_expires(settings):
    """What did not fit may be there for its timeout, whatever else comes and goes."""
    stage = with_robot(replace(settings, max_count=2))
    stage.see(10, instance=1)
    stage.wait_until(1.0)
    stage.see(20, instance=2)
    assert stage.see(30, instance=3) == 'too many obstacles'
    assert sorted(stage.held.values()) == [10, 20]
    stage.wait_until(2.5)
    assert stage.see(40, instance=4) is None
    assert sorted(stage.held.values()) == [20, 40]
    assert stage.status() == 'unknown'
    stage.wait_until(3.001)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_flood_takes_no_more_room_than_max_count(settings):
    """A publisher gone wild sends thousands of obstacles, good and bad, in one instant."""
    source = Source(replace(settings, max_count=5), Contacts(), Deadlines())
    for number in range(1000):
        source.place(square(number).packed, 'map', START, START, number)
        source.refuse('not finite', START, START, -1 - number)
    obstacles = [body for body in source.obstacles.values() if body.polygon is not None]
    assert 2 < len(obstacles) <= 5
    assert len(source.obstacles) <= 7


def test_refused_instances_do_not_exceed_max_count():
    """A stream of bad polygons with ever new ids takes no more room than good ones."""
    stage = with_robot(replace(INSTANCES, max_count=2))
    for instance in range(1000):
        stage.refuse(instance=instance)
    assert stage.state().reasons == (LIDAR + 'sent what was refused: not finite',
                                     LIDAR + 'sent what was refused: too many obstacles')
    stage.see(10, instance=0)
    stage.see(20, instance=1)
    assert stage.held == {0: 10, 1: 20}


def test_message_without_an_id_takes_no_room():
    """One message cannot be decoded; as many ids as allowed are still not too many."""
    stage = with_robot(replace(INSTANCES, max_count=2))
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    stage.refuse(instance=1)
    stage.refuse(instance=2)
    assert stage.state().reasons == (LIDAR + 'sent what was refused: not finite',
                                     LIDAR + 'sent what was refused: undecodable')


def test_timeout_given_to_a_source_that_had_none():
    """The source was trusted for ever; from now on its silence counts."""
    stage = with_robot(replace(SETS, timeout=0.0))
    stage.heartbeat()
    stage.scene.update(replace(stage.settings, obstacles=(SETS,)))
    stage.wait_until(2.0)
    assert stage.status() == 'clear'
    stage.wait_until(2.001)
    assert stage.status() == 'unknown'


def test_disabled_source_is_ignored_and_troubles_nobody():
    """A sensor is switched off on purpose, while another one serves."""
    stage = with_robot(SETS, ObstacleSettings('radar', '/radar'))
    stage.see(0.5)
    stage.see(50, name='radar')
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
    assert findings(stage) == ('unknown', (LIDAR + 'has not been heard yet',))
    stage.see(0.5)
    assert stage.status() == 'collision'


def test_no_enabled_source_leaves_nothing_known():
    """With every source disabled, nobody can say that the robot is clear."""
    stage = with_robot(replace(SETS, enabled=False))
    assert findings(stage) == ('unknown', ('no obstacle source is enabled',))


def test_timeout_changed_while_running():
    """Shorter forgets at once; longer brings a silent source back, not what it forgot."""
    stage = with_robot(SETS)
    stage.see(0.5)
    stage.wait_until(1.5)

    def set_timeout(seconds):
        stage.scene.update(replace(stage.settings, obstacles=(replace(SETS, timeout=seconds),)))

    set_timeout(10.0)
    stage.wait_until(9.0)
    assert stage.status() == 'collision'
    set_timeout(5.0)
    assert findings(stage) == (
        'unknown', (LIDAR + 'has been silent for longer than its timeout of 5 s',))
    set_timeout(0.0)
    assert findings(stage) == ('clear', ())
    assert stage.held == {}

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

"""Sources that sent what was refused, or too much: a doubt until it is mended or expired."""

from dataclasses import replace

import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.settings import ObstacleSettings
from sat_collision.scene.sources import Source
from stage import (
    ACCUMULATED, EVERY_KIND, findings, INSTANCES, LIDAR, nanoseconds, square, START, with_robot)

DOUBT = 'obstacle source lidar on /polygons '


@pytest.mark.parametrize('settings, message', [
    (LIDAR, {}), (LIDAR, {'stamp': 'none'}), (INSTANCES, {'instance': 4}), (ACCUMULATED, {})],
    ids=['set', 'stamp 0', 'instance', 'accumulate'])
def test_refused_obstacle_is_trouble_until_the_next_good_one(settings, message):
    """A polygon with a NaN stands for an obstacle somewhere; other sources are untouched."""
    stage = with_robot(settings, ObstacleSettings('radar', '/radar'))
    stage.see(9, name='radar')
    stage.whole('radar')
    stage.heartbeat()
    stage.refuse('not finite', **message)
    stage.whole()
    assert findings(stage) == ('unknown', (DOUBT + 'sent what was refused: not finite',))
    stage.see(0.5, name='radar')
    assert findings(stage) == ('collision', (DOUBT + 'sent what was refused: not finite',))
    stage.wait_until(0.1)
    stage.see(5, **message)
    stage.whole()
    assert findings(stage) == ('collision', ())


def test_refused_obstacle_takes_its_place_in_the_set():
    """The second of three polygons is bad: the others stay where they are in the order."""
    stage = with_robot(LIDAR)
    stage.see(10)
    stage.refuse()
    stage.see(30)
    assert stage.held == {0: 10, 2: 30}
    stage.wait_until(0.1)
    stage.burst(11, 21, 31)
    assert stage.status() == 'unknown'
    stage.whole()
    assert stage.held == {0: 11, 1: 21, 2: 31}
    assert stage.status() == 'clear'


def test_refused_obstacle_that_the_set_no_longer_has_is_dropped_like_any_other():
    """The bad polygon was the last of its set, and the next sets are shorter."""
    stage = with_robot(LIDAR)
    stage.see(10)
    stage.refuse()
    stage.whole()
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


def test_refused_obstacle_lives_from_its_stamp_though_a_set_before_was_stamped_later():
    """The clock of a publisher was ahead and is set back: what was refused is 1.15 s old."""
    stage = with_robot(LIDAR)
    for stamp in (0.9, -1.2):
        stage.see(10, stamp)
        stage.heartbeat(stamp)
    stage.refuse(stamp=-1.15)
    stage.heartbeat(-1.15)
    stage.wait_until(0.8)
    stage.heartbeat('none')
    assert stage.status() == 'unknown'
    stage.wait_until(0.86)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_undecodable_message_is_trouble_until_the_next_good_one(settings):
    """Neither stamp nor id is known of it: it counts as one more of the set."""
    stage = with_robot(settings)
    stage.whole()
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    assert findings(stage) == ('unknown', (DOUBT + 'sent what was refused: undecodable',))
    if settings is LIDAR:
        stage.time = 0.03
        stage.see(10)
        stage.whole()
        assert stage.status() == 'unknown', 'it may have been of this set or of one before'
    stage.wait_until(0.2)
    stage.see(10, instance=1)
    stage.whole()
    assert findings(stage) == ('clear', ())
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    assert stage.status() == 'unknown'
    assert list(stage.held.values()) == [10]


def test_reasons_for_refusal_are_named_once_each():
    """Two bad polygons of one kind and one of another make two sentences."""
    stage = with_robot(LIDAR)
    for reason in ('not finite', 'self-intersecting', 'not finite'):
        stage.refuse(reason)
    stage.whole()
    assert stage.state().reasons == (DOUBT + 'sent what was refused: not finite',
                                     DOUBT + 'sent what was refused: self-intersecting')
    stage.wait_until(0.1)
    stage.see(10)
    stage.refuse('not finite')
    assert len(stage.state().reasons) == 2
    stage.whole()
    assert stage.state().reasons == (DOUBT + 'sent what was refused: not finite',)


def test_set_beyond_max_count_is_trouble_until_a_set_fits():
    """The scan has more obstacles than the limit: what was cut off may be anywhere."""
    stage = with_robot(replace(LIDAR, max_count=2))
    stage.burst(10, 20)
    stage.whole()
    assert stage.status() == 'clear'
    assert stage.see(30) == stage.see(40) == 'too many obstacles'
    assert stage.held == {0: 10, 1: 20}
    assert findings(stage) == ('unknown', (DOUBT + 'sent what was refused: too many obstacles',))
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
    now = nanoseconds(START)
    for number in range(1000):
        source.place(square(number).packed, 'map', now, now, number)
        source.refuse('not finite', now, now, -1 - number)
    obstacles = [body for body in source.obstacles if body.polygon is not None]
    assert 2 < len(obstacles) <= 5
    assert len(list(source.obstacles)) <= 7


def test_refused_instances_do_not_exceed_max_count():
    """A stream of bad polygons with ever new ids takes no more room than good ones."""
    stage = with_robot(replace(INSTANCES, max_count=2))
    for instance in range(1000):
        stage.refuse(instance=instance)
    assert stage.state().reasons == (DOUBT + 'sent what was refused: not finite',
                                     DOUBT + 'sent what was refused: too many obstacles')
    stage.see(10, instance=0)
    stage.see(20, instance=1)
    assert stage.held == {0: 10, 1: 20}


def test_message_without_an_id_takes_no_room():
    """One message cannot be decoded; as many ids as allowed are still not too many."""
    stage = with_robot(replace(INSTANCES, max_count=2))
    stage.scene.refuse('lidar', 'undecodable', stage.now)
    stage.refuse(instance=1)
    stage.refuse(instance=2)
    assert stage.state().reasons == (DOUBT + 'sent what was refused: not finite',
                                     DOUBT + 'sent what was refused: undecodable')

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

"""Sources whose messages were lost, or whose publishers changed."""

from dataclasses import replace

import pytest
from sat_collision.scene.settings import ObstacleSettings
from stage import ACCUMULATED, EVERY_KIND, findings, INSTANCES, LIDAR, PATIENT_LIDAR, with_robot

DOUBT = 'obstacle source lidar on /polygons '
LOST = DOUBT + 'lost messages on the way, which may have told of obstacles, '
REMEDY = '; publish less at once or raise the depth of the subscription'


def send_set(stage, time, *places):
    """Send a whole set; return the status after each of its messages, the end included."""
    stage.wait_until(time)
    statuses = []
    for x in places:
        stage.see(x)
        statuses.append(stage.status())
    stage.whole()
    return [*statuses, stage.status()]


def test_loss_in_a_set_counts_until_a_set_that_begins_later_is_whole():
    """What is missing may be of the set that comes in, or of one that never came."""
    stage = with_robot(LIDAR)
    assert send_set(stage, 0.0, 10, 20)[-1] == 'clear'
    stage.scene.lose('lidar', stage.now)
    assert findings(stage) == (
        'unknown', (LOST + 'and has not sent a whole set since' + REMEDY,))
    assert set(send_set(stage, 0.1, 10)) == {'unknown'}
    assert send_set(stage, 0.2, 10, 20) == ['unknown', 'unknown', 'clear']


def test_loss_in_the_middle_of_a_set():
    """The set that comes in is not whole, though a later one begins."""
    stage = with_robot(LIDAR)
    send_set(stage, 0.0, 10, 20)
    stage.wait_until(0.1)
    stage.see(10)
    stage.scene.lose('lidar', stage.now)
    stage.see(30)
    stage.wait_until(0.2)
    stage.see(10)
    assert stage.status() == 'unknown'
    stage.whole()
    assert stage.status() == 'clear'


@pytest.mark.parametrize('settings', [INSTANCES, ACCUMULATED], ids=['instances', 'accumulate'])
def test_loss_without_sets_counts_for_the_timeout(settings):
    """By then all that is there has been told anew."""
    stage = with_robot(settings)
    stage.see(10, instance=1)
    stage.scene.lose('lidar', stage.now)
    stage.wait_until(1.5)
    stage.see(10, instance=1)
    stage.wait_until(2.0)
    assert findings(stage) == (
        'unknown', (LOST + 'and its timeout of 2 s has not passed since' + REMEDY,))
    stage.wait_until(2.001)
    assert findings(stage) == ('clear', ())


def test_loss_without_sets_and_timeout_counts_until_the_source_is_enabled_anew():
    """Nothing tells when all was told."""
    patient = replace(INSTANCES, timeout=0.0)
    stage = with_robot(patient)
    stage.see(10, instance=1)
    stage.scene.lose('lidar', stage.now)
    stage.wait_until(1e5)
    assert findings(stage) == ('unknown', (
        LOST + 'and, as nothing of it times out, counts until it is disabled and enabled again'
        + REMEDY,))
    for enabled in (False, True):
        stage.scene.update(replace(stage.settings, obstacles=(
            replace(patient, enabled=enabled),)))
    stage.see(10, instance=1)
    assert findings(stage) == ('clear', ())


def test_lost_footprint_is_made_up_for_by_the_next():
    """A loss of footprints is only counted."""
    stage = with_robot(LIDAR)
    stage.heartbeat()
    stage.scene.lose('robot', stage.now)
    assert findings(stage) == ('clear', ())


def test_map_without_stamps_is_known_after_a_pause():
    """Its polygons come one by one; what is only repeated does not put that off."""
    stage = with_robot(PATIENT_LIDAR)
    for time, x in ((0.0, 10), (0.04, 20), (0.08, 10)):
        stage.wait_until(time)
        stage.see(x, stamp='none')
        assert findings(stage) == ('unknown', (DOUBT + 'has not sent a whole set yet',))
    stage.wait_until(0.0901)
    assert stage.status() == 'clear'


@pytest.mark.parametrize('timeout', [2.0, 0.0])
def test_source_after_silence_or_disabling_is_unknown_until_a_set_is_whole(timeout):
    """The last member of the first set is on the robot."""
    settings = replace(LIDAR, timeout=timeout)
    stage = with_robot(settings)
    first = ['unknown', 'unknown', 'collision', 'collision']
    assert send_set(stage, 0.0, 10, 20, 0.5) == first
    if timeout:
        stage.wait_until(3.0)
    else:
        for enabled in (False, True):
            stage.scene.update(replace(stage.settings, obstacles=(
                replace(settings, enabled=enabled),)))
    assert stage.status() == 'unknown'
    assert send_set(stage, 4.0, 10, 20, 0.5) == first


def test_pause_is_none_while_messages_wait_to_be_looked_at():
    """The node was held up in the middle of a set."""
    stage = with_robot(LIDAR)
    stage.see(10)
    stage.scene.fall_behind('lidar', True, False)
    stage.wait_until(0.5)
    assert stage.status() == 'unknown'
    stage.see(20, stamp=0.0)
    stage.scene.fall_behind('lidar', False, False)
    assert stage.status() == 'unknown'
    stage.wait_until(0.551)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_source_without_a_publisher_is_unknown_at_once(settings):
    """It has ended; one that begins is known when it has told what there is."""
    stage = with_robot(settings)
    stage.scene.count_publishers('lidar', 0)
    assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))
    stage.scene.count_publishers('lidar', 1)
    stage.see(10, instance=1)
    stage.whole()
    assert stage.status() == 'clear'
    stage.scene.count_publishers('lidar', 0)
    assert findings(stage) == ('unknown', (DOUBT + 'has no publisher any more',))
    stage.scene.count_publishers('lidar', 1)
    assert findings(stage) == ('unknown', (DOUBT + 'has not been heard yet',))
    stage.wait_until(0.1)
    stage.see(10, instance=1)
    stage.whole()
    assert stage.status() == 'clear'


def test_two_publishers_of_sets_are_unknown_until_one_is_left():
    """A restart that overlaps heals by itself; sources without sets may have many publishers."""
    stage = with_robot(LIDAR, ObstacleSettings('radar', '/radar', type='polygon_instance'))
    stage.see(20, name='radar', instance=1)
    stage.scene.count_publishers('radar', 2)
    stage.scene.count_publishers('lidar', 1)
    assert send_set(stage, 0.0, 10)[-1] == 'clear'
    stage.scene.count_publishers('lidar', 2)
    assert findings(stage) == ('unknown', (
        DOUBT + 'has 2 publishers, whose sets cannot be told apart: give each a topic and a name '
        'of its own, use ids, or set accumulate',))
    stage.scene.count_publishers('lidar', 1)
    assert stage.status() == 'clear'

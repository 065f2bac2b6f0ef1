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
from stage import (
    ACCUMULATED, EVERY_KIND, findings, INSTANCES, LIDAR, PATIENT_LIDAR, PATIENT_ROBOT, Stage,
    START, with_robot)

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
    stage.wait_until(0.1)
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
    """The node was held up in the middle of a set: the footprint is looked at first."""
    stage = with_robot(LIDAR)
    send_set(stage, 0.0, 0.5, 20)
    stage.wait_until(1.0)
    stage.see(20)
    stage.time = 1.5
    stage.robot()
    stage.scene.pass_time(stage.now)
    assert stage.status() == 'collision', 'of the set before'
    stage.see(0.5, stamp=1.0)
    stage.wait_until(1.501)
    assert stage.held == {0: (0.5, 20), 1: (0.5, 20)}
    stage.wait_until(1.551)
    assert stage.held == {0: 20, 1: 0.5}


def test_loss_among_messages_without_stamps_counts_until_all_have_come_again():
    """A map is sent again and again: what comes from one pause to the next is all there is."""
    stage = with_robot(PATIENT_LIDAR)
    stage.burst(10, 20, stamp='none')
    stage.wait_until(1.0)
    assert stage.status() == 'clear'
    stage.scene.lose('lidar', stage.now)
    stage.see(20, stamp='none')
    for time in (1.04, 1.08):
        stage.wait_until(time)
        stage.see(20, stamp='none')
    stage.wait_until(1.2)
    assert stage.status() == 'unknown'
    stage.burst(10, 20, stamp='none')
    stage.wait_until(1.251)
    assert stage.status() == 'clear'


def begun_stage(settings=LIDAR):
    """Return a stage that has just begun to listen."""
    stage = Stage(settings, footprints=(PATIENT_ROBOT,), start=START + 100.0, listens=False)
    stage.robot()
    return stage


NOT_WHOLE = 'unknown', (DOUBT + 'has not sent a whole set yet',)


@pytest.mark.parametrize('stamp', [None, 'none'], ids=['set', 'stamp 0'])
def test_first_set_joined_in_its_middle_does_not_count(stamp):
    """The last one of it came after the node was there; one before is on the robot."""
    stage = begun_stage()
    stage.wait_until(0.049)
    stage.see(10, stamp)
    stage.wait_until(0.2)
    assert findings(stage) == NOT_WHOLE
    stage.see(20, stamp)
    assert findings(stage) == NOT_WHOLE
    stage.wait_until(0.251)
    assert stage.status() == 'clear'


@pytest.mark.parametrize('stamp', [None, 'none'], ids=['set', 'stamp 0'])
def test_first_set_that_a_publisher_sends_counts(stamp):
    """It sends no more than that: its first message is known to be its first."""
    stage = begun_stage()
    stage.scene.count_publishers('lidar', 1)
    stage.scene.meet_publisher('lidar', True)
    stage.see(10, stamp)
    assert findings(stage) == NOT_WHOLE
    stage.wait_until(0.051)
    assert stage.status() == 'clear'


def test_pause_counts_from_when_there_is_a_publisher():
    """Before it was found, no message could come."""
    stage = begun_stage()
    stage.scene.count_publishers('lidar', 0)
    stage.wait_until(1.0)
    stage.scene.count_publishers('lidar', 1)
    assert send_set(stage, 1.0, 10, 20)[-1] == 'unknown'
    assert send_set(stage, 1.1, 10, 20)[-1] == 'clear'


def test_publisher_replaced_in_the_middle_of_a_set():
    """The set of the old one will never be whole; that of the new one begins with its first."""
    stage = with_robot(LIDAR)
    assert send_set(stage, 0.0, 0.5, 20)[-1] == 'collision'
    stage.wait_until(0.1)
    stage.see(20)
    stage.scene.meet_publisher('lidar', True)
    assert send_set(stage, 0.11, 20, 30) == ['unknown', 'unknown', 'clear']


def test_publisher_replaced_by_one_whose_first_messages_were_missed():
    """It was found when it had begun a set: the next one counts."""
    stage = with_robot(LIDAR)
    assert send_set(stage, 0.0, 10, 20)[-1] == 'clear'
    stage.wait_until(0.1)
    stage.scene.meet_publisher('lidar', False)
    assert set(send_set(stage, 0.1, 20)) == {'unknown'}
    assert send_set(stage, 0.2, 10, 20) == ['unknown', 'unknown', 'clear']


def test_last_set_is_still_held_after_a_publisher_was_replaced_between_sets():
    """It was whole, and so will the next one be."""
    stage = with_robot(LIDAR)
    assert send_set(stage, 0.0, 10, 20)[-1] == 'clear'
    stage.scene.meet_publisher('lidar', True)
    assert set(send_set(stage, 0.1, 20, 30)) == {'clear'}


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


@EVERY_KIND
def test_publisher_that_came_and_went_between_two_looks(settings):
    """None was counted, but something was heard."""
    stage = with_robot(settings)
    stage.scene.count_publishers('lidar', 0)
    stage.see(10, instance=1)
    stage.whole()
    assert stage.status() == 'clear'
    stage.scene.count_publishers('lidar', 0)
    assert findings(stage) == ('unknown', (DOUBT + 'has no publisher any more',))


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
    assert set(send_set(stage, 0.1, 10)) == {'unknown'}
    stage.wait_until(0.2)
    stage.scene.count_publishers('lidar', 1)
    assert set(send_set(stage, 0.2, 10)) == {'unknown'}, 'they were mixed up until just now'
    assert send_set(stage, 0.3, 10)[-1] == 'clear'

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One footprint: age, refusals, sources of its own, and when it is reported clear."""

from dataclasses import replace

import pytest
from sat_collision.scene.obstacles import ObstacleId
from stage import (
    CART, clear_stage, known_stage, LIDAR, NOT_RECEIVED, ROBOT, SILENT, Stage, TOO_OLD,
    UNTIMED_LIDAR, UNTIMED_ROBOT, with_robot)


@pytest.mark.parametrize('stamp, end', [(-0.4, 0.6), (1.0, 1.0), ('none', 1.0)])
def test_footprint_goes_stale_by_its_stamp(stamp, end):
    """By its arrival if it was stamped ahead, or not at all."""
    stage = with_robot(UNTIMED_LIDAR, footprints=[ROBOT], stamp=stamp)
    stage.end()
    assert stage.state().age == pytest.approx(1.0 - end)
    assert stage.at(end).status() == 'clear'
    assert stage.at(end + 0.001).told == ('unknown', (TOO_OLD,))
    assert stage.state().age == pytest.approx(1.001)
    stage.robot()
    assert stage.status() == 'clear'


def test_stale_footprint_in_contact_is_unknown():
    """Its last polygon is still drawn."""
    stage = with_robot(UNTIMED_LIDAR, footprints=[ROBOT]).send(0.5)
    state = stage.at(1.001).state()
    assert (state.status.value, state.contacts, state.reasons) == ('unknown', (), (TOO_OLD,))
    assert [name for name, _ in stage.scene.footprints] == ['robot']


def test_footprint_that_arrives_stale_is_stale_at_once():
    stage = clear_stage(UNTIMED_LIDAR)
    stage.at(2.5).robot(stamp=1.499)
    assert stage.told == ('unknown', (TOO_OLD,))
    stage.robot(stamp=1.5)
    assert stage.status() == 'clear'


def test_older_footprint_after_a_newer_one_is_refused():
    """Two messages arrive in the wrong order."""
    stage = clear_stage(UNTIMED_LIDAR)
    stage.at(0.5).robot(10.5)
    assert stage.robot(20, stamp=0.499) == 'older than the last'
    assert stage.status() == 'collision'
    assert stage.robot(20, stamp=0.5) is None
    assert stage.status() == 'clear'


@pytest.mark.parametrize('footprint', [ROBOT, UNTIMED_ROBOT])
def test_older_footprint_is_accepted_when_the_last_one_no_longer_counts(footprint):
    """The publisher's clock is set back; the last footprint is stale, refused or untimed."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[footprint])
    if footprint is ROBOT:
        assert stage.robot(10.5, stamp=-0.1) == 'older than the last'
        stage.at(1.001)
    assert stage.robot(10.5, stamp=stage.time - 0.1) is None
    assert stage.status() == 'collision'
    stage.refuse(name='robot')
    assert stage.robot(20, stamp=stage.time - 0.2) is None
    assert stage.status() == 'clear'


def test_footprint_stamped_ahead_does_not_block_later_ones():
    """Its time is that of its arrival."""
    stage = clear_stage()
    assert stage.robot(stamp=0.9) is None
    assert stage.at(0.1).robot(10.5, stamp=0.05) is None
    assert stage.status() == 'collision'
    assert stage.robot(20, stamp=0.04) == 'older than the last'


def test_footprint_further_ahead_than_the_tolerance_is_refused():
    stage = clear_stage(UNTIMED_LIDAR, future_tolerance=0.5)
    assert stage.robot(stamp=0.5) is None
    assert stage.robot(stamp=0.501) == 'from the future'
    assert stage.state().reasons == ('footprint robot on /footprint was refused: from the future',)
    assert stage.robot() is None
    assert stage.status() == 'clear'


def test_footprint_without_a_publisher_is_unknown_at_once():
    """However long its timeout is."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[UNTIMED_ROBOT])
    assert stage.publish_by('a', name='robot').status() == 'clear'
    assert stage.publish_by(name='robot').state().reasons == (
        'footprint robot on /footprint has no publisher',
        'footprint robot on /footprint has not been received since its publisher changed')
    assert stage.publish_by('b', name='robot').status() == 'unknown'
    stage.restart('robot')
    stage.robot()
    assert stage.status() == 'clear'


def test_footprint_with_two_publishers_is_unknown():
    """Both are in the graph, or the message numbers show a second one."""
    stage = clear_stage(UNTIMED_LIDAR).publish_by('a', 'b', name='robot')
    stage.robot()
    assert stage.state().reasons == (
        'footprint robot on /footprint has 2 publishers, /a and /b, which cannot be told apart: '
        'give each a topic and a name here of its own',)
    stage.publish_by('a', name='robot')
    stage.robot()
    assert stage.status() == 'clear'
    stage.numbers['robot'] -= 2
    stage.robot()
    assert 'whose numbers are those of two publishers' in stage.state().reasons[0]
    assert stage.status() == 'unknown'
    for time, status in ((1.0, 'unknown'), (1.001, 'clear')):
        stage.at(time).robot()
        assert stage.status() == status


def test_footprint_is_unknown_after_a_refused_message_until_the_next_good_one():
    stage = with_robot().send(0.5)
    stage.refuse('not finite', name='robot')
    state = stage.state()
    assert (state.status.value, state.contacts, state.age) == ('unknown', (), None)
    assert state.reasons == ('footprint robot on /footprint was refused: not finite',)
    assert stage.scene.footprints == []
    stage.robot()
    assert stage.status() == 'collision'


def test_disabled_footprint_is_unknown_and_ignored():
    stage = clear_stage().use('robot', enabled=False)
    assert stage.robot() is None
    stage.refuse(name='robot')
    assert stage.state().reasons == ('footprint robot is disabled',)
    assert stage.use('robot', enabled=True).state().reasons == (NOT_RECEIVED,)
    stage.robot()
    assert stage.status() == 'clear'


def test_footprints_that_came_while_disabled_were_not_lost():
    stage = known_stage(LIDAR)
    for enabled in (False, True):
        stage.use('robot', enabled=enabled)
        stage.robot()
        stage.robot()
    assert stage.scene.lost() == {}
    stage.lose(name='robot')
    stage.robot()
    assert stage.scene.lost() == {'robot': 1}


DELAYED = 'clear for less than release_delay, 0.5 s'


def test_release_delay_starts_again_with_each_contact():
    """The flag stays up while a contact flickers."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[UNTIMED_ROBOT], release_delay=0.0)
    stage.use(release_delay=0.5)
    stage.see(0.5)
    assert stage.status() == 'collision'
    for time, x in ((0.1, 5), (0.5, 0.5), (0.6, 5)):
        assert stage.at(time).send(x).status() == 'collision'
    assert stage.state().contacts == ()
    assert stage.state().reasons == (DELAYED,)
    stage.scene.take_changes()
    assert stage.at(1.099).status() == 'collision' and not stage.scene.take_changes().changed
    assert stage.at(1.1).told == ('clear', ())
    assert stage.scene.take_changes().changed == ['robot']


def test_brief_contact_restarts_the_release_delay():
    """Even if no state was read during the contact."""
    stage = with_robot(release_delay=0.5)
    for time, x in ((0.0, 5), (0.3, 0.5), (0.4, 6)):
        stage.at(time).send(x)
    assert [stage.at(time).status() for time in (0.8, 0.9)] == ['collision', 'clear']


def test_release_delay_applies_to_unknown():
    """The flag does not flicker when a sensor drops out again and again."""
    stage = with_robot(UNTIMED_LIDAR, release_delay=0.5)
    assert stage.send(5).told == ('unknown', (DELAYED,))
    assert stage.at(0.5).status() == 'clear'


def test_timeout_and_release_delay_can_be_changed_live():
    stage = clear_stage(UNTIMED_LIDAR)
    assert stage.at(1.5).status() == 'unknown'
    stage.use(release_delay=0.5)
    assert stage.use('robot', timeout=0.0).state().reasons == (DELAYED,)
    assert stage.use(release_delay=0.0).status() == 'clear'
    assert stage.use('robot', timeout=1.0).state().reasons == (TOO_OLD,)


def test_release_delay_does_not_delay_collision_or_unknown():
    stage = with_robot(release_delay=0.5).send(5)
    assert stage.at(1.0).status() == 'clear'
    stage.see(0.5)
    assert stage.status() == 'collision'
    stage.refuse(name='robot')
    assert stage.status() == 'unknown'


def test_stamps_of_another_clock_are_reported_as_such():
    """A recording of last year is played without use_sim_time; later, old is just old."""
    stage = clear_stage(UNTIMED_LIDAR, start=1e5)
    stage.at(2.0).robot(stamp=-4000.0)
    reason, = stage.state().reasons
    assert 'footprint robot on /footprint has stamps' in reason and 'use_sim_time: true' in reason
    stage.robot(stamp=4000.0)
    reason, = stage.state().reasons
    assert 'was refused: from the future, more than an hour' in reason
    stage.see(10, stamp=4000.0)
    assert 'more than an hour' in stage.state().reasons[1]
    stage.end()
    stage.send(10)
    stage.robot()
    assert stage.status() == 'clear'
    assert stage.at(9000.0).state().reasons == (TOO_OLD,)


DOCK = replace(LIDAR, name='dock', topic='/dock', timeout=100.0)
WALLS = replace(LIDAR, name='walls', topic='/walls', timeout=100.0)
BOTH = DOCK, WALLS


def stage_of(*own):
    """Return a stage where the robot touches the dock and is far from the walls."""
    stage = with_robot(*BOTH, footprints=[replace(UNTIMED_ROBOT, obstacles=own)])
    stage.send(0.5, name='dock')
    stage.send(7.0, name='walls')
    return stage


def test_footprint_ignores_sources_that_it_does_not_monitor():
    """The dock is left out while docking and counts again afterwards."""
    stage = stage_of()
    assert stage.status() == 'collision'
    assert stage.use('robot', obstacles=('walls',)).status() == 'clear'
    assert stage.scene.nearest('robot')[:2] == (ObstacleId('walls', 0), 6.0)
    stage.robot(0.1)
    stage.see(0.2, name='dock')
    assert stage.status() == 'clear'
    assert stage.use('robot', obstacles=()).state().contacts == (ObstacleId('dock', 0),)
    assert stage.scene.nearest('robot')[0] == ObstacleId('dock', 0)


def test_contacts_with_monitored_sources():
    """The obstacle moves to the robot, the robot to the obstacle, and the margin grows."""
    stage = stage_of('walls')
    for x, status in ((0.9, 'collision'), (7.0, 'clear')):
        assert stage.send(x, name='walls').status() == status
    for x, status in ((6.5, 'collision'), (5.8, 'clear')):
        stage.robot(x)
        assert stage.status() == status
    assert stage.use(margin=0.5).state().contacts == (ObstacleId('walls', 0),)


def test_faults_of_other_sources_are_ignored():
    robot = replace(UNTIMED_ROBOT, obstacles=('walls',))
    cart = replace(CART, timeout=0.0, obstacles=('lidar', 'walls'))
    all_seeing = replace(CART, name='all', timeout=0.0)
    stage = Stage(*BOTH, LIDAR, footprints=[robot, cart, all_seeing])
    for name in ('robot', 'cart', 'all'):
        stage.robot(name=name)
    for name in ('dock', 'walls', 'lidar'):
        stage.send(9, name=name)
    assert stage.status('all') == 'clear'
    stage.at(2.001).refuse(name='dock')
    refused = ('obstacle source dock on /dock has not sent a whole set since a message was '
               'refused: not finite')
    assert stage.told == ('clear', ())
    assert stage.state('cart').reasons == (SILENT,)
    assert stage.state('all').reasons == (refused, SILENT)


def test_unknown_if_all_monitored_sources_are_disabled():
    """Though another source is enabled and known."""
    stage = stage_of('walls').use('walls', enabled=False)
    assert stage.told == ('unknown', ('none of its obstacle sources is enabled',))

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

"""States of footprints: what is known, what wins, and when a change is reported."""

from dataclasses import replace

import pytest
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings
from stage import Stage

LIDAR = ObstacleSettings('lidar', '/polygons')
PATIENT_LIDAR = replace(LIDAR, timeout=0.0)
ROBOT = FootprintSettings('robot', '/footprint')
CART = FootprintSettings('cart', '/cart/footprint')
PATIENT_ROBOT = replace(ROBOT, timeout=0.0)
TOO_OLD = 'footprint robot on /footprint is older than its timeout of 1 s'
UNHEARD = 'footprint robot on /footprint has not been heard yet'
UNHEARD_LIDAR = 'obstacle source lidar on /polygons has not been heard yet'


def clear_stage(*sources, **settings):
    """Return a stage with a footprint at 0 and an obstacle far from it."""
    stage = Stage(*sources, **settings)
    stage.robot()
    stage.see(10)
    assert stage.status() == 'clear'
    return stage


def test_everything_is_unknown_before_any_message():
    """The node has just started."""
    stage = Stage()
    state = stage.state()
    assert stage.status() == 'unknown'
    assert state.contacts == ()
    assert state.reasons == (UNHEARD, UNHEARD_LIDAR)
    assert state.age is None


def test_contact_begins_and_ends_with_the_obstacle():
    """A person walks up to the robot, touches it and walks away."""
    stage = clear_stage()
    for time, x, status in ((0.1, 5, 'clear'), (0.2, 1, 'collision'), (0.3, 0.3, 'collision'),
                            (0.4, -1.01, 'clear')):
        stage.wait_until(time)
        stage.see(x)
        assert stage.status() == status


def test_contact_begins_and_ends_with_the_footprint():
    """The robot drives past obstacles that stand still."""
    stage = Stage()
    stage.burst(0, 4, 5)
    for x, keys in ((2, []), (3, [1]), (4.5, [1, 2]), (6.5, []), (0, [0])):
        stage.robot(x)
        assert stage.state().contacts == tuple(ObstacleId('lidar', key) for key in keys)
        assert stage.status() == ('collision' if keys else 'clear')


def test_contacts_are_sorted_by_source_and_key():
    """Contacts come from several sources in any order."""
    stage = Stage(ObstacleSettings('radar', '/radar'), LIDAR)
    stage.robot()
    stage.burst(0.1, 9, 0.2, name='radar')
    stage.burst(0.3)
    assert [str(obstacle) for obstacle in stage.state().contacts] == [
        'lidar/0', 'radar/0', 'radar/2']


def test_footprints_are_judged_each_for_itself():
    """Two robots, one of them in contact."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot(0)
    stage.robot(5, name='cart')
    stage.see(5.5)
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'collision')


def test_forgotten_obstacle_ends_its_contact():
    """An obstacle that nobody confirms stops counting, and with it the source that is silent."""
    stage = Stage(footprints=[PATIENT_ROBOT])
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'collision'
    stage.wait_until(2.001)
    assert stage.status() == 'unknown'
    assert stage.state().contacts == ()


def test_footprint_goes_stale_by_its_stamp():
    """The localisation hangs: the footprint was 0.4 s old when it came."""
    stage = clear_stage(PATIENT_LIDAR)
    stage.robot(stamp=-0.4)
    stage.wait_until(0.6)
    assert stage.status() == 'clear'
    stage.wait_until(0.601)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (TOO_OLD,)
    assert stage.state().age == pytest.approx(1.001)
    stage.robot()
    assert stage.status() == 'clear'


def test_stale_footprint_in_contact_is_unknown():
    """Where the robot is now is not known, so neither is its contact; it stays drawn."""
    stage = Stage(PATIENT_LIDAR)
    stage.robot()
    stage.see(0.5)
    stage.wait_until(1.001)
    state = stage.state()
    assert (state.status.value, state.contacts, state.reasons) == ('unknown', (), (TOO_OLD,))
    assert [name for name, _ in stage.scene.footprints] == ['robot']


def test_footprint_that_arrives_stale_is_stale_at_once():
    """The latest message wins even if it is too old: an older place is no better."""
    stage = clear_stage()
    stage.robot(stamp=-1.001)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (TOO_OLD,)


def test_latest_arrival_wins_even_with_an_earlier_stamp():
    """Two footprints overtake each other on the way; the earlier stamp goes stale earlier."""
    stage = clear_stage(PATIENT_LIDAR)
    stage.wait_until(0.5)
    stage.robot(20)
    stage.robot(10.5, stamp=0.1)
    assert stage.status() == 'collision'
    stage.wait_until(1.101)
    assert stage.status() == 'unknown'


def test_footprint_from_the_future_lives_no_longer():
    """Its publisher's clock is an hour ahead."""
    stage = clear_stage(PATIENT_LIDAR)
    stage.robot(stamp=3600.0)
    assert stage.state().age == 0.0
    stage.wait_until(1.001)
    assert stage.status() == 'unknown'


def test_footprint_without_a_stamp_counts_from_its_arrival():
    """Stamp 0 means that the publisher set none."""
    stage = clear_stage(PATIENT_LIDAR)
    stage.robot(stamp='none')
    stage.wait_until(1.0)
    assert stage.status() == 'clear'
    stage.wait_until(1.001)
    assert stage.status() == 'unknown'


def test_footprint_with_timeout_0_never_goes_stale():
    """A body that is bolted down sends its footprint once."""
    stage = clear_stage(PATIENT_LIDAR, footprints=[PATIENT_ROBOT])
    stage.wait_until(1e6)
    assert stage.status() == 'clear'


def test_refused_footprint_is_unknown_until_a_good_one():
    """One message with a NaN: the last good place is not trusted any more."""
    stage = Stage()
    stage.robot()
    stage.see(0.5)
    stage.refuse('not finite', name='robot')
    state = stage.state()
    assert (state.status.value, state.contacts, state.age) == ('unknown', (), None)
    assert state.reasons == ('footprint robot on /footprint was refused: not finite',)
    assert stage.scene.footprints == []
    stage.robot()
    assert stage.status() == 'collision'


def test_disabled_footprint_is_unknown_and_ignored():
    """A gripper's footprint is switched off, and on again."""
    stage = clear_stage()
    settings = stage.settings
    stage.scene.update(replace(settings, footprints=(replace(ROBOT, enabled=False),)))
    assert stage.robot() is None
    stage.refuse(name='robot')
    assert stage.state().reasons == ('footprint robot is disabled',)
    stage.scene.update(settings)
    assert stage.state().reasons == (UNHEARD,)
    stage.robot()
    assert stage.status() == 'clear'


def test_contact_outweighs_a_source_in_trouble():
    """A proved contact is one, whatever else is unknown; the trouble is still told."""
    stage = Stage(LIDAR, ObstacleSettings('radar', '/radar'))
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'collision'
    assert stage.state().reasons == ('obstacle source radar on /radar has not been heard yet',)
    stage.wait_until(0.1)
    stage.see(5)
    assert stage.status() == 'unknown'


def test_scene_disabled_knows_nothing_and_knows_all_when_enabled():
    """`enabled` is switched off and on: what was heard meanwhile counts."""
    stage = clear_stage()
    stage.scene.update(replace(stage.settings, enabled=False))
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == ('checking is disabled',)
    stage.scene.update(stage.settings)
    assert stage.status() == 'collision'


def test_nothing_is_known_without_a_clock():
    """With use_sim_time the time is 0 until /clock comes; a latched map that came is kept."""
    stage = Stage(PATIENT_LIDAR, start=0.0)
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons[0].startswith('no clock yet')
    assert stage.scene.changes() == ['robot']
    stage.start = 1000.0
    stage.wait_until(0.0)
    assert stage.scene.changes() == ['robot']
    assert stage.state().reasons == (TOO_OLD,)
    stage.robot()
    assert stage.status() == 'collision'


def test_step_back_in_time_drops_everything():
    """A recording starts again: what was heard lies in the future now."""
    stage = clear_stage(PATIENT_LIDAR, footprints=[PATIENT_ROBOT])
    stage.wait_until(-0.001)
    assert stage.scene.footprints == stage.scene.obstacles == []
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (UNHEARD, UNHEARD_LIDAR)
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'collision'


def test_step_back_is_noticed_with_the_first_message_too():
    """The message comes before the tick that would have noticed."""
    stage = clear_stage()
    stage.time = -5.0
    stage.see(20)
    assert stage.held == {0: 20}
    assert stage.state().reasons == (UNHEARD,)


def test_frame_of_the_first_footprint_is_that_of_the_scene():
    """No frame_id is configured."""
    stage = Stage()
    assert stage.scene.frame_id == ''
    stage.robot(frame='odom')
    assert stage.scene.frame_id == 'odom'
    assert stage.see(0.5, frame='map') == 'other frame'
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (
        'obstacle source lidar on /polygons sent what was refused: other frame',)
    stage.wait_until(0.1)
    stage.see(0.5, frame='odom')
    assert stage.status() == 'collision'


@pytest.mark.parametrize('source', [
    LIDAR, replace(LIDAR, accumulate=True), replace(LIDAR, type='polygon_instance')],
    ids=['sets', 'accumulate', 'instances'])
def test_obstacles_that_came_before_the_frame_was_known(source):
    """The first obstacles come before the first footprint, some of them in another frame."""
    stage = Stage(source)
    stage.see(0.5, frame='odom', instance=1)
    stage.see(9.5, frame='map', instance=2)
    stage.robot(frame='odom')
    assert list(stage.held.values()) == [0.5]
    assert stage.status() == 'collision'
    assert stage.state().reasons == (
        'obstacle source lidar on /polygons sent what was refused: other frame',)
    stage.wait_until(0.1)
    stage.see(0.5, frame='odom', instance=1)
    stage.see(8.5, frame='odom', instance=2)
    assert stage.status() == 'collision'
    assert stage.state().reasons == ()


def test_refusal_before_the_frame_was_known_keeps_its_reason():
    """What was not finite is not in another frame as well."""
    stage = Stage()
    stage.refuse('not finite')
    stage.robot()
    assert stage.state().reasons == (
        'obstacle source lidar on /polygons sent what was refused: not finite',)


def test_configured_frame_holds_from_the_start():
    """With frame_id set, neither the first footprint nor the first obstacle decides."""
    stage = Stage(frame_id='map')
    assert stage.see(0.5, frame='odom') == 'other frame'
    assert stage.robot(frame='odom') == 'other frame'
    assert stage.state().reasons == (
        "footprint robot on /footprint is not in the frame 'map'",
        'obstacle source lidar on /polygons sent what was refused: other frame')
    stage.wait_until(0.1)
    stage.see(0.5)
    stage.robot()
    assert stage.status() == 'collision'


def test_second_footprint_in_another_frame_is_unknown():
    """The first one decides; it is not disturbed by the other."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.see(10)
    stage.robot()
    assert stage.robot(10, name='cart', frame='odom') == 'other frame'
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'unknown')


def test_footprint_that_changes_its_frame_is_unknown():
    """Its last place in the right frame is not kept."""
    stage = clear_stage()
    stage.robot(frame='odom')
    assert stage.status() == 'unknown'
    assert stage.scene.footprints == []


def test_step_back_in_time_lets_the_frame_be_chosen_anew():
    """The next recording may be in another frame."""
    stage = clear_stage()
    stage.wait_until(-1.0)
    stage.robot(frame='odom')
    stage.see(10, frame='odom')
    assert stage.status() == 'clear'


def test_refused_footprint_does_not_choose_the_frame():
    """Only a good footprint does, and no disabled one."""
    stage = Stage(footprints=[replace(CART, enabled=False), ROBOT])
    stage.refuse(name='robot')
    stage.robot(name='cart', frame='odom')
    assert stage.scene.frame_id == ''


def test_release_waits_until_clear_without_interruption():
    """The flag does not fall while a contact flickers."""
    stage = clear_stage(PATIENT_LIDAR, footprints=[PATIENT_ROBOT], release_delay=0.0)
    stage.scene.update(replace(stage.settings, release_delay=0.5))
    stage.see(0.5)
    assert stage.status() == 'collision'
    for time, x in ((0.1, 5), (0.5, 0.5), (0.6, 5)):
        stage.wait_until(time)
        stage.see(x)
        assert stage.status() == 'collision'
    assert stage.state().contacts == ()
    assert stage.state().reasons == ('clear for less than release_delay, 0.5 s',)
    stage.scene.changes()
    stage.wait_until(1.099)
    assert (stage.status(), stage.scene.changes()) == ('collision', [])
    stage.wait_until(1.1)
    assert (stage.status(), stage.scene.changes()) == ('clear', ['robot'])
    assert stage.state().reasons == ()


def test_interruption_counts_even_if_nobody_looked():
    """A contact that came and went between two looks starts the delay again."""
    stage = Stage(PATIENT_LIDAR, footprints=[PATIENT_ROBOT], release_delay=0.5)
    stage.robot()
    stage.see(5)
    stage.wait_until(0.3)
    stage.see(0.5)
    stage.wait_until(0.4)
    stage.see(6)
    stage.wait_until(0.8)
    assert stage.status() == 'collision'
    stage.wait_until(0.9)
    assert stage.status() == 'clear'


def test_release_from_unknown_waits_too_and_keeps_its_status():
    """A sensor that drops out again and again does not make the flag flicker."""
    stage = Stage(PATIENT_LIDAR, footprints=[PATIENT_ROBOT], release_delay=0.5)
    stage.robot()
    stage.see(5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == ('clear for less than release_delay, 0.5 s',)
    stage.wait_until(0.5)
    assert stage.status() == 'clear'


def test_settings_of_a_footprint_changed_while_running():
    """Its timeout and the release delay count from the moment at which they are changed."""
    stage = clear_stage(PATIENT_LIDAR)
    stage.wait_until(1.5)
    assert stage.status() == 'unknown'
    patient = replace(stage.settings, footprints=(PATIENT_ROBOT,), release_delay=5.0)
    stage.scene.update(patient)
    assert stage.state().reasons == ('clear for less than release_delay, 5 s',)
    stage.scene.update(replace(patient, release_delay=0.0))
    assert stage.status() == 'clear'
    stage.scene.update(stage.settings)
    assert stage.state().reasons == (TOO_OLD,)


def test_rise_is_never_delayed():
    """Whatever the release delay, a contact is told at once, and so is doubt."""
    stage = Stage(footprints=[PATIENT_ROBOT], release_delay=0.5)
    stage.robot()
    stage.see(5)
    stage.wait_until(1.0)
    assert stage.status() == 'clear'
    stage.see(0.5)
    assert stage.status() == 'collision'
    stage.refuse(name='robot')
    assert stage.status() == 'unknown'


def test_changes_name_every_footprint_once_at_first():
    """The first call tells what is to be published at the start."""
    stage = Stage(footprints=[ROBOT, CART])
    assert stage.scene.changes() == ['robot', 'cart']
    assert stage.scene.changes() == []


def test_changes_name_those_whose_state_differs():
    """Contacts and reasons count as well as the status; what stays the same does not."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot()
    stage.robot(5, name='cart')
    stage.see(20)
    stage.scene.changes()
    stage.see(0.5)
    assert stage.scene.changes() == ['robot']
    stage.see(0.4)
    assert stage.scene.changes() == ['robot']
    stage.see(30)
    stage.robot(0.1)
    assert stage.scene.changes() == []
    stage.refuse()
    assert stage.scene.changes() == ['robot', 'cart']
    stage.refuse()
    assert stage.scene.changes() == []


def test_state_that_came_and_went_is_no_change():
    """Only what is so at the time of the call is compared."""
    stage = clear_stage()
    stage.scene.changes()
    stage.see(0.5)
    stage.wait_until(0.1)
    stage.burst(20, 30)
    assert stage.scene.changes() == []


def test_time_alone_makes_no_change_until_something_is_due():
    """Ticks come all the time; the age grows, but no state changes by that."""
    stage = clear_stage()
    stage.scene.changes()
    for hundredth in range(100):
        stage.wait_until(hundredth / 100)
        assert stage.scene.changes() == []
    stage.wait_until(1.01)
    assert stage.scene.changes() == ['robot']


def test_margin_makes_what_is_near_a_contact():
    """A gap of 0.5 m: a collision for a margin of 0.5 m, clear for less, both changed live."""
    stage = Stage(PATIENT_LIDAR, footprints=(PATIENT_ROBOT,), margin=0.5)
    stage.robot()
    stage.see(1.5)
    assert stage.status() == 'collision'
    for margin, status in ((0.25, 'clear'), (0.75, 'collision'), (0.0, 'clear')):
        stage.scene.update(replace(stage.settings, margin=margin))
        assert stage.status() == status
    stage.wait_until(1)
    stage.robot(0.5)
    assert stage.status() == 'collision'


def test_nearest_obstacle():
    """The nearest of two, and none where there is none."""
    stage = Stage(PATIENT_LIDAR, footprints=(PATIENT_ROBOT,))
    assert stage.scene.nearest('robot') is None
    stage.robot(10000)
    assert stage.scene.nearest('robot') is None
    stage.burst(10004, 9997)
    obstacle, separation, *_ = stage.scene.nearest('robot')
    assert (obstacle, separation) == (ObstacleId('lidar', 1), 2.0)

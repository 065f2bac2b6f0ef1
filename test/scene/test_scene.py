# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene of footprints: what it receives, its frame and clock, what it reports, contacts."""

from dataclasses import replace

from monitors import (
    CART, clear_stage, EVERY_KIND, INSTANCES, LIDAR, NOT_RECEIVED, NOTHING_SENT, POLYGONS, REFUSED,
    ROBOT, square, Stage, START, TOO_OLD, UNTIMED_LIDAR, UNTIMED_ROBOT, with_robot)
import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint, Status
from sat_collision.scene.obstacle_store import KeyedGroup, ObstacleStore
from sat_collision.scene.obstacles import Obstacle, ObstacleId
from sat_collision.scene.scene import OVERTAKEN
from sat_collision.scene.sources import TOO_OLD as OLD_OBSTACLE


def changed(stage):
    """Return the names of the footprints that have changed since the last call."""
    return stage.scene.take_changes().changed


def test_everything_is_unknown_before_any_message():
    assert Stage().state() == (Status.UNKNOWN, (), (NOT_RECEIVED, NOTHING_SENT), None)


def test_disabled_scene_is_unknown_but_still_receives():
    stage = clear_stage().use(enabled=False)
    stage.see(0.5)
    assert stage.told == ('unknown', ('checking is disabled',))
    assert stage.use(enabled=True).status() == 'collision'


def test_unknown_until_the_clock_starts():
    """With use_sim_time the time is 0 until /clock arrives; a map received before that is kept."""
    stage = with_robot(UNTIMED_LIDAR, footprints=[ROBOT], start=0.0)
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons[0].startswith('no clock yet')
    assert stage.state().reasons[0].endswith('publish /clock, or set use_sim_time to false')
    assert changed(stage) == ['robot']
    stage.start = START
    assert changed(stage.at(0.0)) == ['robot']
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
    stage = clear_stage(footprints=[UNTIMED_ROBOT]).send_all(0.5)
    for time in steps:
        assert stage.status() == 'collision'
        stage.at(time)
    assert stage.scene.footprints == []
    assert stage.told == ('unknown', tuple(
        reason.replace('yet', 'since the clock was set')
        for reason in (NOT_RECEIVED, NOTHING_SENT)))
    stage.robot()
    assert stage.status() == 'collision'
    assert stage.at(0.5).send_all(20).status() == 'collision', 'what comes was met in its middle'
    assert stage.send_all(20).status() == 'collision'
    assert stage.at(0.9991).told == ('clear', ())


def test_clock_that_goes_back_by_little_changes_nothing():
    """By no more than future_tolerance; ages stop at 0."""
    stage = clear_stage(footprints=[UNTIMED_ROBOT])
    assert stage.at(-1.0).told == ('clear', ())
    assert stage.state().age == 0.0
    assert stage.send_all(0.5).status() == 'collision'
    assert stage.send_all(10).status() == 'clear'


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
    stage.send_all(10004, 9997)
    obstacle, separation, *_ = stage.scene.nearest('robot')
    assert (obstacle, separation) == (ObstacleId('lidar', 1), 2.0)


# --- its frame


def test_frame_is_that_of_all_footprints_of_the_last_second():
    """The first footprint came in a wrong frame; obstacles follow with their next set."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot(frame='odom', name='cart')
    stage.send_all(10)
    assert stage.robot(frame='map') == 'other frame', 'they do not agree'
    assert stage.at(0.5).robot(name='cart') is None
    assert stage.scene.frame_id == 'map'
    stage.robot()
    assert stage.status('robot') == stage.status('cart') == 'unknown'
    assert stage.send_all(10).status('robot') == stage.status('cart') == 'clear'


def test_frame_ignores_footprints_older_than_a_second():
    """A footprint still in the old frame is unknown from then on."""
    stage = Stage(footprints=[ROBOT, replace(CART, timeout=0.0)])
    stage.robot(frame='odom', name='cart')
    assert stage.at(1.0).robot() == 'other frame'
    assert stage.at(1.001).robot() is None
    assert stage.state('cart').reasons[0] == (
        "footprint cart on /cart/footprint is not in the frame 'map'")


def test_first_footprint_sets_the_frame():
    stage = Stage()
    assert stage.scene.frame_id == ''
    stage.robot(frame='odom')
    assert stage.scene.frame_id == 'odom'
    assert stage.see(0.5, frame='map') == 'other frame'
    stage.end()
    assert stage.told == ('unknown', (REFUSED + 'other frame',))
    stage.at(0.1).see(0.5, frame='odom')
    assert stage.status() == 'collision'


@EVERY_KIND
def test_obstacles_received_before_the_frame_is_known(settings):
    """Those in another frame are refused then."""
    stage = Stage(settings)
    stage.see(0.5, frame='odom', instance=1)
    stage.see(9.5, frame='map', instance=2)
    stage.end()
    stage.robot(frame='odom')
    assert (stage.status(), [*stage.held.values()]) == ('collision', [0.5])
    assert stage.state().reasons[-1].endswith('a message was refused: other frame')
    for time in (0.1, 2.0, 3.2):
        stage.at(time).robot(frame='odom')
        stage.see(0.5, frame='odom', instance=1)
        stage.see(8.5, frame='odom', instance=2)
        stage.end()
        assert stage.status() == 'collision'
        assert (stage.state().reasons == ()) == (settings is LIDAR or time > 3)


def test_set_of_which_a_part_is_in_another_frame_is_not_whole():
    """Its frame is known only when the first footprint comes, before the set ends."""
    stage = Stage()
    stage.see(0.5, frame='map')
    stage.robot(frame='odom')
    stage.end()
    assert stage.status() == 'unknown'


def test_refusal_before_the_frame_is_known_keeps_its_reason():
    stage = Stage()
    stage.refuse('not finite')
    stage.end()
    stage.robot()
    assert stage.state().reasons == (REFUSED + 'not finite',)


def test_configured_frame_refuses_other_frames_from_the_start():
    stage = Stage(frame_id='map')
    assert stage.see(0.5, frame='odom') == stage.robot(frame='odom') == 'other frame'
    stage.end()
    assert stage.state().reasons == (
        "footprint robot on /footprint is not in the frame 'map'", REFUSED + 'other frame')
    stage.at(0.1).see(0.5)
    stage.robot()
    assert stage.status() == 'collision'


def test_second_footprint_in_another_frame_is_unknown():
    """The first one is not affected."""
    stage = Stage(footprints=[ROBOT, CART]).send_all(10)
    stage.robot()
    assert stage.robot(10, name='cart', frame='odom') == 'other frame'
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'unknown')


def test_footprint_that_changes_its_frame_is_unknown():
    """If no frame is configured, the frame changes and the obstacles must follow."""
    for settings in ({'frame_id': 'map'}, {}):
        stage = clear_stage(**settings)
        stage.robot(frame='odom')
        assert stage.status() == 'unknown'
        assert (stage.scene.footprints == []) == bool(settings)


def test_step_back_in_time_resets_the_frame():
    """The next recording may use another one."""
    stage = clear_stage()
    for time in (-1.0, -0.9):
        stage.at(time)
    stage.robot(frame='odom')
    for stamp in (-1.0, None):
        stage.see(10, stamp, frame='odom')
        stage.end(stamp)
    assert stage.status() == 'clear'


def test_footprint_of_before_the_clock_went_back_has_no_say_in_the_frame():
    """Otherwise there would be none until it is as late as it was."""
    stage = clear_stage(footprints=[ROBOT, CART])
    stage.robot(name='cart')
    assert stage.at(-600.0).robot(frame='odom') is None
    assert stage.scene.frame_id == 'odom'


def test_refused_or_disabled_footprint_does_not_set_the_frame():
    stage = Stage(footprints=[replace(CART, enabled=False), ROBOT])
    stage.refuse(name='robot')
    stage.robot(name='cart', frame='odom')
    assert stage.scene.frame_id == ''


# --- what is reported as changed


@pytest.fixture
def evaluated(monkeypatch):
    """Return the list of footprints that are evaluated from now on."""
    names = []

    def evaluate(self, *arguments, original=Footprint.evaluate):
        names.append(self.settings.name)
        return original(self, *arguments)
    monkeypatch.setattr(Footprint, 'evaluate', evaluate)
    return names


@pytest.fixture
def stage(evaluated):
    """Return a stage with two footprints whose states have not been reported yet."""
    stage = with_robot(footprints=[ROBOT, CART])
    stage.robot(5, name='cart')
    stage.see(20)
    evaluated.clear()
    return stage


def test_only_footprints_that_changed_are_evaluated(stage, evaluated):
    stage.see(0.5)
    assert evaluated == ['robot']
    stage.see(5.5)
    assert evaluated == ['robot', 'cart']


def test_common_fault_evaluates_every_footprint_once(stage, evaluated):
    """A fault that is set again evaluates none."""
    stage.scene.stop_clock('the clock stands still')
    assert sorted(evaluated) == ['cart', 'robot']
    assert all('clock stands still' in stage.scene.state(name).reasons[0] for name in evaluated)
    stage.scene.stop_clock('the clock stands still')
    stage.at(0.01)
    assert len(evaluated) == 2


def test_changes_are_returned_once_in_the_order_of_the_settings(stage):
    """At first every footprint is listed."""
    assert [changed(stage), changed(stage)] == [['robot', 'cart'], []]
    for name in ('cart', 'robot'):
        stage.refuse(name=name)
    assert [changed(stage), changed(stage)] == [['robot', 'cart'], []]


def test_deadline_is_when_the_first_footprint_becomes_stale(stage):
    stage.at(0.5).robot()
    assert stage.scene.deadline == stage.stamp(1)
    assert [stage.at(1.1).status(name) for name in ('robot', 'cart')] == ['unknown'] * 2
    assert stage.scene.deadline == stage.stamp(1.5)


def test_changes_include_contacts_and_reasons(stage):
    """Not only the status; footprints whose state stays the same are not listed."""
    stage.scene.take_changes()
    for x in (0.5, 0.4):
        stage.see(x)
        assert changed(stage) == ['robot']
    stage.see(30)
    stage.robot(0.1)
    assert changed(stage) == []
    for names in (['robot', 'cart'], []):
        stage.refuse()
        assert changed(stage) == names


def test_next_set_with_the_same_contacts_is_no_change():
    """Also while obstacles of both sets are held; one contact more or fewer is a change."""
    stage = clear_stage()
    stage.at(0.1).send_all(0.5, 0.6)
    assert changed(stage) == ['robot']
    stage.at(0.2).see(0.5)
    assert changed(stage) == []
    stage.see(0.7)
    assert changed(stage) == []
    stage.end()
    assert changed(stage) == []
    assert [contact.key for contact in stage.state().contacts] == [0, 1]
    stage.at(0.3).send_all(0.5)
    assert changed(stage) == ['robot']
    stage.at(0.4).see(0.5)
    stage.see(0.6)
    assert changed(stage) == ['robot']
    assert [contact.key for contact in stage.state().contacts] == [0, 1]


def test_collision_between_two_reports_is_a_brief_contact():
    """A collision that lasts, or was already reported, is not brief."""
    stage = clear_stage()
    stage.scene.take_changes()
    stage.send_all(0.5)
    stage.at(0.1).send_all(20)
    assert stage.scene.take_changes() == ([], ['robot'])
    assert stage.scene.take_changes() == ([], [])
    stage.robot(20.5)
    assert stage.scene.take_changes() == (['robot'], [])
    stage.robot(0)
    assert stage.scene.take_changes() == (['robot'], [])
    stage.robot(20.5)
    stage.at(0.2).see(40)
    assert stage.scene.take_changes() == (['robot'], [])
    stage.robot(0)
    stage.robot(20.5)
    assert stage.scene.take_changes() == ([], [])


def test_brief_contact_before_the_first_report():
    stage = Stage()
    stage.see(10)
    stage.robot(10.5)
    stage.robot()
    assert stage.scene.take_changes() == (['robot'], ['robot'])


def test_time_alone_changes_nothing_before_a_deadline():
    """The age of a footprint is not part of its reported state."""
    stage = clear_stage()
    stage.scene.take_changes()
    for hundredth in range(100):
        assert changed(stage.at(hundredth / 100)) == []
    assert changed(stage.at(1.01)) == ['robot']


def test_contacts_are_sorted_only_when_read(monkeypatch):
    """The cost of a new contact does not depend on how many there are."""
    lengths = []

    def count(names):
        lengths.append(len(names))
        return sorted(names)
    monkeypatch.setattr('sat_collision.scene.footprints.sorted', count, raising=False)
    stage = with_robot(POLYGONS)
    for k in range(200):
        stage.see(0.001 * k, stamp='none')
        assert changed(stage) == ['robot']
    assert not lengths
    assert len(stage.state().contacts) == 200
    assert len(stage.state().contacts) == 200
    assert lengths == [200]


# --- contacts of bodies that are placed, moved and removed


class Squares(Contacts):
    """Contacts of unit squares on a line."""

    def put(self, *places):
        """Place bodies where their x is."""
        for body, x in places:
            place = self.place_footprint if isinstance(body, Footprint) else self.place_obstacle
            place(body, square(x).packed)


@pytest.fixture
def contacts():
    return Squares()


@pytest.fixture
def robot():
    return Footprint(ROBOT)


def obstacles(contacts, count):
    """Return obstacles that have not been placed yet."""
    group = KeyedGroup(ObstacleStore('lidar', contacts))
    return [Obstacle(group, 'lidar', key) for key in range(count)]


def test_contact_is_recorded_on_both_sides(contacts, robot):
    """An obstacle is placed onto the footprint, then the footprint onto another obstacle."""
    near, far = obstacles(contacts, 2)
    contacts.put((robot, 0), (near, 0.5), (far, 5))
    assert (robot.contacts, near.contacts, far.contacts) == ({near}, {robot}, set())
    contacts.put((robot, 4.5))
    assert (robot.contacts, near.contacts, far.contacts) == ({far}, set(), {robot})


def test_changed_are_footprints_that_gained_or_lost_a_contact(contacts, robot):
    cart = Footprint(CART)
    person, = obstacles(contacts, 1)
    contacts.put((robot, 0), (cart, 10))
    assert contacts.changed == set()
    for x, changed in ((0.5, {robot}), (0.6, set()), (9.5, {robot, cart}), (20, {cart}),
                       (21, set())):
        contacts.changed.clear()
        contacts.put((person, x))
        assert contacts.changed == changed


def test_placing_a_body_where_it_already_is_changes_nothing(contacts):
    person, = obstacles(contacts, 1)
    contacts.put((person, 1))
    polygon = person.polygon
    contacts.put((person, 1))
    assert person.polygon is polygon
    contacts.put((person, 2))
    assert person.polygon.bounds == (2, 0, 3, 1)


def test_row_that_another_source_takes_is_monitored_by_that(contacts):
    """An obstacle takes the row of one that was removed."""
    robot = Footprint(replace(ROBOT, obstacles=('tracks',)))
    contacts.put((robot, 0))
    other, = obstacles(contacts, 1)
    contacts.put((other, 2))
    assert contacts.nearest(robot) is None
    contacts.remove_obstacle(other)
    track = Obstacle(KeyedGroup(ObstacleStore('tracks', contacts)), 'tracks', 1)
    contacts.put((track, 3), (other, 2))
    assert contacts.nearest(robot)[:2] == (track, 2.0)
    assert contacts.nearest(robot, [track]) is None


def test_removed_body_has_no_contacts_and_no_polygon(contacts, robot):
    """Removing a body twice is harmless."""
    person, wall = obstacles(contacts, 2)
    contacts.put((robot, 0), (person, 0.5), (wall, -0.5))
    contacts.changed.clear()
    contacts.remove_obstacle(person)
    assert (robot.contacts, person.contacts, person.polygon) == ({wall}, set(), None)
    assert contacts.changed == {robot}
    contacts.changed.clear()
    contacts.remove_obstacle(person)
    assert contacts.changed == set()
    contacts.remove_footprint(robot)
    assert (robot.contacts, wall.contacts, robot.polygon) == (set(), set(), None)
    assert contacts.changed == {robot}


def test_row_of_a_removed_body_is_reused_for_another(contacts, robot):
    """Even if the new body has the same vertices as the removed one."""
    gone, came = obstacles(contacts, 2)
    contacts.put((robot, 0), (gone, 0.5))
    row = gone.row
    contacts.remove_obstacle(gone)
    contacts.put((came, 0.5))
    assert came.row == row
    assert (robot.contacts, gone.contacts, came.contacts) == ({came}, set(), {robot})


def test_new_margin_updates_all_pairs(contacts, robot):
    """Only footprints whose contacts change are reported."""
    cart = Footprint(CART)
    near, far = obstacles(contacts, 2)
    contacts.put((robot, 0), (cart, 20), (near, 1.5), (far, 2.5))
    for margin, met, changed in ((0.5, {near}, {robot}), (0.75, {near}, set()),
                                 (1.5, {near, far}, {robot}), (0.0, set(), {robot})):
        contacts.changed.clear()
        contacts.use_margin(margin)
        assert (robot.contacts, contacts.changed) == (met, changed)
        assert {body for body in (near, far) if body.contacts == {robot}} == met


def test_nearest_excludes_given_obstacles(contacts, robot):
    touching, apart = obstacles(contacts, 2)
    contacts.put((touching, 0.5), (apart, 3))
    assert contacts.nearest(robot) is None
    contacts.put((robot, 0))
    assert contacts.nearest(robot)[:2] == (touching, -0.5)
    assert contacts.nearest(robot, [touching])[:2] == (apart, 2.0)
    assert contacts.nearest(robot, [touching, apart]) is None


def test_contacts_are_sorted_by_name_and_place():
    """So that all that is drawn and published of them is the same in each run."""
    stage = with_robot(INSTANCES)
    for key in reversed(range(40)):
        stage.see(key / 64, instance=key)
    stage.restart()
    for key in range(40):
        stage.see(-key / 64, stamp=0.5, instance=key)
    found = stage.scene.contacts('robot')
    assert [(obstacle.key, other.bounds[0]) for obstacle, _, other in found] == [
        place for key in range(40) for place in ((key, -key / 64), (key, key / 64))]

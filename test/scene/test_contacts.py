# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contacts of bodies that are placed, moved and removed."""

from dataclasses import replace

import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacle_store import KeyedGroup, ObstacleStore
from sat_collision.scene.obstacles import Obstacle
from stage import CART, INSTANCES, ROBOT, square, with_robot


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
        stage.see(0.01 * key, instance=key)
    stage.restart()
    for key in range(40):
        stage.see(-0.01 * key, stamp=0.5, instance=key)
    found = stage.scene.contacts('robot')
    assert [(obstacle.key, other.bounds[0]) for obstacle, _, other in found] == [
        place for key in range(40) for place in ((key, -0.01 * key), (key, 0.01 * key))]

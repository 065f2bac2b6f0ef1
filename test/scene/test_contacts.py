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

"""Contacts of bodies that are placed, moved and removed."""

from dataclasses import replace

import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.obstacles import Obstacle, ObstacleStore
from stage import CART, PATIENT_LIDAR, PATIENT_ROBOT, ROBOT, square, Stage


@pytest.fixture
def contacts():
    """Return contacts of nothing yet."""
    return Contacts()


@pytest.fixture
def robot():
    """Return a footprint that is nowhere."""
    return Footprint(ROBOT)


def obstacles(contacts, count):
    """Return obstacles that are nowhere."""
    group = ObstacleStore('lidar', contacts).new_keyed()
    return [Obstacle(group, 'lidar', key, key) for key in range(count)]


def test_each_side_knows_of_the_contact_whichever_is_placed_last(contacts, robot):
    """An obstacle comes to the footprint, and the footprint to another one."""
    near, far = obstacles(contacts, 2)
    contacts.place_footprint(robot, square(0).packed)
    contacts.place_obstacle(near, square(0.5).packed)
    contacts.place_obstacle(far, square(5).packed)
    assert (robot.contacts, near.contacts, far.contacts) == ({near}, {robot}, set())
    contacts.place_footprint(robot, square(4.5).packed)
    assert (robot.contacts, near.contacts, far.contacts) == ({far}, set(), {robot})


def test_changed_are_footprints_that_gained_or_lost_a_contact(contacts, robot):
    """None whose contacts stay the same while somebody moves."""
    cart = Footprint(CART)
    person, = obstacles(contacts, 1)
    contacts.place_footprint(robot, square(0).packed)
    contacts.place_footprint(cart, square(10).packed)
    assert contacts.changed == set()
    for x, changed in ((0.5, {robot}), (0.6, set()), (9.5, {robot, cart}), (20, {cart}),
                       (21, set())):
        contacts.changed.clear()
        contacts.place_obstacle(person, square(x).packed)
        assert contacts.changed == changed


def test_body_placed_where_it_is_stays_as_it_is(contacts):
    """It differs from one that has moved, and from one that is nowhere."""
    person, = obstacles(contacts, 1)
    assert contacts.place_obstacle(person, square(1).packed)
    polygon = person.polygon
    assert not contacts.place_obstacle(person, square(1).packed)
    assert person.polygon is polygon
    assert contacts.place_obstacle(person, square(2).packed)
    assert person.polygon.bounds == (2, 0, 3, 1)


def test_removed_body_meets_nothing_and_is_nowhere(contacts, robot):
    """Either side; to remove what is nowhere does no harm."""
    person, wall = obstacles(contacts, 2)
    contacts.place_footprint(robot, square(0).packed)
    contacts.place_obstacle(person, square(0.5).packed)
    contacts.place_obstacle(wall, square(-0.5).packed)
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


def test_body_in_the_row_of_a_removed_one_is_another(contacts, robot):
    """It is placed although the row last held the very same body."""
    gone, came = obstacles(contacts, 2)
    contacts.place_footprint(robot, square(0).packed)
    contacts.place_obstacle(gone, square(0.5).packed)
    row = gone.row
    contacts.remove_obstacle(gone)
    assert contacts.place_obstacle(came, square(0.5).packed)
    assert came.row == row
    assert (robot.contacts, gone.contacts, came.contacts) == ({came}, set(), {robot})


def test_margin_decides_all_pairs_anew(contacts, robot):
    """Footprints for which nothing changes by it are not reported."""
    cart = Footprint(CART)
    near, far = obstacles(contacts, 2)
    contacts.place_footprint(robot, square(0).packed)
    contacts.place_footprint(cart, square(20).packed)
    contacts.place_obstacle(near, square(1.5).packed)
    contacts.place_obstacle(far, square(2.5).packed)
    for margin, met, changed in ((0.5, {near}, {robot}), (0.75, {near}, set()),
                                 (1.5, {near, far}, {robot}), (0.0, set(), {robot})):
        contacts.changed.clear()
        contacts.use_margin(margin)
        assert (robot.contacts, contacts.changed) == (met, changed)
        assert {body for body in (near, far) if body.contacts == {robot}} == met


def test_nearest_leaves_out_what_it_is_told_to(contacts, robot):
    """Obstacles in contact, say; there may be nothing left."""
    touching, apart = obstacles(contacts, 2)
    contacts.place_obstacle(touching, square(0.5).packed)
    contacts.place_obstacle(apart, square(3).packed)
    assert contacts.nearest(robot) is None
    contacts.place_footprint(robot, square(0).packed)
    assert contacts.nearest(robot)[:2] == (touching, -0.5)
    assert contacts.nearest(robot, [touching])[:2] == (apart, 2.0)
    assert contacts.nearest(robot, [touching, apart]) is None


def test_margin_makes_what_is_near_a_contact():
    """A gap of 0.5 m: a collision for a margin of 0.5 m, clear for less, both changed live."""
    stage = Stage(PATIENT_LIDAR, footprints=(PATIENT_ROBOT,), margin=0.5)
    stage.robot()
    stage.send(1.5)
    assert stage.status() == 'collision'
    for margin, status in ((0.25, 'clear'), (0.75, 'collision'), (0.0, 'clear')):
        stage.scene.update(replace(stage.settings, margin=margin))
        assert stage.status() == status
    stage.wait_until(1)
    stage.robot(0.5)
    assert stage.status() == 'collision'

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

"""Which states are told as changed, and which footprints are evaluated for that."""

import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.evaluations import Evaluations
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.settings import Settings
from sat_collision.scene.sources import Source
from stage import ACCUMULATED, CART, clear_stage, LIDAR, ROBOT, Stage

SECOND = 10**9


@pytest.fixture
def changed():
    """Return the set of footprints for which something has changed."""
    return set()


@pytest.fixture
def footprints(changed):
    """Return two footprints by name, good since 0, with nothing found of them yet."""
    footprints = {settings.name: Footprint(settings) for settings in (ROBOT, CART)}
    for footprint in footprints.values():
        footprint.time = 0
    changed.update(footprints.values())
    return footprints


@pytest.fixture
def evaluations(footprints, changed):
    """Return what evaluates the two, with nothing reported yet."""
    return Evaluations(footprints, changed, {})


def test_only_footprints_that_changed_are_evaluated(footprints, changed, evaluations):
    """The other keeps what was found before, though by now it is stale."""
    evaluations.evaluate(now=0, release_delay=0)
    assert not changed
    assert evaluations.changes() == ['robot', 'cart']
    changed.add(footprints['cart'])
    evaluations.evaluate(now=2 * SECOND, release_delay=0)
    assert [footprint.status.value for footprint in footprints.values()] == ['clear', 'unknown']
    assert evaluations.changes() == ['cart']


def test_other_faults_concern_all_footprints(footprints, changed, evaluations):
    """The same again concern none."""
    settings = Settings((ROBOT, CART), (LIDAR,))
    lidar = Source(LIDAR, Contacts())
    evaluations.evaluate(now=0, release_delay=0)
    evaluations.find_faults(settings, SECOND, False, [lidar])
    assert changed == set(footprints.values())
    evaluations.evaluate(now=0, release_delay=0)
    assert [footprint.evaluation[1] for footprint in footprints.values()] == [lidar.faults] * 2
    evaluations.find_faults(settings, 2 * SECOND, False, [lidar])
    assert not changed


def test_changes_are_told_once_and_in_the_order_of_the_settings(footprints, changed, evaluations):
    """However many evaluations lie between two reports."""
    evaluations.evaluate(now=0, release_delay=0)
    assert evaluations.changes() == ['robot', 'cart']
    for name in ('cart', 'robot'):
        footprints[name].fault = 'was refused: not finite'
        changed.add(footprints[name])
        evaluations.evaluate(now=0, release_delay=0)
    assert evaluations.changes() == ['robot', 'cart']
    assert evaluations.changes() == []


def test_evaluation_tells_when_something_changes_by_itself(footprints, changed, evaluations):
    """The footprint that becomes stale first."""
    footprints['cart'].time = SECOND
    assert evaluations.evaluate(now=SECOND, release_delay=0) == SECOND
    changed.add(footprints['cart'])
    assert evaluations.evaluate(now=SECOND, release_delay=0) == 2 * SECOND


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


def test_next_set_with_the_same_contacts_is_no_change():
    """Nor is it while both sets are there; a name less or more is one."""
    stage = clear_stage()
    stage.wait_until(0.1)
    stage.send(0.5, 0.6)
    assert stage.scene.changes() == ['robot']
    stage.wait_until(0.2)
    stage.see(0.5)
    assert stage.scene.changes() == []
    stage.see(0.7)
    assert stage.scene.changes() == []
    stage.end()
    assert stage.scene.changes() == []
    assert [contact.key for contact in stage.state().contacts] == [0, 1]
    stage.wait_until(0.3)
    stage.send(0.5)
    assert stage.scene.changes() == ['robot']
    stage.wait_until(0.4)
    stage.see(0.5)
    stage.see(0.6)
    assert stage.scene.changes() == ['robot']
    assert [contact.key for contact in stage.state().contacts] == [0, 1]


def test_state_that_came_and_went_is_no_change():
    """Only what is so at the time of the call is compared."""
    stage = clear_stage()
    stage.scene.changes()
    stage.see(0.5)
    stage.wait_until(0.1)
    stage.send(20, 30)
    assert stage.scene.changes() == []


def test_collision_that_came_and_went_is_told_as_brief():
    """Until the changes are told; one that stays, or was reported before, is none."""
    stage = clear_stage()
    stage.scene.changes()
    stage.see(0.5)
    assert stage.scene.evaluations.brief_contacts() == []
    stage.wait_until(0.1)
    stage.see(20)
    assert stage.scene.evaluations.brief_contacts() == []
    stage.end()
    assert stage.scene.evaluations.brief_contacts() == ['robot']
    assert stage.scene.changes() == []
    assert stage.scene.evaluations.brief_contacts() == []
    stage.robot(20.5)
    stage.scene.changes()
    stage.robot(0)
    assert stage.scene.evaluations.brief_contacts() == []


def test_first_collision_may_be_brief():
    """It came and went before anything was ever reported."""
    stage = Stage()
    stage.see(10)
    stage.robot(10.5)
    stage.robot()
    assert stage.scene.evaluations.brief_contacts() == ['robot']


def test_time_alone_makes_no_change_until_something_is_due():
    """Ticks come all the time; the age grows, but no state changes by that."""
    stage = clear_stage()
    stage.scene.changes()
    for hundredth in range(100):
        stage.wait_until(hundredth / 100)
        assert stage.scene.changes() == []
    stage.wait_until(1.01)
    assert stage.scene.changes() == ['robot']


def test_contacts_that_begin_one_by_one_are_not_sorted_each_time(monkeypatch):
    """What a new contact costs does not depend on how many there are, until somebody asks."""
    lengths = []

    def count(names):
        lengths.append(len(names))
        return sorted(names)
    monkeypatch.setattr('sat_collision.scene.footprints.sorted', count, raising=False)
    stage = Stage(ACCUMULATED)
    stage.robot()
    for k in range(200):
        stage.see(0.001 * k, stamp='none')
        assert stage.scene.changes() == ['robot']
    assert not lengths
    assert len(stage.state().contacts) == 200
    assert len(stage.state().contacts) == 200
    assert lengths == [200]

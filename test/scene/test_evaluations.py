# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Which states are reported as changed, and which footprints are evaluated for that."""

import pytest
from sat_collision.scene.footprints import Footprint
from stage import CART, clear_stage, POLYGONS, ROBOT, Stage


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
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot()
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
    assert stage.scene.take_changes().changed == ['robot', 'cart']
    assert stage.scene.take_changes().changed == []
    for name in ('cart', 'robot'):
        stage.refuse(name=name)
    assert stage.scene.take_changes().changed == ['robot', 'cart']
    assert stage.scene.take_changes().changed == []


def test_deadline_is_when_the_first_footprint_becomes_stale(stage):
    stage.at(0.5).robot()
    assert stage.scene.deadline == stage.stamp(1)
    stage.at(1.1)
    assert [stage.status(name) for name in ('robot', 'cart')] == ['unknown'] * 2
    assert stage.scene.deadline == stage.stamp(1.5)


def test_changes_include_contacts_and_reasons(stage):
    """Not only the status; footprints whose state stays the same are not listed."""
    stage.scene.take_changes()
    stage.see(0.5)
    assert stage.scene.take_changes().changed == ['robot']
    stage.see(0.4)
    assert stage.scene.take_changes().changed == ['robot']
    stage.see(30)
    stage.robot(0.1)
    assert stage.scene.take_changes().changed == []
    stage.refuse()
    assert stage.scene.take_changes().changed == ['robot', 'cart']
    stage.refuse()
    assert stage.scene.take_changes().changed == []


def test_next_set_with_the_same_contacts_is_no_change():
    """Also while obstacles of both sets are held; one contact more or fewer is a change."""
    stage = clear_stage()
    stage.at(0.1).send(0.5, 0.6)
    assert stage.scene.take_changes().changed == ['robot']
    stage.at(0.2).see(0.5)
    assert stage.scene.take_changes().changed == []
    stage.see(0.7)
    assert stage.scene.take_changes().changed == []
    stage.end()
    assert stage.scene.take_changes().changed == []
    assert [contact.key for contact in stage.state().contacts] == [0, 1]
    stage.at(0.3).send(0.5)
    assert stage.scene.take_changes().changed == ['robot']
    stage.at(0.4).see(0.5)
    stage.see(0.6)
    assert stage.scene.take_changes().changed == ['robot']
    assert [contact.key for contact in stage.state().contacts] == [0, 1]


def test_collision_between_two_reports_is_a_brief_contact():
    """A collision that lasts, or was already reported, is not brief."""
    stage = clear_stage()
    stage.scene.take_changes()
    stage.send(0.5)
    stage.at(0.1).send(20)
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
        assert stage.at(hundredth / 100).scene.take_changes().changed == []
    assert stage.at(1.01).scene.take_changes().changed == ['robot']


def test_contacts_are_sorted_only_when_read(monkeypatch):
    """The cost of a new contact does not depend on how many there are."""
    lengths = []

    def count(names):
        lengths.append(len(names))
        return sorted(names)
    monkeypatch.setattr('sat_collision.scene.footprints.sorted', count, raising=False)
    stage = Stage(POLYGONS)
    stage.robot()
    for k in range(200):
        stage.see(0.001 * k, stamp='none')
        assert stage.scene.take_changes().changed == ['robot']
    assert not lengths
    assert len(stage.state().contacts) == 200
    assert len(stage.state().contacts) == 200
    assert lengths == [200]

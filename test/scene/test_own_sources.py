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

"""Footprints with sources of their own: what the others send is nothing to them."""

from dataclasses import replace

import pytest
from sat_collision.scene.parameters import ParameterError
from stage import CART, findings, LIDAR, PATIENT_ROBOT, Stage
from test_scene import settings_of

DOCK = replace(LIDAR, name='dock', topic='/dock', timeout=100.0)
WALLS = replace(LIDAR, name='walls', topic='/walls', timeout=100.0)
BOTH = DOCK, WALLS


def stage_of(*own):
    """Return a stage with a dock that the robot stands in, and walls that are far."""
    stage = Stage(*BOTH, footprints=[replace(PATIENT_ROBOT, obstacles=own)])
    stage.robot()
    for name, x in (('dock', 0.5), ('walls', 7.0)):
        stage.see(x, name=name)
        stage.end(name=name)
    return stage


def monitor(stage, *own):
    """Give the robot other sources of its own while the scene runs."""
    robot = replace(stage.settings.footprints[0], obstacles=own)
    stage.settings = replace(stage.settings, footprints=(robot,))
    stage.scene.update(stage.settings)


def test_dock_is_left_out_while_docking():
    """Then it counts again, at once; what stays goes on."""
    stage = stage_of()
    assert stage.status() == 'collision'
    monitor(stage, 'walls')
    assert stage.status() == 'clear'
    assert stage.scene.nearest('robot')[:2] == (('walls', 0), 6.0)
    stage.robot(0.1)
    stage.see(0.2, stamp=0.03, name='dock')
    assert stage.status() == 'clear'
    monitor(stage)
    assert stage.state().contacts == (('dock', 0),)
    assert stage.scene.nearest('robot')[0] == ('dock', 0)


def test_own_obstacles_are_met_however_they_come():
    """The wall comes to the robot, then the robot goes to the wall; the margin counts."""
    stage = stage_of('walls')
    stage.see(0.9, stamp=0.03, name='walls')
    assert stage.status() == 'collision'
    stage.see(7.0, stamp=0.06, name='walls')
    stage.end(0.06, 'walls')
    assert stage.status() == 'clear'
    stage.robot(6.5)
    assert stage.status() == 'collision'
    stage.robot(5.8)
    assert stage.status() == 'clear'
    stage.scene.update(replace(stage.settings, margin=0.5))
    assert stage.state().contacts == (('walls', 0),)


def test_faults_of_other_sources_are_nothing_to_it():
    """The lidar of one robot is silent, and what the dock sends is refused."""
    robot = replace(PATIENT_ROBOT, obstacles=('walls',))
    cart = replace(CART, timeout=0.0, obstacles=('lidar', 'walls'))
    all_seeing = replace(CART, name='all', timeout=0.0)
    stage = Stage(*BOTH, LIDAR, footprints=[robot, cart, all_seeing])
    for name in ('robot', 'cart', 'all'):
        stage.robot(name=name)
    for name in ('dock', 'walls', 'lidar'):
        stage.see(9, name=name)
        stage.end(name=name)
    assert stage.status('all') == 'clear'
    stage.wait_until(2.001)
    stage.refuse(name='dock')
    silent = ('obstacle source lidar on /polygons has been silent for longer than its timeout of '
              '2 s')
    refused = 'obstacle source dock on /dock sent what was refused: not finite'
    assert findings(stage) == ('clear', ())
    assert stage.state('cart').reasons == (silent,)
    assert stage.state('all').reasons == (refused, silent)


def test_nothing_is_known_with_all_own_sources_disabled():
    """Though another one is enabled and well."""
    stage = stage_of('walls')
    stage.scene.update(replace(stage.settings, obstacles=(DOCK, replace(WALLS, enabled=False))))
    assert findings(stage) == ('unknown', ('none of its obstacle sources is enabled',))


def test_sources_are_given_by_name():
    """Empty names are none; a name that is not there is refused with the one that was meant."""
    given = {'obstacles': ['walls', 'dock'], 'footprints': ['a', 'b']}
    a, b = settings_of(**given, a__obstacles=['walls'], b__obstacles=['']).footprints
    assert (a.obstacles, b.obstacles) == (('walls',), ())
    with pytest.raises(ParameterError, match=(
            r"^a.obstacles: there is no obstacle source 'wals'; did you mean 'walls'\?$")):
        settings_of(**given, a__obstacles=['dock', 'wals'])
    with pytest.raises(ParameterError, match="^b.obstacles: there is no obstacle source 'x'$"):
        settings_of(**given, b__obstacles=['x'])

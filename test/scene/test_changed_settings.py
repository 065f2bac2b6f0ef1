# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Settings that change while the scene runs: what others have proved is proved no more."""

from dataclasses import replace

import pytest
from stage import (
    known_stage, LIDAR, LIDAR_SAYS, pass_by, REFRESHED, SILENT, status_and_reasons, UNTIMED_LIDAR,
    with_robot)


def change(stage, **changes):
    """Change the settings of the source."""
    source, = stage.settings.obstacles
    stage.settings = replace(stage.settings, obstacles=(replace(source, **changes),))
    stage.scene.update(stage.settings)


@REFRESHED
def test_a_longer_timeout_is_unknown_until_it_has_passed(settings):
    """An obstacle that is sent every 5 s was forgotten after the 2 s of before."""
    stage = known_stage(settings)
    stage.see(0.5, instance=2)
    for time in (1.5, 3.0):
        stage.at(time).see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())
    change(stage, timeout=6.0)
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 6 s and future_tolerance, 1 s, '
        'without a gap since its parameters were changed',))
    stage.at(5.0).see(0.5, instance=2)
    assert stage.status() == 'collision'
    pass_by(stage, 10.0, 11.5)
    assert status_and_reasons(stage) == ('clear', ())


@REFRESHED
def test_a_shorter_timeout_forgets_sooner_and_all_stays_known(settings):
    stage = known_stage(settings)
    change(stage, timeout=0.1)
    stage.at(0.1).see(0.5, instance=1)
    stage.at(0.2).see(10, instance=2)
    assert status_and_reasons(stage) == ('collision', ())
    pass_by(stage, 0.204)
    assert status_and_reasons(stage) == ('clear', ())


def test_timeout_of_sets_can_be_changed_live():
    """A shorter one forgets at once; a longer one restores neither obstacles nor knowledge."""
    stage = with_robot(LIDAR)
    stage.send(0.5)
    stage.at(1.5)
    change(stage, timeout=10.0)
    stage.send(0.5)
    assert status_and_reasons(stage.at(9.0)) == ('collision', (
        LIDAR_SAYS + 'has not sent a whole set since its parameters were changed',))
    change(stage, timeout=5.0)
    assert status_and_reasons(stage) == ('unknown', (SILENT.replace('of 2 s', 'of 5 s'),))
    change(stage, timeout=0.0)
    assert stage.status() == 'unknown' and stage.held == {}
    stage.send()
    stage.send()
    assert status_and_reasons(stage) == ('clear', ())
    change(stage, timeout=2.0)
    assert status_and_reasons(stage) == ('clear', ())


def test_set_of_which_some_was_too_old_is_not_whole_for_a_longer_timeout():
    stage = known_stage(LIDAR)
    stage.time = 2.5
    stage.see(0.5, stamp=0.1)
    change(stage, timeout=4.0)
    stage.end(stamp=0.1)
    assert stage.status() == 'unknown'
    stage.send(10)
    assert status_and_reasons(stage) == ('clear', ())


@pytest.mark.parametrize('before, after', [
    ({'timeout': 2.0}, {'timeout': 0.0}), ({'max_count': 1}, {'max_count': 10})])
def test_map_that_now_has_room_is_requested_again(before, after):
    """The publisher of a latched map sends it only once."""
    stage = with_robot(replace(UNTIMED_LIDAR, **before))
    for x in (10, 20):
        stage.see(x, stamp=-100.0)
    assert stage.status() == 'unknown' and not stage.scene.wants_history('lidar')
    change(stage, **after)
    assert stage.status() == 'unknown' and stage.scene.wants_history('lidar')
    stage.scene.renew('lidar')
    stage.restart()
    stage.send(10, 20, stamp=-100.0)
    assert status_and_reasons(stage) == ('clear', ())
    change(stage, max_count=20)
    assert not stage.scene.wants_history('lidar'), 'it is known'


def test_footprints_that_came_while_disabled_were_not_lost():
    stage = known_stage(LIDAR)
    for enabled in (False, True):
        stage.settings = replace(stage.settings, footprints=(
            replace(stage.settings.footprints[0], enabled=enabled),))
        stage.scene.update(stage.settings)
        stage.robot()
        stage.robot()
    assert stage.scene.lost() == {}
    stage.lose(name='robot')
    stage.robot()
    assert stage.scene.lost() == {'robot': 1}

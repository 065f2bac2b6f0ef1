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

"""Settings that change while the scene runs: what others have proved is proved no more."""

from dataclasses import replace

import pytest
from stage import (
    INSTANCES, known_stage, LIDAR, LIDAR_SAYS, status_and_reasons, UNTIMED_LIDAR, with_robot)


def change(stage, **changes):
    """Change the settings of the source."""
    source, = stage.settings.obstacles
    stage.settings = replace(stage.settings, obstacles=(replace(source, **changes),))
    stage.scene.update(stage.settings)


def test_ids_are_unknown_for_a_longer_timeout():
    """An obstacle that is sent every 5 s was forgotten after the 2 s of before."""
    stage = known_stage(INSTANCES)
    stage.see(0.5, instance=0)
    for time in (1.5, 3.0):
        stage.wait_until(time)
        stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())
    change(stage, timeout=6.0)
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 6 s without a gap since its '
        'parameters were changed',))
    stage.wait_until(5.0)
    stage.see(0.5, instance=0)
    assert stage.status() == 'collision'
    for time in (8.9, 9.0):
        stage.see(20, instance=0)
        assert stage.status() == 'unknown'
        stage.wait_until(time)
        stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())


def test_ids_stay_known_for_a_shorter_timeout():
    stage = known_stage(INSTANCES)
    stage.see(10, instance=0)
    change(stage, timeout=1.0)
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


@pytest.mark.parametrize('changes', [{'set_window': 0.1}, {'max_count': 3}])
def test_set_that_was_cut_in_two_is_not_whole_for_a_greater_window_or_count(changes):
    """The robot touches the first of three obstacles, 30 ms apart, each a set so far."""
    stage = known_stage(LIDAR)
    stage.see(0.5, stamp=0.0)
    stage.time = 0.03
    stage.see(10)
    stage.time = 0.06
    stage.see(20)
    assert status_and_reasons(stage) == ('clear', ())
    change(stage, **changes)
    for time in (0.06, 1.0):
        stage.wait_until(time)
        assert status_and_reasons(stage) == ('unknown', (
            LIDAR_SAYS + 'has not sent a whole set since its parameters were changed',))
        stage.end()
    stage.wait_until(2.0)
    stage.send(10, 20)
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

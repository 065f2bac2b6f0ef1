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

"""Obstacles that are refused, or exceed max_count: unknown until a valid replacement."""

from dataclasses import replace

from sat_collision.scene.contacts import Contacts
from sat_collision.scene.settings import ObstacleSettings
from sat_collision.scene.sources import Source
from stage import (
    POLYGONS, EVERY_KIND, INSTANCES, REFRESHED, known_stage, LIDAR, LIDAR_SAYS, nanoseconds,
    REFUSED, square, START, status_and_reasons, with_robot)


def test_refused_obstacle_of_a_set_counts_until_the_next_whole_set():
    """There is an obstacle at an unknown place; other sources are not affected."""
    stage = with_robot(LIDAR, ObstacleSettings('radar', '/radar'))
    stage.send(9, name='radar')
    stage.see(10)
    stage.refuse()
    stage.see(30)
    stage.end()
    assert stage.held == {0: (9, 10), 2: 30}
    assert status_and_reasons(stage) == ('unknown', (REFUSED + 'not finite',))
    stage.see(0.5, name='radar')
    assert status_and_reasons(stage) == ('collision', (REFUSED + 'not finite',))
    stage.send(name='radar', stamp=0.0)
    stage.wait_until(0.1)
    stage.see(11)
    assert status_and_reasons(stage) == ('collision', (REFUSED + 'not finite',))
    stage.end()
    assert status_and_reasons(stage) == ('collision', ())


def test_refused_instance_counts_until_it_is_replaced_or_times_out():
    for is_mended in (True, False):
        stage = known_stage(INSTANCES)
        stage.refuse(instance=1)
        stage.wait_until(0.5)
        stage.see(10, instance=2)
        assert status_and_reasons(stage) == ('unknown', (REFUSED + 'not finite',))
        if is_mended:
            stage.see(10, instance=1)
        else:
            stage.wait_until(2.0)
            stage.see(10, instance=2)
            assert stage.status() == 'unknown'
            stage.wait_until(2.001)
            stage.see(10, instance=2)
        assert status_and_reasons(stage) == ('clear', ())


@EVERY_KIND
def test_undecodable_message_is_a_gap(settings):
    """It may be of this set, or of any key."""
    stage = known_stage(settings)
    stage.send_garbage()
    stage.wait_until(0.1)
    stage.see(10, instance=1)
    stage.end()
    stage.wait_until(2.001)
    assert stage.status() == 'unknown'
    stage.see(10, instance=1)
    stage.end()
    assert status_and_reasons(stage) == ('clear', ())


def test_refused_accumulated_polygon_is_a_gap():
    """It has no key, since accumulated polygons are their own keys."""
    stage = known_stage(POLYGONS)
    stage.refuse('self-intersecting')
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 2 s without a gap since a message '
        'was refused: self-intersecting',))
    stage.wait_until(2.0)
    stage.end()
    assert status_and_reasons(stage) == ('clear', ())


def test_each_reason_for_refusal_is_listed_once():
    stage = with_robot(LIDAR)
    for reason in ('not finite', 'self-intersecting', 'not finite'):
        stage.refuse(reason)
    stage.end()
    assert stage.state().reasons == (REFUSED + 'not finite', REFUSED + 'self-intersecting')
    stage.wait_until(0.1)
    stage.refuse('not finite')
    assert len(stage.state().reasons) == 2
    stage.end()
    assert stage.state().reasons == (REFUSED + 'not finite',)


def test_set_beyond_max_count_is_unknown_until_a_set_fits():
    stage = with_robot(replace(LIDAR, max_count=2))
    stage.send(10, 20)
    assert stage.status() == 'clear'
    for time in (0.1, 0.2):
        stage.wait_until(time)
        for x in (11, 21):
            stage.see(x)
        assert stage.status() == ('clear' if time == 0.1 else 'unknown')
        assert stage.see(30) == stage.see(40) == 'too many obstacles'
        assert status_and_reasons(stage) == ('unknown', (REFUSED + 'too many obstacles',))
    stage.wait_until(0.3)
    stage.send(12, 22)
    assert status_and_reasons(stage) == ('clear', ())


@REFRESHED
def test_more_keys_than_max_count_are_a_gap(settings):
    """The obstacle left out may exist until its timeout."""
    stage = known_stage(replace(settings, max_count=2))
    stage.see(10, instance=1)
    stage.see(20, instance=2)
    assert stage.see(30, instance=3) == 'too many obstacles'
    assert sorted(stage.held.values()) == [10, 20]
    stage.wait_until(1.999)
    stage.see(20, instance=2)
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 2 s without a gap since there '
        'were too many obstacles',))
    stage.wait_until(2.001)
    stage.end()
    assert stage.see(40, instance=4) is None
    assert status_and_reasons(stage) == ('clear', ())


@EVERY_KIND
def test_memory_is_bounded_by_max_count(settings):
    """One publisher sends thousands of valid and invalid obstacles at once."""
    source = Source(replace(settings, max_count=5), Contacts())
    now = nanoseconds(START)
    for number in range(1000):
        source.receive(square(number).packed, 'map', now, now, number, 2 * number + 1)
        source.receive(None, 'map', now, now, -1 - number, 2 * number + 2, 'not finite')
    obstacles = [body for body in source.store if body.polygon is not None]
    assert 2 < len(obstacles) <= 5
    assert len(list(source.store)) <= 7

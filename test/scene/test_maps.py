# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Maps, which do not age: when one is whole, replaced, placed anew or requested again."""

from dataclasses import replace

import pytest
from sat_collision.scene.obstacle_store import Followed
from sat_collision.scene.streams import Endpoint
from stage import LIDAR_SAYS, square, UNTIMED_LIDAR, with_robot


@pytest.mark.parametrize('back', [0.0, 0.5, 3600.0])
def test_map_sent_again_after_its_clock_went_back_is_whole(back):
    """Also where our clock goes back with it; of the map before nothing stays."""
    stage = with_robot(UNTIMED_LIDAR).send(0.5, 20)
    stage.at(-back).robot()
    assert stage.told == ('collision', ())
    assert stage.send(0.5, 20, stamp=-7200.0).told == ('collision', ())
    assert stage.held == {0: 0.5, 1: 20}
    assert stage.send(20, 30, stamp=-7201.0).told == ('clear', ())
    assert stage.held == {0: 20, 1: 30}


def followed_map():
    """Return a stage with a part of a map at 10, whose frame can be followed."""
    stage = with_robot(UNTIMED_LIDAR)
    stage.scene.obstacle('lidar', Followed(square(10).packed, ('map2', 'points')), 'map',
                         stage.now, stage.now, None, stage.number('lidar'))
    return stage


def test_map_follows_its_frame():
    """Its static transform is corrected; where it is not valid any more it is not known."""
    stage = followed_map()
    assert stage.send(20).status() == 'clear'
    assert stage.scene.sources['lidar'].store.frames == {'map2'}
    stage.scene.follow_frame('lidar', 'map2', lambda sent: square(0.5).packed)
    assert stage.status() == 'collision' and stage.held == {0: 0.5, 1: 20}
    stage.scene.follow_frame('lidar', 'map2', lambda sent: None)
    assert stage.told == ('unknown', (
        LIDAR_SAYS + 'has not sent a whole map since a part of it is not valid where its frame '
        'has moved',))
    assert stage.send(10).told == ('clear', ())


@pytest.mark.parametrize('pass_by_time', [True, False])
def test_map_in_a_frame_that_is_not_known_is_not_known(pass_by_time):
    """Its transform is past the footprint's timeout, or of a clock that went back since."""
    stage = followed_map()
    stage.end()
    stage.scene.limit_frames('lidar', {'map2': ('', stage.stamp(5.0))})
    assert stage.at(5.0).told == ('clear', ())
    stage.at(5.001 if pass_by_time else -5.0).robot()
    assert stage.told == (
        'unknown', (LIDAR_SAYS + 'is a map in a frame whose transform is too old',))
    stage.scene.limit_frames('lidar', {'map2': ('', stage.stamp(60.0))})
    assert stage.told == ('clear', ())


def test_open_update_of_a_map_makes_it_unknown_though_the_clock_goes_back():
    """Its publisher has begun to send another one, and died."""
    for back in (1.001, -3600.0):
        stage = with_robot(UNTIMED_LIDAR).send(10)
        stage.see(20)
        stage.at(back).robot()
        assert stage.told == ('unknown', (
            LIDAR_SAYS + 'has not sent a whole map since it began to send another one',))


def test_map_of_which_a_part_was_lost_is_requested_again():
    """Its publisher keeps what it has sent: number 1 comes again."""
    stage = with_robot(UNTIMED_LIDAR).publish_by('a')
    assert stage.scene.wants_history('lidar'), 'it may have sent its map already'
    stage.see(10)
    assert not stage.scene.wants_history('lidar')
    stage.lose()
    stage.see(20)
    assert stage.scene.wants_history('lidar')
    stage.publish_by('a', 'b')
    assert not stage.scene.wants_history('lidar'), 'of two'
    stage.publish_by('a')
    stage.restart()
    stage.scene.renew('lidar')
    assert stage.send(10, 20, 30).told == ('clear', ())
    assert sorted(stage.held.values()) == [10, 20, 30]
    assert not stage.scene.wants_history('lidar')


def test_map_stays_until_a_new_publisher_sends_a_whole_one():
    stage = with_robot(UNTIMED_LIDAR).publish_by('a')
    stage.send(0.5)
    stage.publish_by()
    assert stage.at(100.0).told == ('collision', (LIDAR_SAYS + 'has no publisher',))
    stage.publish_by('b')
    stage.restart()
    stage.see(10)
    assert stage.status() == 'collision'
    stage.end()
    assert stage.told == ('clear', ())
    assert list(stage.held.values()) == [10]


def test_map_of_a_killed_publisher_stays_until_its_lease_ends():
    """Until then it counts beside the whole map of the respawned node."""
    stage = with_robot(UNTIMED_LIDAR)
    killed, respawned = Endpoint('a', '/map'), Endpoint('b', '/map')
    for publishers, x in (([killed], 0.5), ([killed, respawned], 10)):
        stage.scene.update_publishers('lidar', publishers)
        stage.restart()
        assert stage.send(x).told == ('collision', ())
    stage.scene.update_publishers('lidar', [respawned])
    assert stage.told == ('clear', ())
    assert list(stage.held.values()) == [10]


@pytest.mark.parametrize('before, after', [
    ({'timeout': 2.0}, {'timeout': 0.0}), ({'max_count': 1}, {'max_count': 10})])
def test_map_that_now_has_room_is_requested_again(before, after):
    """The publisher of a latched map sends it only once."""
    stage = with_robot(replace(UNTIMED_LIDAR, **before))
    for x in (10, 20):
        stage.see(x, stamp=-100.0)
    assert stage.status() == 'unknown' and not stage.scene.wants_history('lidar')
    assert stage.use('lidar', **after).status() == 'unknown' and stage.scene.wants_history('lidar')
    stage.scene.renew('lidar')
    stage.restart()
    assert stage.send(10, 20, stamp=-100.0).told == ('clear', ())
    stage.use('lidar', max_count=20)
    assert not stage.scene.wants_history('lidar'), 'it is known'

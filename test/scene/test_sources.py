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

"""Sources of obstacles: what is kept, what is known, and the faults reported."""

from dataclasses import replace

import pytest
from sat_collision.scene.scene import FROM_FUTURE
from sat_collision.scene.settings import ObstacleSettings
from sat_collision.scene.sources import TOO_OLD
from sat_collision.scene.streams import Endpoint
from stage import (
    EVERY_KIND, INSTANCES, REFRESHED, known_stage, LIDAR, LIDAR_SAYS, NOTHING_SENT, REFUSED, Stage,
    status_and_reasons, UNTIMED_LIDAR, with_robot)


def test_instances_are_identified_by_id():
    """Two of them may have the same polygon."""
    stage = Stage(INSTANCES)
    stage.see(10, instance=7)
    stage.see(10, instance=-3)
    assert stage.held == {7: 10, -3: 10}
    stage.wait_until(0.5)
    stage.see(11, stamp=0.1, instance=7)
    assert stage.held == {7: 11, -3: 10}


def test_older_message_of_an_id_changes_nothing():
    """Two messages arrive in the wrong order."""
    stage = known_stage(INSTANCES)
    stage.see(0.5, instance=1)
    assert stage.see(10, stamp=-0.1, instance=1) is None
    stage.refuse(stamp=-0.1, instance=1)
    assert status_and_reasons(stage) == ('collision', ())
    stage.see(10, instance=1)
    assert stage.status() == 'clear'


def test_instance_returns_to_a_former_place():
    """A door opens and closes: two shapes in turn under one id."""
    stage = known_stage(INSTANCES)
    for time, x, status in ((0.1, 0.5, 'collision'), (0.2, 9, 'clear'), (0.3, 0.5, 'collision')):
        stage.wait_until(time)
        stage.see(x, instance=1)
        assert stage.status() == status


@REFRESHED
def test_key_is_forgotten_only_if_its_publisher_goes_on_without_it(settings):
    """If the publisher falls silent instead, the obstacle stays until the source is unknown."""
    for is_alive, expected in ((True, 'clear'), (False, 'unknown')):
        stage = known_stage(settings)
        stage.see(0.5, instance=1)
        stage.wait_until(1.4)
        stage.end()
        stage.wait_until(2.001)
        assert stage.status() == 'collision', 'no message has come that is too much later'
        if is_alive:
            stage.end()
        else:
            stage.wait_until(3.4)
            assert stage.status() == 'collision'
            stage.wait_until(3.401)
        assert stage.status() == expected


def test_last_whole_set_stays_until_the_source_is_unknown():
    """The publisher stops in the middle of the second set."""
    stage = with_robot(LIDAR)
    stage.send(0.5, 10)
    stage.wait_until(1.0)
    stage.see(20)
    stage.wait_until(2.0)
    assert status_and_reasons(stage) == ('collision', ())
    stage.wait_until(2.001)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has not sent a whole set for longer than its timeout of 2 s',))
    assert stage.held == {0: 20}


def test_set_completed_after_its_timeout_is_forgotten_at_once():
    """Until then it was held because the set before it was recent."""
    stage = known_stage(LIDAR)
    stage.see(0.5, stamp=-1.9)
    stage.wait_until(0.2)
    assert stage.status() == 'collision'
    stage.see(10)
    assert (stage.status(), stage.held) == ('unknown', {0: 10})


def test_obstacle_times_out_even_if_the_reasons_stay_the_same():
    """The source was already unknown because its first messages were missed."""
    stage = with_robot(LIDAR)
    stage.lose(4)
    stage.end()
    stage.wait_until(0.5)
    stage.see(0.5, stamp=0.4)
    stage.wait_until(2.4)
    assert stage.status() == 'collision'
    stage.wait_until(2.401)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has been silent for longer than its timeout of 2 s',))


@EVERY_KIND
def test_obstacle_times_out_from_its_stamp(settings):
    """One stamped ahead of the clock times out from its arrival."""
    for arrival, stamp, end in ((1.0, 0.0, 2.0), (0.0, 1.0, 2.0)):
        stage = Stage(settings)
        stage.wait_until(arrival)
        stage.see(10, stamp, instance=1)
        stage.wait_until(end)
        assert len(stage.held) == 1
        stage.wait_until(end + 0.001)
        assert stage.held == {}


@EVERY_KIND
def test_stamp_further_ahead_than_the_tolerance_is_refused(settings):
    stage = known_stage(settings)
    assert stage.see(10, stamp=3600.0, instance=1) == 'from the future'
    assert stage.status() == 'unknown'
    for time in (2.1, 4.1):
        stage.wait_until(time)
        stage.see(10, instance=1)
        stage.end()
    assert stage.status() == 'clear'


@EVERY_KIND
def test_timeout_0_keeps_obstacles_forever(settings):
    """A latched map is sent once, and is known after settle_time."""
    stage = with_robot(replace(settings, timeout=0.0))
    stage.see(10, instance=1)
    stage.wait_until(1.0)
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'sends its map: known once it ends with an empty polygon, or pauses for '
        'settle_time, 1 s',))
    stage.wait_until(1e6)
    assert list(stage.held.values()) == [10]
    assert status_and_reasons(stage) == ('clear', ())
    stage.wait_until(-10.0)
    stage.robot()
    assert status_and_reasons(stage) == ('clear', ()), 'it has no time that could be set back'


def test_map_does_not_settle_while_messages_are_queued():
    stage = with_robot(UNTIMED_LIDAR)
    stage.see(10)
    stage.time = 3.0
    stage.scene.pass_time(stage.now, is_all_taken=False)
    assert stage.status() == 'unknown'
    stage.scene.waiting = {'lidar'}
    stage.wait_until(6.0)
    assert stage.status() == 'unknown'
    stage.scene.waiting = ()
    stage.wait_until(7.001)
    assert stage.status() == 'clear'


@EVERY_KIND
def test_source_is_unknown_before_its_first_message(settings):
    for timeout, reason in ((2.0, NOTHING_SENT),
                            (0.0, LIDAR_SAYS + 'has not sent a whole map yet')):
        stage = with_robot(replace(settings, timeout=timeout))
        stage.wait_until(10.0)
        assert status_and_reasons(stage) == ('unknown', (reason,))


@EVERY_KIND
def test_silent_source_is_unknown_until_it_sends_a_whole_listing(settings):
    stage = known_stage(settings)
    stage.see(10, instance=1)
    stage.end()
    stage.wait_until(2.0)
    assert stage.status() == 'clear'
    stage.wait_until(2.001)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has been silent for longer than its timeout of 2 s',))
    stage.wait_until(3.0)
    stage.see(10, instance=1)
    stage.end()
    if settings is not LIDAR:
        assert stage.status() == 'unknown', 'of another obstacle nothing may have come yet'
        stage.wait_until(5.0)
        stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())


def test_messages_past_their_timeout_leave_a_source_silent():
    """The publisher's clock is behind by more than the timeout."""
    stage = with_robot(LIDAR)
    assert stage.see(10, stamp=-2.001) == TOO_OLD
    stage.end(stamp=-2.001)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has been silent for longer than its timeout of 2 s',))


@REFRESHED
def test_burst_of_late_messages_is_no_listing(settings):
    """The node was held up: messages stamped meanwhile were refused as too old."""
    stage = with_robot(settings)
    stage.wait_until(10.0)
    for stamp in (2.0, 4.0, 6.0):
        stage.end(stamp)
    assert stage.see(0.5, stamp=7.9, instance=1) == TOO_OLD
    stage.end(stamp=8.0)
    assert stage.status() == 'unknown'


@REFRESHED
def test_unreadable_first_message_delays_a_listing(settings):
    """It may have been of any key; the next message was stamped before it."""
    stage = with_robot(settings)
    stage.send_garbage()
    stage.see(10, stamp=-0.5, instance=1)
    stage.wait_until(1.5)
    stage.see(10, instance=1)
    assert stage.status() == 'unknown', 'what was sent at 0 is sent again until 2'
    stage.wait_until(2.0)
    stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())


def test_refused_instance_of_a_silent_source_is_forgotten():
    """It has no valid stamp, so it does not end the silence."""
    stage = known_stage(INSTANCES)
    stage.wait_until(3.0)
    stage.see(10, stamp=100.0, instance=1)
    silent = LIDAR_SAYS + 'has been silent for longer than its timeout of 2 s'
    assert status_and_reasons(stage) == ('unknown', (silent, REFUSED + FROM_FUTURE))
    stage.wait_until(5.001)
    assert status_and_reasons(stage) == ('unknown', (silent,))


@EVERY_KIND
def test_stamps_of_another_clock_are_reported_as_such(settings):
    """Stamps of an hour ago or older."""
    stage = Stage(settings, start=1e5)
    stage.robot()
    assert stage.see(5, stamp=-3600.0, instance=1) == TOO_OLD
    assert 'stamps' not in stage.state().reasons[0]
    assert stage.see(5, stamp=-3600.1, instance=1) == TOO_OLD
    reason, = stage.state().reasons
    assert 'lidar on /polygons has stamps' in reason and 'use_sim_time: true' in reason
    stage.see(5, instance=1)
    stage.end()
    assert 'stamps' not in ''.join(stage.state().reasons)


def test_disabled_source_is_ignored():
    """Its faults do not count; once enabled, it must send a whole listing again."""
    stage = with_robot(LIDAR, ObstacleSettings('radar', '/radar'))
    stage.send(0.5)
    stage.send(50, name='radar')
    assert stage.status() == 'collision'
    settings = stage.settings
    lidar, radar = settings.obstacles
    stage.scene.update(replace(settings, obstacles=(replace(lidar, enabled=False), radar)))
    assert status_and_reasons(stage) == ('clear', ())
    assert stage.see(0.5) is None
    stage.refuse()
    stage.lose()
    assert status_and_reasons(stage) == ('clear', ())
    assert [name.source for name, _ in stage.scene.obstacles] == ['radar']
    stage.scene.update(settings)
    assert status_and_reasons(stage) == ('unknown', (NOTHING_SENT,))
    stage.see(0.5)
    assert stage.status() == 'collision'


def test_unknown_if_no_source_is_enabled():
    stage = with_robot(replace(LIDAR, enabled=False))
    assert status_and_reasons(stage) == ('unknown', ('no obstacle source is enabled',))


def test_timeout_can_be_changed_live():
    """A shorter one forgets at once; a longer one restores neither obstacles nor knowledge."""
    stage = with_robot(LIDAR)
    stage.send(0.5)
    stage.wait_until(1.5)

    def set_timeout(seconds):
        stage.scene.update(replace(stage.settings, obstacles=(replace(LIDAR, timeout=seconds),)))

    set_timeout(10.0)
    stage.wait_until(9.0)
    assert status_and_reasons(stage) == ('collision', ())
    set_timeout(5.0)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has been silent for longer than its timeout of 5 s',))
    set_timeout(0.0)
    assert status_and_reasons(stage) == ('unknown', (LIDAR_SAYS + 'has not sent a whole map yet',))
    assert stage.held == {}
    for _ in range(2):
        stage.end()
    assert status_and_reasons(stage) == ('clear', ())
    set_timeout(2.0)
    assert stage.status() == 'unknown', 'what is a map need not be a set'


def test_set_with_a_loss_does_not_replace_the_last_whole_set():
    """The lost message may be of this set or of the next; the one after that is whole."""
    stage = with_robot(LIDAR)
    stage.send(0.5, 10)
    stage.wait_until(0.1)
    stage.lose()
    stage.send(20)
    assert stage.held == {0: (0.5, 20), 1: 10}
    assert status_and_reasons(stage) == ('collision', ())
    stage.wait_until(0.2)
    stage.send(20)
    assert stage.held == {0: 20}
    assert status_and_reasons(stage) == ('clear', ())
    assert stage.scene.lost() == {'lidar': 1}


def test_lossy_source_is_unknown_when_its_last_whole_set_is_too_old():
    stage = with_robot(LIDAR)
    stage.send(10)
    for time in (0.5, 1.0, 1.5, 2.0):
        assert stage.status() == 'clear'
        stage.wait_until(time)
        stage.see(10)
        stage.lose()
    stage.wait_until(2.001)
    stage.see(10)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has not sent a whole set since messages were lost',))


@REFRESHED
def test_loss_of_keys_makes_a_source_unknown_for_its_timeout(settings):
    """By then every key has been sent again."""
    stage = known_stage(settings)
    stage.lose()
    stage.see(10, instance=1)
    reason = LIDAR_SAYS + ('has not been received for its timeout of 2 s without a gap since '
                           'messages were lost')
    for time in (0.5, 1.999):
        assert status_and_reasons(stage) == ('unknown', (reason,))
        stage.wait_until(time)
        stage.see(10, instance=1)
    stage.wait_until(2.0)
    stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('clear', ())


def test_loss_before_an_empty_polygon_of_stamp_0_is_a_loss_in_the_set():
    """That polygon ends no set, but its number shows the loss."""
    stage = known_stage(LIDAR)
    stage.wait_until(1.0)
    stage.see(10)
    stage.lose()
    stage.end(stamp='none')
    stage.end()
    stage.wait_until(2.001)
    assert status_and_reasons(stage) == (
        'unknown', (LIDAR_SAYS + 'has not sent a whole set since messages were lost',))


def test_loss_before_a_refused_instance_may_be_of_any_key():
    stage = known_stage(INSTANCES)
    stage.lose()
    assert stage.see(10, stamp=100.0, instance=1) == FROM_FUTURE
    stage.see(10, instance=1)
    assert status_and_reasons(stage) == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 2 s without a gap since messages '
        'were lost',))


def test_history_of_a_lossy_map_is_requested_again():
    """Its publisher keeps what it has sent: number 1 comes again."""
    stage = with_robot(UNTIMED_LIDAR)
    stage.publish_by('a')
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
    stage.send(10, 20, 30)
    assert status_and_reasons(stage) == ('clear', ())
    assert sorted(stage.held.values()) == [10, 20, 30]
    assert not stage.scene.wants_history('lidar')


def test_lost_footprints_are_only_counted():
    stage = known_stage(LIDAR)
    stage.lose(name='robot')
    stage.robot()
    assert status_and_reasons(stage) == ('clear', ())
    assert stage.scene.lost() == {'robot': 1}


@pytest.mark.parametrize('timeout', [2.0, 0.0])
@EVERY_KIND
def test_source_starts_over_when_enabled(settings, timeout):
    """Messages sent while it was disabled are missing."""
    settings = replace(settings, timeout=timeout)
    stage = with_robot(settings)
    stage.see(0.5, instance=1)
    for enabled in (False, True):
        stage.scene.update(replace(stage.settings, obstacles=(
            replace(settings, enabled=enabled),)))
    assert stage.held == {}
    for time, status in ((0.1, 'unknown'), (2.1, 'clear')):
        stage.wait_until(time)
        stage.see(10, instance=1)
        stage.end()
        assert stage.status() == status


@EVERY_KIND
def test_restarted_publisher_must_send_its_own_listing(settings):
    """Obstacles of the previous publisher stay until their timeout."""
    stage = known_stage(settings)
    stage.publish_by('a')
    stage.restart()
    stage.see(0.5, instance=1)
    stage.wait_until(1.0)
    stage.publish_by('b')
    stage.restart()
    stage.see(10, instance=1)
    stage.end()
    assert stage.status() == 'collision'
    stage.wait_until(2.001)
    stage.see(10, instance=1)
    stage.end()
    assert stage.status() == ('clear' if settings is LIDAR else 'unknown')
    stage.wait_until(3.0)
    stage.end()
    assert status_and_reasons(stage) == ('clear', ())


def test_map_stays_until_a_new_publisher_sends_a_whole_one():
    stage = with_robot(UNTIMED_LIDAR)
    stage.publish_by('a')
    stage.send(0.5)
    stage.publish_by()
    stage.wait_until(100.0)
    assert status_and_reasons(stage) == ('collision', (LIDAR_SAYS + 'has no publisher',))
    stage.publish_by('b')
    stage.restart()
    stage.see(10)
    assert stage.status() == 'collision'
    stage.end()
    assert status_and_reasons(stage) == ('clear', ())
    assert list(stage.held.values()) == [10]


def test_map_of_a_killed_publisher_stays_until_its_lease_ends():
    """Until then it counts beside the whole map of the respawned node."""
    stage = with_robot(UNTIMED_LIDAR)
    killed, respawned = Endpoint('a', '/map'), Endpoint('b', '/map')
    stage.scene.update_publishers('lidar', [killed])
    stage.send(0.5)
    stage.scene.update_publishers('lidar', [killed, respawned])
    stage.restart()
    stage.send(10)
    assert status_and_reasons(stage) == ('collision', ())
    stage.scene.update_publishers('lidar', [respawned])
    assert status_and_reasons(stage) == ('clear', ())
    assert list(stage.held.values()) == [10]


@EVERY_KIND
def test_listing_of_a_second_publisher_that_leaves_does_not_count(settings):
    """It sends an empty set and goes; the next number of the first one happens to fit."""
    stage = with_robot(settings)
    stage.publish_by('a')
    stage.see(0.5, instance=1)
    stage.publish_by('a', 'b')
    assert stage.state().reasons == (
        LIDAR_SAYS + 'has 2 publishers, /a and /b, which cannot be told apart: give each a topic '
        'and a name here of its own',)
    stage.restart()
    stage.end()
    stage.publish_by('a')
    assert stage.status() == 'collision'
    stage.wait_until(2.001)
    stage.end()
    stage.see(10, instance=1)
    assert stage.status() == 'unknown'
    stage.wait_until(4.001)
    stage.end()
    stage.see(10, instance=1)
    stage.end()
    assert stage.status() == 'clear'


def test_stamp_of_0_after_others_starts_over():
    """Sets are told apart by stamps; obstacles without a stamp by their shape."""
    stage = with_robot(LIDAR)
    stage.send(0.5)
    stage.see(10, stamp='none')
    assert stage.state().reasons == (
        LIDAR_SAYS + 'has not been received for its timeout of 2 s without a gap',)
    assert stage.held == {0: 0.5, -1: 10}
    stage.wait_until(2.0)
    stage.see(10, stamp='none')
    assert status_and_reasons(stage) == ('collision', ())
    stage.wait_until(2.001)
    assert status_and_reasons(stage) == ('clear', ())

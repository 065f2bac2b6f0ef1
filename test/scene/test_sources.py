# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sources of obstacles and maps in a scene: what is kept, what is known, the faults reported."""

from dataclasses import replace

from builders import box, SECOND, serialised
from monitors import (
    CART, EVERY_KIND, INSTANCES, known_stage, LIDAR, LIDAR_SAYS, nanoseconds, NOTHING_SENT,
    pass_by, POLYGONS, RADAR, REFRESHED, SILENT, square, Stage, UNTIMED_LIDAR, UNTIMED_ROBOT,
    with_robot, World)
import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.obstacle_store import Followed, TOO_MANY
from sat_collision.scene.scene import FROM_FUTURE
from sat_collision.scene.settings import NEVER, Settings
from sat_collision.scene.sources import Source, TOO_OLD
from sat_collision.scene.streams import Endpoint

NEW_STAMP = replace(POLYGONS, set_end='new_stamp')
EACH_MESSAGE = replace(POLYGONS, set_end='each_message')
WITHOUT_A_GAP = LIDAR_SAYS + (
    'has not been received for its timeout of 2 s and future_tolerance, 1 s, without a gap')


# --- what publishers send


def test_mark_is_not_refused_for_its_frame_nor_for_its_stamp():
    stage = with_robot(LIDAR, frame_id='map')
    for stamp in ('none', -1e6, 1e6):
        stage.see(10)
        assert stage.scene.obstacle('lidar', None, 'nowhere', stage.stamp(stamp), stage.now,
                                    number=stage.number('lidar')) is None
        assert stage.told == ('clear', ())


# --- age and silence


@pytest.mark.parametrize('batches, timeout, expires', [
    # The mark of the last set is stamped later.
    ([*3 * [(0.0, (9, 0.0), (12, 0.0), (None, 0.0))], (1.0, (9, 0.0), (12, 0.0), (None, 1.0))],
     2.0, 2.0),
    ([(0.0, (9, 0.0), (None, 0.0)), (1.0, (9, -0.8), (None, -0.8))], 2.0, 1.2),
    # While it is received another footprint times out.
    ([(0.0, (20, 0.0), (None, 0.0)), (0.25, (20, -19.0)), (0.75, (None, 0.75))], 20.0, 1.0)],
    ids=['stamped as the set before', 'older than the set before', 'its oldest is very old'])
def test_set_expires_with_its_oldest_obstacle(batches, timeout, expires):
    """Received in batches of places (None: a mark) and stamps, which may be taken as runs."""
    world = World(Settings((UNTIMED_ROBOT, replace(CART, timeout=0.5)),
                           (replace(LIDAR, timeout=timeout),)), transforms=False)
    for name, x in (('robot', 0), ('cart', 50)):
        assert world.send(name, box(x)) is None
    number = 1
    for now, *sent in batches:
        messages = [serialised([] if x is None else box(x), nanoseconds(stamp), 'odom')
                    for x, stamp in sent]
        assert not world.at(now).monitor.receive_batch('lidar', messages, world.now, number)
        number += len(messages)
    assert [world.at(time).status() for time in (expires, expires + 0.001)] == ['clear', 'unknown']


@EVERY_KIND
def test_obstacle_times_out_from_its_stamp(settings):
    """One stamped ahead of the clock times out from its arrival."""
    for arrival, stamp in ((1.0, 0.0), (0.0, 1.0)):
        stage = Stage(settings)
        stage.at(arrival).see(10, stamp, instance=1)
        assert [len(stage.at(time).held) for time in (2.0, 2.001)] == [1, 0]


def test_obstacle_times_out_even_if_the_reasons_stay_the_same():
    """The source was already unknown because its first messages were missed."""
    stage = with_robot(LIDAR)
    stage.lose(4)
    stage.see(0.5, stamp=-0.1)
    assert stage.at(1.9).status() == 'collision'
    reasons = stage.state().reasons
    stage.see(10)
    assert stage.at(1.901).told == ('unknown', reasons)


@EVERY_KIND
def test_messages_past_their_timeout_prove_nothing(settings):
    """The node was held up, or the clock of the publisher is behind: all are too old."""
    stage = with_robot(settings)
    stage.at(10.0)
    for stamp in (2.0, 4.0, 6.0, 7.9):
        assert stage.see(0.5, stamp, instance=1) == TOO_OLD
        stage.end(stamp)
    assert stage.held == {}
    assert stage.told == ('unknown', (
        LIDAR_SAYS + 'has sent nothing of use for longer than its timeout of 2 s: its stamps are '
        'older than that',))


@EVERY_KIND
def test_stamps_of_another_clock_are_reported_as_such(settings):
    """Stamps of an hour ago or older."""
    stage = with_robot(settings, start=1e5)
    assert stage.see(5, stamp=-3600.0, instance=1) == TOO_OLD
    assert 'has stamps' not in stage.state().reasons[0]
    assert stage.see(5, stamp=-3600.1, instance=1) == TOO_OLD
    reason, = stage.state().reasons
    assert 'lidar on /polygons has stamps' in reason and 'use_sim_time: true' in reason
    stage.send_all(5)
    assert 'has stamps' not in ''.join(stage.state().reasons)


@EVERY_KIND
def test_stamp_further_ahead_than_the_tolerance_is_refused(settings):
    """Its body is at an unknown place, until all is proved anew."""
    stage = known_stage(settings)
    assert stage.see(10, stamp=1.001, instance=1) == FROM_FUTURE
    assert stage.status() == 'unknown' and FROM_FUTURE in stage.state().reasons[0]
    for time in (1.5, 3.0, 3.1):
        stage.at(time).send_all(10)
    assert stage.told == ('clear', ())


@EVERY_KIND
def test_stamps_that_fall_by_more_than_the_timeout_begin_anew(settings):
    """The clock of the publisher was set back; what was told counts for one more timeout."""
    stage = known_stage(settings).send_all(0.5)
    stage.at(1.0)
    assert stage.see(10, stamp=-1.999, instance=2) == TOO_OLD if settings is POLYGONS else True
    assert stage.see(10, stamp=-2.001, instance=2) == TOO_OLD
    assert stage.status() == 'collision' and stage.state().reasons
    stage.see(10, instance=2)
    assert stage.state().reasons == (
        LIDAR_SAYS + 'has not sent a whole set since its stamps fell by more than its timeout'
        if settings is LIDAR else WITHOUT_A_GAP,)
    assert [stage.at(time).status() for time in (3.0, 3.001)] == ['collision', 'unknown']
    for time in (3.1, 4.6, 6.1, 6.101):
        stage.at(time).send_all(10)
    assert stage.told == ('clear', ())


@EVERY_KIND
def test_clock_that_went_back_by_much_begins_anew(settings):
    """A publisher that hangs over it is unknown, not clear."""
    stage = known_stage(settings).send_all(0.5)
    stage.at(-600.0).robot()
    assert [stage.at(time).status() for time in (-600.0, -598.0)] == 2 * ['collision']
    assert stage.at(-597.999).told == ('unknown', (
        NOTHING_SENT.replace('yet', 'since the clock was set'),))
    for time in (-597.0, -595.5, -594.0, -593.999):
        stage.at(time).send_all(10)
    assert stage.told == ('clear', ())


@pytest.mark.parametrize('name', ['robot', 'lidar'])
def test_numbers_of_two_publishers_are_no_longer_a_fault_once_the_clock_went_back(name):
    """They would be until it is as late as it was."""
    stage = with_robot(UNTIMED_LIDAR).publish_by('a', name=name)
    for number in (9, 5):
        stage.numbers[name] = number
        stage.robot()
        stage.end()
    assert 'two publishers' in stage.state().reasons[0]
    stage.at(-600.0).robot()
    stage.end()
    assert 'two publishers' in stage.state().reasons[0]
    assert stage.at(-598.999).send_all(10).told == ('clear', ())


# --- refused


def test_obstacle_counts_as_long_as_the_last_whole_set_though_another_is_refused():
    """It was older than the timeout when it came."""
    stage = with_robot(LIDAR).send_all(10)
    assert stage.at(1.0).see(0.5, stamp=-1.5) == TOO_OLD
    stage.refuse()
    assert [stage.at(time).status() for time in (1.0, 2.0, 2.001)] == [
        'collision', 'collision', 'unknown']


def test_few_of_very_many_reasons_are_named():
    """Only those that hold: messages of an id in an ever new frame have a reason each."""
    stage = known_stage(INSTANCES)
    for k in range(20):
        stage.refuse(f'made up {k}', k / 1000, instance=1)
    assert stage.state().reasons == (LIDAR_SAYS + 'sent what was refused: made up 19',)
    for k in range(2, 6):
        stage.refuse(f'made up {k}', instance=k)
    assert stage.state().reasons == (
        LIDAR_SAYS + 'sent what was refused: made up 19, made up 2, made up 3 and 2 more',)


@EVERY_KIND
def test_memory_is_bounded_by_max_count(settings):
    """One publisher sends thousands of valid and invalid obstacles at once."""
    source = Source(replace(settings, max_count=5), Contacts(), SECOND)
    now = nanoseconds(0.0)
    for number in range(1000):
        source.receive(square(number).packed, 'map', now, now, number, 2 * number + 1)
        source.receive(None, 'map', now, now, -1 - number, 2 * number + 2, 'not finite')
    assert 2 < len([*source.store]) <= 5
    for _ in range(200):
        source.set_back(now)
        source.receive(square(1).packed, 'map', now, now, 1, 7)
    assert len(source.store.groups) < 110
    assert source.faults


# --- publishers


def test_lost_footprints_are_only_counted():
    stage = known_stage(LIDAR)
    stage.lose(name='robot')
    stage.robot()
    assert stage.told == ('clear', ())
    assert stage.scene.lost() == {'robot': 1}


def test_obstacle_past_its_timeout_is_forgotten_when_its_publisher_restarts():
    """Until then it was held because its publisher was alive."""
    stage = with_robot(INSTANCES)
    stage.see(0.5, instance=1)
    stage.at(1.5).see(10, instance=2)
    assert stage.at(2.5).status() == 'collision'
    stage.restart()
    stage.see(10, instance=3)
    assert stage.held == {2: 10, 3: 10}


@EVERY_KIND
def test_restarted_publisher_must_send_all_by_itself(settings):
    """Obstacles of the previous publisher stay until their timeout."""
    stage = known_stage(settings).publish_by('a')
    stage.restart()
    stage.see(0.5, instance=1)
    stage.at(1.0).publish_by('b')
    stage.restart()
    for time, status in ((1.0, 'collision'), (2.0, 'collision'), (2.5, 'unknown'),
                         (4.0, 'unknown'), (4.001, 'clear')):
        stage.at(time).send_all(10)
        assert stage.status() == ('clear' if settings is LIDAR and status == 'unknown' else status)


@EVERY_KIND
def test_listing_of_a_second_publisher_that_leaves_does_not_count(settings):
    """It sends an empty set and goes; the next number of the first one happens to fit."""
    stage = with_robot(settings).publish_by('a')
    stage.see(0.5, instance=1)
    assert stage.publish_by('a', 'b').state().reasons == (
        LIDAR_SAYS + 'has 2 publishers, /a and /b, which cannot be told apart: give each a topic '
        'and a name here of its own',)
    stage.restart()
    stage.end()
    assert stage.publish_by('a').status() == 'collision'
    stage.at(2.001).end()
    assert stage.status() == 'unknown'
    for time in (2.001, 4.0, 5.002):
        stage.at(time).send_all(10)
    assert stage.told == ('clear', ())


@pytest.mark.parametrize('settings', [LIDAR, INSTANCES, POLYGONS, EACH_MESSAGE, UNTIMED_LIDAR])
def test_batch_of_any_publisher_counts_and_ends_nothing(settings):
    """A publisher came while messages were taken: a whole listing among them proves nothing."""
    stage = with_robot(settings, time=-3.001)
    pass_by(stage, -1.5, 0.0)
    stage.see(0.5, instance=1)
    assert stage.told == ('collision', ())
    stage.scene.mix('lidar', True)
    stage.restart()
    stage.see(10, instance=1)
    stage.end()
    stage.end()
    stage.scene.mix('lidar', False)
    assert stage.status() == 'collision' and stage.state().reasons
    assert len(stage.scene.obstacles) == 2


def test_batch_of_any_publisher_refuses_what_is_too_much():
    stage = with_robot(replace(EACH_MESSAGE, max_count=2))
    stage.scene.mix('lidar', True)
    assert [stage.see(x) for x in (20, 21, 0.5)] == [None, None, TOO_MANY]


def test_what_is_gone_of_a_set_that_never_ends_is_not_looked_at():
    """Otherwise each message would cost more than the one before."""
    stage = with_robot(LIDAR)
    for _ in range(100):
        stage.time += 0.1
        stage.see(30)
    group, = (one for one in stage.scene.sources['lidar'].store.groups if len(one))
    assert len(group) == 100 and group._places[group._gone] is next(iter(group))
    assert len([*group]) == 100 - group._gone < 50


def test_obstacle_behind_one_that_waits_counts_at_once():
    """It counts beside the last whole set; a map is unknown while anything of it waits."""
    for settings in (LIDAR, UNTIMED_LIDAR):
        stage = with_robot(settings).send_all(10)
        stage.scene.wait('lidar', 1)
        assert (stage.status() == 'clear') == (settings is LIDAR)
        stage.scene.receive_early('lidar', square(0.5).packed, stage.now, 2, None, None)
        assert stage.status() == 'collision'
        stage.scene.wait('lidar', NEVER)
        assert stage.told == ('clear', ())


# --- settings


def test_disabled_source_is_ignored():
    """Its faults do not count; once enabled, all must be proved again."""
    stage = with_robot(LIDAR, RADAR).send_all(0.5)
    assert stage.send_all(50, name='radar').status() == 'collision'
    assert stage.use('lidar', enabled=False).told == ('clear', ())
    assert stage.see(0.5) is None
    stage.refuse()
    stage.lose()
    assert stage.told == ('clear', ())
    assert [name.source for name, _ in stage.scene.obstacles] == ['radar']
    assert stage.scene.sources['lidar'].summary == 'disabled'
    assert stage.use('lidar', enabled=True).told == ('unknown', (NOTHING_SENT,))
    stage.see(0.5)
    assert stage.status() == 'collision' and stage.scene.lost() == {}


def test_unknown_if_no_source_is_enabled():
    stage = with_robot(replace(LIDAR, enabled=False))
    assert stage.told == ('unknown', ('no obstacle source is enabled',))


@EVERY_KIND
def test_source_starts_over_when_enabled(settings):
    """Messages sent while it was disabled are missing."""
    stage = known_stage(settings)
    stage.see(0.5, instance=1)
    for enabled in (False, True):
        stage.use('lidar', enabled=enabled)
    assert stage.held == {}
    for time, status in ((0.1, 'unknown'), (2.0, 'unknown'), (3.101, 'clear')):
        stage.at(time).send_all(10)
        assert stage.status() == ('clear' if settings is LIDAR and time == 2.0 else status)


@pytest.mark.parametrize('settings, summary, rest', [
    (LIDAR, '2 polygons of the last whole listing, 2 listings/s, by empty polygon', ''),
    (UNTIMED_LIDAR, '2 polygons of the last whole listing, 2 listings/s, by empty polygon', ''),
    (NEW_STAMP, '2 polygons of the last whole listing, 2 listings/s, by new stamp', ''),
    (EACH_MESSAGE, '1 polygon of the last whole listing, 4.5 listings/s, by each message', ''),
    (INSTANCES, '2 polygons of the last 2 s, by ids', ''),
    (POLYGONS, '10 polygons of the last 2 s, by timeout',
     'are released only 2 s after they were last sent: to release them at once, send an empty '
     'polygon after the last one of each set, and set lidar.set_end: empty_polygon; 2 polygons '
     'come with each stamp: if that is always all, set_end: new_stamp does so, too')])
def test_state_shows_what_is_known_and_how(settings, summary, rest):
    """And how obstacles would be released sooner."""
    stage = Stage(settings)
    for k in range(8):
        stage.at(k / 2)
        for instance, x in enumerate((10, 20), 1):
            stage.see(x, instance=instance)
        if settings.set_end == 'empty_polygon':
            stage.end()
    source, = stage.scene.sources.values()
    assert source.summary == summary
    assert source.advice.endswith(rest) and bool(source.advice) == bool(rest)


@REFRESHED
def test_empty_polygon_without_a_stamp_does_not_show_that_its_publisher_is_alive(settings):
    stage = with_robot(settings)
    for time in (0.0, 1.5, 3.1):
        stage.at(time).end('none')
    assert stage.told == ('unknown', (NOTHING_SENT,))


@REFRESHED
def test_a_longer_timeout_is_unknown_until_it_has_passed(settings):
    """An obstacle that is sent every 5 s was forgotten after the 2 s of before."""
    stage = known_stage(settings)
    stage.see(0.5, instance=2)
    for time in (1.5, 3.0):
        stage.at(time).see(10, instance=1)
    assert stage.told == ('clear', ())
    assert stage.use('lidar', timeout=6.0).told == ('unknown', (
        LIDAR_SAYS + 'has not been received for its timeout of 6 s and future_tolerance, 1 s, '
        'without a gap since its parameters were changed',))
    stage.at(5.0).see(0.5, instance=2)
    assert stage.status() == 'collision'
    pass_by(stage, 10.0, 11.5)
    assert stage.told == ('clear', ())


@REFRESHED
def test_a_shorter_timeout_forgets_sooner_and_all_stays_known(settings):
    stage = known_stage(settings).use('lidar', timeout=0.1)
    stage.at(0.1).see(0.5, instance=1)
    stage.at(0.2).see(10, instance=2)
    assert stage.told == ('collision', ())
    pass_by(stage, 0.204)
    assert stage.told == ('clear', ())


def test_timeout_of_sets_can_be_changed_live():
    """A shorter one forgets at once; a longer one restores neither obstacles nor knowledge."""
    stage = with_robot(LIDAR).send_all(0.5)
    stage.at(1.5)
    stage.use('lidar', timeout=10.0)
    stage.send_all(0.5)
    assert stage.at(9.0).told == ('collision', (
        LIDAR_SAYS + 'has not sent a whole set since its parameters were changed',))
    stage.use('lidar', timeout=5.0)
    assert stage.told == ('unknown', (SILENT.replace('of 2 s', 'of 5 s'),))
    assert stage.use('lidar', timeout=0.0).status() == 'unknown' and stage.held == {}
    stage.send_all()
    assert stage.send_all().told == ('clear', ())
    assert stage.use('lidar', timeout=2.0).told == ('clear', ())


def test_set_of_which_some_was_too_old_is_not_whole_for_a_longer_timeout():
    stage = known_stage(LIDAR)
    stage.time = 2.5
    stage.see(0.5, stamp=0.1)
    stage.use('lidar', timeout=4.0)
    stage.end(stamp=0.1)
    assert stage.status() == 'unknown'
    assert stage.send_all(10).told == ('clear', ())


# --- maps, which do not age


@pytest.mark.parametrize('back', [0.0, 0.5, 3600.0])
def test_map_sent_again_after_its_clock_went_back_is_whole(back):
    """Also where our clock goes back with it; of the map before nothing stays."""
    stage = with_robot(UNTIMED_LIDAR).send_all(0.5, 20)
    stage.at(-back).robot()
    assert stage.told == ('collision', ())
    assert stage.send_all(0.5, 20, stamp=-7200.0).told == ('collision', ())
    assert stage.held == {0: 0.5, 1: 20}
    assert stage.send_all(20, 30, stamp=-7201.0).told == ('clear', ())
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
    assert stage.send_all(20).status() == 'clear'
    assert stage.scene.sources['lidar'].store.frames == {'map2'}
    stage.scene.follow_frame('lidar', 'map2', lambda sent: square(0.5).packed)
    assert stage.status() == 'collision' and stage.held == {0: 0.5, 1: 20}
    stage.scene.follow_frame('lidar', 'map2', lambda sent: None)
    assert stage.told == ('unknown', (
        LIDAR_SAYS + 'has not sent a whole map since a part of it is not valid where its frame '
        'has moved',))
    assert stage.send_all(10).told == ('clear', ())


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
        stage = with_robot(UNTIMED_LIDAR).send_all(10)
        stage.see(20)
        # A parameter is changed meanwhile.
        assert stage.at(1.0).use(margin=0.1).told == ('clear', ())
        stage.at(back).robot()
        assert stage.told == ('unknown', (
            LIDAR_SAYS + 'has not sent a whole map since it began to send another one',))


def test_map_of_which_a_part_was_lost_is_requested_again():
    """Its publisher keeps what it has sent: number 1 comes again."""
    stage = with_robot(UNTIMED_LIDAR).publish_by('a')
    assert stage.scene.wants_history('lidar'), 'it may have sent its map already'
    stage.scene.renew('lidar')
    assert not stage.scene.wants_history('lidar'), 'one subscription is enough'
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
    assert stage.send_all(10, 20, 30).told == ('clear', ())
    assert sorted(stage.held.values()) == [10, 20, 30]
    assert not stage.scene.wants_history('lidar')


def test_map_met_in_its_middle_is_requested_again_unless_its_publisher_keeps_no_more():
    stage = with_robot(UNTIMED_LIDAR).publish_by('a')
    stage.lose(5)
    stage.see(10)
    assert stage.scene.wants_history('lidar')
    stage.scene.renew('lidar')
    stage.lose(-1)
    stage.see(10)
    assert not stage.scene.wants_history('lidar'), 'only number 6 came again'
    stage.monitor.interrupt('lidar')
    stage.see(20)
    assert stage.scene.wants_history('lidar')


@pytest.mark.parametrize('now', [0.0, -600.0])
def test_map_of_a_publisher_that_has_gone_is_not_waited_for_for_long(now):
    """It was requested again, and has more messages than that of the other one."""
    stage = with_robot(UNTIMED_LIDAR).publish_by('a').send_all(10, 20, 30)
    stage.scene.renew('lidar')
    stage.publish_by('a', 'b').publish_by('b')
    stage.restart()
    assert stage.send_all(40).status() == 'unknown'
    stage.at(now).robot()
    assert [stage.at(now + wait).status() for wait in (1.0, 1.001)] == ['unknown', 'clear']


def test_map_stays_until_a_new_publisher_sends_a_whole_one():
    stage = with_robot(UNTIMED_LIDAR).publish_by('a')
    stage.send_all(0.5)
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
        assert stage.send_all(x).told == ('collision', ())
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
    assert stage.send_all(10, 20, stamp=-100.0).told == ('clear', ())
    stage.use('lidar', max_count=20)
    assert not stage.scene.wants_history('lidar'), 'it is known'

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sources of obstacles in a scene: what is kept, what is known, and the faults reported."""

from dataclasses import replace

from builders import box, SECOND, serialised
from monitors import nanoseconds, World
import pytest
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.obstacle_store import TOO_MANY
from sat_collision.scene.scene import FROM_FUTURE
from sat_collision.scene.settings import NEVER, Settings
from sat_collision.scene.sources import Source, TOO_OLD
from stage import (
    CART, EVERY_KIND, INSTANCES, known_stage, LIDAR, LIDAR_SAYS, NOTHING_SENT, pass_by, POLYGONS,
    RADAR, REFRESHED, REFUSED, SILENT, square, Stage, UNTIMED_LIDAR, UNTIMED_ROBOT, with_robot)

NEW_STAMP = replace(POLYGONS, set_end='new_stamp')
EACH_MESSAGE = replace(POLYGONS, set_end='each_message')
WITHOUT_A_GAP = LIDAR_SAYS + (
    'has not been received for its timeout of 2 s and future_tolerance, 1 s, without a gap')


# --- what publishers send


@pytest.mark.parametrize('settings', [LIDAR, POLYGONS, EACH_MESSAGE])
def test_contact_stays_though_each_polygon_has_a_stamp_of_its_own(settings):
    """They are sent 30 ms apart, an empty polygon last; without a declaration that is unknown."""
    stage = with_robot(settings)
    seen = set()
    for k in range(1, 201):
        stage.at(0.03 * k)
        if k % 4:
            stage.see(0.5 if settings is EACH_MESSAGE else (0.5, 10, 20)[k % 4 - 1])
        elif settings is not EACH_MESSAGE:
            stage.end()
        seen.add(stage.told)
    assert ('collision', ()) in seen and {status for status, _ in seen} == {'collision'}


def test_source_of_which_nothing_can_be_read_is_not_silent():
    stage = with_robot(LIDAR)
    useless = LIDAR_SAYS + 'has sent nothing of use {}: a message was refused: undecodable'
    for time in (0.0, 1.0, 2.0):
        stage.at(time).send_garbage()
        assert stage.state().reasons == (useless.format('yet'),)
    stage.send(10)
    assert stage.send(10).status() == 'clear'
    for time in (3.0, 4.0, 4.001):
        stage.at(time).send_garbage()
    assert stage.state().reasons == (useless.format('for longer than its timeout of 2 s'),)


def test_ids_are_places_of_their_own():
    """Two of them may have the same polygon, and one may return to where it was: a door."""
    stage = known_stage(INSTANCES)
    stage.see(10, instance=7)
    stage.see(10, instance=-3)
    for time, x, status in ((0.1, 0.5, 'collision'), (0.2, 9, 'clear'), (0.3, 0.5, 'collision')):
        stage.at(time).see(x, instance=7)
        assert (stage.status(), stage.held) == (status, {7: x, -3: 10})


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
def test_silent_source_is_unknown_until_all_is_proved_anew(settings):
    """Also before its first message."""
    stage = with_robot(settings)
    assert stage.at(10.0).told == ('unknown', (NOTHING_SENT,))
    stage = known_stage(settings).send(10)
    assert stage.at(2.0).status() == 'clear'
    assert stage.at(2.001).told == ('unknown', (
        SILENT if settings is LIDAR else SILENT.partition(': ')[0],))
    for time, is_known in ((3.0, False), (4.5, False), (6.0, False), (6.001, True)):
        assert stage.at(time).send(10).told == (
            ('clear', ()) if is_known or settings is LIDAR else ('unknown', (WITHOUT_A_GAP,)))


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
    stage.send(5)
    assert 'has stamps' not in ''.join(stage.state().reasons)


@EVERY_KIND
def test_stamp_further_ahead_than_the_tolerance_is_refused(settings):
    """Its body is at an unknown place, until all is proved anew."""
    stage = known_stage(settings)
    assert stage.see(10, stamp=1.001, instance=1) == FROM_FUTURE
    assert stage.status() == 'unknown' and FROM_FUTURE in stage.state().reasons[0]
    for time in (1.5, 3.0, 3.1):
        stage.at(time).send(10)
    assert stage.told == ('clear', ())


@EVERY_KIND
def test_stamps_that_fall_by_more_than_the_timeout_begin_anew(settings):
    """The clock of the publisher was set back; what was told counts for one more timeout."""
    stage = known_stage(settings).send(0.5)
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
        stage.at(time).send(10)
    assert stage.told == ('clear', ())


@EVERY_KIND
def test_clock_that_went_back_by_much_begins_anew(settings):
    """A publisher that hangs over it is unknown, not clear."""
    stage = known_stage(settings).send(0.5)
    stage.at(-600.0).robot()
    assert [stage.at(time).status() for time in (-600.0, -598.0)] == 2 * ['collision']
    assert stage.at(-597.999).told == ('unknown', (
        NOTHING_SENT.replace('yet', 'since the clock was set'),))
    for time in (-597.0, -595.5, -594.0, -593.999):
        stage.at(time).send(10)
    assert stage.told == ('clear', ())


# --- refused


def test_refused_obstacle_of_a_set_makes_it_not_whole():
    """Other sources are not affected; a contact is told though the rest is unknown."""
    stage = with_robot(LIDAR, RADAR).send(9, name='radar')
    stage.see(10)
    stage.refuse()
    stage.see(30)
    stage.end()
    assert stage.held == {0: (9, 10), 1: 30}
    reasons = (REFUSED + 'not finite',)
    assert stage.told == ('unknown', reasons)
    assert stage.send(0.5, name='radar').told == ('collision', reasons)
    stage.see(11)
    assert stage.told == ('collision', reasons)
    stage.end()
    assert stage.told == ('collision', ())


def test_obstacle_counts_as_long_as_the_last_whole_set_though_another_is_refused():
    """It was older than the timeout when it came."""
    stage = with_robot(LIDAR).send(10)
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


@REFRESHED
@pytest.mark.parametrize('what, cause', [
    ('lose', 'messages were lost'), ('send_garbage', 'a message was refused: undecodable')])
def test_gap_makes_a_source_unknown_until_all_was_sent_again(settings, what, cause):
    stage = known_stage(settings)
    getattr(stage, what)()
    for time in (0.0, 1.5, 3.0):
        stage.at(time).see(10, instance=1)
        assert stage.told == ('unknown', (f'{WITHOUT_A_GAP} since {cause}',))
    stage.at(3.001).see(10, instance=1)
    assert stage.told == ('clear', ())


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
        stage.at(time).send(10)
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
        stage.at(time).send(10)
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
        stage = with_robot(settings).send(10)
        stage.scene.wait('lidar', 1)
        assert (stage.status() == 'clear') == (settings is LIDAR)
        stage.scene.receive_early('lidar', square(0.5).packed, stage.now, 2, None, None)
        assert stage.status() == 'collision'
        stage.scene.wait('lidar', NEVER)
        assert stage.told == ('clear', ())


# --- settings


def test_disabled_source_is_ignored():
    """Its faults do not count; once enabled, all must be proved again."""
    stage = with_robot(LIDAR, RADAR).send(0.5)
    assert stage.send(50, name='radar').status() == 'collision'
    assert stage.use('lidar', enabled=False).told == ('clear', ())
    assert stage.see(0.5) is None
    stage.refuse()
    stage.lose()
    assert stage.told == ('clear', ())
    assert [name.source for name, _ in stage.scene.obstacles] == ['radar']
    assert stage.scene.sources['lidar'].summary == 'disabled'
    assert stage.use('lidar', enabled=True).told == ('unknown', (NOTHING_SENT,))
    stage.see(0.5)
    assert stage.status() == 'collision'


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
        stage.at(time).send(10)
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
    stage = with_robot(LIDAR).send(0.5)
    stage.at(1.5)
    stage.use('lidar', timeout=10.0)
    stage.send(0.5)
    assert stage.at(9.0).told == ('collision', (
        LIDAR_SAYS + 'has not sent a whole set since its parameters were changed',))
    stage.use('lidar', timeout=5.0)
    assert stage.told == ('unknown', (SILENT.replace('of 2 s', 'of 5 s'),))
    assert stage.use('lidar', timeout=0.0).status() == 'unknown' and stage.held == {}
    stage.send()
    assert stage.send().told == ('clear', ())
    assert stage.use('lidar', timeout=2.0).told == ('clear', ())


def test_set_of_which_some_was_too_old_is_not_whole_for_a_longer_timeout():
    stage = known_stage(LIDAR)
    stage.time = 2.5
    stage.see(0.5, stamp=0.1)
    stage.use('lidar', timeout=4.0)
    stage.end(stamp=0.1)
    assert stage.status() == 'unknown'
    assert stage.send(10).told == ('clear', ())

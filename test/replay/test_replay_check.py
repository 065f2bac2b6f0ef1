# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Replay as live of recordings whose results are known."""

import contextlib
import random
import sqlite3

from builders import collection, polygon_2d, SECOND, serialised
from published import load
import pytest
from recordings import (
    box, check, COLLECTION, declared, drive, MARKS, NAMES, nanoseconds, POLYGON, POLYGON_2D,
    published, run, since, SOURCE, STAMPS, START, times, write)
from sat_collision.messages.cdr import decode
from sat_collision.messages.ingest import Ingest
from sat_collision.replay import check as replay
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import HEADER, least_of, Options, Series, Verdict
from storages import storage_file

LIVE = Options(as_live=True)
WITH_WALLS = {'obstacles': ['seen', 'walls'], 'seen.topic': '/obstacles', 'walls.timeout': 0.0,
              **declared(MARKS, 'seen', 'walls')}


def standing(end, topics=('/footprint', '/obstacles'), rate=10):
    """Return messages of bodies at rest and apart, at a rate until an end."""
    places = {'/footprint': box(0), '/obstacles': box(3)}
    return [(topic, k / rate, places[topic]) for k in range(round(end * rate)) for topic in topics]


@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
@pytest.mark.parametrize('name', NAMES)
def test_contacts_of_a_recording_are_exact(monkeypatch, name, storage, clock):
    """When the set of a stamp is whole, contacts equal those computed exactly."""
    expected = load('recordings')[name]['contacts']
    seen = {}

    class Watched(replay.Monitor):
        latest = None

        def receive_batch(self, name, messages, now, number):
            stamp, frame_id, *_ = decode(messages[0], False)
            if self.latest and stamp != self.latest[0]:
                self.look(now)
            Watched.current, self.latest = self, (stamp, frame_id)
            return super().receive_batch(name, messages, now, number)

        def look(self, now):
            """End the set with an empty polygon, which the recorded publishers did not send."""
            stamp, frame_id = self.latest
            super().receive_batch(SOURCE, [serialised([], stamp, frame_id)], now)
            seen[stamp] = [str(one) for one in self.scene.state('footprint').contacts]

    monkeypatch.setattr(replay, 'Monitor', Watched)
    result = check(published(name, storage), Options(as_live=True, clock=clock))
    Watched.current.look(result.end)
    assert seen == {frame['stamp_ns']: [f'{SOURCE}/{index}' for index, _, _ in frame['hits']]
                    for frame in expected}
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    for frame in expected:
        for index, _, kind in frame['hits']:
            contact, = (contact for contact in result.contacts
                        if contact.obstacle == f'{SOURCE}/{index}'
                        and contact.first <= frame['stamp_ns'] + 99 <= contact.last + 99
                        and contact.first - 99 <= frame['stamp_ns'])
            assert (contact.depth > 0) or kind == 'touch'


def test_contact_is_an_interval_with_its_deepest_moment(tmp_path):
    """The obstacle comes nearer and leaves; it is deepest in the third of five messages."""
    places = [3.0, 1.0, 0.9, 0.5, 0.9, 1.0, 3.0, 3.0]
    messages = [message for k, x in enumerate(places)
                for message in (('/footprint', k, box(0)), ('/obstacles', k, box(x)),
                                ('/obstacles', k, []))]
    result = run(tmp_path, messages, MARKS, as_live=True)
    contact, = result.contacts
    assert since(result, contact.first, contact.deepest, contact.last) == [1, 3, 6]
    assert (contact.depth, contact.x, contact.y) == (0.5, 0.75, 0.5)
    assert (contact.normal, contact.points) == ([-1.0, 0.0], [[1.0, 1.0], [1.0, 0.0]])
    assert (contact.at_end, result.verdict) == (False, Verdict.COLLISION)
    footprint, = result.footprints
    assert (footprint.collision, footprint.least.separation) == (5 * SECOND, -0.5)


def test_footprint_alone_deepens_a_contact(tmp_path):
    """The obstacle is sent once."""
    messages = [('/obstacles', 0.0, box(2))]
    messages += [('/footprint', 0.1 + k / 10, box(x)) for k, x in enumerate([0, 1.25, 1.5, 1.0])]
    result = run(tmp_path, messages, MARKS, as_live=True)
    assert [contact.depth for contact in result.contacts] == [0.5]


def test_silence_begins_at_its_timeout(tmp_path):
    """
    Obstacles end after 3 s, the footprint after 8 s, and another topic after 12 s.

    The timeouts are 2 s and 1 s after the last stamps.
    """
    messages = [*standing(3.0), *standing(8.0, ['/footprint'])[30:], ('/other', 12.0, box(0))]
    result = check(write(tmp_path / 'bag', messages), LIVE, set_end=STAMPS)
    begins = [(round(since(result, unknown.first)[0], 6), unknown.reasons)
              for unknown in result.unknown]
    assert [begin for begin, _ in begins] == pytest.approx([0.0, 4.8, 4.9, 8.9], abs=1e-6)
    assert 'whole set' in begins[0][1][0]
    assert 'silent' in begins[2][1][0]
    assert 'older than its timeout' in begins[3][1][0]
    assert result.unknown[-1].last == result.end == START + 12 * SECOND
    assert result.footprints[0].coverage == pytest.approx((4.8 - 0.2) / 12, abs=1e-6)
    assert result.verdict is Verdict.UNKNOWN


def test_obstacle_is_forgotten_after_its_timeout(tmp_path):
    """When a message is stamped that much later."""
    messages = [('/footprint', k / 10, box(0)) for k in range(60)] + [
        ('/tracks', k / 10, serialised(box(x), nanoseconds(k / 10), instance=number))
        for k in range(60) for number, x in ((7, 0.5), (8, 9)) if number == 8 or k == 10]
    result = run(tmp_path, messages, None, as_live=True)
    assert [contact.obstacle for contact in result.contacts] == ['tracks/7']
    assert times(result) == pytest.approx([1.0, 3.1], abs=1e-6)


def test_late_footprint_does_not_set_the_time_back(tmp_path):
    """The contact of another robot continues."""
    messages = []
    for k in range(40):
        late = START + (k - 50) * SECOND // 10
        messages += [('/robot', k / 10, box(0)), ('/obstacles', k / 10, box(0.5)),
                     ('/late', k / 10, serialised(box(9), late))]
    result = check(write(tmp_path / 'bag', messages), Options(
        as_live=True, footprints=('robot:=/robot', 'late:=/late'), obstacles=('/obstacles',)))
    contact, = result.contacts
    assert contact.at_end and contact.last == result.end == contact.first + 39 * SECOND // 10
    assert [footprint.coverage for footprint in result.footprints] == [1.0, 0.0]


@pytest.mark.parametrize('parameters, verdict', [
    ({}, Verdict.CLEAR),
    ({f'{SOURCE}.set_end': MARKS}, Verdict.UNKNOWN),
    ({f'{SOURCE}.enabled': False}, Verdict.UNKNOWN),
    ({'footprint.obstacles': ['walls']}, Verdict.UNKNOWN)],
    ids=['monitored', 'sets have ends', 'disabled', 'not monitored'])
def test_only_what_a_footprint_waits_for_has_a_start_up(tmp_path, parameters, verdict):
    """The walls are known from 2 s on; only of a source without ends of sets it takes so long."""
    messages = []
    for k in range(60):
        messages += [('/footprint', k / 10, box(0)), ('/obstacles', k / 10, box(3)),
                     ('/obstacles', k / 10, [])]
        if k >= 20:
            messages += [('/walls', k / 10, box(5)), ('/walls', k / 10, [])]
    result = check(write(tmp_path / 'bag', messages), Options(
        obstacles=(f'{SOURCE}:=/obstacles', 'walls:=/walls'),
        parameters={**declared(MARKS, 'walls'), **parameters}))
    assert result.contacts == [] and result.verdict is verdict


@pytest.mark.parametrize('as_live', [False, True])
def test_disabled_footprint_does_not_count(tmp_path, as_live):
    """It is in contact, and sometimes of another shape."""
    messages = [('/obstacles', k / 10, box(3.0)) for k in range(20)] + [
        message for k in range(20) for message in (
            ('/footprint', k / 10, box(0.0)), ('/other', k / 10, box(3.0)[:3 + k % 2]))]
    result = run(tmp_path, messages, as_live=as_live, parameters={
        'footprints': ['footprint', 'other'], 'other.enabled': False})
    assert (result.contacts, result.verdict) == ([], Verdict.CLEAR)


def test_release_delay(tmp_path):
    """The state stays collision for the delay, but the contact ends."""
    result = run(tmp_path, drive(), MARKS, as_live=True, parameters={'release_delay': 0.55})
    assert times(result) == [4.0, 5.0]
    assert result.footprints[0].collision == pytest.approx(1.55 * SECOND)


@pytest.mark.parametrize('data, reason, verdict', [
    (serialised([(0, 0), (1, 1), (1, 0), (0, 1)], START + 2 * SECOND), 'self-intersecting',
     Verdict.UNKNOWN),
    (serialised(box(0), START + 2 * SECOND, 'odom'), 'other frame', Verdict.CLEAR)],
    ids=['polygon', 'frame'])
def test_messages_are_rejected_as_live_and_counted(tmp_path, data, reason, verdict):
    """An invalid obstacle makes the footprint unknown until the next set."""
    messages = standing(4.0)
    messages[40:42] = [('/footprint', 2.0, box(0)), ('/obstacles', 2.0, data)]
    result = check(write(tmp_path / 'bag', messages), LIVE, set_end=STAMPS)
    source = next(source for source in result.sources if source.name == SOURCE)
    assert source.rejected == {reason: 1}
    assert '/obstacles' in source.examples[reason]
    assert any(reason in unknown.reasons[0] for unknown in result.unknown)
    assert result.verdict is verdict
    strict = check(tmp_path / 'bag', Options(as_live=True, max_unknown=0.05), set_end=STAMPS)
    assert strict.verdict is Verdict.UNKNOWN


def test_part_of_a_recording(tmp_path):
    """From 4.5 s on for 2 s; the contact that began before begins there."""
    result = run(tmp_path, drive(), MARKS, as_live=True, start=4.5, duration=2.0)
    assert since(result, result.start, result.end) == [4.5, 6.5]
    assert (result.messages, times(result)) == (3 * 20, [4.5, 5.0])
    result = check(tmp_path / 'bag', Options(as_live=True, start=99.0))
    assert result.verdict is Verdict.UNKNOWN
    assert result.notes == ['the recording has nothing in the time given by --start and '
                            '--duration: it has 10.000 s, and --start counts from its beginning']


def test_recording_of_a_simulation_needs_the_header_clock(tmp_path):
    """Received by the wall clock, all messages are too old; a note names the option."""
    messages = [(topic, time, serialised(points, 100 * SECOND + round(time * SECOND)))
                for topic, time, points in drive()]
    bag = write(tmp_path / 'bag', messages)
    result = check(bag, LIVE)
    assert result.verdict is Verdict.UNKNOWN
    assert any('--clock header' in note for note in result.notes)
    result = check(bag, Options(as_live=True, clock=HEADER))
    assert (result.start, times(result)) == (100 * SECOND, [4.0, 5.0])


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
@pytest.mark.parametrize('publishers', (0, 1, 2))
def test_publishers_whose_messages_cannot_be_told_apart_are_noted(tmp_path, storage, publishers):
    """The node would know nothing of two; the storage file alone says how many there were."""
    bag = write(tmp_path / 'bag', drive(), storage, publishers=publishers)
    for recording in (bag, storage_file(bag)):
        notes = [note for note in check(recording).notes if 'publishers' in note]
        assert [note.partition(':')[0] for note in notes] == (
            [f'{topic} had 2 publishers' for topic in ('/footprint', '/obstacles')]
            if publishers == 2 else [])


def test_publishers_that_only_metadata_tells_of_are_noted(tmp_path):
    """As where rosbag2_py reads the files."""
    bag = write(tmp_path / 'bag', drive(), 'sqlite3', publishers=2)
    with contextlib.closing(sqlite3.connect(storage_file(bag))) as file, file:
        file.execute("UPDATE topics SET offered_qos_profiles = ''")
    assert sum('had 2 publishers' in note for note in check(bag).notes) == 2


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('back', (0.0, 0.25, 0.95, 5.0, 30.0))
def test_simulation_that_was_reset_is_not_clear(tmp_path, as_live, back):
    """Its second run must not be mixed with the first; only maps may be of any time."""
    def stamp(time):
        return START + round((time - (back if time >= 20.0 else 0.0)) * SECOND)
    messages = [*(('/walls', 15.0, serialised(points, 1)) for points in (box(50), [])), *(
        (topic, time, serialised(points, stamp(time)))
        for topic, time, points in drive(40.0, contact=(20.2, 20.4) if back else (0.0, 0.0)))]
    bag = write(tmp_path / 'bag', messages, latched=['/walls'])
    result = check(bag, Options(as_live=as_live, clock=HEADER, max_unknown=20.0,
                                parameters=WITH_WALLS))
    if not back:
        assert (result.verdict, result.problems) == (Verdict.CLEAR, [])
        return
    problem, = result.problems
    assert (result.verdict, result.contacts) == (Verdict.BAD_INPUT, [])
    assert result.end == START + 199 * SECOND // 10 and result.messages < 3 * 202
    after = f'{stamp(20.0)}'
    assert (f'the stamps of /footprint go back by {back - 0.1:g} s, from {START // SECOND + 19}'
            f'.900000000 to {after[:-9]}.{after[-9:]} s') in problem


def test_stamps_of_obstacles_and_maps_may_be_in_any_order(tmp_path):
    """Those of a set are seen one after the other, the map long ago; a mark is of any time."""
    messages = [('/obstacles', time, serialised(points, START + round(stamp * SECOND)))
                for k in range(30) for time, stamp, points in (
                    (k / 10, k / 10, box(3)), (k / 10, k / 10 - 0.5, box(5)), (k / 10, 0, []))]
    messages += standing(3.0, ['/footprint']) + [
        ('/walls', k / 10, serialised(points, START - 100 * SECOND))
        for k in (0, 15) for points in (box(50), [])]
    bag = write(tmp_path / 'bag', messages, latched=['/walls'])
    result = check(bag, Options(clock=HEADER, parameters=WITH_WALLS))
    assert (result.verdict, result.problems) == (Verdict.CLEAR, [])


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
@pytest.mark.parametrize('latched, verdict', [
    ((), Verdict.UNKNOWN), (('/obstacles',), Verdict.CLEAR)])
def test_map_recorded_once_must_be_latched(tmp_path, storage, latched, verdict):
    """Otherwise earlier messages may have been missed; its storage file alone says it, too."""
    messages = [('/obstacles', 0.0, serialised(points, 0)) for points in (box(3), box(5), [])]
    messages += [('/footprint', k / 10, box(0)) for k in range(50)]
    bag = write(tmp_path / 'bag', messages, storage, latched=latched)
    for recording in (bag, storage_file(bag)):
        result = check(recording, Options(parameters={f'{SOURCE}.timeout': 0.0}))
        assert (result.verdict, result.problems) == (verdict, [])


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('start, stamp, wall, verdict', [
    (2.0, 0, 0.5, Verdict.COLLISION), (2.0, 0, 3, Verdict.CLEAR),
    (0.0, nanoseconds(0.3), 3, Verdict.CLEAR), (0.0, nanoseconds(8.0), 3, Verdict.CLEAR),
    (0.0, nanoseconds(-86400.0), 3, Verdict.CLEAR)],
    ids=['received before the start, touched', 'received before the start', 'stamped ahead',
         'stamped after the end', 'stamped on the day before'])
def test_latched_map_counts_when_it_is_received(tmp_path, as_live, start, stamp, wall, verdict):
    """Its stamp does not extend the recording; a monitor that starts later is sent it, too."""
    messages = [('/obstacles', 0.0, serialised(points, stamp))
                for points in (box(5), box(wall), [])]
    messages += [('/footprint', k / 10, box(0)) for k in range(50)]
    bag = write(tmp_path / 'bag', messages, latched=['/obstacles'])
    result = check(bag, Options(as_live=as_live, start=start, parameters={
        f'{SOURCE}.timeout': 0.0}))
    assert (result.verdict, result.unknown, result.end) == (verdict, [], nanoseconds(4.9))
    assert not any('--clock header' in note for note in result.notes)


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('off', [None, -3600.0, -5.0, -1.0, 0.04, 5.0, 3600.0])
def test_stamps_of_maps_are_not_the_header_clock(tmp_path, as_live, off):
    """A map without a stamp, or of any time, makes no time unknown, before, between or after."""
    messages = [('/obstacles', time, serialised(points, 0 if off is None else nanoseconds(
        time + off))) for time in (0.0, 0.15, 2.05, 5.0) for points in (box(3), [])]
    messages += [('/footprint', k / 10, box(0)) for k in range(1, 50)]
    bag = write(tmp_path / 'bag', messages, latched=['/obstacles'])
    result = check(bag, Options(as_live=as_live, clock=HEADER, parameters={
        f'{SOURCE}.timeout': 0.0}))
    assert (result.verdict, result.unknown) == (Verdict.CLEAR, [])
    assert (result.start, result.end) == (nanoseconds(0.1), nanoseconds(4.9))
    assert result.footprints[0].least.separation == 2.0


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('topic, stamp', [
    ('/footprint', 0), ('/footprint', -SECOND), ('/obstacles', 0), ('/elsewhere', 0)])
def test_header_clock_that_nothing_starts_is_noted(tmp_path, as_live, topic, stamp):
    """Neither messages without a stamp do, nor such as are from before 1970."""
    bag = write(tmp_path / 'bag', [(topic, k / 10, serialised(box(0), stamp)) for k in range(9)])
    result = check(bag, Options(as_live=as_live, clock=HEADER, footprints=('/footprint',),
                                obstacles=('/obstacles',)))
    assert result.verdict is Verdict.UNKNOWN
    assert ('use --clock receive' in ' '.join(result.notes)) == (topic != '/elsewhere')


@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('as_live', [False, True])
def test_time_of_the_monitor_does_not_go_back(tmp_path, monkeypatch, as_live, clock):
    """Not to the deadline of a message that is past its timeout: it would drop all bodies."""
    times = []

    class Watched(replay.Monitor):

        def receive_batch(self, name, messages, now, number):
            times.append(now)
            return super().receive_batch(name, messages, now, number)

        def advance(self, now):
            times.append(now)
            return super().advance(now)

    monkeypatch.setattr(replay, 'Monitor', Watched)
    messages = [*standing(3.0), ('/obstacles', 1.55, serialised(box(9), START + 6 * SECOND // 10))]
    bag = write(tmp_path / 'bag', messages)
    check(bag, Options(as_live=as_live, clock=clock, sample=5.0, parameters={
        f'{SOURCE}.timeout': 0.3}), set_end=None)
    assert len(times) > 60 and times == sorted(times)


def test_jitter_of_header_stamps_drops_nothing(tmp_path):
    """Obstacles are 50 ms behind the footprint, but the clock does not go back."""
    messages = [(topic, time, serialised(points, START + round(
        (time - (0.05 if topic == '/obstacles' else 0.0)) * SECOND)))
        for topic, time, points in drive()]
    result = check(write(tmp_path / 'bag', messages), Options(as_live=True, clock=HEADER))
    assert result.unknown == [] or max(u.last for u in result.unknown) < result.start + SECOND
    assert len(result.contacts) == 1


def test_huge_gap_in_time_is_not_sampled(tmp_path):
    """The first message is of 1919."""
    result = check(write(tmp_path / 'bag', [('/footprint', -1.6e9, box(0)), *standing(1.0)]), LIVE)
    assert result.duration > 1.5e9
    assert len(result.footprints[0].separation) < 100


def test_number_of_samples_is_bounded(tmp_path):
    """An hour sampled every 100 ms; neighbours are merged to their minimum."""
    bag = write(tmp_path / 'bag', drive(3600.0, rate=1.0, contact=(1800.0, 1801.0)))
    result = check(bag, Options(as_live=True, sample=0.1, parameters={
        'footprint.timeout': 3.0, f'{SOURCE}.timeout': 3.0}))
    samples = result.footprints[0].separation
    assert 1000 < len(samples) <= 4096
    assert min(value for _, value in samples) == -0.25
    assert [time for time, _ in samples] == sorted(time for time, _ in samples)


def test_least_of_series_in_any_order():
    """What is found later may have begun earlier."""
    series = [(3, 1.0), (1, 5.0), (5, None)], [(1, 2.0), (4, 0.5)]
    assert [*least_of(series)] == [(1, 2.0), (3, 1.0), (4, 0.5), (5, 0.5)]


def test_long_series_keeps_the_least_of_neighbours():
    """Of 10,000 samples, each four become one; None counts only where there is nothing else."""
    values = [None if k % 3 == 0 or k > 9000 else 7919 * k % 1000 / 10 for k in range(10_000)]
    series = Series([])
    for k, value in enumerate(values):
        series.add(k, value)
    assert series.samples == [
        (k, min((value for value in values[k:k + 4] if value is not None), default=None))
        for k in range(0, 10_000, 4)]


def test_one_topic_may_feed_several_sources(tmp_path):
    """By marks and without."""
    result = check(write(tmp_path / 'bag', drive()), Options(
        as_live=True, parameters=declared(MARKS, 'sets'), footprints=('/footprint',),
        obstacles=('sets:=/obstacles', 'kept:=/obstacles')))
    assert {contact.obstacle.partition('/')[0] for contact in result.contacts} == {'sets', 'kept'}


def test_recording_can_be_closed_early(tmp_path):
    with Recording(write(tmp_path / 'bag', drive())) as recording:
        next(recording.rows({'/footprint'}))
    assert recording.problems == []


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
def test_sets_in_one_message_give_what_the_same_sets_give_polygon_by_polygon(
        tmp_path, monkeypatch, as_live):
    """Also ones that are not convex, and a footprint of float64; without polygon_msgs."""
    monkeypatch.setattr(replay, '_TOGETHER', 14)
    notched = [(6, 3), (8, 3), (8, 5), (7, 4), (6, 5)]

    def sets():
        for k in range(40):
            x = 6 if as_live else 6 - 0.05 * k
            yield k / 10, box(0.2 * k), [box(x), notched, *[box(9, k)] * (k % 3), box(0, 4)]
    one_by_one, at_once = [], []
    for time, robot, obstacles in sets():
        stamp = START + round(time * SECOND)
        one_by_one += [('/footprint', time, robot),
                       *(('/obstacles', time, one) for one in (*obstacles, []))]
        at_once += [('/footprint', time, polygon_2d(robot, stamp)),
                    ('/obstacles', time, collection(obstacles, stamp))]
    options = Options(as_live=as_live)
    expected = check(write(tmp_path / 'a', one_by_one), options)
    found = check(write(tmp_path / 'b', at_once, types={
        '/footprint': POLYGON_2D, '/obstacles': COLLECTION}), options, set_end=None)
    of, wanted = ([(one.obstacle, one.first, one.last, round(one.depth, 6))
                   for one in result.contacts] for result in (found, expected))
    assert of == wanted
    assert len(found.contacts) == 1 and found.verdict is expected.verdict is Verdict.COLLISION
    assert found.problems == expected.problems == []


OUTLINE = {'frame_id': 'odom', 'footprint.radius': 0.5, 'footprint.frame_id': 'base'}


@pytest.mark.parametrize('topic, kind, parameters, words', [
    ('/footprint', 'std_msgs/msg/Bool', {}, f'footprint: {{}}, not {POLYGON}'),
    ('/obstacles', POLYGON_2D, {}, f'{SOURCE}: {{}}, not {POLYGON}'),
    ('/odom', POLYGON, {**OUTLINE, 'footprint.odometry': '/odom'},
     'footprint: {}, not nav_msgs/msg/Odometry'),
    ('/cmd_vel', POLYGON, {**OUTLINE, 'footprint.cmd_vel': '/cmd_vel'},
     'footprint.cmd_vel: {}, not geometry_msgs/msg/TwistStamped or geometry_msgs/msg/Twist')],
    ids=['footprint', 'obstacles', 'odometry', 'commands'])
def test_topic_of_another_type_is_bad_input(tmp_path, topic, kind, parameters, words):
    bag = write(tmp_path / 'bag', [(one, 0.0, box(0)) for one in {
        '/footprint', '/obstacles', topic}], types={topic: kind})
    result = check(bag, Options(parameters=parameters, obstacles=[f'{SOURCE}:=/obstacles']))
    words = words.format(f'{topic} has the type {kind}')
    assert result.verdict is Verdict.BAD_INPUT
    assert any(words in problem for problem in result.problems), result.problems


@pytest.mark.parametrize('names, change', [
    ({'obstacles': ['fast', 'slow']}, {'slow.set_end': MARKS}),
    ({'obstacles': ['fast', 'slow']}, {'slow.timeout': 0.0, 'slow.set_end': 'each_message'}),
    ({'footprints': ['robot', 'fast'], 'obstacles': ['slow']}, {'slow.set_end': MARKS})],
    ids=['marks', 'map', 'footprint'])
def test_sources_of_one_topic_that_count_at_other_times_are_bad_input(tmp_path, names, change):
    """By recorded motion: all messages of the topic would count at the time of the last."""
    bag = write(tmp_path / 'bag', [('/footprint', 0.0, box(0)), ('/both', 0.0, box(9))])
    parameters = {'footprints': ['robot'], 'robot.topic': '/footprint', **names,
                  'fast.topic': '/both', 'slow.topic': '/both', **change}
    problem, = check(bag, Options(parameters)).problems
    assert '/both: only one of fast and slow ends its' in problem and '--as-live' in problem
    assert check(bag, Options(parameters, as_live=True)).problems == []


@pytest.mark.parametrize('seed', range(30))
def test_messages_received_at_once_give_the_same_as_one_by_one(tmp_path, monkeypatch, seed):
    """With deadlines and samples between the messages of a set, on which nothing else depends."""
    rng = random.Random(seed)
    messages, time = [], 0.0
    for tick in range(60):
        count = rng.choice((6, 6, 6, 9))
        pace = rng.choice((0.0, 0.002, 0.01, 0.03))
        stamp = nanoseconds(time - rng.choice((0.0, 0.0, 0.4)))
        messages.append(('/footprint', time, box(rng.choice((0, 0, 5)))))
        far = [box(8.0 + k, 0.01 * tick) for k in range(count)]
        far[rng.randrange(count)] = box(rng.choice((8, 8, 5.5)))
        messages += [('/obstacles', time + (k + 1) * pace, serialised(one, stamp))
                     for k, one in enumerate([*far, *[[]] * rng.choice((1, 1, 1, 0))])]
        time += (count + 2) * pace + rng.choice((0.0, 0.05, 0.3))
    bag = write(tmp_path / 'bag', messages)
    options = Options(as_live=True, sample=rng.choice((1.0, 0.1, 0.013)), parameters={
        'release_delay': rng.choice((0.0, 0.007, 0.04)), f'{SOURCE}.timeout': 0.5,
        f'{SOURCE}.set_end': rng.choice((MARKS, STAMPS))})
    found = check(bag, options)
    monkeypatch.setattr(Ingest, 'apply_run', lambda *_: 0)
    expected = check(bag, options)
    assert expected.contacts and expected.footprints[0].clear
    assert found == expected


def test_message_that_is_too_old_when_it_comes_is_refused_among_others_that_are_not(tmp_path):
    """They are received at once up to it; the set before them is valid for longer."""
    messages = [('/footprint', 0.0, box(0))]
    # Several sets before, whose rows are used again: only then are obstacles received at once.
    messages += [('/obstacles', time, serialised(one, nanoseconds(time)))
                 for time in (0.2, 0.4, 0.6, 0.8, 1.0) for one in (*[box(8)] * 5, [])]
    messages += [('/obstacles', 1.4 + k / 50, serialised(box(8), nanoseconds(0.93)))
                 for k in range(5)]
    result = check(write(tmp_path / 'bag', messages), Options(
        as_live=True, sample=10.0, parameters={
            f'{SOURCE}.timeout': 0.5, f'{SOURCE}.set_end': MARKS, 'footprint.timeout': 0.0}))
    assert [one.rejected for one in result.sources if one.rejected] == [{'too old': 3}]

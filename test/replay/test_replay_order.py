# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages sorted by their stamps, however they are split into rows, and those that were lost."""

from collections import defaultdict
from operator import itemgetter
import struct

from builders import collection, SECOND, serialised, transforms
import numpy as np
import pytest
from recordings import (
    box, check, COLLECTION, INSTANCE, losses, LOST, LOST_TOPIC, MARKS, nanoseconds, SOURCE, STAMPS,
    START, write)
from sat_collision.messages.cdr import decode_losses, header_stamp
from sat_collision.replay.bag.storage import in_rows, LONGEST_ROW
from sat_collision.replay.losses import AfterLoss, Losses, UNSEEN
from sat_collision.replay.model.result import Options, Verdict
from sat_collision.replay.order import StampOrder, WINDOW
from sat_collision.replay.output.text import report


def message(topic, received, stamp, number=0):
    """Return a message at seconds from the beginning, with its number as x."""
    time = START + round(stamp * SECOND) if stamp else 0
    data = (transforms(('map', 'base', time, number, 0.0)) if topic == '/tf' else
            serialised([(number, 0), (1, 1), (0, 1)], time))
    return topic, START + round(received * SECOND), data


def numbers(messages, marks=None):
    """Return topic, time and numbers of messages read in rows; the marks end sets of obstacles."""
    known = [data for _, _, data in messages]
    return [(topic, (time - START) / SECOND, [known.index(data) for data in batch])
            for topic, time, batch in StampOrder(
                in_rows(messages), False,
                marks and {'/obstacles': lambda data: known.index(data) in marks},
                timeouts={'/obstacles': SECOND})]


@pytest.mark.parametrize('sent, wanted', [
    ([*(('/obstacles', 1.0 + k / 100, stamp)
        for k, stamp in enumerate((1.0, 1.0, 1.5, 1.5, 1.0, 1.0, 1.5))),
      ('/footprint', 1.2, 1.25), ('/obstacles', 1.3, 1.0)],
     [('/obstacles', 1.0, [0, 1, 4, 5, 8]), ('/footprint', 1.25, [7]),
      ('/obstacles', 1.5, [2, 3, 6])]),
    ([('/obstacles', received, 20.0) for received in (11.0, 9.0, 20.0, 30.0, 30.1, 30.2)],
     [('/obstacles', 9.0, [1]), ('/obstacles', 20.0, [0, 2, 3]), ('/obstacles', 30.1, [4]),
      ('/obstacles', 30.2, [5])])],
    ids=['of two publishers, and a footprint between', 'some too far from their stamps'])
def test_runs_of_one_stamp_are_sorted(sent, wanted):
    assert numbers([message(*one, k) for k, one in enumerate(sent)]) == wanted


def test_run_continues_after_its_beginning_was_passed_on():
    """Its first message was older than all waiting ones."""
    messages = [message('/obstacles', *one, k) for k, one in enumerate(
        ((0.5, 0.5), (35, 35), (44, 44), (46, 44), (2, 1), (3, 1), (4, 1)))]
    assert sorted(sum((batch for _, _, batch in numbers(messages)), [])) == [*range(7)]


def test_messages_of_a_set_stay_together_in_their_order():
    """They count when the last of them is stamped, whatever the stamp of their mark is."""
    stamps = [('/obstacles', 1.2), ('/obstacles', 1.3), ('/obstacles', 0), ('/footprint', 1.25),
              ('/obstacles', 1.1), ('/footprint', 1.35), ('/obstacles', 1.4), ('/obstacles', 9.0),
              ('/obstacles', 1.6)]
    messages = [message(topic, 1.5 + k / 100, stamp, k) for k, (topic, stamp) in enumerate(stamps)]
    assert numbers(messages, {2, 7, 8}) == [
        ('/footprint', 1.25, [3]), ('/obstacles', 1.3, [0, 1, 2]), ('/footprint', 1.35, [5]),
        ('/obstacles', 1.4, [4, 6, 7]), ('/obstacles', 1.6, [8])]


def test_set_whose_mark_has_the_stamp_of_its_last_message_counts_at_that():
    stamps = [('/obstacles', 1.0), ('/footprint', 1.1), ('/obstacles', 1.2), ('/obstacles', 1.2)]
    messages = [message(topic, 1.5 + k / 100, stamp, k) for k, (topic, stamp) in enumerate(stamps)]
    assert numbers(messages, {3}) == [('/footprint', 1.1, [1]), ('/obstacles', 1.2, [0, 2, 3])]


@pytest.mark.parametrize('stamps, wanted', [
    ((1.0, 1.5, 1.25, 2.5, 2.75, 3.0), [(1.0, [0]), (1.5, [1, 2]), (2.75, [3, 4, 5])]),
    ((1.5, 1.0, 2.25, 2.25), [(1.5, [0, 1]), (2.25, [2, 3])]),
    ((3.5, 2.25, 3.4, 3.4), [(3.5, [0, 1, 2, 3])])],
    ids=['in order', 'the second is oldest', 'the first is newest'])
def test_set_open_for_longer_than_its_timeout_is_read_in_parts(stamps, wanted):
    """What has no mark counts at its own stamp, but all keep their order."""
    messages = [message('/obstacles', 3.5 + k / 100, stamp, k) for k, stamp in enumerate(stamps)]
    assert numbers(messages, {len(stamps) - 1}) == [('/obstacles', *one) for one in wanted]


@pytest.mark.parametrize('times, stamp, counts', [
    ([*range(5, 31)], 25.0, 25.0), ([*range(5, 31)], 33.0, 30.0), ([*range(5, 31)], 12.0, 30.0),
    ([*range(5, 11)], 3.0, 10.0), ([*range(5, 31), 0.0, 1.0, 2.0, 8.0], 3.0, 3.0)],
    ids=['between', 'ahead', 'long ago', 'before the first', 'after a step back'])
def test_stamps_of_maps_are_not_the_clock(times, stamp, counts):
    """One counts at its own only among those of others, and no more than 10 s before the last."""
    rows = [message('/footprint', k, time) for k, time in enumerate(times)]
    rows.append(message('/map', len(times), stamp))
    found = StampOrder(in_rows(rows), True, timeless={'/map': 0})
    assert [(time - START) / SECOND for topic, time, _ in found if topic == '/map'] == [counts]


def test_each_part_of_a_map_counts_from_the_clock_on_at_which_it_was_received():
    """Also where a footprint comes between its parts, and the mark only later."""
    messages = [message('/footprint', 1, 1.0), message('/map', 2, 1.05, 1),
                message('/footprint', 3, 1.1), message('/map', 4, 1.15, 2),
                message('/footprint', 5, 1.2), message('/map', 6, 1.25, 3)]
    order = StampOrder(in_rows(messages), True, {'/map': messages[-1][2].__eq__}, {'/map': 0})
    assert [(time - START) / SECOND for topic, time, batch in order if topic == '/map'
            for _ in batch] == [1.0, 1.1, 1.1]


def test_first_static_transform_of_a_frame_counts_at_any_time():
    """Its publisher keeps it; one that corrects it counts from then on, and so do later ones."""
    messages = [message('/footprint', 1.0, 1.0), *(
        ('/tf_static', START + received * SECOND, transforms(('map', 'base', 0, x, 0.0)))
        for received, x in ((2, 0.0), (3, 5.0), (4, 0.0)))]
    always = -START / SECOND
    assert numbers(messages) == [
        ('/tf_static', always, [1]), ('/footprint', 1.0, [0]), ('/tf_static', 2.0, [1]),
        ('/tf_static', 3.0, [2]), ('/tf_static', 4.0, [1])]


def expected(messages, by_header):
    """Return (topic, time, data) of single messages in the expected order."""
    found, waiting, latest = [], [], 0
    for topic, received, data in messages:
        stamp = header_stamp(data[:4] + data[8:16] if topic == '/tf' else data)
        if by_header:
            if stamp and stamp < latest - WINDOW:
                found += sorted(waiting, key=itemgetter(1))
                waiting, latest = [], 0
            time = stamp or latest
            latest = max(latest, time)
        else:
            time = stamp if stamp and abs(received - stamp) <= WINDOW else received
        waiting.append((topic, time, data))
    return found + sorted(waiting, key=itemgetter(1))


@pytest.mark.parametrize('by_header', (False, True))
@pytest.mark.parametrize('seed', range(40))
def test_messages_are_ordered_by_their_stamps(seed, by_header):
    """Late messages, stamps far off or 0, and a clock that is set back."""
    rng = np.random.default_rng(seed)
    messages = []
    for tick in range(60):
        stamp = tick - (30 if tick > 45 and seed % 2 else 0)
        for topic, count in (('/footprint', 1), ('/obstacles', rng.integers(0, 5)), ('/tf', 2)):
            late = rng.choice([0.0, 0.0, 0.0, 3.0, 9.99, 10.5])
            for k in range(count):
                odd = rng.random()
                messages.append(message(
                    topic, tick + late + k / 1000, 0 if odd < 0.02 else stamp + (
                        0.25 if odd < 0.1 or topic == '/tf' and k else 0.0), len(messages)))
    messages.sort(key=itemgetter(1))
    order = StampOrder(in_rows(messages), by_header)
    found = [(topic, time, data) for topic, time, batch in order for data in batch]
    wanted = expected(messages, by_header)
    assert found == wanted
    topic, received, data = messages[-1]
    assert by_header or order.delay == received - next(
        time for _, time, other in wanted if other is data)


def test_rows_have_one_topic_bounded_length_and_ascending_times():
    messages = [('/a', time, b'') for time in (1, 2, 2, 1)] + [('/b', 3, b'')] * (LONGEST_ROW + 1)
    rows = [*in_rows(messages)]
    assert [(topic, times) for topic, times, _ in rows] == [
        ('/a', [1, 2, 2]), ('/a', [1]), ('/b', [3] * LONGEST_ROW), ('/b', [3])]
    assert [len(data) for _, _, data in rows] == [3, 1, LONGEST_ROW, 1]


BOTH = pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
TYPES = {LOST_TOPIC: LOST, f'/robot{LOST_TOPIC}': LOST}


def standing(end=8.0, kind=MARKS):
    """Return messages at 10 Hz of bodies at rest and apart, with sets of a kind."""
    messages = []
    for k in range(round(end * 10)):
        time = k / 10
        shapes = {COLLECTION: collection([box(3), box(5)], nanoseconds(time)),
                  INSTANCE: serialised(box(3), nanoseconds(time), instance=7)}
        sent = [shapes[kind]] if kind in shapes else [box(3), box(5), []][:2 + (kind == MARKS)]
        messages += [('/footprint', time, box(0)), *(('/obstacles', time, one) for one in sent)]
    return messages


def run(path, messages, *events, storage='mcap', kind=MARKS, latched=(), **options):
    return check(write(path, [*messages, *events], storage, types={
        **TYPES, **({} if kind in (MARKS, STAMPS, None) else {'/obstacles': kind})},
        latched=latched), Options(**options), set_end=kind if kind in (MARKS, STAMPS) else None)


def unknown_times(result):
    return [((one.first - START) / SECOND, (one.last - START) / SECOND) for one in result.unknown]


@BOTH
@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
@pytest.mark.parametrize('kind, known, known_again', (
    (MARKS, 0.1, 8.2), (STAMPS, 0.2, 8.3), (None, 3.1, 11.2), (INSTANCE, 3.1, 11.2)))
def test_sets_are_not_whole_from_the_event_before_on(
        tmp_path, as_live, clock, storage, kind, known, known_again):
    """Which ones are not known; the last whole one before is valid for one timeout."""
    result = run(tmp_path / 'bag', standing(12.0, kind), losses(6.0, obstacles=(0, 0)),
                 losses(8.05, obstacles=(2, 1), other=(5, 0)), storage=storage, kind=kind,
                 as_live=as_live, clock=clock)
    begins_unknown = 5.1 if kind in (None, INSTANCE) else 7.0
    assert unknown_times(result) == [
        (0.0, pytest.approx(known, abs=0.01)),
        (pytest.approx(begins_unknown, abs=0.101), pytest.approx(known_again, abs=0.01))]
    assert 'messages were lost' in result.unknown[-1].reasons[0]
    assert [source.lost for source in result.sources] == [0, 3]
    assert result.verdict is Verdict.UNKNOWN and result.problems == []


@BOTH
@pytest.mark.parametrize('events, known_again, lost', [
    ([(f'/robot{LOST_TOPIC}', *losses(4.0, '/robot/recorder', obstacles=(1, 0))[1:])], 4.1, 1),
    ([losses(0.05, 'a', obstacles=(0, 0)), losses(5.0, 'b', obstacles=(0, 0)),
      losses(7.05, 'b', obstacles=(0, 1)), losses(9.05, 'a', obstacles=(0, 2))], 9.2, 3)],
    ids=['first event, of a recorder in a namespace', 'two recorders'])
def test_loss_may_be_anywhere_since_the_event_before_of_its_recorder(
        tmp_path, as_live, events, known_again, lost):
    result = run(tmp_path / 'bag', standing(12.0), *events, as_live=as_live)
    assert unknown_times(result) == [(0.0, pytest.approx(known_again, abs=0.01))]
    assert [source.lost for source in result.sources] == [0, lost]


@BOTH
@pytest.mark.parametrize('maps, events, start, unknown', [
    ((0.0, 3.0, 5.0), [losses(0.05, obstacles=(1, 0))], 0.0, [(0.0, 5.0)]),
    ((0.0, 3.0, 5.0), [losses(-0.5, obstacles=(1, 0))], 0.0, [(-0.5, 0.0), (0.0, 3.0)]),
    ((0.0, 3.0, 5.0), [], 0.0, []),
    ((0.0,), [losses(0.0, obstacles=(0, 0)), losses(0.5, obstacles=(1, 0))], 2.0, [(2.0, 7.9)])],
    ids=['after its first message', 'before it', 'none', 'of before the start'])
def test_loss_in_a_map_is_known_until_the_next_whole_one(
        tmp_path, as_live, maps, events, start, unknown):
    """
    Its first message is the first one that was sent only if none was lost before.

    To a monitor that starts later its publisher would send it again.
    """
    messages = [one for one in standing() if one[0] == '/footprint'] + [
        ('/obstacles', time, serialised(points, 0)) for time in maps for points in (box(3), [])]
    result = run(tmp_path / 'bag', messages, *events, losses(6.0), latched=['/obstacles'],
                 as_live=as_live, start=start, parameters={f'{SOURCE}.timeout': 0.0})
    assert unknown_times(result) == unknown


@BOTH
@pytest.mark.parametrize('start, duration, lost', (
    (0.0, None, 3), (5.0, None, 2), (7.5, None, 0), (0.0, 1.0, 1)))
def test_losses_of_the_part_that_is_checked_count(tmp_path, as_live, start, duration, lost):
    events = [losses(1.5, obstacles=(1, 0)), losses(4.0, obstacles=(0, 0)),
              losses(7.0, obstacles=(2, 0), footprint=(1, 0))]
    result = run(tmp_path / 'bag', standing(), *events, as_live=as_live, start=start,
                 duration=duration)
    assert [source.lost for source in result.sources] == [int(lost > 1), lost]


@BOTH
def test_whole_sets_in_one_message_stay_whole(tmp_path, as_live):
    result = run(tmp_path / 'bag', standing(kind=COLLECTION), losses(4.0, obstacles=(2, 3)),
                 kind=COLLECTION, as_live=as_live)
    assert (result.verdict, result.notes, result.problems) == (Verdict.CLEAR, [], [])
    assert [source.lost for source in result.sources] == [0, 5]


@pytest.mark.parametrize('data', (
    b'', losses(0, obstacles=(1, 2))[2][:-1], losses(0, obstacles=(1, 2))[2] + bytes(8),
    losses(0)[2][:7]), ids=len)
def test_event_that_cannot_be_read_is_bad_input(tmp_path, data):
    result = run(tmp_path / 'bag', standing(), (LOST_TOPIC, 4.0, data))
    problem, = result.problems
    assert f'1 messages on {LOST_TOPIC} cannot be decoded' in problem
    assert result.verdict is Verdict.BAD_INPUT


@pytest.mark.parametrize('sign, encapsulation', (('<', b'\0\1\0\0'), ('>', bytes(4))))
def test_events_are_read_in_either_order_of_bytes(sign, encapsulation):
    data = encapsulation + struct.pack(f'{sign}I5s3xII4s2QI3sx2Q', 5, b'/rec\0', 2,
                                       4, b'/ab\0', 1, 2, 3, b'/c\0', 3, 4)
    assert decode_losses(data) == ('/rec', [('/ab', 3), ('/c', 7)])


def test_recording_without_events_says_what_cannot_be_seen(tmp_path):
    """Once, and its verdict stays."""
    result = check(write(tmp_path / 'bag', standing()))
    assert (result.notes, result.verdict) == ([UNSEEN], Verdict.CLEAR)
    assert report(result).count(f'  note: {UNSEEN}') == 1


@pytest.mark.parametrize('seed', range(20))
def test_each_gap_that_meets_a_loss_is_marked(seed):
    """Messages of equal times, events of two recorders, and rows of any length."""
    rng = np.random.default_rng(seed)
    events = [(int(time), recorder, rng.choice(['/a', '/b', '/c'])) for time, recorder in zip(
        np.sort(rng.integers(0, 100, 8)) * SECOND, rng.choice(['x', 'y'], 8))]
    found = Losses(0, None)
    begins, last = defaultdict(list), {}
    for time, recorder, topic in events:
        found.add(time, losses(0.0, recorder, **{topic[1:]: (1, 0)})[2])
        begins[topic].append((last.get(recorder, -10**30) - SECOND, time))
        last[recorder] = time
    messages = [(topic, int(time), b'%d' % k) for k, (time, topic) in enumerate(zip(
        np.sort(rng.integers(0, 1000, 300)) * SECOND // 10,
        np.repeat(rng.choice(['/a', '/b'], 60), 5)))]
    marked, seen = [], {}
    for topic, times, row in found.mark(in_rows(messages)):
        assert not any(isinstance(data, AfterLoss) for data in row[1:])
        marked += [(topic, time, data, type(data)) for time, data in zip(times, row)]
    assert [one[:3] for one in marked] == messages
    for topic, time, _, kind in marked:
        before = seen.get(topic, -10**30)
        seen[topic] = time
        assert (kind is AfterLoss) is any(
            begin < time and before < end for begin, end in begins[topic])


def test_what_follows_a_last_set_that_is_not_whole_is_undetermined(tmp_path):
    """Three whole sets; something of the fourth, the last one, is lost."""
    messages = [one for one in standing(4.0) if one[0] == '/footprint'] + [
        ('/obstacles', time, points) for time in (0.1, 0.5, 0.9, 2.5) for points in (box(9), [])]
    result = run(tmp_path / 'bag', messages, losses(2.2, obstacles=(0, 0)),
                 losses(3.0, obstacles=(1, 0)), kind=MARKS, parameters={f'{SOURCE}.timeout': 5.0})
    assert [(one.first - START, one.last - START) for one in result.undetermined] == [
        (0.9 * SECOND, 3.9 * SECOND)]

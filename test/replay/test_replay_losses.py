# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages that the recorder lost, by the events that it recorded."""

from collections import defaultdict
import struct

from builders import collection, SECOND, serialised
import numpy as np
import pytest
from recordings import (
    box, check, COLLECTION, INSTANCE, losses, LOST, LOST_TOPIC, MARKS, nanoseconds, SOURCE,
    STAMPS, START, write)
from sat_collision.messages.cdr import decode_losses
from sat_collision.replay.bag.storage import in_rows
from sat_collision.replay.losses import AfterLoss, Losses, UNSEEN
from sat_collision.replay.model.result import Options, Verdict
from sat_collision.replay.output.text import report

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

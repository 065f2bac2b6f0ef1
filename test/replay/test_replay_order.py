# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages sorted by their stamps, however they are split into rows."""

from operator import itemgetter

from builders import serialised, transforms
import numpy as np
import pytest
from sat_collision.messages.cdr import header_stamp
from sat_collision.replay.bag.storage import in_rows, LONGEST_ROW
from sat_collision.replay.order import StampOrder, WINDOW

SECOND = 10**9
START = 1000 * SECOND


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
                marks and {'/obstacles': lambda data: known.index(data) in marks})]


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

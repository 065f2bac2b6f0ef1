# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recordings published to a running node: contacts are exact, and replay writes the same."""

from collections import defaultdict
import itertools
import time

from builders import serialised
from harness import to_ns, values
from published import load
import pytest
from recordings import by_stamp, check, declared, NAMES, published, STAMPS
from rosbags.highlevel import AnyReader
from sat_collision.replay.model.result import Options

SECOND = 10**9
STORAGES = 'mcap', 'sqlite3'


def between(begin, end, arrays):
    """Return state, contacts and reason within a time range, without repetition."""
    return without_repetition(
        tuple(values(array.status[0])[key] for key in ('state', 'obstacles in contact', 'reason'))
        for array in arrays if begin <= to_ns(array.header.stamp) <= end)


def wait(condition):
    """Wait for the node, which runs in its own thread, without receiving its messages."""
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(1e-4)


def without_repetition(items):
    return [item for item, _ in itertools.groupby(items)]


@pytest.mark.parametrize('name, storage', (
    pytest.param('autoware_ego_trajectory_boxes', 'mcap', marks=pytest.mark.long),
    ('commonroad_USA_Lanker-1_1_ego1247', 'sqlite3'),
    pytest.param('tysik_front_scan_polygons', 'mcap', marks=pytest.mark.long)))
def test_contacts_of_a_recording_are_exact(start, name, storage):
    """
    After the last message of each stamp, contacts equal those computed by rational arithmetic.

    The clock is the recording's. An empty polygon, which the recorded publishers did not send,
    ends each set. The clock advances once the node has counted all messages of a stamp, so a
    state with the later time has seen them all.
    """
    expected = load('recordings')[name]['contacts']
    monitor = start(use_sim_time=True, publish_rate=50.0)
    states = monitor.listen('~/state')
    counted = monitor.received
    sent = 0
    stamps = []
    for (stamp, messages), frame in zip(by_stamp(published(name, storage)), expected):
        stamps.append(stamp)
        monitor.set_clock(stamp)
        for topic, data in (*messages, ('/obstacles', serialised([], stamp))):
            monitor.publisher(topic).publish(data)
            sent += 1
        monitor.until(lambda: counted.total() == sent, 'all messages counted')
        monitor.set_clock(stamp + SECOND // 500)
        monitor.until(lambda: states and to_ns(states[-1].header.stamp) > stamp)
        monitor.further('~/state', 2)
        assert frame['stamp_ns'] == stamp
        assert monitor.contacts() == [f'obstacle/{index}' for index, _, _ in frame['hits']]
        assert monitor.state() == ('collision' if frame['hits'] else 'clear'), monitor.reason()
    assert stamps == [frame['stamp_ns'] for frame in expected]


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if 'commonroad' in name else pytest.mark.long)
    for name in NAMES])
def test_live_node_and_replay_publish_the_same(start, tmp_path, name):
    """
    The node publishes the same changes of state that replay writes to a bag.

    The recording is played in order, each message once the previous one is counted; the clock
    follows header stamps and advances until each set is whole. All changes within a stamp are
    compared, from the third stamp on: the node knows more about the first set, because it is
    its publisher's first.
    """
    bag = published(name, STORAGES[NAMES.index(name) % 2])
    monitor = start(use_sim_time=True, publish_rate=5.0, obstacle__set_end=STAMPS)
    received = monitor.listen('~/state', 10_000)
    flags = monitor.listen('~/collision', 10_000)
    sent = 0
    stamps = []
    monitor.set_clock(next(by_stamp(bag))[0])
    monitor.until(lambda: monitor.status() and '/clock' not in monitor.reason(), 'the clock')
    for stamp, messages in by_stamp(bag):
        monitor.set_clock(stamp)
        wait(lambda: monitor.monitor.get_clock().now().nanoseconds == stamp)
        if len(stamps) == 2:
            monitor.until(lambda: to_ns(received[-1].header.stamp) == stamp, 'the state so far')
        for topic, data in messages:
            monitor.publisher(topic).publish(data)
            sent += 1
            wait(lambda: monitor.received.total() == sent)
        stamps.append(stamp)
        monitor.set_clock(stamp + SECOND // 16)
        wait(lambda: monitor.monitor._scene.deadline > stamp + SECOND // 16)
    monitor.until(lambda: received and to_ns(received[-1].header.stamp) > stamp, 'the last state')
    check(bag, Options(clock='header', as_live=True, write_bag=str(tmp_path / 'out'),
                       parameters={'publish_rate': 5.0, **declared(STAMPS)}))
    written = defaultdict(list)
    with AnyReader([tmp_path / 'out']) as reader:
        for connection, _, data in reader.messages():
            written[connection.topic].append(reader.deserialize(data, connection.msgtype))
    assert between(stamps[2], stamp, received) == between(
        stamps[2], stamp, written['/footprint_monitor/state'])
    raised = without_repetition(
        flag.data for flag in written['/footprint_monitor/collision'])[2:]
    monitor.until(lambda: without_repetition(flag.data for flag in flags)[-len(raised):] == raised,
                  f'flags {raised}')

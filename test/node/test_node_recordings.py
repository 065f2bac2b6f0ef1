# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Real recordings, published to a running node."""

from builders import serialised
from harness import SECOND, to_ns
from published import load
import pytest
from recordings import by_stamp, published


@pytest.mark.parametrize('name, storage', (
    ('autoware_ego_trajectory_boxes', 'mcap'),
    ('commonroad_USA_Lanker-1_1_ego1247', 'sqlite3'),
    ('tysik_front_scan_polygons', 'mcap')))
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
        count = len(states)
        monitor.until(lambda: len(states) > count + 1, 'another state')
        assert frame['stamp_ns'] == stamp
        assert monitor.contacts() == [f'obstacle/{index}' for index, _, _ in frame['hits']]
        assert monitor.state() == ('collision' if frame['hits'] else 'clear'), monitor.reason()
    assert stamps == [frame['stamp_ns'] for frame in expected]

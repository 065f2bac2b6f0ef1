# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Flags and states of a running node."""

import math
import statistics

from diagnostic_msgs.msg import DiagnosticStatus
from harness import APART, box, LASTING, ROBOT, SECOND, to_ns, TOUCHING, values
import numpy as np
import pytest


def test_nothing_received_is_unknown_and_raises_the_flag(start):
    """Before any message, and with a footprint alone."""
    monitor = start()
    assert monitor.await_state('unknown').level == DiagnosticStatus.STALE
    monitor.until_flags(True)
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: 'obstacles' in monitor.reason() and monitor.value('age'), 'a footprint')
    assert monitor.state() == 'unknown' and monitor.flag()


def test_clear_then_touching_then_clear(start):
    """In contact with one common corner; published at once, even without regular times."""
    monitor = start(**LASTING)
    status = monitor.become('clear', APART)
    assert status.level == DiagnosticStatus.OK and status.hardware_id == '/footprint'
    monitor.until_flags(False)
    monitor.monitor._publishing.next = math.inf
    for _ in range(2):
        monitor.send_set('obstacles', TOUCHING)
        status = monitor.await_state('collision')
        assert status.level == DiagnosticStatus.ERROR and 'obstacle/0' in status.message
        assert monitor.contacts() == ['obstacle/0']
        monitor.until_flags(True)
        monitor.send_set('obstacles', APART)
        monitor.await_state('clear')
        monitor.until_flags(False)


def test_states_list_age_time_differences_and_all_contacts(start):
    """The age counts from the stamp; the footprint is 0.1 s older than the obstacles."""
    monitor = start(**LASTING)
    stamp = monitor.now() - 3 * SECOND
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING, APART, [(0.5, 0.5)], stamp=stamp + SECOND // 10)
    monitor.await_state('collision')
    monitor.until(lambda: monitor.contacts() == ['obstacle/0', 'obstacle/2'])
    assert 3.0 <= float(monitor.value('age')) < 3.0 + 10.0
    assert monitor.value('contacts are newer by') == 'obstacle/0 0.100, obstacle/2 0.100'
    assert monitor.value('nearest obstacle is newer by') == '0.100'


def test_each_footprint_has_its_own_flag(start):
    """The common flag rises with any of them."""
    monitor = start(footprints=['left', 'right'], left__timeout=0.0, right__timeout=0.0,
                    obstacle__timeout=60.0)
    monitor.send('left', ROBOT)
    monitor.send('right', box(9, 0))
    monitor.send_set('obstacles', box(9.5, 0))
    monitor.await_state('clear', 'left')
    monitor.await_state('collision', 'right')
    monitor.until_flags(True, 'right')
    monitor.until(lambda: monitor.flag('left') is False)
    assert monitor.flag()


def test_states_and_flags_are_repeated_at_publish_rate(start):
    monitor = start(publish_rate=5.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    topics = [monitor.listen(f'~/{topic}') for topic in
              ('collision', 'footprint/collision', 'state')]
    monitor.until(lambda: all(len(received) > 7 for received in topics))
    assert max(map(len, topics)) < 20
    stamps = [to_ns(array.header.stamp) / SECOND for array in topics[-1]]
    # A late message is followed by one in time.
    assert statistics.median(np.diff(stamps)) == pytest.approx(0.2, abs=0.1)
    ages = [float(age) for array in topics[-1] if (age := values(array.status[0])['age'])]
    assert ages == sorted(ages) and ages[0] < ages[-1]


def test_states_show_the_nearest_obstacle(start):
    monitor = start(**LASTING)
    for state, polygons, nearest, separation in (
            ('clear', [box(4, 5), box(0, 1.5)], 'obstacle/1', '0.5'),
            ('collision', [box(0.75, 0)], 'obstacle/0', '-0.25')):
        monitor.become(state, *polygons)
        monitor.until(lambda: monitor.value('least separation') == separation)
        assert monitor.value('nearest obstacle') == nearest


def test_coarse_coordinates_are_warned_of(start):
    """At UTM coordinates float32 has steps of half a metre."""
    monitor = start(**LASTING)
    north = 5_000_000.0
    monitor.send('footprint', box(500_000, north))
    monitor.send_set('obstacles', box(500_008, north))
    status = monitor.await_state('clear')
    assert status.level == DiagnosticStatus.WARN and 'steps of 0.5 m' in status.message
    assert monitor.set_parameters(resolution=1.0) == [None]
    monitor.until(lambda: monitor.status().level == DiagnosticStatus.OK)
    monitor.set_parameters(resolution=0.001)
    monitor.send('footprint', box(0, 0))
    monitor.until(lambda: monitor.status().level == DiagnosticStatus.OK)

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
    assert monitor.until(monitor.flag) and monitor.until(lambda: monitor.flag('footprint'))
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: 'obstacles' in values(monitor.status())['reason']
                  and values(monitor.status())['age'], 'a footprint')
    assert monitor.state() == 'unknown' and monitor.flag()


def test_clear_then_touching_then_clear(start):
    """In contact with one common corner."""
    monitor = start(**LASTING)
    status = monitor.become('clear', APART)
    assert status.level == DiagnosticStatus.OK and status.hardware_id == '/footprint'
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    monitor.send_set('obstacles', TOUCHING)
    status = monitor.await_state('collision')
    assert status.level == DiagnosticStatus.ERROR and 'obstacle/0' in status.message
    assert monitor.contacts() == ['obstacle/0']
    monitor.until(lambda: monitor.flag() and monitor.flag('footprint'))
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)


def test_states_list_age_and_all_contacts(start):
    """The age counts from the stamp."""
    monitor = start(**LASTING)
    stamp = monitor.now() - 3 * SECOND
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING, APART, [(0.5, 0.5)], stamp=stamp)
    monitor.await_state('collision')
    monitor.until(lambda: monitor.contacts() == ['obstacle/0', 'obstacle/2'])
    assert 3.0 <= float(values(monitor.status())['age']) < 3.0 + 10.0


def test_each_footprint_has_its_own_flag(start):
    """The common flag rises with any of them."""
    monitor = start(footprints=['left', 'right'], left__timeout=0.0, right__timeout=0.0,
                    obstacle__timeout=60.0)
    monitor.send('left', ROBOT)
    monitor.send('right', box(9, 0))
    monitor.send_set('obstacles', box(9.5, 0))
    monitor.await_state('clear', 'left')
    monitor.await_state('collision', 'right')
    monitor.until(lambda: monitor.flag() and monitor.flag('right')
                  and monitor.flag('left') is False)


def test_flag_of_unknown_can_be_lowered(start):
    """With unknown_is_collision false; contact still raises it."""
    monitor = start(unknown_is_collision=False, **LASTING)
    monitor.await_state('unknown')
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.until(lambda: monitor.flag() and monitor.flag('footprint'))


def test_change_is_published_at_once(start):
    """Even if nothing is published at regular times."""
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    monitor.monitor._publishing.next = math.inf
    for obstacle, state in 2 * ((TOUCHING, 'collision'), (APART, 'clear')):
        monitor.send_set('obstacles', obstacle)
        monitor.await_state(state)
        monitor.until(lambda: monitor.flag() == monitor.flag('footprint')
                      == (state == 'collision'))


def test_states_and_flags_are_repeated_at_publish_rate(start):
    monitor = start(publish_rate=5.0)
    topics = [monitor.listen(topic) for topic in ('~/collision', '~/footprint/collision',
                                                  '~/state')]
    monitor.until(lambda: all(len(received) > 7 for received in topics))
    assert max(map(len, topics)) < 20
    stamps = [to_ns(array.header.stamp) / SECOND for array in topics[-1]]
    # A late message is followed by one in time.
    assert statistics.median(np.diff(stamps)) == pytest.approx(0.2, abs=0.1)


def test_repeated_states_have_a_new_stamp_and_age(start):
    monitor = start(footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.state() and values(monitor.status())['age'])
    before, age = monitor.now(), float(values(monitor.status())['age'])
    received = monitor.listen('~/state')
    monitor.until(lambda: to_ns(received[-1].header.stamp) > before)
    monitor.until(lambda: float(values(monitor.status())['age']) > age)


def test_node_in_a_namespace(start):
    monitor = start(arguments=['-r', '__ns:=/fleet/robot1'], **LASTING)
    monitor.name = 'fleet/robot1/footprint_monitor'
    monitor.send('/fleet/robot1/footprint', ROBOT)
    monitor.send_set('/fleet/robot1/obstacles', TOUCHING)
    monitor.await_state('collision')
    monitor.until(lambda: monitor.flag('footprint'))


def test_body_in_another_frame_is_unknown(start, without_tf2_msgs):
    """Without transforms, for an obstacle and for a footprint."""
    monitor = start(frame_id='map', **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART, frame_id='odom')
    status = monitor.await_state('unknown')
    monitor.until(lambda: 'other frame' in values(monitor.status())['reason'])
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    monitor.send('footprint', ROBOT, frame_id='odom')
    status = monitor.await_state('unknown')
    assert 'frame' in values(status)['reason']
    monitor.until(monitor.flag)
    monitor.send('footprint', ROBOT)
    monitor.await_state('clear')


def test_states_show_time_differences(start):
    """The footprint is 0.1 s older than the obstacle that it touches."""
    monitor = start(**LASTING)
    stamp = monitor.now() - SECOND
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING, stamp=stamp + SECOND // 10)
    monitor.await_state('collision')
    reported = values(monitor.status())
    assert reported['contacts are newer by'] == 'obstacle/0 0.100'
    assert reported['nearest obstacle is newer by'] == '0.100'


def test_states_show_the_nearest_obstacle(start):
    """The nearer of two, then one that overlaps."""
    monitor = start(**LASTING)
    monitor.become('clear', box(4, 5), box(0, 1.5))
    monitor.until(lambda: values(monitor.status())['nearest obstacle'] == 'obstacle/1')
    assert values(monitor.status())['least separation'] == '0.5'
    monitor.send_set('obstacles', box(0.75, 0))
    monitor.await_state('collision')
    monitor.until(lambda: values(monitor.status())['least separation'] == '-0.25')
    assert values(monitor.status())['nearest obstacle'] == 'obstacle/0'


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

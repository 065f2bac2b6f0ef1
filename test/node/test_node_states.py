# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Flags and states of a running node, message by message."""

import statistics
import time

from diagnostic_msgs.msg import DiagnosticStatus
from harness import box, SECOND, to_ns, values
import numpy as np
import pytest

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}


def test_nothing_received_is_unknown_and_raises_the_flag(start):
    """Before any message, and while one side alone has been received."""
    monitor = start()
    status = monitor.await_state('unknown')
    assert status.level == DiagnosticStatus.STALE
    assert monitor.until(monitor.flag) and monitor.until(lambda: monitor.flag('footprint'))
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: 'obstacles' in values(monitor.status())['reason']
                  and values(monitor.status())['age'], 'a footprint')
    assert monitor.state() == 'unknown' and monitor.flag()


def test_clear_then_touching_then_clear(start):
    """An obstacle comes as near as one common corner, and goes again."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART)
    status = monitor.await_state('clear')
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


def test_states_say_age_and_all_obstacles_in_contact(start):
    """Two of the three obstacles of a set are in contact; the age counts from the stamp."""
    monitor = start(**LASTING)
    stamp = monitor.now() - 3 * SECOND
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING, APART, [(0.5, 0.5)], stamp=stamp)
    monitor.await_state('collision')
    monitor.until(lambda: monitor.contacts() == ['obstacle/0', 'obstacle/2'])
    assert 3.0 <= float(values(monitor.status())['age']) < 3.0 + 10.0


def test_each_footprint_has_its_own_flag(start):
    """One of two robots collides: its flag and the common one rise, the other's does not."""
    monitor = start(footprints=['left', 'right'], left__timeout=0.0, right__timeout=0.0,
                    obstacle__timeout=60.0)
    monitor.send('left', ROBOT)
    monitor.send('right', box(9, 0))
    monitor.send_set('obstacles', box(9.5, 0))
    monitor.await_state('clear', 'left')
    monitor.await_state('collision', 'right')
    monitor.until(lambda: monitor.flag() and monitor.flag('right')
                  and monitor.flag('left') is False)


def test_unknown_lowers_the_flag_if_so_wished(start):
    """With unknown_is_collision false an unknown footprint is not blocked; contact still is."""
    monitor = start(unknown_is_collision=False, **LASTING)
    monitor.await_state('unknown')
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.until(lambda: monitor.flag() and monitor.flag('footprint'))


class Never:
    """What is never due."""

    def due(self, now):
        return False


def test_change_is_published_at_once(start):
    """Nothing is published at the regular times, and each change still is."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    monitor.monitor._publishing = Never()
    for obstacle, state in 2 * ((TOUCHING, 'collision'), (APART, 'clear')):
        monitor.send_set('obstacles', obstacle)
        monitor.await_state(state)
        monitor.until(lambda: monitor.flag() == monitor.flag('footprint')
                      == (state == 'collision'))


def test_without_change_all_is_repeated_at_publish_rate(start):
    """At 5 Hz every 0.2 s, and no more often."""
    monitor = start(publish_rate=5.0)
    topics = [monitor.listen(topic) for topic in ('~/collision', '~/footprint/collision',
                                                  '~/state')]
    monitor.until(lambda: all(len(received) > 7 for received in topics))
    assert max(map(len, topics)) < 20
    stamps = [to_ns(array.header.stamp) / SECOND for array in topics[-1]]
    # One that comes late is followed by one in time.
    assert statistics.median(np.diff(stamps)) == pytest.approx(0.2, abs=0.1)


def test_states_are_repeated_with_a_fresh_stamp_and_age(start):
    """Two states between which nothing happened."""
    monitor = start(footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.state() and values(monitor.status())['age'])
    before, age = monitor.now(), float(values(monitor.status())['age'])
    received = monitor.listen('~/state')
    monitor.until(lambda: to_ns(received[-1].header.stamp) > before)
    monitor.until(lambda: float(values(monitor.status())['age']) > age)


def test_release_delay_holds_a_fall_and_no_rise(start):
    """The flag falls half a second after the contact has ended, and rises at once."""
    monitor = start(release_delay=0.5, **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    parted = time.monotonic()
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    assert time.monotonic() - parted > 0.4
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')


def test_node_in_a_namespace(start):
    """Its topics are below the namespace, the footprint's as well."""
    monitor = start(arguments=['-r', '__ns:=/fleet/robot1'], **LASTING)
    monitor.name = 'fleet/robot1/footprint_monitor'
    monitor.send('/fleet/robot1/footprint', ROBOT)
    monitor.send_set('/fleet/robot1/obstacles', TOUCHING)
    monitor.await_state('collision')
    monitor.until(lambda: monitor.flag('footprint'))


def test_body_in_another_frame_is_unknown_until_it_comes_in_the_right_one(start):
    """Frames are not transformed: neither the footprint nor an obstacle may be in another."""
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


def test_first_footprint_in_a_wrong_frame_heals(start):
    """Without frame_id, the frame is that of the footprints received in the last second."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT, frame_id='odom')
    monitor.send_set('obstacles', APART)
    monitor.await_state('unknown')
    monitor.until(lambda: 'other frame' in values(monitor.status())['reason'])
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')


def test_states_say_how_far_apart_in_time_things_are(start):
    """The footprint is 0.1 s older than the obstacle that it touches."""
    monitor = start(**LASTING)
    stamp = monitor.now() - SECOND
    monitor.send('footprint', ROBOT, stamp)
    monitor.send_set('obstacles', TOUCHING, stamp=stamp + SECOND // 10)
    monitor.await_state('collision')
    told = values(monitor.status())
    assert told['contacts are newer by'] == 'obstacle/0 0.100'
    assert told['nearest obstacle is newer by'] == '0.100'


def test_first_footprint_gives_the_frame(start):
    """Without frame_id, what comes in its frame is accepted and what does not is refused."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT, frame_id='odom')
    monitor.send_set('obstacles', APART, frame_id='odom')
    monitor.await_state('clear')
    monitor.send_set('obstacles', APART, frame_id='map')
    monitor.await_state('unknown')


def test_margin_counts_as_collision_and_can_be_changed(start):
    """A box a quarter of a metre away collides with a margin of as much, not with less."""
    monitor = start(margin=0.25, **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', box(1.25, 0))
    status = monitor.await_state('collision')
    assert 'within 0.25 m of obstacle/0' in status.message
    assert monitor.set_parameters(margin=0.125) == [None]
    monitor.await_state('clear')
    assert monitor.set_parameters(margin=-1.0)[0]
    assert monitor.set_parameters(margin=0.5) == [None]
    monitor.await_state('collision')


def test_states_say_what_is_nearest(start):
    """Of two obstacles the nearer one apart, then the one overlapped deepest."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', box(4, 5), box(0, 1.5))
    monitor.await_state('clear')
    monitor.until(lambda: values(monitor.status())['nearest obstacle'] == 'obstacle/1')
    assert values(monitor.status())['least separation'] == '0.5'
    monitor.send_set('obstacles', box(0.75, 0))
    monitor.await_state('collision')
    monitor.until(lambda: values(monitor.status())['least separation'] == '-0.25')
    assert values(monitor.status())['nearest obstacle'] == 'obstacle/0'


def test_coordinates_coarser_than_the_resolution_are_warned_of(start):
    """At UTM coordinates float32 steps by half a metre: the state says so, clear or not."""
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

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

"""Sets, numbers and publishers, as the monitor hears of them: what is not whole does not count."""

from dataclasses import replace
import math
import random
import struct

from builders import box, SECOND, serialised
from monitors import BOW_TIE, CIRCLE, clear_monitor, NOW, SETTINGS, status
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.holders import TOO_MANY
from sat_collision.scene.obstacles import ObstacleId


def test_numbers_that_are_missing_are_counted_as_lost():
    """By source; a publisher that begins again, or another one, has lost none by that."""
    monitor = clear_monitor()
    for name, number in (('lidar', 5), ('lidar', 6), ('lidar', 9), ('robot', 1), ('lidar', 3),
                         ('lidar', 4), ('robot', 3), ('lidar', 4)):
        assert monitor.receive_batch(name, [(serialised(box(0)), number)], NOW) == []
    assert monitor.lost == {'lidar': 2, 'robot': 1}


def test_numbers_of_several_publishers_are_told_apart():
    """Each counts its own; as many are followed as there are."""
    monitor = clear_monitor()
    monitor.count_publishers('tracks', 2)
    for number in (100, 7, 101, 8, 102, 9, 11, 105, 12):
        monitor.receive_batch('tracks', [(serialised(box(20), instance=1), number)], NOW)
    assert monitor.lost == {'tracks': 3}


def test_publisher_that_is_counted_after_its_message():
    """Messages may come sooner than word of who sends them; that nobody does counts later."""
    monitor = Monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    monitor.advance(NOW)

    def count(publishers, seconds):
        for name in ('robot', 'lidar'):
            monitor.count_publishers(name, publishers)
        monitor.advance(NOW + round(seconds * SECOND))
    count(0, 0.1)
    for name, x in (('robot', 0), ('lidar', 10)):
        monitor.receive_batch(name, [(serialised(box(x), NOW), 1)], NOW + SECOND // 10)
    count(0, 0.2)
    assert status(monitor) == 'clear'
    count(1, 0.3)
    assert status(monitor) == 'clear'
    count(0, 0.4)
    assert [reason[-25:] for reason in monitor.scene.state('robot').reasons] == [
        'has no publisher any more'] * 2


def test_lost_message_makes_unknown_until_a_set_is_whole():
    """One in ten is dropped on the way; one obstacle lies on the robot all the time."""
    monitor = clear_monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    rng = random.Random(0)
    statuses, number = [], 0
    for scan in range(200):
        stamp = NOW + scan * SECOND // 10 + SECOND
        monitor.receive('robot', serialised(box(0), stamp), stamp)
        for x in (10, 20, 0.5, 30, 40):
            number += 1
            if rng.random() > 0.1:
                monitor.receive_batch('lidar', [(serialised(box(x), stamp), number)], stamp)
                statuses.append(status(monitor))
    assert 50 < monitor.lost['lidar'] < 150
    assert 'clear' not in statuses[5:]
    assert statuses.count('collision') > 500


def test_accumulating_begins_in_the_middle_of_a_set():
    """From then on nothing is replaced any more."""
    monitor = clear_monitor()
    for stamp in (NOW + SECOND, NOW + 2 * SECOND):
        for x in (10, 20, 30):
            if stamp == NOW + 2 * SECOND and x == 20:
                lidar, tracks = SETTINGS.obstacles
                monitor.scene.update(replace(SETTINGS, obstacles=(
                    replace(lidar, accumulate=True), tracks)))
            monitor.receive('lidar', serialised(box(x + stamp / SECOND), stamp), stamp)
    assert len([name for name, _ in monitor.scene.obstacles if name.source == 'lidar']) == 6


def monitor_in_a_set(settings=SETTINGS):
    """Return a monitor that holds three obstacles and has heard of the first one anew."""
    monitor = clear_monitor(settings)
    stamp = NOW + SECOND
    for x in (10, 20, 30):
        monitor.receive('lidar', serialised(box(x), stamp), stamp)
    stamp += SECOND // 10
    monitor.receive('lidar', serialised(box(11), stamp), stamp)
    return monitor, stamp


def end_set(monitor, stamp):
    """Say that the set is whole."""
    assert monitor.receive('lidar', serialised([], stamp), stamp) is None


def places(monitor):
    """Return where the obstacles of the set are, by number."""
    return {name.key: polygon.bounds[0] for name, polygon in monitor.scene.obstacles
            if name.source == 'lidar'}


def test_each_message_puts_the_pause_off():
    """Nothing is due while messages come; what is due is the moment at which the last was it."""
    monitor = clear_monitor()
    for later in (0, 30, 75, 120):
        now = NOW + later * SECOND // 1000
        assert monitor.receive('lidar', serialised(box(10), NOW), now) is None
        assert monitor.deadline == now + SECOND // 20


def test_obstacle_of_a_set_replaces_its_predecessor():
    """In the middle of a set, where hardly anything else ever comes."""
    monitor, stamp = monitor_in_a_set()
    assert monitor.receive('lidar', serialised(box(21), stamp), stamp) is None
    end_set(monitor, stamp)
    assert places(monitor) == {0: 11, 1: 21}


@pytest.mark.parametrize('data, reason', [
    (serialised(box(21), NOW + 11 * SECOND // 10, 'cam'), 'other frame'),
    (serialised(box(21), NOW + 11 * SECOND // 10, ''), 'empty frame_id'),
    (serialised(box(21), NOW + 11 * SECOND // 10)[:-1], 'undecodable'),
    (serialised(box(21), NOW + 11 * SECOND // 10) + bytes(12), 'undecodable'),
    (serialised(box(21))[:8] + struct.pack('<I', 11 * SECOND // 10) + serialised(box(21))[12:],
     'undecodable'),
    (serialised(CIRCLE, NOW + 11 * SECOND // 10), 'too many vertices'),
    (serialised(BOW_TIE, NOW + 11 * SECOND // 10), 'self-intersecting')])
def test_bad_message_in_the_middle_of_a_set_is_rejected(data, reason):
    """It takes the place of the obstacle that it would have been."""
    monitor, stamp = monitor_in_a_set()
    assert monitor.receive('lidar', data, stamp).reason == reason
    assert monitor.receive('lidar', serialised(box(31), stamp), stamp) is None
    end_set(monitor, stamp)
    assert places(monitor) == {0: 11, 1 if reason == 'undecodable' else 2: 31}
    assert status(monitor) == 'unknown'


def test_obstacle_ages_by_its_own_stamp():
    """Within a set a stamp may be earlier than that of the obstacle's predecessor."""
    monitor = clear_monitor()
    first = NOW + SECOND
    millisecond = SECOND // 1000
    for stamp, x in ((0, 10), (19, 20), (21, 11), (5, 21)):
        stamp = first + stamp * millisecond
        monitor.receive('lidar', serialised(box(x), stamp), first + 21 * millisecond)
    end_set(monitor, first + 21 * millisecond)
    assert places(monitor) == {0: 11, 1: 21}
    monitor.scene.advance(first + 2 * SECOND + 6 * millisecond)
    assert places(monitor) == {0: 11}


def test_source_is_silent_from_its_last_message_on():
    """Be that in the middle of a set."""
    monitor = clear_monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    millisecond = SECOND // 1000
    for stamp, x in ((0, 10), (1, 20), (30, 11), (45, 21)):
        stamp = NOW + SECOND + stamp * millisecond
        assert monitor.receive('lidar', serialised(box(x), stamp), stamp) is None
    end_set(monitor, stamp)
    now = NOW + 3 * SECOND + 45 * millisecond
    monitor.receive('robot', serialised(box(0), now), now)
    assert status(monitor) == 'clear'
    monitor.scene.advance(now + 1)
    assert status(monitor) == 'unknown'


def test_limit_of_obstacles_can_be_lowered_in_the_middle_of_a_set():
    """What is beyond it is in doubt from then on, although it has been taken before."""
    monitor, stamp = monitor_in_a_set()
    lidar, tracks = SETTINGS.obstacles
    monitor.scene.update(replace(SETTINGS, obstacles=(replace(lidar, max_count=1), tracks)))
    assert monitor.receive('lidar', serialised(box(21), stamp), stamp).reason == TOO_MANY


def test_whole_set_ends_the_doubt_about_a_message_of_no_set():
    """A refused message without a stamp has no place of its own, where another could end it."""
    monitor, stamp = monitor_in_a_set(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    monitor.receive('robot', serialised(box(0), stamp), stamp)
    monitor.receive('lidar', serialised([(0, math.nan)], 0), stamp)
    for later in (stamp, stamp + SECOND // 10):
        monitor.receive('lidar', serialised(box(21), later), later)
        assert status(monitor) == 'unknown'
        end_set(monitor, later)
    assert status(monitor) == 'clear'


def test_body_that_is_not_convex_in_the_middle_of_a_set():
    """It takes its place and is found there."""
    monitor, stamp = monitor_in_a_set()
    notched = [(-2, -2), (3, -2), (3, 3), (2, 3), (2, -1), (-2, -1)]
    assert monitor.receive('lidar', serialised(notched, stamp), stamp) is None
    end_set(monitor, stamp)
    monitor.receive('robot', serialised(box(0), stamp), stamp)
    assert status(monitor) == 'clear'
    monitor.receive('robot', serialised(box(1), stamp), stamp)
    assert monitor.scene.state('robot').contacts == (ObstacleId('lidar', 1),)


@pytest.mark.parametrize('live', [False, True])
def test_margin_holds_in_the_middle_of_a_set(live):
    """Half a metre away is near enough, from the start or from now on."""
    settings = replace(SETTINGS, margin=0.5)
    monitor, stamp = monitor_in_a_set(SETTINGS if live else settings)
    monitor.scene.update(settings)
    monitor.receive('robot', serialised(box(0), stamp), stamp)
    monitor.receive('lidar', serialised(box(1.5), stamp), stamp)
    assert monitor.scene.state('robot').contacts == (ObstacleId('lidar', 1),)


@pytest.mark.parametrize('number, known', [(1, 'clear'), (5, 'unknown')])
def test_first_set_counts_where_the_publisher_began_with_it(number, known):
    """Its first message has the number 1; where others went before, they may be of this set."""
    monitor = Monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))
    monitor.scene.advance(NOW)
    monitor.receive('robot', serialised(box(0)), NOW)
    monitor.receive_batch('lidar', [(serialised(box(10)), number), (serialised([]), number + 1)],
                          NOW)
    assert status(monitor) == known
    later = NOW + SECOND // 10
    monitor.receive_batch('lidar', [(serialised(box(10), later), number + 2),
                                    (serialised([], later), number + 3)], later)
    assert status(monitor) == 'clear'


def test_messages_without_numbers_are_noted():
    """No loss shows where the middleware does not count."""
    monitor = clear_monitor()
    assert monitor.is_numbered
    monitor.receive_batch('lidar', [(serialised(box(10)), None)], NOW)
    assert not monitor.is_numbered

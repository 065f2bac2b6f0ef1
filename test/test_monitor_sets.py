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

"""Sets, numbers and publishers, as messages tell of them: what is not whole does not count."""

from dataclasses import replace
import random
import struct

from builders import box, SECOND, serialised
from monitors import BOW_TIE, CIRCLE, clear_monitor, NOW, SETTINGS, status
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.obstacle_store import TOO_MANY
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.streams import Endpoint

ONE_SOURCE = replace(SETTINGS, obstacles=SETTINGS.obstacles[:1])


def test_numbers_that_are_missing_are_counted_as_lost():
    """By source; a publisher that begins again, or another one, has lost none by that."""
    monitor = Monitor(SETTINGS)
    for name, number in (('lidar', 5), ('lidar', 6), ('lidar', 9), ('robot', 1), ('lidar', 3),
                         ('lidar', 4), ('robot', 3), ('lidar', 4)):
        assert monitor.receive(name, serialised(box(0)), NOW, number) is None
    assert monitor.lost == {'lidar': 2, 'robot': 1}


def test_publisher_that_is_known_after_its_message():
    """Messages may come sooner than word of who sends them."""
    monitor = Monitor(ONE_SOURCE)

    def publish_by(*endpoints):
        for name in ('robot', 'lidar'):
            monitor.update_publishers(name, [*endpoints])
    publish_by()
    monitor.receive('robot', serialised(box(0)), NOW, 1)
    monitor.receive('lidar', serialised([]), NOW, 1)
    assert status(monitor) == 'unknown'
    publish_by(Endpoint('a', '/a'))
    assert status(monitor) == 'clear'
    publish_by()
    reasons = monitor.scene.state('robot').reasons
    assert [reason[-16:] for reason in reasons if 'no pub' in reason] == ['has no publisher'] * 2


def test_lost_messages_never_make_it_clear():
    """One in ten is dropped on the way; one obstacle lies on the robot all the time."""
    monitor = clear_monitor(ONE_SOURCE)
    rng = random.Random(0)
    statuses, number = [], 2
    for scan in range(200):
        stamp = NOW + scan * SECOND // 10 + SECOND
        monitor.receive('robot', serialised(box(0), stamp), stamp)
        for points in (box(10), box(20), box(0.5), box(30), ()):
            number += 1
            if rng.random() > 0.1:
                monitor.receive('lidar', serialised(points, stamp), stamp, number)
                statuses.append(status(monitor))
    assert 50 < monitor.lost['lidar'] < 150
    assert 'clear' not in statuses[5:]
    assert statuses.count('collision') > 800


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
    """Return a monitor that holds three obstacles and has received the first one anew."""
    monitor = clear_monitor(settings)
    stamp = NOW + SECOND
    for x in (10, 20, 30):
        monitor.receive('lidar', serialised(box(x), stamp), stamp)
    stamp += SECOND // 10
    monitor.receive('lidar', serialised(box(11), stamp), stamp)
    return monitor, stamp


def end_set(monitor, stamp):
    """Send the empty polygon that ends a set."""
    assert monitor.receive('lidar', serialised([], stamp), stamp) is None


def places(monitor):
    """Return number and place of the obstacles of sets, in order."""
    return sorted((name.key, polygon.bounds[0]) for name, polygon in monitor.scene.obstacles
                  if name.source == 'lidar')


def test_obstacle_of_a_set_replaces_its_predecessor_when_the_set_is_whole():
    """In the middle of a set, where hardly anything else ever comes."""
    monitor, stamp = monitor_in_a_set()
    assert monitor.receive('lidar', serialised(box(21), stamp), stamp) is None
    assert places(monitor) == [(0, 10), (0, 11), (1, 20), (1, 21), (2, 30)]
    end_set(monitor, stamp)
    assert places(monitor) == [(0, 11), (1, 21)]


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
    """It takes the place of an obstacle; of one that tells no stamp, the set is not whole."""
    monitor, stamp = monitor_in_a_set()
    assert monitor.receive('lidar', data, stamp).reason == reason
    assert monitor.receive('lidar', serialised(box(31), stamp), stamp) is None
    end_set(monitor, stamp)
    if reason == 'undecodable':
        assert places(monitor) == [(0, 10), (0, 11), (1, 20), (1, 31), (2, 30)]
    else:
        assert places(monitor) == [(0, 11), (2, 31)]
        assert status(monitor) == 'unknown'


def test_set_is_as_old_as_its_oldest_message():
    """Within a set a stamp may be earlier than that of the message before."""
    monitor = clear_monitor(ONE_SOURCE)
    first = NOW + SECOND
    millisecond = SECOND // 1000
    for stamp, x in ((0, 10), (19, 20), (40, 11), (25, 21)):
        stamp = first + stamp * millisecond
        monitor.receive('lidar', serialised(box(x), stamp), first + 40 * millisecond)
    end_set(monitor, first + 40 * millisecond)
    assert places(monitor) == [(0, 11), (1, 21)]
    for late, expected, held in ((0, 'clear', [(0, 11), (1, 21)]), (1, 'unknown', [(0, 11)])):
        now = first + 2 * SECOND + 25 * millisecond + late
        monitor.receive('robot', serialised(box(0), now), now)
        assert (status(monitor), places(monitor)) == (expected, held)


def test_limit_of_obstacles_can_be_lowered_in_the_middle_of_a_set():
    """What is beyond it is in doubt from then on, although it has been taken before."""
    monitor, stamp = monitor_in_a_set()
    lidar, tracks = SETTINGS.obstacles
    monitor.scene.update(replace(SETTINGS, obstacles=(replace(lidar, max_count=1), tracks)))
    assert monitor.receive('lidar', serialised(box(21), stamp), stamp).reason == TOO_MANY


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
    monitor = Monitor(ONE_SOURCE)
    monitor.receive('robot', serialised(box(0)), NOW)
    for k, stamp, expected in ((0, NOW, known), (2, NOW + SECOND // 10, 'clear')):
        monitor.receive_batch('lidar', [serialised(box(10), stamp), serialised([], stamp)], stamp,
                              number + k)
        assert status(monitor) == expected


def test_messages_without_numbers_are_noted():
    """No loss shows where the middleware does not count; one after another continues."""
    monitor = clear_monitor()
    assert monitor.is_numbered
    monitor.receive('lidar', serialised(box(10), NOW + 1), NOW + 1)
    monitor.receive('lidar', serialised([], NOW + 1), NOW + 1)
    assert not monitor.is_numbered
    assert places(monitor) == [(0, 10)]
    assert monitor.lost == {}

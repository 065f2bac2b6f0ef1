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

"""The monitor: serialised messages in, states out, and nothing that arrives makes it fail."""

from dataclasses import replace
import math
import random
import struct

from builders import box, SECOND, serialised
import pytest
from sat_collision.geometry.jit import COMPILED
from sat_collision.monitor import Monitor
from sat_collision.scene.holders import TOO_MANY
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

NOW = 1000 * SECOND
SETTINGS = Settings(
    frame_id='map',
    footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons'),
               ObstacleSettings('tracks', '/tracks', type='polygon_instance', max_count=2)))
BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]
CIRCLE = [(math.cos(k / 500), math.sin(k / 500)) for k in range(2000)]


def clear_monitor(settings=SETTINGS):
    """Return a monitor that has heard a footprint at 0 and of obstacles far from it."""
    monitor = Monitor(settings)
    for seconds in (2, 1):
        monitor.scene.advance(NOW - seconds * SECOND)
    assert monitor.receive('robot', serialised(box(0)), NOW) is None
    assert monitor.receive('lidar', serialised(box(10)), NOW) is None
    assert monitor.receive('lidar', serialised([]), NOW) is None
    if len(settings.obstacles) > 1:
        assert monitor.receive('tracks', serialised(box(20), instance=1), NOW) is None
    assert status(monitor) == 'clear'
    return monitor


def status(monitor):
    return monitor.scene.state('robot').status.value


def test_messages_become_contacts():
    """A footprint, a set and an instance touch; every message is counted."""
    monitor = clear_monitor()
    assert monitor.receive('lidar', serialised(box(1)), NOW) is None
    assert monitor.receive('tracks', serialised(box(-0.5), instance=-7), NOW) is None
    assert status(monitor) == 'collision'
    assert monitor.scene.state('robot').contacts == (
        ObstacleId('lidar', 1), ObstacleId('tracks', -7))
    assert monitor.received == {'robot': 1, 'lidar': 3, 'tracks': 2}
    assert not monitor.rejected


def test_empty_polygon_of_a_source_is_a_heartbeat():
    """The stamp of the heartbeat counts, as that of any message."""
    monitor = clear_monitor()
    later = NOW + SECOND
    assert monitor.receive('robot', serialised(box(0), later), later) is None
    assert monitor.receive('lidar', serialised([], later - 1), later) is None
    assert monitor.receive('lidar', serialised([], later + SECOND), later) is None
    assert [name.source for name, _ in monitor.scene.obstacles] == ['tracks']
    assert status(monitor) == 'clear'


@pytest.mark.parametrize('name, instance', [('robot', None), ('lidar', None), ('tracks', 5)])
@pytest.mark.parametrize('reason, points, frame_id', [
    ('empty frame_id', box(0.5), ''),
    ('other frame', box(0.5), 'odom'),
    ('not finite', [(0, 0), (1, math.nan), (1, 1)], 'map'),
    ('not finite', [(0, 0), (math.inf, 0), (1, 1)], 'map'),
    ('self-intersecting', BOW_TIE, 'map'),
    ('too many vertices', CIRCLE, 'map')])
def test_bad_message_is_rejected_until_good_data_arrives(
        name, instance, reason, points, frame_id):
    """The state is unknown and says why; the rejection says where, why and what to do."""
    monitor = clear_monitor()
    rejection = monitor.receive(name, serialised(points, NOW, frame_id, instance), NOW)
    topic = monitor.scene.settings_of(name).topic
    assert (rejection.name, rejection.topic, rejection.reason) == (name, topic, reason)
    assert topic in rejection.text and reason in rejection.text
    assert monitor.rejected == {(name, reason): 1}
    assert status(monitor) == 'unknown'
    assert any(name in sentence for sentence in monitor.scene.state('robot').reasons)
    for later, x in ((NOW + SECOND // 2, 30), (NOW + SECOND, 0.5)):
        assert monitor.receive(name, serialised(box(x), later, 'map', instance), later) is None
    if name == 'lidar':
        monitor.receive(name, serialised([], later), later)
    assert status(monitor) == ('clear' if name == 'robot' else 'collision')
    assert monitor.scene.state('robot').reasons == ()


def test_empty_footprint_is_rejected():
    """There is no footprint without points: a zero-point message must not read as clear."""
    monitor = clear_monitor()
    assert monitor.receive('robot', serialised([]), NOW).reason == 'empty'
    assert status(monitor) == 'unknown'


@pytest.mark.parametrize('name, instance', [('robot', None), ('lidar', None), ('tracks', 5)])
def test_undecodable_message_is_rejected(name, instance):
    """Bytes that end too early, or none at all."""
    good = serialised(box(0), instance=instance)
    for data in (good[:-1], good[:3], b''):
        monitor = clear_monitor()
        assert monitor.receive(name, data, NOW).reason == 'undecodable'
        assert status(monitor) == 'unknown'


def test_source_over_its_limit_is_rejected():
    """The third track of a source that may hold two."""
    monitor = clear_monitor()
    assert monitor.receive('tracks', serialised(box(21), instance=2), NOW) is None
    rejection = monitor.receive('tracks', serialised(box(22), instance=3), NOW)
    assert rejection.reason == 'too many obstacles'
    assert 'max_count' in rejection.text
    assert status(monitor) == 'unknown'


def test_obstacle_past_its_timeout_is_rejected():
    """The clocks of two machines differ by more than the timeout: the log must say so."""
    monitor = clear_monitor()
    rejection = monitor.receive('lidar', serialised(box(0), NOW - 3 * SECOND), NOW)
    assert rejection.reason == 'too old'
    assert '3.000 s old' in rejection.text and 'timeout' in rejection.text
    assert status(monitor) == 'clear'


def test_message_of_what_is_disabled_is_neither_taken_nor_rejected():
    """Whatever it holds; it is counted as received."""
    monitor = clear_monitor()
    lidar, tracks = SETTINGS.obstacles
    monitor.scene.update(replace(SETTINGS, obstacles=(replace(lidar, enabled=False), tracks)))
    for data in (serialised(box(0)), serialised(BOW_TIE), b''):
        assert monitor.receive('lidar', data, NOW) is None
    assert monitor.received['lidar'] == 5
    assert not monitor.rejected
    assert status(monitor) == 'clear'


def test_limit_of_vertices_can_be_changed():
    """max_vertices is a setting of the monitor."""
    monitor = clear_monitor(replace(SETTINGS, max_vertices=3000))
    assert monitor.receive('lidar', serialised(CIRCLE), NOW) is None
    assert status(monitor) == 'collision'


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


@pytest.mark.parametrize('name, instance', [('robot', None), ('lidar', None), ('tracks', 5)])
def test_stamp_from_the_future_is_rejected(name, instance):
    """The clocks of two machines differ by an hour: the log says what to do."""
    monitor = clear_monitor()
    rejection = monitor.receive(
        name, serialised(box(30), NOW + 3600 * SECOND, instance=instance), NOW)
    assert rejection.reason == 'from the future'
    assert '3600.000 s ahead' in rejection.text and 'future_tolerance' in rejection.text
    assert status(monitor) == 'unknown'


def test_older_footprint_is_rejected_and_changes_nothing():
    """Two publishers send it, or the network changes their order."""
    monitor = clear_monitor()
    rejection = monitor.receive('robot', serialised(box(10), NOW - 1), NOW)
    assert rejection.reason == 'older than the last'
    assert monitor.rejected == {('robot', 'older than the last'): 1}
    assert status(monitor) == 'clear'


def test_damaged_messages_never_raise():
    """Random bytes are changed, inserted and cut in messages of every kind."""
    rng = random.Random(0)
    monitor = clear_monitor()
    for step in range(3000):
        name, instance = rng.choice((('robot', None), ('lidar', None), ('tracks', 3)))
        data = bytearray(serialised(box(rng.randrange(5)), NOW + step, 'map', instance))
        for _ in range(rng.randrange(4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        if rng.random() < 0.2:
            del data[rng.randrange(len(data)):]
        rejection = monitor.receive(name, bytes(data), NOW + step)
        assert rejection is None or rejection.text
    assert sum(monitor.received.values()) == 3004
    assert {reason for _, reason in monitor.rejected} > {'undecodable', 'other frame', 'too old'}


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


def star(vertices):
    """Return a polygon with a notch at every second vertex."""
    return [((2 + k % 2) * math.cos(2 * math.pi * k / vertices),
             (2 + k % 2) * math.sin(2 * math.pi * k / vertices)) for k in range(vertices)]


@pytest.mark.parametrize('vertices, in_time', [(128, True), (130, COMPILED), (1024, COMPILED)])
def test_notches_cost_more_than_plain_python_has_time_for(vertices, in_time):
    """Refused with the number and the kernel, so that nothing else has to wait."""
    monitor = clear_monitor()
    rejection = monitor.receive('lidar', serialised(star(vertices)), NOW)
    assert status(monitor) == ('collision' if in_time else 'unknown')
    if in_time:
        assert rejection is None
    else:
        assert rejection.reason == 'too many vertices'
        assert f'{vertices} vertices' in rejection.detail and 'plain Python' in rejection.detail


def test_convex_polygons_have_no_such_limit():
    """As many vertices as max_vertices allows, compiled or not."""
    circle = [(math.cos(k / 163), math.sin(k / 163)) for k in range(1024)]
    assert clear_monitor().receive('lidar', serialised(circle), NOW) is None


def test_endless_superfluous_points_are_not_looked_at():
    """Repeated points are dropped, but not any number of them."""
    monitor = clear_monitor()
    corners = box(10)
    assert monitor.receive('lidar', serialised(corners + corners[-1:] * 8000), NOW) is None
    rejection = monitor.receive('lidar', serialised(corners + corners[-1:] * 9000), NOW)
    assert rejection.reason == 'too many vertices' and '9004 points' in rejection.detail
    assert status(monitor) == 'unknown'


@pytest.mark.parametrize('frame_id', ['odom\n[INFO] fine', '\x1b[31mred', 'a' * 255, '\u202egnol'])
def test_names_of_frames_are_shown_not_obeyed(frame_id):
    """In the rejection and in the state: one line, nothing invisible, not too long."""
    monitor = clear_monitor()
    rejection = monitor.receive('robot', serialised(box(0), frame_id=frame_id), NOW)
    assert rejection.text.isprintable() and len(rejection.text) < 300
    monitor = Monitor(SETTINGS)
    monitor.receive('robot', serialised(box(0), frame_id=frame_id), NOW)
    monitor.receive('robot', serialised(box(0), frame_id='map'), NOW)
    for reason in monitor.scene.state('robot').reasons:
        assert reason.isprintable() and len(reason) < 200


def test_long_names_of_frames_are_refused():
    """A frame's name is repeated in all that is published."""
    monitor = clear_monitor()
    rejection = monitor.receive('robot', serialised(box(0), frame_id='a' * 256), NOW)
    assert rejection.reason == 'long frame_id' and '256' in rejection.detail
    assert status(monitor) == 'unknown'


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

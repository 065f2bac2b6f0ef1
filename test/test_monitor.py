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

from builders import box, SECOND, serialised
from monitors import BOW_TIE, CIRCLE, clear_monitor, NOW, SETTINGS, status
import pytest
from sat_collision.geometry.jit import COMPILED
from sat_collision.monitor import Monitor
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.streams import Endpoint

ONE_SOURCE = replace(SETTINGS, obstacles=SETTINGS.obstacles[:1])


def test_messages_become_contacts():
    """A footprint, a set and an instance touch; every message is counted."""
    monitor = clear_monitor()
    assert monitor.receive('lidar', serialised(box(1)), NOW) is None
    assert monitor.receive('tracks', serialised(box(-0.5), instance=-7), NOW) is None
    assert status(monitor) == 'collision'
    assert monitor.scene.state('robot').contacts == (
        ObstacleId('lidar', 1), ObstacleId('tracks', -7))
    assert monitor.received == {'robot': 1, 'lidar': 3, 'tracks': 3}
    assert not monitor.rejected


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


@pytest.mark.parametrize('name, instance', [('robot', None), ('lidar', None), ('tracks', 5)])
def test_stamp_from_the_future_is_rejected(name, instance):
    """The clocks of two machines differ by an hour: the log says what to do."""
    monitor = clear_monitor()
    rejection = monitor.receive(
        name, serialised(box(30), NOW + 3600 * SECOND, instance=instance), NOW)
    assert rejection.reason == 'from the future'
    assert '3600.000 s ahead' in rejection.text and 'future_tolerance' in rejection.text
    assert status(monitor) == 'unknown'


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
    assert sum(monitor.received.values()) == 3005
    assert {reason for _, reason in monitor.rejected} > {'undecodable', 'other frame', 'too old'}


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


def places(monitor):
    """Return number and place of the obstacles of sets, in order."""
    return sorted((name.key, polygon.bounds[0]) for name, polygon in monitor.scene.obstacles
                  if name.source == 'lidar')


def test_set_is_as_old_as_its_oldest_message():
    """Within a set a stamp may be earlier than that of the message before."""
    monitor = clear_monitor(ONE_SOURCE)
    first = NOW + SECOND
    millisecond = SECOND // 1000
    for stamp, x in ((0, 10), (19, 20), (40, 11), (25, 21)):
        stamp = first + stamp * millisecond
        monitor.receive('lidar', serialised(box(x), stamp), first + 40 * millisecond)
    last = first + 40 * millisecond
    assert monitor.receive('lidar', serialised([], last), last) is None
    assert places(monitor) == [(0, 11), (1, 21)]
    for late, expected, held in ((0, 'clear', [(0, 11), (1, 21)]), (1, 'unknown', [(0, 11)])):
        now = first + 2 * SECOND + 25 * millisecond + late
        monitor.receive('robot', serialised(box(0), now), now)
        assert (status(monitor), places(monitor)) == (expected, held)


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


def test_each_message_is_a_whole_set_with_a_max_count_of_1():
    """As the footprint of another robot is: nothing else ends the set."""
    lidar, = ONE_SOURCE.obstacles
    monitor = Monitor(replace(ONE_SOURCE, obstacles=(replace(lidar, max_count=1),)))
    for number, (x, known) in enumerate(((10, 'clear'), (0.5, 'collision'), (10, 'clear')), 1):
        stamp = NOW + number * SECOND // 10
        monitor.receive('robot', serialised(box(0), stamp), stamp)
        monitor.receive('lidar', serialised(box(x), stamp), stamp, number)
        assert status(monitor) == known and len(monitor.scene.obstacles) == 1

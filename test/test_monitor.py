# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The monitor: serialised messages in, states out; invalid messages never make it fail."""

from dataclasses import replace
import math

from builders import box, SECOND, serialised
from monitors import BOW_TIE, CIRCLE, clear_monitor, NOW, SETTINGS, status, with_changes
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.streams import Endpoint

INPUTS = ('robot', None), ('lidar', None), ('tracks', 5)


def test_messages_become_contacts():
    """Of a set and of an instance; every message is counted."""
    monitor = clear_monitor()
    assert monitor.receive('lidar', serialised(box(1)), NOW) is None
    assert monitor.receive('tracks', serialised(box(-0.5), instance=-7), NOW) is None
    assert status(monitor) == 'collision'
    assert monitor.scene.state('robot').contacts == (
        ObstacleId('lidar', 0), ObstacleId('tracks', -7))
    assert monitor.received == {'robot': 1, 'lidar': 3, 'tracks': 4}
    assert not monitor.rejected


@pytest.mark.parametrize('name, instance', INPUTS)
@pytest.mark.parametrize('reason, points, frame_id', [
    ('empty frame_id', box(0.5), ''),
    ('other frame', box(0.5), 'odom'),
    ('not finite', [(0, 0), (1, math.nan), (1, 1)], 'map'),
    ('not finite', [(0, 0), (math.inf, 0), (1, 1)], 'map'),
    ('self-intersecting', BOW_TIE, 'map'),
    ('too many vertices', CIRCLE, 'map')])
def test_invalid_message_is_unknown_until_a_valid_one(
        name, instance, reason, points, frame_id):
    """The rejection says where, why and what to do."""
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


@pytest.mark.parametrize('name, data, reason, words', [
    ('robot', serialised([]), 'empty', ()),
    # It may be of a clock that was set back, and so all begins anew.
    ('lidar', serialised(box(0), NOW - 3 * SECOND), 'too old', ('3.000 s old', 'timeout')),
    # The clocks of two machines differ by an hour.
    *((name, serialised(box(30), NOW + 3600 * SECOND, instance=instance), 'from the future',
       ('3600.000 s ahead', 'future_tolerance')) for name, instance in INPUTS),
    # Truncated or empty.
    *((name, serialised(box(0), instance=instance)[:size], 'undecodable', ())
      for name, instance in INPUTS for size in (-1, 3, 0))],
    ids=lambda one: one if isinstance(one, str) else '')
def test_rejection_says_why_and_what_to_do(name, data, reason, words):
    monitor = clear_monitor()
    rejection = monitor.receive(name, data, NOW)
    assert rejection.reason == reason and all(word in rejection.text for word in words)
    assert status(monitor) == 'unknown'


def test_obstacle_beyond_max_count_is_rejected():
    monitor = clear_monitor()
    assert monitor.receive('tracks', serialised(box(21), instance=2), NOW) is None
    rejection = monitor.receive('tracks', serialised(box(22), instance=3), NOW)
    assert rejection.reason == 'too many obstacles'
    assert 'max_count' in rejection.text
    assert status(monitor) == 'unknown'


def test_messages_of_a_disabled_source_are_only_counted():
    monitor = clear_monitor()
    monitor.scene.update(with_changes(SETTINGS, 'lidar', enabled=False))
    for data in (serialised(box(0)), serialised(BOW_TIE), b''):
        assert monitor.receive('lidar', data, NOW) is None
    assert monitor.received['lidar'] == 5
    assert not monitor.rejected
    assert status(monitor) == 'clear'


def test_max_vertices():
    monitor = clear_monitor(replace(SETTINGS, max_vertices=3000))
    assert monitor.receive('lidar', serialised(CIRCLE), NOW) is None
    assert status(monitor) == 'collision'


def star(vertices):
    """Return a non-convex polygon with a reflex angle at every second vertex."""
    return [((2 + k % 2) * math.cos(2 * math.pi * k / vertices),
             (2 + k % 2) * math.sin(2 * math.pi * k / vertices)) for k in range(vertices)]


def test_vertices_of_non_convex_polygons_may_be_limited():
    """As the node does in plain Python, where numba helps and raising max_vertices does not."""
    monitor = clear_monitor(max_non_convex=128)
    rejection = monitor.receive('lidar', serialised(star(130)), NOW)
    assert (rejection.reason, status(monitor)) == ('too many vertices', 'unknown')
    assert '130 vertices, but at most 128 of a polygon that is not convex' in rejection.detail
    assert rejection.text.endswith('; simplify the polygon or run the node with numba')
    assert monitor.receive('lidar', serialised(star(128)), NOW + 1) is None
    assert status(monitor) == 'collision'


@pytest.mark.parametrize('most, points', [
    # Where nothing has to be in time, as in replay, so that the answers are the same.
    (None, star(200)),
    (128, [(math.cos(k / 163), math.sin(k / 163)) for k in range(1024)])],
    ids=['without the limit', 'convex'])
def test_vertices_of_other_polygons_are_not_limited_with_them(most, points):
    """Plain Python has the limit of kernels."""
    monitor = clear_monitor(max_non_convex=most)
    assert monitor.receive('lidar', serialised(points), NOW) is None
    assert status(monitor) == 'collision'


def test_number_of_repeated_points_is_limited():
    monitor = clear_monitor()
    corners = box(10)
    assert monitor.receive('lidar', serialised(corners + corners[-1:] * 8000), NOW) is None
    rejection = monitor.receive('lidar', serialised(corners + corners[-1:] * 9000), NOW)
    assert rejection.reason == 'too many vertices' and '9004 points' in rejection.detail
    assert status(monitor) == 'unknown'


@pytest.mark.parametrize('frame_id', ['odom\n[INFO] fine', '\x1b[31mred', 'a' * 255, '\u202egnol'])
def test_control_characters_in_frame_names_are_escaped(frame_id):
    """In the rejection and in the state: one line, printable, not too long."""
    monitor = clear_monitor()
    rejection = monitor.receive('robot', serialised(box(0), frame_id=frame_id), NOW)
    assert rejection.text.isprintable() and len(rejection.text) < 300
    monitor = Monitor(SETTINGS)
    monitor.receive('robot', serialised(box(0), frame_id=frame_id), NOW)
    monitor.receive('robot', serialised(box(0), frame_id='map'), NOW)
    for reason in monitor.scene.state('robot').reasons:
        assert reason.isprintable() and len(reason) < 200


def test_long_frame_names_are_refused():
    monitor = clear_monitor()
    rejection = monitor.receive('robot', serialised(box(0), frame_id='a' * 256), NOW)
    assert rejection.reason == 'long frame_id' and '256' in rejection.detail
    assert status(monitor) == 'unknown'


def test_publisher_announced_after_its_message():
    monitor = Monitor(replace(SETTINGS, obstacles=SETTINGS.obstacles[:1]))

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


def test_messages_without_numbers():
    """Losses cannot be noticed, and messages are assumed to be consecutive."""
    monitor = clear_monitor()
    for points in (box(10), []):
        monitor.receive('lidar', serialised(points, NOW + 1), NOW + 1)
    assert [(name.key, polygon.bounds[0]) for name, polygon in monitor.scene.obstacles
            if name.source == 'lidar'] == [(0, 10)]
    assert monitor.scene.lost() == {}

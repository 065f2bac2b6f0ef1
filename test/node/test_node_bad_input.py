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

"""Bad input over DDS: nothing that others in the domain send makes a footprint clear."""

import math
from pathlib import Path
import struct
from xml.etree import ElementTree

from builders import serialised
from geometry_msgs.msg import PolygonStamped
from harness import box, health, polygon_message, SECOND, values
import pytest
from rclpy.serialization import serialize_message
from sat_collision.messages.transform_listener import TRANSFORM_TOPICS

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]
CIRCLE = [(math.cos(k / 500), math.sin(k / 500)) for k in range(2000)]
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}
GOOD_POLYGONS = ('obstacles', APART), ('footprint', ROBOT)
GOOD = serialize_message(polygon_message(APART, 10**18))
BAD_POLYGONS = {
    'not finite': [(0, 0), (1, math.nan), (1, 1)],
    'self-intersecting': BOW_TIE,
    'too many vertices': CIRCLE,
}
BAD_BYTES = {
    'truncated': GOOD[:-1],
    'of nothing': b'',
    'left over': GOOD + b'1234',
}


def send(monitor, topic, points, **options):
    """Send a footprint, or a set of one obstacle."""
    (monitor.send if topic == 'footprint' else monitor.send_set)(topic, points, **options)


def clear(monitor):
    """Bring the monitor to a clear state."""
    for topic, good in GOOD_POLYGONS:
        send(monitor, topic, good)
    monitor.await_state('clear')


@pytest.mark.parametrize('reason', BAD_POLYGONS)
def test_bad_polygon_makes_unknown_until_good_data_arrives(start, reason):
    """First as obstacle, then as footprint; the next good message heals."""
    monitor = start(**LASTING)
    clear(monitor)
    for topic, good in GOOD_POLYGONS:
        send(monitor, topic, BAD_POLYGONS[reason])
        monitor.await_state('unknown')
        assert reason in monitor.reason()
        monitor.until(monitor.flag)
        send(monitor, topic, good)
        monitor.await_state('clear')
    key = f'footprint: rejected, {reason}'
    health = monitor.until(lambda: monitor.health() and key in values(monitor.health())
                           and monitor.health(), 'a count in /diagnostics')
    assert values(health)[key] == '1'
    assert values(health)[f'obstacle: rejected, {reason}'] == '1'
    for topic in ('/obstacles', '/footprint'):
        assert len(monitor.logged(reason, topic)) == 1


@pytest.mark.parametrize('situation', BAD_BYTES)
def test_bytes_that_are_no_message_make_unknown(start, situation):
    """A footprint at once; obstacles when the last whole set is past its timeout."""
    monitor = start(footprint__timeout=0.0, obstacle__timeout=0.5)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    bad = BAD_BYTES[situation]

    def sent():
        monitor.publisher('obstacles').publish(bad)
        monitor.send_set('obstacles', APART)
        monitor.spin(0.03)
        return 'since a message was refused: undecodable' in monitor.reason()
    monitor.until(sent)
    monitor.send_set_until('clear', 'obstacles', APART)
    monitor.publisher('footprint').publish(bad)
    monitor.until(lambda: 'was refused: undecodable' in monitor.reason())
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    for topic in ('/obstacles', '/footprint'):
        monitor.logged('undecodable', topic)


def test_empty_footprint_is_unknown(start):
    """An empty polygon ends a set of obstacles, but is no footprint."""
    monitor = start(**LASTING)
    clear(monitor)
    monitor.send('footprint', [])
    status = monitor.await_state('unknown')
    assert 'empty' in values(status)['reason']


def test_empty_frame_is_refused(start):
    """Coordinates in no frame mean nothing."""
    monitor = start(**LASTING)
    clear(monitor)
    for topic, good in GOOD_POLYGONS:
        send(monitor, topic, good, frame_id='')
        monitor.await_state('unknown')
        assert 'frame' in monitor.reason()
        send(monitor, topic, good)
        monitor.await_state('clear')


def test_other_bodies_are_untouched(start):
    """A bad footprint leaves the other's state; a bad obstacle leaves a proved contact."""
    monitor = start(footprints=['left', 'right'], left__timeout=0.0, right__timeout=0.0,
                    obstacle__timeout=60.0)
    monitor.send('left', ROBOT)
    monitor.send('right', box(9, 0))
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision', 'left')
    monitor.await_state('clear', 'right')
    monitor.send('right', BOW_TIE)
    monitor.await_state('unknown', 'right')
    assert monitor.state('left') == 'collision'
    monitor.send('right', box(9, 0))
    monitor.await_state('clear', 'right')
    monitor.send_set('obstacles', TOUCHING, BOW_TIE)
    monitor.await_state('unknown', 'right')
    assert monitor.state('left') == 'collision'
    assert monitor.contacts('left') == ['obstacle/0']


def test_rejections_are_logged_once_a_second_at_most(start):
    """A hundred bad messages in about a second: a few lines, all of them counted."""
    monitor = start(**LASTING)
    clear(monitor)
    begun = monitor.now()
    for _ in range(100):
        monitor.send_set('obstacles', BOW_TIE)
        monitor.spin(0.005)
    key = 'obstacle: rejected, self-intersecting'
    monitor.until(lambda: monitor.health() and values(monitor.health()).get(key) == '100',
                  '100 counted')
    monitor.logged('self-intersecting', '/obstacles')
    monitor.spin(0.1)
    lines = monitor.logged('self-intersecting', '/obstacles')
    assert len(lines) <= 2 + (monitor.now() - begun) // SECOND


def test_max_vertices_is_a_parameter(start):
    """Four vertices are one too many here."""
    monitor = start(max_vertices=3, **LASTING)
    monitor.send('footprint', [(0, 0), (1, 0), (0, 1)])
    monitor.send_set('obstacles', [(5, 5), (6, 5), (6, 6)])
    monitor.await_state('clear')
    monitor.send_set('obstacles', APART)
    monitor.await_state('unknown')


LOCKED = {'enabled': False, 'unknown_is_collision': False, 'margin': 0.5, 'release_delay': 5.0,
          'footprint__timeout': 0.0, 'footprint__enabled': False, 'obstacle__timeout': 0.0,
          'obstacle__enabled': False, 'obstacle__set_window': 5.0, 'obstacle__accumulate': True,
          'obstacle__max_count': 1, 'obstacle__settle_time': 0.1,
          'watchdog': 0.0, 'use_sim_time': True}


def test_locked_parameters_stay(start):
    """Each is refused, with a reason; nothing is changed by the attempt."""
    running = start(lock_parameters=True, watchdog=0.5)
    for name, reason in zip(LOCKED, running.set_parameters(**LOCKED)):
        assert 'lock_parameters' in reason
        value = running.monitor.get_parameter(name.replace('__', '.')).value
        assert value != LOCKED[name], name
    assert not running.monitor.get_clock().ros_time_is_active


def test_what_decides_nothing_is_not_locked(start):
    """How often is published may be changed, and the lock itself may not be opened."""
    running = start(lock_parameters=True)
    assert running.set_parameters(publish_rate=20.0) == [None]
    assert running.set_parameters(lock_parameters=False) != [None]
    assert running.set_parameters(margin=1.0) != [None]


def test_without_a_lock_each_change_is_told(start):
    """In the log with old and new value, and in /diagnostics."""
    running = start()
    assert running.set_parameters(margin=0.25, use_sim_time=True) == [None, None]
    running.logged('parameter margin was changed from 0.0 to 0.25')
    running.logged('parameter use_sim_time was changed from False to True')
    running.until(lambda: health(running).get('margin: changed') == 'from 0.0 to 0.25')


def test_change_of_an_outline_is_told_in_plain_words(start):
    """As the list that a file would have."""
    running = start(footprint__points=[0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
                    footprint__frame_id='base', footprint__odometry='odometry',
                    frame_id='odom')
    assert running.set_parameters(footprint__points=[0.0, 0.0, 2.0, 0.0, 0.0, 2.0]) == [None]
    running.logged('parameter footprint.points was changed from [0.0, 0.0, 1.0, 0.0, 0.0, 1.0] '
                   'to [0.0, 0.0, 2.0, 0.0, 0.0, 2.0]')


def test_a_frame_id_cannot_forge_a_line_of_the_log(start):
    """New lines and colours are shown as what they are; only the beginning of a long one is."""
    running = start(frame_id='map')
    forged = 'odom\n[INFO] all is well \x1b[2J' + 100 * 'x'
    running.send('footprint', box(0, 0), frame_id=forged)
    line = running.logged('odom', 'other frame')[0]
    assert line.isprintable() and len(line) < 400, line
    assert 'x' * 70 not in line


@pytest.mark.parametrize('length, reason', [(255, 'other frame'), (256, 'long frame_id'),
                                            (200_000, 'long frame_id')])
def test_a_long_frame_id_is_refused(start, length, reason):
    """It would be repeated in each state and each marker."""
    running = start(frame_id='map')
    running.send('footprint', box(0, 0), frame_id='x' * length)
    running.logged(reason)
    running.until(lambda: health(running).get(f'footprint: rejected, {reason}'))
    assert len(running.await_state('unknown').message) < 400


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize('where', ['frame_id', 'points'])
def test_an_absurd_length_costs_no_line_of_the_middleware(start, capfd, where, order):
    """Counted and refused; rclpy, which writes to the standard error itself, never sees it."""
    running = start()
    data = bytearray(serialised(box(0, 0), order=order))
    struct.pack_into(order + 'I', data, 12 if where == 'frame_id' else 20, 0xFFFFFFFF)
    publisher = running.publisher('footprint', PolygonStamped)
    capfd.readouterr()
    for _ in range(20):
        publisher.publish(bytes(data))
        running.spin(0.01)
    running.until(
        lambda: int(health(running).get('footprint: rejected, undecodable', 0)) >= 1)
    written = capfd.readouterr().err
    assert 'cdr' not in written.lower() and written.count('\n') < 10, written
    running.await_state('unknown')


POLICY = Path(__file__).resolve().parents[2] / 'config' / 'sros2_policy.xml'


@pytest.mark.parametrize('fixed_frame', [{}, {'frame_id': 'map'}], ids=['no frame', 'a frame'])
def test_the_policy_allows_exactly_what_the_node_has(start, monkeypatch, fixed_frame):
    """Each topic and service that the graph shows of it; with a fixed frame transforms, too."""
    monkeypatch.setattr('sat_collision.node.footprint_monitor.transform_type',
                        lambda node, settings: PolygonStamped if settings.frame_id else None)
    running = start(**fixed_frame)
    profile, = ElementTree.parse(POLICY).iter('profile')

    def allowed(kind, how):
        return {one.text for group in profile.iter(kind) if group.get(how) == 'ALLOW'
                for one in group}
    expected = (allowed('topics', 'publish'),
                allowed('topics', 'subscribe') | (set(TRANSFORM_TOPICS) if fixed_frame else set()),
                allowed('services', 'reply'), set())

    def shown():
        return tuple({topic for topic, _ in names('footprint_monitor', '/')} for names in (
            running.node.get_publisher_names_and_types_by_node,
            running.node.get_subscriber_names_and_types_by_node,
            running.node.get_service_names_and_types_by_node,
            running.node.get_client_names_and_types_by_node))
    running.until(lambda: 'footprint_monitor' in running.node.get_node_names())
    running.until(lambda: all(map(set.issuperset, shown(), expected)), f'{expected} in the graph')
    assert shown() == expected

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

"""Bad input over the wire: what is refused, counted and logged, and what it must not touch."""

import math

from harness import box, polygon_message, SECOND, values
import pytest
from rclpy.serialization import serialize_message

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

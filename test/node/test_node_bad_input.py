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
NO_TIMEOUT = {'footprint__timeout': 0.0, 'obstacle__timeout': 0.0}

GOOD = serialize_message(polygon_message(APART, 10**18))
BAD_POLYGONS = {
    'not finite': [(0, 0), (1, math.nan), (1, 1)],
    'infinite': [(0, 0), (math.inf, 0), (1, 1)],
    'self-intersecting': BOW_TIE,
    'too many vertices': CIRCLE,
}
BAD_BYTES = {
    'truncated': GOOD[:-1],
    'truncated behind the count': GOOD[:24],
    'without payload': GOOD[:4],
    'of nothing': b'',
    'left over': GOOD + b'1234',
    'foreign header': b'\xff\xff\xff\xff' + GOOD[4:],
}


def clear(monitor):
    """Bring the monitor to a clear state."""
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', APART)
    monitor.await_state('clear')


@pytest.mark.parametrize('situation', BAD_POLYGONS)
def test_bad_polygon_makes_unknown_until_good_data_arrives(start, situation):
    """First as obstacle, then as footprint; the next good message heals."""
    monitor = start(**NO_TIMEOUT)
    clear(monitor)
    reason = 'not finite' if situation == 'infinite' else situation
    for topic, good in (('obstacles', APART), ('footprint', ROBOT)):
        monitor.send(topic, BAD_POLYGONS[situation])
        status = monitor.await_state('unknown')
        assert reason in values(status)['reason']
        monitor.until(monitor.flag)
        monitor.send(topic, good)
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
    """What typed subscribers drop in silence is refused aloud."""
    monitor = start(**NO_TIMEOUT)
    clear(monitor)
    for topic, good in (('obstacles', APART), ('footprint', ROBOT)):
        monitor.publisher(topic).publish(BAD_BYTES[situation])
        monitor.await_state('unknown')
        monitor.send_until('clear', topic, good)
        monitor.logged('undecodable', topic)


def test_empty_footprint_is_unknown(start):
    """An empty polygon is a heartbeat of obstacles, but no footprint."""
    monitor = start(**NO_TIMEOUT)
    clear(monitor)
    monitor.send('footprint', [])
    status = monitor.await_state('unknown')
    assert 'empty' in values(status)['reason']


def test_empty_frame_is_refused(start):
    """Coordinates in no frame mean nothing."""
    monitor = start(**NO_TIMEOUT)
    clear(monitor)
    for topic, good in (('obstacles', APART), ('footprint', ROBOT)):
        monitor.send(topic, good, frame_id='')
        status = monitor.await_state('unknown')
        assert 'frame' in values(status)['reason']
        monitor.send(topic, good)
        monitor.await_state('clear')


def test_other_bodies_are_untouched(start):
    """A bad footprint leaves the other's state; a bad obstacle leaves a proved contact."""
    monitor = start(footprints=['left', 'right'], left__timeout=0.0, right__timeout=0.0,
                    obstacle__timeout=0.0)
    monitor.send('left', ROBOT)
    monitor.send('right', box(9, 0))
    stamp = monitor.now()
    monitor.send('obstacles', TOUCHING, stamp)
    monitor.await_state('collision', 'left')
    monitor.await_state('clear', 'right')
    monitor.send('right', BOW_TIE)
    monitor.await_state('unknown', 'right')
    assert monitor.state('left') == 'collision'
    monitor.send('right', box(9, 0))
    monitor.await_state('clear', 'right')
    monitor.send('obstacles', BOW_TIE, stamp)
    monitor.await_state('unknown', 'right')
    assert monitor.state('left') == 'collision'
    assert monitor.contacts('left') == ['obstacle/0']


def test_rejections_are_logged_once_a_second_at_most(start):
    """Two hundred bad messages in about two seconds: a few lines, all of them counted."""
    monitor = start(**NO_TIMEOUT)
    clear(monitor)
    begun = monitor.now()
    for _ in range(200):
        monitor.send('obstacles', BOW_TIE)
        monitor.spin(0.005)
    key = 'obstacle: rejected, self-intersecting'
    monitor.until(lambda: monitor.health() and values(monitor.health()).get(key) == '200',
                  '200 counted')
    monitor.logged('self-intersecting', '/obstacles')
    monitor.spin(0.5)
    lines = monitor.logged('self-intersecting', '/obstacles')
    assert len(lines) <= 2 + (monitor.now() - begun) // SECOND


def test_max_vertices_is_a_parameter(start):
    """Four vertices are one too many here."""
    monitor = start(max_vertices=3, **NO_TIMEOUT)
    monitor.send('footprint', [(0, 0), (1, 0), (0, 1)])
    monitor.send('obstacles', [(5, 5), (6, 5), (6, 6)])
    monitor.await_state('clear')
    monitor.send('obstacles', APART)
    monitor.await_state('unknown')

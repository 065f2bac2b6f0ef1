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

"""Sets of a running node: what proves them whole, and the states before."""

import time

from geometry_msgs.msg import PolygonStamped
from harness import box, health, Peer, polygon_message, SECOND
import pytest
from sat_collision.node.footprint_monitor import FootprintMonitor

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}


def test_each_set_replaces_the_one_before_in_order(start):
    """The second obstacle of a set is hit; in the next set it has moved away, the first came."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART, TOUCHING)
    monitor.await_state('collision')
    assert monitor.contacts() == ['obstacle/1']
    monitor.send_set('obstacles', TOUCHING, APART)
    monitor.until(lambda: monitor.contacts() == ['obstacle/0'])


def test_contact_is_told_at_once_and_a_release_when_the_set_is_whole(start):
    """Without empty polygons a set is whole when the next one begins."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', APART)
    monitor.until(lambda: 'has not sent a whole set yet' in monitor.reason())
    monitor.send('obstacles', APART)
    monitor.await_state('clear')
    monitor.send('obstacles', TOUCHING)
    monitor.await_state('collision')
    flags = monitor.listen('~/collision')
    monitor.send('obstacles', APART)
    count = len(flags)
    monitor.until(lambda: monitor.received['obstacle'] == 4 and len(flags) > count + 2)
    assert monitor.state() == 'collision'
    monitor.send('obstacles', APART)
    monitor.await_state('clear')


def test_no_pause_ends_a_set(start):
    """The last of a set, half a second after the others, is on the robot: never clear before."""
    monitor = start(**LASTING)
    states = monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING, APART)
    monitor.await_state('collision')
    del states[:]
    stamp = monitor.now()
    monitor.send('obstacles', APART, stamp)
    monitor.spin(0.5)
    monitor.send('obstacles', TOUCHING, stamp)
    monitor.send('obstacles', [], stamp)
    monitor.until(lambda: monitor.contacts() == ['obstacle/1'])
    assert {*monitor.states()} == {'collision'}


def test_max_count_ends_a_set(start):
    """As of a source whose sets have one obstacle each: known with the first message."""
    monitor = start(obstacle__max_count=1, **LASTING)
    monitor.send('footprint', ROBOT)
    for points, state in ((APART, 'clear'), (TOUCHING, 'collision'), (APART, 'clear')):
        monitor.send('obstacles', points)
        monitor.await_state(state)


def test_set_window_decides_what_is_one_set(start):
    """Stamps 0.3 s apart: with the window at 0.5 s two obstacles, at 0 one that has moved."""
    monitor = start(obstacle__set_window=0.5, **LASTING)
    stamp = monitor.now() - 10 * SECOND
    monitor.send('footprint', ROBOT)
    for points, offset in ((TOUCHING, 0), (APART, 3), ([], 3)):
        monitor.send('obstacles', points, stamp + offset * SECOND // 10)
    monitor.await_state('collision')
    assert monitor.set_parameters(obstacle__set_window=0.0) == [None]
    for points, offset in ((TOUCHING, 10), (APART, 13), ([], 13)):
        monitor.send('obstacles', points, stamp + offset * SECOND // 10)
    monitor.await_state('clear')


@pytest.mark.parametrize('gap', [0.0, 0.002], ids=['burst', '2 ms apart'])
def test_order_within_a_set_means_nothing(start, gap):
    """Eleven obstacles a set: the one on the robot comes first, last or between."""
    monitor = start(**LASTING)
    received = monitor.listen('~/collision')
    monitor.send('footprint', ROBOT)
    places = [TOUCHING, *(box(5 + x, 5) for x in range(10))]
    for number in range(10):
        stamp = monitor.now()
        for points in places[::-1] if number % 2 else places[number % 7:] + places[:number % 7]:
            monitor.send('obstacles', points, stamp)
            time.sleep(gap)
        monitor.send('obstacles', [], stamp)
        monitor.spin(0.05)
    monitor.await_state('collision')
    raised = [message.data for message in received]
    assert len(raised) > 10 and all(raised[raised.index(True):])


def test_set_that_was_under_way_when_the_node_began_does_not_count(start, domain):
    """What came before is not known; the next set is whole."""
    peer = Peer(domain)
    publisher = peer.node.create_publisher(PolygonStamped, '/obstacles', 10)
    stamp = peer.now()
    publisher.publish(polygon_message(TOUCHING, stamp))
    monitor = start(**LASTING)
    peer.until(publisher.get_subscription_count)
    monitor.until(lambda: monitor._is_heard('/obstacles'), 'news of the publisher')
    for points in (APART, []):
        publisher.publish(polygon_message(points, stamp))
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.received['obstacle'] == 2)
    monitor.until(lambda: monitor.reason().endswith('has not sent a whole set yet'))
    for points in (APART, []):
        publisher.publish(polygon_message(points, stamp + SECOND // 10))
    monitor.await_state('clear')
    peer.close()


def test_thousands_of_obstacles_a_set_are_all_taken(start):
    """Within max_count, in one burst."""
    monitor = start(**LASTING)
    monitor.publisher('obstacles', qos=10_000)
    monitor.send('footprint', ROBOT)
    received = monitor.listen('~/collision')
    for _ in range(3):
        monitor.send_set('obstacles', *(box(5 + k % 50, 5 + k // 50) for k in range(2998)),
                         TOUCHING)
        monitor.spin(0.3)
    monitor.until(lambda: monitor.received['obstacle'] == 9000, 'all messages')
    monitor.await_state('collision')
    raised = [message.data for message in received]
    assert all(raised[raised.index(True):])
    assert not monitor.monitor._monitor.lost


def test_window_that_cuts_a_set_is_told_with_the_remedy(start):
    """Ten obstacles, each stamped when it was built, 5 ms apart; the eighth is on the robot."""
    monitor = start(**LASTING)
    monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    for _ in range(5):
        stamp = monitor.now()
        for k in range(10):
            monitor.send('obstacles', TOUCHING if k == 7 else box(5 + k, 5),
                         stamp + k * SECOND // 200)
            monitor.spin()
        monitor.spin(0.05)
    monitor.until(lambda: 'set_window cuts' in monitor.reason())
    assert 'clear' not in monitor.states()


class LossyMonitor(FootprintMonitor):
    """Every tenth message on obstacles is lost on the way to it."""

    def receive(self, name, messages, now, number):
        for k, data in enumerate(messages, number):
            if name == 'footprint' or k % 10:
                super().receive(name, [data], now, k)


def test_tenth_of_all_messages_is_lost(start, monkeypatch):
    """Another member of the set each time, that on the robot among them: never clear."""
    monkeypatch.setattr('harness.FootprintMonitor', LossyMonitor)
    monitor = start(**LASTING)
    monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    for _ in range(40):
        monitor.send_set('obstacles', APART, box(7, 7), TOUCHING)
        monitor.spin(0.02)
    # More, if the middleware loses some, too.
    monitor.until(lambda: int(health(monitor).get('obstacle: lost', 0)) >= 15)
    assert 'clear' not in monitor.states() and 'collision' in monitor.states()


class NumberlessMonitor(FootprintMonitor):
    """Its middleware does not say which message of its publisher one is."""

    def receive(self, name, messages, now, number):
        super().receive(name, messages, now, None)


def test_middleware_without_numbers_is_told_of_once(start, monkeypatch):
    """All else works as ever."""
    monkeypatch.setattr('harness.FootprintMonitor', NumberlessMonitor)
    monitor = start(**LASTING)
    monitor.send_set('obstacles', APART)
    monitor.send_until('unknown', 'footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    monitor.send_set_until('collision', 'obstacles', TOUCHING)
    assert len(monitor.logged('does not number messages')) == 1
    assert not monitor.monitor._monitor.lost

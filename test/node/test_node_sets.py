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

"""Sets received by a running node: when they are whole, and the states before."""


from geometry_msgs.msg import PolygonStamped
from harness import APART, box, LASTING, polygon_message, ROBOT, SECOND, TOUCHING
from sat_collision.node.footprint_monitor import FootprintMonitor


def test_contact_is_immediate_and_release_needs_a_whole_set(start):
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


def test_set_window_can_be_changed_live(start):
    """Stamps 0.3 s apart: one set with a window of 0.5 s, two sets with a window of 0."""
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


def test_set_in_progress_when_the_node_starts_does_not_count(start, peer):
    """Its first messages were missed; the next set is whole."""
    publisher = peer.node.create_publisher(PolygonStamped, '/obstacles', 10)
    stamp = peer.now()
    publisher.publish(polygon_message(TOUCHING, stamp))
    monitor = start(**LASTING)
    peer.until(publisher.get_subscription_count)
    monitor.until(lambda: monitor._matches_publisher('/obstacles'), 'news of the publisher')
    for points in (APART, []):
        publisher.publish(polygon_message(points, stamp))
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.received['obstacle'] == 2)
    monitor.until(lambda: monitor.reason().endswith('has not sent a whole set yet'))
    for points in (APART, []):
        publisher.publish(polygon_message(points, stamp + SECOND // 10))
    monitor.await_state('clear')


def test_burst_of_thousands_of_obstacles_is_received(start):
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


class NumberlessMonitor(FootprintMonitor):
    """Its middleware does not number messages."""

    def receive(self, name, messages, now, number):
        super().receive(name, messages, now, None)


def test_middleware_without_numbers_is_logged_once(start, monkeypatch):
    """Everything else works."""
    monkeypatch.setattr('harness.FootprintMonitor', NumberlessMonitor)
    monitor = start(**LASTING)
    monitor.send_set('obstacles', APART)
    monitor.send_until('unknown', 'footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    monitor.send_set_until('collision', 'obstacles', TOUCHING)
    assert len(monitor.logged('does not number messages')) == 1
    assert not monitor.monitor._monitor.lost

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sets received by a running node: when they are whole, and the states before."""

from geometry_msgs.msg import PolygonStamped
from harness import APART, box, LASTING, polygon_message, ROBOT, SECOND, TOUCHING


def test_contact_is_immediate_and_release_needs_a_whole_set(start):
    """By new stamps a set is whole when the next one begins."""
    monitor = start(obstacle__set_end='new_stamp', **LASTING)
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
    monitor.until(lambda: 'since it was received from its middle on' in monitor.reason())
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

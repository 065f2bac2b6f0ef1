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

"""Sets of a running node: whole or not, in any order, lost in part, of several publishers."""

import subprocess
import sys
import time

from geometry_msgs.msg import PolygonStamped
from harness import box, health, Peer, polygon_message, SECOND, values
import pytest
from sat_collision.node.footprint_monitor import FootprintMonitor

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
NO_TIMEOUT = {'footprint__timeout': 0.0, 'obstacle__timeout': 0.0}


def test_each_set_replaces_the_one_before_in_order(start):
    """The second obstacle of a set is hit; in the next set it has moved away, the first came."""
    monitor = start(**NO_TIMEOUT)
    stamp = monitor.now()
    monitor.send('footprint', ROBOT, stamp)
    monitor.send('obstacles', APART, stamp)
    monitor.send('obstacles', TOUCHING, stamp)
    monitor.await_state('collision')
    assert monitor.contacts() == ['obstacle/1']
    monitor.send('obstacles', TOUCHING, stamp + SECOND)
    monitor.until(lambda: monitor.contacts() == ['obstacle/0', 'obstacle/1'])
    monitor.send('obstacles', APART, stamp + SECOND)
    monitor.until(lambda: monitor.contacts() == ['obstacle/0'])


def test_set_window_decides_what_is_one_set(start):
    """Stamps 0.3 s apart: with the window at 0.5 s two obstacles, at 0 one that has moved."""
    monitor = start(obstacle__set_window=0.5, future_tolerance=10.0, **NO_TIMEOUT)
    stamp = monitor.now()
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', TOUCHING, stamp)
    monitor.send('obstacles', APART, stamp + 3 * SECOND // 10)
    monitor.await_state('collision')
    assert monitor.set_parameters(obstacle__set_window=0.0) == [None]
    monitor.send('obstacles', APART, stamp + SECOND)
    monitor.await_state('clear')
    monitor.send('obstacles', TOUCHING, stamp + 2 * SECOND)
    monitor.await_state('collision')
    monitor.send('obstacles', APART, stamp + 23 * SECOND // 10)
    monitor.await_state('clear')


@pytest.mark.parametrize('gap', [0.0, 0.002], ids=['burst', '2 ms apart'])
def test_order_within_a_set_means_nothing(start, gap):
    """Eleven obstacles a set: the one on the robot comes first, last or between."""
    monitor = start(obstacle__set_quiet=1.0, **NO_TIMEOUT)
    heard = monitor.listen('~/collision')
    monitor.send('footprint', ROBOT)
    places = [TOUCHING, *(box(5 + x, 5) for x in range(10))]
    for number in range(20):
        stamp = monitor.now()
        for points in places[::-1] if number % 2 else places[number % 7:] + places[:number % 7]:
            monitor.send('obstacles', points, stamp)
            time.sleep(gap)
        monitor.spin(0.05)
    monitor.await_state('collision')
    raised = [message.data for message in heard]
    assert len(raised) > 20 and all(raised[raised.index(True):])


def reason(monitor):
    status = monitor.status()
    return values(status)['reason'] if status else ''


def start_anew(monitor):
    """Nothing was heard before."""
    monitor.await_state('unknown')


def fall_silent(monitor):
    monitor.send_until('clear', 'obstacles', APART)
    monitor.until(lambda: 'silent' in reason(monitor))


def restart_publisher(monitor):
    monitor.send_until('clear', 'obstacles', APART)
    monitor.node.destroy_publisher(monitor._publishers.pop('obstacles'))
    monitor.until(lambda: 'no publisher any more' in reason(monitor))


def enable_again(monitor):
    monitor.send_until('clear', 'obstacles', APART)
    for enabled in (False, True):
        assert monitor.set_parameters(obstacle__enabled=enabled) == [None]
    monitor.await_state('unknown')


def send_too_many(monitor):
    stamp = monitor.now()
    for x in range(5):
        monitor.send('obstacles', box(5 + x, 5), stamp)
    monitor.until(lambda: 'too many' in reason(monitor))


@pytest.mark.parametrize('interrupt, timeout', [
    (start_anew, 0.0), (fall_silent, 2.0), (restart_publisher, 0.0), (enable_again, 0.0),
    (send_too_many, 0.0)])
def test_first_set_counts_when_it_is_whole(start, interrupt, timeout):
    """The last of a set that takes 0.3 s to arrive is on the robot."""
    monitor = start(obstacle__set_quiet=0.5, obstacle__timeout=timeout, obstacle__max_count=4,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    interrupt(monitor)
    states = monitor.listen('~/state')
    del states[:]
    stamp = monitor.now() + SECOND // 10
    for points in (APART, box(7, 7), box(9, 9), TOUCHING):
        monitor.send('obstacles', points, stamp)
        monitor.spin(0.1)
    monitor.until(lambda: states and monitor.state() == 'collision')
    assert 'clear' not in {values(array.status[0])['state'] for array in states}


def test_set_that_was_under_way_when_the_node_began_does_not_count(start, domain):
    """Who knows what came before: the next set tells."""
    peer = Peer(domain)
    publisher = peer.node.create_publisher(PolygonStamped, '/obstacles', 10)
    stamp = peer.now()
    publisher.publish(polygon_message(TOUCHING, stamp))
    monitor = start(obstacle__set_quiet=20.0, **NO_TIMEOUT)
    peer.until(publisher.get_subscription_count)
    publisher.publish(polygon_message(APART, stamp))
    publisher.publish(polygon_message([], stamp))
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.received['obstacle'] == 2)
    monitor.until(lambda: monitor.status() and values(monitor.status())['age'])
    monitor.await_state('unknown')
    assert reason(monitor).endswith('has not sent a whole set yet')
    for points in (APART, []):
        publisher.publish(polygon_message(points, stamp + SECOND // 10))
    monitor.await_state('clear')
    peer.close()


def test_thousands_of_obstacles_a_set_are_all_taken(start, runner):
    """Within max_count, in one burst; fewer for the fall-back, which takes a wait for each."""
    count = {'loop': 3000, 'executor': 500}[runner]
    monitor = start(obstacle__set_quiet=1.0, **NO_TIMEOUT)
    monitor.publisher('obstacles', qos=10_000)
    monitor.send('footprint', ROBOT)
    heard = monitor.listen('~/collision')
    for _ in range(3):
        stamp = monitor.now()
        data = [polygon_message(box(5 + k % 50, 5 + k // 50), stamp) for k in range(count - 1)]
        for message in (*data, polygon_message(TOUCHING, stamp)):
            monitor.publisher('obstacles').publish(message)
        monitor.spin(0.3)
    monitor.until(lambda: monitor.received['obstacle'] == 3 * count, 'all messages')
    monitor.await_state('collision')
    raised = [message.data for message in heard]
    assert all(raised[raised.index(True):])
    assert not monitor.monitor._monitor.lost


def test_window_that_cuts_a_set_is_told_with_the_remedy(start):
    """Ten obstacles, each stamped when it was built, 5 ms apart; the eighth is on the robot."""
    monitor = start(**NO_TIMEOUT)
    states = monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    for _ in range(5):
        stamp = monitor.now()
        for k in range(10):
            monitor.send('obstacles', TOUCHING if k == 7 else box(5 + k, 5),
                         stamp + k * SECOND // 200)
            monitor.spin()
        monitor.spin(0.05)
    monitor.until(lambda: 'set_window cuts' in reason(monitor))
    assert 'or set accumulate' in reason(monitor)
    assert 'clear' not in {values(array.status[0])['state'] for array in states}


def test_publishers_are_counted(start, domain):
    """A second one begins and ends, then the first ends, too."""
    monitor = start(**NO_TIMEOUT)
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', APART)
    monitor.await_state('clear')
    second = monitor.node.create_publisher(PolygonStamped, '/obstacles', 10)
    monitor.await_state('unknown')
    monitor.until(lambda: 'has 2 publishers' in reason(monitor))
    monitor.node.destroy_publisher(second)
    monitor.send_until('clear', 'obstacles', APART)
    monitor.node.destroy_publisher(monitor._publishers.pop('obstacles'))
    monitor.await_state('unknown')
    monitor.until(lambda: 'no publisher any more' in reason(monitor))
    monitor.send('obstacles', APART)
    monitor.await_state('clear')


def test_sets_of_two_publishers_are_unknown(start):
    """Six obstacles each, one of one publisher on the robot: each would replace the other's."""
    monitor = start(**NO_TIMEOUT)
    publishers = [monitor.node.create_publisher(PolygonStamped, '/obstacles', 100)
                  for _ in range(2)]
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: 'has 2 publishers' in reason(monitor))
    assert 'or set accumulate' in reason(monitor)
    states = monitor.listen('~/state')
    del states[:]
    for _ in range(20):
        for publisher, first in zip(publishers, (TOUCHING, APART)):
            stamp = monitor.now()
            for points in (first, *(box(7 + x, 7) for x in range(5))):
                publisher.publish(polygon_message(points, stamp))
            monitor.spin(0.03)
    assert 'clear' not in {values(array.status[0])['state'] for array in states}
    assert monitor.contacts() == ['obstacle/0']


class LossyMonitor(FootprintMonitor):
    """Every tenth message on obstacles is lost on the way to it."""

    def receive(self, name, messages, now):
        super().receive(name, (
            message for message in messages if name == 'footprint' or message[1] % 10), now)


def test_tenth_of_all_messages_is_lost(start, monkeypatch):
    """Another member of the set each time, that on the robot among them: never clear."""
    monkeypatch.setattr('harness.FootprintMonitor', LossyMonitor)
    monitor = start(obstacle__set_quiet=1.0, **NO_TIMEOUT)
    states = monitor.listen('~/state')
    monitor.send('footprint', ROBOT)
    for _ in range(40):
        stamp = monitor.now()
        for points in (APART, box(7, 7), TOUCHING):
            monitor.send('obstacles', points, stamp)
            monitor.spin()
    # More, if the middleware loses some, too.
    monitor.until(lambda: int(health(monitor).get('obstacle: lost', 0)) >= 11)
    assert {values(array.status[0])['state'] for array in states} == {'collision', 'unknown'}
    assert any('lost messages on the way' in values(array.status[0])['reason']
               for array in states)


class NumberlessMonitor(FootprintMonitor):
    """Its middleware does not say which message of its publisher one is."""

    def receive(self, name, messages, now):
        super().receive(name, ((data, None) for data, _ in messages), now)


def test_middleware_without_numbers_is_told_of_once(start, monkeypatch):
    """All else works as ever."""
    monkeypatch.setattr('harness.FootprintMonitor', NumberlessMonitor)
    monitor = start(**NO_TIMEOUT)
    monitor.send('footprint', ROBOT)
    monitor.send_until('clear', 'obstacles', APART)
    monitor.send_until('collision', 'obstacles', TOUCHING)
    assert len(monitor.logged('does not number messages')) == 1
    assert not monitor.monitor._monitor.lost


@pytest.fixture
def publisher_process(domain):
    """Start a process that publishes an obstacle ten times a second, with a lease of 0.5 s."""
    started = []

    def start():
        started.append(subprocess.Popen([sys.executable, '-c', PUBLISHER, str(domain)]))
        return started[-1]
    yield start
    for one in started:
        one.kill()
        one.wait()


PUBLISHER = """
import sys, time
from geometry_msgs.msg import Point32, PolygonStamped
import rclpy
from rclpy.duration import Duration
from rclpy.qos import LivelinessPolicy, QoSProfile
rclpy.init(domain_id=int(sys.argv[1]))
node = rclpy.create_node('obstacles')
publisher = node.create_publisher(PolygonStamped, '/obstacles', QoSProfile(
    depth=10, liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=Duration(seconds=0.5)))
message = PolygonStamped()
message.header.frame_id = 'map'
message.polygon.points = [Point32(x=x, y=5.0) for x in (5.0, 6.0)]
while True:
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    time.sleep(0.1)
"""


def test_killed_publisher_is_unknown_when_its_lease_is_over(start, publisher_process):
    """Nothing of it ever times out; another one takes its place while DDS still counts both."""
    monitor = start(**NO_TIMEOUT, **{
        'qos_overrides./obstacles.subscription.liveliness': 'automatic',
        'qos_overrides./obstacles.subscription.liveliness_lease_duration': SECOND // 2})
    monitor.send('footprint', ROBOT)
    first = publisher_process()
    monitor.await_state('clear', patience=60.0)
    first.kill()
    monitor.await_state('unknown')
    monitor.until(lambda: 'no publisher any more' in reason(monitor))
    monitor.until(lambda: health(monitor).get('/obstacles: liveliness lost') == '1')
    publisher_process()
    monitor.await_state('clear', patience=60.0)

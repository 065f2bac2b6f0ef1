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

"""Obstacle sources of a running node: ids, silence, limits and quality of service."""

from geometry_msgs.msg import PolygonStamped
from harness import box, Peer, polygon_message, SECOND, values
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
NO_TIMEOUT = {'footprint__timeout': 0.0, 'obstacle__timeout': 0.0}


@pytest.mark.parametrize('age', [1, -3600])
def test_footprint_from_the_past_or_the_future_is_refused(start, age):
    """It was overtaken by the one before, or the clock that stamped it is an hour ahead."""
    monitor = start(obstacle__timeout=0.0, footprint__timeout=60.0)
    stamp = monitor.now()
    monitor.send('footprint', ROBOT, stamp)
    monitor.send('obstacles', TOUCHING)
    monitor.await_state('collision')
    states = monitor.listen('~/state')
    monitor.send('footprint', APART, stamp - age * SECOND)
    monitor.until(lambda: monitor.monitor._monitor.rejected.total())
    monitor.spin(0.3)
    assert 'clear' not in {values(array.status[0])['state'] for array in states}
    assert monitor.state() == ('collision' if age > 0 else 'unknown')


def test_missed_deadline_is_told(start):
    """The publisher promises a message every 50 ms and sends one."""
    monitor = start(**{'qos_overrides./obstacles.subscription.deadline': 50_000_000},
                    **NO_TIMEOUT)
    monitor.publisher('/obstacles', qos=QoSProfile(
        depth=5, deadline=Duration(nanoseconds=50_000_000)))
    monitor.send('/footprint', ROBOT)
    monitor.send('/obstacles', APART)
    key = '/obstacles: deadlines missed'
    monitor.until(lambda: monitor.health() and key in values(monitor.health()), 'a count')


def test_instances_are_known_by_their_id(start):
    """Id 7 comes into contact and goes; id -3 stays where it is."""
    monitor = start(obstacle__type='polygon_instance', **NO_TIMEOUT)
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', APART, instance=-3)
    monitor.await_state('clear')
    monitor.send('obstacles', TOUCHING, instance=7)
    monitor.await_state('collision')
    assert monitor.contacts() == ['obstacle/7']
    monitor.send('obstacles', TOUCHING, instance=-3)
    monitor.until(lambda: monitor.contacts() == ['obstacle/-3', 'obstacle/7'])
    monitor.send('obstacles', APART, instance=7)
    monitor.until(lambda: monitor.contacts() == ['obstacle/-3'])


def test_accumulating_source_keeps_every_polygon_until_its_timeout(start):
    """A second obstacle, sent on its own, does not replace the first; the timeout ends both."""
    monitor = start(obstacle__accumulate=True, obstacle__timeout=1.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_until('collision', 'obstacles', TOUCHING)
    begun = monitor.now()
    monitor.send_until('clear', 'obstacles', APART)
    assert monitor.now() - begun > SECOND // 2


def test_several_sources(start):
    """A map with stamp 0 and moving obstacles: contacts say which source they are of."""
    monitor = start(obstacles=['map', 'people'], map__timeout=0.0, people__timeout=0.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send('map', APART, 0)
    monitor.await_state('unknown')
    monitor.until(lambda: 'people' in values(monitor.status())['reason'])
    monitor.send('people', APART)
    monitor.await_state('clear')
    monitor.send('map', TOUCHING, 0)
    monitor.send('people', [(0.2, 0.2), (9.0, 0.3)])
    monitor.until(lambda: len(monitor.contacts()) == 2, 'contact with both')
    assert [name.split('/')[0] for name in monitor.contacts()] == ['map', 'people']


def test_source_that_falls_silent_makes_footprints_unknown(start):
    """First clear, then the obstacles' publisher dies, then it lives again."""
    monitor = start(obstacle__timeout=0.5, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_until('clear', 'obstacles', APART)
    status = monitor.await_state('unknown')
    assert 'silent' in values(status)['reason'] and '/obstacles' in values(status)['reason']
    monitor.until(monitor.flag)
    monitor.send_until('clear', 'obstacles', APART)


def test_footprint_that_falls_silent_is_unknown(start):
    """The robot's localisation dies, while it was clear."""
    monitor = start(obstacle__timeout=0.0, footprint__timeout=0.5)
    monitor.send('obstacles', APART)
    monitor.send_until('clear', 'footprint', ROBOT)
    monitor.await_state('unknown')
    monitor.send_until('clear', 'footprint', ROBOT)


def test_footprint_with_an_old_stamp_is_unknown(start):
    """It counts when it was taken, not when it came."""
    monitor = start(obstacle__timeout=0.0, footprint__timeout=0.5)
    monitor.send('obstacles', APART)
    monitor.send('footprint', ROBOT, monitor.now() - 5 * SECOND)
    monitor.until(lambda: monitor.state() and values(monitor.status())['age'])
    assert monitor.state() == 'unknown'


def test_empty_polygon_is_a_heartbeat(start):
    """A publisher that sees nothing keeps its source alive and its footprints clear."""
    monitor = start(obstacle__timeout=0.5, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_until('clear', 'obstacles', [])
    begun = monitor.now()
    while monitor.now() < begun + SECOND:
        monitor.send('obstacles', [])
        monitor.spin(0.05)
    heard = monitor.listen('~/state')
    messages = {array.status[0].message for array in heard[-5:]}
    assert messages == {'clear'}


def test_obstacle_that_is_not_refreshed_is_forgotten(start):
    """The source lives on another obstacle, while the one in contact ages."""
    monitor = start(obstacle__type='polygon_instance', obstacle__timeout=0.5,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_until('collision', 'obstacles', TOUCHING, instance=1)
    monitor.send_until('clear', 'obstacles', APART, instance=2)


def test_more_obstacles_than_max_count_are_unknown_not_truncated(start):
    """Three obstacles where two are allowed, the third in contact or not: nobody knows."""
    monitor = start(obstacle__max_count=2, **NO_TIMEOUT)
    stamp = monitor.now()
    monitor.send('footprint', ROBOT)
    for x in (5, 7):
        monitor.send('obstacles', box(x, 5), stamp)
    monitor.await_state('clear')
    monitor.send('obstacles', box(9, 5), stamp)
    status = monitor.await_state('unknown')
    assert 'too many' in values(status)['reason']


def test_disabled_source_and_footprint(start):
    """A source switched off in flight no longer collides; alone, nothing is known any more."""
    monitor = start(obstacles=['map', 'people'], map__timeout=0.0, people__timeout=0.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send('map', TOUCHING)
    monitor.send('people', APART)
    monitor.await_state('collision')
    assert monitor.set_parameters(map__enabled=False) == [None]
    monitor.await_state('clear')
    assert monitor.set_parameters(people__enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until(monitor.flag)


def test_latched_map_sent_before_the_node_started(start, domain):
    """With the durability overridden, a late joiner gets the map that was published once."""
    mapper = Peer(domain)
    map_publisher = mapper.node.create_publisher(PolygonStamped, '/map', QoSProfile(
        depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    map_publisher.publish(polygon_message(TOUCHING, 0))
    map_publisher.publish(polygon_message(APART, 0))
    monitor = start(obstacles=['map'], map__timeout=0.0, footprint__timeout=0.0, **{
        'qos_overrides./map.subscription.durability': 'transient_local'})
    monitor.send('footprint', ROBOT)
    monitor.await_state('collision')
    mapper.close()


@pytest.mark.parametrize('overrides, profile, policy', [
    ({}, QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT), 'reliability'),
    ({'qos_overrides./obstacles.subscription.durability': 'transient_local'}, QoSProfile(depth=5),
     'durability'),
])
def test_incompatible_publisher_is_reported(start, overrides, profile, policy):
    """Nothing of it arrives; log and diagnostics name the topic, the policy and what to do."""
    monitor = start(**overrides)
    monitor.node.create_publisher(PolygonStamped, '/obstacles', profile)
    remedy = f'qos_overrides./obstacles.subscription.{policy}'
    monitor.logged(remedy)
    health = monitor.until(lambda: monitor.health() and 'incompatible' in monitor.health().message
                           and monitor.health(), 'a report in /diagnostics')
    assert values(health)['/obstacles: incompatible QoS'] == policy.upper()


def test_best_effort_publisher_is_heard_with_an_override(start):
    """What Nav2's sensors send, once the parameter says so."""
    monitor = start(**{'qos_overrides./obstacles.subscription.reliability': 'best_effort'},
                    **NO_TIMEOUT)
    monitor.publisher('/obstacles', qos=QoSProfile(
        depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
    monitor.send('/footprint', ROBOT)
    monitor.send_until('collision', '/obstacles', TOUCHING)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Obstacle sources of a running node: sets, ids, maps and silence."""

from geometry_msgs.msg import PolygonStamped
from harness import APART, box, LASTING, polygon_message, ROBOT, SECOND, to_ns, TOUCHING, values
import pytest


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


@pytest.mark.parametrize('names', [['few', 'many'], ['many', 'few']])
def test_queues_of_one_topic_have_room_for_the_longest_sets(start, names):
    """Whichever source comes first; a footprint may be an obstacle of others, too."""
    monitor = start(obstacles=names, few__topic='/obstacles', few__max_count=5,
                    many__topic='/obstacles', many__max_count=1000, footprint__topic='/obstacles')
    depths = [one.qos_profile.depth for one in monitor.monitor.subscriptions
              if one.topic_name == '/obstacles']
    assert depths == [2000] * 3


@pytest.mark.parametrize('override, depth', [(None, 800), (200, 200)])
def test_queue_has_room_for_longer_sets_once_max_count_is_raised(start, override, depth):
    """It was too short for sets sent at once; a depth that is overridden stays."""
    parameters = {} if override is None else {
        'qos_overrides./obstacles.subscription.depth': override}
    monitor = start(obstacle__max_count=50, **LASTING, **parameters)
    monitor.publisher('obstacles', qos=1000)
    assert monitor.set_parameters(obstacle__max_count=400) == [None]

    def queue():
        return next(one.qos_profile.depth for one in monitor.monitor.subscriptions
                    if one.topic_name == '/obstacles')
    monitor.send('footprint', ROBOT)
    if override is None:
        monitor.until(lambda: queue() == depth, 'a deeper queue')
    monitor.send_set_until('clear', 'obstacles', *[APART] * (depth // 2 - 1))
    assert queue() == depth


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


def test_instances_are_identified_by_id(start):
    """Known after one timeout without a gap; then id 7 comes into contact and goes."""
    monitor = start(obstacle__type='polygon_instance', obstacle__timeout=1.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    begun = monitor.now()

    def until(state, third, seventh):
        def sent():
            monitor.send('obstacles', third, instance=3)
            monitor.send('obstacles', seventh, instance=7)
            monitor.spin(0.05)
            return monitor.state() == state
        monitor.until(sent, state)
    until('clear', APART, APART)
    assert monitor.now() - begun > SECOND
    until('collision', APART, TOUCHING)
    assert monitor.contacts() == ['obstacle/7']
    until('clear', APART, APART)


def test_polygons_of_which_nothing_is_declared_count_for_one_timeout(start):
    """Empty ones or not; what that costs and how to avoid it is logged once, and in the state."""
    monitor = start(obstacle__set_end='none', obstacle__timeout=1.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('collision', 'obstacles', TOUCHING, APART)
    sent = monitor._last_stamps['obstacles']
    monitor.send_set_until('clear', 'obstacles', APART, APART)
    assert to_ns(monitor.listen('~/state')[-1].header.stamp) - sent > SECOND
    words = ('released only 1 s after they were last sent', 'set_end: empty_polygon',
             '2 polygons come with each stamp', 'set_end: new_stamp')
    known = values(monitor.status())['source obstacle']
    assert all(word in known for word in words), known
    begun = monitor.now()

    def sent():
        monitor.send_set('obstacles', APART, APART)
        monitor.spin(0.03)
        return monitor.now() > begun + 3 * SECOND
    monitor.until(sent)
    assert len(monitor.logged('released only 1 s after they were last sent')) == 1


def test_contacts_name_their_source(start):
    """A map with stamp 0 and a source of sets."""
    monitor = start(obstacles=['map', 'people'], map__timeout=0.0, people__timeout=60.0,
                    footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set('map', APART, stamp=0)
    monitor.until(lambda: 'people' in monitor.reason() and '/map' not in monitor.reason())
    monitor.send_set('people', APART)
    monitor.await_state('clear')
    monitor.send_set('map', TOUCHING, stamp=0)
    monitor.send_set('people', [(0.2, 0.2), (9.0, 0.3)])
    monitor.until(lambda: len(monitor.contacts()) == 2, 'contact with both')
    assert [name.split('/')[0] for name in monitor.contacts()] == ['map', 'people']


def test_silent_source_is_unknown(start):
    monitor = start(obstacle__timeout=0.5, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    status = monitor.await_state('unknown')
    assert 'silent' in values(status)['reason'] and '/obstacles' in values(status)['reason']
    monitor.until(monitor.flag)
    monitor.send_set_until('clear', 'obstacles', APART)


def test_silent_footprint_is_unknown(start):
    monitor = start(obstacle__timeout=60.0, footprint__timeout=0.5)
    monitor.send_set('obstacles', APART)
    monitor.send_until('clear', 'footprint', ROBOT)
    monitor.await_state('unknown')
    monitor.send_until('clear', 'footprint', ROBOT)


def test_map_is_known_when_it_ends_and_replaced_as_a_whole(start):
    """Whatever the times in either; a contact counts before that."""
    monitor = start(obstacle__timeout=0.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    for x in range(5):
        monitor.send('obstacles', box(5 + x, 5))
    monitor.until(lambda: 'has not ended a map yet' in monitor.reason())
    monitor.send('obstacles', [])
    monitor.await_state('clear')
    monitor.send('obstacles', TOUCHING, 5 * SECOND)
    monitor.await_state('collision')
    monitor.send('obstacles', [], 5 * SECOND)
    monitor.send_set('obstacles', APART, stamp=0)
    monitor.await_state('clear')
    assert len(monitor.monitor._scene.obstacles) == 1

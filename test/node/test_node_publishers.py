# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The publishers of a node's topics: exactly one per topic, otherwise a fault."""

import time
from types import SimpleNamespace

from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from harness import APART, box, health, LASTING, ROBOT, SECOND, TOUCHING
from publishers import ALIVE, Publisher, sets, World
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from sat_collision.node.loop import Input
from sat_collision.node.publishers import Publishers

BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.mark.parametrize('topic, kind, qos, words', [
    ('/obstacles', PolygonStamped, 10, 'has 2 publishers, /peer and /second'),
    ('/footprint', PolygonStamped, 10, 'has 2 publishers, /peer and /second'),
    ('/obstacles', PolygonStamped, BEST_EFFORT,
     'has a publisher, /second, which cannot be received: it is best effort, the subscription '
     'reliable'),
    ('/footprint', PolygonInstanceStamped, 10,
     'has a publisher, /second, of another type, geometry_msgs/msg/PolygonInstanceStamped'),
], ids=['obstacles', 'footprint', 'best effort', 'other type'])
def test_second_publisher_is_named_until_it_leaves(start, join, topic, kind, qos, words):
    """Whatever it would send: the first publisher alone is not the whole truth."""
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    second = join('second').node.create_publisher(kind, topic, qos)
    monitor.await_state('unknown')
    monitor.until_reason(f'{topic} {words}')
    monitor.until(monitor.flag)
    for _ in range(3):
        monitor.send_both(APART)
        monitor.spin(0.05)
    assert monitor.state() == 'unknown'
    second.destroy()
    monitor.repeat_until('clear', lambda: monitor.send_both(APART))


def test_topics_can_be_swapped_by_remapping(start):
    """They have no publisher at first."""
    monitor = start(arguments=['-r', 'footprint:=obstacles', '-r', 'obstacles:=footprint'])
    monitor.until_reason('footprint footprint on /obstacles has no publisher; obstacle source '
                         'obstacle on /footprint has no publisher')
    monitor.send('obstacles', ROBOT)
    monitor.until(lambda: 'has no publisher' in monitor.reason()
                  and '/obstacles' not in monitor.reason())
    monitor.send_set('footprint', APART)
    monitor.send('obstacles', ROBOT)
    monitor.await_state('clear')


def test_second_publisher_is_never_ignored(start, join):
    """Even if its message numbers happen to continue those of the first one."""
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    second = join('second')
    second.publisher('/obstacles')
    monitor.await_state('unknown')
    begun = len(monitor.states())
    for _ in range(20):
        second.send_set('/obstacles', TOUCHING)
        monitor.send_set('obstacles', APART)
        monitor.spin(0.03)
    assert 'clear' not in monitor.states()[begun:] and 'collision' in monitor.states()[begun:]


@pytest.mark.parametrize('overrides, qos, policy', [
    ({}, BEST_EFFORT, 'reliability: best_effort'),
    ({'qos_overrides./obstacles.subscription.durability': 'transient_local'}, QoSProfile(depth=5),
     'durability: volatile'),
])
def test_incompatible_publisher_is_reported_with_a_remedy(start, join, overrides, qos, policy):
    """State, log and diagnostics name it, the QoS policy, and the parameter to set."""
    monitor = start(**overrides)
    join('camera').node.create_publisher(PolygonStamped, '/obstacles', qos)
    remedy = f'set qos_overrides./obstacles.subscription.{policy}'
    monitor.until_reason('publisher, /camera,', remedy)
    monitor.until(lambda: monitor.health() and remedy in monitor.health().message)
    monitor.logged('/obstacles', policy.split(':')[0])


def test_best_effort_publisher_is_received_with_an_override(start):
    monitor = start(**{'qos_overrides./obstacles.subscription.reliability': 'best_effort'},
                    **LASTING)
    monitor.publisher('/obstacles', qos=BEST_EFFORT)
    monitor.send('/footprint', ROBOT)
    monitor.send_set_until('collision', '/obstacles', TOUCHING)


def test_latched_publisher_without_a_latched_subscription(start, join):
    """The map was sent before the node started; the reason names the parameter to set."""
    join('mapper').node.create_publisher(PolygonStamped, '/obstacles', LATCHED)
    start(**LASTING).until_reason(
        'its publisher keeps what it has sent, of which nothing comes here: '
        'set qos_overrides./obstacles.subscription.durability: transient_local')


@pytest.fixture
def detector(domain):
    """Start processes that publish sets thirty times a second, with a lease of 0.5 s."""
    world = World()
    world.touching.value = 0
    started = []

    def detector():
        started.append(Publisher(world, domain, sets, '/obstacles', 'detector', qos=ALIVE,
                                 count=2, period=0.03))
        return started[-1]
    yield detector
    for process in started:
        process.end()


LIVELINESS = {'qos_overrides./obstacles.subscription.liveliness': 'automatic',
              'qos_overrides./obstacles.subscription.liveliness_lease_duration': SECOND // 2}


def test_killed_publisher_is_noticed_when_its_lease_is_over(start, detector):
    """Its messages never time out; its successor is accepted while DDS still lists both."""
    monitor = start(**LASTING, **LIVELINESS)
    monitor.send('footprint', ROBOT)
    first = detector()
    monitor.await_state('clear')
    first.kill()
    monitor.await_state('unknown')
    monitor.until_reason('/obstacles has no publisher')
    monitor.until(lambda: int(health(monitor).get('/obstacles: liveliness lost', 0)) >= 1)
    detector()
    monitor.await_state('clear')


def test_killed_publisher_is_replaced_while_dds_lists_both(start, detector):
    """Its successor has the same name, as with respawn, long before the lease of 20 s ends."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    first = detector()
    # More than its successor has sent when it is found.
    monitor.until(lambda: monitor.received['obstacle'] > 40)
    killed = time.monotonic()
    first.kill()
    before = monitor.received['obstacle']
    detector()
    # More than may still have been queued from the first one.
    monitor.until(lambda: monitor.received['obstacle'] > before + 40)
    count = len(monitor.states())
    monitor.until(lambda: monitor.states()[count + 3:][-1:] == ['clear'])
    assert monitor.node.count_publishers('/obstacles') == 2 or time.monotonic() - killed > 20.0


def test_missed_deadline_is_counted(start):
    """The publisher promises a message every 50 ms but sends one."""
    monitor = start(**{'qos_overrides./obstacles.subscription.deadline': 50_000_000}, **LASTING)
    monitor.publisher('/obstacles', qos=QoSProfile(
        depth=5, deadline=Duration(nanoseconds=50_000_000)))
    monitor.send_set('/obstacles', APART)
    monitor.until(lambda: int(health(monitor).get('/obstacles: deadlines missed', 0)) > 3,
                  'a count')


def test_another_monitor_of_the_same_name_is_an_error(start):
    """Both publish the same flags, so neither can be trusted."""
    monitor = start()
    monitor.until(lambda: monitor.health() and monitor.health().level < b'\x02')
    other = start()
    monitor.until(lambda: monitor.health().level == b'\x02')
    assert 'others publish /footprint_monitor/collision' in monitor.health().message
    del other


def test_flags_of_one_topic_are_an_error(start):
    monitor = start(['-r', '~/a/collision:=/stop', '-r', '~/b/collision:=/stop'],
                    footprints=['a', 'b'])
    monitor.until(lambda: monitor.health() and monitor.health().level == b'\x02')
    assert 'others publish /stop, too' in monitor.health().message


def test_unknown_state_after_the_start_is_logged_once(start, monkeypatch):
    monkeypatch.setattr('sat_collision.node.footprint_monitor._STARTED', 3600.0)
    monitor = start(obstacle__timeout=60.0)
    monitor.send_set('obstacles', APART)
    reason = 'footprint footprint on /footprint has no publisher'
    monitor.until(lambda: monitor.reason() == reason)
    monitor.monitor._reports_unknown_at = 0.0
    for _ in range(2):
        assert monitor.logged('unknown since the start') == [f'unknown since the start: {reason}']
        monitor.further('~/state', 10)


MAP = {'obstacles': ['map'], 'map__timeout': 0.0, 'footprint__timeout': 0.0,
       'qos_overrides./map.subscription.durability': 'transient_local'}


def publish_map(peer, *polygons):
    """Publish a latched map of polygons with stamp 0, and its end."""
    peer.publisher('/map', qos=LATCHED)
    peer.send_set('/map', *polygons, stamp=0)


def test_latched_map_sent_before_the_node_started(start, join):
    """A late joiner gets what was published once."""
    mapper = join('mapper')
    mapper._publishers['/map'] = mapper.node.create_publisher(PolygonStamped, '/map', LATCHED)
    publish_map(mapper, TOUCHING, APART)
    monitor = start(**MAP)
    monitor.send('footprint', ROBOT)
    monitor.await_state('collision')


def test_latched_map_survives_another_publisher(start, join):
    """As `ros2 topic pub --once`: its obstacle is forgotten once it has gone."""
    monitor, mapper, once = start(**MAP), join('mapper'), join('once')
    publish_map(mapper, APART, box(7, 7))
    monitor.send('footprint', ROBOT)
    monitor.await_state('clear')
    publish_map(once, TOUCHING)
    monitor.await_state('collision')
    once.leave('/map')
    monitor.await_state('clear')
    assert len(monitor.monitor._scene.obstacles) == 2


def test_kept_map_of_a_publisher_that_hangs_does_not_count_for_another(start, join):
    """While it is listed, it would send its map again to a new subscription."""
    monitor = start(**MAP, **{
        name.replace('obstacles', 'map'): value for name, value in LIVELINESS.items()})
    peers = join('hangs'), join('lives')
    lease = {'durability': LATCHED.durability, 'liveliness_lease_duration': Duration(seconds=0.5)}
    peers[0].publisher('/map', qos=QoSProfile(
        depth=10, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, **lease))
    publish_map(peers[0], APART)
    monitor.send('footprint', ROBOT)
    monitor.await_state('clear')
    peers[1].publisher('/map', qos=QoSProfile(
        depth=10, liveliness=LivelinessPolicy.AUTOMATIC, **lease))
    publish_map(peers[1], APART)

    def counted():
        return [one.node for one in monitor.monitor._inputs.publishers['map'].reported]
    monitor.until(lambda: counted() == ['/hangs', '/lives'])
    begun = len(monitor.states())
    monitor.until(lambda: counted() == ['/lives'])
    monitor.spin(1.0)
    # Some states of before were still on their way.
    assert counted() == ['/lives'] and 'clear' not in monitor.states()[begun + 3:]
    peers[0].leave('/map')
    monitor.await_state('clear')


@pytest.fixture
def graph():
    """Return the list of publishers in a made-up graph, and Publishers that look at it."""
    infos = []
    node = SimpleNamespace(handle=SimpleNamespace(get_count_publishers=lambda _: len(infos)),
                           get_publishers_info_by_topic=lambda _: [*infos])
    subscription = SimpleNamespace(topic_name='/obstacles', qos_profile=QoSProfile(depth=1),
                                   msg_type=PolygonStamped)
    publishers = Publishers(node, Input('obstacle', subscription, topic='obstacles', depth=2))

    def look(is_behind=False):
        news = publishers.news(is_behind)
        return None if news is None else [endpoint.node for endpoint in news]
    return infos, look, publishers


def info(name):
    return SimpleNamespace(node_name=name, node_namespace='/', qos_profile=QoSProfile(depth=1),
                           topic_type='geometry_msgs/msg/PolygonStamped',
                           endpoint_gid=name.encode())


def test_departure_is_reported_at_the_next_look(graph):
    """By then its last messages have been received; it waits longer while any are queued."""
    infos, look, _ = graph
    infos += [info('a'), info('b')]
    assert [look(True), look(True)] == [['/a', '/b'], None]
    del infos[0]
    assert [look(), look(), look()] == [None, ['/b'], None]
    del infos[0]
    assert [look(True), look(True), look()] == [None, None, []]


def test_new_publisher_is_reported_at_once_beside_one_that_has_gone(graph):
    """Also if its first message comes before the next look."""
    infos, look, publishers = graph
    infos.append(info('a'))
    assert look() == ['/a']
    infos[:] = [info('b')]
    assert [one.node for one in publishers.at_beginning()] == ['/a', '/b']
    assert look() == ['/b']


def test_publisher_that_came_and_went_between_two_looks_is_reported(graph):
    """It may have sent something; one that the graph does not show yet has not gone."""
    infos, look, publishers = graph

    def match(count, new):
        publishers.note_matched(SimpleNamespace(current_count=count, total_count_change=new))
    match(1, 1)
    match(0, 0)
    assert [look(), look()] == [['one that has gone'], []]
    infos += [info('a'), info('other')]
    infos[1].topic_type = 'std_msgs/msg/String'
    match(1, 1)
    assert [look(), look()] == [['/other', '/a'], None]
    match(2, 1)
    match(1, 0)
    assert [look(), look()] == [['/other', '/a', 'one that has gone'], ['/other', '/a']]
    match(2, 1)
    assert look() is None
    infos.append(info('b'))
    assert [look(), look()] == [['/other', '/a', '/b'], None]
    publishers.forget_matched()
    match(2, 2)
    assert look() is None, 'a new subscription is matched with them again'


def test_what_no_event_tells_is_found_within_ten_looks(graph):
    """One publisher is in place of another; a name is asked for at each look until known."""
    infos, look, publishers = graph
    infos.append(info('_NODE_NAME_UNKNOWN_'))
    assert look() == ['']
    infos[0].node_name = 'a'
    assert look() == ['/a']
    infos[:] = [info('b')]
    assert [news for _ in range(11) if (news := look()) is not None] == [['/b']]
    infos[:] = [info('c')]
    publishers.note_matched(SimpleNamespace(current_count=1, total_count_change=1))
    assert [look(), look()] == [None, ['/c']], 'an event tells it at once'


def test_lost_liveliness_is_that_of_a_publisher_which_is_still_there(graph):
    """Fast DDS counts down to -1, and not down when one that has died leaves."""
    infos, look, publishers = graph

    def reported(count, change):
        publishers.note_liveliness(count, change)
        look()
        look()
        return [one.node for one in publishers.reported]
    infos += [info('a'), info('b')]
    assert reported(0, 0) == ['/a', '/b']
    infos.reverse()
    assert reported(1, 1) == ['/b'], 'the oldest one is dead, in whatever order they are listed'
    assert reported(-1, -2) == ['/a', '/b']
    assert reported(1, 1) == ['/b']
    infos[:] = [info('b'), info('c')]
    assert reported(1, 0) == ['/b', '/c']


@pytest.mark.parametrize('qos, words', [
    (QoSProfile(depth=1), 'the queue here holds 1 messages: set qos_overrides./obstacles'),
    (BEST_EFFORT, 'its publisher is best effort')], ids=['depth', 'best effort'])
def test_why_messages_may_be_lost_is_known(graph, qos, words):
    infos, look, publishers = graph
    infos.append(info('a'))
    infos[0].qos_profile = qos
    publishers._input.subscription.qos_profile.reliability = qos.reliability
    look()
    assert publishers.reported[0].loss.startswith(words)

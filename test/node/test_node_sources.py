# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages to a running node: sets, queues, silence, bad input, and what middlewares lack."""

import gc
import os
from pathlib import Path
import struct
import subprocess
import sys
from xml.etree import ElementTree

from ament_index_python import get_resources
from builders import serialised
from geometry_msgs.msg import PolygonStamped
from harness import APART, box, health, LASTING, polygon_message, ROBOT, SECOND, to_ns, TOUCHING
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
import rclpy
import rclpy.event_handler
from rclpy.event_handler import UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
import rclpy.publisher
from sat_collision.messages.ingest import _DECODERS
from sat_collision.messages.transform_listener import TRANSFORM_TOPICS
from sat_collision.node import loop
from sat_collision.node.subscriptions import _kind
from sat_collision.replay.model.configuration import _KINDS
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, specs

CYCLONE = 'rmw_cyclonedds_cpp'


def test_set_in_progress_when_the_node_starts_does_not_count(start, peer):
    """Its first messages were missed; the next set is whole."""
    publisher = peer.node.create_publisher(PolygonStamped, '/obstacles', 10)

    def publish(stamp, *polygons):
        for points in polygons:
            publisher.publish(polygon_message(points, stamp))
    stamp = peer.now()
    publish(stamp, TOUCHING)
    monitor = start(**LASTING)
    peer.until(publisher.get_subscription_count)
    monitor.until(lambda: monitor._matches_publisher('/obstacles'), 'news of the publisher')
    publish(stamp, APART, [])
    monitor.send('footprint', ROBOT)
    monitor.until(lambda: monitor.received['obstacle'] == 2)
    monitor.until_reason('since it was received from its middle on')
    publish(stamp + SECOND // 10, APART, [])
    monitor.await_state('clear')


@pytest.mark.parametrize('names', [['few', 'many'], ['many', 'few']])
def test_queues_of_one_topic_have_room_for_the_longest_sets(start, names):
    """Whichever source comes first; a footprint may be an obstacle of others, too."""
    monitor = start(obstacles=names, few__topic='/obstacles', few__max_count=5,
                    many__topic='/obstacles', many__max_count=1000, footprint__topic='/obstacles')
    depths = [one.qos_profile.depth for one in monitor.monitor.subscriptions
              if one.topic_name == '/obstacles']
    assert depths == [2000] * 3


@pytest.mark.parametrize('overrides, depth', [
    ({}, 800), ({'qos_overrides./obstacles.subscription.depth': 200}, 200)],
    ids=['default', 'overridden'])
def test_queue_has_room_for_longer_sets_once_max_count_is_raised(start, overrides, depth):
    """It was too short for sets sent at once; a depth that is overridden stays."""
    monitor = start(obstacle__max_count=50, **LASTING, **overrides)
    monitor.publisher('obstacles', qos=1000)
    assert monitor.set_parameters(obstacle__max_count=400) == [None]

    def queue():
        # There is none while it is made anew.
        return next((one.qos_profile.depth for one in monitor.monitor.subscriptions
                     if one.topic_name == '/obstacles'), None)
    monitor.send('footprint', ROBOT)
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
    assert not monitor.monitor._monitor.scene.lost()


def test_polygons_of_which_nothing_is_declared_count_for_one_timeout(start):
    """Empty ones or not; what that costs and how to avoid it is logged once, and in the state."""
    monitor = start(obstacle__set_end='none', obstacle__timeout=1.0, footprint__timeout=0.0)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('collision', 'obstacles', TOUCHING, APART)
    sent = monitor._last_stamps['obstacles']
    monitor.send_set_until('clear', 'obstacles', APART, APART)
    assert to_ns(monitor.listen('~/state')[-1].header.stamp) - sent > SECOND
    cost = 'released only 1 s after they were last sent'
    known = monitor.value('source obstacle')
    for words in (cost, 'set_end: empty_polygon', '2 polygons come with each stamp',
                  'set_end: new_stamp'):
        assert words in known
    end = monitor.now() + 3 * SECOND
    monitor.repeat(lambda: monitor.send_set('obstacles', APART, APART),
                   lambda: monitor.now() > end)
    assert len(monitor.logged(cost)) == 1


def polygon_2d(points):
    """Build a Polygon2D."""
    msg = pytest.importorskip('polygon_msgs.msg', reason='make .venv/messages.stamp builds it')
    return msg.Polygon2D(points=[msg.Point2D(x=float(x), y=float(y)) for x, y in points])


def send_2d(monitor, topic, polygons, stamp=None):
    """Publish a Polygon2DStamped of one polygon, or a Polygon2DCollection of a list of them."""
    from polygon_msgs.msg import Polygon2DCollection, Polygon2DStamped
    if isinstance(polygons, list):
        message = Polygon2DCollection(polygons=polygons)
    else:
        message = Polygon2DStamped(polygon=polygons)
    message.header.frame_id = 'map'
    stamp = monitor.now() if stamp is None else stamp
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, SECOND)
    monitor.publisher(topic, type(message)).publish(message)


def test_each_collection_is_a_whole_set(start):
    """No mark, no number and no wait is needed: one message tells, and the next releases."""
    robot, apart, touching = map(polygon_2d, (ROBOT, APART, TOUCHING))
    monitor = start(obstacle__type='polygon_collection', footprint__type='polygon_2d')
    for polygons, state in (([apart], 'clear'), ([apart, touching], 'collision'),
                            ([], 'clear'), ([touching], 'collision'), ([apart], 'clear')):
        send_2d(monitor, 'footprint', robot)
        send_2d(monitor, 'obstacles', polygons)
        monitor.await_state(state)
        if state == 'collision':
            assert monitor.contacts() == [f'obstacle/{polygons.index(touching)}']
    assert 'by each message' in monitor.value('source obstacle')


@pytest.mark.parametrize('kind, name', [('obstacle', 'polygon_collection'),
                                        ('footprint', 'polygon_2d')])
def test_types_of_polygon_msgs_say_what_to_install(start, monkeypatch, kind, name):
    monkeypatch.setitem(sys.modules, 'polygon_msgs', None)
    with pytest.raises(ParameterError, match='apt install ros-jazzy-polygon-msgs'):
        start(**{f'{kind}__type': name})
    # Else the next node of this process would have the name of one that is registered still.
    gc.collect()


@pytest.mark.parametrize('settings', [
    kind(name='one', topic='/one', enabled=True, type=name)
    for kind in (FootprintSettings, ObstacleSettings) for name in specs(kind)['type'][1].choices],
    ids=lambda settings: settings.type)
def test_node_and_recordings_have_the_same_message_for_each_type(settings):
    pytest.importorskip('polygon_msgs', reason='make .venv/messages.stamp builds it')
    kind = _kind(settings)
    package = kind.__module__.partition('.')[0]
    assert _KINDS[f'{package}/msg/{kind.__name__}'] == settings.type
    assert settings.type in _DECODERS


@pytest.fixture
def middleware(monkeypatch):
    """Return what is added to the information that comes with each message."""
    added = {}
    before = loop._Topic.__init__

    def init(topic, *arguments):
        before(topic, *arguments)
        take = topic._take

        def take_with_more():
            taken = take()
            return taken and (taken[0], {**taken[1], **added})
        topic._take = take_with_more
    monkeypatch.setattr(loop._Topic, '__init__', init)
    return added


@pytest.fixture
def without_numbers(middleware):
    """Make the middleware give no sequence numbers, unless it is Cyclone DDS, which gives none."""
    if rclpy.get_rmw_implementation_identifier() != CYCLONE:
        middleware[loop._NUMBER] = None


def test_publishers_are_told_apart_by_their_gid(start, middleware):
    """Where the middleware names the publisher, numbers that continue do not hide another one."""
    middleware['publisher_gid'] = 'a'
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    monitor.send('footprint', ROBOT)
    received = monitor.received['obstacle']
    monitor.send('obstacles', APART)
    monitor.until(lambda: monitor.received['obstacle'] > received, 'the message')
    middleware['publisher_gid'] = 'b'
    monitor.send('obstacles', [])
    monitor.send('footprint', ROBOT)
    monitor.until_reason('received from its middle on', timeout=5.0)
    monitor.become('clear', APART)


def test_without_numbers_sets_of_several_messages_are_unknown(start, without_numbers):
    """The lost message may be that of the touching obstacle; contacts are told all the same."""
    monitor = start()
    for _ in range(5):
        monitor.send_both(APART)
    monitor.until_reason(f'{rclpy.get_rmw_implementation_identifier()} does not give',
                         'assume_no_loss: true')
    assert monitor.state() == 'unknown'
    monitor.send_set_until('collision', 'obstacles', TOUCHING)


@pytest.mark.parametrize('parameters', [
    {'obstacle__assume_no_loss': True}, {'obstacle__set_end': 'each_message'}], ids=str)
def test_without_numbers_what_is_promised_or_whole_is_known(start, without_numbers, parameters):
    monitor = start(**parameters)
    monitor.send('footprint', ROBOT)
    send = monitor.send_until if 'obstacle__set_end' in parameters else monitor.send_set_until
    for state, points in (('clear', APART), ('collision', TOUCHING), ('clear', APART)):
        send(state, 'obstacles', points)


def test_events_that_the_middleware_lacks_are_told_once(start, monkeypatch, capfd):
    """As over releases of Zenoh: the node runs without them."""
    before = rclpy.event_handler.EventHandler
    lacking = ('DEADLINE', 'LIVELINESS', 'MATCHED')

    def handler(*, event_type, **options):
        if any(word in str(event_type) for word in lacking):
            raise UnsupportedEventTypeError('not supported')
        return before(event_type=event_type, **options)
    monkeypatch.setattr(rclpy.event_handler, 'EventHandler', handler)
    monitor = start()
    told = 'has no events of these kinds: deadline, liveliness, matched'
    assert capfd.readouterr().err.count(told) == 1
    monitor.become('clear', APART)
    monitor.until(lambda: health(monitor).get('events that the middleware lacks')
                  == 'deadline, liveliness, matched', 'the diagnostics')
    monitor.become('collision', TOUCHING)


@pytest.mark.long
def test_over_cyclone_dds():
    """Without a stand-in: whole sets are known, others only if no loss is promised."""
    try:
        installed = get_resources('rmw_typesupport')
    except OSError:  # without an index of packages
        installed = {}
    if CYCLONE not in installed:
        pytest.skip('apt install ros-jazzy-rmw-cyclonedds-cpp')
    result = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', __file__, '-k', 'collection or without_numbers'],
        env={**os.environ, 'RMW_IMPLEMENTATION': CYCLONE}, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]


def test_rejections_are_logged_once_a_second_at_most(start):
    """A hundred invalid messages in about a second: a few lines, but all are counted."""
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    begun = monitor.now()
    for _ in range(100):
        monitor.send_set('obstacles', BOW_TIE)
        monitor.spin(0.005)
    key = 'obstacle: rejected, self-intersecting'
    monitor.until(lambda: health(monitor).get(key) == '100', '100 counted')
    monitor.logged('self-intersecting', '/obstacles')
    monitor.spin(0.1)
    lines = monitor.logged('self-intersecting', '/obstacles')
    assert len(lines) <= 2 + (monitor.now() - begun) // SECOND


LOCKED = {'enabled': False, 'unknown_is_collision': False, 'margin': 0.5, 'release_delay': 5.0,
          'footprint__timeout': 0.0, 'footprint__enabled': False, 'obstacle__timeout': 0.0,
          'obstacle__enabled': False, 'obstacle__max_count': 1, 'watchdog': 0.0,
          'use_sim_time': True, 'lock_parameters': False}


def test_locked_parameters_cannot_be_changed(start):
    """Nor the lock itself, but the rate of messages can."""
    running = start(lock_parameters=True, watchdog=0.5)
    for name, reason in zip(LOCKED, running.set_parameters(**LOCKED)):
        assert 'lock_parameters' in reason
        value = running.monitor.get_parameter(name.replace('__', '.')).value
        assert value != LOCKED[name], name
    assert not running.monitor.get_clock().ros_time_is_active
    assert running.set_parameters(publish_rate=20.0) == [None]


@pytest.mark.parametrize('service, name', [
    (SetParameters, 'set_parameters'),
    (SetParametersAtomically, 'set_parameters_atomically')])
def test_parameter_of_no_type_is_refused(start, service, name):
    """Such a request ended the node, and then had no answer, because rclpy cannot read it."""
    monitor = start()
    client = monitor.node.create_client(service, f'/{monitor.name}/{name}')
    monitor.until(client.service_is_ready)
    answer = client.call_async(service.Request(parameters=[
        Parameter(name='margin', value=ParameterValue(type=kind, double_value=2.0))
        for kind in (200, ParameterType.PARAMETER_DOUBLE)]))
    monitor.until(answer.done)
    assert answer.result() == service.Response()
    assert monitor.logged(f'a request of {monitor.name}/{name} was refused', '200')
    assert monitor.set_parameters(margin=2.0) == [None]


def test_parameter_changes_are_reported(start):
    """In the log with old and new value, and in /diagnostics; outlines as lists."""
    running = start(footprint__points=[0.0, 0.0, 1.0, 0.0, 0.0, 1.0], frame_id='odom',
                    footprint__frame_id='base', footprint__odometry='odometry')
    assert running.set_parameters(
        margin=0.25, use_sim_time=True,
        footprint__points=[0.0, 0.0, 2.0, 0.0, 0.0, 2.0]) == 3 * [None]
    for name, change in (
            ('margin', 'from 0.0 to 0.25'), ('use_sim_time', 'from False to True'),
            ('footprint.points',
             'from [0.0, 0.0, 1.0, 0.0, 0.0, 1.0] to [0.0, 0.0, 2.0, 0.0, 0.0, 2.0]')):
        running.logged(f'parameter {name} was changed {change}')
        running.until(lambda: health(running).get(f'{name}: changed') == change, name)


def test_frame_id_cannot_forge_a_log_line(start, without_tf2_msgs):
    """Control characters are escaped, and a long name is cut."""
    running = start(frame_id='map')
    forged = 'odom\n[INFO] all is well \x1b[2J' + 100 * 'x'
    running.send('footprint', box(0, 0), frame_id=forged)
    line = running.logged('odom', 'other frame')[0]
    assert line.isprintable() and len(line) < 400, line
    assert 'x' * 70 not in line


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize('where', ['frame_id', 'points'])
def test_absurd_length_never_reaches_the_middleware(start, capfd, where, order):
    """Fast CDR would print a line for each message."""
    running = start()
    data = bytearray(serialised(box(0, 0), order=order))
    struct.pack_into(order + 'I', data, 12 if where == 'frame_id' else 20, 0xFFFFFFFF)
    publisher = running.publisher('footprint', PolygonStamped)
    capfd.readouterr()
    for _ in range(20):
        publisher.publish(bytes(data))
        running.spin(0.01)
    running.until(lambda: int(health(running).get('footprint: rejected, undecodable', 0)) >= 1)
    written = capfd.readouterr().err
    assert 'cdr' not in written.lower() and written.count('\n') < 10, written
    running.await_state('unknown')


POLICY = Path(__file__).resolve().parents[2] / 'config' / 'sros2_policy.xml'


@pytest.mark.parametrize('fixed_frame', [{}, {'frame_id': 'map'}], ids=['no frame', 'a frame'])
def test_sros2_policy_allows_exactly_what_the_node_uses(start, monkeypatch, fixed_frame):
    """All topics and services of the node, and transforms if there is a fixed frame."""
    monkeypatch.setattr('sat_collision.node.footprint_monitor.transform_type',
                        lambda node, settings: PolygonStamped if settings.frame_id else None)
    running = start(**fixed_frame)
    profile, = ElementTree.parse(POLICY).iter('profile')

    def allowed(kind, how):
        return {one.text for group in profile.iter(kind) if group.get(how) == 'ALLOW'
                for one in group}
    expected = (allowed('topics', 'publish'),
                allowed('topics', 'subscribe') | set(TRANSFORM_TOPICS if fixed_frame else ()),
                allowed('services', 'reply'), set())

    def shown():
        return tuple({topic for topic, _ in getattr(
            running.node, f'get_{kind}_names_and_types_by_node')('footprint_monitor', '/')}
            for kind in ('publisher', 'subscriber', 'service', 'client'))
    running.until(lambda: 'footprint_monitor' in running.node.get_node_names())
    running.until(lambda: all(map(set.issuperset, shown(), expected)), f'{expected} in the graph')
    assert shown() == expected


@pytest.mark.parametrize('topic', ['collision', 'footprint/collision', 'state', 'markers'])
def test_message_that_is_not_published_is_counted(start, monkeypatch, topic):
    """The middleware refuses one: whatever it is, the next flags come."""
    monitor = start(**LASTING)
    flags = monitor.listen('~/collision')
    for one in ('~/state', '~/markers'):
        monitor.listen(one)
    monitor.until(lambda: len(flags) > 2, 'flags')
    publish = rclpy.publisher.Publisher.publish
    refused = []

    def refuse_once(publisher, message):
        if publisher.topic_name == f'/footprint_monitor/{topic}' and not refused:
            refused.append(message)
            raise _rclpy.RCLError('cannot publish data')
        publish(publisher, message)
    monkeypatch.setattr(rclpy.publisher.Publisher, 'publish', refuse_once)
    monitor.until(lambda: health(monitor).get(f'/footprint_monitor/{topic}: not published') == '1')
    monitor.logged(f'/footprint_monitor/{topic}: cannot publish data')
    count = len(flags)
    monitor.until(lambda: len(flags) > count + 2, 'flags')

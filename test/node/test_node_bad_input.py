# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Invalid messages and parameter changes over DDS never make a footprint clear."""

from pathlib import Path
import struct
from xml.etree import ElementTree

from builders import serialised
from geometry_msgs.msg import PolygonStamped
from harness import APART, box, health, LASTING, ROBOT, SECOND
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
import rclpy.publisher
from sat_collision.messages.transform_listener import TRANSFORM_TOPICS

BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]


def test_invalid_polygon_is_unknown_until_a_valid_one(start):
    """First as an obstacle, then as a footprint; it is logged and counted."""
    monitor = start(**LASTING)
    monitor.become('clear', APART)
    reason = 'self-intersecting'
    for topic, send, good in (('obstacles', monitor.send_set, APART),
                              ('footprint', monitor.send, ROBOT)):
        send(topic, BOW_TIE)
        monitor.await_state('unknown')
        assert reason in monitor.reason()
        monitor.until(monitor.flag)
        send(topic, good)
        monitor.await_state('clear')
    monitor.until(lambda: [health(monitor).get(f'{name}: rejected, {reason}')
                           for name in ('footprint', 'obstacle')] == ['1', '1'], 'counts')
    for topic in ('/obstacles', '/footprint'):
        assert len(monitor.logged(reason, topic)) == 1


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

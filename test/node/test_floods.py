# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages that come in batches, while others are predicted, or too fast; and leaks."""

from contextlib import closing, contextmanager, ExitStack
import importlib
import itertools
import math
import os
import signal
import time

from builders import serialised
from geometry_msgs.msg import PolygonStamped
from harness import (
    APART, box, health, LASTING, MonitorPeer, polygon_message, ROBOT, RunningMonitor, SECOND,
    streaming, TOUCHING)
import pytest
import rclpy
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.node import footprint_monitor

EACH_MESSAGE = {'obstacle__set_end': 'each_message'}
DEPTH = 'qos_overrides./obstacles.subscription.depth'


class PausedMonitor(MonitorPeer):
    """A monitor that can be paused, so that messages queue up."""

    paused = False

    def spin(self, seconds=0.0):
        """Run the monitor for a turn or two unless it is paused, and receive its messages."""
        if not self.paused:
            calls = itertools.count()
            self.monitor.loop.run(lambda: next(calls) > 1)
        super().spin(seconds)

    @contextmanager
    def paused_while_sending(self):
        """Pause; at the end all messages sent meanwhile have arrived and none is received."""
        self.paused = True
        yield
        for publisher in self._publishers.values():
            assert publisher.wait_for_all_acked(Duration(seconds=60))
        self.paused = False


@pytest.fixture
def pausable(domain):
    """Start a monitor that can be paused."""
    with ExitStack() as stack:
        yield lambda **parameters: stack.enter_context(closing(
            PausedMonitor(domain, (), {**LASTING, **parameters})))


def test_set_in_one_batch_is_evaluated_as_a_whole(pausable):
    """The flag does not fall while a contact moves to another place in the set."""
    monitor = pausable()
    monitor.become('collision', TOUCHING)
    received = monitor.listen('~/collision')
    monitor.until(lambda: received and received[-1].data)
    del received[:]
    with monitor.paused_while_sending():
        monitor.send_set('obstacles', *(box(10 + 2 * k, 5) for k in range(99)), TOUCHING)
    before = len(received)
    monitor.until(lambda: monitor.contacts() == ['obstacle/99'] and len(received) > before)
    assert all(flag.data for flag in received)


def test_contact_within_a_batch_is_published(pausable):
    """The flags rise and fall, although the contact ends within the batch."""
    monitor = pausable(**EACH_MESSAGE, publish_rate=5.0)
    both = monitor.listen('~/footprint/collision'), monitor.listen('~/collision')
    monitor.send('footprint', ROBOT)
    monitor.send('obstacles', APART)
    monitor.until(lambda: all(received and not received[-1].data for received in both))
    before = [len(received) for received in both]
    with monitor.paused_while_sending():
        for polygon in (TOUCHING, APART):
            monitor.send('obstacles', polygon)
    for received, start in zip(both, before):
        # A flag published before the batch may arrive late.
        monitor.until(lambda: any(flag.data for flag in received[start:])
                      and not received[-1].data, 'a rise and a fall')


def test_lost_messages_are_counted(pausable):
    """Fifty messages for a queue of ten: forty are lost."""
    monitor = pausable(obstacle__timeout=20.0, **{DEPTH: 10})
    states = monitor.listen('~/state')
    monitor.send('obstacles', APART)
    monitor.until_reason('has not ended a set yet')
    with monitor.paused_while_sending():
        monitor.send_set('obstacles', *49 * [APART])
    monitor.until(lambda: 'obstacle: lost' in health(monitor))
    assert 'messages lost' in monitor.health().message
    shown = health(monitor)
    words = ('has not sent a whole set since messages were lost; the queue here holds 10 '
             f'messages: set {DEPTH} to one more than max_count')
    assert any(words in array.status[0].message for array in states)
    assert (shown['obstacle: lost'], shown['obstacle: received']) == ('40', '11')


def test_silent_publisher_does_not_go_on_with_the_messages_of_another(pausable, join):
    """It lost its liveliness, another one sent as many messages, and then it is heard again."""
    override = 'qos_overrides./obstacles.subscription.liveliness'
    monitor = pausable(**{override: 'automatic', f'{override}_lease_duration': SECOND // 2})
    silent, other = join('silent'), join('other')
    for peer, kind, points, state in (
            (silent, LivelinessPolicy.MANUAL_BY_TOPIC, APART, 'clear'),
            (other, LivelinessPolicy.AUTOMATIC, TOUCHING, 'collision')):
        monitor.until_reason('/obstacles has no publisher')
        peer.publisher('/obstacles', qos=QoSProfile(
            depth=10, liveliness=kind, liveliness_lease_duration=Duration(seconds=0.5)))
        monitor.send('footprint', ROBOT)
        peer.send_set('/obstacles', points)
        monitor.until(lambda: monitor.state() == state and 'publisher' not in monitor.reason())
    count = len(monitor.states())
    monitor.paused = True
    silent.send_set('/obstacles', APART)
    assert silent.publisher('/obstacles').wait_for_all_acked(Duration(seconds=60))
    monitor.paused = False
    monitor.until_reason('has 2 publishers')
    assert 'clear' not in monitor.states()[count:]


class SlowMonitor(footprint_monitor.FootprintMonitor):
    """Takes ten milliseconds per message."""

    def receive(self, name, messages, now, number, arrived):
        time.sleep(0.01 * len(messages))
        super().receive(name, messages, now, number, arrived)


@pytest.fixture
def start_slow(start, monkeypatch):
    monkeypatch.setattr('harness.FootprintMonitor', SlowMonitor)
    return start


def test_source_behind_by_more_than_its_timeout_is_unknown(start_slow):
    """It recovers when it has caught up; /diagnostics reports the delay."""
    monitor = start_slow(footprint__timeout=0.0, obstacle__timeout=0.3)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', APART)
    monitor.send_set('obstacles', *100 * [APART])
    monitor.await_state('unknown')
    monitor.until(lambda: monitor.health() and 'behind' in monitor.health().message)
    seconds, messages = health(monitor)['obstacle: behind'].split(' s, ')
    assert float(seconds) > 0.1 and messages.endswith(' messages')
    monitor.send_set_until('clear', 'obstacles', APART)
    monitor.until(lambda: 'behind' not in monitor.health().message)


def test_node_stays_responsive_while_messages_stream(start, domain):
    """Parameter services, an incompatible publisher, and /clock."""
    monitor = start(**LASTING)
    with streaming(domain, 'obstacles', 2000, TOUCHING):
        monitor.send('footprint', ROBOT)
        monitor.await_state('collision')
        assert monitor.set_parameters(obstacle__enabled=False) == [None]
        monitor.await_state('unknown')
        assert monitor.set_parameters(obstacle__enabled=True, margin=-1.0)[1]
        monitor.await_state('collision')
        transient = QoSProfile(depth=1, reliability=rclpy.qos.ReliabilityPolicy.BEST_EFFORT,
                               durability=DurabilityPolicy.TRANSIENT_LOCAL)
        unfit = monitor.node.create_publisher(PolygonStamped, 'footprint', transient)
        monitor.logged('offers a RELIABILITY')
        monitor.await_state('unknown')
        monitor.node.destroy_publisher(unfit)
        monitor.send_until('collision', 'footprint', ROBOT)
        assert monitor.set_parameters(use_sim_time=True) == [None]
        monitor.set_clock(3600 * SECOND)
        monitor.send('footprint', ROBOT, 3600 * SECOND)
        monitor.await_state('collision')


NAMES = [f'robot{k}' for k in range(12)]
# Of each that a node looks ahead for: where it is predicted, and the parameters.
FLAGS = 'sat_collision.scene.evaluator', {f'{name}__min_time_to_collision': 1.0 for name in NAMES}
FIGURES = 'sat_collision.scene.view', {}


@pytest.mark.parametrize(('module', 'parameters'), [FLAGS, FIGURES])
def test_message_during_predictions_has_its_flag_published_first(
        start, monkeypatch, module, parameters):
    """It does not wait until the others are predicted, each of which takes longer than a part."""
    running = start(footprints=NAMES, obstacle__timeout=60.0, **parameters,
                    **{f'{name}__timeout': 0.0 for name in NAMES})
    for k, name in enumerate(NAMES):
        running.send(name, box(0, 10 * k))
    running.send_set('obstacles', APART)
    for name in NAMES:
        running.await_state('clear', name)
    publisher = running.publisher(NAMES[-1])
    happened = []
    module = importlib.import_module(module)
    predict = module.predict

    def predict_slowly(footprint, *others):
        if footprint.settings.name == NAMES[2] and 'sent' not in happened:
            publisher.publish(polygon_message(APART, running.now()))
            assert publisher.wait_for_all_acked(Duration(seconds=60))
            happened.append('sent')
        happened.append(footprint.settings.name)
        time.sleep(0.002)
        return predict(footprint, *others)

    flag = running.monitor._outputs._flags[NAMES[-1]]
    publish = flag.publish

    def publish_flag(data):
        if data[4]:
            happened.append('raised')
        publish(data)
    monkeypatch.setattr(flag, 'publish', publish_flag)
    monkeypatch.setattr(module, 'predict', predict_slowly)
    running.until(lambda: 'raised' in happened, 'a flag')
    between = happened[happened.index('sent') + 1:happened.index('raised')]
    assert between in ([NAMES[2]], [NAMES[2], NAMES[-1]])
    running.send(NAMES[-1], ROBOT)
    running.until(lambda: happened.count(NAMES[-2]) > 2, 'predictions of the others')


NODE = ['-m', 'sat_collision.node', '--ros-args', '-p', 'obstacles:=[obstacle, flood]',
        '-p', 'obstacle.topic:=obstacles', '-p', 'obstacle.set_end:=empty_polygon', '-p',
        'flood.topic:=flood']
# The flood ends by itself after this time in s.
FLOODED = 240.0
# Messages per second; with more, the middleware loses messages of other topics, too.
MAX_RATE = 10_000
# Longer than DDS takes to repeat messages that the flood displaced, in s.
SOON = 40.0

# Publishes all of a message but its stamp, given as hexadecimal digits, at a rate in Hz.
FLOODER = """
import struct, sys, time
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.qos import QoSProfile
content, rate, seconds = bytes.fromhex(sys.argv[1]), *map(float, sys.argv[2:])
rclpy.init()
publisher = rclpy.create_node('flooder').create_publisher(
    PolygonStamped, '/flood', QoSProfile(depth=1000))
begun = time.monotonic()
sent = 0
while (passed := time.monotonic() - begun) < seconds:
    if sent >= passed * rate:
        time.sleep(0.001)
    stamp = struct.pack('<4sII', b'\\0\\1\\0\\0', *divmod(time.time_ns(), 10**9))
    publisher.publish(stamp + content)
    sent += 1
"""


def circle(count):
    return [(500.0 + math.cos(2.0 * math.pi * k / count), math.sin(2.0 * math.pi * k / count))
            for k in range(count)]


def comb(count):
    """Return a polygon whose vertices are mostly the tips and roots of its teeth."""
    teeth = [(500.0 + 0.01 * k, 1.0 + 4.0 * (k % 2)) for k in range(1, count - 2)]
    width = 0.01 * (count - 2)
    return [(500.0, 0.0), *teeth, (500.0 + width, 0.0), (500.0 + width / 2, -1.0)][::-1]


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='a comb takes plain Python seconds')
@pytest.mark.parametrize('points, rate, length', [
    (circle(1024), MAX_RATE, None), (comb(1024), 1_000, None), (circle(4), MAX_RATE, None),
    (circle(4), MAX_RATE, -7), ([(math.nan, 0.0), *circle(3)], MAX_RATE, None)],
    ids=['1024-gons', 'combs of 1024', '4-gons', 'truncated', 'NaN'])
def test_flood_on_one_topic_does_not_block_others(run, peer, points, rate, length):
    """Contacts on the other topic are seen soon, and so is a signal."""
    node = run(*NODE, env={'NUMBA_DISABLE_JIT': '0'})
    peer.until(peer.status, 'a state')
    flooder = run('-c', FLOODER, serialised(points, 0)[12:length].hex(), str(rate), str(FLOODED))
    peer.until(lambda: int(health(peer).get('flood: received', 0)) > 100, 'a flood')
    for polygon, met in ((TOUCHING, ['obstacle/0']), (APART, []), (TOUCHING, ['obstacle/0'])):
        peer.repeat(lambda: peer.send_both(polygon), lambda: peer.contacts() == met,
                    f'contact with {met}', SOON)
    received = peer.listen('~/collision')
    before = len(received)
    peer.until(lambda: len(received) > before + 10, 'regular flags', SOON)
    node.send_signal(signal.SIGTERM)
    assert node.wait(timeout=SOON) == 0
    assert flooder.poll() is None, 'it was flooded to the end'


def resources():
    """Return the number of threads and open files of this process."""
    return len(os.listdir('/proc/self/task')), len(os.listdir('/proc/self/fd'))


def test_repeated_starts_do_not_leak(domain):
    counts = []
    for _ in range(12):
        monitor = RunningMonitor(domain, (), {})
        monitor.until(monitor.flag)
        monitor.close()
        counts.append(resources())
    assert counts[-1] <= counts[3]


def test_publishers_that_come_and_go_do_not_leak(start):
    monitor = start()
    counts = []
    for _ in range(60):
        before = monitor.received['obstacle']
        monitor.repeat(lambda: monitor.send_set('obstacles', APART),
                       lambda: monitor.received['obstacle'] > before, 'a message')
        monitor.leave('obstacles')
        counts.append(resources())
    assert counts[-1] <= counts[9]

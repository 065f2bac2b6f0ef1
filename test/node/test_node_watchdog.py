# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A stalled loop: the watchdog raises the flags, and DDS reports a dead node."""

import math
import signal
import socket
import threading
import time

from builders import odometry, serialised
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PolygonStamped, Twist
from harness import APART, box, health, LASTING, ROBOT, values
from nav_msgs.msg import Odometry
import pytest
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import LivelinessPolicy, QoSProfile
from sat_collision.node.watchdog import Systemd
from std_msgs.msg import Bool


class Stall:
    """Blocks a monitor's loop from its next tick until it is released."""

    def __init__(self, running):
        self._monitor = running.monitor
        self._released = threading.Event()
        self._begun = threading.Event()
        self._tick = self._monitor.tick
        self._monitor.tick = self._hang
        self.release = self._released.set
        running.until(self._begun.is_set)

    def _hang(self, now):
        self._begun.set()
        self._released.wait()
        del self._monitor.tick
        return self._tick(now)


@pytest.fixture
def stall():
    """Return a function that stalls a running monitor until the test ends at the latest."""
    stalls = []

    def stall(running):
        stalls.append(Stall(running))
        return stalls[-1]
    yield stall
    for one in stalls:
        one.release()


@pytest.fixture
def start_clear(start):
    """Start a monitor, with more parameters, that is in a clear state."""
    def start_clear(**parameters):
        running = start(**{**LASTING, 'watchdog': 1.0, **parameters})
        running.send_set('obstacles', APART)
        running.send_until('clear', 'footprint', ROBOT)
        running.until_flags(False)
        return running
    return start_clear


def test_stalled_loop_raises_the_flags(start_clear, stall):
    """All flags are raised and all states unknown until the loop continues."""
    running = start_clear()
    running.logged('footprint: ')
    running.listen('/diagnostics')
    separations = running.listen('~/footprint/separation')
    running.until(lambda: separations)
    begun = time.monotonic()
    stalled = stall(running)
    running.until_flags(True)
    status = running.await_state('unknown')
    assert status.level == b'\x03' and 'stalled for' in running.reason()
    words = running.logged('stalled for', 'all flags are raised')[0]
    longest = time.monotonic() - begun + 1.0
    assert 1.0 <= float(words.split('stalled for ')[1].split(' s')[0]) < longest
    running.until(lambda: running.health() and 'stalled for' in running.health().message)
    assert 'stalled for' in running.diagnostic('/footprint_monitor: footprint').message
    running.until(lambda: math.isnan(separations[-1].data))
    stalled.release()
    running.await_state('clear')
    running.until(lambda: separations[-1].data == 4 * 2**0.5)
    running.until_flags(False)
    running.logged('goes on after a stall')
    running.until(lambda: '1, the longest' in health(running).get('stalls', ''))


def test_flags_fall_after_the_stall(start_clear, stall):
    """The two threads that publish do not overtake each other."""
    running = start_clear()
    for _ in range(2):
        stalled = stall(running)
        running.until(running.flag, 'the flag raised')
        stalled.release()
        running.until(lambda: running.flag() is False)
        assert not any(flag.data for flag in running.further('~/collision', 3))


OUTLINE = {'footprint__points': '[[0, 0], [1, 0], [1, 1]]', 'footprint__frame_id': 'base',
           'footprint__odometry': '/odom', 'footprint__cmd_vel': '/cmd_vel', 'frame_id': 'odom'}


@pytest.mark.parametrize('name, parameters, topic, kind, sent', [
    ('footprint', {'obstacle__timeout': 60.0}, 'footprint', PolygonStamped,
     [serialised(ROBOT, 0)]),
    ('obstacle', {'footprint__timeout': 0.0}, 'obstacles', PolygonStamped,
     [serialised(APART, 0), serialised([], 0)]),
    ('footprint', {**OUTLINE, 'obstacle__timeout': 60.0}, '/odom', Odometry,
     [odometry('odom', 'base', 0, 0, 0)]),
    ('footprint.cmd_vel', {**OUTLINE, 'obstacle__timeout': 60.0}, '/cmd_vel', Twist, [Twist()])])
def test_message_of_stamp_0_that_waited_through_a_stall_is_old(
        start, stall, name, parameters, topic, kind, sent):
    """Its timeout of 0.5 s has passed when it is taken: it makes nothing clear, nothing known."""
    running = start(**{'watchdog': 0.3, 'footprint__timeout': 0.5, 'obstacle__timeout': 0.5,
                       **parameters})
    frame_id = running.monitor._scene.settings.frame_id or 'map'

    def publish():
        for message in sent:
            running.publisher(topic, kind).publish(message)

    def send():
        if name == 'obstacle':
            running.send('footprint', ROBOT)
        else:
            running.send_set('obstacles', APART, frame_id=frame_id)
        if name == 'footprint.cmd_vel':
            running.publisher('/odom', Odometry).publish(
                odometry('odom', 'base', running.now(), 0, 0))
        publish()
    running.repeat(send, lambda: running.state() == 'clear' and (
        name != 'footprint.cmd_vel' or running.value('velocity').endswith('command')))
    running.until(lambda: running.flag() is False)
    stalled = stall(running)
    before = running.received[name]
    publish()
    running.spin(1.0)
    states = running.listen('~/state')
    del states[:]
    stalled.release()
    running.until(lambda: running.received[name] >= before + len(sent))
    running.spin(0.3)
    later = [values(array.status[0]) for array in states]
    assert later
    if name == 'footprint.cmd_vel':
        # Those of the stall, of which one may arrive only now, have no velocity.
        assert not any(one['velocity'].endswith('command') for one in later), later
    else:
        assert all(one['state'] == 'unknown' for one in later), later


def test_nothing_old_is_published_after_a_message_that_took_long(start, monkeypatch):
    """The loop stands still between reading the clock and publishing what a message changed."""
    running = start(watchdog=0.3, footprint__timeout=0.5, obstacle__timeout=60.0,
                    obstacle__set_end='each_message')
    running.send('obstacles', box(0.5, 0))
    running.send_until('collision', 'footprint', ROBOT)
    receive = running.monitor.receive

    def receive_late(name, *message):
        receive(name, *message)
        if name == 'obstacle':
            monkeypatch.undo()
            time.sleep(1.0)
    monkeypatch.setattr(running.monitor, 'receive', receive_late)
    received = len(running.listen('~/collision'))
    running.send('footprint', ROBOT)
    running.send('obstacles', APART)
    running.until(lambda: running.received['obstacle'] == 2)
    running.spin(1.5)
    assert all(flag.data for flag in running.listen('~/collision')[received:])


def test_watchdog_goes_on_after_an_error(start_clear, stall, monkeypatch, capfd):
    """What fails once is logged once, and the stall is reported all the same."""
    running = start_clear()
    watchdog = running.monitor._watchdog
    report, failed = watchdog._on_stall, []

    def fail_first(stalled):
        if not failed:
            failed.append(stalled)
            raise OSError('no report')
        report(stalled)
    monkeypatch.setattr(watchdog, '_on_stall', fail_first)
    stall(running)
    running.until(running.flag)
    assert capfd.readouterr().err.count("the watchdog failed: OSError('no report')") == 1


@pytest.mark.parametrize('period', [0.0, 30.0])
def test_watchdog_can_be_changed_live(start_clear, stall, period):
    """With 0.0, or within a longer time, the last flag stays."""
    running = start_clear()
    assert running.set_parameters(watchdog=period) == [None]
    change = f'from 1.0 to {period}'
    running.logged(f'parameter watchdog was changed {change}')
    running.until(lambda: health(running).get('watchdog: changed') == change)
    stall(running)
    flags = running.listen('~/collision')
    del flags[:]
    running.spin(1.5)
    assert not any(flag.data for flag in flags)


def test_no_flag_falls_by_what_was_known_before_a_stall(start):
    """Parameters that take long to apply: by now the footprint is too old."""
    monitor = start(watchdog=0.3, footprint__timeout=0.5, obstacle__timeout=0.5)
    flags = monitor.listen('~/collision')
    monitor.repeat(lambda: monitor.send_both(APART), lambda: flags and not flags[-1].data)
    prepare = monitor.monitor._prepare
    monitor.monitor._prepare = lambda settings: time.sleep(1.0) or prepare(settings)
    assert monitor.set_parameters(resolution=0.002) == [None]
    monitor.until(lambda: health(monitor).get('stalls'))
    values = [flag.data for flag in flags]
    assert False not in values[values.index(True, values.index(False)):]


def test_no_state_from_before_a_stall_follows_it(start):
    """The loop stalls when the state of the first footprint is written, but not the second's."""
    times = {f'{name}__timeout': 0.5 for name in ('a', 'b', 'obstacle')}
    monitor = start(watchdog=0.3, footprints=['a', 'b'], **times)
    states = monitor.listen('~/state')

    def send():
        for name in ('a', 'b'):
            monitor.send(name, ROBOT)
        monitor.send_set('obstacles', APART)
    monitor.repeat(send, lambda: states and {
        one.level for one in states[-1].status} == {DiagnosticStatus.OK})
    scene = monitor.monitor._scene
    nearest = scene.nearest

    def hang(name):
        if name == 'b':
            del scene.nearest
            time.sleep(1.0)
        return nearest(name)
    scene.nearest = hang
    monitor.until(lambda: health(monitor).get('stalls'))
    stalled = next(k for k, one in enumerate(states) if 'stalled' in one.status[0].message)
    assert {one.level for state in states[stalled:] for one in state.status} == {
        DiagnosticStatus.STALE}


NODE = '-m', 'sat_collision.node'


@pytest.mark.parametrize('number', (signal.SIGKILL, signal.SIGSTOP))
def test_dds_reports_a_dead_monitor(run, peer, number):
    """Killed or stopped, to a subscriber with a deadline and liveliness."""
    monitor = run(*NODE)
    late, lost, received = [], [], []
    qos = QoSProfile(depth=10, deadline=Duration(seconds=0.4),
                     liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                     liveliness_lease_duration=Duration(seconds=0.6))
    peer.node.create_subscription(
        Bool, '/footprint_monitor/collision', received.append, qos,
        event_callbacks=SubscriptionEventCallbacks(
            deadline=late.append,
            liveliness=lambda event: lost.append(event) if event.not_alive_count_change > 0
            or event.alive_count_change < 0 else None))
    peer.until(lambda: len(received) > 5, 'flags')
    del late[:], lost[:]
    monitor.send_signal(number)
    # Without them DDS reports a killed process after 20 s, and a stopped one never.
    peer.until(lambda: late and lost, 'events', timeout=15.0)


def test_systemd_is_notified(run, tmp_path):
    address = str(tmp_path / 'notify')
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as connection:
        connection.bind(address)
        connection.settimeout(60.0)
        monitor = run(*NODE, env={'NOTIFY_SOCKET': address, 'WATCHDOG_USEC': '200000'})
        received = [connection.recv(100) for _ in range(5)]
        monitor.terminate()
        assert received == [b'READY=1', *[b'WATCHDOG=1'] * 4]
        while (last := connection.recv(100)) == b'WATCHDOG=1':
            pass
        assert last == b'STOPPING=1'
    assert monitor.wait(60) == 0


def test_missing_systemd_socket_is_ignored(run, peer, tmp_path):
    run(*NODE, env={'NOTIFY_SOCKET': str(tmp_path / 'nobody')})
    peer.until(lambda: len(peer.listen('~/collision')) > 3, 'flags')


def test_systemd_may_not_listen_for_a_while(monkeypatch, tmp_path):
    """Not yet, and then so long that its queue is full."""
    address = str(tmp_path / 'notify')
    monkeypatch.setenv('NOTIFY_SOCKET', address)
    monkeypatch.setenv('WATCHDOG_USEC', '1')
    systemd = Systemd()
    systemd.turned()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as connection:
        connection.bind(address)
        connection.settimeout(60.0)
        for _ in range(2000):
            systemd.turned()
        assert [connection.recv(100) for _ in range(2)] == [b'READY=1', b'WATCHDOG=1']

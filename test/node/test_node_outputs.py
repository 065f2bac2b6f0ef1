# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Outputs of a running node besides its flags, and that they are those of replay."""

from collections import defaultdict
import itertools
import math
import re
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from harness import APART, box, LASTING, ROBOT, SECOND, to_ns, TOUCHING, values
import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from recordings import by_stamp, check, declared, NAMES, published, STAMPS
from rosbags.highlevel import AnyReader
from sat_collision import KERNEL
from sat_collision.geometry.sets.packed_set import PackedSet
from sat_collision.messages import outputs
from sat_collision.messages.markers import Markers
from sat_collision.replay.model.result import Options
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, Settings
from std_msgs.msg import Float64
from visualization_msgs.msg import Marker


def namespaces(message):
    return {marker.ns for marker in message.markers if marker.action == Marker.ADD}


def drawn(monitor):
    """Return the namespaces of the last markers, none before the first."""
    received = monitor.listen('~/markers')
    return namespaces(received[-1]) if received else set()


def calls_of(monkeypatch, owner, name):
    """Return a list that grows with each call of a function."""
    calls = []
    function = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *a, **b: calls.append(1) or function(*a, **b))
    return calls


def test_late_subscriber_gets_all_markers(start, monkeypatch):
    """They are repeated without any change, and not drawn again."""
    calls = calls_of(monkeypatch, Markers, 'message')
    monitor = start(**LASTING)
    monitor.become('collision', TOUCHING)
    first, *others = monitor.further('~/markers', 3)
    assert first.markers[0].action == Marker.DELETEALL
    assert {'footprint/fill', 'obstacle/outline', 'footprint/name'} <= namespaces(first)
    assert all(namespaces(other) == namespaces(first) for other in others)
    count = len(calls)
    monitor.further('~/markers', 3)
    assert len(calls) == count


def test_states_are_all_new_where_a_subscriber_comes_amid_figures(start):
    """Of those footprints, too, whose figures had been published before."""
    monitor = start()
    settings = Settings(tuple(FootprintSettings(name, f'/{name}') for name in 'abc'), ())
    found = outputs.Outputs(monitor.node, settings, Scene(settings))
    received = []
    monitor.node.create_subscription(Float64, '~/c/separation', received.append, 10)
    monitor.until(lambda: found.find_subscribers() or found._measured)
    figures = found.publish_figures('abc')
    next(figures)
    states = []
    monitor.node.create_subscription(DiagnosticArray, '~/state', states.append, 10, raw=True)
    monitor.until(lambda: found.find_subscribers() or found._with_states)
    assert [*figures] == [None, None]
    assert [*found.publish_figures('abc')] == [None] * 3
    monitor.until(lambda: states, 'states')
    assert [status.name[-1] for status in deserialize_message(
        states[0], DiagnosticArray).status if status.message] == ['a', 'b', 'c']


def test_markers_follow_the_scene(start):
    monitor = start(marker_rate=50.0, **LASTING)
    received = monitor.listen('~/markers')
    monitor.until(lambda: received and not drawn(monitor), 'an empty picture')
    monitor.send_both(TOUCHING)
    monitor.until(lambda: 'contacts/points' in drawn(monitor))
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: drawn(monitor) & {'nearest/axis', 'contacts/points'} == {'nearest/axis'})
    monitor.send_set('obstacles', box(7, 7))
    monitor.until(lambda: any(marker.ns == 'obstacle/outline' and marker.points[0].x >= 7
                              for marker in received[-1].markers), 'the obstacle where it is')
    assert monitor.set_parameters(obstacle__enabled=False) == [None]
    monitor.until(lambda: drawn(monitor) == {
        'footprint/fill', 'footprint/outline', 'footprint/name'})


def test_obstacles_that_are_too_old_leave_the_markers(start):
    """Where no message comes, and the second one changes no state: that is unknown by then."""
    monitor = start(marker_rate=50.0, **{**LASTING, 'obstacle__timeout': 4.0})
    received = monitor.listen('~/markers')
    monitor.become('clear', APART)
    stamp = monitor.now()
    for points, age in ((APART, 0.0), (box(7, 7), 1.7), (box(9, 9), 1.9), ([], 0.0)):
        monitor.send('obstacles', points, stamp - round(age * SECOND))
    for left in (3, 1):
        monitor.until(lambda: 8 * left == sum(
            len(marker.points) for marker in received[-1].markers
            if marker.ns == 'obstacle/outline'), f'{left} obstacles')


def test_drawing_takes_no_more_than_a_tenth_of_the_time(start, monkeypatch):
    """Of 10,000 obstacles it held up the flags; in between, the markers drawn last are sent."""
    begun = []
    message = Markers.message

    def slow(*arguments):
        begun.append(time.monotonic())
        time.sleep(0.04)
        return message(*arguments)

    monkeypatch.setattr(Markers, 'message', slow)
    monitor = start(**LASTING)
    received = monitor.listen('~/markers')
    monitor.repeat(lambda: monitor.send('footprint', ROBOT), lambda: len(begun) > 3,
                   'markers of moving bodies')
    assert min(np.diff(begun)) >= 0.4
    assert len(received) > len(begun)


def test_points_of_contact_are_published_to_subscribers(start, monkeypatch):
    """With the stamp of the state that names the obstacle; none are made before."""
    calls = calls_of(monkeypatch, outputs, 'contact_cloud')
    monitor = start(**LASTING)
    monitor.become('collision', TOUCHING)
    assert not calls
    clouds, states = monitor.listen('~/footprint/contacts'), monitor.listen('~/state')
    cloud, state = monitor.until(lambda: [
        (cloud, state) for cloud in clouds for state in states
        if cloud.header.stamp == state.header.stamp], 'one stamp')[0]
    assert cloud.width == 1 and cloud.header.frame_id == 'map'
    point = np.frombuffer(bytes(cloud.data), np.float32)
    assert point[:3].tolist() == [1, 1, 0] and np.hypot(*point[3:5]) == 1 and point[6] == 0
    assert values(state.status[0])['obstacles in contact'] == 'obstacle/0'
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: clouds[-1].width == 0, 'an empty cloud')


def drive(monitor, condition, what):
    """Move a robot at 1 m/s until a condition holds; it starts again every second."""
    begun = monitor.now()

    def send():
        stamp = monitor.now()
        monitor.send('footprint', box((stamp - begun) % SECOND / SECOND, 0), stamp)
    monitor.repeat(send, condition, what)


@pytest.mark.parametrize('owner, function, topic', [
    (Markers, 'message', '~/markers'), (Scene, 'nearest', '~/footprint/separation'),
    (PackedSet, 'first_met', '~/footprint/time_to_collision')],
    ids=['markers', 'separation', 'time to collision'])
def test_figures_are_computed_only_for_subscribers(start, monkeypatch, owner, function, topic):
    """Those of points of contact are there in each case."""
    monitor = start(**LASTING)
    monitor.until(lambda: monitor.monitor._outputs.measures, 'kernels')
    calls = calls_of(monkeypatch, owner, function)
    monitor.listen('~/footprint/contacts')
    monitor.send_set('obstacles', box(3, 0))
    drive(monitor, lambda: monitor.flag() is False and monitor.health(), 'a clear state')
    monitor.spin(0.3)
    assert not calls and not monitor.monitor._scene.tracks_motion
    monitor.listen(topic)
    drive(monitor, lambda: calls, 'a figure')


def test_time_to_collision_is_published_to_subscribers(start):
    """It is NaN at first, and without a horizon."""
    monitor = start(**LASTING)
    times = monitor.listen('~/footprint/time_to_collision')
    monitor.send_set('obstacles', box(3, 0))
    drive(monitor, lambda: times and times[-1].data < 3.0, 'a time')
    assert math.isnan(times[0].data)
    assert all(math.isnan(time.data) or 0.0 < time.data <= 3.0 or time.data == math.inf
               for time in times)
    assert monitor.set_parameters(horizon=0.0) == [None]
    drive(monitor, lambda: math.isnan(times[-1].data), 'no prediction')


def test_states_and_markers_of_an_imminent_collision(start):
    """Within min_time_to_collision: a warning, a raised flag, and the way there in amber."""
    monitor = start(footprint__min_time_to_collision=2.5, **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', box(3, 0))
    drive(monitor, lambda: monitor.state() == 'imminent', 'a warning')
    status = monitor.status()
    assert status.level == DiagnosticStatus.WARN
    assert re.fullmatch(r'collision with obstacle/0 in [12]\.\d s', status.message)
    shown = values(status)
    assert 1.0 < float(shown['time to collision']) <= 2.5
    assert shown['first contact with'] == 'obstacle/0'
    assert re.match(r'(1\.0|0\.9)\d\d m/s.* rad/s by footprints$', shown['velocity'])
    drive(monitor, lambda: monitor.flag() and monitor.flag('footprint'), 'flags')
    markers = monitor.listen('~/markers')
    drive(monitor, lambda: drawn(monitor) >= {'footprint/ahead', 'footprint/time'} and any(
        marker.text == 'footprint: imminent' for marker in markers[-1].markers),
        'a way ahead, in the markers of an imminent collision')
    for _ in range(2):
        monitor.send('footprint', ROBOT)
        monitor.spin(0.1)
    monitor.await_state('clear')
    monitor.until(lambda: monitor.flag() is False and 'footprint/ahead' not in drawn(monitor),
                  'a lowered flag')
    assert monitor.value('time to collision') == 'inf'


def test_way_ahead_does_not_stay_when_nothing_is_received(start):
    """After 2 s without a footprint its velocity is unknown: nothing is predicted or drawn."""
    monitor = start(**LASTING)
    monitor.listen('~/footprint/time_to_collision')
    monitor.send('footprint', ROBOT)
    monitor.send_set_until('clear', 'obstacles', box(3, 0))
    drive(monitor, lambda: 'footprint/ahead' in drawn(monitor), 'a way ahead')
    monitor.until(lambda: re.fullmatch(r'unknown: its last place is of \d\.\d s ago',
                                       monitor.value('velocity')), 'silence')
    # Long before the obstacle is too old, for which all is drawn anew.
    monitor.until(lambda: 'footprint/ahead' not in drawn(monitor), 'an end', 10)


def test_health_reports_rates_rejections_check_time_and_kernel(start):
    """Five sets, one of them invalid: a warning in one period, OK in the next."""
    monitor = start(**LASTING)
    monitor.until(monitor.health, 'a first word')
    for points in 4 * [APART] + [[(0, 0), (1, 1), (1, 0), (0, 1)]]:
        monitor.send_set('obstacles', points)
    warned = monitor.until(lambda: monitor.health() and monitor.health().level
                           == DiagnosticStatus.WARN and 'rejected' in monitor.health().message
                           and monitor.health(), 'a warning')
    assert 'messages rejected: 1' in warned.message
    shown = values(warned)
    # The period may have ended before the end of the set.
    assert shown['obstacle: received'] in ('9', '10')
    assert shown['obstacle: rejected, self-intersecting'] == '1'
    assert float(shown['obstacle: rate [Hz]']) > 0
    assert 0 < float(shown['check time mean [ms]']) <= float(shown['longest batch [ms]'])
    assert shown['kernel'] == KERNEL
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: monitor.health().level == DiagnosticStatus.OK, 'a quiet period')
    monitor.until(lambda: values(monitor.health())['obstacle: rate [Hz]'] == '0.0')
    assert values(monitor.health())['obstacle: received'] == '12'
    assert monitor.health().hardware_id == '/footprint_monitor'


def test_parameters_change_a_running_node(start):
    monitor = start(publish_rate=5.0, **LASTING)
    monitor.become('clear', box(1.25, 0))
    assert monitor.set_parameters(margin=0.25) == [None]
    monitor.await_state('collision')
    assert monitor.contacts() == ['obstacle/0']
    monitor.until_flags(True)
    assert monitor.set_parameters(margin=0.125) == [None]
    monitor.await_state('clear')
    monitor.until_flags(False)
    assert monitor.set_parameters(enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until_flags(True)
    assert monitor.set_parameters(unknown_is_collision=False) == [None]
    monitor.until_flags(False)
    assert monitor.set_parameters(enabled=True) == [None]
    monitor.send_set_until('collision', 'obstacles', TOUCHING)
    monitor.until_flags(True)
    assert monitor.set_parameters(footprint__enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until_flags(False)
    assert monitor.set_parameters(unknown_is_collision=True) == [None]
    monitor.until(monitor.flag, 'the flag when nothing is watched')
    states = monitor.listen('~/state')
    assert monitor.set_parameters(publish_rate=50.0) == [None]
    # Of six states at 5 Hz, the last would be a second after the first.
    monitor.until(lambda: to_ns(states[-1].header.stamp) - to_ns(states[-6].header.stamp)
                  < SECOND // 2, 'more states')


def test_contact_that_a_parameter_ended_and_a_message_brings_back(start):
    monitor = start(**LASTING)
    monitor.become('clear', box(1.25, 0))
    assert monitor.set_parameters(margin=0.25) == [None]
    monitor.await_state('collision')
    monitor.until_flags(True)
    # Within a tick.
    monitor.set_parameters(margin=0.125)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    assert monitor.further('~/collision')[-1].data


AHEAD = box(5, 0)
OVERLAPPING = box(0.75, 0)


def test_contact_and_unknown_reach_diagnostics(start):
    """With the node's full name, so that two robots do not mix; topics are in its namespace."""
    monitor = start(['-r', '__ns:=/robot1'], **LASTING)
    monitor.name = 'robot1/footprint_monitor'

    def reported(level):
        status = monitor.diagnostic('/robot1/footprint_monitor: footprint')
        return status and status.level == level and status
    unknown = monitor.until(lambda: reported(DiagnosticStatus.STALE), 'unknown')
    assert 'has no publisher' in unknown.message
    monitor.send_set('/robot1/obstacles', OVERLAPPING)
    monitor.send_until('collision', '/robot1/footprint', ROBOT)
    monitor.until_flags(True)
    status = monitor.until(lambda: (status := reported(DiagnosticStatus.ERROR))
                           and not values(status)['reason'] and status, 'a contact')
    assert status.message == 'in contact with obstacle/0'
    assert status.hardware_id == '/robot1/footprint'
    assert values(status) == {'state': 'collision', 'obstacles in contact': 'obstacle/0',
                              'reason': ''}
    monitor.send_set('/robot1/obstacles', AHEAD)
    monitor.until(lambda: reported(DiagnosticStatus.OK), 'clear')
    assert monitor.health().name == '/robot1/footprint_monitor: health'


def test_health_warns_of_a_silent_source(start):
    """No publisher, then a good one, then silence, then a good one again."""
    monitor = start(footprint__timeout=0.0, obstacle__timeout=1.5)

    def until_warned(words):
        monitor.until(lambda: (health := monitor.health()) and words in health.message
                      and health.level == DiagnosticStatus.WARN, f'a warning: {words}')

    def until_well():
        monitor.repeat(lambda: monitor.send_set('/obstacles', AHEAD),
                       lambda: monitor.health().level == DiagnosticStatus.OK, 'health')
    until_warned('/obstacles has no publisher')
    monitor.send('/footprint', ROBOT)
    until_well()
    assert monitor.health().message == 'running'
    until_warned('/obstacles has been silent')
    until_well()


def test_separation_follows_the_scene(start):
    monitor = start(footprint__timeout=1.0, obstacle__timeout=60.0)
    received = monitor.listen('~/footprint/separation')

    def until_nan():
        monitor.until(lambda: received and math.isnan(received[-1].data), 'nothing known')
    until_nan()
    for obstacles, separation in (([], math.inf), ([AHEAD], 4.0), ([OVERLAPPING], -0.25)):
        monitor.send_set('/obstacles', *obstacles)
        monitor.repeat(lambda: monitor.send('/footprint', ROBOT),
                       lambda: received[-1].data == separation, f'a separation of {separation}')
    monitor.await_state('unknown')
    until_nan()
    assert monitor.value('least separation') == ''


STORAGES = 'mcap', 'sqlite3'


def between(begin, end, arrays):
    """Return state, contacts and reason within a time range, without repetition."""
    return without_repetition(
        tuple(values(array.status[0])[key] for key in ('state', 'obstacles in contact', 'reason'))
        for array in arrays if begin <= to_ns(array.header.stamp) <= end)


def wait(condition):
    """Wait for the node, which runs in its own thread, without receiving its messages."""
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(1e-4)


def without_repetition(items):
    return [item for item, _ in itertools.groupby(items)]


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if 'commonroad' in name else pytest.mark.long)
    for name in NAMES])
def test_live_node_and_replay_publish_the_same(start, tmp_path, name):
    """
    The node publishes the same changes of state that replay writes to a bag.

    The recording is played in order, each message once the previous one is counted; the clock
    follows header stamps and advances until each set is whole. All changes within a stamp are
    compared, from the third stamp on: the node knows more about the first set, because it is
    its publisher's first.
    """
    bag = published(name, STORAGES[NAMES.index(name) % 2])
    monitor = start(use_sim_time=True, publish_rate=5.0, obstacle__set_end=STAMPS)
    received = monitor.listen('~/state', 10_000)
    flags = monitor.listen('~/collision', 10_000)
    sent = 0
    stamps = []
    monitor.set_clock(next(by_stamp(bag))[0])
    monitor.until(lambda: monitor.status() and '/clock' not in monitor.reason(), 'the clock')
    for stamp, messages in by_stamp(bag):
        monitor.set_clock(stamp)
        wait(lambda: monitor.monitor.get_clock().now().nanoseconds == stamp)
        if len(stamps) == 2:
            monitor.until(lambda: to_ns(received[-1].header.stamp) == stamp, 'the state so far')
        for topic, data in messages:
            monitor.publisher(topic).publish(data)
            sent += 1
            wait(lambda: monitor.received.total() == sent)
        stamps.append(stamp)
        monitor.set_clock(stamp + SECOND // 16)
        wait(lambda: monitor.monitor._scene.deadline > stamp + SECOND // 16)
    monitor.until(lambda: received and to_ns(received[-1].header.stamp) > stamp, 'the last state')
    check(bag, Options(clock='header', as_live=True, write_bag=str(tmp_path / 'out'),
                       parameters={'publish_rate': 5.0, **declared(STAMPS)}))
    written = defaultdict(list)
    with AnyReader([tmp_path / 'out']) as reader:
        for connection, _, data in reader.messages():
            written[connection.topic].append(reader.deserialize(data, connection.msgtype))
    assert between(stamps[2], stamp, received) == between(
        stamps[2], stamp, written['/footprint_monitor/state'])
    raised = without_repetition(
        flag.data for flag in written['/footprint_monitor/collision'])[2:]
    monitor.until(lambda: without_repetition(flag.data for flag in flags)[-len(raised):] == raised,
                  f'flags {raised}')

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

"""What a running node shows beside its flags: markers, diagnostics, live parameters."""

import itertools
import math
import re

from diagnostic_msgs.msg import DiagnosticStatus
from harness import box, Peer, SECOND, to_ns, values
import numpy as np
from rclpy.parameter_client import AsyncParameterClient
from sat_collision import KERNEL
from sat_collision.geometry.polygon_set import PackedSet
from sat_collision.messages import outputs
from sat_collision.messages.markers import Markers
from sat_collision.messages.outputs import contact_cloud
from sat_collision.scene.scene import Scene
from visualization_msgs.msg import Marker

ROBOT = box(0, 0)
APART = box(5, 5)
TOUCHING = box(1, 1)
LASTING = {'footprint__timeout': 0.0, 'obstacle__timeout': 60.0}


def spaces(message):
    return {marker.ns for marker in message.markers if marker.action == Marker.ADD}


def test_late_subscriber_gets_the_whole_scene(start):
    """Markers begin with somebody who looks; they come again without any change."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    heard = monitor.markers()
    monitor.until(lambda: len(heard) > 2, 'markers')
    first, *others = heard
    assert first.markers[0].action == Marker.DELETEALL
    assert {'footprint/fill', 'obstacle/outline', 'footprint/name'} <= spaces(first)
    assert all(spaces(other) == spaces(first) for other in others)


def test_markers_follow_the_scene_and_nothing_stale_stays(start):
    """The obstacle parts from the footprint, then the node is told to check nothing."""
    monitor = start(marker_rate=50.0, **LASTING)
    heard = monitor.markers()
    monitor.until(lambda: heard and not spaces(heard[-1]), 'an empty picture')
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.until(lambda: 'contacts/points' in spaces(heard[-1]))
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: 'nearest/axis' in spaces(heard[-1])
                  and 'contacts/points' not in spaces(heard[-1]))
    monitor.send_set('obstacles', box(7, 7))
    monitor.until(lambda: any(marker.ns == 'obstacle/outline' and marker.points[0].x >= 7
                              for marker in heard[-1].markers), 'the obstacle where it is')
    assert monitor.set_parameters(obstacle__enabled=False) == [None]
    monitor.until(lambda: spaces(heard[-1]) == {
        'footprint/fill', 'footprint/outline', 'footprint/name'})


def test_nobody_subscribed_no_markers_are_made(start, monkeypatch):
    """The scene is not even looked at; once somebody subscribes, it is."""
    asked = []
    message = Markers.message
    monkeypatch.setattr(Markers, 'message', lambda *a: asked.append(1) or message(*a))
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    monitor.spin(0.3)
    assert not asked
    monitor.until(monitor.markers)
    count = len(asked)
    assert count
    monitor.spin(0.3)
    assert len(asked) == count, 'nothing has changed since'


def test_points_of_contact_come_while_somebody_subscribes(start, monkeypatch):
    """With the stamp of the state that names the obstacle; nothing is made before."""
    asked = []
    monkeypatch.setattr(outputs, 'contact_cloud',
                        lambda *a: asked.append(1) or contact_cloud(*a))
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    assert not asked
    clouds, states = monitor.listen('~/footprint/contacts'), monitor.listen('~/state')
    both = monitor.until(lambda: [(cloud, state) for cloud in clouds for state in states
                                  if cloud.header.stamp == state.header.stamp], 'one stamp')
    cloud, state = both[0]
    assert cloud.width == 1 and cloud.header.frame_id == 'map'
    point = np.frombuffer(bytes(cloud.data), np.float32)
    assert point[:3].tolist() == [1, 1, 0] and np.hypot(*point[3:5]) == 1 and point[6] == 0
    assert values(state.status[0])['obstacles in contact'] == 'obstacle/0'
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: clouds[-1].width == 0, 'an empty cloud')


def drive(monitor, condition, what):
    """Let a robot come at 1 m/s until something holds; after each second it starts anew."""
    begun = monitor.now()

    def there():
        stamp = monitor.now()
        x = (stamp - begun) % SECOND / SECOND
        monitor.send('footprint', [(x + u, v) for u, v in ROBOT], stamp)
        monitor.spin(0.05)
        return condition()
    monitor.until(there, what)


def test_the_time_to_a_collision_comes_while_somebody_subscribes(start, monkeypatch):
    """Not a number at first; nothing is predicted, nor any motion tracked, before."""
    asked = []
    first_met = PackedSet.first_met
    monitor = start(**LASTING)
    monitor.until(lambda: monitor.monitor._outputs.measures, 'kernels')
    monkeypatch.setattr(PackedSet, 'first_met',
                        lambda *a, **b: asked.append(1) or first_met(*a, **b))
    monitor.send_set('obstacles', box(3, 0))
    drive(monitor, lambda: monitor.flag() is False, 'a clear state')
    monitor.spin(0.3)
    scene = monitor.monitor._scene
    assert not asked and not scene.tracks_motion
    assert scene.velocity('footprint') == ''
    times = monitor.listen('~/footprint/time_to_collision')
    drive(monitor, lambda: times and times[-1].data < 3.0, 'a time')
    assert math.isnan(times[0].data) and asked
    assert all(math.isnan(time.data) or 0.0 < time.data <= 3.0 or time.data == math.inf
               for time in times)
    assert monitor.set_parameters(horizon=0.0) == [None]
    monitor.until(lambda: math.isnan(times[-1].data), 'no prediction')


def test_states_and_markers_tell_of_a_collision_ahead(start):
    """With a threshold that is met: a warning, a raised flag, and the way there in amber."""
    monitor = start(footprint__min_time_to_collision=2.5, **LASTING)
    monitor.send_set('obstacles', box(3, 0))
    drive(monitor, lambda: monitor.state() == 'imminent', 'a warning')
    status = monitor.status()
    assert status.level == DiagnosticStatus.WARN
    assert re.fullmatch(r'collision with obstacle/0 in [12]\.\d s', status.message)
    told = values(status)
    assert 1.0 < float(told['time to collision']) <= 2.5
    assert told['first contact with'] == 'obstacle/0'
    assert re.match(r'1\.0\d\d m/s|0\.9\d\d m/s', told['velocity'])
    assert told['velocity'].endswith('rad/s by footprints')
    drive(monitor, lambda: monitor.flag() and monitor.flag('footprint'), 'flags')
    drive(monitor, lambda: monitor.markers() and {'footprint/ahead', 'footprint/time'} <= spaces(
        monitor.markers()[-1]), 'a way ahead')
    assert any(marker.text == 'footprint: imminent' for marker in monitor.markers()[-1].markers)
    for _ in range(2):
        monitor.send('footprint', ROBOT)
        monitor.spin(0.1)
    monitor.await_state('clear')
    monitor.until(lambda: monitor.flag() is False and 'footprint/ahead' not in spaces(
        monitor.markers()[-1]), 'a lowered flag')
    assert values(monitor.status())['time to collision'] == 'inf'


def test_states_and_times_of_obstacles_that_move(start):
    """Known once an id came twice; one that comes in another shape has no velocity."""
    monitor = start(obstacle__type='polygon_instance', obstacle__moving=True,
                    obstacle__timeout=0.5, footprint__timeout=0.0)
    times = monitor.listen('~/footprint/time_to_collision')
    begun = monitor.now()

    def told(count=4):
        """Let it come at 1 m/s, for a second again and again, with so many corners."""
        stamp = monitor.now()
        x = 3.0 - (stamp - begun) % SECOND / SECOND
        monitor.send('footprint', ROBOT, stamp)
        monitor.send('obstacles', box(x)[:count], stamp, instance=7)
        monitor.spin(0.05)
        return values(monitor.status()) if monitor.status() else {}
    found = monitor.until(lambda: told().get('first contact with') == 'obstacle/7' and told(),
                          'a contact with what comes')
    assert found['obstacles of unknown motion'] == ''
    monitor.until(lambda: told() and 0.0 < times[-1].data < 3.0, 'a time')
    corners = itertools.cycle((3, 4))
    found = monitor.until(lambda: (
        now := told(next(corners)))['obstacles of unknown motion'] and now, 'unknown motion')
    assert found['obstacles of unknown motion'] == 'obstacle/7'
    assert found['time to collision'] == found['first contact with'] == ''
    monitor.until(lambda: told(next(corners)) and math.isnan(times[-1].data), 'no time')


def test_health_tells_rates_rejections_check_time_and_kernel(start):
    """Five sets, one of them bad: a warning in one period, running in the next."""
    monitor = start(**LASTING)
    monitor.until(monitor.health, 'a first word')
    for points in 4 * [APART] + [[(0, 0), (1, 1), (1, 0), (0, 1)]]:
        monitor.send_set('obstacles', points)
    warned = monitor.until(lambda: monitor.health() and monitor.health().level
                           == DiagnosticStatus.WARN and 'rejected' in monitor.health().message
                           and monitor.health(), 'a warning')
    assert 'messages rejected: 1' in warned.message
    told = values(warned)
    # The period may have ended before the end of the set.
    assert told['obstacle: received'] in ('9', '10')
    assert told['obstacle: rejected, self-intersecting'] == '1'
    assert float(told['obstacle: rate [Hz]']) > 0
    assert 0 < float(told['check time mean [ms]']) <= float(told['longest batch [ms]'])
    assert told['kernel'] == KERNEL
    monitor.send_set('obstacles', APART)
    monitor.until(lambda: monitor.health().level == DiagnosticStatus.OK, 'a quiet period')
    monitor.until(lambda: values(monitor.health())['obstacle: rate [Hz]'] == '0.0')
    assert values(monitor.health())['obstacle: received'] == '12'
    assert monitor.health().hardware_id == '/footprint_monitor'


def test_parameters_change_a_running_node(start):
    """Every live parameter over the service; what follows from it at once."""
    monitor = start(publish_rate=5.0, **LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    monitor.await_state('collision')
    assert monitor.set_parameters(enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until(monitor.flag)
    assert monitor.set_parameters(unknown_is_collision=False) == [None]
    monitor.until(lambda: monitor.flag() is False and monitor.flag('footprint') is False)
    assert monitor.set_parameters(enabled=True) == [None]
    monitor.send_set_until('collision', 'obstacles', TOUCHING)
    assert monitor.set_parameters(footprint__enabled=False) == [None]
    monitor.await_state('unknown')
    monitor.until(lambda: monitor.flag() is False)
    assert monitor.set_parameters(unknown_is_collision=True) == [None]
    monitor.until(monitor.flag, 'the flag when nothing is watched')
    states = monitor.listen('~/state')
    assert monitor.set_parameters(publish_rate=50.0) == [None]
    # Of six states at 5 Hz, the last would be a second after the first.
    monitor.until(lambda: to_ns(states[-1].header.stamp) - to_ns(states[-6].header.stamp)
                  < SECOND // 2, 'more states')


def test_timeout_set_while_running_applies_to_what_is_there(start):
    """A footprint that would never expire is stale at once, and good again without a timeout."""
    monitor = start(**LASTING)
    monitor.send_set('obstacles', APART)
    monitor.send('footprint', ROBOT)
    monitor.await_state('clear')
    assert monitor.set_parameters(footprint__timeout=0.01) == [None]
    monitor.await_state('unknown')
    assert monitor.set_parameters(footprint__timeout=0.0) == [None]
    monitor.await_state('clear')


def test_bad_parameters_are_refused_with_a_reason_and_change_nothing(start):
    """Out of range, of the wrong type, structural: the node goes on as before."""
    monitor = start(**LASTING)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', APART)
    monitor.await_state('clear')
    reasons = monitor.set_parameters(footprint__timeout=-1.0, enabled='no', footprints=['a'])
    for reason, words in zip(reasons, ('range', 'type', 'read-only')):
        assert words in reason
    assert monitor.state() == 'clear'


def test_parameters_are_described_to_users(start):
    """As `ros2 param describe` shows them."""
    monitor = start()
    client = AsyncParameterClient(monitor.node, 'footprint_monitor')
    monitor.until(client.services_are_ready)
    future = client.describe_parameters(['obstacle.timeout', 'obstacle.type'])
    timeout, kind = monitor.until(future.done) and future.result().descriptors
    assert 'forgotten' in timeout.description and timeout.floating_point_range[0].from_value == 0
    assert kind.read_only and 'polygon_instance' in kind.additional_constraints


def test_peer_that_only_listens(start, domain):
    """A second participant, as a dashboard is, sees what the first sees."""
    monitor = start(**LASTING)
    dashboard = Peer(domain)
    monitor.send('footprint', ROBOT)
    monitor.send_set('obstacles', TOUCHING)
    dashboard.await_state('collision')
    dashboard.close()


AHEAD = box(5, 0)
OVERLAPPING = box(0.75, 0)


def level(monitor, name):
    status = monitor.told(name)
    return status and status.level


def test_contact_and_unknown_reach_diagnostics(start):
    """By the node's full name, so that two robots do not mix."""
    monitor = start(['-r', '__ns:=/robot1'], **LASTING)
    monitor.name = 'robot1/footprint_monitor'
    name = '/robot1/footprint_monitor: footprint'
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.STALE, 'unknown')
    assert 'has no publisher' in monitor.told(name).message
    monitor.send_set('/robot1/obstacles', OVERLAPPING)
    monitor.send_until('collision', '/robot1/footprint', ROBOT)
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.ERROR
                  and not values(monitor.told(name))['reason'], 'a contact')
    status = monitor.told(name)
    assert status.message == 'in contact with obstacle/0'
    assert status.hardware_id == '/robot1/footprint'
    assert values(status) == {'state': 'collision', 'obstacles in contact': 'obstacle/0',
                              'reason': ''}
    monitor.send_set('/robot1/obstacles', AHEAD)
    monitor.until(lambda: level(monitor, name) == DiagnosticStatus.OK, 'clear')
    assert monitor.health().name == '/robot1/footprint_monitor: health'


def test_health_warns_of_a_source_while_it_is_silent(start):
    """Without a publisher, then all is well, then silent, then well again."""
    monitor = start(footprint__timeout=0.0, obstacle__timeout=1.5)

    def warned(words):
        health = monitor.health()
        return health and health.level == DiagnosticStatus.WARN and words in health.message

    def well():
        monitor.send_set('/obstacles', AHEAD)
        monitor.spin(0.1)
        return monitor.health().level == DiagnosticStatus.OK
    monitor.until(lambda: warned('/obstacles has no publisher'), 'a warning')
    monitor.send('/footprint', ROBOT)
    monitor.until(well, 'health')
    assert monitor.health().message == 'running'
    monitor.until(lambda: warned('/obstacles has been silent'), 'a warning')
    monitor.until(well, 'health again')


def test_separation_follows_the_scene_and_is_never_stale(start):
    """Not a number, infinity with nothing around, a gap, a depth, and not a number again."""
    monitor = start(footprint__timeout=1.0, obstacle__timeout=60.0)
    heard = monitor.listen('~/footprint/separation')

    def until(value, what):
        def is_so():
            if not math.isnan(value):
                monitor.send('/footprint', ROBOT)
                monitor.spin(0.02)
            return heard and (heard[-1].data == value
                              or math.isnan(value) and math.isnan(heard[-1].data))
        monitor.until(is_so, what)
    until(math.nan, 'nothing known')
    monitor.send_set('/obstacles')
    until(math.inf, 'nothing around')
    monitor.send_set('/obstacles', AHEAD)
    until(4.0, 'a gap')
    monitor.send_set('/obstacles', OVERLAPPING)
    until(-0.25, 'a depth')
    monitor.await_state('unknown')
    until(math.nan, 'a stale footprint')
    assert values(monitor.status())['least separation'] == ''


def test_separation_is_worked_out_only_for_who_subscribes(start, monkeypatch):
    """The nearest obstacle is not even looked for."""
    asked = []
    nearest = Scene.nearest
    monkeypatch.setattr(Scene, 'nearest', lambda *a, **b: asked.append(1) or nearest(*a, **b))
    monitor = start(**LASTING)
    monitor.send_set('/obstacles', AHEAD)
    monitor.send('/footprint', ROBOT)
    monitor.until(lambda: monitor.flag() is False)
    monitor.until(monitor.health)
    assert not asked
    monitor.until(lambda: monitor.listen('~/footprint/separation') and asked)

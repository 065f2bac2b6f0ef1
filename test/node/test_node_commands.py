# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Commands, odometry and frames over DDS."""

import itertools
import math

from builders import box, transforms
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PolygonStamped, PoseStamped, Twist, TwistStamped
from harness import health
from nav_msgs.msg import Path
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sat_collision.geometry.preparation import Preparation
from sat_collision.messages.outputs import Outputs
from sat_collision.messages.paths import Paths
from std_msgs.msg import Bool

OUTLINE = {'footprint__radius': 0.5, 'footprint__frame_id': 'base', 'obstacle__timeout': 60.0}
COMMANDED = {**OUTLINE, 'footprint__cmd_vel': 'cmd_vel', 'footprint__timeout': 0.5}
PLANNED = {**OUTLINE, 'footprint__path': 'plan', 'footprint__timeout': 5.0}
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def twist(x):
    message = Twist()
    message.linear.x = x
    return message


def stamped(x, frame_id='base'):
    message = TwistStamped(twist=twist(x))
    message.header.frame_id = frame_id
    return message


def straight(length, count=2):
    """Return a path along the x axis."""
    path = Path()
    path.header.frame_id = 'odom'
    for k in range(count):
        pose = PoseStamped()
        pose.pose.position.x = length * k / (count - 1)
        pose.pose.orientation.w = 1.0
        path.poses.append(pose)
    return path


class Robot:
    """A robot that stands at 0, with slight noise, 1.5 m before a wall; one figure is heard."""

    def __init__(self, running, figure):
        self.running = running
        self.figures = running.listen(f'~/footprint/{figure}')
        self.obstacle = box(2.0, -0.5)
        self._noise = itertools.cycle((-1e-3, 0.0))

    def until(self, condition, what, publisher=None, command=None):
        """Send its transform and the obstacle, and a command, until a condition holds."""
        def send():
            self.running.publisher('/tf', PolygonStamped).publish(transforms(
                ('odom', 'base', self.running.now(), next(self._noise), 0.0)))
            self.running.send_set('/obstacles', self.obstacle, frame_id='odom')
            if publisher:
                publisher.publish(command)
        self.running.repeat(send, condition, what)

    def until_value(self, key, begin):
        """Wait until a value of the state begins with some words."""
        self.until(lambda: self.running.value(key).startswith(begin), begin)

    def until_figure(self, number, *command):
        self.until(lambda: self.figures and self.figures[-1].data == pytest.approx(
            number, abs=0.05, nan_ok=True), f'a figure of {number}', *command)

    def until_predicted(self, *command):
        """Wait until contact is predicted in 1.5 s, at the commanded 1 m/s."""
        self.until(lambda: self.figures and 1.0 < self.figures[-1].data <= 1.5
                   and self.running.value('velocity').endswith('by command'), 'a time', *command)


@pytest.fixture
def commanded(start_with_tf):
    """Start a robot that gets commands, with more parameters."""
    return lambda **parameters: Robot(
        start_with_tf(**COMMANDED, **parameters), 'time_to_collision')


@pytest.fixture
def planned(start_with_tf):
    """Start a robot that gets paths, with more parameters."""
    return lambda **parameters: Robot(
        start_with_tf(**PLANNED, **parameters), 'path_contact_distance')


@pytest.mark.parametrize(('message', 'qos'), [
    (twist(1.0), 10), (twist(1.0), BEST_EFFORT), (stamped(1.0), 10), (stamped(1.0, ''), 1)])
def test_time_to_collision_follows_the_command(commanded, message, qos):
    """For both types and any QoS; unknown before the first command and after the last."""
    robot = commanded()
    running = robot.running
    robot.until(lambda: running.state() == 'clear', 'a clear state')
    robot.until(lambda: running.value('velocity') == 'unknown: no command on /cmd_vel yet',
                'no command')
    robot.until_figure(math.nan)
    robot.until_predicted(running.publisher('cmd_vel', type(message), qos), message)
    assert running.logged(f'footprint.cmd_vel: {type(message).__name__} on /cmd_vel')
    robot.until_value('velocity', 'unknown: no command on /cmd_vel for ')
    robot.until_figure(math.nan)


def test_type_of_commands_may_change(commanded, join):
    """One publisher leaves and another comes with the other type; no restart is needed."""
    robot = commanded()
    for number, message in enumerate((twist(1.0), stamped(1.0), twist(1.0))):
        peer = join(f'driver{number}')
        robot.until_predicted(peer.publisher('cmd_vel', type(message)), message)
        peer.leave('cmd_vel')
        robot.until_value('velocity', 'unknown: no command on')


def test_invalid_commands_are_counted_and_logged(commanded):
    robot = commanded()
    running = robot.running
    publisher = running.publisher('cmd_vel', TwistStamped)
    robot.until_predicted(publisher, stamped(1.0))
    for message, reason, words in (
            (stamped(math.nan), 'no velocity of a robot', 'nan m/s, 0 m/s, 0 rad/s; the publis'),
            (stamped(1.0, 'map'), 'command in another frame', "in 'map', the outline in 'base'")):
        refused = f'unknown: the last command on /cmd_vel was refused: {reason}'
        robot.until(lambda: running.value('velocity') == refused, reason, publisher, message)
        robot.until_figure(math.nan, publisher, message)
        line, *_ = running.logged('a message on /cmd_vel was rejected', reason)
        assert line.startswith('footprint.cmd_vel: ') and words in line
        robot.until(lambda: f'footprint.cmd_vel: rejected, {reason}' in health(running), 'a count')
        robot.until_predicted(publisher, stamped(1.0))
    assert int(health(running)['footprint.cmd_vel: received']) > 2


def test_commands_that_cannot_come_are_warned_of(commanded):
    """If min_time_to_collision needs them: no publisher, one of another type, a good one."""
    robot = commanded(footprint__min_time_to_collision=2.0)
    running = robot.running

    def until_warned(words):
        robot.until(lambda: (status := running.status()) and status.level == DiagnosticStatus.WARN
                    and status.message.startswith(
                        f'clear: no contact is predicted: /cmd_vel {words}'), words)
    until_warned('has no publisher')
    assert running.logged('footprint.cmd_vel: /cmd_vel has no publisher: ',
                          'correct footprint.cmd_vel')
    publisher = running.node.create_publisher(Bool, 'cmd_vel', 10)
    wrong = 'is published as std_msgs/msg/Bool, but has to be geometry_msgs/msg/Twist '
    until_warned(wrong)
    assert running.logged(f'footprint.cmd_vel: /cmd_vel {wrong}')
    running.node.destroy_publisher(publisher)
    robot.until(lambda: running.status().level == DiagnosticStatus.OK, 'no warning',
                running.publisher('cmd_vel', Twist), twist(0.0))
    assert running.set_parameters(footprint__enabled=False) == [None]
    robot.until(lambda: running.reason() == (
        'footprint footprint is disabled, commands on /cmd_vel are ignored'), 'a reason')


@pytest.mark.parametrize('parameters, topic, kind', [
    (COMMANDED, 'cmd_vel', Twist), (PLANNED, 'plan', Path)], ids=['commands', 'paths'])
def test_topic_is_remapped_once(start_with_tf, parameters, topic, kind):
    running = start_with_tf(
        arguments=['-r', f'{topic}:=other', '-r', 'other:=elsewhere'], **parameters)
    running.publisher('/other', kind)


@pytest.mark.parametrize('qos', [10, BEST_EFFORT, LATCHED])
def test_distance_follows_path_and_obstacles(planned, qos):
    """From unknown to a contact ahead, to none, and to contact; the flag is that of contacts."""
    robot = planned()
    running = robot.running
    robot.until(lambda: running.state() == 'clear', 'a clear state')
    robot.until_value('path contact', 'unknown: /plan has no publisher: ')
    robot.until_figure(math.nan)
    publisher = running.publisher('/plan', Path, qos)
    publisher.publish(straight(9.0))
    robot.until_figure(1.5)
    robot.until_value('path contact', 'obstacle/')
    robot.until(lambda: running.flag() is False, 'a flag')
    robot.until(lambda: draws_path(running), 'a marker')
    robot.obstacle = box(2.5, 3.0)
    robot.until_figure(math.inf)
    robot.until_value('path contact', 'none')
    robot.obstacle = box(0.2, 0.0)
    robot.until_figure(0.0)
    assert running.state() == 'collision'
    publisher.publish(Path())
    robot.until_value('path contact', 'unknown: no plan, as the last path on /plan is empty')
    robot.until_figure(math.nan)


def draws_path(running):
    """Return whether the last markers, of which there may be none yet, have the path."""
    return any(one.ns == 'footprint/path'
               for message in running.listen('~/markers')[-1:] for one in message.markers)


def test_distance_is_unknown_until_it_can_be_measured(planned, monkeypatch):
    """Kernels are still compiled: it is published all the same, as NaN."""
    monkeypatch.setattr(Preparation, 'is_complete', lambda self: False)
    robot = planned()
    robot.until_figure(math.nan)
    assert robot.running.monitor._outputs.measures is False


def test_each_distance_is_published_before_the_next_path_is_checked(planned, monkeypatch):
    """What comes between two checks may raise the flag of the first footprint."""
    turns = []

    def noted(kind, name, footprint_of):
        call = getattr(kind, name)
        monkeypatch.setattr(kind, name, lambda self, *arguments: turns.append(
            (name, footprint_of(*arguments))) or call(self, *arguments))

    noted(Paths, 'check', lambda now, footprints, measures: footprints[0].name)
    noted(Outputs, 'publish_path', lambda name: name)
    robot = planned(footprints=['footprint', 'second'], second__path='plan', second__radius=0.5,
                    second__frame_id='base', second__timeout=5.0)
    robot.until(lambda: len(turns) > 3, 'two checks')
    assert turns[:4] == [(turn, name) for name in ('footprint', 'second')
                         for turn in ('check', 'publish_path')]


def test_path_is_drawn_when_nothing_else_is_received(planned):
    """The markers before it was checked do not stay."""
    robot = planned()
    running = robot.running
    plans = running.publisher('/plan', Path)
    markers = running.listen('~/markers')
    robot.until(lambda: running.state() == 'clear' and markers, 'a clear state')
    for length in 9.0, 1.0, 9.0:
        plans.publish(straight(length))
        running.until(lambda: draws_path(running) is (length == 9.0), 'a marker')


def test_latched_plan_of_before_the_start_counts(planned, join):
    plans = join('planner').node.create_publisher(Path, '/plan', LATCHED)
    plans.publish(straight(9.0, 10_000))
    robot = planned()
    robot.until_figure(1.5)
    plans.publish(straight(9.0, 10_001))
    robot.until_value(
        'path contact', 'unknown: the last path on /plan was refused: too many poses')
    robot.until_figure(math.nan)
    assert robot.running.logged('footprint.path', 'too many poses', 'max_path_poses')
    assert robot.running.set_parameters(max_path_poses=20_000) == [None]
    plans.publish(straight(9.0, 10_001))
    robot.until_figure(1.5)


def test_publishers_with_other_qos_take_over(planned, join):
    """Volatile, then latched before it is known, then best effort."""
    robot = planned()

    def is_heard(name):
        return any(one.node_name == name
                   for one in robot.running.monitor.get_publishers_info_by_topic('/plan'))

    for number, qos in enumerate((10, LATCHED, BEST_EFFORT, LATCHED)):
        planner = join(f'planner{number}')
        if qos is LATCHED:
            def latch():
                plans = planner.node.create_publisher(Path, '/plan', qos)
                plans.publish(straight(9.0))
                return plans
            plans = planner.joined(latch, lambda _: is_heard(planner.node.get_name()))
        else:
            plans = planner.publisher('/plan', Path, qos)
            plans.publish(straight(1.0))
        robot.until_figure(1.5 if qos is LATCHED else math.inf)
        planner.node.destroy_publisher(plans)
        # Its executor may hold the publisher until it spins again.
        planner.until(lambda: not is_heard(planner.node.get_name()), 'the end of its publisher')


def test_planner_that_offers_less_is_heard_beside_another(planned, join):
    robot = planned()
    for name, qos, length, metres in (('first', LATCHED, 9.0, 1.5), ('second', 10, 1.0, math.inf)):
        join(name).publisher('/plan', Path, qos).publish(straight(length))
        robot.until_figure(metres)


def test_new_planner_is_heard_without_a_gap(start_with_tf, join):
    """The node subscribes anew, as the QoS may be another one."""
    running = start_with_tf(**PLANNED)
    first, second = join('first'), join('second')
    first.publisher('/plan', Path)
    first.leave('/plan')
    plans = second.node.create_publisher(Path, '/plan', 10)
    heard = []

    def hear():
        if heard or plans.get_subscription_count():
            heard.append(plans.get_subscription_count())

    running.until(lambda: hear() or len(running.logged('Path on /plan')) == 2, 'another one')
    assert min(heard) == 1


def test_path_of_another_type_is_named(planned):
    robot = planned()
    robot.running.node.create_publisher(Bool, '/plan', 10)
    robot.until_value('path contact', 'unknown: /plan is published as std_msgs/msg/Bool, but '
                      'has to be nav_msgs/msg/Path')


def send_transforms(running, *links):
    running.publisher('/tf', PolygonStamped).publish(transforms(*links))


def drive(running, x, state):
    """Send the robot's transform, and an obstacle, until a state is there."""
    def send():
        send_transforms(running, ('odom', 'base', running.now(), x, 0.0))
        running.send_set('/obstacles', box(9.0), frame_id='odom')
    running.repeat_until(state, send)


def test_static_transform_sent_before_the_start_is_received(join, start_with_tf):
    publisher = join('before').node.create_publisher(PolygonStamped, '/tf_static', LATCHED)
    publisher.publish(transforms(('odom', 'camera', 0, 0.5, 0.0)))
    running = start_with_tf()
    listener = running.monitor._monitor.transforms
    running.until(lambda: listener.received['/tf_static'], 'the latched transform')


def test_missing_and_invalid_transforms_are_logged(start_with_tf):
    running = start_with_tf()
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    line, = running.logged('no transform from base to odom: no good transform has come yet')[:1]
    assert line.startswith('footprint: a message on /footprint was rejected, unknown frame: ')
    send_transforms(running, ('odom', 'base', running.now(), float('nan'), 0.0))
    assert running.logged("the transform of 'base' in 'odom' by an unknown publisher")


def test_tf_can_be_remapped(start, start_with_tf):
    running = start(arguments=['-r', '/tf:=tf', '-r', '__ns:=/robot1'], frame_id='odom')
    topics = {one.topic_name for one in running.monitor.subscriptions}
    assert {'/robot1/tf', '/tf_static'} <= topics


SQUARE = '[[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]'
SQUARE_OF_BASE = {'footprint__points': SQUARE, 'footprint__frame_id': 'base'}


def test_outline_follows_tf(start_with_tf):
    running = start_with_tf(**SQUARE_OF_BASE)
    for x, state in ((0.0, 'clear'), (9.5, 'collision'), (8.0, 'clear')):
        drive(running, x, state)
    assert running.value('frame') == 'base'
    assert 0.0 <= float(running.value('age of transform')) < 60.0
    assert running.set_parameters(footprint__points='[[1.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]') == [
        None]
    drive(running, 8.0, 'collision')


def test_missing_tf2_msgs_is_logged_once(start, without_tf2_msgs):
    """A footprint in another frame than the fixed one is refused."""
    running = start(frame_id='odom', footprints=['footprint', 'outline'],
                    outline__points=SQUARE, outline__frame_id='base')
    assert len(running.logged('tf2_msgs is not installed (apt install ros-jazzy-tf2-msgs',
                              'it is not known where outline is')) == 1
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    assert running.logged('other frame')


def test_two_publishers_of_a_frame_are_named(join, start_with_tf):
    """With their nodes; a frame that only one publishes is not named."""
    running = start_with_tf(**SQUARE_OF_BASE)
    second = join().node.create_publisher(PolygonStamped, '/tf', 100)
    running.until(lambda: second.get_subscription_count(), 'a subscription')

    def send():
        stamp = running.now()
        send_transforms(running, ('odom', 'base', stamp, 0.0, 0.0))
        second.publish(transforms(('odom', 'base', stamp, 0.0, 0.0),
                                  ('odom', 'arm', stamp, 0.0, 0.0)))
    running.repeat(send, lambda: 'transforms of base: publishers took turns' in health(running),
                   'two publishers')
    assert 'transforms of arm: publishers took turns' not in health(running)
    assert float(health(running)['transforms: rate [Hz]']) > 1.0
    assert 'of /peer, sends base' in running.health().message.replace('/peer, /peer', '/peer')


ROUND_BASE = {'footprint__radius': 0.5, 'footprint__frame_id': 'base'}


def test_start_without_transforms_logs_what_to_do(start_with_tf):
    """Until a publisher of the remapped topic is found."""
    running = start_with_tf(**ROUND_BASE, arguments=('-r', '/tf:=/robot/tf'))
    missing = '/robot/tf has no publisher'
    running.until_reason(missing)
    assert running.logged('unknown since the start: ', f' {missing}: start what')
    running.publisher('/robot/tf', PolygonStamped)
    running.until(lambda: missing not in running.reason(), timeout=5.0)


def test_lack_of_transforms_says_what_is_lacking(start_with_tf, join):
    """Nothing published, another type, a QoS that does not fit; and a frame nobody tells of."""
    running = start_with_tf(**ROUND_BASE)
    peer = join('localisation')
    running.until_reason('has not been received yet', '/tf has no publisher')
    best_effort = QoSProfile(depth=9, reliability=ReliabilityPolicy.BEST_EFFORT)
    for kind, topic, qos, words in (
            (Bool, '/tf', 9, 'of another type, std_msgs/msg/Bool, where '),
            (PolygonStamped, '/tf', best_effort, 'it is best effort, the subscription reliable'),
            (PolygonStamped, '/tf_static', 9, 'it is volatile, the subscription transient local')):
        publisher = peer.node.create_publisher(kind, topic, qos)
        words = f'{topic} has a publisher, /localisation, ', words
        running.until_reason(*words)
        running.until(lambda: running.health() and all(
            word in running.health().message for word in words), words)
        peer.node.destroy_publisher(publisher)
    send_transforms(running, ('odom', 'other', running.now(), 0.0, 0.0))
    running.until_reason('no good transform has named base yet, only odom, other')
    assert running.logged('footprint: a message on /tf was rejected, unknown frame: ',
                          'only odom, other; correct the frame_id, or publish its transform on')

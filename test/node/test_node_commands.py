# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Velocity commands over DDS: both types, any publisher, valid and invalid."""

import math

from builders import box, transforms
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PolygonStamped, Twist, TwistStamped
from harness import health, values
import pytest
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import Bool

ROBOT = {'footprint__radius': 0.5, 'footprint__frame_id': 'base',
         'footprint__cmd_vel': 'cmd_vel', 'footprint__timeout': 0.5, 'obstacle__timeout': 60.0}
BEST_EFFORT = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)


def twist(x, frame_id=''):
    message = Twist()
    message.linear.x = x
    return message


def stamped(x, frame_id='base'):
    message = TwistStamped()
    message.header.frame_id = frame_id
    message.twist.linear.x = x
    return message


class Robot:
    """A robot that stands at 0, with slight noise, 1.5 m before a wall."""

    def __init__(self, running):
        self.running = running
        self.times = running.listen('~/footprint/time_to_collision')
        self.placed = 0

    def stand(self, command=None, publisher=None):
        """Send its transform and the wall, and a command if there is one."""
        self.placed += 1
        self.running.publisher('/tf', PolygonStamped).publish(transforms(
            ('odom', 'base', self.running.now(), -1e-3 * (self.placed % 2), 0.0)))
        self.running.send_set('/obstacles', box(2.0, -0.5), frame_id='odom')
        if publisher:
            publisher.publish(command)
        self.running.spin(0.02)

    def until(self, condition, what, *command):
        self.running.until(lambda: self.stand(*command) or condition(), what)

    def velocity(self):
        return values(self.running.status())['velocity'] if self.running.status() else ''

    def until_predicted(self, *command):
        """Wait until contact is predicted in 1.5 s, at the commanded 1 m/s."""
        self.until(lambda: self.times and 1.0 < self.times[-1].data <= 1.5
                   and self.velocity().endswith('by command'), 'a time', *command)


@pytest.mark.parametrize(('message', 'qos'), [
    (twist(1.0), 10), (twist(1.0), BEST_EFFORT), (stamped(1.0), 10), (stamped(1.0, ''), 1)])
def test_time_to_collision_follows_the_command(start_with_tf, message, qos):
    """For both types and any QoS; unknown before the first command and after the last."""
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    robot.until(lambda: running.state() == 'clear', 'a clear state')
    robot.until(lambda: robot.velocity() == 'unknown: no command on /cmd_vel yet', 'no command')
    robot.until(lambda: math.isnan(robot.times[-1].data), 'no time')
    robot.until_predicted(message, running.publisher('cmd_vel', type(message), qos))
    assert running.logged(f'footprint.cmd_vel: {type(message).__name__} on /cmd_vel')
    robot.until(lambda: robot.velocity().startswith('unknown: no command on /cmd_vel for '),
                'an end')
    robot.until(lambda: math.isnan(robot.times[-1].data), 'no time')


def test_type_of_commands_may_change(start_with_tf, join):
    """One publisher leaves and another comes with the other type; no restart is needed."""
    robot = Robot(start_with_tf(**ROBOT))
    for number, message in enumerate((twist(1.0), stamped(1.0), twist(1.0))):
        peer = join(f'driver{number}')
        publisher = peer.publisher('cmd_vel', type(message))
        robot.until_predicted(message, publisher)
        peer.node.destroy_publisher(publisher)
        robot.until(lambda: robot.velocity().startswith('unknown: no command on'), 'an end')


def test_invalid_commands_are_counted_and_logged(start_with_tf):
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    publisher = running.publisher('cmd_vel', TwistStamped)
    robot.until_predicted(stamped(1.0), publisher)
    for message, reason, words in (
            (stamped(math.nan), 'no velocity of a robot', 'nan m/s, 0 m/s, 0 rad/s; the publis'),
            (stamped(1.0, 'map'), 'command in another frame', "in 'map', the outline in 'base'")):
        robot.until(lambda: robot.velocity() == (
            f'unknown: the last command on /cmd_vel was refused: {reason}'), reason,
            message, publisher)
        robot.until(lambda: math.isnan(robot.times[-1].data), 'no time', message, publisher)
        line, *_ = running.logged('a message on /cmd_vel was rejected', reason)
        assert line.startswith('footprint.cmd_vel: ') and words in line
        robot.until(lambda: f'footprint.cmd_vel: rejected, {reason}' in health(running), 'a count')
        robot.until_predicted(stamped(1.0), publisher)
    assert int(health(running)['footprint.cmd_vel: received']) > 2


def test_commands_that_cannot_come_are_warned_of(start_with_tf):
    """If min_time_to_collision needs them: no publisher, one of another type, a good one."""
    running = start_with_tf(**ROBOT, footprint__min_time_to_collision=2.0)
    robot = Robot(running)

    def warns(words):
        status = running.status()
        return status and status.level == DiagnosticStatus.WARN and status.message.startswith(
            f'clear: no contact is predicted: /cmd_vel {words}')
    robot.until(lambda: warns('has no publisher'), 'a warning')
    assert running.logged('footprint: no contact is predicted: /cmd_vel has no publisher: ',
                          'correct footprint.cmd_vel')
    publisher = running.node.create_publisher(Bool, 'cmd_vel', 10)
    wrong = 'is published as std_msgs/msg/Bool, but a command has to be geometry_msgs/msg/Twist '
    robot.until(lambda: warns(wrong), 'a warning of its type')
    assert running.logged(f'footprint.cmd_vel: /cmd_vel {wrong}')
    running.node.destroy_publisher(publisher)
    publisher = running.publisher('cmd_vel', Twist)
    robot.until(lambda: running.status().level == DiagnosticStatus.OK, 'no warning', twist(0.0),
                publisher)
    assert running.set_parameters(footprint__enabled=False) == [None]
    robot.until(lambda: running.reason() == (
        'footprint footprint is disabled, commands on /cmd_vel are ignored'), 'a reason')


def test_topic_of_commands_is_remapped_once(start_with_tf):
    running = start_with_tf(arguments=['-r', 'cmd_vel:=driven', '-r', 'driven:=elsewhere'],
                            **ROBOT)
    running.publisher('driven', Twist)


def test_flag_is_raised_by_a_commanded_velocity(start_with_tf):
    """The robot does not move yet."""
    running = start_with_tf(**ROBOT, footprint__min_time_to_collision=2.0)
    robot = Robot(running)
    publisher = running.publisher('cmd_vel', TwistStamped)
    for speed, state in ((0.1, 'clear'), (1.0, 'imminent'), (0.0, 'clear')):
        robot.until(lambda: running.state() == state, state, stamped(speed), publisher)
        robot.until(lambda: running.flag() is (state != 'clear'), 'a flag', stamped(speed),
                    publisher)

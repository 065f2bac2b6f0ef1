# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Files shipped with the package: configurations of other programs, an example, a fleet."""

from contextlib import closing
import json
from pathlib import Path
import re
import runpy
import time

from geometry_msgs.msg import Twist, Vector3
from harness import APART, box, LASTING, TOUCHING
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Bool
import yaml

ROOT = Path(__file__).resolve().parents[2]
TIME_TO_STOP = 0.3


def read_yaml(*path):
    return yaml.safe_load(ROOT.joinpath(*path).read_text())


def published(monitor):
    """Return the names and types of all that a running monitor publishes."""
    return {one.topic_name: one.msg_type for one in monitor.monitor.publishers}


def test_rviz_shows_our_markers(start):
    """The file has RViz's form, and its topic is our marker topic."""
    manager = read_yaml('rviz', 'footprint_monitor.rviz')['Visualization Manager']
    topic, = [display['Topic']['Value'] for display in manager['Displays'] if 'Topic' in display]
    assert published(start())[topic].__name__ == 'MarkerArray'
    assert all(display['Class'].startswith('rviz_default_plugins/')
               for display in manager['Displays'])


def test_foxglove_shows_our_topics(start):
    """
    Each placed panel is configured, and each topic and field exists.

    The topics are those of the default footprint and of the one in nav2.yaml.
    """
    layout = json.loads((ROOT / 'foxglove' / 'footprint_monitor.json').read_text())
    text = json.dumps(layout)
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', text)
    assert sorted(placed) == sorted(layout['configById'])
    named = read_yaml('config', 'nav2.yaml')['/**']['ros__parameters']['footprints']
    ours = published(start(footprints=['footprint', *named]))
    topics = re.findall(r'"(/[^"]+)"', text)
    assert len(topics) == 9
    for topic, _, field in (path.partition('.') for path in topics):
        assert hasattr(ours[topic](), field or '__slots__')


def test_twist_mux_is_locked_by_the_flag(start):
    """
    The file has the form that twist_mux documents.

    A lock with a timeout is locked when no message comes, and stops inputs of lower priority.
    """
    parameters = read_yaml('config', 'twist_mux.yaml')['/**']['ros__parameters']
    topics, locks = parameters['topics'], parameters['locks']
    assert parameters['use_stamped'] is False, 'twist_mux 4.4 does not start without it'
    for one in (*topics.values(), *locks.values()):
        assert {key: type(value) for key, value in one.items()} == {
            'topic': str, 'timeout': float, 'priority': int}
        assert 0 <= one['priority'] <= 255
    lock = locks['collision']
    assert published(start())['/' + lock['topic']] is Bool
    assert lock['timeout'] == TIME_TO_STOP
    assert topics['navigation']['priority'] < lock['priority'] < topics['teleop']['priority']


class Robot:
    """Is always commanded to drive, and receives the speeds that the example passes on."""

    def __init__(self, monitor):
        self.monitor = monitor
        example = runpy.run_path(str(ROOT / 'examples' / 'stop_on_collision.py'))
        self.node = example['StopOnCollision'](context=monitor.context)
        self.executor = SingleThreadedExecutor(context=monitor.context)
        self.executor.add_node(self.node)
        self.commands = monitor.node.create_publisher(Twist, 'cmd_vel_nav', 1)
        self.speed = None
        monitor.node.create_subscription(Twist, 'cmd_vel', self.note, 1)

    def close(self):
        self.node.destroy_node()
        self.executor.shutdown()

    def note(self, twist):
        self.speed = twist.linear.x

    def command(self):
        self.commands.publish(Twist(linear=Vector3(x=0.5)))
        self.executor.spin_once(timeout_sec=0.01)

    def until(self, speed):
        """Command it to drive until the last speed passed on is the given one."""
        self.monitor.repeat(self.command, lambda: self.speed == speed, f'a speed of {speed}')


def test_example_stops_the_robot(start):
    """Before the first flag, in contact, and 0.3 s after the monitor has stopped publishing."""
    monitor = start(**LASTING)
    with closing(Robot(monitor)) as robot:
        robot.until(0.0)
        monitor.send_both(TOUCHING)
        monitor.until(monitor.flag)
        for obstacle, speed in ((APART, 0.5), (TOUCHING, 0.0), (APART, 0.5)):
            monitor.send_set('obstacles', obstacle)
            robot.until(speed)
        flags = monitor.listen('~/collision')
        begin = len(flags)
        monitor._stop.set()
        robot.until(0.0)
        assert time.monotonic() >= robot.node.clear_until > 0.0
        assert not any(flag.data for flag in flags[begin:])


def test_fleet_avoids_itself(start):
    """Two robots touch; a robot that falls silent is an unknown obstacle of the other."""
    monitor = start(['--params-file', str(ROOT / 'config' / 'fleet.yaml')],
                    robot1__timeout=0.0, robot2__timeout=0.0, body1__timeout=60.0,
                    body2__timeout=1.5, obstacle__timeout=60.0)

    def until(one, other, *robots):
        def send():
            for number, x in enumerate(robots, 1):
                monitor.send(f'/robot{number}/local_costmap/published_footprint', box(x, 0))
        monitor.repeat(send, lambda: [one, other] == [
            monitor.state(name) for name in ('robot1', 'robot2')], f'{one} and {other}')
    monitor.send_set('/obstacles', box(20, 20))
    until('clear', 'clear', 0, 5)
    until('collision', 'collision', 0, 0.75)
    assert monitor.contacts('robot1') == ['body2/0']
    assert monitor.contacts('robot2') == ['body1/0']
    until('clear', 'clear', 0, 5)
    until('unknown', 'clear', 0)
    assert 'body2' in monitor.reason('robot1')

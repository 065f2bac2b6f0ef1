# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Paths over DDS: any QoS, latched plans, other publishers, what is published of them."""

import math

from builders import box, transforms
from geometry_msgs.msg import PolygonStamped, PoseStamped
from harness import values
from nav_msgs.msg import Path
import pytest
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from sat_collision.geometry.preparation import Preparation
from sat_collision.messages.outputs import Outputs
from sat_collision.messages.paths import Paths
from std_msgs.msg import Bool

ROBOT = {'footprint__radius': 0.5, 'footprint__frame_id': 'base', 'footprint__path': 'plan',
         'footprint__timeout': 5.0, 'obstacle__timeout': 60.0}
BEST_EFFORT = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


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
    """A robot that stands at 0, 2 m before a wall."""

    def __init__(self, running):
        self.running = running
        self.distances = running.listen('~/footprint/path_contact_distance')

    def stand(self, *polygons):
        """Send its transform and the obstacles."""
        self.running.publisher('/tf', PolygonStamped).publish(transforms(
            ('odom', 'base', self.running.now(), 0.0, 0.0)))
        self.running.send_set('/obstacles', *(polygons or (box(2.5, -0.5),)), frame_id='odom')
        self.running.spin(0.02)

    def until(self, condition, what, *polygons):
        self.running.until(lambda: self.stand(*polygons) or condition(), what)

    def until_text(self, text, *polygons):
        self.until(lambda: (status := self.running.status()) and text in values(status)[
            'path contact'], text, *polygons)

    def until_distance(self, metres, *polygons):
        self.until(lambda: self.distances and (
            self.distances[-1].data == pytest.approx(metres, abs=0.05, nan_ok=True)),
            f'a distance of {metres}', *polygons)


@pytest.mark.parametrize('qos', [10, BEST_EFFORT, LATCHED])
def test_distance_follows_path_and_obstacles(start_with_tf, qos):
    """From unknown to a contact ahead, to none, and to contact; the flag is that of contacts."""
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    robot.until(lambda: running.state() == 'clear', 'a clear state')
    robot.until_text('unknown: no path on /plan yet; it has no publisher')
    robot.until_distance(math.nan)
    publisher = running.publisher('/plan', Path, qos)
    publisher.publish(straight(9.0))
    robot.until_distance(2.0)
    robot.until_text('obstacle/')
    robot.until(lambda: running.flag() is False, 'a flag')
    markers = running.markers()
    robot.until(lambda: markers and any(one.ns == 'footprint/path'
                                        for one in markers[-1].markers), 'a marker')
    robot.until_distance(math.inf, box(2.5, 3.0))
    robot.until_text('none', box(2.5, 3.0))
    robot.until_distance(0.0, box(0.2, 0.0))
    assert running.state() == 'collision'
    publisher.publish(Path())
    robot.until_text('unknown: no plan, as the last path on /plan is empty')
    robot.until_distance(math.nan)


def test_distance_is_unknown_until_it_can_be_measured(start_with_tf, monkeypatch):
    """Kernels are still compiled: it is published all the same, as NaN."""
    monkeypatch.setattr(Preparation, 'is_complete', lambda self: False)
    robot = Robot(start_with_tf(**ROBOT))
    robot.until_distance(math.nan)
    assert robot.running.monitor._outputs.measures is False


def test_each_distance_is_published_before_the_next_path_is_checked(start_with_tf, monkeypatch):
    """What comes between two checks may raise the flag of the first footprint."""
    turns = []

    def noted(kind, name, footprint_of):
        call = getattr(kind, name)
        monkeypatch.setattr(kind, name, lambda self, *arguments: turns.append(
            (name, footprint_of(*arguments))) or call(self, *arguments))

    noted(Paths, 'check', lambda now, footprints, measures: footprints[0].name)
    noted(Outputs, 'publish_path', lambda name: name)
    running = start_with_tf(
        footprints=['footprint', 'second'], second__path='plan', second__radius=0.5,
        second__frame_id='base', second__timeout=5.0, **ROBOT)
    Robot(running).until(lambda: len(turns) > 3, 'two checks')
    assert turns[:4] == [(turn, name) for name in ('footprint', 'second')
                         for turn in ('check', 'publish_path')]


def test_path_is_drawn_when_nothing_else_is_received(start_with_tf):
    """The markers before it was checked do not stay."""
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    plans = running.publisher('/plan', Path)
    markers = running.markers()

    def drawn():
        return bool(markers) and any(one.ns == 'footprint/path' for one in markers[-1].markers)

    robot.until(lambda: running.state() == 'clear' and markers, 'a clear state')
    for path in straight(9.0), straight(1.0), straight(9.0):
        plans.publish(path)
        running.until(lambda: drawn() is (path.poses[-1].pose.position.x == 9.0), 'a marker')


def test_latched_plan_of_before_the_start_counts(start_with_tf, join):
    plans = join('planner').node.create_publisher(Path, '/plan', LATCHED)
    plans.publish(straight(9.0, 10_000))
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    robot.until_distance(2.0)
    plans.publish(straight(9.0, 10_001))
    robot.until_text('refused: too many poses')
    robot.until_distance(math.nan)
    assert running.logged('footprint.path', 'too many poses', 'max_path_poses')
    assert running.set_parameters(max_path_poses=20_000) == [None]
    plans.publish(straight(9.0, 10_001))
    robot.until_distance(2.0)


def test_publishers_with_other_qos_take_over(start_with_tf, join):
    """Volatile, then latched before it is known, then best effort."""
    running = start_with_tf(**ROBOT)
    robot = Robot(running)

    def is_heard(name):
        return any(one.node_name == name
                   for one in running.monitor.get_publishers_info_by_topic('/plan'))

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
        robot.until_distance(2.0 if qos is LATCHED else math.inf)
        planner.node.destroy_publisher(plans)


def test_new_planner_is_heard_without_a_gap(start_with_tf, join):
    """The node subscribes anew, as the QoS may be another one."""
    running = start_with_tf(**ROBOT)
    first, second = join('first'), join('second')
    plans = first.publisher('/plan', Path)
    first.node.destroy_publisher(plans)
    plans = second.node.create_publisher(Path, '/plan', 10)
    heard = []

    def hear():
        if heard or plans.get_subscription_count():
            heard.append(plans.get_subscription_count())

    running.until(lambda: hear() or len(running.logged('Path on /plan')) == 2, 'another one')
    assert min(heard) == 1


def test_topic_of_another_type_is_named(start_with_tf):
    running = start_with_tf(**ROBOT)
    robot = Robot(running)
    running.node.create_publisher(Bool, '/plan', 10)
    robot.until_text('no path on /plan yet; it is published as std_msgs/msg/Bool')


def test_topic_is_remapped_once(start_with_tf):
    running = start_with_tf(arguments=['-r', 'plan:=planned', '-r', 'planned:=elsewhere'], **ROBOT)
    running.publisher('/planned', Path)

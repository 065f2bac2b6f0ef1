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

"""Frames over DDS; tf2_msgs is stood in for by another type, as nobody looks into the bytes."""

import sys

from builders import box, transforms
from geometry_msgs.msg import PolygonStamped
from harness import Peer
from rclpy.qos import DurabilityPolicy, QoSProfile

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def tell(running, *links):
    running.publisher('/tf', PolygonStamped).publish(transforms(*links))


def latch(running, *links):
    running.publisher('/tf_static', PolygonStamped, LATCHED).publish(transforms(*links))


def test_bodies_are_placed_by_tf(start_with_tf):
    """The robot drives into what its camera sees standing in the world."""
    running = start_with_tf()
    latch(running, ('base', 'camera', 0, 0.5, 0.0))

    def drive(x):
        stamp = running.now()
        tell(running, ('odom', 'base', stamp, x, 0.0))
        running.send('/footprint', box(0), stamp, 'base')
        running.send_set('/obstacles', box(4.5 - x), stamp=stamp, frame_id='camera')
        running.spin(0.02)

    def until(state, x):
        running.until(lambda: drive(x) or running.state() == state, state)

    until('clear', 0.0)
    until('collision', 4.5)
    until('clear', 6.5)


def test_what_was_latched_before_the_start_is_known(domain, start_with_tf):
    """A robot description is told once."""
    before = Peer(domain)
    publisher = before.node.create_publisher(PolygonStamped, '/tf_static', LATCHED)
    publisher.publish(transforms(('odom', 'camera', 0, 0.5, 0.0)))
    running = start_with_tf()
    listener = running.monitor._monitor.transforms
    running.until(lambda: listener.received['/tf_static'], 'the latched transform')
    before.close()


def test_messages_wait_for_the_transform_at_their_stamp(start_with_tf):
    """The obstacle counts as where it was before until that comes, and nothing is refused."""
    running = start_with_tf(transform_timeout=9.0, footprint__timeout=0.0, obstacle__timeout=60.0)
    tell(running, ('odom', 'base', running.now(), 0.0, 0.0))
    running.send('/footprint', box(0), frame_id='odom')
    running.send_set_until('collision', '/obstacles', box(0.5), frame_id='odom')
    received = running.received['obstacle']
    stamp = running.now()
    running.send_set('/obstacles', box(0.5), stamp=stamp, frame_id='base')
    running.until(lambda: running.received['obstacle'] == received + 2)
    count = len(running.states())
    running.until(lambda: len(running.states()) > count + 2)
    assert running.state() == 'collision'
    tell(running, ('odom', 'base', stamp, 9.0, 0.0))
    running.await_state('clear')
    assert not running.monitor._monitor.rejected


def test_what_never_comes_is_logged(start_with_tf):
    running = start_with_tf()
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    line, = running.logged('no good transform has named base yet')[:1]
    assert line.startswith('footprint: a message on /footprint was rejected, unknown frame: ')


def test_bad_transforms_are_logged_with_their_frame(start_with_tf):
    running = start_with_tf()
    tell(running, ('odom', 'base', running.now(), float('nan'), 0.0))
    assert running.logged("the transform of 'base' in 'odom' by an unknown publisher")


def test_without_tf2_msgs_that_is_said_once(start, monkeypatch):
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    running = start(frame_id='odom')
    assert len(running.logged('tf2_msgs is not installed (apt install ros-jazzy-tf2-msgs')) == 1
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    assert running.logged('other frame')


def test_without_a_fixed_frame_nothing_is_listened_to(start_with_tf, start):
    running = start()
    assert not [one for one in running.monitor.subscriptions if one.topic_name.startswith('/tf')]


def test_where_tf_comes_from_can_be_chosen(start, start_with_tf):
    running = start(arguments=['-r', '/tf:=tf', '-r', '__ns:=/robot1'], frame_id='odom')
    topics = {one.topic_name for one in running.monitor.subscriptions}
    assert {'/robot1/tf', '/tf_static'} <= topics

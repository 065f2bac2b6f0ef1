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

"""Outlines over DDS: moved by the bytes of TFMessages, and by real odometry."""

import sys

from builders import box, odometry, transforms
from geometry_msgs.msg import PolygonStamped
from harness import health, Peer, values
from nav_msgs.msg import Odometry
import rclpy.serialization
from sat_collision.messages.transforms import decode_odometry

SQUARE = '[[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]'
OUTLINE = {'footprint__points': SQUARE, 'footprint__frame_id': 'base'}


def drive(running, x, child='base', peer=None):
    """Tell where a robot is, and that its laser sees nothing near."""
    (peer or running).publisher('/tf', PolygonStamped).publish(
        transforms(('odom', child, running.now(), x, 0.0)))
    running.send_set('/obstacles', box(9.0), frame_id='odom')
    running.spin(0.02)


def until(running, state, x):
    running.until(lambda: drive(running, x) or running.state() == state, state)


def test_an_outline_is_moved_by_tf(start_with_tf):
    running = start_with_tf(**OUTLINE)
    until(running, 'clear', 0.0)
    until(running, 'collision', 9.5)
    until(running, 'clear', 8.0)
    shown = values(running.status())
    assert shown['frame'] == 'base' and 0.0 <= float(shown['age of transform']) < 60.0
    assert running.set_parameters(footprint__points='[[1.5, 0.5], [-0.5, 0.5], [-0.5, -0.5]]') == [
        None]
    until(running, 'collision', 8.0)
    reason, = running.set_parameters(footprint__points=[1.0, 2.0, 3.0])
    assert reason == 'footprint.points has 3 numbers, but each point has two'


def test_an_outline_is_moved_by_odometry(start, monkeypatch):
    """Where there is no tf2_msgs, for what the robot sees as well."""
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    running = start(frame_id='odom', footprint__odometry='odom', **OUTLINE)

    def report(x):
        data = odometry('odom', 'base', running.now(), x, 0.0)
        message = rclpy.serialization.deserialize_message(data, Odometry)
        # But for bytes that only fill up, which may be any.
        assert decode_odometry(rclpy.serialization.serialize_message(message)) == (
            decode_odometry(data))
        running.publisher('/odom', Odometry).publish(message)
        running.send_set('/obstacles', box(9.0 - x), frame_id='base')
        running.spin(0.02)

    for x, state in ((0.0, 'clear'), (9.0, 'collision'), (7.0, 'clear')):
        running.until(lambda: report(x) or running.state() == state, state)


def test_without_tf2_msgs_an_outline_by_tf_is_told_of(start, monkeypatch):
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    running = start(frame_id='odom', **OUTLINE)
    assert running.logged('tf2_msgs is not installed', 'it is not known where footprint is')


def test_two_publishers_of_a_frame_are_named(domain, start_with_tf):
    """With the nodes that publish /tf; a frame that one publishes alone is not."""
    running = start_with_tf(**OUTLINE)
    other = Peer(domain)
    second = other.node.create_publisher(PolygonStamped, '/tf', 100)
    running.until(lambda: second.get_subscription_count(), 'a subscription')

    def both():
        drive(running, 0.0)
        second.publish(transforms(('odom', 'base', running.now(), 0.0, 0.0),
                                  ('odom', 'arm', running.now(), 0.0, 0.0)))
        return 'transforms of base: publishers took turns' in health(running)
    running.until(both, 'two publishers')
    assert 'transforms of arm: publishers took turns' not in health(running)
    assert float(health(running)['transforms: rate [Hz]']) > 1.0
    assert 'of /peer, tells of base' in running.health().message.replace('/peer, /peer', '/peer')
    other.close()

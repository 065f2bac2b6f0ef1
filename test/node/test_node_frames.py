# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Frames over DDS; another type stands in for tf2_msgs, since only bytes are sent."""

import time

from builders import box, odometry, transforms
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from harness import health
from moving_scenes import FIXED, MovingScene, OUTLINE, WINDOW, WINDOWS
from nav_msgs.msg import Odometry
import oracle
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
import rclpy.serialization
from sat_collision.messages.cdr import decode_odometry
from std_msgs.msg import Bool

LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


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


def test_outline_follows_odometry(start, without_tf2_msgs):
    """Obstacles in the robot's frame are placed by it, too."""
    running = start(frame_id='odom', footprint__odometry='odom', **SQUARE_OF_BASE)

    def send(x):
        data = odometry('odom', 'base', running.now(), x, 0.0)
        message = rclpy.serialization.deserialize_message(data, Odometry)
        # Padding bytes may differ.
        assert decode_odometry(rclpy.serialization.serialize_message(message)) == (
            decode_odometry(data))
        running.publisher('/odom', Odometry).publish(message)
        running.send_set('/obstacles', box(9.0 - x), frame_id='base')

    for x, state in ((0.0, 'clear'), (9.0, 'collision'), (7.0, 'clear')):
        running.repeat_until(state, lambda: send(x))


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


PARAMETERS = {
    'footprints': ['robot', 'cart'], 'obstacles': ['seen'], 'robot__topic': '/footprint',
    'robot__timeout': 0.0, 'cart__timeout': 0.0, 'cart__frame_id': 'base',
    'cart__points': [number for corner in OUTLINE for number in (corner.real, corner.imag)],
    'cart__rate': 1000.0, 'seen__topic': '/obstacles', 'seen__type': 'polygon_instance',
    'seen__timeout': 60.0, 'transform_timeout': 9.0, 'future_tolerance': 60.0}


@pytest.mark.parametrize('seed', (0, 7))
def test_contacts_match_the_true_poses(start_with_tf, seed):
    """In whatever order messages arrive; by the end of each window all have."""
    running = start_with_tf(**PARAMETERS)
    publishers = {topic: running.publisher(topic, kind, qos) for topic, kind, qos in (
        ('/tf', PolygonStamped, 100), ('/tf_static', PolygonStamped, LATCHED),
        ('/footprint', PolygonStamped, 100), ('/obstacles', PolygonInstanceStamped, 100))}
    running.listen('~/state')
    scene = MovingScene(seed, running.now())
    events = list(reversed(scene.moving))
    began = time.monotonic()
    for window in range(WINDOWS):
        end = (window + 1) * WINDOW
        while events and events[-1].time <= end:
            event = events.pop()
            running.spin(began + event.time - time.monotonic())
            publishers[event.topic].publish(event.data)
        rings = {name: [(corner.real, corner.imag) for corner in ring] for name, ring in {
            **scene.truth[window], 'cart': scene.outline(end)}.items()}
        true = {name: {f'seen/{key}' for key in rings.keys() - {'robot', 'cart'}
                       if oracle.intersects(rings[name], rings[key])}
                for name in ('robot', 'cart')}
        running.until(lambda: all(set(running.contacts(name)) == true[name] for name in true),
                      f'the contacts of window {window}: {true}')
    assert not running.monitor._monitor.rejected
    assert FIXED == running.monitor._scene.frame_id


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

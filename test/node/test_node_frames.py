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
from harness import health, Peer, values
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


def latch(running, *links):
    running.publisher('/tf_static', PolygonStamped, LATCHED).publish(transforms(*links))


def test_bodies_are_placed_by_tf(start_with_tf):
    """The robot drives into an obstacle that its camera sees at rest."""
    running = start_with_tf()
    latch(running, ('base', 'camera', 0, 0.5, 0.0))

    def drive(x):
        stamp = running.now()
        send_transforms(running, ('odom', 'base', stamp, x, 0.0))
        running.send('/footprint', box(0), stamp, 'base')
        running.send_set('/obstacles', box(4.5 - x), stamp=stamp, frame_id='camera')
        running.spin(0.02)

    def until(state, x):
        running.until(lambda: drive(x) or running.state() == state, state)

    until('clear', 0.0)
    until('collision', 4.5)
    until('clear', 6.5)


def test_static_transform_sent_before_the_start_is_received(domain, start_with_tf):
    before = Peer(domain)
    publisher = before.node.create_publisher(PolygonStamped, '/tf_static', LATCHED)
    publisher.publish(transforms(('odom', 'camera', 0, 0.5, 0.0)))
    running = start_with_tf()
    listener = running.monitor._monitor.transforms
    running.until(lambda: listener.received['/tf_static'], 'the latched transform')
    before.close()


def test_message_waits_for_its_transform(start_with_tf):
    """Until then the obstacle stays where it was, and nothing is refused."""
    running = start_with_tf(transform_timeout=9.0, footprint__timeout=0.0, obstacle__timeout=60.0)
    send_transforms(running, ('odom', 'base', running.now(), 0.0, 0.0))
    running.send('/footprint', box(0), frame_id='odom')
    running.send_set_until('collision', '/obstacles', box(0.5), frame_id='odom')
    received = running.received['obstacle']
    stamp = running.now()
    running.send_set('/obstacles', box(0.5), stamp=stamp, frame_id='base')
    running.until(lambda: running.received['obstacle'] == received + 2)
    count = len(running.states())
    running.until(lambda: len(running.states()) > count + 2)
    assert running.state() == 'collision'
    send_transforms(running, ('odom', 'base', stamp, 9.0, 0.0))
    running.await_state('clear')
    assert not running.monitor._monitor.rejected


def test_missing_transform_is_logged(start_with_tf):
    running = start_with_tf()
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    line, = running.logged('no transform from base to odom: no good transform has come yet')[:1]
    assert line.startswith('footprint: a message on /footprint was rejected, unknown frame: ')


def test_invalid_transform_is_logged(start_with_tf):
    running = start_with_tf()
    send_transforms(running, ('odom', 'base', running.now(), float('nan'), 0.0))
    assert running.logged("the transform of 'base' in 'odom' by an unknown publisher")


def test_missing_tf2_msgs_is_logged_once(start, without_tf2_msgs):
    running = start(frame_id='odom')
    assert len(running.logged('tf2_msgs is not installed (apt install ros-jazzy-tf2-msgs')) == 1
    running.send_until('unknown', '/footprint', box(0), frame_id='base')
    assert running.logged('other frame')


def test_no_transforms_are_subscribed_to_without_a_fixed_frame(start_with_tf, start):
    running = start()
    assert not [one for one in running.monitor.subscriptions if one.topic_name.startswith('/tf')]


def test_tf_can_be_remapped(start, start_with_tf):
    running = start(arguments=['-r', '/tf:=tf', '-r', '__ns:=/robot1'], frame_id='odom')
    topics = {one.topic_name for one in running.monitor.subscriptions}
    assert {'/robot1/tf', '/tf_static'} <= topics


SQUARE = '[[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]]'
SQUARE_OF_BASE = {'footprint__points': SQUARE, 'footprint__frame_id': 'base'}


def drive(running, x, child='base', peer=None):
    """Send the robot's transform, and an obstacle that is far away."""
    (peer or running).publisher('/tf', PolygonStamped).publish(
        transforms(('odom', child, running.now(), x, 0.0)))
    running.send_set('/obstacles', box(9.0), frame_id='odom')
    running.spin(0.02)


def until(running, state, x):
    running.until(lambda: drive(running, x) or running.state() == state, state)


def test_outline_follows_tf(start_with_tf):
    running = start_with_tf(**SQUARE_OF_BASE)
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


def test_outline_follows_odometry(start, without_tf2_msgs):
    """Obstacles in the robot's frame are placed by it, too."""
    running = start(frame_id='odom', footprint__odometry='odom', **SQUARE_OF_BASE)

    def report(x):
        data = odometry('odom', 'base', running.now(), x, 0.0)
        message = rclpy.serialization.deserialize_message(data, Odometry)
        # Padding bytes may differ.
        assert decode_odometry(rclpy.serialization.serialize_message(message)) == (
            decode_odometry(data))
        running.publisher('/odom', Odometry).publish(message)
        running.send_set('/obstacles', box(9.0 - x), frame_id='base')
        running.spin(0.02)

    for x, state in ((0.0, 'clear'), (9.0, 'collision'), (7.0, 'clear')):
        running.until(lambda: report(x) or running.state() == state, state)


def test_outline_without_tf2_msgs_is_logged(start, without_tf2_msgs):
    running = start(frame_id='odom', **SQUARE_OF_BASE)
    assert running.logged('tf2_msgs is not installed', 'it is not known where footprint is')


def test_two_publishers_of_a_frame_are_named(domain, start_with_tf):
    """With their nodes; a frame that only one publishes is not named."""
    running = start_with_tf(**SQUARE_OF_BASE)
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
    assert 'of /peer, sends base' in running.health().message.replace('/peer, /peer', '/peer')
    other.close()


KINDS = {'/obstacles': PolygonInstanceStamped}


def parameters():
    return {'footprints': ['robot', 'cart'], 'obstacles': ['seen'], 'robot__topic': '/footprint',
            'robot__timeout': 0.0, 'cart__timeout': 0.0, 'cart__frame_id': 'base',
            'cart__points': [number for corner in OUTLINE
                             for number in (corner.real, corner.imag)],
            'cart__rate': 1000.0, 'seen__topic': '/obstacles', 'seen__type': 'polygon_instance',
            'seen__timeout': 60.0, 'transform_timeout': 9.0, 'future_tolerance': 60.0}


@pytest.mark.parametrize('seed', (0, 7))
def test_contacts_match_the_true_poses(start_with_tf, seed):
    """In whatever order messages arrive; by the end of each window all have."""
    running = start_with_tf(**parameters())
    publishers = {topic: running.publisher(topic, KINDS.get(topic, PolygonStamped), qos)
                  for topic, qos in (('/tf', 100), ('/tf_static', LATCHED), ('/footprint', 100),
                                     ('/obstacles', 100))}
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


def test_start_without_transforms_logs_what_to_do(start_with_tf):
    running = start_with_tf(footprint__radius=0.5, footprint__frame_id='base',
                            arguments=('-r', '/tf:=/robot/tf'))
    assert running.logged('unknown since the start: ', ' /robot/tf has no publisher: start what')


def test_publisher_of_a_remapped_tf_is_found(start_with_tf):
    running = start_with_tf(footprint__radius=0.5, footprint__frame_id='base',
                            arguments=('-r', '/tf:=/robot/tf'))
    running.until(lambda: '/robot/tf has no publisher' in running.reason())
    running.publisher('/robot/tf', PolygonStamped)
    running.until(lambda: '/robot/tf has no publisher' not in running.reason(), timeout=5.0)


def test_start_with_transforms_of_other_frames_logs_what_to_do(start_with_tf):
    running = start_with_tf(footprint__radius=0.5, footprint__frame_id='base')
    send_transforms(running, ('odom', 'other', running.now(), 0.0, 0.0))
    assert running.logged('footprint: a message on /tf was rejected, unknown frame: ',
                          'only odom, other; correct the frame_id, or publish its transform on')


def test_lack_of_transforms_says_what_is_lacking(start_with_tf, join):
    """Nothing published, another type, a QoS that does not fit; and a frame nobody tells of."""
    running = start_with_tf(footprint__radius=0.5, footprint__frame_id='base')
    peer = join('localisation')

    def until_said(*words, of=running.reason):
        running.until(lambda: all(word in of() for word in words), words)
    until_said('has not been received yet', '/tf has no publisher')
    best_effort = QoSProfile(depth=9, reliability=ReliabilityPolicy.BEST_EFFORT)
    for kind, topic, qos, words in (
            (Bool, '/tf', 9, 'of another type, std_msgs/msg/Bool, where '),
            (PolygonStamped, '/tf', best_effort, 'it is best effort, the subscription reliable'),
            (PolygonStamped, '/tf_static', 9, 'it is volatile, the subscription transient local')):
        publisher = peer.node.create_publisher(kind, topic, qos)
        words = f'{topic} has a publisher, /localisation, ', words
        until_said(*words)
        until_said(*words, of=lambda: running.health() and running.health().message or '')
        peer.node.destroy_publisher(publisher)
    send_transforms(running, ('odom', 'other', running.now(), 0.0, 0.0))
    until_said('no good transform has named base yet, only odom, other')

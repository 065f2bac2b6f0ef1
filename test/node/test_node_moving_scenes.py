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

"""Random scenes in random moving frames over DDS: the contacts of their true places."""

import time

from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
from moving_scenes import FIXED, MovingScene, OUTLINE, WINDOW, WINDOWS
import oracle
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

KINDS = {'/obstacles': PolygonInstanceStamped}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def parameters():
    return {'footprints': ['robot', 'cart'], 'obstacles': ['seen'], 'robot__topic': '/footprint',
            'robot__timeout': 0.0, 'cart__timeout': 0.0, 'cart__frame_id': 'base',
            'cart__points': [number for corner in OUTLINE
                             for number in (corner.real, corner.imag)],
            'cart__rate': 1000.0, 'seen__topic': '/obstacles', 'seen__type': 'polygon_instance',
            'seen__timeout': 0.0, 'transform_timeout': 9.0, 'future_tolerance': 60.0}


@pytest.mark.parametrize('seed', (0, 7))
def test_contacts_are_those_of_the_true_places(start_with_tf, seed):
    """Whatever the order in which all is taken; at the end of each window all has come."""
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

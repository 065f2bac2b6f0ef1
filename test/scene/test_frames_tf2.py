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

"""The same look-ups as the real tf2 has answered, in every case where it is not too trusting."""

import numpy as np
from published import load
import pytest
from sat_collision.scene import frames
from sat_collision.scene.frames import Frames, NoTransform

CASES = load('tf2_lookups')
ERRORS = {
    'ExtrapolationException': {frames.NO_TRANSFORM},
    'LookupException': {frames.UNKNOWN_FRAME},
    'InvalidArgumentException': {frames.BAD_FRAME_ID},
    'ConnectivityException': {frames.NOT_CONNECTED},
}
# Infinitely far away: tf2 takes it.
NOT_TAKEN = {('refused', 'i')}
START = 1_700_000_000_000_000_000


def transform_of(event):
    return tuple(map(float, (*event['xyz'], *event['quaternion'])))


def look_up(buffer, target, source, stamp):
    return buffer.lookup(target, source, stamp) if stamp else buffer.newest(target, source)


def assert_same(found, translation, quaternion):
    """Compare with what tf2 found; a quaternion and its opposite are one rotation."""
    *place, x, y, z, w = found.transform
    np.testing.assert_allclose(place, translation, rtol=0, atol=1e-9)
    sign = 1 if np.dot((x, y, z, w), quaternion) > 0 else -1
    np.testing.assert_allclose((x, y, z, w), np.multiply(sign, quaternion), rtol=0, atol=1e-9)


@pytest.mark.parametrize('case', CASES, ids=lambda case: case['name'].replace(' ', '_'))
def test_recorded_answers(case):
    buffer = Frames(round(case['cache_time'] * 1e9))
    for event in case['events']:
        if event['do'] == 'set':
            buffer.insert(event['parent'], event['child'], event['stamp'], transform_of(event),
                          event['static'])
            continue
        target, source, stamp = event['target'], event['source'], event['stamp']
        found = look_up(buffer, target, source, stamp)
        if (case['name'], source) in NOT_TAKEN:
            assert found.reason == frames.UNKNOWN_FRAME
        elif 'error' in event:
            assert found.reason in ERRORS[event['error']], event
        else:
            assert not isinstance(found, NoTransform), found
            assert_same(found, event['xyz'], event['quaternion'])
            assert source == target or (found.at or 0) == event['at']


def test_all_recorded_answers_are_there():
    lookups = [event for case in CASES for event in case['events'] if event['do'] == 'lookup']
    assert len(CASES) == 23 and len(lookups) == 975


@pytest.mark.parametrize('seed', range(20))
def test_random_trees_beside_tf2(seed):
    """With jumps, late transforms, changes of parent and static frames in between."""
    tf2 = pytest.importorskip('tf2_py')
    from geometry_msgs.msg import TransformStamped
    from rclpy.duration import Duration
    from rclpy.time import Time
    rng = np.random.default_rng(seed)
    theirs = tf2.BufferCore(Duration(seconds=3))
    ours = Frames(3 * 10**9)
    names = [f'f{k}' for k in range(6)]
    static = rng.random(6) < 0.2
    answered = refused = 0
    for step in range(400):
        stamp = START + 25_000_000 * step
        child = int(rng.integers(1, 6))
        parent = child - 1 if rng.random() < 0.95 else int(rng.integers(child))
        sent = stamp - int(rng.integers(10**9)) if rng.random() < 0.1 else stamp
        message = TransformStamped()
        message.header.frame_id, message.child_frame_id = names[parent], names[child]
        message.header.stamp = Time(nanoseconds=sent).to_msg()
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        values = (*rng.normal(size=3).tolist(), *quaternion.tolist())
        translation, rotation = message.transform.translation, message.transform.rotation
        translation.x, translation.y, translation.z = values[:3]
        rotation.x, rotation.y, rotation.z, rotation.w = values[3:]
        put = theirs.set_transform_static if static[child] else theirs.set_transform
        put(message, 'test')
        ours.insert(names[parent], names[child], sent, values, bool(static[child]))
        source, target = rng.choice(names, 2, replace=False).tolist()
        asked = 0 if rng.random() < 0.2 else stamp - int(rng.integers(4 * 10**9))
        found = look_up(ours, target, source, asked)
        try:
            wanted = theirs.lookup_transform_core(target, source, Time(nanoseconds=asked))
        except tf2.TransformException as error:
            assert isinstance(found, NoTransform), error
            refused += 1
            continue
        assert not isinstance(found, NoTransform), found
        translation, rotation = wanted.transform.translation, wanted.transform.rotation
        assert_same(found, (translation.x, translation.y, translation.z),
                    (rotation.x, rotation.y, rotation.z, rotation.w))
        answered += 1
    assert answered > 30 and refused > 30

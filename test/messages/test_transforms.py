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

"""The bytes of a TFMessage against rosbags' own encoder and decoder."""

import struct
import subprocess
import sys

import numpy as np
import pytest
from rosbags.typesys import get_typestore, Stores
from sat_collision.messages.cdr import MessageError
from sat_collision.messages.transform_listener import decode_transforms

STORE = get_typestore(Stores.ROS2_JAZZY)
KIND = 'tf2_msgs/msg/TFMessage'
SECOND = 10**9
NAMES = ('a', 'map', 'odom', 'größe', 'base_footprint')


def message(*links):
    """Build a TFMessage of (parent, child, stamp, seven numbers)."""
    types = STORE.types
    stamped = []
    for parent, child, stamp, (x, y, z, *rotation) in links:
        time = types['builtin_interfaces/msg/Time'](*divmod(stamp, SECOND))
        stamped.append(types['geometry_msgs/msg/TransformStamped'](
            types['std_msgs/msg/Header'](time, parent), child,
            types['geometry_msgs/msg/Transform'](
                types['geometry_msgs/msg/Vector3'](x, y, z),
                types['geometry_msgs/msg/Quaternion'](*rotation))))
    return types[KIND](stamped)


def written(*links, little_endian=True):
    """Return the bytes of a TFMessage, as rosbags writes them."""
    return bytes(STORE.serialize_cdr(message(*links), KIND, little_endian=little_endian))


def some_links(seed, count):
    rng = np.random.default_rng(seed)
    return [(*rng.choice(NAMES, 2).tolist(), int(rng.integers(-2**31, 2**31)) * SECOND
             + int(rng.integers(SECOND)), tuple(rng.normal(size=7).tolist()))
            for _ in range(count)]


def read_by_rosbags(data):
    found = STORE.deserialize_cdr(data, KIND)
    return [(one.header.frame_id, one.child_frame_id,
             one.header.stamp.sec * SECOND + one.header.stamp.nanosec,
             (*(getattr(one.transform.translation, name) for name in 'xyz'),
              *(getattr(one.transform.rotation, name) for name in 'xyzw')))
            for one in found.transforms]


@pytest.mark.parametrize('count', range(6))
@pytest.mark.parametrize('little_endian', (True, False))
def test_messages_are_read_as_they_were_written(count, little_endian):
    for seed in range(20):
        links = some_links(seed, count)
        assert decode_transforms(written(*links, little_endian=little_endian)) == links


@pytest.mark.parametrize('parent', range(1, 10))
@pytest.mark.parametrize('child', range(1, 10))
def test_every_alignment(parent, child):
    """The lengths of the names move the numbers, and those the next transform."""
    link = 'abcdefghij'[:parent], 'abcdefghij'[:child], -1, (1.0, 2.0, 3.0, 0.0, 0.0, 0.6, 0.8)
    assert decode_transforms(written(link, link)) == [link, link]


def test_numbers_that_are_none_are_read_too():
    """Whether they make a transform is asked later, for each one."""
    link = 'map', 'odom', 0, (np.nan, np.inf, -np.inf, 0.0, -0.0, 1e308, 5e-324)
    (_, _, _, numbers), = decode_transforms(written(link))
    np.testing.assert_array_equal(numbers, link[-1])


def test_every_truncation_is_refused():
    data = written(*some_links(1, 3))
    for size in range(len(data)):
        with pytest.raises(MessageError):
            decode_transforms(data[:size])


@pytest.mark.parametrize('size', (1, 3, 4, 8, 64))
def test_left_over_bytes_are_refused(size):
    with pytest.raises(MessageError, match='bytes where the contents need'):
        decode_transforms(written(*some_links(1, 3)) + bytes(size))


@pytest.mark.parametrize('count', (2, 4, 2**31, 2**32 - 1))
def test_a_false_count_is_refused(count):
    """At once, however many it says there are."""
    data = bytearray(written(*some_links(1, 3)))
    struct.pack_into('<I', data, 4, count)
    with pytest.raises(MessageError):
        decode_transforms(bytes(data))


@pytest.mark.parametrize('length', (0, 1, 3, 5, 2**31, 2**32 - 1))
def test_a_false_length_of_a_name_is_refused(length):
    data = bytearray(written(('map', 'odom', 0, (0.0,) * 6 + (1.0,))))
    struct.pack_into('<I', data, 16, length)
    with pytest.raises(MessageError):
        decode_transforms(bytes(data))


@pytest.mark.parametrize('text, words', [(b'm\xffp\0', 'not UTF-8'), (b'm\0p\0', 'does not end'),
                                         (b'mapx', 'does not end')])
def test_broken_names_are_refused(text, words):
    data = written(('map', 'odom', 0, (0.0,) * 6 + (1.0,)))
    with pytest.raises(MessageError, match=words):
        decode_transforms(data.replace(b'map\0', text))


def test_nanoseconds_beyond_a_second_are_refused():
    data = bytearray(written(('map', 'odom', 0, (0.0,) * 6 + (1.0,))))
    struct.pack_into('<I', data, 12, SECOND)
    with pytest.raises(MessageError, match='more than a second'):
        decode_transforms(bytes(data))


@pytest.mark.parametrize('data', (b'', b'\0\1\0\0', b'\0\1\0\0\0\0\0', b'\0\3\0\0\0\0\0\0',
                                  b'no CDR at all'))
def test_foreign_bytes_are_refused(data):
    with pytest.raises(MessageError, match='not a message'):
        decode_transforms(data)


def test_damaged_bytes_never_read_as_something_else():
    """Where a damaged message is accepted, rosbags reads the same from it."""
    random = np.random.default_rng(5)
    data = written(*some_links(2, 3))
    accepted = 0
    for _ in range(5000):
        damaged = bytearray(data)
        for at in random.integers(len(data), size=random.integers(1, 4)):
            damaged[at] = random.integers(256)
        damaged = bytes(damaged)
        try:
            found = decode_transforms(damaged)
        except MessageError:
            continue
        accepted += 1
        np.testing.assert_equal([tuple(one) for one in found], read_by_rosbags(damaged))
    assert 1000 < accepted < 4900


def test_random_bytes_are_never_more_than_refused():
    random = np.random.default_rng(6)
    for _ in range(5000):
        size = int(random.integers(200))
        data = b'\0\1\0\0' + bytes(random.integers(0, random.choice([2, 8, 256]), size, np.uint8))
        try:
            decode_transforms(data)
        except MessageError:
            pass


def test_it_needs_neither_ros_nor_rosbags():
    data = written(*some_links(3, 2))
    program = ('import sys; '
               'from sat_collision.messages.transform_listener import decode_transforms; '
               f'assert len(decode_transforms({data!r})) == 2; '
               'assert not {"rclpy", "geometry_msgs", "rosbags"} & set(sys.modules)')
    subprocess.run([sys.executable, '-c', program], check=True)

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

"""Bytes as they come from the wire against rclpy's own encoder and decoder."""

import struct
import subprocess
import sys

from builders import polygon_message, SECOND, serialised
from geometry_msgs.msg import PolygonInstanceStamped, PolygonStamped
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
import sat_collision.messages
from sat_collision.messages.cdr import decode, header_stamp, MessageError

TYPES = {False: PolygonStamped, True: PolygonInstanceStamped}
POINTS = ((1, 2, 3), (-4, 0.1, 0), (1e30, -0.0, 5))
STAMP = 7 * SECOND + 8
ID = -9


def sent(instance=False, frame_id='map'):
    """Return what rclpy sends."""
    return serialize_message(polygon_message(POINTS, STAMP, frame_id, ID if instance else None))


def sent_with_nanoseconds(nanoseconds, seconds=7):
    """Return what rclpy sends with so many nanoseconds in the stamp."""
    message = polygon_message(POINTS, seconds * SECOND)
    message.header.stamp.nanosec = nanoseconds
    return serialize_message(message)


def fields(message, instance):
    """Return a message's fields in the order of `decode`, points as tuples."""
    polygon = message.polygon.polygon if instance else message.polygon
    return (message.header.stamp.sec * SECOND + message.header.stamp.nanosec,
            message.header.frame_id, [(p.x, p.y, p.z) for p in polygon.points],
            message.polygon.id if instance else None)


def decoded(data, instance):
    """Return what `decode` does, points as tuples."""
    stamp, frame_id, (points, start, count), identity = decode(data, instance)
    return (stamp, frame_id, list(struct.iter_unpack('=fff', points[start:start + 12 * count])),
            identity)


@pytest.mark.parametrize('instance', (None, ID))
@pytest.mark.parametrize('length', range(10))
@pytest.mark.parametrize('count', range(4))
def test_every_alignment_reads_as_rclpy_wrote_it(instance, length, count):
    """The frame_id's length moves the points and, with their number, the id's padding."""
    frame_id = 'frame_name'[:length]
    points = [(k, 0.5 * k, -k) for k in range(count)]
    message = polygon_message(points, STAMP, frame_id, instance)
    data = serialize_message(message)
    assert decoded(data, instance is not None) == (STAMP, frame_id, points, instance)
    written = serialised(points, STAMP, frame_id, instance)
    assert len(written) == len(data) and deserialize_message(written, type(message)) == message


@pytest.mark.parametrize('instance', (None, 2**63 - 1))
def test_extreme_fields_survive(instance):
    """Time before 1970, the largest id, a frame name that is not ASCII, NaN and infinity."""
    original = polygon_message([(np.inf, -np.inf, np.nan)], -1, 'größe', instance)
    stamp, frame_id, points, identity = decoded(serialize_message(original), instance is not None)
    assert (stamp, frame_id, identity) == (-1, 'größe', instance)
    np.testing.assert_array_equal(points, [(np.inf, -np.inf, np.nan)])


@pytest.mark.parametrize('instance', (False, True))
def test_every_truncation_is_refused(instance):
    """No prefix of a message is a message."""
    data = sent(instance)
    for size in range(len(data)):
        with pytest.raises(MessageError):
            decode(data[:size], instance)


@pytest.mark.parametrize('instance', (False, True))
def test_left_over_bytes_are_refused(instance):
    """Bytes behind the end: perhaps another type's message, certainly not this one."""
    data = sent(instance)
    for size in (1, 3, 4, 8, 12):
        with pytest.raises(MessageError, match='bytes where the contents need'):
            decode(data + bytes(size), instance)


@pytest.mark.parametrize('count', (2, 4, 200_000_000, 2**32 - 1))
@pytest.mark.parametrize('instance', (False, True))
def test_false_point_count_is_refused(instance, count):
    """Where rclpy reads no points at all, which on an obstacle topic means 'nothing there'."""
    data = bytearray(sent(instance))
    struct.pack_into('<I', data, 20, count)
    with pytest.raises(MessageError):
        decode(bytes(data), instance)


@pytest.mark.parametrize('text', (b'mapx', b'm\xffp\0'), ids=('no NUL', 'not UTF-8'))
def test_broken_frame_id_is_refused(text):
    """What is no string is not taken for one."""
    data = sent()
    with pytest.raises(MessageError):
        decode(data[:16] + text + data[20:], False)


def test_frame_id_ends_at_its_first_nul():
    """So it does for every typed subscriber."""
    data = sent()
    _, frame_id, _, _ = decode(data[:16] + b'm\0p\0' + data[20:], False)
    assert frame_id == 'm'


def test_broken_frame_id_of_same_encoded_size_is_refused():
    """Where rclpy replaces a byte by three, the length alone could not tell."""
    data = sent(frame_id='abcd')
    with pytest.raises(MessageError, match='UTF-8'):
        decode(data[:16] + b'abc\xff\0' + data[21:], False)


@pytest.mark.parametrize('length', (0, 2**31, 2**32 - 1))
def test_false_text_length_is_refused(length):
    """A length that leaves the message, or that leaves no room for the NUL."""
    data = bytearray(sent())
    struct.pack_into('<I', data, 12, length)
    with pytest.raises(MessageError):
        decode(bytes(data), False)


def test_nanoseconds_beyond_a_second_are_refused():
    """Such a stamp is no time."""
    with pytest.raises(MessageError, match='nanoseconds'):
        decode(sent_with_nanoseconds(SECOND), False)


@pytest.mark.parametrize('identity', (None, -5))
def test_big_endian_goes_through_rclpy(identity):
    """The other byte order is legal, if rare."""
    points = [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
    data = serialised(points, STAMP, 'odom', identity, order='>')
    assert decoded(data, identity is not None) == (STAMP, 'odom', points, identity)


@pytest.mark.parametrize('data', (b'', b'\0', b'\xff\xff\0\0', b'\0\1\0\0', b'no CDR at all'))
def test_foreign_bytes_are_refused(data):
    """Whatever arrives on the topic, the answer is one kind of error."""
    for instance in TYPES:
        with pytest.raises(MessageError):
            decode(data, instance)


@pytest.mark.parametrize('instance', (False, True))
def test_damaged_bytes_never_read_as_something_else(instance):
    """Where a damaged message is accepted, rclpy reads the same from it."""
    random = np.random.default_rng(5)
    data = sent(instance)
    accepted = 0
    for _ in range(3000):
        damaged = bytearray(data)
        for at in random.integers(len(data), size=random.integers(1, 4)):
            damaged[at] = random.integers(256)
        damaged = bytes(damaged)
        try:
            received = decoded(damaged, instance)
        except MessageError:
            continue
        accepted += 1
        wanted = fields(deserialize_message(damaged, TYPES[instance]), instance)
        np.testing.assert_equal(received, wanted)
    assert accepted > 300


def test_foreign_encoding_without_any_library_is_refused(monkeypatch):
    """The geometry is used without ROS and rosbags too: it says so rather than fail."""
    monkeypatch.setitem(sys.modules, 'sat_collision.messages.interfaces', None)
    monkeypatch.delattr(sat_collision.messages, 'interfaces', raising=False)
    with pytest.raises(MessageError, match='only rclpy or rosbags'):
        decode(serialised([], order='>'), False)


@pytest.mark.parametrize('sec, nanosec', [(7, 8), (-1, 999_999_999), (0, 0), (5, SECOND)])
def test_stamp_alone_is_that_of_the_message(sec, nanosec):
    """What sorts messages by their stamps reads no more; a senseless one counts as none."""
    data = sent_with_nanoseconds(nanosec, sec)
    assert header_stamp(data) == (sec * SECOND + nanosec if nanosec < SECOND else 0)
    assert header_stamp(data[:11]) == header_stamp(serialised([], order='>')) == 0


def test_plain_message_needs_no_ros():
    """Decoding in place imports no ROS package."""
    data = sent(instance=True)
    program = ('import sys; from sat_collision.messages.cdr import decode; '
               f'assert decode({data!r}, True)[-1] == -9; '
               'assert not {"rclpy", "geometry_msgs"} & set(sys.modules)')
    subprocess.run([sys.executable, '-c', program], check=True)


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize('at, count', [(12, 2**32 - 1), (12, 60), (20, 2**32 - 1), (20, 4)])
def test_rclpy_never_sees_a_length_beyond_the_end(monkeypatch, order, at, count):
    """It would write a line to the standard error for each."""
    monkeypatch.setattr('sat_collision.messages.interfaces.deserialize',
                        lambda data, kind: pytest.fail('rclpy has been asked'))
    data = bytearray(serialised(POINTS, STAMP, 'map', order=order))
    struct.pack_into(order + 'I', data, at, count)
    with pytest.raises(MessageError, match=str(count)):
        decode(bytes(data), False)

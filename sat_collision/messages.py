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

"""
Serialised geometry_msgs/PolygonStamped and PolygonInstanceStamped to plain data.

A message that every publisher on this kind of machine sends (CDR, little endian) is read in place,
with every length checked. Whatever does not fit to the byte goes to rclpy's own decoder, or
without ROS to that of rosbags.
"""

import struct
from typing import NamedTuple

import numpy as np

_LITTLE_ENDIAN_CDR = b'\x00\x01\x00\x00'
_HEADER = struct.Struct('<4siII')  # encapsulation, seconds, nanoseconds, length of frame_id
_COUNT = struct.Struct('<I')
_ID = struct.Struct('<q')
_POINT = np.dtype('<f4')
_POINT_BYTES = 12
_SECOND = 1_000_000_000


class MessageError(ValueError):
    """The bytes are not the message that their topic announces."""


class Received(NamedTuple):
    """What a polygon message says: stamp in ns, float32 points (n, 3), and the id if any."""

    stamp: int
    frame_id: str
    points: np.ndarray
    identity: int | None


def decode(data: bytes, instance: bool) -> Received:
    """
    Read a PolygonStamped, or a PolygonInstanceStamped if `instance` is true.

    Raises
    ------
    MessageError
        If neither this decoder nor the library's can account for every byte.

    """
    seconds, nanoseconds, frame_id, points, identity = (
        _read_in_place(data, instance) or _read_with_library(data, instance))
    if nanoseconds >= _SECOND:
        raise MessageError(f'{nanoseconds} nanoseconds in the stamp make more than a second')
    return Received(seconds * _SECOND + nanoseconds, frame_id, points, identity)


def _read_in_place(data, instance):
    """Return the fields of a plain little-endian message, None if in any doubt."""
    size = len(data)
    if size < _HEADER.size:
        return None
    encapsulation, seconds, nanoseconds, length = _HEADER.unpack_from(data)
    text_end = _HEADER.size + length
    count_at = (text_end + 3) & ~3
    points_at = count_at + _COUNT.size
    if encapsulation != _LITTLE_ENDIAN_CDR or length == 0 or points_at > size:
        return None
    # The first NUL must be the last byte of the string.
    if data.find(b'\0', _HEADER.size, text_end) != text_end - 1:
        return None
    count, = _COUNT.unpack_from(data, count_at)
    end = points_at + count * _POINT_BYTES
    identity = None
    if instance:
        # Alignment counts from behind the encapsulation, hence the 4.
        id_at = ((end - 4 + 7) & ~7) + 4
        end = id_at + _ID.size
    if end != size:
        return None
    if instance:
        identity, = _ID.unpack_from(data, id_at)
    try:
        frame_id = data[_HEADER.size:text_end - 1].decode()
    except UnicodeDecodeError:
        return None
    points = np.ndarray((count, 3), _POINT, data, points_at)
    return seconds, nanoseconds, frame_id, points, identity


def _read_with_library(data, instance):
    """
    Return the fields as the decoder of rclpy or rosbags reads them.

    rclpy's forgives what a monitor must not: a point count beyond the end of the message comes
    back as no points at all, and bytes left over are ignored. So what it read must, when encoded
    again, give as many bytes, and the bytes must state as many points.
    """
    try:
        from sat_collision import interfaces
    except ImportError as error:
        raise MessageError(
            f'only rclpy or rosbags could read this encoding: {error}') from error
    kind = interfaces.PolygonInstanceStamped if instance else interfaces.PolygonStamped
    try:
        message = interfaces.deserialize(data, kind)
    except Exception as error:  # rclpy's own error class is private, rosbags raises any
        raise MessageError(f'not decodable: {error}') from error
    frame_id = message.header.frame_id
    if '\N{REPLACEMENT CHARACTER}' in frame_id:
        raise MessageError('frame_id is not UTF-8')
    expected = len(interfaces.serialize(message))
    if len(data) != expected:
        raise MessageError(f'{len(data)} bytes where the contents need {expected}')
    polygon = message.polygon.polygon if instance else message.polygon
    points = np.array([(p.x, p.y, p.z) for p in polygon.points], _POINT).reshape(-1, 3)
    count_at = (_HEADER.size + len(frame_id.encode()) + 1 + 3) & ~3
    stated = data[count_at:count_at + _COUNT.size]
    if len(points) not in (int.from_bytes(stated, 'little'), int.from_bytes(stated, 'big')):
        raise MessageError('the points end before their stated number')
    stamp = message.header.stamp
    identity = message.polygon.id if instance else None
    return stamp.sec, stamp.nanosec, frame_id, points, identity

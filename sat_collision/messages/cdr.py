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
Decodes serialised geometry_msgs/PolygonStamped and PolygonInstanceStamped.

CDR in this machine's byte order is read in place, with every length checked. A message that does
not match to the byte goes to the decoder of rclpy, or without ROS to that of rosbags.
"""

from __future__ import annotations

from array import array
import struct
import sys
from typing import Literal, TypeAlias

_OWN_CDR = {'little': b'\x00\x01\x00\x00', 'big': b'\x00\x00\x00\x00'}[sys.byteorder]
_HEADER = struct.Struct('=4siII')  # encapsulation, seconds, nanoseconds, length of frame_id
_HEADER_SIZE = _HEADER.size
_read_header = _HEADER.unpack_from
_read_count = struct.Struct('=I').unpack_from
_read_id = struct.Struct('=q').unpack_from
_read_stamp = struct.Struct('=4siI').unpack_from
STAMP_SIZE = 12
COUNT_SIZE = 4
_ID_SIZE = 8
POINT_SIZE = 12
_SECOND = 1_000_000_000
_MOST_SHOWN = 200

# Bytes, the offset of the points in them, and the number of points: x, y and z of each as float32
# in this machine's byte order.
Points: TypeAlias = tuple[bytes, int, int]


class MessageError(ValueError):
    """The bytes are not a message of their topic's type."""


def decode(data: bytes, instance: bool) -> tuple[int, str, Points, int | None]:
    """
    Read a PolygonStamped, or a PolygonInstanceStamped if `instance` is true.

    Parameters
    ----------
    data : bytes
    instance : bool

    Returns
    -------
    stamp : int
        In ns.
    frame_id : str
    points : Points
    identity : int or None
        The id of a PolygonInstanceStamped.

    Raises
    ------
    MessageError
        If neither this decoder nor the library's can account for every byte.

    """
    size = len(data)
    if size < _HEADER_SIZE:
        return _decode_with_library(data, instance)
    encapsulation, seconds, nanoseconds, length = _read_header(data)
    text_end = _HEADER_SIZE + length
    count_at = (text_end + 3) & ~3
    points_at = count_at + COUNT_SIZE
    # The first NUL must be the last byte of the string.
    if (encapsulation != _OWN_CDR or length == 0 or points_at > size
            or data.find(b'\0', _HEADER_SIZE, text_end) != text_end - 1):
        return _decode_with_library(data, instance)
    count, = _read_count(data, count_at)
    end = points_at + count * POINT_SIZE
    identity = None
    if instance:
        # Alignment counts from the end of the encapsulation, hence the 4.
        id_at = ((end - 4 + 7) & ~7) + 4
        end = id_at + _ID_SIZE
        if end == size:
            identity, = _read_id(data, id_at)
    if end != size:
        return _decode_with_library(data, instance)
    try:
        frame_id = data[_HEADER_SIZE:text_end - 1].decode()
    except UnicodeDecodeError:
        return _decode_with_library(data, instance)
    if nanoseconds >= _SECOND:
        raise _too_many_nanoseconds(nanoseconds)
    return seconds * _SECOND + nanoseconds, frame_id, (data, points_at, count), identity


def header_stamp(data: bytes) -> int:
    """Return the header stamp of a message in ns, 0 if it cannot be read in place."""
    if len(data) < STAMP_SIZE:
        return 0
    encapsulation, seconds, nanoseconds = _read_stamp(data)
    if encapsulation != _OWN_CDR or nanoseconds >= _SECOND:
        return 0
    return int(seconds * _SECOND + nanoseconds)


def _too_many_nanoseconds(nanoseconds: int) -> MessageError:
    return MessageError(f'{nanoseconds} nanoseconds in the stamp make more than a second')


def _decode_with_library(data: bytes, instance: bool) -> tuple[int, str, Points, int | None]:
    """
    Decode with rclpy or rosbags; return the same as `decode`.

    rclpy's decoder accepts what a monitor must not: for a point count beyond the end of the
    message it returns no points at all, and it ignores extra bytes. So its result must encode to
    as many bytes again, and have as many points as the bytes state. It also writes a line to
    standard error for each length beyond the end, so lengths are checked first.
    """
    _check_lengths(data)
    try:
        from sat_collision.messages import interfaces
    except ImportError as error:
        raise MessageError(
            f'only rclpy or rosbags could read this encoding: {error}') from error
    kind = interfaces.PolygonInstanceStamped if instance else interfaces.PolygonStamped
    try:
        message = interfaces.deserialize(data, kind)
    except Exception as error:  # rclpy's own error class is private, rosbags raises any
        raise MessageError(f'not decodable: {str(error)[:_MOST_SHOWN]!r}') from error
    frame_id = message.header.frame_id
    if '\N{REPLACEMENT CHARACTER}' in frame_id:
        raise MessageError('frame_id is not UTF-8')
    expected = len(interfaces.serialize(message))
    if len(data) != expected:
        raise MessageError(f'{len(data)} bytes where the contents need {expected}')
    polygon = message.polygon.polygon if instance else message.polygon
    points = polygon.points
    count_at = (_HEADER_SIZE + len(frame_id.encode()) + 1 + 3) & ~3
    stated = data[count_at:count_at + COUNT_SIZE]
    if len(points) not in (int.from_bytes(stated, 'little'), int.from_bytes(stated, 'big')):
        raise MessageError('the points end before their stated number')
    stamp = message.header.stamp
    if stamp.nanosec >= _SECOND:
        raise _too_many_nanoseconds(stamp.nanosec)
    coordinates = array('f', [number for p in points for number in (p.x, p.y, p.z)]).tobytes()
    return (stamp.sec * _SECOND + stamp.nanosec, frame_id, (coordinates, 0, len(points)),
            message.polygon.id if instance else None)


def _check_lengths(data: bytes) -> None:
    """Raise MessageError if a length, in the message's own byte order, is beyond its end."""
    if len(data) < _HEADER_SIZE:
        raise MessageError(f'{len(data)} bytes where the header alone needs {_HEADER_SIZE}')
    order: Literal['little', 'big'] = 'little' if data[1] & 1 else 'big'

    def number(start: int) -> int:
        return int.from_bytes(data[start:start + COUNT_SIZE], order)
    length = number(_HEADER_SIZE - COUNT_SIZE)
    points_at = ((_HEADER_SIZE + length + 3) & ~3) + COUNT_SIZE
    if points_at > len(data):
        raise MessageError(f'a frame_id of {length} bytes in a message of {len(data)}')
    count = number(points_at - COUNT_SIZE)
    room = (len(data) - points_at) // POINT_SIZE
    if count > room:
        raise MessageError(f'{count} points where there are bytes for {room}')

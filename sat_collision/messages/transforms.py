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

"""Serialised tf2_msgs/TFMessage and nav_msgs/Odometry to plain data, every length checked."""

from __future__ import annotations

import struct
from typing import TypeAlias

from sat_collision.messages.cdr import MessageError
from sat_collision.scene.frame_ids import LONGEST_FRAME_ID
from sat_collision.scene.rotations import Transform

_HEAD = 8
_STAMP_SIZE = 8
_LENGTH_SIZE = 4
_TRANSFORM_SIZE = 56
# Pose and twist, each with a covariance.
_ODOMETRY_SIZE = 8 * 2 * 36 + 8 * (7 + 6)
# From its twist on.
_TWIST_SIZE = 8 * 36 + 8 * 6
_SECOND = 1_000_000_000

# Names come again and again. One that is cut off by the end of a message may be among them: then
# its transform is beyond the end.
_MOST_NAMES = 1000
_names: dict[bytes, str] = {}


class _Order:
    """What reads the numbers of one byte order."""

    def __init__(self, sign: str) -> None:
        self.count = struct.Struct(f'{sign}I').unpack_from
        self.head = struct.Struct(f'{sign}iII').unpack_from
        self.transform = struct.Struct(f'{sign}7d').unpack_from
        self.twist = struct.Struct(f'{sign}2d24x1d').unpack_from


_ORDERS = {b'\x00\x01\x00\x00': _Order('<'), b'\x00\x00\x00\x00': _Order('>')}


# Parent and child frame, stamp in ns, and the transform as received: its rotation may have any
# length.
StampedTransform: TypeAlias = tuple[str, str, int, Transform]


def decode_transforms(data: bytes) -> list[StampedTransform]:
    """
    Read a TFMessage, of either byte order.

    Raises
    ------
    MessageError
        If not every byte is accounted for, a name is not UTF-8 or a stamp is no time.

    """
    order = _ORDERS.get(data[:4])
    if order is None or len(data) < _HEAD:
        raise MessageError(f'{len(data)} bytes that begin with {data[:4].hex()!r} are no message')
    count, = order.count(data, 4)
    head, link, transform, names = order.head, order.count, order.transform, _names
    at = _HEAD
    transforms = []
    try:
        for _ in range(count):
            seconds, nanoseconds, length = head(data, at)
            start = at + _STAMP_SIZE + _LENGTH_SIZE
            at = start + length
            parent = names.get(data[start:at]) or _name(data[start:at], length)
            start = ((at + 3) & ~3) + _LENGTH_SIZE
            length, = link(data, start - _LENGTH_SIZE)
            at = start + length
            child = names.get(data[start:at]) or _name(data[start:at], length)
            # Alignment counts from behind the encapsulation, hence the 4.
            at = ((at - 4 + 7) & ~7) + 4
            if nanoseconds >= _SECOND:
                raise MessageError(
                    f'{nanoseconds} nanoseconds in a stamp make more than a second')
            transforms.append((
                parent, child, seconds * _SECOND + nanoseconds, transform(data, at)))
            at += _TRANSFORM_SIZE
    except struct.error as error:
        raise MessageError(f'ends before its {count} transforms do') from error
    if at != len(data):
        raise MessageError(f'{len(data)} bytes where the contents need {at}')
    return transforms


def decode_odometry(data: bytes) -> StampedTransform:
    """
    Read an Odometry, of either byte order, as the transform that its pose is.

    Raises
    ------
    MessageError
        As `decode_transforms`.

    """
    order = _ORDERS.get(data[:4])
    if order is None:
        raise MessageError(f'{len(data)} bytes that begin with {data[:4].hex()!r} are no message')
    try:
        seconds, nanoseconds, length = order.head(data, 4)
        start = 4 + _STAMP_SIZE + _LENGTH_SIZE
        parent = _name(data[start:start + length], length)
        start = ((start + length + 3) & ~3) + _LENGTH_SIZE
        length, = order.count(data, start - _LENGTH_SIZE)
        child = _name(data[start:start + length], length)
        at = ((start + length - 4 + 7) & ~7) + 4
        transform = order.transform(data, at)
    except struct.error as error:
        raise MessageError('ends before its pose does') from error
    if nanoseconds >= _SECOND:
        raise MessageError(f'{nanoseconds} nanoseconds in the stamp make more than a second')
    if at + _ODOMETRY_SIZE != len(data):
        raise MessageError(f'{len(data)} bytes where the contents need {at + _ODOMETRY_SIZE}')
    return parent, child, seconds * _SECOND + nanoseconds, transform


def decode_twist(data: bytes) -> tuple[float, float, float]:
    """Read vx, vy (m/s) and omega (rad/s) in the child frame from a whole Odometry."""
    vx, vy, omega = _ORDERS[data[:4]].twist(data, len(data) - _TWIST_SIZE)
    return vx, vy, omega


def _name(text: bytes, length: int) -> str:
    """
    Return the name that a string holds, and keep it for the next time.

    Parameters
    ----------
    text : bytes
        What there is of it.
    length : int
        How long it says to be.

    """
    if length > LONGEST_FRAME_ID + 1:
        raise MessageError(f'a frame name of {length} bytes where {LONGEST_FRAME_ID} are accepted')
    # The first NUL must be the last byte of the string.
    if length == 0 or text.find(b'\0') != length - 1:
        raise MessageError('a frame name does not end where it says')
    try:
        name = text[:-1].decode()
    except UnicodeDecodeError as error:
        raise MessageError('a frame name is not UTF-8') from error
    if len(_names) >= _MOST_NAMES:
        _names.clear()
    _names[text] = name
    return name

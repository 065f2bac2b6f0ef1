# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Decodes serialised messages in place, with every length checked.

Of geometry_msgs PolygonStamped, PolygonInstanceStamped and TwistStamped, of polygon_msgs
Polygon2DStamped and Polygon2DCollection, of nav_msgs Odometry, of tf2_msgs TFMessage; in either
byte order. What cannot be accounted for to the byte raises a MessageError.
"""

from __future__ import annotations

import struct
import sys
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.packing import DOUBLE, PAIR, TRIPLE
from sat_collision.geometry.body.polygon import Points
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.run import find_polygons, IN_ONE_MESSAGE
from sat_collision.scene.frames import LONGEST_FRAME_ID
from sat_collision.scene.rotations import Transform
from sat_collision.scene.velocity import Twist

_OWN_SIGN = {'little': '<', 'big': '>'}[sys.byteorder]
_HEADER_SIZE = 16  # encapsulation, seconds, nanoseconds, length of frame_id
_read_count = struct.Struct('=I').unpack_from
STAMP_SIZE = 12
COUNT_SIZE = 4
_ID_SIZE = 8
POINT_SIZE = 12
_PAIR_SIZE = PAIR * DOUBLE
_COLOR_SIZE = 16
_ENCAPSULATION_SIZE = 4
# Sizes of the encapsulation of a TFMessage with the number of its transforms, of a stamp with the
# length of the name after it, and of a transform.
_COUNTED_SIZE = 8
_STAMPED_SIZE = 12
_TRANSFORM_SIZE = 56
_TWIST_SIZE = 8 * 6
_LOSSES_SIZE = 8 * 2
_COVARIANCE_SIZE = 8 * 36
_SECOND = 1_000_000_000

# Decoded names of frames, kept because they repeat. Where a message is cut off within a name, its
# transform is beyond the end, which is checked.
_MAX_NAMES = 1000
_names: dict[bytes, str] = {}

# The bytes of the messages of a run; the end of each but the last, an array of int64; where in
# each message the points start; and TRIPLE. Of polygons in one message: as `geometry.run.Run` has
# bytes, offsets and numbers; IN_ONE_MESSAGE, or 0 if there are none; and PAIR.
RunPoints: TypeAlias = tuple[bytes, Any, int, int]
# Parent and child frame, stamp in ns, transform as received: its rotation may have any length.
StampedTransform: TypeAlias = tuple[str, str, int, Transform]


class MessageError(ValueError):
    """The bytes are not a message of their topic's type."""


class PoseFrameError(MessageError):
    """A pose of a path is in another frame than the path."""


def decode(data: bytes, instance: bool) -> tuple[int, str, Points, int | None]:
    """
    Read a PolygonStamped, or a PolygonInstanceStamped if `instance` is true.

    Return the stamp in ns, the frame_id, the points, and the id of a PolygonInstanceStamped.
    """
    try:
        order, stamp, frame_id, end = _read_header(data)
        start = ((end + 3) & ~3) + COUNT_SIZE
        count, = order.count(data, start - COUNT_SIZE)
    except struct.error as error:
        raise MessageError('ends before its points do') from error
    end = start + count * POINT_SIZE
    identity = None
    if instance:
        # Alignment counts from the end of the encapsulation, hence the 4.
        end = ((end - 4 + 7) & ~7) + 4 + _ID_SIZE
    _check_size(data, end)
    if instance:
        identity, = order.identity(data, end - _ID_SIZE)
    if order.sign != _OWN_SIGN:
        points = np.frombuffer(data, f'{order.sign}f4', TRIPLE * count, start)
        data, start = points.astype(np.float32).tobytes(), 0
    return stamp, frame_id, (data, start, count, TRIPLE), identity


def decode_polygon_2d(data: bytes) -> tuple[int, str, Points, None]:
    """Read a Polygon2DStamped, as `decode` does a PolygonStamped."""
    stamp, frame_id, payload, at, order = _read_polygon_2d_header(data)
    count, = order.count(payload, at)
    at += COUNT_SIZE
    if count:
        at = (at + DOUBLE - 1) & -DOUBLE
    _check_size(data, _ENCAPSULATION_SIZE + at + count * _PAIR_SIZE)
    if order.sign != _OWN_SIGN:
        payload, at = np.frombuffer(payload, np.float64, PAIR * count, at).byteswap().tobytes(), 0
    return stamp, frame_id, (payload, at, count, PAIR), None


def decode_collection(data: bytes) -> tuple[int, str, RunPoints, None]:
    """Read a Polygon2DCollection; one without polygons is as an empty polygon."""
    stamp, frame_id, payload, at, order = _read_polygon_2d_header(data)
    count, = order.count(payload, at)
    room = (len(payload) - at - COUNT_SIZE) // COUNT_SIZE
    if count > room:
        raise MessageError(f'{count} polygons where there are bytes for {room}')
    spans = indexable(np.empty(2 * count, np.int64))
    is_own = order.sign == _OWN_SIGN
    if not is_own:
        words = np.frombuffer(payload, np.uint32, len(payload) // COUNT_SIZE).byteswap()
        payload = words.tobytes()
    end = find_polygons(payload, at + COUNT_SIZE, spans)
    if end < 0:
        raise MessageError(f'polygon {-1 - end} ends beyond the message')
    if end + COUNT_SIZE > len(payload):
        raise MessageError('the message ends before its colours')
    colors, = _read_count(payload, end)
    _check_size(data, _ENCAPSULATION_SIZE + end + COUNT_SIZE + colors * _COLOR_SIZE)
    if not is_own:
        for start, points in np.asarray(spans).reshape(-1, 2).tolist():
            halves = words[start // COUNT_SIZE:][:2 * PAIR * points].reshape(-1, 2)
            halves[:] = halves[:, ::-1].copy()
        payload = words.tobytes()
    return stamp, frame_id, (payload, spans, IN_ONE_MESSAGE if count else 0, PAIR), None


def _read_polygon_2d_header(data: bytes) -> tuple[int, str, bytes, int, _Order]:
    """Read a header: stamp, frame, the bytes from where alignment counts, its end, the order."""
    try:
        order, stamp, frame_id, end = _read_header(data)
    except struct.error as error:
        raise MessageError('ends before its header does') from error
    at = ((end + 3) & ~3) - _ENCAPSULATION_SIZE
    payload = data[_ENCAPSULATION_SIZE:]
    if at + COUNT_SIZE > len(payload):
        raise MessageError('ends where its polygons should begin')
    return stamp, frame_id, payload, at, order


def header_stamp(data: bytes) -> int:
    """Return the header stamp of a message in ns, 0 if it has none that is valid."""
    order = _ORDERS.get(data[:_ENCAPSULATION_SIZE])
    if order is None or len(data) < STAMP_SIZE:
        return 0
    seconds, nanoseconds = order.stamp(data, _ENCAPSULATION_SIZE)
    return seconds * _SECOND + nanoseconds if nanoseconds < _SECOND else 0


def _too_many_nanoseconds(nanoseconds: int, stamp: str = 'the stamp') -> MessageError:
    return MessageError(f'{nanoseconds} nanoseconds in {stamp} make more than a second')


def _check_size(data: bytes, expected: int) -> None:
    """Raise MessageError if a message has not as many bytes as its contents need."""
    if len(data) != expected:
        raise MessageError(f'{len(data)} bytes where the contents need {expected}')


class _Order:
    """Readers of the numbers of one byte order."""

    def __init__(self, sign: str) -> None:
        self.sign = sign
        self.count = struct.Struct(f'{sign}I').unpack_from
        self.identity = struct.Struct(f'{sign}q').unpack_from
        self.stamp = struct.Struct(f'{sign}iI').unpack_from
        self.head = struct.Struct(f'{sign}iII').unpack_from
        self.transform = struct.Struct(f'{sign}7d').unpack_from
        self.losses = struct.Struct(f'{sign}2Q').unpack_from
        self.twist = struct.Struct(f'{sign}2d24xd').unpack_from


_ORDERS = {b'\x00\x01\x00\x00': _Order('<'), b'\x00\x00\x00\x00': _Order('>')}


def decode_transforms(data: bytes) -> list[StampedTransform]:
    """Read a TFMessage."""
    order = _order_of(data, _COUNTED_SIZE)
    count, = order.count(data, _COUNTED_SIZE - COUNT_SIZE)
    head, link, transform, names = order.head, order.count, order.transform, _names
    at = _COUNTED_SIZE
    transforms = []
    try:
        for _ in range(count):
            seconds, nanoseconds, length = head(data, at)
            start = at + _STAMPED_SIZE
            at = start + length
            parent = names.get(data[start:at]) or _link_name(data[start:at], length)
            start = ((at + 3) & ~3) + COUNT_SIZE
            length, = link(data, start - COUNT_SIZE)
            at = start + length
            child = names.get(data[start:at]) or _link_name(data[start:at], length)
            # Alignment counts from behind the encapsulation, hence the 4.
            at = ((at - 4 + 7) & ~7) + 4
            if nanoseconds >= _SECOND:
                raise _too_many_nanoseconds(nanoseconds, 'a stamp')
            transforms.append((
                parent, child, seconds * _SECOND + nanoseconds, transform(data, at)))
            at += _TRANSFORM_SIZE
    except struct.error as error:
        raise MessageError(f'ends before its {count} transforms do') from error
    _check_size(data, at)
    return transforms


def decode_odometry(data: bytes) -> tuple[StampedTransform, Twist]:
    """Read an Odometry: its pose as a transform, and the twist in the child frame."""
    try:
        order, stamp, _, end = _read_header(data)
        parent = _link_name(data[_HEADER_SIZE:end], end - _HEADER_SIZE)
        start = ((end + 3) & ~3) + COUNT_SIZE
        length, = order.count(data, start - COUNT_SIZE)
        child = _link_name(data[start:start + length], length)
        at = ((start + length - 4 + 7) & ~7) + 4
        transform = order.transform(data, at)
    except struct.error as error:
        raise MessageError('ends before its pose does') from error
    at += _TRANSFORM_SIZE + _COVARIANCE_SIZE
    _check_size(data, at + _TWIST_SIZE + _COVARIANCE_SIZE)
    return (parent, child, stamp, transform), order.twist(data, at)


def decode_path(data: bytes, most: int) -> tuple[int, str, NDArray[np.float64] | int]:
    """
    Read a Path: stamp in ns, frame, and x, y, z and the quaternion of each pose, (k, 7).

    If there are more poses than `most`, their number stands for them. Poses in other frames raise
    a `PoseFrameError`.
    """
    try:
        order, stamp, frame_id, end = _read_header(data)
        at = ((end + 3) & ~3) + COUNT_SIZE
        count, = order.count(data, at - COUNT_SIZE)
        if count > most:
            return stamp, frame_id, count
        poses = []
        begin, last = 0, b''
        for k in range(count):
            if k == 2 and (rest := _alike(data, begin, at, len(last), count - k)):
                poses.append(rest)
                at = len(data)
                break
            begin = at
            length, = order.count(data, at + _STAMPED_SIZE - COUNT_SIZE)
            start = at + _STAMPED_SIZE
            at = start + length
            text = data[start:at]
            if text != last or not length:
                if _name(text, length) not in ('', frame_id):
                    raise PoseFrameError('a pose is in another frame than the path')
                last = text
            at = ((at - 4 + 7) & ~7) + 4
            poses.append(data[at:at + _TRANSFORM_SIZE])
            at += _TRANSFORM_SIZE
    except struct.error as error:
        raise MessageError('ends before its poses do') from error
    _check_size(data, at)
    numbers = np.frombuffer(b''.join(poses), f'{order.sign}f8').reshape(-1, 7)
    return stamp, frame_id, numbers.astype(np.float64)


def _alike(data: bytes, begin: int, end: int, length: int, count: int) -> bytes:
    """
    Return the poses of the last `count` records of a Path, without their frames.

    Empty unless all have the frame, of some length, of the record before them, which is given.
    """
    size = end - begin
    if len(data) != end + count * size:
        return b''
    records = np.frombuffer(data, np.uint8, offset=begin).reshape(-1, size)
    frames = records[:, _STAMPED_SIZE - COUNT_SIZE:_STAMPED_SIZE + length]
    return b'' if (frames[1:] != frames[0]).any() else records[1:, -_TRANSFORM_SIZE:].tobytes()


def decode_command(data: bytes) -> tuple[int, str, Twist]:
    """Read a TwistStamped: its stamp in ns, its frame and its twist."""
    try:
        order, stamp, frame_id, end = _read_header(data)
        at = ((end - 4 + 7) & ~7) + 4
        twist = order.twist(data, at)
    except struct.error as error:
        raise MessageError('ends before its twist does') from error
    _check_size(data, at + _TWIST_SIZE)
    return stamp, frame_id, twist


def decode_losses(data: bytes) -> tuple[str, list[tuple[str, int]]]:
    """
    Read a MessagesLostEvent: the name of the recorder, and how many messages each topic lost.

    Those lost on the way to the recorder and by itself count together.
    """
    order = _order_of(data, _COUNTED_SIZE)
    lost = []
    try:
        recorder, at = _text(data, _COUNTED_SIZE - COUNT_SIZE, order)
        count, = order.count(data, at)
        at += COUNT_SIZE
        for _ in range(count):
            topic, at = _text(data, at, order)
            at = ((at - 4 + 7) & ~7) + 4
            lost.append((topic, sum(order.losses(data, at))))
            at += _LOSSES_SIZE
    except struct.error as error:
        raise MessageError('ends before its statistics do') from error
    _check_size(data, at)
    return recorder, lost


def stamped(twist: bytes) -> bytes:
    """Return a serialised Twist as a TwistStamped without stamp and frame."""
    order: Literal['little', 'big'] = 'little' if twist[1:2] == b'\1' else 'big'
    length = (1).to_bytes(COUNT_SIZE, order)
    return twist[:4] + bytes(_STAMPED_SIZE - COUNT_SIZE) + length + bytes(4) + twist[4:]


def _read_header(data: bytes) -> tuple[_Order, int, str, int]:
    """Read a header: its byte order, the stamp in ns, the frame, and where its name ends."""
    order = _order_of(data)
    seconds, nanoseconds, length = order.head(data, 4)
    end = _HEADER_SIZE + length
    text = data[_HEADER_SIZE:end]
    frame_id = _names.get(text) or _name(text, length)
    if nanoseconds >= _SECOND:
        raise _too_many_nanoseconds(nanoseconds)
    return order, seconds * _SECOND + nanoseconds, frame_id, end


def _order_of(data: bytes, least: int = 0) -> _Order:
    """Return the byte order of a message, which has so many bytes at least."""
    order = _ORDERS.get(data[:4])
    if order is None or len(data) < least:
        raise MessageError(
            f'{len(data)} bytes that begin with {data[:4].hex()!r} are not a message')
    return order


def _text(data: bytes, at: int, order: _Order) -> tuple[str, int]:
    """Return a string, and where a number of 4 bytes after it begins."""
    length, = order.count(data, at)
    end = at + COUNT_SIZE + length
    return data[at + COUNT_SIZE:end].rstrip(b'\0').decode(errors='replace'), (end + 3) & ~3


def _link_name(text: bytes, length: int) -> str:
    """Return the name of a frame to keep: one that is too long is refused."""
    if length > LONGEST_FRAME_ID + 1:
        raise MessageError(f'a frame name of {length} bytes where {LONGEST_FRAME_ID} are accepted')
    return _name(text, length)


def _name(text: bytes, length: int) -> str:
    """Return the name that a string holds, cut off if shorter than its length; keep the name."""
    # The first NUL must be the last byte of the string.
    if length == 0 or text.find(b'\0') != length - 1:
        raise MessageError('a frame name does not end where it says')
    try:
        name = text[:-1].decode()
    except UnicodeDecodeError as error:
        raise MessageError('a frame name is not UTF-8') from error
    if len(_names) >= _MAX_NAMES:
        _names.clear()
    if length <= LONGEST_FRAME_ID + 1:
        _names[text] = name
    return name

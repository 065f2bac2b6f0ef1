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
Receives /tf, /tf_static and odometry, and returns the affine map for a message.

tf2_msgs/TFMessage, nav_msgs/Odometry and geometry_msgs/TwistStamped are decoded here, with every
length checked.
"""

from __future__ import annotations

from collections import Counter
import struct
from typing import Literal, TypeAlias

from sat_collision.messages.cdr import MessageError
from sat_collision.messages.rejections import Rejection, UNDECODABLE
from sat_collision.scene.frame_tree import in_quotes, in_words, LONGEST_FRAME_ID
from sat_collision.scene.frames import Frames, Mapped, NoTransform
from sat_collision.scene.rotations import Transform
from sat_collision.scene.scene import FROM_FUTURE
from sat_collision.scene.settings import NEVER, Settings, TF
from sat_collision.scene.velocity import Twist

TF_STATIC = '/tf_static'
TRANSFORM_TOPICS = (TF, TF_STATIC)

# Refused transforms are counted by frame for so many frames; the rest are counted together.
_MOST_COUNTED = 100
_OTHERS = 'other frames'

_HEAD = 8
_STAMP_SIZE = 8
_LENGTH_SIZE = 4
_TRANSFORM_SIZE = 56
# Pose and twist, each with a covariance.
_ODOMETRY_SIZE = 8 * 2 * 36 + 8 * (7 + 6)
_TWIST_SIZE = 8 * 6
_TWIST_COVARIANCE_SIZE = 8 * 36
_SECOND = 1_000_000_000

# Decoded names, as they repeat. One may be of a message that is cut off within it: its transform
# is then beyond the end, which is checked.
_MOST_NAMES = 1000
_names: dict[bytes, str] = {}


class _Order:
    """Readers of the numbers of one byte order."""

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
        If lengths do not add up, a name is not UTF-8 or a stamp is invalid.

    """
    order = _ORDERS.get(data[:4])
    if order is None or len(data) < _HEAD:
        raise MessageError(
            f'{len(data)} bytes that begin with {data[:4].hex()!r} are not a message')
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
    try:
        order, stamp, parent, end = _read_header(data)
        start = ((end + 3) & ~3) + _LENGTH_SIZE
        length, = order.count(data, start - _LENGTH_SIZE)
        child = _name(data[start:start + length], length)
        at = ((start + length - 4 + 7) & ~7) + 4
        transform = order.transform(data, at)
    except struct.error as error:
        raise MessageError('ends before its pose does') from error
    if at + _ODOMETRY_SIZE != len(data):
        raise MessageError(f'{len(data)} bytes where the contents need {at + _ODOMETRY_SIZE}')
    return parent, child, stamp, transform


def decode_twist(data: bytes) -> Twist:
    """Read the twist in the child frame from a whole Odometry."""
    vx, vy, omega = _ORDERS[data[:4]].twist(
        data, len(data) - _TWIST_COVARIANCE_SIZE - _TWIST_SIZE)
    return vx, vy, omega


def decode_command(data: bytes) -> tuple[int, str, Twist]:
    """
    Read a TwistStamped, of either byte order: its stamp in ns, its frame and its twist.

    Raises
    ------
    MessageError
        As `decode_transforms`.

    """
    try:
        order, stamp, frame_id, end = _read_header(data)
        at = ((end - 4 + 7) & ~7) + 4
        vx, vy, omega = order.twist(data, at)
    except struct.error as error:
        raise MessageError('ends before its twist does') from error
    if at + _TWIST_SIZE != len(data):
        raise MessageError(f'{len(data)} bytes where the contents need {at + _TWIST_SIZE}')
    return stamp, frame_id, (vx, vy, omega)


def stamped(twist: bytes) -> bytes:
    """Return a serialised Twist as a TwistStamped without stamp and frame."""
    order: Literal['little', 'big'] = 'little' if twist[1:2] == b'\1' else 'big'
    length = (1).to_bytes(_LENGTH_SIZE, order)
    return twist[:4] + bytes(_STAMP_SIZE) + length + bytes(4) + twist[4:]


def _read_header(data: bytes) -> tuple[_Order, int, str, int]:
    """Read a header: the byte order, the stamp in ns, the frame, and where its name ends."""
    order = _ORDERS.get(data[:4])
    if order is None:
        raise MessageError(
            f'{len(data)} bytes that begin with {data[:4].hex()!r} are not a message')
    seconds, nanoseconds, length = order.head(data, 4)
    start = 4 + _STAMP_SIZE + _LENGTH_SIZE
    frame_id = _name(data[start:start + length], length)
    if nanoseconds >= _SECOND:
        raise MessageError(f'{nanoseconds} nanoseconds in the stamp make more than a second')
    return order, seconds * _SECOND + nanoseconds, frame_id, start + length


def _name(text: bytes, length: int) -> str:
    """
    Return the name that a string holds, and keep it for the next time.

    The text may be shorter than its announced length, if the message is cut off.
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


class TransformListener:
    """Takes serialised TFMessages; a bad transform is counted and returned as a Rejection."""

    def __init__(self, settings: Settings) -> None:
        self.frames = Frames(round(settings.tf_cache_time * 1e9))
        # All messages, by topic, and how many transforms were taken.
        self.received: Counter[str] = Counter()
        self.transforms = 0
        # Refused transforms by (child frame, reason), with the frame in words for users; messages
        # that could not be read by (topic, reason).
        self.rejected: Counter[tuple[str, str]] = Counter()
        # How often a frame was sent by another publisher than before, by its name.
        self.turns: Counter[str] = Counter()
        self._numbers: dict[str, int] = {}
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply settings."""
        self._target = settings.frame_id
        self._tolerance = round(settings.future_tolerance * 1e9)
        self.frames.configure(settings.max_tf_gap * 1e9, settings.max_tilt)

    def clear(self) -> None:
        """Forget all but the static frames: the clock was set back."""
        self.frames.clear()

    def receive(self, topic: str, data: bytes, now: int,
                number: int | None = None) -> list[Rejection]:
        """Take a message of /tf or /tf_static, with its number of its publisher, if known."""
        self.received[topic] += 1
        try:
            transforms = decode_transforms(data)
        except MessageError as error:
            self.rejected[topic, UNDECODABLE] += 1
            return [Rejection(topic, topic, UNDECODABLE, str(error))]
        rejections = []
        insert = self.frames.insert
        static = topic == TF_STATIC
        numbers = self._numbers
        for parent, child, stamp, transform in transforms:
            if now and stamp > now + self._tolerance and not static:
                refusal: str | None = FROM_FUTURE
            else:
                refusal = insert(parent, child, stamp, transform, static)
            if refusal == FROM_FUTURE:
                self._count(in_words(child), refusal)
                rejections.append(Rejection(topic, topic, refusal, _ahead(child, stamp, now)))
            elif refusal:
                self._count(in_words(child), refusal)
                rejections.append(Rejection(topic, topic, refusal, _detail(
                    parent, child, transform, 'by an unknown publisher ')))
            elif number is not None and not static:
                # Each publisher counts its messages upwards, so a number that is not above the
                # last one for a frame is another publisher's, or of one that has begun again.
                if numbers.get(child, 0) >= number:
                    self.turns[child] += 1
                numbers[child] = number
        self.transforms += len(transforms) - len(rejections)
        return rejections

    def receive_odometry(self, data: bytes, now: int) -> tuple[str, str] | None:
        """Take an Odometry; return reason and detail if it is refused."""
        try:
            parent, child, stamp, transform = decode_odometry(data)
        except MessageError as error:
            return UNDECODABLE, str(error)
        if now and stamp > now + self._tolerance:
            return FROM_FUTURE, _ahead(child, stamp, now)
        # One that is ahead of the clock must not shut out those that follow.
        refusal = self.frames.insert(parent, child, min(stamp, now) if now else stamp, transform)
        if refusal:
            return refusal, _detail(parent, child, transform)
        self.transforms += 1
        return None

    def _count(self, child: str, refusal: str) -> None:
        """Count a transform that was refused."""
        key = child, refusal
        if key not in self.rejected and len(self.rejected) >= _MOST_COUNTED:
            key = _OTHERS, refusal
        self.rejected[key] += 1

    def stamps(self, frame_id: str, after: int, until: int) -> list[int]:
        """Return the stamps in ns, between two times, of the transforms of a frame."""
        return self.frames.stamps(self._target, frame_id, after, until)

    def newest(self, frame_id: str, now: int) -> Mapped | NoTransform:
        """Return the map from a frame to the fixed frame at the latest time that is known."""
        return self.frames.newest_affine(self._target, frame_id, now=now)

    def lookup_affine(self, frame_id: str, stamp: int, now: int,
                      timeout: float) -> Mapped | NoTransform:
        """
        Return the map from the frame of a message to the fixed frame.

        Stamp and present time are in ns. A stamp of 0 uses the newest transform, unless that is
        older than the timeout in s; 0.0 for any age.
        """
        if stamp:
            return self.frames.lookup_affine(self._target, frame_id, stamp)
        oldest = now - timeout * 1e9 if timeout > 0.0 else -NEVER
        return self.frames.newest_affine(self._target, frame_id, oldest, now)


def _ahead(child: str, stamp: int, now: int) -> str:
    return (f'the transform of {in_quotes(child)} is stamped {(stamp - now) / 1e9:.3f} s ahead of '
            'the clock')


def _detail(parent: str, child: str, transform: Transform, publisher: str = '') -> str:
    numbers = ', '.join(f'{number:.6g}' for number in transform)
    return (f'the transform of {in_quotes(child)} in {in_quotes(parent)} {publisher}is '
            f'({numbers})')

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Receives /tf, /tf_static and odometry, and returns the affine map for a message."""

from __future__ import annotations

from collections import Counter

from sat_collision.messages.cdr import decode_transforms, MessageError, StampedTransform
from sat_collision.messages.rejections import Rejection, UNDECODABLE
from sat_collision.scene.frames import Frames, in_quotes, in_words, Mapped, NoTransform
from sat_collision.scene.scene import FROM_FUTURE
from sat_collision.scene.settings import NEVER, Settings, TF

TF_STATIC = '/tf_static'
TRANSFORM_TOPICS = (TF, TF_STATIC)

# Max frames whose refused transforms are counted by frame; the rest are counted together.
_MAX_COUNTED = 100
_OTHERS = 'other frames'
# Max frames whose message numbers are kept: more are made-up names, as no buffer holds so many.
_MAX_NUMBERS = 20_000


class TransformListener:
    """
    Passes serialised TFMessages, and the poses of odometry, to a buffer of transforms.

    Bad transforms are counted and returned, as a Rejection or as the reason and detail of one.
    """

    def __init__(self, settings: Settings) -> None:
        self.frames = Frames(round(settings.tf_cache_time * 1e9))
        self.received: Counter[str] = Counter()  # all messages, by topic
        self.transforms = 0  # how many were taken
        # Refused transforms by (child frame, reason), with the frame in words for users; messages
        # that could not be read by (topic, reason).
        self.rejected: Counter[tuple[str, str]] = Counter()
        # How often a frame was sent by another publisher than before, by its name.
        self.turns: Counter[str] = Counter()
        self._numbers: dict[str, int] = {}
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        self._target = settings.frame_id
        self._tolerance = round(settings.future_tolerance * 1e9)
        self.frames.configure(settings.max_tf_gap * 1e9, settings.max_tilt)

    def receive(self, topic: str, data: bytes, now: int, number: int | None,
                arrived: int) -> list[Rejection]:
        """
        Take a message of /tf or /tf_static, with its sequence number if known.

        A transform of stamp 0 counts from when it `arrived`.
        """
        self.received[topic] += 1
        try:
            transforms = decode_transforms(data)
        except MessageError as error:
            self.rejected[topic, UNDECODABLE] += 1
            return [Rejection(topic, topic, UNDECODABLE, str(error))]
        rejections = []
        numbers = self._numbers
        for one in transforms:
            child = one[1]
            if problem := self.take(one, now, arrived, topic):
                key = in_words(child), problem[0]
                if key not in self.rejected and len(self.rejected) >= _MAX_COUNTED:
                    key = _OTHERS, problem[0]
                self.rejected[key] += 1
                rejections.append(Rejection(topic, topic, *problem))
            elif number is not None and topic != TF_STATIC:
                # Each publisher counts its messages upwards, so a number that is not above the
                # last one for a frame is another publisher's, or of one that has begun again.
                if numbers.get(child, 0) >= number:
                    self.turns[child] += 1
                elif len(numbers) > _MAX_NUMBERS:
                    numbers.clear()
                    self.turns.clear()
                numbers[child] = number
        return rejections

    def take(self, received: StampedTransform, now: int, arrived: int,
             topic: str = '') -> tuple[str, str] | None:
        """Take a transform of a topic, or the pose of an Odometry; return why it is refused."""
        parent, child, stamp, transform = received
        stamp = stamp or arrived
        static = topic == TF_STATIC
        if now and stamp > now + self._tolerance and not static:
            return FROM_FUTURE, (f'the transform of {in_quotes(child)} is stamped '
                                 f'{(stamp - now) / 1e9:.3f} s ahead of the clock')
        if refusal := self.frames.insert(parent, child, stamp, transform, static):
            publisher = 'by an unknown publisher ' if topic else ''
            numbers = ', '.join(f'{number:.6g}' for number in transform)
            return refusal, (f'the transform of {in_quotes(child)} in {in_quotes(parent)} '
                             f'{publisher}is ({numbers})')
        self.transforms += 1
        return None

    def stamps(self, frame_id: str, after: int, until: int) -> list[int]:
        """Return the stamps in ns, between two times, of the transforms of a frame."""
        return self.frames.stamps(self._target, frame_id, after, until)

    def lookup_affine(self, frame_id: str, stamp: int, now: int,
                      timeout: float = 0.0) -> Mapped | NoTransform:
        """
        Return the map from the frame of a message to the fixed frame.

        Stamp and present time are in ns. A stamp of 0 uses the newest transform, unless that is
        older than the timeout in s; 0.0 for any age.
        """
        oldest = now - round(timeout * 1e9) if timeout else -NEVER
        return self.frames.lookup_affine(self._target, frame_id, stamp, oldest, now)

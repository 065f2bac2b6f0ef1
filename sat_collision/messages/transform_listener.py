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

"""What /tf and /tf_static have told, and which map it makes for a message."""

from __future__ import annotations

from collections import Counter

from sat_collision.messages.cdr import MessageError
from sat_collision.messages.rejections import Rejection, UNDECODABLE
from sat_collision.messages.transforms import decode_transforms
from sat_collision.scene.deadlines import NEVER
from sat_collision.scene.frames import Frames, Mapped, NoTransform
from sat_collision.scene.settings import Settings

TF = '/tf'
TF_STATIC = '/tf_static'
TRANSFORM_TOPICS = (TF, TF_STATIC)


class TransformListener:
    """
    Takes serialised TFMessages; a transform of no use is counted and told as a Rejection.

    Parameters
    ----------
    settings : Settings

    Attributes
    ----------
    received : Counter
        All messages, by topic.
    transforms : int
        How many transforms were taken.
    rejected : Counter
        The transforms that were not taken, by (child frame, reason); of messages that could not
        be read by (topic, reason).

    """

    def __init__(self, settings: Settings) -> None:
        self._frames = Frames(round(settings.tf_cache_time * 1e9))
        self.received: Counter[str] = Counter()
        self.rejected: Counter[tuple[str, str]] = Counter()
        self.transforms = 0
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply settings."""
        self._target = settings.frame_id
        self._frames.configure(settings.max_tf_gap * 1e9, settings.max_tilt)

    def clear(self) -> None:
        """Forget what was told of another time: all but the static frames."""
        self._frames.clear()

    def listen(self, topic: str, data: bytes) -> list[Rejection]:
        """Take a message of /tf or /tf_static."""
        self.received[topic] += 1
        try:
            transforms = decode_transforms(data)
        except MessageError as error:
            self.rejected[topic, UNDECODABLE] += 1
            return [Rejection(topic, topic, UNDECODABLE, str(error))]
        rejections = []
        insert = self._frames.insert
        static = topic == TF_STATIC
        for parent, child, stamp, transform in transforms:
            refusal = insert(parent, child, stamp, transform, static)
            if refusal:
                self.rejected[child, refusal] += 1
                numbers = ', '.join(f'{number:.6g}' for number in transform)
                rejections.append(Rejection(
                    topic, topic, refusal, f"the transform of '{child}' in '{parent}' by an "
                    f'unknown publisher is ({numbers})'))
            else:
                self.transforms += 1
        return rejections

    def plane(self, frame_id: str, stamp: int, now: int,
              timeout: float) -> Mapped | NoTransform:
        """
        Return what takes a message to the fixed frame.

        Parameters
        ----------
        frame_id : str
        stamp, now : int
            Header stamp and present time in ns; the stamp 0 takes the newest transform.
        timeout : float
            How old that may be, in s; 0.0 for any age.

        Returns
        -------
        Mapped or NoTransform

        """
        if stamp:
            return self._frames.plane(self._target, frame_id, stamp)
        oldest = now - timeout * 1e9 if timeout > 0.0 else -NEVER
        return self._frames.newest_plane(self._target, frame_id, oldest)

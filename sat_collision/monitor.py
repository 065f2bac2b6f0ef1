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

"""What the live node and the replay tool share: bytes in, states out."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from sat_collision.geometry.jit import COMPILED, indexable
from sat_collision.geometry.layout import packed_size
from sat_collision.geometry.packing import pack_convex
from sat_collision.geometry.polygon import PackedBody, Polygon, PolygonError, Reason
from sat_collision.messages.cdr import decode, MessageError, Points
from sat_collision.messages.losses import Losses
from sat_collision.scene.frame_ids import in_quotes, LONGEST_FRAME_ID
from sat_collision.scene.holders import OTHER_FRAME, TOO_MANY
from sat_collision.scene.observer import Observer
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN, Scene
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_INSTANCE, Settings)
from sat_collision.scene.sources import TOO_OLD

EMPTY_FRAME_ID = 'empty frame_id'
LONG_FRAME_ID = 'long frame_id'
UNDECODABLE = 'undecodable'

_ADVICE = {
    EMPTY_FRAME_ID: 'the publisher must say which frame the polygon is in',
    FROM_FUTURE: 'set the clocks of both machines by one, or raise the parameter future_tolerance',
    LONG_FRAME_ID: 'the publisher must name a frame as tf2 has it',
    OTHER_FRAME: 'publish in that frame, or choose another by the parameter frame_id',
    OVERTAKEN: 'let one publisher send the footprint, in the order of its stamps',
    Reason.EMPTY.value: 'the publisher must send where the footprint is',
    Reason.NOT_FINITE.value: 'the publisher must send finite coordinates only',
    Reason.SELF_INTERSECTING.value: 'the publisher must send the outline of a simple polygon',
    Reason.TOO_MANY_VERTICES.value: 'simplify the polygon or raise the parameter max_vertices',
    TOO_MANY: 'publish fewer obstacles or raise the parameter max_count of the source',
    TOO_OLD: 'check clocks and delays, or raise the parameter timeout of the source',
    UNDECODABLE: 'check that the publisher has the message type that this topic should have',
}


class Rejection(NamedTuple):
    """
    A message that was not taken.

    Attributes
    ----------
    name, topic : str
        The footprint or source that it was for, and its topic.
    reason : str
        A few words without figures, to count by.
    detail : str
        What is wrong with this very message.

    """

    name: str
    topic: str
    reason: str
    detail: str

    @property
    def text(self) -> str:
        """The whole story as a sentence: topic, reason, and what to do."""
        return (f'{self.name}: a message on {self.topic} was rejected, {self.reason}: '
                f'{self.detail}; {_ADVICE[self.reason]}')


class Monitor:
    """
    Takes serialised messages and keeps the scene that they make.

    A message of no use is counted and returned as a Rejection, and never raises. The scene is
    told of it, because it stands for a body whose place is not known.

    Parameters
    ----------
    settings : Settings
    observer : Observer, optional
        Of the scene.

    Attributes
    ----------
    scene : Scene
        Tells the states, and is where settings are changed.
    stamp, points : int, Points
        Those of the last message that could be decoded.
    received : Counter
        All messages, by name of the footprint or source.
    rejected : Counter
        The messages that were not taken, by (name, reason).
    lost : Counter
        The messages that were sent but never came, by name.
    is_numbered : bool
        Whether the messages of all batches have numbers, without which no loss shows.

    """

    def __init__(self, settings: Settings, observer: Observer | None = None) -> None:
        self.scene = Scene(settings, observer)
        self.stamp = 0
        self.points: Points = b'', 0, 0
        self.received: Counter[str] = Counter()
        self.rejected: Counter[tuple[str, str]] = Counter()
        self.lost: Counter[str] = Counter()
        self.is_numbered = True
        self._losses: defaultdict[str, Losses] = defaultdict(Losses)
        self._overwhelmed: set[str] = set()
        self._lost_when_behind: dict[str, int] = {}
        self._with_ids = {source.name for source in settings.obstacles
                          if source.type == POLYGON_INSTANCE}
        self._packer = _Packer(settings.max_vertices)

    def receive(self, name: str, data: bytes, now: int) -> Rejection | None:
        """
        Take a message; one for what is disabled is ignored.

        Parameters
        ----------
        name : str
            Name of the footprint or source.
        data : bytes
            The serialised PolygonStamped or PolygonInstanceStamped.
        now : int
            Present time in ns, by the clock of the header stamps.

        Returns
        -------
        Rejection or None

        """
        self.received[name] += 1
        settings = self.scene.settings_of(name)
        return self._take(settings, data, now) if settings.enabled else None

    def receive_batch(self, name: str, messages: Iterable[tuple[bytes, int | None]],
                      now: int) -> list[Rejection]:
        """
        Take messages as `receive` does, and find out what is missing among them.

        Parameters
        ----------
        name : str
        messages : iterable of tuple
            The serialised message, and which one of its publisher it is, where that is known.
        now : int

        Returns
        -------
        list of Rejection

        """
        rejections = []
        settings = self.scene.settings_of(name)
        missing = self._losses[name].missing
        received = 0
        for data, number in messages:
            received += 1
            if number is None:
                self.is_numbered = False
            elif (lost := missing(number)) is None:
                self.scene.meet_publisher(name, number == 1)
            elif lost:
                self.lost[name] += lost
                self.scene.lose(name, now)
            if settings.enabled and (rejection := self._take(settings, data, now)):
                rejections.append(rejection)
        self.received[name] += received
        return rejections

    def note_backlog(self, name: str, seconds: float | None) -> None:
        """
        Take note of how old messages are before they are taken, None where none is waiting.

        A source that is behind by more than its timeout, or goes on losing messages while it is
        behind, cannot be trusted until it has caught up.
        """
        settings = self.scene.settings_of(name)
        if isinstance(settings, FootprintSettings):
            return
        lost, lost_before = self.lost[name], self._lost_when_behind.pop(name, self.lost[name])
        if seconds is None:
            self._overwhelmed.discard(name)
        else:
            self._lost_when_behind[name] = lost
            if lost > lost_before or seconds > settings.timeout > 0.0:
                self._overwhelmed.add(name)
        self.scene.overwhelm(name, name in self._overwhelmed)

    def _take(self, settings: FootprintSettings | ObstacleSettings, data: bytes,
              now: int) -> Rejection | None:
        scene, name = self.scene, settings.name
        stamp = instance = None
        try:
            stamp, frame_id, points, instance = decode(data, name in self._with_ids)
            self.stamp, self.points = stamp, points
            if not frame_id:
                return self._refuse(settings, EMPTY_FRAME_ID, 'its header names no frame', now,
                                    stamp, instance)
            if len(frame_id) > LONGEST_FRAME_ID:
                return self._refuse(
                    settings, LONG_FRAME_ID, f'{len(frame_id)} characters where '
                    f'{LONGEST_FRAME_ID} are accepted', now, stamp, instance)
            if isinstance(settings, FootprintSettings):
                refusal = scene.footprint(name, self._packer.pack(points), frame_id, stamp, now)
            else:
                body = self._packer.pack(points) if points[2] else None
                refusal = scene.obstacle(name, body, frame_id, stamp, now, instance)
        except MessageError as error:
            return self._refuse(settings, UNDECODABLE, str(error), now)
        except PolygonError as error:
            return self._refuse(settings, error.reason.value, str(error), now, stamp, instance)
        if refusal is None:
            return None
        if refusal == OTHER_FRAME:
            detail = f'it is in {in_quotes(frame_id)}, all else in {in_quotes(scene.frame_id)}'
        elif refusal == TOO_OLD:
            detail = (f'its stamp is {(now - stamp) / 1e9:.3f} s old, past the timeout of '
                      f'{settings.timeout:g} s')
        elif refusal == FROM_FUTURE:
            detail = f'its stamp is {(stamp - now) / 1e9:.3f} s ahead of the clock'
        elif refusal == OVERTAKEN:
            detail = 'a footprint with a later stamp came before it'
        else:
            detail = 'the source holds max_count obstacles already'
        return self._reject(settings, refusal, detail)

    def count_publishers(self, name: str, count: int) -> None:
        """Take note of how many publishers a footprint or source has; called again and again."""
        self._losses[name].most = max(count, 1)
        self.scene.count_publishers(name, count)

    def _refuse(self, settings: FootprintSettings | ObstacleSettings, reason: str, detail: str,
                now: int, stamp: int | None = None, instance: int | None = None) -> Rejection:
        """Tell the scene, and the caller, of a message that gives no polygon."""
        self.scene.refuse(settings.name, reason, now, stamp, instance)
        return self._reject(settings, reason, detail)

    def _reject(self, settings: FootprintSettings | ObstacleSettings, reason: str,
                detail: str) -> Rejection:
        self.rejected[settings.name, reason] += 1
        return Rejection(settings.name, settings.topic, reason, detail)


# What plain Python has the time to cut into convex parts and to measure, see docs/reliability.md.
_MOST_NOTCHED = 128
# More points than this for each vertex accepted are not looked at.
_POINTS_FOR_A_VERTEX = 8


class _Packer:
    """Packs the points of one message after another, convex ones into one array."""

    def __init__(self, max_vertices: int) -> None:
        self._max_vertices = max_vertices
        self._max_notched = max_vertices if COMPILED else min(max_vertices, _MOST_NOTCHED)
        # One more for a closing point; whoever sends yet more points is in no hurry.
        self._most_points = max_vertices + 1
        self._array = indexable(np.empty(packed_size(self._most_points)))

    def pack(self, points: Points) -> PackedBody:
        """
        Return the body that points make, good until the next call.

        Raises
        ------
        PolygonError
            If they make none.

        """
        count = points[2]
        if 0 < count <= self._most_points:
            vertices = pack_convex(*points, self._array, self._max_vertices)
            if vertices:
                return self._array, vertices
        most = _POINTS_FOR_A_VERTEX * self._max_vertices
        if count > most:
            raise PolygonError(Reason.TOO_MANY_VERTICES,
                               f'{count} points, of which at most {most} are looked at')
        return Polygon.from_float32(*points, self._max_vertices, self._max_notched).packed

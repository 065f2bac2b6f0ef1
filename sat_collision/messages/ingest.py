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

"""Ingest: one message after another is read, moved to the fixed frame and packed for the scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.polygon import PlaneMap, PolygonError
from sat_collision.geometry.run import Run
from sat_collision.messages.cdr import COUNT_SIZE, decode, MessageError, Points
from sat_collision.messages.packer import Packer, vertices_of
from sat_collision.messages.placement import Placement, points_of_run
from sat_collision.messages.rejections import (
    detail_of, EMPTY_FRAME_ID, LONG_FRAME_ID, Rejection, UNDECODABLE)
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.scene.frame_tree import LONGEST_FRAME_ID
from sat_collision.scene.frames import Mapped, NoTransform
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_INSTANCE, Settings)
from sat_collision.scene.velocity import Velocity
from sat_collision.scene.waiting import WAIT, Wait

_UNMOVED: PlaneMap = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


class Batch:
    """
    Messages that are taken together.

    Attributes
    ----------
    messages : sequence of tuple
        The serialised message, and which one of its publisher it is, where that is known.

    """

    def __init__(self, messages: Sequence[tuple[bytes, int | None]]) -> None:
        self.messages = messages
        self._joined: tuple[bytes, object] | None = None
        self._has_no_gap: bool | None = None

    def joined(self) -> tuple[bytes, object]:
        """Return all messages, one behind the other, and where each ends: (m,) array of int64."""
        if self._joined is None:
            data = [data for data, _ in self.messages]
            ends = np.cumsum(np.fromiter(map(len, data), np.int64, len(data)))
            self._joined = b''.join(data), indexable(ends)
        return self._joined

    def has_no_gap(self) -> bool:
        """Return whether each message is the next one of the publisher of the one before."""
        if self._has_no_gap is None:
            numbers = [number for _, number in self.messages]
            first = numbers[0]
            self._has_no_gap = numbers == ([None] * len(numbers) if first is None
                                           else [*range(first, first + len(numbers))])
        return self._has_no_gap


class Ingest:
    """
    Passes messages to a scene, or refuses them.

    Parameters
    ----------
    settings : Settings
    scene : Scene
    transforms : TransformListener or None
        None where what is not in the fixed frame is refused.
    watch_clock : callable
        Takes the present time in ns before a transform is asked for.
    placements : list of Placement, optional
        Gets what was taken.

    Attributes
    ----------
    rejected : Counter
        The messages that were not taken, by (name, reason).

    """

    def __init__(self, settings: Settings, scene: Scene, transforms: TransformListener | None,
                 watch_clock: Callable[[int], None],
                 placements: list[Placement] | None = None) -> None:
        self._placements = placements
        self.rejected: Counter[tuple[str, str]] = Counter()
        self._scene = scene
        self._transforms = transforms
        self._fixed = settings.frame_id
        self._watch_clock = watch_clock
        self._with_ids = {source.name for source in settings.obstacles
                          if source.type == POLYGON_INSTANCE}
        self._packer = Packer(settings.max_vertices)
        # The last obstacle that was received, which the messages of a run must be like: its
        # source, its bytes, where in them the points start, its stamp, its frame and where it was
        # moved.
        self._model: tuple[str, bytes, int, int, str, PlaneMap | None] = '', b'', 0, 0, '', None

    def take_run(self, settings: ObstacleSettings, batch: Batch, begin: int, now: int) -> int:
        """Pass messages like the one before them to the scene; return how many were taken."""
        source, model, points_at, stamp, frame_id, plane = self._model
        if source != settings.name or model is not batch.messages[begin - 1][0]:
            return 0
        data, ends = batch.joined()
        taken = self._scene.obstacle_run(settings.name, Run(
            data, ends, begin - 1, begin, points_at - COUNT_SIZE, self._packer.max_vertices,
            plane or _UNMOVED, self._packer.array), stamp, now)
        placements = self._placements
        if taken and placements is not None:
            first = begin
            if placements and placements[-1].points[0] is model:
                # The message that they are like begins the run.
                placements.pop()
                first -= 1
            points = points_of_run(data, ends, first, begin + taken, points_at)
            placements.append(Placement(settings.name, stamp, True, frame_id, points, plane, None))
        return taken

    def take(self, settings: FootprintSettings | ObstacleSettings, data: bytes,
             number: int | None, now: int, may_wait: bool = True) -> Rejection | Wait | None:
        """Pass a message to the scene; return WAIT if its transform may come, and it may wait."""
        scene, name = self._scene, settings.name
        stamp = instance = None
        try:
            stamp, frame_id, points, instance = decode(data, name in self._with_ids)
            plane: PlaneMap | None = None
            if not frame_id:
                return self.refuse(settings, EMPTY_FRAME_ID, 'its header names no frame', now,
                                   stamp, instance, number)
            if len(frame_id) > LONGEST_FRAME_ID:
                return self.refuse(
                    settings, LONG_FRAME_ID, f'{len(frame_id)} characters where '
                    f'{LONGEST_FRAME_ID} are accepted', now, stamp, instance, number)
            origin = None
            if self._transforms and frame_id != self._fixed and points[2]:
                self._watch_clock(now)
                found = self._transforms.plane(frame_id, stamp, now, settings.timeout)
                if isinstance(found, NoTransform):
                    if found.may_come and may_wait and stamp:
                        return WAIT
                    return self.refuse(settings, found.reason, found.detail, now, stamp,
                                       instance, number)
                plane, at = found
                origin, frame_id = (frame_id, at), self._fixed
            if isinstance(settings, FootprintSettings):
                refusal = scene.footprint(name, self._packer.pack(points, plane), frame_id,
                                          stamp, now, origin, number)
                if refusal is None and scene.is_tracked(name):
                    scene.track(name, vertices_of(points, plane))
            else:
                body = self._packer.pack(points, plane) if points[2] else None
                refusal = scene.obstacle(name, body, frame_id, stamp, now, instance, number)
                if settings.moving and body and instance is not None and refusal is None:
                    scene.track_obstacle(name, instance, vertices_of(points, plane), stamp, now)
        except MessageError as error:
            return self.refuse(settings, UNDECODABLE, str(error), now, number=number)
        except PolygonError as error:
            return self.refuse(settings, error.reason.value, str(error), now, stamp, instance,
                               number)
        if refusal is None:
            if self._placements is not None:
                self._placements.append(Placement(
                    name, stamp or now, stamp != 0, frame_id, points, plane, instance))
            if points[2] and points[0] is data:
                self._model = name, data, points[1], stamp, frame_id, plane
            return None
        return self.reject(settings, refusal, detail_of(
            refusal, frame_id, scene.frame_id, (now - stamp) / 1e9, settings.timeout))

    def place(self, settings: FootprintSettings, points: Points, found: Mapped, now: int,
              velocity_at: Callable[[Mapped], Velocity | None]) -> Rejection | None:
        """
        Place the outline of a footprint, given where its frame was found.

        Its velocity there is asked for only where it is tracked.
        """
        stamp = now if found.at is None else found.at
        try:
            refusal = self._scene.footprint(
                settings.name, self._packer.pack(points, found.plane), self._fixed, stamp, now,
                (settings.frame_id, found.at))
        except PolygonError as error:
            return self.refuse(settings, error.reason.value, str(error), now, stamp)
        if refusal is None:
            if self._scene.is_tracked(settings.name):
                self._scene.track(settings.name, vertices_of(points, found.plane),
                                  velocity_at(found))
            if self._placements is not None:
                self._placements.append(Placement(
                    settings.name, stamp, True, self._fixed, points, found.plane, None))
            return None
        return self.reject(settings, refusal, detail_of(
            refusal, self._fixed, self._fixed, (now - stamp) / 1e9, settings.timeout))

    def refuse(self, settings: FootprintSettings | ObstacleSettings, reason: str, detail: str,
               now: int, stamp: int | None = None, instance: int | None = None,
               number: int | None = None) -> Rejection:
        """Refuse a message that gives no polygon."""
        self._scene.refuse(settings.name, reason, now, stamp, instance, number)
        return self.reject(settings, reason, detail)

    def reject(self, settings: FootprintSettings | ObstacleSettings, reason: str,
               detail: str) -> Rejection:
        """Count a message that was not taken, and put it into words."""
        self.rejected[settings.name, reason] += 1
        return Rejection(settings.name, settings.topic, reason, detail)

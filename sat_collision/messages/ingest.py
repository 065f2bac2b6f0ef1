# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Ingest: reads messages, moves them to the fixed frame and packs them for the scene."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import accumulate, pairwise
from typing import Any, cast, NamedTuple

import numpy as np
from sat_collision.geometry.body.packing import SIZES, TRIPLE
from sat_collision.geometry.body.polygon import (
    Affine2D, PackedBody, Packer, Points, PolygonError, UNMOVED, vertices_of)
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.run import IN_ONE_MESSAGE, Run
from sat_collision.messages.cdr import (
    COUNT_SIZE, decode, decode_collection, decode_polygon_2d, header_stamp, MessageError,
    POINT_SIZE, RunPoints, STAMP_SIZE)
from sat_collision.messages.rejections import (
    detail_of, EMPTY_FRAME_ID, LONG_FRAME_ID, Rejection, UNDECODABLE)
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.scene.frames import LONGEST_FRAME_ID, Mapped, NoTransform
from sat_collision.scene.obstacle_store import Followed, Polygons, Shape, TOO_MANY
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import (
    CommandSettings, EACH_MESSAGE, EMPTY_POLYGON, FootprintSettings, in_ns, NEVER, NONE,
    ObstacleSettings, PathSettings, POLYGON, POLYGON_2D, POLYGON_COLLECTION, POLYGON_INSTANCE,
    Settings)
from sat_collision.scene.velocity import Velocity

_NO_ENDS = indexable(np.empty(0, np.int64))
_NO_POINTS: Points = (b'', 0, 0, TRIPLE)

_DECODERS: dict[str, Callable[[bytes], tuple[int, str, Any, int | None]]] = {
    POLYGON: partial(decode, instance=False), POLYGON_2D: decode_polygon_2d,
    POLYGON_COLLECTION: decode_collection, POLYGON_INSTANCE: partial(decode, instance=True)}


class Wait(NamedTuple):
    """The outcome of a message that must go on waiting: for a transform of a frame at a stamp."""

    frame_id: str
    stamp: int


class Batch:
    """Consecutive messages of one publisher."""

    __slots__ = 'messages', 'number', 'data', 'ends'

    def __init__(self, messages: Sequence[bytes], number: int | None = None) -> None:
        self.messages = messages
        self.number = number  # the sequence number of the first one, None if unknown
        self.data = b''.join(messages)
        # Ends in the data of all messages but the last one: (m - 1,) array of int64.
        self.ends: Any = _NO_ENDS
        if len(messages) > 1:
            self.ends = indexable(np.fromiter(accumulate(map(len, messages)), np.int64,
                                              len(messages) - 1))


class Placement(NamedTuple):
    """For recorded motion: a message that was applied, or a run of them."""

    name: str  # of the footprint or source of obstacles
    stamp: int  # in ns, the time of reception if it has none
    frame_id: str  # after the map is applied
    points: Points | RunPoints  # as received
    affine: Affine2D | None  # the map of the points to that frame, None if they are in it
    instance: int | None  # the obstacle's id, of a source that gives ids
    # Of an obstacle: number of the listing that it joined, 0 where nothing ends a listing; and of
    # the last whole listing, 0 for none.
    listing: int = 0
    last_whole: int = 0
    # Of a map in another frame: that frame. Without points: it has moved, by now to `affine`.
    sent_in: str = ''

    @property
    def is_empty(self) -> bool:
        """Whether the message has no points, which ends a set or a map."""
        return not self.points[2]

    @property
    def single(self) -> Points:
        """The points of a single message."""
        return cast(Points, self.points)

    @property
    def shape(self) -> bytes:
        """The bytes of the points of a single message."""
        data, start, count, step = self.single
        return data[start:start + SIZES[step] * count]

    def each(self) -> Iterator[Placement]:
        """Yield the messages of a run one by one."""
        data, ends, points_at, step = self.points
        if isinstance(ends, int):
            yield self
        elif points_at == IN_ONE_MESSAGE:
            for start, count in np.asarray(ends).reshape(-1, 2).tolist():
                yield self._replace(points=(data, start, count, step))
        else:
            for start, end in pairwise([0, *ends.tolist(), len(data)]):
                start += points_at
                yield self._replace(points=(data, start, (end - start) // POINT_SIZE, step))


class Ingest:
    """
    Decodes messages, places them in the fixed frame and applies them to a scene, or refuses them.

    If `transforms` is None, all messages in other frames are refused. `placements` receives the
    accepted messages. `max_non_convex` is the most vertices of a non-convex polygon, if fewer than
    of others.
    """

    def __init__(self, settings: Settings, scene: Scene, transforms: TransformListener | None,
                 placements: list[Placement] | None = None,
                 max_non_convex: int | None = None) -> None:
        self._placements = placements
        self.rejected: Counter[tuple[str, str]] = Counter()  # messages, by (name, reason)
        self._scene = scene
        self._transforms = transforms
        self._fixed = settings.frame_id
        self._decode = {one.name: _DECODERS[one.type] for one in settings.inputs}
        self._refused: list[tuple[int, PolygonError]] = []  # polygons of the last collection
        self._packer = Packer(settings.max_vertices, max_non_convex)
        # By source of a map: the frame of a message refused for lack of a transform.
        self.untransformed: dict[str, str] = {}
        # By source without ids, of the last obstacle accepted: the bytes between its stamp and its
        # point count, the offset of the points in the message, and the frame in which it was sent.
        self.headers: dict[str, tuple[bytes, int, str] | None] = {
            source.name: None for source in settings.obstacles if source.type == POLYGON}
        # By source of a map, for each other frame in which it was sent: the affine map from there.
        self._followed: dict[str, dict[str, Affine2D]] = {}

    def apply_run(self, name: str, batch: Batch, begin: int, now: int) -> int:
        """Apply messages of one stamp in the frame of the one before; return how many."""
        if (header := self.headers.get(name)) is None:
            return 0
        after_stamp, points_at, frame_id = header
        message = batch.messages[begin]
        if message[STAMP_SIZE:points_at - COUNT_SIZE] != after_stamp:
            return 0
        stamp = header_stamp(message)
        affine = None
        if self._transforms and frame_id != self._fixed:
            settings = self._scene.settings_of(name)
            found = self._lookup(settings, frame_id, stamp, now)
            if isinstance(found, NoTransform) or not settings.timeout:
                return 0
            affine, frame_id = found.affine, self._fixed
        applied = self._scene.obstacle_run(
            name, (batch.data, batch.ends, begin, points_at - COUNT_SIZE, affine or UNMOVED,
                   self._packer.max_vertices, self._packer.array),
            frame_id, stamp, now, batch.number and batch.number + begin)
        placements = self._placements
        if applied and placements is not None:
            if applied < len(batch.messages):
                batch = Batch(batch.messages[begin:begin + applied])
            placements.append(Placement(
                name, stamp, frame_id, (batch.data, batch.ends, points_at, TRIPLE), affine, None,
                *self._scene.joined(name)))
        return applied

    def apply(self, settings: FootprintSettings | ObstacleSettings, data: bytes,
              number: int | None, now: int, arrived: int,
              may_wait: bool = True) -> Rejection | Wait | None:
        """
        Apply a message; return a Wait if it may wait and its transform may still arrive.

        One of stamp 0 counts from when it `arrived`.
        """
        scene, name = self._scene, settings.name
        stamp = instance = None
        try:
            sent, sent_in, points, instance = self._read(settings, data, now)
            stamp = self._stamp_of(settings, sent, points, min(arrived, now))
            frame_id = sent_in
            affine: Affine2D | None = None
            origin, followed = None, ''
            if points[2] and not 0 < len(frame_id) <= LONGEST_FRAME_ID:
                fault = EMPTY_FRAME_ID, 'its header names no frame'
                if frame_id:
                    fault = LONG_FRAME_ID, (f'{len(frame_id)} characters where '
                                            f'{LONGEST_FRAME_ID} are accepted')
                return self.refuse(settings, *fault, now, stamp, instance, number)
            if self._transforms and points[2] and self._needs_transform(frame_id, sent, now):
                found = self._lookup(settings, frame_id, sent, now)
                if isinstance(found, NoTransform):
                    if found.may_come and may_wait and sent:
                        return Wait(frame_id, sent)
                    if isinstance(settings, ObstacleSettings) and not settings.timeout:
                        self.untransformed[name] = frame_id
                    scene.refuse(name, found.lasting, now, stamp, instance, number)
                    self._note_alive(name, now, stamp, instance)
                    return self.reject(settings, found.reason, found.detail)
                affine, at = found
                origin, frame_id = (frame_id, at), self._fixed
                if isinstance(settings, FootprintSettings):
                    # Without a stamp it is as old as the transform that says where it is.
                    stamp = sent or at or stamp
            if isinstance(settings, FootprintSettings):
                body = self._packer.pack(points, affine or UNMOVED)
                refusal = scene.footprint(name, body, frame_id, stamp, now, origin, number)
                if refusal is None and scene.is_tracked(name):
                    scene.track(name, vertices_of(points, affine))
            else:
                if affine and not settings.timeout:
                    followed = sent_in
                obstacle = self._shape(settings, points, affine, followed) if points[2] else None
                refusal = scene.obstacle(name, obstacle, frame_id, stamp, now, instance, number)
                if followed and self._followed.setdefault(name, {}).get(followed) != affine:
                    self.follow_maps(now)
                if settings.moving and obstacle and instance is not None and refusal is None:
                    scene.sources[name].track(instance, stamp or now, vertices_of(points, affine))
        except (MessageError, PolygonError) as error:
            return self.refuse(settings, _reason_of(error), str(error), now, stamp, instance,
                               number)
        refused, self._refused = self._refused, []
        if refusal is None or refused or (
                refusal == TOO_MANY and settings.type == POLYGON_COLLECTION):
            if self._placements is not None:
                if refusal is not None:
                    points = _placed(points, [k for k, _ in refused],
                                     scene.sources[name].settings.max_count)
                self._placements.append(Placement(
                    name, stamp or now, frame_id, points, affine, instance, *scene.joined(name),
                    followed))
            if refused:
                examples: dict[str, str] = {}  # the first polygon of each reason
                for k, problem in refused:
                    self.rejected[name, problem.reason.value] += 1
                    examples.setdefault(problem.reason.value, f'polygon {k}: {problem}')
                return Rejection(name, settings.topic, next(iter(examples)),
                                 '; '.join(examples.values()))
        if refusal is None:
            if name in self.headers and points[2] and points[0] is data:
                self.headers[name] = (data[STAMP_SIZE:points[1] - COUNT_SIZE], points[1], sent_in)
            return None
        self._note_alive(name, now, stamp, instance, refusal)
        return self.reject(settings, refusal, detail_of(
            refusal, frame_id, scene.frame_id, (now - stamp) / 1e9, settings.timeout))

    def apply_early(self, settings: ObstacleSettings, data: bytes, now: int,
                    order: int) -> Wait | None:
        """
        Let an obstacle count that is queued behind a message which waits.

        The order is its number in the queue. Return a Wait if its transform may still arrive.
        """
        body: Shape | None = None
        stamp, instance, refusal = 0, None, None
        try:
            stamp, frame_id, points, instance = self._read(settings, data, now)
            if not points[2]:
                return None
            affine = UNMOVED
            if self._needs_transform(frame_id, stamp, now):
                found = self._lookup(settings, frame_id, stamp, now)
                if isinstance(found, NoTransform):
                    if found.may_come and stamp:
                        return Wait(frame_id, stamp)
                    refusal = found.lasting
                else:
                    affine = found.affine
            if not refusal:
                body = self._shape(settings, points, affine)
        except (MessageError, PolygonError) as error:
            refusal = _reason_of(error)
        self._scene.receive_early(settings.name, body, stamp, order, instance, refusal)
        self._refused = []
        return None

    def end_of(self, settings: ObstacleSettings, data: bytes, now: int) -> float | None:
        """
        Return the stamp of the newest messages that one replaces which ends a listing.

        NEVER where stamps are not compared; None if it ends none.
        """
        if settings.ending not in (EACH_MESSAGE, EMPTY_POLYGON):
            return None
        try:
            stamp, _, points, _ = self._read(settings, data, now)
        except MessageError:
            return None
        if settings.ending == EMPTY_POLYGON:
            return None if points[2] else NEVER
        if self._is_from_future(stamp, now):
            return None
        return stamp or NEVER if settings.timeout else NEVER

    def _read(self, settings: FootprintSettings | ObstacleSettings, data: bytes,
              now: int) -> tuple[int, str, Any, int | None]:
        """Return stamp, frame, points and instance of a message."""
        stamp, frame_id, points, instance = self._decode[settings.name](data)
        if not settings.timeout and isinstance(settings, ObstacleSettings):
            # A map does not age, and may have been kept since the clock was set back.
            stamp = min(stamp, now)
        return stamp, frame_id, points, instance

    @staticmethod
    def _stamp_of(settings: FootprintSettings | ObstacleSettings, sent: int, points: Any,
                  arrived: int) -> int:
        """Return the stamp from which a message counts: one of stamp 0 from its arrival."""
        # Where nothing ends a set, an empty polygon shows only by a stamp of its own that its
        # publisher is alive.
        shows_nothing = (isinstance(settings, ObstacleSettings) and settings.ending == NONE
                         and not points[2])
        return sent if shows_nothing else sent or arrived

    def _needs_transform(self, frame_id: str, stamp: int, now: int) -> bool:
        """Return whether a message is in another frame; one from the future is refused in any."""
        return frame_id != self._fixed and not self._is_from_future(stamp, now)

    def _is_from_future(self, stamp: int, now: int) -> bool:
        return stamp > now and self._scene.from_future(stamp) is not None

    def _shape(self, settings: ObstacleSettings, points: Any, affine: Affine2D | None,
               followed: str = '') -> Shape:
        """Return what a message with points places, in a frame to follow, until the next call."""
        def packed(one: Points) -> PackedBody | Followed:
            body = self._packer.pack(one, affine or UNMOVED)
            return Followed(body, (followed, one)) if followed else body

        if settings.type != POLYGON_COLLECTION:
            return packed(points)
        data, spans, _, step = points
        self._refused.clear()

        def run(first: int) -> Run:
            return (data, spans, first, IN_ONE_MESSAGE, affine or UNMOVED,
                    self._packer.max_vertices, self._packer.array)

        def body(k: int) -> tuple[PackedBody | Followed | None, str | None]:
            try:
                return packed((data, int(spans[2 * k]), int(spans[2 * k + 1]), step)), None
            except PolygonError as error:
                self._refused.append((k, error))
                return None, error.reason.value
        return Polygons(len(spans) // 2, None if followed else run, body)

    def follow_maps(self, now: int) -> None:
        """Place maps anew whose frames have moved; one whose frame is not known is not known."""
        for name, affines in self._followed.items():
            limits: dict[str, tuple[str, float]] = {}
            timeout = in_ns(self._scene.footprint_timeout(name))
            frames = self._scene.sources[name].store.frames
            for frame_id in affines.keys() - frames:
                del affines[frame_id]
            for frame_id in frames:
                found = self._lookup(self._scene.settings_of(name), frame_id, now, now)
                if isinstance(found, NoTransform):
                    limits[frame_id] = f'is a map in another frame: {found.detail}', NEVER
                    continue
                limits[frame_id] = '', NEVER if found.at is None else found.at + timeout
                if found.affine != affines.get(frame_id):
                    affines[frame_id] = found.affine
                    self._scene.follow_frame(name, frame_id, partial(self._body_at, found.affine))
                    if self._placements is not None:
                        self._placements.append(Placement(
                            name, now, self._fixed, _NO_POINTS, found.affine, None,
                            sent_in=frame_id))
            self._scene.limit_frames(name, limits)

    def _body_at(self, affine: Affine2D, sent: tuple[str, Points]) -> PackedBody | None:
        """Return a body of a map in its frame as it is now, None if that is not valid."""
        try:
            return self._packer.pack(sent[1], affine)
        except PolygonError:
            return None

    def _lookup(self, settings: FootprintSettings | ObstacleSettings, frame_id: str, stamp: int,
                now: int) -> Mapped | NoTransform:
        """Return the map of a message to the fixed frame; a map follows its frame."""
        assert self._transforms
        if isinstance(settings, ObstacleSettings) and not settings.timeout:
            return self._transforms.lookup_affine(
                frame_id, 0, now, self._scene.footprint_timeout(settings.name))
        return self._transforms.lookup_affine(frame_id, stamp, now, settings.timeout)

    def place_outline(self, settings: FootprintSettings, points: Points, found: Mapped, now: int,
                      velocity_at: Callable[[Mapped], Velocity | None]) -> Rejection | None:
        """
        Place the outline of a footprint where its frame was found.

        `velocity_at` is called only if the footprint's motion is tracked.
        """
        stamp = now if found.at is None else found.at
        try:
            refusal = self._scene.footprint(
                settings.name, self._packer.pack(points, found.affine), self._fixed, stamp, now,
                (settings.frame_id, found.at))
        except PolygonError as error:
            return self.refuse(settings, error.reason.value, str(error), now, stamp)
        if refusal is None:
            if self._scene.is_tracked(settings.name):
                self._scene.track(settings.name, vertices_of(points, found.affine),
                                  velocity_at(found))
            if self._placements is not None:
                self._placements.append(Placement(
                    settings.name, stamp, self._fixed, points, found.affine, None))
            return None
        return self.reject(settings, refusal, detail_of(
            refusal, self._fixed, self._fixed, (now - stamp) / 1e9, settings.timeout))

    def refuse_outline(self, settings: FootprintSettings, found: NoTransform,
                       now: int) -> Rejection:
        """Refuse an outline whose frame has no transform."""
        self._scene.refuse(settings.name, found.lasting, now)
        return self.reject(settings, found.reason, found.detail)

    def refuse(self, settings: FootprintSettings | ObstacleSettings, reason: str, detail: str,
               now: int, stamp: int | None = None, instance: int | None = None,
               number: int | None = None) -> Rejection:
        """Refuse a message that gives no valid polygon."""
        self._scene.refuse(settings.name, reason, now, stamp, instance, number)
        self._note_alive(settings.name, now, stamp, instance)
        return self.reject(settings, reason, detail)

    def _note_alive(self, name: str, now: int, stamp: int | None, instance: int | None,
                    refusal: str = '') -> None:
        """
        Let recorded motion know by a refused message that its publisher is alive, as live.

        That is by one with an id, and by one too many where nothing ends a listing.
        """
        if self._placements is not None and stamp is not None and stamp <= now and (
                instance or refusal == TOO_MANY and (
                    self._scene.sources[name].settings.ending == NONE)):
            self._placements.append(Placement(
                name, stamp or now, self._fixed, _NO_POINTS, None, None,
                *self._scene.joined(name)))

    def reject(self, settings: (FootprintSettings | ObstacleSettings | CommandSettings
                                | PathSettings), reason: str, detail: str) -> Rejection:
        """Count a refused message and return its Rejection."""
        self.rejected[settings.name, reason] += 1
        return Rejection(settings.name, settings.topic, reason, detail)


def _placed(points: RunPoints, refused: Sequence[int], most: int) -> RunPoints:
    """Return the points of those polygons of a collection that were placed."""
    data, spans, in_one, step = points
    first = np.asarray(spans).reshape(-1, 2)[:most]
    return data, np.delete(first, [k for k in refused if k < most], 0).ravel(), in_one, step


def _reason_of(error: MessageError | PolygonError) -> str:
    return error.reason.value if isinstance(error, PolygonError) else UNDECODABLE

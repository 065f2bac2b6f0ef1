# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Footprints without a publisher: an outline, a frame that moves it, and its commands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
import struct

from sat_collision.geometry.body.packing import TRIPLE
from sat_collision.geometry.body.polygon import Affine2D, Points, Polygon, UNMOVED
from sat_collision.messages.cdr import decode_command, decode_odometry, MessageError
from sat_collision.messages.ingest import Ingest
from sat_collision.messages.rejections import (
    BAD_COMMAND, COMMAND_FRAME, detail_of, OTHER_BODY, Rejection, UNDECODABLE)
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.scene.frames import in_quotes, Mapped, NoTransform
from sat_collision.scene.parameters import Outline, outline_of
from sat_collision.scene.scene import FROM_FUTURE, Scene
from sat_collision.scene.settings import (
    CommandSettings, FootprintSettings, in_ns, NEVER, Settings)
from sat_collision.scene.sources import TOO_OLD
from sat_collision.scene.velocity import (
    AT_REST, COMMAND, Command, is_plausible, is_upside_down, ODOMETRY, Pose, pose_of, TRANSFORMS,
    Twist, Velocity, VELOCITY_LASTS)

# An outline in a static frame is placed again so many times within its timeout.
_TIMES_PLACED = 3


class Outlines:
    """
    Places outlines in the scene whenever their frames have moved.

    `transforms` also receives the odometry. `received` counts poses of outlines that move by /tf.
    """

    def __init__(self, settings: Settings, ingest: Ingest, transforms: TransformListener,
                 received: Counter[str]) -> None:
        self._ingest = ingest
        self._received = received
        self._transforms = transforms
        self._outlines = {one.name: _PlacedOutline(one, settings.max_vertices)
                          for one in settings.footprints if one.has_outline}
        self.names = frozenset(self._outlines)
        # Of the newest message of each topic of odometry: time, child frame and twist.
        self._odometry: dict[str, tuple[int, str, Twist]] = {}
        # Whether frames that are static are to be looked up although no message comes.
        self._is_clock_new = True
        # Whether a message of transforms, or of odometry, has come since the clock began.
        self._has_transforms = False
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply settings; a changed outline counts at once."""
        self._timeout = round(settings.transform_timeout * 1e9)
        for footprint in settings.footprints:
            if footprint.name in self._outlines:
                self._outlines[footprint.name].configure(footprint, settings.max_vertices)

    def clear(self) -> None:
        """Forget all places: the clock was set back."""
        self._odometry.clear()
        self._is_clock_new, self._has_transforms = True, False
        for one in self._outlines.values():
            one.forget()

    def limit_times(self, now: int) -> None:
        """Let no place be ahead of a clock that went back a little: the next one counts."""
        self._odometry.clear()
        for one in self._outlines.values():
            one.next = min(one.next, now)
            if one.is_static and one.stamp is not None:
                one.stamp = min(one.stamp, now)

    def receive(self, name: str, data: bytes, now: int, arrived: int) -> list[Rejection]:
        """Take a message of odometry for a footprint, which `arrived` then."""
        settings = self._outlines[name].settings
        try:
            pose, twist = decode_odometry(data)
        except MessageError as error:
            return [self._ingest.reject(settings, UNDECODABLE, str(error))]
        if problem := self._transforms.take(pose, now, arrived):
            return [self._ingest.reject(settings, *problem)]
        parent, child, stamp, _ = pose
        parent, child = parent.removeprefix('/'), child.removeprefix('/')
        if not self._transforms.frames.is_carried(settings.frame_id, child, parent):
            return [self._ingest.reject(settings, OTHER_BODY, (
                f'it is of {in_quotes(child)}, with which {in_quotes(settings.frame_id)} does not '
                'move'))]
        # The first of several footprints that receive a message moves all of them. One that is
        # ahead of the clock must not shut out those that follow.
        time = stamp or arrived
        if settings.topic not in self._odometry or (
                not time < self._odometry[settings.topic][0] <= now):
            self._odometry[settings.topic] = time, child, twist
        return []

    def follow(self, now: int, has_received: bool = False) -> list[Rejection]:
        """Place the outlines that have moved, once there is a clock; say if a message has come."""
        self._has_transforms |= has_received
        if not now:
            return []
        rejections = [rejection for one in self._outlines.values()
                      if (rejection := self._follow(one, now))]
        self._is_clock_new = False
        return rejections

    def pose(self, name: str) -> Pose:
        """Return x, y and yaw of the frame of an outline that is placed."""
        return pose_of(self._outlines[name].affine)

    def polygon(self, name: str) -> Polygon:
        """Return an outline in its own frame; if that is upside down, turned up about x."""
        polygon = self._outlines[name].polygon
        return (Polygon(polygon.vertices * (1, -1)) if is_upside_down(self._outlines[name].affine)
                else polygon)

    def moving_frames(self) -> set[str]:
        """Return the frames by whose transforms on /tf outlines move."""
        return {self._transforms.frames.moving_frame(settings.frame_id) for one in
                self._outlines.values() if not (settings := one.settings).odometry}

    @property
    def deadline(self) -> float:
        """The time in ns until which nothing is to be placed unless a message comes."""
        if self._is_clock_new:
            return 0
        return min((one.due(self._timeout) for one in self._outlines.values()), default=NEVER)

    def _follow(self, one: _PlacedOutline, now: int) -> Rejection | None:
        """Place an outline, if its frame has moved and it is not too soon."""
        settings = one.settings
        if not settings.enabled:
            return None
        if now + one.period < one.next:
            one.is_pending = True
            return None
        one.is_pending = False
        if one.begun is None and self._has_transforms:
            one.begun = now
        found = self._transforms.lookup_affine(settings.frame_id, 0, now)
        if isinstance(found, NoTransform):
            one.is_static = False
            has_waited = (one.stamp is None and one.begun is not None
                          and now > one.begun + self._timeout)
            if one.fault == found.lasting or found.may_come and not has_waited:
                return None
            one.forget(found.lasting)
            return self._ingest.refuse_outline(settings, found, now)
        if not one.is_moved(found, now):
            return None
        one.next = max(one.next, now) + one.period
        one.stamp = now if found.at is None else found.at
        one.affine, one.fault, one.is_static = found.affine, '', found.at is None
        if not settings.odometry:
            self._received[settings.name] += 1
        return self._ingest.place_outline(settings, one.points, found, now,
                                          partial(self._velocity, one))

    def _velocity(self, one: _PlacedOutline, found: Mapped) -> Velocity | None:
        """Return the velocity given for an outline, whose frame was found; None if none is."""
        if one.settings.cmd_vel or found.at is None:
            # With commands only the pose counts: the twist is that of the command.
            return Velocity.in_frame(found.affine, AT_REST,
                                     COMMAND if one.settings.cmd_vel else TRANSFORMS)
        if one.settings.topic not in self._odometry:
            return None
        time, child, twist = self._odometry[one.settings.topic]
        if found.at - time > min(in_ns(one.settings.timeout), VELOCITY_LASTS):
            # Another publisher moves its frame by now.
            return None
        where = self._transforms.lookup_affine(child, found.at, found.at)
        is_fixed = self._transforms.frames.newest(child, one.settings.frame_id) is None
        if not is_fixed or isinstance(where, NoTransform):
            # The outline may turn in the frame of the odometry.
            return None
        return Velocity.in_frame(where.affine, twist, ODOMETRY)


class Commands:
    """
    Passes commands to a scene, of which the last counts, or refuses them.

    A refused command replaces the one before: the velocity is then unknown.
    """

    def __init__(self, settings: Settings, ingest: Ingest, scene: Scene) -> None:
        self._ingest = ingest
        self._scene = scene
        self.names = frozenset(one.command.name for one in settings.footprints if one.command)
        # The last command, by these names.
        self.last: dict[str, Command] = {}

    def receive(self, name: str, messages: Sequence[bytes], now: int,
                arrived: int) -> list[Rejection]:
        """Take serialised TwistStamped messages, oldest first, which `arrived` then."""
        return [rejection for one in self._scene.settings.footprints
                if one.command and one.command.name == name and one.enabled
                for data in messages
                if (rejection := self._receive(one, one.command, data, now, arrived))]

    def _receive(self, footprint: FootprintSettings, settings: CommandSettings, data: bytes,
                 now: int, arrived: int) -> Rejection | None:
        problem = None
        time = now
        try:
            stamp, frame_id, twist = decode_command(data)
        except MessageError as error:
            problem = UNDECODABLE, str(error)
        else:
            stamp = stamp or arrived
            time = min(stamp, now)
            age = (now - stamp) / 1e9 if now and stamp else 0.0
            if frame_id not in ('', footprint.frame_id):
                problem = COMMAND_FRAME, (f'it is in {in_quotes(frame_id)}, the outline in '
                                          f'{in_quotes(footprint.frame_id)}')
            elif not is_plausible(twist):
                problem = BAD_COMMAND, '{:g} m/s, {:g} m/s, {:g} rad/s'.format(*twist)
            elif age > settings.timeout or -age > self._scene.settings.future_tolerance:
                reason = TOO_OLD if age > 0.0 else FROM_FUTURE
                problem = reason, detail_of(reason, '', '', age, settings.timeout)
        command = Command(now, refusal=problem[0]) if problem else Command(time, twist)
        self.last[settings.name] = command
        self._scene.command(footprint.name, command)
        return self._ingest.reject(settings, *problem) if problem else None


class _PlacedOutline:
    """The outline of a footprint, and where it was placed last."""

    def __init__(self, footprint: FootprintSettings, max_vertices: int) -> None:
        self.begun: int | None = None
        self._outline: Outline = ()
        self.configure(footprint, max_vertices)
        self.forget()

    def configure(self, footprint: FootprintSettings, max_vertices: int) -> None:
        self.settings = footprint
        # The least time between two placements, on average, in ns.
        self.period = round(1e9 / footprint.rate)
        outline = outline_of(footprint, max_vertices)
        if outline != self._outline or not footprint.enabled:
            self._outline = outline
            self.polygon = Polygon(outline, max_vertices)
            self.points: Points = (b''.join(struct.pack('=3f', x, y, 0.0) for x, y in outline), 0,
                                   len(outline), TRIPLE)
            self.forget()
            # Until it is placed it is unknown, which the scene must learn at once.
            self.begun = 0

    def forget(self, fault: str = '') -> None:
        self.stamp: int | None = None  # of its last place
        self.affine: Affine2D = UNMOVED  # that place
        self.is_static = False  # whether its frame is
        self.next = 0  # when it is due again
        self.is_pending = False  # whether it may have moved when that was too soon
        self.fault = fault  # why it has no place, as last reported
        self.begun = None  # since when it has waited for one

    def is_moved(self, found: Mapped, now: int) -> bool:
        """
        Return whether a place differs from the last one, or is to be refreshed.

        Its time may be older than that of the last one, where frames above it have changed.
        """
        if self.is_static != (found.at is None) or found.affine != self.affine:
            return True
        return now >= self._refreshed if found.at is None else found.at != self.stamp

    def due(self, timeout: int) -> float:
        """Return when it must be checked even without a message, in ns."""
        if self.is_pending:
            return self.next - self.period - 1
        if self.is_static:
            return self._refreshed - 1
        is_waiting = self.stamp is None and not self.fault and self.settings.enabled
        if is_waiting and self.begun is not None:
            return self.begun + timeout
        return NEVER

    @property
    def _refreshed(self) -> float:
        """When a place in a static frame is refreshed, so that it does not grow too old."""
        if self.stamp is None or not self.settings.timeout:
            return NEVER
        return self.stamp + max(self.period, round(1e9 * self.settings.timeout / _TIMES_PLACED))

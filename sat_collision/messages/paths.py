# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The paths that footprints are about to follow: received, placed, and checked when due."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
import math

import numpy as np
from sat_collision.messages.cdr import decode_path, MessageError, PoseFrameError
from sat_collision.messages.ingest import Ingest
from sat_collision.messages.outlines import Outlines
from sat_collision.messages.rejections import (
    BAD_PATH, detail_of, EMPTY_FRAME_ID, NO_ORIENTATION, POSE_FRAME, Rejection, TOO_MANY_POSES,
    UNDECODABLE)
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.scene.footprints import Status
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.path import FollowedPath, PathCheck
from sat_collision.scene.scene import FROM_FUTURE, Scene
from sat_collision.scene.settings import FootprintSettings, PathSettings

# Numbers of poses beyond this might overflow.
_FARTHEST = 1e100


class Paths:
    """
    Keeps the latest path of each footprint, and checks it.

    Receiving only keeps the bytes; all else is done by `check`, which is called after flags.
    """

    def __init__(self, ingest: Ingest, scene: Scene, transforms: TransformListener,
                 outlines: Outlines) -> None:
        self._ingest = ingest
        self._scene = scene
        self._transforms = transforms
        self._outlines = outlines
        self.names = frozenset(path.name for one in scene.settings.footprints
                               if (path := one.path_settings))
        self.clear()

    def receive(self, name: str, data: bytes) -> None:
        """Take a serialised Path, which replaces the one before."""
        self.latest[name] = ReceivedPath(data)

    def note_fault(self, name: str, fault: str) -> None:
        """Record why no path can come, as a sentence; the last one still counts."""
        self.latest[name].fault = fault

    def clear(self) -> None:
        """Forget all paths: the clock was set."""
        self.latest = {name: ReceivedPath() for name in self.names}

    def check(self, now: int, footprints: Iterable[FootprintSettings] | None = None,
              measures: bool = True) -> list[Rejection]:
        """
        Check the paths of some footprints, by default of all; the scene keeps the answers.

        Where `measures` is false they are only read and placed, for which no kernel is needed.
        """
        rejections: list[Rejection] = []
        for footprint in self._scene.settings.footprints if footprints is None else footprints:
            if settings := footprint.path_settings:
                rejections += self.read(settings, now)
                latest = self.latest[settings.name]
                if measures:
                    self._scene.path_checks[footprint.name] = self.check_one(
                        footprint, latest, now)
                else:
                    self._place(latest, now)
        return rejections

    def read(self, settings: PathSettings, now: int) -> list[Rejection]:
        """Decode a path that was received, once the clock runs; return why it is refused if so."""
        latest, most = self.latest[settings.name], self._scene.settings.max_path_poses
        if not now or latest.data is None:
            return []
        data, latest.data = latest.data, None
        try:
            latest.stamp, latest.frame_id, poses = decode_path(data, most)
        except MessageError as error:
            problem = (POSE_FRAME if isinstance(error, PoseFrameError) else UNDECODABLE,
                       str(error))
        else:
            if isinstance(poses, int):
                problem = TOO_MANY_POSES, f'{poses} poses, where max_path_poses is {most}'
            elif not len(poses):
                latest.problem = f'no plan, as the last path on {settings.topic} is empty'
                return []
            elif not (np.abs(poses) < _FARTHEST).all():
                problem = BAD_PATH, f'a number is not finite, or beyond {_FARTHEST:g}'
            elif not latest.frame_id:
                problem = EMPTY_FRAME_ID, 'its header names no frame'
            elif latest.stamp > now + self._scene.settings.future_tolerance * 1e9:
                problem = FROM_FUTURE, detail_of(
                    FROM_FUTURE, '', '', (now - latest.stamp) / 1e9, 0.0)
            else:
                path = FollowedPath(poses)
                unknown = np.flatnonzero(np.isnan(path.poses[:, 2]))
                if not len(unknown):
                    latest.path = path
                    return []
                problem = NO_ORIENTATION, f'the quaternion of pose {unknown[0]} is zero'
        latest.problem = f'the last path on {settings.topic} was refused: {problem[0]}'
        return [self._ingest.reject(settings, *problem)]

    def check_one(self, footprint: FootprintSettings, latest: ReceivedPath, now: int,
                  is_plan: bool = False) -> PathCheck:
        """
        Check a path that was read.

        Of a plan the whole is checked while it is not known where the footprint is.
        """
        scene, name = self._scene, footprint.name
        # Whatever else is unknown: later its transform is not kept any more.
        missing = self._place(latest, now)
        if scene.status(name) is Status.UNKNOWN and (
                reasons := scene.faults_around(name) if is_plan else scene.state(name).reasons):
            return PathCheck(math.nan, '; '.join(reasons))
        path = latest.path
        if path is None:
            return PathCheck(math.nan, latest.problem or latest.fault or
                             f'no path on {footprint.path} yet')
        if missing:
            return PathCheck(math.nan, f'the path on {footprint.path} has no place: '
                                       f'{missing.lasting}', may_come=missing.may_come)
        outline = self._outlines.polygon(name)
        try:
            if scene.is_placed(name):
                path.advance(self._outlines.pose(name), float(np.hypot(*outline.vertices.T).max()))
            return scene.check_path(name, path, outline)
        except ValueError as error:
            return PathCheck(math.nan, f'the path on {footprint.path} cannot be checked: {error}')

    def _place(self, latest: ReceivedPath, now: int) -> NoTransform | None:
        """Move a path to the fixed frame, once; return why that cannot be done yet."""
        frame_id = self._scene.frame_id
        if latest.path and latest.frame_id != frame_id:
            found = self._transforms.lookup_affine(latest.frame_id, latest.stamp, now)
            if isinstance(found, NoTransform):
                return found
            latest.path.move(found.affine)
            latest.frame_id = frame_id
        return None


@dataclass
class ReceivedPath:
    """The last path on a topic, if any."""

    data: bytes | None = None  # while it is to be decoded
    stamp: int = 0
    frame_id: str = ''  # that it is in: as sent, until it is moved to the fixed one
    path: FollowedPath | None = None  # None, too, if it is empty or was refused
    problem: str = ''  # why there is none
    fault: str = ''  # why no other can come

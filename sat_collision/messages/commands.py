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

"""Commands: the velocities that robots are told to drive at, by which contacts are predicted."""

from __future__ import annotations

from collections.abc import Sequence

from sat_collision.messages.cdr import MessageError
from sat_collision.messages.ingest import Ingest
from sat_collision.messages.rejections import (
    BAD_COMMAND, COMMAND_FRAME, detail_of, Rejection, UNDECODABLE)
from sat_collision.messages.transform_listener import decode_command
from sat_collision.scene.frame_tree import in_quotes
from sat_collision.scene.scene import FROM_FUTURE, Scene
from sat_collision.scene.settings import CommandSettings, FootprintSettings, Settings
from sat_collision.scene.sources import TOO_OLD
from sat_collision.scene.velocity import Command, is_plausible


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

    def receive(self, name: str, messages: Sequence[bytes], now: int) -> list[Rejection]:
        """Take serialised TwistStamped messages, oldest first."""
        return [rejection for one in self._scene.settings.footprints
                if one.command and one.command.name == name and one.enabled
                for data in messages
                if (rejection := self._receive(one, one.command, data, now))]

    def _receive(self, footprint: FootprintSettings, settings: CommandSettings, data: bytes,
                 now: int) -> Rejection | None:
        problem = None
        time = now
        try:
            stamp, frame_id, twist = decode_command(data)
        except MessageError as error:
            problem = UNDECODABLE, str(error)
        else:
            time = stamp if 0 < stamp < now else now
            age = (now - stamp) / 1e9 if now and stamp > 0 else 0.0
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

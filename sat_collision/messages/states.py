# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""States of footprints as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from sat_collision.messages.interfaces import (
    DiagnosticArray, DiagnosticStatus, KeyValue, serialize)
from sat_collision.scene.footprints import State, Status
from sat_collision.scene.frames import in_words as name_in_words
from sat_collision.scene.prediction import Prediction
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import Settings
from sat_collision.scene.view import Nearest

_LEVELS = {Status.CLEAR: DiagnosticStatus.OK, Status.IMMINENT: DiagnosticStatus.WARN,
           Status.COLLISION: DiagnosticStatus.ERROR, Status.UNKNOWN: DiagnosticStatus.STALE}
_NAMED_IN_MESSAGE = 3
_NOT_MEASURED = 'distances are not measured yet: their kernels are being compiled'
_MOVING = ('age', 'least separation', 'nearest obstacle', 'nearest obstacle is newer by',
           'contacts are newer by', 'frame', 'age of transform', 'time to collision',
           'first contact with', 'path contact', 'velocity', 'obstacles of unknown motion')


def in_words(state: State, margin: float = 0.0, prediction: Prediction | None = None) -> str:
    """Return a state in a few words; the prediction is that of an imminent collision."""
    if state.status is Status.IMMINENT and prediction and prediction.obstacle:
        most = '' if prediction.is_known else 'at most '
        return f'collision with {prediction.obstacle} in {most}{prediction.seconds:.1f} s'
    if state.status is Status.COLLISION and state.contacts:
        names = [str(obstacle) for obstacle in state.contacts[:_NAMED_IN_MESSAGE]]
        more = len(state.contacts) - len(names)
        verb = f'within {margin:g} m of' if margin else 'in contact with'
        return f'{verb} {", ".join(names)}' + (f' and {more} more' if more else '')
    word = state.status.value
    return f'{word}: {"; ".join(state.reasons)}' if state.reasons else word


def coordinate_step(scene: Scene, name: str) -> float:
    """Return the float32 step (m) of coordinates sent in the fixed frame, 0 of others."""
    polygon = scene.polygon(name)
    if polygon is None or scene.origin(name)[0] != scene.frame_id:
        return 0.0
    return float(np.spacing(np.float32(np.abs(polygon.bounds).max())))


class States:
    """One status a footprint; with `moving`, as in ~/state, with what changes all the time too."""

    def __init__(self, node_name: str, settings: Settings, moving: bool = True) -> None:
        self.settings = settings
        sources = [f'source {one.name}' for one in settings.obstacles]
        keys = ('state', 'obstacles in contact', *((*_MOVING, *sources) if moving else ()),
                'reason')
        self._statuses = {one.name: DiagnosticStatus(
            name=f'{node_name}: {one.name}', hardware_id=one.topic,
            values=[KeyValue(key=key) for key in keys]) for one in settings.footprints}
        self._packed = dict.fromkeys(self._statuses, b'')

    def update(self, scene: Scene) -> None:
        for name in self._statuses:
            self.write(name, scene.state(name), coordinate_step(scene, name))

    def write(self, name: str, state: State, step: float,
              prediction: Prediction | None = None, is_measured: bool = True) -> None:
        """
        Write a footprint's state; `step` is the float32 step of its coordinates, m.

        Where `is_measured` is false the state says that no distances can be measured yet.
        """
        coarse = step > self.settings.resolution
        status = self._statuses[name]
        status.level = _LEVELS[state.status]
        status.message = in_words(state, self.settings.margin, prediction)
        if state.status is Status.CLEAR and (coarse or state.reasons):
            status.level = DiagnosticStatus.WARN
        if coarse:
            status.message += (
                f'; its coordinates have steps of {step:.2g} m, coarser than the resolution of '
                f'{self.settings.resolution:g} m: publish in a frame with a nearer origin')
        reasons = list(state.reasons)
        if not is_measured and state.status is not Status.UNKNOWN:
            status.message += f'; {_NOT_MEASURED}'
            reasons.append(_NOT_MEASURED)
        word, contacts, *_, reason = status.values
        word.value = state.status.value
        contacts.value = ', '.join(map(str, state.contacts))
        reason.value = '; '.join(reasons)

    def write_moving(self, name: str, scene: Scene, nearest: Nearest | None,
                     prediction: Prediction | None) -> None:
        """Write the values that change all the time, with what is known of each source."""
        state = scene.state(name)
        newer = scene.contacts_newer_by(name) if state.contacts else {}
        frame_id, transform_age = scene.origin(name)
        velocity = scene.velocity(name)
        if isinstance(velocity, str):
            motion = f'unknown: {velocity}' if velocity else 'unknown'
        else:
            vx, vy, omega = velocity.twist
            motion = f'{vx:.3f} m/s, {vy:.3f} m/s, {omega:.3f} rad/s by {velocity.origin}'
        path_contact = scene.path_checks[name].text if name in scene.path_checks else ''
        if path_contact and state.status is Status.UNKNOWN:
            # It may have been known when the path was checked.
            path_contact = f'unknown: {"; ".join(state.reasons)}'
        is_known = prediction and prediction.is_known
        texts = (
            '' if state.age is None else f'{state.age:.3f}',
            f'{nearest.separation:.6g}' if nearest else '',
            str(nearest.obstacle) if nearest else '',
            f'{nearest.newer_by():.3f}' if nearest else '',
            ', '.join(f'{one} {seconds:.3f}' for one, seconds in newer.items()),
            name_in_words(frame_id) if frame_id else '',
            '' if transform_age is None else f'{transform_age:.3f}',
            f'{prediction.seconds:.3f}' if prediction and is_known else '',
            str(prediction.obstacle or '') if prediction and is_known else '',
            path_contact,
            motion,
            ', '.join(map(str, prediction.unknown)) if prediction else '',
            *('; '.join(filter(None, (one.summary, one.advice)))
              for one in scene.sources.values()))
        for value, text in zip(self._statuses[name].values[2:-1], texts, strict=True):
            value.value = text

    @property
    def statuses(self) -> list[Any]:
        """The statuses, in the order of the settings."""
        return list(self._statuses.values())

    def pack(self, name: str) -> None:
        """Serialise the status of a footprint: all of them at once would hold up flags."""
        self._packed[name] = bytes(serialize(self._statuses[name]))

    def message(self, stamp: Any) -> bytes:
        """Return the serialised message of all statuses, each as it was packed."""
        head = DiagnosticArray()
        head.header.stamp = stamp
        data = bytearray(serialize(head))
        data[-4:] = struct.pack('=I', len(self._packed))
        for packed in self._packed.values():
            # The level is a byte at any place; what follows is aligned to four.
            level, rest = packed[4:5], packed[8:]
            data += level + bytes(-(len(data) + 1) % 4) + rest
        return bytes(data)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Footprints and their states."""

from __future__ import annotations

from collections.abc import Collection
import enum
from typing import NamedTuple, TypeAlias

from sat_collision.scene.obstacles import Body, Obstacle, ObstacleId
from sat_collision.scene.settings import BY_ANOTHER_CLOCK, FAR, FootprintSettings, in_ns, NEVER
from sat_collision.scene.streams import Stream
from sat_collision.scene.velocity import Command, MotionTracker


class Status(enum.Enum):
    CLEAR = 'clear'
    IMMINENT = 'imminent'
    COLLISION = 'collision'
    UNKNOWN = 'unknown'


class State(NamedTuple):
    status: Status
    contacts: tuple[ObstacleId, ...]  # sorted; empty unless in collision
    # Sentences: why the status is unknown or imminent, or what else is unknown beside a collision
    # or a clear state. Without running figures: time alone must not change a state.
    reasons: tuple[str, ...]
    age: float | None  # seconds since the footprint's stamp; None if there is no valid footprint


# The frame in which a footprint was sent, and the time in ns of the transform applied to it, None
# for a static one.
Origin: TypeAlias = tuple[str, int | None]
# Status and reasons of a State.
Evaluation: TypeAlias = tuple[Status, tuple[str, ...]]


class Footprint(Body[Obstacle]):
    """A footprint: its place, its time and the status reported for it. Times are in ns."""

    evaluation: Evaluation  # the result of the last `evaluate`
    reported: Evaluation | None = None  # that of the last report

    def __init__(self, settings: FootprintSettings) -> None:
        super().__init__()
        self.stream = Stream()
        self._stream_faults: tuple[str, ...] = ()  # what is wrong with its publishers
        self.time: int | None = None  # its stamp, not in the future; None if there is no valid one
        self.stamp = 0  # as sent
        self.origin: Origin | None = None  # None if it was not transformed
        self.stale = False  # whether it is past its timeout
        self.fault = ''  # why there is no valid one; empty if there is one, even if stale
        self.hints: tuple[str, ...] = ()  # what else may be wrong then, beside its publishers
        # Why no footprint can be known, and why obstacles may not have been received; empty if
        # nothing is wrong.
        self.other_faults: tuple[str, tuple[str, ...]] = '', ()
        self.frame_id = ''  # of the last message
        self.received: int | None = None  # when that came
        self.motion = MotionTracker()  # empty unless it is tracked
        self.command: Command | None = None  # the last one
        self.command_fault = ''  # why none can come, as a sentence; empty if one can
        # Whether a contact is due within its min_time_to_collision; None if it was unknown when
        # that was last to be predicted, so that it is clear only once it is predicted.
        self.is_imminent: bool | None = False
        self.status = Status.UNKNOWN  # as reported: CLEAR only after the release delay
        self.unknown_reasons: tuple[str, ...] = ()  # why its contacts may be unknown
        # Names of contacts that changed since the reader emptied this.
        self.gained_or_lost: set[ObstacleId] = set()
        # Number of contacts by name: obstacles of successive sets may have the same name.
        self._held: dict[ObstacleId, int] = {}
        self._names: tuple[ObstacleId, ...] | None = None
        self._clear_since: int | None = None
        self._release: float = NEVER
        self.configure(settings)

    def configure(self, settings: FootprintSettings) -> None:
        """Apply settings; with other sources its contacts must be decided again."""
        self.settings = settings
        self.timeout = self.stream.timeout = in_ns(settings.timeout)

    @property
    def deadline(self) -> float:
        """Time in ns after which age, faults or release change something without a message."""
        deadline = min(self._release, self.stream.mixed_until)
        if self.time is None or self.stale:
            return deadline
        return min(deadline, self.time + self.timeout)

    @property
    def contacts_reported(self) -> tuple[ObstacleId, ...]:
        """The names of the obstacles that it collides with, sorted; empty if in no collision."""
        if self.status is not Status.COLLISION:
            return ()
        # Sorted only on request: with many contacts, sorting for each new one takes very long.
        if self._names is None:
            self._names = tuple(sorted(self._held))
        return self._names

    def newer_by(self, obstacle: Obstacle) -> float:
        """Return by how many s an obstacle is newer than this, which is placed."""
        assert self.time is not None
        obstacle.group.flush()
        return (obstacle.time - self.time) / 1e9

    def toggle(self, others: Collection[Obstacle]) -> None:
        super().toggle(others)
        for other in others:
            name = other.name
            before = self._held.get(name, 0)
            now = before + 1 if other in self.contacts else before - 1
            if now:
                self._held[name] = now
            else:
                del self._held[name]
            if not (now and before):
                self.gained_or_lost ^= {name}
                self._names = None

    def limit_times(self, now: int) -> None:
        """Let nothing be ahead of a clock that went back a little: its age is 0."""
        if self.time is not None:
            self.time = min(self.time, now)
        if self.command:
            self.command = self.command._replace(time=min(self.command.time, now))

    def set_back(self, now: int) -> None:
        """Reset all times, because the clock was set back."""
        self.stream.set_back(now)
        self.command = self.received = None

    def find_stream_faults(self, now: int) -> bool:
        """Update the faults of the publishers; return whether they have changed."""
        self.stream.pass_time(now)
        faults = tuple(self.stream.faults())
        if faults == self._stream_faults:
            return False
        self._stream_faults = faults
        return True

    def evaluate(self, now: int, release_delay: int) -> bool:
        """
        Update the status to report: CLEAR after the release delay, anything else at once.

        Return False if it stays as it was until it is known whether a contact is imminent.
        """
        monitor_fault, source_faults = self.other_faults
        if self.stream.mixed_until < now:
            self.find_stream_faults(now)
        self.stale = self.time is not None and self.time + self.timeout < now
        self._release = NEVER
        reasons = source_faults
        if monitor_fault:
            status, reasons = Status.UNKNOWN, (monitor_fault,)
        elif not self.settings.enabled:
            topic = self.settings.cmd_vel
            ignored = topic and f', commands on {topic} are ignored'
            status, reasons = Status.UNKNOWN, (
                f'footprint {self.settings.name} is disabled{ignored}',)
        elif self._stream_faults or self.fault or self.stale:
            status, reasons = Status.UNKNOWN, (*self._faults_in_words(), *source_faults)
        elif self.contacts:
            status = Status.COLLISION
        elif source_faults:
            status = Status.UNKNOWN
        elif self.is_imminent:
            how = 'as it is told to' if self.settings.cmd_vel else 'on as it does'
            status, reasons = Status.IMMINENT, (
                f'moving {how}, it is in contact within min_time_to_collision, '
                f'{self.settings.min_time_to_collision:g} s',)
        else:
            status = Status.CLEAR
            if self.command_fault and self.settings.min_time_to_collision:
                reasons = f'no contact is predicted: {self.command_fault}',
        self.unknown_reasons = reasons if status in (Status.UNKNOWN, Status.COLLISION) else ()
        if status is not Status.CLEAR:
            self._clear_since = None
        else:
            if self._clear_since is None:
                self._clear_since = now
            if now < self._clear_since + release_delay:
                self._release = self._clear_since + release_delay - 1
                if self.status is not Status.CLEAR:
                    status = self.status
                    reasons = f'clear for less than release_delay, {release_delay / 1e9:g} s',
            elif self.is_imminent is None:
                return False
        self.status = status
        self.evaluation = status, reasons
        return True

    def _faults_in_words(self) -> tuple[str, ...]:
        faults = self._stream_faults
        if self.stale:
            if self.received is not None and self.received - (self.time or 0) > FAR:
                faults += f'has stamps that are {BY_ANOTHER_CLOCK}',
            else:
                faults += '; '.join((f'is older than its timeout of {self.settings.timeout:g} s',
                                     *self.hints)),
        elif self.fault and not (faults and self.received is None):
            faults += ('; '.join((self.fault, *self.stream.hints(), *self.hints)),)
        return tuple(f'footprint {self.settings.name} on {self.settings.topic} {fault}'
                     for fault in faults)

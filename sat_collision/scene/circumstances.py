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

"""What a scene is told of publishers, losses and the clock, beside the messages themselves."""

from __future__ import annotations

from abc import ABC, abstractmethod

from sat_collision.scene.footprints import Footprint
from sat_collision.scene.settings import Settings
from sat_collision.scene.view import View


class Circumstances(View, ABC):
    """The part of a `Scene` that doubts what it cannot trust."""

    settings: Settings
    _clock_stands: bool
    _release_delay: int

    @abstractmethod
    def pass_time(self, now: int) -> None:
        """Let time pass."""

    def lose(self, name: str, now: int) -> None:
        """Take note that messages of a source were lost; of a footprint the latest counts."""
        self.pass_time(now)
        source = self._sources.get(name)
        if source is not None and source.settings.enabled:
            source.lose(now)
            self._reevaluate_all()

    def meet_publisher(self, name: str, from_beginning: bool) -> None:
        """
        Take note that the next message of a source is the first one heard of a publisher.

        If it is the first that was sent, too, nothing was missed.
        """
        source = self._sources.get(name)
        if source is not None:
            source.meet_publisher(from_beginning)
            self._reevaluate_all()

    def count_publishers(self, name: str, count: int) -> None:
        """Take note of how many publishers a footprint or source has; called again and again."""
        source = self._sources.get(name)
        if source is not None:
            source.count_publishers(count, self._now)
        elif count == 0 and self._footprints[name].time is not None:
            self._invalidate(self._footprints[name], 'has no publisher any more')
        self._reevaluate_all()

    def stop_clock(self, stands: bool) -> None:
        """Take note of whether the clock stands still, so that nothing can grow old."""
        if stands != self._clock_stands:
            self._clock_stands = stands
            self._reevaluate_all()

    def note_waiting(self, name: str, are_waiting: bool) -> None:
        """Take note of whether messages of a source wait to be told, so that no set is whole."""
        source = self._sources.get(name)
        if source is not None:
            source.are_waiting = are_waiting

    def overwhelm(self, name: str, overwhelmed: bool) -> None:
        """Take note of whether a source sends more than can be checked."""
        self._sources[name].overwhelm(overwhelmed)
        self._reevaluate_all()

    def _invalidate(self, footprint: Footprint, fault: str) -> None:
        footprint.time = None
        footprint.fault = fault
        self._contacts.remove_footprint(footprint)
        self._contacts.changed.add(footprint)

    def _reevaluate_all(self) -> None:
        """Evaluate the footprints for which something has changed: all, if a common fault has."""
        self.evaluations.find_faults(self.settings, self._now, self._clock_stands,
                                     self._sources.values())
        self._evaluate()

    def _evaluate(self) -> None:
        self.evaluations.evaluate(self._now, self._release_delay)

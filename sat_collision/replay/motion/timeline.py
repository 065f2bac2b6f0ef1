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

"""The answer to what touched, over time: contacts by recorded motion, doubts by the scene."""

from __future__ import annotations

from collections.abc import Iterable
from operator import attrgetter

from sat_collision.replay.motion.motion import Motion
from sat_collision.replay.result import Contact, FootprintResult, Unknown
from sat_collision.replay.unknowns import Unknowns
from sat_collision.scene.scene import Scene


class MotionTimeline:
    """
    Joins what recorded motion finds with the times at which the scene is in doubt.

    Parameters
    ----------
    scene : Scene
    motion : Motion
        Observes the scene.
    footprints : list of FootprintResult

    Attributes
    ----------
    contacts : list of Contact
        In the order of their beginning.
    footprints : list of FootprintResult
    notes : list of str
        What a reader should know.

    """

    def __init__(self, scene: Scene, motion: Motion, footprints: list[FootprintResult]) -> None:
        self._scene = scene
        self._motion = motion
        self.contacts: list[Contact] = motion.contacts
        self.footprints = footprints
        self.notes: list[str] = []
        self._results = {result.name: result for result in footprints}
        self._unknowns = Unknowns()
        self._start: int | None = None

    @property
    def unknown(self) -> list[Unknown]:
        """The Unknown intervals, in the order of their beginning."""
        return self._unknowns.intervals

    def change(self, names: Iterable[str], now: int) -> None:
        """Take the new doubts about footprints."""
        if self._start is None:
            self._start = now
        for name in names:
            reasons = list(self._scene.doubts(name))
            self._unknowns.follow(name, reasons, now)
            if not reasons:
                self._results[name].ever_known = True

    def finish(self, now: int) -> None:
        """Decide what is left, and end all that is open."""
        self._unknowns.finish(now)
        self._motion.finish(now)
        self._motion.draw_curves(self.unknown)
        self.contacts.sort(key=attrgetter('first'))
        start = now if self._start is None else self._start
        for name, result in self._results.items():
            if result.ever_known and not self._motion.is_decided(name):
                result.ever_known = False
                self.notes.append(f'{name}: at no time is it known where it and the obstacles '
                                  'are; --as-live tells what the monitor would have said')
            touching = [(contact.first, contact.last) for contact in self.contacts
                        if contact.footprint == name]
            doubtful = [(unknown.first, unknown.last) for unknown in self.unknown
                        if unknown.footprint == name]
            result.collision = _length(touching, start, now)
            both = _length(touching + doubtful, start, now)
            result.unknown = both - result.collision
            result.clear = now - start - both


def _length(intervals: Iterable[tuple[int, int]], start: int, end: int) -> int:
    """Return how much of a time is in any of some intervals."""
    total, reached = 0, start
    for first, last in sorted(intervals):
        first, last = max(first, reached), min(last, end)
        if last > first:
            total += last - first
            reached = last
    return total

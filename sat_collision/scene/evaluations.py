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

"""Which footprints have to be evaluated anew, and whose state has changed by it."""

from __future__ import annotations

from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.footprints import Evaluation, Footprint, Status


class Evaluations:
    """
    Evaluates footprints where something has changed, and keeps what has been reported.

    Parameters
    ----------
    footprints : dict
        Every Footprint by name.
    changed : set of Footprint
        Those for which something has changed; emptied here.
    deadlines : Deadlines
    reported : dict
        The Evaluation of each footprint that was reported last, by name; kept here.

    """

    def __init__(self, footprints: dict[str, Footprint], changed: set[Footprint],
                 deadlines: Deadlines, reported: dict[str, Evaluation]) -> None:
        self._footprints = footprints
        self._changed = changed
        self._deadlines = deadlines
        self._reported = reported
        self._unreported: set[Footprint] = set()
        self._in_collision: set[str] = set()
        self._faults: tuple[str, tuple[str, ...]] = '', ()

    def use_faults(self, monitor_fault: str, source_faults: tuple[str, ...]) -> None:
        """Have all footprints evaluated anew if these are others, see `Footprint.evaluate`."""
        if (monitor_fault, source_faults) != self._faults:
            self._faults = monitor_fault, source_faults
            self._changed.update(self._footprints.values())

    def evaluate(self, now: int, release_delay: int) -> None:
        """Evaluate the footprints for which something has changed; times in ns."""
        for footprint in self._changed:
            footprint.evaluate(now, *self._faults, release_delay)
            self._deadlines.watch(footprint)
            if footprint.status is Status.COLLISION:
                self._in_collision.add(footprint.settings.name)
        self._unreported |= self._changed
        self._changed.clear()

    def brief_contacts(self) -> list[str]:
        """
        Return the names of footprints that were in collision for a moment only.

        That is, between two calls of `changes`, of which the later is still to come.
        """
        return [name for name in self._in_collision
                if self._footprints[name].status is not Status.COLLISION
                and self._reported.get(name, (None,))[0] is not Status.COLLISION]

    def changes(self) -> list[str]:
        """Return the names of footprints whose state, age apart, changed since the last call."""
        if not self._unreported:
            return []
        changed = []
        for name, footprint in self._footprints.items():
            if footprint in self._unreported and (
                    footprint.evaluation != self._reported.get(name)):
                self._reported[name] = footprint.evaluation
                changed.append(name)
        self._unreported.clear()
        self._in_collision.clear()
        return changed

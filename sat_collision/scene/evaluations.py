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

from collections.abc import Iterable
from itertools import chain

from sat_collision.scene.footprints import Evaluation, Footprint, Status
from sat_collision.scene.settings import Settings
from sat_collision.scene.sources import Source
from sat_collision.scene.times import NEVER

_DISABLED = 'checking is disabled'
_NO_CLOCK = 'no clock yet: the time reads 0, as with use_sim_time before the first /clock'
_CLOCK_STANDS = 'the clock stands still: /clock tells the same time, or comes no more'
_NO_SOURCE = 'no obstacle source is enabled'
_NONE_OF_THEM = 'none of its obstacle sources is enabled'


class Evaluations:
    """
    Evaluates footprints where something has changed, and keeps what has been reported.

    Parameters
    ----------
    footprints : dict
        Every Footprint by name.
    changed : set of Footprint
        Those for which something has changed; emptied here.
    reported : dict
        The Evaluation of each footprint that was reported last, by name; kept here.

    Attributes
    ----------
    unreported : set of Footprint
        Those that were evaluated since the last call of `changes`.

    """

    def __init__(self, footprints: dict[str, Footprint], changed: set[Footprint],
                 reported: dict[str, Evaluation]) -> None:
        self._footprints = footprints
        self._changed = changed
        self._reported = reported
        self.unreported: set[Footprint] = set()
        self._in_collision: set[str] = set()
        self._told: tuple[str, Settings | None, tuple[tuple[str, ...], ...]] = '', None, ()
        self._faults: dict[str, tuple[str, tuple[str, ...]]] = dict.fromkeys(footprints, ('', ()))

    def find_faults(self, settings: Settings, now: int, clock_stands: bool,
                    sources: Iterable[Source]) -> None:
        """Find out what concerns footprints; have those evaluated anew for which it is new."""
        monitor_fault = ''
        if not settings.enabled:
            monitor_fault = _DISABLED
        elif not now:
            monitor_fault = _NO_CLOCK
        elif clock_stands:
            monitor_fault = _CLOCK_STANDS
        sources = tuple(sources)
        told = monitor_fault, settings, tuple(source.faults for source in sources)
        if told == self._told:
            return
        self._told = told
        for name, footprint in self._footprints.items():
            faults = monitor_fault, _faults_for(footprint, sources)
            if faults != self._faults[name]:
                self._faults[name] = faults
                self._changed.add(footprint)

    def evaluate(self, now: int, release_delay: int) -> float:
        """Evaluate what has changed; return when the first of it changes by itself; in ns."""
        deadline = NEVER
        for footprint in self._changed:
            footprint.evaluate(now, *self._faults[footprint.settings.name], release_delay)
            deadline = min(deadline, footprint.deadline)
            if footprint.status is Status.COLLISION:
                self._in_collision.add(footprint.settings.name)
        self.unreported |= self._changed
        self._changed.clear()
        return deadline

    def brief_contacts(self) -> list[str]:
        """
        Return the names of footprints that were in collision for a moment only.

        That is, since the last call of `changes`, and not when it was called.
        """
        return [name for name in self._in_collision
                if self._footprints[name].status is not Status.COLLISION
                and (name not in self._reported
                     or self._reported[name][0] is not Status.COLLISION)]

    def changes(self) -> list[str]:
        """Return the names of footprints whose state, age apart, changed since the last call."""
        if not self.unreported:
            return []
        changed = []
        for name, footprint in self._footprints.items():
            if footprint in self.unreported:
                others = footprint.gained_or_lost and footprint.status is Status.COLLISION
                if others or footprint.evaluation != self._reported.get(name):
                    self._reported[name] = footprint.evaluation
                    changed.append(name)
                footprint.gained_or_lost.clear()
        self.unreported.clear()
        self._in_collision.clear()
        return changed


def _faults_for(footprint: Footprint, sources: Iterable[Source]) -> tuple[str, ...]:
    """Return why there may be obstacles that concern a footprint and were not received."""
    monitored = [source for source in sources
                 if footprint.settings.monitors(source.settings.name)]
    if not any(source.settings.enabled for source in monitored):
        return (_NONE_OF_THEM if footprint.settings.obstacles else _NO_SOURCE),
    return tuple(chain.from_iterable(source.faults for source in monitored))

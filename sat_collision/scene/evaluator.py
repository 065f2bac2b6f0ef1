# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What follows for footprints from what was received: their faults, and their states."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
import math
from typing import NamedTuple

from sat_collision.scene.contacts import Contacts
from sat_collision.scene.footprints import Footprint, Status
from sat_collision.scene.prediction import predict
from sat_collision.scene.settings import NEVER, Settings
from sat_collision.scene.sources import Source

# How much further ahead than needed `look_ahead` predicts, in s, to know when it is due again; it
# is called more often than that.
_AHEAD = 0.5
_NO_SOURCE = 'no obstacle source is enabled'
_NONE_OF_THEM = 'none of its obstacle sources is enabled'


class Changes(NamedTuple):
    """What has changed since the last report, as names of footprints."""

    changed: list[str]  # with another state, but for its age
    brief: list[str]  # in collision since then, but neither then nor now


_NONE = Changes([], [])


class Evaluator:
    """
    Evaluates the footprints for which something has changed.

    If knowledge is missing a footprint is unknown, never clear. It is

    - UNKNOWN if the footprint itself is unknown (not received, refused, in another frame, older
      than its timeout, disabled, with two publishers), if checking is disabled, or if there is no
      running clock;
    - else in COLLISION if it shares a point with an obstacle, or is within the margin of one: a
      proved contact stays true whatever else is unknown;
    - else UNKNOWN if a source of obstacles is not known, see `knowledge`, or none is enabled:
      there may be an obstacle that was not received;
    - else IMMINENT if `look_ahead` predicts a contact within its min_time_to_collision;
    - else CLEAR, which is reported once it has been so for `release_delay`.

    If a footprint lists sources of its own, only these count for it.
    """

    def __init__(self, footprints: Mapping[str, Footprint], sources: Mapping[str, Source],
                 contacts: Contacts, settings: Settings) -> None:
        self._footprints = footprints
        self._sources = sources
        self._contacts = contacts
        # What the faults beside those of footprints were last found from.
        self._causes: tuple[object, ...] = ()
        # Footprints evaluated since the last call of `take_changes`, and those then in collision.
        self._evaluated: set[Footprint] = set()
        self.collided: set[Footprint] = set()
        self.use(settings)

    def use(self, settings: Settings) -> None:
        self._settings = settings
        self._release_delay = round(settings.release_delay * 1e9)

    def find_faults(self, monitor_fault: str) -> None:
        """Find why footprints may be unknown; the fault given, if any, concerns all of them."""
        causes = monitor_fault, self._settings, *(one.faults for one in self._sources.values())
        if causes == self._causes:
            return
        self._causes = causes
        for footprint in self._footprints.values():
            faults = monitor_fault, self._source_faults(footprint)
            if faults != footprint.other_faults:
                footprint.other_faults = faults
                self._contacts.changed.add(footprint)

    def _source_faults(self, footprint: Footprint) -> tuple[str, ...]:
        """Return why obstacles that a footprint monitors may not have been received."""
        monitored = [source for name, source in self._sources.items()
                     if footprint.settings.monitors(name)]
        if not any(source.settings.enabled for source in monitored):
            return (_NONE_OF_THEM if footprint.settings.obstacles else _NO_SOURCE),
        return tuple(chain.from_iterable(source.faults for source in monitored))

    def evaluate(self, now: int) -> float:
        """Evaluate what has changed; return the time in ns after which it may by time alone."""
        changed = self._contacts.changed
        deadline = NEVER
        for footprint in changed:
            if footprint.evaluate(now, self._release_delay):
                self._evaluated.add(footprint)
            deadline = min(deadline, footprint.deadline)
            if footprint.status is Status.COLLISION:
                self.collided.add(footprint)
        changed.clear()
        return deadline

    def look_ahead(self, name: str, now: int) -> float:
        """
        Predict whether a footprint is in contact within its min_time_to_collision, which it has.

        One that was unknown when it was last predicted stays so until it is predicted again.
        Return the time in ns after which its state may change by time alone.
        """
        footprint, deadline = self._footprints[name], NEVER
        threshold = footprint.settings.min_time_to_collision
        if footprint.is_imminent is None:
            deadline = self._set_imminent(footprint, False, now)
        if footprint.status is Status.UNKNOWN:
            footprint.is_imminent = None
            return deadline
        found = predict(footprint, self._contacts, self._sources.values(), now, threshold + _AHEAD)
        seconds = found.seconds if found else math.inf
        if footprint.is_imminent != (seconds <= threshold):
            return self._set_imminent(footprint, seconds <= threshold, now)
        if threshold < seconds < math.inf:
            return min(deadline, now + int((seconds - threshold) * 1e9) - 1)
        return deadline

    def _set_imminent(self, footprint: Footprint, is_imminent: bool, now: int) -> float:
        footprint.is_imminent = is_imminent
        self._contacts.changed.add(footprint)
        return self.evaluate(now)

    def take_changes(self) -> Changes:
        """Return what has changed since the last call."""
        if not self._evaluated:
            return _NONE
        changes = Changes([], [])
        for name, footprint in self._footprints.items():
            if footprint in self._evaluated:
                before, collides = footprint.reported, footprint.status is Status.COLLISION
                if footprint in self.collided and not (
                        collides or before and before[0] is Status.COLLISION):
                    changes.brief.append(name)
                if footprint.evaluation != before or collides and footprint.gained_or_lost:
                    footprint.reported = footprint.evaluation
                    changes.changed.append(name)
                footprint.gained_or_lost.clear()
        self._evaluated.clear()
        self.collided.clear()
        return changes

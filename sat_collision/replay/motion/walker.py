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

"""A footprint on its way through what all sources of obstacles tell."""

from __future__ import annotations

from collections import deque

from sat_collision.replay.motion.encounters import Encounters, Step
from sat_collision.replay.motion.findings import Findings
from sat_collision.replay.motion.tracks import Track
from sat_collision.replay.motion.trails import LONGEST, Trail
from sat_collision.replay.result import Contact, FootprintResult
from sat_collision.scene.deadlines import NEVER


class Walker:
    """
    Decides steps once the footprint's way through them is known, or can be no more.

    Parameters
    ----------
    result : FootprintResult
        Of the footprint.
    contacts : list of Contact
        Of all footprints.
    timeout : float
        Of the footprint, s; 0 for never.
    margin : float
        Metres up to which bodies apart count as in contact.
    keep : int
        For how long its way is of interest, ns.

    Attributes
    ----------
    track : Track
    findings : Findings
    is_decided : bool
        Whether there was a decision against all trails that had bodies.

    """

    def __init__(self, result: FootprintResult, contacts: list[Contact], timeout: float,
                 margin: float, keep: int) -> None:
        self._timeout = round(timeout * 1e9) if timeout else NEVER
        self._margin = margin
        self._keep = keep
        self.track = Track(self._timeout, LONGEST)
        self.findings = Findings(result, contacts, self.track)
        self._waiting: dict[Trail, deque[Step]] = {}
        self._encounters: dict[Trail, Encounters] = {}

    @property
    def is_decided(self) -> bool:
        return all(encounters.decided for encounters in self._encounters.values())

    @property
    def undecided(self) -> int:
        """For how long the way was not known though the footprint was there, ns."""
        return self.track.undecided + sum(
            encounters.undecided for encounters in self._encounters.values())

    def queue(self, trail: Trail, step: Step, now: int) -> None:
        """Take a step, to be decided when the way is known."""
        if trail not in self._encounters:
            if step.seen is not None and not len(step.seen):
                return
            self._encounters[trail] = Encounters(self.track, self.findings, self._margin)
            self._waiting[trail] = deque()
        self._waiting[trail].append(step)
        if self._is_due(self._waiting[trail][0], now):
            self.walk(now)

    def walk(self, now: int) -> None:
        """Decide what can be decided."""
        for trail, waiting in self._waiting.items():
            while waiting and self._is_due(waiting[0], now):
                self.track.stand(waiting[0].finish)
                self._encounters[trail].decide(waiting.popleft())
        if self.track.latest is not None:
            self.track.drop_before(self.track.latest - self._keep)

    def skip(self) -> None:
        """Drop all that is to be decided: it is in another frame."""
        for waiting in self._waiting.values():
            waiting.clear()

    def finish(self, end: int) -> None:
        """Decide all that is left."""
        self.track.stand(end)
        for trail, waiting in self._waiting.items():
            for step in waiting:
                self._encounters[trail].decide(step)
            self._encounters[trail].finish()

    def _is_due(self, step: Step, now: int) -> bool:
        """Tell whether the way through a step is known, or no frame of it will come any more."""
        latest = self.track.latest
        if latest is not None and step.finish <= latest:
            return True
        return now > step.finish + 2 * min(self._timeout, LONGEST)

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

"""Footprints, and the states in which they are."""

import enum
from operator import attrgetter
from typing import NamedTuple

from sat_collision.scene.contacts import Placeable
from sat_collision.scene.deadlines import NEVER
from sat_collision.scene.obstacles import Obstacle

_NAME = attrgetter('name')


class Status(enum.Enum):
    """What is known of a footprint."""

    CLEAR = 'clear'
    COLLISION = 'collision'
    UNKNOWN = 'unknown'


class State(NamedTuple):
    """
    The state of a footprint.

    Attributes
    ----------
    status : Status
    contacts : tuple of Obstacle
        The obstacles that share a point with it, sorted; empty unless in collision.
    reasons : tuple of str
        Sentences: why the status is unknown, or what else is in doubt beside a collision. They
        hold no running figures, so that a state does not change only because time passes.
    age : float or None
        Seconds since the footprint's stamp; None if there is no good footprint.

    """

    status: Status
    contacts: tuple[Obstacle, ...]
    reasons: tuple[str, ...]
    age: float | None


class Footprint(Placeable):
    """
    One footprint: where it is, since when, and the status reported for it. Times are in ns.

    Attributes
    ----------
    trouble : str
        Why there is no good footprint; empty if there is one, be it stale.
    stale : bool
        Whether the good footprint is past its timeout.
    clear_since : int or None
        Since when it has been clear without interruption.
    status : Status
        The status reported: CLEAR only after the release delay.
    finding : tuple
        Status, contacts and reasons of its State, as they were settled last.

    """

    __slots__ = ('settings', 'timeout', 'time', 'trouble', 'stale', 'clear_since', 'status',
                 'finding', 'watched', '_release', '_due')

    def __init__(self, settings, due):
        super().__init__()
        self.time = None
        self.trouble = ''
        self.stale = False
        self.clear_since = None
        self.status = Status.UNKNOWN
        self.watched = NEVER
        self._release = NEVER
        self._due = due
        self.configure(settings)

    def configure(self, settings):
        """Apply settings."""
        self.settings = settings
        self.timeout = round(settings.timeout * 1e9) if settings.timeout > 0.0 else NEVER

    @property
    def deadline(self):
        """Time in ns after which the footprint is stale, or its delayed release is due."""
        if self.time is None or self.stale:
            return self._release
        return min(self._release, self.time + self.timeout)

    def expire(self):
        """Ask for another look, now that the deadline is past."""
        self._due.add(self)

    def settle(self, now, blanket, doubts, release_delay):
        """
        Work out what to report: a release after the delay, anything else at once.

        Parameters
        ----------
        now : int
        blanket : str
            Why nothing can be known of any footprint; empty if something can.
        doubts : tuple of str
            Why there may be obstacles that nobody told of.
        release_delay : int

        """
        self.stale = self.time is not None and self.time + self.timeout < now
        self._release = NEVER
        contacts = ()
        reasons = doubts
        if blanket:
            status, reasons = Status.UNKNOWN, (blanket,)
        elif not self.settings.enabled:
            status, reasons = Status.UNKNOWN, (f'footprint {self.settings.name} is disabled',)
        elif self.trouble or self.stale:
            status, reasons = Status.UNKNOWN, (self._complaint(), *doubts)
        elif self.meets:
            status, contacts = Status.COLLISION, tuple(sorted(map(_NAME, self.meets)))
        else:
            status = Status.UNKNOWN if doubts else Status.CLEAR
        if status is not Status.CLEAR:
            self.clear_since = None
        else:
            if self.clear_since is None:
                self.clear_since = now
            if now < self.clear_since + release_delay:
                self._release = self.clear_since + release_delay - 1
                if self.status is not Status.CLEAR:
                    status = self.status
                    reasons = f'clear for less than release_delay, {release_delay / 1e9:g} s',
        self.status = status
        self.finding = status, contacts, reasons

    def _complaint(self):
        """Return what is wrong with the footprint itself, as a sentence."""
        trouble = self.trouble
        if self.stale:
            trouble = f'is older than its timeout of {self.settings.timeout:g} s'
        return f'footprint {self.settings.name} on {self.settings.topic} {trouble}'

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

"""
Which messages on a topic are those of one publisher, without a gap.

docs/knowing.md has the rules and why they hold. Times are in ns.
"""

from __future__ import annotations

from collections.abc import Sequence
import enum
from typing import NamedTuple

from sat_collision.scene.settings import NEVER


class News(enum.Enum):
    """What the sequence number of a message means."""

    CONTINUES = 'it is the next one of its stream'
    LOST = 'it is of the same stream, but some before it were lost'
    MET = 'it is of another stream, which is met in its middle'
    BEGUN = 'it is the first one of its stream'


CONTINUES, LOST, MET, BEGUN = News

# For so long, at most, numbers that only two publishers can have sent are a fault, in ns.
_LONGEST_MIXED = 10 * 10**9


class Endpoint(NamedTuple):
    """A publisher on a topic, as the middleware knows it."""

    gid: str  # identifies it
    node: str = ''  # full name of its node; empty while that is not known
    problem: str = ''  # why nothing of it can be received, and what to do: ends a sentence
    hint: str = ''  # what may be missing of what it has sent, likewise


class Stream:
    """
    The messages of the one publisher that a topic must have.

    A publisher numbers its messages 1, 2, 3 …, and a message does not say whose it is. So a stream
    ends with any change of the publishers, and by a number that cannot continue it.

    A process that was killed stays among the publishers until its lease is over. One of the same
    node name as the publisher of the stream, which is newer, does not count while nothing comes
    of it.
    """

    def __init__(self) -> None:
        # The number that continues the stream; None where no number does.
        self.next: int | None = None
        # How many messages were lost so far.
        self.lost = 0
        # For how long numbers that only two publishers can have sent are a fault, and until when
        # they are one now; NEVER if they are none.
        self.timeout: float = NEVER
        self.mixed_until: float = NEVER
        # The number of the message before, where `next` does not have it.
        self._last = 0
        # By gid, in the order in which they came; None where that is not known.
        self._endpoints: dict[str, Endpoint] | None = None
        self._speaker: str | None = None
        # Publishers of which nothing has come yet, and those of which something may have come.
        self._silent: set[str] = set()
        self._perhaps_silent: set[str] = set()
        # Whether the stream began before the news of its publisher; and who came next, then.
        self.awaits_endpoint = False
        self._presumed: str | None = None
        # The last number of the stream before.
        self._last_before = 0

    @property
    def publishers(self) -> list[Endpoint]:
        """The publishers that count."""
        endpoints = self._endpoints or {}
        speaker = endpoints.get(self._speaker or '')
        if speaker is None or not speaker.node:
            return [*endpoints.values()]
        gids = [*endpoints]
        older = gids[:gids.index(speaker.gid)]
        return [one for one in endpoints.values()
                if one.gid not in older or one.node != speaker.node]

    @property
    def is_alone(self) -> bool:
        """Whether no other publisher is left than that of the stream."""
        return len(self._endpoints or ()) <= 1

    def receive(self, number: int | None, now: int) -> News:
        """Take the number of a message; where the middleware gives none, no loss shows."""
        expected = self.next
        if number is None:
            number = 2 if expected is None else expected
        self.next = number + 1
        # Only number 1 comes before the news of its publisher, so this one was known before.
        self.awaits_endpoint = False
        if number == expected:
            return CONTINUES
        last = self._last if expected is None else expected - 1
        if number == 1 or number <= last:
            self._last_before = last
            self._find_speaker(number, expected, now)
            return BEGUN if number == 1 else MET
        if expected is None:
            # Its publisher is not known, unless there is only one.
            if self._endpoints and len(self._endpoints) == 1:
                self._speaker, = self._endpoints
                self._perhaps_silent.clear()
            else:
                self._perhaps_silent |= self._silent
            self._silent.clear()
            return MET
        self.lost += number - expected
        if number > self._last_before:
            # It may be from a publisher of the same node name that is alive after all.
            self._speaker = None
        return LOST

    def update(self, endpoints: Sequence[Endpoint]) -> bool:
        """Update the publishers; return whether what is known must be rebuilt."""
        before = [one.gid for one in self.publishers]
        known = self._endpoints or {}
        current = {one.gid: one for one in endpoints}
        new = [gid for gid in current if gid not in known]
        self._endpoints = {gid: current[gid]
                           for gid in (*(gid for gid in known if gid in current), *new)}
        if self.awaits_endpoint and len(new) <= 1:
            # Those that left were not its publisher, and the one that came is.
            if new:
                self._speaker = self._presumed = new[0]
                self.awaits_endpoint = False
            return False
        self._silent = (self._silent & current.keys()) | {*new}
        self._perhaps_silent &= current.keys()
        if current.keys() == known.keys():
            # A name is known by now, and who counts by it.
            return False
        if [one.gid for one in self.publishers] == before:
            return False
        self.awaits_endpoint = False
        self.mixed_until = NEVER
        self.interrupt()
        return True

    def _find_speaker(self, number: int, expected: int | None, now: int) -> None:
        """Find out which publisher has begun a stream with this number."""
        self._speaker = None
        self.mixed_until = NEVER
        presumed, self._presumed = self._presumed, None
        if self._perhaps_silent:
            return
        if len(self._silent) == 1:
            self._speaker = self._silent.pop()
        elif not self._silent and number == 1:
            if presumed in (self._endpoints or ()):
                self._speaker = presumed
            else:
                self.awaits_endpoint = True
        elif not self._silent and expected is not None:
            self.mixed_until = now + min(self.timeout, _LONGEST_MIXED)

    def interrupt(self) -> None:
        """Accept no number as the next one of the stream, only the first of another."""
        if self.next is not None:
            self._last, self.next = self.next - 1, None

    def restart(self) -> None:
        """Start over with a new subscription, to all that the publisher still keeps."""
        self.next, self._last = None, 0
        self._silent = {one.gid for one in self.publishers}
        self._perhaps_silent.clear()

    def pass_time(self, now: int) -> None:
        """Let time pass: the numbers of two publishers are a fault no longer."""
        if self.mixed_until < now:
            self.mixed_until = NEVER

    def set_back(self, now: int) -> None:
        """Take a clock that was set back."""
        if self.mixed_until < NEVER:
            self.mixed_until = now + min(self.timeout, _LONGEST_MIXED)

    def faults(self) -> list[str]:
        """Return what is wrong with the publishers, as ends of sentences."""
        if self._endpoints is None:
            return []
        publishers = self.publishers
        if not publishers:
            return ['has no publisher']
        faults = [f'has a publisher, {_named(one)}, {one.problem}'
                  for one in publishers if one.problem]
        if len(publishers) > 1:
            faults.append(f'has {len(publishers)} publishers, '
                          f'{" and ".join(map(_named, publishers))}, which cannot be told '
                          'apart: give each a topic and a name here of its own')
        elif self.awaits_endpoint:
            faults.append('has messages of a publisher that the middleware does not know yet')
        elif self.mixed_until < NEVER:
            faults.append('has messages whose numbers are those of two publishers: give each a '
                          'topic and a name here of its own')
        return faults

    def hints(self) -> list[str]:
        """Return what may be missing of what the publishers have sent."""
        return [one.hint for one in self.publishers if one.hint]


def _named(endpoint: Endpoint) -> str:
    return endpoint.node or 'of a node whose name is not known yet'

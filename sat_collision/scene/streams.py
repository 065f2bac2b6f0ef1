# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Which messages on a topic belong to one publisher, without a gap.

docs/knowing.md has the rules and why they hold. Times are in ns.
"""

from __future__ import annotations

from collections.abc import Sequence
import enum
from itertools import chain
from typing import NamedTuple

from sat_collision.scene.settings import NEVER


class Continuity(enum.Enum):
    """How the number of a message continues its stream."""

    CONTINUES = 'it is the next one of its stream'
    LOST = 'it is of the same stream, but some before it were lost'
    JOINED = 'it is of another stream, whose earlier messages were not received'
    BEGUN = 'it is the first one of its stream'


CONTINUES, LOST, JOINED, BEGUN = Continuity

# For how long numbers of two publishers are a fault where there is no timeout.
_MIXED_MAP = 10**9


class Endpoint(NamedTuple):
    """A publisher on a topic, as reported by the middleware."""

    gid: str  # identifies it
    node: str = ''  # full name of its node; empty while that is not known
    problem: str = ''  # why it cannot be received, and what to do: ends a sentence
    hint: str = ''  # which of its messages may be missing, likewise
    loss: str = ''  # why messages may be lost, and what to do, likewise


class Stream:
    """
    The messages of the one publisher that a topic must have.

    A publisher numbers its messages 1, 2, 3 …, and a message does not identify its publisher. So a
    stream ends with any change of the publishers, and by a number that cannot continue it.

    A process that was killed stays among the publishers until its lease expires. So a publisher
    older than that of the stream, with the same node name, does not count while nothing of it is
    received.
    """

    def __init__(self) -> None:
        self.last = 0  # the number of the last message; 0 before the first one
        self.is_interrupted = True  # whether the next message does not continue the stream
        self.lost = 0  # how many messages, so far
        self.is_numbered = True  # whether the middleware gives numbers, which show losses
        # Whether messages were lost before the next one, where no number shows it.
        self.is_lossy = False
        # For how long numbers that only two publishers can have sent are a fault, and until when
        # they are one now, NEVER if they are not.
        self.timeout: float = NEVER
        self.mixed_until: float = NEVER
        self._last_before = 0  # the last number of the previous stream
        # By gid in order of appearance, None if not known yet; the gid of the stream's publisher.
        self._endpoints: dict[str, Endpoint] | None = None
        self._publisher: str | None = None
        # Gids of publishers of which nothing was received, and of which something may have been.
        self._silent: set[str] = set()
        self._perhaps_silent: set[str] = set()
        self.awaits_endpoint = False  # whether it began before its publisher was reported
        self._presumed: str | None = None  # which was reported next
        self._newest = 0  # the greatest number received
        self._is_newest_sure = True  # whether that is surely of the one publisher
        # Up to which number messages come again, for a new subscription; until when they may.
        self._again = 0
        self.again_until: float = NEVER

    @property
    def publishers(self) -> list[Endpoint]:
        """The publishers that count."""
        endpoints = self._endpoints or {}
        publisher = endpoints.get(self._publisher or '')
        if publisher is None or not publisher.node:
            return [*endpoints.values()]
        gids = [*endpoints]
        older = gids[:gids.index(publisher.gid)]
        return [one for one in endpoints.values()
                if one.gid not in older or one.node != publisher.node]

    @property
    def is_alone(self) -> bool:
        """Whether at most one publisher is left, including those that do not count."""
        return len(self._endpoints or ()) <= 1

    @property
    def is_again(self) -> bool:
        """Whether messages are still to come again that were received before."""
        return self._newest < self._again

    def receive(self, number: int | None, now: int) -> Continuity:
        """Receive the number of a message; if the middleware gives none, losses go unnoticed."""
        expected = None if self.is_interrupted else self.last + 1
        self.is_numbered = number is not None
        if number is None:
            number = 2 if expected is None else expected
        number += self.is_lossy
        self.is_lossy = False
        last, self.last, self.is_interrupted = self.last, number, False
        self._newest = max(self._newest, number)
        if not self.is_again:
            self._again, self.again_until = 0, NEVER
        # Only number 1 can arrive before its publisher is reported, so this one was reported.
        self.awaits_endpoint = False
        if number == expected:
            return CONTINUES
        if number == 1 or number <= last:
            self._last_before = last
            self._find_publisher(number, expected, now)
            return BEGUN if number == 1 else JOINED
        if expected is None:
            # Its publisher is known only if there is just one.
            if self._endpoints and len(self._endpoints) == 1:
                self._publisher, = self._endpoints
                self._perhaps_silent.clear()
            else:
                self._perhaps_silent |= self._silent
                if number != last + 1:
                    self._doubt_publisher(number)
            self._silent.clear()
            return JOINED
        self.lost += number - expected
        self._doubt_publisher(number)
        return LOST

    def drop(self, number: int | None) -> None:
        """Record the number of a message that was received, but is not taken."""
        self._newest = max(self._newest, number or 0)

    def update(self, endpoints: Sequence[Endpoint]) -> bool:
        """Update the publishers; return whether knowledge of obstacles must begin anew."""
        before = [one.gid for one in self.publishers]
        known = self._endpoints or {}
        current = {one.gid: one for one in endpoints}
        new = [gid for gid in current if gid not in known]
        self._endpoints = {gid: current[gid]
                           for gid in (*(gid for gid in known if gid in current), *new)}
        if self.awaits_endpoint and len(new) <= 1:
            # Those that have gone were not its publisher, and the new one is.
            if new:
                self._publisher = self._presumed = new[0]
                self.awaits_endpoint = False
            return False
        self._silent = (self._silent & current.keys()) | {*new}
        self._perhaps_silent &= current.keys()
        if current.keys() == known.keys():
            # The same ones: a node name may have become known, and by it who counts.
            return False
        if [one.gid for one in self.publishers] == before:
            return False
        self.awaits_endpoint = False
        self.mixed_until = NEVER
        self._is_newest_sure = known.keys().isdisjoint(current)
        if self._is_newest_sure:
            self._newest, self._again, self.again_until = 0, 0, NEVER
        self.interrupt()
        return True

    def _doubt_publisher(self, number: int) -> None:
        """Let all count if an older publisher of the same node name may have sent a number."""
        if number > self._last_before:
            self._publisher = None

    def _find_publisher(self, number: int, expected: int | None, now: int) -> None:
        """Find the publisher that began a stream with this number."""
        self._publisher = None
        self.mixed_until = NEVER
        presumed, self._presumed = self._presumed, None
        if self._perhaps_silent:
            return
        if len(self._silent) == 1:
            self._publisher = self._silent.pop()
        elif not self._silent and number == 1:
            if presumed in (self._endpoints or ()):
                self._publisher = presumed
            else:
                self.awaits_endpoint = True
        elif not self._silent and expected is not None:
            self._be_mixed(now)

    def _be_mixed(self, now: int) -> None:
        self.mixed_until = now + (_MIXED_MAP if self.timeout == NEVER else self.timeout)

    def interrupt(self) -> None:
        """End the stream: the next message belongs to another one."""
        self.is_interrupted = True

    def restart(self, now: int) -> None:
        """Start over with a new subscription, to which the publisher sends all that it keeps."""
        self.last, self.is_interrupted = 0, True
        self._again = max(self._again, self._newest)
        self.limit_again(now)
        self._newest, self._is_newest_sure = 0, self.is_alone
        self._silent = {one.gid for one in self.publishers}
        self._perhaps_silent.clear()

    def limit_again(self, now: int) -> None:
        """Await what was received before for long only if it is surely of the one publisher."""
        if self._again and not self._is_newest_sure:
            self.again_until = now + _MIXED_MAP

    def pass_time(self, now: int) -> None:
        """Let time pass, after which numbers of two publishers are no longer a fault."""
        if self.mixed_until < now:
            self.mixed_until = NEVER
        if self.again_until < now:
            self._again, self.again_until = 0, NEVER

    def set_back(self, now: int) -> None:
        """Adjust to a clock that was set back."""
        if self.mixed_until < NEVER:
            self._be_mixed(now)
        if self.again_until < NEVER:
            self.again_until = now + _MIXED_MAP

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
        elif self.is_again:
            faults.append('is being received again from the start')
        return faults

    def hints(self, is_lossy: bool = False) -> list[str]:
        """Return which messages of the publishers may be missing, and why some were lost."""
        return [*filter(None, chain.from_iterable(
            (one.hint, one.loss if is_lossy else '') for one in self.publishers))]


def _named(endpoint: Endpoint) -> str:
    return endpoint.node or 'of a node whose name is not known yet'

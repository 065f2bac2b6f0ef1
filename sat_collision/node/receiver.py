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

"""What the loop calls: the node's handlers of messages and time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Backlog(NamedTuple):
    """How far behind the taking of a topic is: in seconds, and about how many messages."""

    seconds: float
    messages: int


class Receiver(Protocol):
    """What the loop calls."""

    def receive(self, name: str, messages: Sequence[bytes], now: int,
                number: int | None) -> None:
        """
        Take messages of one publisher, between which none is missing.

        Parameters
        ----------
        name : str
            Name of the footprint or source.
        messages : sequence of bytes
        now : int
            Present time in ns.
        number : int or None
            Which one of its publisher's messages the first one is, where that is known.

        """

    def begin_stream(self, name: str) -> None:
        """Record that the next message of a footprint or source is the first of its publisher."""

    def end_batch(self, messages: int, seconds: float) -> None:
        """Publish what has changed, after so many messages that took so long."""

    def note_backlog(self, name: str, backlog: Backlog | None) -> None:
        """Record how far behind a topic is, None where it is not any more."""

    def due(self, now: int, steady: float) -> float:
        """
        Return when the next tick is due, by the steady clock in s; messages may put it off.

        Parameters
        ----------
        now : int
            A time in ns, by the clock of the header stamps.
        steady : float
            The same time by the steady clock.

        """

    def tick(self, now: int, is_all_taken: bool) -> None:
        """
        Do what is due by time alone.

        Parameters
        ----------
        now : int
            Present time in ns, read before the messages of this turn were taken.
        is_all_taken : bool
            Whether all that had been sent until then has been received.

        """

    def present(self) -> int:
        """Return the present time in ns by the clock of the header stamps."""

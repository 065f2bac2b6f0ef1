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

"""Messages in the order of their own stamps, whenever they were received."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from itertools import groupby, islice
from operator import itemgetter
from typing import TypeAlias

from sat_collision.messages.cdr import header_stamp
from sat_collision.messages.ingest import Batch
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.replay.bag.storage import Message
from sat_collision.scene.settings import TF

# Messages in a row of one topic that count at one time, in ns.
Run: TypeAlias = tuple[str, int, list[bytes]]

# As many messages as the node takes together.
_LONGEST_ROW = 64
# How late a message may be received to count at its own stamp, ns.
WINDOW = 10 * 10**9


class StampOrder:
    """
    Yields Runs by the time of the stamp, from messages by time received.

    A message without a stamp counts when it is received; so does one whose stamp is further than
    WINDOW from that, as those of another clock are, unless the stamps are the clock. Then the time
    is 0 of what comes before the first stamp.

    Parameters
    ----------
    messages : iterable of Message
    by_header : bool
        Whether the stamps are the clock.

    Attributes
    ----------
    delay : int
        How much later than its stamp the last message was received, ns; 0 by the header.

    """

    def __init__(self, messages: Iterable[Message], by_header: bool) -> None:
        self.delay = 0
        self._messages = messages
        self._by_header = by_header
        self._waiting: list[tuple[int, int, str, bytes]] = []

    def __iter__(self) -> Iterator[Run]:
        by_header, waiting = self._by_header, self._waiting
        latest = released = 0
        for count, (topic, received, data) in enumerate(self._messages):
            if topic == TF_STATIC:
                # It holds at any time.
                waiting.append((0, count, topic, data))
                continue
            time = _tf_stamp(data) if topic == TF else header_stamp(data)
            if by_header:
                if time and time < latest - WINDOW:
                    # The clock was set back: what is from before comes first.
                    yield from self._take(None)
                    latest = released = 0
                time = received = time or latest
            elif not (time and -WINDOW <= received - time <= WINDOW):
                time = received
            self.delay = received - time
            if received > latest:
                latest = received
            waiting.append((time, count, topic, data))
            if latest > released + 2 * WINDOW:
                released = latest - WINDOW
                yield from self._take(released)
        yield from self._take(None)

    def _take(self, until: int | None) -> Iterator[Run]:
        """Take what is from before a time, or all, out of what waits."""
        waiting = self._waiting
        waiting.sort()
        end = len(waiting) if until is None else bisect_left(waiting, (until,))
        ready = waiting[:end]
        del waiting[:end]
        for (topic, time), run in groupby(ready, itemgetter(2, 0)):
            yield topic, time, [message[3] for message in run]


class Rows:
    """
    Yields messages one by one as they were received, and skips what adds to a set in one call.

    Parameters
    ----------
    messages : iterable of Message

    """

    def __init__(self, messages: Iterable[Message]) -> None:
        self._messages = messages
        self._row: list[Message] = []
        self._batch = Batch(())
        self._taken = 0

    def __iter__(self) -> Iterator[Run]:
        for topic, messages in groupby(self._messages, itemgetter(0)):
            while row := [*islice(messages, _LONGEST_ROW)]:
                self._row, self._taken = row, 0
                self._batch = Batch([(data, None) for _, _, data in row])
                while self._taken < len(row):
                    _, time, data = row[self._taken]
                    self._taken += 1
                    yield topic, time, [data]

    def receive_run(self, monitor: Monitor, name: str, now: int, bound: float) -> int:
        """
        Have a monitor receive what only adds to the set of the message yielded last.

        Parameters
        ----------
        monitor : Monitor
        name : str
            The source.
        now : int
        bound : int or float
            Until then nothing happens by time alone, in ns.

        Returns
        -------
        int
            The time of the last message that was received.

        """
        if self._taken < len(self._row) and self._row[-1][1] <= bound:
            taken = monitor.receive_run(name, self._batch, self._taken, now)
            if taken:
                self._taken += taken
                now = max(now, self._row[self._taken - 1][1])
        return now


def _tf_stamp(data: bytes) -> int:
    """Return the stamp of the first transform in ns; 0 where there is none."""
    # Behind the number of transforms comes the header of the first one.
    return header_stamp(data[:4] + data[8:16]) if data[4:8] != bytes(4) else 0

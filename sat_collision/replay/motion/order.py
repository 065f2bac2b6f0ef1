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

from sat_collision.messages.cdr import header_stamp
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.replay.bag.storage import Message
from sat_collision.scene.settings import TF

# How late a message may be received to count at its own stamp, ns.
WINDOW = 10 * 10**9


class StampOrder:
    """
    Yields (topic, time in ns, data) by the time of the stamp, from messages by time received.

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

    def __iter__(self) -> Iterator[Message]:
        by_header, waiting = self._by_header, self._waiting
        latest = released = 0
        for count, (topic, received, data) in enumerate(self._messages):
            if topic == TF_STATIC:
                # It holds at any time.
                waiting.append((0, count, topic, data))
                continue
            time = _stamp(topic, data)
            if by_header:
                if time and time < latest - WINDOW:
                    # The clock was set back: what is from before comes first.
                    yield from self._take(None)
                    latest = released = 0
                time = received = time or latest
            elif abs(received - time) > WINDOW or not time:
                time = received
            self.delay = received - time
            if received > latest:
                latest = received
            waiting.append((time, count, topic, data))
            if latest > released + 2 * WINDOW:
                released = latest - WINDOW
                yield from self._take(released)
        yield from self._take(None)

    def _take(self, until: int | None) -> Iterator[Message]:
        """Take what is from before a time, or all, out of what waits."""
        waiting = self._waiting
        waiting.sort()
        end = len(waiting) if until is None else bisect_left(waiting, (until,))
        ready = waiting[:end]
        del waiting[:end]
        for time, _, topic, data in ready:
            yield topic, time, data


def _stamp(topic: str, data: bytes) -> int:
    """Return when that was of which a message tells, in ns; 0 where it does not say."""
    if topic == TF:
        # Behind the number of transforms comes the header of the first one.
        return header_stamp(data[:4] + data[8:16]) if data[4:8] != bytes(4) else 0
    return header_stamp(data)

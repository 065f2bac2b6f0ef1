# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The messages that a recorder lost, by the events that it published and recorded."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from itertools import chain

from sat_collision.messages.cdr import decode_losses
from sat_collision.replay.bag.storage import Row
from sat_collision.replay.model.result import joined
from sat_collision.replay.order import Timed
from sat_collision.scene.settings import NEVER

LOSS_TYPE = 'rosbag2_interfaces/msg/MessagesLostEvent'
UNSEEN = ('what its recorder lost cannot be seen: the recording has no '
          '/events/rosbag2_messages_lost')

# How much later than it counted an event may have been received, ns.
_LATENCY = 10**9


class AfterLoss(bytes):
    """A message before which others of its topic may have been lost."""


class Losses:
    """
    When and how many messages of each topic were lost.

    An event has what was lost since the last one of the same recorder. Where in that time is not
    known, so there may be a loss before each of the messages that were received then, and before
    the first one after that. Counted are those of the times from start on and before stop, in ns.
    """

    def __init__(self, start: int, stop: int | None) -> None:
        self.counts: Counter[str] = Counter()  # by topic
        self._start, self._stop = start, NEVER if stop is None else stop
        # By topic the times from the event before to the one that reports a loss; when each
        # recorder sent its last event.
        self._times: defaultdict[str, list[tuple[float, float]]] = defaultdict(list)
        self._last: dict[str, int] = {}
        # When the last message of each topic was received.
        self._received: dict[str, int] = {}

    def add(self, time: int, event: bytes) -> None:
        """Add an event, by the time at which it was received; raise MessageError if it is bad."""
        recorder, lost = decode_losses(event)
        begin = self._last.get(recorder, -NEVER) - _LATENCY
        self._last[recorder] = time
        for topic, count in lost:
            if count:
                self._times[topic].append((begin, time))
                if begin < self._stop and time >= self._start:
                    self.counts[topic] += count

    def mark(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Yield rows that begin anew with each message after a loss, which is an AfterLoss."""
        times_of = {topic: joined(times) for topic, times in self._times.items()}
        ends_of = {topic: [end for _, end in times] for topic, times in times_of.items()}
        for topic, times, messages in rows:
            if topic in times_of:
                begin = 0
                for k, time in enumerate(times):
                    place = bisect_right(ends_of[topic], self._received.get(topic, -NEVER))
                    if place < len(times_of[topic]) and times_of[topic][place][0] < time:
                        if k:
                            yield topic, times[begin:k], messages[begin:k]
                        begin, messages[k] = k, AfterLoss(messages[k])
                    self._received[topic] = time
                times, messages = times[begin:], messages[begin:]
            yield topic, times, messages


def apart(runs: Iterable[Timed]) -> Iterator[Timed]:
    """Yield runs of messages that begin anew with each AfterLoss."""
    for topic, time, messages in runs:
        places = [k for k, data in enumerate(messages) if k and isinstance(data, AfterLoss)]
        for begin, end in zip(chain((0,), places), chain(places, (len(messages),))):
            yield topic, time, messages[begin:end]

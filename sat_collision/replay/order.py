# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Messages in the order in which a check takes them: as received, or by their own stamps."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import accumulate, groupby
from operator import itemgetter
from typing import TypeAlias

from sat_collision.messages.cdr import decode_transforms, header_stamp, MessageError, STAMP_SIZE
from sat_collision.messages.ingest import Batch
from sat_collision.messages.transform_listener import TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.replay.bag.storage import Row
from sat_collision.scene.frames import in_quotes
from sat_collision.scene.settings import NEVER, TF

# Consecutive messages of one topic with the same time, in ns.
Timed: TypeAlias = tuple[str, int, list[bytes]]

# A time, the number of the first message, the topic, and messages.
_Counted: TypeAlias = tuple[int, int, str, list[bytes]]

# How far apart stamp and time received may be for a message to count at its stamp, ns.
WINDOW = 10 * 10**9

_NONE = Batch(())
_header_of = itemgetter(slice(STAMP_SIZE))


class ArrivalOrder:
    """Yields messages as received, one by one, except those that `receive_run` has passed on."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self._rows = rows
        self._times: list[int] = []
        self._messages: list[bytes] = []
        self._taken = 0
        self._single = -1  # the number of the message that ended the last run of the row
        self._batch = _NONE  # the first messages of the row, for `receive_run`

    def __iter__(self) -> Iterator[Timed]:
        for topic, times, messages in self._rows:
            self._times, self._messages, self._batch = times, messages, _NONE
            self._taken, self._single = 0, -1
            while (taken := self._taken) < len(times):
                self._taken += 1
                yield topic, times[taken], messages[taken:taken + 1]

    def receive_run(self, monitor: Monitor, name: str, now: int, bound: float) -> int | None:
        """
        Pass the message that was yielded last, and those that continue it, on to a monitor.

        Only those received until the bound, in ns, before which nothing is due. Returns when the
        last one was received, or something that they brought is due before; None if none was.
        """
        end = bisect_right(self._times, bound)
        if end < self._taken or self._single == self._taken - 1:
            return None
        if end != len(self._batch.messages):
            self._batch = Batch(self._messages[:end])
        taken = monitor.receive_run(name, self._batch, self._taken - 1, now)
        if not taken:
            return None
        self._taken += taken - 1
        self._single = self._taken
        return max(now, int(min(self._times[self._taken - 1], monitor.deadline)))


class StampOrder:
    """
    Yields messages in the order of stamps, given in the order received.

    A message without a stamp counts at the time received; so does one whose stamp is more than
    WINDOW off that, as it is from another clock. With `by_header` the stamps are the clock, and a
    message without one counts at the latest stamp so far, 0 before the first.

    Maps and plans, on `timeless` topics, may have any stamp, so theirs are not the clock. They
    count at it if it lies in the WINDOW before the time received, and not before the time given
    for the topic. With `by_header` that time received is the latest stamp so far, and they do not
    count before the first one.

    Where a mark ends a set, order says what is in it: its messages stay in their order, and all
    count at the latest stamp of them but that of the mark. Those of a map, each of which stays,
    count at the latest stamp of those received until then. `marks` has for the topic of each such
    source what tells whether a message is a mark. A set that stays open for longer than its
    timeout in ns, in `timeouts`, is read in parts, as what is older would be refused. What has no
    mark counts at its own stamp, or at that of a message before if this is later.
    """

    def __init__(self, rows: Iterable[Row], by_header: bool,
                 marks: Mapping[str, Callable[[bytes], bool]] | None = None,
                 timeless: Mapping[str, int] | None = None,
                 timeouts: Mapping[str, float] | None = None) -> None:
        # How much later than its time the last message was received, ns; unused by header.
        self.delay = 0
        self._rows = rows
        self._by_header = by_header
        self._timeless = timeless or {}
        # Consecutive messages of one topic and time, with the count of the first.
        self._waiting: list[_Counted] = []
        # The same of the sets that are being received, by their topics.
        self._sets: dict[str, list[_Counted]] = {topic: [] for topic in marks or ()}
        self._marks = marks or {}
        self._timeouts = timeouts or {}
        # The oldest and the newest time in the set that is being received, by topic.
        self._spans: dict[str, tuple[int, int]] = {}
        # The first of each frame, None once it was corrected.
        self._static: dict[str, object] = {}

    def __iter__(self) -> Iterator[Timed]:
        by_header, waiting = self._by_header, self._waiting
        first_time = latest = released = time = before = count = 0
        # The run that a message extends if it has its topic and header, received in begin to end.
        run, run_topic, head, begin, end = [b''], '', b'', 0, 0
        for topic, times, messages in self._rows:
            if by_header:
                times = [0] * len(times)
            k = 0
            for own, same in groupby(messages, _header_of):
                stop = k + len([*same])
                while k < stop:
                    received = times[k]
                    if topic == run_topic and own == head and begin <= received <= end:
                        first, k = k, bisect_right(times, end, k, stop)
                        run += messages[first:k]
                        before = times[k - 1]
                        latest = max(latest, before)
                        continue
                    data = messages[k]
                    k += 1
                    run, run_topic = [data], ''
                    count += 1
                    if topic == TF_STATIC:
                        # They count from then on, the first of their frames at any time, too.
                        waiting.append((received or latest, count, topic, run))
                        if self.note_static(data):
                            waiting.append((0, count, topic, [data]))
                        continue
                    time = stamp = _tf_stamp(data) if topic == TF else header_stamp(data)
                    if by_header:
                        if topic in self._timeless and not (
                                max(first_time, latest - WINDOW) <= time <= latest):
                            time = latest
                        if time and time < latest - WINDOW:
                            # The clock was set back: earlier messages come first.
                            self._end_sets()
                            yield from self._take(None)
                            first_time = latest = released = 0
                        time = received = time or latest
                        first_time = first_time or time
                    else:
                        oldest, newest = received - WINDOW, received + WINDOW
                        if topic in self._timeless:
                            oldest, newest = max(oldest, self._timeless[topic]), received
                        if not (time and oldest <= time <= newest):
                            time = received
                    if stamp and time == stamp and topic != TF:
                        run_topic, head = topic, own
                        begin, end = (0, 0) if by_header else (stamp - WINDOW, stamp + WINDOW)
                    before = received
                    latest = max(latest, received)
                    if topic in self._sets:
                        self._add_to_set(topic, (time, count, topic, run))
                    else:
                        waiting.append((time, count, topic, run))
                    if latest > released + 2 * WINDOW:
                        released = latest - WINDOW
                        self._end_sets(released)
                        self.delay = received - time
                        yield from self._take(released)
                        run_topic = ''
        self.delay = before - time
        self._end_sets()
        yield from self._take(None)

    def note_static(self, data: bytes) -> bool:
        """Note static transforms; return whether they are the first of their frames, or equal."""
        try:
            found: dict[str, object] = {child: (parent, transform) for parent, child, _, transform
                                        in decode_transforms(data)}
        except MessageError:
            return False
        if found == {child: self._static.setdefault(child, one) for child, one in found.items()}:
            return True
        # Those that follow count after this one, also where they are as the first one again.
        self._static.update(dict.fromkeys(found))
        return False

    def _add_to_set(self, topic: str, counted: _Counted) -> None:
        """Add messages to the set that is being received on a topic, or to the next one."""
        parts, is_mark = self._sets[topic], self._marks[topic]
        time, *_, run = counted
        oldest, newest = self._spans[topic] if parts else (time, time)
        is_late = newest <= time > oldest + self._timeouts.get(topic, NEVER)
        if parts and (is_mark(parts[-1][-1][-1]) or is_late and not is_mark(run[0])):
            self._end_set(topic)
            oldest = newest = time
        parts.append(counted)
        self._spans[topic] = min(oldest, time), max(newest, time)

    def _end_set(self, topic: str) -> None:
        parts, is_mark = self._sets[topic], self._marks[topic]
        times = [0 if is_mark(run[0]) else time for time, *_, run in parts]
        if topic not in self._timeless and is_mark(parts[-1][-1][-1]):
            times[0] = max(times)
        # Only an empty set counts at the stamp of its mark.
        self._waiting += [(time or parts[-1][0], count, topic, run)
                          for time, (_, count, _, run) in zip(accumulate(times, max), parts)]
        parts.clear()

    def _end_sets(self, until: int | None = None) -> None:
        """End the sets that are being received, those that began before a time or all."""
        for topic, parts in self._sets.items():
            if parts and (until is None or parts[0][0] < until):
                self._end_set(topic)

    def _take(self, until: int | None) -> Iterator[Timed]:
        """Yield and drop the waiting messages from before a time, or all."""
        waiting = self._waiting
        waiting.sort()
        end = len(waiting) if until is None else bisect_left(waiting, (until,))
        ready = waiting[:end]
        del waiting[:end]
        last_topic, last_time, messages = '', -1, [b'']
        for time, _, topic, run in ready:
            if topic == last_topic and time == last_time:
                messages += run
                continue
            if last_topic:
                yield last_topic, last_time, messages
            last_topic, last_time, messages = topic, time, run
        if last_topic:
            yield last_topic, last_time, messages


def by_stamps_as_received(rows: Iterable[Row], timeless: Collection[str],
                          frames: Callable[[], Collection[str]]) -> Iterator[Timed]:
    """
    Yield messages as received, each with its stamp; 0 where it has none or is of `timeless`.

    On /tf only the stamps of `frames` count, by which outlines move: those of others, such as a
    map's, may be ahead.
    """
    for topic, _, messages in rows:
        for data in messages:
            if topic == TF:
                moving = frames()
                time = max((stamp for frame, stamp in _frames_of(data) if frame in moving),
                           default=0)
            else:
                time = 0 if topic in timeless else header_stamp(data)
            yield topic, time, [data]


def until_set_back(rows: Iterable[Row], tolerances: Mapping[str, int],
                   marks: Mapping[str, Callable[[bytes], bool]],
                   report: Callable[[str, int, int], None]) -> Iterator[Row]:
    """
    Yield messages until those of a topic, or of a frame on /tf, show that a clock was set back.

    That is where two in a row are stamped before the latest one by more than the tolerance of the
    topic, in ns: one alone was only received late, unless it is by more than WINDOW. What has such
    stamps, the latest one and the first after that are then reported. Those of marks, see
    `StampOrder`, do not count.
    """
    latest: dict[str, int] = {}
    late: dict[str, int] = {}
    for topic, times, messages in rows:
        for k, data in enumerate(messages if topic in tolerances else ()):
            for name, stamp in _named_stamps(topic, data):
                before = latest.get(name, stamp)
                oldest = before - tolerances[topic]
                if not stamp or not oldest <= stamp <= before and (
                        topic in marks and marks[topic](data)):
                    continue
                if stamp >= oldest:
                    latest[name] = max(stamp, before)
                    late.pop(name, None)
                elif name in late or stamp < before - WINDOW:
                    if k:
                        yield topic, times[:k], messages[:k]
                    report(name, before, late.get(name, stamp))
                    return
                else:
                    late[name] = stamp
        yield topic, times, messages


def _named_stamps(topic: str, data: bytes) -> Iterator[tuple[str, int]]:
    """Yield the stamp of a topic, or those of the frames on /tf, each with its name in words."""
    if topic != TF:
        yield topic, header_stamp(data)
        return
    for frame, stamp in _frames_of(data):
        yield f'frame {in_quotes(frame)} on {TF}', stamp


def _frames_of(data: bytes) -> list[tuple[str, int]]:
    """Return the child frames of a message of /tf with their stamps, none if it is damaged."""
    try:
        return [(child.removeprefix('/'), stamp) for _, child, stamp, _ in decode_transforms(data)]
    except MessageError:
        return []


def _tf_stamp(data: bytes) -> int:
    """Return the stamp of the first transform in ns; 0 if there is none."""
    # The header of the first transform follows the number of transforms.
    return header_stamp(data[:4] + data[8:16]) if data[4:8] != bytes(4) else 0

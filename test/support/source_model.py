# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A model of a source of obstacles, see scene_model: its obstacles, and whether all are known.

It follows the rules of docs/knowing.md literally. What came since knowledge began is a log of all
messages; each query reads it from the start. Publishers are not announced: a stream begins with
number 1, or with a number that was already received. Times are in ns.
"""

from dataclasses import dataclass, field, replace as changed
from itertools import dropwhile
from math import inf
from typing import NamedTuple

from builders import SECOND
from sat_collision.scene.obstacle_store import TOO_MANY
from sat_collision.scene.sources import TOO_OLD

# At most so many sets that are not whole are kept, a map is received in so long, and obstacles
# stamped in the same one of so many parts of a timeout are forgotten together.
MOST_NEWER, LONGEST_OPEN, PARTS = 20, SECOND, 32


class Message(NamedTuple):
    """A received message: a ring, None for an empty polygon, or why it was refused."""

    ring: tuple | None
    refusal: str | None
    stamp: int | None  # as in its header; None if it was not read
    now: int
    instance: int | None
    number: int
    is_first: bool = False  # whether it has number 1
    is_next: bool = False  # whether nothing is missing between it and the one before

    @property
    def sent(self):
        """Return its stamp, that of its arrival if it has none."""
        return self.stamp or self.now

    @property
    def time(self):
        return min(self.sent, self.now)

    @property
    def is_empty(self):
        return self.ring is None and self.refusal is None


@dataclass
class Obstacle:
    """An obstacle, or a placeholder of a refused one."""

    key: int
    ring: tuple | None
    time: int
    stamp: int = 0
    refusal: str | None = None
    places: tuple = ()


@dataclass
class Listing:
    """What is sent until the next mark, stamp or message, as is declared."""

    is_sound: bool
    stamp: int | None = None
    times: list = field(default_factory=list)
    begun: int | None = None
    members: list = field(default_factory=list)


def read_listings(settings, _, log, now):
    """Return groups of what is held, whether all is known, and the answer to the last message."""
    timeout, is_map = timeout_of(settings), not settings.timeout
    whole, newer, current = None, [], Listing(False)
    is_doubtful = is_unread = False
    answer = None

    def is_young(time):
        return time is not None and min(whole.times) + timeout >= time

    def close():
        nonlocal whole, newer, current, is_doubtful
        if current.is_sound:
            whole, newer, is_doubtful = current, [], False
        elif current.members:
            newer.append(current)
            if len(newer) > MOST_NEWER:
                newer.pop(0)
                is_doubtful = True
        current = Listing(True, current.stamp)

    def separate(message):
        before = current
        if before.stamp is None or message.sent == before.stamp and before.times:
            return
        is_newer = message.sent > before.stamp
        before.is_sound &= is_newer
        if before.times:
            close()
        current.is_sound &= is_newer and message.is_next and not is_unread

    def expire(time):
        nonlocal whole, is_doubtful
        if whole and not is_young(time):
            newer.insert(0, whole)
            whole = None
        if is_map and current.begun is not None and abs(time - current.begun) > LONGEST_OPEN:
            is_doubtful = True

    for message in log:
        if not isinstance(message, Message):
            expire(message)
            continue
        expire(message.now)
        answer = message.refusal
        is_lost = not message.is_first and not message.is_next and message is not log[0]
        if message.is_first:
            current.is_sound = True
        if is_lost:
            current.is_sound = False
            is_doubtful |= is_map
        if message.stamp is None:
            current.is_sound, is_doubtful, is_unread = False, True, True
            continue
        if settings.set_end == 'new_stamp':
            if message.is_empty and message.sent == current.stamp:
                continue
            separate(message)
        is_unread = False
        if settings.set_end == 'each_message':
            current.is_sound = not (whole and message.sent < whole.stamp and not is_map)
        current.stamp = message.sent
        if message.is_empty:
            current.times = current.times or [message.time]
            close()
            continue
        current.times.append(message.time)
        current.begun = message.now if current.begun is None else current.begun
        if not answer and len(current.members) >= settings.max_count:
            answer = TOO_MANY
        if answer:
            current.is_sound, is_doubtful = False, True
        else:
            current.members.append(Obstacle(len(current.members), message.ring, message.time))
        if settings.set_end == 'each_message':
            close()
    expire(now)
    groups = [one.members for one in ([whole] if whole else []) + newer + [current]]
    if whole is None:
        groups = [filtered(group, now - timeout) for group in groups]
    return groups, whole is not None and not is_doubtful, answer


def read_refreshed(settings, tolerance, log, now):
    """As `read_listings`, of obstacles that are sent again and again."""
    timeout = timeout_of(settings)
    part = max(timeout // PARTS, 1)
    parts, counts, ids = {}, {}, {}
    begun, newest, heard, is_known = None, -inf, -inf, False
    answer = None

    def fall_silent(time):
        nonlocal begun, is_known, ids
        if heard + timeout < time:
            begun, is_known = None, False
            ids = without_first(ids, lambda one: one.time + timeout < time)
            for end in [*parts]:
                parts[end] = filtered(parts[end], time - timeout)
                if not parts[end]:
                    del parts[end], counts[end]

    def miss(time):
        nonlocal begun, is_known
        begun, is_known = time, False

    for message in log:
        fall_silent(message.now)
        answer, instance, stamp = message.refusal, message.instance, message.sent
        if answer and (message.stamp is None or not instance):
            miss(message.now)
            continue
        if message.is_empty and not message.stamp:
            if not message.is_next:
                miss(message.now)
            continue
        if not message.is_next or begun is None or newest + timeout < stamp:
            miss(message.now)
        heard, newest = max(heard, message.time), max(newest, stamp)
        ids = without_first(ids, lambda one: one.stamp < stamp - timeout)
        for end in [end for end in parts if end <= stamp - timeout]:
            del parts[end], counts[end]
        if stamp > begun + timeout + tolerance and heard + timeout >= message.now:
            is_known = True
        if message.is_empty:
            continue
        has_room = sum(counts.values()) + sum(map(len, ids.values())) < settings.max_count
        if not instance:
            if has_room:
                end = (stamp // part + 1) * part
                count = counts[end] = counts.get(end, 0) + 1
                parts.setdefault(end, []).append(Obstacle(count - 1, message.ring, message.time))
        else:
            has_room = put(ids, message, has_room, timeout)
        if not has_room:
            answer = TOO_MANY
            miss(message.now)
    fall_silent(now)
    has_refused = any(one.refusal for held in ids.values() for one in held)
    return [ids, *parts.values()], is_known and not has_refused, answer


def put(ids, message, has_room, timeout):
    """Put an obstacle where its newest stamp says, or beside that; return if there was room."""
    held = ids.pop(message.instance, [])
    one = Obstacle(message.instance, message.ring, message.time, message.sent, message.refusal)
    if held and one.stamp > held[0].stamp:
        one.places, held, has_room = held[0].places, [], True
    if has_room:
        if message.ring and not held and message.time + timeout >= message.now:
            one.places = followed_by(one.places, one.stamp, one.ring)
        held.append(one)
    if held:
        ids[message.instance] = held
    return has_room


def filtered(obstacles, oldest):
    return [one for one in obstacles if one.time >= oldest]


def without_first(ids, is_gone):
    """Drop the ids all of whose obstacles are gone, of those least recently received."""
    return dict(dropwhile(lambda item: all(map(is_gone, item[1])), ids.items()))


def followed_by(places, stamp, ring):
    """Append the next place of a body; earlier places are dropped if its stamp goes back."""
    return *((t, r) for t, r in places if places[-1][0] <= stamp and t != stamp), (stamp, ring)


def velocity_of(places, stamp):
    """Return vx and vy in m/s of a body that moved without rotating, None if unknown."""
    last, ring = places[-1] if places else (None, ())
    earlier = [place for place in places if last - place[0] >= 10 * SECOND // 1000]
    if last != stamp or not earlier or last - earlier[-1][0] > 2 * SECOND:
        return None
    begin, before = earlier[-1]
    moves = {(x - a, y - b) for (x, y), (a, b) in zip(ring, before)}
    if len(ring) != len(before) or len(moves) > 1:
        return None
    return tuple(move * SECOND / (last - begin) for move in moves.pop())


class SourceModel:
    """One source of obstacles: the log since knowledge began, and what was told before."""

    def __init__(self, settings, tolerance):
        self.settings = settings
        self._tolerance = tolerance
        self._read = read_refreshed if settings.set_end == 'none' else read_listings
        # Groups of what was told before: lists, or dicts of lists by id.
        self._former = []
        self._log = []
        self._next = None
        self._now = 0
        self._question = self._result = None

    def switch(self, settings):
        """Reset it when it is disabled or enabled."""
        self.settings = settings
        self._log, self._former, self._next = [], [], None

    def step_back(self, now):
        """Begin anew: what was told before counts for one more timeout."""
        if self.settings.timeout:
            self._next = None
            self._begin_anew(now, time=now)
        else:
            self._log.append(now)
        self._now = now

    def pass_time(self, now):
        """Let time pass; a whole map ends what was told before."""
        self._now = now
        if not self.settings.timeout and self.is_known(now):
            self._former.clear()

    def receive(self, message):
        """Receive a message; return why it is refused, None if it is not."""
        settings, now = self.settings, message.now
        self.pass_time(now)
        expected, self._next = self._next, message.number + 1
        is_old = message.time + timeout_of(settings) < now
        is_mark = message.is_empty and settings.set_end == 'empty_polygon'
        is_joined = expected is None or message.number < expected
        if is_joined:
            self._begin_anew(now)
        elif message.stamp and not is_mark and settings.timeout and (
                message.stamp + timeout_of(settings) < self._newest()):
            is_joined = True
            self._begin_anew(now, time=now)
        self._log.append(message._replace(is_first=message.number == 1,
                                          is_next=not is_joined and message.number == expected))
        self.pass_time(now)
        return self._reading(now)[2] or (TOO_OLD if is_old and not is_mark else None)

    def held(self, now):
        """Return all obstacles, including the placeholders of refused messages."""
        groups = self._reading(now)[0] + self._still(self._former, now)
        return [one for group in groups for one in members_of(group)]

    def is_known(self, now):
        return self._reading(now)[1]

    def _newest(self):
        """Return the newest stamp: of obstacles, without listings of all that show life."""
        return max((one.sent for one in self._log if isinstance(one, Message)
                    and one.stamp is not None and (
                        not one.is_empty if self._read is read_listings else
                        one.stamp if one.is_empty else not one.refusal or one.instance)),
                   default=-inf)

    def _reading(self, now):
        """Read the log, unless nothing has changed since the last query."""
        question = self._log, len(self._log), now
        if question != self._question:
            self._question = question
            self._result = self._read(self.settings, self._tolerance, self._log, now)
        return self._result

    def _begin_anew(self, now, time=None):
        """Keep what is held, from another time on if one is given."""
        groups = self._reading(self._now)[0]
        self._former = self._still(self._former, self._now) + (
            self._still(groups, now) if time is None else groups)
        if time is not None:
            self._former = [{key: [changed(one, time=time) for one in held]
                             for key, held in group.items()} if isinstance(group, dict) else
                            [changed(one, time=time) for one in group] for group in self._former]
        self._log = []

    def _still(self, groups, now):
        """Return what of some groups is not older than the timeout."""
        oldest = now - timeout_of(self.settings)
        return [without_first(group, lambda one: one.time < oldest) if isinstance(group, dict)
                else filtered(group, oldest) for group in groups]


def members_of(group):
    return [one for held in group.values() for one in held] if isinstance(group, dict) else group


def nanoseconds(seconds):
    return round(seconds * SECOND)


def timeout_of(settings):
    return nanoseconds(settings.timeout) or inf


def is_past(settings, time, now):
    """Tell whether a time is older than the timeout, if that is not 0."""
    return now - time > timeout_of(settings)

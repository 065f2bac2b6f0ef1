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
A model of a source of obstacles, see scene_model: its obstacles, and whether it is known.

It follows the rules of docs/knowing.md literally. A listing is a log of all its messages; each
query reads it from the start. Publishers are not announced: a stream begins with number 1, or with
a number that was already received. Times are in ns.
"""

from dataclasses import dataclass, field
from itertools import dropwhile, filterfalse
from math import inf
from typing import NamedTuple

from builders import SECOND
from sat_collision.scene.obstacle_store import TOO_MANY
from sat_collision.scene.settings import POLYGON_INSTANCE
from sat_collision.scene.sources import TOO_OLD


class Message(NamedTuple):
    """A received message: a ring, None for an empty polygon, or why it was refused."""

    ring: tuple | None
    refusal: str | None
    stamp: int | None
    now: int
    instance: int | None
    number: int
    is_first: bool = False
    is_after_gap: bool = False

    @property
    def time(self):
        return min(self.stamp or self.now, self.now)

    @property
    def is_end(self):
        return self.ring is None and self.refusal is None

    @property
    def key(self):
        """Return the id, otherwise the ring; None if it could not be read."""
        return self.ring if self.instance is None else self.instance


class Obstacle(NamedTuple):
    """An obstacle, or a placeholder of a refused one."""

    key: object
    ring: tuple | None
    refusal: str | None
    time: int
    listing: int = 0
    places: tuple = ()


@dataclass
class Set:
    """A run of messages that is taken as a set."""

    start: int
    last: int
    is_sound: bool
    count: int = 0
    is_ended: bool = False
    is_whole: bool = False
    times: list = field(default_factory=list)
    members: list = field(default_factory=list)


def read_sets(settings, log, now):
    """Return the obstacles of the last whole set and later ones, and whether they are known."""
    window, max_count = nanoseconds(settings.set_window), settings.max_count
    sets = []
    is_missing = is_doubtful = is_cut = is_too_large = False

    def prove(one):
        nonlocal is_doubtful, is_cut, is_too_large
        if one.is_sound and not one.is_whole:
            sets[:] = [one]
            one.is_whole, is_too_large = True, one.count > max_count
            is_doubtful = is_cut = False

    for message in log:
        last = sets[-1] if sets else None
        is_unreadable = not message.stamp and not message.is_end
        is_missing |= message.is_after_gap or is_unreadable
        if is_missing and last and not last.is_whole:
            last.is_sound = False
        is_doubtful |= is_unreadable
        if not message.stamp:
            continue
        is_next, is_missing = last is not None and not is_missing, False
        is_near = last and not last.is_ended and abs(message.stamp - last.start) <= window
        if not (is_near and (last.count < max_count or is_next and message.is_end)
                or is_next and message.stamp == last.last):
            cuts = bool(last) and not last.is_ended and abs(message.stamp - last.last) <= window
            if is_next and not cuts:
                prove(last)
            is_cut |= cuts
            last = Set(message.stamp, message.stamp, message.is_first or is_next and not cuts)
            sets.append(last)
        elif not message.is_end:
            last.last = max(last.last, message.stamp)
        last.times.append(message.time)
        if message.is_end:
            last.is_ended = True
            prove(last)
            continue
        last.count += 1
        if not is_past(settings, message.time, message.now):
            place = min(len(last.members), max_count)
            refusal = message.refusal or (TOO_MANY if place == max_count else None)
            last.members[place:] = [
                Obstacle(place, None if refusal else message.ring, refusal, message.time)]
        if last.count == max_count and not is_cut and not is_too_large:
            prove(last)
        is_too_large |= last.count > max_count
    is_known = bool(sets) and sets[0].is_whole and not is_doubtful and not is_cut and (
        not is_past(settings, min(sets[0].times), now))
    return [member for one in sets for member in one.members
            if is_known or not is_past(settings, member.time, now)], is_known


def read_keys(settings, log, now):
    """Return the obstacles by id or ring, and whether all of one timeout has been received."""
    held, since, last = {}, None, -inf

    def forget(time):
        while held and is_past(settings, next(iter(held.values())).time, time):
            del held[next(iter(held))]

    def fall_silent(time):
        nonlocal since
        if is_past(settings, last, time):
            since = None
            forget(time)

    def miss(time):
        nonlocal since, last
        since = last = max(time, last)

    for message in log:
        fall_silent(message.now)
        is_lost = message.is_first or message.is_after_gap
        is_refused = message.refusal and (message.stamp is None or message.key is None)
        if not is_refused:
            if since is None or is_lost:
                since = max(message.time, last)
            last = max(message.time, last)
            forget(last)
        elif is_lost or message.key is None:
            miss(message.now)
        if not place(settings, held, message):
            miss(message.now)
    fall_silent(now)
    return [*held.values()], since is not None and since + nanoseconds(settings.timeout) <= last


def read_map(settings, log, now):
    """Return the obstacles of a map, and whether it is known; a time in the log is no pause."""
    held, listing, is_begun, is_known = {}, 0, False, False
    quiet_since = None

    def has_settled(time):
        return quiet_since is not None and (
            quiet_since + nanoseconds(settings.settle_time) < time)

    for message in log:
        if not isinstance(message, Message):
            quiet_since = None if quiet_since is None else message
            continue
        if has_settled(message.now):
            quiet_since, is_known = None, True
        if message.is_first:
            is_begun, quiet_since = True, message.now
        elif quiet_since is not None:
            quiet_since = message.now
        has_room = place(settings, held, message, listing)
        if message.is_after_gap or message.refusal or not has_room:
            is_begun, is_known, quiet_since = False, False, None
        if message.is_end:
            if is_begun:
                is_known = True
                held = {key: one for key, one in held.items() if one.listing == listing}
            listing, is_begun, quiet_since = listing + 1, True, None
    return [*held.values()], is_known or has_settled(now)


def place(settings, held, message, listing=0):
    """Put an obstacle where its newest stamp says; return whether there is room for it."""
    key = message.key
    if key is None or message.is_end or is_past(settings, message.time, message.now):
        return True
    before = held.pop(key, None)
    if before is None and len(held) >= settings.max_count:
        return False
    if before and message.time < before.time:
        held[key] = before
        return True
    places = before.places if before else ()
    if not message.refusal:
        places = followed_by(places, message.time, message.ring)
    held[key] = Obstacle(key, None if message.refusal else message.ring, message.refusal,
                         message.time, listing, places)
    return True


def followed_by(places, time, ring):
    """Append the next place of a body; earlier places are dropped if its time goes back."""
    return *((t, r) for t, r in places if places[-1][0] <= time and t != time), (time, ring)


def velocity_of(places, time):
    """Return vx and vy in m/s of a body that moved without rotating, None if unknown."""
    last, ring = places[-1] if places else (None, ())
    earlier = [place for place in places if last - place[0] >= 10 * SECOND // 1000]
    if last != time or not earlier or last - earlier[-1][0] > 2 * SECOND:
        return None
    begin, before = earlier[-1]
    moves = {(x - a, y - b) for (x, y), (a, b) in zip(ring, before)}
    if len(ring) != len(before) or len(moves) > 1:
        return None
    return tuple(move * SECOND / (last - begin) for move in moves.pop())


class SourceModel:
    """One source of obstacles: the log of its listing, and remains of earlier ones."""

    def __init__(self, settings):
        self.settings = settings
        self._read = (read_map if not settings.timeout else
                      read_sets if self._has_sets else read_keys)
        # How each former listing is filtered as it becomes stale, and its obstacles.
        self._former = []
        self._log = []
        self._next = None
        self._question = self._answer = None

    def switch(self, settings):
        """Reset it when it is disabled or enabled."""
        self.settings = settings
        self._forget()

    def step_back(self, now):
        """Drop everything that has a time."""
        if self.settings.timeout:
            self._forget()
        else:
            self._log.append(now)

    def pass_time(self, now, is_all_taken=True):
        """Let time pass; while messages may be queued, it is no pause."""
        if not is_all_taken and self._read is read_map:
            self._log.append(now)
        if self._read is read_map and self.is_known(now):
            self._former.clear()

    def receive(self, message):
        """Receive a message; return why it is refused, None if it is not."""
        self.pass_time(message.now)
        expected, self._next = self._next, message.number + 1
        if expected is None or message.number < expected:
            self._begin_anew(self._read, message.now)
        if self._has_sets and self.settings.timeout and message.stamp is not None and (
                message.stamp or not message.is_end):
            read = read_sets if message.stamp else read_keys
            if read is not self._read:
                self._begin_anew(read, message.now)
        self._log.append(message._replace(
            is_first=message.number == 1,
            is_after_gap=message.number not in (1, expected)))
        self.pass_time(message.now)
        if is_past(self.settings, message.time, message.now):
            return TOO_OLD
        if message.refusal or message.is_end:
            return message.refusal
        held, _ = self._listed(message.now)
        if self._read is read_sets:
            return held[-1].refusal
        return None if message.key in {one.key for one in held} else TOO_MANY

    def held(self, now):
        """Return all obstacles, including the placeholders of refused messages."""
        return self._listed(now)[0] + [one for only, former in self._former for one in only(
            lambda one: is_past(self.settings, one.time, now), former)]

    def is_known(self, now):
        return self._listed(now)[1]

    @property
    def _has_sets(self):
        return self.settings.type != POLYGON_INSTANCE and not self.settings.accumulate

    def _listed(self, now):
        """Read the log, unless nothing has changed since the last query."""
        question = self._read, self._log, len(self._log), now
        if question != self._question:
            self._question, self._answer = question, self._read(self.settings, self._log, now)
        return self._answer

    def _begin_anew(self, read, now):
        self._former.append((filterfalse if self._read is read_sets else dropwhile,
                             [one for one in self._listed(now)[0] if not one.refusal]))
        self._read, self._log = read, []

    def _forget(self):
        self._log, self._former = [], []


def nanoseconds(seconds):
    return round(seconds * SECOND)


def is_past(settings, time, now):
    """Tell whether a time is older than the timeout, if that is not 0."""
    return settings.timeout > 0 and now - time > nanoseconds(settings.timeout)

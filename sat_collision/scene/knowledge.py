# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Whether all obstacles that a source sends are known.

Every state "clear" depends on this. `Listings` replace each other where `set_end` declares what
ends one. `Refreshed` obstacles are forgotten when a publisher that is alive has not sent them
again for a timeout. Order says what belongs together; stamps only say how old it is. The bodies
are in groups of obstacles. docs/knowing.md has the rules, and why they hold. Times and stamps are
in ns.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast, NamedTuple

from sat_collision.geometry.body.polygon import PackedBody
from sat_collision.geometry.sets.run import Run
from sat_collision.scene.obstacle_store import (
    KeyedGroup, ObstacleGroup, ObstacleStore, SetGroup, Shape, TOO_MANY)
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import (
    EACH_MESSAGE, EMPTY_POLYGON, in_ns, NEVER, NEW_STAMP, ObstacleSettings, POLYGON_INSTANCE)
from sat_collision.scene.streams import BEGUN, CONTINUES, Continuity, JOINED, LOST

LOSS = 'messages were lost'
_CHANGED = 'its parameters were changed'
_FROM_MIDDLE = 'it was received from its middle on'
_GAP = 'nothing came for longer than its timeout'

# Max listings kept that are not whole.
_MAX_NEWER = 20
# For how long a map stays known while the next one is being received.
_LONGEST_OPEN = 10**9
# Obstacles stamped in the same one of so many parts of a timeout are forgotten together.
_PARTS = 32
# The rate of listings is measured over so many.
_MEASURED = 10
# Max reasons named for which messages were refused.
_MOST_NAMED = 3
# Max numbers kept of listings that ended and were not whole.
_MAX_BROKEN = 1000


class Message(NamedTuple):
    """A message of a source as knowledge receives it."""

    continuity: Continuity  # of its stream, by its number
    stamp: int  # as sent, the time of arrival if it has none
    time: int  # that it counts from: the stamp, or the arrival if that is earlier
    is_stamped: bool
    body: Shape | None = None  # None for an empty polygon, and if it is refused
    frame_id: str = ''
    refusal: str | None = None  # why it is refused
    instance: int | None = None  # the obstacle's id, of a source that gives ids


class Knowledge:
    """
    The base of both kinds of knowledge; the store makes the groups of obstacles.

    `receive` takes an obstacle and returns why it is refused, and `end` takes an empty polygon.
    `receive_run` takes obstacles of one stamp that continue their stream, and returns how many.
    `deadline` is the time after which `pass_time` changes something. `problem` says why not all
    obstacles are known, as the end of a sentence; empty if they are.
    """

    def __init__(self, store: ObstacleStore, settings: ObstacleSettings, tolerance: int) -> None:
        self._store = store
        self.is_known = False  # whether all that the publisher sees is known
        self.since = 'yet'  # when it began, as the end of a sentence
        # Numbers of the listing that the last message joined and of the last whole one; 0: none.
        self.joined = self.last_whole = 0
        self.broken: deque[int] = deque(maxlen=_MAX_BROKEN)  # those that ended and were not whole
        self.wants_history = False  # whether a new subscription is needed for older messages
        self.newest = -NEVER  # the newest stamp
        self._heard = -NEVER  # the latest time of a message
        self._useless = ''  # why the last message was of no use; empty if it was of use
        self._missed = ''  # why not all is known since then; empty if nothing was missed
        self.timeout: float = NEVER
        self.configure(settings, tolerance, 0)

    def configure(self, settings: ObstacleSettings, tolerance: int, now: int) -> None:
        """Apply settings, and by how much clocks may differ; a longer timeout proves less."""
        before, self.timeout = self.timeout, in_ns(settings.timeout)
        self._tolerance = tolerance
        if before < self.timeout and self._heard > -NEVER:
            self.miss(_CHANGED, now)

    def miss(self, cause: str, now: int, group: ObstacleGroup | None = None) -> None:
        """Record why there are obstacles at unknown places: of a group, or of what comes now."""
        raise NotImplementedError

    def refuse(self, reason: str, now: int, is_read: bool = True) -> None:
        """Record a refused message, and whether its stamp was read."""
        self._useless = (f'there were more obstacles than max_count, {self._store.max_count}'
                         if reason is TOO_MANY else f'a message was refused: {reason}')
        self.miss(self._useless, now)

    def _hear(self, message: Message, now: int) -> None:
        """Record that the publisher was alive at the stamp of a message."""
        self._heard = max(self._heard, message.time)
        self._useless = ('' if message.time + self.timeout >= now else
                         'its stamps are older than that')

    def _silence(self, now: int) -> str:
        """Return why nothing of use comes, as the end of a sentence; empty if something does."""
        if self._heard == -NEVER:
            return (f'has sent nothing of use {self.since}: {self._useless}' if self._useless
                    else f'has not sent anything {self.since}')
        if self._heard + self.timeout >= now:
            return ''
        what = 'has sent nothing of use' if self._useless else 'has been silent'
        return f'{what} for longer than {self._timeout_in_words}' + (
            f': {self._useless}' if self._useless else '')

    @property
    def _timeout_in_words(self) -> str:
        return f'its timeout of {self.timeout / 1e9:g} s'


@dataclass(slots=True, eq=False)
class _Listing:
    """All that a publisher sees, once."""

    group: SetGroup
    number: int  # among those of its source
    is_sound: bool  # whether its beginning was received, and nothing of it is missing
    stamp: float = -NEVER  # of its last message
    time: float = NEVER  # of its oldest message
    oldest: ObstacleId | None = None  # the obstacle of that
    begun: float = NEVER  # when its first obstacle was received

    @property
    def is_empty(self) -> bool:
        return self.begun == NEVER


class Listings(Knowledge):
    """
    Listings that follow one another in a stream: sets, and maps where the timeout is 0.

    A listing is whole if it began with number 1 or after the end of another one, nothing of it
    was lost or refused, and its end has come. Only a whole listing replaces what came before it:
    held are the last whole one and all that is newer. They are known while the last whole one is
    not older than the timeout, and nothing since was refused.
    """

    def __init__(self, store: ObstacleStore, settings: ObstacleSettings, tolerance: int) -> None:
        super().__init__(store, settings, tolerance)
        self._next = store.new_set()  # for the next listing
        # The last whole one, until it is older than the timeout; those after it that are not
        # whole; and the open one.
        self._held: list[_Listing] = []
        self._whole: _Listing | None = None
        self._open = self._new_listing(is_sound=False)
        self._is_unread = False  # whether the stamp of the last message was not read
        self._ends: deque[int] = deque(maxlen=_MEASURED)
        self._age = 0.0  # of the last whole one when it ended, in s
        self._oldest: ObstacleId | None = None  # of it, None if it has none
        self._end = settings.ending

    @property
    def groups(self) -> list[ObstacleGroup]:
        return [*(one.group for one in self._held), self._next]

    @property
    def count(self) -> int:
        """Number of obstacles of the last whole listing."""
        return len(self._whole.group) if self._whole else 0

    @property
    def rate(self) -> float:
        """How many listings end in a second; 0 while that is not known."""
        ends = self._ends
        return (len(ends) - 1) / (ends[-1] - ends[0]) * 1e9 if ends and ends[-1] > ends[0] else 0.0

    def receive(self, message: Message, now: int) -> str | None:
        one = self._add(message, now)
        refusal = message.refusal or one.group.add(
            message.body, message.frame_id, message.time, message.instance)
        if refusal:
            self.refuse(refusal, now)
        if self._end == EACH_MESSAGE:
            self._close(now)
        return refusal

    def receive_run(self, run: Run, frame_id: str, stamp: int, now: int) -> int:
        if self._end == EACH_MESSAGE:
            return 0
        one = self._open
        ends = self._end == NEW_STAMP and stamp != one.stamp and not one.is_empty
        group = self._next if ends else one.group
        added = group.add_run(run, self._store.max_count - len(group), frame_id, stamp)
        if added:
            self._add(Message(CONTINUES, stamp, stamp, True), now, added)
        return added

    def _add(self, message: Message, now: int, added: int = 0) -> _Listing:
        """
        Let obstacles join a listing, and return it.

        `added` is how many of a run its group has added already.
        """
        self._continue(message, now)
        one = self._join(message, now)
        self.newest = max(self.newest, message.stamp)
        if message.time < one.time:
            place = len(one.group) - added if message.instance is None else message.instance
            one.time, one.oldest = message.time, ObstacleId(self._store.source, place)
        one.begun = min(one.begun, now)
        return one

    def end(self, message: Message, now: int) -> None:
        """Receive an empty polygon: the end of a set, or a set of none."""
        self._continue(message, now)
        if self._end == NEW_STAMP and message.stamp == self._open.stamp:
            self.joined = self._open.number
            return
        one = self._join(message, now)
        if one.is_empty:
            one.time = message.time
        self._close(now)

    def miss(self, cause: str, now: int, group: ObstacleGroup | None = None) -> None:
        self._missed, self.is_known = cause, False
        if group is None or group is self._open.group:
            self._open.is_sound = False

    def refuse(self, reason: str, now: int, is_read: bool = True) -> None:
        super().refuse(reason, now)
        self._is_unread = not is_read
        if not is_read and self._end == EACH_MESSAGE:
            # It was a listing by itself.
            self.joined = self._open.number
            self._close(now)

    def pass_time(self, now: int) -> None:
        """Drop obstacles that are too old, once the last whole listing is."""
        whole = self._whole
        if whole and whole.time + self.timeout >= now:
            begun = self._open.begun
            if self.is_known and self.timeout == NEVER and begun < NEVER and (
                    abs(now - begun) > _LONGEST_OPEN):
                self.is_known, self._missed = False, 'it began to send another one'
            return
        self.is_known, self._whole = False, None
        for one in [*self._held]:
            one.group.forget_before(now - self.timeout)
            if one is not self._open and one.group.oldest == NEVER:
                self._held.remove(one)
                one.group.clear()

    @property
    def deadline(self) -> float:
        """The time after which the last whole listing, or else some obstacle, is too old."""
        if self.timeout == NEVER:
            return self._open.begun + _LONGEST_OPEN if self.is_known else NEVER
        return self.timeout + (self._whole.time if self._whole else
                               min(group.oldest for group in self.groups))

    def problem(self, now: int) -> str:
        if self.is_known:
            return ''
        is_map = self.timeout == NEVER
        what = 'map' if is_map else 'set'
        if silence := self._silence(now):
            return silence + ('' if self._useless or self._heard == -NEVER else
                              ': where it sees nothing let it send an empty polygon')
        if self._missed == _FROM_MIDDLE and is_map:
            return ('has not sent a whole map: it was received from its middle on; raise the '
                    'depth of its publisher to one message more than a map has with its end')
        if self._missed:
            return f'has not sent a whole {what} since {self._missed}'
        if self._end == EMPTY_POLYGON and (not self._ends or self._ends[-1] + self.timeout < now):
            since = 'yet' if is_map or not self._ends else f'for {self.timeout / 1e9:g} s'
            return (f'has not ended a {what} {since}: send an empty polygon after the last '
                    f'obstacle of each {what}' + ('' if is_map else ', or leave set_end out'))
        if 0 < self.rate * self.timeout < 1e9:
            return f'sends a set every {1 / self.rate:.2g} s: raise timeout above that'
        if self._age * 1e9 > self.timeout:
            return (f'sends sets whose oldest obstacle, {self._oldest}, is {self._age:.2g} s old '
                    f'when they end, more than {self._timeout_in_words}')
        if self._age:
            return (f'has sent no other whole set within {self._timeout_in_words} from the oldest '
                    'message of the last one')
        return f'has not sent a whole {what} yet'

    def _continue(self, message: Message, now: int) -> None:
        """Follow what the number of a message says."""
        self._hear(message, now)
        if message.continuity is BEGUN:
            self._open.is_sound = True
        elif message.continuity is LOST:
            self._missed, self._open.is_sound = LOSS, False
            if self.timeout == NEVER:
                self.is_known, self.wants_history = False, True
        elif message.continuity is JOINED:
            self._missed = self._missed or _FROM_MIDDLE

    def _join(self, message: Message, now: int) -> _Listing:
        """Return the listing that a message belongs to."""
        if self._end == NEW_STAMP:
            self._separate(message, now)
        elif self._end == EACH_MESSAGE:
            self._open.is_sound = self._replaces(message)
        self._is_unread = False
        self._open.stamp = message.stamp
        self.joined = self._open.number
        return self._open

    def _separate(self, message: Message, now: int) -> None:
        """Let a message of another stamp than the last one end the open listing."""
        one, stamp = self._open, message.stamp
        if one.stamp == -NEVER or stamp == one.stamp and not one.is_empty:
            return
        is_newer = stamp > one.stamp
        one.is_sound &= is_newer
        if not one.is_empty:
            self._close(now)
        self._open.is_sound &= is_newer and message.continuity is CONTINUES and not self._is_unread

    def _replaces(self, message: Message) -> bool:
        """Return whether a message that is a set by itself replaces those before it."""
        return self.timeout == NEVER or all(
            message.stamp >= one.stamp for one in self._held[:-1])

    def _close(self, now: int) -> None:
        """End the open listing, which replaces all older ones if it is whole."""
        one = self._open
        if one.is_sound:
            for held in self._held[:-1]:
                held.group.clear()
            self._held = [one]
            self._whole, self.is_known, self._missed = one, True, ''
            self.last_whole = one.number
            self.wants_history = False
            self._age, self._oldest = (now - one.time) / 1e9, one.oldest
        else:
            self.broken.append(one.number)
            if not len(one.group):
                self._held.pop().group.clear()
            oldest = 1 if self._whole else 0
            if len(self._held) > oldest + _MAX_NEWER:
                self._held.pop(oldest).group.clear()
                self.miss(self._missed or f'{_MAX_NEWER} sets in a row were not whole', now)
        self._ends.append(now)
        self._open = self._new_listing(is_sound=True, stamp=one.stamp)
        if one is self._whole:
            self.pass_time(now)

    def _new_listing(self, is_sound: bool, stamp: float = -NEVER) -> _Listing:
        self._store.listings += 1
        group, self._next = self._next, self._store.new_set()
        self._held.append(_Listing(group, self._store.listings, is_sound, stamp))
        return self._held[-1]


class Refreshed(Knowledge):
    """
    Obstacles that are sent again and again: by id, else each message is an obstacle.

    They are known from the first message on that is stamped a timeout and the tolerance of clocks
    after the arrival of the one with which reception without a gap began. An obstacle is forgotten
    when a message stamped more than the timeout after it shows that its publisher is alive and
    has not sent it again. Stamps further apart than the timeout are a gap.
    """

    def __init__(self, store: ObstacleStore, settings: ObstacleSettings, tolerance: int) -> None:
        super().__init__(store, settings, tolerance)
        self.by_id = KeyedGroup(store) if settings.type == POLYGON_INSTANCE else None
        # Obstacles without ids, by the end of the part of a timeout in which they are stamped.
        self._parts: dict[int, SetGroup] = {}
        self._begun = NEVER  # when reception without a gap began, NEVER if it has not
        # How many obstacles came with each of the last stamps.
        self._gathered: deque[tuple[int, int]] = deque(maxlen=3)

    @property
    def groups(self) -> list[ObstacleGroup]:
        return [*([] if self.by_id is None else [self.by_id]), *self._parts.values()]

    @property
    def count(self) -> int:
        """Number of obstacles that are held."""
        return len(self.by_id or ()) + sum(map(len, self._parts.values()))

    @property
    def room(self) -> int:
        """For how many more obstacles there is room."""
        return self._store.max_count - self.count

    @property
    def together(self) -> int:
        """How many obstacles come with each stamp; 0 if that differs, or is one."""
        counts = [count for _, count in self._gathered]
        return counts[0] if len(counts) == 3 and counts[0] == counts[1] > 1 else 0

    def receive(self, message: Message, now: int) -> str | None:
        refusal, by_id = message.refusal, self.by_id
        if refusal and not message.instance:
            self.refuse(refusal, now)
            return refusal
        self._continue(message, now)
        if message.instance and by_id is not None:
            # A message with an id has one polygon.
            body = cast(PackedBody | None, message.body)
            refusal = by_id.add(message.instance, body, message.frame_id, message.stamp,
                                message.time, refusal, self.room > 0)
        elif self.room > 0:
            end = self._end_of_part(message.stamp)
            if end not in self._parts:
                self._parts[end] = self._store.new_set()
            self._parts[end].add(message.body, message.frame_id, message.time)
            self._gather(message.stamp, 1)
        else:
            refusal = TOO_MANY
        if refusal is TOO_MANY:
            self.refuse(refusal, now)
        return refusal

    def _continue(self, message: Message, now: int) -> None:
        """Receive what a message proves: that what has not been sent again by then is gone."""
        stamp = message.stamp
        if message.continuity is not CONTINUES or self._begun == NEVER:
            self.miss(LOSS if message.continuity is LOST else '', now)
        elif self.newest + self.timeout < stamp:
            self.miss(_GAP, now)
        self._hear(message, now)
        self.newest = max(self.newest, stamp)
        oldest = stamp - self.timeout
        self._drop_parts(lambda end: end <= oldest)
        if self.by_id is not None:
            self.by_id.forget_first(lambda one: one.stamp < oldest)
        if stamp > self._begun + self.timeout + self._tolerance:
            self.is_known = True

    def receive_run(self, run: Run, frame_id: str, stamp: int, now: int) -> int:
        part = self._parts.get(self._end_of_part(stamp))
        added = 0 if part is None else part.add_run(run, self.room, frame_id, stamp)
        if added:
            self._continue(Message(CONTINUES, stamp, stamp, True), now)
            self._gather(stamp, added)
        return added

    def _end_of_part(self, stamp: int) -> int:
        part = max(int(self.timeout) // _PARTS, 1)
        return (stamp // part + 1) * part

    def end(self, message: Message, now: int) -> None:
        """Receive an empty polygon, which shows by its stamp that the publisher is alive."""
        if message.is_stamped:
            self._continue(message, now)
        elif message.continuity is not CONTINUES:
            self.miss(LOSS if message.continuity is LOST else '', now)

    def miss(self, cause: str, now: int, group: ObstacleGroup | None = None) -> None:
        self._begun, self._missed, self.is_known = now, cause, False

    def pass_time(self, now: int) -> None:
        """Drop obstacles that are too old once the source is silent; before, time drops none."""
        if self._heard + self.timeout < now:
            self.is_known = False
            # A late message must not continue as if nothing had been dropped.
            self._begun = NEVER
            for group in self.groups:
                group.forget_before(now - self.timeout)
            self._drop_parts(lambda end: self._parts[end].oldest == NEVER)

    @property
    def deadline(self) -> float:
        """The time after which the source is silent, or its oldest obstacle is too old."""
        return self.timeout + (self._heard if self._begun < NEVER else
                               min((group.oldest for group in self.groups), default=NEVER))

    def problem(self, now: int) -> str:
        refusals = self.by_id.refusals if self.by_id else ()
        if self.is_known and not refusals:
            return ''
        if silence := self._silence(now):
            return silence
        if refusals:
            more = len(refusals) - _MOST_NAMED
            return f'sent what was refused: {", ".join(refusals[:_MOST_NAMED])}' + (
                f' and {more} more' if more > 0 else '')
        if self._missed == _GAP:
            return f'has stamps that are further apart than {self._timeout_in_words}: raise it'
        since = f' since {self._missed}' if self._missed else ''
        return (f'has not been received for {self._timeout_in_words} and future_tolerance, '
                f'{self._tolerance / 1e9:g} s, without a gap{since}')

    def _gather(self, stamp: int, count: int) -> None:
        """Record how many obstacles came with a stamp."""
        gathered = self._gathered
        if gathered and gathered[-1][0] == stamp:
            count += gathered.pop()[1]
        gathered.append((stamp, count))

    def _drop_parts(self, is_gone: Callable[[int], bool]) -> None:
        for end in [end for end in self._parts if is_gone(end)]:
            self._parts.pop(end).clear()

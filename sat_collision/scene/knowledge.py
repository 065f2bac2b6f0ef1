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
What is known of one source of obstacles: by proof, never by a pause.

This is the model behind every clear: `Sets`, `Keys` and `Maps` are three manners of listing all
that a publisher sees, and know when such a listing is whole. They know stamps and what `streams`
makes of numbers, but no bodies: these are in the groups of obstacles that a listing fills, drops
or ages. docs/knowing.md has the promise, the assumptions and why the rules here keep it. Times are
in ns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, Protocol, TypeVar

from sat_collision.scene.streams import BEGUN, CONTINUES, LOST, MET, News
from sat_collision.scene.times import NEVER

LOSS = 'messages were lost'

# How many sets that are not whole are held beside the last whole one.
_MOST_SETS = 20


class Group(Protocol):
    """Obstacles that are held, and dropped, together."""

    @property
    def oldest(self) -> float:
        """The earliest time of its obstacles; NEVER if there are none."""

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""

    def forget_refused(self) -> None:
        """Drop what stands for refused messages."""

    def clear(self) -> None:
        """Drop all."""


class KeyedGroup(Group, Protocol):
    """Obstacles by id or shape, each with the number of the listing that had it last."""

    def forget_listings_before(self, listing: int) -> None:
        """Drop the obstacles that were in earlier listings only."""


_Group = TypeVar('_Group', bound=Group)
_Keyed = TypeVar('_Keyed', bound=KeyedGroup)


class _Set(Generic[_Group]):
    """
    One set of obstacles.

    Attributes
    ----------
    group : Group
        Its obstacles.
    start, last : int
        Stamp of its first message, and of the last one so far.
    time : int
        The earliest time that its messages count from.
    count : int
        How many messages of it came.
    is_begun : bool
        Whether nothing was missed since its beginning.
    is_ended, is_whole : bool
        Whether an empty polygon has ended it, and whether it is proved whole.

    """

    __slots__ = ('group', 'start', 'last', 'time', 'count', 'is_begun', 'is_ended', 'is_whole')

    def __init__(self, group: _Group, stamp: int, time: int, is_begun: bool) -> None:
        self.group = group
        self.start = self.last = stamp
        self.time = time
        self.count = 0
        self.is_begun = is_begun
        self.is_ended = self.is_whole = False


class Sets(Generic[_Group]):
    """
    Listings that are sets: polygons whose stamps lie within a window.

    The beginning of a set is proved by number 1, or by the end of the set before it; its end by a
    message of a later set, by an empty polygon with its stamp, or by `max_count` messages, unless
    the set before had more. Held is the last whole set and all that is newer: only a whole set
    replaces it.

    Parameters
    ----------
    new_group : callable
        Returns a Group for another set.

    Attributes
    ----------
    window, timeout : int or float
    max_count : int
    current : _Set or None
        The set of the message before.
    is_known : bool
        Whether the last whole set is younger than the timeout.

    """

    def __init__(self, new_group: Callable[[], _Group]) -> None:
        self.window: float = 0
        self.timeout: float = NEVER
        self.max_count = 1
        self.current: _Set[_Group] | None = None
        self.is_known = False
        self._new_group = new_group
        self._whole: _Set[_Group] | None = None
        self._newer: list[_Set[_Group]] = []
        self._is_cut = self._is_too_large = False
        self._is_spoiled = False
        self._period = 0
        self._missed = ''

    @property
    def groups(self) -> Sequence[Group]:
        """All that is held."""
        sets = [self._whole, *self._newer]
        if self.current is not self._whole:
            sets.append(self.current)
        return [one.group for one in sets if one is not None]

    def receive(self, news: News, stamp: int, time: int, now: int) -> _Group:
        """Take a polygon's stamp and the time it counts from; return the group that it joins."""
        current = self.current
        if (current is None or stamp != current.last or news is not CONTINUES
                or time < current.time or self._is_spoiled):
            current = self._follow(news, stamp, time, now)
        current.count += 1
        if current.count >= self.max_count:
            self._fill(current, now)
        return current.group

    def room_for_run(self, stamp: int) -> int:
        """Return how many messages of a stamp simply continue the current set."""
        current = self.current
        if current is None or stamp != current.last or self._is_spoiled or stamp < current.time:
            return 0
        return max(self.max_count - 1 - current.count, 0)

    def end(self, news: News, stamp: int, time: int, now: int) -> None:
        """Take an empty polygon: the set of its stamp ends."""
        current = self.current
        if current is not None and self._is_near(current, stamp):
            # It ends a set that has max_count members, too.
            stamp = current.last
        current = self._follow(news, stamp, time, now)
        current.is_ended = True
        self._end(current, now)

    def spoil(self, cause: str) -> None:
        """Take messages that are missing, of this set or of the next one."""
        self._miss(cause)
        self._is_spoiled = True

    def pass_time(self, now: int) -> None:
        """Forget what is too old, but nothing as long as the last whole set is not."""
        whole = self._whole
        if self.is_known and whole is not None and whole.time + self.timeout >= now:
            return
        self.is_known = False
        for group in self.groups:
            group.forget_before(now - self.timeout)
        for one in [one for one in self._newer if one.group.oldest == NEVER]:
            self._newer.remove(one)
            one.group.clear()

    @property
    def deadline(self) -> float:
        """The time after which something is too old."""
        if self._whole is not None and self.is_known:
            return self._whole.time + self.timeout
        return min((group.oldest for group in self.groups), default=NEVER) + self.timeout

    def problem(self, now: int) -> str:
        """Return why no listing is known, as the end of a sentence; empty if one is."""
        if self._is_cut:
            return ('sends sets that set_window cuts in two: set it to more than a set takes and '
                    'less than the time between sets, or to 0 with one stamp a set')
        if self.is_known:
            return ''
        timeout = f'its timeout of {self.timeout / 1e9:g} s'
        current, whole = self.current, self._whole
        if current is None:
            return 'has not sent anything yet'
        if current.time + self.timeout < now:
            return f'has been silent for longer than {timeout}'
        if self._missed:
            return f'has not sent a whole set since {self._missed}'
        if not current.is_whole and not current.is_ended and (
                2 * self._period > self.timeout):
            period = self._period / 1e9
            return (f'sends a set every {period:.2g} s, which is whole when the next one begins: '
                    f'end each set with an empty polygon, or set timeout to more than '
                    f'{2.2 * period:.2g} s')
        if whole is None:
            return 'has not sent a whole set yet'
        return f'has not sent a whole set for longer than {timeout}'

    def _follow(self, news: News, stamp: int, time: int, now: int) -> _Set[_Group]:
        """Return the set that a message joins."""
        current = self.current
        if news is CONTINUES and not self._is_spoiled and current is not None and (
                stamp == current.last or self._joins(current, stamp)):
            if stamp != current.last:
                current.last = max(current.last, stamp)
            if time < current.time:
                current.time = time
            return current
        return self._receive_other(news, stamp, time, now)

    def _joins(self, current: _Set[_Group], stamp: int) -> bool:
        """Tell whether a stamp is of this set."""
        return current.count < self.max_count and self._is_near(current, stamp)

    def _is_near(self, current: _Set[_Group], stamp: int) -> bool:
        """Tell whether a stamp is in the window of a set that no empty polygon has ended."""
        return not current.is_ended and abs(stamp - current.start) <= self.window

    def _receive_other(self, news: News, stamp: int, time: int, now: int) -> _Set[_Group]:
        """Take what does not simply go on: after a gap, or of another set; return the set."""
        current = self.current
        if news is LOST:
            self._miss(LOSS)
        elif self._is_spoiled:
            news = LOST
        self._is_spoiled = False
        follows = current is not None and news is not BEGUN and news is not MET
        if current is not None and follows and self._joins(current, stamp):
            current.last = max(current.last, stamp)
            return current
        is_after = follows and news is CONTINUES
        is_cut = (current is not None and follows and not current.is_ended
                  and abs(stamp - current.last) <= self.window)
        if current is not None:
            self._period = abs(stamp - current.start)
            if not current.is_whole:
                if is_after and current.is_begun and not is_cut:
                    self._complete(current, now)
                else:
                    self._keep(current)
        if is_cut:
            self._is_cut, self.is_known = True, False
        self.current = _Set(self._new_group(), stamp, time,
                            news is BEGUN or (is_after and not is_cut))
        return self.current

    def _keep(self, current: _Set[_Group]) -> None:
        """Hold a set that is not whole; where that is too much, nothing is known any more."""
        self._newer.append(current)
        if len(self._newer) > _MOST_SETS:
            self.is_known = False
            self._newer.pop(0).group.clear()

    def _miss(self, what: str) -> None:
        """Take a gap in what has come."""
        self._missed = what
        if self.current is not None and not self.current.is_whole:
            self.current.is_begun = False

    def _fill(self, current: _Set[_Group], now: int) -> None:
        """Take a set that has as many messages as there may be, or more."""
        if current.count > self.max_count:
            self._is_too_large = True
        elif not self._is_cut and not self._is_too_large:
            self._end(current, now)

    def _end(self, current: _Set[_Group], now: int) -> None:
        """Take a set that has ended for whole, if nothing was missed since its beginning."""
        if current.is_begun and not current.is_whole:
            self._complete(current, now)

    def _complete(self, current: _Set[_Group], now: int) -> None:
        """Let a set that is proved whole replace all that is older."""
        for one in (self._whole, *self._newer):
            if one is not None:
                one.group.clear()
        self._newer.clear()
        current.is_whole = True
        self._whole = current
        self._is_cut = False
        self._is_too_large = current.count > self.max_count
        self._missed = ''
        self.is_known = current.time + self.timeout >= now


class Keys(Generic[_Keyed]):
    """
    Listings of obstacles that are told apart by id, or by shape: all that comes in one timeout.

    Known from the first message on that is stamped a whole timeout after the one with which
    hearing without a gap began. An obstacle is forgotten when a message stamped more than the
    timeout after it shows that its publisher lives and tells no more of it.

    Parameters
    ----------
    group : KeyedGroup
        The obstacles, each with its own time.

    Attributes
    ----------
    timeout : int or float
    is_known : bool

    """

    def __init__(self, group: _Keyed) -> None:
        self.group = group
        self.timeout: float = NEVER
        self.is_known = False
        self.listing = 0
        self._since: float = NEVER
        self._last: float = -NEVER
        self._cause = ''

    @property
    def groups(self) -> Sequence[Group]:
        """All that is held."""
        return [self.group]

    def receive(self, news: News, time: int, now: int) -> _Keyed:
        """Take the time that a polygon counts from; return the group that it joins."""
        last = self._last
        if news is not CONTINUES or self._since == NEVER or last + self.timeout < now:
            self._restart(max(time, last), LOSS if news is LOST else '')
        if time > last:
            self._last = last = time
        if self.group.oldest + self.timeout < last:
            self.group.forget_before(last - self.timeout)
        if not self.is_known and self._since + self.timeout <= last >= now - self.timeout:
            self.is_known = True
        return self.group

    def spoil(self, cause: str, time: int) -> None:
        """Take messages that are missing, of any key."""
        self._last = max(time, self._last)
        self._restart(self._last, cause)

    def pass_time(self, now: int) -> None:
        """Forget all once the source is silent; until then time alone forgets nothing."""
        if self._last + self.timeout < now:
            self.is_known = False
            self.group.forget_before(now - self.timeout)
            # A message that was late must not go on as if nothing had been forgotten.
            self._since = NEVER

    @property
    def deadline(self) -> float:
        """The time after which the source is silent, or what is left is too old."""
        return self.timeout + (self._last if self._since < NEVER else self.group.oldest)

    def problem(self, now: int) -> str:
        """Return why no listing is known, as the end of a sentence; empty if one is."""
        if self.is_known:
            return ''
        timeout = f'its timeout of {self.timeout / 1e9:g} s'
        if self._last == -NEVER:
            return 'has not sent anything yet'
        if self._last + self.timeout < now:
            return f'has been silent for longer than {timeout}'
        since = f' since {self._cause}' if self._cause else ''
        return f'has not been received for {timeout} without a gap{since}'

    def _restart(self, time: float, cause: str) -> None:
        self._since = time
        self._cause = cause
        self.is_known = False


class Maps(Generic[_Keyed]):
    """
    Listings that never grow old: all obstacles up to an empty polygon.

    Known is a listing that began with number 1 or right after an empty polygon, once an empty
    polygon ends it; and the first one of a stream, too, when nothing new has come for
    `settle_time`, which drops nothing.

    Parameters
    ----------
    group : KeyedGroup
        The obstacles, each with the number of its listing.

    Attributes
    ----------
    settle_time : int
    listing : int
        The number of the listing that is coming in.
    is_known : bool
    wants_history : bool
        Whether what was sent before must be asked for again.

    """

    def __init__(self, group: _Keyed, wants_history: bool = False) -> None:
        self.group = group
        self.settle_time = 0
        self.listing = 0
        self.is_known = False
        self.wants_history = wants_history
        self._is_begun = False
        self._settles: float = NEVER
        self._cause = ''

    @property
    def groups(self) -> Sequence[Group]:
        """All that is held."""
        return [self.group]

    def receive(self, news: News, now: int) -> _Keyed:
        """Take a polygon; return the group that it joins."""
        if news is BEGUN:
            self._is_begun, self.wants_history = True, False
            self._settles = now
        elif news is LOST:
            self._miss(LOSS)
            self.wants_history = True
        elif news is MET:
            self._miss('it was received from its middle on: the depth of its publisher must '
                       'hold the whole map')
        if self._settles < NEVER:
            self._settles = now + self.settle_time
        return self.group

    def end(self, news: News, now: int) -> None:
        """Take an empty polygon: the listing ends."""
        self.receive(news, now)
        if self._is_begun:
            self.group.forget_listings_before(self.listing)
            self.is_known = True
        self.listing += 1
        self._is_begun = True
        self._settles = NEVER

    def spoil(self, cause: str) -> None:
        """Take messages that are missing, of any obstacle."""
        self._miss(cause)

    def wait(self, now: int) -> None:
        """Begin anew to wait for nothing new: messages may still be queued."""
        if self._settles < NEVER:
            self._settles = now + self.settle_time

    def pass_time(self, now: int) -> None:
        """Settle, if nothing new has come for long enough."""
        if self._settles < now:
            self._settles = NEVER
            self.is_known = True

    @property
    def deadline(self) -> float:
        """The time after which it settles."""
        return self._settles

    def problem(self, now: int) -> str:
        """Return why no listing is known, as the end of a sentence; empty if one is."""
        if self.is_known:
            return ''
        if self._settles < NEVER:
            return 'sends its map: known once it ends with an empty polygon, or pauses for ' \
                   f'settle_time, {self.settle_time / 1e9:g} s'
        if self._cause:
            return f'has not sent a whole map since {self._cause}'
        return 'has not sent a whole map yet'

    def _miss(self, what: str) -> None:
        self._is_begun = self.is_known = False
        self._settles = NEVER
        self._cause = what

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
Whether all obstacles that a source sends are known.

Every state "clear" depends on this. `Sets`, `Keys` and `Maps` are three ways to list all that a
publisher sees, and decide when such a listing is whole: by stamps and by sequence numbers, as
`streams` interprets them, never by bodies. The bodies are in groups of obstacles, which a listing
fills and drops. All three receive the meaning of a message's number, its stamp, the time from
which it counts and the present time, in ns. docs/knowing.md has the guarantees, and why they hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sat_collision.scene.obstacle_store import KeyedGroup, ObstacleStore, SetGroup
from sat_collision.scene.settings import NEVER, ObstacleSettings
from sat_collision.scene.streams import BEGUN, CONTINUES, JOINED, LOST, News

LOSS = 'messages were lost'
_CHANGED = 'its parameters were changed'

# Max sets kept that are not whole, besides the last whole one.
_MAX_SETS = 20


class _Listing:
    """
    The base of all listings; the store makes the groups of obstacles.

    `receive` takes a polygon and returns the group that it joins, `end` takes an empty polygon,
    and `spoil` messages of unknown content. `deadline` is the time after which `pass_time` changes
    something. `problem` says why no listing is known, as the end of a sentence; empty if one is.
    """

    timeout: float = NEVER
    window: float = 0
    settle_time: float = 0
    max_count = 1

    def __init__(self, store: ObstacleStore) -> None:
        self._store = store
        self.is_known = False  # whether all that the publisher sees is known
        self.since = 'yet'  # when it began, as the end of a sentence
        self.wants_history = False  # whether a new subscription is needed for older messages

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        """Apply the settings of the source; what others have proved may be proved no more."""
        self.timeout = round(settings.timeout * 1e9) or NEVER
        self.window = round(settings.set_window * 1e9)
        self.settle_time = round(settings.settle_time * 1e9)
        self.max_count = settings.max_count

    def wait(self, now: int) -> None:
        """Restart `settle_time`, if there is one: messages may still be queued."""

    @property
    def _timeout_in_words(self) -> str:
        return f'its timeout of {self.timeout / 1e9:g} s'


@dataclass(slots=True, eq=False)
class _Set:
    """One set of obstacles."""

    group: SetGroup
    start: int  # the stamp of its first message
    last: int  # that of the last one so far
    time: int  # the earliest from which its messages count
    is_begun: bool  # whether nothing is missing since its beginning
    count: int = 0  # of its messages so far
    is_ended: bool = False  # whether an empty polygon has ended it
    is_whole: bool = False  # whether it is proved whole


class Sets(_Listing):
    """
    Listings as sets: polygons whose stamps lie within a window.

    The beginning of a set is proved by number 1, or by the end of the set before it; its end by a
    message of a later set, by an empty polygon with its stamp, or by `max_count` messages, unless
    the set before had more. The last whole set and all newer ones are kept: only a whole set
    replaces it. The listing is known while the last whole set is not older than the timeout.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        self.current: _Set | None = None  # the set of the message before
        # In order of arrival. Only the first one may be whole.
        self._sets: list[_Set] = []
        # Whether the window has cut a set in two; whether a set had more than max_count messages;
        # whether messages were missed since the last one that was received.
        self._is_cut = self._is_too_large = self._is_spoiled = False
        # The time between the beginnings of the last two sets, in ns.
        self._period = 0
        # What was missed since the last whole set; empty if nothing.
        self._missed = ''

    @property
    def groups(self) -> Sequence[SetGroup]:
        return [one.group for one in self._sets]

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        timeout, *before = self.timeout, self.window, self.max_count
        super().configure(settings, now)
        current = self.current
        if current is None:
            return
        if [self.window, self.max_count] != before:
            self.spoil(_CHANGED, now)
        elif self.timeout > timeout and not current.is_whole:
            # Some of it may have been too old.
            current.is_begun = False

    def receive(self, news: News, stamp: int, time: int, now: int) -> SetGroup:
        current = self.current
        if (current is None or stamp != current.last or news is not CONTINUES
                or time < current.time or self._is_spoiled):
            current = self._follow(news, stamp, time, now)
        current.count += 1
        if current.count >= self.max_count:
            if current.count > self.max_count:
                self._is_too_large = True
            elif not self._is_cut and not self._is_too_large:
                self._end(current, now)
        return current.group

    def set_to_extend(self, stamp: int) -> _Set | None:
        """Return the current set if messages of a stamp only add to it, else None."""
        current = self.current
        if current is None or stamp != current.last or self._is_spoiled or stamp < current.time:
            return None
        return current

    def set_of(self, stamp: int, now: int) -> _Set:
        """Return the set that the next messages join, which are valid and have a stamp."""
        return self._follow(CONTINUES, stamp, stamp, now)

    def end(self, news: News, stamp: int, time: int, now: int) -> None:
        """Receive an empty polygon, which ends the set of its stamp; none if that is 0."""
        if not stamp:
            if news is LOST:
                self._miss(LOSS)
            return
        current = self.current
        if current is not None and self._is_near(current, stamp):
            # A set that has max_count members already is ended, too.
            stamp = current.last
        current = self._follow(news, stamp, time, now)
        current.is_ended = True
        self._end(current, now)

    def spoil(self, cause: str, now: int) -> None:
        """Record messages of unknown content, of this set or of the next one."""
        self._miss(cause)
        self.is_known = False

    def pass_time(self, now: int) -> None:
        """Drop obstacles that are too old, unless the listing is still known."""
        whole = self._whole
        if self.is_known and whole is not None and whole.time + self.timeout >= now:
            return
        self.is_known = False
        for one in [*self._sets]:
            one.group.forget_before(now - self.timeout)
            if one.group.oldest == NEVER and one is not self.current and not one.is_whole:
                self._sets.remove(one)
                one.group.clear()

    @property
    def deadline(self) -> float:
        """The time after which the last whole set, or else some obstacle, is too old."""
        whole = self._whole
        if whole is not None and self.is_known:
            return whole.time + self.timeout
        return min((group.oldest for group in self.groups), default=NEVER) + self.timeout

    def problem(self, now: int) -> str:
        if self._is_cut:
            return ('sends sets that set_window cuts in two: set it to more than a set takes and '
                    'less than the time between sets, or to 0 with one stamp a set')
        if self.is_known:
            return ''
        current = self.current
        if current is None:
            return f'has not sent anything {self.since}'
        if current.time + self.timeout < now:
            return f'has been silent for longer than {self._timeout_in_words}'
        if self._missed:
            return f'has not sent a whole set since {self._missed}'
        if not current.is_whole and not current.is_ended and 2 * self._period > self.timeout:
            period = self._period / 1e9
            return (f'sends a set every {period:.2g} s, which is whole when the next one begins: '
                    f'end each set with an empty polygon, or set timeout to more than '
                    f'{2.2 * period:.2g} s')
        if self._whole is None:
            return 'has not sent a whole set yet'
        return f'has not sent a whole set for longer than {self._timeout_in_words}'

    @property
    def _whole(self) -> _Set | None:
        """The last set that is proved whole."""
        return self._sets[0] if self._sets and self._sets[0].is_whole else None

    def _is_near(self, current: _Set, stamp: int) -> bool:
        """Return whether a stamp is in the window of a set that no empty polygon has ended."""
        return not current.is_ended and abs(stamp - current.start) <= self.window

    def _follow(self, news: News, stamp: int, time: int, now: int) -> _Set:
        """Return the set that a message joins: the current one, or a new one."""
        if news is LOST:
            self._miss(LOSS)
        elif self._is_spoiled:
            news = LOST
        self._is_spoiled = False
        current = self.current
        is_begun, is_cut = news is BEGUN, False
        if current is not None:
            if news is CONTINUES or news is LOST:
                if (stamp == current.last and news is CONTINUES) or (
                        current.count < self.max_count and self._is_near(current, stamp)):
                    current.last = max(current.last, stamp)
                    current.time = min(current.time, time)
                    return current
                is_cut = not current.is_ended and abs(stamp - current.last) <= self.window
            self._period = abs(stamp - current.start)
            if is_cut:
                self._is_cut, self.is_known = True, False
            elif news is CONTINUES:
                self._end(current, now)
                is_begun = True
        self.current = current = _Set(self._store.new_set(), stamp, stamp, time, is_begun)
        self._sets.append(current)
        is_first_whole = self._sets[0].is_whole
        if len(self._sets) > _MAX_SETS + 1 + is_first_whole:
            # Too many sets: drop the oldest that is not whole.
            self.is_known = False
            self._sets.pop(is_first_whole).group.clear()
        return current

    def _miss(self, what: str) -> None:
        """Record a gap in the messages."""
        self._missed = what
        self._is_spoiled = True
        if self.current is not None and not self.current.is_whole:
            self.current.is_begun = False

    def _end(self, current: _Set, now: int) -> None:
        """Let a set that has ended replace all older ones, if nothing of it is missing."""
        if not current.is_begun or current.is_whole:
            return
        for one in self._sets:
            if one is not current:
                one.group.clear()
        self._sets = [current]
        current.is_whole = True
        self._is_cut = False
        self._is_too_large = current.count > self.max_count
        self._missed = ''
        self.is_known = current.time + self.timeout >= now


class _Keyed(_Listing):
    """The base of listings by id or shape, which fill one group."""

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        self.group = store.new_keyed()
        self._cause = ''

    @property
    def groups(self) -> Sequence[KeyedGroup]:
        return [self.group]


class Keys(_Keyed):
    """
    Listings of obstacles identified by id or shape: all that are received in one timeout.

    Known from the first message on that is stamped a whole timeout after the one with which
    reception without a gap began. An obstacle is dropped when a message stamped more than the
    timeout after it shows that its publisher is alive and no longer sends it.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # When reception without a gap began, NEVER if it has not; and the latest time received.
        self._since: float = NEVER
        self._last: float = -NEVER

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        before = self.timeout
        super().configure(settings, now)
        if self._since < NEVER and self.timeout > before:
            # What is sent less often than before, but often enough now, may have been forgotten.
            self.spoil(_CHANGED, now)

    def receive(self, news: News, stamp: int, time: int, now: int) -> KeyedGroup:
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

    def end(self, news: News, stamp: int, time: int, now: int) -> None:
        """Receive an empty polygon, which shows that the publisher is alive."""
        self.receive(news, stamp, time, now)

    def spoil(self, cause: str, now: int) -> None:
        """Record messages of unknown content, of any key."""
        self._last = max(now, self._last)
        self._restart(self._last, cause)

    def pass_time(self, now: int) -> None:
        """Drop obstacles that are too old once the source is silent; before, time drops none."""
        if self._last + self.timeout < now:
            self.is_known = False
            self.group.forget_before(now - self.timeout)
            # A late message must not continue as if nothing had been dropped.
            self._since = NEVER

    @property
    def deadline(self) -> float:
        """The time after which the source is silent, or its oldest obstacle is too old."""
        return self.timeout + (self._last if self._since < NEVER else self.group.oldest)

    def problem(self, now: int) -> str:
        if self.is_known:
            return ''
        if self._last == -NEVER:
            return f'has not sent anything {self.since}'
        if self._last + self.timeout < now:
            return f'has been silent for longer than {self._timeout_in_words}'
        since = f' since {self._cause}' if self._cause else ''
        return f'has not been received for {self._timeout_in_words} without a gap{since}'

    def _restart(self, time: float, cause: str) -> None:
        self._since = time
        self._cause = cause
        self.is_known = False


class Maps(_Keyed):
    """
    Listings that never become too old: all obstacles up to an empty polygon.

    A listing that began with number 1 or right after an empty polygon is known once an empty
    polygon ends it; the first one of a stream also when nothing has been received for
    `settle_time`, which drops nothing.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # Whether nothing is missing since the listing began; and after which time without a
        # message it settles, NEVER if it does not.
        self._is_begun = False
        self._settles: float = NEVER

    def receive(self, news: News, stamp: int, time: int, now: int) -> KeyedGroup:
        if news is BEGUN:
            self._is_begun, self.wants_history = True, False
            self._settles = now
        elif news is LOST:
            self.spoil(LOSS, now)
            self.wants_history = True
        elif news is JOINED:
            self.spoil('it was received from its middle on: the depth of its publisher must hold '
                       'the whole map', now)
        self.wait(now)
        return self.group

    def end(self, news: News, stamp: int, time: int, now: int) -> None:
        """Receive an empty polygon, which ends the listing."""
        self.receive(news, stamp, time, now)
        self.is_known |= self._is_begun
        self.group.end_listing(replaces=self._is_begun)
        self._is_begun = True
        self._settles = NEVER

    def spoil(self, cause: str, now: int) -> None:
        """Record messages of unknown content, of any obstacle."""
        self._is_begun = self.is_known = False
        self._settles = NEVER
        self._cause = cause

    def wait(self, now: int) -> None:
        """Restart `settle_time`: messages may still be queued."""
        if self._settles < NEVER:
            self._settles = now + self.settle_time

    def pass_time(self, now: int) -> None:
        """Settle if nothing has been received for `settle_time`."""
        if self._settles < now:
            self._settles = NEVER
            self.is_known = True

    @property
    def deadline(self) -> float:
        """The time after which it settles."""
        return self._settles

    def problem(self, now: int) -> str:
        if self.is_known:
            return ''
        if self._settles < NEVER:
            return 'sends its map: known once it ends with an empty polygon, or pauses for ' \
                   f'settle_time, {self.settle_time / 1e9:g} s'
        if self._cause:
            return f'has not sent a whole map since {self._cause}'
        return 'has not sent a whole map yet'

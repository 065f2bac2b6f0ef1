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

"""Sources of obstacles: what each one is known to have sent, where it is, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from sat_collision.geometry.polygon import PackedBody, size_of
from sat_collision.geometry.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.knowledge import Group, Keys, LOSS, Maps, Sets
from sat_collision.scene.obstacle_store import KeyedGroup, ObstacleStore, SetGroup, TOO_MANY
from sat_collision.scene.obstacles import Key
from sat_collision.scene.settings import ObstacleSettings, POLYGON_INSTANCE
from sat_collision.scene.streams import BEGUN, CONTINUES, Endpoint, LOST, MET, News, Stream
from sat_collision.scene.times import BY_ANOTHER_CLOCK, FAR, NEVER

TOO_OLD = 'too old'

# Of so many listings that were interrupted the obstacles stay.
_MOST_FORMER = 20

_Listing: TypeAlias = 'Sets[SetGroup] | Keys[KeyedGroup] | Maps[KeyedGroup]'


class Source:
    """
    One topic of obstacles: its stream, how it lists them, and the obstacles themselves.

    Polygons with stamps come in sets; those of stamp 0, and all of a source that accumulates, go
    by their shape; instances by their id; with a timeout of 0 they make a map. The obstacles of a
    listing that was interrupted stay until their timeout, beside those of the listing that
    follows.

    Times are in ns. A message counts from its stamp, from now if that is 0 or in the future. One
    past its timeout is refused as TOO_OLD.

    Parameters
    ----------
    settings : ObstacleSettings
    contacts : Contacts

    Attributes
    ----------
    store : ObstacleStore
    stream : Stream
    listing : Sets, Keys or Maps
        What its publisher lists now. Another object where that begins anew.
    faults : tuple of str
        Why the source cannot be trusted, in words; empty if it can. The same object as long as
        nothing about it changes.
    timeout : int or float
        NEVER where there is none.
    are_waiting : bool
        Whether messages wait to be taken, so that no map is complete.

    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts) -> None:
        self.settings = settings
        self.store = ObstacleStore(settings.name, contacts)
        self.stream = Stream()
        self.faults: tuple[str, ...] = ()
        self.are_waiting = False
        # Groups of listings that were interrupted.
        self._former: list[Group] = []
        self._is_far = False
        self._was_known = False
        self.timeout: float = NEVER
        self.listing: _Listing = Sets(self.store.new_set)
        self.configure(settings, now=0)

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        """Apply settings; a disabled source forgets all that it has received."""
        before, self.settings = self.settings, settings
        self.timeout = round(settings.timeout * 1e9) if settings.timeout > 0.0 else NEVER
        self.store.max_count = settings.max_count
        self.stream.timeout = self.timeout
        self._by_id = settings.type == POLYGON_INSTANCE
        self._in_sets = not self._by_id and not settings.accumulate
        self._stamped = self._manner(1)
        if settings.enabled != before.enabled:
            self.stream.interrupt()
            self._forget_all(now, wants_history=settings.enabled)
        else:
            self._follow(CONTINUES, None, now)
        self._configure_listing()
        self.pass_time(now)

    @property
    def wants_history(self) -> bool:
        """Whether a publisher that keeps what it has sent must be asked for all of it again."""
        listing = self.listing
        return isinstance(listing, Maps) and listing.wants_history and self.settings.enabled

    @property
    def deadline(self) -> float:
        """Time in ns after which something changes by itself."""
        deadline = min(self.listing.deadline, self.stream.mixed_until)
        if self._former and self.timeout < NEVER:
            deadline = min(deadline, self.timeout + min(group.oldest for group in self._former))
        return deadline

    def pass_time(self, now: int) -> None:
        """Let time pass: what is too old is forgotten, and what has paused may settle."""
        if self.are_waiting:
            self.wait(now)
        self.stream.pass_time(now)
        self.listing.pass_time(now)
        if self.timeout < NEVER:
            for group in self._former:
                group.forget_before(now - self.timeout)
        self._drop_former()
        self._find_faults(now)

    def wait(self, now: int) -> None:
        """Take for no pause what was none: messages may still be queued."""
        if isinstance(self.listing, Maps):
            self.listing.wait(now)

    def set_back(self, now: int) -> None:
        """Forget what belongs to another time, all but maps."""
        self.stream.set_back(now)
        if isinstance(self.listing, Maps):
            self.listing.wait(now)
        else:
            self._forget_all(now, wants_history=False)
        self._find_faults(now)

    def update_publishers(self, endpoints: Sequence[Endpoint], now: int) -> None:
        """Take the publishers that there are now."""
        if self.stream.update(endpoints):
            self._begin_anew(type(self.listing), now, wants_history=True)
        self._drop_former()
        self._find_faults(now)

    def renew(self, now: int) -> None:
        """Listen anew: what the one publisher has kept comes again."""
        self.stream.restart()
        self._begin_anew(type(self.listing), now)
        self._find_faults(now)

    def place(self, body: PackedBody | None, frame_id: str, stamp: int, now: int,
              instance: int | None, number: int | None) -> str | None:
        """Take a body, or None for an empty polygon; return a refusal or None."""
        news = self.stream.receive(number, now)
        if news is not CONTINUES or not stamp or type(self.listing) is not self._stamped:
            self._follow(news, stamp if stamp or body is not None else None, now)
        time = stamp if 0 < stamp < now else now
        listing = self.listing
        is_old = time + self.timeout < now
        if is_old or self._is_far:
            self._note_age(is_old, now - time)
        refusal: str | None = TOO_OLD if is_old else None
        if body is None:
            self._end_listing(news, stamp, time, now)
        elif isinstance(listing, Sets):
            group = listing.receive(news, stamp, time, now)
            if not is_old:
                refusal = group.place(body, frame_id, time)
        else:
            keyed = self._join(listing, news, time, now)
            if not is_old:
                key: Key = shape_of(body) if instance is None or not self._by_id else instance
                refusal = keyed.place(key, listing.listing, body, frame_id, time)
                if refusal:
                    self._spoil(f'there were {refusal}', now)
        if self.listing.is_known is not self._was_known or news is not CONTINUES or (
                self.faults or refusal):
            self._find_faults(now)
        return refusal

    def place_run(self, run: Run, stamp: int, now: int) -> int:
        """
        Take what continues the set of the message before, and may meet nothing.

        Return how many messages were taken; what comes next is to be placed by itself.
        """
        listing = self.listing
        if not isinstance(listing, Sets) or stamp > now:
            return 0
        room = listing.room_for_run(stamp)
        if not room:
            return 0
        placed = listing.current.group.place_run(run, room, stamp)
        listing.current.count += placed
        self.stream.next += placed
        return placed

    def refuse(self, reason: str, stamp: int | None, now: int, instance: int | None,
               number: int | None) -> str:
        """Take a message without a usable polygon, as `Scene.refuse`; return what counts."""
        news = self.stream.receive(number, now)
        self._follow(news, stamp, now)
        time = stamp if stamp and stamp < now else now
        listing = self.listing
        is_old = time + self.timeout < now
        if is_old or self._is_far:
            self._note_age(is_old, now - time)
        if stamp and isinstance(listing, Sets):
            group = listing.receive(news, stamp, time, now)
            if not is_old:
                reason = group.refuse(time, reason)
        elif instance is not None and self._by_id and not isinstance(listing, Sets):
            if stamp is not None:
                self._join(listing, news, time, now)
            elif news is not CONTINUES:
                self._spoil(LOSS, now)
            keyed = listing.group
            if not is_old and keyed.refuse(instance, listing.listing, time, reason):
                self._spoil(f'there were {TOO_MANY}', now)
        else:
            self._spoil(f'a message was refused: {reason}', now)
            if isinstance(listing, Sets):
                listing.is_known = False
        self._find_faults(now)
        return TOO_OLD if is_old else reason

    def refuse_other_frames(self, frame_id: str, now: int) -> None:
        """Refuse the obstacles in another frame than this, which was not known when they came."""
        for group in self.store.groups:
            group.refuse_other_frames(frame_id)
        self._find_faults(now)

    def _follow(self, news: News, stamp: int | None, now: int) -> None:
        """Begin another listing where a stream begins, or is listed in another manner."""
        if news is MET or news is BEGUN:
            self._begin_anew(type(self.listing), now)
        manner = self._manner(stamp)
        if type(self.listing) is not manner:
            self._begin_anew(manner, now)

    def _manner(self, stamp: int | None) -> type[_Listing]:
        """Return how a message with this stamp is listed; None for any."""
        if self.timeout == NEVER:
            return Maps
        if not self._in_sets:
            return Keys
        if stamp is None:
            return Sets if isinstance(self.listing, Maps) else type(self.listing)
        return Sets if stamp else Keys

    def _join(self, listing: Keys[KeyedGroup] | Maps[KeyedGroup], news: News, time: int,
              now: int) -> KeyedGroup:
        return (listing.receive(news, time, now) if isinstance(listing, Keys)
                else listing.receive(news, now))

    def _end_listing(self, news: News, stamp: int, time: int, now: int) -> None:
        """Take an empty polygon: what that means depends on the manner."""
        listing = self.listing
        if isinstance(listing, Maps):
            listing.end(news, now)
            self._drop_former()
        elif isinstance(listing, Keys):
            listing.receive(news, time, now)
        elif stamp:
            listing.end(news, stamp, time, now)
        elif news is LOST:
            listing.spoil(LOSS)

    def _spoil(self, cause: str, now: int) -> None:
        """Take messages of which nothing is known."""
        if isinstance(self.listing, Keys):
            self.listing.spoil(cause, now)
        else:
            self.listing.spoil(cause)

    def _begin_anew(self, manner: type[_Listing], now: int,
                    wants_history: bool = False) -> None:
        """Begin another listing; bodies of the former one stay until their timeout."""
        for group in self.listing.groups:
            group.forget_refused()
            group.forget_before(now - self.timeout)
            if group.oldest < NEVER:
                self._former.append(group)
            else:
                group.clear()
        if manner is Sets:
            self.listing = Sets(self.store.new_set)
        elif manner is Keys:
            self.listing = Keys(self.store.new_keyed())
        else:
            self.listing = Maps(self.store.new_keyed(), wants_history)
        self._configure_listing()
        self._drop_former()

    def _configure_listing(self) -> None:
        listing = self.listing
        if isinstance(listing, Maps):
            listing.settle_time = round(self.settings.settle_time * 1e9)
        else:
            listing.timeout = self.timeout
        if isinstance(listing, Sets):
            listing.window = round(self.settings.set_window * 1e9)
            listing.max_count = self.settings.max_count

    def _forget_all(self, now: int, wants_history: bool) -> None:
        self._begin_anew(self._manner(None), now, wants_history)
        for group in self._former:
            group.clear()
        self._former.clear()

    def _drop_former(self) -> None:
        """Forget what is left of former listings, where nothing speaks for it any more."""
        is_replaced = (self.timeout == NEVER and self.listing.is_known
                       and self.stream.is_alone)
        for k, group in reversed([*enumerate(self._former)]):
            if is_replaced or group.oldest == NEVER or k < len(self._former) - _MOST_FORMER:
                del self._former[k]
                group.clear()

    def _note_age(self, is_old: bool, age: int) -> None:
        self._is_far = is_old and (self._is_far or age > FAR)

    def _find_faults(self, now: int) -> None:
        """Put into words what is wrong with the source."""
        if self._was_known and not self.listing.is_known:
            # What was held because the last whole set was young may be too old.
            self.listing.pass_time(now)
        self._was_known = self.listing.is_known
        faults: tuple[str, ...] = ()
        if self.settings.enabled:
            words = self.stream.faults()
            problem = self.listing.problem(now)
            if problem and not words:
                if self._is_far:
                    problem = f'has stamps that are {BY_ANOTHER_CLOCK}'
                words = ['; '.join((problem, *self.stream.hints()))]
            words += [f'sent what was refused: {reason}'
                      for reason in sorted(+self.store.refusals)]
            faults = tuple(f'obstacle source {self.settings.name} on {self.settings.topic} {word}'
                           for word in words)
        if faults != self.faults:
            self.faults = faults


def shape_of(body: PackedBody) -> bytes:
    """Return what is the same for equal bodies, and for no others."""
    return np.asarray(body[0])[:size_of(body)].tobytes()

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

"""Sources of obstacles: whether all that each one sent is known, its obstacles and its faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from sat_collision.geometry.polygon import PackedBody, size_of
from sat_collision.geometry.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.knowledge import Keys, LOSS, Maps, Sets
from sat_collision.scene.obstacle_store import KeyedGroup, ObstacleStore, SetGroup, TOO_MANY
from sat_collision.scene.obstacles import Key
from sat_collision.scene.settings import (
    BY_ANOTHER_CLOCK, FAR, NEVER, ObstacleSettings, POLYGON_INSTANCE)
from sat_collision.scene.streams import BEGUN, CONTINUES, Endpoint, JOINED, News, Stream
from sat_collision.scene.velocity import MotionTracker, Vertices

TOO_OLD = 'too old'

# Max interrupted listings whose obstacles are kept.
_MAX_FORMER = 20

_Listing: TypeAlias = Sets | Keys | Maps
_Group: TypeAlias = SetGroup | KeyedGroup


class Source:
    """
    One topic of obstacles: its stream, its kind of listing, and the obstacles themselves.

    Polygons with stamps come in sets; those of stamp 0, and all of a source that accumulates, are
    identified by their shape; instances by their id; with a timeout of 0 they make a map. The
    obstacles of an interrupted listing stay until their timeout, beside those of the next listing.

    Times are in ns. A message counts from its stamp, or from now if that is 0 or in the future.
    One past its timeout is refused as TOO_OLD.
    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts) -> None:
        self.settings = settings
        self.store = ObstacleStore(settings.name, contacts)
        self.stream = Stream()
        # Why the source cannot be trusted, as sentences; empty if it can. The same object until
        # they change.
        self.faults: tuple[str, ...] = ()
        # The current listing of its publisher: a new object whenever that starts over.
        self.listing: _Listing = Sets(self.store)
        # Groups of listings that were interrupted.
        self._former: list[_Group] = []
        # Whether stamps are those of another clock, see FAR.
        self._is_far = False
        # Whether the listing was known when faults were last found.
        self._was_known = False
        self.timeout: float = NEVER
        self.configure(settings, now=0)

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        """Apply settings; a disabled source drops all that it has received."""
        before, self.settings = self.settings, settings
        self.timeout = self.stream.timeout = round(settings.timeout * 1e9) or NEVER
        self.store.max_count = settings.max_count
        self._by_id = settings.type == POLYGON_INSTANCE
        # The kinds of listing for messages with a stamp, and for those of stamp 0.
        self._stamped: type[_Listing] = Sets
        self._unstamped: type[_Listing] = Keys
        if self.timeout == NEVER:
            self._stamped = self._unstamped = Maps
        elif self._by_id or settings.accumulate:
            self._stamped = Keys
        self._follow(CONTINUES, None, now)
        if settings.enabled != before.enabled:
            self.stream.interrupt()
            self._forget_all(now, wants_history=settings.enabled)
        self.listing.configure(settings, now)
        self.pass_time(now)
        if settings != before:
            self.request_history()

    @property
    def wants_history(self) -> bool:
        """Whether the messages that a publisher keeps are needed again."""
        return self.listing.wants_history and self.settings.enabled

    def request_history(self) -> None:
        """Request a map again of which something is missing, as it may be taken now."""
        if isinstance(self.listing, Maps) and (
                not self.listing.is_known or self.store.refusals.total()):
            self.listing.wants_history = True

    @property
    def deadline(self) -> float:
        """Time in ns after which something changes without a message."""
        return min(self.listing.deadline, self.stream.mixed_until,
                   *(group.oldest + self.timeout for group in self._former))

    def pass_time(self, now: int) -> None:
        """Let time pass: drop obstacles that are too old, and settle a map after a pause."""
        self.stream.pass_time(now)
        self.listing.pass_time(now)
        for group in self._former:
            group.forget_before(now - self.timeout)
        self._drop_former()
        self._find_faults(now)

    def set_back(self, now: int) -> None:
        """Drop all but maps, because the clock was set back."""
        self.stream.set_back(now)
        if isinstance(self.listing, Maps):
            self.listing.wait(now)
        else:
            self._forget_all(now, wants_history=False)
            self.listing.since = 'since the clock was set back'
        self._find_faults(now)

    def update_publishers(self, endpoints: Sequence[Endpoint], now: int) -> None:
        """Update the publishers; a change of them may start a new listing."""
        if self.stream.update(endpoints):
            self._begin_anew(type(self.listing), now, wants_history=True)
        self._drop_former()
        self._find_faults(now)

    def renew(self, now: int) -> None:
        """Start over with a new subscription, to which the publisher sends all that it keeps."""
        self.stream.restart()
        self._begin_anew(type(self.listing), now)
        self._find_faults(now)

    def receive(self, body: PackedBody | None, frame_id: str, stamp: int | None, now: int,
                instance: int | None, number: int | None,
                refusal: str | None = None) -> str | None:
        """
        Receive a message; return the reason if it is refused, by the caller or here.

        The body of an empty polygon, or of a message that the caller refuses, is None; so is a
        stamp that could not be read or cannot be trusted.
        """
        news = self.stream.receive(number, now)
        is_end = body is None and not refusal
        if news is not CONTINUES or not stamp or type(self.listing) is not self._stamped:
            self._follow(news, stamp or None if is_end else stamp, now)
        listing = self.listing
        time = stamp if stamp and stamp < now else now
        is_old = time + self.timeout < now
        if is_old or self._is_far:
            self._is_far = is_old and (self._is_far or now - time > FAR)
        if is_end:
            listing.end(news, stamp or 0, time, now)
            self._drop_former()
        elif (key := 0 if stamp and type(listing) is Sets
              else self._key_of(body, instance)) is None:
            listing.spoil(f'a message was refused: {refusal}', now)
        else:
            if stamp is not None:
                group: _Group = listing.receive(news, stamp, time, now)
            else:
                group = listing.groups[-1]
                if news is not CONTINUES:
                    listing.spoil(LOSS, now)
            if not is_old:
                taken = group.take(key, body, frame_id, time, refusal)
                if taken is TOO_MANY and not isinstance(listing, Sets):
                    listing.spoil(f'there were {TOO_MANY}', now)
                refusal = refusal or taken
        if is_old:
            refusal = TOO_OLD
        if listing.is_known is not self._was_known or news is not CONTINUES or (
                self.faults or refusal):
            self._find_faults(now)
        return refusal

    def track(self, instance: int, time: int, vertices: Vertices) -> None:
        """Track an obstacle by its id, vertices in the order sent, unless it is newer."""
        obstacle = None if isinstance(self.listing, Sets) else self.listing.group.get(instance)
        if obstacle is not None and obstacle.time == time:
            obstacle.motion = obstacle.motion or MotionTracker()
            obstacle.motion.place(time, vertices)

    def receive_run(self, run: Run, frame_id: str, stamp: int, number: int | None,
                    now: int) -> int:
        """
        Receive messages that add to the set of the one before, as `receive` would one by one.

        If no contacts are decided they may also begin a set.

        Return how many were taken; the next one may be refused, may meet a footprint, or may end
        the set, and must be received by itself.
        """
        listing, stream = self.listing, self.stream
        expected = stream.next
        if (not isinstance(listing, Sets) or expected is None or number not in (None, expected)
                or stream.awaits_endpoint
                or self._is_far or not 0 < stamp <= now <= stamp + self.timeout):
            return 0
        # The message that reaches max_count may end the set.
        limit = self.settings.max_count - 1
        current = listing.set_to_extend(stamp)
        if current is not None:
            taken = current.group.take_run(run, limit - current.count, frame_id, stamp)
        elif taken := self.store.contacts.count_unplaced(run, limit):
            current = listing.set_of(stamp, now)
            taken = current.group.add_run(min(taken, limit - current.count), frame_id, stamp)
        else:
            return 0
        if taken:
            current.count += taken
            stream.next = expected + taken
            if self.faults or listing.is_known is not self._was_known:
                self._find_faults(now)
        return taken

    def refuse_other_frames(self, frame_id: str, now: int) -> None:
        """Refuse obstacles in other frames, received before the common frame was known."""
        for group in self.store.groups:
            group.refuse_other_frames(frame_id)
        self._find_faults(now)

    def _follow(self, news: News, stamp: int | None, now: int) -> None:
        """Begin another listing if a stream begins, or the kind of listing changes."""
        kind: type[_Listing] = type(self.listing)
        if stamp is not None:
            kind = self._stamped if stamp else self._unstamped
        elif kind not in (self._stamped, self._unstamped):
            kind = self._stamped
        if news is JOINED or news is BEGUN or kind is not type(self.listing):
            self._begin_anew(kind, now)

    def _key_of(self, body: PackedBody | None, instance: int | None) -> Key | None:
        """Return the id or shape of an obstacle, None if unknown or in a set."""
        if isinstance(self.listing, Sets):
            return None
        if self._by_id:
            return instance
        # The bytes of the packed body: equal for equal bodies, and only for these.
        return None if body is None else np.asarray(body[0])[:size_of(body)].tobytes()

    def _begin_anew(self, kind: type[_Listing], now: int, wants_history: bool = False) -> None:
        """Begin another listing; obstacles of the former one stay until their timeout."""
        for group in self.listing.groups:
            group.forget_refused()
            group.forget_before(now - self.timeout)
            if group.oldest < NEVER:
                self._former.append(group)
            else:
                group.clear()
        self.listing = kind(self.store)
        self.listing.configure(self.settings, now)
        self.listing.wants_history = wants_history and kind is Maps
        self._drop_former()

    def _forget_all(self, now: int, wants_history: bool) -> None:
        self._begin_anew(type(self.listing), now, wants_history)
        for group in self._former:
            group.clear()
        self._former.clear()

    def _drop_former(self) -> None:
        """Drop former listings that have expired, are replaced, or are too many."""
        is_replaced = (self.timeout == NEVER and self.listing.is_known
                       and self.stream.is_alone)
        for k, group in reversed([*enumerate(self._former)]):
            if is_replaced or group.oldest == NEVER or k < len(self._former) - _MAX_FORMER:
                del self._former[k]
                group.clear()

    def _find_faults(self, now: int) -> None:
        """Update the faults of the source."""
        if self._was_known and not self.listing.is_known:
            # Obstacles kept while the last whole set was valid may be too old.
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

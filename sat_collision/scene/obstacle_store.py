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

"""The obstacles of a source, in groups that are dropped together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.polygon import PackedBody
from sat_collision.geometry.run import Run
from sat_collision.scene.contacts import Contacts, NOWHERE
from sat_collision.scene.obstacles import Key, Obstacle
from sat_collision.scene.settings import NEVER

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'


class ObstacleStore:
    """The groups of obstacles of a source."""

    def __init__(self, source: str, contacts: Contacts) -> None:
        self.source = source
        self.contacts = contacts
        # Max obstacles of a group.
        self.max_count = 0
        # Number of obstacles whose message was refused, by reason.
        self.refusals: Counter[str] = Counter()
        self.groups: list[ObstacleGroup] = []
        self._spare: list[SetGroup] = []
        self._shapes_seen = 0

    def __iter__(self) -> Iterator[Obstacle]:
        """Iterate over all obstacles, including those whose message was refused."""
        return chain.from_iterable(self.groups)

    def new_set(self) -> SetGroup:
        """Return a group for a set, reusing a dropped one if possible."""
        group = self._spare.pop() if self._spare else SetGroup(self)
        self.groups.append(group)
        return group

    def new_keyed(self) -> KeyedGroup:
        """Return a group for obstacles by id or shape."""
        group = KeyedGroup(self)
        self.groups.append(group)
        return group

    def drop(self, group: ObstacleGroup) -> None:
        """Drop an empty group."""
        if group in self.groups:
            self.groups.remove(group)
            if isinstance(group, SetGroup):
                self._spare.append(group)

    def number_of(self, key: Key) -> int:
        """Return the number by which an obstacle of this key is reported."""
        if isinstance(key, int):
            return key
        self._shapes_seen += 1
        return -self._shapes_seen


class ObstacleGroup:
    """The base of groups. A refused message takes the place of its obstacle."""

    def __init__(self, store: ObstacleStore) -> None:
        self._store = store
        self._contacts = store.contacts

    def __iter__(self) -> Iterator[Obstacle]:
        """Iterate over all obstacles, including those whose message was refused."""
        raise NotImplementedError

    def flush(self) -> None:
        """Update the obstacles that runs have moved."""

    def forget_refused(self) -> None:
        """Drop the obstacles whose messages were refused."""
        self._forget([one for one in self if one.refused])

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse all placed obstacles in other frames than this."""
        for one in self:
            if one.row is not None and one.frame_id != frame_id:
                self._put(one, None, one.frame_id, one.time, OTHER_FRAME)

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        """Drop obstacles."""
        for obstacle in obstacles:
            self._contacts.remove_obstacle(obstacle)
            self._mark(obstacle, None)

    def _put(self, obstacle: Obstacle, body: PackedBody | None, frame_id: str, time: float,
             refusal: str | None) -> None:
        """Place an obstacle as its message says, or remove its body if that is refused."""
        obstacle.frame_id = frame_id
        obstacle.time = time
        if body is None or refusal:
            self._contacts.remove_obstacle(obstacle)
        else:
            self._contacts.place_obstacle(obstacle, body)
        if refusal or obstacle.refused:
            self._mark(obstacle, refusal)

    def _mark(self, obstacle: Obstacle, refusal: str | None) -> None:
        """Set why an obstacle is refused, None if it is not."""
        before, obstacle.refused = obstacle.refused, refusal
        if before:
            self._store.refusals[before] -= 1
        if refusal:
            self._store.refusals[refusal] += 1


class SetGroup(ObstacleGroup):
    """
    The obstacles of one set: the k-th message is the k-th obstacle.

    A group that is cleared keeps its rows, hidden, for another set.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # The earliest time of its obstacles; NEVER if there are none.
        self.oldest: float = NEVER
        self._places: list[Obstacle] = []
        # The row of each place, -1 for none.
        self._rows = indexable(np.empty(0, np.int64))
        self._taken = 0
        # Of runs: begin and end of their places, and the frame and time of their obstacles. Only
        # `flush` writes these to the obstacles: most sets are dropped before that is needed.
        self._pending: list[tuple[int, int, str, float]] = []

    def __iter__(self) -> Iterator[Obstacle]:
        self.flush()
        return (one for one in self._places[:self._taken] if one.row is not None or one.refused)

    def flush(self) -> None:
        for begin, end, frame_id, time in self._pending:
            self._add_places(end)
            for obstacle in self._places[begin:end]:
                if obstacle.row is None:
                    obstacle.row = NOWHERE
                obstacle.moved()
                obstacle.frame_id = frame_id
                obstacle.time = time
        self._pending.clear()

    def take_run(self, run: Run, limit: int, frame_id: str, time: int) -> int:
        """
        Take obstacles of a run, up to a limit.

        Return how many were taken: if contacts are decided, all before the first one that has no
        row or may meet a footprint.
        """
        if limit <= 0:
            return 0
        taken = self._contacts.place_run(run, self._rows, self._taken, limit)
        return self.add_run(taken, frame_id, time)

    def add_run(self, count: int, frame_id: str, time: int) -> int:
        """Add obstacles of a run, which are in their places or have none; return the count."""
        begin = self._taken
        if count:
            self._taken += count
            if time < self.oldest:
                self.oldest = time
            self._pending.append((begin, self._taken, frame_id, time))
        return count

    def take(self, key: Key, body: PackedBody | None, frame_id: str, time: int,
             refusal: str | None) -> str | None:
        """Take a message, with body None if it is refused; return why it is refused, or None."""
        place = self._taken
        if place >= self._store.max_count:
            # All obstacles beyond the limit share a place.
            place = self._store.max_count
            refusal = refusal or TOO_MANY
        self._taken = place + 1
        if time < self.oldest:
            self.oldest = time
        self._add_places(place + 1)
        self._put(self._places[place], body, frame_id, time, refusal)
        return refusal

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""
        if self.oldest < time:
            self._forget([one for one in self if one.time < time])

    def clear(self) -> None:
        """Hide all obstacles."""
        places, taken = self._places, self._taken
        if taken < len(places):
            super()._forget(places[taken:])
            for place in range(taken, len(places)):
                self._rows[place] = -1
            del places[taken:]
        if self._store.refusals:
            for obstacle in places:
                self._mark(obstacle, None)
        self._contacts.hide_obstacles(self, self._rows)
        self._pending.clear()
        self._taken = 0
        self.oldest = NEVER
        self._store.drop(self)

    def _add_places(self, count: int) -> None:
        """Add places until there are so many."""
        for place in range(len(self._places), count):
            self._places.append(Obstacle(self, self._store.source, place, place))
            if place == len(self._rows):
                self._rows = indexable(np.append(self._rows, np.full(place + 1, -1)))

    def _put(self, obstacle: Obstacle, body: PackedBody | None, frame_id: str, time: float,
             refusal: str | None) -> None:
        super()._put(obstacle, body, frame_id, time, refusal)
        self._rows[obstacle.name.key] = -1 if obstacle.row is None else obstacle.row

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        super()._forget(obstacles)
        for obstacle in obstacles:
            self._rows[obstacle.name.key] = -1
        self.oldest = min((obstacle.time for obstacle in self), default=NEVER)


class KeyedGroup(ObstacleGroup):
    """Obstacles identified by id or shape, each where the message of its newest stamp says."""

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # In order of their times, if messages arrive in order of their stamps.
        self._held: dict[Key, Obstacle] = {}
        # The number of the current listing.
        self._listing = 0

    def __iter__(self) -> Iterator[Obstacle]:
        return iter(self._held.values())

    @property
    def oldest(self) -> float:
        """The time of the least recently updated obstacle; NEVER if there is none."""
        for obstacle in self._held.values():
            return obstacle.time
        return NEVER

    def take(self, key: Key, body: PackedBody | None, frame_id: str, time: int,
             refusal: str | None) -> str | None:
        """
        Take a message, with body None if it is refused; return why it is refused, or None.

        A message older than the obstacle of its key changes nothing. A new key for which there
        is no room is refused as TOO_MANY, and no obstacle is made for it.
        """
        held = self._held
        obstacle = held.pop(key, None)
        if obstacle is None:
            if len(held) >= self._store.max_count:
                return TOO_MANY
            obstacle = Obstacle(self, self._store.source, key, self._store.number_of(key))
        elif time < obstacle.time:
            held[key] = obstacle
            return refusal
        held[key] = obstacle
        obstacle.listing = self._listing
        self._put(obstacle, body, frame_id, time, refusal)
        return refusal

    def get(self, key: Key) -> Obstacle | None:
        """Return the obstacle of a key, or None."""
        return self._held.get(key)

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""
        while self.oldest < time:
            self._forget([next(iter(self))])

    def end_listing(self, replaces: bool) -> None:
        """End the listing; if it replaces earlier ones, drop obstacles that only those had."""
        if replaces:
            self._forget([one for one in self if one.listing < self._listing])
        self._listing += 1

    def clear(self) -> None:
        """Drop all."""
        self._forget([*self])
        self._store.drop(self)

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        super()._forget(obstacles)
        for obstacle in obstacles:
            del self._held[obstacle.key]

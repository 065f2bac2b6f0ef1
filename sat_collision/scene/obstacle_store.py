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

"""The obstacles that a source holds: in groups that are dropped together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import chain

from sat_collision.geometry.polygon import PackedBody
from sat_collision.geometry.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.obstacles import Key, Obstacle
from sat_collision.scene.times import NEVER

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'


class ObstacleStore:
    """
    The groups of obstacles of one source.

    Parameters
    ----------
    source : str
        Name of the source.
    contacts : Contacts

    Attributes
    ----------
    max_count : int
        How many obstacles a group has room for.
    refusals : Counter
        How many obstacles stand for a message that was refused, by reason.

    """

    def __init__(self, source: str, contacts: Contacts) -> None:
        self.source = source
        self.contacts = contacts
        self.max_count = 0
        self.refusals: Counter[str] = Counter()
        self.groups: list[ObstacleGroup] = []
        self._spare: list[SetGroup] = []
        self._shapes_seen = 0

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all obstacles, those that stand for a refused message included."""
        return chain.from_iterable(self.groups)

    def new_set(self) -> SetGroup:
        """Return a group for a set, one that was used before if there is one."""
        group = self._spare.pop() if self._spare else SetGroup(self)
        self.groups.append(group)
        return group

    def new_keyed(self) -> KeyedGroup:
        """Return a group for obstacles by id or shape."""
        group = KeyedGroup(self)
        self.groups.append(group)
        return group

    def drop(self, group: ObstacleGroup) -> None:
        """Forget a group that is empty."""
        if group in self.groups:
            self.groups.remove(group)
            if isinstance(group, SetGroup):
                self._spare.append(group)

    def number_of(self, key: Key) -> int:
        """Return the number that an obstacle of this key is reported by."""
        if isinstance(key, int):
            return key
        self._shapes_seen += 1
        return -self._shapes_seen


class ObstacleGroup:
    """
    What groups of obstacles have in common. A refused message takes the place of its obstacle.

    Parameters
    ----------
    store : ObstacleStore

    """

    def __init__(self, store: ObstacleStore) -> None:
        self._store = store
        self._contacts = store.contacts

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all obstacles, those that stand for a refused message included."""
        raise NotImplementedError

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse all in other frames than this."""
        for obstacle in self:
            if obstacle.row is not None and obstacle.frame_id != frame_id:
                self._refuse(obstacle, obstacle.time, OTHER_FRAME)

    def _place(self, obstacle: Obstacle, body: PackedBody, frame_id: str, time: int) -> None:
        """Put an obstacle where a message says."""
        obstacle.frame_id = frame_id
        obstacle.time = time
        self._contacts.place_obstacle(obstacle, body)
        if obstacle.refused:
            self._mark(obstacle, None)

    def _refuse(self, obstacle: Obstacle, time: float, reason: str) -> None:
        """Let an obstacle stand for a message that was refused."""
        obstacle.time = time
        self._contacts.remove_obstacle(obstacle)
        self._mark(obstacle, reason)

    def _remove(self, obstacle: Obstacle) -> None:
        self._contacts.remove_obstacle(obstacle)
        self._mark(obstacle, None)

    def _mark(self, obstacle: Obstacle, reason: str | None) -> None:
        """Change why an obstacle is refused: None if it is not any more."""
        before, obstacle.refused = obstacle.refused, reason
        if before:
            self._store.refusals[before] -= 1
        if reason:
            self._store.refusals[reason] += 1


class SetGroup(ObstacleGroup):
    """
    The obstacles of one set: the k-th message is the k-th obstacle.

    One that is cleared keeps its rows, hidden, for another set.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        self.oldest: float = NEVER
        self._places: list[Obstacle] = []
        self._taken = 0

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all obstacles, those that stand for a refused message included."""
        return (one for one in self._places[:self._taken] if one.row is not None or one.refused)

    def place(self, body: PackedBody, frame_id: str, time: int) -> str | None:
        """Take a body; return a refusal or None."""
        if self._taken >= self._store.max_count:
            return self.refuse(time, TOO_MANY)
        obstacle = self._next(time)
        obstacle.frame_id = frame_id
        obstacle.time = time
        self._contacts.place_obstacle(obstacle, body)
        return None

    def place_run(self, run: Run, most: int, time: int) -> int:
        """Take bodies that may meet nothing, at most so many; return how many were taken."""
        begin = self._taken
        places = self._places[begin:min(begin + most, self._store.max_count)]
        for k, obstacle in enumerate(places):
            if obstacle.row is None or obstacle.refused:
                del places[k:]
                break
        placed = self._contacts.place_run(places, run) if places else 0
        frame_id = self._places[begin - 1].frame_id
        for obstacle in places[:placed]:
            obstacle.frame_id = frame_id
            obstacle.time = time
        self._taken += placed
        return placed

    def refuse(self, time: int, reason: str) -> str:
        """Take a message that is refused; return the reason."""
        # All that is too much shares a place.
        self._taken = min(self._taken, self._store.max_count)
        self._refuse(self._next(time), time, reason)
        return reason

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""
        if self.oldest < time:
            for obstacle in self:
                if obstacle.time < time:
                    self._remove(obstacle)
            self._find_oldest()

    def forget_refused(self) -> None:
        """Drop what stands for refused messages."""
        for obstacle in self:
            if obstacle.refused:
                self._remove(obstacle)
        self._find_oldest()

    def _find_oldest(self) -> None:
        self.oldest = min((obstacle.time for obstacle in self), default=NEVER)

    def clear(self) -> None:
        """Hide all."""
        places, taken = self._places, self._taken
        for obstacle in places[taken:]:
            self._remove(obstacle)
        del places[taken:]
        if self._store.refusals:
            for obstacle in places:
                if obstacle.refused:
                    self._mark(obstacle, None)
        self._contacts.hide_obstacles(self, [one.row for one in places if one.row is not None])
        self._taken = 0
        self.oldest = NEVER
        self._store.drop(self)

    def _next(self, time: int) -> Obstacle:
        """Return the obstacle at the next place."""
        place = self._taken
        self._taken = place + 1
        if time < self.oldest:
            self.oldest = time
        if place == len(self._places):
            self._places.append(Obstacle(self, self._store.source, place, place))
        return self._places[place]


class KeyedGroup(ObstacleGroup):
    """Obstacles that are told apart by id or shape, each where its newest stamp says."""

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # In the order of their times, as far as messages come in the order of their stamps.
        self._held: dict[Key, Obstacle] = {}

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all obstacles, those that stand for a refused message included."""
        return iter(self._held.values())

    def __len__(self) -> int:
        return len(self._held)

    @property
    def oldest(self) -> float:
        """The time of the obstacle that was refreshed the longest ago; NEVER if there is none."""
        for obstacle in self._held.values():
            return obstacle.time
        return NEVER

    def place(self, key: Key, listing: int, body: PackedBody, frame_id: str,
              time: int) -> str | None:
        """Take a body of a listing; return a refusal, for which nothing stands here, or None."""
        obstacle = self._take(key, listing, time)
        if obstacle is None:
            return None if key in self._held else TOO_MANY
        self._place(obstacle, body, frame_id, time)
        return None

    def refuse(self, key: Key, listing: int, time: int, reason: str) -> str | None:
        """Take a message of a key that is refused; return as `place`."""
        obstacle = self._take(key, listing, time)
        if obstacle is None:
            return None if key in self._held else TOO_MANY
        self._refuse(obstacle, time, reason)
        return None

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""
        while self.oldest < time:
            self._forget(next(iter(self._held)))

    def forget_refused(self) -> None:
        """Drop what stands for refused messages."""
        for key in [key for key, one in self._held.items() if one.refused]:
            self._forget(key)

    def forget_listings_before(self, listing: int) -> None:
        """Drop the obstacles that were in earlier listings only."""
        for key in [key for key, one in self._held.items() if one.listing < listing]:
            self._forget(key)

    def clear(self) -> None:
        """Drop all."""
        for key in [*self._held]:
            self._forget(key)
        self._store.drop(self)

    def _take(self, key: Key, listing: int, time: int) -> Obstacle | None:
        """Return the obstacle of a key; None if a newer stamp has put it elsewhere, or no room."""
        held = self._held
        obstacle = held.pop(key, None)
        if obstacle is None:
            if len(held) >= self._store.max_count:
                return None
            obstacle = Obstacle(self, self._store.source, key, self._store.number_of(key))
        elif time < obstacle.time:
            held[key] = obstacle
            return None
        held[key] = obstacle
        obstacle.listing = listing
        return obstacle

    def _forget(self, key: Key) -> None:
        self._remove(self._held.pop(key))

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The obstacles of a source, in groups that are dropped together."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from sat_collision.geometry.body.polygon import PackedBody
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.sets.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.obstacles import Obstacle, ObstacleId
from sat_collision.scene.settings import NEVER

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'

_MAX_SPARE = 100


class Followed(NamedTuple):
    """A body of a map in another frame, which moves with that."""

    body: PackedBody
    sent: tuple[str, Any]  # that frame, and what is needed to place it anew


@dataclass(frozen=True, slots=True)
class Polygons:
    """The polygons of a message that has all that a source sees."""

    count: int
    run: Callable[[int], Run] | None  # those from one on; None where each is placed by itself
    # The body of one, and why it is refused.
    body: Callable[[int], tuple[PackedBody | Followed | None, str | None]]


# What a message places.
Shape: TypeAlias = PackedBody | Followed | Polygons


class ObstacleStore:
    """The groups of obstacles of a source."""

    def __init__(self, source: str, contacts: Contacts) -> None:
        self.source = source
        self.contacts = contacts
        self.max_count = 0  # of a group
        self.groups: list[ObstacleGroup] = []
        self.listings = 0  # how many have begun
        self._spare: list[SetGroup] = []

    def __iter__(self) -> Iterator[Obstacle]:
        return chain.from_iterable(self.groups)

    @property
    def frames(self) -> set[str]:
        """The other frames in which obstacles of a map were sent."""
        return set().union(*(group.frames for group in self.groups))

    def new_set(self) -> SetGroup:
        """Return a group for obstacles in order, a dropped one if there is any."""
        if not self._spare:
            return SetGroup(self)
        group = self._spare.pop()
        self.groups.append(group)
        return group

    def drop(self, group: ObstacleGroup) -> None:
        """Drop an empty group."""
        if group in self.groups:
            self.groups.remove(group)
            if isinstance(group, SetGroup) and len(self._spare) < _MAX_SPARE:
                self._spare.append(group)


class ObstacleGroup:
    """The base of groups."""

    def __init__(self, store: ObstacleStore) -> None:
        self._store = store
        self._contacts = store.contacts
        self.frames: set[str] = set()  # other frames in which obstacles of a map were sent
        store.groups.append(self)

    def __iter__(self) -> Iterator[Obstacle]:
        raise NotImplementedError

    @property
    def oldest(self) -> float:
        """The time of what it forgets first; NEVER if there are none."""
        raise NotImplementedError

    def flush(self) -> None:
        """Update the obstacles that runs have moved."""

    def clear(self) -> None:
        """Drop all."""
        raise NotImplementedError

    def forget_before(self, time: float) -> None:
        """Drop the obstacles whose time is earlier."""
        if self.oldest < time:
            self._forget([one for one in self if one.time < time])

    def set_times(self, time: int) -> None:
        """Let all obstacles count from a time."""
        for one in self:
            one.time = time

    def forget_other_frames(self, frame_id: str) -> bool:
        """Drop the obstacles in other frames than this; return whether there were any."""
        others = [one for one in self if one.frame_id != frame_id]
        self._forget(others)
        return bool(others)

    def place_anew(self, frame_id: str, body_of: Callable[[Any], PackedBody | None]) -> bool:
        """Place obstacles that were sent in a frame where that is now; return whether all are."""
        moved = [one for one in self if one.sent is not None and one.sent[0] == frame_id]
        for one in moved:
            self._put(one, body_of(one.sent), one.frame_id, one.time)
        return all(one.row is not None for one in moved)

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        for obstacle in obstacles:
            self._contacts.remove_obstacle(obstacle)

    def _put(self, obstacle: Obstacle, body: PackedBody | None, frame_id: str,
             time: float) -> None:
        """Place an obstacle as its message says; without a body it is nowhere."""
        obstacle.frame_id = frame_id
        obstacle.time = time
        if body is None:
            self._contacts.remove_obstacle(obstacle)
        else:
            self._contacts.place_obstacle(obstacle, body)


class SetGroup(ObstacleGroup):
    """
    Obstacles in the order of their messages: the k-th message is the k-th obstacle.

    A group that is cleared keeps its rows, hidden, to be used again.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        self._oldest: float = NEVER
        self._places: list[Obstacle] = []
        # The row of each place, -1 for none.
        self._rows = indexable(np.empty(0, np.int64))
        self._added = 0
        # How many of the first places are empty: a set that never ends has ever more of them.
        self._gone = 0
        # Of runs: begin and end of their places, and the frame and time of their obstacles. Only
        # `flush` writes these to the obstacles: most sets are dropped before that is needed.
        self._pending: list[tuple[int, int, str, float]] = []

    def __len__(self) -> int:
        """Return how many messages were added."""
        return self._added

    def __iter__(self) -> Iterator[Obstacle]:
        self.flush()
        return (one for one in self._places[self._gone:self._added] if one.row is not None)

    @property
    def oldest(self) -> float:
        return self._oldest

    def flush(self) -> None:
        for begin, end, frame_id, time in self._pending:
            for obstacle in self._places[begin:end]:
                obstacle.moved()
                obstacle.frame_id = frame_id
                obstacle.time = time
                obstacle.sent = None
        self._pending.clear()

    def add_run(self, run: Run, limit: int, frame_id: str, time: int) -> int:
        """Take obstacles of a run as `Contacts.place_run` does; return how many."""
        begin = self._added
        count = self._contacts.place_run(run, self._rows, begin, limit) if limit > 0 else 0
        if count:
            self._added += count
            self._oldest = min(self._oldest, time)
            self._pending.append((begin, self._added, frame_id, time))
        return count

    def add(self, body: Shape | None, frame_id: str, time: int,
            instance: int | None = None) -> str | None:
        """Take an obstacle, named by its id or else by its place; return TOO_MANY without room."""
        if isinstance(body, Polygons):
            return self._add_all(body, frame_id, time)
        sent = None
        if isinstance(body, Followed):
            body, sent = body
        place = self._added
        if place >= self._store.max_count:
            return TOO_MANY
        self._added = place + 1
        self._oldest = min(self._oldest, time)
        if place == len(self._places):
            self._places.append(Obstacle(self, self._store.source, place))
            if place == len(self._rows):
                self._rows = indexable(np.append(self._rows, np.full(place + 1, -1)))
        obstacle = self._places[place]
        name = place if instance is None else instance
        if obstacle.name.key != name:
            self._contacts.remove_obstacle(obstacle)
            obstacle.name = ObstacleId(self._store.source, name)
        obstacle.sent = sent
        if sent is not None:
            self.frames.add(sent[0])
        self._put(obstacle, body, frame_id, time)
        return None

    def _add_all(self, polygons: Polygons, frame_id: str, time: int) -> str | None:
        """Take the polygons of a message; return why the first refused one is."""
        problem = None
        k = 0
        count = min(polygons.count, self._store.max_count - self._added)
        if polygons.run and self._added + count > len(self._places):
            self._reserve(polygons.run(len(self._places) - self._added), count)
        while k < polygons.count and problem is not TOO_MANY:
            if polygons.run:
                k += self.add_run(polygons.run(k), self._store.max_count - self._added, frame_id,
                                  time)
            if k < polygons.count:
                body, refusal = polygons.body(k)
                refusal = self.add(body, frame_id, time) or refusal
                problem = refusal if refusal is TOO_MANY else problem or (
                    refusal and f'polygon {k}: {refusal}')
                k += 1
        return problem

    def _reserve(self, run: Run, count: int) -> None:
        """Have places and rows for the first polygons of a message, of which a run is missing."""
        _, spans, first, _, _, max_vertices, _ = run
        places = [Obstacle(self, self._store.source, self._added + k) for k in range(first, count)]
        points = np.asarray(spans)[1::2][first:count].clip(max=max_vertices + 1)
        rows = np.asarray(self._rows)[:len(self._places)]
        self._places += places
        self._rows = indexable(np.append(rows, self._contacts.reserve(places, points)))

    def set_times(self, time: int) -> None:
        super().set_times(time)
        self._oldest = time if self._added else NEVER

    def clear(self) -> None:
        """Hide all obstacles."""
        places, added = self._places, self._added
        if added < len(places):
            super()._forget(places[added:])
            np.asarray(self._rows)[added:len(places)] = -1
            del places[added:]
        self._contacts.hide_obstacles(self, self._rows)
        self._pending.clear()
        self.frames.clear()
        self._added = self._gone = 0
        self._oldest = NEVER
        self._store.drop(self)

    def _put(self, obstacle: Obstacle, body: PackedBody | None, frame_id: str,
             time: float) -> None:
        super()._put(obstacle, body, frame_id, time)
        self._rows[obstacle.key] = -1 if obstacle.row is None else obstacle.row

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        super()._forget(obstacles)
        for obstacle in obstacles:
            self._rows[obstacle.key] = -1
        while self._gone < self._added and self._places[self._gone].row is None:
            self._gone += 1
        self._oldest = min((obstacle.time for obstacle in self), default=NEVER)


class KeyedGroup(ObstacleGroup):
    """
    Obstacles by id, the least recently received first.

    An obstacle is where the message with its newest stamp says. One with the same or an older
    stamp counts beside it, until one with a newer stamp than both comes. A refused message takes
    the place of its obstacle.
    """

    def __init__(self, store: ObstacleStore) -> None:
        super().__init__(store)
        # Of each id the obstacles, that with the newest stamp first.
        self._held: OrderedDict[int, list[Obstacle]] = OrderedDict()
        self._count = 0
        # Number of obstacles whose message was refused, by reason.
        self._refused: Counter[str] = Counter()

    def __len__(self) -> int:
        """Return how many obstacles there are, with those that count beside others."""
        return self._count

    def __iter__(self) -> Iterator[Obstacle]:
        return chain.from_iterable(self._held.values())

    @property
    def oldest(self) -> float:
        return max((one.time for one in next(iter(self._held.values()), ())), default=NEVER)

    @property
    def refusals(self) -> list[str]:
        """Why messages in the place of obstacles were refused."""
        return sorted(self._refused)

    def add(self, instance: int, body: PackedBody | None, frame_id: str, stamp: int, time: int,
            refusal: str | None, has_room: bool) -> str | None:
        """
        Take a message, with body None if it is refused; return why it is refused, or None.

        One that needs room for one more obstacle, where there is none, is refused as TOO_MANY.
        """
        held = self._held.pop(instance, [])
        is_newest = bool(held) and stamp > held[0].stamp
        if is_newest:
            self._drop(held[1:])
            del held[1:]
        elif has_room:
            held.append(Obstacle(self, self._store.source, instance))
            self._count += 1
        else:
            refusal = TOO_MANY
        if held:
            self._held[instance] = held
        if refusal is not TOO_MANY:
            held[-1].stamp = stamp
            self._put(held[-1], body, frame_id, time)
            self._mark(held[-1], refusal)
        return refusal

    def stamped(self, instance: int, stamp: int) -> Obstacle | None:
        """Return where the newest stamp of an id says it is, if that is this one, at one place."""
        held = self._held.get(instance, [])
        return held[0] if [one.stamp for one in held].count(stamp) == 1 and (
            held[0].stamp == stamp) else None

    def forget_before(self, time: float) -> None:
        self.forget_first(lambda one: one.time < time)

    def forget_first(self, is_gone: Callable[[Obstacle], bool]) -> None:
        """Drop ids all of whose obstacles have gone, of those least recently received."""
        held = self._held
        while held and all(map(is_gone, next(iter(held.values())))):
            self._drop(held.popitem(last=False)[1])

    def clear(self) -> None:
        self.forget_first(lambda one: True)
        self._store.drop(self)

    def _drop(self, obstacles: Iterable[Obstacle]) -> None:
        """Drop obstacles that their ids no longer list."""
        for one in obstacles:
            super()._forget((one,))
            self._mark(one, None)
            self._count -= 1

    def _forget(self, obstacles: Iterable[Obstacle]) -> None:
        gone = {*obstacles}
        for instance in {one.key for one in gone}:
            held = [one for one in self._held[instance] if one not in gone]
            if held:
                self._held[instance] = held
            else:
                del self._held[instance]
        self._drop(gone)

    def _mark(self, obstacle: Obstacle, refusal: str | None) -> None:
        """Set why an obstacle is refused, None if it is not."""
        before, obstacle.refused = obstacle.refused, refusal
        if before:
            self._refused[before] -= 1
            if not self._refused[before]:
                del self._refused[before]
        if refusal:
            self._refused[refusal] += 1

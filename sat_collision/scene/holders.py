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

"""Where a source holds its obstacles: those with a key of their own, and those of a set."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import chain

import numpy as np
from sat_collision.geometry.layout import FINGERPRINT
from sat_collision.geometry.polygon import PackedBody, size_of
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines, NEVER
from sat_collision.scene.obstacles import Key, Obstacle

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'

# Keys of what is held beside obstacles: a refused message that has no place of its own, and
# whatever came when there was no room.
_UNPLACED = 'unplaced'
_EXCESS = 'excess'


class Holder:
    """
    What holders have in common. A refused message takes the place of its obstacle.

    Parameters
    ----------
    source : str
    contacts : Contacts
    deadlines : Deadlines
        Calls for `expire` of the obstacles.
    count_refusals : callable
        Takes a reason, and by how many more obstacles are refused for it.

    Attributes
    ----------
    timeout : int or float
        Age in ns past which an obstacle is forgotten, or NEVER.
    most : int
        How many obstacles there is room for.

    """

    def __init__(self, source: str, contacts: Contacts, deadlines: Deadlines,
                 count_refusals: Callable[[str, int], None]) -> None:
        self._source = source
        self._contacts = contacts
        self._deadlines = deadlines
        self._count_refusals = count_refusals
        self.timeout: float = NEVER
        self.most = 0

    def _put(self, obstacle: Obstacle, body: PackedBody, frame_id: str, time: float) -> None:
        """Put an obstacle where a message says."""
        obstacle.frame_id = frame_id
        if self._contacts.place_obstacle(obstacle, body) or time > obstacle.time:
            if obstacle.refused:
                self._mark(obstacle, None)
            obstacle.time = time
            if time + self.timeout < obstacle.watched:
                self._deadlines.watch(obstacle)

    def _refuse(self, obstacle: Obstacle, time: float, reason: str) -> None:
        """Let an obstacle stand for a message that was refused."""
        obstacle.time = max(obstacle.time, time)
        self._deadlines.watch(obstacle)
        self._contacts.remove_obstacle(obstacle)
        self._mark(obstacle, reason)

    def _mark(self, obstacle: Obstacle, reason: str | None) -> None:
        """Change why an obstacle is refused: None if it is not any more."""
        before, obstacle.refused = obstacle.refused, reason
        if before != reason:
            if before:
                self._count_refusals(before, -1)
            if reason:
                self._count_refusals(reason, 1)

    def _remove(self, obstacle: Obstacle) -> None:
        self._contacts.remove_obstacle(obstacle)
        self._mark(obstacle, None)


class KeyedObstacles(Holder):
    """Obstacles that are known by their id, or by their shape."""

    def __init__(self, source: str, contacts: Contacts, deadlines: Deadlines,
                 count_refusals: Callable[[str, int], None]) -> None:
        super().__init__(source, contacts, deadlines, count_refusals)
        self._held: dict[Key, Obstacle] = {}
        self._shapes_seen = 0

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all, those that stand for what was refused included."""
        return iter(self._held.values())

    def __contains__(self, key: Key | None) -> bool:
        """Tell whether an obstacle of this key is held; None for a message without one."""
        return (_UNPLACED if key is None else key) in self._held

    def place(self, key: Key, body: PackedBody, frame_id: str, time: int) -> str | None:
        """Take a body; return a refusal or None."""
        key = self._admit(key)
        obstacle = self._held.get(key) or self._new(key, time)
        if key == _EXCESS:
            self._refuse(obstacle, time, TOO_MANY)
            return TOO_MANY
        self._put(obstacle, body, frame_id, time)
        return None

    def refuse(self, key: Key | None, time: float, reason: str) -> str:
        """Take a message that is refused, without a key if None; return the reason that counts."""
        key = _UNPLACED if key is None else self._admit(key)
        if key == _EXCESS:
            reason = TOO_MANY
        self._refuse(self._held.get(key) or self._new(key, time), time, reason)
        return reason

    def refuse_other_frames(self, frame_id: str) -> bool:
        """Refuse all in other frames than this; tell whether any has lost its key by it."""
        others = [one for one in self if one.row is not None and one.frame_id != frame_id]
        for obstacle in others:
            if isinstance(obstacle.key, bytes):
                self.forget(obstacle)
                self.refuse(None, obstacle.time, OTHER_FRAME)
            else:
                self._refuse(obstacle, obstacle.time, OTHER_FRAME)
        return any(isinstance(obstacle.key, bytes) for obstacle in others)

    def forget_unplaced(self) -> None:
        """Drop what stands for a message without a key: all that is there was told anew."""
        if None in self:
            self.forget(self._held[_UNPLACED])

    def forget(self, obstacle: Obstacle) -> None:
        """Drop an obstacle."""
        del self._held[obstacle.key]
        obstacle.watched = NEVER
        self._remove(obstacle)

    def clear(self) -> None:
        """Drop all."""
        for obstacle in list(self):
            self.forget(obstacle)

    def _admit(self, key: Key) -> Key:
        """Return the key, or _EXCESS if there is no room for another one."""
        held = self._held
        room = self.most + (_EXCESS in held) + (_UNPLACED in held)
        return key if key in held or len(held) < room else _EXCESS

    def _new(self, key: Key, time: float) -> Obstacle:
        number = key if isinstance(key, int) else 0
        if isinstance(key, bytes):
            self._shapes_seen += 1
            number = -self._shapes_seen
        obstacle = self._held[key] = Obstacle(self, self._source, key, number, time)
        return obstacle


class SetOfObstacles(Holder):
    """
    The obstacles of one set after another: the k-th message is the k-th obstacle.

    A set that is cleared is hidden; the next one takes its rows.
    """

    def __init__(self, source: str, contacts: Contacts, deadlines: Deadlines,
                 count_refusals: Callable[[str, int], None]) -> None:
        super().__init__(source, contacts, deadlines, count_refusals)
        self._places: list[Obstacle] = []
        self._taken = 0
        self._place_of: dict[float, int] = {}

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all, those that stand for what was refused included."""
        return (one for one in self._places[:self._taken] if one.row is not None or one.refused)

    def place(self, body: PackedBody, frame_id: str, time: int) -> str | None:
        """Take a body, one that is there already for the same; return a refusal or None."""
        fingerprint = body[0][FINGERPRINT]
        place = self._place_of.get(fingerprint)
        if place is None or not self._is_at(place, body):
            place = self._taken
            if place >= self.most:
                return self.refuse(time, TOO_MANY)
            self._place_of[fingerprint] = place
            obstacle = self._take_place(time)
        else:
            obstacle = self._places[place]
        self._put(obstacle, body, frame_id, time)
        return None

    def refuse(self, time: float, reason: str) -> str:
        """Take a message that is refused; return the reason."""
        if self._taken > self.most:
            # All that is too much shares a place.
            self._taken = self.most
        self._refuse(self._take_place(time), time, reason)
        return reason

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse all in other frames than this."""
        for obstacle in self:
            if obstacle.row is not None and obstacle.frame_id != frame_id:
                self._refuse(obstacle, obstacle.time, OTHER_FRAME)

    def forget(self, obstacle: Obstacle) -> None:
        """Drop an obstacle; its place stays."""
        self._remove(obstacle)

    def clear(self) -> None:
        """Hide all."""
        places, taken = self._places, self._taken
        for obstacle in places[taken:]:
            obstacle.watched = NEVER
            self._remove(obstacle)
        del places[taken:]
        for obstacle in places:
            if obstacle.refused:
                self._mark(obstacle, None)
        self._contacts.hide_obstacles(
            self, [one.row for one in places if one.row is not None])
        self._taken = 0
        self._place_of = {}

    def _is_at(self, place: int, body: PackedBody) -> bool:
        """Tell whether a place has this very body, or is empty by now."""
        obstacle = self._places[place]
        return obstacle.row is None or self._contacts.is_at(obstacle, body)

    def _take_place(self, time: float) -> Obstacle:
        """Return the obstacle at the next place."""
        place = self._taken
        self._taken = place + 1
        if place == len(self._places):
            self._places.append(Obstacle(self, self._source, place, place, time))
        obstacle = self._places[place]
        obstacle.time = time
        return obstacle


class Holdings:
    """All that a source holds: obstacles with a key of their own, and two sets, by sides."""

    def __init__(self, source: str, contacts: Contacts, deadlines: Deadlines,
                 count_refusals: Callable[[str, int], None]) -> None:
        shared = source, contacts, deadlines, count_refusals
        self.keyed = KeyedObstacles(*shared)
        self.sides = SetOfObstacles(*shared), SetOfObstacles(*shared)
        self._deadlines = deadlines

    def __iter__(self) -> Iterator[Obstacle]:
        """Go through all, those that stand for what was refused included."""
        return chain(self.keyed, *self.sides)

    def configure(self, timeout: float, most: int) -> None:
        """Apply another timeout (ns) and another room for obstacles, of all sorts each."""
        for holder in (self.keyed, *self.sides):
            holder.timeout = timeout
            holder.most = most
        for obstacle in self:
            self._deadlines.watch(obstacle)

    def refuse_other_frames(self, frame_id: str) -> bool:
        """Refuse all in other frames than this; tell whether any has lost its key by it."""
        for side in self.sides:
            side.refuse_other_frames(frame_id)
        return self.keyed.refuse_other_frames(frame_id)

    def clear(self) -> None:
        """Drop all."""
        for holder in (self.keyed, *self.sides):
            holder.clear()


def shape_of(body: PackedBody) -> bytes:
    """Return what is the same for equal bodies, and for no others."""
    return np.asarray(body[0])[:size_of(body)].tobytes()

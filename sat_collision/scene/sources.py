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

"""Sources of obstacles: what each has told, and for how long."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np
from sat_collision.geometry.layout import FINGERPRINT
from sat_collision.geometry.polygon import PackedBody, size_of
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Alarm, Deadlines, NEVER
from sat_collision.scene.doubts import Doubts
from sat_collision.scene.obstacle_sets import ObstacleSets
from sat_collision.scene.obstacles import Key, Obstacle, ObstacleId
from sat_collision.scene.settings import ObstacleSettings, POLYGON_INSTANCE

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'
TOO_OLD = 'too old'

_UNPLACED = 'unplaced'
_EXCESS = 'excess'


class Source:
    """
    What one topic has told about obstacles.

    A polygon with a stamp is an obstacle of a set, see `ObstacleSets`. Polygons with stamp 0, and
    all those of a source that accumulates, are known by their shape; instances by their id.

    The source is known once a set of it is whole, or no new shape has come for as long as that
    takes; one with ids, and one that accumulates, from its first message on.

    A refused message takes the place of the obstacle that it would have been. While the source
    holds one, it is at fault: there may be an obstacle where nobody looks. So it is after a loss,
    until a set has come whole or, without sets, for the timeout: by then all that is there has
    been told anew.

    Times are in ns. A message counts from its stamp, from now if that is 0 or in the future. One
    that is past its timeout when it comes is refused as TOO_OLD and changes nothing: it could
    only push out obstacles that are known better.

    Parameters
    ----------
    settings : ObstacleSettings
    contacts : Contacts
        Where obstacles are placed.
    deadlines : Deadlines
        Calls for `expire` of the source and of its obstacles.

    Attributes
    ----------
    faults : tuple of str
        Why the source cannot be trusted, in words; empty if it can. The same object as long as
        nothing about it changes.
    timeout : int or float
        NEVER if nothing times out.

    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts,
                 deadlines: Deadlines) -> None:
        self._contacts = contacts
        self._deadlines = deadlines
        self._keyed: dict[Key, Obstacle] = {}
        self._sides: tuple[dict[Key, Obstacle], dict[Key, Obstacle]] = {}, {}
        self._retired: dict[Key, Obstacle] = {}
        self.faults: tuple[str, ...] = ()
        self.watched: float = NEVER
        self._sets = ObstacleSets()
        self._doubts = Doubts()
        self._shapes_seen = 0
        self._pause = Alarm(self._end_pause)
        self._cure = Alarm(self._get_over_loss)
        self._clear()
        self.configure(settings, now=0)

    def _clear(self) -> None:
        for obstacle in list(self.obstacles):
            self.forget(obstacle)
        for obstacle in self._retired.values():
            self._contacts.remove_obstacle(obstacle)
        self._retired = {}
        publishers = self._doubts.publishers
        self._doubts = Doubts(publishers=publishers)
        self._heard: int | None = None
        self._lost_in: float = NEVER
        self._cut_in = 0
        self._are_waiting = False
        self._pause_is_over = False
        self._pause.deadline = self._cure.deadline = NEVER
        self._sets.clear()

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        """Apply settings; a disabled source forgets all that it was told."""
        self.settings = settings
        self.timeout = round(settings.timeout * 1e9) if settings.timeout > 0.0 else NEVER
        self._sets.window = round(settings.set_window * 1e9)
        self._sets.timeout = self.timeout
        self._sets.most = settings.max_count
        self._quiet = round(settings.set_quiet * 1e9)
        self._by_id = settings.type == POLYGON_INSTANCE
        self._in_sets = not self._by_id and not settings.accumulate
        if not settings.enabled:
            self._clear()
        elif not self._in_sets:
            self._doubts.is_known = True
        if self._doubts.is_silent and now <= self.deadline:
            # What it held is forgotten: a longer timeout does not bring that back.
            self._heard = None
            self._doubts.is_heard = False
        if self.deadline < now:
            self.expire()
        self._deadlines.watch(self)
        for obstacle in self.obstacles:
            self._deadlines.watch(obstacle)
        self._find_faults()

    @property
    def obstacles(self) -> Iterator[Obstacle]:
        """Every Obstacle, those that stand for what was refused included."""
        return chain(self._keyed.values(), *(side.values() for side in self._sides))

    def named(self, name: ObstacleId) -> list[Obstacle]:
        """Return the obstacles of a name that are somewhere: two sets may have one each."""
        found = [held.get(name.key) for held in (self._keyed, *self._sides)]
        return [one for one in found if one and one.row is not None and one.name == name] or [
            one for one in self._keyed.values() if one.name == name and one.row is not None]

    @property
    def deadline(self) -> float:
        """Time in ns after which the source is silent, unless it is heard again."""
        return NEVER if self._heard is None else self._heard + self.timeout

    def expire(self) -> None:
        """Note that the source is silent, now that its deadline is past."""
        self._doubts.is_silent = True
        self._begin_anew()
        self._find_faults()

    def _begin_anew(self) -> None:
        """Trust the source from the first set on that begins after this and is whole."""
        self._finish_set()
        self._sets.clear()
        self._pause.deadline = NEVER
        self._doubts.is_known = False

    def lose(self, now: int) -> None:
        """Take note that messages were lost before the one that comes next."""
        self._doubts.is_lossy = True
        # Those lost may be of the set that the next message belongs to, or may begin.
        self._lost_in = NEVER
        self._cure.deadline = now + self.timeout
        self._deadlines.watch(self._cure)
        self._find_faults()

    def count_publishers(self, count: int) -> None:
        """Take note of how many publishers there are; without any, nothing is known any more."""
        doubts = self._doubts
        if count != doubts.publishers:
            doubts.is_left = count == 0 and (bool(doubts.publishers) or doubts.is_heard)
            doubts.publishers = count
            if doubts.is_left:
                self._heard = None
                doubts.is_heard = False
                self._begin_anew()
            self._find_faults()

    def fall_behind(self, waiting: bool, overwhelmed: bool) -> None:
        """Take note of whether messages wait, so that a pause may be none, and of too many."""
        self._are_waiting = waiting
        if not waiting and self._pause_is_over:
            self._end_pause()
        if overwhelmed != self._doubts.is_behind:
            self._doubts.is_behind = overwhelmed
            self._find_faults()

    def heartbeat(self, stamp: int, now: int) -> str | None:
        """Take the message that the publisher lives and saw nothing; return a refusal or None."""
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._in_sets:
            if stamp:
                self._join_set(stamp, now)
                if self._sets.includes(stamp):
                    self._finish_set()
            else:
                self._await_pause(now)
        return None

    def place(self, body: PackedBody, frame_id: str, stamp: int, now: int,
              instance: int | None) -> str | None:
        """Take a body; return a refusal or None."""
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        key: Key
        if self._in_sets and stamp:
            self._join_set(stamp, now)
            held = self._sides[self._sets.side]
            key = self._place_of(body)
            full = key >= self.settings.max_count
        else:
            held = self._keyed
            if _UNPLACED in held:
                self.forget(held[_UNPLACED])
            key = _shape(body) if instance is None or not self._by_id else instance
            if self._in_sets and key not in held:
                self._await_pause(now)
            key = self._admit(key)
            full = key == _EXCESS
        if full:
            self._refuse(held, key, time, TOO_MANY)
            return TOO_MANY
        obstacle = held.get(key) or self._new_obstacle(held, key, time)
        obstacle.frame_id = frame_id
        if self._contacts.place_obstacle(obstacle, body) or time > obstacle.time:
            if obstacle.refused:
                self._count_refusal(obstacle, None)
            obstacle.time = time
            if time + self.timeout < obstacle.watched:
                self._deadlines.watch(obstacle)
        return None

    def refuse(self, reason: str, stamp: int | None, now: int, instance: int | None) -> str:
        """
        Take a message without a usable polygon; return the reason that counts.

        `stamp` and `instance` are None where they could not be read. A message of a set that is
        not known counts until a set has come whole, as one that was lost.
        """
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        held = self._keyed
        key: Key = _UNPLACED
        if self._in_sets:
            if stamp:
                self._join_set(stamp, now)
                held = self._sides[self._sets.side]
                key = self._sets.next_place()
            else:
                self._lost_in = NEVER
                self._await_pause(now)
        elif self._by_id and instance is not None:
            key = self._admit(instance)
        if key == _EXCESS:
            reason = TOO_MANY
        self._refuse(held, key, time, reason)
        return reason

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse the obstacles in another frame than this, which was not known when they came."""
        for obstacle in list(self.obstacles):
            if obstacle.refused is None and obstacle.frame_id != frame_id:
                if isinstance(obstacle.key, bytes):
                    self.forget(obstacle)
                    self._refuse(self._keyed, _UNPLACED, obstacle.time, OTHER_FRAME)
                else:
                    self._refuse(obstacle.held, obstacle.key, obstacle.time, OTHER_FRAME)

    def forget(self, obstacle: Obstacle) -> None:
        """Drop an obstacle."""
        del obstacle.held[obstacle.key]
        obstacle.watched = NEVER
        self._contacts.remove_obstacle(obstacle)
        if obstacle.refused:
            self._count_refusal(obstacle, None)

    def _hear(self, stamp: int | None, now: int) -> int | None:
        """Note a sign of life; return the time it counts from, None if that is too long ago."""
        time = stamp if stamp and stamp < now else now
        if time + self.timeout < now:
            return None
        if self._heard is None or time > self._heard:
            first = self._heard is None
            self._heard = time
            if first or self._doubts.is_silent:
                self._doubts.is_heard = True
                self._doubts.is_silent = False
                self._doubts.is_known = not self._in_sets
                self._deadlines.watch(self)
                self._find_faults()
        return time

    def _join_set(self, stamp: int, now: int) -> None:
        """Let a message join the set that comes in, or begin the next one."""
        sets = self._sets
        if not sets.continues(stamp):
            self._finish_set()
            sets.begin(stamp)
            if sets.is_cut:
                self._cut_in = sets.number
                self._doubts.is_cut = True
                self._find_faults()
        if self._lost_in == NEVER:
            self._lost_in = sets.number
        self._await_pause(now)

    def _await_pause(self, now: int) -> None:
        """Have the set be whole if nothing more comes for a while."""
        self._pause_is_over = False
        self._pause.deadline = now + self._quiet
        if self._pause.deadline < self._pause.watched:
            self._deadlines.watch(self._pause)

    def _end_pause(self) -> None:
        """Take the set that came in last for whole, now that nothing more of it comes."""
        self._pause_is_over = bool(self._are_waiting)
        if self._pause_is_over:
            return
        self._finish_set()
        if not self._doubts.is_known:
            self._doubts.is_known = True
            self._find_faults()

    def _finish_set(self) -> None:
        """Take the set that came in last for whole: what the one before held is forgotten."""
        sets = self._sets
        if sets.is_whole:
            return
        sets.is_whole = True
        self._retire(self._sides[1 - sets.side])
        doubts = self._doubts
        if self._lost_in < sets.number:
            self._get_over_loss()
        if not doubts.is_known or doubts.is_cut:
            doubts.is_known = True
            doubts.is_cut = self._cut_in == sets.number
            self._find_faults()

    def _retire(self, held: dict[Key, Obstacle]) -> None:
        """Drop all obstacles of a set; those of the one after the next take their rows."""
        for obstacle in [one for one in held.values() if one.refused]:
            self.forget(obstacle)
        for place, obstacle in self._retired.items():
            if place in held:
                self._contacts.remove_obstacle(obstacle)
        for obstacle in held.values():
            obstacle.time = NEVER
        self._contacts.hide_obstacles(held.values())
        self._retired.update(held)
        held.clear()

    def _get_over_loss(self) -> None:
        """Trust the source again after messages were lost, or came without a stamp."""
        if self._doubts.is_lossy:
            self._doubts.is_lossy = False
            self._find_faults()
        if self._in_sets and _UNPLACED in self._keyed:
            self.forget(self._keyed[_UNPLACED])

    def _place_of(self, body: PackedBody) -> int:
        """Return the place in the set of an equal body, be it forgotten, else the next one."""
        fingerprint = body[0][FINGERPRINT]
        place = self._sets.place_of_equal(fingerprint)
        if place is not None:
            obstacle = self._sides[self._sets.side].get(place)
            if obstacle is None or obstacle.refused or self._contacts.is_at(obstacle, body):
                return place
        return self._sets.next_place(fingerprint)

    def _admit(self, key: Key) -> Key:
        """Return the key of an id or shape, or _EXCESS if there is no room for another one."""
        held = self._keyed
        room = self.settings.max_count + (_EXCESS in held) + (_UNPLACED in held)
        return key if key in held or len(held) < room else _EXCESS

    def _new_obstacle(self, held: dict[Key, Obstacle], key: Key, time: float) -> Obstacle:
        if held is not self._keyed and key in self._retired:
            obstacle = held[key] = self._retired.pop(key)
            obstacle.held = held
            obstacle.time = time
            return obstacle
        number = key if isinstance(key, int) else 0
        if isinstance(key, bytes):
            self._shapes_seen += 1
            number = -self._shapes_seen
        obstacle = held[key] = Obstacle(self, held, key, number, time)
        return obstacle

    def _refuse(self, held: dict[Key, Obstacle], key: Key, time: float, reason: str) -> None:
        """Put a refused message in the place of what was there."""
        obstacle = held.get(key) or self._new_obstacle(held, key, time)
        obstacle.time = max(obstacle.time, time)
        self._deadlines.watch(obstacle)
        self._contacts.remove_obstacle(obstacle)
        if obstacle.refused != reason:
            self._count_refusal(obstacle, reason)

    def _count_refusal(self, obstacle: Obstacle, reason: str | None) -> None:
        """Change why an obstacle is refused: None if it is not any more."""
        if obstacle.refused:
            self._doubts.refusals[obstacle.refused] -= 1
        if reason:
            self._doubts.refusals[reason] += 1
        obstacle.refused = reason
        self._find_faults()

    def _find_faults(self) -> None:
        """Put into words what is wrong with the source."""
        faults = self._doubts.in_words(self.settings, self._in_sets)
        if faults != self.faults:
            self.faults = faults


def _shape(body: PackedBody) -> bytes:
    """Return what is the same for equal bodies, and for no others."""
    return np.asarray(body[0])[:size_of(body)].tobytes()

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

"""Sources of obstacles: what each has told, for how long, and whether it can be trusted."""

from __future__ import annotations

from collections import Counter

import numpy as np
from sat_collision.geometry.layout import FINGERPRINT
from sat_collision.geometry.polygon import PackedBody, size_of
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines, NEVER
from sat_collision.scene.obstacle_sets import ObstacleSets
from sat_collision.scene.obstacles import Key, Obstacle
from sat_collision.scene.settings import ObstacleSettings, POLYGON_INSTANCE

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'
TOO_OLD = 'too old'

# Keys of what a source holds beside its obstacles: a refused message that has no place of its
# own, and whatever came when the source was full.
_UNPLACED = 'unplaced'
_EXCESS = 'excess'


class Source:
    """
    What one topic has told about obstacles.

    A polygon with a stamp is an obstacle of a set, see `ObstacleSets`. Polygons with stamp 0, and
    all those of a source that accumulates, are known by their shape; instances by their id.

    A refused message takes the place of the obstacle that it would have been. While the source
    holds one, it is at fault: there may be an obstacle where nobody looks.

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
    obstacles : dict
        Every Obstacle by its key: place in the set, id or shape.
    timeout : int or float
        NEVER if nothing times out.

    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts,
                 deadlines: Deadlines) -> None:
        self._contacts = contacts
        self._deadlines = deadlines
        self.obstacles: dict[Key, Obstacle] = {}
        self.faults: tuple[str, ...] = ()
        self.watched: float = NEVER
        self._sets = ObstacleSets()
        self._refusals: Counter[str] = Counter()
        self._shapes_seen = 0
        self._pause = _Pause(self)
        self._clear()
        self.configure(settings, now=0)

    def _clear(self) -> None:
        for obstacle in list(self.obstacles.values()):
            self.forget(obstacle)
        self._heard: int | None = None
        self._silent = False
        self._is_behind = False
        self._is_known = False
        self._lost = 0
        self._lost_in = 0
        self._cut_in = 0
        self._publishers: int | None = None
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
        self._silent = self.deadline < now
        self._deadlines.watch(self)
        for obstacle in self.obstacles.values():
            self._deadlines.watch(obstacle)
        self._find_faults()

    @property
    def deadline(self) -> float:
        """Time in ns after which the source is silent, unless it is heard again."""
        return NEVER if self._heard is None else self._heard + self.timeout

    def expire(self) -> None:
        """Note that the source is silent, now that its deadline is past."""
        self._silent = True
        self._is_known = False
        self._find_faults()

    def end_pause(self) -> None:
        """Take the set that came in last for whole, now that nothing more of it comes."""
        self._is_known = True
        self._finish_set()
        self._find_faults()

    def lose(self, count: int) -> None:
        """Take note that messages were lost before the one that comes next."""
        self._lost += count
        # Those lost may be of the set that the next message belongs to, or may begin.
        self._lost_in = NEVER
        self._find_faults()

    def count_publishers(self, count: int) -> bool:
        """Take note of how many publishers there are; tell if that changes what is at fault."""
        before = self.faults
        self._publishers = count
        if count == 0 and self._heard is not None:
            self._is_known = False
        self._find_faults()
        return self.faults is not before

    def fall_behind(self, seconds: float) -> bool:
        """Take note of how old messages are before they are taken; tell if that is news."""
        is_behind = seconds > self.settings.timeout > 0.0
        changed = is_behind != self._is_behind
        self._is_behind = is_behind
        if changed:
            self._find_faults()
        return changed

    def heartbeat(self, stamp: int, now: int) -> str | None:
        """Take the message that the publisher lives and saw nothing; return a refusal or None."""
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._in_sets and stamp:
            self._join_set(stamp, now)
            self._finish_set()
        return None

    def place(self, body: PackedBody, frame_id: str, stamp: int, now: int,
              instance: int | None) -> str | None:
        """Take a body; return a refusal or None."""
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        obstacles = self.obstacles
        if _UNPLACED in obstacles:
            self.forget(obstacles[_UNPLACED])
        key: Key
        if self._in_sets and stamp:
            self._join_set(stamp, now)
            place = self._place_of(body)
            full = place >= self.settings.max_count
            key = self._sets.side, place
        else:
            self._await_pause(now)
            key = _shape(body) if instance is None or not self._by_id else instance
            key = self._admit(key)
            full = key == _EXCESS
        if full:
            self._refuse(key, time, TOO_MANY)
            return TOO_MANY
        obstacle = obstacles.get(key) or self._new_obstacle(key, time)
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

        `stamp` and `instance` are None where they could not be read.
        """
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        key: Key = _UNPLACED
        if self._in_sets and stamp != 0:
            if stamp is not None:
                self._join_set(stamp, now)
            if self._sets.start is not None:
                key = self._sets.side, self._sets.next_place()
        elif self._by_id and instance is not None:
            key = self._admit(instance)
        if key == _EXCESS:
            reason = TOO_MANY
        self._refuse(key, time, reason)
        return reason

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse the obstacles in another frame than this, which was not known when they came."""
        for obstacle in list(self.obstacles.values()):
            if obstacle.refused is None and obstacle.frame_id != frame_id:
                if isinstance(obstacle.key, bytes):
                    self.forget(obstacle)
                    self._refuse(_UNPLACED, obstacle.time, OTHER_FRAME)
                else:
                    self._refuse(obstacle.key, obstacle.time, OTHER_FRAME)

    def forget(self, obstacle: Obstacle) -> None:
        """Drop an obstacle."""
        del self.obstacles[obstacle.key]
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
            if first or self._silent:
                self._silent = False
                self._is_known = not self._in_sets
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
                self._find_faults()
        if self._lost_in == NEVER:
            self._lost_in = sets.number
        self._await_pause(now)

    def _await_pause(self, now: int) -> None:
        """Have `end_pause` called if nothing more comes for a while."""
        self._pause.deadline = now + self._quiet
        if self._pause.deadline < self._pause.watched:
            self._deadlines.watch(self._pause)

    def _finish_set(self) -> None:
        """Take the set that came in last for whole: what the one before held is forgotten."""
        sets = self._sets
        if sets.is_whole:
            return
        sets.is_whole = True
        last = 1 - sets.side
        for key in [key for key in self.obstacles if isinstance(key, tuple) and key[0] == last]:
            self.forget(self.obstacles[key])
        if not self._is_known or self._lost or self._cut_in:
            self._is_known = True
            if self._lost_in < sets.number:
                self._lost = 0
            if self._cut_in < sets.number:
                self._cut_in = 0
            self._find_faults()

    def _place_of(self, body: PackedBody) -> int:
        """Return the place in the set of an equal body, be it forgotten, else the next one."""
        fingerprint = body[0][FINGERPRINT]
        place = self._sets.place_of_equal(fingerprint)
        if place is not None:
            obstacle = self.obstacles.get((self._sets.side, place))
            if obstacle is None or obstacle.refused or self._contacts.is_at(obstacle, body):
                return place
        return self._sets.next_place(fingerprint)

    def _admit(self, key: Key) -> Key:
        """Return the key of an id or shape, or _EXCESS if there is no room for another one."""
        obstacles = self.obstacles
        room = self.settings.max_count + (_EXCESS in obstacles) + (_UNPLACED in obstacles)
        return key if key in obstacles or len(obstacles) < room else _EXCESS

    def _new_obstacle(self, key: Key, time: int) -> Obstacle:
        number = key[1] if isinstance(key, tuple) else key if isinstance(key, int) else 0
        if isinstance(key, bytes):
            self._shapes_seen += 1
            number = -self._shapes_seen
        obstacle = self.obstacles[key] = Obstacle(self, key, number, time)
        return obstacle

    def _refuse(self, key: Key, time: int, reason: str) -> None:
        """Put a refused message in the place of what was there."""
        obstacle = self.obstacles.get(key) or self._new_obstacle(key, time)
        obstacle.time = max(obstacle.time, time)
        self._deadlines.watch(obstacle)
        self._contacts.remove_obstacle(obstacle)
        if obstacle.refused != reason:
            self._count_refusal(obstacle, reason)

    def _count_refusal(self, obstacle: Obstacle, reason: str | None) -> None:
        """Change why an obstacle is refused: None if it is not any more."""
        if obstacle.refused:
            self._refusals[obstacle.refused] -= 1
        if reason:
            self._refusals[reason] += 1
        obstacle.refused = reason
        self._find_faults()

    def _find_faults(self) -> None:
        """Put into words what is wrong with the source."""
        faults = []
        if self._publishers == 0 and self._heard is not None:
            faults.append('has no publisher any more')
        elif self._heard is None:
            faults.append('has not been heard yet')
        elif self._silent:
            faults.append(
                f'has been silent for longer than its timeout of {self.settings.timeout:g} s')
        elif not self._is_known:
            faults.append('has not sent a whole set yet')
        if self._in_sets and (self._publishers or 0) > 1:
            faults.append(f'has {self._publishers} publishers, whose sets cannot be told apart: '
                          'give each a topic and a name of its own, use ids, or set accumulate')
        if self._lost:
            faults.append('lost messages on the way, and has not sent a whole set since: raise '
                          'the depth of the subscription or publish less at once')
        if self._cut_in:
            faults.append('sends sets that set_window cuts in two: set it to more than a set '
                          'takes or to 0 with one stamp per set, use ids, or set accumulate')
        if self._is_behind:
            faults.append('sends more than can be checked: what it sent is older than its timeout '
                          f'of {self.settings.timeout:g} s before it is looked at')
        faults += [f'sent what was refused: {reason}' for reason in sorted(+self._refusals)]
        name, topic = self.settings.name, self.settings.topic
        worded = tuple(f'obstacle source {name} on {topic} {fault}' for fault in faults
                       if self.settings.enabled)
        if worded != self.faults:
            self.faults = worded


def _shape(body: PackedBody) -> bytes:
    """Return what is the same for equal bodies, and for no others."""
    return np.asarray(body[0])[:size_of(body)].tobytes()


class _Pause:
    """The pause that ends a set: it is over when its deadline passes without being put off."""

    def __init__(self, source: Source) -> None:
        self.deadline: float = NEVER
        self.watched: float = NEVER
        self._source = source

    def expire(self) -> None:
        """Tell the source."""
        self._source.end_pause()

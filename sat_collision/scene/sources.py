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

"""Obstacles as their publishers send them: which message is which obstacle, and for how long."""

from collections import Counter

import numpy as np
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.packing import fingerprint
from sat_collision.scene.deadlines import NEVER
from sat_collision.scene.express import move_obstacle, NOT_ORDINARY
from sat_collision.scene.obstacles import Body
from sat_collision.scene.settings import POLYGON_INSTANCE

OTHER_FRAME = 'other frame'
TOO_MANY = 'too many obstacles'
TOO_OLD = 'too old'

# Keys of what a source holds beside its obstacles: a refused message that has no place of its
# own, and whatever came when the source was full.
_UNPLACED = 'unplaced'
_EXCESS = 'excess'
_FEWEST_PLACES = 16


class Source:
    """
    What one topic has told about obstacles.

    A polygon with a stamp is the k-th obstacle of a set: of messages whose stamps lie within
    `set_window` of the set's first. It replaces the k-th of the set before; what a set leaves
    over stays until the next one begins. So nothing blinks to empty while a set comes in, and
    the error is a ghost for one set. Polygons with stamp 0, and all those of a source that
    accumulates, are known by their shape; instances by their id.

    A refused message takes the place of the obstacle that it would have been. While the source
    holds one, it is in trouble: there may be an obstacle where nobody looks.

    Times are in ns. A message counts from its stamp, from now if that is 0 or in the future. One
    that is past its timeout when it comes is refused as TOO_OLD and changes nothing: it could
    only push out obstacles that are known better.

    Parameters
    ----------
    settings : ObstacleSettings
    contacts : Contacts
        Where obstacles are placed.
    deadlines : Deadlines
        Calls for `expire` of the source and of its bodies.

    Attributes
    ----------
    reasons : tuple of str
        Why the source cannot be trusted, in words; empty if it can. The same object as long as
        nothing about it changes.
    bodies : dict
        Every Body by its key: place in the set, id or shape.

    """

    def __init__(self, settings, contacts, deadlines):
        self._contacts = contacts
        self._deadlines = deadlines
        self.bodies = {}
        self.reasons = ()
        self.watched = NEVER
        self._refusals = Counter()
        self._shapes_seen = 0
        self._clear()
        self.configure(settings, now=0)

    def _clear(self):
        for body in list(self.bodies.values()):
            self.forget(body)
        self._heard = None
        self._silent = False
        self._set_start = None
        self._prints = np.empty(_FEWEST_PLACES)
        self._count = 0
        self._places = 0

    def configure(self, settings, now):
        """Apply settings; a disabled source forgets all that it was told."""
        self.settings = settings
        self.timeout = round(settings.timeout * 1e9) if settings.timeout > 0.0 else NEVER
        self._set_window = round(settings.set_window * 1e9)
        self._by_id = settings.type == POLYGON_INSTANCE
        self._in_sets = not self._by_id and not settings.accumulate
        if not settings.enabled:
            self._clear()
        self._silent = self.deadline < now
        for thing in (self, *self.bodies.values()):
            self._deadlines.watch(thing)
        self._review()

    @property
    def deadline(self):
        """Time in ns after which the source is silent, unless it is heard again."""
        return NEVER if self._heard is None else self._heard + self.timeout

    def expire(self):
        """Note that the source is silent, now that its deadline is past."""
        self._silent = True
        self._review()

    def heartbeat(self, stamp, now):
        """Take the message that the publisher lives and saw nothing; return a refusal or None."""
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._in_sets and stamp:
            self._join_set(stamp)
        return None

    def place(self, polygon, frame_id, stamp, now, instance):
        """Take a polygon; return a refusal or None."""
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        bodies = self.bodies
        if _UNPLACED in bodies:
            self.forget(bodies[_UNPLACED])
        if self._in_sets and stamp:
            if stamp != self._set_start:
                self._join_set(stamp)
            key = self._place_of(polygon)
            full = key >= self.settings.max_count
        else:
            key = self._admit(instance if self._by_id else polygon.block[0].tobytes())
            full = key == _EXCESS
        if full:
            self._refuse(key, time, TOO_MANY)
            return TOO_MANY
        body = bodies.get(key) or self._new_body(key, time)
        body.frame_id = frame_id
        if self._contacts.is_at(body, polygon):
            body.time = max(body.time, time)
            return None
        if body.refused:
            self._count_refusal(body, None)
        body.time = time
        if time + self.timeout < body.watched:
            self._deadlines.watch(body)
        self._contacts.place_obstacle(body, polygon)
        return None

    def express(self, data, now, frame, most):
        """
        Take a message if it is an ordinary one, see `express`; return whether it was.

        `frame` is the scene's frame_id with a NUL, in bytes, and `most` the most vertices.
        """
        place = self._count
        begins = place == self._places
        if begins:
            place = 0
        body = self.bodies.get(place)
        if (body is None or body.row is None or self.reasons or not self._in_sets
                or place >= len(self._prints) or place >= self.settings.max_count):
            return False
        time = move_obstacle(data, frame, most, now, body.time, self._set_start, self._set_window,
                             begins, self._prints, place, body.row,
                             *self._contacts.packed or self._contacts.pack())
        if time == NOT_ORDINARY:
            return False
        if begins:
            self._set_start = time
        self._count = place + 1
        body.time = time
        if time > self._heard:
            self._heard = time
        return True

    def refuse(self, reason, stamp, now, instance):
        """
        Take a message without a usable polygon; return the reason that counts.

        `stamp` and `instance` are None where they could not be read.
        """
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        if self._in_sets and stamp != 0:
            if stamp is not None:
                self._join_set(stamp)
            key = self._next_place()
        elif self._by_id and instance is not None:
            key = self._admit(instance)
        else:
            key = _UNPLACED
        if key == _EXCESS:
            reason = TOO_MANY
        self._refuse(key, time, reason)
        return reason

    def refuse_other_frames(self, frame_id):
        """Refuse the obstacles in another frame than this, which was not known when they came."""
        for body in list(self.bodies.values()):
            if body.refused is None and body.frame_id != frame_id:
                if isinstance(body.key, bytes):
                    self.forget(body)
                    self._refuse(_UNPLACED, body.time, OTHER_FRAME)
                else:
                    self._refuse(body.key, body.time, OTHER_FRAME)

    def forget(self, body):
        """Drop a body."""
        del self.bodies[body.key]
        body.watched = NEVER
        self._contacts.remove_obstacle(body)
        if body.refused:
            self._count_refusal(body, None)

    def _hear(self, stamp, now):
        """Note a sign of life; return the time it counts from, None if that is too long ago."""
        time = stamp if stamp and stamp < now else now
        if time + self.timeout < now:
            return None
        if self._heard is None or time > self._heard:
            first = self._heard is None
            self._heard = time
            if first or self._silent:
                self._silent = False
                self._deadlines.watch(self)
                self._review()
        return time

    def _join_set(self, stamp):
        """
        Begin a set if the stamp does not belong to the one that is coming in.

        A stamp before the set by less than the timeout is that of a late message, which joins it.
        One still earlier says that the publisher's clock was set back, as does any earlier one
        where nothing times out: a new set begins, or the old ones would stay for ever.
        """
        if self._set_start is not None:
            ahead = stamp - self._set_start
            late = self.settings.timeout > 0.0 and -self.timeout < ahead < 0
            if late or abs(ahead) <= self._set_window:
                return
        for place in range(self._count, self._places):
            body = self.bodies.get(place)
            if body is not None:
                self.forget(body)
        self._places = self._count
        self._count = 0
        self._set_start = stamp

    def _place_of(self, polygon):
        """Return the place in the set of an equal polygon, be it forgotten, else the next one."""
        block, _ = polygon.block
        own = fingerprint(indexable(block))
        for place in np.flatnonzero(self._prints[:self._count] == own).tolist():
            body = self.bodies.get(place)
            if body is None or body.row is None or self._contacts.is_at(body, polygon):
                return place
        return self._next_place(own)

    def _next_place(self, own=np.nan):
        """
        Return the next place in the set; when it is full, the one behind it.

        It is marked by the fingerprint of what takes it, if that has one.
        """
        place = self._count
        if place > self.settings.max_count:
            place = self.settings.max_count
        if place == len(self._prints):
            self._prints = np.concatenate([self._prints, np.empty_like(self._prints)])
        self._prints[place] = own
        self._count = place + 1
        if self._count > self._places:
            self._places = self._count
        return place

    def _admit(self, key):
        """Return the key of an id or shape, or _EXCESS if there is no room for another one."""
        bodies = self.bodies
        room = self.settings.max_count + (_EXCESS in bodies) + (_UNPLACED in bodies)
        return key if key in bodies or len(bodies) < room else _EXCESS

    def _new_body(self, key, time):
        number = key
        if isinstance(key, bytes):
            self._shapes_seen += 1
            number = -self._shapes_seen
        body = self.bodies[key] = Body(self, key, number, time)
        return body

    def _refuse(self, key, time, reason):
        """Put a refused message in the place of what was there."""
        body = self.bodies.get(key) or self._new_body(key, time)
        body.time = max(body.time, time)
        self._deadlines.watch(body)
        self._contacts.remove_obstacle(body)
        if body.refused != reason:
            self._count_refusal(body, reason)

    def _count_refusal(self, body, reason):
        """Change why a body is refused: None if it is not any more."""
        if body.refused:
            self._refusals[body.refused] -= 1
        if reason:
            self._refusals[reason] += 1
        body.refused = reason
        self._review()

    def _review(self):
        """Put into words what is wrong with the source."""
        troubles = []
        if self._heard is None:
            troubles.append('has not been heard yet')
        elif self._silent:
            troubles.append(
                f'has been silent for longer than its timeout of {self.settings.timeout:g} s')
        troubles += [f'sent what was refused: {reason}'
                     for reason in sorted(+self._refusals)]
        name, topic = self.settings.name, self.settings.topic
        reasons = tuple(f'obstacle source {name} on {topic} {trouble}' for trouble in troubles
                        if self.settings.enabled)
        if reasons != self.reasons:
            self.reasons = reasons

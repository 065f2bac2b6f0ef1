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
A source of obstacles as a model, see scene_model: which messages make sets, and what is held.

It keeps what it was told and recomputes the rest. Times are in ns.
"""

from typing import NamedTuple

from builders import SECOND
from sat_collision.scene.holders import TOO_MANY
from sat_collision.scene.settings import POLYGON_INSTANCE
from sat_collision.scene.sources import TOO_OLD

UNHEARD = 'has not been heard yet'

# Keys of what was refused and has no place of its own, and of what came to a full source.
_UNPLACED = 'unplaced'
_EXCESS = 'excess'


class Place(NamedTuple):
    """Where a body is and since when, or what is wrong with it."""

    ring: tuple | None = None
    time: int | None = None
    fault: str = UNHEARD
    stamp: int | None = None


class SourceModel:
    """
    One source of obstacles: what it holds, as of the last look.

    `sent` has every body of a set, those that never came included: which set, the ring and the
    time.
    """

    def __init__(self, settings, now, publishers=None):
        self.settings = settings
        self.publishers = publishers
        self.overwhelmed = False
        self.are_waiting = False
        self.sent = []
        self._was_left = False
        self._keyed = {}
        self._last, self._newest = {}, {}
        self._heard = None
        self._silent = False
        self._lost_at = None
        self._doubts_window = False
        self._set = 0
        self._turn = 0
        self._begin_anew()
        self._listens_since = None
        self.listen(now)

    def _begin_anew(self):
        """Count nothing that may have begun before now."""
        self._known = False
        self._whole = True
        self._is_cut = False
        self._set_start = None
        self._taken = 0
        self._place_of = {}
        self._miss()

    def _miss(self):
        self._before = None
        self._first_to_count = None

    def _settle(self):
        self._before = None
        self._first_to_count = self._turn + 1

    def listen(self, now):
        """Hear all that is sent from now on."""
        if self._has_sets and self.settings.enabled and self.publishers != 0:
            self._listens_since = now

    def look(self, now):
        """Let time pass."""
        settings = self.settings
        if not self._silent and self._heard is not None and is_past(settings, self._heard, now):
            self._silent = True
            self._drop_last()
            self._begin_anew()
            if self._listens_since is None:
                self._settle()
        if self._lost_at is not None and is_past(settings, self._lost_at, now):
            self._lost_at = None
        for held in (self._keyed, self._last, self._newest):
            for key in [key for key, place in held.items() if is_past(settings, place.time, now)]:
                del held[key]

    def advance(self, now):
        """Let time pass when all that was sent until now has been told."""
        since = self._listens_since
        quiet = nanoseconds(self.settings.set_quiet)
        if since is not None and since + quiet < now and self.are_waiting:
            self._listens_since = since + quiet
        elif since is not None and since + quiet < now:
            self._listens_since = None
            self._finish()
            self._settle()
        self.look(now)

    def held(self, now):
        """Return key and Place of all that is not past its timeout."""
        self.look(now)
        return [item for held in (self._keyed, self._last, self._newest) for item in held.items()]

    def last_whole_and_newer(self, now):
        """Return the rings of the last whole set and of all that was sent after it."""
        last = self._set - (not self._whole)
        return [ring for number, ring, time in self.sent
                if number >= last and not is_past(self.settings, time, now)]

    def doubts(self, now):
        """Return why the source cannot be trusted."""
        self.look(now)
        doubts = []
        if self._was_left:
            doubts.append('has no publisher any more')
        elif self._heard is None:
            doubts.append(UNHEARD)
        elif self._silent:
            doubts.append(
                f'has been silent for longer than its timeout of {self.settings.timeout:g} s')
        elif self._has_sets and not self._known:
            doubts.append('has not sent a whole set yet')
        if self._has_sets and (self.publishers or 0) > 1:
            doubts.append(f'has {self.publishers} publishers')
        if self._lost_at is not None:
            doubts.append('lost messages')
        if self._has_sets and self._doubts_window:
            doubts.append('sends sets that set_window cuts in two')
        if self.overwhelmed:
            doubts.append('sends more than can be checked')
        faults = {place.fault for _, place in self.held(now) if place.fault}
        return doubts + [f'sent what was refused: {fault}' for fault in sorted(faults)]

    def lose(self, now):
        """Take note that messages were lost before the next one."""
        self.look(now)
        self._lost_at = now
        self._miss()

    def miss_body(self, ring, now):
        """Take note of a body of the set that the last message is of, which never came."""
        self.sent.append((self._set, ring, now))

    def meet_publisher(self, from_beginning):
        if self._heard is not None and not (from_beginning and self._whole):
            self._drop_last()
            self._begin_anew()
        if from_beginning:
            self._settle()

    def count_publishers(self, count, now):
        before, self.publishers = self.publishers, count
        if count == before and (count or self._heard is None):
            return
        self._was_left = count == 0 and bool(before or self._heard is not None)
        if self._was_left:
            self._heard = None
            self._silent = False
        if self._was_left or (count == 1 and (before or 0) > 1):
            self._drop_last()
            self._begin_anew()
        if count == 0:
            self._listens_since = None
        elif count == 1:
            self.listen(now)

    def heartbeat(self, stamp, now):
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._has_sets:
            self._follow(stamp, now)
            if stamp and abs(self._set_start - stamp) <= nanoseconds(self.settings.set_window):
                self._finish()
        return None

    def place(self, ring, stamp, now, instance):
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        if self._in_sets(stamp):
            self._follow(stamp, now)
            key = self._next_in_set(ring)
            held = self._newest
            full = key == self.settings.max_count
            if not full:
                self.sent.append((self._set, ring, time))
        else:
            held = self._keyed
            key = instance if self._by_id else ring
            if not self._has_sets:
                held.pop(_UNPLACED, None)
            elif key not in held or self._lost_at is not None or _UNPLACED in held:
                self._follow(0, now)
            key = self._admitted(key)
            full = key == _EXCESS
        if full:
            self._hold_refused(held, key, TOO_MANY, time)
            return TOO_MANY
        last = held.get(key)
        if last and last.ring == ring:
            time = max(time, last.time)
        held[key] = Place(ring, time, '')
        return None

    def refuse(self, reason, stamp, now, instance):
        time = self._hear(stamp or 0, now)
        if time is None:
            return TOO_OLD
        key, held = _UNPLACED, self._keyed
        if self._in_sets(stamp or 0):
            self._follow(stamp, now)
            key = self._next_in_set(None)
            held = self._newest
        elif self._has_sets:
            self._follow(0, now)
            self._miss()
        elif self._by_id and instance is not None:
            key = self._admitted(instance)
        if key == _EXCESS:
            reason = TOO_MANY
        self._hold_refused(held, key, reason, time)
        return reason

    @property
    def _by_id(self):
        return self.settings.type == POLYGON_INSTANCE

    @property
    def _has_sets(self):
        return not self._by_id and not self.settings.accumulate

    def _in_sets(self, stamp):
        return stamp != 0 and self._has_sets

    def _hear(self, stamp, now):
        """Return the time that a message counts from, None if that is too long ago."""
        time = min(stamp or now, now)
        self.look(now)
        if is_past(self.settings, time, now):
            return None
        if self._heard is None or time > self._heard:
            self._heard = time
            self._silent = False
        return time

    def _hold_refused(self, held, key, reason, time):
        last = held.get(key)
        held[key] = Place(None, max(time, last.time) if last else time, reason)

    def _admitted(self, key):
        """Return a key, or that of the excess if there is no room for another one."""
        known = self._keyed.keys() - {_UNPLACED, _EXCESS}
        return key if key in known or len(known) < self.settings.max_count else _EXCESS

    def _next_in_set(self, ring):
        """Return the place of an equal body of this set, else the next; beyond all is one more."""
        if ring in self._place_of:
            return self._place_of[ring]
        place = min(self._taken, self.settings.max_count)
        self._taken = place + 1
        if ring and place < self.settings.max_count:
            self._place_of[ring] = place
        return place

    def _follow(self, stamp, now):
        """Let a message join what is coming in, or begin the next set."""
        if stamp and not self._continues(stamp):
            if not self._whole:
                self._finish()
            self._set += 1
            self._turn += 1
            self._is_cut = self._set_start is not None and (
                0 < stamp - self._latest < nanoseconds(self.settings.set_window))
            self._doubts_window |= self._is_cut
            self._set_start = self._latest = stamp
            self._taken, self._place_of = 0, {}
            self._last, self._newest = self._newest, {}
            self._whole = False
        elif stamp:
            self._latest = max(stamp, self._latest)
        elif self._before is None:
            self._turn += 1
        if self._first_to_count is None:
            self._first_to_count = self._turn + 1
        self._before = stamp
        self._listens_since = now

    def _continues(self, stamp):
        if self._set_start is None:
            return False
        late = self._set_start - stamp
        return (abs(late) <= nanoseconds(self.settings.set_window)
                or 0 < late < nanoseconds(self.settings.timeout))

    def _finish(self):
        """Take what came in last for whole."""
        self._drop_last()
        if self._first_to_count is not None and self._turn >= self._first_to_count:
            self._lost_at = None
            if self._has_sets:
                self._keyed.pop(_UNPLACED, None)
            self._known = True
            self._doubts_window = self._is_cut

    def _drop_last(self):
        if not self._whole:
            self._whole = True
            self._last = {}


def nanoseconds(seconds):
    return round(seconds * SECOND)


def is_past(settings, time, now):
    """Tell whether something of a time is older than the timeout, where that is not 0."""
    return settings.timeout > 0 and now - time > nanoseconds(settings.timeout)

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

"""Sources of obstacles: what each has told, for how long, and whether that is all there is."""

from __future__ import annotations

from sat_collision.geometry.polygon import PackedBody
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Alarm, Deadlines, NEVER
from sat_collision.scene.doubts import Doubts
from sat_collision.scene.holders import Holdings, shape_of
from sat_collision.scene.obstacle_sets import ObstacleSets
from sat_collision.scene.obstacles import Key
from sat_collision.scene.settings import ObstacleSettings, POLYGON_INSTANCE

TOO_OLD = 'too old'


class Source:
    """
    What one topic has told about obstacles.

    A polygon with a stamp is an obstacle of a set, see `ObstacleSets`. While a set comes in it
    only adds: what the last whole set held is forgotten when the new one is whole. Polygons with
    stamp 0, and all those of a source that accumulates, go by their shape; instances by their id.
    The source is known from its first whole set on, or the first pause after polygons without
    stamps; one without sets from its first message on.

    While a source holds a message that was refused it is at fault: there may be an obstacle where
    nobody looks. So it is after a loss until all is told anew: by a whole set, or in the timeout.

    Times are in ns. A message counts from its stamp, from now if that is 0 or in the future. One
    past its timeout is refused as TOO_OLD and changes nothing: what is held is known better.

    Parameters
    ----------
    settings : ObstacleSettings
    contacts : Contacts
    deadlines : Deadlines
        Calls for `expire`.

    Attributes
    ----------
    obstacles : Holdings
    pause : int or float
        Time in ns after which what comes in is whole, if nothing more comes; NEVER if nothing is.
    faults : tuple of str
        Why the source cannot be trusted, in words; empty if it can. The same object as long as
        nothing about it changes.

    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts,
                 deadlines: Deadlines) -> None:
        self._note_set = contacts.begin_set
        self._deadlines = deadlines
        self._doubts = Doubts()
        self.obstacles = Holdings(settings.name, contacts, deadlines, self._count_refusals)
        self._sets = ObstacleSets()
        self._coming_in = self.obstacles.sides[0]
        self.are_waiting = False
        self._cure = Alarm(self._get_over_loss)
        self.settings = settings
        self.faults: tuple[str, ...] = ()
        self.watched: float = NEVER
        self._clear()
        self.configure(settings, now=0)

    def _clear(self) -> None:
        self.obstacles.clear()
        self._doubts = Doubts(publishers=self._doubts.publishers)
        self._heard: float = -NEVER
        self.pause = self._cure.deadline = NEVER
        self._sets.clear()

    def configure(self, settings: ObstacleSettings, now: int) -> None:
        """Apply settings; a disabled source forgets all that it was told."""
        was_enabled = self.settings.enabled
        self.settings = settings
        self._timeout = round(settings.timeout * 1e9) if settings.timeout > 0.0 else NEVER
        self.obstacles.configure(self._timeout, settings.max_count)
        self._sets.window = round(settings.set_window * 1e9)
        self._sets.timeout = self._timeout
        self._quiet = round(settings.set_quiet * 1e9)
        self._by_id = settings.type == POLYGON_INSTANCE
        self._in_sets = not self._by_id and not settings.accumulate
        self._followed = -1
        if not settings.enabled:
            self._clear()
        elif now and not was_enabled:
            self.listen(now)
        if self._doubts.is_silent and now <= self.deadline:
            # What it held is forgotten: a longer timeout brings nothing back.
            self._heard, self._doubts.is_silent, self._doubts.is_heard = -NEVER, False, False
        if self.deadline < now:
            self.expire()
        self._deadlines.watch(self)
        self._find_faults()

    @property
    def deadline(self) -> float:
        """Time in ns after which the source is silent, unless it is heard again."""
        return self._heard + self._timeout if self._doubts.is_heard else NEVER

    def expire(self) -> None:
        """Note that the source is silent, now that its deadline is past."""
        self._doubts.is_silent = True
        self._begin_anew()
        if self.pause == NEVER:
            self._sets.settle()
        self._find_faults()

    def listen(self, now: int) -> None:
        """Take note that from now on all is told that is sent: after a pause, sets count."""
        if self._in_sets and self.settings.enabled and self._doubts.publishers != 0:
            self.pause = now + self._quiet

    def meet_publisher(self, from_beginning: bool) -> None:
        """Take note that the next message is the first one heard of a publisher, or sent by it."""
        if self._doubts.is_heard and not (from_beginning and self._sets.is_whole):
            self._begin_anew()
            self._find_faults()
        if from_beginning:
            self._sets.settle()

    def _begin_anew(self) -> None:
        """Trust the source from the first set on that begins after this and is whole."""
        self._drop_last_set()
        self._sets.clear()
        self._doubts.is_known = False

    def lose(self, now: int) -> None:
        """Take note that messages were lost before the one that comes next."""
        self._doubts.is_lossy = True
        self._sets.miss()
        self._cure.deadline = now + self._timeout
        self._deadlines.watch(self._cure)
        self._find_faults()

    def count_publishers(self, count: int, now: int) -> None:
        """Take note of how many publishers there are; without any, nothing is known any more."""
        doubts = self._doubts
        if count == doubts.publishers and (count or not doubts.is_heard):
            return
        before, doubts.publishers = doubts.publishers, count
        doubts.is_left = count == 0 and (bool(before) or doubts.is_heard)
        if doubts.is_left:
            doubts.is_heard = doubts.is_silent = False
            self._heard = -NEVER
        if doubts.is_left or count == 1 < (before or 0):  # what several sent was mixed up
            self._begin_anew()
        if count == 0:
            self.pause = NEVER
        elif count == 1:
            self.listen(now)
        self._find_faults()

    def overwhelm(self, overwhelmed: bool) -> None:
        """Take note of whether the source sends more than can be checked."""
        self._doubts.is_behind = overwhelmed
        self._find_faults()

    def heartbeat(self, stamp: int, now: int) -> str | None:
        """Take the message that the publisher lives and saw nothing; return a refusal or None."""
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._in_sets:
            self._follow(stamp, now)
            if stamp and self._sets.includes(stamp):
                self._end_set()
        return None

    def place(self, body: PackedBody, frame_id: str, stamp: int, now: int,
              instance: int | None) -> str | None:
        """Take a body; return a refusal or None."""
        if now == self._followed and stamp == self._sets.current and stamp:
            # The message before has told the source all but the body.
            return self._coming_in.place(body, frame_id, stamp if stamp < now else now)
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        if self._in_sets and stamp:
            self._follow(stamp, now)
            return self._coming_in.place(body, frame_id, time)
        key: Key = shape_of(body) if instance is None or not self._by_id else instance
        keyed = self.obstacles.keyed
        if not self._in_sets:
            keyed.forget_unplaced()
        elif key not in keyed or self._doubts.is_lossy or None in keyed:
            self._follow(0, now)
        return keyed.place(key, body, frame_id, time)

    def refuse(self, reason: str, stamp: int | None, now: int, instance: int | None) -> str:
        """Take a message without a usable polygon, as `Scene.refuse`; return what counts."""
        time = self._hear(stamp or 0, now)
        if time is None:
            return TOO_OLD
        if self._in_sets:
            if stamp:
                self._follow(stamp, now)
                return self._coming_in.refuse(time, reason)
            self._follow(0, now)
            self._sets.miss()
        return self.obstacles.keyed.refuse(instance if self._by_id else None, time, reason)

    def refuse_other_frames(self, frame_id: str) -> None:
        """Refuse the obstacles in another frame than this, which was not known when they came."""
        if self.obstacles.refuse_other_frames(frame_id):
            self._sets.miss()

    def _hear(self, stamp: int, now: int) -> int | None:
        """Note a sign of life; return the time it counts from, None if that is too long ago."""
        time = stamp if 0 < stamp < now else now
        if time + self._timeout < now:
            self._doubts.note_late(now - time)
            self._find_faults()
            return None
        if time > self._heard:
            self._heard = time
            if self._doubts.hear():
                self._deadlines.watch(self)
                self._find_faults()
        return time

    def _follow(self, stamp: int, now: int) -> None:
        """Let a message join the set that comes in, or begin the next one."""
        sets = self._sets
        self._followed = now
        # What comes in is whole if nothing more of it comes for a while.
        self.pause = now + self._quiet
        if stamp == sets.current:
            return
        if not stamp or sets.continues(stamp):
            return sets.join(stamp)
        if not sets.is_whole:
            self._end_set()
        sets.begin(stamp)
        self._coming_in = self.obstacles.sides[sets.side]
        self._note_set(self.settings.name, stamp)
        if sets.is_cut:
            self._doubts.is_cut = True
            self._find_faults()

    def end_pause(self) -> None:
        """Take what came in last for whole, if nothing more of it waits; the pause is over."""
        if self.are_waiting:
            self.pause += self._quiet
            return
        self.pause = NEVER
        self._end_set()
        self._sets.settle()

    def _end_set(self) -> None:
        """Take the set that came in last for whole; trust the source if nothing was missed."""
        sets, doubts = self._sets, self._doubts
        self._drop_last_set()
        if sets.counts:
            if self._in_sets:
                self.obstacles.keyed.forget_unplaced()
            if doubts.is_lossy:
                self._get_over_loss()
            if not doubts.is_known or doubts.is_cut:
                doubts.is_known = True
                doubts.is_cut = sets.is_cut
                self._find_faults()

    def _drop_last_set(self) -> None:
        """Forget what the set before held."""
        if not self._sets.is_whole:
            self._sets.is_whole = True
            self.obstacles.sides[1 - self._sets.side].clear()

    def _get_over_loss(self) -> None:
        self._cure.deadline = NEVER
        self._doubts.is_lossy = False
        self._find_faults()

    def _count_refusals(self, reason: str, more: int) -> None:
        self._doubts.refusals[reason] += more
        self._find_faults()

    def _find_faults(self) -> None:
        """Put into words what is wrong with the source."""
        faults = self._doubts.in_words(self.settings, self._in_sets)
        if faults != self.faults:
            self.faults = faults

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

"""The scene: what is known of footprints and obstacles, and what follows for each footprint."""

from __future__ import annotations

from sat_collision.geometry.polygon import PackedBody
from sat_collision.scene.circumstances import Circumstances
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.evaluations import Evaluations
from sat_collision.scene.footprints import Evaluation, Footprint, Origin
from sat_collision.scene.frame_ids import in_quotes
from sat_collision.scene.holders import OTHER_FRAME
from sat_collision.scene.observer import Observer
from sat_collision.scene.settings import Settings
from sat_collision.scene.sources import Source

FROM_FUTURE = 'from the future'
OVERTAKEN = 'older than the last'

_AGREEMENT = 10**9
_UNHEARD = 'has not been heard yet'


class Scene(Circumstances):
    """
    Footprints and obstacles, and the state of each footprint.

    A message is decided against the bodies that it may meet; all else stays as it was decided.
    In doubt a footprint is unknown, never clear. It is

    - UNKNOWN if nothing is known of the footprint itself (never heard, refused, in another frame,
      older than its timeout, disabled), if checking is disabled, or if there is no clock;
    - else in COLLISION if it shares a point with an obstacle, or is within the margin of one: a
      proved contact stays true whatever else is in doubt;
    - else UNKNOWN if a source of obstacles is at fault (never heard, silent, refused), or none
      is enabled: there may be an obstacle that nobody told of;
    - else CLEAR, which is reported once it has been so for `release_delay`.

    Where a footprint has sources of its own, these alone count for it.

    Every method that takes `now` first lets time pass until then, as `pass_time` does. Times are
    ints in ns by one clock. A header stamp of 0 means now, and no stamp counts from the future.
    A body is a packed polygon, whose array may be used again once the method has returned.

    Parameters
    ----------
    settings : Settings
    observer : Observer, optional
        Is told of what is taken and of what is dropped.

    Attributes
    ----------
    settings : Settings
    frame_id : str
        The frame of all bodies: that of the settings, else the one that the footprints heard in
        the last second agree on; empty until there is one.

    """

    def __init__(self, settings: Settings, observer: Observer | None = None) -> None:
        self.settings = settings
        self._observer = observer
        self._now = 0
        self._clock_stands = False
        self._reported: dict[str, Evaluation] = {}
        self._release_delay = round(settings.release_delay * 1e9)
        self._future_tolerance = round(settings.future_tolerance * 1e9)
        self._forget_all()
        self._reevaluate_all()

    def _forget_all(self) -> None:
        self.frame_id = self.settings.frame_id
        self._contacts = Contacts(self.settings.margin, self._observer)
        self._deadlines = Deadlines()
        self._sources = {source.name: Source(source, self._contacts, self._deadlines)
                         for source in self.settings.obstacles}
        self._footprints = {footprint.name: Footprint(footprint, self._contacts.changed)
                            for footprint in self.settings.footprints}
        self.evaluations = Evaluations(self._footprints, self._contacts.changed,
                                       self._deadlines, self._reported)
        for footprint in self._footprints.values():
            self._invalidate(footprint, _UNHEARD)

    def update(self, settings: Settings) -> None:
        """
        Apply other settings, of the same names, topics and types.

        What is disabled forgets what it was told: enabled again, it is unknown until told anew.
        """
        self.settings = settings
        self._release_delay = round(settings.release_delay * 1e9)
        self._future_tolerance = round(settings.future_tolerance * 1e9)
        for source in settings.obstacles:
            self._sources[source.name].configure(source, self._now)
        for new in settings.footprints:
            footprint = self._footprints[new.name]
            if new.enabled != footprint.settings.enabled:
                self._invalidate(footprint, _UNHEARD)
            minded = footprint.settings.obstacles
            footprint.configure(new)
            if new.obstacles != minded:
                self._contacts.decide(footprint)
        self._contacts.use_margin(settings.margin)
        self._contacts.changed.update(self._footprints.values())
        self._reevaluate_all()
        self.pass_time(self._now)

    def footprint(self, name: str, body: PackedBody, frame_id: str, stamp: int, now: int,
                  origin: Origin | None = None) -> str | None:
        """
        Take a footprint.

        Parameters
        ----------
        name : str
        body : PackedBody
        frame_id : str
        stamp, now : int
            Header stamp and present time in ns.
        origin : Origin, optional
            Where it came from, if it was moved to the frame.

        Returns
        -------
        str or None
            Why it was refused, if it was: FROM_FUTURE, OTHER_FRAME or OVERTAKEN; the last leaves
            the footprint as it is.

        """
        if now != self._now:
            self.pass_time(now)
        footprint = self._footprints[name]
        if not footprint.settings.enabled:
            return None
        if stamp > now and self._is_from_future(stamp):
            self._invalidate(footprint, f'was refused: {FROM_FUTURE}')
            self._evaluate()
            return FROM_FUTURE
        footprint.frame_id = frame_id
        footprint.heard = now
        if frame_id != self.frame_id and not self.settings.frame_id:
            self._choose_frame()
        if frame_id != self.frame_id:
            self._invalidate(footprint, f'is not in the frame {in_quotes(self.frame_id)}')
            self._evaluate()
            return OTHER_FRAME
        if footprint.is_newer_than(stamp):
            return OVERTAKEN
        self._contacts.place_footprint(footprint, body)
        footprint.stamp = stamp or now
        footprint.origin = origin
        footprint.time = time = min(stamp, now) if stamp else now
        if footprint.fault or footprint.stale or time + footprint.timeout < now:
            footprint.fault = ''
            self._contacts.changed.add(footprint)
        elif time + footprint.timeout < footprint.watched:
            self._deadlines.watch(footprint)
        if self._contacts.changed:
            self._evaluate()
        return None

    def obstacle(self, name: str, body: PackedBody | None, frame_id: str, stamp: int, now: int,
                 instance: int | None = None) -> str | None:
        """
        Take a message of a source of obstacles; as `footprint`, but for what follows.

        Parameters
        ----------
        body : PackedBody or None
            None for a heartbeat: the publisher lives, and saw nothing.
        instance : int, optional
            The obstacle's id, of a source that gives ids.

        Returns
        -------
        str or None
            Why it was refused, if it was: FROM_FUTURE, OTHER_FRAME, TOO_MANY or TOO_OLD.

        """
        if now != self._now:
            self.pass_time(now)
        source = self._sources[name]
        if not source.settings.enabled:
            return None
        faults = source.faults
        refusal: str | None
        if stamp > now and self._is_from_future(stamp):
            # With such a stamp it can be of no set; a heartbeat is of no instance.
            refusal = source.refuse(FROM_FUTURE, None, now, None if body is None else instance)
        elif body is None:
            refusal = source.heartbeat(stamp, now)
        elif self.frame_id and frame_id != self.frame_id:
            refusal = source.refuse(OTHER_FRAME, stamp, now, instance)
        else:
            refusal = source.place(body, frame_id, stamp, now, instance)
        if source.faults is not faults:
            self._reevaluate_all()
        elif self._contacts.changed:
            self._evaluate()
        return refusal

    def refuse(self, name: str, reason: str, now: int, stamp: int | None = None,
               instance: int | None = None) -> None:
        """
        Take note of a message of a footprint or source that gave no polygon.

        The reason has no figures; stamp and instance are None where they could not be read.
        """
        self.pass_time(now)
        if stamp is not None and self._is_from_future(stamp):
            stamp = None
        footprint = self._footprints.get(name)
        if footprint is None:
            if self._sources[name].settings.enabled:
                self._sources[name].refuse(reason, stamp, now, instance)
        else:
            self._invalidate(footprint, f'was refused: {reason}')
        self._reevaluate_all()

    def advance(self, now: int) -> None:
        """
        Let time pass when all that was sent until now has been told: what paused is whole.

        Where messages may wait to be told, only `pass_time` is right: a pause may be none.
        """
        paused = [source for source in self._sources.values() if source.pause < now]
        for source in paused:
            source.end_pause()
        self.pass_time(now)
        if paused:
            self._reevaluate_all()

    def pass_time(self, now: int) -> None:
        """
        Let time pass: obstacles are forgotten, footprints become stale, sources fall silent.

        A step back (a recording begins again, a simulation is reset) drops everything: it belongs
        to another time.
        """
        last, self._now = self._now, now
        if 0 < last <= now <= self._deadlines.earliest:
            return
        begins = last == 0 or now < last
        if now < last:
            self._forget_all()
        if begins:
            for source in self._sources.values():
                source.listen(now)
        changed = begins
        for thing in self._deadlines.missed(now):
            thing.expire()
            changed = True
        if changed:
            self._reevaluate_all()

    def _is_from_future(self, stamp: int) -> bool:
        return stamp > self._now + self._future_tolerance and self._now > 0

    def _choose_frame(self) -> None:
        """Let the frame be the one that the footprints heard of late agree on, if they do."""
        frames = {footprint.frame_id for footprint in self._footprints.values()
                  if footprint.heard is not None and footprint.heard >= self._now - _AGREEMENT}
        if len(frames) != 1 or self.frame_id in frames:
            return
        self.frame_id, = frames
        for footprint in self._footprints.values():
            if footprint.time is not None and footprint.frame_id != self.frame_id:
                self._invalidate(footprint, f'is not in the frame {in_quotes(self.frame_id)}')
        for source in self._sources.values():
            source.refuse_other_frames(self.frame_id)
        self._reevaluate_all()

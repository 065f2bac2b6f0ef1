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

from sat_collision.geometry.polygon import PackedBody, Polygon
from sat_collision.geometry.polygon_set import Point
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.evaluations import Evaluations
from sat_collision.scene.footprints import Evaluation, Footprint, State, Status
from sat_collision.scene.frame_ids import in_quotes
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
from sat_collision.scene.sources import OTHER_FRAME, Source

_UNHEARD = 'has not been heard yet'


class Scene:
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

    Every method that takes `now` first lets time pass until then, as `advance` does. Times are
    ints in ns by one clock. A header stamp of 0 means now, and no stamp counts from the future.
    A body is a packed polygon, whose array may be used again once the method has returned.

    Parameters
    ----------
    settings : Settings

    Attributes
    ----------
    settings : Settings
    frame_id : str
        The frame of all bodies: that of the settings, else of the first good footprint; empty
        until there is one.
    evaluations : Evaluations

    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self._now = 0
        self._reported: dict[str, Evaluation] = {}
        self._release_delay = round(settings.release_delay * 1e9)
        self._forget_all()
        self._reevaluate_all()

    def _forget_all(self) -> None:
        self.frame_id = self.settings.frame_id
        self._contacts = Contacts(self.settings.margin)
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
        self._contacts.use_margin(settings.margin)
        for source in settings.obstacles:
            self._sources[source.name].configure(source, self._now)
        for new in settings.footprints:
            footprint = self._footprints[new.name]
            if new.enabled != footprint.settings.enabled:
                self._invalidate(footprint, _UNHEARD)
            footprint.configure(new)
        self._contacts.changed.update(self._footprints.values())
        self._reevaluate_all()
        self.advance(self._now)

    def settings_of(self, name: str) -> FootprintSettings | ObstacleSettings:
        """Return the settings of a footprint or source by its name."""
        source = self._sources.get(name)
        return source.settings if source else self._footprints[name].settings

    def footprint(self, name: str, body: PackedBody, frame_id: str, stamp: int,
                  now: int) -> str | None:
        """
        Take a footprint.

        Parameters
        ----------
        name : str
        body : PackedBody
        frame_id : str
        stamp, now : int
            Header stamp and present time in ns.

        Returns
        -------
        str or None
            Why it was refused, if it was: OTHER_FRAME.

        """
        self.advance(now)
        footprint = self._footprints[name]
        if not footprint.settings.enabled:
            return None
        if not self.frame_id:
            self.frame_id = frame_id
            for source in self._sources.values():
                source.refuse_other_frames(frame_id)
            self._reevaluate_all()
        if frame_id != self.frame_id:
            self._invalidate(footprint, f'is not in the frame {in_quotes(self.frame_id)}')
            self._evaluate()
            return OTHER_FRAME
        self._contacts.place_footprint(footprint, body)
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
            Why it was refused, if it was: OTHER_FRAME, TOO_MANY or TOO_OLD.

        """
        self.advance(now)
        source = self._sources[name]
        if not source.settings.enabled:
            return None
        faults = source.faults
        if body is None:
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
        self.advance(now)
        footprint = self._footprints.get(name)
        if footprint is None:
            if self._sources[name].settings.enabled:
                self._sources[name].refuse(reason, stamp, now, instance)
        else:
            self._invalidate(footprint, f'was refused: {reason}')
        self._reevaluate_all()

    def overwhelm(self, name: str, overwhelmed: bool) -> None:
        """Take note of whether a source sends more than can be checked."""
        self._sources[name].overwhelm(overwhelmed)
        self._reevaluate_all()

    def advance(self, now: int) -> None:
        """
        Let time pass: obstacles are forgotten, footprints become stale, sources fall silent.

        A step back (a recording begins again, a simulation is reset) drops everything: it belongs
        to another time.
        """
        last, self._now = self._now, now
        if 0 < last <= now <= self._deadlines.earliest:
            return
        changed = now > last == 0
        if now < last:
            self._forget_all()
            changed = True
        for thing in self._deadlines.missed(now):
            thing.expire()
            changed = True
        if changed:
            self._reevaluate_all()

    def changes(self) -> list[str]:
        """Return the names of footprints whose state, age apart, changed since the last call."""
        return self.evaluations.changes()

    def status(self, name: str) -> Status:
        """Return the Status of a footprint."""
        return self._footprints[name].status

    def state(self, name: str) -> State:
        """Return the State of a footprint at the time that was passed last."""
        footprint = self._footprints[name]
        age = None if footprint.time is None else (self._now - footprint.time) / 1e9
        status, reasons = footprint.evaluation
        return State(status, footprint.contacts_reported, reasons, age)

    @property
    def deadline(self) -> float:
        """The time in ns until which, at least, nothing changes by itself; NEVER if at no time."""
        return self._deadlines.earliest

    @property
    def footprints(self) -> list[tuple[str, Polygon]]:
        """The (name, Polygon) of every footprint that is somewhere, be it stale."""
        return [(name, polygon) for name, footprint in self._footprints.items()
                if (polygon := footprint.polygon) is not None]

    @property
    def obstacles(self) -> list[tuple[ObstacleId, Polygon]]:
        """The (ObstacleId, Polygon) of every obstacle that is somewhere."""
        return [(obstacle.name, polygon) for source in self._sources.values()
                for obstacle in source.obstacles.values()
                if (polygon := obstacle.polygon) is not None]

    def contacts(self, name: str) -> list[tuple[ObstacleId, Polygon, Polygon]]:
        """Return (ObstacleId, Polygon of the footprint, Polygon) of all that a footprint meets."""
        footprint = self._footprints[name]
        return [(obstacle.name, own, other) for obstacle in footprint.contacts
                if (own := footprint.polygon) and (other := obstacle.polygon)]

    def nearest(self, name: str, apart: bool = False
                ) -> tuple[ObstacleId, float, Point, Point] | None:
        """
        Return what is nearest to a footprint, None if one of the two is nowhere.

        It is an obstacle, its separation and the closest points, as `PolygonSet.nearest` has
        them; with `apart` the obstacles in contact are left out.
        """
        footprint = self._footprints[name]
        found = self._contacts.nearest(footprint, footprint.contacts if apart else ())
        return found and (found[0].name, *found[1:])

    def _invalidate(self, footprint: Footprint, fault: str) -> None:
        footprint.time = None
        footprint.fault = fault
        self._contacts.remove_footprint(footprint)
        self._contacts.changed.add(footprint)

    def _reevaluate_all(self) -> None:
        """Evaluate the footprints for which something has changed: all, if a common fault has."""
        self.evaluations.find_faults(self.settings, self._now, self._sources.values())
        self._evaluate()

    def _evaluate(self) -> None:
        self.evaluations.evaluate(self._now, self._release_delay)

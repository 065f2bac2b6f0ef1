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

from itertools import chain

import numpy as np
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.deadlines import Deadlines
from sat_collision.scene.express import NOT_ORDINARY
from sat_collision.scene.footprints import Footprint, State, Status
from sat_collision.scene.obstacles import Obstacle
from sat_collision.scene.sources import OTHER_FRAME, Source

__all__ = ['Obstacle', 'Scene', 'State', 'Status']

_DISABLED = 'checking is disabled'
_NO_CLOCK = 'no clock yet: the time reads 0, as with use_sim_time before the first /clock'
_NO_SOURCE = 'no obstacle source is enabled'
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
    - else UNKNOWN if a source of obstacles is in trouble (never heard, silent, refused), or none
      is enabled: there may be an obstacle that nobody told of;
    - else CLEAR, which is reported once it has been so for `release_delay`.

    Every method that takes `now` first lets time pass until then, as `advance` does. Times are
    ints in ns by one clock. A header stamp of 0 means now, and no stamp counts from the future.

    Parameters
    ----------
    settings : Settings

    Attributes
    ----------
    settings : Settings
    frame_id : str
        The frame of all bodies: that of the settings, else of the first good footprint; empty
        until there is one.

    """

    def __init__(self, settings):
        self.settings = settings
        self._now = 0
        self._reported = {}
        self._release_delay = round(settings.release_delay * 1e9)
        self._forget_all()
        self._look_again()

    def _forget_all(self):
        self._use_frame(self.settings.frame_id)
        self._contacts = Contacts(self.settings.margin)
        self._deadlines = Deadlines()
        self._blanket = ''
        self._doubts = ()
        self._unreported = set()
        self._sources = {source.name: Source(source, self._contacts, self._deadlines)
                         for source in self.settings.obstacles}
        self._footprints = {footprint.name: Footprint(footprint, self._contacts.changed)
                            for footprint in self.settings.footprints}
        for footprint in self._footprints.values():
            self._lose(footprint, _UNHEARD)

    def update(self, settings):
        """
        Apply other settings, of the same names, topics and types.

        What is disabled forgets what it was told: enabled again, it is unknown until told anew.
        """
        self.settings = settings
        self._release_delay = round(settings.release_delay * 1e9)
        self._contacts.use_margin(settings.margin)
        self._use_frame(self.frame_id)
        for source in settings.obstacles:
            self._sources[source.name].configure(source, self._now)
        for new in settings.footprints:
            footprint = self._footprints[new.name]
            if new.enabled != footprint.settings.enabled:
                self._lose(footprint, _UNHEARD)
            footprint.configure(new)
        self._contacts.changed.update(self._footprints.values())
        self._look_again()
        self.advance(self._now)

    def settings_of(self, name):
        """Return the FootprintSettings or ObstacleSettings of a name."""
        return (self._footprints.get(name) or self._sources[name]).settings

    def footprint(self, name, polygon, frame_id, stamp, now):
        """
        Take a footprint.

        Parameters
        ----------
        name : str
        polygon : Polygon
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
            self._fix_frame(frame_id)
            self._look_again()
        if frame_id != self.frame_id:
            self._lose(footprint, f"is not in the frame '{self.frame_id}'")
            self._settle()
            return OTHER_FRAME
        self._contacts.place_footprint(footprint, polygon)
        self._placed(footprint, stamp)
        return None

    def _placed(self, footprint, stamp):
        """Take note that a footprint has been placed, and settle what follows."""
        now = self._now
        footprint.time = min(stamp, now) if stamp else now
        if footprint.trouble or footprint.stale or footprint.time + footprint.timeout < now:
            footprint.trouble = ''
            self._contacts.changed.add(footprint)
        elif footprint.time + footprint.timeout < footprint.watched:
            self._deadlines.watch(footprint)
        if self._contacts.changed:
            self._settle()

    def obstacle(self, name, polygon, frame_id, stamp, now, instance=None):
        """
        Take a message of an obstacle source.

        Parameters
        ----------
        name : str
            Name of the source.
        polygon : Polygon or None
            None for a heartbeat: the publisher lives, and saw nothing.
        frame_id : str
        stamp, now : int
            Header stamp and present time in ns.
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
        reasons = source.reasons
        if polygon is None:
            refusal = source.heartbeat(stamp, now)
        elif self.frame_id and frame_id != self.frame_id:
            refusal = source.refuse(OTHER_FRAME, stamp, now, instance)
        else:
            refusal = source.place(polygon, frame_id, stamp, now, instance)
        if source.reasons is not reasons:
            self._look_again()
        elif self._contacts.changed:
            self._settle()
        return refusal

    def express(self, name, data, now):
        """
        Take a serialised message if it is an ordinary one, see `express`; tell whether it was.

        Parameters
        ----------
        name : str
            Name of the footprint or source.
        data : bytes
        now : int
            Present time in ns.

        """
        if not self._ordinary_frame:
            return False
        # What `advance` would do for nearly every message, without the call.
        if 0 < self._now <= now <= self._deadlines.earliest:
            self._now = now
        else:
            self.advance(now)
        source = self._sources.get(name)
        if source is not None:
            return source.express(data, now, self._ordinary_frame, self.settings.max_vertices)
        footprint = self._footprints[name]
        if footprint.row is None:
            return False
        stamp = self._contacts.move_footprint(footprint, data, self._ordinary_frame,
                                              self.settings.max_vertices)
        if stamp == NOT_ORDINARY:
            return False
        self._placed(footprint, stamp)
        return True

    def refuse(self, name, reason, now, stamp=None, instance=None):
        """
        Take note of a message that gave no polygon.

        Parameters
        ----------
        name : str
            Name of the footprint or source.
        reason : str
            What is wrong with it, without figures.
        now : int
            Present time in ns.
        stamp, instance : int, optional
            As for `obstacle`; None where they could not be read.

        """
        self.advance(now)
        footprint = self._footprints.get(name)
        if footprint is None:
            if self._sources[name].settings.enabled:
                self._sources[name].refuse(reason, stamp, now, instance)
        else:
            self._lose(footprint, f'was refused: {reason}')
        self._look_again()

    def advance(self, now):
        """
        Let time pass: obstacles are forgotten, footprints become stale, sources fall silent.

        A step back (a recording begins again, a simulation is reset) drops everything: it belongs
        to another time.
        """
        last, self._now = self._now, now
        if 0 < last <= now <= self._deadlines.earliest:
            return
        look_again = now > last == 0
        if now < last:
            self._forget_all()
            look_again = True
        for thing in self._deadlines.missed(now):
            thing.expire()
            look_again = True
        if look_again:
            self._look_again()

    def changes(self):
        """Return the names of footprints whose state, age apart, changed since the last call."""
        if not self._unreported:
            return []
        changed = []
        for name, footprint in self._footprints.items():
            if footprint in self._unreported:
                if footprint.finding != self._reported.get(name):
                    self._reported[name] = footprint.finding
                    changed.append(name)
        self._unreported.clear()
        return changed

    def status(self, name):
        """Return the Status of a footprint."""
        status, _, _ = self._footprints[name].finding
        return status

    def state(self, name):
        """Return the State of a footprint at the time that was passed last."""
        footprint = self._footprints[name]
        age = None if footprint.time is None else (self._now - footprint.time) / 1e9
        return State(*footprint.finding, age)

    @property
    def footprints(self):
        """The (name, Polygon) of every footprint that is somewhere, be it stale."""
        return [(name, footprint.polygon) for name, footprint in self._footprints.items()
                if footprint.polygon is not None]

    @property
    def obstacles(self):
        """The (Obstacle, Polygon) of every obstacle that is somewhere."""
        return [(body.name, body.polygon)
                for source in self._sources.values() for body in source.bodies.values()
                if body.row is not None]

    @property
    def deadline(self):
        """The time in ns until which, at least, nothing changes by itself; NEVER if at no time."""
        return self._deadlines.earliest

    def contacts(self, name):
        """Return (Obstacle, Polygon of the footprint, Polygon) of all that a footprint meets."""
        footprint = self._footprints[name]
        return [(body.name, footprint.polygon, body.polygon) for body in footprint.meets]

    def nearest(self, name):
        """
        Return what is nearest to a footprint, None if one of the two is nowhere.

        Returns
        -------
        Obstacle, float, (x, y), (x, y)
            The obstacle, its separation and the closest points, as `distance` has them.

        """
        return self._contacts.nearest(self._footprints[name])

    def coordinate_step(self, name):
        """Return the distance (m) of neighbouring float32 numbers where a footprint is, else 0."""
        polygon = self._footprints[name].polygon
        return float(np.spacing(np.float32(np.abs(polygon.bounds).max()))) if polygon else 0.0

    def _use_frame(self, frame_id):
        """Take the frame of all bodies; with a margin no message is ordinary."""
        self.frame_id = frame_id
        no_margin = self.settings.margin == 0.0
        self._ordinary_frame = frame_id.encode() + b'\0' if frame_id and no_margin else b''

    def _fix_frame(self, frame_id):
        self._use_frame(frame_id)
        for source in self._sources.values():
            source.refuse_other_frames(frame_id)

    def _lose(self, footprint, trouble):
        footprint.time = None
        footprint.trouble = trouble
        self._contacts.remove_footprint(footprint)
        self._contacts.changed.add(footprint)

    def _look_again(self):
        """Settle the footprints for which something has changed: all, if a common doubt has."""
        blanket = '' if self.settings.enabled and self._now else (
            _NO_CLOCK if self.settings.enabled else _DISABLED)
        doubts = tuple(chain.from_iterable(source.reasons for source in self._sources.values()))
        if not any(source.enabled for source in self.settings.obstacles):
            doubts = _NO_SOURCE,
        if (blanket, doubts) != (self._blanket, self._doubts):
            self._blanket, self._doubts = blanket, doubts
            self._contacts.changed.update(self._footprints.values())
        self._settle()

    def _settle(self):
        """Settle the footprints for which something has changed, but no common doubt."""
        changed = self._contacts.changed
        for footprint in changed:
            footprint.settle(self._now, self._blanket, self._doubts, self._release_delay)
            self._deadlines.watch(footprint)
        self._unreported |= changed
        changed.clear()

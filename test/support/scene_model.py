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
The scene as a model that is simple: it follows the rules to the letter and recomputes everything.

It looks through all bodies whenever it is asked, and leaves geometry to shapely. A body is a ring:
a tuple of its corners. Times are in ns.
"""

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

from builders import SECOND
from sat_collision.scene.settings import POLYGON_INSTANCE
from sat_collision.scene.sources import OTHER_FRAME, TOO_MANY, TOO_OLD
import shapely

_UNHEARD = 'has not been heard yet'

# Keys of what was refused and has no place of its own, and of what came to a full source.
_UNPLACED = 'unplaced'
_EXCESS = 'excess'


class SceneModel:
    """
    All footprints and sources, told of the same events as a Scene whose frame_id is configured.

    What takes a message returns why it is refused, None if it is not.
    """

    def __init__(self, settings):
        self.settings = settings
        self.forget_all()

    def forget_all(self):
        """Begin anew, as after a step back in time."""
        self._footprints = {settings.name: Place() for settings in self.settings.footprints}
        self._sources = {settings.name: SourceModel(settings)
                         for settings in self.settings.obstacles}

    def use(self, settings):
        """Apply other settings of the same names; what is disabled, or was, forgets all."""
        for settings_before, footprint in zip(self.settings.footprints, settings.footprints):
            if settings_before.enabled != footprint.enabled:
                self._footprints[footprint.name] = Place()
        for source in settings.obstacles:
            self._sources[source.name].settings = source
            if not source.enabled:
                self._sources[source.name] = SourceModel(source)
        self.settings = settings

    def settings_of(self, name):
        both = (*self.settings.footprints, *self.settings.obstacles)
        return next(settings for settings in both if settings.name == name)

    def place(self, name, ring, stamp, now, instance=None):
        """Take a body of a footprint or source."""
        if not self.settings_of(name).enabled:
            return None
        if name in self._sources:
            return self._sources[name].place(ring, stamp, now, instance)
        self._footprints[name] = Place(ring, min(stamp or now, now), '')
        return None

    def refuse(self, name, reason, stamp, now, instance=None):
        """Take a message without a usable body; stamp and instance are None where unknown."""
        if not self.settings_of(name).enabled:
            return None
        if name in self._sources:
            return self._sources[name].refuse(reason, stamp, now, instance)
        self._footprints[name] = Place(fault=(
            f"is not in the frame '{self.settings.frame_id}'" if reason == OTHER_FRAME
            else f'was refused: {reason}'))
        return reason

    def heartbeat(self, name, stamp, now):
        """Take the message of a source that it lives and sees nothing."""
        if not self.settings_of(name).enabled:
            return None
        return self._sources[name].heartbeat(stamp, now)

    def overwhelm(self, name, overwhelmed):
        """Take note of whether a source sends more than can be checked."""
        self._sources[name].overwhelmed = overwhelmed

    def obstacles(self, now):
        """Return the ring of every obstacle by source and key, which is the ring if no number."""
        return {(name, key): place.ring for name, source in self._sources.items()
                for key, place in source.held(now).items() if place.ring}

    def state(self, name, now):
        """Return a footprint's status in a word, source and key of its contacts, and reasons."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return 'unknown', set(), [f'footprint {name} is disabled']
        doubts = self._doubts(now)
        ring, time, fault = self._footprints[name]
        if not fault and is_past(settings, time, now):
            fault = f'is older than its timeout of {settings.timeout:g} s'
        if fault:
            return 'unknown', set(), [f'footprint {name} on {settings.topic} {fault}', *doubts]
        contacts = {key for key, other in self.obstacles(now).items()
                    if separation(ring, other) <= self.settings.margin}
        if contacts:
            return 'collision', contacts, doubts
        return 'unknown' if doubts else 'clear', set(), doubts

    def age(self, name, now):
        """Return a footprint's age in seconds, None if there is no good one."""
        time = self._footprints[name].time
        return None if time is None else (now - time) / SECOND

    def _doubts(self, now):
        """Return why there may be obstacles that nobody told of, in sentences."""
        enabled = [source for source in self._sources.values() if source.settings.enabled]
        if not enabled:
            return ['no obstacle source is enabled']
        return [f'obstacle source {source.settings.name} on {source.settings.topic} {doubt}'
                for source in enabled for doubt in source.doubts(now)]


class Place(NamedTuple):
    """Where a body is and since when, or what is wrong with it."""

    ring: tuple | None = None
    time: int | None = None
    fault: str = _UNHEARD


class SourceModel:
    """One source of obstacles: what it holds by key, as of the last look."""

    def __init__(self, settings):
        self.settings = settings
        self.overwhelmed = False
        self._held = {}
        self._heard = None
        self._set_start = None
        self._taken = 0
        self._place_of = {}

    def held(self, now):
        """Forget what is past its timeout; return the Place of what is left, by key."""
        self._held = {key: place for key, place in self._held.items()
                      if not is_past(self.settings, place.time, now)}
        return self._held

    def doubts(self, now):
        """Return why the source cannot be trusted."""
        doubts = []
        if self._heard is None:
            doubts.append(_UNHEARD)
        elif is_past(self.settings, self._heard, now):
            doubts.append(
                f'has been silent for longer than its timeout of {self.settings.timeout:g} s')
        if self.overwhelmed:
            doubts.append('sends more than can be checked: messages come too late or are lost')
        faults = {place.fault for place in self.held(now).values() if place.fault}
        return doubts + [f'sent what was refused: {fault}' for fault in sorted(faults)]

    def heartbeat(self, stamp, now):
        if self._hear(stamp, now) is None:
            return TOO_OLD
        if self._in_sets(stamp):
            self._begin_set_if_due(stamp)
        return None

    def place(self, ring, stamp, now, instance):
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        self._held.pop(_UNPLACED, None)
        if self._in_sets(stamp):
            key = self._next_in_set(ring, stamp)
            full = key == self.settings.max_count
        else:
            key = self._admitted(instance if self._by_id else ring)
            full = key == _EXCESS
        if full:
            self._hold_refused(key, TOO_MANY, time)
            return TOO_MANY
        last = self._held.get(key)
        if last and last.ring == ring:
            time = max(time, last.time)
        self._held[key] = Place(ring, time, '')
        return None

    def refuse(self, reason, stamp, now, instance):
        time = self._hear(stamp, now)
        if time is None:
            return TOO_OLD
        key = _UNPLACED
        if self._in_sets(stamp):
            key = self._next_in_set(None, stamp)
        elif self._by_id and instance is not None:
            key = self._admitted(instance)
        if key == _EXCESS:
            reason = TOO_MANY
        self._hold_refused(key, reason, time)
        return reason

    @property
    def _by_id(self):
        return self.settings.type == POLYGON_INSTANCE

    def _in_sets(self, stamp):
        """Tell whether a message is one of a set; one with an unknown stamp counts as such."""
        return stamp != 0 and not self._by_id and not self.settings.accumulate

    def _hear(self, stamp, now):
        """Return the time that a message counts from, None if that is too long ago."""
        time = min(stamp or now, now)
        if is_past(self.settings, time, now):
            return None
        self.held(now)
        self._heard = time if self._heard is None else max(time, self._heard)
        return time

    def _hold_refused(self, key, reason, time):
        last = self._held.get(key)
        self._held[key] = Place(None, max(time, last.time) if last else time, reason)

    def _admitted(self, key):
        """Return a key, or that of the excess if there is no room for another one."""
        known = self._held.keys() - {_UNPLACED, _EXCESS}
        return key if key in known or len(known) < self.settings.max_count else _EXCESS

    def _next_in_set(self, ring, stamp):
        """Return the place of an equal body of this set, else the next; beyond all is one more."""
        if stamp is not None:
            self._begin_set_if_due(stamp)
        if ring in self._place_of:
            return self._place_of[ring]
        place = min(self._taken, self.settings.max_count)
        self._taken = place + 1
        if ring and place < self.settings.max_count:
            self._place_of[ring] = place
        return place

    def _begin_set_if_due(self, stamp):
        if self._set_start is not None:
            late = self._set_start - stamp
            if abs(late) <= nanoseconds(self.settings.set_window):
                return
            if 0 < late < nanoseconds(self.settings.timeout):
                return
        self._held = {key: place for key, place in self._held.items()
                      if not isinstance(key, int) or key < self._taken}
        self._set_start, self._taken, self._place_of = stamp, 0, {}


def nanoseconds(seconds):
    return round(seconds * SECOND)


def is_past(settings, time, now):
    """Tell whether something of a time is older than the timeout, where that is not 0."""
    return settings.timeout > 0 and now - time > nanoseconds(settings.timeout)


def enable(settings, name, enabled):
    """Return the Settings with one footprint or source enabled or not."""
    return replace(settings, **{
        kind: tuple(replace(each, enabled=enabled) if each.name == name else each
                    for each in getattr(settings, kind)) for kind in ('footprints', 'obstacles')})


@lru_cache(maxsize=None)
def separation(ring, other):
    """Return the distance of two bodies, 0 if they share a point."""
    return shapely.distance(_shape(ring), _shape(other))


def _shape(ring):
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(ring), shapely.Polygon)
    return kind(ring if len(ring) > 1 else ring[0])

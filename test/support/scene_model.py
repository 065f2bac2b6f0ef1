# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A simple model of the scene that follows the rules literally and recomputes everything.

Each query checks all bodies with shapely. A body is a ring: a tuple of its corners. Times are in
ns.
"""

from functools import lru_cache
from typing import NamedTuple

from builders import SECOND
from sat_collision.scene.obstacle_store import OTHER_FRAME
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN
import shapely
from source_model import followed_by, is_past, Message, nanoseconds, SourceModel, velocity_of


class Place(NamedTuple):
    """The last position of a footprint, its stamp and time, or what is wrong with it."""

    ring: tuple | None = None
    stamp: int | None = None
    time: int | None = None
    fault: str = 'has not been received yet'
    places: tuple = ()


class Ahead(NamedTuple):
    """
    What a footprint moves towards: obstacles at its stamp, and their relative velocities.

    `unknown` are those obstacles whose motion is not known.
    """

    ring: tuple
    age: float
    margin: float
    others: list
    unknown: set

    def is_met(self, seconds, slack):
        """Tell whether it meets any within some seconds from now, up to a slack in m."""
        return any(_is_met(self.ring, other, vx * (seconds + self.age), vy * (seconds + self.age),
                           self.margin + slack) for other, vx, vy in self.others)


class SceneModel:
    """
    All footprints and sources, with the same events as a Scene with a configured frame_id.

    Methods that take a message return why it is refused, None if it is not.
    """

    def __init__(self, settings):
        self.settings = settings
        self.tracks_motion = True
        self._footprints = {one.name: Place() for one in settings.footprints}
        self._sources = {
            one.name: SourceModel(one, nanoseconds(settings.future_tolerance))
            for one in settings.obstacles}

    def step_back(self, now):
        """Step back in time."""
        self._footprints = dict.fromkeys(self._footprints, Place(
            fault='has not been received since the clock was set'))
        for source in self._sources.values():
            source.step_back(now)

    def pass_time(self, now):
        """Let time pass."""
        for source in self._sources.values():
            source.pass_time(now)

    def use(self, settings):
        """Apply settings with the same names; what is disabled or enabled is reset."""
        for before, footprint in zip(self.settings.footprints, settings.footprints):
            if before.enabled != footprint.enabled:
                self._footprints[footprint.name] = Place()
        for source in settings.obstacles:
            before = self._sources[source.name]
            if source.enabled != before.settings.enabled:
                before.switch(source)
            before.settings = source
        self.settings = settings

    def settings_of(self, name):
        both = (*self.settings.footprints, *self.settings.obstacles)
        return next(settings for settings in both if settings.name == name)

    def receive(self, name, ring, refusal, stamp, now, instance, number):
        """Receive a message: a ring, an empty polygon, or one that is already refused."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return None
        if name in self._sources and settings.set_end == 'empty_polygon' and (
                ring is None and refusal is None):
            # A mark ends a set whatever its stamp.
            stamp = min(stamp, now)
        if stamp is not None and stamp > now + nanoseconds(self.settings.future_tolerance):
            ring, stamp = None, None
            refusal = FROM_FUTURE if refusal in (None, OTHER_FRAME) else refusal
        if name in self._sources:
            return self._sources[name].receive(
                Message(ring, refusal, stamp, now, instance, number))
        if refusal:
            self._footprints[name] = Place(fault=(
                f"is not in the frame '{self.settings.frame_id}'" if refusal == OTHER_FRAME
                else f'was refused: {refusal}'))
            return refusal
        last, time = self._footprints[name], min(stamp or now, now)
        if not last.fault and settings.timeout and not is_past(settings, last.time, now) and (
                time < last.time):
            return OVERTAKEN
        places = ()
        if self.tracks_motion or settings.min_time_to_collision:
            places = followed_by(() if last.fault else last.places, stamp or now, ring)
        self._footprints[name] = Place(ring, stamp or now, time, '', places)
        return None

    def obstacles(self, now):
        """Return source, key and ring of every obstacle; the key is the ring if no number."""
        return [(name, one.key, one.ring) for name, one in self._held(now)]

    def _held(self, now):
        return [(name, one) for name, source in self._sources.items()
                for one in source.held(now) if one.ring]

    def state(self, name, now):
        """Return a footprint's status, the source and key of its contacts, and reasons."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return 'unknown', set(), [f'footprint {name} is disabled']
        own = settings.obstacles or self._sources
        monitored = [source for key, source in self._sources.items() if key in own]
        faults = self._faults(settings, monitored, now)
        ring, _, time, fault, _ = self._footprints[name]
        if not fault and is_past(settings, time, now):
            fault = f'is older than its timeout of {settings.timeout:g} s'
        if fault:
            return 'unknown', set(), [f'footprint {name} on {settings.topic} {fault}', *faults]
        contacts = {(source, key) for source, key, other in self.obstacles(now)
                    if source in own and separation(ring, other) <= self.settings.margin}
        if contacts:
            return 'collision', contacts, faults
        return 'unknown' if faults else 'clear', set(), faults

    def ahead(self, name, now):
        """Return what a footprint without contact moves towards, None while that is unknown."""
        settings, place = self.settings_of(name), self._footprints[name]
        own = settings.obstacles or self._sources
        velocity = self.state(name, now)[0] == 'clear' and velocity_of(place.places, place.stamp)
        if not velocity or any(velocity) and now - place.time > 2 * SECOND:
            return None
        others, unknown = [], set()
        for source, one in self._held(now):
            moves = source in own and self.settings_of(source).moving
            course = velocity_of(one.places, one.stamp) if moves else (0.0, 0.0)
            if course is None:
                unknown.add((source, one.key))
            if source in own:
                vx, vy = course or (0.0, 0.0)
                since = (place.time - one.time) / SECOND
                others.append((tuple((x + vx * since, y + vy * since) for x, y in one.ring),
                               velocity[0] - vx, velocity[1] - vy))
        return Ahead(place.ring, (now - place.time) / SECOND, self.settings.margin, others,
                     unknown)

    def age(self, name, now):
        """Return a footprint's age in seconds, None if it has no valid position."""
        time = self._footprints[name].time
        return None if time is None else (now - time) / SECOND

    def _faults(self, settings, monitored, now):
        """Return why some obstacles may be missing, in sentences."""
        enabled = [source for source in monitored if source.settings.enabled]
        if not enabled:
            return ['none of its obstacle sources is enabled' if settings.obstacles
                    else 'no obstacle source is enabled']
        return [f'obstacle source {source.settings.name} on {source.settings.topic} '
                for source in enabled if not source.is_known(now)]


@lru_cache(maxsize=None)
def separation(ring, other):
    """Return the distance of two bodies, 0 if they share a point."""
    return shapely.distance(_shape(ring), _shape(other))


@lru_cache(maxsize=None)
def _is_met(ring, other, x, y, margin):
    """Tell whether a body that moves straight by (x, y) comes within a margin of another."""
    moved = [(a + x, b + y) for a, b in ring]
    way = shapely.union_all([_shape(ring), _shape(moved), *(
        shapely.convex_hull(shapely.MultiPoint([ring[k - 1], ring[k], moved[k - 1], moved[k]]))
        for k in range(len(ring)))])
    if margin < 0.0:
        return bool(way.buffer(margin).intersects(_shape(other)))
    return bool(shapely.distance(way, _shape(other)) <= margin)


def _shape(ring):
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(ring), shapely.Polygon)
    return kind(ring if len(ring) > 1 else ring[0])

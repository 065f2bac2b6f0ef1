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

from builders import SECOND
from sat_collision.scene.holders import OTHER_FRAME
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN
import shapely
from source_model import is_past, nanoseconds, Place, SourceModel


class SceneModel:
    """
    All footprints and sources, told of the same events as a Scene whose frame_id is configured.

    What takes a message returns why it is refused, None if it is not.
    """

    def __init__(self, settings, now):
        self.settings = settings
        self.forget_all(now)

    def forget_all(self, now):
        """Begin anew, as after a step back in time."""
        self._footprints = {settings.name: Place() for settings in self.settings.footprints}
        self._sources = {settings.name: SourceModel(settings, now)
                         for settings in self.settings.obstacles}

    def advance(self, now):
        """Let time pass when all that was sent until now has been told."""
        for source in self._sources.values():
            source.advance(now)

    def use(self, settings, now):
        """Apply other settings of the same names; what is disabled, or was, forgets all."""
        for settings_before, footprint in zip(self.settings.footprints, settings.footprints):
            if settings_before.enabled != footprint.enabled:
                self._footprints[footprint.name] = Place()
        for source in settings.obstacles:
            before = self._sources[source.name]
            if source.enabled and before.settings.enabled:
                before.settings = source
            elif source.enabled or before.settings.enabled:
                self._sources[source.name] = SourceModel(source, now, before.publishers)
        self.settings = settings

    def settings_of(self, name):
        both = (*self.settings.footprints, *self.settings.obstacles)
        return next(settings for settings in both if settings.name == name)

    def place(self, name, ring, stamp, now, instance=None):
        """Take a body of a footprint or source."""
        if not self.settings_of(name).enabled:
            return None
        if self._is_from_future(stamp, now):
            return self.refuse(name, FROM_FUTURE, None, now, instance)
        if name in self._sources:
            return self._sources[name].place(ring, stamp, now, instance)
        settings = self.settings_of(name)
        last = self._footprints[name]
        if not last.fault and settings.timeout and not is_past(settings, last.time, now) and (
                0 < stamp < last.stamp):
            return OVERTAKEN
        self._footprints[name] = Place(ring, min(stamp or now, now), '', stamp or now)
        return None

    def refuse(self, name, reason, stamp, now, instance=None):
        """Take a message without a usable body; stamp and instance are None where unknown."""
        if not self.settings_of(name).enabled:
            return None
        if stamp is not None and self._is_from_future(stamp, now):
            stamp = None
            reason = FROM_FUTURE if reason == OTHER_FRAME else reason
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
        if self._is_from_future(stamp, now):
            return self.refuse(name, FROM_FUTURE, None, now)
        return self._sources[name].heartbeat(stamp, now)

    def _is_from_future(self, stamp, now):
        return stamp > now + nanoseconds(self.settings.future_tolerance)

    def note_waiting(self, name, are_waiting):
        """Take note of whether messages of a source wait to be told."""
        if name in self._sources:
            self._sources[name].are_waiting = are_waiting

    def overwhelm(self, name, overwhelmed):
        """Take note of whether a source sends more than can be checked."""
        self._sources[name].overwhelmed = overwhelmed

    def lose(self, name, now):
        """Take note that messages were lost; of a footprint that means nothing."""
        if name in self._sources and self.settings_of(name).enabled:
            self._sources[name].lose(now)

    def miss_body(self, name, ring, now):
        """Take note that a body was sent just before the last message, and never came."""
        if self.settings_of(name).enabled:
            self._sources[name].miss_body(ring, now)

    def meet_publisher(self, name, from_beginning):
        """Take note that the next message is the first heard of a publisher, or sent by it."""
        self._sources[name].meet_publisher(from_beginning)

    def count_publishers(self, name, count, now):
        """Take note of how many publishers there are for a source."""
        self._sources[name].count_publishers(count, now)

    def obstacles(self, now):
        """Return source, key and ring of every obstacle; the key is the ring if no number."""
        return [(name, key, place.ring) for name, source in self._sources.items()
                for key, place in source.held(now) if place.ring]

    def must_not_be_clear(self, name, now):
        """Tell if a footprint meets a body of the last whole set, or of what is newer."""
        return any(separation(self._footprints[name].ring, ring) <= self.settings.margin
                   for source in self._minded(name) if source.settings.enabled
                   for ring in source.last_whole_and_newer(now))

    def state(self, name, now):
        """Return a footprint's status in a word, source and key of its contacts, and reasons."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return 'unknown', set(), [f'footprint {name} is disabled']
        doubts = self._doubts(name, now)
        minded = {source.settings.name for source in self._minded(name)}
        ring, time, fault, _ = self._footprints[name]
        if not fault and is_past(settings, time, now):
            fault = f'is older than its timeout of {settings.timeout:g} s'
        if fault:
            return 'unknown', set(), [f'footprint {name} on {settings.topic} {fault}', *doubts]
        contacts = {(source, key) for source, key, other in self.obstacles(now)
                    if source in minded and separation(ring, other) <= self.settings.margin}
        if contacts:
            return 'collision', contacts, doubts
        return 'unknown' if doubts else 'clear', set(), doubts

    def age(self, name, now):
        """Return a footprint's age in seconds, None if there is no good one."""
        time = self._footprints[name].time
        return None if time is None else (now - time) / SECOND

    def _minded(self, name):
        """Return the sources that concern a footprint: its own, all if it has none."""
        own = self.settings_of(name).obstacles or self._sources
        return [source for key, source in self._sources.items() if key in own]

    def _doubts(self, name, now):
        """Return why there may be obstacles that nobody told of, in sentences."""
        enabled = [source for source in self._minded(name) if source.settings.enabled]
        if not enabled:
            return ['none of its obstacle sources is enabled' if self.settings_of(name).obstacles
                    else 'no obstacle source is enabled']
        return [f'obstacle source {source.settings.name} on {source.settings.topic} {doubt}'
                for source in enabled for doubt in source.doubts(now)]


def with_one(settings, name, **changes):
    """Return the Settings with one footprint or source changed."""
    return replace(settings, **{
        kind: tuple(replace(each, **changes) if each.name == name else each
                    for each in getattr(settings, kind)) for kind in ('footprints', 'obstacles')})


@lru_cache(maxsize=None)
def separation(ring, other):
    """Return the distance of two bodies, 0 if they share a point."""
    return shapely.distance(_shape(ring), _shape(other))


def _shape(ring):
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(ring), shapely.Polygon)
    return kind(ring if len(ring) > 1 else ring[0])

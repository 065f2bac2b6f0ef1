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

"""What touched as it was recorded: everything where it was at each time, by its own stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import chain
from typing import TypeVar

from sat_collision.geometry.polygon import PlaneMap
from sat_collision.monitor import Monitor
from sat_collision.replay.film import Film
from sat_collision.replay.motion.bodies import Bodies, Ring
from sat_collision.replay.motion.encounters import Step
from sat_collision.replay.motion.filming import MotionFilm
from sat_collision.replay.motion.named import NamedTrail
from sat_collision.replay.motion.poses import Poses
from sat_collision.replay.motion.sets import SetTrail
from sat_collision.replay.motion.tracks import Track
from sat_collision.replay.motion.trails import Emit, LONGEST, Trail
from sat_collision.replay.motion.walker import Walker
from sat_collision.replay.result import Contact, FootprintResult, Unknown
from sat_collision.scene.footprints import Footprint
from sat_collision.scene.holders import SetOfObstacles
from sat_collision.scene.observer import Observer
from sat_collision.scene.obstacles import Obstacle, ObstacleId
from sat_collision.scene.settings import ObstacleSettings, Settings

_Kind = TypeVar('_Kind', SetTrail, NamedTrail)


class Motion(Observer):
    """
    Answers whether footprints touched obstacles, from what a scene takes.

    What is taken, and until when it is there, the scene says; where it was then is a matter of
    the stamps. Nothing is decided before it is known where a footprint has gone, and nothing is
    kept for long after that.

    Parameters
    ----------
    settings : Settings
    results : list of FootprintResult
        To be filled in.
    film : Film, optional
        To be filled.

    Attributes
    ----------
    monitor : Monitor
        That is given the messages; to be set before it is.
    now : int
        The present time in ns, to be set before the monitor is told anything.
    contacts : list of Contact
        In the order in which they were found.

    """

    monitor: Monitor

    def __init__(self, settings: Settings, results: list[FootprintResult],
                 film: Film | None = None) -> None:
        self.now = 0
        self.contacts: list[Contact] = []
        self._film = film and MotionFilm(film)
        self._max_vertices = settings.max_vertices
        self._frame_id = settings.frame_id
        self._sources = {source.name: source for source in settings.obstacles}
        self._sets: dict[str, SetTrail] = {}
        self._named: dict[str, NamedTrail] = {}
        keep = 3 * max(map(_patience, settings.obstacles), default=0)
        self._footprints = {one.name: one for one in settings.footprints}
        self._walkers = {result.name: Walker(
            result, self.contacts, self._footprints[result.name].timeout,
            settings.margin, keep)
            for result in results}

    def place_footprint(self, footprint: Footprint) -> None:
        """Take a footprint that the scene has taken."""
        if footprint.frame_id != self._frame_id:
            self._frame_id = footprint.frame_id
            for trail in self._trails():
                trail.use_frame(self._frame_id)
            for walker in self._walkers.values():
                walker.skip()
        name = footprint.settings.name
        walker = self._walkers[name]
        stamp = self._stamp()
        if name in self.monitor.outlines.names:
            self._follow(walker.track, footprint, stamp)
        walker.track.add(self._body(name, stamp, self.monitor.teller.plane))
        if self._film:
            self._film.walk(name, walker.track)
        for trail in self._trails():
            trail.rest(self.now)
        walker.walk(self.now)

    def _follow(self, track: Track, footprint: Footprint, stamp: int) -> None:
        """Let the track of an outline follow its frame to where it is placed now."""
        begin = track.begin_of_way(stamp)
        if begin is None:
            return
        settings = footprint.settings
        poses = Poses(self.monitor.transforms, settings.frame_id,
                      self.monitor.teller.points).between(begin, stamp)
        if poses is None:
            track.lose_way(stamp)
            return
        for time, plane in poses:
            track.add(self._body(settings.name, time, plane, is_between=True))

    def _body(self, name: str, stamp: int, plane: PlaneMap | None,
              is_between: bool = False) -> Bodies:
        """Return the footprint of which the scene is told, at a time."""
        return Bodies([ObstacleId(name, 0)], [stamp], [(self.monitor.teller.points, plane)],
                      self._max_vertices, is_between=is_between)

    def remove_footprint(self, footprint: Footprint) -> None:
        """Take note that a footprint is nowhere."""
        self._walkers[footprint.settings.name].track.lose()

    def begin_set(self, source: str, stamp: int) -> None:
        """Take note that a set begins."""
        self._trail(source, self._sets, SetTrail).begin(stamp)

    def place_obstacle(self, obstacle: Obstacle) -> None:
        """Take an obstacle that the scene has taken."""
        source = obstacle.name.source
        trail: Trail = self._sets[source] if isinstance(obstacle.held_by, SetOfObstacles) else (
            self._trail(source, self._named, NamedTrail))
        trail.place(obstacle, self._stamp(), self._ring())

    def remove_obstacle(self, obstacle: Obstacle) -> None:
        """Take note that the scene holds an obstacle no longer."""
        source = obstacle.name.source
        for trail in (self._sets.get(source), self._named.get(source)):
            if trail is not None:
                trail.forget(obstacle, self.now)

    def finish(self, end: int) -> None:
        """Decide all that is left, now that the recording is over."""
        self.now = end
        latest = [walker.track.latest for walker in self._walkers.values()]
        # What is told after the last footprint is of no interest.
        last = max((time for time in latest if time is not None), default=end)
        for trail in self._trails():
            trail.rest(last, is_over=True)
        for name, walker in self._walkers.items():
            walker.finish(end)
            if self._film:
                self._film.walk(name, walker.track)
        if self._film:
            self._film.finish(end)

    def draw_curves(self, unknown: Iterable[Unknown]) -> None:
        """Fill in the separations over time, given when nothing was known."""
        for walker in self._walkers.values():
            walker.findings.draw_curve(unknown)

    def undecided(self, name: str) -> int:
        """Return for how long (ns) it was not known how a footprint or obstacles moved."""
        if name in self._walkers:
            return self._walkers[name].undecided
        return sum(trail.undecided for trail in (self._sets.get(name), self._named.get(name))
                   if trail is not None)

    def is_decided(self, name: str) -> bool:
        """Tell whether a footprint was ever decided against all obstacles that there were."""
        return self._walkers[name].is_decided

    def _stamp(self) -> int:
        """Return when that was there which the scene is told of now."""
        return self.monitor.teller.stamp or self.now

    def _ring(self) -> Ring:
        """Return where it was."""
        return self.monitor.teller.points, self.monitor.teller.plane

    def _trails(self) -> Iterable[Trail]:
        return chain(self._sets.values(), self._named.values())

    def _trail(self, source: str, trails: dict[str, _Kind],
               kind: Callable[[int, int, Emit], _Kind]) -> _Kind:
        """Return the trail of a source, a new one if it has none yet."""
        trail = trails.get(source)
        if trail is None:
            trail = trails[source] = kind(
                _patience(self._sources[source]), self._max_vertices,
                partial(self._take, source))
            trail.use_frame(self._frame_id)
        return trail

    def _take(self, source: str, trail: Trail, step: Step) -> None:
        """Take a step of a trail, to be decided for each footprint when its way is known."""
        if self._film:
            self._film.follow(trail, step)
        for name, walker in self._walkers.items():
            if self._footprints[name].minds(source):
                walker.queue(trail, step, self.now)
            if self._film:
                self._film.walk(name, walker.track)


def _patience(source: ObstacleSettings) -> int:
    """Return over how long a motion of a source's obstacles is made up at most, ns."""
    return min(round(source.timeout * 1e9) or LONGEST, LONGEST)

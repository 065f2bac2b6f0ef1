# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
Times to collision of a footprint, if all bodies had kept their velocities.

The velocity of a footprint at a message is a constant twist: that of its trajectory from there on,
or if it has commands that of the last one before. Each obstacle moves on straight at its velocity
between two messages.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterable
from math import inf
from operator import attrgetter, itemgetter
from sys import maxsize
from typing import TypeAlias

import numpy as np
from sat_collision.geometry.body.polygon import Polygon, PolygonError
from sat_collision.geometry.sets.polygon_set import PolygonSet
from sat_collision.replay.model.result import FootprintResult, Series, Soonest, Unknown
from sat_collision.replay.motion.bodies import LinearMotion
from sat_collision.replay.motion.tracker import Step
from sat_collision.replay.motion.trajectories import Trajectory
from sat_collision.scene.parameters import outline_of
from sat_collision.scene.settings import FootprintSettings
from sat_collision.scene.velocity import (
    AT_REST, COMMAND, Command, fitted, FOOTPRINTS, pose_between, Velocity, VELOCITY_LASTS)

# How far ahead to look unless a longer time is asked for, s.
HORIZON = 3.0
# Collisions are predicted at the first message of a footprint in each interval of so many ns.
_EVERY = 10**8
# Obstacles out of reach by more than this, m, are skipped.
_SLACK = 1e-3
# Bound of the rounding of a determinant, relative to the squares of its numbers.
_ROUNDING = 1e-12
_time_of = attrgetter('time')

# Seconds to a contact, infinity if there is none within the horizon, and with which obstacle.
_Found: TypeAlias = tuple[float, str]


class Predictor:
    """
    Predicts at messages of one footprint when it would have touched an obstacle.

    It looks ahead up to the horizon, in s. Bodies apart by up to the margin, in m, collide.
    """

    def __init__(self, settings: FootprintSettings, trajectory: Trajectory, horizon: float,
                 margin: float) -> None:
        self._settings = settings.command
        # The limit of vertices was checked before.
        self._outline = np.array(outline_of(settings, maxsize) if settings.command else ())
        self._commands: list[Command] = []
        self._trajectory = trajectory
        self._horizon = horizon
        self._margin = margin
        self._found: dict[int, _Found] = {}

    def command(self, command: Command) -> None:
        """Add a command, which holds from its time on."""
        insort(self._commands, command, key=_time_of)

    def drop_before(self, time: int) -> None:
        """Drop the commands that no longer hold at a time."""
        del self._commands[:bisect_right(self._commands, time - VELOCITY_LASTS, key=_time_of)]

    def look_ahead(self, step: Step) -> None:
        """Predict collisions in a step; the trajectory through it must be known."""
        for motion in step.motions:
            for time in self._times(motion.begin, motion.end):
                link = self._trajectory.link_from(time)
                own = self._trajectory.outline(time)
                velocity = link and self._velocity(link, time)
                if own and velocity:
                    found = self._first(own, velocity, motion, time)
                    self._found[time] = min(found, self._found.get(time, found))

    def finish(self, result: FootprintResult, unknown: Iterable[Unknown]) -> None:
        """Fill in the times to collision, except while the footprint is unknown."""
        gaps = [(one.first, one.last) for one in unknown if one.footprint == result.name]
        samples: dict[int, float | None] = {first: None for first, _ in gaps}
        for time, (seconds, obstacle) in self._found.items():
            if any(first <= time < last for first, last in gaps):
                continue
            samples[time] = None if seconds == inf else seconds
            least = result.soonest
            if seconds < (least.time_to_collision if least else inf):
                result.soonest = Soonest(seconds, time, obstacle)
        series = Series(result.time_to_collision)
        for sample in sorted(samples.items(), key=itemgetter(0)):
            series.add(*sample)

    def _velocity(self, link: LinearMotion, time: int) -> Velocity | None:
        """Return the velocity at a time, at which the link begins."""
        if not self._settings:
            # Fitted backwards in time, so that its frame is at the beginning.
            start, finish = link.begin, link.end
            return fitted(link.ring(0, finish), link.ring(0, start), (start - finish) / 1e9,
                          FOOTPRINTS)
        k = bisect_right(self._commands, time, key=_time_of)
        command = self._commands[k - 1] if k else None
        if not (command and command.holds(time, self._settings.timeout)):
            return None
        outline, ring = self._outline, link.ring(0, time)
        shape = (outline - outline.mean(0)).T @ (ring - ring.mean(0))
        # Its determinant is negative then, and about 0 for an outline that is a segment.
        is_upside_down = bool(np.linalg.det(shape) < -_ROUNDING * (shape * shape).sum())
        pose = pose_between(outline * (1, -1) if is_upside_down else outline, ring)
        return Velocity(AT_REST, pose, COMMAND, is_upside_down).by(command.twist)

    def _times(self, start: int, finish: int) -> list[int]:
        """Return the times to predict at, from one time until before another."""
        samples = self._trajectory.samples(start - start % _EVERY - 1, finish - 1)
        firsts = {time // _EVERY: time for time in reversed(samples)}
        return [time for time in firsts.values() if time >= start]

    def _first(self, own: Polygon, velocity: Velocity, motion: LinearMotion, time: int) -> _Found:
        """Return when the footprint first touches any of the bodies that move from a time on."""
        starts, finishes = motion.starts, motion.finishes
        moved = motion.after.middles[motion.next_rows] - motion.before.middles[motion.rows]
        velocities = moved / np.maximum(finishes - starts, 1)[:, None] * 1e9
        speeds = velocity.fastest(own.bounds) + np.hypot(*velocities.T)
        box, boxes = np.array(own.bounds), motion.boxes
        gaps = np.maximum(boxes[:, :2] - box[2:], box[:2] - boxes[:, 2:]).max(axis=1)
        near = gaps <= _SLACK + self._margin + self._horizon * speeds
        names, polygons, rows = [], [], []
        for i in np.flatnonzero(near & (starts <= time) & (time < finishes)).tolist():
            try:
                polygons.append(motion.polygon(i, time))
            except PolygonError:
                continue
            names.append(str(motion.before.names[motion.rows[i]]))
            rows.append(i)
        found = polygons and PolygonSet(polygons).first_contact(
            own, velocity.twist, self._horizon, velocities[rows], velocity.pose,
            margin=self._margin)
        return (found[1], names[found[0]]) if found else (inf, '')

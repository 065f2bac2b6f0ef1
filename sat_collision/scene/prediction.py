# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The time to collision of a footprint that keeps its velocity."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
import math
from typing import NamedTuple

import numpy as np
from sat_collision.geometry.body.polygon import Polygon, PolygonError
from sat_collision.scene.contacts import Contacts, Course
from sat_collision.scene.footprints import Footprint, Status
from sat_collision.scene.obstacles import Obstacle, ObstacleId
from sat_collision.scene.sources import Source
from sat_collision.scene.velocity import (
    FOOTPRINTS, TRANSFORMS, Translation, Velocity, VELOCITY_LASTS)

# Obstacles that stay further away than this, m, are left out.
_SLACK = 1e-3
# Bound of the rounding of a distance, relative to the coordinates.
_ROUNDING = 1e-9


class Prediction(NamedTuple):
    """When a footprint will be in contact if it and the obstacles keep their velocities."""

    seconds: float  # from now; 0 in contact, infinity if there is none within the horizon
    obstacle: ObstacleId | None  # that it is in contact with then
    # From the stamp of the footprint on; None only while in contact, where none is needed.
    velocity: Velocity | None
    duration: float  # from the stamp until the contact, in s
    # Obstacles of unknown motion, sorted: they are assumed to stand, so the contact may be sooner.
    # Empty where it cannot.
    unknown: tuple[ObstacleId, ...] = ()

    @property
    def is_known(self) -> bool:
        """Whether the time is known; if not, it is an upper bound."""
        return not self.unknown


def velocity_of(footprint: Footprint, now: int) -> Velocity | str:
    """
    Return the velocity of a footprint from its stamp on, or why it is unknown.

    The reason is empty where the last two places of the footprint give no velocity.
    """
    settings, command = footprint.settings.command, footprint.command
    if settings:
        if not command:
            return f'no command on {settings.topic} yet'
        if command.refusal:
            return f'the last command on {settings.topic} was refused: {command.refusal}'
        if not command.holds(now, settings.timeout):
            return f'no command on {settings.topic} for {(now - command.time) / 1e9:.1f} s'
    if footprint.time is None:
        return ''
    velocity = footprint.motion.velocity(
        footprint.stamp, TRANSFORMS if footprint.settings.has_outline else FOOTPRINTS)
    if velocity and command:
        velocity = velocity.by(command.twist)
    if velocity and any(velocity.twist) and now - footprint.time > VELOCITY_LASTS:
        return f'its last place is of {(now - footprint.time) / 1e9:.1f} s ago'
    return velocity or ''


def predict(footprint: Footprint, contacts: Contacts, sources: Iterable[Source], now: int,
            horizon: float) -> Prediction | None:
    """
    Return when a footprint will be in contact, None while its state or its velocity is unknown.

    `sources` are all of the scene; the horizon is in s.
    """
    if footprint.status is Status.UNKNOWN or footprint.time is None:
        return None
    known = velocity_of(footprint, now)
    velocity = known if isinstance(known, Velocity) else None
    if footprint.contacts:
        first = min(obstacle.name for obstacle in footprint.contacts)
        return Prediction(0.0, first, velocity, 0.0)
    # The motion begins where the footprint was at its stamp.
    age = max(now - footprint.time, 0)
    own = footprint.polygon
    if velocity is None or own is None:
        return None
    seconds = horizon + age / 1e9
    bounds = own.bounds
    reach = contacts.margin + velocity.fastest(bounds) * seconds
    courses: dict[Obstacle, Course] = {}
    unknown = []
    for obstacle in chain.from_iterable(
            source.store for source in sources if source.settings.moving
            and footprint.settings.monitors(source.settings.name)):
        if obstacle.row is None:
            continue
        motion = obstacle.motion and obstacle.motion.translation(obstacle.stamp)
        time = min(obstacle.time, now)
        if not motion or now - time > VELOCITY_LASTS and (motion.vx or motion.vy):
            unknown.append(obstacle.name)
            continue
        ahead = (footprint.time - time) / 1e9
        # One that is left out is assumed to stand where it was seen: the way from there counts.
        speed = math.hypot(motion.vx, motion.vy)
        if _is_apart(bounds, motion, reach + speed * (seconds + abs(ahead))):
            continue
        if course := _course(obstacle, motion, ahead):
            courses[obstacle] = course
        else:
            unknown.append(obstacle.name)
    try:
        found = contacts.first_contact(footprint, velocity, seconds, courses)
    except ValueError:  # the way leads beyond the largest double
        return None
    seconds = max(found[1] - age / 1e9, 0.0) if found else math.inf
    if seconds == 0.0:
        unknown.clear()
    if not found or seconds > horizon:
        return Prediction(math.inf, None, velocity, math.inf, tuple(sorted(unknown)))
    return Prediction(seconds, found[0].name, velocity, found[1], tuple(sorted(unknown)))


def _is_apart(bounds: tuple[float, float, float, float], motion: Translation,
              distance: float) -> bool:
    """Return whether the circle round an obstacle is surely further away than a distance."""
    low_x, low_y, high_x, high_y = bounds
    x = max(low_x - motion.x, motion.x - high_x, 0.0)
    y = max(low_y - motion.y, motion.y - high_y, 0.0)
    rounding = _ROUNDING * (abs(motion.x) + abs(motion.y) + x + y)
    return math.hypot(x, y) - motion.radius - rounding > distance + _SLACK


def _course(obstacle: Obstacle, motion: Translation, ahead: float) -> Course | None:
    """Return where an obstacle is `ahead` s after its stamp, and its velocity; None if nowhere."""
    polygon, velocity = obstacle.polygon, np.array((motion.vx, motion.vy))
    if polygon is None:
        return None
    moved = ahead * velocity
    try:
        return (Polygon(polygon.vertices + moved) if moved.any() else polygon), velocity
    except PolygonError:  # so thin that rounding makes it none
        return None

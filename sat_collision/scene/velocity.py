# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The velocity of a footprint: from a command, from odometry, or fitted to its last two places.

Both places have the same vertices in the same order. The rotation between them by least squares
has a closed form in the plane, and so has the constant twist between two poses: a body on an arc
gets the twist of that arc. Noise is not smoothed: two places 0.1 s apart with independent errors
of 1 cm give a velocity with an error of 0.14 m/s.
"""

from __future__ import annotations

from collections import deque
import math
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.body.polygon import Affine2D

ODOMETRY = 'odometry'
TRANSFORMS = 'transforms'
FOOTPRINTS = 'footprints'
COMMAND = 'command'

# For so long, in ns, a body is assumed to keep its velocity.
VELOCITY_LASTS = 2 * 10**9

Vertices: TypeAlias = NDArray[np.float64]
# vx and vy in m/s along the axes of a body's frame, omega in rad/s, counter-clockwise.
Twist: TypeAlias = tuple[float, float, float]
AT_REST: Twist = (0.0, 0.0, 0.0)
# A body's frame in the fixed frame: x and y in m, yaw in rad.
Pose: TypeAlias = tuple[float, float, float]

# Least and greatest time between two places that a velocity is fitted to, in ns.
_SHORTEST = 10**7
_LONGEST = 2 * 10**9
_MAX_PLACES = 100
# Greater velocities, in m/s or rad/s, are not those of a robot.
FASTEST = 1e3
# Of a translation, all vertices have the same velocity but for this, in m/s.
_MAX_SPREAD = 0.05
# Of a rigid motion, the outline changes by no more than this share of its size.
_MAX_CHANGE = 0.1


class Velocity(NamedTuple):
    """How a body moves: by a constant twist."""

    twist: Twist
    pose: Pose
    origin: str  # where the twist comes from: COMMAND, ODOMETRY, TRANSFORMS or FOOTPRINTS
    # Whether its frame is upside down: pose and twist are those of the frame turned up about x.
    is_upside_down: bool = False

    @classmethod
    def in_frame(cls, affine: Affine2D, twist: Twist, origin: str) -> Velocity:
        """Return that of a twist in a frame, from the map that takes it to the fixed frame."""
        return cls(AT_REST, pose_of(affine), origin, is_upside_down(affine)).by(twist)

    def by(self, twist: Twist) -> Velocity:
        """Return the same with another twist, in the frame."""
        vx, vy, omega = twist
        return self._replace(twist=(vx, -vy, -omega) if self.is_upside_down else twist)

    def fastest(self, bounds: tuple[float, float, float, float]) -> float:
        """Return a bound of the speed, m/s, of points within min x, min y, max x and max y."""
        vx, vy, omega = self.twist
        x, y, _ = self.pose
        low_x, low_y, high_x, high_y = bounds
        radius = math.hypot(max(x - low_x, high_x - x), max(y - low_y, high_y - y))
        return math.hypot(vx, vy) + abs(omega) * radius

    def carry(self, vertices: Vertices, seconds: float) -> Vertices:
        """Return where (n, 2) vertices are after a time."""
        vx, vy, omega = self.twist
        x, y, yaw = self.pose
        half = omega * seconds / 2.0
        along = seconds * math.sin(half) / half if half else seconds
        way = along * _rotation(yaw + half) @ (vx, vy)
        moved: Vertices = (vertices - (x, y)) @ _rotation(omega * seconds).T + (x, y) + way
        return moved


class Translation(NamedTuple):
    """The motion of a body that does not turn, and a circle round its last place; m and m/s."""

    vx: float
    vy: float
    x: float
    y: float
    radius: float


class Command(NamedTuple):
    """The last command of a footprint."""

    time: int  # its stamp in ns, not in the future
    twist: Twist = AT_REST  # in the frame of the outline
    refusal: str = ''  # why it was refused; empty if it was not

    def holds(self, now: int, timeout: float) -> bool:
        """Return whether it holds at a time in ns, given for how many s it does."""
        return not self.refusal and now - self.time <= timeout * 1e9


class MotionTracker:
    """Keeps the last places of a body, and the velocity that was given with the last one."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all: the clock was set back, or the body was lost."""
        self._places: deque[tuple[int, Vertices]] = deque(maxlen=_MAX_PLACES)
        self._given: Velocity | None = None
        self._translation: Translation | None = None
        self._is_translation_current = False

    def place(self, time: int, vertices: Vertices, given: Velocity | None = None) -> None:
        """
        Add the place of the body at a stamp in ns, with its velocity if that is given.

        The vertices are in metres in the fixed frame, in the order in which they were sent.
        """
        if self._places and time < self._places[-1][0]:
            self.clear()
        if self._places and time == self._places[-1][0]:
            self._places.pop()
        self._places.append((time, vertices))
        while len(self._places) > 1 and time - self._places[1][0] >= _SHORTEST:
            self._places.popleft()
        self._given = given
        self._is_translation_current = False

    def velocity(self, time: int, origin: str) -> Velocity | None:
        """
        Return the velocity at the stamp of the last place: the given one, else a fitted one.

        None while unknown, and at any other time. `origin` is that of a fitted velocity.
        """
        if not self._places or self._places[-1][0] != time:
            return None
        if self._given is not None and is_plausible(self._given.twist):
            return self._given
        found = self._last_two()
        return found and fitted(*found, origin)

    def translation(self, time: float) -> Translation | None:
        """Return the translation at a time, as `velocity` does; None if the body turns."""
        if not self._places or self._places[-1][0] != time:
            return None
        if not self._is_translation_current:
            self._is_translation_current = True
            found = self._last_two()
            self._translation = found and translated(*found)
        return self._translation

    def _last_two(self) -> tuple[Vertices, Vertices, float] | None:
        """Return the two places that a velocity is fitted to, and the time between them in s."""
        (since, before), (last, after) = self._places[0], self._places[-1]
        if before.shape != after.shape or not _SHORTEST <= last - since <= _LONGEST:
            return None
        return before, after, (last - since) / 1e9


def translated(before: Vertices, after: Vertices, seconds: float) -> Translation | None:
    """Return the translation of vertices, None if not all moved alike."""
    velocities = (after - before) / seconds
    mean, centre = velocities.mean(0), after.mean(0)
    # An overflow makes NaN, which fails both comparisons.
    if not (np.abs(velocities - mean).max() <= _MAX_SPREAD and np.abs(mean).max() <= FASTEST):
        return None
    (vx, vy), (x, y) = mean.tolist(), centre.tolist()
    return Translation(vx, vy, x, y, float(np.hypot(*(after - centre).T).max()))


def fitted(before: Vertices, after: Vertices, seconds: float, origin: str) -> Velocity | None:
    """
    Return the twist that takes vertices to where they are now, None if no rigid motion does.

    Its frame is at the mean of the vertices, and parallel to the fixed frame now.
    """
    start, end = before.mean(0), after.mean(0)
    *_, turn = pose_between(before, after)
    change = np.linalg.norm(after - end - (before - start) @ _rotation(turn).T)
    if not change <= _MAX_CHANGE * np.linalg.norm(after - end):
        return None
    half = turn / 2.0
    stretch = half / math.sin(half) if half else 1.0
    vx, vy = (stretch / seconds * _rotation(half) @ (end - start)).tolist()
    velocity = Velocity((vx, vy, turn / seconds), (*end.tolist(), 0.0), origin)
    return velocity if is_plausible(velocity.twist) else None


def pose_between(before: Vertices, after: Vertices) -> Pose:
    """Return the pose that takes vertices from one place to another, by least squares."""
    start, end = before.mean(0), after.mean(0)
    a, b = before - start, after - end
    yaw = math.atan2(float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()), float((a * b).sum()))
    x, y = (end - _rotation(yaw) @ start).tolist()
    return x, y, yaw


def pose_of(affine: Affine2D) -> Pose:
    """Return x, y and yaw of a frame, from the map that takes it to the fixed frame."""
    a, _, x, d, _, y = affine
    return x, y, math.atan2(d, a)


def is_upside_down(affine: Affine2D) -> bool:
    """Return whether a frame is upside down, from the map that takes it to the fixed frame."""
    a, b, _, d, e, _ = affine
    return a * e < b * d


def is_plausible(twist: Twist) -> bool:
    """Return whether a twist is finite and not too fast."""
    return all(abs(value) <= FASTEST for value in twist)


def _rotation(angle: float) -> NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([(c, -s), (s, c)])

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The embedded scene of the demo: robots that drive through a warehouse, and their contacts.

Plain geometry in metres in the frame 'map', x along the aisles. It needs no ROS.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Outline: TypeAlias = NDArray[np.float64]
_Pose: TypeAlias = tuple[float, float, float]  # x, y, heading
_Path: TypeAlias = Sequence[tuple[float, float, float, float]]  # way points: time, pose

FRAME = 'map'
DURATION = 16.0
# Least x and y and greatest x and y of all bodies and of the texts beside them.
BOUNDS = (0.3, 1.5, 20.7, 11.5)


def _box(min_x: float, min_y: float, max_x: float, max_y: float) -> Outline:
    return np.array([(min_x, min_y), (max_x, min_y), (max_x, max_y), (min_x, max_y)], float)


def _disc(x: float, y: float, radius: float, sides: int) -> Outline:
    angles = 2.0 * np.pi * np.arange(sides) / sides
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


# The outline that ends a set of obstacles.
NOTHING: Outline = np.empty((0, 2))

# Four shelves, two pillars, and a wall as a segment.
STATIC = (
    _box(3.0, 2.0, 8.0, 3.0),
    _box(10.0, 2.0, 15.0, 3.0),
    _box(3.0, 8.0, 8.0, 9.0),
    _box(10.0, 8.0, 15.0, 9.0),
    _disc(9.0, 5.5, 0.25, 8),
    _disc(17.0, 5.5, 0.25, 8),
    np.array([(1.0, 11.0), (19.0, 11.0)]),
)

# Footprints in the robot's own frame, x forward; that of the forklift is an L.
FOOTPRINTS = {
    'amr': _box(-0.4, -0.3, 0.4, 0.3),
    'forklift': np.array([(-0.6, -0.5), (1.0, -0.5), (1.0, -0.2), (0.3, -0.2), (0.3, 0.5),
                          (-0.6, 0.5)]),
    'cart': _box(-0.5, -0.5, 0.5, 0.5),
}

# Way points: time (s), x, y, heading (rad). The forklift takes a pillar into its notch without
# touching it, then backs into a shelf. The cart touches the wall exactly, edge on edge.
_PATHS: dict[str, _Path] = {
    'amr': [(0, 1.0, 4.0, 0), (16, 18.0, 4.0, 0)],
    'forklift': [(0, 6.0, 5.35, 0), (4, 8.35, 5.35, 0), (8, 8.35, 5.35, 0), (10, 6.0, 5.35, 0),
                 (12, 6.0, 7.65, 0), (13, 6.0, 7.65, 0), (15, 6.0, 5.35, 0), (16, 6.0, 5.35, 0)],
    'cart': [(0, 17.0, 9.5, 0), (6, 15.0, 10.5, 0), (9, 12.0, 10.5, 0), (12, 12.0, 9.75, 0),
             (16, 17.0, 9.75, 0)],
}
_PERSON_PATH: _Path = [(0, 12.0, 7.0, 0), (5, 11.0, 7.0, 0), (11, 11.0, 3.4, 0), (16, 9.0, 3.4, 0)]
_PERSON = _disc(0.0, 0.0, 0.3, 12)

# The robot that publishes no footprint: its outline moves with its odometry, and its laser sees
# the person in the robot's own frame.
BY_ODOMETRY = 'amr'

# The robot that brakes: it drives straight along the aisle, where the person is in its way.
BRAKES = 'courier'
COURIER = _box(-0.4, -0.3, 0.4, 0.3)
COURIER_START = 15.5, 7.0, np.pi
COURIER_DISTANCE = 6.9

# The obstacles that each robot touches in turn, as (source, number of the obstacle).
CONTACTS = {'amr': [('people', 0)], 'forklift': [('warehouse', 2)], 'cart': [('warehouse', 6)]}


def footprint(name: str, time: float) -> Outline:
    """Return the (n, 2) footprint of a robot at a time in seconds."""
    return _placed(FOOTPRINTS[name], pose(name, time))


def courier(distance: float) -> Outline:
    """Return the (n, 2) footprint of the robot that brakes, after a distance in metres."""
    x, y, heading = COURIER_START
    return _placed(COURIER, (x + distance * np.cos(heading), y + distance * np.sin(heading),
                             heading))


def person(time: float) -> Outline:
    """Return the (n, 2) outline of the person at a time in seconds."""
    return _placed(_PERSON, _pose(_PERSON_PATH, time))


def pose(name: str, time: float) -> _Pose:
    """Return x, y and heading of a robot at a time in seconds."""
    return _pose(_PATHS[name], time)


def seen_by(name: str, outline: Outline, time: float) -> Outline:
    """Return an outline in the frame of a robot at a time in seconds."""
    x, y, heading = pose(name, time)
    return _turned(outline - (x, y), -heading)


def _pose(path: _Path, time: float) -> _Pose:
    times, *coordinates = zip(*path)
    x, y, heading = (float(np.interp(time, times, values)) for values in coordinates)
    return x, y, heading


def _placed(outline: Outline, pose: _Pose) -> Outline:
    x, y, heading = pose
    placed: Outline = _turned(outline, heading) + (x, y)
    return placed


def _turned(outline: Outline, heading: float) -> Outline:
    cosine, sine = np.cos(heading), np.sin(heading)
    turned: Outline = outline @ np.array([(cosine, sine), (-sine, cosine)])
    return turned

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

"""Outlines of footprints that are given as parameters."""

from __future__ import annotations

import ast
import math
from typing import TypeAlias

import numpy as np
from sat_collision.geometry.polygon import Polygon, PolygonError
from sat_collision.scene.settings import FootprintSettings, Settings

# Its vertices, as float32 numbers: those that a message would carry.
Outline: TypeAlias = tuple[tuple[float, float], ...]

# More than rounding to float32 may take from a disc.
_ROUNDED = 1.0 + 1e-6


class OutlineError(ValueError):
    """A footprint has an invalid outline; the message begins with the parameter."""


def outline_of(settings: FootprintSettings, max_vertices: int) -> Outline:
    """
    Return the outline of a footprint that has one.

    Raises
    ------
    OutlineError

    """
    name = settings.name
    if settings.points and settings.radius:
        raise OutlineError(f'{name}.points and {name}.radius are both given: choose one')
    pairs = _pairs(settings) if settings.points else _disc(settings)
    with np.errstate(over='ignore'):  # it is not finite then, which is reported
        vertices = np.array(pairs, np.float32).astype(np.float64)
    try:
        Polygon(vertices, max_vertices)
    except PolygonError as error:
        raise OutlineError(f'{name}.points are not a simple polygon: {error}') from error
    return tuple((x, y) for x, y in vertices.tolist())


def check(settings: Settings) -> None:
    """
    Check what the settings say of outlines.

    Raises
    ------
    OutlineError

    """
    for one in settings.footprints:
        name = one.name
        if one.has_outline:
            if not one.frame_id or one.frame_id[0] == '/':
                raise OutlineError(f'{name}.frame_id: an outline needs the frame that it moves '
                                   'with, such as base_link, without a slash before it')
            if not settings.frame_id:
                raise OutlineError(f'frame_id: the outline of {name} needs the fixed frame that '
                                   'it moves in, such as odom')
            outline_of(one, settings.max_vertices)
        elif one.cmd_vel:
            raise OutlineError(f'{name}.cmd_vel: a command is in the frame of the robot, and a '
                               f'footprint that is published does not say where that is: give '
                               f'{name}.points or {name}.radius, and {name}.frame_id, instead')
        elif one.frame_id or one.odometry:
            given = 'frame_id' if one.frame_id else 'odometry'
            raise OutlineError(f'{name}.{given} is for an outline: give {name}.points or '
                               f'{name}.radius, too')


def _pairs(settings: FootprintSettings) -> list[tuple[float, float]]:
    """Return the points as they were given."""
    points, name = settings.points, settings.name
    if not isinstance(points, str):
        if len(points) % 2:
            raise OutlineError(f'{name}.points has {len(points)} numbers, but each point has two')
        return list(zip(points[::2], points[1::2]))
    try:
        pairs = [(float(x), float(y)) for x, y in ast.literal_eval(points.strip())]
    # Whatever the parser of Python raises for anything else than a list of pairs.
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError) as error:
        raise OutlineError(f'{name}.points: a string must have the form '
                           "'[[x1, y1], [x2, y2], ...]'") from error
    return pairs


def _disc(settings: FootprintSettings) -> list[tuple[float, float]]:
    """Return a regular polygon whose edges touch the disc from outside."""
    count = settings.radius_vertices
    reach = _ROUNDED * settings.radius / math.cos(math.pi / count)
    return [(reach * math.cos(angle), reach * math.sin(angle))
            for angle in (math.tau * k / count for k in range(count))]

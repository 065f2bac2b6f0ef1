# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random bodies of every kind, and bodies as shapely's geometries, which may move."""

import math

import numpy as np
import pytest
from sat_collision import Polygon

shapely = pytest.importorskip('shapely')

U_SHAPE = np.array([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], float)


def random_body(rng):
    """Return a box, triangle, segment, point or U on a coarse lattice, so that many touch."""
    corner = rng.integers(0, 40, 2) / 2
    kind = rng.integers(5)
    if kind == 0:
        points = corner + U_SHAPE
    elif kind == 1:
        points = corner + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * rng.integers(1, 4)
    else:
        points = corner + rng.integers(-3, 4, (kind - 1, 2))
    return Polygon(points)


def as_shapely(body):
    """Return a Polygon, or a ring of points, as shapely's geometry."""
    vertices = getattr(body, 'vertices', body)
    if len(vertices) > 2:
        return shapely.Polygon(vertices)
    return shapely.LineString(vertices) if len(vertices) == 2 else shapely.Point(vertices[0])


def where(outline, twist, seconds):
    """Return an outline after some time or times, moving straight or around a fixed centre."""
    vx, vy, omega = twist
    seconds, points = np.asarray(seconds)[..., None], shapely.get_coordinates(outline) @ (1, 1j)
    if omega:
        centre = complex(-vy, vx) / omega
        points = centre + np.exp(1j * omega * seconds) * (points - centre)
    else:
        points = points + complex(vx, vy) * seconds
    return shapely.polygons(np.stack([points.real, points.imag], axis=-1))


def first_contact(seconds, outlines, obstacles):
    """Return the first of some times at which an outline meets any obstacle, inf if none does."""
    meets = shapely.intersects(outlines[:, None], obstacles).any(axis=1)
    return seconds[meets.argmax()] if meets.any() else math.inf

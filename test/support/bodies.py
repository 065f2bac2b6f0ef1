# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random bodies of every kind, and bodies as shapely's geometries, which may move."""

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


def as_shapely(polygon):
    vertices = polygon.vertices
    if len(vertices) > 2:
        return shapely.Polygon(vertices)
    return shapely.LineString(vertices) if len(vertices) == 2 else shapely.Point(vertices[0])


def where(outline, twist, seconds):
    """Return an outline after some time, moving straight or around a fixed centre."""
    vx, vy, omega = twist
    if not omega:
        return shapely.affinity.translate(outline, vx * seconds, vy * seconds)
    return shapely.affinity.rotate(outline, omega * seconds, (-vy / omega, vx / omega),
                                   use_radians=True)

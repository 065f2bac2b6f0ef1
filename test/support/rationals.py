# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Exact areas, and exact separations and depths of convex bodies, in rationals."""

from fractions import Fraction
import math

import numpy as np
from sat_collision.scene.rotations import IDENTITY


def twice_area(vertices):
    """Return twice the signed area of a ring, exactly."""
    points = [(Fraction(x), Fraction(y)) for x, y in np.asarray(vertices).tolist()]
    return sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(points, points[1:] + points[:1]))


def exact_distance(a, b):
    """Return the distance of bodies apart: the least of a vertex and an edge, by rationals."""
    least = min(_square_to_edge(vertex, *edge)
                for p, q in ((a, b), (b, a)) for vertex, _ in _edges(p) for edge in _edges(q))
    return square_root(least)


def exact_depth(a, b):
    """Return the depth of convex bodies: the least reach beyond an edge, < 0 if there is none."""
    reaches = []
    for p, q in ((a, b), (b, a)):
        for start, end in _edges(p):
            ex, ey = end[0] - start[0], end[1] - start[1]
            if ex == ey == 0:
                continue
            reach = max(ex * (v[1] - start[1]) - ey * (v[0] - start[0]) for v, _ in _edges(q))
            reaches.append(Fraction(reach * abs(reach), ex * ex + ey * ey))
    least = min(reaches, default=Fraction(0))
    return square_root(least) if least >= 0 else -square_root(-least)


def _edges(polygon):
    """Return the edges of a Polygon, or of a ring of any numbers; integers stay integers."""
    ring = polygon if isinstance(polygon, list) else polygon.vertices.tolist()
    vertices = [[x if isinstance(x, int) else Fraction(x) for x in point] for point in ring]
    return list(zip(vertices, vertices[1:] + vertices[:1]))


def _square_to_edge(vertex, start, end):
    ex, ey = end[0] - start[0], end[1] - start[1]
    wx, wy = vertex[0] - start[0], vertex[1] - start[1]
    along, length = wx * ex + wy * ey, ex * ex + ey * ey
    if along <= 0:
        return Fraction(wx * wx + wy * wy)
    if along >= length:
        return Fraction((vertex[0] - end[0]) ** 2 + (vertex[1] - end[1]) ** 2)
    return Fraction((ex * wy - ey * wx) ** 2, length)


def square_root(square):
    """Return the root of a rational, correct to far more digits than a double has."""
    scale = 2 ** (200 + abs(square.denominator.bit_length() - square.numerator.bit_length()))
    return Fraction(math.isqrt(square.numerator * scale ** 2 // square.denominator), scale)


def rounded(transform):
    """Return a transform of fixed-point numbers in doubles, its quaternion of length 1."""
    x, y, z, *rotation = transform
    length = math.isqrt(sum(number * number for number in rotation))
    one = IDENTITY[-1]
    return (x / one, y / one, z / one, *(number / length for number in rotation))

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

"""Transforms between frames: turned by a unit quaternion, then moved. Plain floats, for speed."""

from __future__ import annotations

import math
from typing import TypeAlias

from sat_collision.geometry.polygon import PlaneMap

# Translation x, y, z in m, then rotation x, y, z, w, a unit quaternion. It takes the coordinates
# of a point in the child frame to those in the parent frame.
Transform: TypeAlias = tuple[float, float, float, float, float, float, float]

IDENTITY: Transform = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)

# How far the square of a quaternion's length may be from 1; tf2 has the same.
_DENORMALISED = 1e-2


def normalised(transform: Transform) -> Transform | None:
    """Return a transform with a rotation of length 1, None if it has none or is not finite."""
    x, y, z, a, b, c, d = transform
    square = a * a + b * b + c * c + d * d
    # Of translations whose sum is beyond the largest double no frame is known to lie so far.
    if not (abs(square - 1.0) <= _DENORMALISED and math.isfinite(x + y + z)):
        return None
    if square == 1.0:
        return transform
    length = math.sqrt(square)
    return x, y, z, a / length, b / length, c / length, d / length


def composed(outer: Transform, inner: Transform) -> Transform:
    """Return the transform that does first the inner one, then the outer one."""
    x, y, z, a, b, c, d = outer
    u, v, w, p, q, r, s = inner
    # Twice the cross product of the outer rotation's axis and the inner translation.
    i = 2.0 * (b * w - c * v)
    j = 2.0 * (c * u - a * w)
    k = 2.0 * (a * v - b * u)
    return (u + d * i + (b * k - c * j) + x,
            v + d * j + (c * i - a * k) + y,
            w + d * k + (a * j - b * i) + z,
            d * p + a * s + b * r - c * q,
            d * q - a * r + b * s + c * p,
            d * r + a * q - b * p + c * s,
            d * s - a * p - b * q - c * r)


def inverse(transform: Transform) -> Transform:
    """Return the transform back."""
    x, y, z, a, b, c, d = transform
    return composed((0.0, 0.0, 0.0, -a, -b, -c, d), (-x, -y, -z, 0.0, 0.0, 0.0, 1.0))


def interpolated(one: Transform, two: Transform, share: float) -> Transform:
    """
    Return what lies between two transforms: one at share 0, two at share 1.

    The translation is linear, the rotation turns evenly the shorter way round (K. Shoemake,
    "Animating Rotation with Quaternion Curves", SIGGRAPH 1985), as in tf2.
    """
    x, y, z, a, b, c, d = one
    u, v, w, p, q, r, s = two
    cosine = a * p + b * q + c * r + d * s
    sign = 1.0
    if cosine < 0.0:
        cosine, sign = -cosine, -1.0
    m, n = 1.0 - share, share
    if cosine < 1.0:
        angle = math.acos(cosine)
        sine = math.sin(angle)
        m, n = math.sin(m * angle) / sine, math.sin(n * angle) / sine
    n *= sign
    return (x + share * (u - x), y + share * (v - y), z + share * (w - z),
            m * a + n * p, m * b + n * q, m * c + n * r, m * d + n * s)


def plane_map(transform: Transform) -> PlaneMap:
    """Return what a transform does to points of the plane z = 0, projected onto z = 0."""
    x, y, _, a, b, c, d = transform
    return (1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b - c * d), x,
            2.0 * (a * b + c * d), 1.0 - 2.0 * (a * a + c * c), y)


def tilt(transform: Transform) -> float:
    """
    Return by what angle (rad) a transform tilts the plane z = 0.

    That of the z axes as lines: what is mounted upside down is not tilted.
    """
    _, _, _, a, b, c, d = transform
    # Sine of half the angle between the axes, and its cosine.
    half = math.atan2(math.hypot(a, b), math.hypot(c, d))
    return min(2.0 * half, math.pi - 2.0 * half)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Transforms between frames: turned by a quaternion, then moved.

Received ones are doubles. They are composed in integers, so that a chain of frames rounds no more
than one transform does, see docs/exactness.md, lemma 24.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from sat_collision.geometry.body.polygon import Affine2D

# Translation x, y, z in m, then rotation x, y, z, w, a quaternion of any length above zero. It
# takes the coordinates of a point in the child frame to those in the parent frame.
Transform: TypeAlias = tuple[float, float, float, float, float, float, float]

# The same in fixed point, in units of 2^-128; the quaternion's length is about 1.
FixedTransform: TypeAlias = tuple[int, int, int, int, int, int, int]

_BITS = 128
_ONE = 1 << _BITS
IDENTITY: FixedTransform = (0, 0, 0, 0, 0, 0, _ONE)

# Translations are refused from here on, so that a chain of them never leaves the doubles.
_FARTHEST = 2.0 ** 1000
# Up to here a translation in units of 2^-128 is a double.
_FAR = 2.0 ** 800
# Quaternions whose squared length is closer to 1 than this count as of length 1: after 10,000
# products in a chain they are still about that long.
_NEARLY_UNIT = 1e-9


def accepted(transform: Transform) -> Transform | None:
    """
    Return a received transform, None if it is not finite or its quaternion is zero.

    A quaternion that is much too long or too short is scaled by a power of two, which rounds
    nothing; its direction alone says how a frame is turned, as in tf2.
    """
    x, y, z, a, b, c, d = transform
    if not (-_FARTHEST < x < _FARTHEST and -_FARTHEST < y < _FARTHEST
            and -_FARTHEST < z < _FARTHEST):
        return None
    if 0.5 < a * a + b * b + c * c + d * d < 2.0:
        return transform
    if not all(map(math.isfinite, (a, b, c, d))):
        return None
    largest = max(abs(a), abs(b), abs(c), abs(d))
    if largest == 0.0:
        return None
    _, exponent = math.frexp(largest)
    return (x, y, z, math.ldexp(a, -exponent), math.ldexp(b, -exponent),
            math.ldexp(c, -exponent), math.ldexp(d, -exponent))


def fixed(transform: Transform) -> FixedTransform:
    """Return an accepted transform in fixed point."""
    x, y, z, a, b, c, d = transform
    return _fixed_length(x), _fixed_length(y), _fixed_length(z), *_fixed_rotation(a, b, c, d)


def _fixed_length(x: float) -> int:
    return int(x * _ONE) if -_FAR < x < _FAR else int(x) << _BITS


def _fixed_rotation(a: float, b: float, c: float, d: float) -> tuple[int, int, int, int]:
    square = a * a + b * b + c * c + d * d
    i, j, k, m = int(a * _ONE), int(b * _ONE), int(c * _ONE), int(d * _ONE)
    if abs(square - 1.0) < _NEARLY_UNIT:
        return i, j, k, m
    scale = int(2.0 ** 64 / math.sqrt(square))
    return i * scale >> 64, j * scale >> 64, k * scale >> 64, m * scale >> 64


def composed(outer: FixedTransform, inner: FixedTransform) -> FixedTransform:
    """Return the transform that applies first the inner one, then the outer one."""
    x, y, z, a, b, c, d = outer
    u, v, w, p, q, r, s = inner
    # The cross product of the outer rotation's axis and the inner translation.
    i = b * w - c * v
    j = c * u - a * w
    k = a * v - b * u
    half = (a * a + b * b + c * c + d * d) >> 1
    return (x + u + (d * i + b * k - c * j) // half,
            y + v + (d * j + c * i - a * k) // half,
            z + w + (d * k + a * j - b * i) // half,
            (d * p + a * s + b * r - c * q) >> _BITS,
            (d * q - a * r + b * s + c * p) >> _BITS,
            (d * r + a * q - b * p + c * s) >> _BITS,
            (d * s - a * p - b * q - c * r) >> _BITS)


def relative(target: FixedTransform, source: FixedTransform) -> FixedTransform:
    """Return the transform from one frame to another, both given in a third frame."""
    x, y, z, a, b, c, d = target
    u, v, w, p, q, r, s = source
    return composed((0, 0, 0, -a, -b, -c, d), (u - x, v - y, w - z, p, q, r, s))


def interpolated(one: Transform, two: Transform, passed: int, span: int) -> FixedTransform:
    """
    Return what lies between two accepted transforms: one where 0 of the span has passed.

    The translation is linear, the rotation turns evenly the shorter way round (K. Shoemake,
    "Animating Rotation with Quaternion Curves", SIGGRAPH 1985), as in tf2.
    """
    x, y, z, a, b, c, d = one
    u, v, w, p, q, r, s = two
    length = math.sqrt(a * a + b * b + c * c + d * d)
    other = math.sqrt(p * p + q * q + r * r + s * s)
    cosine = (a * p + b * q + c * r + d * s) / (length * other)
    sign = 1.0
    if cosine < 0.0:
        cosine, sign = -cosine, -1.0
    n = passed / span
    m = 1.0 - n
    if cosine < 1.0:
        angle = math.acos(cosine)
        sine = math.sin(angle)
        m, n = math.sin(m * angle) / sine, math.sin(n * angle) / sine
    m /= length
    n *= sign / other
    x, y, z = _fixed_length(x), _fixed_length(y), _fixed_length(z)
    return (x + (_fixed_length(u) - x) * passed // span,
            y + (_fixed_length(v) - y) * passed // span,
            z + (_fixed_length(w) - z) * passed // span,
            *_fixed_rotation(m * a + n * p, m * b + n * q, m * c + n * r, m * d + n * s))


def affine_of(transform: FixedTransform) -> Affine2D:
    """Return the map of the plane z = 0 by a transform, projected onto z = 0."""
    x, y, _, a, b, c, d = transform
    aa, bb, cc, ab, cd = a * a, b * b, c * c, 2 * a * b, 2 * c * d
    square = aa + bb + cc + d * d
    # Python divides integers with a single rounding.
    return ((square - 2 * (bb + cc)) / square, (ab - cd) / square, x / _ONE,
            (ab + cd) / square, (square - 2 * (aa + cc)) / square, y / _ONE)


def tilt(transform: FixedTransform) -> float:
    """Return the angle (rad) between the z axes as lines: upside down is not tilted."""
    _, _, _, a, b, c, d = transform
    # Sine of half the angle between the axes, and its cosine.
    half = math.atan2(math.hypot(a, b), math.hypot(c, d))
    return min(2.0 * half, math.pi - 2.0 * half)

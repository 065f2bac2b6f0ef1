# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Motions changed in steps of ulps to maximise the errors of predictions: `make adversary`.

Lengths and times are of all magnitudes, subnormal ones included. Each evaluation checks that the
bodies do not overlap at the time predicted, nor at some times before, and how near they are then.
Poses are computed with sine and cosine of the angle, and separations as everywhere.
"""

import contacts
from contacts import packed_body
import numpy as np
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.motion.prediction import first_row_met
from sat_collision.geometry.numeric.vectors import length
from sat_collision.geometry.pair.distance import measure_arrays
import separations
import steering

LATE, EARLY = range(2)
NAMES = 'share of the margin used', 'distance at the time'
BOUNDS = '2⁻⁴⁴ M', 'max(tolerance, 2⁻²⁵ a T²) + 2⁻⁴⁰ M'
COUNTS = (1, 2), (2, 2), (3, 4), (4, 8), (8, 8)
STEPS = 2000
TOLERANCE = 1e-3
_NUMBERS = 6
_SAMPLES = 8
_LEAST = 5e-324


@kernel
def _way(speed, horizon):
    """Return a way as `prediction` computes it."""
    way = speed * horizon
    return np.copysign(_LEAST, speed) if way == 0.0 and speed != 0.0 else way


@kernel
def _moved(points, vx, vy, omega, time):
    """Return points moved by a twist about (0, 0)."""
    angle = omega * time
    c, s = np.cos(angle), np.sin(angle)
    ahead = s / angle if angle != 0.0 else 1.0
    aside = 2.0 * np.sin(angle / 2.0) * (np.sin(angle / 2.0) / angle) if angle != 0.0 else 0.0
    x, y = vx * time, vy * time
    moved = np.empty(len(points))
    for k in range(0, len(points), 2):
        moved[k] = points[k] * c - points[k + 1] * s + (x * ahead - y * aside)
        moved[k + 1] = points[k] * s + points[k + 1] * c + (x * aside + y * ahead)
    return moved


@kernel
def _set_of(body):
    """Return a set with a packed body in its only row, see `layout`."""
    size = len(body.array)
    array = np.zeros(10 + size)
    array[:2] = 1.0
    array[3:7] = body.array[2:6]
    array.view(np.int64)[8] = body.n
    array[10:] = body.array
    return array


@kernel
def score(which, x, n):
    """
    Return an error of a prediction relative to its bound, and whether a promise is broken.

    The input is x, y of n vertices, vx, vy, omega and the horizon; vx, vy and the vertices of what
    is met.
    """
    points = x[:2 * n]
    vx, vy, omega, horizon, ux, uy = x[2 * n:2 * n + _NUMBERS]
    others = x[2 * n + _NUMBERS:]
    if not horizon > 0.0:
        return -1.0, False
    a, b = packed_body(points), packed_body(others)
    if a.n == 0 or b.n == 0:
        return -1.0, False
    wx, wy, turn = _way(vx, horizon), _way(vy, horizon), _way(omega, horizon)
    ox, oy = _way(ux, horizon), _way(uy, horizon)
    radius = 0.0
    for k in range(0, len(points), 2):
        radius = max(radius, length(points[k], points[k + 1]))
    # a T^2
    bend = abs(turn) * (length(wx, wy) + abs(turn) * radius)
    reach = radius + length(wx, wy) + abs(turn) * radius + abs(ox) + abs(oy) + np.abs(others).max()
    if not 16.0 * reach < np.inf or abs(turn) > 100.0:
        return -1.0, False
    tolerance = max(TOLERANCE * radius, _LEAST)
    motion = np.array([0.0, 0.0, wx, wy, turn, horizon, tolerance, 0.0])
    row, time = first_row_met(_set_of(b), 0, a.array, a.n, motion, np.array([ox, oy]),
                              np.empty(0, np.int64))
    margin = 2.0 ** -44 * reach + 2.0 ** -1060
    # Nearer ones may be in contact at once.
    if measure_arrays(a.array, a.n, b.array, b.n)[0] <= 2.0 * margin:
        return -1.0, False
    end = time if row >= 0 else horizon
    wrong = not end > 0.0
    value = np.inf
    for k in range(1, _SAMPLES + 1):
        at = end * (k / _SAMPLES)
        p = packed_body(_moved(points, vx, vy, omega, at))
        q = packed_body(_moved(others, ux, uy, 0.0, at))
        if p.n == 0 or q.n == 0:
            return -1.0, False
        value = measure_arrays(p.array, p.n, q.array, q.n)[0]
        wrong |= value < -margin / 8.0
    if row < 0:
        return 0.0, wrong
    early = value / (max(tolerance, 2.0 ** -25 * bend) + 16.0 * margin)
    late = 1.0 - value / margin
    return (late if which == LATE else early), wrong or early > 1.0


def starts_of(rng, kind, count):
    """Return motions that lead two bodies to meet, more or less."""
    first, other = (
        contacts.non_convex(rng, count, n) if n > 4 else
        separations.starts_of(rng, count, 3, n).reshape(count, -1, 2)[:, -n:]
        for n in COUNTS[kind])
    first = first - first.mean(axis=1, keepdims=True) * (rng.random((count, 1, 1)) < 0.9)
    gap = rng.uniform(0.0, 3.0, (count, 1, 2))
    other = other - other.mean(axis=1, keepdims=True) + gap
    horizon = rng.uniform(0.5, 4.0, count)
    velocity = gap[:, 0] / horizon[:, None] * rng.uniform(0.3, 3.0, (count, 1))
    own = velocity * rng.choice([0.0, -0.5], (count, 1))
    omega = rng.choice([0.0, 1e-9, 0.3, 2.0], count) * rng.normal(size=count)
    omega = np.where(rng.random(count) < 0.2, _LEAST * rng.integers(1, 2 ** 12, count), omega)
    longer = rng.choice([0, -1000, -1060, -300, 300, 900], count)
    slower = rng.choice([0, 0, 100, -100], count)
    return np.column_stack([
        np.ldexp(first.reshape(count, -1), longer[:, None]),
        np.ldexp(velocity, (longer - slower)[:, None]), np.ldexp(omega, -slower),
        np.ldexp(horizon, slower), np.ldexp(own, (longer - slower)[:, None]),
        np.ldexp(other.reshape(count, -1), longer[:, None])])


def largest(which, kind, evaluations, seed=1):
    """Return the largest error relative to its bound, and the number of broken promises."""
    rng = np.random.default_rng(seed)
    starts = starts_of(rng, kind, max(evaluations // STEPS, 20))
    return steering.largest(score, which, starts, COUNTS[kind][0], evaluations, rng)

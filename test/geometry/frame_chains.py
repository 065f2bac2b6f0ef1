# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
A search for chains of frames with errors beyond lemma 24 of docs/exactness.md.

Transforms and points pass through `Frames` and `moved_points`, as in messages. The true position
follows from the received numbers in integers of any length: the rotation of a quaternion of any
length except zero is a matrix of rationals.
"""

import math
from operator import mul
import random

import numpy as np
from sat_collision.geometry.body.packing import moved_points, TRIPLE
from sat_collision.scene.frames import Frames

U = 2.0 ** -53
# The number of frames from the body up to a common one, and from the fixed frame up to it.
CHAINS = {'one yaw': (1, 0), 'two frames': (2, 0), 'ten frames': (5, 5), 'both under UTM': (1, 1),
          'all but the same frame': (2, 2)}
STEPS = 500
_NUMBERS = 7
_UTM = (448_262.37, 5_411_932.68, 117.2)


def starts_of(rng, name, count):
    """Return chains as arrays: seven numbers of each transform, then x and y of a point."""
    up, down = CHAINS[name]
    chains = np.empty((count, _NUMBERS * (up + down) + 2))
    transforms = chains[:, :-2].reshape(count, up + down, _NUMBERS)
    transforms[..., :3] = (rng.uniform(-1, 1, (*transforms.shape[:2], 3))
                           * 2.0 ** rng.integers(-6, 5, (*transforms.shape[:2], 1)))
    # Yaw alone, or with slight roll and pitch; some quaternions are not of length 1.
    angle = rng.uniform(-np.pi, np.pi, transforms.shape[:2])
    transforms[..., 3:5] = (rng.normal(0, 0.01, (*transforms.shape[:2], 2))
                            * (rng.random((count, 1, 1)) < 0.5))
    transforms[..., 5], transforms[..., 6] = np.sin(angle / 2), np.cos(angle / 2)
    transforms[..., 3:] *= np.where(rng.random((count, 1, 1)) < 0.2,
                                    rng.uniform(0.5, 2, (count, 1, 1)), 1.0)
    chains[:, -2:] = rng.uniform(-1, 1, (count, 2)) * 2.0 ** rng.integers(-3, 8, (count, 1))
    if name == 'both under UTM':
        transforms[..., :3] += _UTM
    elif name == 'all but the same frame':
        # Large terms cancel, and the point is near the origin.
        transforms[:, up:] = transforms[:, :up]
        chains[:, -2:] *= 2.0 ** rng.integers(-70, -40, (count, 1))
    return chains


def evaluate(name, chain):
    """Return the larger error of a moved point's coordinates, relative to its bound."""
    up, down = CHAINS[name]
    transforms = [tuple(row) for row in chain[:-2].reshape(-1, _NUMBERS).tolist()]
    ups, downs = transforms[:up], transforms[up:]
    frames = Frames(10**9)
    for side, chain_of_side in (('up', ups), ('down', downs)):
        for k, transform in enumerate(chain_of_side, 1):
            parent = 'common' if k == len(chain_of_side) else f'{side}{k}'
            frames.insert(parent, f'{side}{k - 1}', 0, transform, True)
    affine = frames.lookup_affine('down0' if down else 'common', 'up0', 0).affine
    point = np.array([*chain[-2:], 0.0], np.float32)
    found = moved_points(point.tobytes(), 0, 1, TRIPLE, affine)
    (x, y, _), origin, w = moved(ups, downs, point[:2].tolist())
    r = math.hypot(*point[:2].tolist())
    travelled = sum(abs(part) for transform in transforms for part in transform[:3])
    composing = len(transforms) * 2.0 ** -120 * (1.0 + travelled)
    return max(
        abs(n * w - true * d) / (d * w) / (
            U * (abs(n / d) + abs(c / w) + 3.0 * r) + composing)
        for (n, d), true, c in zip(map(float.as_integer_ratio, np.asarray(found).tolist()),
                                   (x, y), origin))


def moved(ups, downs, point):
    """
    Return a point of the plane of the first frame in the last one, and that frame's origin.

    Both as three integers, to be divided by a third result.
    """
    (x, y), w = _integers(point)
    points = (x, y, 0), (0, 0, 0)
    for transform in ups:
        square, matrix = _turn(transform[3:])
        shift, unit = _integers(transform[:3])
        points = [[unit * sum(map(mul, row, at)) + t * square * w for row, t in zip(matrix, shift)]
                  for at in points]
        w *= square * unit
    for transform in reversed(downs):
        square, matrix = _turn(transform[3:])
        shift, unit = _integers(transform[:3])
        points = [[unit * value - t * w for value, t in zip(at, shift)] for at in points]
        points = [[sum(map(mul, row, at)) for row in zip(*matrix)] for at in points]
        w *= square * unit
    return *points, w


def _integers(numbers):
    """Return doubles times their common denominator, and that denominator."""
    ratios = [number.as_integer_ratio() for number in numbers]
    unit = max(denominator for _, denominator in ratios)
    return [numerator * (unit // denominator) for numerator, denominator in ratios], unit


def _turn(quaternion):
    """Return the squared length of a quaternion, and its rotation matrix times that."""
    (a, b, c, d), _ = _integers(quaternion)
    return a * a + b * b + c * c + d * d, (
        (a * a - b * b - c * c + d * d, 2 * (a * b - c * d), 2 * (a * c + b * d)),
        (2 * (a * b + c * d), b * b - a * a - c * c + d * d, 2 * (b * c - a * d)),
        (2 * (a * c - b * d), 2 * (b * c + a * d), c * c - a * a - b * b + d * d))


def climb(name, chain, steps, rng):
    """Change a chain in place, one or two numbers per step; return the largest error / bound."""
    bits = chain.view(np.int64)
    best, kept = evaluate(name, chain), chain.copy()
    places = np.flatnonzero(chain).tolist()
    for _ in range(steps):
        for k in rng.choices(places, k=rng.randint(1, 2)):
            # A point has the precision of float32.
            lowest = 29 if k >= len(chain) - 2 else 0
            bits[k] += rng.choice((-1, 1)) << rng.randint(lowest, 50)
        usual = all(1e-30 < abs(chain[k]) < 1e30 for k in places)
        ratio = evaluate(name, chain) if usual else 0.0
        if ratio >= best:
            best = ratio
            kept[:] = chain
        else:
            chain[:] = kept
    return best


def largest(name, evaluations, seed=1):
    """Return the largest error relative to its bound."""
    starts = starts_of(np.random.default_rng(seed), name, max(evaluations // STEPS, 1))
    rng = random.Random(seed)
    return max(climb(name, chain, evaluations // len(starts), rng) for chain in starts)


def rows(evaluations, seed):
    """Yield a row for each kind of chain, and whether it exceeded the bound."""
    share = evaluations // len(CHAINS)
    for name in CHAINS:
        ratio = largest(name, share, seed)
        yield name, f'{ratio:.4f}', f'{share:.1e}', ratio > 1.0

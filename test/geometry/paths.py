# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Random paths compared with shapely at many places of each segment: `make paths`.

Poses between two are taken from the centre of the circle on which the origin moves. At the poses
themselves shapely's answer is replaced by exact integers.
"""

import argparse
from collections import Counter
from functools import partial
import math
from multiprocessing import Pool

import numpy as np
import oracle
from sat_collision import first_contact_along
import shapes

BOX = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
BAR = BOX[:2]
L = np.array([(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)])
_BODIES = [BOX[:1], BAR, BOX[:3], BOX, L, shapes.comb(2) / 4, shapes.star(5) / 4]
_NEAR = 1e-3 + 1e-9
TOGETHER = 1000


def place(points, x, y, yaw):
    """Return points of a body at a pose, rounded as documented."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([(a * c - b * s + x, a * s + b * c + y) for a, b in points])


def pose_at(poses, number):
    """Return the pose at a place of a path."""
    k = min(int(number), len(poses) - 2)
    return poses_between(poses[k], poses[k + 1], np.array([number - k]))[0]


def poses_between(start, end, shares):
    """Return the poses at some shares of a segment, (n, 3), the shorter way round."""
    (x, y, yaw), (end_x, end_y, end_yaw) = start, end
    turn = math.remainder(end_yaw - yaw, 2 * math.pi)
    if abs(turn) < 1e-9:
        return np.array(start) + np.outer(shares, [end_x - x, end_y - y, turn])
    # The centre sees both ends under the angle of the turn.
    high = 0.5 / math.tan(turn / 2)
    centre = complex(x + end_x, y + end_y) / 2 + high * 1j * complex(end_x - x, end_y - y)
    moved = centre + (complex(x, y) - centre) * np.exp(1j * turn * shares)
    return np.column_stack([moved.real, moved.imag, yaw + turn * shares])


def _geometries(body, poses):
    """Return the body at poses as geometries of shapely."""
    import shapely
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x, y = body.T
    points = np.stack([x * c - y * s + poses[:, :1], x * s + y * c + poses[:, 1:2]], axis=-1)
    if len(body) == 1:
        return shapely.points(points[:, 0])
    return shapely.linestrings(points) if len(body) == 2 else shapely.polygons(points)


def _geometry(body):
    return _geometries(np.asarray(body), np.zeros((1, 3)))[0]


def distance_at(body, poses, number, others):
    """Return how far a body at a place of a path is from the nearest of others."""
    import shapely
    there = _geometries(body, pose_at(poses, number)[None])[0]
    return min(shapely.distance(there, _geometry(other)) for other in others)


def least_distance(body, poses, other, samples=2000):
    """Return the least distance of a body on a path from another, at many places."""
    import shapely
    shares = np.linspace(0, 1, samples)
    return min(shapely.distance(_geometries(body, poses_between(*ends, shares)),
                                _geometry(other)).min() for ends in zip(poses, poses[1:]))


def random_path(rng):
    """Return a body, the poses of a path and obstacles."""
    body = _BODIES[rng.integers(len(_BODIES))] * rng.choice([0.5, 1]) - rng.integers(0, 3, 2) / 4
    count = rng.integers(2, 6)
    poses = rng.integers(-12, 13, (count, 3)) / 4.0
    poses[:, 2] = rng.choice([poses[0, 2], 0.0, 40.0], count) + rng.choice([0, 0.2, 3], count) * (
        rng.uniform(-1, 1, count))
    for k in range(1, count):
        kind = rng.integers(6)
        if kind == 0:
            poses[k] = poses[k - 1]
        elif kind == 1:
            poses[k, :2] = poses[k - 1, :2]
        elif kind == 2:
            poses[k, 2] = poses[k - 1, 2]
    others = [shapes.convex(shapes.polygons(rng, 1, 5))[0] * rng.choice([0.1, 0.5]) if kind > 4
              else _BODIES[kind] * 0.5 for kind in rng.integers(0, 7, rng.integers(1, 4))]
    return body, poses, [other + rng.uniform(-4, 4, 2) for other in others]


def check(count, seed, samples=64):
    """
    Compare the answers for random paths; return how many there were of each kind.

    Raise `AssertionError` where one is late, or early by more than is allowed.
    """
    import shapely
    rng = np.random.default_rng(seed)
    seen = Counter(none=0, first=0, between=0, margin=0)
    shares = np.linspace(0, 1, samples + 1)
    for number in range(count):
        body, poses, others = random_path(rng)
        margin = float(rng.choice([0.0, 0.0, 0.125]))
        found = first_contact_along(body, poses, others, margin)
        reached = math.inf if found is None else found.pose
        where = f'path {number} of seed {seed}: {found}'
        for k, ends in enumerate(zip(poses, poses[1:])):
            before = shares[k + shares < reached - 1e-12]
            between = poses_between(*ends, before)
            for other in others:
                # Where the origin is farther away nothing of the body comes near.
                centre = other[0]
                radius = np.hypot(*body.T).max() + np.hypot(*(other - centre).T).max()
                away = np.hypot(*(between[:, :2] - centre).T)
                moved = _geometries(body, between[away <= radius + margin + 1e-6])
                touched = shapely.distance(moved, _geometry(other)) <= margin - 1e-12 if (
                    margin) else shapely.intersects(moved, _geometry(other))
                assert not touched.any(), where
        if margin == 0.0:
            for k, pose in enumerate(poses):
                if any(oracle.intersects(place(body, *pose), other) for other in others):
                    assert reached <= k, where
                    break
            else:
                assert reached > 0.0, where
        if found is not None:
            near = distance_at(body, poses, found.pose, [others[found.row]])
            assert near <= margin + (_NEAR if reached else 0.0), (where, near)
            seen['margin'] += margin > 0.0
        seen['none' if found is None else 'between' if reached else 'first'] += 1
    return seen


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--paths', type=float, default=1e5)
    parser.add_argument('--samples', type=int, default=10_000)
    given = parser.parse_args()
    seen = Counter()
    with Pool() as pool:
        seeds = range(2, 2 + math.ceil(given.paths / TOGETHER))
        for found in pool.imap_unordered(partial(check, TOGETHER, samples=given.samples), seeds):
            seen += found
            print(*(f'{kind}: {count}' for kind, count in seen.items()), '0 late', sep=', ',
                  flush=True)


if __name__ == '__main__':
    main()

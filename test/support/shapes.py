# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Convex and simple polygons for the hard families, and how far one must move to touch another."""

import numpy as np

import oracle

PLUS = np.array([(1, 0), (2, 0), (2, 1), (3, 1), (3, 2), (2, 2), (2, 3), (1, 3), (1, 2), (0, 2),
                 (0, 1), (1, 1)], float)


def convex(batch):
    """
    Return (count, n, 2) rings that were convex before rounding as exactly convex bodies.

    Rings that turn left at every vertex by more than rounding errors, and once around, are
    kept; others are replaced by their exact convex hull, which may have fewer vertices.
    """
    edges = np.roll(batch, -1, axis=1) - batch
    after = np.roll(edges, -1, axis=1)
    left, right = edges[..., 0] * after[..., 1], edges[..., 1] * after[..., 0]
    proved = (left - right > 2.0**-51 * (abs(left) + abs(right)) + 1e-300).all(axis=1)
    rounds = ((edges[..., 1] < 0) & (after[..., 1] >= 0)).sum(axis=1)
    kept = proved & (rounds == 1)
    return [ring if keep else hull(ring) for ring, keep in zip(batch, kept)]


def hull(points):
    """Return the exact convex hull of points, strictly convex and counter-clockwise."""
    points = np.unique(np.asarray(points, float), axis=0)
    grid, = oracle.integers(points)
    chains = []
    for order in (range(len(points)), range(len(points) - 1, -1, -1)):
        chain = []
        for i in order:
            while len(chain) > 1 and oracle.orientation(
                    grid[chain[-2]], grid[chain[-1]], grid[i]) <= 0:
                chain.pop()
            chain.append(i)
        chains += chain[:-1]
    return points[chains or [0]]


def at_angles(angle, radius=1.0):
    """Return points (..., 2) around the origin."""
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def directions(rng, count):
    return at_angles(rng.uniform(0, 2 * np.pi, count))


def regular(rng, count, n, spread=0.0):
    """Return (count, n, 2) points on the unit circle, evenly spaced up to a random spread."""
    angle = 2 * np.pi / n * (np.arange(n) + rng.uniform(0, 1, (count, 1))
                             + spread * rng.uniform(0, 1, (count, n)))
    return at_angles(angle)


def polygons(rng, count, n, width=None):
    """Return (count, n, 2) polygons inscribed in unit ellipses, their mean vertex the origin."""
    if width is None:
        width = rng.uniform(0.1, 1, count)
    ring = regular(rng, count, n, 0.9)
    ring[..., 1] *= width[:, None]
    along = directions(rng, count)
    turn = np.stack([along, along[:, ::-1] * [-1, 1]], axis=1)
    return (ring - ring.mean(axis=1, keepdims=True)) @ turn


def rectangle(centre, along, across):
    return np.stack([centre - along - across, centre + along - across,
                     centre + along + across, centre - along + across], axis=1)


def lattice(rng, count, n):
    """Return (count, n, 2) convex polygons of integers: the edges of random rings, by angle."""
    ring = rng.integers(-99, 100, (count, n, 2))
    edges = np.roll(ring, -1, axis=1) - ring
    order = np.argsort(np.arctan2(edges[..., 1], edges[..., 0]), axis=1)
    return 4.0 * np.cumsum(np.take_along_axis(edges, order[..., None], axis=1), axis=1)


def comb(teeth, slack=0.0):
    """Return a comb with teeth 1 - 2 slack wide and 1 + 2 slack apart: with two teeth, a U."""
    ring = [[0, 0], [2 * teeth - 1, 0]]
    for k in range(teeth - 1, -1, -1):
        right, left = 2 * k + 1 - slack, 2 * k + slack
        ring += [[right, 1], [right, 3], [left, 3], [left, 1]]
    ring[0][0], ring[1][0] = slack, 2 * teeth - 1 - slack
    del ring[2], ring[-1]
    return np.array(ring, float)


def star(points):
    return at_angles(np.pi / points * np.arange(2 * points), np.tile([3, 1], points))


def reach(a, b, heading):
    """Return how far b must move along a heading to just touch a, and that axis's cosine."""
    least, cosine = np.full(len(a), np.inf), np.ones(len(a))
    for body, sign in ((a, 1), (b, -1)):
        edges = np.roll(body, -1, axis=1) - body
        normals = edges[..., ::-1] * [sign, -sign]
        normals /= np.hypot(normals[..., :1], normals[..., 1:])
        along = (normals @ heading[:, :, None])[..., 0]
        overlap = ((normals @ a.transpose(0, 2, 1)).max(axis=2)
                   - (normals @ b.transpose(0, 2, 1)).min(axis=2))
        with np.errstate(divide='ignore', invalid='ignore'):
            reaches = np.where(along > 0, overlap / along, np.inf)
        rows, best = np.arange(len(a)), reaches.argmin(axis=1)
        nearer = reaches[rows, best] < least
        least = np.where(nearer, reaches[rows, best], least)
        cosine = np.where(nearer, along[rows, best], cosine)
    return least, cosine

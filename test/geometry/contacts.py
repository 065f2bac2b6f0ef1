# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Pairs of polygons changed in steps of ulps to maximise the errors of a contact: `make adversary`.

Bodies are convex or not. Each evaluation checks all promises of a contact, and that it agrees with
`separation` and `intersects`; a climb maximises one of the errors. Errors are computed in twice
the precision of doubles, over all parts, vertices and edges without any search.
"""

import numpy as np
from sat_collision.geometry.body.convex_parts import convex_parts
from sat_collision.geometry.body.layout import (
    convex_part, first_vertex, HEADER, Packed, packed_size)
from sat_collision.geometry.body.packing import CONVEX, NON_CONVEX, pack
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.numeric.double_double import (
    difference, dot, negative, plus, square_root, times)
from sat_collision.geometry.numeric.predicates import orient
from sat_collision.geometry.pair.contact import contact_of_arrays
from sat_collision.geometry.pair.convex_distance import reach_of
from sat_collision.geometry.pair.distance import measure_arrays
from sat_collision.geometry.pair.intersection import arrays_meet
import separations
from separations import distance_to_edges, reach_beyond_edges, UNIT
import shapes
import steering

NORMAL, POINTS, GAP, WAY_OUT = range(4)
NAMES = ('length of the normal', 'points outside their body', 'offset of the points',
         'overlap once moved by depth × normal')
BOUNDS = '4 u', '8 u R', '32 u R', '2⁻⁴⁵ S'
COUNTS = (1, 2), (2, 2), (1, 4), (3, 3), (4, 6), (4, 20), (1, 6), (2, 7), (4, 8), (8, 8)
# From this index on the second body is non-convex, in the last pair both.
CONVEX_COUNTS = 6
STEPS = 5000
_FAR = (1e300, 0.0)


@kernel
def packed_body(points):
    """Return a body of points x, y, x, y, ..., packed; with 0 vertices if refused."""
    limit = len(points) // 2
    ring = np.empty(packed_size(limit))
    verdict, count, _, _, first = pack(points, ring, limit, limit)
    if verdict == CONVEX:
        return Packed(ring, 0, count)
    if verdict != NON_CONVEX:
        return Packed(ring, 0, 0)
    outline = ring[first:first + 2 * count].copy()
    corners, ends = convex_parts(outline)
    start = HEADER + 2 * len(ends)
    array = np.empty(start + packed_size(len(corners)) + HEADER * len(ends) + 2 * count)
    array[:HEADER] = ring[:HEADER]
    begin = 0
    for i in range(len(ends)):
        n = ends[i] - begin
        part = np.empty(2 * n)
        for k in range(n):
            part[2 * k:2 * k + 2] = outline[2 * corners[begin + k]:2 * corners[begin + k] + 2]
        _, n, _, _, _ = pack(part, array[start:], n, n)
        array[HEADER + 2 * i], array[HEADER + 2 * i + 1] = start, n
        start += packed_size(n)
        begin = ends[i]
    array[0], array[1] = start, start + 2 * count
    array[start:start + 2 * count] = outline
    return Packed(array[:start + 2 * count].copy(), 0, -len(ends))


@kernel
def _outside(p, x, y):
    """Return how far a point is outside a body."""
    point = np.empty(packed_size(1))
    point[HEADER], point[HEADER + 1] = x, y
    least = np.inf
    for i in range(max(1, -p.n)):
        part = convex_part(p, i)
        v = part.array
        first = first_vertex(part)
        inside = part.n > 2
        for k in range(part.n):
            a, b = first + 2 * k, first + 2 * ((k + 1) % part.n)
            inside = inside and orient(v[a], v[a + 1], v[b], v[b + 1], x, y) >= 0
        if inside:
            return 0.0
        least = min(least, distance_to_edges(part, Packed(point, 0, 1), _FAR)[0])
    return least


@kernel
def _left_over(p, q, mx, my):
    """Return how deep any part of P, moved by m, overlaps one of Q; negative if apart."""
    greatest = -np.inf
    for i in range(max(1, -p.n)):
        a = convex_part(p, i)
        for j in range(max(1, -q.n)):
            b = convex_part(q, j)
            if a.n > 1 or b.n > 1:
                reach = reach_beyond_edges(a, b, _FAR, negative(mx), negative(my))
                greatest = max(greatest, reach_beyond_edges(b, a, reach, mx, my)[0])
    return greatest


@kernel
def _extent(p, q):
    """Return the longer side of the bounding box of two bodies."""
    a, b = p.array, q.array
    return max(max(a[4], b[4]) - min(a[2], b[2]), max(a[5], b[5]) - min(a[3], b[3]))


@kernel
def errors(p, q):
    """Return each error of a contact relative to its bound, and whether it is inconsistent."""
    value, depth, nx, ny, count, pairs = contact_of_arrays(p.array, p.n, q.array, q.n)
    convex = p.n > 0 and q.n > 0
    wrong = (value != measure_arrays(p.array, p.n, q.array, q.n)[0]
             or (value > 0.0) == arrays_meet(p.array, p.n, q.array, q.n)
             or (value > 0.0 and depth != 0.0) or not max(-value, 0.0) <= depth < np.inf
             or (convex and depth != max(-value, 0.0)) or not 1 <= count <= 2)
    unit = square_root(dot((nx, 0.0), (ny, 0.0), (nx, 0.0), (ny, 0.0)))
    outside = aside = 0.0
    least = np.inf
    for k in range(count):
        ax, ay, bx, by = pairs[k]
        outside = max(outside, _outside(p, ax, ay), _outside(q, bx, by))
        gx, gy = difference(ax, bx), difference(ay, by)
        least = min(least, plus(dot(gx, gy, (nx, 0.0), (ny, 0.0)), (-value, 0.0))[0])
        aside = max(aside, abs(dot(gx, gy, (-ny, 0.0), (nx, 0.0))[0]))
    rounding = UNIT * reach_of(p, q)
    slack = 2.0 ** -45 * _extent(p, q)
    left = _left_over(p, q, times((depth, 0.0), (nx, 0.0)), times((depth, 0.0), (ny, 0.0)))
    out = plus((depth, 0.0), (slack, 0.0))
    wrong |= depth > 0.0 and not _left_over(p, q, times(out, (nx, 0.0)), times(out, (ny, 0.0))) < 0
    return (abs(plus(unit, (-1.0, 0.0))[0]) / (4.0 * UNIT), outside / (8.0 * rounding),
            max(abs(least), aside) / (32.0 * rounding) if convex else 0.0,
            max(left, 0.0) / slack), wrong


@kernel
def score(which, x, n):
    """Return an error for bodies of n points and the rest, and whether a promise is broken."""
    if steering.are_between(x, 1e-60, 1e60):
        p = packed_body(x[:2 * n])
        q = packed_body(x[2 * n:])
        if p.n != 0 and q.n != 0:
            ratios, contradicts = errors(p, q)
            return ratios[which], contradicts or max(ratios) > 1.0
    return -1.0, False


def starts_of(rng, kind, count):
    """Return near pairs as flat arrays: some far from the origin, half of them on a lattice."""
    n, m = COUNTS[kind]
    x = separations.starts_of(rng, count, n, m) if kind < CONVEX_COUNTS else (
        _non_convex_pairs(rng, count, n, m))
    # On the lattice edges are level and features equally near, but no coordinate is 0.
    return np.where(rng.random((count, 1)) < 0.5, np.rint(4.0 * x) / 4.0 + 17.0, x)


def _non_convex_pairs(rng, count, n, m):
    pair = [non_convex(rng, count, size) if size > 4 else
            rng.uniform(-1, 1, (count, 1, 2)) + separations.starts_of(rng, count, size, 1).reshape(
                count, -1, 2)[:, :size] for size in (n, m)]
    pair[1] += rng.uniform(-1, 1, (count, 1, 2))
    offset = rng.normal(size=(count, 1, 2)) * rng.choice([0.0, 1.0, 1e3, 1e6], (count, 1, 1))
    return (np.concatenate(pair, axis=1) + offset).reshape(count, -1)


def non_convex(rng, count, n):
    """Return rings around the origin whose vertices alternate between two distances."""
    angle = (np.arange(n) + rng.uniform(0, 0.9, (count, n))) * 2 * np.pi / n
    radius = rng.uniform(0.8, 1.2, (count, n)) * np.where(np.arange(n) % 2, 1.0, 0.4)
    return shapes.at_angles(angle, radius)


def largest(which, kind, evaluations, seed=1):
    """Return the largest error relative to its bound, and the number of broken promises."""
    rng = np.random.default_rng(seed)
    starts = starts_of(rng, kind, max(evaluations // STEPS, 10))
    return steering.largest(score, which, starts, COUNTS[kind][0], evaluations, rng)

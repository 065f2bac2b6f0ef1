# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Pairs of polygons changed in steps of ulps to maximise errors of separation, offset and axis.

Errors are computed in twice the precision of doubles, over all pairs of vertices and edges without
any search; the largest are confirmed in rationals.
"""

from fractions import Fraction

import numpy as np
from rationals import exact_depth, exact_distance, square_root
from sat_collision import Polygon
from sat_collision.geometry.body.layout import first_vertex, Packed, packed_size
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.numeric.double_double import (
    cross, difference, dot, negative, plus, quotient, scaled, square_root as root)
from sat_collision.geometry.numeric.vectors import scale_to_one
from sat_collision.geometry.pair.convex_distance import reach_of
from sat_collision.geometry.pair.distance import measure
import steering

DISTANCE, DEPTH, WAY, AXIS = range(4)
NAMES = 'distance', 'depth', 'offset', 'axis'
UNIT = 2.0 ** -53
BOUNDS = '2 u d + 2⁻⁹⁶ R', '2 u d + 2⁻⁹⁶ R', '6 u R', '6 u R'
COUNTS = (1, 2), (2, 2), (1, 4), (3, 3), (4, 6), (4, 20)
STEPS = 5000
CONFIRMED = 20
_UNMOVED = (0.0, 0.0)


@kernel
def distance_to_edges(p, q, least):
    """Return the distance of the nearest vertex of Q and edge of P, if it is smaller."""
    v, w = p.array, q.array
    first, other = first_vertex(p), first_vertex(q)
    for i in range(p.n):
        a, b = first + 2 * i, first + 2 * ((i + 1) % p.n)
        ex, ey = difference(v[b], v[a]), difference(v[b + 1], v[a + 1])
        ex, ey = scaled(ex, ey, scale_to_one(max(abs(ex[0]), abs(ey[0]))))
        for j in range(other, other + 2 * q.n, 2):
            ax, ay = difference(w[j], v[a]), difference(w[j + 1], v[a + 1])
            bx, by = difference(w[j], v[b]), difference(w[j + 1], v[b + 1])
            found = root(dot(ax, ay, ax, ay))
            if dot(ax, ay, ex, ey)[0] > 0.0:
                found = root(dot(bx, by, bx, by))
                if dot(bx, by, ex, ey)[0] < 0.0:
                    found = quotient(cross(ex, ey, ax, ay), root(dot(ex, ey, ex, ey)))
                    if found[0] < 0.0:
                        found = negative(found)
            if plus(found, negative(least))[0] < 0.0:
                least = found
    return least


@kernel
def reach_beyond_edges(p, q, least, mx, my):
    """Return the smallest reach of Q, moved by m, beyond an edge of P, if it is smaller."""
    v, w = p.array, q.array
    first, other = first_vertex(p), first_vertex(q)
    for i in range(p.n if p.n > 1 else 0):
        a, b = first + 2 * i, first + 2 * ((i + 1) % p.n)
        ex, ey = difference(v[b], v[a]), difference(v[b + 1], v[a + 1])
        ex, ey = scaled(ex, ey, scale_to_one(max(abs(ex[0]), abs(ey[0]))))
        greatest = (-np.inf, 0.0)
        for j in range(other, other + 2 * q.n, 2):
            found = cross(ex, ey, plus(difference(w[j], v[a]), mx),
                          plus(difference(w[j + 1], v[a + 1]), my))
            if greatest[0] == -np.inf or plus(found, negative(greatest))[0] > 0.0:
                greatest = found
        greatest = quotient(greatest, root(dot(ex, ey, ex, ey)))
        if plus(greatest, negative(least))[0] < 0.0:
            least = greatest
    return least


@kernel
def _gap_along(p, q, ux, uy):
    """Return the gap of P and Q along an axis, negative if their projections overlap."""
    v, w = p.array, q.array
    first, other = first_vertex(p), first_vertex(q)
    least = (np.inf, 0.0)
    for i in range(first, first + 2 * p.n, 2):
        for j in range(other, other + 2 * q.n, 2):
            found = dot(difference(w[j], v[i]), difference(w[j + 1], v[i + 1]),
                        (ux, 0.0), (uy, 0.0))
            if least[0] == np.inf or plus(found, negative(least))[0] < 0.0:
                least = found
    return least


@kernel
def error(which, p, q):
    """Return the error of a measurement of two convex polygons, and its bound; 0 if none."""
    value, points = measure(p, q)
    ax, ay, bx, by, ux, uy = points
    reach = reach_of(p, q)
    if which == WAY:
        mx, my = difference(bx, ax), difference(by, ay)
        found = root(dot(mx, my, mx, my))
        return abs(plus(found, (-abs(value), 0.0))[0]), 6.0 * UNIT * reach
    if which == AXIS:
        if value == 0.0:
            return 0.0, 0.0
        return abs(plus(_gap_along(p, q, ux, uy), (-value, 0.0))[0]), 6.0 * UNIT * reach
    if (value > 0.0) != (which == DISTANCE) or value == 0.0:
        return 0.0, 0.0
    far = (1e300, 0.0)
    if which == DISTANCE:
        true = distance_to_edges(q, p, distance_to_edges(p, q, far))
    else:
        true = reach_beyond_edges(p, q, far, _UNMOVED, _UNMOVED)
        true = reach_beyond_edges(q, p, true, _UNMOVED, _UNMOVED)
    return (abs(plus(true, (-abs(value), 0.0))[0]),
            2.0 * UNIT * true[0] + 2.0 ** -96 * reach)


@kernel
def score(which, x, n):
    """Return the error for bodies of n vertices and the rest relative to its bound."""
    m = len(x) // 2 - n
    a, b = np.empty(packed_size(n)), np.empty(packed_size(m))
    if not (steering.are_between(x, -1.0, 1e60) and steering.pack_both(x, n, a, b)):
        return -1.0, False
    wrong_by, bound = error(which, Packed(a, 0, n), Packed(b, 0, m))
    return wrong_by / bound if bound > 0.0 else 0.0, False


def exact(which, x, n):
    """Return the error relative to its bound in rationals."""
    p, q = Polygon(x[:2 * n].reshape(-1, 2)), Polygon(x[2 * n:].reshape(-1, 2))
    value, points = measure(*(Packed(body.packed[0], 0, body.packed[1]) for body in (p, q)))
    ax, ay, bx, by, ux, uy = map(Fraction, points)
    value = Fraction(value)
    reach = Fraction(float(abs(x).max()))
    bound = 6 * Fraction(UNIT) * reach
    if which == WAY:
        wrong_by = square_root((bx - ax) ** 2 + (by - ay) ** 2) - abs(value)
    elif which == AXIS:
        heights, others = ([Fraction(s) * ux + Fraction(t) * uy for s, t in body.vertices.tolist()]
                           for body in (p, q))
        wrong_by = min(others) - max(heights) - value if value else 0
    else:
        true = exact_distance(p, q) if value > 0 else -exact_depth(p, q)
        wrong_by = true - value
        bound = 2 * Fraction(UNIT) * abs(true) + reach / 2 ** 96
    return float(abs(wrong_by) / bound)


def starts_of(rng, count, n, m):
    """Return near pairs of n and m vertices, some of them far from the origin."""
    x = steering.starts_of(rng, count, max(n, 3), max(m, 3)).reshape(count, -1, 2)
    first = max(n, 3)
    return np.concatenate([x[:, :n], x[:, first:first + m]], axis=1).reshape(count, -1)


def largest(which, kind, evaluations, seed=1):
    """Return the largest error relative to its bound, confirmed, and how many exceed it."""
    rng = np.random.default_rng(seed)
    n, m = COUNTS[kind]
    starts = starts_of(rng, max(evaluations // STEPS, CONFIRMED), n, m)
    found = [steering.climb(score, which, x, n, evaluations // len(starts), rng)[0]
             for x in starts]
    ratios = [exact(which, starts[k], n) for k in np.argsort(found)[-CONFIRMED:]]
    return max(ratios), sum(ratio > 1.0 for ratio in ratios)

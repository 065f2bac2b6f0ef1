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

"""
How wrong answers depend on the condition of the question, and how far off the question they are.

A pair's signed separation g is computed in integers, so exactly but for its last rounding. With D
the largest magnitude of a coordinate and u = 2^-53 the condition number is kappa = u D / |g|,
infinite where bodies touch; the figures are by its reciprocal, the gap in units of u D. A wrong
answer about a gap g is right for bodies moved by |g| / 2 each: |g| / 2 in units of u D is its
backward error c.
"""

import math

import families
from methods import applicable, Pairs, run
import numpy as np
import oracle
import samples

U = 2.0 ** -53
SIDES = 3, 4, 8, 16
# Bins of half a decade of |g| / (u D); below the first all, and bodies that touch, in bins of
# their own.
STEP = 0.5
FIRST, LAST = -3.0, 16.0


def measure(rng, count):
    """
    Return wrong answers by method and bin, of one also by family, and backward errors.

    The families are those of convex bodies with few vertices, count pairs of each. A bin is a list
    of its number, false collisions, pairs apart, false clears, and pairs that meet.
    """
    rows, worst = {}, {}
    for name, family in families.CONVEX.items():
        if name in samples.MANY:
            continue
        pairs = samples.of_family(rng, family, count, SIDES)
        meet, _ = oracle.intersects_pairs(pairs)
        units = np.array([gap_in_units(a, b, met) for (a, b), met in zip(pairs, meet.tolist())])
        bins = np.array([bin_of(value) for value in units])
        prepared = Pairs(pairs)
        with np.errstate(all='ignore'):
            answers = {method: run(method, prepared)[0] for method in applicable()}
        for method, answer in answers.items():
            wrong = answer != meet
            worst[method] = max(worst.get(method, 0.0), float(units[wrong].max(initial=0.0)) / 2)
            for k in np.unique(bins):
                here = bins == k
                rows[method, name, int(k)] = tuple(int(of.sum()) for of in (
                    wrong & here & ~meet, here & ~meet, wrong & here & meet, here & meet))
    return {'bins': _pooled(rows), 'families': _of_method(rows, 'traditional'),
            'backward': worst, 'pairs': sum(apart + met for (m, *_), (_, apart, _, met)
                                            in rows.items() if m == 'traditional')}


def gap_in_units(a, b, meet):
    """Return the exact distance, or the depth of bodies that meet, as a multiple of u D."""
    p, q = oracle.integers(a, b)
    largest = max(abs(x) for body in (p, q) for point in body for x in point)
    square, divisor = _depth_square(p, q) if meet else _distance_square(p, q)
    return math.sqrt(((square << 106) / (divisor * largest * largest)) if square else 0.0)


def bin_of(units):
    """Return the number of the bin for a gap in units of u D: -1 for no gap at all."""
    if units == 0.0:
        return -1
    place = min(max(math.log10(units), FIRST), LAST - STEP)
    return int((place - FIRST) / STEP)


def centre_of_bin(k):
    """Return the gap in units of u D in the middle of a bin."""
    return 10 ** (FIRST + STEP * (k + 0.5))


def _pooled(rows):
    pooled = {}
    for (method, _, k), counts in rows.items():
        before = pooled.setdefault(method, {}).get(k, (0, 0, 0, 0))
        pooled[method][k] = [a + b for a, b in zip(before, counts)]
    return {method: [[k, *of[k]] for k in sorted(of)] for method, of in pooled.items()}


def _of_method(rows, method):
    found = {}
    for (name, family, k), counts in sorted(rows.items()):
        if name == method:
            found.setdefault(family, []).append([k, *counts])
    return found


def _distance_square(p, q):
    """Return the square of the distance of two bodies apart, numerator and denominator."""
    least = None
    for body, other in ((p, q), (q, p)):
        for x, y in body:
            for i in range(len(other)):
                square = _square_to_edge(x, y, other[i - 1], other[i])
                if least is None or square[0] * least[1] < least[0] * square[1]:
                    least = square
    return least


def _square_to_edge(x, y, start, end):
    ex, ey = end[0] - start[0], end[1] - start[1]
    wx, wy = x - start[0], y - start[1]
    along, length = wx * ex + wy * ey, ex * ex + ey * ey
    if along <= 0 or length == 0:
        return wx * wx + wy * wy, 1
    if along >= length:
        return (x - end[0]) ** 2 + (y - end[1]) ** 2, 1
    return (ex * wy - ey * wx) ** 2, length


def _depth_square(p, q):
    """Return the square of the penetration depth of two convex bodies that meet, likewise."""
    least = None
    for body, other in ((p, q), (q, p)):
        for i in range(len(body) if len(body) > 1 else 0):
            x, y = body[i - 1]
            ex, ey = body[i][0] - x, body[i][1] - y
            reach = max(ex * (v[1] - y) - ey * (v[0] - x) for v in other)
            square = reach * reach, ex * ex + ey * ey
            if least is None or square[0] * least[1] < least[0] * square[1]:
                least = square
    return least or (0, 1)

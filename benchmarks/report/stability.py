# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Wrong answers by family, condition, distance from the origin, float32, step; and the long run.

A pair's signed separation g is exact up to its last rounding. With D the largest magnitude of a
coordinate and u = 2^-53 the condition number is u D / |g|, infinite where bodies touch; figures
are by its reciprocal, the gap in units of u D. A wrong answer about a gap g is right for bodies
moved by |g| / 2 each: |g| / 2 in units of u D is its backward error c.
"""

from collections import Counter, defaultdict
import math
import sys
import time

import families
import methods
import numpy as np
import oracle
import rationals
import rivals
from sat_collision import (
    closest_points, intersects, intersects_pairs, Polygon, PolygonError, PolygonSet, separation)
from scenes import EXACT, stages
import shapes

SIDES = 3, 4, 8, 16, 64
OFFSETS = 0, *(10**k for k in range(9))
# Of pairs at a distance, and of those drawn.
SHOWN_SIDES = 8
DISTANCES = 10, 100, 1e3, 5e3, 1e4, 2e4, 1e5, 1e6, 5e6
GROWING = 'traditional', 'traditional_float32', 'gjk', 'improved', 'shapely'
STEPS = {'published_a': ('centre line', 'edge normals at B and C', 'lines to the nearest points'),
         'published_b': ('centre line, four vertices', 'normals of the crossed edges')}
FEW_SIDES = 3, 4, 8, 16
# Of the long run, and the share of answers proved by the oracle's filter that integers check.
LONG_SIDES = 3, 4, 5, 6, 8, 16, 32, 64, 256, 1024
CHECKED = 1 / 1000
# Bins of half a decade of |g| / (u D); below the first all, and bodies that touch, in bins of
# their own.
STEP = 0.5
FIRST, LAST = -3.0, 16.0


def by_family(rng, count=2000):
    """Return wrong answers by family and method; non-convex bodies are decided by two methods."""
    rows = []
    for name, family in {**families.CONVEX, **families.SIMPLE}.items():
        pairs = methods.of_family(rng, family, count, SIDES)
        meet, _ = oracle.intersects_pairs(pairs)
        answers = _answers(pairs, ('improved', 'shapely') if name in families.SIMPLE
                           else methods.METHODS)
        rows += [{'family': name, 'method': method, **methods.counts(answer, meet)}
                 for method, answer in answers.items()]
    return rows


def _answers(pairs, names):
    """Return the answers of some methods, by name."""
    prepared = methods.Pairs(pairs)
    with np.errstate(all='ignore'):
        return {name: methods.run(name, prepared) for name in names}


def long_run(pairs, seed):
    """
    Compare millions of answers with the exact oracle, over all hard families.

    Bodies go through the checked constructor and the bulk decision, as in the node; the oracle
    does not use separating axes. Also measured are how often floating point left the decision to
    the exact stage, and its cost. Returns counts by family, and the pairs of wrong answers.
    """
    _compare(families.near(np.random.default_rng(seed), 1, 3), ())  # compiles everything
    results, whole, wrong, start = defaultdict(Counter), Counter(), [], time.perf_counter()
    for k, (family, n, count) in enumerate(_shares(pairs)):
        rng = np.random.default_rng([seed, k])
        for part in methods.chunks(count, n):
            bodies = family(rng, part, n)
            counts, rows = _compare(bodies, np.flatnonzero(rng.random(len(bodies)) < CHECKED))
            results[family.__name__].update(counts)
            whole.update(counts)
            wrong += [{'family': family.__name__, 'n': n, 'pair': [
                body.tolist() for body in bodies[row]]} for row in rows]
        print(f'{time.perf_counter() - start:6.0f} s  {family.__name__}, n = {n}: '
              f'{len(wrong)} wrong so far', file=sys.stderr)
    return {'seed': seed, 'seconds': round(time.perf_counter() - start),
            'families': {**results, 'all': whole}, 'wrong': wrong}


def _shares(pairs):
    """
    Return (family, n, count) for the pairs of a long run.

    Families have equal shares, those of `MANY` less; in a family, counts are proportional to 1/n.
    """
    named = [*families.CONVEX.values(), *families.EXTREME.values(), *families.SIMPLE.values()]
    shares = []
    for family in named:
        share, sides = pairs // len(named), LONG_SIDES
        if family.__name__ in methods.MANY:
            share, sides = share // 50, methods.MANY[family.__name__]
        elif family.__name__ in families.SIMPLE:
            sides = LONG_SIDES[:-2]
        whole = sum(1 / n for n in sides)
        shares += [(family, n, max(1, int(share / n / whole))) for n in sides]
    left = pairs - sum(count for _, _, count in shares)
    return [(*shares[0][:2], shares[0][2] + left), *shares[1:]]


def _compare(pairs, checked):
    """Return counts, and the rows of wrong answers; of the checked rows by integers, too."""
    expected, unknown = oracle.intersects_pairs(pairs)
    checked = [i for i in checked if not unknown[i]]
    if any(oracle.intersects(*pairs[i]) != expected[i] for i in checked):
        raise AssertionError('the filtered oracle contradicts the exact one')
    a, b = ([Polygon(pair[k]) for pair in pairs] for k in (0, 1))
    unsure = stages(PolygonSet(a), PolygonSet(b)) == EXACT
    answers, seconds = np.empty(len(pairs), np.bool_), {}
    for exact in (False, True):
        rows = np.flatnonzero(unsure == exact)
        sets = [PolygonSet(polygons[i] for i in rows) for polygons in (a, b)]
        start = time.perf_counter()
        answers[rows] = intersects_pairs(*sets)
        seconds[exact] = time.perf_counter() - start
    wrong = np.flatnonzero(answers != expected)
    return Counter({
        'pairs': len(pairs), 'meet': int(expected.sum()), 'wrong': len(wrong),
        'oracle_in_integers': int(unknown.sum()), 'oracle_checked': len(checked),
        'exact': int(unsure.sum()), 'seconds': seconds[False], 'exact_seconds': seconds[True],
    }), wrong


def by_offset(rng, count=2000):
    """Return wrong answers and the widest gap or overlap misjudged, by distance from 0."""
    rows = []
    for offset in OFFSETS:
        pairs, gaps = hair_pairs(rng, offset, count, -16)
        meet, _ = oracle.intersects_pairs(pairs)
        prepared = methods.Pairs(pairs)
        for method in GROWING:
            answers = methods.run(method, prepared)
            rows.append({'offset': offset, 'method': method, **methods.counts(answers, meet),
                         'widest': float(np.abs(gaps[answers != meet]).max(initial=0.0))})
    return rows


def by_float32(rng, count=2000):
    """Return how often rounding bodies to float32, as a message does, changes the exact answer."""
    rows = []
    for distance in DISTANCES:
        pairs, gaps = hair_pairs(rng, distance, count, -5)
        changed, refused = [], 0
        for (a, b), gap in zip(pairs, gaps):
            try:
                there = intersects(*(body.astype(np.float32) for body in (a, b)))
            except PolygonError:
                refused += 1
                continue
            if there != intersects(a, b):
                changed.append(abs(float(gap)))
        rows.append({'distance': distance, 'step': float(np.spacing(np.float32(distance))),
                     'pairs': len(pairs), 'changed': len(changed), 'refused': refused,
                     'widest': max(changed, default=0.0)})
    return rows


def hair_pairs(rng, offset, count, least):
    """
    Return pairs of unit size, 10^least to 1 apart or overlapping, and their separations.

    They are moved by the offset, rounded there. Moved back, which is exact far from the origin,
    they are measured with an error that does not grow with the offset.
    """
    gaps = families._hairs(rng, count, least, 0)
    moves = offset * shapes.directions(rng, count)
    pairs = []
    for part in methods.chunks(count, SHOWN_SIDES):
        gap, move = (of[len(pairs):len(pairs) + part] for of in (gaps, moves))
        pairs += families._moved(families._placed_arrays(rng, part, SHOWN_SIDES, gap), move)
    back = [a[0] if offset > 1 else 0.0 for a, _ in pairs]
    return pairs, np.array([separation(a - to, b - to) for (a, b), to in zip(pairs, back)])


def by_step(rng, count=4000):
    """Return by number of vertices at which step near pairs are called clear, rightly or not."""
    rows = []
    for n in methods.SIDES:
        pairs, meet = methods.sample(rng, n, 'near', count if n < 256 else count // 4)
        prepared = methods.Pairs(pairs)
        for method, steps in STEPS.items():
            numbers = methods.steps(method, prepared)
            found = [{'step': step, 'clears': int(((numbers == k) & ~meet).sum()),
                      'false_clears': int(((numbers == k) & meet).sum())}
                     for k, step in enumerate(steps, 1)]
            rows.append({'n': n, 'method': method, 'apart': int((~meet).sum()),
                         'meet': int(meet.sum()), 'steps': found})
    return rows


def examples(rng, count=4000):
    """Return the near pair furthest apart of those A calls colliding, and B's deepest miss."""
    pairs, meet = methods.sample(rng, SHOWN_SIDES, 'near', count)
    prepared = methods.Pairs(pairs)
    found = {}
    for method, wrong in (('published_a', ~meet), ('published_b', meet)):
        answers = methods.run(method, prepared)
        rows = np.flatnonzero((answers != meet) & wrong)
        values = [separation(*pairs[i]) for i in rows]
        a, b = pairs[rows[np.argmax(np.abs(values))]]
        found[method] = {
            'a': a.tolist(), 'b': b.tolist(), 'separation': float(separation(a, b)),
            'closest_points': [point.tolist() for point in closest_points(a, b)],
            'centres': [list(map(float, rivals.centre_of_gravity(body))) for body in (a, b)]}
    return found


def by_condition(rng, count):
    """
    Return wrong answers by method and bin, of one also by family, and backward errors.

    The families are those of convex bodies with few vertices, count pairs of each. A bin is a list
    of its number, false collisions, pairs apart, false clears, and pairs that meet.
    """
    pooled = defaultdict(lambda: defaultdict(lambda: np.zeros(4, int)))
    of_families, worst = defaultdict(list), defaultdict(float)
    for name, family in families.CONVEX.items():
        if name in methods.MANY:
            continue
        pairs = methods.of_family(rng, family, count, FEW_SIDES)
        meet, _ = oracle.intersects_pairs(pairs)
        units = np.array([gap_in_units(a, b, met) for (a, b), met in zip(pairs, meet.tolist())])
        bins = np.array([bin_of(value) for value in units])
        for method, answer in _answers(pairs, methods.METHODS).items():
            wrong = answer != meet
            worst[method] = max(worst[method], float(units[wrong].max(initial=0.0)) / 2)
            for k in np.unique(bins).tolist():
                here = bins == k
                found = np.array([(of & here).sum() for of in (
                    wrong & ~meet, ~meet, wrong & meet, meet)])
                pooled[method][k] += found
                if method == 'traditional':
                    of_families[name].append([k, *found.tolist()])
    return {'bins': {method: [[k, *of[k].tolist()] for k in sorted(of)]
                     for method, of in pooled.items()},
            'families': dict(sorted(of_families.items())), 'backward': worst}


def gap_in_units(a, b, meet):
    """Return the exact distance, or the depth of bodies that meet, as a multiple of u D."""
    p, q = oracle.integers(a, b)
    largest = max(abs(x) for body in (p, q) for point in body for x in point)
    gap = rationals.exact_depth(p, q) if meet else rationals.exact_distance(p, q)
    return float(gap * 2**53 / largest) if gap else 0.0


def bin_of(units):
    """Return the number of the bin for a gap in units of u D: -1 if there is no gap."""
    if units == 0.0:
        return -1
    place = min(max(math.log10(units), FIRST), LAST - STEP)
    return int((place - FIRST) / STEP)


def centre_of_bin(k):
    """Return the gap in units of u D in the middle of a bin."""
    return 10 ** (FIRST + STEP * (k + 0.5))

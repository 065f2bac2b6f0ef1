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

"""Wrong answers by family, distance from the origin, float32 and step of the paper's method."""

import families
from libraries import shapely_shape
from methods import applicable, counts, Pairs, run
import numpy as np
import oracle
import samples
from sat_collision import closest_points, intersects, PolygonError, separation
import sat_methods
import shapely
import shapes

SIDES = 3, 4, 8, 16, 64
OFFSETS = 0, *(10**k for k in range(9))
OFFSET_SIDES = 8
DISTANCES = 10, 100, 1e3, 5e3, 1e4, 2e4, 1e5, 1e6, 5e6
GROWING = 'traditional', 'traditional_float32', 'gjk', 'improved', 'shapely'
DRAWN_SIDES = 8
PUBLISHED = 'published_a', 'published_b'
# The last axis of each step.
STEPS = {'published_a': {'centre line': 1, 'edge normals at B and C': 5,
                         'lines to the nearest points': 9},
         'published_b': {'centre line, four vertices': 1, 'normals of the crossed edges': 3}}


def by_family(rng, count=2000):
    """Return wrong answers by family and method; of bodies that are not convex, of two methods."""
    rows = []
    for name, family in {**families.CONVEX, **families.SIMPLE}.items():
        pairs = samples.of_family(rng, family, count, SIDES)
        meet, _ = oracle.intersects_pairs(pairs)
        if name in families.SIMPLE:
            answers = {
                'improved': np.array([intersects(a, b) for a, b in pairs]),
                'shapely': shapely.intersects(*(np.array([shapely_shape(pair[k])
                                                          for pair in pairs]) for k in (0, 1)))}
        else:
            prepared = Pairs(pairs)
            with np.errstate(all='ignore'):
                answers = {method: run(method, prepared)[0] for method in applicable()}
        rows += [{'family': name, 'method': method, **counts(answer, meet)}
                 for method, answer in answers.items()]
    return rows


def by_offset(rng, count=2000):
    """Return wrong answers and the widest gap or overlap misjudged, by distance from 0."""
    return [{'offset': offset, **row} for offset in OFFSETS
            for row in _misjudged(rng, OFFSET_SIDES, offset, count)]


def by_float32(rng, count=2000):
    """Return how often rounding bodies to float32, as a message does, changes the exact answer."""
    rows = []
    for distance in DISTANCES:
        pairs, gaps = hair_pairs(rng, OFFSET_SIDES, distance, count, -5, 0)
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


def hair_pairs(rng, n, offset, count, least, most):
    """
    Return pairs of unit size, 10^least to 10^most apart or overlapping, and their separations.

    They are moved by the offset, rounded there. Moved back, which is exact far from the origin,
    they are measured with an error that does not grow with the offset.
    """
    gap = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(least, most, count)
    move = offset * shapes.directions(rng, count)
    pairs = []
    size = min(max(5_000_000 // n**2, 4), 10_000)
    for start in range(0, count, size):
        pairs += _moved_pairs(rng, n, gap[start:start + size], move[start:start + size])
    back = [a[0] if offset > 1 else 0.0 for a, _ in pairs]
    return pairs, np.array([separation(a - to, b - to) for (a, b), to in zip(pairs, back)])


def _misjudged(rng, n, offset, count):
    pairs, gaps = hair_pairs(rng, n, offset, count, -16, 0)
    meet, _ = oracle.intersects_pairs(pairs)
    prepared = Pairs(pairs)
    rows = []
    for method in applicable():
        if method in GROWING:
            answers, _ = run(method, prepared)
            misjudged = np.abs(gaps[answers != meet])
            rows.append({'method': method, **counts(answers, meet),
                         'widest': float(misjudged.max(initial=0.0))})
    return rows


def _moved_pairs(rng, n, gap, move):
    count = len(gap)
    a, b = shapes.polygons(rng, count, n), shapes.polygons(rng, count, n)
    heading = shapes.directions(rng, count)
    reach, cosine = shapes.reach(a, b, heading)
    b += ((reach + gap / np.maximum(cosine, 0.1))[:, None] * heading)[:, None]
    return list(zip(*(shapes.convex(body + move[:, None]) for body in (a, b))))


def by_step(rng, count=4000):
    """Return by number of vertices at which step the answers of near pairs fall, right or not."""
    rows = []
    for n in samples.SIDES:
        pairs, meet = samples.sample(rng, n, 'near', count if n < 256 else count // 4)
        prepared = Pairs(pairs)
        for method in PUBLISHED:
            answers, axes = run(method, prepared)
            row = {'n': n, 'method': method, 'apart': int((~meet).sum()),
                   'meet': int(meet.sum()), 'steps': []}
            first = 1
            for step, last in STEPS[method].items():
                here = ~answers & (axes >= first) & (axes <= last)
                row['steps'].append({'step': step, 'clears': int((here & ~meet).sum()),
                                     'false_clears': int((here & meet).sum())})
                first = last + 1
            rows.append(row)
    return rows


def examples(rng, count=4000):
    """Return the near pair furthest apart of those A calls colliding, and B's deepest miss."""
    pairs, meet = samples.sample(rng, DRAWN_SIDES, 'near', count)
    prepared = Pairs(pairs)
    found = {}
    for method, wrong in (('published_a', ~meet), ('published_b', meet)):
        answers, _ = run(method, prepared)
        rows = np.flatnonzero((answers != meet) & wrong)
        values = [separation(*pairs[i]) for i in rows]
        a, b = pairs[rows[np.argmax(np.abs(values))]]
        found[method] = {
            'a': a.tolist(), 'b': b.tolist(), 'separation': float(separation(a, b)),
            'closest_points': [point.tolist() for point in closest_points(a, b)],
            'centres': [list(map(float, sat_methods.centre_of_gravity(body))) for body in (a, b)]}
    return found

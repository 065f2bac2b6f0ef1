# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Pairs of polygons steered, in steps of ulps, to where a filter just decides, or just does not.

Each verdict of the search in doubles is compared with the exact stage, and the final pairs of
climbs with the oracle's integers.
"""

import families
from filter_bounds import along, cross, difference
import numpy as np
import oracle
from sat_collision.geometry.body.layout import first_vertex, Packed, packed_size
from sat_collision.geometry.body.packing import CONVEX, pack
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.numeric.predicates import ORIENTATION_BOUND
from sat_collision.geometry.pair.intersection import convex_meet, meet_near
from sat_collision.geometry.pair.separating_axis import (
    boxes_apart, find_separating_axis, first_axis, MEET, OPEN, PRODUCT_BOUND, refine, support,
    SUPPORT_BOUND, UNCERTAIN)
import shapes

GAP, TURN, RISE, DISC, ORIENTATION = range(5)
NAMES = 'gap', 'turn', 'rise', 'disc', 'orientation'
# Vertices of both bodies; supports are scanned for few and climbed to for many.
COUNTS = (3, 3), (4, 6), (4, 20), (20, 20)
STEPS = 20000
_LARGEST_STEP = 46
# The number of final pairs compared with the oracle, for each filter and count.
ASKED = 300


@kernel
def _danger(value, bound, error):
    """Return less than 1 far from a filter's limit, there 1 + error / bound."""
    size = abs(value)
    if not (0.0 < size < np.inf and 0.0 < bound < np.inf):
        return 0.0
    nearness = min(size, bound) / max(size, bound)
    return nearness if nearness < 0.5 else 1.0 + abs(error) / bound


@kernel
def _of_orientations(p, q):
    """Return the greatest danger of an orientation of an edge of P and a vertex of Q."""
    greatest = 0.0
    first, other = first_vertex(p), first_vertex(q)
    v, w = p.array, q.array
    for i in range(p.n):
        a, b = first + 2 * i, first + 2 * ((i + 1) % p.n)
        for c in range(other, other + 2 * q.n, 2):
            value, size, error = cross(difference(v[a], w[c]), difference(v[b + 1], w[c + 1]),
                                       difference(v[a + 1], w[c + 1]), difference(v[b], w[c]))
            greatest = max(greatest, _danger(value, ORIENTATION_BOUND * size, error))
    return greatest


@kernel
def _of_rises(p, ux, uy):
    """Return the greatest danger of an edge's rise along u."""
    greatest = 0.0
    first = first_vertex(p)
    v = p.array
    for i in range(p.n):
        a, b = first + 2 * i, first + 2 * ((i + 1) % p.n)
        value, size, error = along(difference(v[b], v[a]), difference(v[b + 1], v[a + 1]), ux, uy)
        greatest = max(greatest, _danger(value, PRODUCT_BOUND * size, error))
    return greatest


@kernel
def danger(which, p, q):
    """Return the greatest danger of a filter at any step of the search."""
    if which == ORIENTATION:
        return max(_of_orientations(p, q), _of_orientations(q, p))
    verdict, search = first_axis(p, q)
    if which == DISC:
        inner = p.array[6] + q.array[6]
        return _danger(search.ux * search.ux + search.uy * search.uy, inner * inner, 0.0)
    greatest = 0.0
    for _ in range(8):
        if verdict != OPEN:
            break
        ux, uy = search.ux, search.uy
        i, j = support(p, ux, uy), support(q, -ux, -uy)
        if which == RISE:
            greatest = max(greatest, _of_rises(p, ux, uy), _of_rises(q, ux, uy))
        elif i >= 0 and j >= 0:
            wx = difference(q.array[j], p.array[i])
            wy = difference(q.array[j + 1], p.array[i + 1])
            if which == GAP:
                value, size, error = along(wx, wy, ux, uy)
                bound = PRODUCT_BOUND * size + SUPPORT_BOUND * (
                    abs(ux) * search.reach_x + abs(uy) * search.reach_y)
                greatest = max(greatest, _danger(value, bound, error))
            else:
                for bx, by in ((search.ax, search.ay), (search.bx, search.by)):
                    value, size, error = cross((bx, 0.0), (by, 0.0), wx, wy)
                    greatest = max(greatest, _danger(value, PRODUCT_BOUND * size, error))
        verdict, search = refine(p.array, i, q.array, j, search)
    return greatest


@kernel
def pack_both(x, n, p, q):
    """Pack the bodies in x; tell whether both are strictly convex with all vertices."""
    verdict, count, _, _, _ = pack(x[:2 * n], p, n, n)
    if verdict != CONVEX or count != n:
        return False
    m = len(x) // 2 - n
    verdict, count, _, _, _ = pack(x[2 * n:], q, m, m)
    return verdict == CONVEX and count == m


@kernel
def nudge(x, random):
    """Change one or two numbers in place by a power of two of ulps."""
    bits = x.view(np.int64)
    for _ in range(random.integers(1, 3)):
        k = random.integers(0, len(x))
        move = 1 << random.integers(0, 50)
        bits[k] += move if random.random() < 0.5 else -move


@kernel
def climb(score, which, x, shape, steps, random):
    """
    Change an input in place, step by step; return its score and the mistakes on the way.

    `score(which, x, shape)` returns the score, which changes must not lessen, and a mistake.
    """
    best, mistakes = -1.0, 0
    kept = x.copy()
    for step in range(steps):
        if step > 0:
            nudge(x, random)
        found, wrong = score(which, x, shape)
        mistakes += wrong
        if found >= best:
            best = found
            kept[:] = x
        else:
            x[:] = kept
    return best, mistakes


@kernel
def are_between(x, least, greatest):
    """Return whether the magnitudes of all numbers are between two."""
    for k in range(len(x)):
        if not least < abs(x[k]) < greatest:
            return False
    return True


@kernel
def steer(which, x, n, steps, random):
    """
    Change two bodies in place, n vertices and the rest, to increase a filter's danger.

    Returns the danger, the number of proved verdicts on the way, and how many were wrong.
    """
    m = len(x) // 2 - n
    a, b = np.empty(packed_size(n)), np.empty(packed_size(m))
    bits = x.view(np.int64)
    best, proved, wrong = 0.0, 0, 0
    kept = x.copy()
    # Steps are about as large as the last successful one, and become smaller.
    exponent = power = _LARGEST_STEP
    for step in range(steps):
        if step > 0:
            k = random.integers(0, len(x))
            power = min(max(exponent + random.integers(-3, 4), 0), _LARGEST_STEP)
            move = random.integers(1, 4) << power
            bits[k] += move if random.random() < 0.5 else -move
        found = -1.0
        if pack_both(x, n, a, b):
            p, q = Packed(a, 0, n), Packed(b, 0, m)
            found = 0.0
            if not boxes_apart(p, q):
                found = danger(which, p, q)
                verdict, _, _, _ = find_separating_axis(p, q)
                if verdict != UNCERTAIN:
                    proved += 1
                    exact = meet_near(p, q, first_vertex(p), first_vertex(q))
                    wrong += (verdict == MEET) != exact
        if found > best:
            exponent = power
        elif random.random() < 0.03:
            exponent = exponent - 1 if exponent > 0 else _LARGEST_STEP
        if found >= best:
            best = found
            kept[:] = x
        else:
            x[:] = kept
    return best, proved, wrong


@kernel
def decide(x, n):
    """Return the answer for the bodies in x."""
    m = len(x) // 2 - n
    a, b = np.empty(packed_size(n)), np.empty(packed_size(m))
    pack_both(x, n, a, b)
    return convex_meet(Packed(a, 0, n), Packed(b, 0, m))


def starts_of(rng, count, n, m):
    """Return near pairs of n and m vertices, some of them far from the origin."""
    a, b = shapes.polygons(rng, count, n), shapes.polygons(rng, count, m)
    gap = np.where(rng.random(count) < 0.5, families._hairs(rng, count), rng.normal(0, 0.1, count))
    a, b = families._placed_arrays(rng, count, n, gap, a, b)
    offset = (rng.normal(size=(count, 1, 2))
              * rng.choice([0.0, 1.0, 1e3, 1e6], (count, 1, 1)))
    return np.concatenate([a + offset, b + offset], axis=1).reshape(count, -1)


def at_the_edge(which, n, m, evaluations, seed=1):
    """
    Steer pairs of n and m vertices to a filter's limit, and on to large errors.

    Return the share of starts from which the limit was reached; the largest error there, relative
    to the bound; how many verdicts the filters proved; and how many of these, or of the final
    answers, were wrong.
    """
    rng = np.random.default_rng(seed)
    starts = starts_of(rng, max(evaluations // STEPS, 10), n, m)
    found = np.array([steer(which, x, n, evaluations // len(starts), rng) for x in starts])
    ends = starts[np.argsort(-found[:, 0])[:ASKED]]
    wrong = sum(decide(x, n) != oracle.intersects(x[:2 * n].reshape(-1, 2),
                                                  x[2 * n:].reshape(-1, 2)) for x in ends)
    return ((found[:, 0] >= 1.0).mean(), found[:, 0].max() - 1.0, int(found[:, 1].sum()),
            int(found[:, 2].sum() + wrong))


def largest(score, which, starts, shape, evaluations, rng):
    """Climb from all starts; return the largest score and the number of mistakes."""
    steps = evaluations // len(starts)
    found, mistakes = zip(*(climb(score, which, x, shape, steps, rng) for x in starts))
    return max(found), sum(mistakes)


def rows(evaluations, seed):
    """Yield a row for each filter, and how many answers were wrong."""
    for which, name in enumerate(NAMES):
        found = [at_the_edge(which, n, m, evaluations // len(COUNTS), seed) for n, m in COUNTS]
        arrived, ratio, proved, wrong = np.array(found).T
        yield (name, f'{100 * arrived.mean():.0f} %',
               '' if which == DISC else f'{ratio.max():.4f}', f'{proved.sum() / 1e6:.1f}e6',
               f'{wrong.sum():.0f}', f'{evaluations:.0e}', int(wrong.sum()))

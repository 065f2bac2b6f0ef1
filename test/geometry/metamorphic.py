# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Bodies of integers in or near contact, and changes that must not change any answer."""

import families
import numpy as np
from sat_collision import intersects_pairs, Polygon, PolygonSet


def pairs_of(rng, count, n):
    """Return two (count, n, 2) arrays of integers: convex bodies at most a step from touching."""
    parts = [contact(rng, share, n)[:2] for contact, share in zip(
        (families._vertex_on_vertex, families._vertex_on_edge, families._edge_on_edge),
        (count // 3, count // 3, count - 2 * (count // 3)))]
    a, b = (np.concatenate(bodies) for bodies in zip(*parts))
    return a, b + rng.integers(-1, 2, (count, 1, 2)) * (rng.random((count, 1, 1)) < 0.5)


def sets_of(a, b):
    return [PolygonSet(map(Polygon, bodies)) for bodies in (a, b)]


def _moved(rng, *bodies):
    move = rng.integers(-10**6, 10**6, (len(bodies[0]), 1, 2))
    return [ring + move for ring in bodies]


def _sheared(rng, *bodies):
    share = rng.integers(-9, 10, (len(bodies[0]), 1))
    return [np.stack([ring[..., 0] + share * ring[..., 1], ring[..., 1]], axis=2)
            for ring in bodies]


def _sheared_twice(rng, *bodies):
    return [ring @ [[1, 3], [2, 7]] for ring in bodies]


def _started_elsewhere(rng, *bodies):
    return [np.take_along_axis(ring, (np.arange(ring.shape[1]) + rng.integers(
        0, ring.shape[1], (len(ring), 1)))[..., None] % ring.shape[1], axis=1) for ring in bodies]


def _reversed(rng, *bodies):
    return [ring[:, ::-1] for ring in bodies]


def _with_middles(rng, *bodies):
    return [np.stack([ring, (ring + np.roll(ring, -1, axis=1)) / 2], axis=2).reshape(
        len(ring), -1, 2) for ring in bodies]


def _scaled(rng, *bodies):
    exponent = rng.integers(-900, 900, (len(bodies[0]), 1, 1))
    return [np.ldexp(ring, exponent) for ring in bodies]


def _exchanged(rng, a, b):
    return b, a


# Each maps both bodies without rounding, rewrites their rings, or exchanges them.
CHANGES = {change.__name__.lstrip('_').replace('_', ' '): change for change in (
    _moved, _sheared, _sheared_twice, _started_elsewhere, _reversed, _with_middles, _scaled,
    _exchanged)}


def changed_answers(name, rng, count, n):
    """Return how many of count pairs have another answer after a change, in either order."""
    a, b = pairs_of(rng, count, n)
    answers = intersects_pairs(*sets_of(a, b))
    p, q = sets_of(*CHANGES[name](rng, a, b))
    return int((intersects_pairs(p, q) != answers).sum()
               + (intersects_pairs(q, p) != answers).sum())


def lost_by_a_cut(rng, count, n):
    """Return for how many bodies, cut along a diagonal, the halves give another answer."""
    a, b = pairs_of(rng, count, n)
    i, k = sorted(rng.choice(n, 2, replace=False))
    whole, other = sets_of(a, b)
    half, rest = sets_of(a[:, i:k + 1], np.concatenate([a[:, k:], a[:, :i + 1]], axis=1))
    return int(((intersects_pairs(half, other) | intersects_pairs(rest, other))
                != intersects_pairs(whole, other)).sum())


def rows(count, seed):
    """Yield a row for each change, and how many answers changed."""
    rng = np.random.default_rng(seed)
    for name in CHANGES:
        changed = sum(changed_answers(name, rng, count // 2, n) for n in (5, 19))
        yield name, changed, f'{count:.0e}', changed
    lost = sum(lost_by_a_cut(rng, count // 20, n) for n in (5, 19) for _ in range(10))
    yield 'cut along a diagonal', lost, f'{count:.0e}', lost

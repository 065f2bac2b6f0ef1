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

"""`intersects` against the exact oracle on every hard family."""

import families
import numpy as np
import oracle
import pytest

from sat_collision import intersects, intersects_pairs, Polygon, PolygonSet
from sat_collision.geometry import sat_methods

ALL = {**families.CONVEX, **families.SIMPLE}
EVERY = {**ALL, **families.EXTREME}
HARD = ('hair_gaps', 'far_offsets', 'slivers', 'one_ulp', 'rectangles_on_edge', 'collinear_edges',
        'points_and_segments', 'extreme_scales')

# Each gives the same body, or both bodies changed alike without rounding.
UNCHANGED = {
    'other winding': lambda body: body[::-1],
    'other first vertex': lambda body: np.roll(body, len(body) // 2, axis=0),
    'closed ring': lambda body: np.concatenate([body, body[:1]]),
    'repeated vertices': lambda body: np.repeat(body, 2, axis=0),
    'x and y exchanged': lambda body: body[:, ::-1],
    'turned by half a turn': lambda body: -body,
    'scaled up': lambda body: body * 2.0**40,
    'scaled down': lambda body: body * 2.0**-40,
    'with z': lambda body: np.column_stack([body, np.full(len(body), np.nan)]),
}


def pairs_of(name, count, n, seed=7):
    return EVERY[name](np.random.default_rng(seed), count, n)


def bulk(pairs):
    return intersects_pairs(*(PolygonSet(Polygon(pair[k]) for pair in pairs) for k in (0, 1)))


@pytest.mark.parametrize('n', [3, 4, 9, 24])
@pytest.mark.parametrize('name', EVERY)
def test_every_answer_is_the_oracles(name, n):
    pairs = pairs_of(name, 500, n)
    truth, _ = oracle.intersects_pairs(pairs)
    np.testing.assert_array_equal(bulk(pairs), truth)
    assert [intersects(p, q) for p, q in pairs[:50]] == truth[:50].tolist()


@pytest.mark.parametrize('n', [256, 1024])
@pytest.mark.parametrize('name', ['many_sided', 'hair_gaps', 'flat_arcs', 'float32_round_trip'])
def test_bodies_of_many_sides(name, n):
    pairs = pairs_of(name, 20, n)
    np.testing.assert_array_equal(bulk(pairs), oracle.intersects_pairs(pairs)[0])


@pytest.mark.parametrize('change', UNCHANGED)
@pytest.mark.parametrize('name', EVERY)
def test_answers_do_not_depend_on_how_the_bodies_are_written(name, change):
    if 'scaled' in change and name in ('one_ulp', *families.EXTREME):
        pytest.skip('no room for another scale')
    pairs = pairs_of(name, 60, 6)
    changed = [[UNCHANGED[change](body) for body in pair] for pair in pairs]
    np.testing.assert_array_equal(bulk(changed), bulk(pairs))


@pytest.mark.parametrize('name', EVERY)
def test_bodies_may_be_exchanged(name):
    pairs = pairs_of(name, 200, 6)
    np.testing.assert_array_equal(bulk([(b, a) for a, b in pairs]), bulk(pairs))


@pytest.mark.parametrize('exponent', [-1060, -700, 700, 1015])
def test_no_surprise_beyond_the_scales_of_the_families(exponent):
    """Down to denormal numbers, which coarsen the bodies, and up to the largest: still exact."""
    pairs = [(np.ldexp(a, exponent), np.ldexp(b, exponent))
             for name in ('near', 'hair_gaps', 'rectangles_on_edge', 'points_and_segments')
             for a, b in pairs_of(name, 100, 3)]
    truth = [oracle.intersects(a, b) for a, b in pairs]
    np.testing.assert_array_equal(bulk(pairs), truth)


@pytest.mark.parametrize('name', HARD)
def test_hard_families_defeat_plain_floating_point(name):
    pairs = pairs_of(name, 500, 5)
    plain = np.array([sat_methods.traditional(p, q) for p, q in pairs])
    assert (plain != oracle.intersects_pairs(pairs)[0]).any()


@pytest.mark.parametrize('name', ALL)
def test_families_keep_their_promises(name):
    """Bodies are valid, exactly convex where promised, and both answers occur."""
    pairs = pairs_of(name, 300, 8)
    assert len(pairs) == 300
    truth, _ = oracle.intersects_pairs(pairs)
    assert truth.any()
    assert name == 'containment' or not truth.all()
    if name in families.CONVEX:
        for body in (body for pair in pairs[:50] for body in pair):
            grid, = oracle.integers(body)
            turns = [oracle.orientation(grid[i], grid[j], grid[k])
                     for i in range(len(grid)) for j in range(i) for k in range(j)]
            assert all(turn < 0 for turn in turns)


def test_random_pairs_are_half_separate():
    truth, _ = oracle.intersects_pairs(pairs_of('random_pairs', 3000, 5))
    assert 0.45 < truth.mean() < 0.55


def lattice_pairs(rng, count, n):
    """Return pairs of even integers up to a thousand, most of them in contact or nearly so."""
    pairs = families.vertex_on_vertex(rng, count // 3, n) + families.edge_on_edge(
        rng, count // 3, n) + families.vertex_on_edge(rng, count - 2 * (count // 3), n)
    return [[body / scale for body in pair] for pair, scale in
            ((pair, _unit(np.concatenate(pair)) / 2) for pair in pairs)]


def _unit(numbers):
    """Return the greatest power of two that all numbers are multiples of."""
    return min(1 / x.as_integer_ratio()[1] if x % 1 else x.as_integer_ratio()[0]
               & -x.as_integer_ratio()[0] for x in numbers.ravel().tolist() if x)


def with_middles(ring):
    return np.stack([ring, (ring + np.roll(ring, -1, axis=0)) / 2], axis=1).reshape(-1, 2)


# Exact maps of the plane, and other ways to write a ring, that leave integers integers.
MAPS = {
    'moved': lambda rng: lambda ring, move=rng.integers(-10**6, 10**6, 2): ring + move,
    'sheared': lambda rng: lambda ring, k=rng.integers(-9, 10): ring @ [[1, 0], [k, 1]],
    'sheared twice': lambda rng: lambda ring: ring @ [[1, 3], [2, 7]],
    'another start': lambda rng: lambda ring: np.roll(ring, rng.integers(len(ring)), axis=0),
    'reversed': lambda rng: lambda ring: ring[::-1],
    'middles of edges': lambda rng: with_middles,
    'powers of two': lambda rng: lambda ring, e=int(rng.integers(-900, 900)): np.ldexp(ring, e),
}


@pytest.mark.parametrize('n', [5, 19])
@pytest.mark.parametrize('name', MAPS)
def test_exact_maps_change_no_answer(name, n):
    rng = np.random.default_rng(5)
    pairs = lattice_pairs(rng, 5000, n)
    mapped = []
    for pair in pairs:
        change = MAPS[name](rng)
        mapped.append([change(body) for body in pair])
    answers = bulk(pairs)
    np.testing.assert_array_equal(bulk(mapped), answers)
    np.testing.assert_array_equal(bulk([pair[::-1] for pair in mapped]), answers)
    assert 0.3 < answers.mean() < 0.95


@pytest.mark.parametrize('n', [5, 19])
def test_a_body_is_met_where_one_of_its_halves_is(n):
    """The halves, cut along a diagonal, share it: nothing is lost between them."""
    rng = np.random.default_rng(6)
    pairs, halves, others = lattice_pairs(rng, 5000, n), [], []
    for a, b in pairs:
        i, k = sorted(rng.choice(len(a), 2, replace=False))
        halves.append((a[i:k + 1], b))
        others.append((np.concatenate([a[k:], a[:i + 1]]), b))
    np.testing.assert_array_equal(bulk(halves) | bulk(others), bulk(pairs))

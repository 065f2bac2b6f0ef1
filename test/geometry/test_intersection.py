# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""`intersects` and the exact oracle: each other, GEOS, and cases of JTS, GEOS and CGAL."""

import families
import numpy as np
import oracle
from published import load
import pytest
from sat_collision import intersects, intersects_pairs, Polygon, PolygonError, PolygonSet, Reason
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.geometry.numeric.predicates import orient

EVERY = {**families.ALL, **families.EXTREME}
COUNT = 2000 if COMPILED else 300
NO_ROOM_TO_SCALE = ('one_ulp', *families.EXTREME)

# Each gives the same body, or the same change of both bodies without rounding.
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


@pytest.mark.parametrize('count', [200, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize('n', [3, 4, 9, 24])
@pytest.mark.parametrize('name', EVERY)
def test_answers_agree_with_the_oracle(name, n, count):
    pairs = pairs_of(name, count, n)
    truth, _ = oracle.intersects_pairs(pairs)
    np.testing.assert_array_equal(bulk(pairs), truth)
    assert [intersects(p, q) for p, q in pairs[:50]] == truth[:50].tolist()


@pytest.mark.parametrize('count', [8, pytest.param(20, marks=pytest.mark.long)])
@pytest.mark.parametrize('n', [256, 1024])
@pytest.mark.parametrize('name', ['many_sided', 'hair_gaps', 'flat_arcs', 'float32_round_trip'])
def test_bodies_with_many_vertices(name, n, count):
    pairs = pairs_of(name, count, n)
    np.testing.assert_array_equal(bulk(pairs), oracle.intersects_pairs(pairs)[0])


@pytest.mark.parametrize('name, change', [
    (name, change) for name in EVERY for change in UNCHANGED
    if not ('scaled' in change and name in NO_ROOM_TO_SCALE)])
def test_answers_do_not_depend_on_order_and_representation(name, change):
    pairs = pairs_of(name, 100, 6)
    if change == 'with z':  # two points with z look like three points in columns
        pairs = [pair for pair in pairs if all(len(body) != 2 for body in pair)]
    changed = [[UNCHANGED[change](body) for body in pair[::-1]] for pair in pairs]
    np.testing.assert_array_equal(bulk(changed), bulk(pairs))


@pytest.mark.parametrize('exponent', [-1060, -700, 700, 1015])
def test_extreme_scales(exponent):
    """Denormal numbers coarsen the bodies, but answers are exact for the result."""
    pairs = [(np.ldexp(a, exponent), np.ldexp(b, exponent))
             for name in ('near', 'hair_gaps', 'rectangles_on_edge', 'points_and_segments')
             for a, b in pairs_of(name, 100, 3)]
    truth = [oracle.intersects(a, b) for a, b in pairs]
    np.testing.assert_array_equal(bulk(pairs), truth)


@pytest.mark.parametrize('name', families.ALL)
def test_families(name):
    """Bodies are valid, and convex if promised; both answers occur."""
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


def integer_pairs(rng, count, n):
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


def _with_middles(rng, *bodies):
    return [np.stack([ring, (ring + np.roll(ring, -1, axis=1)) / 2], axis=2).reshape(
        len(ring), -1, 2) for ring in bodies]


# Each maps both bodies without rounding, or divides their edges.
CHANGES = {change.__name__.lstrip('_').replace('_', ' '): change for change in (
    _moved, _sheared, _sheared_twice, _with_middles)}


def changed_answers(name, rng, count, n):
    """Return how many of count pairs have another answer after a change, in either order."""
    a, b = integer_pairs(rng, count, n)
    answers = intersects_pairs(*sets_of(a, b))
    p, q = sets_of(*CHANGES[name](rng, a, b))
    return int((intersects_pairs(p, q) != answers).sum()
               + (intersects_pairs(q, p) != answers).sum())


def lost_by_a_cut(rng, count, n):
    """Return for how many bodies, cut along a diagonal, the halves give another answer."""
    a, b = integer_pairs(rng, count, n)
    i, k = sorted(rng.choice(n, 2, replace=False))
    whole, other = sets_of(a, b)
    half, rest = sets_of(a[:, i:k + 1], np.concatenate([a[:, k:], a[:, :i + 1]], axis=1))
    return int(((intersects_pairs(half, other) | intersects_pairs(rest, other))
                != intersects_pairs(whole, other)).sum())


@pytest.mark.parametrize('n', [5, 19])
@pytest.mark.parametrize('name', CHANGES)
def test_exact_changes_change_no_answer(name, n):
    assert changed_answers(name, np.random.default_rng(5), COUNT, n) == 0


@pytest.mark.parametrize('n', [5, 19])
def test_body_intersects_if_one_of_its_halves_does(n):
    """The halves share the diagonal along which the body is cut."""
    rng = np.random.default_rng(6)
    assert sum(lost_by_a_cut(rng, COUNT // 5, n) for _ in range(5)) == 0


def test_both_answers_occur_in_pairs_that_are_changed():
    answers = intersects_pairs(*sets_of(
        *integer_pairs(np.random.default_rng(7), COUNT, 5)))
    assert 0.3 < answers.mean() < 0.95


SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
NON_CONVEX = [[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]]


@pytest.mark.parametrize('a, b, meet', [
    (SQUARE, [[1, 1], [2, 1], [1, 2]], True),
    (SQUARE, [[5, 5], [6, 5], [5, 6]], False),
    (SQUARE, [[4, 4], [6, 5], [5, 6]], True),
    (SQUARE, [[4, 1], [6, 1], [6, 2]], True),
    (SQUARE, [[-1, 2], [9, 2], [9, 3], [-1, 3]], True),
    (SQUARE, [[2, 2]], True),
    (SQUARE, [[4, 2]], True),
    (SQUARE, [[np.nextafter(4, 5), 2]], False),
    (SQUARE, [[-1, 5], [5, 5]], False),
    (SQUARE, [[-1, -1], [5, 5]], True),
    (NON_CONVEX, [[2, 2]], False),
    (NON_CONVEX, [[2, 1]], True),
    (NON_CONVEX, [[1.5, 3], [2, 2], [2.5, 3]], False),
    (NON_CONVEX, [[0.5, 3], [2, 2], [2.5, 3]], True),
    ([[0, 0], [2, 0]], [[2, 0], [5, 0]], True),
    ([[0, 0], [2, 0]], [[3, 0], [5, 0]], False),
    ([[0, 0], [2, 2]], [[0, 2], [2, 0]], True),
    ([[1, 1]], [[1, 1]], True),
    ([[1, 1]], [[1, 1 + 2.0**-52]], False),
])
def test_oracle_in_simple_cases(a, b, meet):
    pairs = [(np.array(p, float), np.array(q, float)) for p in (a, a[::-1]) for q in (b, b[::-1])]
    pairs += [(q, p) for p, q in pairs]
    assert {oracle.intersects(p, q) for p, q in pairs} == {meet}
    assert set(oracle.intersects_pairs(pairs)[0].tolist()) == {meet}


@pytest.mark.parametrize('name', families.ALL)
def test_filter_of_the_oracle_agrees_with_integers(name):
    pairs = pairs_of(name, 300, 6, seed=3)
    answers, _ = oracle.intersects_pairs(pairs)
    assert answers.tolist() == [oracle.intersects(a, b) for a, b in pairs]


@pytest.mark.parametrize('name', families.ALL)
def test_geos_agrees_with_the_oracle(name):
    shapely = pytest.importorskip('shapely')
    kinds = {1: shapely.Point, 2: shapely.LineString}
    pairs = pairs_of(name, 300, 6, seed=4)
    geos = [[kinds.get(len(body), shapely.Polygon)(body) for body in pair] for pair in pairs]
    assert all(body.is_valid for pair in geos for body in pair)
    answers, _ = oracle.intersects_pairs(pairs)
    assert answers.tolist() == [a.intersects(b) for a, b in geos]


DEGENERATE = {'fewer-than-3-points', 'fewer-than-3-distinct', 'all-collinear',
              'duplicate-consecutive-point'}
SELF_INTERSECTING = {'self-intersection', 'self-touch', 'spike-or-foldback'}


@pytest.mark.parametrize('name', ['convex', 'nonconvex', 'near_touch'])
def test_published_pairs(name):
    cases = load('pairs')[name]
    expected = [case['intersects'] for case in cases]
    assert [intersects(case['a'], case['b']) for case in cases] == expected
    assert [intersects(case['b'], case['a']) for case in cases] == expected
    sets = [PolygonSet(Polygon(case[k]) for case in cases) for k in 'ab']
    assert intersects_pairs(*sets).tolist() == expected
    assert [oracle.intersects(case['a'], case['b']) for case in cases] == expected


def test_published_orientations_of_nearly_collinear_points():
    for case in load('orientations'):
        assert orient(*map(float, (*case['a'], *case['b'], *case['c']))) == case['sign_ccw']


def test_published_invalid_rings_are_refused():
    """Degenerate ones are accepted as points and segments."""
    for case in load('outlines')['invalid']:
        reasons = set(case['reasons'])
        if reasons <= DEGENERATE:
            assert len(Polygon(case['polygon']).vertices) >= 1
            continue
        with pytest.raises(PolygonError) as caught:
            Polygon(case['polygon'])
        if reasons & SELF_INTERSECTING:
            assert caught.value.reason is Reason.SELF_INTERSECTING
        else:
            assert reasons == {'non-finite'}
            assert caught.value.reason is Reason.NOT_FINITE

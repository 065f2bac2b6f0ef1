# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The oracle itself, and the cases in test/data from the suites of JTS, GEOS and CGAL."""

import families
import numpy as np
import oracle
from published import load
import pytest
from sat_collision import intersects, intersects_pairs, Polygon, PolygonError, PolygonSet, Reason
from sat_collision.geometry.numeric.predicates import orient

ALL = {**families.CONVEX, **families.SIMPLE}
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
def test_simple_cases(a, b, meet):
    pairs = [(np.array(p, float), np.array(q, float)) for p in (a, a[::-1]) for q in (b, b[::-1])]
    pairs += [(q, p) for p, q in pairs]
    assert {oracle.intersects(p, q) for p, q in pairs} == {meet}
    assert set(oracle.intersects_pairs(pairs)[0].tolist()) == {meet}


@pytest.mark.parametrize('name', ALL)
def test_filter_agrees_with_integers(name):
    pairs = ALL[name](np.random.default_rng(3), 300, 6)
    answers, _ = oracle.intersects_pairs(pairs)
    assert answers.tolist() == [oracle.intersects(a, b) for a, b in pairs]


@pytest.mark.parametrize('name', ALL)
def test_geos_agrees(name):
    shapely = pytest.importorskip('shapely')
    kinds = {1: shapely.Point, 2: shapely.LineString}
    pairs = ALL[name](np.random.default_rng(4), 300, 6)
    geos = [[kinds.get(len(body), shapely.Polygon)(body) for body in pair] for pair in pairs]
    assert all(body.is_valid for pair in geos for body in pair)
    answers, _ = oracle.intersects_pairs(pairs)
    assert answers.tolist() == [a.intersects(b) for a, b in geos]


DEGENERATE = {'fewer-than-3-points', 'fewer-than-3-distinct', 'all-collinear',
              'duplicate-consecutive-point'}
SELF_INTERSECTING = {'self-intersection', 'self-touch', 'spike-or-foldback'}


@pytest.mark.parametrize('name', ['convex', 'nonconvex', 'near_touch'])
def test_pairs(name):
    cases = load('pairs')[name]
    expected = [case['intersects'] for case in cases]
    assert [intersects(case['a'], case['b']) for case in cases] == expected
    assert [intersects(case['b'], case['a']) for case in cases] == expected
    sets = [PolygonSet(Polygon(case[k]) for case in cases) for k in 'ab']
    assert intersects_pairs(*sets).tolist() == expected
    assert [oracle.intersects(case['a'], case['b']) for case in cases] == expected


def test_orientations_of_nearly_collinear_points():
    for case in load('orientations'):
        assert orient(*map(float, (*case['a'], *case['b'], *case['c']))) == case['sign_ccw']


def test_invalid_rings_are_refused():
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

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

"""The oracle itself: drawn cases, its filter against its integers, and GEOS as second opinion."""

import families
import numpy as np
import oracle
import pytest

ALL = {**families.CONVEX, **families.SIMPLE}
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
NOTCHED = [[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]]


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
    (NOTCHED, [[2, 2]], False),
    (NOTCHED, [[2, 1]], True),
    (NOTCHED, [[1.5, 3], [2, 2], [2.5, 3]], False),
    (NOTCHED, [[0.5, 3], [2, 2], [2.5, 3]], True),
    ([[0, 0], [2, 0]], [[2, 0], [5, 0]], True),
    ([[0, 0], [2, 0]], [[3, 0], [5, 0]], False),
    ([[0, 0], [2, 2]], [[0, 2], [2, 0]], True),
    ([[1, 1]], [[1, 1]], True),
    ([[1, 1]], [[1, 1 + 2.0**-52]], False),
])
def test_drawn_cases(a, b, meet):
    pairs = [(np.array(p, float), np.array(q, float)) for p in (a, a[::-1]) for q in (b, b[::-1])]
    pairs += [(q, p) for p, q in pairs]
    assert {oracle.intersects(p, q) for p, q in pairs} == {meet}
    assert set(oracle.intersects_pairs(pairs)[0].tolist()) == {meet}


@pytest.mark.parametrize('name', ALL)
def test_the_filter_agrees_with_the_integers(name):
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

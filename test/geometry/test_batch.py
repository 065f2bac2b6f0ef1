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

"""Sets paired row by row."""

from bodies import as_shapely, random_body
import numpy as np
import pytest
from sat_collision import intersects, intersects_pairs, Polygon, PolygonSet


def test_pairs_are_row_by_row():
    """The k-th answer is about the k-th body of both sets."""
    rng = np.random.default_rng(3)
    a = [random_body(rng) for _ in range(400)]
    b = [random_body(rng) for _ in range(400)]
    expected = [as_shapely(p).intersects(as_shapely(q)) for p, q in zip(a, b)]
    answers = intersects_pairs(PolygonSet(a), PolygonSet(b))
    assert answers.dtype == np.bool_ and answers.tolist() == expected
    with pytest.raises(ValueError, match='399'):
        intersects_pairs(PolygonSet(a), PolygonSet(b[1:]))


def test_pairs_of_few_and_many_vertices_side_by_side():
    """What is searched at once and what in step, over several batches and with rows freed."""
    rng = np.random.default_rng(8)

    def body(_):
        if rng.random() < 0.2:
            return random_body(rng)
        angles = np.linspace(0, 2 * np.pi, rng.choice([3, 16, 17, 40, 129, 300]), endpoint=False)
        return Polygon(rng.uniform(0, 20, 2) + rng.uniform(1, 8) * np.column_stack(
            [np.cos(angles), np.sin(angles)]))

    a, b = (list(map(body, range(700))) for _ in range(2))
    expected = np.array([intersects(p, q) for p, q in zip(a, b)])
    assert 200 < expected.sum() < 500
    first, second = PolygonSet(a), PolygonSet(b)
    np.testing.assert_array_equal(intersects_pairs(first, second), expected)
    for rows, bodies in ((range(0, 700, 7), first), (range(5, 700, 11), second)):
        for row in rows:
            bodies.remove(row)
            expected[row] = False
    np.testing.assert_array_equal(intersects_pairs(first, second), expected)

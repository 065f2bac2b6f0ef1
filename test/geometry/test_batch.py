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

"""Many bodies at once: kernels over rows, queries of a set, and scans."""

import math

from bodies import as_shapely, random_body
import numpy as np
import pytest
from sat_collision import (
    intersects, intersects_many, intersects_pairs, Polygon, PolygonSet, separation)


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


def test_many_takes_a_set_or_plain_points():
    """The answer has one entry a body, in order."""
    rng = np.random.default_rng(4)
    others = [random_body(rng) for _ in range(300)]
    footprint = Polygon([(5, 5), (15, 5), (15, 8), (5, 8)])
    expected = [as_shapely(footprint).intersects(as_shapely(other)) for other in others]
    assert 0 < sum(expected) < 300
    assert intersects_many(footprint, PolygonSet(others)).tolist() == expected
    assert intersects_many(footprint.vertices,
                           [other.vertices for other in others]).tolist() == expected
    assert intersects_many(footprint, []).shape == (0,)


def test_nearest_and_within_a_margin():
    """Over sets with holes: the least separation of all rows, and the rows up to a margin."""
    rng = np.random.default_rng(5)
    apart = set()
    for _ in range(40):
        bodies = PolygonSet()
        others = {}
        for _ in range(30):
            other = random_body(rng)
            others[bodies.append(other)] = other
        for row in rng.choice(30, 12, replace=False).tolist():
            bodies.remove(row)
            del others[row]
        footprint = Polygon(rng.uniform(0, 20, 2) + [(0, 0), (0.3, 0), (0, 0.3)])
        expected = {row: separation(footprint, other) for row, other in others.items()}
        row, least, on_row, on_footprint = bodies.nearest(footprint)
        assert math.dist(on_row, on_footprint) == pytest.approx(abs(least), abs=1e-14)
        assert least == pytest.approx(min(expected.values()), abs=1e-14)
        assert expected[row] == pytest.approx(least, abs=1e-14)
        for margin in (0.0, 0.75, 4.0):
            assert bodies.rows_within(footprint, margin).tolist() == sorted(
                row for row, value in expected.items() if value <= margin)
        apart.add(least > 0)
    assert apart == {True, False}


def test_margin_counts_the_distance_itself():
    """A box a quarter of a metre away is within that margin, and not within less."""
    bodies = PolygonSet([Polygon([(1.25, 0), (2, 0), (2, 1), (1.25, 1)])])
    footprint = Polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert bodies.rows_within(footprint, 0.25).tolist() == [0]
    assert bodies.rows_within(footprint, np.nextafter(0.25, 0)).tolist() == []

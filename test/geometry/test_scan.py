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

"""One body against all rows of a set: contacts, margins, what is nearest."""

import math

from bodies import random_body
import numpy as np
import pytest
from sat_collision import Polygon, PolygonSet, separation


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

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

"""What two bodies share as it is drawn, against shapely."""

from builders import box
import numpy as np
import pytest
from sat_collision import Polygon
from sat_collision.messages.shared_region import clip, contact_marks
import shapely

U_SHAPE = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]


def shape(ring):
    """Return the shapely body of a ring."""
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(ring), shapely.Polygon)
    return kind(ring if len(ring) > 1 else ring[0])


def marks(one, other):
    return contact_marks(Polygon(one), Polygon(other))


def test_overlap_of_convex_bodies_is_what_shapely_says():
    """Random polygons around a circle, of which many overlap."""
    random = np.random.default_rng(7)
    overlaps = 0
    for _ in range(200):
        rings = []
        for _ in range(2):
            angles = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 12)))
            rings.append(np.column_stack([np.cos(angles), np.sin(angles)])
                         + random.uniform(-1, 1, 2))
        bodies = [shape(ring) for ring in rings]
        shared = clip(*rings)
        area = shapely.intersection(*bodies).area
        assert shapely.Polygon(shared).area == pytest.approx(area, abs=1e-9) if len(shared) else (
            area == 0.0)
        overlaps += area > 0.0
    assert overlaps > 50


@pytest.mark.parametrize('x, y', [(0.0, 0.0), (5e5, 5e6)])
@pytest.mark.parametrize('one, other', [
    (box(0, 0), box(1, 0)),
    (box(0, 0), box(1, 1)),
    (box(0, 0, 3, 3), [(1, 1)]),
    (box(0, 0, 3, 3), [(-1, 1), (2, 2)]),
    (box(0, 0), [(1, -1), (1, 3)]),
    ([(0, 0), (4, 0)], [(2, -1), (2, 2)]),
    ([(0, 0), (4, 0)], [(1, 0), (6, 0)]),
    ([(0, 0), (4, 0)], [(4, 0), (6, 2)]),
    ([(1, 1)], [(1, 1)]),
    (U_SHAPE, [(1.5, 2), (2, 2)]),
    (U_SHAPE, box(1, 1)),
    (U_SHAPE, box(0.5, 1.5, 2, 1)),
], ids=str)
def test_touching_is_marked_by_what_is_shared(one, other, x, y):
    """A point, a segment or an area, whoever is the footprint; near the origin and far away."""
    one, other = ([(px + x, py + y) for px, py in ring] for ring in (one, other))
    wanted = shapely.intersection(shape(one), shape(other))
    for found in (marks(one, other), marks(other, one)):
        assert found and {min(len(mark), 3) for mark in found} == {wanted_size(wanted)}
        shared = shapely.union_all([shape(mark) for mark in found])
        assert shapely.hausdorff_distance(shared, wanted) < 1e-6 * (1 + abs(y) / 1e3)


def wanted_size(body):
    """Return how many points a mark of a body has at least."""
    return {0.0: 1 if body.length == 0.0 else 2}.get(body.area, 3)


def test_within_the_margin_the_gap_is_marked():
    """From one body to the other, where they are nearest."""
    mark, = marks(box(0, 0), box(1.5, 0.5))
    assert sorted(mark[:, 0].tolist()) == [1.0, 1.5]


def test_bodies_of_very_many_parts_are_marked_where_they_are_deepest():
    """Two combs in each other: one segment between their nearest points, and soon."""
    comb = [(x / 2, 3 if x % 2 else 1) for x in range(200)] + [(100, 0), (0, 0)]
    (mark,) = marks(comb, [(x, -y) for x, y in reversed(comb)])
    assert mark.shape == (2, 2) and np.allclose(mark[:, 1], 0.0)

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

"""Convex parts: few, without new vertices, and of exactly the area of the whole."""

import numpy as np
from published import load
import pytest
from rationals import twice_area
from sat_collision import Polygon

L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]


def test_l_shape_is_cut_in_two():
    """The parts are convex, use no new vertex and have the area of the whole, exactly."""
    polygon = Polygon(L_SHAPE)
    assert not polygon.is_convex
    assert len(polygon.parts) == 2
    assert all(part.is_convex for part in polygon.parts)
    vertices = set(map(tuple, polygon.vertices.tolist()))
    assert all(tuple(v) in vertices for part in polygon.parts for v in part.vertices.tolist())
    assert (sum(twice_area(part.vertices) for part in polygon.parts)
            == twice_area(polygon.vertices) == 10)


@pytest.mark.parametrize('count', [5, 9, 40])
def test_parts_of_random_stars(count):
    """Star-shaped polygons with random radii: area kept exactly, and few parts."""
    rng = np.random.default_rng(count)
    for _ in range(20):
        angles = (np.arange(count) + rng.uniform(0, 0.9, count)) * 2 * np.pi / count
        radii = rng.uniform(0.2, 1.0, count)
        star = Polygon(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))
        assert all(part.is_convex for part in star.parts)
        assert (sum(twice_area(part.vertices) for part in star.parts)
                == twice_area(star.vertices))
        edges = np.roll(star.vertices, -1, axis=0) - star.vertices
        after = np.roll(edges, -1, axis=0)
        reflex = int((edges[:, 0] * after[:, 1] < edges[:, 1] * after[:, 0]).sum())
        assert len(star.parts) <= 2 * reflex + 1


def test_published_outlines():
    """Outlines with holes cut open, notches and spirals."""
    for case in load('outlines')['simple']:
        points = np.array(case['polygon'], float)
        polygon = Polygon(points, max_vertices=len(points))
        own = set(map(tuple, points.tolist()))
        for part in polygon.parts:
            assert part.is_convex
            assert set(map(tuple, part.vertices.tolist())) <= own
        total = sum(twice_area(part.vertices) for part in polygon.parts)
        assert total == abs(twice_area(points))
        assert float(total) / 2 == pytest.approx(case['area'])

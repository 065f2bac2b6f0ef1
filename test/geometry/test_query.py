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

"""What is asked of bodies, given as polygons, sets or plain points."""

from bodies import as_shapely, random_body
import numpy as np
from sat_collision import intersects_many, Polygon, PolygonSet


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

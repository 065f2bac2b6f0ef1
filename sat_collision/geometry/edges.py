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

"""How far points are from edges, given by where their ends stand in an array of vertices."""

from sat_collision.geometry.jit import inner, kernel
from sat_collision.geometry.plane import length, scale_to_one, unit
from sat_collision.geometry.predicates import difference_error, product_error


@kernel
def to_segment(v, a, b, x, y):
    """Return the distance of a point from the segment between two vertices, and its foot there."""
    ex, ey = unit(v[b] - v[a], v[b + 1] - v[a + 1])
    along = (x - v[a]) * ex + (y - v[a + 1]) * ey
    if not along > 0.0:
        return length(x - v[a], y - v[a + 1]), v[a], v[a + 1]
    beyond = (x - v[b]) * ex + (y - v[b + 1]) * ey
    if not beyond < 0.0:
        return length(x - v[b], y - v[b + 1]), v[b], v[b + 1]
    share = along / (along - beyond)
    return (abs(height(v, a, b, x, y)),
            v[a] + share * (v[b] - v[a]), v[a + 1] + share * (v[b + 1] - v[a + 1]))


@kernel
def height(v, a, b, x, y):
    """Return how far a point is to the left of the line from one vertex to another."""
    near = a if abs(x - v[a]) + abs(y - v[a + 1]) < abs(x - v[b]) + abs(y - v[b + 1]) else b
    ex, ex_error = _difference(v[b], v[a])
    ey, ey_error = _difference(v[b + 1], v[a + 1])
    dx, dx_error = _difference(x, v[near])
    dy, dy_error = _difference(y, v[near + 1])
    edge_scale = scale_to_one(max(abs(ex), abs(ey)))
    scale = scale_to_one(max(abs(dx), abs(dy)))
    ex *= edge_scale
    ey *= edge_scale
    dx *= scale
    dy *= scale
    left = ex * dy
    right = ey * dx
    turn, error = _difference(left, right)
    # What rounding took from the products and the differences before, but for its square.
    error += (product_error(ex, dy, left) - product_error(ey, dx, right)
              + (ex * (dy_error * scale) + (ex_error * edge_scale) * dy)
              - (ey * (dx_error * scale) + (ey_error * edge_scale) * dx))
    return (turn + error) / length(ex, ey) / scale


@inner
def _difference(a, b):
    """Return a - b rounded, and what is lost by it."""
    difference = a - b
    return difference, difference_error(a, b, difference)

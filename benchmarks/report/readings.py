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

"""
The paper's other readings, so that nothing in it goes unmeasured.

Kernels as those of `sat_methods`: convex polygons as counter-clockwise (n, 2) arrays, the centres
of gravity made in advance; each returns the answer and how many axes it projected on.
"""

import math

from sat_collision.geometry.jit import kernel
from sat_methods import crossed_edge, edge_separates, separates, to_edge


@kernel
def hybrid_axes(p, q, centre_p, centre_q):
    """
    Decide by the charitable hybrid of the readings A and B.

    All vertices are projected on the centre line as in section 3.2, which never misses a
    collision; then on the normals of the two edges that it crosses, as in section 4.
    """
    x = centre_q[0] - centre_p[0]
    y = centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return False, 1
    if edge_separates(p, q, p, crossed_edge(p, centre_p, x, y)):
        return False, 2
    return not edge_separates(p, q, q, crossed_edge(q, centre_q, -x, -y)), 3


@kernel
def closest_axes(p, q):
    """
    Decide by the line through the closest points, found as equations 3 and 4 say, by brute force.

    The distances from every vertex to every edge of the other polygon are compared. The paper
    calls that undesirable (section 3.1); it is complete but for rounding, and takes n m distances.
    """
    least = math.inf
    x = y = 0.0
    for body, other in ((p, q), (q, p)):
        for k in range(len(body)):
            for i in range(len(other)):
                to_x, to_y = to_edge(body[k, 0], body[k, 1], other, i)
                square = to_x * to_x + to_y * to_y
                if square < least:
                    least = square
                    x = to_x
                    y = to_y
    return not separates(p, q, x, y), 1


@kernel
def literal_axes(p, q, centre_p, centre_q):
    """
    Decide as reading A, with B and C chosen as equation 5 is printed: the longest OB / cos BOE.

    That length grows without bound as OB turns away from the centre line, so it picks vertices
    beside the body rather than near the other one.
    """
    x = centre_q[0] - centre_p[0]
    y = centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return False, 1
    axes = 1
    b, c = _longest(p, centre_p, x, y), _longest(q, centre_q, -x, -y)
    for body, nearest in ((p, b), (q, c)):
        for i in (nearest, (nearest + 1) % len(body)):
            axes += 1
            if edge_separates(p, q, body, i):
                return False, axes
    for body, vertex, other, nearest in ((p, b, q, c), (q, c, p, b)):
        for i in (nearest, (nearest + 1) % len(other)):
            axes += 1
            x, y = to_edge(body[vertex, 0], body[vertex, 1], other, i)
            if separates(p, q, x, y):
                return False, axes
    return True, axes


@kernel
def _longest(polygon, centre, x, y):
    """Return the vertex with the longest OB / cos of those before the centre, up to |(x, y)|."""
    best = 0
    most = 0.0
    for i in range(len(polygon)):
        to_x = polygon[i, 0] - centre[0]
        to_y = polygon[i, 1] - centre[1]
        along = to_x * x + to_y * y
        if along > 0.0:
            length = (to_x * to_x + to_y * to_y) / along
            if length > most:
                best = i
                most = length
    return best

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
The separating axis methods compared: the traditional one, and all readings of the paper's.

The paper is Liang and Liu, "The Research of Collision Detection Algorithm Based on Separating Axis
Theorem". Each kernel takes two convex polygons as counter-clockwise (n, 2) and (m, 2) float arrays
and returns whether the closed sets share a point, in plain floating point, and on how many axes
the kernel projected them. What the paper computes in a pre-treatment stage (section 6), bounding
boxes and centres of gravity, is an argument.
"""

import math

from sat_collision.geometry.jit import inner, kernel
from sat_collision.geometry.plane import centroid


@kernel
def traditional_axes(p, q):
    """
    Decide by the normals of all edges (section 2.3), points and segments too.

    Complete, up to rounding. Arrays of float32 are processed in float32.
    """
    axes = 0
    for body in (p, q):
        for i in range(len(body)):
            axes += 1
            if edge_separates(p, q, body, i):
                return False, axes
    if len(p) < 3 and len(q) < 3:
        # Without area, bodies on one line are separate along that line only.
        return not (separates(p, q, 1, 0) or separates(p, q, 0, 1)), axes + 2
    return True, axes


@kernel
def boxed_axes(p, q, bounds_p, bounds_q):
    """Decide by bounding boxes, which are exact, then as the traditional method (section 1)."""
    if (bounds_p[0] > bounds_q[2] or bounds_q[0] > bounds_p[2]
            or bounds_p[1] > bounds_q[3] or bounds_q[1] > bounds_p[3]):
        return False, 2
    collides, axes = traditional_axes(p, q)
    return collides, axes + 2


@kernel
def published_a_axes(p, q, centre_p, centre_q):
    """
    Decide as the paper's sections 3.1 and 3.2 say (reading A).

    Axes are the centre line; the normals of the two edges at each potential nearest point, the
    vertices B of P and C of Q that reach furthest along the centre line; and the lines from B and
    from C to their nearest points on the two edges at the other. The separating axis may be the
    normal of another edge, so separate bodies that are near are called colliding.
    """
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return False, 1
    return _axes_at(p, q, _furthest(p, x, y), _furthest(q, -x, -y))


@kernel
def literal_axes(p, q, centre_p, centre_q):
    """Decide as reading A, with B and C as equation 5 is printed: the longest OB / cos BOE."""
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return False, 1
    return _axes_at(p, q, _longest(p, centre_p, x, y), _longest(q, centre_q, -x, -y))


@kernel
def published_b_axes(p, q, centre_p, centre_q):
    """
    Decide by steps 1 to 4 of the paper's section 4 (reading B).

    Only the ends of the edge of each polygon that the centre line crosses are projected on it;
    then the normals of those two edges are tried. Beside the fault of reading A, another vertex
    may reach further along the centre line than those four: overlapping bodies are called apart.
    """
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    i, j = crossed_edge(p, centre_p, x, y), crossed_edge(q, centre_q, -x, -y)
    high = max(p[i - 1, 0] * x + p[i - 1, 1] * y, p[i, 0] * x + p[i, 1] * y)
    low = min(q[j - 1, 0] * x + q[j - 1, 1] * y, q[j, 0] * x + q[j, 1] * y)
    if high < low:
        return False, 1
    if edge_separates(p, q, p, i):
        return False, 2
    return not edge_separates(p, q, q, j), 3


@kernel
def hybrid_axes(p, q, centre_p, centre_q):
    """Project all vertices on the centre line, then on the normals of the edges it crosses."""
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return False, 1
    if edge_separates(p, q, p, crossed_edge(p, centre_p, x, y)):
        return False, 2
    return not edge_separates(p, q, q, crossed_edge(q, centre_q, -x, -y)), 3


@kernel
def closest_axes(p, q):
    """Decide by the line through the closest points, by brute force as equations 3 and 4 say."""
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
def bounds(polygon):
    """Return the bounding box (min_x, min_y, max_x, max_y)."""
    return (polygon[:, 0].min(), polygon[:, 1].min(), polygon[:, 0].max(), polygon[:, 1].max())


@kernel
def centre_of_gravity(polygon):
    """Return the centre of gravity (section 2.2); of a segment its middle."""
    return centroid(polygon.ravel(), len(polygon))


@kernel
def _axes_at(p, q, b, c):
    """Try the edges at two vertices that may be nearest, and the lines from each to the others."""
    axes = 1
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
def edge_separates(p, q, body, i):
    return separates(p, q, body[i, 1] - body[i - 1, 1], body[i - 1, 0] - body[i, 0])


@kernel
def separates(p, q, x, y):
    """Return whether projections of two polygons on an axis are apart, without error bounds."""
    low_p, high_p = _project(p, x, y)
    low_q, high_q = _project(q, x, y)
    return high_p < low_q or high_q < low_p


@inner
def _project(polygon, x, y):
    low = high = polygon[0, 0] * x + polygon[0, 1] * y
    for i in range(1, len(polygon)):
        along = polygon[i, 0] * x + polygon[i, 1] * y
        low = min(low, along)
        high = max(high, along)
    return low, high


@inner
def _furthest(polygon, x, y):
    best, most = 0, polygon[0, 0] * x + polygon[0, 1] * y
    for i in range(1, len(polygon)):
        along = polygon[i, 0] * x + polygon[i, 1] * y
        if along > most:
            best, most = i, along
    return best


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


@kernel
def to_edge(x, y, body, i):
    """Return the vector from a point to the nearest point of an edge."""
    start_x, start_y = body[i - 1, 0], body[i - 1, 1]
    along_x, along_y = body[i, 0] - start_x, body[i, 1] - start_y
    length = along_x * along_x + along_y * along_y
    share = 0.0
    if length > 0:
        share = ((x - start_x) * along_x + (y - start_y) * along_y) / length
    share = min(max(share, 0.0), 1.0)
    return start_x + share * along_x - x, start_y + share * along_y - y


@kernel
def crossed_edge(polygon, centre, x, y):
    """Return the end of the edge that the ray from the centre along (x, y) crosses."""
    for i in range(len(polygon)):
        start = x * (polygon[i - 1, 1] - centre[1]) - y * (polygon[i - 1, 0] - centre[0])
        end = x * (polygon[i, 1] - centre[1]) - y * (polygon[i, 0] - centre[0])
        if start <= 0 <= end:
            return i
    return 0

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The methods compared, as kernels: the traditional one, the paper's, other SATs, GJK, orientations.

Each takes two convex polygons as counter-clockwise (n, 2) and (m, 2) arrays, and returns whether
the closed sets are apart: False, or the number of the step that separates them, True where there
is one step. What a method needs to know of each body is an argument: its box, its centre of
gravity or its head, which is both. All compute in plain floating point except one.

The paper is Liang and Liu, "The Research of Collision Detection Algorithm Based on Separating Axis
Theorem"; boxes and centres belong to its pre-treatment stage (section 6).
"""

import math

from sat_collision.geometry.compiled.jit import inner, kernel
from sat_collision.geometry.numeric.predicates import orient, segments_meet
from sat_collision.geometry.numeric.vectors import centroid

# The support vertex of bodies with at most this many vertices is found by a linear scan.
_SCANNED = 8

# GJK counts bodies nearer than this as touching, relative to the largest difference between their
# vertices; it ends after so many steps, and then counts them as touching, too.
GJK_TOLERANCE = 1e-10
_MAX_STEPS = 64

# The constants of CGAL's Orientation_2: error of the determinant of 2 x 2 rounded differences,
# and the magnitudes between which neither the bound underflows nor the determinant overflows.
_CGAL_ERROR = 8.8872057372592798e-16
_CGAL_MIN = 1e-146
_CGAL_MAX = 1e153


@kernel
def traditional(p, q):
    """
    Decide by the normals of all edges (section 2.3), points and segments too.

    Complete, up to rounding. Arrays of float32 are processed in float32.
    """
    for body in (p, q):
        for i in range(len(body)):
            if edge_separates(p, q, body, i):
                return True
    # Without area, bodies on one line are separate along that line only.
    return len(p) < 3 and len(q) < 3 and (separates(p, q, 1, 0) or separates(p, q, 0, 1))


@kernel
def boxed(p, q, bounds_p, bounds_q):
    """Decide by bounding boxes, which are exact, then as the traditional method (section 1)."""
    return boxes_apart(bounds_p, bounds_q) or traditional(p, q)


@kernel
def published_a(p, q, centre_p, centre_q):
    """
    Decide as the paper's sections 3.1 and 3.2 say (reading A).

    Axes are the centre line; the normals of the two edges at each potential nearest point, the
    vertices B of P and C of Q that reach furthest along the centre line; and the lines from B and
    from C to their nearest points on the two edges at the other. The separating axis may be the
    normal of another edge, so separate bodies that are near are called colliding.
    """
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return 1
    return _step_at(p, q, _furthest(p, x, y), _furthest(q, -x, -y))


@kernel
def literal(p, q, centre_p, centre_q):
    """Decide as reading A, with B and C as equation 5 is printed: the longest OB / cos BOE."""
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    if separates(p, q, x, y):
        return 1
    return _step_at(p, q, _longest(p, centre_p, x, y), _longest(q, centre_q, -x, -y))


@kernel
def published_b(p, q, centre_p, centre_q):
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
        return 1
    return 2 if edge_separates(p, q, p, i) or edge_separates(p, q, q, j) else 0


@kernel
def hybrid(p, q, centre_p, centre_q):
    """Project all vertices on the centre line, then on the normals of the edges it crosses."""
    x, y = centre_q[0] - centre_p[0], centre_q[1] - centre_p[1]
    return (separates(p, q, x, y) or edge_separates(p, q, p, crossed_edge(p, centre_p, x, y))
            or edge_separates(p, q, q, crossed_edge(q, centre_q, -x, -y)))


@kernel
def closest(p, q):
    """Decide by the line through the closest points, by brute force as equations 3 and 4 say."""
    least, x, y = math.inf, 0.0, 0.0
    for body, other in ((p, q), (q, p)):
        for k in range(len(body)):
            for i in range(len(other)):
                to_x, to_y = to_edge(body[k, 0], body[k, 1], other, i)
                square = to_x * to_x + to_y * to_y
                if square < least:
                    least, x, y = square, to_x, to_y
    return separates(p, q, x, y)


@kernel
def bounds(polygon):
    """Return the bounding box (min_x, min_y, max_x, max_y)."""
    return (polygon[:, 0].min(), polygon[:, 1].min(), polygon[:, 0].max(), polygon[:, 1].max())


@kernel
def centre_of_gravity(polygon):
    """Return the centre of gravity (section 2.2); of a segment its middle."""
    return centroid(polygon.ravel(), len(polygon))


@kernel
def head(polygon):
    """Return bounding box and centre of gravity, six numbers."""
    return bounds(polygon) + centre_of_gravity(polygon)


@kernel
def _step_at(p, q, b, c):
    """Try the edges at two vertices that may be nearest, then the lines from each to others."""
    for body, nearest in ((p, b), (q, c)):
        for i in (nearest, (nearest + 1) % len(body)):
            if edge_separates(p, q, body, i):
                return 2
    for body, vertex, other, nearest in ((p, b, q, c), (q, c, p, b)):
        for i in (nearest, (nearest + 1) % len(other)):
            x, y = to_edge(body[vertex, 0], body[vertex, 1], other, i)
            if separates(p, q, x, y):
                return 3
    return 0


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
    """Return the vertex furthest along an axis, up to rounding, by a scan."""
    best, most = 0, polygon[0, 0] * x + polygon[0, 1] * y
    for i in range(1, len(polygon)):
        along = polygon[i, 0] * x + polygon[i, 1] * y
        if along > most:
            best, most = i, along
    return best


@kernel
def _longest(polygon, centre, x, y):
    """Return the vertex with the longest OB / cos of those before the centre, up to |(x, y)|."""
    best, most = 0, 0.0
    for i in range(len(polygon)):
        to_x, to_y = polygon[i, 0] - centre[0], polygon[i, 1] - centre[1]
        along = to_x * x + to_y * y
        if along > 0.0:
            length = (to_x * to_x + to_y * to_y) / along
            if length > most:
                best, most = i, length
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


@kernel
def binary(p, q, head_p, head_q):
    """Try the normal of each edge by the support vertex of the other body (O'Rourke 1998, 7.9)."""
    if boxes_apart(head_p, head_q):
        return True
    for body, other in ((p, q), (q, p)):
        for i in range(len(body)):
            x, y = body[i, 1] - body[i - 1, 1], body[i - 1, 0] - body[i, 0]
            k = support(other, -x, -y)
            reach = max(body[i - 1, 0] * x + body[i - 1, 1] * y, body[i, 0] * x + body[i, 1] * y)
            if other[k, 0] * x + other[k, 1] * y > reach:
                return True
    return False


@kernel
def gjk(p, q, head_p, head_q):
    """
    Walk to the point of Q - P nearest to the origin, as van den Bergen (1999) does.

    Each step adds the support vertex along the nearest point found so far, and ends once that
    point is an axis that separates, or is as good as the origin.
    """
    if boxes_apart(head_p, head_q):
        return True
    x, y = head_q[4] - head_p[4], head_q[5] - head_p[5]
    ax, ay, bx, by = x, y, x, y
    points = 1
    largest = math.sqrt(x * x + y * y)
    for _ in range(_MAX_STEPS):
        length = math.sqrt(x * x + y * y)
        if length <= GJK_TOLERANCE * largest:
            return False
        i = support(p, x, y)
        j = support(q, -x, -y)
        wx, wy = q[j, 0] - p[i, 0], q[j, 1] - p[i, 1]
        largest = max(largest, math.sqrt(wx * wx + wy * wy))
        if wx * x + wy * y > GJK_TOLERANCE * length * largest:
            return True
        if points == 2 and _holds_origin(ax, ay, bx, by, wx, wy):
            return False
        # The nearest point of the triangle lies on one of the two edges at the new vertex.
        x, y, ax, ay = _nearer_edge(ax, ay, bx, by, wx, wy)
        bx, by, points = wx, wy, 2
    return False


@kernel
def boxes_apart(head_p, head_q):
    """Return whether two bounding boxes share no point."""
    return ((head_p[0] > head_q[2]) | (head_q[0] > head_p[2])
            | (head_p[1] > head_q[3]) | (head_q[1] > head_p[3]))


@kernel
def support(body, x, y):
    """Return the vertex furthest along an axis, up to rounding; vertices are counter-clockwise."""
    if len(body) <= _SCANNED:
        return _furthest(body, x, y)
    low, high = 0, len(body)
    rises = _rise(body, 0, x, y) > 0
    if not rises and _rise(body, -1, x, y) > 0:
        return 0
    while high - low > 1:
        middle = (low + high) // 2
        ahead = _rise(body, middle, x, y)
        if ahead <= 0 and _rise(body, middle - 1, x, y) > 0:
            return middle
        higher = ((body[low, 0] - body[middle, 0]) * x
                  + (body[low, 1] - body[middle, 1]) * y) > 0
        if (ahead <= 0 or higher) if rises else (ahead <= 0 and not higher):
            high = middle
        else:
            low, rises = middle, ahead > 0
    return low


@kernel
def _rise(body, i, x, y):
    """Return how far the edge from vertex i on goes along an axis."""
    k = i + 1 if i + 1 < len(body) else 0
    return (body[k, 0] - body[i, 0]) * x + (body[k, 1] - body[i, 1]) * y


@kernel
def _holds_origin(ax, ay, bx, by, cx, cy):
    """Return whether a triangle, in either winding, contains the origin."""
    ab = ax * by - ay * bx
    bc = bx * cy - by * cx
    ca = cx * ay - cy * ax
    return (ab >= 0 and bc >= 0 and ca >= 0) or (ab <= 0 and bc <= 0 and ca <= 0)


@kernel
def _nearer_edge(ax, ay, bx, by, wx, wy):
    """Return the nearest point to the origin on a w or b w, and the other end of that edge."""
    x, y = _nearest_on_segment(ax, ay, wx, wy)
    other_x, other_y = _nearest_on_segment(bx, by, wx, wy)
    if x * x + y * y <= other_x * other_x + other_y * other_y:
        return x, y, ax, ay
    return other_x, other_y, bx, by


@kernel
def _nearest_on_segment(ax, ay, bx, by):
    """Return the point of a segment that is nearest to the origin."""
    x, y = bx - ax, by - ay
    square = x * x + y * y
    along = -(ax * x + ay * y)
    if not along > 0.0:
        return ax, ay
    if along >= square:
        return bx, by
    return ax + along / square * x, ay + along / square * y


@kernel
def filtered(p, q, head_p, head_q):
    """
    Look for an edge that has every vertex of the other polygon strictly on its outer side.

    Each vertex is tested with the semi-static filter of CGAL's kernel (Melquiond and Pion 2007),
    and exactly if that fails; first the one that refuted the edge before, so most pairs are O(n).
    """
    if boxes_apart(head_p, head_q):
        return True
    if len(p) <= 2 and len(q) <= 2:
        return not segments_meet(p[0, 0], p[0, 1], p[-1, 0], p[-1, 1],
                                 q[0, 0], q[0, 1], q[-1, 0], q[-1, 1])
    return _some_edge_separates(p, q) or _some_edge_separates(q, p)


@kernel
def _some_edge_separates(body, other):
    k = 0
    for i in range(len(body) if len(body) > 1 else 0):
        separates = True
        for _ in range(len(other)):
            if semi_static_orient(body[i - 1, 0], body[i - 1, 1], body[i, 0], body[i, 1],
                                  other[k, 0], other[k, 1]) >= 0:
                separates = False
                break
            k = k + 1 if k + 1 < len(other) else 0
        if separates:
            return True
    return False


@kernel
def semi_static_orient(ax, ay, bx, by, cx, cy):
    """Return the sign of the turn a, b, c through CGAL's semi-static filter."""
    abx, aby, acx, acy = bx - ax, by - ay, cx - ax, cy - ay
    determinant = abx * acy - aby * acx
    x, y = max(abs(abx), abs(acx)), max(abs(aby), abs(acy))
    least = min(x, y)
    if least == 0.0:
        return 0
    if least > _CGAL_MIN and max(x, y) < _CGAL_MAX:
        bound = _CGAL_ERROR * x * y
        if determinant > bound:
            return 1
        if determinant < -bound:
            return -1
    return orient(ax, ay, bx, by, cx, cy)

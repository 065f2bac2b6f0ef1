# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Whether two simple polygons meet: the exact answers that the tests and `make accuracy` rely on.

Nothing here uses the separating axis theorem, and only the compiler is shared with the code under
test.  Two closed bodies meet iff their boundaries meet or one body contains the other: a boundary
is connected, so one that misses the other boundary lies wholly inside or wholly outside it, and
any one vertex decides which.  A point is a ring of one edge of no length, a segment a ring of two.
"""

import math

import numpy as np

from sat_collision.geometry.compiled.jit import kernel

_UNKNOWN = 2


def orientation(p, q, r):
    """Return twice the signed area of a triangle, exact where the coordinates are integers."""
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def integers(*bodies):
    """
    Return the bodies as lists of integer points, all multiplied by one power of two.

    Every finite float64 is an integer over a power of two, and Python's integers have no limit:
    nothing is rounded here or in what is computed from it, and no sign changes.
    """
    ratios = [[[x.as_integer_ratio() for x in point] for point in np.asarray(body, float).tolist()]
              for body in bodies]
    scale = max(denominator for body in ratios for point in body for _, denominator in point)
    return [[[x * (scale // denominator) for x, denominator in point] for point in body]
            for body in ratios]


def intersects(a, b):
    """Return whether two closed bodies, (n, 2) points of simple rings in either winding, meet."""
    a, b = integers(a, b)
    box_a, box_b = _box(a), _box(b)
    near_b = [edge for edge in _edges(b) if _boxes_meet(_box(edge), box_a)]
    for edge in _edges(a):
        if _boxes_meet(_box(edge), box_b):
            if any(_segments_meet(*edge, *other) for other in near_b):
                return True
    return _holds(a, b[0]) or _holds(b, a[0])


def intersects_pairs(pairs):
    """
    Return the answers for many pairs, and which of them floating point left open.

    A compiled loop answers where floating point proves every relevant sign, `intersects` the
    rest: see `_sign` for the proof.
    """
    answers = np.empty(len(pairs), np.int8)
    _filter_pairs(*_packed([a for a, _ in pairs]), *_packed([b for _, b in pairs]), answers)
    unknown = answers == _UNKNOWN
    for i in np.flatnonzero(unknown):
        answers[i] = intersects(*pairs[i])
    return answers.astype(bool), unknown


def _edges(ring):
    return [(ring[i - 1], ring[i]) for i in range(len(ring))]


def _box(points):
    xs, ys = zip(*points)
    return min(xs), min(ys), max(xs), max(ys)


def _boxes_meet(a, b):
    return a[0] <= b[2] and b[0] <= a[2] and a[1] <= b[3] and b[1] <= a[3]


def _segments_meet(p, q, r, s):
    """Tell whether closed segments meet: their boxes do, and each straddles the other's line."""
    return (_boxes_meet(_box((p, q)), _box((r, s)))
            and _opposite(orientation(p, q, r), orientation(p, q, s))
            and _opposite(orientation(r, s, p), orientation(r, s, q)))


def _opposite(a, b):
    return (a >= 0 or b >= 0) and (a <= 0 or b <= 0)


def _holds(ring, point):
    """Tell whether a point off the ring is inside: a ray from it to the right crosses oddly."""
    inside = False
    for p, q in _edges(ring):
        if (p[1] > point[1]) != (q[1] > point[1]):
            inside ^= (orientation(p, q, point) > 0) == (q[1] > p[1])
    return inside


def _packed(bodies):
    ends = np.cumsum([0] + [len(body) for body in bodies])
    return np.concatenate(bodies), ends


@kernel
def _filter_pairs(points_a, ends_a, points_b, ends_b, answers):
    for i in range(len(answers)):
        answers[i] = _filter(points_a[ends_a[i]:ends_a[i + 1]], points_b[ends_b[i]:ends_b[i + 1]])


@kernel
def _filter(a, b):
    """As `intersects`, in floating point: 1 they meet, 0 they do not, `_UNKNOWN` not proved."""
    exact = _on_grid(a, b)
    low_x, low_y = max(a[:, 0].min(), b[:, 0].min()), max(a[:, 1].min(), b[:, 1].min())
    high_x, high_y = min(a[:, 0].max(), b[:, 0].max()), min(a[:, 1].max(), b[:, 1].max())
    if low_x > high_x or low_y > high_y:
        return 0
    unknown = False
    for i in range(len(a)):
        px, py, qx, qy = a[i - 1, 0], a[i - 1, 1], a[i, 0], a[i, 1]
        if (max(px, qx) < low_x or min(px, qx) > high_x
                or max(py, qy) < low_y or min(py, qy) > high_y):
            continue
        for j in range(len(b)):
            rx, ry, sx, sy = b[j - 1, 0], b[j - 1, 1], b[j, 0], b[j, 1]
            if (max(rx, sx) < min(px, qx) or min(rx, sx) > max(px, qx)
                    or max(ry, sy) < min(py, qy) or min(ry, sy) > max(py, qy)):
                continue
            r, s = _sign(px, py, qx, qy, rx, ry, exact), _sign(px, py, qx, qy, sx, sy, exact)
            if r == s and (r == 1 or r == -1):
                continue
            p, q = _sign(rx, ry, sx, sy, px, py, exact), _sign(rx, ry, sx, sy, qx, qy, exact)
            if p == q and (p == 1 or p == -1):
                continue
            if p == _UNKNOWN or q == _UNKNOWN or r == _UNKNOWN or s == _UNKNOWN:
                unknown = True
            else:
                return 1
    if unknown:
        return _UNKNOWN
    held = _filter_holds(a, b[0, 0], b[0, 1], exact)
    if held != 0:
        return held
    return _filter_holds(b, a[0, 0], a[0, 1], exact)


@kernel
def _filter_holds(ring, x, y, exact):
    inside = 0
    for i in range(len(ring)):
        px, py, qx, qy = ring[i - 1, 0], ring[i - 1, 1], ring[i, 0], ring[i, 1]
        if (py > y) != (qy > y):
            sign = _sign(px, py, qx, qy, x, y, exact)
            if sign == _UNKNOWN:
                return _UNKNOWN
            if (sign > 0) == (qy > py):
                inside = 1 - inside
    return inside


@kernel
def _sign(px, py, qx, qy, rx, ry, exact):
    """
    Return the sign of `orientation`, or `_UNKNOWN` where rounding might have changed it.

    With u = 2^-53 each difference is right to a factor 1 + u, so each product to (1 + u)^3 and the
    result errs by less than 4 u (|left| + |right|), Shewchuk's bound (1997, eq. 10) rounded up;
    below 1e-300 products may lose more to underflow, and an overflow proves nothing.
    """
    left = (qx - px) * (ry - py)
    right = (qy - py) * (rx - px)
    area = left - right
    if not exact and not abs(area) > 2.0**-51 * (abs(left) + abs(right)) + 1e-300:
        return _UNKNOWN
    if area > 0:
        return 1
    return -1 if area < 0 else 0


@kernel
def _on_grid(a, b):
    """
    Tell whether floating point is exact on these bodies: scaled or unscaled integer lattices.

    If all coordinates are multiples, up to 2^25 times, of one power of two, their differences
    are up to 2^26 times it, products 2^52 and the area 2^53 times its square: all are float64.
    """
    largest = max(np.abs(a).max(), np.abs(b).max())
    if not 1e-130 < largest < 1e130:
        return False
    unit = math.ldexp(1.0, math.frexp(largest)[1] - 25)
    for body in (a, b):
        for i in range(len(body)):
            for x in body[i]:
                if math.floor(x / unit) * unit != x:
                    return False
    return True

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The filters of docs/exactness.md, each with its exact error.

A filter computes a value, trusts its sign if its magnitude exceeds a bound, and is right as long
as the error stays within the bound. The error is computed here almost without rounding: sums and
products as head and tail, so that only small terms are rounded. `exact` repeats it in rationals.
"""

from fractions import Fraction

from compiled import callable_here
import numpy as np
from rationals import square_root
from sat_collision.geometry.body.layout import first_vertex, HEADER, Packed
from sat_collision.geometry.body.packing import _SHORTER, CONVEX, pack
from sat_collision.geometry.compiled.jit import kernel
from sat_collision.geometry.numeric.double_double import (
    difference, difference_error, product_error)
from sat_collision.geometry.numeric.predicates import orient, ORIENTATION_BOUND, UNDERFLOW_BOUND
from sat_collision.geometry.pair.separating_axis import (
    _gap, _rise, _turn, hill_climb, PRODUCT_BOUND, Search, support, SUPPORT_BOUND)

support_here, climb_here = callable_here(support, hill_climb)
UNIT = 2.0 ** -53
ORIENTATION, TURN, RISE, SCAN, GAP, CLIMB, DISC = range(7)
NAMES = 'orientation', 'turn', 'rise', 'scan', 'gap', 'climb', 'disc'
# The number of numbers in an input, and the bound as written in docs/exactness.md.
SIZES = 6, 8, 6, 10, 14, 12, 8
BOUNDS = '(3 u + 16 u²) S', '8 u S', '8 u S', '4 u M', '8 u S + 64 u M', '25 u M', '2⁻⁴⁵ (r + E)'


@kernel
def evaluate(which, x):
    """
    Return a filter's value, its bound, its error, and whether it is wrong.

    The value is 0 for SCAN, CLIMB and DISC, which compute no sign; the bound, for invalid input.
    """
    if which == ORIENTATION:
        return _orientation(x)
    if which == TURN:
        return _of_turn(x)
    if which == RISE:
        return _of_rise(x)
    if which == SCAN:
        return _scan(x)
    if which == GAP:
        return _of_gap(x)
    if which == CLIMB:
        return _climb(x)
    return _disc(x)


@kernel
def _product(a, b):
    """Return the rounded product of two rounded numbers, and its difference to the true one."""
    product = a[0] * b[0]
    return product, product_error(a[0], b[0], product) + (a[0] * b[1] + a[1] * b[0] + a[1] * b[1])


@kernel
def _sum_of_products(left, right):
    """Return a rounded sum, the sum of magnitudes, and its error."""
    value = left[0] + right[0]
    return (value, abs(left[0]) + abs(right[0]),
            -(difference_error(left[0], -right[0], value) + (left[1] + right[1])))


@kernel
def cross(ax, ay, bx, by):
    """Return value, size and error of a cross product of differences, each with its tail."""
    return _sum_of_products(_product(ax, by), _product((-ay[0], -ay[1]), bx))


@kernel
def along(dx, dy, ux, uy):
    """Return value, size and error of a difference's component along an axis."""
    return _sum_of_products(_product(dx, (ux, 0.0)), _product(dy, (uy, 0.0)))


@kernel
def _sign(value, bound):
    return (value > bound) - (-value > bound)


@kernel
def _orientation(x):
    value, size, error = cross(difference(x[0], x[4]), difference(x[1], x[5]),
                               difference(x[2], x[4]), difference(x[3], x[5]))
    true = value - error
    return (value, ORIENTATION_BOUND * size + UNDERFLOW_BOUND, error,
            orient(x[0], x[1], x[2], x[3], x[4], x[5]) != _sign(true, 0.0)
            and abs(true) > 1e-9 * abs(error))


@kernel
def _of_turn(x):
    ax, ay = difference(x[0], x[1]), difference(x[2], x[3])
    bx, by = difference(x[4], x[5]), difference(x[6], x[7])
    value, size, error = cross(ax, ay, bx, by)
    bound = PRODUCT_BOUND * size + UNDERFLOW_BOUND
    return value, bound, error, _turn(ax[0], ay[0], bx[0], by[0]) != _sign(value, bound)


@kernel
def _of_rise(x):
    value, size, error = along(difference(x[2], x[0]), difference(x[3], x[1]), x[4], x[5])
    bound = PRODUCT_BOUND * size + UNDERFLOW_BOUND
    return value, bound, error, _rise(x, 0, 2, x[4], x[5]) != _sign(value, bound)


@kernel
def _most(x, start, end):
    """Return max|x| and max|y| of the vertices from start to end."""
    most_x = most_y = 0.0
    for k in range(start, end, 2):
        most_x = max(most_x, abs(x[k]))
        most_y = max(most_y, abs(x[k + 1]))
    return most_x, most_y


@kernel
def _reach(x, start, end):
    """Return |ux| max|x| + |uy| max|y| of the vertices from start to end; u comes first."""
    most_x, most_y = _most(x, start, end)
    return abs(x[0]) * most_x + abs(x[1]) * most_y


@kernel
def _shortfall(x, start, end, chosen, ux, uy):
    """Return by how much the chosen vertex is less far along u than another."""
    most = 0.0
    for k in range(start, end, 2):
        value, _, error = along(difference(x[k], x[chosen]),
                                difference(x[k + 1], x[chosen + 1]), ux, uy)
        most = max(most, value - error)
    return most


@kernel
def _packed(x, start, end):
    """Return the vertices as a packed polygon without a table."""
    array = np.zeros(HEADER + end - start)
    array[HEADER:] = x[start:end]
    return Packed(array, 0, (end - start) // 2)


@kernel
def _scan(x):
    place = support(_packed(x, 2, 10), x[0], x[1]) - HEADER + 2
    return (0.0, 4.0 * UNIT * _reach(x, 2, 10), _shortfall(x, 2, 10, place, x[0], x[1]), False)


@kernel
def _of_gap(x):
    ux, uy = x[0], x[1]
    i = support(_packed(x, 2, 8), ux, uy) - HEADER + 2
    j = support(_packed(x, 8, 14), -ux, -uy) - HEADER + 8
    most_x, most_y = _most(x, 2, 14)
    wx, wy = difference(x[j], x[i]), difference(x[j + 1], x[i + 1])
    value, size, error = along(wx, wy, ux, uy)
    error += _shortfall(x, 2, 8, i, ux, uy) + _shortfall(x, 8, 14, j, -ux, -uy)
    bound = (PRODUCT_BOUND * size + SUPPORT_BOUND * (abs(ux) * most_x + abs(uy) * most_y)
             + UNDERFLOW_BOUND)
    search = Search(0.0, 0.0, 0.0, 0.0, ux, uy, most_x, most_y)
    return value, bound, max(error, 0.0), _gap(wx[0], wy[0], search) != _sign(value, bound)


@kernel
def is_convex(x, start, end):
    """Tell exactly whether the vertices form a strictly convex polygon."""
    n = (end - start) // 2
    rounds = 0
    for k in range(n):
        a, b, c = start + 2 * k, start + 2 * ((k + 1) % n), start + 2 * ((k + 2) % n)
        if orient(x[a], x[a + 1], x[b], x[b + 1], x[c], x[c + 1]) <= 0:
            return False
        rounds += x[b + 1] < x[a + 1] and x[b + 1] <= x[c + 1]
    return rounds == 1


@kernel
def _climb(x):
    if not is_convex(x, 2, 12):
        return 0.0, 0.0, 0.0, False
    polygon = _packed(x, 2, 12)
    error = 0.0
    for k in range(5):
        place = hill_climb(polygon, first_vertex(polygon) + 2 * k, x[0], x[1])
        if place >= 0:
            error = max(error, _shortfall(x, 2, 12, place - HEADER + 2, x[0], x[1]))
    return 0.0, 25.0 * UNIT * _reach(x, 2, 12), error, False


@kernel
def _disc(x):
    packed = np.zeros(HEADER + len(x))
    verdict, count, _, _, _ = pack(x, packed, 4, 4)
    radius = packed[6]
    if verdict != CONVEX or count != 4 or radius == 0.0:
        return 0.0, 0.0, 0.0, False
    extent = (packed[4] - packed[2]) + (packed[5] - packed[3])
    shorter = _SHORTER * (radius + extent)
    # The distance of the nearest edge beyond the radius, in terms that lose no digits.
    spare = np.inf
    for k in range(4):
        a, b = HEADER + 2 * k, HEADER + 2 * ((k + 1) % 4)
        ex, ey = difference(packed[b], packed[a]), difference(packed[b + 1], packed[a + 1])
        value, _, error = cross(ex, ey, difference(packed[0], packed[a]),
                                difference(packed[1], packed[a + 1]))
        size = np.sqrt(ex[0] * ex[0] + ey[0] * ey[0])
        square, _, square_error = along(ex, ey, ex[0], ey[0])
        head = size * size
        size_tail = ((square - head - product_error(size, size, head) - square_error
                      + ex[0] * ex[1] + ey[0] * ey[1]) / (2.0 * size))
        product = radius * size
        spare = min(spare, ((value - product) - product_error(radius, size, product)
                            - radius * size_tail - error) / size)
    return 0.0, shorter, max(shorter - spare, 0.0), False


def exact(which, x, share=1.0):
    """Return in rationals the error relative to a share of the bound; 0 beyond twice that."""
    value, bound, _, _ = evaluate(which, x)
    value, bound = Fraction(float(value)), Fraction(float(bound))
    if bound == 0 or abs(value) > 2 * bound * Fraction(share):
        return 0.0
    v = [Fraction(float(number)) for number in x]
    if which == ORIENTATION:
        true = (v[0] - v[4]) * (v[3] - v[5]) - (v[1] - v[5]) * (v[2] - v[4])
    elif which == TURN:
        true = (v[0] - v[1]) * (v[6] - v[7]) - (v[2] - v[3]) * (v[4] - v[5])
    elif which == RISE:
        true = (v[2] - v[0]) * v[4] + (v[3] - v[1]) * v[5]
    elif which == GAP:
        heights = [v[k] * v[0] + v[k + 1] * v[1] for k in range(2, 14, 2)]
        true = min(heights[3:]) - max(heights[:3])
    else:
        true = -(_exact_clearance(x) if which == DISC else _exact_shortfall(which, x, v))
        if which == DISC:
            true = min(true - bound, 0)
    return float(abs(value - true) / bound / Fraction(share))


def _exact_shortfall(which, x, v):
    heights = [v[k] * v[0] + v[k + 1] * v[1] for k in range(2, len(v), 2)]
    polygon = _packed(x, 2, len(x))
    if which == SCAN:
        places = [support_here(polygon, x[0], x[1])]
    else:
        places = [climb_here(polygon, HEADER + 2 * k, x[0], x[1]) for k in range(len(heights))]
    return max(heights) - min(heights[(place - HEADER) // 2] for place in places if place >= 0)


def _exact_clearance(x):
    """Return the radius of the disc minus the true distance of its centre from the boundary."""
    packed = np.zeros(HEADER + len(x))
    pack(x, packed, 4, 4)
    cx, cy, radius = (Fraction(float(packed[k])) for k in (0, 1, 6))
    ring = [(Fraction(a), Fraction(b)) for a, b in packed[HEADER:].reshape(-1, 2).tolist()]
    squares = [(((b[0] - a[0]) * (cy - a[1]) - (b[1] - a[1]) * (cx - a[0])) ** 2
                / ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2))
               for a, b in zip(ring, ring[1:] + ring[:1])]
    return radius - square_root(min(squares))

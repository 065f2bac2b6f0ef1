# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Exact orientation of three points, for every finite double.

Three stages, each tried only when the one before cannot decide (the adaptive scheme of
J. R. Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
Predicates", 1997):

A. the determinant in plain doubles, accepted when it exceeds its forward error bound;
B. where the coordinate differences carry no rounding error, the two products compared exactly
   as head and tail (error-free transformation, Dekker 1971);
C. the six products of the expanded determinant summed in a fixed-point accumulator as wide as the
   whole exponent range (Kulisch), which is exact, and free of overflow and underflow.

For the proofs see docs/exactness.md, lemmas 1 to 3.
"""

import math

from sat_collision.geometry.compiled.jit import inner, kernel, scratch_integers
from sat_collision.geometry.numeric.double_double import difference_error, product_error

# Shewchuk's ccwerrboundA, (3 + 16 u) u with u = 2^-53; the absolute term covers products that
# underflow. See docs/exactness.md, lemma 1.
ORIENTATION_BOUND = (3.0 + 16.0 * 2.0 ** -53) * 2.0 ** -53
UNDERFLOW_BOUND = 2.0 ** -1060

# Between these magnitudes neither Dekker's splitting overflows nor a product's tail underflows.
_LARGEST_SPLIT = 2.0 ** 490
_SMALLEST_PRODUCT = 2.0 ** -960

_LIMB_BITS = 24
_LIMB_MASK = (1 << _LIMB_BITS) - 1
_EXPONENT_OFFSET = 1128
_LIMBS = 184


@kernel
def orient(ax, ay, bx, by, cx, cy):
    """Return 1 if points a, b, c turn left, -1 if right, 0 if they are collinear; exact."""
    acx, acy = ax - cx, ay - cy
    bcx, bcy = bx - cx, by - cy
    left, right = acx * bcy, acy * bcx
    determinant = left - right
    bound = ORIENTATION_BOUND * (abs(left) + abs(right)) + UNDERFLOW_BOUND
    # Strict, so that overflow (infinity > infinity) and NaN go on to the exact stages.
    if determinant > bound:
        return 1
    if -determinant > bound:
        return -1
    return _orient_adaptive(ax, ay, bx, by, cx, cy)


@inner
def _orient_adaptive(ax, ay, bx, by, cx, cy):
    acx, acy = ax - cx, ay - cy
    bcx, bcy = bx - cx, by - cy
    largest = max(max(abs(acx), abs(bcx)), max(abs(acy), abs(bcy)))
    if (largest < _LARGEST_SPLIT
            and difference_error(ax, cx, acx) == 0.0 and difference_error(bx, cx, bcx) == 0.0
            and difference_error(ay, cy, acy) == 0.0 and difference_error(by, cy, bcy) == 0.0):
        left, right = acx * bcy, acy * bcx
        if ((abs(left) > _SMALLEST_PRODUCT or acx == 0.0 or bcy == 0.0)
                and (abs(right) > _SMALLEST_PRODUCT or acy == 0.0 or bcx == 0.0)):
            # Rounding is monotone, so heads decide if they differ; if they are equal, tails do.
            difference = left - right
            if difference == 0.0:
                difference = product_error(acx, bcy, left) - product_error(acy, bcx, right)
            return (difference > 0.0) - (difference < 0.0)
    return _orient_exact(ax, ay, bx, by, cx, cy)


@inner
def _orient_exact(ax, ay, bx, by, cx, cy):
    total = scratch_integers(_LIMBS)
    for k in range(_LIMBS):
        total[k] = 0
    for x, y, sign in ((ax, by, 1), (ax, cy, -1), (cx, by, -1), (ay, bx, -1), (ay, cx, 1),
                       (cy, bx, 1)):
        _accumulate(total, x, y, sign)
    carry = rest = 0
    for k in range(_LIMBS):
        limb = total[k] + carry
        carry = limb >> _LIMB_BITS
        rest |= limb & _LIMB_MASK
    return -1 if carry < 0 else 1 if rest else 0


@inner
def _accumulate(total, x, y, sign):
    """Add sign * x * y to the fixed-point number whose 24-bit limbs, lowest first, are total."""
    if x == 0.0 or y == 0.0:
        return
    if (x < 0.0) != (y < 0.0):
        sign = -sign
    x0, x1, x2, x3, start_x = _limbs(abs(x))
    y0, y1, y2, y3, start_y = _limbs(abs(y))
    start = start_x + start_y
    # No column overflows, see docs/exactness.md, lemma 3.
    total[start] += sign * (x0 * y0)
    total[start + 1] += sign * (x0 * y1 + x1 * y0)
    total[start + 2] += sign * (x0 * y2 + x1 * y1 + x2 * y0)
    total[start + 3] += sign * (x0 * y3 + x1 * y2 + x2 * y1 + x3 * y0)
    total[start + 4] += sign * (x1 * y3 + x2 * y2 + x3 * y1)
    total[start + 5] += sign * (x2 * y3 + x3 * y2)
    total[start + 6] += sign * (x3 * y3)


@inner
def _limbs(x):
    """Return the four 24-bit limbs of x > 0, lowest first, and the index of the lowest."""
    fraction, exponent = math.frexp(x)
    mantissa = int(fraction * 9007199254740992.0)
    place = exponent - 53 + _EXPONENT_OFFSET
    shift = place % _LIMB_BITS
    low = (mantissa & _LIMB_MASK) << shift
    middle = (((mantissa >> _LIMB_BITS) & _LIMB_MASK) << shift) + (low >> _LIMB_BITS)
    high = ((mantissa >> (2 * _LIMB_BITS)) << shift) + (middle >> _LIMB_BITS)
    return (low & _LIMB_MASK, middle & _LIMB_MASK, high & _LIMB_MASK, high >> _LIMB_BITS,
            place // _LIMB_BITS)


@kernel
def segments_meet(ax, ay, bx, by, cx, cy, dx, dy):
    """
    Return whether the closed segments a b and c d share a point; exact, points allowed.

    With overlapping boxes, each segment must reach both sides of the other's line. Where all four
    points are collinear the boxes alone decide.
    """
    if (max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx)
            or max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by)):
        return False
    return (orient(ax, ay, bx, by, cx, cy) * orient(ax, ay, bx, by, dx, dy) <= 0
            and orient(cx, cy, dx, dy, ax, ay) * orient(cx, cy, dx, dy, bx, by) <= 0)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Numbers of twice the precision of a double.

A double-double is the unevaluated sum of two doubles, a pair (head, tail) with the head the
rounded sum of both. With u = 2^-53 and unless a product underflows, differences of doubles are
exact, the error of a sum is at most 4 u^2 times the sum of the magnitudes, and the relative error
of products is at most 9 u^2, of quotients and roots 16 u^2 (docs/exactness.md, lemma 15).
"""

import math

from sat_collision.geometry.compiled.jit import inner, kernel

_SPLITTER = 2.0 ** 27 + 1.0


@kernel
def difference_error(a, b, difference):
    """Return a - b - difference exactly, difference being the rounded a - b (Knuth)."""
    b_virtual = a - difference
    a_virtual = difference + b_virtual
    return (a - a_virtual) + (b_virtual - b)


@kernel
def product_error(a, b, product):
    """Return a b - product exactly, product being the rounded a b (Dekker, Veltkamp)."""
    c = _SPLITTER * a
    a_high = c - (c - a)
    a_low = a - a_high
    c = _SPLITTER * b
    b_high = c - (c - b)
    b_low = b - b_high
    return a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@inner
def difference(a, b):
    """Return the difference of two doubles, exactly."""
    head = a - b
    return head, difference_error(a, b, head)


@inner
def _normalised(head, tail):
    """Return the exact sum of two doubles as head and tail."""
    total = head + tail
    return total, difference_error(head, -tail, total)


@inner
def negative(a):
    return -a[0], -a[1]


@inner
def plus(a, b):
    head = a[0] + b[0]
    return _normalised(head, difference_error(a[0], -b[0], head) + (a[1] + b[1]))


@inner
def times(a, b):
    head = a[0] * b[0]
    return _normalised(head, product_error(a[0], b[0], head) + (a[0] * b[1] + a[1] * b[0]))


@inner
def quotient(a, b):
    """Return a / b; b is not 0."""
    head = a[0] / b[0]
    product = head * b[0]
    rest = ((a[0] - product) - product_error(head, b[0], product)) + (a[1] - head * b[1])
    return _normalised(head, rest / b[0])


@inner
def square_root(a):
    """Return the square root of a; a is not negative."""
    head = math.sqrt(a[0])
    if head == 0.0:
        return head, head
    square = head * head
    rest = ((a[0] - square) - product_error(head, head, square)) + a[1]
    return _normalised(head, rest / (2.0 * head))


@inner
def dot(ax, ay, bx, by):
    return plus(times(ax, bx), times(ay, by))


@inner
def cross(ax, ay, bx, by):
    """Return the cross product of two vectors: positive where b is to the left of a."""
    return plus(times(ax, by), times(negative(ay), bx))


@inner
def scaled(x, y, scale):
    """Return a vector times a power of two."""
    return (x[0] * scale, x[1] * scale), (y[0] * scale, y[1] * scale)

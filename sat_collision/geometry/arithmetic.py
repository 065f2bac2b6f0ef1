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
Floating point: checks that it is what the proofs assume, and numbers of twice its precision.

Results must be rounded to nearest, underflow must be gradual, and multiplications must not be
fused with additions, see docs/exactness.md. All of this is checked once, at import; if it is not
so, that raises. The first two are modes of a thread, which any library may change at any time (one
linked with ``-ffast-math`` does so when it is loaded), so every kernel that Python calls checks
them again.

A double-double is the unevaluated sum of two doubles, a pair (head, tail) with the head the
rounded sum of both. With u = 2^-53 and unless a product underflows, differences of doubles are
exact, the error of a sum is at most 4 u^2 times the sum of the magnitudes, and the relative error
of products is at most 9 u^2, of quotients and roots 16 u^2 (docs/exactness.md, lemma 15).
"""

import math

from sat_collision.geometry.jit import HAS_CONTROL_WORD, inner, kernel

FLUSHED = ('floating point flushes numbers below 2^-1022 to zero in this thread, and collision '
           'answers would be wrong: a library built with -ffast-math has set this when it was '
           'loaded; load it in another process, or reset the mode')
DIRECTED = ('floating point does not round to nearest in this thread, and collision answers would '
            'be wrong: reset the rounding mode, which fesetround or the like has set')
FUSED = ('kernels are compiled with fused multiply-add, and collision answers would be wrong: '
         'compile them without fastmath, or set NUMBA_DISABLE_JIT=1')

_IS_DIRECTED = 1
_FLUSHES = 2
_FUSES = 3

# Bits of MXCSR: flush to zero and denormals are zero; the rounding control.
_FLUSHING_BITS = 0x8040
_ROUNDING_BITS = 0x6000

_NORMAL = 2.0 ** -1022
_NEXT = 2.0 ** -1022 + 2.0 ** -1074
_LITTLE = 2.0 ** -60
# Its square has more bits than a double.
_UNEVEN = 1.0 + 2.0 ** -30

_SPLITTER = 2.0 ** 27 + 1.0


def require_proved() -> None:
    """Raise FloatingPointError unless kernels compute as the proofs assume."""
    # In plain Python first: code compiled in a wrong mode would be cached and stay wrong.
    found = getattr(problem, 'py_func', problem)(1.0, _UNEVEN) or problem(1.0, _UNEVEN)
    if found:
        raise FloatingPointError({_FLUSHES: FLUSHED, _IS_DIRECTED: DIRECTED, _FUSES: FUSED}[found])


@kernel
def problem(one, uneven):
    """Return the code of what is wrong, else 0; arguments keep compilers from folding this."""
    if one + one * _LITTLE != one or one - one * _LITTLE != one:
        return _IS_DIRECTED
    low = one * _NORMAL
    high = one * _NEXT
    if low == high or low + (high - low) != high:
        return _FLUSHES
    if uneven * uneven - (one * uneven) * (one * uneven) != 0.0:
        return _FUSES
    return 0


if HAS_CONTROL_WORD:
    from sat_collision.geometry.jit import control_word

    @kernel
    def require_nearest(count):
        """Raise FloatingPointError if this thread's modes are wrong; any count will do."""
        word = control_word()
        if word & _FLUSHING_BITS:
            raise FloatingPointError(FLUSHED)
        if word & _ROUNDING_BITS:
            raise FloatingPointError(DIRECTED)
else:
    @kernel
    def require_nearest(count):
        """Raise FloatingPointError if this thread's modes are wrong; any count will do."""
        found = problem(1.0 + abs(count), _UNEVEN)
        if found == _FLUSHES:
            raise FloatingPointError(FLUSHED)
        if found == _IS_DIRECTED:
            raise FloatingPointError(DIRECTED)


require_proved()


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
    """Return -a."""
    return -a[0], -a[1]


@inner
def plus(a, b):
    """Return a + b."""
    head = a[0] + b[0]
    return _normalised(head, difference_error(a[0], -b[0], head) + (a[1] + b[1]))


@inner
def times(a, b):
    """Return a b."""
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
    """Return the scalar product of two vectors."""
    return plus(times(ax, bx), times(ay, by))


@inner
def cross(ax, ay, bx, by):
    """Return the cross product of two vectors: positive where b is to the left of a."""
    return plus(times(ax, by), times(negative(ay), bx))


@inner
def scaled(x, y, scale):
    """Return a vector times a power of two."""
    return (x[0] * scale, x[1] * scale), (y[0] * scale, y[1] * scale)

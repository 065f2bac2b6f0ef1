# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Checks that floating point is what the proofs assume.

Results must be rounded to nearest, underflow must be gradual, and multiplications must not be
fused with additions, see docs/exactness.md. The import checks all of this once, and fails if it
does not hold. The first two are modes of a thread, which any library may change at any time (one
linked with ``-ffast-math`` does so when loaded), so every kernel that Python calls checks again.
"""

from sat_collision.geometry.compiled.jit import kernel

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

_NORMAL = 2.0 ** -1022
_NEXT = 2.0 ** -1022 + 2.0 ** -1074
_LITTLE = 2.0 ** -60
# Its square has more bits than a double.
_UNEVEN = 1.0 + 2.0 ** -30


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


@kernel
def require_nearest(count):
    """Raise FloatingPointError if this thread's modes are wrong; any count will do."""
    found = problem(1.0 + abs(count), _UNEVEN)
    if found == _FLUSHES:
        raise FloatingPointError(FLUSHED)
    if found == _IS_DIRECTED:
        raise FloatingPointError(DIRECTED)


require_proved()

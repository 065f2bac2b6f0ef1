# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compile kernels with numba, if it is installed.

Every kernel is written once, as a plain function on scalars and flat arrays. With numba it is
compiled, without it the same function runs as Python; both do the same IEEE double operations in
the same order, so the answers are identical. ``NUMBA_DISABLE_JIT=1`` selects plain Python.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any, Callable

import numpy as np
from numpy.typing import NDArray
from sat_collision.geometry.compiled.compilation import (
    digest_of, GEOMETRY, is_plain_python_chosen, report_problem)

# Whether kernels are kept and linked by `kernel_cache`, not by numba itself.
HAS_OWN_CACHE = False


def _step(x):
    return x + 1.0


def _trial(x):
    return _step(x)


try:
    if is_plain_python_chosen():
        # Importing numba takes half a second and 100 MB.
        raise ModuleNotFoundError('numba is not needed', name='numba')
    import numba
    import numba.extending
    from llvmlite import ir
    try:
        from sat_collision.geometry.compiled.kernel_cache import (
            IntermediateOnly, keep_compiled, Standalone)
        HAS_OWN_CACHE = True
    except Exception as error:  # of other internals anything may be missing
        if not numba.config.DISABLE_JIT:
            report_problem(f'numba {numba.__version__} is used as it is, so a first start takes '
                           f'about twice as long: {error}')

    def _compiled(function: Callable[..., Any], is_inner: bool, **options: Any) -> Any:
        if HAS_OWN_CACHE:
            options |= {'no_cfunc_wrapper': True, 'no_cpython_wrapper': is_inner,
                        'pipeline_class': IntermediateOnly if is_inner else Standalone}
        return numba.njit(error_model='numpy', **options)(function)

    def _kept(function: Callable[..., Any]) -> Any:
        # Without the interpreter lock, so that other threads go on.
        compiled = _compiled(function, False, nogil=True)
        if HAS_OWN_CACHE:
            keep_compiled(compiled)
            return compiled
        # numba's own cache does not notice that a kernel which this one calls has changed.
        for folder in GEOMETRY, Path(function.__code__.co_filename).parent:
            function.__qualname__ += f'_{digest_of(folder)[:16]}'
        with suppress(OSError, RuntimeError):  # it cannot be written
            compiled.enable_caching()
        return compiled

    if not numba.config.DISABLE_JIT:
        # A numba that is broken, or has other internals, may fail only when it compiles.
        _step = _compiled(_step, True)
        _kept(_trial)(1.0)
except Exception as error:  # a broken library may raise anything
    numba = None
    if not (isinstance(error, ModuleNotFoundError) and error.name == 'numba'):
        report_problem('numba does not work here, so kernels run in plain Python: '
                       f'{type(error).__name__}: {error}')

COMPILED = numba is not None and not numba.config.DISABLE_JIT
KERNEL = f'numba {numba.__version__}' if COMPILED else 'plain Python'


def kernel(function: Callable[..., Any]) -> Any:
    """
    Compile a module-level function with numba, or return it unchanged.

    Python and other kernels may call it, but no function that numba alone compiles: kernels that
    it calls would not be linked.

    No ``fastmath``: fused or reordered arithmetic would break the error bounds that the exact
    answers rest on. Division by zero gives infinity or NaN in compiled code and must be avoided
    by the caller, because plain Python raises.
    """
    if not COMPILED:
        return function
    compiled = _kept(function)
    if HAS_OWN_CACHE:
        linked = inner(function)
        compiled.get_call_template = linked.get_call_template
        compiled.get_overload = linked.get_overload
    return compiled


def inner(function: Callable[..., Any], **options: Any) -> Any:
    """Compile like `kernel`, but only for other kernels: it has no machine code of its own."""
    if not COMPILED:
        return function
    compiled = _compiled(function, True, **options)
    if not HAS_OWN_CACHE:
        return compiled
    # A literal 0 and an integer are two types to numba, and it would compile for both.
    template = compiled.get_call_template
    compiled.get_call_template = lambda types, named: template(
        tuple(map(numba.types.unliteral, types)), named)
    return compiled


def inlined(function: Callable[..., Any]) -> Any:
    """Compile like `inner`, and always inline: for the steps of a hot loop."""
    return inner(function, forceinline=True)


def indexable(array: NDArray[Any]) -> Any:
    """
    Return the array for compiled kernels, and a memoryview of it for plain Python.

    Elements of a memoryview are Python floats, with which plain Python computes several times
    faster than with NumPy scalars.
    """
    return array if COMPILED else array.data


if COMPILED:
    @numba.extending.intrinsic
    def prefetch(typing_context, array, i):
        """Prefetch element i of `elements` into the processor's caches, without waiting."""
        def generate(context, builder, signature, arguments):
            integer = ir.IntType(32)
            pointer_type = ir.IntType(8).as_pointer()
            pointer = builder.bitcast(builder.gep(arguments[0], [arguments[1]]), pointer_type)
            instruction = builder.module.declare_intrinsic(
                'llvm.prefetch', [pointer_type],
                ir.FunctionType(ir.VoidType(), [pointer_type, integer, integer, integer]))
            to_read, to_all_caches, data = integer(0), integer(3), integer(1)
            builder.call(instruction, [pointer, to_read, to_all_caches, data])
            return context.get_dummy_value()
        return numba.types.none(array, i), generate

    @numba.extending.intrinsic
    def elements(typing_context, array):
        """
        Return a pointer to the numbers of a flat array, for use inside kernels.

        Without reference count and length it is passed on as one word instead of seven. Indices
        are not checked, and negative ones do not count from the end. The caller must keep the
        array itself for as long as the pointer is in use.
        """
        if isinstance(array, numba.types.CPointer):
            return array(array), lambda context, builder, signature, arguments: arguments[0]

        def generate(context, builder, signature, arguments):
            return context.make_array(array)(context, builder, arguments[0]).data
        return numba.types.CPointer(array.dtype)(array), generate

    @numba.extending.intrinsic
    def beyond(typing_context, numbers, place):
        """Return the numbers from an index on."""
        def generate(context, builder, signature, arguments):
            return builder.gep(arguments[0], [arguments[1]])
        return numbers(numbers, place), generate

    def _taken_as(element: Any) -> Any:
        @numba.extending.intrinsic
        def taken(typing_context, numbers):
            """Return numbers reinterpreted as those of another type, bit by bit."""
            pointer = numba.types.CPointer(element)

            def generate(context, builder, signature, arguments):
                return builder.bitcast(arguments[0], context.get_value_type(pointer))
            return pointer(numbers), generate
        return taken

    integers = _taken_as(numba.types.int64)
    _words = _taken_as(numba.types.uint32)
    _float32s = _taken_as(numba.types.float32)
    _float64s = _taken_as(numba.types.float64)

    @kernel
    def scratch(size):
        """Return an uninitialised flat array of doubles for use inside a kernel."""
        return np.empty(size)

    @kernel
    def scratch_integers(size):
        """Return an uninitialised flat array of 64-bit integers for use inside a kernel."""
        return np.empty(size, np.int64)

    @kernel
    def numbers_of(data):
        """Return bytes reinterpreted as 32-bit words, as float32 and as float64, native order."""
        start = elements(data)
        return _words(start), _float32s(start), _float64s(start)
else:
    def prefetch(array, i):
        """Do nothing: plain Python would gain nothing."""

    def elements(array):
        """Return the array; plain Python checks indices anyway."""
        return array

    def beyond(numbers, place):
        return numbers[place:]

    def integers(numbers):
        return numbers.cast('B').cast(np.dtype(np.int64).char)

    def scratch(size):
        return memoryview(np.empty(size))

    def scratch_integers(size):
        return memoryview(np.empty(size, np.int64))

    def numbers_of(data):
        whole = memoryview(data)
        words = whole[:len(data) // 4 * 4]
        return words.cast('I'), words.cast('f'), whole[:len(data) // 8 * 8].cast('d')

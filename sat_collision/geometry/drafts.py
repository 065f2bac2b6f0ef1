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
Link kernels so that each is compiled to machine code once.

numba compiles every function to machine code together with all that it calls, and again in each
that calls it: the last function of a chain of ten is compiled ten times. Here a function stays a
draft, unlinked LLVM intermediate representation, until one that Python calls is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Code(JITCodeLibrary):  # type: ignore[misc]
    """The code of a function and of all that it calls."""

    def add_linking_library(self, library: Any) -> None:
        """Add the code of a function that is called."""
        # Each before those that it calls, because LLVM links only what is already called.
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            for called in library._linking_libraries if isinstance(library, _DraftCode) else ():
                self.add_linking_library(called)


class _DraftCode(_Code):
    """The code of a function that Python cannot call: it has no address."""

    @property
    def codegen(self) -> Any:
        """Return the object whose `set_env` receives the environment, which only Python needs."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Drop an environment."""

    def finalize(self) -> None:
        """Compile nothing: the functions that call this one do."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        self._ensure_finalized()
        return 0


class Whole(Compiler):  # type: ignore[misc]
    """Compiles a function for Python to call."""

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile a function, to be kept on disk."""
        self.state.library = _Code(self.state.targetctx.codegen(), function.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(function)


class Draft(Compiler):  # type: ignore[misc]
    """Compiles a function for use in others."""

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile a function as far as it can be without those that call it."""
        self.state.library = _DraftCode(self.state.targetctx.codegen(), function.__qualname__)
        return super().compile_extra(function)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Changes to how numba compiles: each kernel is compiled once, and kept on disk.

numba compiles every function to machine code together with all that it calls, and again in each
that calls it: the last function of a chain of ten is compiled ten times. Here a function stays
`IntermediateOnly`, in LLVM's intermediate representation and unlinked, until one that Python calls
is compiled.

numba compiles a function again if its own file has changed, but not if a kernel that it calls has.
Here all sources in `sat_collision.geometry`, and in the folder of a kernel, count as its source.
If files cannot be written, kernels are compiled in each process; if a file is damaged, its kernel
is compiled again. `kernel_problem` returns the reason.

The files are pickles: whoever can write to their folder can run code as whoever reads them.

Of numba's internals this replaces the cache of a function, `FunctionCache`, with its files,
`IndexDataCacheFile`, and the library of compiled code, `JITCodeLibrary`; and `jit` changes how a
function finds those that it calls, `get_call_template` and `get_overload`. All tests of geometry
were run with the versions `OLDEST` and `NEWEST`. With one that is not between them this module
cannot be imported, and `jit` takes numba as it is.
"""

import hashlib
from pathlib import Path
import pickle
import sys
from typing import Any, Callable

from numba import __version__, config, version_info
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target
from numba.core.sigutils import normalize_signature
from sat_collision.geometry.compiled.compilation import (
    digest_of, GEOMETRY, report_problem, say_compiling)

OLDEST, NEWEST = (0, 59), (0, 68)
if not OLDEST <= version_info.short <= NEWEST:
    raise ImportError('it was tried with numba {}.{} to {}.{}'.format(*OLDEST, *NEWEST))

# Compiling these, which importing the package does, takes a fraction of a second.
_QUICK = 'sat_collision.geometry.compiled.floating_point', 'sat_collision.geometry.compiled.jit'
_DIGEST_SIZE = hashlib.sha256().digest_size


def is_kept(kernel: Any) -> bool:
    """Return whether compiled code of a numba kernel can be loaded from disk."""
    return isinstance(kernel._cache, _KernelCache) and kernel._cache.is_filled()


def keep_compiled(kernel: Any) -> None:
    """Load compiled code of a numba kernel from disk, and save what is compiled anew."""
    try:
        kernel._cache = _KernelCache(kernel.py_func)
    except (OSError, RuntimeError):  # raised by numba if no folder is usable
        report_problem(
            'compiled kernels cannot be kept, so each process compiles them again: '
            f'neither NUMBA_CACHE_DIR nor a __pycache__ in {GEOMETRY} '
            "nor the user's cache directory can be written to")


def prepared_mark(others: Path) -> Path | None:
    """
    Return the file whose existence says that all current kernels are kept, for this processor.

    Kernels are those in `sat_collision.geometry` and another folder. None if none can be kept.
    """
    if config.DISABLE_JIT:
        return None
    try:
        folder = FunctionCache(keep_compiled).cache_path
    except (OSError, RuntimeError):  # as above
        return None
    machine = cpu_target.target_context.codegen().magic_tuple()
    known = repr((__version__, sys.version_info[:2], digest_of(GEOMETRY), digest_of(others),
                  machine))
    return Path(folder, f'prepared-{hashlib.sha256(known.encode()).hexdigest()[:16]}')


class _KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, valid as long as no kernel has changed."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._is_quick = function.__module__ in _QUICK
        self._name = function.__name__
        beside = Path(function.__code__.co_filename).parent
        self._cache_file = _CheckedFile(
            self.cache_path, self._impl.filename_base,
            (__version__, digest_of(GEOMETRY), digest_of(beside),
             self._impl.locator.get_source_stamp()))

    def is_filled(self) -> bool:
        machine = cpu_target.target_context.codegen().magic_tuple()
        try:
            return any(key[1] == machine for key in self._cache_file._load_index())
        except Exception:  # reading damaged files may raise anything
            return False

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code compiled for a signature, None if there is none that is valid."""
        try:
            found = super().load_overload(sig, target_context)
        except Exception as error:  # reading damaged files may raise anything
            report_problem('compiled kernels were damaged, and are compiled again: '
                           f'{self.cache_path} ({type(error).__name__}: {error})')
            found = None
        # Processes that save two signatures at once may both choose the same file.
        if found is not None and found.signature.args == normalize_signature(sig)[0]:
            return found
        if not self._is_quick:
            say_compiling(self._name, self.cache_path)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the code compiled for a signature, if possible."""
        try:
            try:
                super().save_overload(sig, data)
            except Exception:  # the files may be damaged: delete them
                self._cache_file.delete()
                super().save_overload(sig, data)
        except Exception as error:
            report_problem(f'compiled kernels cannot be kept in {self.cache_path}, so each '
                           f'process compiles them again: {error}')


class _CheckedFile(IndexDataCacheFile):  # type: ignore[misc]
    """
    Files with a checksum and the stamp of the source, used only if these are right.

    Code has the stamp, too: a process that is killed between writing a new index and the code
    leaves old code behind that index.
    """

    def delete(self) -> None:
        for path in Path(self._cache_path).glob(f'{Path(self._index_name).stem}.*nb[ci]'):
            if path.is_dir() and not path.is_symlink():
                path.rmdir()
            else:
                path.unlink(missing_ok=True)

    def _load_index(self) -> Any:
        try:
            return self._read(self._index_path) or {}
        except FileNotFoundError:
            return {}

    def _save_index(self, overloads: Any) -> None:
        self._write(self._index_path, overloads)

    def _load_data(self, name: str) -> Any:
        return self._read(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), data)

    def _write(self, path: str, contents: Any) -> None:
        data = self._dump((self._source_stamp, contents))
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(data).digest() + data)

    def _read(self, path: str) -> Any:
        data = Path(path).read_bytes()
        if hashlib.sha256(data[_DIGEST_SIZE:]).digest() != data[:_DIGEST_SIZE]:
            raise ValueError(f'{Path(path).name} has another checksum')
        stamp, contents = pickle.loads(data[_DIGEST_SIZE:])
        return contents if stamp == self._source_stamp else None


class _Code(JITCodeLibrary):  # type: ignore[misc]
    """The code of a function and of all that it calls."""

    def add_linking_library(self, library: Any) -> None:
        """Add the code of a function that is called."""
        # Each before those that it calls, because LLVM links only what is already called.
        if library not in self._linking_libraries:
            super().add_linking_library(library)
            if isinstance(library, _IntermediateCode):
                for called in library._linking_libraries:
                    self.add_linking_library(called)


class _IntermediateCode(_Code):
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


class Standalone(Compiler):  # type: ignore[misc]
    """Compiles a function for Python to call."""

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile a function, to be kept on disk."""
        self.state.library = _Code(self.state.targetctx.codegen(), function.__qualname__)
        self.state.library.enable_object_caching()
        return super().compile_extra(function)


class IntermediateOnly(Compiler):  # type: ignore[misc]
    """Compiles a function for use in others."""

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile a function as far as it can be without those that call it."""
        self.state.library = _IntermediateCode(self.state.targetctx.codegen(),
                                               function.__qualname__)
        return super().compile_extra(function)

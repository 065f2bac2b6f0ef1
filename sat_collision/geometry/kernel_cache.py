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
Compiled kernels kept on disk from one process to the next, so that starting is quick.

numba keeps them per function and compiles anew where the function's own file has changed, but does
not notice a change in a kernel that it calls. Here all of `sat_collision.geometry` counts as one
source. Where the files cannot be kept the kernels are compiled in each process, and where one is
damaged it is compiled again; `cache_problem` says so.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
import pickle
from typing import Any, Callable

from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.sigutils import normalize_signature

_problems: list[str] = []


def cache_problem() -> str | None:
    """Return in one line what is wrong with the kept kernels, None if nothing is."""
    return _problems[0] if _problems else None


def is_kept(kernel: Any) -> bool:
    """Tell whether anything compiled of a numba kernel can be loaded from disk."""
    return isinstance(kernel._cache, _KernelCache) and kernel._cache.is_filled()


def keep_compiled(kernel: Any) -> None:
    """Load what is compiled of a numba kernel from disk, and save it there."""
    try:
        kernel._cache = _KernelCache(kernel.py_func)
    except RuntimeError:
        _problems.append('compiled kernels cannot be kept, so each process compiles them again: '
                         f'neither NUMBA_CACHE_DIR nor {Path(__file__).parent / "__pycache__"} '
                         "nor the user's cache directory can be written to")


def _digest() -> str:
    """Return a digest of all sources of the kernels that may call each other."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob('*.py')):
        digest.update(path.read_bytes())
    return digest.hexdigest()


_SOURCES = _digest()


class _KernelCache(FunctionCache):  # type: ignore[misc]
    """What numba keeps of a function, good as long as no kernel has changed."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        locator = self._impl.locator
        self._cache_file = _CheckedFile(self.cache_path, self._impl.filename_base,
                                        (_SOURCES, locator.get_source_stamp()))

    def is_filled(self) -> bool:
        """Tell whether there is anything to load."""
        try:
            return bool(self._cache_file._load_index())
        except Exception:  # reading damaged files may raise anything
            return False

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for a signature, None if there is nothing of use."""
        try:
            found = super().load_overload(sig, target_context)
        except Exception as error:  # reading damaged files may raise anything
            _problems.append('compiled kernels were damaged, and are compiled again: '
                             f'{self.cache_path} ({type(error).__name__}: {error})')
            return None
        # Processes that save two signatures at once may each take the same file for its own.
        if found is not None and found.signature.args != normalize_signature(sig)[0]:
            return None
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save what was compiled for a signature, if possible."""
        try:
            try:
                super().save_overload(sig, data)
            except OSError:
                raise
            except Exception:  # the index is damaged: begin a new one
                self.flush()
                super().save_overload(sig, data)
        except OSError as error:
            _problems.append(f'compiled kernels cannot be kept: {error}')


class _CheckedFile(IndexDataCacheFile):  # type: ignore[misc]
    """Files of machine code that are not run once damaged."""

    def _save_data(self, name: str, data: Any) -> None:
        code = self._dump(data)
        super()._save_data(name, (hashlib.sha256(code).digest(), code))

    def _load_data(self, name: str) -> Any:
        digest, code = super()._load_data(name)
        if hashlib.sha256(code).digest() != digest:
            raise ValueError(f'{name} has another checksum')
        return pickle.loads(code)

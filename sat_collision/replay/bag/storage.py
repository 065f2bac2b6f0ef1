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

"""What the readers of storage files have in common, and the faults that they find."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Set
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol, TypeAlias

Message: TypeAlias = tuple[str, int, bytes]  # topic, time in ns, data


def is_installed(library: str) -> bool:
    """Return whether a library can be imported; a folder of the same name does not count."""
    try:
        spec = find_spec(library)
    except ModuleNotFoundError:  # what it lies in
        return False
    return spec is not None and spec.origin is not None


class Storage(Protocol):
    """
    A storage file, of which faults are recorded while it is opened and read.

    Attributes
    ----------
    topics, counts : dict
        Type and number of messages of each topic.
    start, end : int
        Times of the first and the last message in ns, None if there is none.

    """

    topics: dict[str, str]
    counts: Counter[str]
    start: int | None
    end: int | None

    def close(self) -> None:
        ...

    def messages(self, topics: Collection[str], start: int | None,
                 stop: int | None) -> Iterator[Message]:
        """Yield (topic, time in ns, data) of some topics, from start on and before stop (ns)."""
        ...


class Recorded(Protocol):
    """The interface of a recording that is checked; the attributes are those of Recording."""

    path: Path
    topics: dict[str, str]
    counts: Counter[str]

    @property
    def latched(self) -> Set[str]:
        ...

    @property
    def start(self) -> int | None:
        ...

    @property
    def end(self) -> int | None:
        ...

    @property
    def problems(self) -> list[str]:
        ...

    def messages(self, topics: Collection[str], start: int | None = None,
                 stop: int | None = None) -> Iterator[Message]:
        """Yield (topic, time in ns, data) of some topics, from start on and before stop (ns)."""
        ...


_MOST = 3
_LONGEST = 1000


class Faults:
    """
    The faults of one file: places that are damaged, and numbers that differ.

    Parameters
    ----------
    file : Path
        What to call the file.

    """

    def __init__(self, file: Path) -> None:
        self._file = file
        self._first = ''
        self._more = 0
        self._differences: dict[object, str] = {}

    def damaged(self, where: str) -> None:
        """Record a damaged place: the first one is described, further ones are counted."""
        if self._first:
            self._more += 1
        else:
            self._first = where

    def differs(self, about: object, words: str) -> None:
        """Record that two numbers differ, once for each subject."""
        self._differences.setdefault(about, words)

    def __bool__(self) -> bool:
        return bool(self._first or self._differences)

    def __str__(self) -> str:
        parts = []
        if self._first:
            more = f', and in {self._more} more places' if self._more else ''
            parts.append(self._first + more)
        differences = list(self._differences.values())
        parts += differences[:_MOST]
        if differences[_MOST:]:
            parts.append(f'and {len(differences) - _MOST} more differences')
        # Names of topics come from the file, and may be anything.
        text = ''.join(letter if letter.isprintable() else '?' for letter in '; '.join(parts))
        return f'{self._file}: {text[:_LONGEST]}'

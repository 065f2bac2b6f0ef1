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

"""What a recording is read from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Set
from pathlib import Path
from typing import Protocol, TypeAlias

Message: TypeAlias = tuple[str, int, bytes]  # topic, time in ns, data


class Storage(Protocol):
    """
    A storage file, of which faults are noted while it is opened and read.

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
    """What is asked of a recording to check it; the attributes are those of Recording."""

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

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

"""How far a run has come, shown on a terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
import sys
import time
from typing import TextIO, TypeAlias, TypeVar

OnProgress: TypeAlias = Callable[[float], None]

_Any = TypeVar('_Any')
_EVERY = 500
# What is longer would go over the end of a line, which cannot be removed.
_LONGEST = 25
_BAR = 30
_PATIENCE = 1.0
_REDRAW = 0.1


class Progress:
    """
    A bar on a terminal that appears when a run takes long, and vanishes after it.

    Parameters
    ----------
    what : str
        What the bar is about.
    stream : file, optional

    """

    def __init__(self, what: str = '', stream: TextIO = sys.stderr) -> None:
        self._what = f'{what[:_LONGEST]} ' if what else ''
        self._stream = stream
        self._begun = time.monotonic()
        self._next = self._begun + _PATIENCE if stream.isatty() else float('inf')
        self._shown = False

    def show(self, share: float) -> None:
        """Show that a share of the work is done."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + _REDRAW
        self._shown = True
        bar = f'{self._what}[{"#" * round(_BAR * share):{_BAR}}] {share:4.0%}'
        if share:
            bar += f'  {(now - self._begun) * (1.0 / share - 1.0):.0f} s left'
        self._stream.write(f'\r\033[K{bar}')
        self._stream.flush()

    def clear(self) -> None:
        """Remove the bar."""
        if self._shown:
            self._stream.write('\r\033[K')
            self._stream.flush()
            self._shown = False


def with_progress(messages: Iterable[_Any], total: int, progress: OnProgress) -> Iterator[_Any]:
    """Yield messages, and tell now and then what share of the total has passed."""
    for count, message in enumerate(messages):
        if count % _EVERY == 0:
            progress(min(count / max(total, 1), 1.0))
        yield message

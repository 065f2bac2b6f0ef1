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

"""The terminal: progress, verdicts in colour, and interrupts that are not lost."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
import signal
import sys
import time
from types import FrameType
from typing import Any, TextIO

from sat_collision.replay.model.result import Verdict

# A longer line would wrap, and could not be removed.
_LONGEST = 25
_BAR = 30
_DELAY = 1.0
_REDRAW = 0.1


class Progress:
    """A bar on a terminal that appears when a run takes long, and vanishes after it."""

    def __init__(self, what: str = '', stream: TextIO = sys.stderr) -> None:
        self._what = f'{what[:_LONGEST]} ' if what else ''
        self._stream = stream
        self._begun = time.monotonic()
        self._next = self._begun + _DELAY if stream.isatty() else float('inf')
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


_GREEN, _RED, _YELLOW, _MAGENTA = 32, 31, 33, 35
_COLOURS = {Verdict.CLEAR: _GREEN, Verdict.COLLISION: _RED, Verdict.UNKNOWN: _YELLOW,
            Verdict.BAD_INPUT: _MAGENTA}


def with_colour(lines: list[str], verdict: Verdict, stream: TextIO) -> list[str]:
    """Return lines whose verdict, at the end of one, is coloured if the stream should have it."""
    # https://no-color.org: whatever it is set to, unless it is empty.
    if os.environ.get('NO_COLOR') or os.environ.get('TERM') == 'dumb' or not stream.isatty():
        return lines
    word = verdict.words.upper()
    coloured = f'\033[1;{_COLOURS[verdict]}m{word}\033[0m'
    return [line.removesuffix(word) + coloured if line.endswith(f' {word}') else line
            for line in lines]


_AGAIN = 0.3


@contextlib.contextmanager
def insistent_interrupts() -> Iterator[None]:
    """
    Have an interrupt raised again and again until it has ended what is under way.

    Nothing is printed of those that are swallowed, nor, from the first one on until the process
    has ended, of objects that it left half made. A process that ignores interrupts, as one in the
    background does, goes on to do so.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return

    is_interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal is_interrupted
        is_interrupted = True
        signal.setitimer(signal.ITIMER_REAL, _AGAIN)
        raise KeyboardInterrupt

    def report(unraisable: Any) -> None:
        if not is_interrupted:
            report_before(unraisable)

    report_before = sys.unraisablehook
    handlers = {number: signal.signal(number, interrupt)
                for number in (signal.SIGINT, signal.SIGALRM)}
    sys.unraisablehook = report
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if not is_interrupted:
            sys.unraisablehook = report_before

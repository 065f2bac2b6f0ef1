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


"""Interrupts that are not lost: callbacks from compiled code, as compiling makes, swallow them."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import signal
import sys
from types import FrameType
from typing import Any

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

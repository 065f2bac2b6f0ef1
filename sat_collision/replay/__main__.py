# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The entry point of replay_check: a crash never has the exit status of a collision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import resource
import signal
import sys
import traceback
from types import FrameType
from typing import Any

from sat_collision.extras import missing, unexpected

_KERNELS = 'sat_collision.geometry.compiled.jit'
_STATUS_OF_INTERRUPTED = 2
_STATUS_OF_BAD_INPUT = 3
# After how many seconds an interrupt is raised again.
_AGAIN = 0.3


def main(args: Sequence[str] | None = None) -> int:
    """Run the command and return the exit status."""
    try:
        with _insistent_interrupts():
            # Imported here, as an interrupt may come during these slow imports.
            from sat_collision.replay.arguments import parse
            options = parse(args)
            # All files of a recording are open at once.
            _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
            resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
            from sat_collision.replay.kernels import choose, prepare
            # The workers of a cluster have kernels of their own, and so has a program that used
            # the library before.
            if not (options.dask or _KERNELS in sys.modules) and choose(
                    options.bags, options.limits):
                prepare(lambda words: print(f'replay_check: {words}', file=sys.stderr))
            from sat_collision.replay.command import run
            return run(options)
    except KeyboardInterrupt:
        print('replay_check: interrupted', file=sys.stderr)
        # After an interrupted exec of a string Python would still exit by the signal, unless
        # another one follows.
        exec('')
        return _STATUS_OF_INTERRUPTED
    except Exception as error:
        if '--debug' in (sys.argv if args is None else args):
            traceback.print_exc()
        hint = missing(error) if isinstance(error, ModuleNotFoundError) else unexpected(error)
        print(f'replay_check: cannot start: {hint}', file=sys.stderr)
        return _STATUS_OF_BAD_INPUT


@contextlib.contextmanager
def _insistent_interrupts() -> Iterator[None]:
    """
    Raise an interrupt, or SIGTERM, again and again until it has ended what is running.

    Interrupts that destructors swallow are not printed. From the first one on, until the process
    ends, neither are errors of objects that were left half made. A process that ignores
    interrupts, such as one in the background, still ignores them.
    """
    numbers = [number for number in (signal.SIGINT, signal.SIGTERM)
               if signal.getsignal(number) is not signal.SIG_IGN]
    if not numbers:
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
    handlers = {number: signal.signal(number, interrupt) for number in (*numbers, signal.SIGALRM)}
    sys.unraisablehook = report
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if not is_interrupted:
            sys.unraisablehook = report_before


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Signal handling: exit at once while starting, later record the signal for the loop."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def end_on_signals() -> None:
    """
    Let signals end the process at once, with status 0, while there is nothing to lose yet.

    An exception instead could be raised in a destructor or in a callback from compiled code, which
    would swallow it, or leave ROS half initialised at interpreter exit. Python runs its signal
    handlers only between bytecode instructions, and one that compiles may take seconds: so a
    thread waits for the signal number, which is written into a pipe when a signal arrives.
    """
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    signal.set_wakeup_fd(write_end)
    for number in _SIGNALS:
        signal.signal(number, lambda number, frame: os._exit(0))

    def end() -> None:
        if os.read(read_end, 1):
            os._exit(0)
        os.close(read_end)
    threading.Thread(target=end, daemon=True).start()


class Signalled:
    """Whether a signal has arrived."""

    def __init__(self) -> None:
        self._has_arrived = False
        write_end = signal.set_wakeup_fd(-1)
        for number in _SIGNALS:
            signal.signal(number, self._note)
        if write_end >= 0:
            # This ends the thread of `end_on_signals`.
            os.close(write_end)

    def __call__(self) -> bool:
        """Return whether the node should stop; from then on signals are ignored."""
        if self._has_arrived:
            # Python prints an error for another one that comes meanwhile.
            sys.unraisablehook = lambda error: None
            for number in _SIGNALS:
                signal.signal(number, signal.SIG_IGN)
        return self._has_arrived

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._has_arrived = True

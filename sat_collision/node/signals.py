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

"""Signal handling: exit at once while starting, later record the signal for the loop."""

from __future__ import annotations

import os
import signal
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
    come, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write)
    for number in _SIGNALS:
        signal.signal(number, lambda number, frame: os._exit(0))

    def end() -> None:
        if os.read(come, 1):
            os._exit(0)
        os.close(come)
    threading.Thread(target=end, daemon=True).start()


def ignore_signals() -> None:
    """Ignore further signals while the process ends."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Signalled:
    """Whether a signal has arrived; further ones are ignored."""

    def __init__(self) -> None:
        self._come = False
        early = signal.set_wakeup_fd(-1)
        for number in _SIGNALS:
            signal.signal(number, self._note)
        if early >= 0:
            os.close(early)

    def __call__(self) -> bool:
        """Return whether the node should stop."""
        return self._come

    def _note(self, number: int, frame: FrameType | None) -> None:
        ignore_signals()
        self._come = True

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

"""How signals end the node: they are noted, and looked at where it is safe to end."""

from __future__ import annotations

import signal
from types import FrameType

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def interrupt_on_signals() -> None:
    """Have the signals raise KeyboardInterrupt: a long start-up can be broken off."""
    for number in _SIGNALS:
        signal.signal(number, signal.default_int_handler)


def ignore_signals() -> None:
    """Let nothing more disturb the end of the process."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


class Signalled:
    """Tells whether a signal has come; further ones are ignored."""

    def __init__(self) -> None:
        self._come = False
        for number in _SIGNALS:
            signal.signal(number, self._note)

    def __call__(self) -> bool:
        """Tell whether the node is to end."""
        return self._come

    def _note(self, number: int, frame: FrameType | None) -> None:
        ignore_signals()
        self._come = True

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

"""A thread that watches over the loop of the node: when that hangs, the flags are raised."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time

# How many times in each period the alarm is raised again.
_ALARMS = 4


class Watchdog:
    """
    Raises the alarm while the loop of the node has not turned for some time, by the steady clock.

    It runs in a thread of its own, which starts with the first turn. Python lets it run while the
    loop waits or computes in Python, and between two calls of compiled kernels, not during one.

    Parameters
    ----------
    raise_alarm : callable
        Takes for how many s the loop has not turned; called again and again, from the thread.
    end_alarm : callable
        Takes for how many s it had not; called once, from the loop.

    """

    def __init__(self, raise_alarm: Callable[[float], None],
                 end_alarm: Callable[[float], None]) -> None:
        self._raise_alarm = raise_alarm
        self._end_alarm = end_alarm
        self._period = 0.0
        self._turned_at = 0.0
        self._alarm = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False

    def use(self, period: float) -> None:
        """Choose after how many s without a turn the alarm is raised, 0 for never."""
        with self._changed:
            self._period = period
            self._changed.notify()

    def turned(self) -> bool:
        """Take note that the loop has turned; tell whether that ends an alarm."""
        now = time.monotonic()
        with self._changed:
            stalled, self._turned_at = now - self._turned_at, now
            alarm, self._alarm = self._alarm, False
        if alarm:
            self._end_alarm(stalled)
        if self._thread is None and not self._closed:
            self._thread = threading.Thread(target=self._watch, name='watchdog', daemon=True)
            self._thread.start()
        return alarm

    def close(self) -> None:
        """End the thread."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread:
            self._thread.join()

    def _watch(self) -> None:
        with self._changed:
            while not self._closed:
                stalled = time.monotonic() - self._turned_at
                if 0.0 < self._period <= stalled:
                    self._alarm = True
                    # With the lock held, so that it cannot come after the end of the stall.
                    self._raise_alarm(stalled)
                    self._changed.wait(self._period / _ALARMS)
                else:
                    self._changed.wait(self._period - stalled if self._period else None)

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

"""What recurs, and clocks that stand still."""

from __future__ import annotations


class Every:
    """A timer for something that recurs, by a clock in seconds."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._next = 0.0

    def due(self, now: float) -> bool:
        """Return whether it is due; if so, it is due again a period later."""
        if now < self._next:
            return False
        self._next += self._period
        if self._next <= now:
            self._next = now + self._period
        return True


class ClockWatch:
    """Detects that a clock stands still, by another one that does not."""

    def __init__(self) -> None:
        self._reading: int | None = None
        self._since = 0.0

    def stands(self, reading: int, now: float, timeout: float) -> bool:
        """
        Return whether the clock has read the same for longer than a timeout.

        Parameters
        ----------
        reading : int
            What it reads now.
        now : float
            The other clock, in s.
        timeout : float
            In s; 0.0 for never.

        """
        if reading != self._reading:
            self._reading, self._since = reading, now
        return 0.0 < timeout < now - self._since

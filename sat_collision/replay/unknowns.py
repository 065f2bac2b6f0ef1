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

"""When footprints were unknown, and why."""

from __future__ import annotations

from collections.abc import Iterable

from sat_collision.replay.result import Unknown


class Unknowns:
    """
    Joins what is told of footprints to intervals.

    Attributes
    ----------
    intervals : list of Unknown
        In the order of their beginning.

    """

    def __init__(self) -> None:
        self.intervals: list[Unknown] = []
        self._open: dict[str, Unknown] = {}

    def follow(self, name: str, reasons: Iterable[str], now: int) -> None:
        """Take note of why a footprint is unknown from now on; for no reason if it is not."""
        reasons = list(reasons)
        unknown = self._open.get(name)
        if unknown and unknown.reasons != reasons:
            unknown.last = now
            del self._open[name]
        if reasons and name not in self._open:
            self._open[name] = Unknown(name, now, now, reasons)
            self.intervals.append(self._open[name])

    def finish(self, now: int) -> None:
        """End what is open; what came and went between two messages of one time never was."""
        for unknown in self._open.values():
            unknown.last = now
        self.intervals = [one for one in self.intervals if one.last > one.first]

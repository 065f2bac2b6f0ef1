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

"""What is to be done at times of a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sat_collision.scene.deadlines import NEVER

_LONGEST_QUIET = 60 * 10**9


class Timer:
    """
    Something that recurs.

    Parameters
    ----------
    period : float
        In s.
    action : callable
        Takes the time in ns.

    Attributes
    ----------
    due : int or float
        When it is to be done next, ns.

    """

    def __init__(self, period: float, action: Callable[[int], None]) -> None:
        self.action = action
        self.due: float = 0
        self._period = max(round(period * 1e9), 1)

    def act(self, until: float) -> None:
        """Do it; of a long time in which nothing else happens, until then, leave the most out."""
        self.action(int(self.due))
        self.due += self._period
        quiet = until - self.due
        if quiet > _LONGEST_QUIET:
            self.due += int(quiet)


class Moments(Timer):
    """
    Something that is done at chosen moments.

    Parameters
    ----------
    moments : iterable of int
        In ns, in their order.
    action : callable
        Takes the time in ns.

    """

    def __init__(self, moments: Iterable[int], action: Callable[[int], None]) -> None:
        super().__init__(0.0, action)
        self._moments = iter(moments)

    def act(self, until: float) -> None:
        """Do it."""
        self.action(int(self.due))
        self.due = next(self._moments, NEVER)

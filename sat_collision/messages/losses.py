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

"""What is missing among messages, by the numbers that their publishers give them."""

from __future__ import annotations

import enum


class News(enum.Enum):
    """What the number of a message tells before the message itself."""

    LOST = 'some before it are lost'
    MET = 'it is the first one heard of its publisher'
    BEGUN = 'it is the first one that its publisher sent'


class Losses:
    """
    Finds gaps in the numbers of the messages on one topic.

    Each publisher counts its own messages, and a message does not say whose it is: it is taken
    for the next one of the publisher whose last number lies nearest below its own. One below all
    is the first that is heard of a publisher, be it a new one or one that has begun again.

    Attributes
    ----------
    most : int
        How many publishers there are.

    """

    def __init__(self) -> None:
        self.most = 1
        self._last: list[int] = []

    def missing(self, number: int) -> int | None:
        """Return how many are missing before a message, None if its publisher is a new one."""
        last = self._last
        if last and last[0] == number - 1:
            last[0] = number
            return 0
        before = max((other for other in last if other < number), default=None)
        if before is not None:
            last.remove(before)
        # The publisher heard last stands first.
        last.insert(0, number)
        del last[self.most:]
        return None if before is None else number - before - 1


class Overload:
    """
    Tells whether more comes on a topic than can be checked.

    So it is where messages are older than their timeout when they are taken, or go on being lost
    while some are waiting, and until none is waiting any more.
    """

    def __init__(self) -> None:
        self._is_there = False
        self._lost: int | None = None

    def note(self, seconds: float | None, timeout: float, lost: int) -> bool:
        """
        Take note of a backlog, and tell whether it is too much.

        Parameters
        ----------
        seconds : float or None
            How old messages are before they are taken, None where none is waiting.
        timeout : float
            In s; 0.0 for never.
        lost : int
            How many messages were lost so far.

        """
        before, self._lost = self._lost, lost
        if seconds is None:
            self._is_there, self._lost = False, None
        elif (before is not None and lost > before) or seconds > timeout > 0.0:
            self._is_there = True
        return self._is_there

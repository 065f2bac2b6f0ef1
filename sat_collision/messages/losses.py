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

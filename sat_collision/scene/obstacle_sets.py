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

"""Which messages make a set, of a source that publishes sets, and which sets count."""

from __future__ import annotations

from sat_collision.scene.deadlines import NEVER


class ObstacleSets:
    """
    The sets of a source, by their stamps.

    A set is the messages whose stamps lie within a window of the set's first. It is whole when a
    message of a later set comes, when an empty polygon with its stamp says so, or when nothing of
    it came for a while. So the order of the messages of a set means nothing.

    A whole set tells all that is there only if its beginning was seen, too. That of the first one
    that comes in may have been missed, as may that of one with a loss; whatever follows a whole
    set, or a pause, is seen from its beginning.

    Attributes
    ----------
    window : int
        How far from a set's first stamp those of its messages lie, in ns.
    timeout : int or float
        Age in ns past which the source's messages are refused, or NEVER.
    start, last : int or None
        Stamp of the set that came in last, and its latest one.
    current : int or None
        Stamp of the message before, 0 for none; None after a pause, or if one was missed since.
    side : int
        0 or 1 by turns: where that set is held, so that it leaves the one before alone.
    is_whole : bool
        Whether that set is whole; late messages may join it all the same.
    is_cut : bool
        Whether the window has cut that set off from the one before.
    number : int
        How many sets there have been.

    """

    def __init__(self) -> None:
        self.window = 0
        self.timeout: float = NEVER
        self.number = 0
        self.side = 0
        self.clear()

    def clear(self) -> None:
        """Forget all sets, and count none that may have begun before now."""
        self.start: int | None = None
        self.last: int | None = None
        self.is_whole = True
        self.is_cut = False
        self.miss()

    def miss(self) -> None:
        """Take note that something may have been missed: whatever is coming in does not count."""
        self.current: int | None = None
        self._counts_from: float = NEVER

    def settle(self) -> None:
        """Take note of a pause: whatever begins from now on is seen from its beginning."""
        self.current = None
        self._counts_from = self.number + 1

    @property
    def counts(self) -> bool:
        """Whether nothing of the set that came in last was missed."""
        return self.number >= self._counts_from

    def continues(self, stamp: int) -> bool:
        """
        Tell whether a message belongs to the set that came in last.

        A stamp before the set by less than the timeout is that of a late message, which joins it.
        One still earlier says that the publisher's clock was set back, as does any earlier one
        where nothing times out: a new set begins, or the old ones would stay for ever.
        """
        if self.start is None:
            return False
        ahead = stamp - self.start
        late = self.timeout != NEVER and -self.timeout < ahead < 0
        return late or abs(ahead) <= self.window

    def includes(self, stamp: int) -> bool:
        """Tell whether a stamp is that of the set that came in last, not of one before."""
        return self.start is not None and abs(stamp - self.start) <= self.window

    def begin(self, stamp: int) -> None:
        """Begin a set, on the other side than the one before, which must be whole."""
        # A pause ends a set: one that begins before the window's length has passed was cut off.
        self.is_cut = self.last is not None and 0 < stamp - self.last < self.window
        self.start = self.last = stamp
        self.side = 1 - self.side
        self.is_whole = False
        self.number += 1
        self._follow(stamp)

    def join(self, stamp: int) -> None:
        """Let a message join what is coming in; without a stamp, one begins it after a pause."""
        if stamp == 0:
            self.number += self.current is None
        elif self.last is None or stamp > self.last:
            self.last = stamp
        self._follow(stamp)

    def _follow(self, stamp: int) -> None:
        if self._counts_from == NEVER:
            self.settle()
        self.current = stamp

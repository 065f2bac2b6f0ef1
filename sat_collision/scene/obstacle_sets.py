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

"""Which message is which obstacle, of a source that publishes sets, and when a set is whole."""

from __future__ import annotations

from sat_collision.scene.deadlines import NEVER


class ObstacleSets:
    """
    The sets of a source, by their stamps.

    A set is the messages whose stamps lie within a window of the set's first. The k-th message is
    the k-th obstacle of its set: its *place* is k. While a set comes in it only adds to what the
    last whole set held, on the other of two *sides*. It is whole when a message of a later set
    comes, when an empty polygon with its stamp says so, or when nothing of it came for a while. So
    nothing is forgotten before it is known what takes its place, and the order of the messages of
    a set means nothing.

    Attributes
    ----------
    window : int
        How far from a set's first stamp those of its messages lie, in ns.
    timeout : int or float
        Age in ns past which the source's messages are refused, or NEVER.
    most : int
        The number of places of a set; all further messages share one more.
    start : int or None
        Stamp of the set that came in last.
    side : int
        The side of that set, 0 or 1.
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
        self.most = 0
        self.number = 0
        self.side = 0
        self.clear()

    def clear(self) -> None:
        """Forget all sets; the next one is on the other side all the same."""
        self.start: int | None = None
        self.is_whole = True
        self.is_cut = False
        self._last = 0
        self._taken = 0
        self._seen: dict[float, int] = {}

    def continues(self, stamp: int) -> bool:
        """
        Tell whether a message belongs to the set that came in last, and let it join if so.

        A stamp before the set by less than the timeout is that of a late message, which joins it.
        One still earlier says that the publisher's clock was set back, as does any earlier one
        where nothing times out: a new set begins, or the old ones would stay for ever.
        """
        if self.start is None:
            return False
        ahead = stamp - self.start
        late = self.timeout != NEVER and -self.timeout < ahead < 0
        if not late and abs(ahead) > self.window:
            return False
        if stamp > self._last:
            self._last = stamp
        return True

    def includes(self, stamp: int) -> bool:
        """Tell whether a stamp is that of the set that came in last, not of one before."""
        return self.start is not None and abs(stamp - self.start) <= self.window

    def begin(self, stamp: int) -> None:
        """Begin a set, on the other side than the one before, which must be whole."""
        # A pause ends a set: one that begins before the window's length has passed was cut off.
        self.is_cut = self.start is not None and 0 < stamp - self._last < self.window
        self.start = self._last = stamp
        self.side = 1 - self.side
        self.is_whole = False
        self.number += 1
        self._taken = 0
        self._seen.clear()

    def place_of_equal(self, fingerprint: float) -> int | None:
        """Return the place in this set of what has this fingerprint, None if nothing has."""
        return self._seen.get(fingerprint)

    def next_place(self, fingerprint: float | None = None) -> int:
        """Return the next place in the set, or `most` if it is full, and who takes it."""
        place = self._taken
        if place >= self.most:
            place = self.most
        elif fingerprint is not None:
            self._seen[fingerprint] = place
        self._taken = place + 1
        return place

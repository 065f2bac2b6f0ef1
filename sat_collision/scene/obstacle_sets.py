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

"""Which message is which obstacle, of a source that publishes sets."""

from __future__ import annotations

from sat_collision.scene.deadlines import NEVER


class ObstacleSets:
    """
    The sets of a source, by their stamps.

    A set is the messages whose stamps lie within a window of the set's first. The k-th message is
    the k-th obstacle of its set: its *place* is k. It replaces the k-th of the set before; what a
    set leaves over stays until the next one begins. So nothing blinks to empty while a set comes
    in, and the error is a ghost for one set.

    Attributes
    ----------
    window : int
        How far from a set's first stamp those of its messages lie, in ns.
    timeout : int or float
        Age in ns past which the source's messages are refused, or NEVER.
    most : int
        The number of places of a set; all further messages share one more.
    start : int or None
        Stamp of the set that is coming in.

    """

    def __init__(self) -> None:
        self.window = 0
        self.timeout: float = NEVER
        self.most = 0
        self.clear()

    def clear(self) -> None:
        """Forget all sets."""
        self.start: int | None = None
        self._taken = 0
        self._used = 0
        self._seen: dict[float, int] = {}

    def join(self, stamp: int) -> range:
        """
        Let a message join the set that is coming in, or begin the next one.

        A stamp before the set by less than the timeout is that of a late message, which joins it.
        One still earlier says that the publisher's clock was set back, as does any earlier one
        where nothing times out: a new set begins, or the old ones would stay for ever.

        Returns
        -------
        range
            The places that the set before has left over, to be forgotten now.

        """
        if self.start is not None:
            ahead = stamp - self.start
            late = self.timeout != NEVER and -self.timeout < ahead < 0
            if late or abs(ahead) <= self.window:
                return range(0)
        left_over = range(self._taken, self._used)
        self._used = self._taken
        self._taken = 0
        self._seen.clear()
        self.start = stamp
        return left_over

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

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

"""The recent history of one frame that moves in another."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import TypeAlias

from sat_collision.scene.rotations import fixed, FixedTransform, interpolated, Transform

# The parent frame, and the transform to it.
Link: TypeAlias = tuple[str, Transform]


class Track:
    """
    Transforms of a frame by their stamps, with the meaning that tf2's TimeCache gives them.

    Where several have one stamp the last one counts, from then on; what lies before leads to the
    first one. Times are ints in ns.

    Attributes
    ----------
    stamps : list of int
        Ascending, never empty; none more than twice.
    links : list of Link
        One for each stamp.

    """

    __slots__ = ('stamps', 'links')

    def __init__(self, stamp: int, link: Link) -> None:
        self.stamps = [stamp]
        self.links = [link]

    def extend(self, stamp: int, link: Link, history: int) -> bool:
        """
        Add a transform newer than all others.

        Parameters
        ----------
        stamp : int
        link : Link
        history : int
            What was older than this before the newest one until now is forgotten, as in tf2.

        Returns
        -------
        bool
            False if it is not newer, and nothing was done.

        """
        stamps = self.stamps
        if stamp <= stamps[-1]:
            return False
        self._prune(history)
        stamps.append(stamp)
        self.links.append(link)
        return True

    def insert(self, stamp: int, link: Link, history: int) -> bool:
        """
        Add a transform that is not newer than all others, forgetting as `extend` does.

        Returns
        -------
        bool
            False if it is too old to be taken.

        """
        stamps, links = self.stamps, self.links
        self._prune(history)
        if stamp < stamps[-1] - history:
            return False
        place = bisect_right(stamps, stamp)
        first = bisect_left(stamps, stamp)
        if link not in links[first:place]:
            if place - first == 2:
                links[place - 1] = link
            else:
                stamps.insert(place, stamp)
                links.insert(place, link)
        return True

    def _prune(self, history: int) -> None:
        """Forget what is older than the newest by more than the history."""
        stamps = self.stamps
        oldest = stamps[-1] - history
        if stamps[0] < oldest:
            passed = bisect_left(stamps, oldest)
            del stamps[:passed], self.links[:passed]

    def at(self, stamp: int, max_gap: float) -> tuple[str, FixedTransform] | None:
        """
        Return the parent and the transform at a time.

        Between two stamps it is interpolated; where the parent changed between them it is the
        older one, as in tf2.

        Parameters
        ----------
        stamp : int
        max_gap : float
            How far apart the two stamps may be.

        Returns
        -------
        str, FixedTransform or None
            None outside the history, and in a gap.

        """
        stamps = self.stamps
        place = bisect_right(stamps, stamp)
        if place == 0:
            return None
        before = stamps[place - 1]
        parent, older = self.links[place - 1]
        if before == stamp:
            return parent, fixed(older)
        if place == len(stamps) or stamps[place] - before > max_gap:
            return None
        next_parent, newer = self.links[place]
        if next_parent != parent:
            return parent, fixed(older)
        return parent, interpolated(older, newer, stamp - before, stamps[place] - before)

    def gap(self, stamp: int) -> int:
        """Return how far apart the stamps around a time within the history are."""
        place = bisect_right(self.stamps, stamp)
        return self.stamps[place] - self.stamps[place - 1]

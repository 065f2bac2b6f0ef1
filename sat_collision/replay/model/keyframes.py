# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where all bodies of a recording were at chosen moments, to be drawn."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]


class Span(NamedTuple):
    """A body at consecutive moments, from number `first` until before number `end`."""

    first: int
    end: int
    name: str
    ring: Floats  # (n, 2): where it is, or was last if that is not known
    known: bool


class ShownBody:
    """A footprint, or an obstacle, whose name may change."""

    def __init__(self, is_footprint: bool) -> None:
        self.is_footprint = is_footprint
        self.spans: list[Span] = []

    def show(self, first: int, end: int, name: str, ring: Floats, known: bool = True) -> None:
        """Show it at some moments, if it has not been shown at those or later ones."""
        last = self.spans[-1] if self.spans else None
        if last is not None:
            first = max(first, last.end)
        if first >= end:
            return
        if last is not None and (last.end, last.name, last.known) == (
                first, name, known) and np.array_equal(last.ring, ring):
            self.spans[-1] = last._replace(end=end)
        else:
            self.spans.append(Span(first, end, name, np.array(ring), known))

    def at(self, number: int) -> Span | None:
        """Return where it is at a moment, None if nowhere."""
        k = bisect_right(self.spans, number, key=attrgetter('first')) - 1
        return self.spans[k] if k >= 0 and number < self.spans[k].end else None


class Keyframes:
    """The bodies of a recording at chosen moments, in ns and in their order."""

    def __init__(self, moments: Sequence[int]) -> None:
        self.moments = list(moments)
        self.bodies: list[ShownBody] = []

    def add(self, is_footprint: bool = False) -> ShownBody:
        self.bodies.append(ShownBody(is_footprint))
        return self.bodies[-1]

    def number(self, time: int) -> int:
        """Return the number of the first moment that is not before a time."""
        return bisect_left(self.moments, time)

    def at(self, number: int) -> list[tuple[ShownBody, Span]]:
        """Return the bodies at a moment, and where they are."""
        found = ((body, body.at(number)) for body in self.bodies)
        return [(body, span) for body, span in found if span is not None]

    def footprint(self, name: str) -> ShownBody | None:
        """Return a footprint, None if it was never seen."""
        return next((body for body in self.bodies
                     if body.is_footprint and body.spans[0].name == name), None)

    def obstacle(self, name: str, time: int, x: float, y: float) -> ShownBody | None:
        """
        Return the obstacle that has a name at a moment.

        As live, an obstacle of the set being received may have the same name as one of the set
        before: then the one at (x, y) is returned.
        """
        place = np.array([x, y])
        found = [(body, span.ring) for body, span in self.at(self.number(time))
                 if span.name == name and not body.is_footprint]
        return min(found, default=(None, None), key=lambda one: float(np.max(np.maximum(
            one[1].min(axis=0) - place, place - one[1].max(axis=0)))))[0]

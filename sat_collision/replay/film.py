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

"""Where all bodies of a recording were at chosen moments, to be drawn."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from sat_collision.replay.result import Contact, Result
from sat_collision.scene.scene import Scene

Floats: TypeAlias = NDArray[np.float64]
# Name of a body, whether it is a footprint, and which one of this name; then where it is.
_Key: TypeAlias = tuple[str, bool, int]
_Place: TypeAlias = tuple[_Key, Floats]

_SECOND = 10**9
# How many moments there are in all, around a contact, and of how many contacts, the deepest.
_MOMENTS = 400
_AROUND = 40
_MOST_AROUND = 20
MOST_CONTACTS = 200


class Span(NamedTuple):
    """
    A body at consecutive moments, from number `first` until before number `end`.

    `ring` (n, 2) is where it is, or, where that is not `known`, was last; `name` what it is called
    then.
    """

    first: int
    end: int
    name: str
    ring: Floats
    known: bool


class FilmedBody:
    """A footprint, or an obstacle, which may have another name at another time."""

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


class Film:
    """
    The bodies of a recording at chosen moments.

    Parameters
    ----------
    moments : sequence of int
        In ns, in their order.

    Attributes
    ----------
    moments : list of int
    bodies : list of FilmedBody

    """

    def __init__(self, moments: Sequence[int]) -> None:
        self.moments = list(moments)
        self.bodies: list[FilmedBody] = []
        self._held: dict[_Key, FilmedBody] = {}
        self._taken = 0
        self._kept: tuple[int, float, list[_Place]] | None = None

    def add(self, is_footprint: bool = False) -> FilmedBody:
        """Return a new body."""
        self.bodies.append(FilmedBody(is_footprint))
        return self.bodies[-1]

    def number(self, time: int) -> int:
        """Return the number of the first moment that is not before a time."""
        return bisect_left(self.moments, time)

    def nearest(self, time: int) -> int:
        """Return the number of the moment that is nearest to a time."""
        return min(range(len(self.moments)), key=lambda k: abs(self.moments[k] - time))

    def at(self, number: int) -> list[tuple[FilmedBody, Span]]:
        """Return the bodies at a moment, and where they are."""
        found = ((body, body.at(number)) for body in self.bodies)
        return [(body, span) for body, span in found if span is not None]

    def footprint(self, name: str) -> FilmedBody | None:
        """Return a footprint, None if it was never seen."""
        return next((body for body in self.bodies
                     if body.is_footprint and body.spans[0].name == name), None)

    def obstacle(self, contact: Contact) -> FilmedBody | None:
        """Return the obstacle of a contact: the one that was where they overlapped most."""
        number = self.number(contact.deepest)
        own = self.footprint(contact.footprint)
        place = None if own is None else own.at(number)
        if place is None:
            return None
        ring = place.ring

        def strangeness(found: tuple[FilmedBody, Span]) -> tuple[float, bool]:
            x, y = _middle_of_overlap(ring, found[1].ring)
            return abs(x - contact.x) + abs(y - contact.y), found[1].name != contact.obstacle

        others = [one for one in self.at(number) if not one[0].is_footprint]
        return min(others, key=strangeness)[0] if others else None

    def keep(self, scene: Scene, now: int, depth: float) -> None:
        """Keep a scene in a contact, whatever else comes at the same time; the deepest counts."""
        if self._kept is None or self._kept[0] != now or depth > self._kept[1]:
            self._kept = now, depth, _places(scene)

    def take(self, scene: Scene, now: int) -> None:
        """Take a scene as it is, for all moments until now that are left."""
        number = bisect_right(self.moments, now)
        kept = self._kept
        for key, ring in kept[2] if kept and kept[0] == now else _places(scene):
            if key not in self._held:
                self._held[key] = self.add(key[1])
            self._held[key].show(self._taken, number, key[0], ring)
        self._taken = number


def moments_of(result: Result) -> list[int]:
    """
    Return the moments of a result that are worth drawing, in ns.

    They are spread over the recording, denser around the deepest contacts, and have the beginning
    and the deepest moment of each of the deepest contacts and every least separation.
    """
    if result.start is None or result.end is None:
        return []
    known = [time for footprint in result.footprints for time, value in footprint.separation
             if value is not None]
    start, end = min(known, default=result.start), max(known, default=result.end)
    moments = _spread(start, end, _MOMENTS)
    contacts = deepest_contacts(result)
    for contact in contacts[:_MOST_AROUND]:
        first, last = max(contact.first - _SECOND, start), min(contact.last + _SECOND, end)
        if last - first < _AROUND * (end - start) / _MOMENTS:
            moments |= _spread(first, last, _AROUND)
    moments.update(time for contact in contacts for time in (contact.first, contact.deepest))
    moments.update(footprint.least.time for footprint in result.footprints if footprint.least)
    return sorted(moments)


def deepest_contacts(result: Result) -> list[Contact]:
    """Return the contacts of a result, the deepest first; not more than are drawn."""
    return sorted(result.contacts, key=lambda contact: -contact.depth)[:MOST_CONTACTS]


def _spread(first: int, last: int, count: int) -> set[int]:
    return {first + (last - first) * k // (count - 1) for k in range(count)}


def _places(scene: Scene) -> list[_Place]:
    """Return where all is; while a set comes in, two obstacles may have the same name."""
    places: list[_Place] = []
    told: Counter[tuple[str, bool]] = Counter()
    for is_footprint, bodies in ((True, scene.footprints), (False, scene.obstacles)):
        for name, polygon in bodies:
            key = str(name), is_footprint
            places.append(((*key, told[key]), np.array(polygon.vertices)))
            told[key] += 1
    return places


def _middle_of_overlap(ring: Floats, other: Floats) -> list[float]:
    low = np.maximum(ring.min(axis=0), other.min(axis=0))
    high = np.minimum(ring.max(axis=0), other.max(axis=0))
    middle: list[float] = ((low + high) / 2).tolist()
    return middle

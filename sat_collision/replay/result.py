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

"""What a check of a recording finds, and the verdict on it. All times are ints in ns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from sat_collision.geometry.polygon import Polygon
from sat_collision.replay.verdict import Verdict

if TYPE_CHECKING:
    from sat_collision.replay.film import Film

# How a contact or a separation was found.
AT_A_FRAME = 'at a frame'
BETWEEN_FRAMES = 'between frames'
AT_A_MESSAGE = 'at a message'


# From the least grave verdict to the gravest.
GRAVITY = (Verdict.CLEAR, Verdict.UNKNOWN, Verdict.BAD_INPUT, Verdict.COLLISION)


@dataclass
class Contact:
    """
    A footprint and an obstacle share a point, from `first` until just before `last`.

    `found` says how: AT_A_MESSAGE as the monitor, of recorded motion AT_A_FRAME or only
    BETWEEN_FRAMES. `between` has the last time before and the first time after at which recorded
    motion has them apart, each None where it is not known. `depth` is the deepest penetration in
    m, at the time `deepest`: 0 if they only touch, negative if they were apart within the margin;
    (x, y) is the middle of where their bounds overlapped then. `at_end` says that they were still
    in contact at the end.
    """

    footprint: str
    obstacle: str
    first: int
    last: int
    depth: float = 0.0
    deepest: int = 0
    x: float = 0.0
    y: float = 0.0
    at_end: bool = False
    found: str = AT_A_MESSAGE
    between: list[int | None] = field(default_factory=lambda: [None, None])


@dataclass
class Unknown:
    """The state of a footprint is unknown from `first` until just before `last`."""

    footprint: str
    first: int
    last: int
    reasons: list[str]


@dataclass
class Least:
    """The least separation in m of a footprint, at a time, from an obstacle, at (x, y)."""

    separation: float
    time: int
    obstacle: str
    x: float
    y: float
    found: str = AT_A_MESSAGE


@dataclass
class FootprintResult:
    """
    How long (ns) a footprint was in each state, and how near the nearest obstacle was.

    `separation` has samples (time, separation in m or None), thinned out to their least where
    there are very many.
    """

    name: str
    topic: str
    enabled: bool
    clear: int = 0
    collision: int = 0
    unknown: int = 0
    ever_known: bool = False
    least: Least | None = None
    separation: list[tuple[int, float | None]] = field(default_factory=list)

    @property
    def coverage(self) -> float | None:
        """The share of the time in which the state was known, None if no time passed."""
        known = self.clear + self.collision
        return known / (known + self.unknown) if known + self.unknown else None


@dataclass
class SourceResult:
    """
    How many messages a footprint or source of obstacles had, and why some were rejected.

    `undecided` is for how long (ns) recorded motion does not know how something of it moved,
    because it was not known to be the same at both ends: only the ends were decided.
    """

    name: str
    topic: str
    received: int
    rejected: dict[str, int]
    examples: dict[str, str]
    undecided: int = 0


@dataclass
class Result:
    """
    What was found in one recording.

    `as_live` tells which question is answered: what the monitor would have said, or what touched.
    `origin` is when the recording begins, `start` what part of it was checked. `problems` say
    what is wrong with the recording, `notes` what else a reader should know.
    `film` has the bodies at moments worth drawing, if that was asked for. `content` is what the
    messages are known by, wherever they lie. `max_undecided` is for how long (s) the motion of
    each footprint and source may be undecided, None for any time.
    """

    bag: str
    clock: str
    max_unknown: float
    as_live: bool = False
    origin: int | None = None
    start: int | None = None
    end: int | None = None
    content: str | None = None
    footprints: list[FootprintResult] = field(default_factory=list)
    sources: list[SourceResult] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    unknown: list[Unknown] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    film: Film | None = None
    max_undecided: float | None = None

    @property
    def duration(self) -> float:
        """The time checked, in s."""
        if self.start is None or self.end is None:
            return 0.0
        return (self.end - self.start) / 1e9

    def since(self, time: int) -> float:
        """Return a time in s since the recording begins."""
        return 0.0 if self.origin is None else (time - self.origin) / 1e9

    @property
    def messages(self) -> int:
        return sum(source.received for source in self.sources)

    @property
    def least(self) -> Least | None:
        """The least separation of any footprint, None if none was found."""
        found = [footprint.least for footprint in self.footprints if footprint.least]
        return min(found, key=lambda least: least.separation, default=None)

    @property
    def too_undecided(self) -> list[SourceResult]:
        """Those of which it is not known for too long how something moved."""
        if self.max_undecided is None:
            return []
        most = 1e9 * self.max_undecided
        return [source for source in self.sources if source.undecided > most]

    @property
    def verdict(self) -> Verdict:
        """The verdict: a proved contact counts whatever else is wrong."""
        if self.contacts:
            return Verdict.COLLISION
        if self.problems:
            return Verdict.BAD_INPUT
        watched = [footprint for footprint in self.footprints if footprint.enabled]
        if not watched or not all(footprint.ever_known for footprint in watched) or any(
                footprint.unknown > 1e9 * self.max_unknown for footprint in watched) or (
                    self.too_undecided):
            return Verdict.UNKNOWN
        return Verdict.CLEAR


def middle_of_overlap(body: Polygon, other: Polygon) -> tuple[float, float]:
    """Return the middle of where the bounds of two bodies in contact overlap."""
    a, b = body.bounds, other.bounds
    return ((max(a[0], b[0]) + min(a[2], b[2])) / 2, (max(a[1], b[1]) + min(a[3], b[3])) / 2)


def overall(results: Iterable[Result]) -> Verdict:
    """Return the verdict on several recordings: the gravest one."""
    return max((result.verdict for result in results), key=GRAVITY.index,
               default=Verdict.BAD_INPUT)

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

"""Where and when a footprint on its way touches what a source of obstacles tells of."""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import NamedTuple

import numpy as np
from sat_collision.geometry.polygon import Polygon, PolygonError
from sat_collision.geometry.query import separation
from sat_collision.geometry.sweep import time_of_contact
from sat_collision.replay.motion.bodies import Bodies, Floats, Ways
from sat_collision.replay.motion.findings import Findings
from sat_collision.replay.motion.rings import box_gaps
from sat_collision.replay.motion.tracks import Track
from sat_collision.replay.result import AT_A_FRAME, Contact
from sat_collision.scene.obstacles import ObstacleId

# What rounding may take from a separation or add to a way, in parts of the largest coordinate.
_SLACK = 1e-12


class Step(NamedTuple):
    """
    What a source tells of the time from one moment to the next.

    Attributes
    ----------
    ways : list of Ways
        The bodies that are known to be the same at both.
    seen : Bodies or None
        All that was seen at the later one, None if nothing was.
    gone : sequence of ObstacleId or None
        Names of those that are there no longer; None for all that was not seen.
    finish : int
        The last time that it tells of, ns.

    """

    ways: list[Ways]
    seen: Bodies | None
    gone: Sequence[ObstacleId] | None
    finish: int


class Encounters:
    """
    Follows the contacts of one footprint with the obstacles of one source.

    Parameters
    ----------
    track : Track
        Of the footprint.
    findings : Findings
        What is found goes there.
    margin : float
        Metres up to which bodies apart count as in contact.

    Attributes
    ----------
    decided : bool
        Whether footprint and source were ever known at the same time.
    undecided : int
        For how long a body had no outline on its way, ns.

    """

    def __init__(self, track: Track, findings: Findings, margin: float) -> None:
        self.decided = False
        self.undecided = 0
        self._track = track
        self._series = findings.series()
        self._findings = findings
        self._margin = margin
        self._touching: dict[ObstacleId, Contact] = {}

    def decide(self, step: Step) -> None:
        """Decide a step; the footprint's way through it must be known, as far as it ever is."""
        stamps = step.seen.stamps if step.seen is not None else ()
        followed: dict[ObstacleId, Contact] = {}
        for ways in step.ways:
            self._follow(ways, followed, stamps)
        if step.gone is None:
            before, self._touching = self._touching, followed
        else:
            before = self._touching
            before.update(followed)
        if step.seen is not None:
            touching = self._look(step.seen, before)
            if step.gone is None:
                self._touching = touching
            else:
                for name in step.seen.names:
                    self._touching.pop(name, None)
                self._touching.update(touching)
        for name in step.gone or ():
            self._touching.pop(name, None)

    def finish(self) -> None:
        """Take note of the contacts that last to the end."""
        for contact in self._touching.values():
            contact.at_end = True

    def _look(self, seen: Bodies, before: dict[ObstacleId, Contact]) -> dict[ObstacleId, Contact]:
        """Decide a moment: return what touches, and note how deep, and what is nearest."""
        touching: dict[ObstacleId, Contact] = {}
        box = self._track.bounds(min(seen.stamps), max(seen.stamps)) if len(seen) else None
        if box is None:
            return touching
        self.decided = True
        least: tuple[float, int] | None = None
        for row, gap in _by_gap(box, seen.boxes):
            if gap > self._margin and least is not None and gap > least[0]:
                break
            time, name = seen.stamps[row], seen.names[row]
            outline = self._track.outline(time)
            if outline is None:
                continue
            value = separation(outline, seen.polygon(row))
            if value <= self._margin:
                contact = self._touching.get(name) or before.get(name) or (
                    self._findings.begin(name, time))
                touching[name] = contact
                contact.last = time
                contact.found = AT_A_FRAME
                self._findings.deepen(contact, 0.0 - value, time, outline, seen.polygon(row))
            if least is None or value < least[0]:
                least = value, row
        if least:
            value, row = least
            self._series.add(seen.stamps[row], value)
            self._findings.measure(seen.names[row], seen.stamps[row], value, seen.polygon(row))
        return touching

    def _follow(self, ways: Ways, followed: dict[ObstacleId, Contact],
                seen: Container[int]) -> None:
        """Decide the ways of bodies that are known; put what touches at their ends to the rest."""
        start, finish = min(ways.starts), max(ways.finishes)
        box = self._track.bounds(start, finish)
        names = ways.before.names
        near = set() if box is None else set(np.flatnonzero(
            box_gaps(box, ways.boxes) <= self._margin).tolist())
        if self._touching:
            for i, row in enumerate(ways.rows):
                if names[row] in self._touching and i not in near:
                    del self._touching[names[row]]
        if box is None:
            return
        self.decided = True
        for i in sorted(near):
            contact = self._touching.pop(names[ways.rows[i]], None)
            for begin, end, piece in self._track.pieces(ways.starts[i], ways.finishes[i]):
                if contact is not None and contact.last != begin:
                    contact = None
                try:
                    contact = self._cross(_Pair(piece, ways, i, begin, end), contact)
                except PolygonError:
                    contact = None
                    self.undecided += end - begin
            if contact is not None:
                followed[ways.after.names[ways.next_rows[i]]] = contact
        self._look_at_still(ways, start, finish, seen)

    def _look_at_still(self, ways: Ways, start: int, finish: int, seen: Container[int]) -> None:
        """Find what is nearest of all that does not move, at the frames of the footprint."""
        times = [time for time in self._track.frames(start, finish) if time not in seen]
        if not times:
            return
        still = np.flatnonzero(np.array(ways.moved) == 0.0)
        boxes = ways.boxes[still]
        rows = still.tolist()
        for time in times:
            outline = self._track.outline(time)
            if outline is None:
                continue
            least = None
            for k, gap in _by_gap(np.array(outline.bounds), boxes):
                if least is not None and gap > least[0]:
                    break
                i = rows[k]
                if ways.starts[i] <= time <= ways.finishes[i]:
                    value = separation(outline, ways.polygon(i, time))
                    if least is None or value < least[0]:
                        least = value, ways.rows[i]
            if least:
                value, row = least
                self._findings.measure(ways.before.names[row], time, value,
                                       ways.before.polygon(row))
                if len(rows) == len(ways.before):
                    self._series.add(time, value)

    def _cross(self, pair: _Pair, contact: Contact | None) -> Contact | None:
        """Decide a piece of the way of a pair; return the contact in which it ends, if in one."""
        own, other = pair.at(pair.end)
        value = separation(own, other)
        touches = value <= self._margin
        if contact is None:
            if pair.begin == pair.end:
                first: int | None = pair.begin if touches else None
            else:
                first = self._first(pair)
            if first is None:
                if not touches:
                    return None
                first = pair.end
            contact = self._findings.begin(pair.name, first)
            contact.between[0] = pair.begin if first > pair.begin else None
        if touches:
            contact.last = pair.end
            if pair.ends_at_a_frame:
                contact.found = AT_A_FRAME
            self._findings.deepen(contact, 0.0 - value, pair.end, own, other)
            return contact
        last = self._first(pair.backwards())
        begun = max(contact.first, pair.begin)
        contact.last = begun if last is None else max(begun, last)
        contact.between[1] = pair.end
        middle = (begun + contact.last) // 2
        own, other = pair.at(middle)
        depth = 0.0 - separation(own, other)
        # Nearer than the sweep can tell from contact is no depth.
        self._findings.deepen(contact, max(depth, 0.0 - self._margin), middle, own, other)
        return None

    def _first(self, pair: _Pair) -> int | None:
        """Return when a pair first touches on a piece of its way."""
        own, other = pair.at(pair.begin)
        value = separation(own, other)
        if value <= self._margin:
            return pair.begin
        if value - self._margin > pair.most_motion():
            return None
        share = time_of_contact(*pair.rings(), margin=self._margin)
        return None if share is None else pair.begin + round(share * (pair.end - pair.begin))


class _Pair(NamedTuple):
    """A footprint and an obstacle from one time to another, both on straight ways; or back."""

    piece: Ways
    ways: Ways
    i: int
    begin: int
    end: int

    @property
    def name(self) -> ObstacleId:
        return self.ways.before.names[self.ways.rows[self.i]]

    @property
    def ends_at_a_frame(self) -> bool:
        """Whether the footprint has a frame at the end, and the other does not move."""
        return (self.end == self.piece.finishes[0] and not self.piece.after.is_between
                and not self.ways.moved[self.i])

    def backwards(self) -> _Pair:
        return self._replace(begin=self.end, end=self.begin)

    def at(self, time: int) -> tuple[Polygon, Polygon]:
        return self.piece.polygon(0, time), self.ways.polygon(self.i, time)

    def rings(self) -> tuple[Floats, Floats, Floats, Floats]:
        return (self.piece.ring(0, self.begin), self.piece.ring(0, self.end),
                self.ways.ring(self.i, self.begin), self.ways.ring(self.i, self.end))

    def most_motion(self) -> float:
        """Return how far the two can come towards each other, metres."""
        both = (self.piece, 0), (self.ways, self.i)
        passed = abs(self.end - self.begin)
        motion = 0.0
        for ways, i in both:
            motion += ways.moved[i] * passed / max(ways.finishes[i] - ways.starts[i], 1)
        largest: float = max(np.abs(ways.boxes[i]).max() for ways, i in both)
        return motion * (1.0 + _SLACK) + _SLACK * largest


def _by_gap(box: Floats, boxes: Floats) -> list[tuple[int, float]]:
    """Return which boxes are how far from one, the nearest first."""
    gaps = box_gaps(box, boxes)
    order = np.argsort(gaps, kind='stable')
    return list(zip(order.tolist(), gaps[order].tolist()))

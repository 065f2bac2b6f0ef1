# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Match the bodies of a source from one message to the next: by id, by shape, or set by set.

Which messages are one set, and which sets are whole, is what the live knowledge found: placements
have the numbers of listings. A tracker turns the placements of a source into steps, each from one
moment at which bodies were received to the next. A body that is not received again stands still
until it times out, unless it is known to move.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass
from itertools import chain, compress, count, repeat, takewhile
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from sat_collision.messages.ingest import Placement
from sat_collision.replay.motion.bodies import (
    Block, Bodies, LinearMotion, LONGEST, motion_between, motion_in_block, stay)
from sat_collision.replay.motion.kernels import COUNT, MOVED, mutual_nearest
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import NEVER, ObstacleSettings

# Bodies known by id or shape are processed together if stamped within this of the first, ns.
_TOGETHER = 10**8
# So many shapes are remembered though their bodies are gone.
_MAX_FORGOTTEN = 1000


@dataclass(slots=True)
class Step:
    """The motion of a source's bodies from one moment to the next."""

    made: list[LinearMotion]  # the motions computed so far
    seen: Bodies | None  # received at the later moment, None if nothing was
    gone: Sequence[ObstacleId] | None  # no longer there; None for all that are not in `seen`
    finish: int  # the end of the step, ns
    # The set before `seen` in the same block, if the step has no motion but that between the two:
    # it is then computed on first use.
    last: Bodies | None = None

    @property
    def motions(self) -> list[LinearMotion]:
        """The motions of the bodies that are matched from one moment to the other."""
        if self.last is not None and self.seen is not None and not self.made:
            self.made = motion_in_block(self.last, self.seen)
        return self.made

    def __reduce__(self) -> tuple[Any, ...]:
        return Step, (self.motions, self.seen, self.gone, self.finish)

    @property
    def frame_id(self) -> str:
        """The frame of its bodies, empty if there is none."""
        bodies = [motion.before for motion in self.motions] if self.seen is None else [self.seen]
        return bodies[0].frame_id if bodies else ''


# A set, and how many messages it was made from.
Described: TypeAlias = tuple[Bodies, int]
Emit: TypeAlias = 'Callable[[Tracker, Step], None]'


class Tracker(ABC):
    """Follows the bodies of a source."""

    def __init__(self, settings: ObstacleSettings, max_vertices: int, emit: Emit) -> None:
        # For how long the motion of some body was not known, ns.
        self.undetermined = 0
        self._source = settings.name
        self._timeout = round(settings.timeout * 1e9) or NEVER
        self._longest = round(min(self._timeout, LONGEST))
        self._max_vertices = max_vertices
        self._emit = emit
        self._frame_id = ''

    def describe(self, placements: Sequence[Placement]) -> Iterable[Described | None]:
        """Return for each placement about to be placed the set that begins with it, if any."""
        return repeat(None)

    @abstractmethod
    def place(self, placement: Placement, described: Described | None = None) -> None:
        """
        Process a placement; one without points ends the publisher's set.

        `described` is the set that begins with it, if that was described before.
        """

    @abstractmethod
    def rest(self, now: int, is_over: bool = False) -> None:
        """Extend bodies not received for long, or all if the recording is over, standing still."""

    def use_frame(self, frame_id: str) -> None:
        """Set the current frame, and drop bodies in other frames."""
        self._frame_id = frame_id

    def _bodies(self, names: Sequence[ObstacleId], placements: Sequence[Placement],
                block: Block, number: int = 0) -> Bodies:
        """Return the received bodies of a block; there may be more names than bodies."""
        frames = {one.frame_id for one in placements}
        frame_id = frames.pop() if len(frames) == 1 else ''
        return Bodies(names, block, number, self._max_vertices, frame_id)

    def _is_usable(self, placement: Placement) -> bool:
        """Return whether a placement is in the current frame, if there is one yet."""
        return not self._frame_id or placement.frame_id == self._frame_id


class SetTracker(Tracker):
    """
    Follows a source that publishes sets, each a listing.

    The order of bodies may differ from set to set, so bodies of two sets are matched if they are
    nearest to each other and have equally many vertices.
    """

    def __init__(self, settings: ObstacleSettings, max_vertices: int, emit: Emit) -> None:
        super().__init__(settings, max_vertices, emit)
        # The number of the set that is being received, 0 if none is, and its first stamp.
        self._listing = self._start = 0
        self._pending: list[Placement] = []
        self._described: Described | None = None
        self._names: list[ObstacleId] = []
        # The last set as far as it has stood, the same as received, and the rows not timed out.
        self._last: Bodies | None = None
        self._seen: Bodies | None = None
        self._last_stamp = 0
        self._alive: Sequence[int] = ()

    def describe(self, placements: Sequence[Placement]) -> Iterable[Described | None]:
        sets: list[list[Placement]] = []
        begins = []
        listing = 0
        for placement in placements:
            begins.append(placement.listing != listing)
            if placement.listing != listing:
                listing = placement.listing
                sets.append([])
            if not placement.is_empty:
                sets[-1].append(placement)
        block = Block(sets, self._longest)
        found = ((self._set(one, block, k), len(one)) for k, one in enumerate(sets))
        return [next(found) if is_first else None for is_first in begins]

    def place(self, placement: Placement, described: Described | None = None) -> None:
        if placement.listing != self._listing:
            self._close()
            self._listing, self._start = placement.listing, placement.stamp
            self._described = described
        if not placement.is_empty:
            self._pending.append(placement)
        if placement.listing == placement.last_whole:
            self._close()

    def use_frame(self, frame_id: str) -> None:
        super().use_frame(frame_id)
        if self._last is not None and self._last.frame_id != frame_id:
            self._last = None

    def rest(self, now: int, is_over: bool = False) -> None:
        if self._listing and (is_over or now > self._start + self._longest):
            self._close()
        last, seen = self._last, self._seen
        # Whether bodies are received again is only known when the next set has ended.
        if self._listing or last is None or seen is None or not self._alive or not (
                is_over or now > self._last_stamp + self._longest):
            return
        alive, moving = self._alive, last.moving
        stamps, seen_at = last.stamps.tolist(), seen.stamps.tolist()
        ends = {row: min(now, seen_at[row] + self._timeout) for row in alive}
        until = {row: round(end) for row, end in ends.items()
                 if not moving[row] and end > stamps[row]}
        self.undetermined += max([0, *(round(ends[row]) - self._last_stamp
                                       for row in alive if row not in until)])
        left = dict.fromkeys(row for row in until if seen_at[row] + self._timeout > now)
        self._emit(self, Step([stay(last, until)] if until else [], None,
                              [last.names[row] for row in alive if row not in left],
                              max(until.values(), default=self._last_stamp)))
        self._alive = [*left]
        self._last = last.at([now if row in left else stamp for row, stamp in enumerate(stamps)])
        self._last_stamp = now

    def _close(self) -> None:
        """End the set that is being received, and match the bodies of the one before to it."""
        if not self._listing:
            return
        self._listing = 0
        seen = self._take_set()
        stamp = seen.begin or self._start
        last, last_seen = self._last, self._seen
        motions: list[LinearMotion] = []
        until: dict[int, int] = {}
        is_in_block = False
        if last is not None and last_seen is not None:
            is_in_block = seen.follows(last)
            if not is_in_block:
                motions = self._follow(last, seen)
            found = seen.followed if is_in_block else sum(map(len, motions))
            is_lost = found < len(last)
            if is_lost:
                if is_in_block:
                    motions = motion_in_block(last, seen)
                lost = {*self._alive}.difference(*(motion.rows.tolist() for motion in motions))
                moving = last.moving
                # Bodies that timed out before this set stood until then.
                for row in sorted(lost):
                    end = int(last_seen.stamps[row]) + self._timeout
                    if not moving[row] and last.stamps[row] < end < stamp:
                        until[row] = round(end)
                if until:
                    motions.append(stay(last, until))
                is_lost = len(until) < len(lost)
            if found < len(seen) or is_lost:
                self.undetermined += min(max(stamp - self._last_stamp, 0), self._longest)
        self._emit(self, Step(motions, seen, None, max(stamp, seen.end, *until.values()),
                              last if is_in_block and not until else None))
        self._last, self._seen, self._last_stamp = seen, seen, stamp
        self._alive = range(len(seen))

    def _take_set(self) -> Bodies:
        """Return the received set; of identical bodies the last message counts."""
        pending, self._pending = self._pending, []
        described = self._described
        if described and described[1] == len(pending):
            seen = described[0]
        else:
            seen = self._set(pending, Block([pending]))
        if seen.may_repeat or not all(map(self._is_usable, pending)):
            shapes = {}
            for one in chain.from_iterable(placement.each() for placement in pending):
                shapes[one.shape, one.affine] = one
            usable = [*map(self._is_usable, shapes.values())]
            pending = [*compress(shapes.values(), usable)]
            seen = self._bodies([*compress(self._names, usable)], pending, Block([pending]))
        return seen

    def _set(self, placements: Sequence[Placement], block: Block, number: int = 0) -> Bodies:
        bodies = self._bodies(self._names, placements, block, number)
        self._names += [ObstacleId(self._source, k) for k in range(len(self._names), len(bodies))]
        return bodies

    def _follow(self, last: Bodies, seen: Bodies) -> list[LinearMotion]:
        """Return the motion from one set to the next, nothing if no body was matched."""
        # In the block, MOVED is that of the motion from another set.
        seen.rings[:, MOVED] = 0
        rows, next_rows = np.empty((2, len(last)), np.int64)
        found = mutual_nearest(last.rings, last.boxes, seen.rings, seen.boxes, self._longest,
                               rows, next_rows)
        return [motion_between(last, seen, rows[:found], next_rows[:found])] if found else []


class _Sighting(NamedTuple):
    """A body in its group, its listing, when it was received, and until when it has stood."""

    bodies: Bodies
    row: int
    listing: int
    seen_at: int
    stamp: int


class KeyTracker(Tracker):
    """
    Follows bodies that have ids, or are known by shape and so stand still.

    In listings, as those of maps, a whole one replaces all bodies that are only in older ones.
    """

    def __init__(self, settings: ObstacleSettings, max_vertices: int, emit: Emit) -> None:
        super().__init__(settings, max_vertices, emit)
        # The bodies that are there, those that have stood for longest first.
        self._seen: dict[ObstacleId, _Sighting] = {}
        # The group of bodies that is being received.
        self._pending: dict[ObstacleId, Placement] = {}
        self._shapes: dict[tuple[bytes, object], ObstacleId] = {}
        self._numbers = count(1)
        self._first_stamp = self._rested = self._now = 0
        # Listing and stamp of the last message, if it has no listing the place among those of its
        # stamp; and the last whole listing.
        self._listing = self._stamp = self._place = self._whole = 0
        # The last stamp of the group before.
        self._closed_at: int | None = None

    def place(self, placement: Placement, described: Described | None = None) -> None:
        if self._timeout == NEVER:
            # It may be stamped long before it was received, again and again.
            placement = placement._replace(stamp=max(placement.stamp, self._now))
        if placement.listing != self._listing or not (placement.listing or (
                placement.stamp == self._stamp)):
            self._place = 0
        # The stamp of an empty polygon after others means nothing.
        if placement.listing != self._listing or not placement.is_empty:
            self._listing, self._stamp = placement.listing, placement.stamp
        for one in () if placement.is_empty else placement.each():
            name = self._name(one)
            self._place += 1
            if self._pending and (name in self._pending
                                  or abs(one.stamp - self._first_stamp) > _TOGETHER):
                self._close()
            if not self._pending:
                self._first_stamp = one.stamp
            self._pending[name] = one
        if placement.last_whole > self._whole:
            self._whole = placement.last_whole
            self._close()
            self._stand(self._stamp, self._longest, replaced={
                name for name, one in self._seen.items() if one.listing < self._whole})

    def use_frame(self, frame_id: str) -> None:
        super().use_frame(frame_id)
        self._seen = {name: sighting for name, sighting in self._seen.items()
                      if sighting.bodies.frame_id == frame_id}

    def rest(self, now: int, is_over: bool = False) -> None:
        self._now = now
        if is_over or now > min(self._rested, self._first_stamp) + self._longest:
            self._close()
        if is_over or now > self._rested + self._longest:
            self._rested = now
            self._stand(now, 0 if is_over else self._longest, is_over)

    def _name(self, placement: Placement) -> ObstacleId:
        """Return the name of a body: its id, else the place where its shape was sent first."""
        if placement.instance:
            return ObstacleId(self._source, placement.instance)
        key = placement.shape, placement.affine
        if key not in self._shapes:
            if len(self._shapes) > 2 * len(self._seen) + len(self._pending) + _MAX_FORGOTTEN:
                self._shapes = {key: name for key, name in self._shapes.items()
                                if name in self._seen or name in self._pending}
            self._shapes[key] = ObstacleId(self._source, self._place, next(self._numbers))
        return self._shapes[key]

    def _stand(self, now: int, least: int, is_over: bool = False,
               replaced: Set[ObstacleId] = frozenset()) -> None:
        """
        Extend bodies known until over `least` ns ago, standing still until now or timeout.

        Those that are replaced are extended, too, and then forgotten.
        """
        standing: defaultdict[int, dict[int, int]] = defaultdict(dict)
        found: dict[int, Bodies] = {}
        gone = []
        items = self._seen.items()
        for name, (bodies, row, _, seen_at, stamp) in list(items) if replaced or is_over else [
                *takewhile(lambda item: item[1].stamp < now - least, items)]:
            is_replaced = name in replaced
            if stamp >= now - least and not is_replaced:
                continue
            end = round(min(now, seen_at + self._timeout))
            is_forgotten = is_replaced or seen_at + self._timeout < now
            if not bodies.moving[row]:
                if end > stamp:
                    found[id(bodies)] = bodies
                    standing[id(bodies)][row] = end
            elif is_over or is_forgotten:
                self.undetermined += max(end - stamp, 0)
            if is_forgotten:
                gone.append(name)
                del self._seen[name]
        if gone or standing:
            motions = [stay(found[key], until) for key, until in standing.items()]
            self._emit(self, Step(motions, None, gone, max(
                (end for until in standing.values() for end in until.values()), default=now)))
        for key, until in standing.items():
            rested = found[key].at([until.get(row, stamp)
                                    for row, stamp in enumerate(found[key].stamps.tolist())])
            for row, end in until.items():
                name = rested.names[row]
                if name in self._seen:
                    self._seen[name] = self._seen.pop(name)._replace(bodies=rested, stamp=end)

    def _close(self) -> None:
        """End the group that is being received, and match its bodies to where they were last."""
        pending = {name: one for name, one in self._pending.items() if self._is_usable(one)}
        self._pending = {}
        if not pending:
            return
        placements = [*pending.values()]
        seen = self._bodies([*pending], placements, Block([placements]))
        self._stand(seen.begin, self._longest)
        followed: defaultdict[int, list[tuple[int, int]]] = defaultdict(list)
        found: dict[int, Bodies] = {}
        undetermined = 0
        for row, (name, one, stamp) in enumerate(
                zip(seen.names, placements, seen.stamps.tolist())):
            last = self._seen.pop(name, None)
            if last is not None:
                passed = stamp - last.stamp
                if 0 < passed <= self._longest and (
                        last.bodies.rings[last.row, COUNT] == seen.rings[row, COUNT]):
                    found[id(last.bodies)] = last.bodies
                    followed[id(last.bodies)].append((last.row, row))
                else:
                    undetermined = max(undetermined, min(passed, self._longest))
            elif name.number and not one.listing and self._closed_at is not None:
                # It may be one that has moved.
                undetermined = max(undetermined, min(stamp - self._closed_at, self._longest))
            self._seen[name] = _Sighting(seen, row, one.listing, stamp, stamp)
        self.undetermined += undetermined
        self._closed_at = seen.end
        motions = []
        for key, pairs in followed.items():
            rows, next_rows = np.array(pairs, np.int64).T
            motions.append(motion_between(found[key], seen, np.ascontiguousarray(rows),
                                          np.ascontiguousarray(next_rows)))
        self._emit(self, Step(motions, seen, (), seen.end))

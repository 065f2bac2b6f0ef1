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
as long as the node would hold it. docs/motion.md has the theory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right, insort
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import dataclass
from itertools import chain, compress, count, pairwise, repeat, takewhile
from typing import NamedTuple, TypeAlias

import numpy as np
from sat_collision.messages.ingest import Placement
from sat_collision.replay.motion.bodies import (
    Bodies, Interval, LinearMotion, LONGEST, motion_between, motion_in_batch, SetBatch, stay)
from sat_collision.replay.motion.kernels import COUNT, MOVED, mutual_nearest
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import (
    EACH_MESSAGE, EMPTY_POLYGON, in_ns, NEVER, ObstacleSettings)

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
    # The set before `seen` in the same batch, if the step has no motion but that between the two:
    # it is then computed on first use.
    last: Bodies | None = None

    @property
    def motions(self) -> list[LinearMotion]:
        """The motions of the bodies that are matched from one moment to the other."""
        if self.last is not None and self.seen is not None and not self.made:
            self.made = motion_in_batch(self.last, self.seen)
        return self.made

    @property
    def frame_id(self) -> str:
        """The frame of its bodies, empty if there is none."""
        bodies = [motion.before for motion in self.motions] if self.seen is None else [self.seen]
        return bodies[0].frame_id if bodies else ''


# A set, and how many messages it was made from.
Described: TypeAlias = tuple[Bodies, int]
# For bodies that stand still, until when each of the rows does.
Standing: TypeAlias = defaultdict[Bodies, dict[int, int]]
Emit: TypeAlias = Callable[[Step], None]


class Tracker(ABC):
    """Follows the bodies of a source."""

    def __init__(self, settings: ObstacleSettings, emit: Emit) -> None:
        # The times in which the motion of some body is not known.
        self.undetermined: list[Interval] = []
        self.name = settings.name
        self._timeout = in_ns(settings.timeout)
        self._longest = round(min(self._timeout, LONGEST))
        self._emit = emit
        self._frame_id = ''

    def describe(self, placements: Sequence[Placement]) -> Iterable[Described | None]:
        """Return for each placement about to be placed the set that begins with it, if any."""
        return repeat(None)

    @abstractmethod
    def place(self, placement: Placement, described: Described | None = None) -> None:
        """Process a placement, and the set that begins with it, if that was described before."""

    @abstractmethod
    def rest(self, now: int, is_over: bool = False, listing: int = 0) -> None:
        """
        Extend bodies not received for long, or all where the recording or its frame ends, at rest.

        Then `listing` is that of the last message, which may have been refused.
        """

    def use_frame(self, frame_id: str) -> None:
        """Set the current frame, and drop bodies in other frames."""
        self._frame_id = frame_id

    def _miss(self, first: int, last: int) -> None:
        """Record that the motion of some body is not known between two times."""
        if self.undetermined and self.undetermined[-1][1] == first:
            first, _ = self.undetermined.pop()
        if first < last:
            self.undetermined.append((first, last))

    def _bodies(self, names: Sequence[ObstacleId], placements: Sequence[Placement],
                batch: SetBatch, number: int = 0) -> Bodies:
        """Return the received bodies of a batch; there may be more names than bodies."""
        frames = {one.frame_id for one in placements}
        frame_id = frames.pop() if len(frames) == 1 else ''
        return Bodies(names, batch, number, frame_id)

    def _is_usable(self, placement: Placement) -> bool:
        """Return whether a placement is in the current frame, if there is one yet."""
        return not self._frame_id or placement.frame_id == self._frame_id


class SetTracker(Tracker):
    """
    Follows a source that publishes sets, each a listing.

    The order of bodies may differ from set to set, so bodies of two sets are matched if they are
    nearest to each other and have equally many vertices.
    """

    def __init__(self, settings: ObstacleSettings, emit: Emit,
                 is_broken: Callable[[int], bool]) -> None:
        super().__init__(settings, emit)
        self._ending = settings.ending
        # Tells of a listing whether it ended and was not whole.
        self._is_broken = is_broken
        # The set being received: its number, 0 if none is, and first stamp. The last one's number.
        self._listing = self._start = self._number = 0
        self._pending: list[Placement] = []
        self._described: Described | None = None
        self._names: list[ObstacleId] = []
        # The last set as far as it has stood, the same as received, and the rows not timed out.
        self._last: Bodies | None = None
        self._seen: Bodies | None = None
        self._alive: Sequence[int] = ()
        # Its stamp, until when its bodies have stood, and whether it was whole.
        self._since = self._last_stamp = 0
        self._is_whole = True

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
        batch = SetBatch(sets, self._longest)
        found = ((self._set(one, batch, k), len(one)) for k, one in enumerate(sets))
        return [next(found) if is_first else None for is_first in begins]

    def place(self, placement: Placement, described: Described | None = None) -> None:
        if placement.listing != self._listing:
            # Long after it nothing shows that it was whole.
            late = self._start + self._longest
            self._close(placement.last_whole >= self._listing,
                        late if late < placement.stamp else 0)
            if self._ending != EMPTY_POLYGON:
                self._rest_before(placement.stamp, placement.stamp)
            # All of a set between the two was refused.
            self._is_whole &= self._number in (0, placement.listing - 1)
            self._number = placement.listing
            self._listing, self._start = placement.listing, placement.stamp
            self._described = described
        if not placement.is_empty:
            self._pending.append(placement)
        # Where a set has an end of its own, that also ends one that is not whole.
        is_whole = placement.listing == placement.last_whole
        if is_whole or self._ending == EACH_MESSAGE or (
                self._ending == EMPTY_POLYGON and placement.is_empty):
            self._close(is_whole)

    def use_frame(self, frame_id: str) -> None:
        super().use_frame(frame_id)
        if self._last is not None and len(self._last) and self._last.frame_id != frame_id:
            self._last = None

    def rest(self, now: int, is_over: bool = False, listing: int = 0) -> None:
        late = self._start + self._longest
        if self._listing and (is_over or now > late):
            # What ended it may all have been refused.
            self._close(not self._is_broken(self._listing), min(now, late))
        # Whether bodies are received again is only known when the next set has ended.
        if not self._listing and (is_over or now > self._last_stamp + self._longest):
            self._rest(now)
        if is_over and (not self._is_whole or self._number < listing):
            self._miss(self._since, now)

    def _rest_before(self, begin: int, end: int) -> None:
        """Let the last set rest if the latest stamp of the next one, its end, is long after it."""
        if self._seen is not None and (gap := end - self._seen.end) > self._longest:
            # After a timeout nothing of it is left, else it may be linked to where it stood.
            self._rest((begin if gap <= self._timeout else end) - 1)

    def _rest(self, now: int) -> None:
        """Let the bodies of the last set stand until a time, or their timeout."""
        last, seen = self._last, self._seen
        if last is None or seen is None or not self._alive:
            return
        left = {row for row in self._alive if seen.stamps[row] + self._timeout > now}
        self._hold(last, seen, self._alive, now, left)
        self._alive = sorted(left)
        self._last = last.at(dict.fromkeys(left, now))
        self._last_stamp = now

    def _close(self, is_whole: bool, held: int = 0) -> None:
        """
        End the set that is being received, and match the bodies of the one before to it.

        Those without a match stand until before its end, or until `held` if that is later.
        """
        if not self._listing:
            return
        self._listing = 0
        seen = self._take_set()
        stamp = seen.begin or self._start
        end = max(stamp, seen.end)
        if self._ending == EMPTY_POLYGON:
            # Its stamps are in any order.
            self._rest_before(stamp, end)
        last, last_seen = self._last, self._seen
        motions: list[LinearMotion] = []
        is_in_batch = False
        if last is not None and last_seen is not None:
            is_in_batch = seen.follows(last)
            if not is_in_batch:
                motions = self._follow(last, seen)
            found = seen.followed if is_in_batch else sum(map(len, motions))
            if found < len(last):
                if is_in_batch:
                    motions = motion_in_batch(last, seen)
                lost = {*self._alive}.difference(*(motion.rows.tolist() for motion in motions))
                self._hold(last, last_seen, sorted(lost), max(end - 1, held))
            gap = stamp - (last_seen.end or self._since)
            # Bodies that are new may be those that are lost.
            if not (is_whole and self._is_whole) or gap > self._timeout or (
                    found < min(len(last), len(seen))):
                self._miss(self._since, end)
        self._emit(Step(motions, seen, None, end, last if is_in_batch else None))
        # Before the first one nothing is known.
        self._is_whole = is_whole or last is None
        self._last, self._seen = seen, seen
        self._since, self._last_stamp = stamp, end
        self._alive = range(len(seen))

    def _hold(self, last: Bodies, seen: Bodies, rows: Sequence[int], until: int,
              left: Set[int] = frozenset()) -> None:
        """Let bodies of the last set stand until a time or their timeout; all but some then go."""
        ends = {row: round(min(until, seen.stamps[row] + self._timeout)) for row in rows}
        standing = {row: end for row, end in ends.items() if end > last.stamps[row]}
        self._emit(Step([stay(last, standing)] if standing else [], None,
                        [last.names[row] for row in rows if row not in left],
                        max(standing.values(), default=self._last_stamp)))

    def _take_set(self) -> Bodies:
        """Return the received set; of identical bodies the last message counts."""
        pending, self._pending = self._pending, []
        described = self._described
        if described and described[1] == len(pending):
            seen = described[0]
        else:
            seen = self._set(pending, SetBatch([pending]))
        if seen.may_repeat or not all(map(self._is_usable, pending)):
            shapes = {}
            for one in chain.from_iterable(placement.each() for placement in pending):
                shapes[one.shape, one.affine] = one
            usable = [*map(self._is_usable, shapes.values())]
            pending = [*compress(shapes.values(), usable)]
            seen = self._bodies([*compress(self._names, usable)], pending, SetBatch([pending]))
        return seen

    def _set(self, placements: Sequence[Placement], batch: SetBatch, number: int = 0) -> Bodies:
        bodies = self._bodies(self._names, placements, batch, number)
        self._names += [ObstacleId(self.name, k) for k in range(len(self._names), len(bodies))]
        return bodies

    def _follow(self, last: Bodies, seen: Bodies) -> list[LinearMotion]:
        """Return the motion from one set to the next, nothing if no body was matched."""
        # In the batch, MOVED is that of the motion from another set.
        seen.rings[:, MOVED] = 0
        rows, next_rows = np.empty((2, len(last)), np.int64)
        found = mutual_nearest(last.rings, last.boxes, seen.rings, seen.boxes, self._longest,
                               rows, next_rows)
        rows, next_rows = rows[:found], next_rows[:found]
        if found and self._seen is not None and last is not self._seen:
            # Of bodies that have stood for long, those are linked that are where they were.
            still = motion_between(last, seen, rows, next_rows).moved == 0.0
            still &= seen.stamps[next_rows] - self._seen.stamps[rows] <= self._timeout
            rows, next_rows = rows[still], next_rows[still]
        return [motion_between(last, seen, rows, next_rows)] if len(rows) else []


def _shape_of(placement: Placement) -> tuple[bytes, object, str]:
    return placement.shape, placement.affine, placement.sent_in


class _LastSample(NamedTuple):
    """A body in its group, its placement, when it was received, and until when it has stood."""

    bodies: Bodies
    row: int
    sent: Placement
    seen_at: int
    stamp: int


class KeyTracker(Tracker):
    """
    Follows bodies that have ids, or are known by shape and so stand still.

    In listings, as those of maps, a whole one replaces all bodies that are only in older ones.
    """

    def __init__(self, settings: ObstacleSettings, emit: Emit) -> None:
        super().__init__(settings, emit)
        # The bodies that are there, those that were received longest ago first.
        self._seen: dict[ObstacleId, _LastSample] = {}
        # The group of bodies that is being received, which ends before any of them may be gone.
        self._pending: dict[ObstacleId, Placement] = {}
        self._together = min(_TOGETHER, self._longest)
        self._shapes: dict[tuple[bytes, object, str], ObstacleId] = {}
        self._numbers = count(1)
        self._first_stamp = self._rested = self._now = 0
        # The stamps of all messages of that group, and the last one before it.
        self._times: list[int] = []
        self._heard: int | None = None
        # Listing and stamp of the last message; its place in the listing, without one among those
        # of its stamp, and how often each id came there; and the last whole listing.
        self._listing = self._stamp = self._place = self._whole = 0
        self._counts: Counter[int] = Counter()
        # Where ids are besides their first place of a stamp.
        self._beside: set[ObstacleId] = set()
        # When shapes were sent that had not been there before.
        self._appeared: list[int] = []

    def place(self, placement: Placement, described: Described | None = None) -> None:
        if self._timeout == NEVER:
            # It may be stamped long before it was received, again and again.
            placement = placement._replace(stamp=max(placement.stamp, self._now))
        if placement.sent_in and placement.is_empty:
            self._move(placement)
            return
        if placement.listing != self._listing or not (placement.listing or (
                placement.stamp == self._stamp)):
            self._place = 0
            self._counts.clear()
        # The stamp of an empty polygon after others means nothing.
        if placement.listing != self._listing or not placement.is_empty:
            self._listing, self._stamp = placement.listing, placement.stamp
        if self._pending and abs(placement.stamp - self._first_stamp) > self._together:
            self._close()
        if placement.is_empty:
            self._times.append(placement.stamp)
        for one in () if placement.is_empty else placement.each():
            name = self._name(one)
            self._place += 1
            if name in self._pending:
                self._close()
            if not self._pending:
                self._first_stamp = one.stamp
            self._pending[name] = one
            self._times.append(one.stamp)
        if placement.last_whole > self._whole:
            self._whole = placement.last_whole
            self._close()
            self._stand(self._stamp, self._longest, replaced={
                name for name, one in self._seen.items() if one.sent.listing < self._whole})

    def use_frame(self, frame_id: str) -> None:
        super().use_frame(frame_id)
        self._seen = {name: sample for name, sample in self._seen.items()
                      if sample.bodies.frame_id == frame_id}

    def rest(self, now: int, is_over: bool = False, listing: int = 0) -> None:
        self._now = now
        if is_over or now > min(self._rested, self._first_stamp) + self._longest:
            self._close()
        now = min([now, *self._times])
        if is_over or now > self._rested + self._longest:
            self._rested = now
            self._stand(now, 0 if is_over else self._longest, is_over)

    def _name(self, placement: Placement) -> ObstacleId:
        """Return the name of a body: its id, else the place where its shape was sent first."""
        if placement.instance:
            name = ObstacleId(self.name, placement.instance, -self._counts[placement.instance])
            self._counts[placement.instance] += 1
            if name.number and not placement.listing:
                self._beside.add(name)
            return name
        key = _shape_of(placement)
        if key not in self._shapes:
            if len(self._shapes) > 2 * len(self._seen) + len(self._pending) + _MAX_FORGOTTEN:
                self._shapes = {key: name for key, name in self._shapes.items()
                                if name in self._seen or name in self._pending}
            self._shapes[key] = ObstacleId(self.name, self._place, next(self._numbers))
        return self._shapes[key]

    def _move(self, frame: Placement) -> None:
        """Let the bodies of a map that were sent in a frame be where that is from now on."""
        self._close()
        for name, last in self._seen.items():
            if last.sent.sent_in == frame.sent_in:
                one = last.sent._replace(stamp=frame.stamp, affine=frame.affine)
                self._pending[name] = one
                if not one.instance:
                    self._shapes.pop(_shape_of(last.sent), None)
                    self._shapes[_shape_of(one)] = name
        self._close()

    def _stand(self, now: int, least: int, is_over: bool = False,
               replaced: Set[ObstacleId] = frozenset(), times: Sequence[int] = ()) -> None:
        """
        Extend bodies known until over `least` ns ago, standing still until now or they are gone.

        They are gone where they are replaced, or a message is stamped a timeout after them; the
        stamps of those since the last call are given in order.
        """
        standing: Standing = defaultdict(dict)
        gone = []
        items = self._seen.items()
        old = takewhile(lambda item: item[1].seen_at < now - least, items)
        for name, (bodies, row, sent, seen_at, stamp) in list(
                items if replaced or is_over else old):
            over, is_forgotten = self._end_of(seen_at, times)
            is_forgotten = is_forgotten or over < now or name in replaced
            again = self._pending.get(name._replace(number=0) if name in self._beside else name)
            if stamp >= now - least and not is_forgotten or (
                    again and again.stamp <= seen_at + self._timeout):
                continue
            end = round(min(now, over))
            if end > stamp:
                standing[bodies][row] = end
            if name.number > 0 and (is_forgotten or is_over):
                # The first new one since may be the same, elsewhere.
                k = bisect_right(self._appeared, seen_at)
                if k < len(self._appeared):
                    self._miss(seen_at, self._appeared[k])
            if is_forgotten:
                gone.append(name)
                del self._seen[name]
        motions = [stay(*one) for one in standing.items()]
        if gone or motions:
            self._emit(Step(motions, None, gone,
                            max((motion.end for motion in motions), default=now)))
        for motion, until in zip(motions, standing.values()):
            for row, end in until.items():
                name = motion.after.names[row]
                if name in self._seen:
                    self._seen[name] = self._seen[name]._replace(bodies=motion.after, stamp=end)

    def _end_of(self, seen_at: int, times: Sequence[int]) -> tuple[float, bool]:
        """Return until when a body is there by later messages, and whether one shows its end."""
        k = bisect_right(times, seen_at + self._timeout)
        silent = max(seen_at, times[k - 1] if k else self._heard or 0) + self._timeout
        return (min(times[k], silent), True) if k < len(times) else (silent, False)

    def _close(self) -> None:
        """
        End the group that is being received, and match its bodies to where they were last.

        Those of a map stood there until then.
        """
        jumps = self._timeout == NEVER
        times, self._times = sorted(self._times), []
        if times:
            self._stand(times[-1], self._longest, times=times)
            before = times[0] if self._heard is None else self._heard
            for earlier, later in pairwise([before, *times]):
                if later > earlier + self._timeout:
                    self._miss(earlier, later)
            self._heard = max(before, times[-1])
        pending = {name: one for name, one in self._pending.items() if self._is_usable(one)}
        self._pending = {}
        if not pending:
            return
        placements = [*pending.values()]
        seen = self._bodies([*pending], placements, SetBatch([placements]))
        followed: defaultdict[Bodies, list[tuple[int, int]]] = defaultdict(list)
        standing: Standing = defaultdict(dict)
        for row, (name, one, stamp) in enumerate(
                zip(seen.names, placements, seen.stamps.tolist())):
            last = self._seen.pop(name, None)
            if last is not None:
                if not jumps and 0 < stamp - last.seen_at <= self._longest and (
                        last.bodies.rings[last.row, COUNT] == seen.rings[row, COUNT]):
                    followed[last.bodies].append((last.row, row))
                else:
                    over = round(min(stamp, last.seen_at + self._timeout))
                    if last.stamp < over:
                        standing[last.bodies][last.row] = over
                    if not jumps and last.seen_at < stamp and not np.array_equal(
                            last.bodies.ring(last.row), seen.ring(row)):
                        self._miss(last.seen_at, stamp)
            elif name.number > 0 and not one.listing:
                insort(self._appeared, stamp)
            self._seen[name] = _LastSample(seen, row, one, stamp, stamp)
        gone = []
        for name in self._beside.difference(pending):
            newer, last = pending.get(name._replace(number=0)), self._seen.get(name)
            if newer and last and newer.stamp > last.seen_at:
                if last.stamp < newer.stamp:
                    standing[last.bodies][last.row] = newer.stamp
                gone.append(name)
                del self._seen[name]
        self._beside &= self._seen.keys()
        if self._appeared and self._timeout < NEVER:
            # Of no use for bodies that are still there.
            del self._appeared[:bisect_right(self._appeared, seen.begin - 3 * self._timeout)]
        motions = [stay(*one) for one in standing.items()]
        motions += [motion_between(last_bodies, seen, *np.array([*zip(*pairs)], np.int64))
                    for last_bodies, pairs in followed.items()]
        self._emit(Step(motions, seen, gone, seen.end))

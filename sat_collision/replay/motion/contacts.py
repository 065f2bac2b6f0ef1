# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where and when a footprint on its trajectory touches the obstacles of a source."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from math import inf, isnan
from operator import itemgetter
from typing import NamedTuple, TypeAlias

import numpy as np
from sat_collision.geometry.body.polygon import Polygon, PolygonError
from sat_collision.geometry.compiled.jit import indexable
from sat_collision.geometry.motion.sweep import time_of_contact
from sat_collision.geometry.query import closest_points, separation
from sat_collision.replay.model.result import (
    AT_A_SAMPLE, BETWEEN_SAMPLES, Contact, FootprintResult, Least, least_of, Series, Unknown)
from sat_collision.replay.motion.bodies import (
    Bodies, Floats, Integers, Interval, LinearMotion, SetBatch)
from sat_collision.replay.motion.nearness import measure_near, nearest_in_steps, rows_near, SLACK
from sat_collision.replay.motion.tracker import Step
from sat_collision.replay.motion.trajectories import Box, Link, Trajectory
from sat_collision.scene.obstacles import ObstacleId

# A depth in m, when it is so, and the two bodies then.
_Depth: TypeAlias = tuple[float, int, tuple[Polygon, Polygon]]

_NOTHING = indexable(np.zeros(1)), 0
# Up to how far apart the sweep takes bodies to touch, in m, with what rounded times take.
_TOLERANCE = 2e-6
# Where bodies part in a contact by no more than this, in m, it may go unnoticed; or by no more
# than their relative motion in the contact, divided by this.
_GAP = 1e-3
_PARTS = 128


class ContactTracker:
    """
    Follows the contacts of one footprint with the obstacles of one source.

    Bodies apart by up to the margin, in metres, count as in contact.
    """

    def __init__(self, trajectory: Trajectory, contacts: ContactResults, margin: float) -> None:
        # Whether footprint and source were ever known at the same time.
        self.decided = False
        # The times in which the vertices of a moving body made no valid polygon.
        self.undetermined: list[Interval] = []
        self._trajectory = trajectory
        self._series = contacts.series()
        self._contacts = contacts
        self._margin = margin
        self._touching: dict[ObstacleId, Contact] = {}
        self._nearest: _NearestInSteps | None = None
        # Of bodies that need not come together: how far each was when it came last, or the body
        # itself where that was not measured.
        self._latest: dict[ObstacleId, float | tuple[Bodies, int]] = {}

    def decide(self, step: Step) -> None:
        """Decide a step; the trajectory must be complete up to the end of the step."""
        if step.last is not None and step.seen is not None and not self._touching and (
                self._decide_from_batch(step.last, step.seen)):
            return
        followed: dict[ObstacleId, Contact] = {}
        for motion in step.motions:
            self._follow(motion, followed, step.seen)
        if step.gone is None:
            before, self._touching = self._touching, followed
        else:
            before = self._touching
            before.update(followed)
        if step.seen is not None:
            touching = self._decide_moment(step.seen, before, step.gone is not None)
            if step.gone is None:
                self._touching = touching
            else:
                for name in step.seen.names:
                    self._touching.pop(name, None)
                self._touching.update(touching)
        for name in step.gone or ():
            self._touching.pop(name, None)
            self._latest.pop(name, None)

    def finish(self) -> None:
        """Mark the contacts that last to the end."""
        for contact in self._touching.values():
            contact.at_end = True

    def _decide_from_batch(self, last: Bodies, seen: Bodies) -> bool:
        """Decide a step from the results of its batch; return False if these do not have it."""
        nearest = self._nearest
        if nearest is None or nearest.batch is not seen.batch:
            if self._trajectory.batch is None:
                return False
            nearest = self._nearest = _NearestInSteps(
                seen.batch, self._trajectory.batch, self._margin)
        first, end, low, high = nearest.steps[seen.number]
        if first < 0 or not self._trajectory.is_in_batch(
                nearest.trajectory, low, high, last.begin, seen.begin):
            return False
        self.decided = True
        for (time, row, kind), value in zip(nearest.times[first:end], nearest.values[first:end]):
            if kind:
                self._series.add(time, value)
            self._contacts.measure(seen if kind == 2 else last, row, time, value)
        return True

    def _decide_moment(self, seen: Bodies, before: dict[ObstacleId, Contact],
                       is_part: bool) -> dict[ObstacleId, Contact]:
        """
        Decide a moment: return the contacts, and record their depths and the nearest body.

        The bodies seen may be a part of those that are there.
        """
        touching: dict[ObstacleId, Contact] = {}
        box = self._trajectory.bounds(seen.begin, seen.end) if len(seen) else None
        if is_part:
            self._latest.update((name, (seen, row)) for row, name in enumerate(seen.names))
        if box is None:
            return touching
        self.decided = True
        least = inf
        nearest = -1
        own = self._trajectory.outline(seen.begin) if seen.begin == seen.end else None
        for row, time, value in self._by_gap(own, box, seen, None, self._margin):
            outline = self._trajectory.outline(time) if value <= self._margin else None
            if outline is not None:
                name = seen.names[row]
                contact = self._touching.get(name) or before.get(name) or (
                    self._contacts.begin(name, time))
                touching[name] = contact
                contact.last = time
                contact.found = AT_A_SAMPLE
                self._contacts.deepen(contact, name, 0.0 - value, time,
                                      (outline, seen.polygon(row)))
            if is_part:
                self._latest[seen.names[row]] = value
            if value < least:
                least, nearest = value, row
        if nearest >= 0:
            time = int(seen.stamps[nearest])
            self._contacts.measure(seen, nearest, time, least)
            if len(self._latest) > len(seen):
                least = min(map(self._measured, [*self._latest]))
            self._series.add(time, least)
        return touching

    def _measured(self, name: ObstacleId) -> float:
        """Return how far a body was when it came last, infinity if that is not known."""
        value = self._latest[name]
        if isinstance(value, tuple):
            bodies, row = value
            own = self._trajectory.outline(int(bodies.stamps[row]))
            value = self._latest[name] = (
                inf if own is None else separation(own, bodies.polygon(row)))
        return value

    def _follow(self, motion: LinearMotion, followed: dict[ObstacleId, Contact],
                seen: Bodies | None) -> None:
        """Decide a motion of matched bodies; add the contacts open at its end to `followed`."""
        box = self._trajectory.bounds(motion.begin, motion.end)
        near: list[int] = []
        if box is not None:
            self.decided = True
            rows = np.empty(len(motion), np.int64)
            near = rows[:rows_near(box, motion.boxes, self._margin, rows)].tolist()
        names = motion.before.names
        far = self._touching.keys() - {names[motion.rows[i]] for i in near}
        if far:
            for name in far.intersection(names[row] for row in motion.rows.tolist()):
                del self._touching[name]
        for i in near:
            contact = self._touching.pop(names[motion.rows[i]], None)
            after: Bodies | None = None
            for begin, end, link in self._trajectory.links(
                    int(motion.starts[i]), int(motion.finishes[i])):
                if contact is not None and (
                        contact.last != begin or after not in (None, link.before)):
                    contact = None
                after = link.after
                try:
                    contact = self._cross(_Pair(link, motion, i, begin, end), contact)
                except PolygonError:
                    contact = None
                    self.undetermined.append((begin, end))
            if contact is not None:
                followed[motion.after.names[motion.next_rows[i]]] = contact
        if box is not None:
            self._measure_still(motion, seen)

    def _measure_still(self, motion: LinearMotion, seen: Bodies | None) -> None:
        """Find the nearest of the bodies that stand still, at the samples of the footprint."""
        times = [time for time in self._trajectory.samples(motion.begin, motion.end)
                 if seen is None or time not in seen.moments]
        if not times:
            return
        still = motion.moved == 0.0
        are_all_still = np.count_nonzero(still) == len(motion.before)
        for time in times:
            outline = self._trajectory.outline(time)
            if outline is None:
                continue
            rows = motion.rows[still & (motion.starts <= time) & (time <= motion.finishes)]
            nearest = min(self._by_gap(outline, outline.bounds, motion.before, rows, -inf, time),
                          key=itemgetter(2), default=None)
            if nearest:
                row, _, value = nearest
                self._contacts.measure(motion.before, row, time, value)
                if are_all_still and len(self._latest) <= len(motion.before):
                    self._series.add(time, value)

    def _by_gap(self, own: Polygon | None, box: Box, bodies: Bodies, rows: Integers | None,
                margin: float, at: int | None = None) -> Iterator[tuple[int, int, float]]:
        """
        Yield (row, time, separation) of bodies that may be nearest or within a margin.

        The nearest boxes come first. Without an outline there is another one for each of them;
        without rows all are candidates; without a time each counts at its own.
        """
        if rows is None:
            rows = np.arange(len(bodies))
        found = np.empty((len(rows), 3))
        count = measure_near(own.packed if own else _NOTHING, box, rows,
                             (bodies.boxes, bodies.points, bodies.rings), margin, found)
        least = inf
        for gap, number, value in sorted(found[:count].tolist()):
            if gap > max(margin, least):
                return
            row = int(number)
            time = int(bodies.stamps[row]) if at is None else at
            if isnan(value):
                outline = self._trajectory.outline(time)
                if outline is None:
                    continue
                value = separation(outline, bodies.polygon(row))
            least = min(least, value)
            yield row, time, value

    def _cross(self, pair: _Pair, contact: Contact | None) -> Contact | None:
        """Decide a part of the motion of a pair; return the contact open at its end, if any."""
        own, other = pair.at(pair.end)
        value = separation(own, other)
        touches = value <= self._margin
        if contact is None:
            first = self._first(pair) if pair.begin < pair.end else None
            if first is None:
                if not touches:
                    return None
                first = pair.end
            contact = self._contacts.begin(pair.name, first)
            contact.between[0] = pair.begin if first > pair.begin else None
        begun = max(contact.first, pair.begin)
        last: int | None = pair.end
        fault = None
        if not touches:
            try:
                last = self._first(pair._replace(begin=pair.end, end=pair.begin))
            except PolygonError as error:
                fault, last = error, None
        contact.last = begun if last is None else max(begun, last)
        if not touches or begun < pair.end and pair.most_motion() > self._margin - value + _GAP:
            measured, invalid = pair.depths(begun, contact.last, self._margin, touches)
            fault = fault or invalid
            depth, time, bodies = min(measured, key=itemgetter(0))
            if depth < -self._margin - _TOLERANCE:
                self._cross(pair._replace(end=time), contact)
                return self._cross(pair._replace(begin=time), None)
            depth, time, bodies = max(measured, key=itemgetter(0))
            self._contacts.deepen(contact, pair.name, depth, time, bodies)
        if touches:
            if pair.ends_at_a_sample:
                contact.found = AT_A_SAMPLE
            self._contacts.deepen(contact, pair.end_name, 0.0 - value, pair.end, (own, other))
            return contact
        contact.between[1] = pair.end
        if fault:
            raise fault
        return None

    def _first(self, pair: _Pair) -> int | None:
        """
        Return when a pair first touches on a part of its motion.

        A PolygonError is raised where that depends on an outline that is not valid.
        """
        own, other = pair.at(pair.begin)
        value = separation(own, other)
        if value <= self._margin:
            return pair.begin
        if value - self._margin > pair.most_motion():
            return None
        share = time_of_contact(*pair.rings(), margin=self._margin)
        if share is None:
            return None
        length = pair.end - pair.begin
        time = pair.begin + round(share * length)
        if abs(length) > 1 and separation(*pair.at(time)) - self._margin > _TOLERANCE:
            # The sweep took hulls for parts that do not stay convex. In halves they stay so, or
            # their bodies stay apart.
            middle = pair.begin + length // 2
            first = self._first(pair._replace(end=middle))
            return self._first(pair._replace(begin=middle)) if first is None else first
        return time


class _NearestInSteps:
    """
    The obstacles nearest to a footprint at each step of a batch: what `nearest_in_steps` writes.

    The trajectory is the batch of the footprint's samples.
    """

    def __init__(self, batch: SetBatch | None, trajectory: SetBatch, margin: float) -> None:
        assert batch is not None
        self.batch = batch
        self.trajectory = trajectory
        steps = np.empty((len(batch.sets), 4), np.int64)
        room = len(batch.sets) + len(trajectory.sets)
        times, values = np.empty((room, 3), np.int64), np.empty(room)
        own, other = ((one.points, one.rings, one.boxes, one.sets, *one.motions)
                      for one in (trajectory, batch))
        nearest_in_steps(own, other, margin, steps, times, values)
        self.steps, self.times, self.values = steps.tolist(), times.tolist(), values.tolist()


class _Pair(NamedTuple):
    """A footprint and an obstacle in linear motion from one time to another, or backwards."""

    link: Link
    motion: LinearMotion
    i: int
    begin: int
    end: int

    @property
    def name(self) -> ObstacleId:
        return self.motion.before.names[int(self.motion.rows[self.i])]

    @property
    def end_name(self) -> ObstacleId:
        if self.end < self.motion.finishes[self.i]:
            return self.name
        return self.motion.after.names[int(self.motion.next_rows[self.i])]

    @property
    def ends_at_a_sample(self) -> bool:
        """Whether the footprint has a sample at the end, and the other does not move."""
        return (self.end == self.link.end and not self.link.after.is_between
                and not self.motion.moved[self.i])

    def depths(self, first: int, last: int, margin: float,
               touches: bool) -> tuple[list[_Depth], PolygonError | None]:
        """
        Return depths from one time of touching to another, and why some, if any, are not known.

        The bodies are apart at one of these times, or not by more than `_GAP` or `_PARTS` tell at
        any time: each part of the motion is halved until its ends are deep enough to show that.
        """
        found: dict[int, float] = {}
        measured: list[_Depth] = []
        fault = None
        touching = 0.0 - margin
        change = self._most_change() / max(abs(self.end - self.begin), 1)
        allowed = max(_GAP, change * (last - first) / _PARTS)
        # At eighths if it does not last to the end: it may be deepest anywhere.
        times = [first, last] if touches else [
            first + (last - first) * part // 8 for part in range(9)]
        spans = [*zip(times, times[1:])]
        for begin, end in spans:
            for time in (begin, end):
                if time not in found:
                    found[time] = touching
                    try:
                        bodies = self.at(time)
                        depth = 0.0 - separation(*bodies)
                        # Not less than for touching at the ends, which the sweep found within
                        # its tolerance, and time within 1 ns.
                        found[time] = max(depth, touching) if time in (first, last) else depth
                        measured.append((found[time], time, bodies))
                    except PolygonError as error:
                        fault = error
            least = min(found[begin], found[end]) - touching
            if least < -_TOLERANCE:
                break
            if change * (end - begin) / 2 - least > allowed and end - begin > 1:
                middle = (begin + end) // 2
                spans += (begin, middle), (middle, end)
        return measured, fault

    def _most_change(self) -> float:
        """
        Return what docs/motion.md (I4) calls m, in metres.

        On the way the bodies are less deep by half of it at most than at the less deep end.
        """
        own, own_end, other, other_end = self.rings()
        own_moved, other_moved = own_end - own, other_end - other
        translation = own_moved.mean(axis=0)
        if all(body.is_convex for body in self.at(self.end)):
            return 2.0 * (_most(own_moved - translation)
                          + _most(other_moved - other_moved.mean(axis=0)))
        return _most(own_moved - translation) + _most(other_moved - translation)

    def at(self, time: int) -> tuple[Polygon, Polygon]:
        return self.link.motion.polygon(0, time), self.motion.polygon(self.i, time)

    def rings(self) -> tuple[Floats, Floats, Floats, Floats]:
        return (self.link.motion.ring(0, self.begin), self.link.motion.ring(0, self.end),
                self.motion.ring(self.i, self.begin), self.motion.ring(self.i, self.end))

    def most_motion(self) -> float:
        """Return how far the two move towards each other at most, metres."""
        both = (self.link.motion, 0), (self.motion, self.i)
        passed = abs(self.end - self.begin)
        moved: float = sum(motion.moved[i] * passed / max(motion.finishes[i] - motion.starts[i], 1)
                           for motion, i in both)
        largest: float = max(np.abs(motion.boxes[i]).max() for motion, i in both)
        return moved * (1.0 + SLACK) + SLACK * largest


def _most(moved: Floats) -> float:
    """Return the greatest length of vectors, (n, 2)."""
    return float(np.hypot(moved[:, 0], moved[:, 1]).max())


class ContactResults:
    """Collects the results of one footprint; contacts also go to the list of all footprints."""

    def __init__(self, result: FootprintResult, contacts: list[Contact],
                 trajectory: Trajectory) -> None:
        self._result = result
        self._contacts = contacts
        self._trajectory = trajectory
        self._series: list[Series] = []

    def begin(self, obstacle: ObstacleId, time: int) -> Contact:
        """Record a contact that begins, and return it."""
        contact = Contact(self._result.name, str(obstacle), time, time, found=BETWEEN_SAMPLES)
        self._contacts.append(contact)
        return contact

    def deepen(self, contact: Contact, name: ObstacleId, depth: float, time: int,
               bodies: tuple[Polygon, Polygon]) -> None:
        """Record how deep a contact is at a time, and where; and the obstacle's name then."""
        if contact.deepen(depth, time, *bodies):
            contact.deepest_as = str(name)
            self._result.note_least(contact.least)

    def series(self) -> Series:
        """Return a new series, for the separations from the nearest obstacles of one tracker."""
        self._series.append(Series([]))
        return self._series[-1]

    def measure(self, bodies: Bodies, row: int, time: int, value: float) -> None:
        """Record the separation from an obstacle if it is the least so far."""
        if self._result.is_least(value) and (own := self._trajectory.outline(time)) is not None:
            (ax, ay), (bx, by) = (
                point.tolist() for point in closest_points(own, bodies.polygon(row)))
            self._result.note_least(Least(value + 0.0, time, str(bodies.names[row]),
                                          (ax + bx) / 2, (ay + by) / 2, AT_A_SAMPLE))

    def draw_curve(self, unknown: Iterable[Unknown]) -> None:
        """Merge the series of all sources, with gaps where the state was unknown."""
        samples = list(least_of(series.samples for series in self._series))
        times = [time for time, _ in samples]
        for one in unknown:
            k = bisect_left(times, one.first)
            # Up to half of the time between two samples, it is not shown as a gap.
            if one.footprint == self._result.name and 0 < k == bisect_left(times, one.last) and (
                    k == len(times) or 2 * (one.last - one.first) > times[k] - times[k - 1]):
                samples.append((one.first, None))
        curve = Series(self._result.separation)
        for time, value in sorted(samples, key=itemgetter(0)):
            curve.add(time, value)

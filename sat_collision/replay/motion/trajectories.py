# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The trajectory of a footprint, and the poses of an outline between two messages."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from contextlib import suppress
from functools import cached_property, reduce
from typing import TypeAlias

import numpy as np
from sat_collision.geometry.body.polygon import (
    Affine2D, Points, Polygon, PolygonError, vertices_of)
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.replay.motion.bodies import (
    Bodies, Floats, Interval, LinearMotion, LONGEST, motion_between, SetBatch)
from sat_collision.replay.motion.kernels import COUNT
from sat_collision.replay.motion.nearness import around
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.settings import FootprintSettings, in_ns, NEVER

# The row of a footprint, which is alone in its set.
_ROW = np.zeros(1, np.int64)
_MAX_OUTLINES = 256
# min x, min y, max x, max y.
Box: TypeAlias = tuple[float, float, float, float]


class Link:
    """The motion of a footprint from one sample to the next, or one sample alone."""

    def __init__(self, before: Bodies, after: Bodies) -> None:
        self.before = before
        self.after = after
        self.begin, self.end = before.begin, after.begin

    @cached_property
    def box(self) -> Box:
        """The bounds of all of it."""
        box: Box = around(*(tuple(one.boxes[0].tolist()) for one in (self.before, self.after)))
        return box

    @cached_property
    def motion(self) -> LinearMotion:
        """The motion, vertex by vertex."""
        return motion_between(self.before, self.after, _ROW, _ROW)


class Trajectory:
    """
    The samples of a footprint, and the links of its motion.

    A link leads from one sample to the next if no refused footprint came between them, if they
    are no further apart in time than the timeout, and if they have as many vertices. One that
    never times out stands where it was last. A sample alone, or one of several with a stamp, is a
    link without length. Times are in ns.
    """

    def __init__(self, settings: FootprintSettings) -> None:
        timeout = in_ns(settings.timeout)
        self._never_stale = timeout == NEVER
        # The longest motion that is interpolated.
        self.longest = round(min(timeout, LONGEST))
        # The batch of the samples that are being added, if any.
        self.batch: SetBatch | None = None
        # The greatest stamp of samples, and that of the last one, or until when it has stood.
        self.newest: int | None = None
        self.latest: int | None = None
        # The times in which the motion is known, those that meet as one.
        self.known: list[Interval] = []
        self._links: list[Link] = []
        self._starts: list[int] = []
        self._last: Bodies | None = None
        # If it never times out: the last one as far as it has stood, if it has; and whether it may
        # ever have been elsewhere.
        self._stood: Bodies | None = None
        self._has_moved = False
        # By time, the outlines found last.
        self._outlines: dict[int, Polygon] = {}

    def add(self, sample: Bodies) -> None:
        """Add a sample; one older than the last by up to `longest`, or equal to it, is ignored."""
        time, last = sample.begin, self._last or sample
        begin = last.begin if self._last else None
        if begin is not None and (
                begin - self.longest <= time < begin
                or time == begin and np.array_equal(sample.ring(0), last.ring(0))):
            return
        if begin is not None and begin + self.longest < time:
            self.stand(time)
        if self._never_stale and not (
                self._has_moved or np.array_equal(sample.ring(0), last.ring(0))):
            self._leave()
        stood, self._stood = self._stood, None
        self._last, self.latest = sample, time
        self.newest = max(time, self.newest or time)
        is_linked = begin is not None and begin < time and not stood and (
            sample.followed if sample.follows(last) else time - begin <= self.longest and (
                last.rings[0, COUNT] == sample.rings[0, COUNT]))
        self._append(Link(last if is_linked else sample, sample))

    def lose(self, time: int) -> None:
        """Reset the pose: from a time on it is unknown until the next sample."""
        self.stand(time)
        self._leave()
        self._last = self._stood = None

    def _leave(self) -> None:
        """Record that it may have been elsewhere; it is not known since when."""
        if self._stood and self._last and not self._has_moved:
            first, _ = self.known.pop()
            self.known.append((first, self._last.begin))
        self._has_moved = True

    def begin_of_link(self, until: int) -> int | None:
        """Return when the link that leads to a sample at a time begins, None if none does."""
        if self._last is None or not 0 < until - self._last.begin <= self.longest:
            return None
        return self._last.begin

    def standing(self, until: int) -> Bodies:
        """Return the last sample, of which there is one, at a later time."""
        assert self._last
        return self._last.at({0: until})

    def stand(self, until: int) -> None:
        """
        Let a footprint that never times out stand until a time.

        This is what the node holds. That it stands there is known only if it is never elsewhere.
        """
        if not self._never_stale or self._last is None:
            return
        before = self._stood or self._last
        if before.begin < until:
            self._stood, self.latest = before.at({0: until}), until
            self._append(Link(before, self._stood), not self._has_moved)

    def drop_before(self, time: int) -> None:
        """Forget the links that end before a time."""
        while len(self._links) > 1 and self._links[0].end < time:
            del self._links[0], self._starts[0]

    def links(self, start: int, finish: int) -> list[tuple[int, int, Link]]:
        """Return the beginning and the end of each link between two times, with its motion."""
        starts, links = self._starts, self._links
        k = max(bisect_right(starts, start) - 1, 0)
        # Pieces of no length may share their time with the end of the one before.
        while k > 0 and links[k - 1].end >= start:
            k -= 1
        found: list[tuple[int, int, Link]] = []
        while k < len(starts) and starts[k] <= finish:
            begin, end = max(starts[k], start), min(links[k].end, finish)
            # An instant whose sample ends the link before or begins the next is left out.
            if begin < end or begin == end and not (
                    found and found[-1][1] == end and found[-1][2].after is links[k].before
            ) and not (k + 1 < len(starts) and links[k + 1].before is links[k].after
                       and max(starts[k + 1], start) == end < min(links[k + 1].end, finish)):
                found.append((begin, end, links[k]))
            k += 1
        return found

    def is_in_batch(self, batch: SetBatch, low: int, high: int, start: int, finish: int) -> bool:
        """Return whether links between two times lead to just samples low to high of a batch."""
        k = bisect_right(self._starts, start) - 1
        last = bisect_left(self._starts, finish) - 1
        if k < 0 or last - k != high - low:
            return False
        # The batch knows no samples by themselves, such as those of equal stamps.
        first, after = bisect_left(self._starts, start), bisect_right(self._starts, finish)
        if any(one.begin == one.end for one in self._links[first:after]):
            return False
        begin, end = self._links[k].before, self._links[last].after
        return (begin.batch is batch and end.batch is batch
                and begin.number == low - 1 and end.number == high)

    def bounds(self, start: int, finish: int) -> Box | None:
        """Return the bounds of the footprint between two times, None if it is unknown then."""
        boxes = [link.box for _, _, link in self.links(start, finish)]
        return reduce(around, boxes) if boxes else None

    def samples(self, after: int, until: int) -> list[int]:
        """Return the stamps of the samples after one time and until another."""
        first, end = bisect_right(self._starts, after), bisect_right(self._starts, until)
        found = {link.begin for link in self._links[first:end] if not link.before.is_between}
        if self.latest is not None and after < self.latest <= until:
            found.add(self.latest)
        return sorted(found)

    def link_from(self, time: int) -> LinearMotion | None:
        """Return the link that begins at a time and leads on from there, None if none does."""
        return next((link.motion for _, end, link in self.links(time, time + 1)
                     if link.begin == time < end), None)

    def outline(self, time: int) -> Polygon | None:
        """Return the outline at a time, None if it is not known."""
        outlines = self._outlines
        if time not in outlines and (links := self.links(time, time)):
            if len(outlines) >= _MAX_OUTLINES:
                outlines.clear()
            # Of links that meet the first one, whose sample there they share.
            _, _, link = links[0]
            with suppress(PolygonError):
                outlines[time] = link.motion.polygon(0, time)
        return outlines.get(time)

    def _append(self, link: Link, is_known: bool = True) -> None:
        if self._starts and link.begin < self._starts[-1]:
            # The clock of the stamps was set back: the links so far belong to another time.
            self._links.clear()
            self._starts.clear()
            self._outlines.clear()
        self._links.append(link)
        self._starts.append(link.begin)
        if is_known:
            begin = link.begin
            if self.known and self.known[-1][1] == begin:
                begin, _ = self.known.pop()
            self.known.append((begin, link.end))


# The most that a vertex may be off the line that approximates its motion, in m, as in the sweep.
TOLERANCE = 1e-6
# Shorter intervals, in ns, are not divided.
_SHORTEST = 4


class _UnknownError(Exception):
    """The pose of the frame is unknown at some time."""


class Poses:
    """The poses of an outline, whose points are in a frame."""

    def __init__(self, transforms: TransformListener, frame_id: str, points: Points) -> None:
        self._transforms = transforms
        self._frame_id = frame_id
        vertices = vertices_of(points)
        # Homogeneous coordinates: x, y, 1.
        self._vertices: Floats = np.column_stack([vertices, np.ones(len(vertices))])

    def between(self, begin: int, end: int) -> list[tuple[int, Affine2D]] | None:
        """
        Return the times between two at which the outline must be placed, and the maps then.

        From each to the next the vertices move on straight lines, to TOLERANCE: there is one at
        the stamp of each transform, and as many more as rotation needs. None if the pose of the
        frame is not known all the time.
        """
        times = [begin, *self._transforms.stamps(self._frame_id, begin, end), end]
        found: list[tuple[int, Affine2D]] = []
        try:
            for one, other in zip(times, times[1:]):
                if one != begin:
                    found.append((one, self._affine(one)))
                self._refine(one, other, found)
        except _UnknownError:
            return None
        return found

    def _refine(self, begin: int, end: int, found: list[tuple[int, Affine2D]]) -> None:
        """Add the times and maps needed between two times."""
        if end - begin < _SHORTEST:
            return
        middle = (begin + end) // 2
        first, last = np.array(self._affine(begin)), np.array(self._affine(end))
        for time in ((begin + middle) // 2, middle, (middle + end) // 2):
            straight = first + (time - begin) / (end - begin) * (last - first)
            off = (np.array(self._affine(time)) - straight).reshape(2, 3) @ self._vertices.T
            if np.hypot(*off).max() > TOLERANCE:
                self._refine(begin, middle, found)
                found.append((middle, self._affine(middle)))
                self._refine(middle, end, found)
                return

    def _affine(self, time: int) -> Affine2D:
        found = self._transforms.lookup_affine(self._frame_id, time, time, 0.0)
        if isinstance(found, NoTransform):
            raise _UnknownError
        return found.affine

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Contacts in recorded motion: each body is where it was at each time, by its own stamps.

Placements arrive in the order of stamps. A tracker for each source turns them into steps, and each
footprint's sweep decides a step once the footprint's trajectory through it is known. Data that is
no longer needed is dropped soon after.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby, pairwise, repeat
from operator import attrgetter, itemgetter
from typing import Any

from sat_collision.messages.ingest import Placement
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.replay.model.result import (
    Contact, FootprintResult, joined, joined_contacts, length_of, times_of, Unknowns)
from sat_collision.replay.motion.bodies import Bodies, Interval, LONGEST, SetBatch
from sat_collision.replay.motion.contacts import ContactResults, ContactTracker
from sat_collision.replay.motion.drawing import MotionDrawing
from sat_collision.replay.motion.prediction import Predictor
from sat_collision.replay.motion.tracker import KeyTracker, SetTracker, Step, Tracker
from sat_collision.replay.motion.trajectories import Poses, Trajectory
from sat_collision.scene.frames import Mapped
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import (
    FootprintSettings, in_ns, NONE, POLYGON_INSTANCE, Settings)
from sat_collision.scene.velocity import Command


class Sweep:
    """
    Decides one footprint against the steps of all sources that it monitors.

    `contacts` collects those of all footprints. The trajectory is kept for `keep` ns, and
    collisions are predicted up to the horizon, in s, if there is one. Bodies apart by up to the
    margin, in metres, count as in contact.
    """

    def __init__(self, settings: FootprintSettings, result: FootprintResult,
                 contacts: list[Contact], margin: float, keep: int,
                 horizon: float | None) -> None:
        self.settings = settings
        self.result = result
        self._names = [ObstacleId(settings.name, 0)]
        self._margin = margin
        self._keep = keep
        self.trajectory = Trajectory(settings)
        self.contacts = ContactResults(result, contacts, self.trajectory)
        self.prediction = (None if horizon is None
                           else Predictor(settings, self.trajectory, horizon, margin))
        self._contact_trackers: dict[str, ContactTracker] = {}
        # Steps to be decided once the trajectory is known.
        self._waiting: deque[tuple[ContactTracker, Step]] = deque()

    def describe(self, placements: Sequence[Placement]) -> list[Bodies]:
        """Return the samples that are about to be placed."""
        batch = SetBatch([[one] for one in placements], self.trajectory.longest)
        self.trajectory.batch = batch
        return [self.sample(batch, k) for k in range(len(placements))]

    def sample(self, batch: SetBatch, number: int = 0, is_between: bool = False) -> Bodies:
        return Bodies(self._names, batch, number, is_between=is_between)

    @property
    def is_decided(self) -> bool:
        """Whether it was ever decided against each source that had bodies."""
        return all(one.decided for one in self._contact_trackers.values())

    def undetermined(self, start: int, end: int,
                     trackers: Iterable[Tracker]) -> dict[str, list[Interval]]:
        """Return by footprint or source when it is not known how something of it moved."""
        found = defaultdict(list)
        known = joined(self.trajectory.known)
        found[self.settings.name] = [(first, last) for (_, first), (last, _) in pairwise(
            [(start, start), *known, (end, end)]) if first < last]
        for tracker in trackers:
            if self.settings.monitors(tracker.name):
                found[tracker.name] += tracker.undetermined
        for name, one in self._contact_trackers.items():
            found[name] += one.undetermined
        return found

    def queue(self, source: str, step: Step, now: int) -> None:
        """Queue a step of a source, which is decided once the trajectory is known."""
        one = self._contact_trackers.get(source)
        if one is None:
            if step.seen is not None and not len(step.seen):
                return
            one = self._contact_trackers[source] = ContactTracker(
                self.trajectory, self.contacts, self._margin)
        self._waiting.append((one, step))
        self._decide_known(now)

    def advance(self, now: int) -> None:
        """Decide the steps that can be decided, and drop data that is no longer needed."""
        self._decide_known(now)
        if self.trajectory.latest is not None:
            self.trajectory.drop_before(self.trajectory.latest - self._keep)
            if self.prediction:
                self.prediction.drop_before(self.trajectory.latest - self._keep)

    def _decide_known(self, now: int) -> None:
        """Decide the steps up to where the trajectory is known, or too old for another sample."""
        over, latest = now - 2 * self.trajectory.longest - 1, self.trajectory.latest
        known = over if latest is None else max(latest, over)
        while self._waiting and (finish := self._waiting[0][1].finish) <= known:
            self.trajectory.stand(finish)
            self._decide()

    def use_frame(self, frame_id: str, now: int) -> None:
        """Decide the steps in other frames: nothing links what was in these to a later sample."""
        if self.trajectory.latest is not None:
            self.trajectory.lose(now)
        while self._waiting and self._waiting[0][1].frame_id != frame_id:
            self._decide()

    def finish(self) -> None:
        """Decide all that is left."""
        while self._waiting:
            self._decide()
        for one in self._contact_trackers.values():
            one.finish()

    def _decide(self) -> None:
        one, step = self._waiting.popleft()
        one.decide(step)
        if self.prediction:
            self.prediction.look_ahead(step)


class RecordedMotion:
    """
    Decides whether footprints touched obstacles, from the placements in messages.

    The scene tells when footprints are unknown. Results are filled in, and so is a drawing, if
    given. Footprints with an outline in the parameters are placed by transforms. Without a
    horizon, in s, no collisions are predicted.
    """

    def __init__(self, settings: Settings, scene: Scene, transforms: TransformListener,
                 footprints: list[FootprintResult], horizon: float | None = None,
                 drawing: MotionDrawing | None = None) -> None:
        # In the order in which they are found; in the end, in that of their beginning.
        self.contacts: list[Contact] = []
        # Remarks for the report.
        self.notes: list[str] = []
        self._scene = scene
        # The times in which footprints are unknown, and in which only motion is not known.
        self._unknowns, self._undetermined = Unknowns(), Unknowns()
        self.unknown, self.undetermined = self._unknowns.intervals, self._undetermined.intervals
        # For how long (ns) the motion of something of a footprint or source is not known.
        self.undetermined_of: Counter[str] = Counter()
        self._start: int | None = None
        self._now = 0
        self._transforms = transforms
        self._drawing = drawing
        self._frame_id = settings.frame_id
        self._sources = {source.name: source for source in settings.obstacles}
        self._trackers: dict[str, Tracker] = {}
        keep = 3 * max((round(min(in_ns(source.timeout), LONGEST))
                        for source in settings.obstacles), default=0)
        self._sweeps = {result.name: Sweep(
            one, result, self.contacts, settings.margin, keep, horizon)
            for one, result in zip(settings.footprints, footprints)}

    def change(self, names: Iterable[str], now: int) -> None:
        """Take from the scene whether footprints are unknown from now on."""
        if self._start is None:
            self._start = now
        for name in names:
            reasons = list(self._scene.unknown_reasons(name))
            self._unknowns.follow(name, reasons, now)
            if not reasons:
                self._sweeps[name].result.ever_known = True

    def place(self, placements: Sequence[Placement]) -> None:
        """Process placements, given in the order of stamps."""
        sweeps, trackers = self._sweeps, self._trackers
        # None for those of a new tracker: it must not rest before its first placement.
        takers = [sweeps.get(one.name) or trackers.get(one.name) for one in placements]
        taken: defaultdict[Sweep | Tracker | None, list[Placement]] = defaultdict(list)
        for taker, placement in zip(takers, placements):
            taken[taker].append(placement)
        described: dict[object, Iterator[Any]] = {
            taker: iter(taker.describe(own)) if taker else repeat(None)
            for taker, own in taken.items()}
        for taker, placement in zip(takers, placements):
            if placement.stamp > self._now:
                self._now = placement.stamp
            bodies = next(described[taker])
            if isinstance(taker, Sweep):
                self._place_footprint(taker, placement, bodies)
            else:
                taker = taker or self._tracker(placement.name)
                taker.place(placement, bodies)

    def _tracker(self, name: str) -> Tracker:
        tracker = self._trackers.get(name)
        if tracker is None:
            source = self._sources[name]
            in_sets = (source.ending != NONE and source.timeout > 0.0
                       and source.type != POLYGON_INSTANCE)
            emit = partial(self._queue, name, [
                sweep for sweep in self._sweeps.values() if sweep.settings.monitors(name)])
            tracker = self._trackers[name] = (
                SetTracker(source, emit, partial(self._scene.is_broken, name)) if in_sets
                else KeyTracker(source, emit))
            tracker.use_frame(self._frame_id)
        return tracker

    def command(self, name: str, command: Command) -> None:
        """Pass a command on to the footprints whose commands have this name."""
        for sweep in self._sweeps.values():
            settings = sweep.settings.command
            if sweep.prediction and settings and settings.name == name:
                sweep.prediction.command(command)

    def lose(self, name: str, now: int) -> None:
        """Reset the pose of a footprint until its next message; obstacles stay where they are."""
        if name in self._sweeps:
            self._sweeps[name].trajectory.lose(now)

    def finish(self, end: int) -> None:
        """Decide all remaining steps at the end of the recording, and complete the results."""
        self._unknowns.finish(end)
        self._now = end
        for sweep in self._sweeps.values():
            sweep.trajectory.stand(end)
        latest = [sweep.trajectory.latest for sweep in self._sweeps.values()]
        # Obstacles after the last footprint are of no interest.
        last = max((time for time in latest if time is not None), default=end)
        for name, tracker in self._trackers.items():
            tracker.rest(last, True, self._scene.joined(name)[0])
        start = end if self._start is None else self._start
        for name, sweep in self._sweeps.items():
            result = sweep.result
            result.last = sweep.trajectory.newest
            sweep.finish()
            if self._drawing:
                self._drawing.show(name, sweep.trajectory)
            sweep.contacts.draw_curve(self.unknown)
            if sweep.prediction:
                sweep.prediction.finish(result, self.unknown)
            if result.ever_known and not sweep.is_decided:
                result.ever_known = False
                self.notes.append(f'{name}: at no time is it known where it and the obstacles '
                                  'are; --as-live tells what the monitor would have said')
            undetermined = sweep.undetermined(start, end, self._trackers.values())
            for of, intervals in undetermined.items():
                self.undetermined_of[of] = max(
                    length_of(intervals, start, result.last or end), self.undetermined_of[of])
            undetermined[''] = times_of(self.unknown, name)
            self._add_undetermined(name, undetermined, start, end)
        if self._drawing:
            self._drawing.finish(end)
        self.contacts[:] = joined_contacts(self.contacts)
        self.contacts.sort(key=attrgetter('first', 'footprint', 'obstacle'))

    def _add_undetermined(self, name: str, intervals: dict[str, list[Interval]], start: int,
                          end: int) -> None:
        """Record when motion was not known, by whose it was; but for what has an empty name."""
        within = ((max(first, start), min(last, end), of) for of, times in intervals.items()
                  for first, last in joined(times))
        events = sorted(event for first, last, of in within if first < last
                        for event in ((first, True, of), (last, False, of)))
        active: set[str] = set()
        for time, changes in groupby(events, itemgetter(0)):
            for _, is_begin, of in changes:
                (active.add if is_begin else active.discard)(of)
            self._undetermined.follow(
                name, () if '' in active else
                [f'it is not known how {"it" if of == name else f"something of {of}"} moved'
                 for of in sorted(active)], time)
        self._undetermined.finish(end)

    def _place_footprint(self, sweep: Sweep, placement: Placement, sample: Bodies) -> None:
        if placement.frame_id != self._frame_id:
            before, self._frame_id = self._frame_id, placement.frame_id
            for name, tracker in self._trackers.items():
                if before:
                    tracker.rest(self._now, True, self._scene.joined(name)[0])
                tracker.use_frame(self._frame_id)
            for other in self._sweeps.values():
                other.use_frame(self._frame_id, self._now)
        trajectory, stamp = sweep.trajectory, placement.stamp
        begin = trajectory.begin_of_link(stamp) if sweep.settings.has_outline else None
        if begin is not None and self._is_static(sweep.settings.frame_id, stamp):
            # Where the transform is another one now, it jumps.
            self._add(sweep, trajectory.standing(stamp))
        elif begin is not None:
            poses = Poses(self._transforms, sweep.settings.frame_id,
                          placement.single).between(begin, stamp)
            if poses is None:
                trajectory.lose(begin)
            for time, affine in poses or ():
                self._add(sweep, sweep.sample(SetBatch(
                    [[placement._replace(stamp=time, affine=affine)]]), is_between=True))
        self._add(sweep, sample)
        for tracker in self._trackers.values():
            tracker.rest(self._now)
        sweep.advance(self._now)

    def _is_static(self, frame_id: str, now: int) -> bool:
        """Return whether only static transforms say where a frame is."""
        found = self._transforms.lookup_affine(frame_id, 0, now)
        return isinstance(found, Mapped) and found.at is None

    def _add(self, sweep: Sweep, sample: Bodies) -> None:
        sweep.trajectory.add(sample)
        if self._drawing:
            self._drawing.show(sweep.settings.name, sweep.trajectory)

    def _queue(self, source: str, concerned: Iterable[Sweep], step: Step) -> None:
        """Draw a step of a source, and queue it for the footprints that monitor that."""
        if self._drawing:
            self._drawing.follow(source, step)
        for sweep in concerned:
            sweep.queue(source, step, self._now)

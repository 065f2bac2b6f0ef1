# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where recorded motion has the bodies at chosen moments."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from sat_collision.replay.model.keyframes import Keyframes, ShownBody
from sat_collision.replay.motion.bodies import Floats, LinearMotion
from sat_collision.replay.motion.tracker import Step
from sat_collision.replay.motion.trajectories import Trajectory
from sat_collision.scene.obstacles import ObstacleId


class _LastSample(NamedTuple):
    """Where and when an obstacle was last, its name, and the body that shows it."""

    time: int
    name: str
    ring: Floats
    body: ShownBody


class MotionDrawing:
    """
    Fills keyframes, at moments given in their order, with the motion that decides contacts.

    A body whose motion is not known is shown at its last place, and marked so.
    """

    def __init__(self, moments: Sequence[int]) -> None:
        self.keyframes = Keyframes(moments)
        self._samples: defaultdict[str, dict[ObstacleId, _LastSample]] = defaultdict(dict)
        self._footprints: dict[str, ShownBody] = {}
        self._next: dict[str, int] = {}

    def follow(self, source: str, step: Step) -> None:
        """Show the bodies of a source in a step."""
        samples = self._samples[source]
        arrived: dict[ObstacleId, ShownBody] = {}
        for motion in step.motions:
            for i, row in enumerate(motion.rows.tolist()):
                name = motion.before.names[row]
                sample = samples.get(name)
                if sample is None:
                    continue
                self._move(sample, motion, i)
                if motion.after is step.seen:
                    arrived[motion.after.names[motion.next_rows[i]]] = sample.body
                    del samples[name]
                else:
                    samples[name] = sample._replace(time=int(motion.finishes[i]))
        seen = step.seen
        end = seen.begin if seen is not None and len(seen) else step.finish
        for name in list(samples) if step.gone is None else step.gone:
            if name in samples:
                self._hold(samples.pop(name), end if step.gone is None else step.finish)
        if seen is None:
            return
        for row, (name, stamp) in enumerate(zip(seen.names, seen.stamps.tolist())):
            body = arrived.get(name)
            if body is None and name in samples:
                self._hold(samples[name], stamp)
                body = samples[name].body
            samples[name] = _LastSample(stamp, str(name), seen.ring(row),
                                        body or self.keyframes.add())

    def show(self, name: str, trajectory: Trajectory) -> None:
        """Show a footprint on its trajectory, as far as that is known so far."""
        if trajectory.latest is None:
            return
        until = bisect_right(self.keyframes.moments, trajectory.latest)
        for number in range(self._next.get(name, 0), until):
            outline = trajectory.outline(self.keyframes.moments[number])
            if outline is not None:
                if name not in self._footprints:
                    self._footprints[name] = self.keyframes.add(is_footprint=True)
                self._footprints[name].show(number, number + 1, name, outline.vertices)
            else:
                self._lose(name, number + 1)
        self._next[name] = max(until, self._next.get(name, 0))

    def finish(self, end: int) -> None:
        """Show the remaining bodies at their last places until the end."""
        for samples in self._samples.values():
            for sample in samples.values():
                self._hold(sample, end + 1)
        for name in self._footprints:
            self._lose(name, len(self.keyframes.moments))
        # Others came and went between two moments.
        self.keyframes.bodies = [body for body in self.keyframes.bodies if body.spans]

    def _move(self, sample: _LastSample, motion: LinearMotion, i: int) -> None:
        start, finish = int(motion.starts[i]), int(motion.finishes[i])
        first, end = self.keyframes.number(start), self.keyframes.number(finish)
        if not motion.moved[i]:
            sample.body.show(first, end, sample.name, motion.ring(i, start))
            return
        for number in range(first, end):
            ring = motion.ring(i, self.keyframes.moments[number])
            sample.body.show(number, number + 1, sample.name, ring)

    def _hold(self, sample: _LastSample, end: int) -> None:
        """Show an obstacle at its last place, until before a time."""
        first, until = self.keyframes.number(sample.time), self.keyframes.number(end)
        if first < until and self.keyframes.moments[first] == sample.time:
            sample.body.show(first, first + 1, sample.name, sample.ring)
        sample.body.show(first, until, sample.name, sample.ring, known=False)

    def _lose(self, name: str, end: int) -> None:
        """Show a footprint at its last place, until before a moment."""
        body = self._footprints.get(name)
        if body is not None and body.spans:
            body.show(0, end, name, body.spans[-1].ring, known=False)

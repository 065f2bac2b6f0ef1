# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recorded motion in a temporary file, made into keyframes once their moments are known."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from sat_collision.replay.model.keyframes import Keyframes, ShownBody, Tape
from sat_collision.replay.motion.bodies import Floats, LinearMotion, LONGEST
from sat_collision.replay.motion.tracker import Step
from sat_collision.replay.motion.trajectories import Trajectory
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings


class MotionTape(Tape):
    """
    The motion by which contacts are decided, in a temporary file; see Tape.

    An event is the id of a tracker and a step of its source; or the name of a footprint and a
    sample of it, None if its pose is unknown until the next one.
    """

    def __init__(self, max_bytes: int, footprints: Sequence[FootprintSettings]) -> None:
        super().__init__(max_bytes)
        self._footprints = footprints

    def keyframes_at(self, moments: Sequence[int], end: int) -> Keyframes:
        """Return keyframes at some moments; the recording ends at a time in ns."""
        keyframes = Keyframes(moments)
        trajectories = {one.name: Trajectory(one) for one in self._footprints}
        filler = _Filler(keyframes)
        for key, event in self._events():
            if isinstance(event, Step):
                filler.follow(key, event)
                for trajectory in trajectories.values():
                    trajectory.stand(event.finish)
            elif event is None:
                trajectories[key].lose()
            else:
                trajectories[key].add(event.begin, event)
                filler.show(key, trajectories[key])
                trajectories[key].drop_before(event.begin - LONGEST)
        for name, trajectory in trajectories.items():
            trajectory.stand(end)
            filler.show(name, trajectory)
        filler.finish(end)
        return keyframes


class _Sight(NamedTuple):
    """Where and when an obstacle was last, its name, and the body that shows it."""

    time: int
    name: str
    ring: Floats
    body: ShownBody


class _Filler:
    """
    Fills keyframes with the recorded motion that contacts are decided by.

    A body whose motion is not known is shown at its last place, and marked so.
    """

    def __init__(self, keyframes: Keyframes) -> None:
        self._keyframes = keyframes
        self._sights: dict[int, dict[ObstacleId, _Sight]] = {}
        self._footprints: dict[str, ShownBody] = {}
        self._next: dict[str, int] = {}

    def follow(self, tracker: int, step: Step) -> None:
        """Show the bodies of a source in a step."""
        sights = self._sights.setdefault(tracker, {})
        arrived: dict[ObstacleId, ShownBody] = {}
        for motion in step.motions:
            for i, row in enumerate(motion.rows.tolist()):
                name = motion.before.names[row]
                sight = sights.get(name)
                if sight is None:
                    continue
                self._move(sight, motion, i)
                if motion.after is step.seen:
                    arrived[motion.after.names[motion.next_rows[i]]] = sight.body
                    del sights[name]
                else:
                    sights[name] = sight._replace(time=int(motion.finishes[i]))
        seen = step.seen
        end = seen.begin if seen is not None and len(seen) else step.finish
        for name in list(sights) if step.gone is None else step.gone:
            if name in sights:
                self._hold(sights.pop(name), end if step.gone is None else step.finish)
        if seen is None:
            return
        for row, (name, stamp) in enumerate(zip(seen.names, seen.stamps.tolist())):
            body = arrived.get(name)
            if body is None and name in sights:
                self._hold(sights[name], stamp)
                body = sights[name].body
            sights[name] = _Sight(stamp, str(name), seen.ring(row), body or self._keyframes.add())

    def show(self, name: str, trajectory: Trajectory) -> None:
        """Show a footprint on its trajectory, as far as that is known so far."""
        if trajectory.latest is None:
            return
        until = bisect_right(self._keyframes.moments, trajectory.latest)
        for number in range(self._next.get(name, 0), until):
            outline = trajectory.outline(self._keyframes.moments[number])
            if outline is not None:
                if name not in self._footprints:
                    self._footprints[name] = self._keyframes.add(is_footprint=True)
                self._footprints[name].show(number, number + 1, name, outline.vertices)
            else:
                self._lose(name, number + 1)
        self._next[name] = max(until, self._next.get(name, 0))

    def finish(self, end: int) -> None:
        """Show the remaining bodies at their last places until the end."""
        for sights in self._sights.values():
            for sight in sights.values():
                self._hold(sight, end + 1)
        for name in self._footprints:
            self._lose(name, len(self._keyframes.moments))
        # Others came and went between two moments.
        self._keyframes.bodies = [body for body in self._keyframes.bodies if body.spans]

    def _move(self, sight: _Sight, motion: LinearMotion, i: int) -> None:
        start, finish = int(motion.starts[i]), int(motion.finishes[i])
        first, end = self._keyframes.number(start), self._keyframes.number(finish)
        if not motion.moved[i]:
            sight.body.show(first, end, sight.name, motion.ring(i, start))
            return
        for number in range(first, end):
            ring = motion.ring(i, self._keyframes.moments[number])
            sight.body.show(number, number + 1, sight.name, ring)

    def _hold(self, sight: _Sight, end: int) -> None:
        """Show an obstacle at its last place, until before a time."""
        first, until = self._keyframes.number(sight.time), self._keyframes.number(end)
        if first < until and self._keyframes.moments[first] == sight.time:
            sight.body.show(first, first + 1, sight.name, sight.ring)
        sight.body.show(first, until, sight.name, sight.ring, known=False)

    def _lose(self, name: str, end: int) -> None:
        """Show a footprint at its last place, until before a moment."""
        body = self._footprints.get(name)
        if body is not None and body.spans:
            body.show(0, end, name, body.spans[-1].ring, known=False)

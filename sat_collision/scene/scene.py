# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The scene: the footprints and obstacles received, and the state of each footprint."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

from sat_collision.geometry.body.polygon import PackedBody, Polygon
from sat_collision.geometry.sets.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.evaluator import Changes, Evaluator
from sat_collision.scene.footprints import Footprint, Origin
from sat_collision.scene.frames import in_quotes
from sat_collision.scene.obstacle_store import OTHER_FRAME, Shape
from sat_collision.scene.path import FollowedPath, PathCheck
from sat_collision.scene.settings import BY_ANOTHER_CLOCK, EMPTY_POLYGON, FAR, NEVER, Settings
from sat_collision.scene.sources import Source
from sat_collision.scene.streams import CONTINUES, Endpoint
from sat_collision.scene.velocity import Command, Velocity, Vertices
from sat_collision.scene.view import SceneView

FROM_FUTURE = 'from the future'
OVERTAKEN = 'older than the last'

# The common frame is that of the footprints received in the last so many ns.
_AGREEMENT = 10**9
_DISABLED = 'checking is disabled'
_NO_CLOCK = ('no clock yet: the time reads 0, as with use_sim_time before the first /clock: '
             'publish /clock, or set use_sim_time to false')
_NOT_RECEIVED = 'has not been received yet'
_CHANGED = 'has not been received since its publisher changed'
_CLOCK_WAS_SET = 'has not been received since the clock was set'


class Scene(SceneView):
    """
    Footprints and obstacles, and the state of each footprint.

    A new body is checked against the bodies that it may meet; other contacts stay as they are.
    `Evaluator` has the rules of the states.

    Every method that takes `now` first lets time pass until then, as `pass_time` does. Times are
    ints in ns by one clock. A header stamp that is 0 or in the future counts as now. A body is a
    packed polygon, whose array may be reused once the method has returned. The number of a
    message is its sequence number among those of its publisher, None if unknown.
    """

    def __init__(self, settings: Settings, decides_contacts: bool = True) -> None:
        # The frame of all bodies: that of the settings, else the common frame of the footprints
        # received in the last second; empty until there is one.
        self.frame_id = settings.frame_id
        # Earliest time after which anything may change without a message.
        self.deadline: float = NEVER
        # Whether the motion of all footprints is tracked, not only where a state depends on it.
        self.tracks_motion = False
        # Called when a footprint has come into collision: where several messages were waiting for
        # a transform, the next one may end it.
        self.on_collision: Callable[[], None] | None = None
        # What the last checks of paths found, by name of the footprint.
        self.path_checks: dict[str, PathCheck] = {}
        # Whether contacts of footprints are decided; if not, only what is unknown is found.
        self._decides_contacts = decides_contacts
        self._now = 0
        self._latest = 0  # the latest time that was known when the clock stepped back
        self._clock_fault = ''  # why the clock cannot be trusted; empty if it can
        self._use(settings)
        self._contacts = Contacts(settings.margin)
        self.sources = {source.name: Source(source, self._contacts, self._future_tolerance)
                        for source in settings.obstacles}
        self._footprints = {footprint.name: Footprint(footprint)
                            for footprint in settings.footprints}
        self._receivers = {**self._footprints, **self.sources}
        self._evaluator = Evaluator(self._footprints, self.sources, self._contacts, settings)
        for footprint in self._footprints.values():
            self._invalidate(footprint, _NOT_RECEIVED)
        self._reevaluate_all()

    def _use(self, settings: Settings) -> None:
        self.settings = settings
        self._future_tolerance = round(settings.future_tolerance * 1e9)
        # The time in s within which a contact of a footprint is imminent, by its name.
        self.looking_ahead = {one.name: one.min_time_to_collision for one in settings.footprints
                              if one.min_time_to_collision}

    def update(self, settings: Settings) -> None:
        """
        Apply changed settings, with the same names, topics and types.

        A disabled footprint or source drops what it received: enabled again, it starts unknown.
        """
        self._use(settings)
        self._evaluator.use(settings)
        for source in settings.obstacles:
            self.sources[source.name].configure(source, self._future_tolerance, self._now)
        for new in settings.footprints:
            footprint = self._footprints[new.name]
            if new.enabled != footprint.settings.enabled:
                footprint.stream.interrupt()
                footprint.command = None
                self._invalidate(footprint, _NOT_RECEIVED)
            if (new.points, new.radius) != (footprint.settings.points, footprint.settings.radius):
                # What was tracked is another outline.
                footprint.motion.clear()
            monitored = footprint.settings.obstacles
            footprint.configure(new)
            if not new.min_time_to_collision:
                footprint.is_imminent = False
            if new.obstacles != monitored:
                self._contacts.decide(footprint)
        self._contacts.use_margin(settings.margin)
        self._contacts.changed.update(self._footprints.values())
        self.deadline = self._now - 1
        self.pass_time(self._now)

    def footprint(self, name: str, body: PackedBody, frame_id: str, stamp: int, now: int,
                  origin: Origin | None = None, number: int | None = None) -> str | None:
        """
        Receive a footprint, and its origin if it was transformed.

        Return the reason if it is refused: FROM_FUTURE, OTHER_FRAME or OVERTAKEN; the last leaves
        the footprint as it is.
        """
        if now != self._now:
            self.pass_time(now)
        footprint = self._footprints[name]
        if not footprint.settings.enabled:
            return None
        self.receive_number(name, number, now)
        if stamp > now and (problem := self.from_future(stamp)):
            self._invalidate(footprint, f'was refused: {problem}')
            self._evaluate()
            return FROM_FUTURE
        footprint.frame_id = frame_id
        footprint.received = now
        if frame_id != self.frame_id and not self.settings.frame_id:
            self._choose_frame()
        if frame_id != self.frame_id:
            self._invalidate(footprint, f'is not in the frame {in_quotes(self.frame_id)}')
            self._evaluate()
            return OTHER_FRAME
        time = stamp if stamp and stamp < now else now
        if footprint.time is not None and time < footprint.time and not (
                footprint.stale or footprint.timeout == NEVER or footprint.settings.has_outline):
            return OVERTAKEN
        if self._decides_contacts:
            self._contacts.place_footprint(footprint, body)
        footprint.origin = origin
        footprint.time, footprint.stamp = time, stamp or now
        if not self.is_tracked(name):
            # What was tracked before is not the last place any more.
            footprint.motion.clear()
        if footprint.fault or footprint.stale or time + footprint.timeout < now:
            footprint.fault = ''
            self._contacts.changed.add(footprint)
        elif time + footprint.timeout < self.deadline:
            self.deadline = time + footprint.timeout
        if self._contacts.changed:
            self._evaluate()
        return None

    def is_tracked(self, name: str) -> bool:
        """Return whether anything needs the motion of a footprint."""
        return self.tracks_motion or name in self.looking_ahead

    def track(self, name: str, vertices: Vertices, given: Velocity | None = None) -> None:
        """Track a footprint just received: its vertices in the order sent, velocity if given."""
        footprint = self._footprints[name]
        if footprint.time is not None:
            footprint.motion.place(footprint.stamp, vertices, given)

    def command(self, name: str, command: Command) -> None:
        self._footprints[name].command = command

    def note_command_fault(self, name: str, fault: str) -> None:
        """Record why no command of a footprint can come; empty if one can."""
        footprint = self._footprints[name]
        if fault != footprint.command_fault:
            footprint.command_fault = fault
            self._contacts.changed.add(footprint)
            self._evaluate()

    def look_ahead(self, name: str) -> None:
        """Predict whether a footprint is about to be in contact, see `Evaluator.look_ahead`."""
        self.deadline = min(self.deadline, self._evaluator.look_ahead(name, self._now))

    def check_path(self, name: str, path: FollowedPath, outline: Polygon) -> PathCheck:
        """Check the path of a footprint, whose outline is given in its own frame."""
        return path.check(self._footprints[name], outline, self._contacts)

    def obstacle(self, name: str, body: Shape | None, frame_id: str, stamp: int, now: int,
                 instance: int | None = None, number: int | None = None) -> str | None:
        """
        Receive a message of a source of obstacles, with the obstacle's id if the source gives ids.

        The body of an empty polygon is None. Return the reason if the message is refused:
        FROM_FUTURE, OTHER_FRAME, TOO_MANY or TOO_OLD.
        """
        if now != self._now:
            self.pass_time(now)
        source = self.sources[name]
        if not source.settings.enabled:
            return None
        faults, knowledge = source.faults, source.knowledge
        refused: str | None = None
        read: int | None = stamp
        if body is None and source.settings.set_end == EMPTY_POLYGON:
            # A mark ends a set whatever its stamp.
            read = min(stamp, now)
        elif stamp > now and (refused := self.from_future(stamp)):
            read = None
        elif body is not None and self.frame_id and frame_id != self.frame_id:
            refused = OTHER_FRAME
        refusal = source.receive(None if refused else body, frame_id, read, now, instance, number,
                                 refused)
        if read is None:
            refusal = FROM_FUTURE
        if body is None:
            # A mark may end a set that is older than itself, and than the set before.
            self.deadline = min(self.deadline, source.deadline)
        self._evaluate_obstacles(
            source, stamp if stamp and stamp < now else now,
            source.faults != faults or source.knowledge is not knowledge)
        return refusal

    def obstacle_run(self, name: str, run: Run, frame_id: str, stamp: int, now: int,
                     number: int | None) -> int:
        """Receive a run of obstacles of one stamp; return how many were added."""
        if self.frame_id and frame_id != self.frame_id:
            return 0
        if now != self._now:
            self.pass_time(now)
        source = self.sources[name]
        faults = source.faults
        added = source.receive_run(run, frame_id, stamp, number, now)
        if added:
            self._evaluate_obstacles(source, stamp, source.faults != faults)
        return added

    def _evaluate_obstacles(self, source: Source, time: int, has_new_faults: bool) -> None:
        """Evaluate what follows from obstacles received, which count from a time."""
        due = source.deadline if source.timeout == NEVER else time + source.timeout
        if due < self.deadline:
            self.deadline = due
        if has_new_faults:
            self._follow_up(source)
        elif self._contacts.changed:
            self._evaluate()

    def refuse(self, name: str, reason: str, now: int, stamp: int | None = None,
               instance: int | None = None, number: int | None = None) -> None:
        """
        Record a message of a footprint or source that gave no valid polygon.

        The reason has no figures; stamp and instance are None if they could not be read.
        """
        self.pass_time(now)
        if stamp is not None and self.from_future(stamp):
            stamp = None
        source = self.sources.get(name)
        if source is None:
            self.receive_number(name, number, now)
            self._invalidate(self._footprints[name], f'was refused: {reason}')
            self._evaluate()
        elif source.settings.enabled:
            source.receive(None, '', stamp, now, instance, number, reason)
            self._follow_up(source)

    def receive_number(self, name: str, number: int | None, now: int) -> None:
        footprint = self._footprints[name]
        if number is not None and footprint.stream.receive(number, now) is not CONTINUES:
            self.pass_time(now)
            if footprint.find_stream_faults(now):
                self._contacts.changed.add(footprint)
                self._evaluate()

    def update_publishers(self, name: str, endpoints: Sequence[Endpoint]) -> None:
        if source := self.sources.get(name):
            source.update_publishers(endpoints, self._now)
            self._follow_up(source)
        else:
            footprint = self._footprints[name]
            if footprint.stream.update(endpoints) and footprint.time is not None:
                self._invalidate(footprint, _CHANGED)
            if footprint.find_stream_faults(self._now):
                self._contacts.changed.add(footprint)
            self._evaluate()

    def wants_history(self, name: str) -> bool:
        """Return whether a map is needed again from the start, by a new subscription."""
        source = self.sources.get(name)
        return source is not None and source.settings.enabled and (
            source.knowledge.wants_history and not source.stream.faults())

    def renew(self, name: str) -> None:
        """Start a source anew: a new subscription receives all that its publisher keeps."""
        self.sources[name].renew(self._now)
        self._follow_up(self.sources[name])

    def interrupt(self, name: str) -> None:
        """Record that the next message of a name is not known to continue the one before."""
        self._receivers[name].stream.interrupt()

    def lose(self, name: str) -> None:
        """Record that messages were lost before the next one, if a source is told so."""
        if source := self.sources.get(name):
            source.stream.is_lossy = True

    def mix(self, name: str, is_mixed: bool) -> None:
        """Begin or end a time at which messages of a name may be of any publisher."""
        if source := self.sources.get(name):
            source.mix(is_mixed, self._now)
            self._follow_up(source)
        else:
            self._footprints[name].stream.interrupt()

    def wait(self, name: str, first: float) -> None:
        """Record the number of a source's first message that waits, NEVER if none does."""
        if source := self.sources.get(name):
            source.wait(first)
            self._follow_up(source)

    def receive_early(self, name: str, body: Shape | None, stamp: int, order: int,
                      instance: int | None, refusal: str | None) -> None:
        """
        Let an obstacle count that is queued behind a message which waits for its transform.

        The order is its number in the queue; the body is None if it is refused.
        """
        source = self.sources[name]
        if problem := self.from_future(stamp):
            body, refusal = None, problem
        source.receive_early(body, self.frame_id, stamp, self._now, order, instance, refusal)
        self._follow_up(source)

    def follow_frame(self, name: str, frame_id: str,
                     body_of: Callable[[Any], PackedBody | None]) -> None:
        """Place the obstacles of a map that were sent in a frame anew, where that is now."""
        self.sources[name].follow_frame(frame_id, body_of, self._now)
        self._follow_up(self.sources[name])

    def joined(self, name: str) -> tuple[int, int]:
        """Return which listing the last message of a source joined, and which is whole; or 0."""
        if name not in self.sources:
            return 0, 0
        knowledge = self.sources[name].knowledge
        return knowledge.joined, knowledge.last_whole

    def is_broken(self, name: str, listing: int) -> bool:
        """Return whether a listing of a source ended and was not whole."""
        return listing in self.sources[name].knowledge.broken

    def limit_frames(self, name: str, limits: Mapping[str, tuple[str, float]]) -> None:
        """Record by frame of a map why it cannot be followed, or '' and until when it can."""
        source = self.sources[name]
        if source.frame_limits != limits:
            source.frame_limits = {**limits}
            self._follow_up(source)

    def note_transforms(self, faults: tuple[str, ...]) -> None:
        """Record why transforms may be missing, in sentences."""
        for footprint in self._footprints.values():
            settings = footprint.settings
            if settings.has_outline and not settings.odometry and footprint.hints != faults:
                footprint.hints = faults
                self._contacts.changed.add(footprint)
        self._evaluate()

    def stop_clock(self, fault: str) -> None:
        """Record why the clock cannot be trusted: nothing may become too old; empty if it can."""
        if fault != self._clock_fault:
            self._clock_fault = fault
            self._reevaluate_all()

    def pass_time(self, now: int) -> None:
        """
        Let time pass: bodies become too old, sources fall silent.

        By a step back of more than `future_tolerance` (a recording starts again, a simulation is
        reset) all begins anew, as by `set_clock`.
        """
        last, self._now = self._now, now
        if 0 < last <= now <= self.deadline:
            return
        if now < last:
            self._latest = max(self._latest, last)
            if self.is_set_back(now):
                self.set_clock(now)
        for footprint in self._footprints.values():
            footprint.limit_times(now)
            if footprint.deadline < now:
                self._contacts.changed.add(footprint)
        for source in self.sources.values():
            if source.deadline < now:
                source.pass_time(now)
        self.deadline = min(chain(
            (source.deadline for source in self.sources.values()),
            (footprint.deadline for footprint in self._footprints.values()
             if footprint not in self._contacts.changed)), default=NEVER)
        self._reevaluate_all()

    def is_set_back(self, now: int) -> bool:
        """Return whether a clock that reads `now` went back by more than `future_tolerance`."""
        return now < max(self._latest, self._now) - self._future_tolerance

    def use_middleware(self, name: str) -> None:
        """Name the middleware where it gives no sequence numbers."""
        for source in self.sources.values():
            source.middleware = name

    def take_changes(self) -> Changes:
        """Return what has changed since the last call."""
        return self._evaluator.take_changes()

    def take_moved(self) -> set[str]:
        """Return which footprints in contact moved since the last call, or what they touch."""
        moved = {footprint.settings.name for footprint in self._contacts.moved}
        self._contacts.moved.clear()
        return moved

    def set_clock(self, now: int) -> None:
        """Begin anew, because the clock was set: the times of all that is there are of another."""
        self._now, self._latest = now, 0
        self.frame_id = self.settings.frame_id
        for footprint in self._footprints.values():
            footprint.set_back(now)
            self._invalidate(footprint, _CLOCK_WAS_SET)
        for source in self.sources.values():
            source.set_back(now)
        # What follows from it is due.
        self.deadline = -NEVER

    def from_future(self, stamp: int) -> str | None:
        """Return why a stamp from the future is refused, None for another stamp."""
        if not 0 < self._now < stamp - self._future_tolerance:
            return None
        return FROM_FUTURE if stamp <= self._now + FAR else f'{FROM_FUTURE}, {BY_ANOTHER_CLOCK}'

    def _choose_frame(self) -> None:
        """Use the common frame of the footprints received recently, if there is one."""
        frames = {footprint.frame_id for footprint in self._footprints.values()
                  if footprint.received is not None
                  and footprint.received >= self._now - _AGREEMENT}
        if len(frames) != 1 or self.frame_id in frames:
            return
        self.frame_id, = frames
        for footprint in self._footprints.values():
            if footprint.time is not None and footprint.frame_id != self.frame_id:
                self._invalidate(footprint, f'is not in the frame {in_quotes(self.frame_id)}')
        for source in self.sources.values():
            source.refuse_other_frames(self.frame_id, self._now)
            source.find_faults(self._now)
        self._reevaluate_all()

    def _invalidate(self, footprint: Footprint, fault: str) -> None:
        footprint.time = None
        footprint.motion.clear()
        footprint.fault = fault
        self._contacts.remove_footprint(footprint)
        self._contacts.changed.add(footprint)

    def _follow_up(self, source: Source) -> None:
        """Evaluate what follows from a change in a source."""
        source.find_faults(self._now)
        self.deadline = min(self.deadline, source.deadline)
        self._reevaluate_all()

    def _reevaluate_all(self) -> None:
        """Update the faults, and evaluate the footprints for which something has changed."""
        self._evaluator.find_faults(
            _DISABLED if not self.settings.enabled else _NO_CLOCK if not self._now
            else self._clock_fault)
        self._evaluate()

    def _evaluate(self) -> None:
        """Evaluate the footprints for which something has changed."""
        self.deadline = min(self.deadline, self._evaluator.evaluate(self._now))
        if self.on_collision and self._evaluator.collided:
            self.on_collision()

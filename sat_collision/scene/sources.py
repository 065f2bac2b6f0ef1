# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sources of obstacles: whether all that each one sent is known, its obstacles and its faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from sat_collision.geometry.body.polygon import PackedBody
from sat_collision.geometry.sets.run import Run
from sat_collision.scene.contacts import Contacts
from sat_collision.scene.knowledge import Listings, LOSS, Message, Refreshed
from sat_collision.scene.obstacle_store import (
    ObstacleGroup, ObstacleStore, OTHER_FRAME, SetGroup, Shape)
from sat_collision.scene.settings import (
    BY_ANOTHER_CLOCK, EACH_MESSAGE, EMPTY_POLYGON, FAR, in_ns, NEVER, NEW_STAMP, NONE,
    ObstacleSettings, POLYGON_COLLECTION, POLYGON_INSTANCE)
from sat_collision.scene.streams import BEGUN, CONTINUES, Endpoint, JOINED, Stream
from sat_collision.scene.velocity import MotionTracker, Vertices

TOO_OLD = 'too old'
_MOVED = 'a part of it is not valid where its frame has moved'
_OLD_FRAME = 'is a map in a frame whose transform is too old'

# Max groups of obstacles kept that were told before knowledge began anew.
_MAX_FORMER = 100
_RULES = {NONE: 'timeout', EMPTY_POLYGON: 'empty polygon', NEW_STAMP: 'new stamp',
          EACH_MESSAGE: 'each message'}

_Knowledge: TypeAlias = Listings | Refreshed


class Source:
    """
    One topic of obstacles: its stream, what is known of it, and the obstacles themselves.

    The obstacles of an interrupted listing stay until their timeout, beside those of the next
    one; without a timeout, until that is whole.

    Times are in ns. A message counts from its stamp, or from now if that is 0 or in the future.
    Clocks may differ by the tolerance.
    """

    def __init__(self, settings: ObstacleSettings, contacts: Contacts, tolerance: int) -> None:
        self.store = ObstacleStore(settings.name, contacts)
        self.stream = Stream()
        self.middleware = 'its middleware'
        # Why the source cannot be trusted, as sentences; empty if it can.
        self.faults: tuple[str, ...] = ()
        # By frame of a map: why it cannot be followed, as the end of a sentence; empty if it can,
        # until when.
        self.frame_limits: dict[str, tuple[str, float]] = {}
        # The number in its queue of the first message that waits for its transform, NEVER if none
        # does. Obstacles that are queued behind it, in groups, each after its last one's number.
        self._first: float = NEVER
        self._early: list[tuple[int, SetGroup]] = []
        self._is_early_open = False  # whether the last group is still filled
        self._early_refusal = -1, ''  # number and reason of the last one that was refused
        self._former: list[ObstacleGroup] = []  # of listings that were interrupted
        self._mixed: SetGroup | None = None  # while the publishers change: what any of them sends
        self._is_far = False  # whether stamps are those of another clock, see FAR
        self._was_known = False  # when faults were last found
        self._use(settings, tolerance)
        # What is known of its publisher: a new object whenever that starts over.
        self.knowledge: _Knowledge = self._new_knowledge()
        self.find_faults(0)

    def _use(self, settings: ObstacleSettings, tolerance: int) -> None:
        self.settings, self._tolerance = settings, tolerance
        self.timeout = self.stream.timeout = in_ns(settings.timeout)
        self.store.max_count = settings.max_count

    def _new_knowledge(self) -> _Knowledge:
        return (Refreshed if self.settings.ending == NONE else Listings)(
            self.store, self.settings, self._tolerance)

    def configure(self, settings: ObstacleSettings, tolerance: int, now: int) -> None:
        """Apply settings; a disabled source drops all that it has received."""
        before = self.settings
        self._use(settings, tolerance)
        if settings.enabled != before.enabled:
            self.stream.interrupt()
            self._begin_anew(now)
            self._drop_former(all_of_them=True)
        if not settings.moving:
            for obstacle in self.store:
                obstacle.motion = None
        self.knowledge.configure(settings, tolerance, now)
        self.pass_time(now)
        self.request_history()

    @property
    def rule(self) -> str:
        """The rule by which its obstacles are known, in words."""
        has_ids = self.settings.type == POLYGON_INSTANCE and self.settings.ending == NONE
        return 'ids' if has_ids else _RULES[self.settings.ending]

    @property
    def _lacks_numbers(self) -> bool:
        """Whether a loss that matters would not be seen."""
        return not self.stream.is_numbered and self.settings.ending != EACH_MESSAGE

    @property
    def summary(self) -> str:
        """What is known of it, in words."""
        if not self.settings.enabled:
            return 'disabled'
        knowledge = self.knowledge
        count = f'{knowledge.count} polygon{"s" * (knowledge.count != 1)}'
        rule = f'by {self.rule}'
        if self._lacks_numbers and self.settings.assume_no_loss:
            rule += ', assuming that none was lost'
        if isinstance(knowledge, Refreshed):
            return f'{count} of the last {self.settings.timeout:g} s, {rule}'
        rate = f', {knowledge.rate:.3g} listings/s' if knowledge.rate else ''
        return f'{count} of the last whole listing{rate}, {rule}'

    @property
    def advice(self) -> str:
        """How obstacles that have gone are released sooner, empty if they are at once."""
        knowledge = self.knowledge
        if not isinstance(knowledge, Refreshed) or self.settings.type == POLYGON_INSTANCE:
            return ''
        advice = (f'obstacles of source {self.settings.name} are released only '
                  f'{self.settings.timeout:g} s after they were last sent: to release them at '
                  'once, send an empty polygon after the last one of each set, and set '
                  f'{self.settings.name}.set_end: {EMPTY_POLYGON}')
        if knowledge.together:
            advice += (f'; {knowledge.together} polygons come with each stamp: if that is always '
                       f'all, set_end: {NEW_STAMP} does so, too')
        return advice

    def request_history(self) -> None:
        """Request a map again of which something is missing, as it may be taken now."""
        if self.timeout == NEVER and not self.knowledge.is_known:
            self.knowledge.wants_history = True

    @property
    def deadline(self) -> float:
        """Time in ns after which something changes without a message."""
        return min(self.knowledge.deadline, self.stream.mixed_until, self.stream.again_until,
                   *(until for _, until in self.frame_limits.values()),
                   *(group.oldest + self.timeout for group in self._former))

    def pass_time(self, now: int) -> None:
        """Let time pass: drop obstacles that are too old."""
        self.stream.pass_time(now)
        self.knowledge.pass_time(now)
        for frame_id, (_, until) in self.frame_limits.items():
            if until < now:
                self.frame_limits[frame_id] = _OLD_FRAME, NEVER
        for group in self._former:
            group.forget_before(now - self.timeout)
        self._drop_former()
        self.find_faults(now)

    def set_back(self, now: int) -> None:
        """Begin anew because the clock was set; what was told counts for one more timeout."""
        self.stream.set_back(now)
        if self.timeout < NEVER:
            self.stream.interrupt()
            self._count_from(now)
            self._begin_anew(now)
            self.knowledge.since = 'since the clock was set'
        # Those of its frames are by the clock of before.
        self.frame_limits = {frame_id: (fault, now - 1 if until < NEVER else NEVER)
                             for frame_id, (fault, until) in self.frame_limits.items()}
        self.pass_time(now)

    def update_publishers(self, endpoints: Sequence[Endpoint], now: int) -> None:
        """Update the publishers; a change of them may start over what is known."""
        if self.stream.update(endpoints):
            self._begin_anew(now, wants_history=True)
            self.stream.limit_again(now)
        self._drop_former()

    def renew(self, now: int) -> None:
        """Start over with a new subscription, to which the publisher sends all that it keeps."""
        self.stream.restart(now)
        self._begin_anew(now)

    def mix(self, is_mixed: bool, now: int) -> None:
        """
        Begin or end a time at which messages may be of any publisher, because these change.

        What comes then counts as obstacles that were told before, and ends nothing.
        """
        self.stream.interrupt()
        self._begin_anew(now, wants_history=not is_mixed)
        self._mixed = self.store.new_set() if is_mixed else None
        if self._mixed is not None:
            self._former.append(self._mixed)

    def wait(self, first: float) -> None:
        """Record the number of the first message that waits, NEVER if none does."""
        self._first = first
        for last, group in self._early:
            if last < first:
                group.clear()
        self._early = [one for one in self._early if one[0] >= first]
        self._is_early_open = False

    def receive_early(self, body: Shape | None, frame_id: str, stamp: int, now: int,
                      order: int, instance: int | None, refusal: str | None) -> None:
        """Let an obstacle count that is queued, by its number, behind a message that waits."""
        if not refusal:
            if not self._is_early_open:
                self._early.append((order, self.store.new_set()))
                self._is_early_open = True
            last, group = self._early[-1]
            self._early[-1] = max(last, order), group
            refusal = group.add(body, frame_id, min(stamp or now, now), instance)
        if refusal:
            self._early_refusal = order, refusal

    def follow_frame(self, frame_id: str, body_of: Callable[[Any], PackedBody | None],
                     now: int) -> None:
        """Place the obstacles of a map that were sent in a frame anew, where that is now."""
        for group in self.store.groups:
            if frame_id in group.frames and not group.place_anew(frame_id, body_of):
                self.knowledge.miss(_MOVED, now, group)

    def receive(self, body: Shape | None, frame_id: str, stamp: int | None, now: int,
                instance: int | None, number: int | None,
                refusal: str | None = None) -> str | None:
        """
        Receive a message; return the reason if it is refused, by the caller or here.

        The body of an empty polygon, or of a message that the caller refuses, is None; so is a
        stamp that could not be read or cannot be trusted. One past its timeout counts, but makes
        nothing known, and TOO_OLD is returned.
        """
        time = min(stamp or now, now)
        is_old = time + self.timeout < now
        if is_old or self._is_far:
            self._is_far = is_old and (self._is_far or now - time > FAR)
        if self._mixed is not None:
            return refusal or (self._mixed.add(body, frame_id, time) if body is not None else None)
        # The start of a map may be kept by its publisher, unless this is all that it keeps.
        wants_history = self.knowledge.wants_history or self.stream.last > 0
        continuity = self.stream.receive(number, now)
        is_mark = body is None and not refusal and self.settings.set_end == EMPTY_POLYGON
        if continuity is JOINED or continuity is BEGUN:
            self._begin_anew(now, wants_history=wants_history and continuity is JOINED)
        elif stamp and stamp + self.timeout < self.knowledge.newest and not is_mark:
            # The clock of its publisher was set back.
            self._count_from(now)
            self._begin_anew(now)
            self.knowledge.miss('its stamps fell by more than its timeout', now)
        knowledge = self.knowledge
        if refusal and stamp is None:
            knowledge.refuse(refusal, now, is_read=False)
        else:
            message = Message(continuity, stamp or now, time, bool(stamp), body, frame_id, refusal,
                              instance)
            if body is None and not refusal:
                knowledge.end(message, now)
            else:
                refusal = knowledge.receive(message, now)
        self._drop_former()
        if is_old:
            refusal = refusal or (None if is_mark else TOO_OLD)
            if not knowledge.is_known:
                knowledge.pass_time(now)
        if knowledge.is_known is not self._was_known or continuity is not CONTINUES or (
                self.faults or refusal):
            self.find_faults(now)
        return refusal

    def track(self, instance: int, stamp: int, vertices: Vertices) -> None:
        """Track an obstacle by its id, vertices in the order sent, unless it is newer."""
        by_id = self.knowledge.by_id if isinstance(self.knowledge, Refreshed) else None
        if by_id is not None and (obstacle := by_id.stamped(instance, stamp)):
            obstacle.motion = obstacle.motion or MotionTracker()
            obstacle.motion.place(stamp, vertices)

    def receive_run(self, run: Run, frame_id: str, stamp: int, number: int | None,
                    now: int) -> int:
        """
        Receive messages of one stamp as `receive` would one by one; return how many were added.

        The next one may be refused, may meet a footprint, or may end the set, and must be received
        by itself.
        """
        knowledge, stream = self.knowledge, self.stream
        if (stream.is_interrupted or number not in (None, stream.last + 1) or stream.is_lossy
                or self._is_far or not 0 < stamp <= now <= stamp + self.timeout
                or stamp + self.timeout < knowledge.newest):
            return 0
        added = knowledge.receive_run(run, frame_id, stamp, now)
        if added:
            # All before the last one continued the stream.
            stream.last += added - 1
            stream.receive(number and stream.last + 1, now)
            if self.faults or knowledge.is_known is not self._was_known:
                self.find_faults(now)
        return added

    def refuse_other_frames(self, frame_id: str, now: int) -> None:
        """Refuse obstacles in other frames, received before the common frame was known."""
        for group in self.store.groups:
            if group.forget_other_frames(frame_id):
                self.knowledge.miss(f'a message was refused: {OTHER_FRAME}', now, group)

    def _begin_anew(self, now: int, wants_history: bool = False) -> None:
        """Begin to know anew; obstacles received before stay until their timeout."""
        for group in self.knowledge.groups:
            group.forget_before(now - self.timeout)
            if group.oldest < NEVER:
                self._former.append(group)
            else:
                group.clear()
        self.knowledge = self._new_knowledge()
        self.knowledge.wants_history = wants_history and self.timeout == NEVER
        while len(self._former) > _MAX_FORMER:
            self._former.pop(0).clear()
            self.knowledge.miss('it began anew too often', now)
        self._drop_former()

    def _count_from(self, now: int) -> None:
        """Let all that was received before count from now: its times are of another clock."""
        for group in self.store.groups:
            group.set_times(now)

    def _drop_former(self, all_of_them: bool = False) -> None:
        """Drop former groups that have expired or are replaced."""
        is_replaced = all_of_them or (
            self.timeout == NEVER and self.knowledge.is_known and self.stream.is_alone
            and not self.stream.is_again)
        for group in [*self._former]:
            if group is not self._mixed and (is_replaced or group.oldest == NEVER):
                self._former.remove(group)
                group.clear()

    def find_faults(self, now: int) -> None:
        """Update the faults of the source."""
        if self._was_known and not self.knowledge.is_known:
            # Obstacles kept while the last whole listing was valid may be too old.
            self.knowledge.pass_time(now)
        self._was_known = self.knowledge.is_known
        self.faults = ()
        if self.settings.enabled:
            words = self.stream.faults()
            if self._lacks_numbers and not self.settings.assume_no_loss:
                words.append(
                    f'has no sequence numbers, which {self.middleware} does not give, so that a '
                    'loss would not be seen: send each set as one message, with type '
                    f'{POLYGON_COLLECTION}, or use another middleware, or promise that nothing is '
                    'lost with assume_no_loss: true')
            problem = self.knowledge.problem(now)
            if problem and not words:
                if self._is_far:
                    problem = f'has stamps that are {BY_ANOTHER_CLOCK}'
                words = ['; '.join((problem, *self.stream.hints(LOSS in problem)))]
            if self.frame_limits:
                words += sorted({fault for frame_id in self.store.frames
                                 if (fault := self.frame_limits.get(frame_id, ('', NEVER))[0])})
            if self._first < NEVER and self.timeout == NEVER:
                words.append('waits for the transform of a part of its map')
            number, refusal = self._early_refusal
            if self._first <= number:
                words.append(f'sent what was refused: {refusal}')
            self.faults = tuple(
                f'obstacle source {self.settings.name} on {self.settings.topic} {word}'
                for word in words)

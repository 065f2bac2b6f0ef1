# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The core that the node and the replay tool share: serialised messages in, states out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial

from sat_collision.messages.ingest import Batch, Ingest, Placement, Wait
from sat_collision.messages.outlines import Commands, Outlines
from sat_collision.messages.paths import Paths
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.messages.waiting import Held, WaitingItems
from sat_collision.scene.frames import NoTransform
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import NEVER, Settings
from sat_collision.scene.streams import Endpoint


class Monitor:
    """
    Receives serialised messages and updates the scene.

    An unusable message never raises: it is counted and returned as a Rejection. It counts in the
    scene, too, because it stands for a body at an unknown place.

    A message in another frame than the fixed one waits until the transform at its stamp has
    arrived; later messages of the same footprint or source queue behind it. After
    `transform_timeout` it is refused. Calls that end a wait also return the Rejections of the
    messages that had waited. A footprint that has an outline moves with its frame.

    Times are in ns by the clock of the header stamps. The number of a message is its sequence
    number among those of its publisher, None if unknown. One of stamp 0 counts from the time at
    which it `arrived`: earlier than now if it was queued.

    Parameters
    ----------
    settings : Settings
    transforms : bool, optional
        Whether /tf is received; if not, messages in other frames are refused.
    placements : list of Placement, optional
        Receives the accepted messages.
    decides_contacts : bool, optional
        Whether the scene decides contacts; if not, only what is unknown is found.
    max_non_convex : int, optional
        The most vertices accepted of a non-convex polygon, if fewer than of others.

    """

    def __init__(self, settings: Settings, transforms: bool = False,
                 placements: list[Placement] | None = None,
                 decides_contacts: bool = True, max_non_convex: int | None = None) -> None:
        self.scene = Scene(settings, decides_contacts)
        # Number of messages by name of the footprint or source; for an outline, of its poses.
        self.received: Counter[str] = Counter()
        self.transforms = TransformListener(settings)
        has_transforms = transforms or any(one.odometry for one in settings.footprints)
        self.ingest = Ingest(settings, self.scene, self.transforms if has_transforms else None,
                             placements, max_non_convex)
        # Number of refused messages, by (name, reason).
        self.rejected = self.ingest.rejected
        self.outlines = Outlines(settings, self.ingest, self.transforms, self.received)
        self.commands = Commands(settings, self.ingest, self.scene)
        self.paths = Paths(self.ingest, self.scene, self.transforms, self.outlines)
        self.waiting = WaitingItems(settings, self.ingest, self.scene)
        self._now = 0

    def update(self, settings: Settings) -> list[Rejection]:
        """Apply changed settings, with the same names, topics and types."""
        for one in settings.inputs:
            if one.enabled != self.scene.settings_of(one.name).enabled:
                self.waiting.renew(one.name)
        self.waiting.configure(settings)
        self.transforms.configure(settings)
        self.outlines.configure(settings)
        self.scene.update(settings)
        self._follow_maps(self._now)
        return self.outlines.follow(self._now)

    def receive(self, name: str, data: bytes, now: int,
                number: int | None = None) -> Rejection | None:
        """
        Receive a message for a footprint, source or command; ignore it if that is disabled.

        It is a serialised PolygonStamped, PolygonInstanceStamped, Odometry or TwistStamped.
        """
        rejections = self.receive_batch(name, (data,), now, number)
        return rejections[0] if rejections else None

    def receive_batch(self, name: str, messages: Sequence[bytes], now: int,
                      number: int | None = None, arrived: int | None = None) -> list[Rejection]:
        """
        Receive consecutive messages of one publisher as `receive` does.

        The number is that of the first message, which `arrived` then, by default now.
        """
        self.received[name] += len(messages)
        self._pass_time(now)
        arrived = now if arrived is None else arrived
        if name in self.commands.names:
            return self.commands.receive(name, messages, now, arrived)
        if name in self.paths.names:
            self.paths.receive(name, messages[-1])
            return []
        rejections: list[Rejection] = []
        batch = Batch(messages, number) if name in self.ingest.headers else None
        applied = 0
        while applied < len(messages):
            if batch and name not in self.waiting and (
                    run := self.ingest.apply_run(name, batch, applied, now)):
                applied += run
            else:
                rejections += self._admit(
                    name, messages[applied], number and number + applied, now, arrived)
                applied += 1
        return rejections

    def receive_run(self, name: str, batch: Batch, begin: int, now: int) -> int:
        """
        Receive messages of one stamp of a batch, from `begin` on; return how many were applied.

        The next one must be received by itself. `now` is when the first one came; until the last
        one came none may be too old, and nothing may be due. While a source has faults none is
        applied, because the words of these may change with each message.
        """
        self._pass_time(now)
        applied = 0 if name in self.waiting or self.scene.source_faults else (
            self.ingest.apply_run(name, batch, begin, now))
        self.received[name] += applied
        return applied

    def receive_mixed(self, name: str, messages: Sequence[bytes], now: int,
                      arrived: int | None = None) -> list[Rejection]:
        """
        Receive messages while one more publisher was matched with the topic.

        They may be of either, so obstacles count, but end and replace nothing.
        """
        self._follow_stream(name, partial(self.scene.mix, name, True))
        rejections = self.receive_batch(name, messages, now, arrived=arrived)
        self._follow_stream(name, partial(self.scene.mix, name, False))
        return rejections

    def update_publishers(self, name: str, endpoints: list[Endpoint]) -> None:
        """Update the publishers of a footprint or source."""
        self._follow_stream(name, partial(self.scene.update_publishers, name, endpoints))

    def interrupt(self, name: str) -> None:
        """Record that the next message of a name is not known to continue the one before."""
        self._follow_stream(name, partial(self.scene.interrupt, name))

    def lose(self, name: str) -> None:
        """Record that messages were lost before the next one; for a source, as it is told so."""
        self._follow_stream(name, partial(self.scene.lose, name))

    def renew(self, name: str) -> None:
        """Start a source anew: a new subscription receives all that its publisher keeps."""
        self.waiting.renew(name)
        self.scene.renew(name)

    def _follow_stream(self, name: str, happens: Callable[[], None]) -> None:
        """Let something happen to a stream, after the messages of it that wait."""
        if name in self.waiting:
            self.waiting.hold(name, Held(happens=happens), self._now)
        else:
            happens()

    def receive_transforms(self, topic: str, data: bytes, now: int, number: int | None = None,
                           arrived: int | None = None) -> list[Rejection]:
        """Receive a message of /tf or /tf_static, and apply the messages that waited for it."""
        self._pass_time(now)
        arrived = now if arrived is None else arrived
        return (self.transforms.receive(topic, data, now, number, arrived)
                + self._apply_moved(now))

    def advance(self, now: int) -> list[Rejection]:
        """Let time pass, see `Scene.pass_time`, and refuse messages that waited too long."""
        self._pass_time(now)
        rejections = self.outlines.follow(now) if self.outlines.deadline < now else []
        if self.waiting.earliest < now:
            rejections += self.waiting.apply(now)
        self.scene.pass_time(now)
        return rejections

    @property
    def deadline(self) -> float:
        """Earliest time in ns after which anything may change without a message, or NEVER."""
        deadline = min(self.scene.deadline, self.waiting.earliest)
        return min(deadline, self.outlines.deadline) if self.outlines.names else deadline

    def _apply_moved(self, now: int) -> list[Rejection]:
        """Apply messages whose transforms have arrived, and place outlines that have moved."""
        rejections = self.outlines.follow(now, has_received=True)
        if self.waiting.earliest < NEVER:
            rejections += self.waiting.apply(now)
        self._follow_maps(now)
        return rejections

    def _follow_maps(self, now: int) -> None:
        """Place maps whose frames have moved; request again those whose transform has come."""
        for name, frame_id in [*self.ingest.untransformed.items()]:
            found = self.transforms.lookup_affine(frame_id, 0, now)
            if not isinstance(found, NoTransform):
                del self.ingest.untransformed[name]
                self.scene.sources[name].request_history()
        self.ingest.follow_maps(now)

    def _pass_time(self, now: int) -> None:
        """
        Let time pass; if the clock was set back, begin anew.

        When it starts, drop transforms of another clock: they would shut out those that follow.
        """
        if now == self._now:
            return
        if now < self._now:
            if self.scene.is_set_back(now):
                self.set_clock(now)
                return
            self.transforms.frames.limit_times(self._now, now)
            self.outlines.limit_times(now)
            self.waiting.limit_times(now)
        elif not self._now:
            ahead = self.scene.settings.future_tolerance * 1e9
            self.transforms.frames.clear(after=now + ahead)
        self._now = now
        self.scene.pass_time(now)

    def set_clock(self, now: int) -> bool:
        """
        Begin anew, because the clock was set: times of before are those of another one.

        Return whether there was a time before.
        """
        if not self._now:
            return False
        self.transforms.frames.clear()
        self.outlines.clear()
        self.paths.clear()
        self.waiting.clear(now)
        self.ingest.follow_maps(self._now)
        self._now = now
        self.scene.set_clock(now)
        self.scene.pass_time(now)
        return True

    def _admit(self, name: str, data: bytes, number: int | None, now: int,
               arrived: int) -> list[Rejection]:
        """Apply a message or queue it: for a transform, or behind messages that wait for one."""
        settings = self.scene.settings_of(name)
        if not settings.enabled:
            return []
        if name in self.outlines.names:
            self.scene.receive_number(name, number, now)
            return self.outlines.receive(name, data, now, arrived) + self._apply_moved(now)
        wait = None
        if name not in self.waiting:
            outcome = self.ingest.apply(settings, data, number, now, arrived)
            if not isinstance(outcome, Wait):
                return [outcome] if outcome else []
            wait = outcome
        return self.waiting.hold(name, Held(data, number, arrived), now, wait)

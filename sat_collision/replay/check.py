# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The check of one recording: its messages go through the scene of the live node."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence, Set
from dataclasses import replace
from functools import partial
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from sat_collision.geometry.body.polygon import Reason
from sat_collision.messages.cdr import decode, header_stamp, MessageError, stamped
from sat_collision.messages.ingest import Placement
from sat_collision.messages.rejections import EMPTY_FRAME_ID, LONG_FRAME_ID, Rejection, UNDECODABLE
from sat_collision.messages.transform_listener import TF_STATIC, TRANSFORM_TOPICS
from sat_collision.monitor import Monitor
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.bag.storage import Row
from sat_collision.replay.live import SceneDrawing, Timeline
from sat_collision.replay.losses import AfterLoss, apart, LOSS_TYPE, Losses, UNSEEN
from sat_collision.replay.model.configuration import (
    all_sources, check_shared_topics, has_marks, is_map, is_subscribed, missing_topics,
    settings_for, Source, TRANSFORM_TYPE, TWIST_TYPE, wrong_types)
from sat_collision.replay.model.result import (
    FootprintResult, HEADER, moments_of, Options, PLAN, RECEIVE, Result, SourceResult)
from sat_collision.replay.motion.bodies import LONGEST
from sat_collision.replay.motion.drawing import MotionDrawing
from sat_collision.replay.motion.motion import RecordedMotion
from sat_collision.replay.motion.prediction import HORIZON
from sat_collision.replay.order import (
    ArrivalOrder, by_stamps_as_received, StampOrder, Timed, until_set_back, WINDOW)
from sat_collision.replay.plans import Plans
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.scene import OVERTAKEN
from sat_collision.scene.settings import (
    FAR, FootprintSettings, in_ns, NEVER, NONE, PathSettings, POLYGON, POLYGON_INSTANCE, Settings)

if TYPE_CHECKING:
    from sat_collision.replay.output.bag import BagOutputs

OnProgress: TypeAlias = Callable[[float], None]

# Messages between two reports of progress.
_PROGRESS_EVERY = 500
# So many placements are processed together, which is faster than one by one; fewer if messages are
# long, so that memory stays bounded.
_TOGETHER = 256
_MAX_BYTES = 2**20
# Reasons for rejection that do not depend on when and where a message is received.
_OF_CONTENT = {EMPTY_FRAME_ID, LONG_FRAME_ID, *(reason.value for reason in Reason)}
# Max time in ns without messages in which timers go on.
_LONGEST_QUIET = 60 * 10**9

_due_of = attrgetter('due')


def check(path: str | Path, options: Options = Options(),
          progress: OnProgress | None = None) -> Result:
    """
    Check a recording: a rosbag2 directory, or a storage file.

    Problems of the result say what is wrong with the recording or the parameters. `progress` is
    called from time to time with the fraction of messages that are done.

    With `keyframes` it is checked twice: which moments are drawn depends on what was found.
    """
    passes = 2 if options.keyframes else 1
    with Recording(path, options.limits) as recording:
        result = check_recording(
            recording, options, progress and (lambda share: progress(share / passes)))
        result.content = recording.content
    if options.keyframes and (moments := moments_of(result)):
        with Recording(path, options.limits) as recording:
            drawn = check_recording(
                recording, replace(options, write_bag=None),
                progress and (lambda share: progress((1 + share) / passes)), moments)
        result.keyframes = drawn.keyframes
        result.problems += [f'{problem}, when it was read again to be drawn'
                            for problem in drawn.problems if problem not in result.problems]
    return result


def check_recording(recording: Recording, options: Options, progress: OnProgress | None = None,
                    moments: Sequence[int] = ()) -> Result:
    """Check an open recording, as `check` does; with keyframes at some moments."""
    path = recording.path
    result = Result(str(path), options)
    try:
        settings = settings_for(recording.topics, options.parameters, options.footprints,
                                options.obstacles, options.node)
        # Recordings have no sequence numbers: only what they hold can be judged.
        settings = replace(settings, obstacles=tuple(
            replace(source, assume_no_loss=True) for source in settings.obstacles))
        if not options.as_live:
            # By stamps, the next transform may come so long after a message.
            gap = min(settings.max_tf_gap, LONGEST / 1e9)
            settings = replace(settings, transform_timeout=max(settings.transform_timeout, gap))
        _Check(recording, settings, options, result, moments).run(progress)
    except (ParameterError, OSError) as error:
        result.problems.append(f'{path}: {error}')
    result.problems[:0] = recording.problems
    return result


class _Check:
    def __init__(self, recording: Recording, settings: Settings, options: Options,
                 result: Result, moments: Sequence[int]) -> None:
        self._recording = recording
        self._settings = settings
        self._options = options
        self._result = result
        footprints = self._footprints = [
            FootprintResult(one.name, one.topic, one.enabled, start_up=_start_up(one, settings))
            for one in settings.footprints]
        self._transforms = [topic for topic in TRANSFORM_TOPICS if settings.frame_id
                            and recording.topics.get(topic) == TRANSFORM_TYPE]
        # Not yet passed to recorded motion; at once with outlines, which look up transforms.
        self._placements: list[Placement] = []
        self._together = 1 if any(one.has_outline for one in settings.footprints) else _TOGETHER
        self._untaken = 0
        # Topics of maps and plans, which may be of any time: their stamps are not the clock.
        self._timeless = {one.topic for one in filter(is_map, settings.obstacles)} | {
            one.path for one in settings.footprints if one.path}
        has_plans = any(one.path and one.enabled for one in settings.footprints)
        if options.fail_on == PLAN and not has_plans:
            raise ParameterError('--fail-on plan: no enabled footprint has a path')
        self._monitor = Monitor(settings, bool(self._transforms),
                                None if options.as_live else self._placements,
                                options.as_live or options.write_bag is not None or has_plans)
        self._scene = self._monitor.scene
        self._plans = Plans(settings, self._monitor, footprints, options.keyframes)
        self._timers: list[Timer] = []
        self._motion: RecordedMotion | None = None
        self._live: Timeline | None = None
        self._timeline: Timeline | RecordedMotion
        self._drawing: SceneDrawing | MotionDrawing | None = None
        if options.as_live:
            drawing = self._drawing = SceneDrawing(self._scene, moments) if moments else None
            self._timeline = self._live = Timeline(self._scene, footprints, drawing)
            self._timers.append(Timer(options.sample, self._live.sample))
            # Contacts may end before all of the messages are applied that waited for a transform.
            self._scene.on_collision = self._report
        else:
            drawn = self._drawing = MotionDrawing(moments) if moments else None
            self._timeline = self._motion = RecordedMotion(
                settings, self._scene, self._monitor.transforms, footprints,
                None if options.min_ttc is None else max(HORIZON, options.min_ttc), drawn)
        self._outputs: BagOutputs | None = None
        self._losses: Losses | None = None
        self._now = 0
        self._due: float = NEVER
        self._examples: dict[str, dict[str, str]] = {}
        # Messages that cannot be decoded, by topic, and why not the first one.
        self._undecodable: Counter[str] = Counter()
        self._undecoded: dict[str, str] = {}

    def run(self, progress: OnProgress | None) -> None:
        """Check the recording and fill in the result."""
        result, recording, options = self._result, self._recording, self._options
        wrong = dict(wrong_types(self._settings, recording.topics))
        result.problems += [f'{recording.path}: {problem}' for problem in wrong.values()]
        if recording.topics or not recording.problems:
            result.notes += missing_topics(self._settings, recording.topics)
        names: dict[str, list[str]] = {}
        for source in all_sources(self._settings):
            if source.name not in wrong and is_subscribed(source):
                names.setdefault(source.topic, []).append(source.name)
        names.update((topic, []) for topic in self._transforms)
        if self._motion:
            check_shared_topics(one for one in self._settings.inputs if one.name not in wrong)
        if recording.start is not None and recording.end is not None:
            start = recording.start + round(options.start * 1e9)
            stop = None if options.duration is None else start + round(options.duration * 1e9)
            if start > recording.end or stop == start:
                result.notes.append(
                    'the recording has nothing in the time given by --start and --duration: it '
                    f'has {(recording.end - recording.start) / 1e9:.3f} s, and --start counts '
                    'from its beginning')
            else:
                end = recording.end if stop is None else min(stop, recording.end)
                self._play(names, start, stop, end, progress)
        for topic, count in self._undecodable.items():
            result.problems.append(f'{recording.path}: {count} messages on {topic} cannot be '
                                   f'decoded, the first one: {self._undecoded[topic]}')
        if not recording.counts.total() and (recording.topics or not recording.problems):
            result.notes.append('the recording has no messages: were the topics published while '
                                'it was made, with a QoS that suits the recorder?')
        shared = {one.topic for one in self._settings.inputs} & recording.shared.keys()
        result.notes += [
            f'{topic} had {recording.shared[topic]} publishers: which message is whose is not '
            'recorded, so all count as those of one, where the node would know nothing; give each '
            'its own topic' for topic in sorted(shared)]
        if result.start is not None and LOSS_TYPE not in recording.topics.values():
            result.notes.append(UNSEEN)
        result.sources = [self._result_of(source) for source in all_sources(self._settings)]
        for footprint, settings in zip(self._footprints, self._settings.footprints):
            concerned = {settings.name, *filter(settings.monitors, self._scene.sources)}
            footprint.refused = [source.name for source in result.sources
                                 if source.refused and source.name in concerned]
        result.footprints = self._footprints
        result.contacts = self._timeline.contacts
        result.unknown = self._timeline.unknown
        result.plan_contacts = self._plans.contacts
        if self._motion:
            result.undetermined = self._motion.undetermined
            result.notes += self._motion.notes
            result.count_times()
        result.notes += [
            f'a contact with {one.name} may be with where an obstacle was: {advice}'
            for one in self._settings.obstacles if one.enabled and self._monitor.received[one.name]
            and (advice := self._scene.sources[one.name].advice)]
        if self._options.as_live:
            result.notes += [
                f'{one.name}.min_time_to_collision raises no flag here; --min-ttc asks for times'
                for one in self._settings.footprints if one.min_time_to_collision]
        if self._drawing:
            result.keyframes = self._drawing.keyframes

    def _result_of(self, source: Source) -> SourceResult:
        name = source.name
        rejected = {reason: count for (of, reason), count
                    in sorted(self._monitor.rejected.items()) if of == name}
        return SourceResult(
            name, source.topic, self._monitor.received[name], rejected,
            examples=self._examples.get(name, {}),
            lost=self._losses.counts[source.topic] if self._losses else 0,
            undetermined=self._motion.undetermined_of[name] if self._motion else 0,
            refused=0 if isinstance(source, PathSettings) else sum(
                count for reason, count in rejected.items() if reason in _OF_CONTENT),
            known_by=(self._scene.sources[name].rule if name in self._scene.sources else ''))

    def _play(self, names: dict[str, list[str]], start: int, stop: int | None, end: int,
              progress: OnProgress | None) -> None:
        by_header, result = self._options.clock == HEADER, self._result
        monitor, now = self._monitor, 0
        if by_header and self._options.start:
            result.origin = self._first_stamp(names.keys() - {*TRANSFORM_TOPICS} - self._timeless)
        elif not by_header:
            result.origin = self._recording.start
        self._losses = self._read_losses(start, stop)
        ordered = self._in_order(names, start, stop, progress)
        arrivals = ordered if isinstance(ordered, ArrivalOrder) else None
        runs = apart(ordered) if self._losses else ordered
        self._begin_outputs()
        # The first message of a latched topic is the first one that its publisher sent.
        numbers = dict.fromkeys(self._recording.latched & names.keys(), 1)
        if not by_header:
            self._begin(start)
            now = start
        plans = self._plans.names
        # With the clock of stamps, those that come before the first of these.
        early: list[tuple[str, bytes]] = []
        # A rejected footprint has no pose until the next one, so each message counts; so do plans.
        single = {one.name for one in self._settings.footprints} | plans
        # By topic, the source whose messages may be received several at once, and its timeout.
        of_runs = {source.topic: (source.name, in_ns(source.timeout))
                   for source in self._settings.obstacles
                   if names.get(source.topic) == [source.name] and source.type == POLYGON}
        if self._options.start:
            latched = {TF_STATIC} & {*self._transforms} | (
                set() if by_header else self._recording.latched & names.keys())
            self._receive_latched(latched, names, start, numbers, ordered)
        for topic, time, batch in runs:
            if by_header and not now:
                if time <= 0 or topic in TRANSFORM_TOPICS:
                    time = 0
                else:
                    self._begin(time, early)
            elif not by_header and stop is not None and time >= stop:
                break
            if time > now:
                self._pass_until(time)
                now = time
            if topic in TRANSFORM_TOPICS:
                for data in batch:
                    self._keep(monitor.receive_transforms(topic, data, now))
                    if now:
                        self._follow()
                        self._plans.follow(now)
            if self._losses:
                self._lose(names[topic], batch)
            number = numbers.pop(topic, None) if numbers else None
            if arrivals and now and number is None and topic in of_runs:
                name, timeout = of_runs[topic]
                bound = min(monitor.deadline, self._due, NEVER if stop is None else stop - 1,
                            header_stamp(batch[0]) + timeout)
                last = arrivals.receive_run(monitor, name, now, bound)
                if last is not None:
                    self._follow()
                    self._now = now = last
                    continue
            for name in names[topic]:
                for k, part in enumerate([[one] for one in batch] if name in single else [batch]):
                    self._receive(name, part, now, number and number + k)
                    if name in plans and now:
                        self._keep(self._plans.receive(name, now))
                    elif name in plans:
                        early.append((name, part[0]))
                    elif name in monitor.outlines.names:
                        self._plans.follow(now)
        if result.start is None:
            if monitor.received.total():
                result.notes.append(
                    'nothing is checked, as no message of a footprint, or of obstacles that are '
                    'not a map, has the header stamp with which the clock would start: stamp '
                    'them, or use --clock receive')
            return
        delay = max(ordered.delay, 0) if isinstance(ordered, StampOrder) else 0
        end = now if by_header else max(now, end - delay)
        self._pass_until(end)
        for timer in self._timers:
            if timer.due <= end:
                timer.action(end)
        self._place(len(self._placements))
        self._timeline.finish(end)
        self._plans.finish(end, self._losses.counts if self._losses else {})
        result.end = end
        if self._outputs:
            self._outputs.close()
            if self._outputs.fault:
                result.add_bag_fault(self._outputs.fault)

    def _in_order(self, names: dict[str, list[str]], start: int, stop: int | None,
                  progress: OnProgress | None) -> Iterable[Timed]:
        """Return the messages in the order in which they are processed, in runs."""
        by_header = self._options.clock == HEADER
        # Messages outside the bounds in metadata.yaml are not dropped. By stamps, messages that
        # are received later may belong to the time that is checked.
        later = WINDOW if self._motion and not by_header else 0
        read: Iterable[Row] = self._with_clocks_compared(self._rows(
            names, start if self._options.start else None, stop and stop + later))
        marks = {one.topic: partial(_is_empty, one.type == POLYGON_INSTANCE)
                 for one in filter(has_marks, self._settings.obstacles)}
        if by_header:
            # A map may be of any time; a set of obstacles may have several stamps in any order.
            tolerance = round(self._settings.future_tolerance * 1e9)
            read = until_set_back(
                read, {one.topic: tolerance for one in self._settings.obstacles if one.timeout}
                | {one.topic: 0 for one in self._settings.footprints}, marks,
                self._note_set_back)
        if progress:
            total = sum(self._recording.counts[topic] for topic in names)
            read = _with_progress(read, total, progress)
        if self._motion:
            timeless = dict.fromkeys(self._timeless, 0) | {
                one.path: start for one in self._settings.footprints if one.path}
            # Of several sources on a topic the least timeout counts.
            timeouts = sorted(((in_ns(one.timeout), one.topic)
                               for one in self._settings.obstacles), reverse=True)
            return StampOrder(read, by_header, marks, timeless,
                              {topic: timeout for timeout, topic in timeouts})
        if by_header:
            return by_stamps_as_received(
                read, {TF_STATIC, *self._timeless}, self._monitor.outlines.moving_frames)
        return ArrivalOrder(read)

    def _begin_outputs(self) -> None:
        """Begin to write what the node would publish, if it is asked for."""
        if self._options.write_bag:
            from sat_collision.replay.output.bag import BagOutputs
            try:
                outputs = self._outputs = BagOutputs(
                    self._options.write_bag, self._options.node, self._settings, self._monitor)
            except (OSError, RuntimeError) as error:  # the latter is whatever rosbag2 raises
                self._result.add_bag_fault(error)
                return
            self._timers += [Timer(1.0 / self._settings.publish_rate, outputs.publish),
                             Timer(1.0 / self._settings.marker_rate, outputs.publish_markers)]

    def _receive_latched(self, topics: Set[str], names: dict[str, list[str]], start: int,
                         numbers: dict[str, int], ordered: Iterable[Timed]) -> None:
        """Receive what publishers of latched topics sent before the start: they send it again."""
        for topic, _, messages in self._rows(topics, None, start):
            self._lose(names[topic], messages)
            number = numbers.pop(topic, None)
            for data in messages if topic == TF_STATIC else ():
                if isinstance(ordered, StampOrder):
                    ordered.note_static(data)
                self._keep(self._monitor.receive_transforms(topic, data, self._now))
            for name in names[topic]:
                self._receive(name, messages, self._now, number)

    def _receive(self, name: str, messages: list[bytes], now: int, number: int | None) -> None:
        if rejections := self._monitor.receive_batch(name, messages, now, number):
            self._keep(rejections)
        if self._motion and name in self._monitor.commands.last:
            self._motion.command(name, self._monitor.commands.last[name])
        self._follow()

    def _lose(self, names: Iterable[str], messages: list[bytes]) -> None:
        """Tell the monitor of a loss before some messages."""
        if isinstance(messages[0], AfterLoss):
            for name in names:
                self._monitor.lose(name)

    def _read_losses(self, start: int, stop: int | None) -> Losses | None:
        """Return what the recorder says that it lost; None if it says nothing."""
        topics = [topic for topic, kind in self._recording.topics.items()
                  if kind == LOSS_TYPE and self._recording.counts[topic]]
        losses = Losses(start, stop)
        for topic, times, events in self._recording.rows(topics) if topics else ():
            for time, event in zip(times, events):
                try:
                    losses.add(time, event)
                except MessageError as error:
                    self._note_undecodable(topic, str(error))
        return losses if topics else None

    def _rows(self, topics: Collection[str], start: int | None = None,
              stop: int | None = None) -> Iterator[Row]:
        """Return messages of the recording; commands without a header are given one."""
        twists = {topic for topic in topics if self._recording.topics.get(topic) == TWIST_TYPE}
        rows = self._recording.rows(topics, start, stop, self._options.content)
        if self._losses:
            rows = self._losses.mark(rows)
        return ((topic, times, [*map(stamped, messages)] if topic in twists else messages)
                for topic, times, messages in rows) if twists else rows

    def _note_set_back(self, what: str, before: int, after: int) -> None:
        """Report stamps that go back."""
        self._result.problems.append(
            f'{self._recording.path}: the stamps of {what} go back by {(before - after) / 1e9:g} '
            f's, from {_in_seconds(before)} to {_in_seconds(after)} s, as where a simulation was '
            'reset; with --clock header what follows is not checked: record each run by itself, '
            'or use --clock receive')

    def _first_stamp(self, names: Collection[str]) -> int | None:
        """Return the header stamp with which the recording begins, None if there is none."""
        stamps = (header_stamp(data) for topic, _, messages in self._recording.rows(names)
                  if self._recording.topics[topic] != TWIST_TYPE for data in messages)
        return next((stamp for stamp in stamps if stamp > 0), None)

    def _keep(self, rejections: Iterable[Rejection]) -> None:
        """Reset the poses of rejected footprints, and keep the first example of each reason."""
        for rejection in rejections:
            if self._motion and rejection.reason != OVERTAKEN:
                self._place(self._untaken)
                self._motion.lose(rejection.name, self._now)
            if rejection.reason == UNDECODABLE:
                self._note_undecodable(rejection.topic, rejection.detail)
            self._examples.setdefault(rejection.name, {}).setdefault(
                rejection.reason, rejection.text)

    def _note_undecodable(self, topic: str, why: str) -> None:
        self._undecodable[topic] += 1
        self._undecoded.setdefault(topic, why)

    def _follow(self) -> None:
        """Process new placements and changed states."""
        untaken = self._untaken = len(self._placements)
        if untaken >= self._together or (
                untaken and untaken * len(self._placements[-1].points[0]) > _MAX_BYTES):
            self._place(untaken)
        self._report()

    def _report(self) -> None:
        """Record changed states, and how deep contacts are, once the clock has started."""
        if not self._now:
            return
        if changed := self._scene.take_changes().changed:
            self._change(changed, self._now)
        if self._live and self._live.touching:
            self._live.deepen(self._now)

    def _place(self, count: int) -> None:
        """Pass the first placements to recorded motion."""
        if self._motion and count:
            self._motion.place(self._placements[:count])
            del self._placements[:count]
            self._untaken = 0

    def _begin(self, start: int, plans: Iterable[tuple[str, bytes]] = ()) -> None:
        """Start the clock, and check the plans that came before."""
        self._result.start = self._now = start
        if self._result.origin is None:
            self._result.origin = start
        self._monitor.advance(start)
        for name, data in plans:
            self._monitor.paths.receive(name, data)
            self._keep(self._plans.receive(name, start))
        self._change(self._scene.take_changes().changed, start)
        for timer in self._timers:
            timer.due = start
        self._due = start if self._timers else NEVER

    def _change(self, changed: Collection[str], now: int) -> None:
        self._timeline.change(changed, now)
        if self._outputs:
            self._outputs.change(changed, now)

    def _pass_until(self, now: int) -> None:
        """Process deadlines of the monitor and timers that are due before the messages of now."""
        while now > (deadline := self._monitor.deadline) or now > self._due:
            # The deadline may lie in the past, but the scene's time must not go back.
            deadline = max(deadline + 1, self._now)
            if deadline <= self._due:
                self._now = int(deadline)
                self._keep(self._monitor.advance(self._now))
                self._follow()
            else:
                timer = min(self._timers, key=_due_of)
                self._scene.pass_time(int(timer.due))
                timer.act(min(deadline, now))
                self._due = min(map(_due_of, self._timers))
        self._now = now

    def _with_clocks_compared(self, rows: Iterator[Row]) -> Iterable[Row]:
        """Add a note if clocks are so far apart at the first message that one must be wrong."""
        passed = []
        for row in rows:
            passed.append(row)
            topic, (time, *_), (data, *_) = row
            if topic in TRANSFORM_TOPICS or topic in self._timeless:
                continue
            stamp = header_stamp(data)
            if self._options.clock == RECEIVE and stamp and abs(time - stamp) > FAR:
                self._result.notes.append(
                    f'the first header stamp is {abs(time - stamp) / 1e9:.0f} s from the receive '
                    'time, as in recordings of simulations: try --clock header')
            break
        return chain(passed, rows)


def _in_seconds(time: int) -> str:
    """Return a time in ns exactly, in s."""
    return f'{time // 10**9}.{time % 10**9:09}'


def _with_progress(rows: Iterable[Row], total: int, progress: OnProgress) -> Iterator[Row]:
    """Yield rows, and report now and then the fraction of messages that have passed."""
    count = due = 0
    for row in rows:
        if count >= due:
            progress(min(count / max(total, 1), 1.0))
            due = count + _PROGRESS_EVERY
        count += len(row[1])
        yield row


def _is_empty(with_id: bool, data: bytes) -> bool:
    """Return whether a message is an empty polygon."""
    try:
        return not decode(data, with_id)[2][2]
    except MessageError:
        return False


def _start_up(footprint: FootprintSettings, settings: Settings) -> int:
    """Return for how long in ns after the start some source of a footprint cannot be known."""
    return max((round((one.timeout + settings.future_tolerance) * 1e9)
                for one in settings.obstacles if one.enabled and one.timeout
                and one.ending == NONE and footprint.monitors(one.name)), default=0)


class Timer:
    """An action that recurs with a period in s, called with the time in ns."""

    def __init__(self, period: float, action: Callable[[int], None]) -> None:
        self.action = action
        self.due: float = 0
        self._period = max(round(period * 1e9), 1)

    def act(self, until: float) -> None:
        """Call the action; skip further calls up to `until` if that is over a minute away."""
        self.action(int(self.due))
        self.due += self._period
        quiet = until - self.due
        if quiet > _LONGEST_QUIET:
            self.due += int(quiet)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The run of one recording through the scene of the live node."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from sat_collision.messages.cdr import header_stamp
from sat_collision.messages.rejections import Rejection
from sat_collision.messages.transform_listener import TF_STATIC, TRANSFORM_TOPICS
from sat_collision.monitor import Monitor
from sat_collision.replay.destinations import OutputError
from sat_collision.replay.film import Film, moments_of
from sat_collision.replay.motion.motion import Motion
from sat_collision.replay.motion.timeline import MotionTimeline
from sat_collision.replay.options import HEADER, Options, RECEIVE
from sat_collision.replay.progress import OnProgress, with_progress
from sat_collision.replay.recording import Recording
from sat_collision.replay.result import FootprintResult, Result, SourceResult
from sat_collision.replay.storage import Message, Recorded
from sat_collision.replay.timeline import Timeline
from sat_collision.replay.timers import Moments, Timer
from sat_collision.replay.topics import (
    all_sources, is_subscribed, missing_topics, settings_for, TRANSFORM_TYPE, wrong_types)
from sat_collision.scene.deadlines import NEVER
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import Settings

if TYPE_CHECKING:
    from sat_collision.replay.outputs import BagOutputs

_APART = 3600 * 10**9


def check(path: str | Path, options: Options = Options(),
          progress: OnProgress | None = None) -> Result:
    """
    Check a recording.

    Parameters
    ----------
    path : str or Path
        A rosbag2 directory or storage file.
    options : Options
    progress : callable, optional
        Called now and then with the share of messages that are done.

    Returns
    -------
    Result
        Whatever is wrong with the recording or the parameters is in its problems.

    """
    half = partial(_half, progress) if options.film and progress else progress
    with Recording(path, options.limits) as recording:
        result = check_recording(recording, options, half)
        result.content = recording.content
    if options.film and (moments := moments_of(result)):
        result.film = Film(moments)
        with Recording(path, options.limits) as recording:
            check_recording(recording, replace(options, write_bag=None),
                            half and (lambda share: half(1.0 + share)), result.film)
    return result


def _half(progress: OnProgress, share: float) -> None:
    progress(0.5 * share)


def check_recording(recording: Recorded, options: Options,
                    progress: OnProgress | None = None, film: Film | None = None) -> Result:
    """Check what is open, as `check` does, and fill a film if there is one."""
    path = recording.path
    result = Result(str(path), options.clock, options.max_unknown, options.as_live,
                    max_undecided=options.max_undecided)
    try:
        settings = settings_for(recording.topics, options.parameters, options.footprints,
                                options.obstacles, options.node)
        _Run(recording, settings, options, result, film).run(progress)
    except (ParameterError, OutputError, OSError) as error:
        result.problems.append(f'{path}: {error}')
    result.problems[:0] = recording.problems
    return result


class _Run:
    """One recording on its way through the scene."""

    def __init__(self, recording: Recorded, settings: Settings, options: Options,
                 result: Result, film: Film | None) -> None:
        self._recording = recording
        self._settings = settings
        self._options = options
        self._result = result
        footprints = [FootprintResult(footprint.name, footprint.topic, footprint.enabled)
                      for footprint in settings.footprints]
        self._motion = None if options.as_live else Motion(settings, footprints, film)
        self._transforms = [topic for topic in TRANSFORM_TOPICS if settings.frame_id
                            and recording.topics.get(topic) == TRANSFORM_TYPE]
        self._monitor = Monitor(settings, bool(self._transforms), self._motion)
        self._scene = self._monitor.scene
        self._timers: list[Timer] = []
        self._live: Timeline | None = None
        self._timeline: Timeline | MotionTimeline
        if self._motion:
            self._motion.monitor = self._monitor
            self._timeline = MotionTimeline(self._scene, self._motion, footprints)
        else:
            self._timeline = self._live = Timeline(self._scene, footprints, film)
            self._timers.append(Timer(options.sample, self._live.sample))
            if film:
                self._timers.append(Moments(film.moments, partial(film.take, self._scene)))
        self._outputs: BagOutputs | None = None
        self._now = 0
        self._due: float = NEVER
        self._examples: dict[str, dict[str, str]] = {}

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
        if recording.start is not None and recording.end is not None:
            start = recording.start + round(options.start * 1e9)
            stop = (None if options.duration is None
                    else start + round(options.duration * 1e9))
            if start > recording.end or stop == start:
                result.notes.append(
                    'the recording has nothing in the time given by --start and --duration')
            else:
                end = recording.end if stop is None else min(stop, recording.end)
                self._play(names, start, stop, end, progress)
        result.sources = [
            SourceResult(source.name, source.topic, self._monitor.received[source.name],
                         {reason: count for (name, reason), count in
                          sorted(self._monitor.rejected.items()) if name == source.name},
                         self._examples.get(source.name, {}),
                         self._motion.undecided(source.name) if self._motion else 0)
            for source in all_sources(self._settings)]
        result.footprints = self._timeline.footprints
        result.contacts = self._timeline.contacts
        result.unknown = self._timeline.unknown
        result.notes += self._timeline.notes

    def _play(self, names: dict[str, list[str]], start: int, stop: int | None, end: int,
              progress: OnProgress | None) -> None:
        by_header, result = self._options.clock == HEADER, self._result
        result.origin = (self._first_stamp(names.keys() - {*TRANSFORM_TOPICS}) if by_header
                         else self._recording.start)
        # What metadata.yaml says of the recording's bounds is not taken as a reason to drop any.
        messages = self._with_clocks_compared(
            self._recording.messages(names, start if self._options.start else None, stop))
        if progress:
            total = sum(self._recording.counts[topic] for topic in names)
            messages = with_progress(messages, total, progress)
        if self._options.write_bag:
            self._write_outputs(self._options.write_bag)
        for topic in self._recording.latched & names.keys():
            for name in names[topic]:
                self._scene.meet_publisher(name, True)
        if not by_header:
            self._begin(start)
        now, monitor, motion = self._now, self._monitor, self._motion
        if self._options.start and TF_STATIC in self._transforms:
            # What was told before would be latched.
            for topic, _, data in self._recording.messages([TF_STATIC], None, start):
                self._keep(monitor.receive_transforms(topic, data, now))
        for topic, time, data in messages:
            if topic in TRANSFORM_TOPICS:
                time = now if by_header else time
            elif by_header:
                time = header_stamp(data)
                if time and not now:
                    self._begin(time)
            if time > now:
                now = time
                if now > monitor.deadline or now >= self._due:
                    self._pass_until(now)
                if motion:
                    motion.now = now
            if topic in TRANSFORM_TOPICS:
                self._keep(monitor.receive_transforms(topic, data, now))
                if now:
                    self._follow(now)
            for name in names[topic]:
                rejection = monitor.receive(name, data, now)
                if rejection:
                    self._keep([rejection])
                self._follow(now)
        if self._result.start is None:
            return
        end = now if by_header else max(now, end)
        self._pass_until(end)
        for timer in self._timers:
            if timer.due <= end:
                timer.action(end)
        self._timeline.finish(end)
        self._result.end = end
        if self._outputs:
            self._outputs.close()

    def _first_stamp(self, names: Iterable[str]) -> int | None:
        """Return the header stamp with which the recording begins, None if there is none."""
        stamps = (header_stamp(data) for _, _, data in self._recording.messages([*names]))
        return next(filter(None, stamps), None)

    def _write_outputs(self, path: str) -> None:
        from sat_collision.replay.outputs import BagOutputs
        self._outputs = BagOutputs(path, self._options.node, self._settings, self._scene)
        self._timers += [Timer(1.0 / self._settings.publish_rate, self._outputs.publish),
                         Timer(1.0 / self._settings.marker_rate, self._outputs.publish_markers)]

    def _keep(self, rejections: Iterable[Rejection]) -> None:
        """Keep the first example of each reason."""
        for rejection in rejections:
            self._examples.setdefault(rejection.name, {}).setdefault(
                rejection.reason, rejection.text)

    def _follow(self, now: int) -> None:
        """Take note of what has changed."""
        changed = self._scene.changes()
        if changed:
            self._change(changed, now)
        if self._live and self._live.touching:
            self._live.deepen(now)

    def _begin(self, start: int) -> None:
        """Let the time begin."""
        self._result.start = self._now = start
        if self._motion:
            self._motion.now = start
        self._monitor.advance(start)
        self._change(self._scene.changes(), start)
        for timer in self._timers:
            timer.due = start
        self._due = start if self._timers else NEVER

    def _change(self, changed: Iterable[str], now: int) -> None:
        self._timeline.change(changed, now)
        if self._outputs:
            self._outputs.change(changed, now)

    def _pass_until(self, now: int) -> None:
        """Do all that is due before the messages of now: what time brings about, and timers."""
        while True:
            # A bound may lie in the past, but the scene's time must not go back.
            deadline = max(self._monitor.deadline + 1, self._now)
            timer = min(self._timers, key=lambda timer: timer.due, default=None)
            if deadline <= (min(now, timer.due) if timer else now):
                self._now = int(deadline)
                if self._motion:
                    self._motion.now = self._now
                self._keep(self._monitor.advance(self._now))
                self._follow(self._now)
                continue
            if timer is None or timer.due >= now:
                break
            timer.act(min(deadline, now))
        self._now = now
        self._due = timer.due if timer else NEVER

    def _with_clocks_compared(self, messages: Iterator[Message]) -> Iterable[Message]:
        """Note clocks so far apart at the first message that one cannot be the robot's."""
        passed = []
        for topic, time, data in messages:
            passed.append((topic, time, data))
            if topic in TRANSFORM_TOPICS:
                continue
            stamp = header_stamp(data)
            if self._options.clock == RECEIVE and stamp and abs(time - stamp) > _APART:
                self._result.notes.append(
                    f'the first header stamp is {abs(time - stamp) / 1e9:.0f} s from the receive '
                    'time, as in recordings of simulations: try --clock header')
            break
        return chain(passed, messages)

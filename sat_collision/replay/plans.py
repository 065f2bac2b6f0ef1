# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The plans of a recording, each checked when it comes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from sat_collision.messages.rejections import Rejection
from sat_collision.monitor import Monitor
from sat_collision.replay.model.result import FootprintResult, PlanContact
from sat_collision.scene.path import PathCheck
from sat_collision.scene.settings import FootprintSettings, PathSettings, Settings

_LOST = 'lost by the recorder'


class Plans:
    """
    Checks plans by what the monitor knows, and records what is found in results of footprints.

    A plan whose frame has no transform yet is checked when that comes, for up to
    `transform_timeout`, unless another plan comes first. With `keeps_ways` contacts have what is
    drawn of them.
    """

    def __init__(self, settings: Settings, monitor: Monitor, footprints: list[FootprintResult],
                 keeps_ways: bool) -> None:
        self.contacts: list[PlanContact] = []
        self._monitor = monitor
        self._keeps_ways = keeps_ways
        self._timeout = round(settings.transform_timeout * 1e9)
        self._planners = {path.name: _Planner(one, path, result) for one, result in zip(
            settings.footprints, footprints) if (path := one.path_settings)}
        # By their names: the plans in contact that count, and those that wait for a transform.
        self._current: dict[str, PlanContact] = {}
        self._waiting: dict[str, tuple[int, PathCheck]] = {}
        for planner in self._planners.values():
            planner.result.plans = 0

    def receive(self, name: str, now: int) -> list[Rejection]:
        """Check a plan that the monitor has just received."""
        self._end(name, now)
        rejections = self._monitor.paths.read(self._planners[name].path, now)
        if not self._monitor.paths.is_empty(name):
            self._check(name, now, now)
        return rejections

    def follow(self, now: int) -> None:
        """Check the plans that wait, after a transform came."""
        for name, (time, found) in [*self._waiting.items()]:
            if now > time + self._timeout:
                self._record(name, time, found)
            else:
                self._check(name, time, now)

    def finish(self, end: int, lost: Mapping[str, int]) -> None:
        """Record what waits at the end of the recording, and how many were lost, by topic."""
        for name, planner in self._planners.items():
            self._end(name, end)
            if count := lost.get(planner.path.topic):
                planner.result.plans_unknown[_LOST] = count

    def _end(self, name: str, now: int) -> None:
        if name in self._waiting:
            self._record(name, *self._waiting[name])
        if contact := self._current.pop(name, None):
            contact.until = now

    def _check(self, name: str, time: int, now: int) -> None:
        planner = self._planners[name]
        found = self._monitor.paths.check_one(planner.settings, planner.path, now, is_plan=True)
        if found.may_come:
            self._waiting[name] = time, found
        else:
            self._record(name, time, found)

    def _record(self, name: str, time: int, found: PathCheck) -> None:
        self._waiting.pop(name, None)
        result = self._planners[name].result
        if found.reason:
            result.plans_unknown[found.reason] = result.plans_unknown.get(found.reason, 0) + 1
            return
        result.plans = (result.plans or 0) + 1
        if found.obstacle is not None:
            contact = self._current[name] = PlanContact(
                result.name, str(found.obstacle), time, time, found.pose, found.metres)
            self.contacts.append(contact)
            if self._keeps_ways and found.way is not None and found.outline is not None:
                contact.way, contact.outline = found.way.tolist(), found.outline.tolist()


class _Planner(NamedTuple):
    """A footprint with a path, and its result."""

    settings: FootprintSettings
    path: PathSettings
    result: FootprintResult

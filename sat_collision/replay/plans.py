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
from dataclasses import dataclass
from operator import attrgetter
from typing import NamedTuple

from sat_collision.messages.paths import ReceivedPath
from sat_collision.messages.rejections import Rejection
from sat_collision.monitor import Monitor
from sat_collision.replay.model.result import (
    FootprintResult, MAX_CONTACTS, MAX_PLACES, PlanContact, spread)
from sat_collision.scene.path import PathCheck
from sat_collision.scene.settings import FootprintSettings, PathSettings, Settings

_LOST = 'lost by the recorder'


class Plans:
    """
    Checks plans by what the monitor knows, and records what is found in results of footprints.

    A plan whose frame has no transform yet is checked when that comes, for up to
    `transform_timeout`. With `keeps_ways` the first contacts have what is drawn of them.
    """

    def __init__(self, settings: Settings, monitor: Monitor, footprints: list[FootprintResult],
                 keeps_ways: bool) -> None:
        self.contacts: list[PlanContact] = []
        self._monitor = monitor
        self._keeps_ways = keeps_ways
        self._timeout = round(settings.transform_timeout * 1e9)
        self._planners = {path.name: _Planner(one, path, result) for one, result in zip(
            settings.footprints, footprints) if one.enabled and (path := one.path_settings)}
        self.names = frozenset(self._planners)
        # By their names the plans that count; those that wait for a transform, and why.
        self._current: dict[str, _Plan] = {}
        self._waiting: list[tuple[_Plan, PathCheck]] = []
        for planner in self._planners.values():
            planner.result.plans = 0

    def receive(self, name: str, now: int) -> list[Rejection]:
        """Check a plan that the monitor has just received."""
        self.follow(now)
        self._end(name, now)
        planner, paths = self._planners[name], self._monitor.paths
        rejections = paths.read(planner.path, now)
        path = paths.latest(name)
        if not path.is_empty:
            plan = self._current[name] = _Plan(planner, path, now, now)
            self._check(plan, now)
        return rejections

    def follow(self, now: int) -> None:
        """Check the plans that wait, after a transform came."""
        waiting, self._waiting = self._waiting, []
        for plan, found in waiting:
            if now > plan.time + self._timeout:
                self._record(plan, found)
            else:
                self._check(plan, now)

    def finish(self, end: int, lost: Mapping[str, int]) -> None:
        """Record what waits at the end of the recording, and how many were lost, by topic."""
        for plan, found in self._waiting:
            self._record(plan, found)
        for name, planner in self._planners.items():
            self._end(name, end)
            if count := lost.get(planner.path.topic):
                planner.result.plans_unknown[_LOST] = count
        self.contacts.sort(key=attrgetter('time'))

    def _end(self, name: str, now: int) -> None:
        if plan := self._current.pop(name, None):
            plan.until = now
            if plan.contact:
                plan.contact.until = now

    def _check(self, plan: _Plan, now: int) -> None:
        found = self._monitor.paths.check_one(plan.planner.settings, plan.path, now, is_plan=True)
        if found.may_come:
            self._waiting.append((plan, found))
        else:
            self._record(plan, found)

    def _record(self, plan: _Plan, found: PathCheck) -> None:
        result = plan.planner.result
        if found.reason:
            result.plans_unknown[found.reason] = result.plans_unknown.get(found.reason, 0) + 1
            return
        result.plans = (result.plans or 0) + 1
        if found.obstacle is not None:
            contact = plan.contact = PlanContact(
                result.name, str(found.obstacle), plan.time, plan.until, found.pose, found.metres)
            self.contacts.append(contact)
            if (self._keeps_ways and len(self.contacts) <= MAX_CONTACTS
                    and found.way is not None and found.outline is not None):
                contact.way = spread(found.way.tolist(), MAX_PLACES)
                contact.outline = found.outline.tolist()


class _Planner(NamedTuple):
    """A footprint with a path, and its result."""

    settings: FootprintSettings
    path: PathSettings
    result: FootprintResult


@dataclass
class _Plan:
    """A plan, which counts from `time` until just before `until`."""

    planner: _Planner
    path: ReceivedPath
    time: int
    until: int
    contact: PlanContact | None = None

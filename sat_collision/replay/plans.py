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
import math
from operator import attrgetter

from sat_collision.messages.paths import ReceivedPath
from sat_collision.messages.rejections import Rejection
from sat_collision.monitor import Monitor
from sat_collision.replay.model.result import (
    FootprintResult, MAX_CONTACTS, MAX_PLACES, PlanContact, spread)
from sat_collision.scene.path import PathCheck
from sat_collision.scene.settings import Settings

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
        self._planners = {path.name: (one, path, result) for one, result in zip(
            settings.footprints, footprints) if one.enabled and (path := one.path_settings)}
        self.names = frozenset(self._planners)
        # By their names the plans that count; those that wait for a transform, and why.
        self._current: dict[str, PlanContact] = {}
        self._waiting: list[tuple[str, ReceivedPath, PlanContact, PathCheck]] = []
        for _, _, result in self._planners.values():
            result.plans = 0

    def receive(self, name: str, now: int) -> list[Rejection]:
        """Check a plan that the monitor has just received."""
        self._end(name, now)
        _, settings, result = self._planners[name]
        rejections = self._monitor.paths.read(settings, now)
        path = self._monitor.paths.latest[name]
        # An empty one is none.
        if path.path or rejections:
            plan = self._current[name] = PlanContact(
                result.name, '', now, now, math.nan, math.nan)
            self._check(name, path, plan, now)
        return rejections

    def follow(self, now: int) -> None:
        """Check the plans that wait, after a transform came."""
        waiting, self._waiting = self._waiting, []
        for name, path, plan, found in waiting:
            if now > plan.time + self._timeout:
                self._record(name, plan, found)
            else:
                self._check(name, path, plan, now)

    def finish(self, end: int, lost: Mapping[str, int]) -> None:
        """Record what waits at the end of the recording, and how many were lost, by topic."""
        for name, _, plan, found in self._waiting:
            self._record(name, plan, found)
        for name, (_, settings, result) in self._planners.items():
            self._end(name, end)
            if count := lost.get(settings.topic):
                result.plans_unknown[_LOST] = count
        self.contacts.sort(key=attrgetter('time'))

    def _end(self, name: str, now: int) -> None:
        if name in self._current:
            self._current.pop(name).until = now

    def _check(self, name: str, path: ReceivedPath, plan: PlanContact, now: int) -> None:
        footprint, _, _ = self._planners[name]
        found = self._monitor.paths.check_one(footprint, path, now, is_plan=True)
        if found.may_come:
            self._waiting.append((name, path, plan, found))
        else:
            self._record(name, plan, found)

    def _record(self, name: str, plan: PlanContact, found: PathCheck) -> None:
        _, _, result = self._planners[name]
        if found.reason:
            result.plans_unknown[found.reason] = result.plans_unknown.get(found.reason, 0) + 1
            return
        result.plans = (result.plans or 0) + 1
        if found.obstacle is not None:
            plan.obstacle, plan.pose, plan.metres = str(found.obstacle), found.pose, found.metres
            self.contacts.append(plan)
            if (self._keeps_ways and len(self.contacts) <= MAX_CONTACTS
                    and found.way is not None and found.outline is not None):
                plan.way = spread(found.way.tolist(), MAX_PLACES)
                plan.outline = found.outline.tolist()

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Options and results of a check of a recording. Times in results are ints in ns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import enum
from operator import itemgetter
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from sat_collision.extras import in_one_line
from sat_collision.replay.bag.storage import Limits

if TYPE_CHECKING:
    from sat_collision.geometry.body.polygon import Polygon
    from sat_collision.replay.model.keyframes import Keyframes, ShownBody

_Number = TypeVar('_Number', int, float)
_Place = TypeVar('_Place')
Sample: TypeAlias = tuple[int, 'float | None']  # a time in ns, and a separation or the like

NODE = '/footprint_monitor'
RECEIVE = 'receive'
HEADER = 'header'
PLAN = 'plan'
# In the words of a problem for which the bag asked for is not written.
WRITING = ': --write-bag: '
_SECOND = 10**9
# Moments drawn over all time, and around each of the deepest contacts; max of these contacts.
_MOMENTS = 400
_AROUND = 40
_MAX_AROUND = 20
# Max contacts that are drawn, also of plans; max places of a plan, and max samples of a curve.
MAX_CONTACTS = 200
MAX_PLACES = 200
_MAX_SAMPLES = 4096


@dataclass(frozen=True)
class Options:
    """How to check recordings; times in s."""

    parameters: Mapping[str, object] = field(default_factory=dict)  # of the node, by dotted name
    footprints: Sequence[str] = ()  # topics, or NAME:=TOPIC
    obstacles: Sequence[str] = ()
    node: str = NODE  # its full name
    as_live: bool = False  # answer what the monitor would have said, not what touched
    clock: str = RECEIVE  # the time of a message is when it was received, or its HEADER stamp
    start: float = 0.0  # what part to check, from the recording's beginning
    duration: float | None = None
    max_unknown: float = 1.0  # for how long in all a footprint may be unknown
    max_undetermined: float = 0.0  # for how long in all motion may be undetermined
    min_ttc: float | None = None  # the least that is allowed, 0 for any; None to predict none
    fail_on: str | None = None  # PLAN: no plan may be in contact, or unknown
    sample: float = 0.1  # as live, how often to measure separations
    keyframes: bool = False  # keep where the bodies were, to be drawn
    content: bool = False  # digest the messages, which tells whether two recordings are the same
    write_bag: str | None = None  # as live, where to write what the node would have published
    limits: Limits = Limits()
    debug: bool = False  # show where an unexpected error is raised


class Verdict(enum.IntEnum):
    """The answer to the question of a check; its value is the exit status."""

    CLEAR = 0
    COLLISION = 1
    UNKNOWN = 2
    BAD_INPUT = 3

    @property
    def words(self) -> str:
        return self.name.lower().replace('_', ' ')


# How a contact or a separation was found: by the monitor, or by recorded motion.
AT_A_MESSAGE = 'at a message'
AT_A_SAMPLE = 'at a sample'
BETWEEN_SAMPLES = 'between samples'

# From the least to the most serious verdict.
SEVERITY = (Verdict.CLEAR, Verdict.UNKNOWN, Verdict.BAD_INPUT, Verdict.COLLISION)


@dataclass
class Contact:
    """A footprint and an obstacle share a point, from `first` until just before `last`."""

    footprint: str
    obstacle: str
    first: int
    last: int
    depth: float = 0.0  # the deepest in m, 0 if they touch, negative if apart within the margin
    deepest: int = 0  # when it was deepest
    x: float = 0.0  # the middle of where their bounds overlapped then
    y: float = 0.0
    normal: list[float] = field(default_factory=list)  # unit vector from obstacle to footprint
    points: list[list[float]] = field(default_factory=list)  # one or two of the footprint
    at_end: bool = False  # they were still in contact at the end
    found: str = AT_A_MESSAGE
    # Recorded motion has them apart last before and first after; None where it is not known.
    between: list[int | None] = field(default_factory=lambda: [None, None])
    # The obstacle's name then: its number may belong to another body in another set.
    deepest_as: str = ''  # empty if it is the same

    def deepen(self, depth: float, time: int, own: Polygon, other: Polygon) -> bool:
        """Take a depth (m) of footprint and obstacle; return whether it is the deepest so far."""
        if self.deepest and depth <= self.depth:
            return False
        # Not above: the command line needs results, and importing geometry takes long.
        from sat_collision.geometry.pair.contact import contact
        self.depth, self.deepest = depth, time
        a, b = own.bounds, other.bounds
        self.x = (max(a[0], b[0]) + min(a[2], b[2])) / 2
        self.y = (max(a[1], b[1]) + min(a[3], b[3])) / 2
        found = contact(own, other)
        self.normal = found.normal.tolist()
        self.points = found.points_a.tolist()
        return True

    @property
    def least(self) -> Least:
        """The separation where it is deepest."""
        return Least(0.0 - self.depth, self.deepest, self.obstacle, self.x, self.y, self.found)

    def join(self, other: Contact) -> None:
        """Add a contact of the same footprint and obstacle that began later."""
        if other.depth > self.depth:
            self.depth, self.deepest, self.deepest_as = (
                other.depth, other.deepest, other.deepest_as)
            self.x, self.y, self.normal, self.points = (
                other.x, other.y, other.normal, other.points)
        if other.last > self.last:
            self.last, self.between[1] = other.last, other.between[1]
        self.at_end |= other.at_end
        self.found = self.found if self.found == AT_A_SAMPLE else other.found


@dataclass
class Unknown:
    """The state of a footprint, or some motion, is unknown from `first` until before `last`."""

    footprint: str
    first: int
    last: int
    reasons: list[str]


@dataclass
class Least:
    """The least separation of a footprint in m: when, from which obstacle, at (x, y)."""

    separation: float
    time: int
    obstacle: str
    x: float
    y: float
    found: str = AT_A_MESSAGE


@dataclass
class Soonest:
    """The least time to collision of a footprint in s: when predicted, and with which obstacle."""

    time_to_collision: float
    time: int
    obstacle: str


@dataclass
class PlanContact:
    """A plan, which counts from `time` until just before `until`, meets an obstacle."""

    footprint: str
    obstacle: str
    time: int
    until: int
    pose: float  # counted from 0 in the plan, 3.25 between 3 and 4
    metres: float  # along the plan, from where the robot is
    way: list[list[float]] = field(default_factory=list)  # the plan until there, (n, 2) in m
    outline: list[list[float]] = field(default_factory=list)  # the footprint there, (n, 2) in m


@dataclass
class FootprintResult:
    """How long (ns) a footprint was in each state, and how near the nearest obstacle was."""

    name: str
    topic: str
    enabled: bool
    clear: int = 0
    collision: int = 0
    unknown: int = 0
    undetermined: int = 0  # its state is known, but not how it or an obstacle moved
    start_up: int = 0  # for how long after the start some source cannot be known
    last: int | None = None  # the stamp of its last message
    ever_known: bool = False
    least: Least | None = None
    # In m, None where unknown; of very many samples only the least of neighbours are kept.
    separation: list[Sample] = field(default_factory=list)
    soonest: Soonest | None = None
    # In s, None where unknown or where no collision is within the horizon.
    time_to_collision: list[Sample] = field(default_factory=list)
    plans: int | None = None  # how many were checked, None without a path
    plans_unknown: dict[str, int] = field(default_factory=dict)  # how many were not, by reason
    # Names of the sources that concern it, itself among them, with messages refused for content.
    refused: list[str] = field(default_factory=list)

    @property
    def coverage(self) -> float | None:
        """The share of the time in which the state was known, None if no time passed."""
        known = self.clear + self.collision
        total = known + self.unknown + self.undetermined
        return known / total if total else None

    def note_least(self, found: Least) -> None:
        """Record a separation if it is the least so far."""
        if self.is_least(found.separation):
            self.least = found

    def is_least(self, separation: float) -> bool:
        """Return whether a separation is the least so far."""
        return self.least is None or separation < self.least.separation


@dataclass
class SourceResult:
    """How many messages a footprint or source of obstacles had, and why some were rejected."""

    name: str
    topic: str
    received: int
    rejected: dict[str, int]  # numbers by reason
    examples: dict[str, str]  # the first one by reason
    undetermined: int = 0  # for how long (ns) it is not known how a body of it moved
    refused: int = 0  # for their content, such as NaN or self-intersection
    lost: int = 0  # messages that the recorder lost, as far as it recorded that
    known_by: str = ''  # the rule by which all obstacles of it are known


@dataclass
class Result:
    """What was found in one recording."""

    bag: str
    options: Options = field(default=Options(), compare=False)
    origin: int | None = None  # when the recording begins
    start: int | None = None  # what part of it was checked
    end: int | None = None
    content: str | None = None  # the digest of the messages, the same wherever they are stored
    footprints: list[FootprintResult] = field(default_factory=list)
    sources: list[SourceResult] = field(default_factory=list)
    contacts: list[Contact] = field(default_factory=list)
    unknown: list[Unknown] = field(default_factory=list)
    undetermined: list[Unknown] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)  # what is wrong with the recording
    notes: list[str] = field(default_factory=list)  # what else a reader should know
    keyframes: Keyframes | None = None  # the bodies at moments worth drawing, if asked for
    plan_contacts: list[PlanContact] = field(default_factory=list)

    @property
    def bag_faults(self) -> list[str]:
        """The problems for which the bag asked for is not written."""
        return [problem for problem in self.problems if WRITING in problem]

    def add_bag_fault(self, error: Exception) -> None:
        """Add the problem that the bag asked for is not written."""
        self.problems.append(f'{self.bag}{WRITING}not written: {in_one_line(error)}')

    @property
    def duration(self) -> float:
        """The time checked, in s."""
        return 0.0 if self.start is None or self.end is None else (self.end - self.start) / 1e9

    @property
    def undecided(self) -> dict[str, list[Unknown]]:
        """The times in which footprints are neither clear nor in collision, by state."""
        return {'unknown': self.unknown, 'undetermined': self.undetermined}

    def count_times(self) -> None:
        """Fill in how long footprints are in each state; of several the first one counts."""
        start, end = self.start or 0, self.end or 0
        states: dict[str, Sequence[Contact | Unknown]] = {
            'collision': self.contacts, **self.undecided}
        for footprint in self.footprints:
            taken: list[tuple[int, int]] = []
            before = 0
            for state, intervals in states.items():
                taken += times_of(intervals, footprint.name)
                length = length_of(taken, start, end)
                setattr(footprint, state, length - before)
                before = length
            footprint.clear = end - start - before

    def obstacle_of(self, contact: Contact) -> ShownBody | None:
        """Return the obstacle of a contact, None if it was not kept."""
        return None if self.keyframes is None else self.keyframes.obstacle(
            contact.deepest_as or contact.obstacle, contact.deepest, contact.x, contact.y)

    def since(self, time: int) -> float:
        """Return a time in s since the recording begins."""
        return 0.0 if self.origin is None else (time - self.origin) / 1e9

    @property
    def messages(self) -> int:
        return sum(source.received for source in self.sources)

    @property
    def nearest(self) -> tuple[str, Least] | None:
        """The footprint of the least separation, and that; None if none was found."""
        found = [(one.name, one.least) for one in self.footprints if one.least]
        return min(found, key=lambda one: one[1].separation, default=None)

    @property
    def too_unknown(self) -> list[FootprintResult]:
        """The footprints that were unknown for too long, besides their start-up."""
        return [footprint for footprint in self.footprints if footprint.enabled and (
            self._only(self.unknown, footprint, self.end or 0) > 1e9 * self.options.max_unknown
            or not footprint.ever_known)]

    @property
    def too_undetermined(self) -> list[FootprintResult]:
        """The footprints whose motion, or that of obstacles, was undetermined for too long."""
        return [footprint for footprint in self.footprints
                if self.undetermined_of(footprint) > 1e9 * self.options.max_undetermined]

    def undetermined_of(self, footprint: FootprintResult) -> int:
        """Return for how long (ns) motion was undetermined after start-up, before its end."""
        end, last = self.end or 0, footprint.last or 0
        # One with no stamp in the time checked has no end there.
        return self._only(self.undetermined, footprint, last if last > (self.start or 0) else end)

    def _only(self, intervals: Iterable[Unknown], footprint: FootprintResult, end: int) -> int:
        """Return for how long (ns) a footprint is in intervals after start-up, not in contact."""
        start = (self.start or 0) + footprint.start_up
        contacts = times_of(self.contacts, footprint.name)
        return length_of([*contacts, *times_of(intervals, footprint.name)], start, end
                         ) - length_of(contacts, start, end)

    @property
    def too_soon(self) -> list[FootprintResult]:
        """The footprints whose least time to collision is less than allowed."""
        limit = self.options.min_ttc
        return [one for one in self.footprints if limit is not None
                and one.soonest and one.soonest.time_to_collision < limit]

    @property
    def planners(self) -> list[FootprintResult]:
        """The footprints whose plans count for the verdict."""
        return [one for one in self.footprints if self.options.fail_on == PLAN
                and one.plans is not None]

    @property
    def verdict(self) -> Verdict:
        """The verdict: a contact, or too short a time to one, outweighs whatever else is wrong."""
        planners = self.planners
        if self.contacts or self.too_soon or planners and self.plan_contacts:
            return Verdict.COLLISION
        if self.problems:
            return Verdict.BAD_INPUT
        if (self.too_unknown or self.too_undetermined or any(one.refused for one in self.sources)
                or any(one.plans_unknown or not one.plans for one in planners)
                or not any(one.enabled for one in self.footprints)):
            return Verdict.UNKNOWN
        return Verdict.CLEAR


def overall(results: Iterable[Result]) -> Verdict:
    """Return the verdict on several recordings: the most serious one."""
    return max((result.verdict for result in results), key=SEVERITY.index,
               default=Verdict.BAD_INPUT)


class Series:
    """Adds samples to an empty list; where it would grow long, neighbours become their least."""

    def __init__(self, samples: list[Sample]) -> None:
        self.samples = samples
        self._merged = 1
        self._pending = 0

    def add(self, time: int, value: float | None) -> None:
        samples = self.samples
        if self._pending:
            samples[-1] = samples[-1][0], least_of_all((samples[-1][1], value))
        else:
            if len(samples) == _MAX_SAMPLES:
                samples[:] = [(time_a, least_of_all((a, b))) for (time_a, a), (_, b)
                              in zip(samples[::2], samples[1::2])]
                self._merged *= 2
            samples.append((time, value))
        self._pending = (self._pending + 1) % self._merged


def least_of(series: Iterable[list[Sample]]) -> Iterable[Sample]:
    """Return the least of the latest values of several series, each in any order, by time."""
    latest: dict[int, float | None] = {}
    found: dict[int, float | None] = {}
    for time, number, value in sorted(
            ((time, number, value) for number, samples in enumerate(series)
             for time, value in samples), key=itemgetter(0)):
        latest[number] = value
        found[time] = least_of_all(latest.values())
    return found.items()


def joined(intervals: Iterable[tuple[_Number, _Number]], gap: float = 0
           ) -> list[tuple[_Number, _Number]]:
    """Return the union of intervals, in their order; those no more than a gap apart are one."""
    found: list[tuple[_Number, _Number]] = []
    for first, last in sorted(intervals):
        if found and first <= found[-1][1] + gap:
            first, last = found[-1][0], max(last, found.pop()[1])
        found.append((first, last))
    return found


def times_of(intervals: Iterable[Contact | Unknown], name: str) -> list[tuple[int, int]]:
    """Return from when to when the intervals of a footprint are."""
    return [(one.first, one.last) for one in intervals if one.footprint == name]


def length_of(intervals: Iterable[tuple[int, int]], start: int, end: int) -> int:
    """Return the total length of the union of intervals, between two times."""
    return sum(last - first for first, last in joined(
        (max(first, start), min(last, end)) for first, last in intervals
        if first < end and last > start))


def joined_contacts(contacts: Iterable[Contact]) -> list[Contact]:
    """Return contacts in order, those that meet with one obstacle as one."""
    found: list[Contact] = []
    latest: dict[tuple[str, str], Contact] = {}
    for contact in sorted(contacts, key=lambda contact: contact.first):
        key = contact.footprint, contact.obstacle
        if key in latest and contact.first <= latest[key].last:
            latest[key].join(contact)
        else:
            latest[key] = contact
            found.append(contact)
    return found


def least_of_all(values: Iterable[float | None]) -> float | None:
    """Return the least of the values that are not None."""
    return min((value for value in values if value is not None), default=None)


class Unknowns:
    """Joins the unknown times of footprints to intervals, in the order of their beginning."""

    def __init__(self) -> None:
        self.intervals: list[Unknown] = []
        self._open: dict[str, Unknown] = {}

    def follow(self, name: str, reasons: Iterable[str], now: int) -> None:
        """Record why a footprint is unknown from now on; no reasons if it is known."""
        reasons = list(reasons)
        unknown = self._open.get(name)
        if unknown and unknown.reasons != reasons:
            unknown.last = now
            del self._open[name]
        if reasons and name not in self._open:
            unknown = self._open[name] = Unknown(name, now, now, reasons)
            self.intervals.append(unknown)

    def finish(self, now: int) -> None:
        """End open intervals, and drop those without duration."""
        for unknown in self._open.values():
            unknown.last = now
        self.intervals[:] = [one for one in self.intervals if one.last > one.first]


def moments_of(result: Result) -> list[int]:
    """
    Return the moments of a result that are worth drawing, in ns.

    They are spread over the recording, denser around the deepest contacts, and include the
    beginning and the deepest moment of each of these and every least separation.
    """
    if result.start is None or result.end is None:
        return []
    known = [time for footprint in result.footprints for time, value in footprint.separation
             if value is not None]
    start, end = min(known, default=result.start), max(known, default=result.end)
    moments = {*spread(range(start, end + 1), _MOMENTS)}
    contacts = deepest_contacts(result)
    for contact in contacts[:_MAX_AROUND]:
        first, last = max(contact.first - _SECOND, start), min(contact.last + _SECOND, end)
        if last - first < _AROUND * (end - start) / _MOMENTS:
            moments.update(spread(range(first, last + 1), _AROUND))
    moments.update(time for contact in contacts for time in (contact.first, contact.deepest))
    moments.update(footprint.least.time for footprint in result.footprints if footprint.least)
    return sorted(moments)


def deepest_contacts(result: Result) -> list[Contact]:
    """Return the contacts of a result, the deepest first; not more than are drawn."""
    return sorted(result.contacts, key=lambda contact: -contact.depth)[:MAX_CONTACTS]


def spread(places: Sequence[_Place], limit: int) -> list[_Place]:
    """Return at most so many of some places, the first and the last ones included."""
    last, count = len(places) - 1, min(len(places), limit)
    return [places[last * k // (count - 1)] for k in range(count)] if count > 1 else [*places]

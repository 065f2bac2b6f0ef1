# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A buffer of transforms: where a frame was in another at a time, or why that is not known.

It does what tf2's buffer does. That one is not used because pip has no tf2, and recordings are
checked without ROS.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Container
from itertools import chain, islice, takewhile
import math
import re
from typing import NamedTuple, TypeAlias

from sat_collision.geometry.body.polygon import Affine2D
from sat_collision.scene.rotations import (
    accepted, affine_of, composed, fixed, FixedTransform, IDENTITY, interpolated, relative, tilt,
    Transform)
from sat_collision.scene.settings import NEVER

# Why a transform is refused.
BAD_NAMES = 'bad frame names'
BAD_TRANSFORM = 'not finite or no rotation'
OLD_TRANSFORM = 'older than tf_cache_time'
TOO_MANY_FRAMES = 'too many frames'
# Why there is none.
BAD_FRAME_ID = 'bad frame_id'
GAP = 'gap between transforms'
LOOP = 'frames in a circle'
NO_TRANSFORM = 'no transform'
NOT_CONNECTED = 'frames not connected'
OLD_LATEST = 'latest transform too old'
TILTED = 'tilted'
UNKNOWN_FRAME = 'unknown frame'
# Of these the detail has no figures.
_LASTING = BAD_FRAME_ID, LOOP, NOT_CONNECTED, UNKNOWN_FRAME

LONGEST_FRAME_ID = 255
# Bounds the memory that made-up frame names can take.
_MAX_FRAMES = 10_000
# The least time of stamps, in ns, between two searches for frames to forget, as each takes long.
_LOOKED_EVERY = 10**9
# Max answered look-ups that are kept; in messages for users, max frames and characters of a name.
_MAX_MAPS = 256
# Max transforms of a frame; more within the history, and the older half is forgotten.
_MAX_KEPT = 20_000
_MAX_LISTED = 10
_MAX_SHOWN = 64
_PLAIN = re.compile(rf'[A-Za-z0-9_./-]{{1,{_MAX_SHOWN}}}')

# A frame and its ancestors, in order, each with the transform from the one before it; that of the
# first is the identity.
_Steps: TypeAlias = dict[str, FixedTransform]
# The parent frame, and the transform to it.
_Link: TypeAlias = tuple[str, Transform]


class Mapped(NamedTuple):
    """The map from the plane of a frame to that of another."""

    affine: Affine2D
    at: int | None  # the time that it holds for in ns, None for all times


class NoTransform(NamedTuple):
    """Why it is not known where a frame is in another."""

    reason: str  # a few words without names and figures, to count by
    detail: str  # what is wrong, for users
    may_come: bool  # whether later transforms may yet give an answer

    @property
    def lasting(self) -> str:
        """What is wrong, without figures that change with time."""
        return self.detail if self.reason in _LASTING else self.reason


class Frames:
    """
    The parent of each frame, its transforms of the last seconds, and look-ups in them.

    Of several transforms of a child at one stamp the last counts, with its parent, whoever sent
    it. As in tf2, the translation is interpolated linearly between two stamps and the rotation
    evenly, and static transforms hold at all times. Unlike in tf2, nothing is known between two
    stamps that are further apart than `max_gap`.

    Transforms of a frame are kept for the `history` before its newest one. A frame that is tilted
    by more than `max_tilt`, in rad, is not projected onto the plane. Times are ints in ns.
    """

    def __init__(self, history: int, max_gap: float = NEVER, max_tilt: float = math.pi) -> None:
        self._history = history
        # By the name of the frame: its parent with the transform to it, or a track of these.
        self._static: dict[str, tuple[str, FixedTransform]] = {}
        self._moving: dict[str, _Track] = {}
        self._parents: set[str] = set()
        self._last = 0  # the stamp of the last moving transform, good or not
        self._looked: float = -NEVER  # that of the last search for frames to forget
        # Answered look-ups by target, source and stamp. They hold until a transform changes the
        # past: one newer than all others of its frame does not.
        self._maps: dict[tuple[str, str, int], Mapped] = {}
        self.configure(max_gap, max_tilt)

    def clear(self, after: float = -NEVER) -> None:
        """
        Forget moving frames, or those without a stamp or with one after a time.

        Static ones come once.
        """
        self._keep(1, after)

    def _keep(self, earliest: float, latest: float) -> None:
        """Forget all moving frames but those whose newest stamp is between two times."""
        self._moving = {frame: track for frame, track in self._moving.items()
                        if earliest <= track.stamps[-1] <= latest}
        links = chain(self._static.values(), *(one.links for one in self._moving.values()))
        self._parents = {parent for parent, _ in links}
        self._maps.clear()

    def limit_times(self, before: int, now: int) -> None:
        """Let no transform be ahead of a clock that went back a little: the next ones count."""
        for track in self._moving.values():
            track.limit(before, now)
        self._maps.clear()

    def configure(self, max_gap: float, max_tilt: float) -> None:
        self._max_gap, self._max_tilt = max_gap, max_tilt
        self._maps.clear()

    def insert(self, parent: str, child: str, stamp: int, transform: Transform,
               static: bool = False) -> str | None:
        """
        Insert the transform from a child frame to its parent.

        A slash before a name is dropped, as tf2 does. Return None, or why it was refused:
        BAD_NAMES, BAD_TRANSFORM, OLD_TRANSFORM or TOO_MANY_FRAMES.
        """
        taken = accepted(transform)
        track = self._moving.get(child)
        if not static:
            self._last = stamp
        # The usual case: a newer transform of a known frame.
        if track is not None and not static and taken and track.links[-1][0] == parent \
                and track.extend(stamp, (parent, taken), self._history):
            return None
        if parent[:1] == '/' or child[:1] == '/':
            parent, child = parent.removeprefix('/'), child.removeprefix('/')
        if parent == child or not parent or not child:
            return BAD_NAMES
        if taken is None:
            return BAD_TRANSFORM
        if self._is_full(parent, child):
            if abs(self._last - self._looked) >= _LOOKED_EVERY:
                self._looked = self._last
                newest = max((one.stamps[-1] for one in self._moving.values()), default=0)
                # Where all are silent, refused ones say how late it is.
                self._keep(max(newest, self._last) - self._history, NEVER)
            if self._is_full(parent, child):
                return TOO_MANY_FRAMES
        link = parent, taken
        if static:
            pose = parent, fixed(taken)
            is_past_changed = self._static.get(child) != pose
            if is_past_changed:
                self._moving.pop(child, None)
                self._static[child] = pose
        elif (track := self._moving.get(child)) is None:
            self._static.pop(child, None)
            self._moving[child] = _Track(stamp, link)
            is_past_changed = True
        else:
            is_past_changed = not track.extend(stamp, link, self._history)
            if is_past_changed and not track.insert(stamp, link, self._history):
                return OLD_TRANSFORM
        is_turned_round = self._drop_reverse(parent, child, NEVER if static else stamp)
        self._parents.add(parent)
        if is_past_changed or is_turned_round:
            self._maps.clear()
        return None

    def _is_full(self, parent: str, child: str) -> bool:
        """Return whether a transform would bring one frame too many."""
        return len(self._static) + len(self._moving) >= _MAX_FRAMES and not (
            child in self._static or child in self._moving) or (
            len(self._parents) >= _MAX_FRAMES and parent not in self._parents)

    def _drop_reverse(self, parent: str, child: str, stamp: float) -> bool:
        """Drop what was known of a parent in its child until a time, as it was wrong."""
        track = self._moving.get(parent)
        if track is not None and track.links[-1][0] == child and track.stamps[-1] <= stamp:
            del self._moving[parent]
        elif parent in self._static and self._static[parent][0] == child:
            del self._static[parent]
        else:
            return False
        return True

    def lookup(self, target: str, source: str, stamp: int) -> FixedTransform | NoTransform:
        """Return the transform from the source frame to the target frame at a time."""
        if source == target:
            return IDENTITY
        below, top = self._climb(source, stamp, (target,))
        if top == target:
            return _transform_to(target, below)
        if top:
            above, common = self._climb(target, stamp, below)
            if common in below:
                return relative(_transform_to(common, above), _transform_to(common, below))
        return self._explain(target, source, stamp)

    def newest(self, target: str, source: str, oldest: float = -NEVER,
               now: float = NEVER) -> int | None | NoTransform:
        """
        Return the latest time for which both frames are known, None if that is any time.

        A time before `oldest` is not accepted. One after `now` counts only while the last
        transforms received are after `now`: those of a clock that is ahead count at once, but one
        ahead of the clock must not shut out those after it.
        """
        below, top = self._climb(source, None, (target,))
        above, common = self._climb(target, None, below)
        if not top or common not in below:
            return self._explain(target, source, None)
        path = chain(takewhile(common.__ne__, below), takewhile(common.__ne__, above))
        tracks = [self._moving[frame] for frame in path if frame in self._moving]
        if not tracks:
            return None
        time = min(track.stamps[-1] for track in tracks)
        if time > now:
            time = min(track.newest(now) for track in tracks)
        if time < oldest:
            return NoTransform(
                OLD_LATEST, f'no transform from {in_words(source)} to {in_words(target)}: the '
                f'newest is past the timeout by {_seconds(oldest - time)}', True)
        return time

    def lookup_affine(self, target: str, source: str, stamp: int, oldest: float = -NEVER,
                      now: float = NEVER) -> Mapped | NoTransform:
        """
        Return the map from the plane of a frame to that of another.

        A stamp of 0 stands for the time that `newest` returns.
        """
        key = target, source, stamp
        if (known := self._maps.get(key)) is not None:
            return known
        at = stamp or self.newest(target, source, oldest, now)
        if isinstance(at, NoTransform):
            return at
        pose = self.lookup(target, source, at or 0)
        if isinstance(pose, NoTransform):
            return pose
        angle = tilt(pose)
        if angle > self._max_tilt:
            return NoTransform(
                TILTED, f'{in_words(source)} is tilted by {math.degrees(angle):.1f} degrees in '
                f'{in_words(target)}, more than {math.degrees(self._max_tilt):g}', False)
        mapped = Mapped(affine_of(pose), at)
        if stamp:
            if len(self._maps) >= _MAX_MAPS:
                self._maps.clear()
            self._maps[key] = mapped
        return mapped

    def is_carried(self, frame: str, other: str, parent: str) -> bool:
        """
        Return whether one of two frames moves with the other, by their newest transforms.

        The other moves in the given parent, so what that moves in does not move with it.
        """
        return (self._climb(frame, None, (other,))[1] == other
                or frame != parent and self._climb(other, None, (frame, parent))[1] == frame)

    def moving_frame(self, frame: str) -> str:
        """Return the first frame, from one upwards, that is not static in its parent."""
        steps, top = self._climb(frame, None)
        return next((name for name in steps if name not in self._static), top)

    def stamps(self, target: str, source: str, after: int, until: int) -> list[int]:
        """Return the sorted stamps, between two times, of the transforms above either frame."""
        names = {*self._climb(source, None)[0], *self._climb(target, None)[0]}
        return sorted({stamp for name in names & self._moving.keys()
                       for stamp in self._moving[name].stamps if after < stamp < until})

    def _climb(self, frame: str, stamp: int | None,
               ends: Container[str] = ()) -> tuple[_Steps, str]:
        """
        Collect the transforms at a time from a frame to its ancestors, up to one of the ends.

        Without a time the newest ones say which the ancestors are, and the steps mean nothing.
        Return the steps, as far as they are known, and the last frame, which is empty if the
        frames form a circle.
        """
        steps = {frame: IDENTITY}
        while frame not in ends:
            found = self._static.get(frame)
            if found is None and (track := self._moving.get(frame)):
                found = ((track.links[-1][0], IDENTITY) if stamp is None
                         else track.at(stamp, self._max_gap))
            if found is None:
                break
            frame, step = found
            if frame in steps:
                return steps, ''
            steps[frame] = step
        return steps, frame

    def _explain(self, target: str, source: str, stamp: int | None) -> NoTransform:
        """Say why there is no answer for a time, or for the newest."""
        prefix = f'no transform from {in_words(source)} to {in_words(target)}'
        for name in (source, target):
            if not name or name[0] == '/':
                return NoTransform(BAD_FRAME_ID, f'{in_quotes(name)} is not a valid frame: a '
                                   'name is not empty and does not begin with a slash', False)
        known = {**self._static, **self._moving, **dict.fromkeys(self._parents)}
        if unknown := [in_words(name) for name in (source, target) if name not in known]:
            only = f'named {" or ".join(unknown)} yet, only {_listed(sorted(known))}'
            return NoTransform(UNKNOWN_FRAME, f'{prefix}: no good transform has '
                               f'{only if known else "come yet"}', True)
        faults = []
        for name in (source, target):
            passed, top = self._climb(name, stamp)
            if stamp is not None and top in self._moving:
                faults.append(self._fault(top, stamp, f'{prefix} at its stamp'))
            if not top:
                return NoTransform(LOOP, f'{prefix}: the parents of {in_words(name)} lead in a '
                                   f'circle: {_listed(passed)}', True)
        if not faults:
            return NoTransform(NOT_CONNECTED, f'{prefix}: no transforms connect them', True)
        return faults[0]._replace(may_come=any(fault.may_come for fault in faults))

    def _fault(self, frame: str, stamp: int, prefix: str) -> NoTransform:
        """Say why it is not known where a frame was at a time."""
        track, name = self._moving[frame], in_words(frame)
        if stamp > track.stamps[-1]:
            return NoTransform(NO_TRANSFORM, f'{prefix}: the newest of {name} is '
                               f'{_seconds(stamp - track.stamps[-1])} older', True)
        if stamp < track.stamps[0]:
            return NoTransform(NO_TRANSFORM, f'{prefix}: the oldest of {name} is '
                               f'{_seconds(track.stamps[0] - stamp)} newer', False)
        before, after = track.stamps[bisect_right(track.stamps, stamp) - 1:][:2]
        return NoTransform(GAP, f'{prefix}: the transforms of {name} around it are '
                           f'{_seconds(after - before)} apart, more than '
                           f'{_seconds(self._max_gap)}', False)


def _listed(names: Collection[str]) -> str:
    """Return the names of frames for users, the first of them if they are many."""
    more = len(names) - _MAX_LISTED
    return ', '.join([*map(in_words, islice(names, _MAX_LISTED)),
                      *([f'and {more} more'] if more > 0 else [])])


def _seconds(nanoseconds: float) -> str:
    return f'{nanoseconds / 1e9:.3g} s'


def _transform_to(end: str, steps: _Steps) -> FixedTransform:
    """Return the transform from the first frame of some steps to another of them."""
    here = IDENTITY
    for frame, step in steps.items():
        here = step if here is IDENTITY else composed(step, here)
        if frame == end:
            break
    return here


class _Track:
    """
    Transforms of a frame by their stamps, with the meaning that tf2's TimeCache gives them.

    Where several have one stamp, the last one counts from then on, and interpolation up to that
    stamp leads to the first one. Times are ints in ns.
    """

    __slots__ = ('stamps', 'links', 'last')

    def __init__(self, stamp: int, link: _Link) -> None:
        # Ascending, none more than twice, and a link for each.
        self.stamps = [stamp]
        self.links = [link]
        self.last = stamp  # that of the last one received

    def extend(self, stamp: int, link: _Link, history: int) -> bool:
        """
        Add a transform newer than all others; return False if it is not newer.

        Transforms more than the history older than the previous newest are forgotten, as in tf2.
        """
        stamps = self.stamps
        if stamp <= stamps[-1]:
            return False
        self._prune(history)
        stamps.append(stamp)
        self.links.append(link)
        self.last = stamp
        return True

    def insert(self, stamp: int, link: _Link, history: int) -> bool:
        """Add an older transform, forgetting as `extend` does; return False if it is too old."""
        stamps, links = self.stamps, self.links
        self._prune(history)
        if stamp < stamps[-1] - history:
            return False
        self.last = stamp
        place = bisect_right(stamps, stamp)
        first = bisect_left(stamps, stamp)
        if place - first == 2:
            links[place - 1] = link
        elif place == first or links[first] != link:
            stamps.insert(place, stamp)
            links.insert(place, link)
        return True

    def newest(self, now: float) -> int:
        """Return the newest stamp until `now`, or that of the last one received if later."""
        return self.last if self.last > now else self.stamps[bisect_right(self.stamps, now) - 1]

    def limit(self, before: int, now: int) -> None:
        """
        Let no stamp be ahead of a clock that went back from `before` to `now`.

        The newest transform is as old as it was, and others of that time or later are forgotten.
        """
        if self.stamps[-1] > now:
            self.last = now - max(before - self.stamps[-1], 0)
            place = bisect_left(self.stamps, self.last)
            self.stamps[place:], self.links[place:] = [self.last], self.links[-1:]

    def _prune(self, history: int) -> None:
        """Forget what is older than the newest by more than the history, and what is too much."""
        stamps = self.stamps
        oldest = stamps[-1] - history
        if stamps[0] < oldest or len(stamps) >= _MAX_KEPT:
            passed = bisect_left(stamps, oldest)
            if len(stamps) - passed >= _MAX_KEPT:
                passed = len(stamps) - _MAX_KEPT // 2
            del stamps[:passed], self.links[:passed]

    def at(self, stamp: int, max_gap: float) -> tuple[str, FixedTransform] | None:
        """
        Return the parent and the transform at a time; None outside the history, and in a gap.

        Between two stamps no further apart than `max_gap` it is interpolated; where the parent
        changed between them it is the older one, as in tf2.
        """
        stamps = self.stamps
        place = bisect_right(stamps, stamp)
        if place == 0:
            return None
        before = stamps[place - 1]
        parent, older = self.links[place - 1]
        if before == stamp:
            return parent, fixed(older)
        if place == len(stamps) or stamps[place] - before > max_gap:
            return None
        next_parent, newer = self.links[place]
        if next_parent != parent:
            return parent, fixed(older)
        return parent, interpolated(older, newer, stamp - before, stamps[place] - before)


def in_quotes(text: str) -> str:
    """Return a text quoted, cut to 64 characters, without line breaks or control characters."""
    shown = repr(text[:_MAX_SHOWN])
    return f'{shown} and so on' if len(text) > _MAX_SHOWN else shown


def in_words(name: str) -> str:
    """Return the name of a frame, in quotes if it has unusual characters."""
    return name if _PLAIN.fullmatch(name) else in_quotes(name)

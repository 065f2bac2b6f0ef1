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

"""Look up where a frame was in another at a time, or why that is not known."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from itertools import chain, takewhile
import math
from typing import NamedTuple

from sat_collision.geometry.polygon import Affine2D
from sat_collision.scene.frame_tree import FrameTree, in_quotes, in_words, transform_to
from sat_collision.scene.rotations import (
    affine_of, FixedTransform, IDENTITY, relative, rounded, tilt, Transform)
from sat_collision.scene.settings import NEVER

BAD_FRAME_ID = 'bad frame_id'
GAP = 'gap between transforms'
LOOP = 'frames in a circle'
NO_TRANSFORM = 'no transform'
NOT_CONNECTED = 'frames not connected'
OLD_LATEST = 'latest transform too old'
TILTED = 'tilted'
UNKNOWN_FRAME = 'unknown frame'

_MOST_MAPS = 256
_MOST_LISTED = 10


class Located(NamedTuple):
    """Where a frame is in another."""

    pose: FixedTransform  # from the one to the other
    at: int | None  # the time that it holds for in ns, None for all times

    @property
    def transform(self) -> Transform:
        """The pose, rounded to doubles."""
        return rounded(self.pose)


class Mapped(NamedTuple):
    """The map from the plane of a frame to that of another."""

    affine: Affine2D
    at: int | None  # as in `Located`


class NoTransform(NamedTuple):
    """Why it is not known where a frame is in another."""

    reason: str  # a few words without names and figures, to count by
    detail: str  # what is wrong, for users
    may_come: bool  # whether later transforms may yet give an answer


class Frames:
    """
    The transforms of the last seconds, and look-ups in them.

    As in tf2, the translation is interpolated linearly between two stamps and the rotation evenly,
    and static transforms hold at all times. Unlike in tf2, nothing is known between two stamps
    that are further apart than `max_gap`.

    Times are ints in ns.

    Parameters
    ----------
    history : int
        How much older than the newest transform of a frame others may be to be kept.
    max_gap : float, optional
        NEVER for any.
    max_tilt : float, optional
        By how much a frame may be tilted to be projected onto the plane, in rad.

    """

    def __init__(self, history: int, max_gap: float = NEVER, max_tilt: float = math.pi) -> None:
        self._tree = FrameTree(history)
        self._maps: dict[tuple[str, str, int], Mapped] = {}
        self.configure(max_gap, max_tilt)

    def clear(self) -> None:
        """Forget all moving frames, as tf2 does; static ones are published only once."""
        self._tree.clear()
        self._maps.clear()

    def configure(self, max_gap: float, max_tilt: float) -> None:
        """Apply other limits."""
        self._max_gap, self._max_tilt = max_gap, max_tilt
        self._maps.clear()

    def insert(self, parent: str, child: str, stamp: int, transform: Transform,
               static: bool = False) -> str | None:
        """Insert a transform as `FrameTree.insert` does, and return what that returns."""
        tree = self._tree
        refusal = tree.insert(parent, child, stamp, transform, static)
        if tree.rewritten:
            # A transform newer than all others changes no look-up that was answered.
            self._maps.clear()
            tree.rewritten = False
        return refusal

    def lookup(self, target: str, source: str, stamp: int) -> Located | NoTransform:
        """Return where the source frame was in the target frame at a time."""
        if source == target:
            return Located(IDENTITY, stamp)
        climb, gap = self._tree.climb, self._max_gap
        below, top = climb(source, stamp, gap, (target,))
        if top == target:
            return Located(transform_to(target, below), stamp)
        if top:
            above, common = climb(target, stamp, gap, below)
            if common in below:
                return Located(relative(transform_to(common, above),
                                        transform_to(common, below)), stamp)
        return self._explain(target, source, stamp)

    def newest(self, target: str, source: str, oldest: float = -NEVER,
               now: float = NEVER) -> Located | NoTransform:
        """
        Return where the source frame is in the target frame, at the latest time known for both.

        A time before `oldest` is no answer. One after `now` is used only if there is no other: a
        transform ahead of the clock must not shut out those after it.
        """
        below, top = self._tree.climb_newest(source, (target,))
        above, common = self._tree.climb_newest(target, below)
        if not top or common not in below:
            return self._explain(target, source, None)
        time = min(above[common], below[common])
        if time == NEVER:
            found = self.lookup(target, source, 0)
            return found._replace(at=None) if isinstance(found, Located) else found
        if time > now:
            path = chain(takewhile(common.__ne__, below), takewhile(common.__ne__, above))
            time = min(stamps[max(bisect_right(stamps, now) - 1, 0)] for stamps in (
                self._tree.moving[frame].stamps for frame in path if frame in self._tree.moving))
        if time < oldest:
            return NoTransform(
                OLD_LATEST, f'no transform from {in_words(source)} to {in_words(target)}: the '
                f'newest is past the timeout by {_seconds(oldest - time)}', True)
        return self.lookup(target, source, int(time))

    def lookup_affine(self, target: str, source: str, stamp: int) -> Mapped | NoTransform:
        """Return as `lookup` does the map from the plane of a frame to that of another."""
        key = target, source, stamp
        known = self._maps.get(key)
        if known is None:
            found = self._projected(self.lookup(target, source, stamp), target, source)
            if isinstance(found, NoTransform):
                return found
            if len(self._maps) >= _MOST_MAPS:
                self._maps.clear()
            self._maps[key] = known = found
        return known

    def newest_affine(self, target: str, source: str, oldest: float = -NEVER,
                      now: float = NEVER) -> Mapped | NoTransform:
        """Return as `newest` does the map from the plane of a frame to that of another."""
        return self._projected(self.newest(target, source, oldest, now), target, source)

    def stamps(self, target: str, source: str, after: int, until: int) -> list[int]:
        """Return the sorted stamps, between two times, of the transforms above either frame."""
        tree = self._tree
        names = {*tree.climb_newest(source)[0], *tree.climb_newest(target)[0]}
        return sorted({stamp for name in names & tree.moving.keys()
                       for stamp in tree.moving[name].stamps if after < stamp < until})

    def _projected(self, found: Located | NoTransform, target: str,
                   source: str) -> Mapped | NoTransform:
        if isinstance(found, NoTransform):
            return found
        angle = tilt(found.pose)
        if angle > self._max_tilt:
            return NoTransform(
                TILTED, f'{in_words(source)} is tilted by {math.degrees(angle):.1f} degrees in '
                f'{in_words(target)}, more than {math.degrees(self._max_tilt):g}', False)
        return Mapped(affine_of(found.pose), found.at)

    def _explain(self, target: str, source: str, stamp: int | None) -> NoTransform:
        """Say why there is no answer for a time, or for the newest."""
        tree = self._tree
        prefix = f'no transform from {in_words(source)} to {in_words(target)}'
        for name in (source, target):
            if not name or name[0] == '/':
                return NoTransform(BAD_FRAME_ID, f'{in_quotes(name)} is not a valid frame: a '
                                   'name is not empty and does not begin with a slash', False)
        for name in (source, target):
            if name not in tree:
                return NoTransform(UNKNOWN_FRAME, f'{prefix}: no good transform has named '
                                   f'{in_words(name)} yet', True)
        faults = []
        for name in (source, target):
            passed: Iterable[str]
            if stamp is None:
                passed, top = tree.climb_newest(name)
            else:
                passed, top = tree.climb(name, stamp, self._max_gap)
                if top in tree.moving:
                    faults.append(self._fault(top, stamp, f'{prefix} at its stamp'))
            if not top:
                shown = [in_words(one) for one in passed]
                if len(shown) > _MOST_LISTED:
                    shown[_MOST_LISTED:] = [f'and {len(shown) - _MOST_LISTED} more']
                return NoTransform(LOOP, f'{prefix}: the parents of {in_words(name)} lead in a '
                                   f'circle: {", ".join(shown)}', True)
        if not faults:
            return NoTransform(NOT_CONNECTED, f'{prefix}: no transforms connect them', True)
        return faults[0]._replace(may_come=any(fault.may_come for fault in faults))

    def _fault(self, frame: str, stamp: int, prefix: str) -> NoTransform:
        """Say why it is not known where a frame was at a time."""
        track, name = self._tree.moving[frame], in_words(frame)
        if stamp > track.stamps[-1]:
            return NoTransform(NO_TRANSFORM, f'{prefix}: the newest of {name} is '
                               f'{_seconds(stamp - track.stamps[-1])} older', True)
        if stamp < track.stamps[0]:
            return NoTransform(NO_TRANSFORM, f'{prefix}: the oldest of {name} is '
                               f'{_seconds(track.stamps[0] - stamp)} newer', False)
        return NoTransform(GAP, f'{prefix}: the transforms of {name} around it are '
                           f'{_seconds(track.gap(stamp))} apart, more than '
                           f'{_seconds(self._max_gap)}', False)


def _seconds(nanoseconds: float) -> str:
    return f'{nanoseconds / 1e9:.3g} s'

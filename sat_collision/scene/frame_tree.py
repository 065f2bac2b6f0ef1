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

"""
The tree of frames: names, recent transforms, and the path from a frame to its ancestors.

It does what tf2's buffer does, which is not used because pip has no tf2, and because recordings
are checked without ROS.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Container
import re
from typing import TypeAlias

from sat_collision.scene.rotations import (
    accepted, composed, fixed, FixedTransform, IDENTITY, interpolated, Transform)
from sat_collision.scene.settings import NEVER

BAD_NAMES = 'bad frame names'
BAD_TRANSFORM = 'not finite or no rotation'
OLD_TRANSFORM = 'older than tf_cache_time'
TOO_MANY_FRAMES = 'too many frames'

# Bounds the memory that made-up frame names can take.
_MOST_FRAMES = 10_000

# A frame and its ancestors, in order, each with the transform from the one before it; that of the
# first is the identity.
Steps: TypeAlias = dict[str, FixedTransform]
# The parent frame, and the transform to it.
Link: TypeAlias = tuple[str, Transform]

LONGEST_FRAME_ID = 255
_PLAIN = re.compile(r'[A-Za-z0-9_./-]{1,64}')
_MOST_SHOWN = 64


class FrameTree:
    """
    The parent of each frame, and its transforms of the last seconds (`history`).

    The last transform of a child at a stamp counts, whoever sent it, and so does its parent. A
    static transform holds at all times. Times are ints in ns.
    """

    def __init__(self, history: int) -> None:
        self._history = history
        # By the name of the frame: its parent with the transform to it, or a track of these.
        self.static: dict[str, tuple[str, FixedTransform]] = {}
        self.moving: dict[str, Track] = {}
        self._parents: set[str] = set()
        # Set when a transform changed the past, and did not only add a newer one.
        self.rewritten = False

    def __contains__(self, frame: str) -> bool:
        """Return whether any transform has named a frame."""
        return frame in self.static or frame in self.moving or frame in self._parents

    def clear(self) -> None:
        """Forget all frames but the static ones."""
        self.moving.clear()
        self._parents = {parent for parent, _ in self.static.values()}

    def insert(self, parent: str, child: str, stamp: int, transform: Transform,
               static: bool = False) -> str | None:
        """
        Insert the transform from a child frame to its parent.

        A slash before a name is dropped, as tf2 does. Return None, or why it was refused:
        BAD_NAMES, BAD_TRANSFORM, OLD_TRANSFORM or TOO_MANY_FRAMES.
        """
        taken = accepted(transform)
        track = self.moving.get(child)
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
        if len(self.static) + len(self.moving) >= _MOST_FRAMES and not (
                child in self.static or child in self.moving):
            return TOO_MANY_FRAMES
        if static:
            pose = parent, fixed(taken)
            if self.static.get(child) != pose:
                self.moving.pop(child, None)
                self.static[child] = pose
                self.rewritten = True
        else:
            link = parent, taken
            track = self.moving.get(child)
            if track is None:
                self.static.pop(child, None)
                self.moving[child] = Track(stamp, link)
                self.rewritten = True
            elif not track.extend(stamp, link, self._history):
                if not track.insert(stamp, link, self._history):
                    return OLD_TRANSFORM
                self.rewritten = True
        self._parents.add(parent)
        return None

    def climb(self, frame: str, stamp: int, max_gap: float,
              ends: Container[str] = ()) -> tuple[Steps, str]:
        """
        Collect the transforms at a time from a frame to its ancestors, up to one of the ends.

        Return the steps, as far as `Track.at` knows them, and the last frame, which is empty if
        the frames form a circle.
        """
        steps = {frame: IDENTITY}
        static, moving = self.static, self.moving
        while frame not in ends:
            found = static.get(frame)
            if found is None:
                track = moving.get(frame)
                if track is None:
                    break
                found = track.at(stamp, max_gap)
                if found is None:
                    break
            frame, step = found
            if frame in steps:
                return steps, ''
            steps[frame] = step
        return steps, frame

    def climb_newest(self, frame: str,
                     ends: Container[str] = ()) -> tuple[dict[str, float], str]:
        """
        Collect the ancestors of a frame as `climb` does, by the newest transforms.

        Return for each the least stamp up to there, NEVER if all are static; and the last frame.
        """
        least = NEVER
        passed = {frame: least}
        while frame not in ends:
            if frame in self.static:
                frame = self.static[frame][0]
            elif frame in self.moving:
                track = self.moving[frame]
                least = min(least, track.stamps[-1])
                frame = track.links[-1][0]
            else:
                break
            if frame in passed:
                return passed, ''
            passed[frame] = least
        return passed, frame


def transform_to(end: str, steps: Steps) -> FixedTransform:
    """Return the transform from the first frame of some steps to another of them."""
    here = IDENTITY
    for frame, step in steps.items():
        here = step if here is IDENTITY else composed(step, here)
        if frame == end:
            break
    return here


class Track:
    """
    Transforms of a frame by their stamps, with the meaning that tf2's TimeCache gives them.

    Where several have one stamp, the last one counts from then on, and interpolation up to that
    stamp leads to the first one. Times are ints in ns.
    """

    __slots__ = ('stamps', 'links')

    def __init__(self, stamp: int, link: Link) -> None:
        # Ascending, none more than twice, and a link for each.
        self.stamps = [stamp]
        self.links = [link]

    def extend(self, stamp: int, link: Link, history: int) -> bool:
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
        return True

    def insert(self, stamp: int, link: Link, history: int) -> bool:
        """Add an older transform, forgetting as `extend` does; return False if it is too old."""
        stamps, links = self.stamps, self.links
        self._prune(history)
        if stamp < stamps[-1] - history:
            return False
        place = bisect_right(stamps, stamp)
        first = bisect_left(stamps, stamp)
        if link not in links[first:place]:
            if place - first == 2:
                links[place - 1] = link
            else:
                stamps.insert(place, stamp)
                links.insert(place, link)
        return True

    def _prune(self, history: int) -> None:
        """Forget what is older than the newest by more than the history."""
        stamps = self.stamps
        oldest = stamps[-1] - history
        if stamps[0] < oldest:
            passed = bisect_left(stamps, oldest)
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

    def gap(self, stamp: int) -> int:
        """Return how far apart the stamps around a time within the history are."""
        place = bisect_right(self.stamps, stamp)
        return self.stamps[place] - self.stamps[place - 1]


def in_quotes(text: str) -> str:
    """Return a text quoted, cut to 64 characters, without line breaks or control characters."""
    shown = repr(text[:_MOST_SHOWN])
    return f'{shown} and so on' if len(text) > _MOST_SHOWN else shown


def in_words(name: str) -> str:
    """Return the name of a frame, in quotes if it has unusual characters."""
    return name if _PLAIN.fullmatch(name) else in_quotes(name)

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

"""The tree that frames make: the transforms heard, and the way from a frame to its parents."""

from __future__ import annotations

from collections.abc import Container

from sat_collision.scene.deadlines import NEVER
from sat_collision.scene.rotations import composed, IDENTITY, normalised, Transform
from sat_collision.scene.tracks import Link, Track

BAD_NAMES = 'bad frame names'
BAD_TRANSFORM = 'not finite or no rotation'
OLD_TRANSFORM = 'older than tf_cache_time'
TOO_MANY_FRAMES = 'too many frames'

# What a stranger who makes up names may take of the memory.
_MOST_FRAMES = 10_000


class FrameTree:
    """
    Every frame in its parent, in the last seconds.

    The last transform of a child at a stamp counts, whoever sent it, and so does its parent. A
    static frame is where it is at all times. Times are ints in ns.

    Parameters
    ----------
    history : int
        For so long before the newest transform of a frame its others are kept, in ns.

    Attributes
    ----------
    static : dict
        The Link of each static frame by its name.
    moving : dict
        The Track of each other frame that has a parent by its name.
    rewritten : bool
        Set where a transform has changed what was known before, not only added a newer one.

    """

    def __init__(self, history: int) -> None:
        self._history = history
        self.static: dict[str, Link] = {}
        self.moving: dict[str, Track] = {}
        self._parents: set[str] = set()
        self.rewritten = False

    def __contains__(self, frame: str) -> bool:
        """Tell whether any transform has named a frame."""
        return frame in self.static or frame in self.moving or frame in self._parents

    def clear(self) -> None:
        """Forget all frames but the static ones."""
        self.moving.clear()
        self._parents = {parent for parent, _ in self.static.values()}

    def insert(self, parent: str, child: str, stamp: int, transform: Transform,
               static: bool = False) -> str | None:
        """
        Take where a child frame is in its parent.

        A slash before a name is dropped, as tf2 does.

        Returns
        -------
        str or None
            Why it was not taken, if so: BAD_NAMES, BAD_TRANSFORM, OLD_TRANSFORM or
            TOO_MANY_FRAMES.

        """
        track = self.moving.get(child)
        if track is not None and not static and track.links[-1][0] == parent:
            # As nearly always: names that were looked at before, and a newer transform.
            unit = normalised(transform)
            if unit is None:
                return BAD_TRANSFORM
            if track.extend(stamp, (parent, unit), self._history):
                return None
        if parent[:1] == '/' or child[:1] == '/':
            parent, child = parent.removeprefix('/'), child.removeprefix('/')
        if parent == child or not parent or not child:
            return BAD_NAMES
        unit = normalised(transform)
        if unit is None:
            return BAD_TRANSFORM
        link = parent, unit
        if static:
            if self.static.get(child) != link:
                if self._is_full(child):
                    return TOO_MANY_FRAMES
                self.moving.pop(child, None)
                self.static[child] = link
                self.rewritten = True
        else:
            track = self.moving.get(child)
            if track is None:
                if self._is_full(child):
                    return TOO_MANY_FRAMES
                self.static.pop(child, None)
                self.moving[child] = Track(stamp, link)
                self.rewritten = True
            elif not track.extend(stamp, link, self._history):
                if not track.insert(stamp, link, self._history):
                    return OLD_TRANSFORM
                self.rewritten = True
        self._parents.add(parent)
        return None

    def _is_full(self, child: str) -> bool:
        """Tell whether there is no room for a frame."""
        return len(self.static) + len(self.moving) >= _MOST_FRAMES and child not in self.static \
            and child not in self.moving

    def climb(self, frame: str, stamp: int, max_gap: float,
              ends: Container[str] = ()) -> tuple[dict[str, Transform], str]:
        """
        Go from a frame to its parent and on, to one of the ends or as far as is known.

        Parameters
        ----------
        frame : str
        stamp : int
            The time to go at.
        max_gap : float
            As for `Track.at`.
        ends : container of str, optional
            The frames at which to stop.

        Returns
        -------
        dict
            The transform from the frame to each one on the way, by its name.
        str
            The last frame; empty if the way leads back to itself.

        """
        here = IDENTITY
        passed = {frame: here}
        static, moving = self.static, self.moving
        while frame not in ends:
            link = static.get(frame)
            if link is None:
                track = moving.get(frame)
                if track is None:
                    break
                link = track.at(stamp, max_gap)
                if link is None:
                    break
            frame, step = link
            if frame in passed:
                return passed, ''
            here = step if here is IDENTITY else composed(step, here)
            passed[frame] = here
        return passed, frame

    def climb_newest(self, frame: str,
                     ends: Container[str] = ()) -> tuple[dict[str, float], str]:
        """
        Go as `climb` does by the newest transforms.

        Returns
        -------
        dict
            The least stamp on the way to each frame, by its name; NEVER if all there are static.
        str
            As `climb`.

        """
        least = NEVER
        passed = {frame: least}
        while frame not in ends:
            link = self.static.get(frame)
            if link is None:
                track = self.moving.get(frame)
                if track is None:
                    break
                link = track.links[-1]
                least = min(least, track.stamps[-1])
            frame = link[0]
            if frame in passed:
                return passed, ''
            passed[frame] = least
        return passed, frame

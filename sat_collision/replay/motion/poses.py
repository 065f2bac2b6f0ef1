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

"""Where the outline of a footprint was between two moments, by the transforms of its frame."""

from __future__ import annotations

import numpy as np
from sat_collision.geometry.polygon import PlaneMap
from sat_collision.messages.cdr import Points
from sat_collision.messages.transform_listener import TransformListener
from sat_collision.replay.motion.bodies import Floats, NUMBERS
from sat_collision.scene.frames import NoTransform

# How far a vertex may be from the straight line that stands for its way, in m: to this the sweep
# decides, too.
TOLERANCE = 1e-6

_SHORTEST = 4


class _UnknownError(Exception):
    """It is not known where the frame was at some time."""


class Poses:
    """
    The poses of an outline.

    Parameters
    ----------
    transforms : TransformListener
    frame_id : str
        That the outline is in.
    points : Points
        The outline.

    """

    def __init__(self, transforms: TransformListener, frame_id: str, points: Points) -> None:
        self._transforms = transforms
        self._frame_id = frame_id
        data, start, count = points
        self._vertices: Floats = np.frombuffer(data, np.float32, NUMBERS * count, start).reshape(
            -1, NUMBERS).astype(np.float64)
        # As the maps take them: x, y, 1.
        self._vertices[:, 2] = 1.0

    def between(self, begin: int, end: int) -> list[tuple[int, PlaneMap]] | None:
        """
        Return the times between two at which the outline must be placed, and the maps then.

        From each to the next the vertices move on straight lines, to TOLERANCE: there is one
        wherever a transform says where the frame was, and as many more as its turning needs.

        Parameters
        ----------
        begin, end : int
            In ns.

        Returns
        -------
        list of tuple or None
            None if it is not known where the frame was all the time.

        """
        times = [begin, *self._transforms.stamps(self._frame_id, begin, end), end]
        found: list[tuple[int, PlaneMap]] = []
        try:
            for one, other in zip(times, times[1:]):
                if one != begin:
                    found.append((one, self._plane(one)))
                self._refine(one, other, found)
        except _UnknownError:
            return None
        return found

    def _refine(self, begin: int, end: int, found: list[tuple[int, PlaneMap]]) -> None:
        """Add what is needed between two times."""
        if end - begin < _SHORTEST:
            return
        middle = (begin + end) // 2
        first, last = np.array(self._plane(begin)), np.array(self._plane(end))
        for time in ((begin + middle) // 2, middle, (middle + end) // 2):
            straight = first + (time - begin) / (end - begin) * (last - first)
            off = (np.array(self._plane(time)) - straight).reshape(2, NUMBERS) @ self._vertices.T
            if np.hypot(*off).max() > TOLERANCE:
                self._refine(begin, middle, found)
                found.append((middle, self._plane(middle)))
                self._refine(middle, end, found)
                return

    def _plane(self, time: int) -> PlaneMap:
        found = self._transforms.plane(self._frame_id, time, time, 0.0)
        if isinstance(found, NoTransform):
            raise _UnknownError
        return found.plane

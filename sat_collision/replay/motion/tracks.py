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

"""Where a footprint was when: its frames, and its ways between them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

import numpy as np
from sat_collision.geometry.polygon import Polygon, PolygonError
from sat_collision.replay.motion.bodies import Bodies, Floats, Ways
from sat_collision.scene.deadlines import NEVER

_ONE = np.zeros(1, np.int64)


class Track:
    """
    The frames of a footprint, and the pieces of its way.

    A piece leads from one frame to the next if no refused footprint came between them, if they
    are no further apart in time than the timeout, and if they have as many vertices. A frame
    alone is a piece without length.

    Parameters
    ----------
    timeout : int or float
        In ns, or NEVER.
    longest : int
        Over how long a motion is made up at most, ns.

    Attributes
    ----------
    latest : int or None
        Stamp of the last frame.
    undecided : int
        For how long the way is not known though the footprint was there, ns.

    """

    def __init__(self, timeout: float, longest: int) -> None:
        self._never_stale = timeout == NEVER
        self._longest = min(timeout, longest)
        self.latest: int | None = None
        self.undecided = 0
        self._pieces: list[Ways] = []
        self._starts: list[int] = []
        self._last: Bodies | None = None
        self._outline: tuple[int, Polygon | None] = -1, None

    def add(self, frame: Bodies) -> None:
        """Take a frame: a footprint as received; one that comes late tells nothing new."""
        time, last = frame.stamps[0], self._last
        if last is not None and last.stamps[0] - self._longest <= time < last.stamps[0]:
            return
        self._last, self.latest = frame, time
        if last is not None and time > last.stamps[0]:
            if time - last.stamps[0] <= self._longest and last.counts[0] == frame.counts[0]:
                self._append(Ways(last, frame, _ONE, _ONE))
            else:
                self.undecided += round(min(time - last.stamps[0], self._longest))
                self._append(Ways(frame, frame, _ONE, _ONE))
        elif last is None or time < last.stamps[0]:
            self._append(Ways(frame, frame, _ONE, _ONE))

    def lose(self) -> None:
        """Take note that the footprint is nowhere until its next frame."""
        self._last = None

    def lose_way(self, until: int) -> None:
        """Take note that it is not known where the footprint was until its next frame."""
        if self._last is not None:
            self.undecided += until - self._last.stamps[0]
        self.lose()

    def begin_of_way(self, until: int) -> int | None:
        """Return when the way began that leads to a frame at a time, None if none does."""
        last = self._last
        if last is None or not 0 < until - last.stamps[0] <= self._longest:
            return None
        return last.stamps[0]

    def stand(self, until: int) -> None:
        """Let a footprint that never times out have stood where it is until a time."""
        last = self._last
        if self._never_stale and last is not None and last.stamps[0] < until:
            self.add(last.at([until]))

    def drop_before(self, time: int) -> None:
        """Forget the pieces that end before a time."""
        count = 0
        while count < len(self._pieces) - 1 and self._pieces[count].finishes[0] < time:
            count += 1
        if count:
            del self._pieces[:count], self._starts[:count]

    def pieces(self, start: int, finish: int) -> Iterator[tuple[int, int, Ways]]:
        """Yield the beginning and the end of each piece between two times, with its way."""
        first = max(bisect_right(self._starts, start) - 1, 0)
        # Pieces of no length may share their time with the end of the one before.
        while first > 0 and self._pieces[first - 1].finishes[0] >= start:
            first -= 1
        found = [(max(piece.starts[0], start), min(piece.finishes[0], finish), piece)
                 for piece in self._pieces[first:bisect_right(self._starts, finish)]]
        reached = None
        for k, (begin, end, piece) in enumerate(found):
            # An instant that is the end of the piece before, or begins the next, adds nothing.
            begins_next = k + 1 < len(found) and found[k + 1][0] == end < found[k + 1][1]
            if begin < end or (begin == end != reached and not begins_next):
                yield begin, end, piece
                reached = end

    def bounds(self, start: int, finish: int) -> Floats | None:
        """Return what bounds the footprint between two times, None if it is nowhere then."""
        boxes = [piece.boxes[0] for _, _, piece in self.pieces(start, finish)]
        if len(boxes) < 2:
            return boxes[0] if boxes else None
        box: Floats = np.concatenate([np.min(boxes, axis=0)[:2], np.max(boxes, axis=0)[2:]])
        return box

    def frames(self, after: int, until: int) -> list[int]:
        """Return the stamps of the frames after one time and until another."""
        first, end = bisect_right(self._starts, after), bisect_right(self._starts, until)
        found = [piece.starts[0] for piece in self._pieces[first:end]
                 if not piece.before.is_between]
        if self.latest is not None and after < self.latest <= until:
            found.append(self.latest)
        return sorted(set(found))

    def outline(self, time: int) -> Polygon | None:
        """Return where the footprint was at a time, None if that is not known."""
        if self._outline[0] != time:
            self._outline = time, self._find_outline(time)
        return self._outline[1]

    def _find_outline(self, time: int) -> Polygon | None:
        # Of pieces that meet at the time, any will do: both end in the same frame.
        for _, _, piece in self.pieces(time, time):
            try:
                return piece.polygon(0, time)
            except PolygonError:
                return None
        return None

    def _append(self, piece: Ways) -> None:
        if self._starts and piece.starts[0] < self._starts[-1]:
            # The clock of the stamps was set back: what was before belongs to another time.
            self._pieces.clear()
            self._starts.clear()
        self._pieces.append(piece)
        self._starts.append(piece.starts[0])

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

"""What recorded motion finds of one footprint: contacts and separations."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from operator import itemgetter

from sat_collision.geometry.polygon import Polygon
from sat_collision.geometry.query import closest_points
from sat_collision.replay.motion.tracks import Track
from sat_collision.replay.result import (
    AT_A_FRAME, BETWEEN_FRAMES, Contact, FootprintResult, Least, middle_of_overlap, Unknown)
from sat_collision.replay.series import least_of, Series
from sat_collision.scene.obstacles import ObstacleId


class Findings:
    """
    Collects what is found of a footprint.

    Parameters
    ----------
    result : FootprintResult
        Least separation and curve go there.
    contacts : list of Contact
        Of all footprints.
    track : Track
        Of the footprint.

    """

    def __init__(self, result: FootprintResult, contacts: list[Contact], track: Track) -> None:
        self._result = result
        self._contacts = contacts
        self._track = track
        self._series: list[Series] = []

    def begin(self, obstacle: ObstacleId, time: int) -> Contact:
        """Note a contact that begins, and return it."""
        contact = Contact(self._result.name, str(obstacle), time, time, found=BETWEEN_FRAMES)
        self._contacts.append(contact)
        return contact

    def deepen(self, contact: Contact, depth: float, time: int, own: Polygon,
               other: Polygon) -> None:
        """Note how deep a contact is at a time, and where."""
        if contact.deepest == 0 or depth > contact.depth:
            contact.depth = depth
            contact.deepest = time
            contact.x, contact.y = middle_of_overlap(own, other)
            self._note_least(Least(0.0 - depth, time, contact.obstacle, contact.x, contact.y,
                                   contact.found))

    def series(self) -> Series:
        """Return where the separations from the nearest obstacles of one kind are to go."""
        self._series.append(Series([]))
        return self._series[-1]

    def measure(self, obstacle: ObstacleId, time: int, value: float, other: Polygon) -> None:
        """Note how far an obstacle is."""
        least = self._result.least
        own = self._track.outline(time)
        if own is not None and (least is None or value < least.separation):
            (ax, ay), (bx, by) = (point.tolist() for point in closest_points(own, other))
            self._note_least(Least(value + 0.0, time, str(obstacle), (ax + bx) / 2, (ay + by) / 2,
                                   AT_A_FRAME))

    def draw_curve(self, unknown: Iterable[Unknown]) -> None:
        """Make the curve of all sources, interrupted where nothing was known."""
        samples = list(least_of(series.samples for series in self._series))
        times = [time for time, _ in samples]
        for one in unknown:
            k = bisect_left(times, one.first)
            # Shorter than half of the time between two moments, it is within what is known.
            if one.footprint == self._result.name and 0 < k == bisect_left(times, one.last) and (
                    k == len(times) or 2 * (one.last - one.first) > times[k] - times[k - 1]):
                samples.append((one.first, None))
        curve = Series(self._result.separation)
        for time, value in sorted(samples, key=itemgetter(0)):
            curve.add(time, value)

    def _note_least(self, found: Least) -> None:
        least = self._result.least
        if least is None or found.separation < least.separation:
            self._result.least = found

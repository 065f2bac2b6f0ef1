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

"""What is drawn over time: a lane for each footprint, with a band for each contact and doubt."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sat_collision.replay.film import deepest_contacts
from sat_collision.replay.result import Contact, Result

# How many bands of a footprint are drawn above each other where they overlap in time.
_MOST_ROWS = 4


class Band(NamedTuple):
    """
    A contact, or a time in which a footprint is unknown.

    Attributes
    ----------
    row : int
        From above, counted over all lanes.
    first, last : float
        In s since the recording begins.
    text : str
    contact : Contact or None

    """

    row: int
    first: float
    last: float
    text: str
    contact: Contact | None


class Lane(NamedTuple):
    """The rows of a footprint, from the first until before the last, and what is in them."""

    name: str
    first: int
    end: int
    bands: list[Band]


def lanes_of(result: Result) -> list[Lane]:
    """Return the lanes of a result, in which the deepest contacts come first."""
    lanes = []
    row = 0
    for footprint in result.footprints:
        bands = _stacked(row, [
            *(Band(0, result.since(one.first), result.since(one.last), one.obstacle, one)
              for one in deepest_contacts(result) if one.footprint == footprint.name),
            *(Band(0, result.since(first), result.since(last), 'unknown', None)
              for first, last in _doubts(result, footprint.name))])
        end = max([row, *(band.row for band in bands)]) + 1
        lanes.append(Lane(footprint.name, row, end, bands))
        row = end
    return lanes


def _doubts(result: Result, name: str) -> list[tuple[int, int]]:
    """Return when a footprint is unknown, for whatever reasons."""
    joined: list[tuple[int, int]] = []
    for one in result.unknown:
        if one.footprint == name:
            meets = joined and one.first <= joined[-1][1]
            joined.append((joined.pop()[0] if meets else one.first, one.last))
    return joined


def _stacked(row: int, bands: Iterable[Band]) -> list[Band]:
    """Return bands in rows from one on, in which they do not overlap if there are enough."""
    rows: list[list[Band]] = [[] for _ in range(_MOST_ROWS)]
    for band in bands:
        free = (k for k, taken in enumerate(rows) if all(
            band.last <= other.first or other.last <= band.first for other in taken))
        k = next(free, _MOST_ROWS - 1)
        rows[k].append(band._replace(row=row + k))
    return [band for taken in rows for band in taken]

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

"""Contacts and unknown times as bars in the rows of a Gantt chart."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sat_collision.replay.model.result import Contact, deepest_contacts, Result, Unknown

# How many bars of a footprint are drawn above each other where they overlap in time.
_MOST_LINES = 4
# How much of all time may lie between two unknown times that are drawn as one.
_LEAST_GAP = 1 / 1000


class Bar(NamedTuple):
    """
    A contact, or a time in which a footprint is unknown.

    Attributes
    ----------
    row : int
        From above, counted over all footprints.
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


class Rows(NamedTuple):
    """The rows of a footprint, from the first until before the end, and what is in them."""

    name: str
    first: int
    end: int
    bars: list[Bar]


def rows_of(result: Result) -> list[Rows]:
    """Return the rows of a result, in which the deepest contacts come first."""
    found = []
    row = 0
    for footprint in result.footprints:
        unknown = [one for one in result.unknown if one.footprint == footprint.name]
        bars = _stacked(row, [
            *(Bar(0, result.since(one.first), result.since(one.last), one.obstacle, one)
              for one in deepest_contacts(result) if one.footprint == footprint.name),
            *(Bar(0, first, last, 'unknown', None) for first, last in joined(result, unknown))])
        end = max([row, *(bar.row for bar in bars)]) + 1
        found.append(Rows(footprint.name, row, end, bars))
        row = end
    return found


def joined(result: Result, unknown: list[Unknown]) -> list[tuple[float, float]]:
    """Return when a footprint is unknown, in s, for whatever reasons."""
    found: list[tuple[float, float]] = []
    for one in unknown:
        first, last = result.since(one.first), result.since(one.last)
        meets = found and first <= found[-1][1] + (
            _LEAST_GAP * result.duration if len(unknown) > 1 / _LEAST_GAP else 0.0)
        found.append((found.pop()[0] if meets else first, last))
    return found


def _stacked(row: int, bars: Iterable[Bar]) -> list[Bar]:
    """Return bars in rows from one on, in which they do not overlap if there are enough."""
    rows: list[list[Bar]] = [[] for _ in range(_MOST_LINES)]
    for bar in bars:
        free = (k for k, taken in enumerate(rows) if all(
            bar.last <= other.first or other.last <= bar.first for other in taken))
        k = next(free, _MOST_LINES - 1)
        rows[k].append(bar._replace(row=row + k))
    return [bar for taken in rows for bar in taken]

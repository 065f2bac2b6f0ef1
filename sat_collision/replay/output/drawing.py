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

"""What pictures and pages have in common: colours, words, and the rows of a Gantt chart."""

from __future__ import annotations

from collections.abc import Iterable
import colorsys
from pathlib import Path
from typing import NamedTuple

from sat_collision.replay.model.result import Contact, deepest_contacts, Result

CONTACT, UNKNOWN, OBSTACLE, INK = '#d62728', '#9aa0a6', '#5b7089', '#2b3138'
# Without red and grey, which mean contact and unknown.
_LINES = ('#1f77b4', '#e08214', '#7b52ab', '#1a9e96', '#8c564b', '#3f8f3f', '#c2559d', '#6b7a1f')
# Of more footprints: hues from orange to violet.
_FIRST_HUE, _LAST_HUE = 0.08, 0.9
# Most rows of a footprint, whose bars overlap in time.
_MOST_ROWS = 4
# More unknown times than this are joined across short gaps.
_MANY = 1000


def colours(result: Result) -> dict[str, str]:
    """Return the colour of each footprint, another one for each."""
    names = [footprint.name for footprint in result.footprints]
    if len(names) <= len(_LINES):
        return dict(zip(names, _LINES))
    found = {}
    for k, name in enumerate(names):
        hue = _FIRST_HUE + (_LAST_HUE - _FIRST_HUE) * k / len(names)
        parts = colorsys.hls_to_rgb(hue, (0.38, 0.5, 0.6)[k % 3], 0.6)
        found[name] = '#' + ''.join(f'{round(255 * part):02x}' for part in parts)
    return found


def name_of(result: Result) -> str:
    """Return the name of a recording."""
    return Path(result.bag).name or result.bag


def distance(separation: float) -> str:
    """Return a separation in words."""
    if separation > 0.0:
        return f'{separation:.3g} m apart'
    return f'{-separation:.3g} m deep' if separation < 0.0 else 'touching'


class Bar(NamedTuple):
    """A contact, or a time (s since the recording begins) in which a footprint is unknown."""

    row: int  # from above, counted over all footprints
    first: float
    last: float
    text: str
    contact: Contact | None


class Rows(NamedTuple):
    """The rows of a footprint, from the first until before the end, and their bars."""

    name: str
    first: int
    end: int
    bars: list[Bar]


def rows_of(result: Result) -> list[Rows]:
    """Return the rows of a result, in which the deepest contacts come first."""
    found = []
    first = 0
    for footprint in result.footprints:
        bars = [*(Bar(0, result.since(one.first), result.since(one.last), one.obstacle, one)
                  for one in deepest_contacts(result) if one.footprint == footprint.name),
                *(Bar(0, *interval, 'unknown', None)
                  for interval in unknown_times(result, footprint.name))]
        rows: list[list[Bar]] = [[] for _ in range(_MOST_ROWS)]
        for bar in bars:
            # They overlap only where all rows are taken.
            free = (k for k, taken in enumerate(rows) if all(
                bar.last <= other.first or other.last <= bar.first for other in taken))
            k = next(free, _MOST_ROWS - 1)
            rows[k].append(bar._replace(row=first + k))
        end = first + max(sum(map(bool, rows)), 1)
        found.append(Rows(footprint.name, first, end, [bar for row in rows for bar in row]))
        first = end
    return found


def unknown_times(result: Result, name: str) -> list[tuple[float, float]]:
    """Return when a footprint is unknown for any reason, in s."""
    found = [(result.since(one.first), result.since(one.last)) for one in result.unknown
             if one.footprint == name]
    # Gaps between very many are too short to be seen.
    return joined(found, result.duration / _MANY if len(found) > _MANY else 0.0)


def joined(intervals: Iterable[tuple[float, float]], gap: float = 0.0
           ) -> list[tuple[float, float]]:
    """Return the union of intervals, in their order; those no more than a gap apart are one."""
    found: list[tuple[float, float]] = []
    for first, last in sorted(intervals):
        if found and first <= found[-1][1] + gap:
            first, last = found[-1][0], max(last, found.pop()[1])
        found.append((first, last))
    return found

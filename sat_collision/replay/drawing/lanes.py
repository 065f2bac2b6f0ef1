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

"""Time from left to right: separations as curves, and a lane of bands for each footprint."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from matplotlib.patches import Rectangle
from matplotlib.transforms import Bbox
import numpy as np
from sat_collision.replay.drawing.labels import fit, Labels
from sat_collision.replay.drawing.words import colours, CONTACT, INK, UNKNOWN
from sat_collision.replay.result import Contact, Result, Unknown

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# How much of the whole time a band takes at least, so that it is seen.
_LEAST = 1 / 250
_HEIGHT = 0.7


def draw_curves(result: Result, axes: Axes) -> None:
    """Draw separations over time, with contacts and unknown times as shades behind them."""
    axes.set_ylabel('separation [m]')
    for bands, colour in ((result.unknown, UNKNOWN), (result.contacts, CONTACT)):
        for first, last in _joined(_bounds(bands, result)):
            axes.axvspan(first, last, color=colour, alpha=0.15, linewidth=0)
    for name, colour in colours(result).items():
        footprint = next(one for one in result.footprints if one.name == name)
        if footprint.separation:
            times, values = zip(*footprint.separation)
            # Sampled values last until the next one; those of moments are joined.
            axes.plot([result.since(time) for time in times],
                      [np.nan if value is None else value for value in values],
                      drawstyle='steps-post' if result.as_live else 'default', color=colour,
                      linewidth=1.4)
    for contact in result.contacts:
        axes.plot(result.since(contact.deepest), -contact.depth, 'o', color=CONTACT,
                  markersize=4)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.grid(alpha=0.25)
    _use_times(result, axes)


def draw_lanes(result: Result, axes: Axes) -> None:
    """Draw a lane for each footprint, with its contacts and unknown times as bands."""
    names = colours(result)
    axes.set_xlabel('time since the recording begins [s]')
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.set_yticks(range(len(names)), [*names], fontweight='bold')
    for label, colour in zip(axes.get_yticklabels(), names.values()):
        label.set_color(colour)
    axes.tick_params(axis='y', length=0)
    axes.spines[['left', 'right', 'top']].set_visible(False)
    lanes = {name: lane for lane, name in enumerate(names)}
    for bands, colour in ((result.unknown, UNKNOWN), (result.contacts, CONTACT)):
        for band, (first, last) in zip(bands, _bounds(bands, result)):
            axes.add_patch(Rectangle((first, lanes[band.footprint] - _HEIGHT / 2), last - first,
                                     _HEIGHT, color=colour, linewidth=0))
    _use_times(result, axes)


def label_lanes(result: Result, axes: Axes) -> None:
    """Write what each band is; the deepest contacts come first where room is short."""
    width = 0.25 * axes.bbox.width
    for label in axes.get_yticklabels():
        fit(label, width)
    for lane, name in enumerate(colours(result)):
        contacts = sorted((contact for contact in result.contacts if contact.footprint == name),
                          key=lambda contact: -contact.depth)
        unknown = [one for one in result.unknown if one.footprint == name]
        labels = Labels(axes)
        texts = [*[contact.obstacle for contact in contacts], *['unknown'] * len(unknown)]
        boxes = [Bbox(axes.transData.transform([(first, lane + _HEIGHT / 2),
                                                (last, lane - _HEIGHT / 2)]))
                 for first, last in [*_bounds(contacts, result), *_bounds(unknown, result)]]
        for box in boxes:
            labels.avoid(box)
        for box, text in zip(boxes, texts):
            labels.place(text, box, INK, sides=((0, 0), (1, 0), (-1, 0)))


def _bounds(bands: Iterable[Contact | Unknown], result: Result) -> list[tuple[float, float]]:
    """Return from when to when bands are drawn, in s; short ones longer than they are."""
    least = _LEAST * result.duration
    found = []
    for band in bands:
        first, last = result.since(band.first), result.since(band.last)
        missing = max(least - (last - first), 0.0) / 2
        found.append((first - missing, last + missing))
    return found


def _joined(bounds: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return what is in any of some intervals, as intervals that do not meet."""
    joined: list[tuple[float, float]] = []
    for first, last in sorted(bounds):
        if joined and first <= joined[-1][1]:
            first, last = joined[-1][0], max(last, joined.pop()[1])
        joined.append((first, last))
    return joined


def _use_times(result: Result, axes: Axes) -> None:
    first = result.since(result.start or 0)
    axes.set_xlim(first, first + max(result.duration, 1e-9))

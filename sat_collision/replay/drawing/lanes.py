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
from sat_collision.replay.drawing.bands import Band, Lane
from sat_collision.replay.drawing.labels import fit, Labels
from sat_collision.replay.drawing.words import colours, CONTACT, INK, UNKNOWN
from sat_collision.replay.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Of a row in inches, of a band in rows, and how much of all time a band takes at least to be seen.
ROW = 0.24
_HEIGHT = 0.72
_LEAST = 1 / 250
# How wide a name is at most, in widths of the axes.
_NAME = 0.25


def draw_curves(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Draw separations over time, with contacts and unknown times as shades behind them."""
    axes.set_ylabel('separation [m]')
    bands = [band for lane in lanes for band in lane.bands]
    for is_contact, colour in ((False, UNKNOWN), (True, CONTACT)):
        for first, last in _joined(_bounds(band, result) for band in bands
                                   if (band.contact is not None) is is_contact):
            axes.axvspan(first, last, color=colour, alpha=0.15, linewidth=0)
    of_footprint = colours(result)
    for footprint in result.footprints:
        if footprint.separation:
            times, values = zip(*footprint.separation)
            # Sampled values last until the next one; those of moments are joined.
            axes.plot([result.since(time) for time in times],
                      [np.nan if value is None else value for value in values],
                      drawstyle='steps-post' if result.as_live else 'default',
                      color=of_footprint[footprint.name], linewidth=1.4)
    for contact in result.contacts:
        axes.plot(result.since(contact.deepest), -contact.depth, 'o', color=CONTACT,
                  markersize=4)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.grid(alpha=0.25)
    _use_times(result, axes)


def draw_lanes(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Draw the lanes, without words but for the names of footprints."""
    axes.set_xlabel('time since the recording begins [s]')
    axes.set_ylim(height(lanes) - 0.5, -0.5)
    axes.set_yticks([(lane.first + lane.end - 1) / 2 for lane in lanes],
                    [lane.name for lane in lanes], fontweight='bold')
    for label, colour in zip(axes.get_yticklabels(), colours(result).values()):
        label.set_color(colour)
        fit(label, _NAME * axes.bbox.width)
    axes.tick_params(axis='y', length=0)
    axes.spines[['left', 'right', 'top']].set_visible(False)
    for lane in lanes:
        if lane.first:
            axes.axhline(lane.first - 0.5, color=UNKNOWN, linewidth=0.4)
        for band in lane.bands:
            first, last = _bounds(band, result)
            axes.add_patch(Rectangle(
                (first, band.row - _HEIGHT / 2), last - first, _HEIGHT, linewidth=0,
                color=CONTACT if band.contact else UNKNOWN))
    _use_times(result, axes)


def label_lanes(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Write what each band is; the deepest contacts come first where room is short."""
    for lane in lanes:
        labels = Labels(axes)
        boxes = []
        for band in lane.bands:
            first, last = _bounds(band, result)
            boxes.append(Bbox(axes.transData.transform([
                (first, band.row + _HEIGHT / 2), (last, band.row - _HEIGHT / 2)])))
            labels.avoid(boxes[-1])
        for band, box in zip(lane.bands, boxes):
            labels.place(band.text, box, INK, sides=((0, 0), (1, 0), (-1, 0)))


def height(lanes: list[Lane]) -> int:
    """Return how many rows there are in all, at least one."""
    return lanes[-1].end if lanes else 1


def _bounds(band: Band, result: Result) -> tuple[float, float]:
    """Return from when to when a band is drawn, in s; a short one longer than it is."""
    missing = max(_LEAST * result.duration - (band.last - band.first), 0.0) / 2
    return band.first - missing, band.last + missing


def _joined(bounds: Iterable[tuple[float, float]]) -> list[tuple[float, float]]:
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

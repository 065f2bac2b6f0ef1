# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A result as a picture: separations and rows over time, and the scene of each contact."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Rectangle
from matplotlib.transforms import Bbox
import numpy as np
from numpy.typing import NDArray
from sat_collision.replay.model.keyframes import Keyframes
from sat_collision.replay.model.result import deepest_contacts, joined, Least, Result
from sat_collision.replay.output.text import (
    Bar, colours, distance, GREY, INK, Lane, lanes_of, name_of, OBSTACLE, RED)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

# Metadata without the time of drawing, by the ending of the file.
_UNDATED = {'.svg': {'Date': None}, '.pdf': {'CreationDate': None}}
_DPI = 110
# Max scenes drawn, and max of them side by side.
_MAX_SCENES = 6
_COLUMNS = 3
# Height of a row in inches, height of a bar in rows, least width of a bar as a share of all time.
_ROW = 0.24
_HEIGHT = 0.72
_LEAST = 1 / 250
# Greatest width of a name, as a share of the axes.
_NAME = 0.25
_SIDES = ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (-1, 1), (1, -1), (-1, -1))
_ALIGNED = {-1: ('right', 'top'), 0: ('center', 'center'), 1: ('left', 'bottom')}
_SMALLEST = 6.0
_GAP = 3.0


# What a scene shows: a footprint, and how near it is to an obstacle then.
_View: TypeAlias = tuple[str, Least]


def write_picture(result: Result, path: str) -> None:
    """Write the picture of a result; the same result gives the same bytes."""
    # Names may have dollar signs, which mark no formulas.
    with rc_context({'svg.hashsalt': 'sat_collision', 'text.parse_math': False}):
        draw_picture(result).savefig(path, metadata=_UNDATED.get(Path(path).suffix.lower()))


def draw_picture(result: Result) -> Figure:
    """Return a result as a figure; of a check with `keyframes`."""
    lanes = lanes_of(result)
    # The deepest contacts, else the least separation, else nothing but the scene.
    deepest = sorted(deepest_contacts(result)[:_MAX_SCENES], key=lambda contact: contact.deepest)
    views: list[_View | None] = [(one.footprint, one.least) for one in deepest] or [result.nearest]
    height = lanes[-1].end if lanes else 1
    below = _ROW * height
    columns = min(len(views), _COLUMNS)
    lines = -(-len(views) // columns)
    figure = Figure(figsize=(12, 5.2 + below + 4.0 * lines), dpi=_DPI,
                    layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2 + lines, columns, height_ratios=(4.2, below, *[4.0] * lines))
    curves, lane_axes = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, :])
    scenes = [figure.add_subplot(grid[2 + k // columns, k % columns]) for k in range(len(views))]
    lane_axes.sharex(curves)
    _draw_curves(result, lanes, curves)
    lane_axes.set_ylim(height - 0.5, -0.5)
    _draw_lanes(result, lanes, lane_axes)
    title = figure.suptitle(f'{name_of(result)}: {result.verdict.words}', fontsize=14,
                            fontweight='bold', color=INK)
    _fit(title, 0.96 * figure.bbox.width)
    titles = []
    for axes, view in zip(scenes, views):
        axes.set(xlabel='x [m]', ylabel='y [m]')
        titles.append(axes.set_title(
            'no separation could be measured' if view is None else
            f'{result.since(view[1].time):.3f} s: {view[0]} and {view[1].obstacle}, '
            f'{distance(view[1].separation)}', fontsize=10))
        titles[-1].set_in_layout(False)
    keyframes = result.keyframes or Keyframes([result.start or 0])
    # The size of axes depends on their labels, and these on the limits.
    for _ in range(2):
        figure.draw_without_rendering()
        for axes, view in zip(scenes, views):
            _look_at(axes, view, keyframes)
    figure.set_layout_engine('none')
    _label_lanes(result, lanes, lane_axes)
    for axes, view, text in zip(scenes, views, titles):
        _fit(text, axes.bbox.width)
        _draw_scene(result, keyframes, axes, view)
    return figure


def _draw_curves(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Draw separations over time, with contacts and unknown times shaded."""
    axes.set_ylabel('separation [m]')
    axes.set_title('Separation from the nearest obstacle; below, contacts over time', fontsize=10)
    axes.tick_params(labelbottom=False)
    bars = [bar for lane in lanes for bar in lane.bars]
    for is_contact, colour in ((False, GREY), (True, RED)):
        for first, last in joined(_bounds(bar, result) for bar in bars
                                  if (bar.contact is not None) is is_contact):
            axes.axvspan(first, last, color=colour, alpha=0.15, linewidth=0)
    of_footprint = colours(result)
    for footprint in result.footprints:
        if footprint.separation:
            times, values = zip(*footprint.separation)
            # Sampled values last until the next one; those of moments are joined.
            axes.plot([result.since(time) for time in times],
                      [np.nan if value is None else value for value in values],
                      drawstyle='steps-post' if result.options.as_live else 'default',
                      color=of_footprint[footprint.name], linewidth=1.4)
    for contact in result.contacts:
        axes.plot(result.since(contact.deepest), -contact.depth, 'o', color=RED, markersize=4)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.grid(alpha=0.25)
    first = 0.0 if result.start is None else result.since(result.start)
    axes.set_xlim(first, first + max(result.duration, 1e-9))


def _draw_lanes(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Draw the lanes and the names of footprints, without other texts."""
    axes.set_xlabel('time since the recording begins [s]')
    axes.set_yticks([(lane.first + lane.end - 1) / 2 for lane in lanes],
                    [lane.name for lane in lanes], fontweight='bold')
    for label, colour in zip(axes.get_yticklabels(), colours(result).values()):
        label.set_color(colour)
        _fit(label, _NAME * axes.bbox.width)
    axes.tick_params(axis='y', length=0)
    axes.spines[['left', 'right', 'top']].set_visible(False)
    for lane in lanes:
        if lane.first:
            axes.axhline(lane.first - 0.5, color=GREY, linewidth=0.4)
        for bar in lane.bars:
            first, last = _bounds(bar, result)
            axes.add_patch(Rectangle(
                (first, bar.row - _HEIGHT / 2), last - first, _HEIGHT, linewidth=0,
                color=RED if bar.contact else GREY))


def _label_lanes(result: Result, lanes: list[Lane], axes: Axes) -> None:
    """Write what each bar is; the deepest contacts come first where room is short."""
    for lane in lanes:
        boxes = [Bbox(axes.transData.transform([
            (first, bar.row + _HEIGHT / 2), (last, bar.row - _HEIGHT / 2)]))
            for bar in lane.bars for first, last in [_bounds(bar, result)]]
        taken = list(boxes)
        for bar, box in zip(lane.bars, boxes):
            _label(axes, bar.text, box, INK, taken, sides=((0, 0), (1, 0), (-1, 0)))


def _bounds(bar: Bar, result: Result) -> tuple[float, float]:
    """Return from when to when a bar is drawn, in s; a short one is widened to be seen."""
    missing = max(_LEAST * result.duration - (bar.last - bar.first), 0.0) / 2
    return bar.first - missing, bar.last + missing


def _look_at(axes: Axes, view: _View | None, keyframes: Keyframes) -> None:
    """Set the limits to show a view, or without one all places of the footprints."""
    if view:
        name, least = view
        middle: NDArray[np.float64] = np.array([least.x, least.y])
        footprint = keyframes.footprint(name)
        size = float(np.max(np.ptp(footprint.spans[0].ring, axis=0))) if footprint else 0.0
        reach: NDArray[np.float64] = np.full(2, max(max(least.separation, 0.0) + 1.5 * size, 1.0))
    else:
        points = np.concatenate([np.zeros((0, 2)), *(
            span.ring for body in keyframes.bodies if body.is_footprint for span in body.spans)])
        low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else np.zeros((2, 2))
        middle, reach = (low + high) / 2, (high - low) / 2
        reach = reach + max(0.08 * float(np.max(reach)), 1.0)
    # The same scale along both axes.
    pixels = np.array(axes.bbox.size)
    reach = pixels * np.max(reach / pixels)
    (left, right), (bottom, top) = np.transpose([middle - reach, middle + reach])
    axes.set(xlim=(left, right), ylim=(bottom, top))


def _draw_scene(result: Result, keyframes: Keyframes, axes: Axes, view: _View | None) -> None:
    """
    Draw bodies into axes with final limits, with dotted outlines where not known.

    Footprints, bodies in contact and the obstacle of the view get labels.
    """
    least = view[1] if view else None
    number = keyframes.number(least.time) if least else 0
    time = keyframes.moments[number]
    touching = {body for contact in result.contacts if contact.first <= time <= contact.last
                for body in (keyframes.footprint(contact.footprint), result.obstacle_of(contact))}
    of_footprint = colours(result)
    taken: list[Bbox] = []
    spared: list[Bbox] = []
    texts = []
    for body, span in keyframes.at(number):
        colour = of_footprint[span.name] if body.is_footprint else OBSTACLE
        face = RED if body in touching else colour
        if span.known and len(span.ring) > 2:
            axes.fill(*span.ring.T, color=face, alpha=0.35, linewidth=0)
        axes.plot(*np.concatenate([span.ring, span.ring[:1]]).T, linewidth=1.4, markersize=4,
                  color=colour if body.is_footprint else face,
                  linestyle='-' if span.known else ':',
                  marker='o' if len(span.ring) == 1 else None)
        box = Bbox.null()
        box.update_from_data_xy(axes.transData.transform(span.ring))
        seen = Bbox.intersection(box, axes.bbox)
        if seen is None:
            continue
        if body.is_footprint or body in touching or least and span.name == least.obstacle:
            taken.append(seen)
            texts.append((span.name, seen, colour if body.is_footprint else INK))
        else:
            spared.append(seen)
    for name, box, colour in texts:
        _label(axes, name, box, colour, taken, spared)


def _label(axes: Axes, text: str, box: Bbox, colour: str, taken: list[Bbox],
           spared: Sequence[Bbox] = (), sides: Sequence[tuple[int, int]] = _SIDES) -> None:
    """
    Write a text beside a box of pixels, if there is room in axes whose limits are final.

    It covers nothing in `taken`, to which it is added, and boxes in `spared` only where there is
    no better place. Sides are -1 for left or below, 1 for right or above; (0, 0) is inside.
    """
    inverse = axes.transData.inverted()
    for avoided, (x, y) in product(([*taken, *spared], [*taken]), sides):
        place = ((box.x0 + box.x1 + x * (box.width + 2 * _GAP)) / 2,
                 (box.y0 + box.y1 + y * (box.height + 2 * _GAP)) / 2)
        spot_x, spot_y = inverse.transform(place)
        is_inside = x == y == 0
        found = axes.text(spot_x, spot_y, text, fontsize=8, zorder=5, ha=_ALIGNED[x][0],
                          va=_ALIGNED[y][1], color='white' if is_inside else colour)
        covered = found.get_window_extent()
        room = box if is_inside else axes.bbox
        fits = np.all(room.min <= covered.min) and np.all(covered.max <= room.max)
        if fits and not any(covered.overlaps(other) for other in avoided
                            if not (is_inside and other is box)):
            taken.append(covered)
            return
        found.remove()


def _fit(text: Text, width: float) -> None:
    """Make a text smaller, then shorter, until it is no wider than some pixels."""
    while text.get_window_extent().width > width:
        size = float(text.get_fontsize())
        words = text.get_text()
        if size > _SMALLEST:
            text.set_fontsize(size - 0.5)
        elif len(words) > 3:
            half = (len(words) - 2) // 2
            text.set_text(f'{words[:half]}…{words[-half:]}')
        else:
            break

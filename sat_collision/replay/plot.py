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

"""A result as a picture: separation and states over time, and the scene where it was nearest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sat_collision.replay.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_CLEAR, _COLLISION, _UNKNOWN = '#2a9d3a', '#d62728', '#9a9a9a'
_OBSTACLE = '#4d6690'
_LINES = ('#1f77b4', '#9467bd', '#e08214', '#17a2b8', '#8c564b')


def plot(result: Result, path: str) -> None:
    """
    Draw a result.

    Parameters
    ----------
    result : Result
        Of a check with `picture`.
    path : str
        Picture file to write; its ending says of what kind.

    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    figure = Figure(figsize=(12, 5.5), layout='constrained')
    FigureCanvasAgg(figure)
    over_time, scene = figure.subplots(1, 2, width_ratios=(1.4, 1))
    _draw_timeline(result, over_time)
    _draw_scene(result, scene)
    figure.suptitle(f'{result.bag}: {result.verdict.words}')
    figure.savefig(path, dpi=110)


def _draw_timeline(result: Result, axes: Axes) -> None:
    """Draw separations as lines, contacts and unknown times as shades behind them."""
    axes.set_xlabel('time since the recording begins [s]')
    axes.set_ylabel('separation from the nearest obstacle [m]')
    axes.set_title('Separation over time (red: contact, grey: unknown)')
    if result.start is None or result.end is None:
        return
    for unknown in result.unknown:
        axes.axvspan(result.since(unknown.first), result.since(unknown.last), color=_UNKNOWN,
                     alpha=0.3, linewidth=0)
    for contact in result.contacts:
        axes.axvspan(result.since(contact.first), result.since(contact.last), color=_COLLISION,
                     alpha=0.25)
    for footprint, colour in zip(result.footprints, _LINES * len(result.footprints)):
        if footprint.separation:
            times, values = zip(*footprint.separation)
            # Sampled values last until the next one; those of moments are joined.
            axes.plot([result.since(time) for time in times],
                      [np.nan if value is None else value for value in values],
                      drawstyle='steps-post' if result.as_live else 'default', color=colour,
                      label=footprint.name, linewidth=1.4)
    for contact in result.contacts:
        axes.plot(result.since(contact.deepest), -contact.depth, 'o', color=_COLLISION,
                  markersize=4)
    axes.axhline(0.0, color='black', linewidth=0.8)
    first, last = result.since(result.start), result.since(result.end)
    axes.set_xlim(first, max(last, first + 1e-9))
    axes.grid(alpha=0.25)
    if axes.get_legend_handles_labels()[0]:
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.12 * (high - low))
        axes.legend(loc='upper center', ncols=5)


def _draw_scene(result: Result, axes: Axes) -> None:
    """Draw the bodies at the least separation of all."""
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')
    picture = result.picture
    if picture is None:
        axes.set_title('no separation could be measured')
        return
    separation = picture.separation
    words = f'{separation:.3g} m apart' if separation > 0 else (
        f'{-separation:.3g} m deep' if separation < 0 else 'touching')
    axes.set_title(f'{result.since(picture.time):.3f} s: {picture.footprint} and '
                   f'{picture.obstacle}, {words}')
    for name, vertices in picture.obstacles.items():
        touching = name == picture.obstacle and separation <= 0
        _draw_body(axes, vertices, _COLLISION if touching else _OBSTACLE, 0.35)
    for name, vertices in picture.footprints.items():
        touching = name == picture.footprint and separation <= 0
        _draw_body(axes, vertices, _COLLISION if touching else _CLEAR, 0.55)
        axes.annotate(name, vertices.max(axis=0), fontsize=9, clip_on=True, annotation_clip=True)
    axes.set_aspect('equal')
    _look_at_pair(axes, max(separation, 0.0), picture.footprints[picture.footprint],
                  picture.obstacles[picture.obstacle])


def _draw_body(axes: Axes, vertices: NDArray[np.float64], colour: str,
               alpha: float) -> None:
    ring = np.concatenate([vertices, vertices[:1]])
    if len(vertices) > 2:
        axes.fill(*vertices.T, color=colour, alpha=alpha, linewidth=0)
    axes.plot(*ring.T, color=colour, linewidth=1.2, marker='o' if len(vertices) == 1 else None)


def _look_at_pair(axes: Axes, gap: float, *bodies: NDArray[np.float64]) -> None:
    """Show the smaller body of the pair and what is around it."""
    low, high = min(((body.min(axis=0), body.max(axis=0)) for body in bodies),
                    key=lambda corners: float((corners[1] - corners[0]).max()))
    x, y = (low + high) / 2
    reach = max(gap + 2.5 * float((high - low).max()), 1.0)
    axes.set_xlim(x - reach, x + reach)
    axes.set_ylim(y - reach, y + reach)

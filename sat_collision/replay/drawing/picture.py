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

"""A result as a picture: separations and bands over time, and the scene where it was nearest."""

from __future__ import annotations

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from sat_collision.replay.drawing.bands import lanes_of
from sat_collision.replay.drawing.labels import fit
from sat_collision.replay.drawing.lanes import (
    draw_curves, draw_lanes, height, label_lanes, ROW)
from sat_collision.replay.drawing.scene import draw_scene, look_at_all, look_at_least
from sat_collision.replay.drawing.words import distance, INK, name_of
from sat_collision.replay.result import Least, Result

_DPI = 110


def draw_picture(result: Result) -> Figure:
    """Return a result as a figure; of a check with `film`."""
    lanes = lanes_of(result)
    below = ROW * height(lanes)
    figure = Figure(figsize=(12, 5.2 + below), dpi=_DPI,
                    layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.4, 1), height_ratios=(4.2, below))
    curves, scene = figure.add_subplot(grid[0, 0]), figure.add_subplot(grid[:, 1])
    lane_axes = figure.add_subplot(grid[1, 0], sharex=curves)
    draw_curves(result, lanes, curves)
    curves.tick_params(labelbottom=False)
    curves.set_title('Separation from the nearest obstacle; below, whose contact is when',
                     fontsize=10)
    draw_lanes(result, lanes, lane_axes)
    scene.set_xlabel('x [m]')
    scene.set_ylabel('y [m]')
    title = figure.suptitle(f'{name_of(result)}: {result.verdict.words}', fontsize=14,
                            fontweight='bold', color=INK)
    fit(title, 0.96 * figure.bbox.width)
    words = scene.set_title(_nearest(result), fontsize=10)
    words.set_in_layout(False)
    film, least = result.film, result.least
    # How large axes are depends on their labels, and these on what is shown.
    for _ in range(2):
        figure.draw_without_rendering()
        if film and least:
            look_at_least(scene, least, film.footprint(_whose(result, least)))
        elif film:
            look_at_all(scene, film)
    figure.set_layout_engine('none')
    fit(words, scene.bbox.width)
    label_lanes(result, lanes, lane_axes)
    if film and least:
        draw_scene(result, film, film.number(least.time), scene, [least.obstacle])
    elif film:
        draw_scene(result, film, 0, scene)
    return figure


def _nearest(result: Result) -> str:
    least = result.least
    if least is None:
        return 'no separation could be measured'
    return (f'{result.since(least.time):.3f} s: {_whose(result, least)} and {least.obstacle}, '
            f'{distance(least.separation)}')


def _whose(result: Result, least: Least) -> str:
    return next(one.name for one in result.footprints if one.least is least)

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
"""Draw the markers of a scene as RViz would from above: a picture, or a moving one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TYPE_CHECKING

from matplotlib.animation import PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.patheffects import withStroke
from matplotlib.textpath import TextPath
import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from visualization_msgs.msg import MarkerArray

# Texts are drawn larger than in the markers, because a picture cannot be zoomed.
_ENLARGED = 1.3
_WORDS = {'clear': ('clear', '#1a9933'), 'imminent': ('COLLISION AHEAD', '#c06000'),
          'collision': ('COLLISION', '#d11919'), 'unknown': ('unknown', '#555555')}


class Frame(NamedTuple):
    """What the node published at one time (s): the state of each footprint, and the markers."""

    time: float
    states: dict[str, str]
    markers: MarkerArray


def write_picture(frame: Frame, bounds: Sequence[float], path: str) -> None:
    """Draw one frame; `bounds` are the least x and y and the greatest x and y shown (m)."""
    figure = _figure()
    _draw(frame, bounds, figure)
    figure.savefig(path, dpi=120)


def write_movie(frames: Sequence[Frame], bounds: Sequence[float], rate: int, path: str) -> None:
    """Draw frames into a GIF file, so many in a second; `bounds` as for a picture."""
    figure = _figure()
    writer = PillowWriter(fps=rate)
    with writer.saving(figure, path, dpi=92):
        for frame in frames:
            figure.clear()
            _draw(frame, bounds, figure)
            writer.grab_frame()


def _figure() -> Figure:
    figure = Figure(figsize=(9.0, 5.0))
    FigureCanvasAgg(figure)
    return figure


def _draw(frame: Frame, bounds: Sequence[float], figure: Figure) -> None:
    """Draw the markers, and above them the time and the states."""
    axes = figure.add_axes((0.06, 0.1, 0.925, 0.84))
    min_x, min_y, max_x, max_y = bounds
    axes.set(xlim=(min_x, max_x), ylim=(min_y, max_y))
    _draw_markers(frame.markers, axes)
    axes.set_title(f'{frame.time:4.1f} s', loc='left', family='monospace')
    for number, (name, state) in enumerate(frame.states.items()):
        word, colour = _WORDS[state]
        axes.text(0.11 + 0.21 * number, 1.02, f'{name}: {word}', color=colour,
                  transform=axes.transAxes)


def _draw_markers(markers: MarkerArray, axes: Axes) -> None:
    """Draw markers (triangles, lines, spheres and text) into axes whose limits are set."""
    for marker in markers.markers:
        colour = np.array([marker.color.r, marker.color.g, marker.color.b])
        # Blended with the white background.
        colour = 1.0 - marker.color.a * (1.0 - colour)
        height = 2.0 + marker.pose.position.z
        points = np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2)
        if marker.type == marker.TRIANGLE_LIST:
            # Antialiased edges would leave light lines between triangles.
            axes.add_collection(PolyCollection(
                list(points.reshape(-1, 3, 2)), facecolor=colour, linewidth=0.0,
                antialiased=False, zorder=height))
        elif marker.type == marker.LINE_LIST:
            axes.add_collection(LineCollection(
                list(points.reshape(-1, 2, 2)), colors=[colour],
                linewidths=60.0 * marker.scale.x, zorder=height))
        elif marker.type == marker.SPHERE_LIST:
            x, y = points.T
            axes.scatter(x, y, color=[colour], s=1500.0 * marker.scale.x**2, zorder=height)
        elif marker.type == marker.TEXT_VIEW_FACING:
            # Centred, as in RViz, but moved into the picture.
            size = _ENLARGED * marker.scale.z
            text = TextPath((0.0, 0.0), marker.text, size=size)
            (left, low), (right, high) = text.get_extents().get_points()
            place = marker.pose.position
            least, most = axes.get_xlim()
            begin = (min(max(place.x - (left + right) / 2, least - left), most - right),
                     place.y - (low + high) / 2)
            axes.add_patch(PathPatch(TextPath(begin, marker.text, size=size),
                                     facecolor=colour, linewidth=0.0, zorder=height + 1.0,
                                     path_effects=[withStroke(linewidth=3.0,
                                                              foreground='white')]))
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')

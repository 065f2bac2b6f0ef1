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
"""Draw a visualization_msgs/MarkerArray as a picture, as RViz would from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from visualization_msgs.msg import MarkerArray


def draw_markers(markers: MarkerArray, axes: Axes) -> None:
    """
    Draw the markers of a scene.

    Parameters
    ----------
    markers : visualization_msgs.msg.MarkerArray
        As `markers.Markers` makes them: triangles, lines, spheres and text.
    axes : matplotlib.axes.Axes
        Gets equal scales, in metres.

    """
    from matplotlib.collections import LineCollection, PolyCollection
    for marker in markers.markers:
        colour = np.array([marker.color.r, marker.color.g, marker.color.b])
        # Mixed with the white ground beforehand: where triangles meet nothing is drawn twice.
        colour = 1.0 - marker.color.a * (1.0 - colour)
        points = np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2)
        if marker.type == marker.TRIANGLE_LIST:
            axes.add_collection(PolyCollection(list(points.reshape(-1, 3, 2)), facecolor=colour,
                                               edgecolor=colour, linewidth=0.3))
        elif marker.type == marker.LINE_LIST:
            axes.add_collection(LineCollection(list(points.reshape(-1, 2, 2)), colors=[colour],
                                               linewidths=60.0 * marker.scale.x))
        elif marker.type == marker.SPHERE_LIST:
            x, y = points.T
            axes.scatter(x, y, color=[colour], s=12.0)
        elif marker.type == marker.TEXT_VIEW_FACING:
            place = marker.pose.position
            axes.annotate(marker.text, (place.x, place.y), color=colour, fontsize=8,
                          xytext=(6, 6), textcoords='offset points', zorder=4,
                          bbox={'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.8,
                                'pad': 1.0})
    axes.autoscale_view()
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')

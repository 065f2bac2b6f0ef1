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
    from matplotlib.patches import PathPatch
    from matplotlib.textpath import TextPath
    for marker in markers.markers:
        colour = np.array([marker.color.r, marker.color.g, marker.color.b])
        # Mixed with the white ground beforehand.
        colour = 1.0 - marker.color.a * (1.0 - colour)
        height = 2.0 + marker.pose.position.z
        points = np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2)
        if marker.type == marker.TRIANGLE_LIST:
            # Between triangles with smoothed edges the ground would shine through.
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
            # Its middle at its place and its height in metres, as viewers of ROS have it.
            text = TextPath((0.0, 0.0), marker.text, size=marker.scale.z)
            box = text.get_extents()
            place = np.array([marker.pose.position.x, marker.pose.position.y])
            axes.add_patch(PathPatch(
                TextPath(place - 0.5 * (box.p0 + box.p1), marker.text, size=marker.scale.z),
                facecolor=colour, linewidth=0.0, zorder=height))
    axes.autoscale_view()
    axes.set_aspect('equal')
    axes.set_xlabel('x [m]')
    axes.set_ylabel('y [m]')

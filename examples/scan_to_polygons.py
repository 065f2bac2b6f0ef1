# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Publish what a laser sees as polygons: LaserScan in, one set of polygons a scan out.

Returns next to each other that are no further apart than `gap` are one surface. It is split where
it bends, so that no piece is thicker than `thickness`, and the convex hull of each piece is
published: a wall around the robot stays a ring of thin pieces. All have the stamp and the frame of
the scan. With the parameter `in_one_message` a set is one polygon_msgs/Polygon2DCollection, for a
source with `type: polygon_collection`; otherwise each piece is a PolygonStamped, and an empty one
ends the set, for a source with `set_end: empty_polygon`. A scan that cannot be read ends the node,
and so makes the source unknown.
"""

from contextlib import suppress
import math
import sys

from geometry_msgs.msg import Point32, PolygonStamped
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from sensor_msgs.msg import LaserScan


class ScanToPolygons(Node):
    """Takes `scan`, publishes `obstacles`."""

    def __init__(self):
        super().__init__('scan_to_polygons')
        self._gap = self.declare_parameter('gap', 0.2).value
        self._thickness = self.declare_parameter('thickness', 0.1).value
        if self.declare_parameter('in_one_message', False).value:
            from polygon_msgs.msg import Polygon2DCollection
            self._obstacles = self.create_publisher(Polygon2DCollection, 'obstacles', 10)
            self._publish = self._publish_collection
        else:
            self._obstacles = self.create_publisher(PolygonStamped, 'obstacles',
                                                    QoSProfile(depth=1000))
            self._publish = self._publish_one_by_one
        self.create_subscription(LaserScan, 'scan', self._convert, qos_profile_sensor_data)

    def _convert(self, scan):
        self._publish(scan.header, outlines(scan, self._gap, self._thickness))

    def _publish_collection(self, header, found):
        from polygon_msgs.msg import Point2D, Polygon2D, Polygon2DCollection
        self._obstacles.publish(Polygon2DCollection(header=header, polygons=[
            Polygon2D(points=[Point2D(x=float(x), y=float(y)) for x, y in outline])
            for outline in found]))

    def _publish_one_by_one(self, header, found):
        for outline in (*found, ()):
            message = PolygonStamped(header=header)
            message.polygon.points = [Point32(x=float(x), y=float(y)) for x, y in outline]
            self._obstacles.publish(message)


def outlines(scan, gap, thickness):
    """
    Return the obstacles that a scan shows.

    Parameters
    ----------
    scan : sensor_msgs.msg.LaserScan
        What is nearer than range_min, as -inf is, is too near to measure, and taken to be at
        range_min. NaN, inf and what is beyond range_max are no returns.
    gap, thickness : float
        In metres, see above.

    Returns
    -------
    list of (n, 2) ndarray
        Convex, counterclockwise, in the frame of the scan; one or two points for a point or a
        segment.

    Raises
    ------
    ValueError
        If the scan has no ranges, or angles or limits that cannot be.

    """
    if not (len(scan.ranges) and 0.0 <= scan.range_min < scan.range_max
            and math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment)):
        raise ValueError(f'a scan of {len(scan.ranges)} ranges, limits {scan.range_min} and '
                         f'{scan.range_max} m, from the angle {scan.angle_min} in steps of '
                         f'{scan.angle_increment}, cannot be read')
    ranges = np.maximum(scan.ranges, scan.range_min)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    if abs(scan.angle_increment) * len(ranges) > 2.0 * math.pi - 1e-3:
        # A full turn: a surface at the end of the scan continues at its beginning.
        ranges, angles = (np.append(values, values[:1]) for values in (ranges, angles))
    returns = np.flatnonzero(np.isfinite(ranges) & (ranges <= scan.range_max))
    ranges, angles = ranges[returns], angles[returns]
    # Rounded as in the message: otherwise rounding could turn a hull into no valid polygon.
    points = np.float32([ranges * np.cos(angles), ranges * np.sin(angles)]).T.astype(float)
    are_near = (np.hypot(*np.diff(points, axis=0).T) <= gap) & (np.diff(returns) == 1)
    surfaces = np.split(points, np.flatnonzero(~are_near) + 1)
    return [hull(piece) for surface in surfaces if len(surface)
            for piece in pieces(surface, thickness)]


def pieces(points, thickness):
    """Split points in a row at the one furthest from the chord, until all are near to theirs."""
    found, start, ends = [], 0, [len(points) - 1]
    while ends:
        offsets = points[start:ends[-1] + 1] - points[start]
        chord = offsets[-1]
        length = np.hypot(*chord)
        if length > 0.0:
            distances = np.abs(chord[0] * offsets[:, 1] - chord[1] * offsets[:, 0]) / length
        else:
            distances = np.hypot(*offsets.T)
        furthest = int(np.argmax(distances))
        if distances[furthest] > max(0.0, 0.5 * thickness):
            ends.append(start + furthest)
        else:
            # The next one has the point of the bend, too, so that there is no gap between them.
            found.append(points[start:ends[-1] + 1])
            start = ends.pop()
    return found


def hull(points):
    """Return the convex hull, by Andrew's monotone chain."""
    ordered = np.unique(points, axis=0)
    if len(ordered) < 3:
        return ordered
    return np.array(_chain(ordered)[:-1] + _chain(ordered[::-1])[:-1])


def _chain(points):
    chain = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def main():
    """Run the node until it is ended."""
    rclpy.init()
    try:
        node = ScanToPolygons()
    except ModuleNotFoundError:
        return ('scan_to_polygons: polygon_msgs is not installed: leave out in_one_message, '
                'or see docs/install.md')
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())

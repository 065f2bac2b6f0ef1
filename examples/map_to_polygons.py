# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Publish the occupied cells of a map as polygons: OccupancyGrid in, one set of rectangles a map out.

A cell is occupied from `occupied_from` per cent on. A cell that is unknown (-1) is occupied, too,
unless `unknown_is_occupied` is false. With the parameter `in_one_message` a set is one
polygon_msgs/Polygon2DCollection, for a source with `type: polygon_collection`; otherwise each
rectangle is a PolygonStamped, and an empty one ends the set, for a source with
`set_end: empty_polygon`. A map that cannot be right, or is tilted, ends the node, and so makes the
source unknown.
"""

from contextlib import suppress
import math
import sys

from geometry_msgs.msg import Point32, PolygonStamped
from nav_msgs.msg import OccupancyGrid
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

# The most rectangles that the monitor takes by default, and the ends of two sets.
DEPTH = 100_002


class MapToPolygons(Node):
    """Takes `map`, publishes `map_polygons`, both transient local."""

    def __init__(self):
        super().__init__('map_to_polygons')
        self._occupied_from = self.declare_parameter('occupied_from', 65).value
        if not 0 <= self._occupied_from <= 100:
            raise ValueError(f'occupied_from is not 0 to 100: {self._occupied_from}')
        self._unknown_is_occupied = self.declare_parameter('unknown_is_occupied', True).value
        if self.declare_parameter('in_one_message', False).value:
            from polygon_msgs.msg import Polygon2DCollection
            kind, depth, self._publish = Polygon2DCollection, 1, self._publish_collection
        else:
            kind, depth, self._publish = PolygonStamped, DEPTH, self._publish_one_by_one
        self._polygons = self.create_publisher(kind, 'map_polygons', latched(depth))
        self.create_subscription(OccupancyGrid, 'map', self._convert, latched(1))

    def _convert(self, grid):
        cells = cells_of(grid)
        occupied = cells >= self._occupied_from
        if self._unknown_is_occupied:
            occupied |= cells == -1
        found = corners(rectangles(occupied), grid.info)
        self._publish(grid.header, found.tolist())
        self.get_logger().info(f'occupied cells: {np.count_nonzero(occupied)}, '
                               f'rectangles: {len(found)}')

    def _publish_collection(self, header, found):
        from polygon_msgs.msg import Point2D, Polygon2D, Polygon2DCollection
        self._polygons.publish(Polygon2DCollection(header=header, polygons=[
            Polygon2D(points=[Point2D(x=x, y=y) for x, y in outline]) for outline in found]))

    def _publish_one_by_one(self, header, found):
        for outline in (*found, ()):
            message = PolygonStamped(header=header)
            message.polygon.points = [Point32(x=x, y=y) for x, y in outline]
            self._polygons.publish(message)


def cells_of(grid):
    """
    Return the cells of a map, row by row.

    Parameters
    ----------
    grid : nav_msgs.msg.OccupancyGrid

    Returns
    -------
    (height, width) ndarray of int8

    Raises
    ------
    ValueError
        If they are none, more or fewer than the size says, or not -1 to 100; or if the resolution
        or the origin cannot be, or the map is tilted.

    """
    info = grid.info
    cells = np.array(grid.data, dtype=np.int8).reshape(info.height, info.width)
    if not (cells.size and cells.min() >= -1 and cells.max() <= 100):
        raise ValueError('the map has no cells, or some that are not -1 to 100')
    if not 0.0 < info.resolution < math.inf:
        raise ValueError(f'the resolution of the map is {info.resolution}')
    place, turn = info.origin.position, info.origin.orientation
    norm = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if not (math.isfinite(place.x) and math.isfinite(place.y) and 0.0 < norm < math.inf
            and math.hypot(turn.x, turn.y) <= 0.01 * norm):
        raise ValueError(f'the origin of the map is tilted, or no pose: {info.origin}')
    return cells


def latched(depth):
    """Return the quality of service of messages that are kept for whoever comes later."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def rectangles(occupied):
    """
    Cut the occupied cells into rectangles that do not overlap.

    The occupied cells of a row that are next to each other are one run, and equal runs in
    successive rows are one rectangle.

    Parameters
    ----------
    occupied : (height, width) ndarray of bool

    Returns
    -------
    (n, 4) ndarray of int
        The first column and row of each rectangle, and the first ones behind it.

    """
    height, width = occupied.shape
    bordered = np.zeros((height, width + 2), np.int8)
    bordered[:, 1:-1] = occupied
    # Runs begin and end by turns, row by row.
    rows, columns = np.nonzero(np.diff(bordered))
    # Equal runs in successive rows have successive numbers, whatever other runs there are.
    numbers = np.sort((columns[::2] * (width + 1) + columns[1::2]) * (height + 1) + rows[::2])
    breaks = np.diff(numbers) != 1
    runs, first_rows = np.divmod(numbers[np.append(True, breaks)[:len(numbers)]], height + 1)
    last_rows = numbers[np.append(breaks, True)[:len(numbers)]] % (height + 1)
    first_columns, end_columns = np.divmod(runs, width + 1)
    return np.stack((first_columns, first_rows, end_columns, last_rows + 1), axis=-1)


def corners(found, info):
    """
    Place rectangles of cells in the frame of the map.

    Parameters
    ----------
    found : (n, 4) ndarray of int
        By `rectangles`.
    info : nav_msgs.msg.MapMetaData
        Its resolution and its origin, the corner of the first cell.

    Returns
    -------
    (n, 4, 2) ndarray
        Corners in metres, counterclockwise.

    """
    x, y = (info.resolution * found[:, sides] for sides in ([0, 2, 2, 0], [1, 1, 3, 3]))
    yaw = 2.0 * math.atan2(info.origin.orientation.z, info.origin.orientation.w)
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.stack((cos * x - sin * y + info.origin.position.x,
                     sin * x + cos * y + info.origin.position.y), axis=-1)


def main():
    """Run the node until it is ended."""
    rclpy.init()
    try:
        node = MapToPolygons()
    except ModuleNotFoundError:
        return ('map_to_polygons: polygon_msgs is not installed: leave out in_one_message, '
                'or see docs/install.md')
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())

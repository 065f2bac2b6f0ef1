# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The examples that convert the cells of a map, and laser scans, to obstacles."""

import math
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
shapely = pytest.importorskip('shapely')

from geometry_msgs.msg import Point, PolygonStamped, Pose, Quaternion  # noqa: E402, I100
from harness import box, to_time  # noqa: E402
from nav_msgs.msg import MapMetaData, OccupancyGrid  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import LaserScan  # noqa: E402
from test_recipes import parameters_of_a_map  # noqa: E402

EXAMPLES = Path(__file__).resolve().parents[2] / 'examples'
sys.path.append(str(EXAMPLES))

from map_to_polygons import cells_of, corners, rectangles  # noqa: E402, I100
from scan_to_polygons import outlines  # noqa: E402

SHAPES = (0, 0), (0, 3), (3, 0), (1, 1), (1, 9), (9, 1), (2, 2), (7, 12), (12, 7), (30, 30)


@pytest.mark.parametrize('share', (0.0, 0.1, 0.5, 0.9, 1.0))
def test_each_occupied_cell_is_in_one_rectangle_and_no_other_cell_is(share):
    """On random grids, the narrowest among them."""
    random = np.random.default_rng(1)
    for shape in SHAPES * 10:
        occupied = random.random(shape) < share
        covered = np.zeros(shape, int)
        for left, bottom, right, top in rectangles(occupied):
            covered[bottom:top, left:right] += 1
            assert left < right and bottom < top
        assert (covered == occupied).all()


def test_walls_are_long_rectangles():
    """Those along a row, and those along a column."""
    occupied = np.zeros((50, 50), bool)
    occupied[[0, -1]] = occupied[:, [0, -1]] = True
    assert len(rectangles(occupied)) == 4


def map_info(width, height, resolution=0.5, x=0.0, y=0.0, yaw=0.0):
    return MapMetaData(width=width, height=height, resolution=resolution, origin=Pose(
        position=Point(x=x, y=y),
        orientation=Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))))


@pytest.mark.parametrize('yaw', (0.0, 0.7, -2.0, math.pi))
def test_cells_are_where_resolution_and_origin_say(yaw):
    """The middle of a cell is in a rectangle exactly if the cell is occupied."""
    occupied = np.random.default_rng(2).random((12, 17)) < 0.4
    found = corners(rectangles(occupied), map_info(17, 12, 0.5, 3.0, -4.0, yaw))
    solid = shapely.union_all([shapely.Polygon(outline) for outline in found])
    assert all(shapely.Polygon(outline).exterior.is_ccw for outline in found)
    assert solid.area == pytest.approx(0.25 * np.count_nonzero(occupied))
    for row, column in np.ndindex(occupied.shape):
        middle = complex(3.0, -4.0) + 0.5 * complex(column + 0.5, row + 0.5) * complex(
            math.cos(yaw), math.sin(yaw))
        assert solid.contains(shapely.Point(middle.real, middle.imag)) == occupied[row, column]


def test_cells_are_read_row_by_row():
    """Where the origin is turned, and tilted by no more than rounding does."""
    info = map_info(2, 1, yaw=1.0)
    info.origin.orientation.y = 0.001
    assert cells_of(OccupancyGrid(info=info, data=[-1, 100])).tolist() == [[-1, 100]]


@pytest.mark.parametrize('fields, data', (
    ({}, [0]), ({}, [0, 0, 0]), ({}, [0, 101]), ({}, [-2, 0]), ({'width': 0}, []),
    ({'width': 2, 'height': 0}, []), ({'resolution': 0.0}, [0, 0]),
    ({'resolution': -0.05}, [0, 0]), ({'resolution': math.inf}, [0, 0]),
    ({'resolution': math.nan}, [0, 0]),
    ({'origin': Pose(orientation=Quaternion(x=0.02, w=1.0))}, [0, 0]),
    ({'origin': Pose(position=Point(y=math.nan))}, [0, 0]),
    ({'origin': Pose(orientation=Quaternion(w=0.0))}, [0, 0]),
    ({'origin': Pose(orientation=Quaternion(z=math.nan))}, [0, 0])))
def test_map_that_contradicts_itself_is_refused(fields, data):
    """Its cells are too few or too many, or no per cent, or nowhere, or not in the plane."""
    info = MapMetaData(**{'width': 2, 'height': 1, 'resolution': 0.5} | fields)
    with pytest.raises(ValueError):
        cells_of(OccupancyGrid(info=info, data=data))


@pytest.mark.parametrize('bound', (-1, 101))
def test_bound_that_is_no_per_cent_is_refused(run, bound):
    """No cell, or each one, would be occupied."""
    process = run(EXAMPLES / 'map_to_polygons.py', '--ros-args', '-p',
                  f'occupied_from:={bound}', stderr=subprocess.PIPE, text=True)
    assert 'ValueError: occupied_from' in process.communicate(timeout=60)[1]


@pytest.mark.parametrize('in_one_message', (False, True), ids=('one by one', 'in one message'))
def test_maps_are_checked(start, run, tmp_path, in_one_message):
    """A map sent once, before the converter is there; then another one replaces it."""
    monitor = start(parameters_of_a_map(tmp_path, in_one_message))
    maps = monitor.node.create_publisher(OccupancyGrid, 'map', QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    grid = OccupancyGrid(info=map_info(8, 2, 1.0, yaw=math.pi / 2))
    grid.header.frame_id = 'map'
    # Column by column along y: occupied, free, occupied enough, not enough, unknown, free.
    grid.data = 2 * [100, 0, 65, 64, -1, 0, 0, 0]
    maps.publish(grid)
    run(EXAMPLES / 'map_to_polygons.py', '--ros-args', '-p',
        f'in_one_message:={in_one_message}')

    def check(*touching):
        for column in range(8):
            monitor.send_until('collision' if column in touching else 'clear', 'footprint',
                               box(-1.5, column + 0.25, 1.0, 0.5))
    check(0, 2, 4)
    grid.data = 2 * [0, 100, 0, 0, 0, 0, 0, 0]
    maps.publish(grid)
    check(1)


def test_unknown_cells_can_be_free(peer, run):
    """As Nav2's static layer has them by default."""
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    maps = peer.node.create_publisher(OccupancyGrid, 'map', latched)
    maps.publish(OccupancyGrid(info=map_info(3, 1), data=[-1, 0, 100]))
    seen = []
    peer.node.create_subscription(PolygonStamped, 'map_polygons', seen.append, latched)
    run(EXAMPLES / 'map_to_polygons.py', '--ros-args', '-p', 'unknown_is_occupied:=false')
    peer.until(lambda: len(seen) == 2, 'a rectangle and the end of the set')
    assert [[(point.x, point.y) for point in message.polygon.points] for message in seen] == [
        [(1.0, 0.0), (1.5, 0.0), (1.5, 0.5), (1.0, 0.5)], []]


RAYS = 720
ROOM = shapely.box(-4.0, -3.0, 4.0, 3.0).exterior
BOX = shapely.box(1.5, -0.5, 2.0, 0.5)
NEAR = shapely.box(0.45, -0.1, 1.0, 0.1)


def scan_of(bodies, rays=RAYS, span=2.0 * np.pi):
    """Return the scan of bodies by a laser at the origin."""
    scan = LaserScan(angle_min=-0.5 * span, angle_increment=span / rays, range_min=0.05,
                     range_max=8.0)
    scan.header.frame_id = 'base_scan'
    bodies = shapely.union_all(bodies)
    for angle in scan.angle_min + scan.angle_increment * np.arange(rays):
        ray = shapely.LineString([(0, 0), (9 * np.cos(angle), 9 * np.sin(angle))])
        seen = ray.intersection(bodies)
        scan.ranges.append(float('inf') if seen.is_empty else shapely.Point(0, 0).distance(seen))
    return scan


def shapes(scan, gap=0.2, thickness=0.1):
    """Return the outlines of a scan, rounded as in messages."""
    kinds = {1: lambda ring: shapely.Point(ring[0]), 2: shapely.LineString}
    found = [np.float32(outline) for outline in outlines(scan, gap, thickness)]
    return [kinds.get(len(ring), shapely.Polygon)(ring) for ring in found]


@pytest.mark.parametrize('bodies', [[ROOM], [ROOM, BOX], [BOX, NEAR]])
def test_outlines_cover_all_returns_and_no_free_space(bodies):
    """A wall all around does not enclose the robot, nor its corner the room."""
    scan = scan_of(bodies)
    found = shapes(scan)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    for distance, angle in zip(scan.ranges, angles):
        if np.isfinite(distance):
            point = shapely.Point(distance * np.cos(angle), distance * np.sin(angle))
            assert min(point.distance(shape) for shape in found) < 1e-6
    assert all(shape.is_valid for shape in found)
    solid = shapely.union_all(bodies).buffer(0.11)
    assert all(solid.covers(shape) for shape in found)


def test_wall_has_no_gap_where_the_scan_begins():
    """The laser first looks backwards, at a wall, which becomes one ring."""
    seen = shapely.union_all([shape.buffer(1e-6) for shape in shapes(scan_of([ROOM]))])
    assert seen.geom_type == 'Polygon' and len(seen.interiors) == 1


@pytest.mark.parametrize('value, seen', (
    (0.05, 0.1), (0.0, 0.1), (-math.inf, 0.1), (0.1, 0.1), (1.0, 1.0), (5.0, 5.0),
    (6.0, None), (math.inf, None), (math.nan, None)))
def test_what_is_too_near_to_measure_is_at_range_min(value, seen):
    """What is too far is no return, nor is NaN."""
    scan = LaserScan(range_min=0.1, range_max=5.0, ranges=[value])
    assert [ring.tolist() for ring in outlines(scan, 0.2, 0.1)] == (
        [] if seen is None else [[[np.float32(seen), 0.0]]])


@pytest.mark.parametrize('range_max', (5.0, math.inf))
def test_no_return_parts_surfaces(range_max):
    """The beams beside it are no neighbours, however near to each other."""
    scan = LaserScan(angle_increment=0.01, range_min=0.1, range_max=range_max,
                     ranges=[1.0, 1.0, math.nan, 1.0, math.inf, math.inf])
    assert [len(ring) for ring in outlines(scan, 0.2, 0.1)] == [2, 1]


@pytest.mark.parametrize('fields', (
    {'angle_min': math.nan}, {'angle_min': math.inf}, {'angle_increment': math.nan},
    {'angle_increment': -math.inf}, {'range_min': -0.1}, {'range_min': math.nan},
    {'range_min': 5.0}, {'range_min': math.inf, 'range_max': math.inf}, {'range_max': 0.0},
    {'range_max': math.nan}, {'ranges': []}), ids=str)
def test_scan_that_cannot_be_read_is_refused(fields):
    """An empty set would say that all is clear."""
    good = {'angle_min': 0.0, 'angle_increment': 0.1, 'range_min': 0.1, 'range_max': 5.0,
            'ranges': [1.0, 1.0]}
    assert outlines(LaserScan(**good), 0.2, 0.1)
    with pytest.raises(ValueError, match='scan'):
        outlines(LaserScan(**good | fields), 0.2, 0.1)


def test_jagged_surface_is_split_at_each_tooth():
    """More often than functions may call each other."""
    scan = LaserScan(angle_increment=1e-4, range_min=0.1, range_max=5.0,
                     ranges=[2.0, 2.17] * 1000)
    assert len(outlines(scan, 0.2, 0.1)) > 1500


@pytest.mark.parametrize('in_one_message', (False, True), ids=('one by one', 'in one message'))
def test_scans_are_checked(start, run, in_one_message):
    """In a room the robot is clear; with a box at its front it is not."""
    if in_one_message:
        pytest.importorskip('polygon_msgs', reason='make .venv/messages.stamp builds it')
    run(EXAMPLES / 'scan_to_polygons.py', '--ros-args', '-p',
        f'in_one_message:={in_one_message}')
    monitor = start(**{'obstacle__type': 'polygon_collection'} if in_one_message else {})
    scans = monitor.node.create_publisher(LaserScan, 'scan', 1)
    for scene, state in (([ROOM, BOX], 'clear'), ([ROOM, NEAR], 'collision'),
                         ([ROOM, BOX], 'clear')):
        scan = scan_of(scene)

        def seen():
            scan.header.stamp = to_time(monitor.now())
            scans.publish(scan)
            monitor.send('footprint', box(-0.5, -0.3, 1.0, 0.6), frame_id='base_scan')
            monitor.spin(0.05)
            return monitor.state() == state
        monitor.until(seen, state)


@pytest.mark.parametrize('example', ('map_to_polygons', 'scan_to_polygons'))
def test_missing_polygon_msgs_is_said_in_one_line(run, tmp_path, example):
    """A user of pip alone does not have it."""
    (tmp_path / 'polygon_msgs.py').touch()
    process = run(EXAMPLES / f'{example}.py', '--ros-args', '-p', 'in_one_message:=true',
                  stderr=subprocess.PIPE, text=True, env={'PYTHONPATH': str(tmp_path)})
    assert process.communicate(timeout=60)[1] == (
        f'{example}: polygon_msgs is not installed: leave out in_one_message, '
        'or see docs/install.md\n')
    assert process.returncode == 1

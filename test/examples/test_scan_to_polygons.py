# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The example that converts laser scans to obstacles."""

import math
from pathlib import Path
import sys

import numpy as np
import pytest

pytest.importorskip('rclpy')
shapely = pytest.importorskip('shapely')

from harness import box, to_time  # noqa: E402, I100
from sensor_msgs.msg import LaserScan  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / 'examples'))

from scan_to_polygons import outlines  # noqa: E402, I100

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


@pytest.fixture(params=(False, True), ids=('one by one', 'in one message'))
def converter(run, request):
    if request.param:
        pytest.importorskip('polygon_msgs', reason='make .venv/messages.stamp builds it')
    run(ROOT / 'examples' / 'scan_to_polygons.py', '--ros-args', '-p',
        f'in_one_message:={request.param}')
    return {'obstacle__type': 'polygon_collection'} if request.param else {}


def test_scans_are_checked(start, converter):
    """In a room the robot is clear; with a box at its front it is not."""
    monitor = start(**converter)
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

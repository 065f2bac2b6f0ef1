# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recipes, examples and other shipped files beside a running node."""

from contextlib import closing
import json
import math
from pathlib import Path
import re
import runpy
import subprocess
import sys
import time
from types import SimpleNamespace

from geometry_msgs.msg import (
    Point, Point32, Polygon, PolygonStamped, Pose, Quaternion, Twist, Vector3)
from harness import APART, box, LASTING, to_time, TOUCHING
from nav_msgs.msg import MapMetaData, OccupancyGrid
import numpy as np
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sat_collision import first_contact_along
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Header
import yaml

shapely = pytest.importorskip('shapely')

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / 'examples'
sys.path.append(str(EXAMPLES))

from map_to_polygons import cells_of, corners, rectangles  # noqa: E402, I100
from scan_to_polygons import outlines  # noqa: E402

PAGE = (ROOT / 'docs' / 'recipes.md').read_text()


def recipe(heading, language, number=0):
    """Return a code block under a heading."""
    _, text = PAGE.split(f'\n## {heading}\n')
    block = text.partition('\n## ')[0].split(f'```{language}\n')[1 + number]
    return block.partition('```')[0]


def functions(heading, number=0):
    known = {}
    exec(recipe(heading, 'python', number), known)
    return SimpleNamespace(**known)


def parameters_of_a_map(folder, at_once=False):
    """Return the arguments of a monitor of the static map, sent one by one or in one message."""
    text = recipe('A static map', 'yaml')
    if at_once:
        pytest.importorskip('polygon_msgs', reason='make .venv/messages.stamp builds it')
        text = text.replace('set_end: empty_polygon', 'type: polygon_collection')
    file = folder / 'params.yaml'
    file.write_text(text)
    return '--params-file', str(file)


@pytest.mark.parametrize('at_once', (False, True), ids=('one by one', 'in one message'))
def test_static_map(start, tmp_path, at_once):
    """It is sent once, before the monitor has found its publisher."""
    monitor = start(parameters_of_a_map(tmp_path, at_once))
    known = functions('A static map', int(at_once))
    publisher = (known.publish_map_at_once if at_once else known.publish_map)(
        monitor.node, [box(0.0), box(5.0), [(9.0, 0.0), (9.0, 5.0)]])
    for x, state in ((2.0, 'clear'), (4.0, 'collision'), (8.5, 'collision'), (2.0, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    assert publisher.get_subscription_count() == 1


@pytest.mark.parametrize('outlines', ([box(0.0), [], box(5.0)], [box(0.0), []], [[]]))
def test_map_with_an_empty_outline_is_refused(outlines):
    """Sent, it would end the set, and all outlines before it would be lost."""
    with pytest.raises(ValueError, match='outline'):
        functions('A static map').publish_map(None, outlines)


def test_zones_of_vda_5050(start, tmp_path):
    """Blocked zones stop the robot, others do not; the next set replaces them."""
    monitor = start(parameters_of_a_map(tmp_path))
    publish_map = functions('A static map').publish_map
    blocked_zones = functions('Zones of VDA 5050').blocked_zones

    def zone_set(**kinds):
        zones = [{'zoneId': name, 'zoneType': kind, 'vertices': [
                  {'x': x, 'y': y} for x, y in box(int(name.removeprefix('at')), 0)]}
                 for name, kind in kinds.items()]
        return json.dumps({'headerId': 1, 'timestamp': '2026-01-01T00:00:00.000Z',
                           'version': '3.0.0', 'manufacturer': 'm', 'serialNumber': 's',
                           'zoneSet': {'mapId': 'hall', 'zoneSetId': 'z', 'zones': zones}})

    publisher = publish_map(monitor.node, blocked_zones(
        zone_set(at0='BLOCKED', at5='SPEED_LIMIT', at8='BLOCKED')))
    for x, state in ((0.5, 'collision'), (5.5, 'clear'), (9.0, 'collision'), (9.5, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    monitor.node.destroy_publisher(publisher)
    publisher = publish_map(monitor.node, blocked_zones(zone_set(at5='BLOCKED')))
    for x, state in ((5.5, 'collision'), (0.5, 'clear')):
        monitor.send_until(state, 'footprint', box(x))
    with pytest.raises(KeyError):
        blocked_zones('{"zones": []}')


def test_costmap_converter(start):
    """A closed ring, a line, a point and a disc, without a frame."""
    monitor = start()
    to_set = functions('costmap_converter').to_set
    ring = box(5.0)

    def state_is(state, x):
        outlines = [*ring, ring[0]], [(8.0, 0.0), (9.0, 0.0)], [(12.0, 0.5)], [(15.0, 0.5)]
        message = SimpleNamespace(header=Header(stamp=to_time(monitor.now())), obstacles=[
            SimpleNamespace(polygon=Polygon(points=[Point32(x=x, y=y) for x, y in outline]),
                            radius=1.5 if outline == [(15.0, 0.5)] else 0.0)
            for outline in outlines])
        for obstacle in to_set(message, 'map'):
            monitor.publisher('obstacles').publish(obstacle)
        monitor.send('footprint', box(x))
        monitor.spin(0.03)
        return monitor.state() == state
    for x, state in ((2.0, 'clear'), (4.0, 'collision'), (10.0, 'clear'), (9.0, 'collision'),
                     (11.5, 'collision'), (12.5, 'collision'), (16.4, 'collision'),
                     (2.0, 'clear')):
        monitor.until(lambda: state_is(state, x), f'{state} at {x}', 60.0)


@pytest.mark.parametrize('radius', (0.0, 1.5))
def test_costmap_converter_without_points_is_refused(radius):
    """What has no place is no reason to call it clear."""
    message = SimpleNamespace(header=Header(), obstacles=[
        SimpleNamespace(polygon=Polygon(), radius=radius)])
    with pytest.raises(ValueError):
        functions('costmap_converter').to_set(message, 'map')


def test_plan_of_the_picture_is_free_but_for_a_turn_that_touches():
    """As its caption says: between two poses, each of which is free."""
    pytest.importorskip('matplotlib')
    from path_picture import BODY, draw, POSES, SHELVES
    assert all(first_contact_along(BODY, [pose], SHELVES) is None for pose in POSES)
    assert 4.0 < first_contact_along(BODY, POSES, SHELVES).pose < 5.0
    assert draw().axes


TIME_TO_STOP = 0.3


def read_yaml(*path):
    return yaml.safe_load(ROOT.joinpath(*path).read_text())


def published(monitor):
    """Return the names and types of all that a running monitor publishes."""
    return {one.topic_name: one.msg_type for one in monitor.monitor.publishers}


def test_rviz_shows_our_markers(start):
    """The file has RViz's form, and its topic is our marker topic."""
    manager = read_yaml('rviz', 'footprint_monitor.rviz')['Visualization Manager']
    topic, = [display['Topic']['Value'] for display in manager['Displays'] if 'Topic' in display]
    assert published(start())[topic].__name__ == 'MarkerArray'
    assert all(display['Class'].startswith('rviz_default_plugins/')
               for display in manager['Displays'])


def test_foxglove_shows_our_topics(start):
    """
    Each placed panel is configured, and each topic and field exists.

    The topics are those of the default footprint and of the one in nav2.yaml.
    """
    layout = json.loads((ROOT / 'foxglove' / 'footprint_monitor.json').read_text())
    text = json.dumps(layout)
    placed = re.findall(r'"(?:first|second)": "([^"]+)"', text)
    assert sorted(placed) == sorted(layout['configById'])
    named = read_yaml('config', 'nav2.yaml')['/**']['ros__parameters']['footprints']
    ours = published(start(footprints=['footprint', *named]))
    topics = re.findall(r'"(/[^"]+)"', text)
    assert len(topics) == 9
    for topic, _, field in (path.partition('.') for path in topics):
        assert hasattr(ours[topic](), field or '__slots__')


def test_twist_mux_is_locked_by_the_flag(start):
    """
    The file has the form that twist_mux documents.

    A lock with a timeout is locked when no message comes, and stops inputs of lower priority.
    """
    parameters = read_yaml('config', 'twist_mux.yaml')['/**']['ros__parameters']
    topics, locks = parameters['topics'], parameters['locks']
    assert parameters['use_stamped'] is False, 'twist_mux 4.4 does not start without it'
    for one in (*topics.values(), *locks.values()):
        assert {key: type(value) for key, value in one.items()} == {
            'topic': str, 'timeout': float, 'priority': int}
        assert 0 <= one['priority'] <= 255
    lock = locks['collision']
    assert published(start())['/' + lock['topic']] is Bool
    assert lock['timeout'] == TIME_TO_STOP
    assert topics['navigation']['priority'] < lock['priority'] < topics['teleop']['priority']


class Robot:
    """Is always commanded to drive, and receives the speeds that the example passes on."""

    def __init__(self, monitor):
        self.monitor = monitor
        example = runpy.run_path(str(ROOT / 'examples' / 'stop_on_collision.py'))
        self.node = example['StopOnCollision'](context=monitor.context)
        self.executor = SingleThreadedExecutor(context=monitor.context)
        self.executor.add_node(self.node)
        self.commands = monitor.node.create_publisher(Twist, 'cmd_vel_nav', 1)
        self.speed = None
        monitor.node.create_subscription(Twist, 'cmd_vel', self.note, 1)

    def close(self):
        self.node.destroy_node()
        self.executor.shutdown()

    def note(self, twist):
        self.speed = twist.linear.x

    def command(self):
        self.commands.publish(Twist(linear=Vector3(x=0.5)))
        self.executor.spin_once(timeout_sec=0.01)

    def until(self, speed):
        """Command it to drive until the last speed passed on is the given one."""
        self.monitor.repeat(self.command, lambda: self.speed == speed, f'a speed of {speed}')


def test_example_stops_the_robot(start):
    """Before the first flag, in contact, and 0.3 s after the monitor has stopped publishing."""
    monitor = start(**LASTING)
    with closing(Robot(monitor)) as robot:
        robot.until(0.0)
        monitor.send_both(TOUCHING)
        monitor.until(monitor.flag)
        for obstacle, speed in ((APART, 0.5), (TOUCHING, 0.0), (APART, 0.5)):
            monitor.send_set('obstacles', obstacle)
            robot.until(speed)
        flags = monitor.listen('~/collision')
        begin = len(flags)
        monitor._stop.set()
        robot.until(0.0)
        assert time.monotonic() >= robot.node.clear_until > 0.0
        assert not any(flag.data for flag in flags[begin:])


def test_fleet_avoids_itself(start):
    """Two robots touch; a robot that falls silent is an unknown obstacle of the other."""
    monitor = start(['--params-file', str(ROOT / 'config' / 'fleet.yaml')],
                    robot1__timeout=0.0, robot2__timeout=0.0, body1__timeout=60.0,
                    body2__timeout=1.5, obstacle__timeout=60.0)

    def until(one, other, *robots):
        def send():
            for number, x in enumerate(robots, 1):
                monitor.send(f'/robot{number}/local_costmap/published_footprint', box(x, 0))
        monitor.repeat(send, lambda: [one, other] == [
            monitor.state(name) for name in ('robot1', 'robot2')], f'{one} and {other}')
    monitor.send_set('/obstacles', box(20, 20))
    until('clear', 'clear', 0, 5)
    until('collision', 'collision', 0, 0.75)
    assert monitor.contacts('robot1') == ['body2/0']
    assert monitor.contacts('robot2') == ['body1/0']
    until('clear', 'clear', 0, 5)
    until('unknown', 'clear', 0)
    assert 'body2' in monitor.reason('robot1')


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

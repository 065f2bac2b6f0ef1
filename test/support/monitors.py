# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Monitors that have received footprints and obstacles, at times in seconds, for short tests."""

from collections import Counter
from dataclasses import replace
import math

from builders import box, collection, odometry, SECOND, serialised, transforms
import pytest
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.messages.states import States
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_COLLECTION, POLYGON_INSTANCE, Settings)
from sat_collision.scene.streams import Endpoint

START = 1000 * SECOND
NOW = START
SETTINGS = Settings(
    frame_id='map',
    footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons', set_end='empty_polygon',
                                assume_no_loss=True),
               ObstacleSettings('tracks', '/tracks', type='polygon_instance', max_count=2,
                                assume_no_loss=True)))
MAP = ObstacleSettings('map', '/map', type='polygon_instance', timeout=0.0,
                       set_end='empty_polygon')
ROBOT = FootprintSettings('robot', '/footprint')
CART = FootprintSettings('cart', '/cart/footprint')
UNTIMED_ROBOT = replace(ROBOT, timeout=0.0)
POLYGONS = ObstacleSettings('lidar', '/polygons')
LIDAR = replace(POLYGONS, set_end='empty_polygon')
UNTIMED_LIDAR = replace(LIDAR, timeout=0.0)
RADAR = replace(LIDAR, name='radar', topic='/radar')
INSTANCES = replace(POLYGONS, type=POLYGON_INSTANCE)
EVERY_KIND = pytest.mark.parametrize('settings', [LIDAR, INSTANCES, POLYGONS],
                                     ids=['sets', 'instances', 'polygons'])
REFRESHED = pytest.mark.parametrize('settings', [INSTANCES, POLYGONS],
                                    ids=['instances', 'polygons'])
TOO_OLD = 'footprint robot on /footprint is older than its timeout of 1 s'
NOT_RECEIVED = 'footprint robot on /footprint has not been received yet'
NOTHING_SENT = 'obstacle source lidar on /polygons has not sent anything yet'
LIDAR_SAYS = 'obstacle source lidar on /polygons '
REFUSED = LIDAR_SAYS + 'has not sent a whole set since a message was refused: '
SILENT = (LIDAR_SAYS + 'has been silent for longer than its timeout of 2 s: where it sees nothing '
          'let it send an empty polygon')
# Of a robot that drives in the frame odom, and sees with a laser.
DRIVING = Settings(
    frame_id='odom', footprints=(FootprintSettings('robot', '/footprint'),),
    obstacles=(ObstacleSettings('lidar', '/polygons', type=POLYGON_INSTANCE, max_count=5),))
SETS = replace(DRIVING, obstacles=(
    ObstacleSettings('lidar', '/polygons', timeout=5.0, set_end='empty_polygon'),))
# Of a robot that is 1 m long and 0.5 m wide.
OUTLINE = (-0.5, -0.25, 0.5, -0.25, 0.5, 0.25, -0.5, 0.25)
BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]
CIRCLE = [(math.cos(k / 500), math.sin(k / 500)) for k in range(2000)]


def nanoseconds(time):
    """Return the time of a clock for seconds since START."""
    return START + round(time * SECOND)


def square(x):
    """Return the unit square whose left lower corner is at (x, 0)."""
    return Polygon(box(x))


def with_changes(settings, name='', **changes):
    """Return Settings of which some are changed: of one footprint or source, or of the scene."""
    return replace(settings, **(changes if not name else {
        kind: tuple(replace(one, **changes) if one.name == name else one
                    for one in getattr(settings, kind)) for kind in ('footprints', 'obstacles')}))


class World:
    """
    A monitor and its clock; times are seconds since START, rejections are kept.

    The messages of each name are numbered from 1 on, as by one publisher. What happens returns
    the world, to be asked what follows from it.
    """

    start = START

    def __init__(self, settings, transforms=True, tracks_motion=False):
        self.settings = settings
        self.monitor = Monitor(settings, transforms=transforms)
        self.scene = self.monitor.scene
        self.scene.tracks_motion = tracks_motion
        self.time = 0.0
        self.numbers = Counter()
        self.rejections = []

    @property
    def now(self):
        return self.stamp(self.time)

    def stamp(self, time):
        """Return the header stamp for a time; None is now, and 'none' is the stamp 0."""
        return self.now if time is None else 0 if time == 'none' else (
            self.start + round(time * SECOND))

    def at(self, time):
        """Wait until a time."""
        self.time = time
        self.rejections += self.monitor.advance(self.now)
        self.look_ahead()
        return self

    def look_ahead(self):
        for name in self.scene.looking_ahead:
            self.scene.look_ahead(name)

    def receive(self, name, data):
        """Receive bytes now; return why they are refused."""
        self.numbers[name] += 1
        rejection = self.monitor.receive(name, data, self.now, self.numbers[name])
        self.rejections += [rejection] if rejection else []
        self.look_ahead()
        return rejection

    def send(self, name, points, time=None, frame_id='odom', instance=None):
        """Receive a polygon stamped at a time."""
        return self.receive(name, serialised(points, self.stamp(time), frame_id, instance))

    def send_map(self, name, *polygons):
        """Receive obstacles with ids from 1 on, and the mark that ends their map."""
        for k, points in enumerate((*polygons, ()), 1):
            self.send(name, points, 'none', instance=k)

    def receive_transforms(self, topic, *links):
        """Receive transforms."""
        self.rejections += self.monitor.receive_transforms(topic, transforms(*links), self.now)
        self.look_ahead()

    def move(self, time, x, y=0.0, yaw=0.0, child='base', parent='odom'):
        """Receive a transform at its time."""
        self.at(time).receive_transforms(TF, (parent, child, self.now, x, y, yaw))
        return self

    def receive_odometry(self, time, x, y=0.0, yaw=0.0, child='base', parent='odom', **twist):
        """Receive odometry at its time."""
        self.at(time).receive('robot', odometry(parent, child, self.now, x, y, yaw, **twist))
        return self

    def use(self, name='', **changes):
        """Change settings of a footprint or source, or without a name those of all."""
        self.settings = with_changes(self.settings, name, **changes)
        self.rejections += self.monitor.update(self.settings)
        return self

    def state(self, name='robot'):
        return self.scene.state(name)

    def status(self, name='robot'):
        return self.scene.status(name).value

    def value(self, key):
        """Return a value of the robot in ~/state, which a new state keeps."""
        states = States('/node', self.settings)
        states.write('robot', self.state(), 0.0)
        states.write_moving('robot', self.scene, None, self.prediction)
        states.write('robot', self.state(), 0.0)
        return {one.key: one.value for one in states.statuses[0].values}[key]

    def bounds(self, name='robot'):
        return dict(self.scene.footprints)[name].bounds

    @property
    def prediction(self):
        return self.scene.prediction('robot')

    @property
    def reasons(self):
        return [rejection.reason for rejection in self.rejections]


class MapWorld(World):
    """Footprints that move in odom, among the polygons of a map."""

    def __init__(self, footprints, *polygons, tracks_motion=False, obstacles=(MAP,), **settings):
        super().__init__(Settings(footprints, obstacles, frame_id='odom', **settings),
                         tracks_motion=tracks_motion)
        self.send_map('map', *polygons)


class Robot(World):
    """
    The monitor of a robot whose fixed frame is odom; see DRIVING.

    The robot moves along x at 1 m/s from 0 at 0 s and is a box of 1 m; its laser, 1 m ahead of
    its origin, is rotated to the left. With the default settings the source is known, and empty.
    """

    def __init__(self, settings=DRIVING):
        super().__init__(settings)
        for self.time in (-3.1, -1.5, 0.0) if settings is DRIVING else ():
            self.see((), self.time)
        self.receive_transforms(TF_STATIC, ('base', 'laser', 0, 1.0, 0.0, math.pi / 2))

    def move(self, time, x=None, child='base'):
        """Receive the transform of the base, or of another frame, now."""
        x = time if x is None else x
        self.receive_transforms(TF, ('odom', child, nanoseconds(time), x, 0.0))
        return self

    def stand(self, x, time=None):
        """Send a footprint in the fixed frame."""
        assert self.send('robot', box(x), time) is None
        return self

    def see(self, points, time=None, frame_id='laser', instance=1):
        """Send an obstacle, with an id if the source gives ids, or as a collection of one."""
        kind = self.settings.obstacles[0].type
        if kind == POLYGON_COLLECTION:
            return self.receive('lidar', collection([points], self.stamp(time), frame_id))
        return self.send('lidar', points, time, frame_id,
                         instance if kind == POLYGON_INSTANCE else None)

    def see_all(self, *polygons, frame_id='odom'):
        """Send a whole set that was seen now."""
        for points in (*polygons, ()):
            self.see(points, None, frame_id)
        return self

    @property
    def seen(self):
        """The bounds of all obstacles."""
        return [polygon.bounds for _, polygon in self.scene.obstacles]


def robot_that_sees_nothing():
    """Return a robot whose pose is known from 0 to 1 s, in an empty world."""
    robot = Robot()
    for k in range(11):
        robot.move(k / 10)
    robot.at(1.0).stand(0)
    robot.see((), 1.0)
    return robot


class Stage(World):
    """
    A world in which bodies are unit squares on a line; its clock may start at another time, in s.

    By default there is a footprint 'robot', stale after 1 s, and a source 'lidar' of sets that
    end with an empty polygon, silent after 2 s. A single message returns why it is refused.
    """

    def __init__(self, *sources, footprints=(ROBOT,), start=START / SECOND, time=0.0, **settings):
        super().__init__(Settings(tuple(footprints), sources or (LIDAR,), **settings), False)
        self.start = round(start * SECOND)
        self.at(time)

    def _send(self, name, points, stamp, frame='map', instance=None):
        rejection = self.send(name, points, stamp, frame, instance)
        return rejection and rejection.reason

    def _has_ids(self, name):
        return self.scene.sources[name].settings.type == POLYGON_INSTANCE

    def number(self, name):
        """Return the number of the next message."""
        self.numbers[name] += 1
        return self.numbers[name]

    def lose(self, count=1, name='lidar'):
        """Skip numbers, as if messages were lost."""
        self.numbers[name] += count

    def restart(self, name='lidar'):
        """Begin again with number 1, as a new publisher does."""
        self.numbers[name] = 0

    def publish_by(self, *gids, name='lidar'):
        """Set the current publishers, each of a node of its own."""
        self.monitor.update_publishers(name, [Endpoint(gid, f'/{gid}') for gid in gids])
        return self

    def robot(self, x=0.0, stamp=None, frame='map', name='robot'):
        return self._send(name, box(x), stamp, frame)

    def see(self, x, stamp=None, frame='map', name='lidar', instance=None):
        return self._send(name, box(x), stamp, frame,
                          (instance or 0) if self._has_ids(name) else None)

    def end(self, stamp=None, name='lidar'):
        """Send an empty polygon, which ends a set of the lidar."""
        return self._send(name, (), stamp, instance=0 if self._has_ids(name) else None)

    def send_all(self, *places, stamp=None, name='lidar'):
        """Send a whole set; of a source that gives ids, those from 1 on."""
        for k, x in enumerate(places, 1):
            self.see(x, stamp, name=name, instance=k)
        self.end(stamp, name)
        return self

    def refuse(self, reason='not finite', stamp=None, name='lidar', instance=None):
        """Send a message that is refused."""
        self.scene.refuse(name, reason, self.now, self.stamp(stamp), instance, self.number(name))

    @property
    def told(self):
        """The status of the robot in a word, and the reasons."""
        return self.status(), self.state().reasons

    @property
    def held(self):
        """The x of all obstacles by key: sorted values if two sets have one."""
        places = {}
        for obstacle, polygon in self.scene.obstacles:
            places.setdefault(obstacle.key, []).append(polygon.bounds[0])
        return {key: found[0] if len(found) == 1 else tuple(sorted(found))
                for key, found in places.items()}


def clear_stage(*sources, **settings):
    """Return a stage with a footprint at 0 and an obstacle far from it."""
    stage = Stage(*sources, **settings)
    stage.robot()
    assert stage.send_all(10).status() == 'clear'
    return stage


def with_robot(*sources, footprints=(UNTIMED_ROBOT,), stamp=None, **settings):
    """Return a stage with a footprint at 0 that by default never becomes stale."""
    stage = Stage(*sources, footprints=footprints, **settings)
    stage.robot(stamp=stamp)
    return stage


def known_stage(*sources, **settings):
    """Return a stage whose source is known and empty, so that the robot is clear."""
    stage = with_robot(*sources, time=-3.001, **settings)
    pass_by(stage, -1.5, 0.0)
    assert stage.told == ('clear', ())
    return stage


def pass_by(stage, *times):
    """Let the publisher of the lidar show that it is alive, now and at some times."""
    for time in (stage.time, *times):
        stage.at(time).end()


def clear_monitor(settings=SETTINGS, max_non_convex=None):
    """Return a monitor with a footprint at 0, and a far obstacle of each source."""
    monitor = Monitor(settings, max_non_convex=max_non_convex)
    if len(settings.obstacles) > 1:
        # The source is known after its timeout of 2 s and future_tolerance.
        for number, ago in enumerate((3.1, 1.5, 0.0), 1):
            stamp = nanoseconds(-ago)
            assert monitor.receive(
                'tracks', serialised(box(20), stamp, instance=1), stamp, number) is None
    assert monitor.receive('robot', serialised(box(0)), NOW, 1) is None
    for number, points in ((1, box(10)), (2, ())):
        assert monitor.receive('lidar', serialised(points), NOW, number) is None
    assert status(monitor) == 'clear'
    return monitor


def status(monitor):
    return monitor.scene.state('robot').status.value

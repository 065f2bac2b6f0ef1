# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Monitors that have received footprints and obstacles, at times in seconds."""

from collections import Counter
import math

from builders import box, odometry, SECOND, serialised, transforms
from sat_collision.messages.states import States
from sat_collision.messages.transform_listener import TF
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
from stage import with_changes

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
# Of a robot that is 1 m long and 0.5 m wide.
OUTLINE = (-0.5, -0.25, 0.5, -0.25, 0.5, 0.25, -0.5, 0.25)
BOW_TIE = [(5, 5), (6, 6), (6, 5), (5, 6)]
CIRCLE = [(math.cos(k / 500), math.sin(k / 500)) for k in range(2000)]


def nanoseconds(time):
    """Return the time of a clock for seconds since START."""
    return START + round(time * SECOND)


class World:
    """
    A monitor and its clock; times are seconds since START, rejections are kept.

    What happens returns the world, to be asked what follows from it.
    """

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
        return nanoseconds(self.time)

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
        """Receive a polygon stamped at a time, by default now; 'none' is the stamp 0."""
        stamp = self.now if time is None else 0 if time == 'none' else nanoseconds(time)
        return self.receive(name, serialised(points, stamp, frame_id, instance))

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

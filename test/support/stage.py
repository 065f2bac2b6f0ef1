# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A scene in which bodies are unit squares on a line and times are seconds, for short tests."""

from collections import Counter
from dataclasses import replace

import pytest
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_INSTANCE, Settings)
from sat_collision.scene.streams import Endpoint

START = 1000.0
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


def nanoseconds(seconds):
    return round(seconds * 1e9)


def square(x):
    """Return the unit square whose left lower corner is at (x, 0)."""
    return Polygon([(x, 0), (x + 1, 0), (x + 1, 1), (x, 1)])


def with_changes(settings, name='', **changes):
    """Return Settings of which some are changed: of one footprint or source, or of the scene."""
    return replace(settings, **(changes if not name else {
        kind: tuple(replace(one, **changes) if one.name == name else one
                    for one in getattr(settings, kind)) for kind in ('footprints', 'obstacles')}))


class Stage:
    """
    One scene and its clock, which begins at START; times are in seconds since then.

    By default there is a footprint 'robot', stale after 1 s, and a source 'lidar' of sets that
    end with an empty polygon, silent after 2 s. The messages of each are numbered from 1 on, as
    by one publisher. What happens returns the stage, to be asked what follows from it; a single
    message returns why it is refused.
    """

    def __init__(self, *sources, footprints=(ROBOT,), start=START, time=0.0, **settings):
        sources = sources or (LIDAR,)
        self.settings = Settings(tuple(footprints), sources, **settings)
        self.scene = Scene(self.settings)
        self.start = start
        self.time = time
        self.numbers = Counter()
        self.scene.pass_time(self.now)

    @property
    def now(self):
        return nanoseconds(self.start + self.time)

    def stamp(self, time):
        """Return the header stamp for a time; None is now, and 'none' is the stamp 0."""
        if time == 'none':
            return 0
        return self.now if time is None else nanoseconds(self.start + time)

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
        self.scene.update_publishers(name, [Endpoint(gid, f'/{gid}') for gid in gids])
        return self

    def at(self, time):
        """Wait until a time."""
        self.time = time
        self.scene.pass_time(self.now)
        return self

    def robot(self, x=0.0, stamp=None, frame='map', name='robot'):
        return self.scene.footprint(name, square(x).packed, frame, self.stamp(stamp), self.now,
                                    number=self.number(name))

    def see(self, x, stamp=None, frame='map', name='lidar', instance=None):
        return self.scene.obstacle(name, square(x).packed, frame, self.stamp(stamp), self.now,
                                   instance, self.number(name))

    def end(self, stamp=None, name='lidar'):
        """Send an empty polygon, which ends a set of the lidar."""
        return self.scene.obstacle(name, None, 'map', self.stamp(stamp), self.now,
                                   number=self.number(name))

    def send(self, *places, stamp=None, name='lidar'):
        """Send a whole set; of a source that gives ids, those from 1 on."""
        has_ids = self.scene.sources[name].settings.type == POLYGON_INSTANCE
        for k, x in enumerate(places, 1):
            self.see(x, stamp, name=name, instance=k if has_ids else None)
        self.end(stamp, name)
        return self

    def use(self, name='', **changes):
        """Change settings of a footprint or source, or without a name those of the scene."""
        self.settings = with_changes(self.settings, name, **changes)
        self.scene.update(self.settings)
        return self

    def refuse(self, reason='not finite', stamp=None, name='lidar', instance=None):
        """Send a message that is refused."""
        self.scene.refuse(name, reason, self.now, self.stamp(stamp), instance, self.number(name))

    def send_garbage(self, name='lidar'):
        """Send a message that cannot be decoded."""
        self.scene.refuse(name, 'undecodable', self.now, number=self.number(name))

    def state(self, name='robot'):
        return self.scene.state(name)

    def status(self, name='robot'):
        """Return the status in a word."""
        return self.scene.state(name).status.value

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
    assert stage.send(10).status() == 'clear'
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

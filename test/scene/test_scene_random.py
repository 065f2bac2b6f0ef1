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

"""
Random message sequences: the scene against a model that is simple and recomputes everything.

The model follows the rules of identity and age to the letter, looks through all bodies whenever it
is asked, and leaves geometry to shapely.
"""

from dataclasses import replace
import math
import random
from typing import NamedTuple

from builders import serialised
import pytest
from sat_collision.geometry.polygon import Polygon
from sat_collision.monitor import Monitor
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings

shapely = pytest.importorskip('shapely')

MILLISECOND = 1_000_000
SECOND = 1000 * MILLISECOND
FRAMES = {'other': 'cam'}
SETTINGS = Settings(
    footprints=(FootprintSettings('robot', '/footprint', timeout=1.0),
                FootprintSettings('cart', '/cart', timeout=0.0)),
    obstacles=(ObstacleSettings('sets', '/sets', timeout=0.6, max_count=6),
               ObstacleSettings('map', '/map', timeout=0.0, max_count=60),
               ObstacleSettings('kept', '/kept', timeout=0.7, accumulate=True, max_count=9),
               ObstacleSettings('tracks', '/tracks', timeout=0.5, type='polygon_instance',
                                max_count=5)),
    frame_id='map')


class Seen(NamedTuple):
    """What a message left behind: its ring of points, or None if it was refused."""

    ring: tuple | None
    time: int


class SourceModel:
    """One source of obstacles: what it holds by key, as of the last look."""

    def __init__(self, settings):
        self.settings = settings
        self.timeout = round(settings.timeout * SECOND)
        self.held = {}
        self.heard = None
        self.set_start = None
        self.count = 0
        self.set_rings = {}

    def is_past(self, time, now):
        return self.timeout > 0 and now - time > self.timeout

    def look(self, now):
        self.held = {key: seen for key, seen in self.held.items()
                     if not self.is_past(seen.time, now)}
        return self.held

    def in_trouble(self, now):
        return (self.heard is None or self.is_past(self.heard, now)
                or any(seen.ring is None for seen in self.look(now).values()))

    def take(self, kind, ring, stamp, now, instance):
        """Take a message that is good, refused, or a heartbeat; its stamp may be unknown."""
        time = min(stamp, now) if stamp else now
        if self.is_past(time, now):
            return
        self.look(now)
        self.heard = max(time, self.heard or time)
        in_sets = not (self.settings.accumulate or self.settings.type == 'polygon_instance'
                       or stamp == 0)
        if in_sets and stamp is not None:
            self.begin_set_if_due(stamp)
        if kind == 'heartbeat':
            return
        if kind == 'good':
            self.held.pop('unplaced', None)
        else:
            ring = None
        if in_sets:
            key = self.set_rings.get(ring)
            if key is None:
                key = min(self.count, self.settings.max_count)
                self.count = key + 1
                if ring:
                    self.set_rings[ring] = key
            too_many = key == self.settings.max_count
        else:
            key = instance if self.settings.type == 'polygon_instance' else ring
            key = 'unplaced' if key is None else key
            known = self.held.keys() - {'unplaced', 'excess'}
            too_many = (key not in known and key != 'unplaced'
                        and len(known) >= self.settings.max_count)
            key = 'excess' if too_many else key
        ring = None if too_many else ring
        last = self.held.get(key)
        if last and (ring is None or ring == last.ring):
            time = max(time, last.time)
        self.held[key] = Seen(ring, time)

    def begin_set_if_due(self, stamp):
        if self.set_start is not None:
            behind = self.set_start - stamp
            if abs(behind) <= round(self.settings.set_window * SECOND):
                return
            if 0 < behind < self.timeout:
                return
        self.held = {key: seen for key, seen in self.held.items()
                     if not isinstance(key, int) or key < self.count}
        self.set_start, self.count, self.set_rings = stamp, 0, {}


class Model:
    """The whole scene: each footprint is a Seen, or None."""

    def __init__(self, settings):
        self.settings = settings
        self.footprints = {footprint.name: None for footprint in settings.footprints}
        self.sources = {source.name: SourceModel(source) for source in settings.obstacles}

    def enable(self, name, enabled):
        """Return the settings with one source enabled or not; forget it if not."""
        self.settings = replace(self.settings, obstacles=tuple(
            replace(source, enabled=enabled) if source.name == name else source
            for source in self.settings.obstacles))
        self.sources = {source.name: SourceModel(source) if source.name == name and not enabled
                        else self.sources[source.name] for source in self.settings.obstacles}
        return self.settings

    def obstacles(self, now):
        """Return the rings of all obstacles, as a sorted list."""
        return sorted(seen.ring for source in self.sources.values()
                      for seen in source.look(now).values() if seen.ring)

    def finding(self, name, now):
        """Return the status in a word and the rings in contact, sorted."""
        settings, = (settings for settings in self.settings.footprints if settings.name == name)
        footprint = self.footprints[name]
        if footprint is None or 0 < settings.timeout * SECOND < now - footprint.time:
            return 'unknown', []
        body = shapely.Polygon(footprint.ring)
        contacts = [ring for ring in self.obstacles(now)
                    if shapely.intersects(body, shapely.Polygon(ring))]
        if contacts:
            return 'collision', contacts
        enabled = [self.sources[settings.name] for settings in self.settings.obstacles
                   if settings.enabled]
        if not enabled or any(source.in_trouble(now) for source in enabled):
            return 'unknown', []
        return 'clear', []


def rings(rng, count):
    """Return triangles, rectangles and L-shapes on a half-metre grid, where many touch."""
    shapes = ([(0, 0), (2, 0), (0, 2)], [(0, 0), (3, 0), (3, 1), (0, 1)],
              [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
    made = {tuple((x / 2 + dx, y / 2 + dy) for x, y in rng.choice(shapes))
            for dx, dy in ((rng.randrange(24) / 2, rng.randrange(24) / 2) for _ in range(count))}
    return sorted(made)


class Polygons:
    """Tells a scene of polygons."""

    def __init__(self):
        self.scene = Scene(SETTINGS)

    def footprint(self, name, ring, kind, stamp, now):
        if kind == 'good':
            self.scene.footprint(name, Polygon(ring).packed, 'map', stamp, now)
        else:
            self.scene.refuse(name, 'not finite', now, stamp)

    def obstacle(self, name, ring, kind, stamp, now, instance):
        if kind == 'undecodable':
            self.scene.refuse(name, kind, now)
        elif kind == 'refused':
            self.scene.refuse(name, kind, now, stamp, instance)
        else:
            self.scene.obstacle(name, Polygon(ring).packed if kind != 'heartbeat' else None,
                                FRAMES.get(kind, 'map'), stamp, now, instance)


class Messages:
    """Tells a monitor of the same by messages, most of which change little."""

    def __init__(self):
        self.monitor = Monitor(SETTINGS)
        self.scene = self.monitor.scene

    def footprint(self, name, ring, kind, stamp, now):
        self.obstacle(name, ring, kind, stamp, now, None)

    def obstacle(self, name, ring, kind, stamp, now, instance):
        ring = {'refused': ((math.nan, 0),), 'heartbeat': ()}.get(kind, ring)
        data = serialised(ring, stamp, FRAMES.get(kind, 'map'), instance)
        self.monitor.receive(name, data[:9] if kind == 'undecodable' else data, now)


@pytest.mark.parametrize('way', (Polygons, Messages))
@pytest.mark.parametrize('seed', range(20))
def test_scene_agrees_with_a_model_that_recomputes_everything(seed, way):
    """Sources of every kind, messages of every kind, in any order, with stamps that jump about."""
    rng = random.Random(seed)
    pool = rings(rng, 40)
    ring_of = {tuple(map(tuple, Polygon(ring).vertices.tolist())): ring for ring in pool}
    told, model = way(), Model(SETTINGS)
    scene = told.scene
    now = 1000 * SECOND
    scene.advance(now)
    states = {}
    seen = set()
    for _ in range(1500):
        now += rng.choice((0, 1, 5, 30, 100)) * MILLISECOND
        stamp = now - rng.choice((0, 0, 0, 1, 15, 90, 400, 650, -2000)) * MILLISECOND
        stamp = rng.choice((stamp,) * 9 + (0,))
        ring = rng.choice(pool)
        event = rng.random()
        if event < 0.003:
            now -= 3 * SECOND
            scene.advance(now)
            model = Model(model.settings)
        elif event < 0.01:
            name = rng.choice(SETTINGS.obstacles).name
            scene.advance(now)
            scene.update(model.enable(name, rng.random() < 0.7))
        elif event < 0.2:
            scene.advance(now)
        elif event < 0.3:
            name = rng.choice(SETTINGS.footprints).name
            kind = 'refused' if rng.random() < 0.1 else 'good'
            told.footprint(name, ring, kind, stamp, now)
            time = min(stamp, now) if stamp else now
            model.footprints[name] = Seen(ring, time) if kind == 'good' else None
        elif event < 0.5:
            for ring in rng.sample(pool, 3):
                take_obstacle(told, model, model.settings.obstacles[0], ring, 'good', now, now)
        else:
            kind = rng.choice(('good',) * 20 + ('refused', 'other', 'heartbeat', 'undecodable'))
            source = rng.choice(model.settings.obstacles)
            instance = rng.randrange(7) if source.type == 'polygon_instance' else None
            take_obstacle(told, model, source, ring, kind, stamp, now, instance)
        scene.advance(now)
        where = {obstacle: ring_of[tuple(map(tuple, polygon.vertices.tolist()))]
                 for obstacle, polygon in scene.obstacles}
        assert sorted(where.values()) == model.obstacles(now)
        for name in scene.changes():
            states[name] = scene.state(name)
        for name in model.footprints:
            state = scene.state(name)
            assert states[name][:3] == state[:3]
            contacts = sorted(where[obstacle] for obstacle in state.contacts)
            assert (state.status.value, contacts) == model.finding(name, now)
            seen.add(state.status.value)
    assert seen == {'clear', 'collision', 'unknown'}


def take_obstacle(told, model, source, ring, kind, stamp, now, instance=None):
    """Give one message of some kind of some source to scene and model."""
    told.obstacle(source.name, ring, kind, stamp, now, instance)
    if source.enabled:
        if kind == 'undecodable':
            stamp = instance = None
        kind = kind if kind in ('good', 'heartbeat') else 'refused'
        model.sources[source.name].take(kind, ring, stamp, now, instance)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random events: the scene against a simple model that recomputes everything.

Hypothesis looks for a sequence of events after which the two differ, and shortens it.
"""

from collections import Counter
import math
from operator import attrgetter

from builders import box, SECOND, serialised
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, rule, RuleBasedStateMachine
from machines import run_until_seen
import numpy as np
import pytest
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.messages.rejections import UNDECODABLE
from sat_collision.monitor import Monitor
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacle_store import OTHER_FRAME, TOO_MANY
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN, Scene
from sat_collision.scene.settings import (
    FootprintSettings, ObstacleSettings, POLYGON_INSTANCE, Settings)
from sat_collision.scene.sources import TOO_OLD

pytest.importorskip('shapely')

from scene_model import SceneModel  # noqa: E402
from stage import with_changes  # noqa: E402

MILLISECOND = SECOND // 1000
START = 1000 * SECOND
FOOTPRINTS = (FootprintSettings('robot', '/footprint', timeout=1.0),
              FootprintSettings('cart', '/cart', timeout=0.0, min_time_to_collision=1.0))
SOURCES = {source.name: source for source in (
    ObstacleSettings('sets', '/sets', timeout=0.6, max_count=3, set_end='empty_polygon'),
    ObstacleSettings('stamped', '/stamped', timeout=0.6, max_count=3, set_end='new_stamp'),
    ObstacleSettings('single', '/single', timeout=0.6, set_end='each_message'),
    ObstacleSettings('map', '/map', timeout=0.0, max_count=4, set_end='empty_polygon'),
    ObstacleSettings('kept', '/kept', timeout=0.7, max_count=5),
    ObstacleSettings('tracks', '/tracks', timeout=0.5, type='polygon_instance', max_count=3,
                     moving=True))}

# In units of 0.5 m, at sites 1.5 m apart: many touch, some lie in the concave part of another, and
# many are exactly a margin apart.
SHAPES = {'square': ((0, 0), (2, 0), (2, 2), (0, 2)),
          'triangle': ((0, 0), (2, 0), (0, 2)),
          'bar': ((0, 0), (3, 0), (3, 1), (0, 1)),
          'hook': ((0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)),
          'segment': ((2, 2), (3, 3)),
          'point': ((2, 2),)}
BODIES = {f'{shape} {column} {row}': tuple((x / 2 + 1.5 * column, y / 2 + 1.5 * row)
                                           for x, y in corners)
          for row in range(3) for column in range(4) for shape, corners in SHAPES.items()}
RING_OF = {frozenset(ring): ring for ring in BODIES.values()}

BAD_POINTS = {'not finite': ((0, 0), (1, math.nan), (1, 1)),
              'self-intersecting': ((5, 5), (6, 6), (6, 5), (5, 6))}

HORIZON = 3.0
# Rounding error allowed in a time in s and a position in m.
ROUNDING = 1e-6

# In milliseconds, some of them exactly a timeout; None stands for a stamp of 0.
ages = st.sampled_from((0, 0, 0, 1, 15, 20, 90, 500, 600, 700, 1000, 2000, -10, -2000, None))
waits = st.sampled_from((1, 5, 30, 100, 500, 600, 2100))
bodies = st.sampled_from(tuple(BODIES))
margins = st.sampled_from((0.0, 0.0, 0.5, 0.75))
flaws = st.sampled_from((OTHER_FRAME, UNDECODABLE, *BAD_POINTS))
footprints = st.sampled_from([footprint.name for footprint in FOOTPRINTS])
instances = st.integers(0, 4)
sources = st.runner().flatmap(lambda machine: st.sampled_from(machine.sources))


class ByPolygons:
    """
    A scene that receives polygons.

    Methods that take a message return why it is refused, None if it is not.
    """

    def __init__(self, settings):
        self.scene = Scene(settings)
        self._sources = {source.name: source for source in settings.obstacles}

    def place(self, name, ring, stamp, now, instance, number, frame_id='map'):
        body = Polygon(ring).packed if ring else None
        if name not in self._sources:
            refusal = self.scene.footprint(name, body, frame_id, stamp, now, number=number)
            if refusal is None and self.scene.is_tracked(name):
                self.scene.track(name, np.array(ring))
            return refusal
        refusal = self.scene.obstacle(name, body, frame_id, stamp, now, instance, number)
        if refusal is None and ring and self._sources[name].moving:
            self.scene.sources[name].track(instance, stamp or now, np.array(ring))
        return refusal

    def refuse(self, name, reason, stamp, now, instance, number):
        if reason == OTHER_FRAME:
            return self.place(name, box(0), stamp, now, instance, number, 'cam')
        if reason == UNDECODABLE:
            stamp = instance = None
        self.scene.refuse(name, reason, now, stamp, instance, number)
        return None


class ByMessages:
    """A monitor that receives the same bodies as serialised messages."""

    def __init__(self, settings):
        self._monitor = Monitor(settings)
        self._with_ids = {source.name for source in settings.obstacles
                          if source.type == POLYGON_INSTANCE}
        self.scene = self._monitor.scene

    def place(self, name, ring, stamp, now, instance, number):
        if not ring and name in self._with_ids:
            instance = 0
        return self._receive(name, serialised(ring, stamp, 'map', instance), now, number)

    def refuse(self, name, reason, stamp, now, instance, number):
        data = serialised(BAD_POINTS.get(reason, box(0)), stamp,
                          'cam' if reason == OTHER_FRAME else 'map', instance)
        return self._receive(name, data[:9] if reason == UNDECODABLE else data, now, number)

    def _receive(self, name, data, now, number):
        rejection = self._monitor.receive(name, data, now, number)
        return rejection and rejection.reason


class SceneMachine(RuleBasedStateMachine):
    """
    A scene and its model, with the same events.

    `seen` counts the statuses and refusals on which both agreed.
    """

    ingest: type
    seen = Counter()

    @initialize(names=st.lists(st.sampled_from(tuple(SOURCES)), min_size=1, unique=True),
                margin=margins, is_known=st.booleans())
    def begin(self, names, margin, is_known):
        self.sources = names
        self.model = SceneModel(Settings(
            FOOTPRINTS, tuple(map(SOURCES.get, names)), frame_id='map', margin=margin,
            horizon=HORIZON, future_tolerance=0.1))
        self.received = self.ingest(self.model.settings)
        self.scene = self.received.scene
        self.scene.tracks_motion = True
        self.reported = {}
        self.in_collision = set()
        self.numbers = Counter()
        self.now = START
        self.scene.pass_time(self.now)
        if is_known:
            self.all_are_known()

    @rule(milliseconds=waits)
    def wait(self, milliseconds):
        self.now += milliseconds * MILLISECOND
        self.scene.pass_time(self.now)
        self.model.pass_time(self.now)

    @rule()
    def step_back(self):
        self.now -= 3 * SECOND
        self.scene.pass_time(self.now)
        self.model.step_back(self.now)

    @rule(name=footprints, body=bodies, age=ages)
    def footprint(self, name, body, age):
        self._place(name, body, age)

    @rule(name=footprints, path=st.lists(bodies, min_size=2, max_size=3),
          late=st.sampled_from((0, 0, 1)))
    def drive(self, name, path, late):
        for body in path:
            self._place(name, body, late)
            late *= 20

    @rule(name=footprints | sources, shape=st.sampled_from(tuple(SHAPES)), places=st.lists(
        st.sampled_from([f'{x} {y}' for y in range(3) for x in range(4)]), min_size=2, max_size=3),
        milliseconds=st.sampled_from((9, 15, 90)), age=st.sampled_from((0, 1, 20)),
        instance=instances, late=st.sampled_from((0, 0, 30)))
    def move(self, name, shape, places, milliseconds, age, instance, late):
        """Move a body, and possibly send an earlier position late."""
        for place in places:
            self.wait(milliseconds)
            self._place(name, f'{shape} {place}', age, instance)
        if late:
            self._place(name, f'{shape} {places[0]}', late, instance)

    @rule(tracks=st.booleans())
    def track(self, tracks):
        self.scene.tracks_motion = self.model.tracks_motion = tracks

    @rule(name=footprints, flaw=flaws, age=ages)
    def bad_footprint(self, name, flaw, age):
        self._refuse(name, flaw, age)

    @rule(name=sources, body=bodies, age=ages, instance=instances)
    def obstacle(self, name, body, age, instance):
        self._place(name, body, age, instance)

    @rule(name=sources, flaw=flaws, age=ages, instance=instances)
    def bad_obstacle(self, name, flaw, age, instance):
        self._refuse(name, flaw, age, instance)

    @rule(name=sources, together=st.lists(bodies, min_size=2, max_size=4), age=ages,
          first=instances)
    def obstacles(self, name, together, age, first):
        for instance, body in enumerate(together, first):
            self._place(name, body, age, instance)

    @rule(name=sources, age=ages)
    def end(self, name, age):
        """Send an empty polygon."""
        self._receive(name, None, age, 0)

    @rule(name=sources, count=st.integers(1, 2))
    def lose(self, name, count):
        self.numbers[name] += count

    @rule(name=sources)
    def restart(self, name):
        """Begin again with number 1, as a new publisher does."""
        self.numbers[name] = 0

    @rule(name=sources, together=st.lists(bodies, min_size=1, max_size=4, unique=True),
          lost=st.sampled_from((0, 0, 1)), ends=st.booleans())
    def listing(self, name, together, lost, ends):
        self.wait(30)
        self.obstacles(name, together, 0, 0)
        self.lose(name, lost)
        if ends:
            self.end(name, 0)

    @rule(name=footprints | sources)
    def disable(self, name):
        self._use(with_changes(self.model.settings, name, enabled=False))

    @rule()
    def all_are_known(self):
        for name in (*map(attrgetter('name'), FOOTPRINTS), *self.sources):
            self._use(with_changes(self.model.settings, name, enabled=True))
        for name in self.sources:
            self.restart(name)
        for milliseconds in (1, 410, 410):
            self.wait(milliseconds)
            for name in self.sources:
                self.end(name, 0)
        for k in range(2):
            self.wait(20)
            self._place('robot', f'square {k} 1', 0)
            self._place('cart', f'square 1 {k}', 0)

    @rule(margin=margins)
    def use_margin(self, margin):
        self._use(with_changes(self.model.settings, margin=margin))

    @rule(name=footprints, own=st.runner().flatmap(
        lambda machine: st.lists(st.sampled_from(machine.sources), unique=True)))
    def monitor(self, name, own):
        """Change which sources a footprint monitors; none means all."""
        self._use(with_changes(self.model.settings, name, obstacles=tuple(own)))

    @invariant()
    def agree(self):
        for name in self.scene.looking_ahead:
            self.scene.look_ahead(name)
        self._obstacles_agree()
        self._states_agree()
        self._predictions_agree()
        self._changes_are_reported()

    def _obstacles_agree(self):
        obstacles = Counter((*name[:2], ring_of(polygon))
                            for name, polygon in self.scene.obstacles)
        assert obstacles == Counter(self.model.obstacles(self.now))

    def _states_agree(self):
        for footprint in FOOTPRINTS:
            state = self.scene.state(footprint.name)
            status, contacts, reasons = self.model.state(footprint.name, self.now)
            if state.status is Status.IMMINENT:
                assert status == 'clear'
                continue
            assert state.status.value == status
            assert len(state.reasons) == len(reasons)
            assert all(map(str.startswith, state.reasons, reasons))
            assert {one[:2] for one in state.contacts} == contacts
            assert list(state.contacts) == sorted(state.contacts)
            assert state.age == self.model.age(footprint.name, self.now)
            self.seen[status] += 1

    def _predictions_agree(self):
        """Fail if a time is early or late, or given while unknown."""
        for footprint in FOOTPRINTS:
            name, threshold = footprint.name, footprint.min_time_to_collision
            found, status = self.scene.prediction(name), self.scene.status(name)
            if status is Status.COLLISION:
                assert found.seconds == 0.0 and found.is_known
                continue
            ahead = self.model.ahead(name, self.now)
            assert (found is None) == (ahead is None)
            assert (status is Status.IMMINENT) == (bool(found) and found.seconds <= threshold
                                                   and threshold > 0.0)
            if ahead is None:
                continue
            seconds, is_due = found.seconds, found.seconds < math.inf
            assert is_due <= (seconds <= HORIZON)
            assert seconds == 0.0 or not ahead.is_met(min(seconds, HORIZON) - ROUNDING,
                                                      -ROUNDING), 'late'
            assert not is_due or ahead.is_met(seconds + ROUNDING, ROUNDING), 'early'
            assert {one[:2] for one in found.unknown} == (ahead.unknown if seconds else set())
            self.seen['time' if is_due else 'never'] += 1
            self.seen['unknown motion'] += not found.is_known

    def _changes_are_reported(self):
        brief = {name for name in self.in_collision
                 if 'collision' not in (self.model.state(name, self.now)[0],
                                        self.reported.get(name, ('unknown',))[0])}
        changes = self.scene.take_changes()
        assert set(changes.brief) == brief
        self.seen['brief'] += len(brief)
        for name in changes.changed:
            state = self._reportable(name)
            assert state != self.reported.get(name)
            self.reported[name] = state
        for footprint in FOOTPRINTS:
            assert self._reportable(footprint.name) == self.reported[footprint.name]
        self.in_collision.clear()
        self._note_collisions()

    def _reportable(self, name):
        status, contacts, reasons, _ = self.scene.state(name)
        return status.value, contacts, reasons

    def _note_collisions(self):
        self.in_collision |= {footprint.name for footprint in FOOTPRINTS
                              if self.model.state(footprint.name, self.now)[0] == 'collision'}

    def _place(self, name, body, age, instance=None):
        self._receive(name, BODIES[body], age, instance)

    def _receive(self, name, ring, age, instance):
        message = self._message(name, age, instance)
        refusal = self.model.receive(name, ring, None, *message)
        assert self.received.place(name, ring or (), *message) == refusal
        self.seen[refusal] += 1
        self._note_collisions()

    def _refuse(self, name, flaw, age, instance=None):
        message = self._message(name, age, instance)
        answer = self.received.refuse(name, flaw, *message)
        if flaw == UNDECODABLE:
            message = None, self.now, None, message[-1]
        refusal = self.model.receive(name, None, flaw, *message)
        assert flaw != OTHER_FRAME or answer == refusal
        self.seen[refusal] += 1

    def _message(self, name, age, instance):
        """Return stamp, current time, id and number; a map does not age, so none is ahead."""
        self.numbers[name] += 1
        age = max(age, 0) if age and name == 'map' else age
        stamp = 0 if age is None else self.now - age * MILLISECOND
        return stamp, self.now, instance if name == 'tracks' else None, self.numbers[name]

    def _use(self, settings):
        self.scene.update(settings)
        self.model.use(settings)
        self.model.pass_time(self.now)
        self._note_collisions()


class PolygonMachine(SceneMachine):
    ingest = ByPolygons


class MessageMachine(SceneMachine):
    ingest = ByMessages


def ring_of(polygon):
    return RING_OF[frozenset(map(tuple, polygon.vertices.tolist()))]


@pytest.mark.long
@pytest.mark.parametrize('machine', (PolygonMachine, MessageMachine))
def test_scene_agrees_with_the_model(machine):
    """Sources and messages of every kind in any order, with stamps that go back and forth."""
    run_until_seen(machine, {
        **dict.fromkeys(('clear', 'collision', 'unknown'), 500),
        **dict.fromkeys((FROM_FUTURE, OTHER_FRAME, OVERTAKEN, TOO_MANY, TOO_OLD), 50),
        **dict.fromkeys(('brief', 'time', 'never', 'unknown motion'), 10)},
        examples=300, steps=50)

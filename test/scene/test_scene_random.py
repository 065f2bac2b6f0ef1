# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random events: the states, predictions and reports of a scene against a simple model.

The model checks all bodies with shapely in each query. Which obstacles there are, and which are
missing, it takes from the scene: test_knowledge and test_knowing decide that. Hypothesis looks for
a sequence of events after which the two differ, and shortens it. A body is a ring: a tuple of its
corners. Times are in ns.
"""

from collections import Counter
from functools import lru_cache
import math
from operator import attrgetter
from typing import NamedTuple

from bodies import as_shapely
from builders import box, SECOND, serialised
import hypothesis
from hypothesis import strategies as st
from hypothesis.stateful import (
    initialize, invariant, rule, RuleBasedStateMachine, run_state_machine_as_test)
from monitors import with_changes
import pytest
from sat_collision.messages.rejections import UNDECODABLE
from sat_collision.monitor import Monitor
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacle_store import OTHER_FRAME
from sat_collision.scene.scene import FROM_FUTURE, OVERTAKEN
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
import shapely

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


class Place(NamedTuple):
    """The last position of a footprint, its stamp and time, or what is wrong with it."""

    ring: tuple | None = None
    stamp: int | None = None
    time: int | None = None
    fault: str = 'has not been received yet'
    places: tuple = ()


class Ahead(NamedTuple):
    """
    What a footprint moves towards: obstacles at its stamp, and their relative velocities.

    `unknown` are those obstacles whose motion is not known.
    """

    ring: tuple
    age: float
    margin: float
    others: list
    unknown: set

    def is_met(self, seconds, slack):
        """Tell whether it meets any within some seconds from now, up to a slack in m."""
        return any(_is_met(self.ring, other, vx * (seconds + self.age), vy * (seconds + self.age),
                           self.margin + slack) for other, vx, vy in self.others)


class SceneModel:
    """The footprints of a scene with a configured frame_id, from the same events."""

    def __init__(self, scene):
        self._scene = scene
        self.settings = scene.settings
        self._footprints = {one.name: Place() for one in FOOTPRINTS}

    def step_back(self):
        self._footprints = dict.fromkeys(self._footprints, Place(
            fault='has not been received since the clock was set'))

    def use(self, settings):
        """Apply settings with the same names; a footprint disabled or enabled is reset."""
        for before, footprint in zip(self.settings.footprints, settings.footprints):
            if before.enabled != footprint.enabled:
                self._footprints[footprint.name] = Place()
        self.settings = settings

    def settings_of(self, name):
        return next(one for one in self.settings.footprints if one.name == name)

    def receive(self, name, ring, refusal, stamp, now):
        """Receive a footprint, or one that is refused for a reason; return why it is refused."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return None
        if stamp > now + round(self.settings.future_tolerance * SECOND):
            refusal = FROM_FUTURE if refusal in (None, OTHER_FRAME) else refusal
        if refusal:
            self._footprints[name] = Place(fault=(
                f"is not in the frame '{self.settings.frame_id}'" if refusal == OTHER_FRAME
                else f'was refused: {refusal}'))
            return refusal
        last, time = self._footprints[name], min(stamp or now, now)
        if not last.fault and settings.timeout and not is_past(settings, last.time, now) and (
                time < last.time):
            return OVERTAKEN
        places = ()
        if self._scene.tracks_motion or settings.min_time_to_collision:
            places = followed_by(() if last.fault else last.places, stamp or now, ring)
        self._footprints[name] = Place(ring, stamp or now, time, '', places)
        return None

    def _held(self):
        """Return the obstacles that are held, each with the name of its source and its ring."""
        return [(name, one, tuple(map(tuple, one.polygon.vertices.tolist())))
                for name, source in self._scene.sources.items() for one in source.store
                if one.polygon is not None]

    def state(self, name, now):
        """Return a footprint's status, the source and key of its contacts, and reasons."""
        settings = self.settings_of(name)
        if not settings.enabled:
            return 'unknown', set(), [f'footprint {name} is disabled']
        faults = self._faults(settings)
        ring, _, time, fault, _ = self._footprints[name]
        if not fault and is_past(settings, time, now):
            fault = f'is older than its timeout of {settings.timeout:g} s'
        if fault:
            return 'unknown', set(), [f'footprint {name} on {settings.topic} {fault}', *faults]
        contacts = {(source, one.key) for source, one, other in self._held()
                    if settings.monitors(source) and (
                        separation(ring, other) <= self.settings.margin)}
        if contacts:
            return 'collision', contacts, faults
        return 'unknown' if faults else 'clear', set(), faults

    def ahead(self, name, now):
        """Return what a footprint without contact moves towards, None while that is unknown."""
        settings, place = self.settings_of(name), self._footprints[name]
        velocity = self.state(name, now)[0] == 'clear' and velocity_of(place.places, place.stamp)
        if not velocity or any(velocity) and now - place.time > 2 * SECOND:
            return None
        others, unknown = [], set()
        for source, one, ring in self._held():
            if not settings.monitors(source):
                continue
            vx = vy = 0.0
            if SOURCES[source].moving:
                motion = one.motion and one.motion.translation(one.stamp)
                if motion:
                    vx, vy = motion.vx, motion.vy
                else:
                    unknown.add((source, one.key))
            since = (place.time - one.time) / SECOND
            others.append((tuple((x + vx * since, y + vy * since) for x, y in ring),
                           velocity[0] - vx, velocity[1] - vy))
        return Ahead(place.ring, (now - place.time) / SECOND, self.settings.margin, others,
                     unknown)

    def age(self, name, now):
        """Return a footprint's age in seconds, None if it has no valid position."""
        time = self._footprints[name].time
        return None if time is None else (now - time) / SECOND

    def _faults(self, settings):
        """Return why some obstacles may be missing, in sentences."""
        enabled = [source for source in self.settings.obstacles
                   if source.enabled and settings.monitors(source.name)]
        if not enabled:
            return ['none of its obstacle sources is enabled' if settings.obstacles
                    else 'no obstacle source is enabled']
        return [fault for source in enabled for fault in self._scene.sources[source.name].faults]


def is_past(settings, time, now):
    """Tell whether a time is older than the timeout, if that is not 0."""
    return now - time > (round(settings.timeout * SECOND) or math.inf)


def followed_by(places, stamp, ring):
    """Append the next place of a body; earlier places are dropped if its stamp goes back."""
    return *((t, r) for t, r in places if places[-1][0] <= stamp and t != stamp), (stamp, ring)


def velocity_of(places, stamp):
    """Return vx and vy in m/s of a body that moved without rotating, None if unknown."""
    last, ring = places[-1] if places else (None, ())
    earlier = [place for place in places if last - place[0] >= 10 * MILLISECOND]
    if last != stamp or not earlier or last - earlier[-1][0] > 2 * SECOND:
        return None
    begin, before = earlier[-1]
    moves = {(x - a, y - b) for (x, y), (a, b) in zip(ring, before)}
    if len(ring) != len(before) or len(moves) > 1:
        return None
    return tuple(move * SECOND / (last - begin) for move in moves.pop())


@lru_cache(maxsize=None)
def separation(ring, other):
    """Return the distance of two bodies, 0 if they share a point."""
    return shapely.distance(as_shapely(ring), as_shapely(other))


@lru_cache(maxsize=None)
def _is_met(ring, other, x, y, margin):
    """Tell whether a body that moves straight by (x, y) comes within a margin of another."""
    moved = [(a + x, b + y) for a, b in ring]
    way = shapely.union_all([as_shapely(ring), as_shapely(moved), *(
        shapely.convex_hull(shapely.MultiPoint([ring[k - 1], ring[k], moved[k - 1], moved[k]]))
        for k in range(len(ring)))])
    if margin < 0.0:
        return bool(way.buffer(margin).intersects(as_shapely(other)))
    return bool(shapely.distance(way, as_shapely(other)) <= margin)


class SceneMachine(RuleBasedStateMachine):
    """
    The scene of a monitor and its model, with the same events.

    `seen` counts the statuses and refusals on which both agreed.
    """

    seen = Counter()

    @initialize(names=st.lists(st.sampled_from(tuple(SOURCES)), min_size=1, unique=True),
                margin=margins, is_known=st.booleans())
    def begin(self, names, margin, is_known):
        self.sources = names
        self.monitor = Monitor(Settings(
            FOOTPRINTS, tuple(map(SOURCES.get, names)), frame_id='map', margin=margin,
            horizon=HORIZON, future_tolerance=0.1))
        self.scene = self.monitor.scene
        self.model = SceneModel(self.scene)
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

    @rule()
    def step_back(self):
        self.now -= 3 * SECOND
        self.scene.pass_time(self.now)
        self.model.step_back()

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
        self.scene.tracks_motion = tracks

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
        self._states_agree()
        self._predictions_agree()
        self._changes_are_reported()

    def _states_agree(self):
        for footprint in FOOTPRINTS:
            state = self.scene.state(footprint.name)
            status, contacts, reasons = self.model.state(footprint.name, self.now)
            if state.status is Status.IMMINENT:
                assert status == 'clear'
                continue
            assert state.status.value == status
            assert [*state.reasons] == reasons
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

    def _refuse(self, name, flaw, age, instance=None):
        self._receive(name, BAD_POINTS.get(flaw, box(0)), age, instance, flaw)

    def _receive(self, name, ring, age, instance, flaw=None):
        """Receive a ring, None for an empty polygon; a map does not age, so none is ahead."""
        self.numbers[name] += 1
        age = max(age, 0) if age and name == 'map' else age
        stamp = 0 if age is None else self.now - age * MILLISECOND
        data = serialised(ring or (), stamp, 'cam' if flaw == OTHER_FRAME else 'map',
                          instance if name == 'tracks' else None)
        rejection = self.monitor.receive(name, data[:9] if flaw == UNDECODABLE else data, self.now,
                                         self.numbers[name])
        refusal = rejection and rejection.reason
        if name not in SOURCES:
            assert refusal == self.model.receive(
                name, ring, flaw, 0 if flaw == UNDECODABLE else stamp, self.now)
        self.seen[refusal] += 1
        self._note_collisions()

    def _use(self, settings):
        self.scene.update(settings)
        self.model.use(settings)
        self._note_collisions()


def run_until_seen(machine, wanted, examples, steps):
    """
    Run a state machine until its `seen` counts all that is wanted of it.

    Examples are drawn from constants of imported modules, too: what one run shows, another may
    not, so it is run with other seeds.
    """
    machine.seen.clear()
    for seed in range(5):
        run_state_machine_as_test(hypothesis.seed(seed)(machine), settings=hypothesis.settings(
            max_examples=examples, stateful_step_count=steps, database=None, deadline=None,
            report_multiple_bugs=False,
            phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink)))
        if all(machine.seen[what] > count for what, count in wanted.items()):
            return
    raise AssertionError(f'wanted {wanted}, seen {machine.seen}')


@pytest.mark.long
def test_scene_agrees_with_the_model():
    """Sources and messages of every kind in any order, with stamps that go back and forth."""
    run_until_seen(SceneMachine, {
        **dict.fromkeys(('clear', 'collision', 'unknown'), 500),
        **dict.fromkeys((FROM_FUTURE, OTHER_FRAME, OVERTAKEN), 50),
        **dict.fromkeys(('brief', 'time', 'never', 'unknown motion'), 10)},
        examples=300, steps=50)

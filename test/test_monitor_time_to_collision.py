# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The time to collision of a footprint: never late, and unknown if motion is unknown."""

from dataclasses import replace
import math

from bodies import first_contact, where
from builders import box, SECOND, serialised
from monitors import MAP, START, World
import numpy as np
import pytest
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.settings import FootprintSettings, Settings
import shapely
from shapely.geometry import Polygon

TRACKS = replace(MAP, timeout=10.0, set_end='none', moving=True)
DOCK = replace(MAP, name='dock', topic='/dock')
ROBOT = [(-0.5, -0.5), (0.5, -0.5), (0.7, 0.0), (0.5, 0.5), (-0.5, 0.5)]
# Error of a position a horizon ahead, by rounding to float32 and the prediction's tolerance, in m.
TOLERANCE = 2e-3


class Predicted(World):
    """A monitor that tracks motion for predictions."""

    def __init__(self, bodies, dock=(), horizon=3.0, release_delay=0.0, margin=0.0, moving=False,
                 **footprint):
        super().__init__(Settings(
            footprints=(FootprintSettings('robot', '/robot', **footprint),),
            obstacles=(TRACKS if moving else MAP, DOCK), horizon=horizon,
            release_delay=release_delay, margin=margin), False, True)
        if moving:
            # The tracks are known after their timeout and future_tolerance.
            for time in (-11.1, -5.0, 0.0):
                self.see(time, ())
        self.send_map('map', *bodies)
        self.send_map('dock', *dock)

    def place(self, time, points, age=0.0):
        """Receive a footprint that has an age."""
        self.at(time).send('robot', points, time - age)
        return self

    def drive(self, *times, speed=1.0):
        """Receive footprints that drive along x, from x = 0 at time 0."""
        for time in times:
            self.place(time, [(x + speed * time, y) for x, y in ROBOT])
        return self

    def see(self, time, points, key=1, age=0.0):
        """Receive an obstacle with an id and an age."""
        self.at(time).send('map', points, time - age, instance=key)
        return self

    @property
    def seconds(self):
        return self.prediction.seconds


AHEAD = box(2.7, -0.5)
FAR = box(50.0)


def test_time_is_counted_from_now():
    """The front is 2 m away at 1 m/s; delays of messages do not matter."""
    world = Predicted([FAR, AHEAD])
    assert world.drive(0.0).status() == 'clear' and world.prediction is None
    assert world.drive(0.1).prediction[:2] == (pytest.approx(1.9, abs=1e-3), ObstacleId('map', 2))
    assert world.prediction.velocity.origin == 'footprints'
    assert world.at(0.5).seconds == pytest.approx(1.5, abs=1e-3)
    world.place(0.8, [(x + 0.4, y) for x, y in ROBOT], age=0.4)
    assert world.seconds == pytest.approx(1.2, abs=1e-3)
    assert world.prediction.duration == pytest.approx(1.6, abs=1e-3)


def test_time_is_0_in_contact_and_after_predicted_contact():
    """The last footprint is 0.5 s old and was 0.1 s before contact; then one touches."""
    world = Predicted([AHEAD]).drive(1.8, 1.9)
    assert world.at(2.4).status() == 'clear' and world.seconds == 0.0
    world = Predicted([AHEAD])
    assert world.drive(2.25).status() == 'collision'
    assert world.prediction == (0.0, ObstacleId('map', 1), None, 0.0, ())


def test_time_until_within_the_margin():
    world = Predicted([AHEAD], margin=0.5)
    assert world.drive(1.3, 1.4).seconds == pytest.approx(0.1, abs=1e-3)
    assert world.drive(1.49).status() == 'clear' and world.seconds == pytest.approx(0.01, abs=1e-3)
    assert world.drive(1.51).status() == 'collision' and world.seconds == 0.0


def test_time_is_infinite_beyond_the_horizon_and_at_rest():
    world = Predicted([AHEAD], horizon=1.0)
    assert world.drive(0.0, 0.5).seconds == math.inf and world.prediction.obstacle is None
    assert world.drive(1.001).seconds == pytest.approx(0.999, abs=1e-3)
    assert world.drive(1.1, 1.2, speed=0.0).prediction == (
        math.inf, None, ((0, 0, 0), pytest.approx((0.14, 0, 0)), 'footprints', False), math.inf,
        ())


@pytest.mark.parametrize('change', ['min_time_to_collision', 'subscription'])
def test_velocity_is_not_that_across_a_time_without_tracking(change):
    """It stands; while its motion is of no interest, it goes back; then it comes at 1 m/s."""
    world = Predicted([AHEAD], min_time_to_collision=2.0 * (change != 'subscription'))

    def track(is_on):
        world.scene.tracks_motion = is_on and change == 'subscription'
        if change != 'subscription':
            world.use('robot', min_time_to_collision=2.0 * is_on)
    track(True)
    world.drive(0.0, 0.1, speed=0.0)
    track(False)
    world.drive(0.2, speed=-1.0)
    track(True)
    assert world.drive(0.3, speed=0.0).prediction is None
    assert world.drive(0.4, speed=0.25).seconds == pytest.approx(1.9, abs=1e-3)


def test_only_monitored_sources_count():
    world = Predicted([FAR], [AHEAD], obstacles=('map',))
    assert world.drive(0.0, 0.1).seconds == math.inf
    world.use('robot', obstacles=())
    assert world.prediction[:2] == (pytest.approx(1.9, abs=1e-3), ObstacleId('dock', 1))


def test_no_prediction_while_unknown_or_not_requested():
    world = Predicted([AHEAD], horizon=0.0)
    assert world.drive(0.0, 0.1).prediction is None
    world = Predicted([AHEAD])
    assert world.drive(0.0, 0.1).seconds < 3
    assert world.at(1.2).status() == 'unknown' and world.prediction is None
    assert world.drive(1.3).seconds == pytest.approx(0.7, abs=1e-3)
    assert world.use(enabled=False).prediction is None


def test_velocity_is_used_for_two_seconds():
    """Even if the footprint has no timeout; one at rest stays at rest."""
    world = Predicted([box(9.0)], horizon=60.0, timeout=0.0).drive(0.0, 0.1)
    assert world.at(2.0).seconds < math.inf
    assert world.at(2.2).status() == 'clear' and world.prediction is None
    world.drive(3.0, 3.1, speed=0.0)
    assert world.at(50.0).seconds == math.inf


def test_imminent_within_min_time_to_collision():
    """It begins by time alone, and ends after release_delay."""
    world = Predicted([AHEAD], min_time_to_collision=1.0, release_delay=0.5)
    world.scene.tracks_motion = False
    assert world.drive(0.0, 0.6, 0.7).status() == 'clear'
    due = (world.scene.deadline - START) / SECOND
    assert due == pytest.approx(1.0, abs=2e-3)
    assert world.at(due - 0.01).status() == 'clear'
    assert world.at(due + 0.001).status() == 'imminent'
    assert world.scene.state('robot').reasons == (
        'moving on as it does, it is in contact within min_time_to_collision, 1 s',)
    assert world.scene.unknown_reasons('robot') == ()
    assert world.drive(2.25).status() == 'collision'
    assert world.drive(2.3, 2.4, speed=0.1).status() == 'imminent'
    assert 'release_delay' in world.scene.state('robot').reasons[0]
    assert world.drive(2.79, speed=0.1).status() == 'imminent'
    assert world.at(2.81).status() == 'clear'


def test_imminent_ends_when_the_footprint_brakes_or_its_velocity_is_unknown():
    """Or without a threshold."""
    world = Predicted([AHEAD], min_time_to_collision=1.0, horizon=0.0).drive(1.5, 1.6)
    assert world.status() == 'imminent' and world.seconds == pytest.approx(0.4, abs=1e-3)
    world.place(1.7, [(x + 1.6, y) for x, y in ROBOT])
    assert world.status() == 'clear' and world.seconds == math.inf
    assert world.place(1.8, [(x + 1.7, y) for x, y in ROBOT]).status() == 'imminent'
    world.place(1.9, [(x + 1.7, y) for x, y in ROBOT[:4]])
    assert world.status() == 'clear' and world.prediction is None
    assert world.drive(2.0, 2.1, speed=0.9).status() == 'imminent'
    assert world.use('robot', min_time_to_collision=0.0).status() == 'clear'


def test_unknown_becomes_clear_only_once_it_is_predicted():
    """No flag falls for the moment until then."""
    world = Predicted([AHEAD], min_time_to_collision=1.0)
    for bodies in ((1.5, 1.6), (9.0, 9.1)):
        world.use('robot', enabled=False)
        world.use('robot', enabled=True)
        world.look_ahead()
        world.scene.take_changes()
        for time in bodies:
            world.time = time
            world.monitor.receive('robot', serialised(
                [(x + time, y) for x, y in ROBOT], world.now, 'odom'), world.now)
        assert world.status() == 'unknown' and world.scene.take_changes() == ([], [])
        world.look_ahead()
        assert world.status() == ('imminent' if bodies[0] == 1.5 else 'clear')
        assert world.scene.take_changes() == (['robot'], [])


def test_unknown_takes_precedence_over_imminent():
    world = Predicted([AHEAD], min_time_to_collision=2.0)
    assert world.drive(0.0, 0.1).status() == 'imminent'
    assert world.at(1.2).status() == 'unknown'
    assert world.drive(1.3).status() == 'imminent'


def walker(time, speed=-1.0, turn=0.0, x=5.0):
    """Return the corners of a person who moves along x, from x = 5 at time 0."""
    c, s = math.cos(turn * time), math.sin(turn * time)
    return [(x + speed * time + c * u - s * v, s * u + c * v) for u, v in box(-0.25, -0.25, 0.5)]


def test_moving_obstacle():
    """At first 4.05 m apart, approaching at 2 m/s; messages have different ages."""
    world = Predicted([walker(0.0)], moving=True).drive(0.0, 0.1)
    assert world.prediction.unknown == (ObstacleId('map', 1),) and not world.prediction.is_known
    world.see(0.2, walker(0.2))
    assert world.prediction[:2] == (pytest.approx(1.825, abs=1e-3), ObstacleId('map', 1))
    assert world.prediction.is_known
    assert world.see(0.6, walker(0.4), age=0.2).seconds == pytest.approx(1.425, abs=1e-3)
    assert world.drive(0.9).seconds == pytest.approx(1.125, abs=1e-3)
    world.use('map', moving=False)
    assert world.seconds == pytest.approx(2.75, abs=1e-3) and world.prediction.is_known
    world.see(1.0, walker(1.0))
    assert world.use('map', moving=True).prediction.unknown == (ObstacleId('map', 1),)


@pytest.mark.parametrize('next_one', [
    walker(0.3)[:3], walker(0.3, turn=0.5), walker(0.3, speed=2000.0)],
    ids=['another shape', 'one that turns', 'too fast'])
def test_obstacles_of_unknown_motion_are_listed(next_one):
    """The flag is raised by the other obstacles."""
    world = Predicted([walker(0.0), AHEAD], moving=True, min_time_to_collision=3.0)
    world.see(0.1, AHEAD, 2)
    world.see(0.2, AHEAD, 2)
    world.see(0.2, walker(0.2))
    assert world.drive(0.1, 0.25).prediction.is_known
    assert world.see(0.3, next_one).prediction.unknown == (ObstacleId('map', 1),)
    assert world.prediction[:2] == (pytest.approx(1.7, abs=1e-3), ObstacleId('map', 2))
    assert world.status() == 'imminent'


def test_motion_of_an_obstacle_begins_anew_when_it_is_tracked_again():
    """It stands; while it is taken to stand it goes away, and comes back at 6 m/s."""
    world = Predicted([FAR], moving=True, timeout=5.0)
    for time in (0.1, 0.2):
        world.drive(time, speed=0.0)
        world.see(time, box(2.4, -0.5))
    for is_moving in (False, True):
        world.use('map', moving=is_moving)
        world.see(0.3 + 0.2 * is_moving, box(3.6 - 1.2 * is_moving, -0.5))
    assert ObstacleId('map', 1) in world.prediction.unknown
    assert world.see(0.6, box(1.8, -0.5)).seconds == pytest.approx(1.1 / 6.0, abs=1e-3)


def test_velocity_of_an_obstacle_is_used_for_two_seconds():
    """One at rest stays at rest."""
    world = Predicted([walker(0.0), FAR], moving=True, timeout=9.0)
    world.see(0.1, walker(0.1))
    world.see(0.1, FAR, 2)
    assert world.drive(2.0, 2.05).prediction.is_known
    assert world.drive(2.15).prediction.unknown == (ObstacleId('map', 1),)


def test_slow_obstacle_with_a_fast_footprint_or_a_wide_margin():
    """Both enlarge the reach within which obstacles are considered."""
    def slow(time):
        return box(20.0 - time / 16, -0.5)
    world = Predicted([slow(0.0)], moving=True)
    world.see(0.25, slow(0.25))
    world.drive(0.25, 0.375, speed=10.0)
    assert world.seconds == pytest.approx(19.3 / 10.0625 - 0.375, abs=1e-3)
    world = Predicted([[(x - 14.2, y) for x, y in slow(0.0)]], moving=True, margin=5.0)
    world.see(0.25, [(x - 14.2, y) for x, y in slow(0.25)])
    assert world.drive(0.25, 0.375, speed=0.0).seconds == pytest.approx(0.1 * 16 - 0.375, abs=2e-2)


@pytest.mark.parametrize('seed', [
    *range(6), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(6, 20))])
def test_no_time_is_late_among_many_moving_obstacles(seed):
    """Most are out of reach, some far and fast; compared with positions every 10 ms."""
    rng = np.random.default_rng(seed)
    margin = rng.choice([0.0, 0.3])
    where_from = rng.choice([0.0, 1e5])
    bodies = []
    for _ in range(40):
        centre = rng.uniform(-30, 30, 2)
        speed = rng.choice([0.0, 1.0, 10.0], p=[0.2, 0.5, 0.3])
        # Most move towards the footprint, so that some meet it.
        velocity = speed * (rng.uniform(-5, 5, 2) - centre) / np.hypot(*centre)
        body = np.float32(where_from + centre + rng.uniform(-0.4, 0.4, (3, 2))).astype(float)
        bodies.append((body, np.round(velocity * 16) / 16))
    world = Predicted([body for body, _ in bodies], moving=True, margin=margin)
    twist = (*rng.uniform(-2, 2, 2), rng.choice([0.0, rng.uniform(-1.5, 1.5)]))
    stamps = [0.25 + 0.125 * rng.integers(0, 3) for _ in bodies]
    for time in (0.25, 0.375, 0.5):
        for k, ((body, velocity), stamp) in enumerate(zip(bodies, stamps)):
            if time == stamp:
                world.see(time, body + velocity * stamp, k + 1)
    offset = np.array((where_from, where_from))
    own = Polygon(np.array(ROBOT))
    for time in (0.5, 0.625):
        world.place(time, offset + np.array(where(own, twist, time).exterior.coords)[:-1])
    if world.status() == 'collision':
        return
    assert world.prediction.is_known
    # The motion is fitted to positions rounded to float32.
    zone = own.buffer(margin - 0.2 if where_from else margin - TOLERANCE)
    steps = np.arange(0.0, 3.0, 0.01)

    def placed(seconds):
        """Return the obstacles after the last footprint, relative to where all are."""
        return np.stack([where(Polygon(body - offset), (*velocity, 0.0), 0.625 + seconds)
                         for body, velocity in bodies], axis=-1)

    touched = first_contact(steps, where(zone, twist, 0.625 + steps), placed(steps))
    assert world.seconds <= touched
    if world.seconds < math.inf:
        there = where(own, twist, 0.625 + world.seconds)
        near = shapely.distance(there, placed(world.seconds)).min()
        assert near <= margin + (0.3 if where_from else TOLERANCE)


@pytest.mark.parametrize('seed', [
    *range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 25))])
def test_no_time_is_late_and_none_is_given_while_unknown(seed):
    """Random motion among random obstacles, at rest or moving, with gaps and changed shapes."""
    rng = np.random.default_rng(seed)
    obstacles = [Polygon(rng.uniform(-0.4, 0.4, (3, 2)) + rng.uniform(-6, 6, 2)).convex_hull
                 for _ in range(6)]
    velocities = rng.uniform(-1.0, 1.0, (6, 2)) * (seed % 2)
    world = Predicted([list(one.exterior.coords) for one in obstacles], moving=seed % 2 == 1)
    outline = Polygon(ROBOT)
    twist = (*rng.uniform(-1.5, 1.5, 2), rng.choice([0.0, rng.uniform(-1.5, 1.5)]))
    events = ['go on'] * 8 + ['gap', 'shape', 'turn'] + ['back'] * (1 - seed % 2)
    count, found, last = 60, 0, []

    def places(time):
        """Return the obstacles at a time or times."""
        return np.stack([where(one, (*velocity, 0.0), time)
                         for one, velocity in zip(obstacles, velocities)], axis=-1)

    for _ in range(count):
        event = rng.choice(events)
        time = world.time + rng.uniform(0.02, 0.2)
        if event == 'gap':
            time += rng.uniform(0.0, 2.5)
        elif event == 'back':
            time, last = max(time - rng.uniform(1.3, 2.0), 0.01), []
            world.at(time)
        elif event == 'turn':
            # Earlier positions do not fit the new motion.
            twist, last = (*rng.uniform(-1.5, 1.5, 2), rng.uniform(-1.5, 1.5)), []
            world.at(time := time + 2.1)
        for key in np.flatnonzero(rng.uniform(0.0, 1.0, 6) < 0.9 * (seed % 2)).tolist():
            world.see(time, list(places(time)[key].exterior.coords)[:-1], key + 1)
        points = list(where(outline, twist, time).exterior.coords)[:-1]
        if event == 'shape':
            points = points[:-1]
        world.place(time, points)
        last = [*last, (time, len(points))][-2:]
        world.at(time + rng.choice([0.0, rng.uniform(0.0, 1.3)]))
        (before, n), (_, m) = last[0], last[-1]
        age = world.time - time
        is_known = n == m and 0.0 < time - before <= 2.0 and age <= 1.0
        if world.status() == 'collision':
            assert world.seconds == 0.0
            continue
        assert (world.prediction is not None) == is_known, (event, last, world.time)
        if not (is_known and world.prediction.is_known):
            continue
        sent = Polygon(points)
        steps = np.arange(0.0, 3.0 + age, 0.02)
        touched = first_contact(
            steps, where(sent.buffer(-TOLERANCE), twist, steps), places(time + steps))
        seconds = world.seconds
        if touched - age <= 3.0:
            assert seconds <= max(touched - age, 0.0), 'late'
        if seconds < math.inf:
            found += 1
            there = where(sent, twist, world.prediction.duration)
            at_contact = places(time + world.prediction.duration)
            assert shapely.distance(there, at_contact).min() < TOLERANCE, 'early'
    assert found or seed


@pytest.mark.parametrize('ahead', [0.0, 0.5])
def test_stamps_ahead_of_our_clock_give_no_slower_velocity(ahead):
    """Messages of 0.1 s come 0.5 s apart, or together: their stamps tell how fast they are."""
    for pause in (0.0, 0.5):
        world = Predicted([walker(0.0)], moving=True)
        world.see(0.1, walker(0.0), age=-ahead)
        world.at(0.1 + pause).send('map', walker(0.1), 0.2 + ahead, instance=1)
        world.send('robot', ROBOT, 0.1 + ahead)
        world.at(0.2 + pause).send('robot', [(x + 0.1, y) for x, y in ROBOT], 0.2 + ahead)
        assert world.prediction.velocity.twist[0] == pytest.approx(1.0, abs=1e-3)
        assert world.prediction.is_known and world.seconds < 1.95 + pause

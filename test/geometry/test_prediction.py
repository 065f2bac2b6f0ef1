# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Times to contact, against published figures and exact poses on arcs."""

import json
import math
from pathlib import Path

import families
import numpy as np
import oracle
import pytest
from sat_collision import (
    intersects, PolygonError, PolygonSet, separation, time_of_contact, time_to_contact)
import shapes
from test_path import BAR, BOX, L

DATA = json.loads((Path(__file__).parents[1] / 'data' / 'prediction.json').read_text())
TRANSLATIONS = [dict(zip(DATA['columns'], row)) for row in DATA['translations']]

BODIES = [BOX[:1], BAR, BOX[:3], BOX, L, shapes.comb(2)]
# Angles 2 atan(k / 256) have rational cosines and sines.
PARTS = 256
STEPS = np.arange(PARTS)


def or_never(time):
    return math.inf if time is None else time


@pytest.mark.parametrize('source', range(len(DATA['sources'])), ids=DATA['sources'])
def test_translations(source):
    """Never late, exact to 1e-9 s, and as published."""
    cases = [case for case in TRANSLATIONS if case['source'] == source]
    assert cases
    for case in cases:
        exact = or_never(case['first_contact'])
        time = time_to_contact(case['a'], (*case['a_velocity'], 0.0), [case['b']],
                               case['horizon'], [case['b_velocity']])
        assert time == exact or exact - 1e-9 <= time <= exact
        if 'published' in case:
            published = or_never(case['published'])
            assert time == published or abs(time - published) <= case['published_tolerance']


@pytest.mark.parametrize('scene', DATA['time_to_collision'], ids=lambda scene: scene['name'])
def test_times_to_collision_of_nuplan(scene):
    """Its metric samples times; ours lies between two samples."""
    ego, velocity, horizon = scene['ego'], scene['ego_velocity'], scene['horizon']
    steps = scene['step'] * np.arange(round(horizon / scene['step']) + 1)
    stepped = math.inf
    for polygon, own, is_ahead, exact in scene['tracks']:
        exact = or_never(exact)
        time = time_to_contact(ego, (*velocity, 0.0), [polygon], horizon, [own])
        assert time == exact or exact - 1e-9 <= time <= exact
        touched = next((t for t in steps.tolist() if intersects(
            np.add(ego, t * np.array(velocity)), np.add(polygon, t * np.array(own)))), math.inf)
        assert touched == math.inf or touched - scene['step'] < time <= touched
        if is_ahead and any(velocity):
            stepped = min(stepped, touched)
    published = or_never(scene['published'])
    assert stepped == published or stepped == pytest.approx(published)
    polygons, velocities, _, times = zip(*scene['tracks'])
    row, time = PolygonSet(polygons).first_contact(ego, (*velocity, 0.0), horizon, velocities)
    assert times[row] == min(map(or_never, times)) == pytest.approx(time, abs=1e-9)


@pytest.mark.parametrize('scene', DATA['collisions'], ids=lambda scene: scene['name'])
def test_collisions_of_nuplan(scene):
    """Each track counts once."""
    collided = set()
    for ego, tracks in scene['frames']:
        collided |= {name for name, polygon in tracks.items()
                     if time_to_contact(ego, (1.0, 2.0, 3.0), [polygon], 0.0) == 0.0}
    assert len(collided) == scene['published_new_collisions']


def turned(points, centre, cosine, sine):
    """Return points rotated about a centre, scaled like cosine and sine."""
    x, y = (points - centre).T
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y])


def arcs(seed, count):
    """
    Yield motions on arcs: body, centre, angular velocity, pose, twist and an obstacle.

    All coordinates are multiples of 1/8, so that poses are rational if cosine and sine are.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        body, other = (BODIES[rng.integers(len(BODIES))] * rng.choice([0.5, 1, 2])
                       + rng.integers(-24, 25, 2) / 8 for _ in range(2))
        centre = rng.integers(-16, 17, 2) / 8 * rng.choice([0, 1, 8])
        omega = rng.choice([-1, 1]) * rng.choice([0.125, 0.5, 1, 4])
        origin, yaw = rng.uniform(-3, 3, 2), rng.uniform(-4, 4)
        vx, vy = omega * np.array([centre[1] - origin[1], origin[0] - centre[0]])
        c, s = math.cos(yaw), math.sin(yaw)
        yield body, centre, omega, (*origin, yaw), (c * vx + s * vy, c * vy - s * vx, omega), other


@pytest.mark.parametrize('tolerance, count', [(1e-3, 100), *(
    pytest.param(tolerance, 400, marks=pytest.mark.long) for tolerance in (1e-3, 1e-6))])
def test_arcs_against_dense_rational_poses(tolerance, count):
    """
    Times are never late, and within the tolerance of contact.

    There are 1024 rational poses per turn, computed in integers.
    """
    outcomes = {'never': 0, 'start': 0, 'later': 0, 'between samples': 0}
    cosine, sine = PARTS ** 2 - STEPS ** 2, 2 * PARTS * STEPS
    for body, centre, omega, pose, twist, other in arcs(int(1e6 * tolerance), count):
        horizon = 5.0 / abs(omega)
        time = time_to_contact(body, twist, [other], horizon, pose=pose, tolerance=tolerance)
        sampled = []
        for quarter in range(4):
            c, s = ((cosine, sine), (-sine, cosine), (-cosine, -sine), (sine, -cosine))[quarter]
            times = (quarter * math.pi / 2 + 2 * np.arctan(STEPS / PARTS)) / abs(omega)
            sampled += [(t, 8 * turned(body, centre, c[k], math.copysign(1, omega) * s[k]),
                         8 * (other - centre) * (PARTS ** 2 + k ** 2))
                        for k, t in enumerate(times.tolist()) if t <= horizon]
        touching, _ = oracle.intersects_pairs([pair for _, *pair in sampled])
        first = sampled[touching.argmax()][0] if touching.any() else math.inf
        assert (time == 0.0) == (first == 0.0) == intersects(body, other)
        assert time <= first * (1.0 + 1e-15)
        if 0.0 < time < math.inf:
            there = centre + turned(body, centre, math.cos(omega * time), math.sin(omega * time))
            acceleration = abs(omega) * (math.hypot(*twist[:2]) + abs(omega) * np.hypot(
                *(body - pose[:2]).T).max())
            bound = max(tolerance, 2.0 ** -25 * acceleration * horizon ** 2)
            assert 0.0 < separation(there, other) + 1e-12 <= bound
        outcomes['never' if time == math.inf else 'start' if time == 0.0 else
                 'later' if first < math.inf else 'between samples'] += 1
    assert min(outcomes['never'], outcomes['start'], outcomes['later']) > count / 20, outcomes
    assert tolerance < 1e-3 or outcomes['between samples'] > 0


def posed(body, twist, time):
    """Return a body after a time, by the exponential map of its twist about (0, 0)."""
    vx, vy, omega = twist
    turned = np.expm1(1j * omega * time)
    along = turned / (1j * omega) if omega else time
    place = (1.0 + turned) * (body @ [1, 1j]) + along * complex(vx, vy)
    return np.column_stack([place.real, place.imag])


def within(margin, body, twist, other, velocities=None):
    contact = PolygonSet([other]).first_contact(body, twist, 3.0, velocities, margin=margin)
    return contact[1] if contact else math.inf


@pytest.mark.parametrize('margin, count, samples', [
    (0.0, 120, 15), (1e-9, 20, 15), (0.1, 20, 15), (1.0, 40, 15),
    *(pytest.param(margin, 120, 60, marks=pytest.mark.long) for margin in (0.0, 1e-9, 0.1, 1.0))])
def test_first_contact_among_moving_bodies(margin, count, samples):
    """
    Never late, and early by no more than the tolerance.

    Samples before it are nearer than the margin by no more than rounding.
    """
    rng = np.random.default_rng(3)
    found = 0
    for k in range(count):
        body = BODIES[k % len(BODIES)]
        twist = (*rng.uniform(-2, 2, 2), rng.choice([0.0, 1e-9, 0.3, -3.0]))
        others = [BODIES[rng.integers(len(BODIES))] + rng.uniform(-9, 9, 2) for _ in range(12)]
        velocities = rng.uniform(-1, 1, (12, 2)) * (k % 3)
        contact = PolygonSet(others).first_contact(body, twist, 3.0, velocities, margin=margin)
        row, time = contact or (-1, math.inf)
        assert (time == 0.0) == (min(separation(body, other) for other in others) <= margin)
        for t in np.linspace(0.0, min(time, 3.0), samples)[:-1 if time else 0].tolist():
            there = posed(body, twist, t)
            assert min(separation(there, other + t * v)
                       for other, v in zip(others, velocities)) > margin - 1e-12
        if 0.0 < time < math.inf:
            found += 1
            assert separation(posed(body, twist, time), others[row] + time * velocities[row]) <= (
                margin + (1e-3 if twist[2] else 1e-10))
        alone = [within(margin, body, twist, other, [v]) for other, v in zip(others, velocities)]
        assert time == min(alone) and (row < 0 or alone[row] == time)
    assert found > count / 5


@pytest.mark.parametrize('omega', [0.0, 1e-9, 0.3, -4.0, 200.0])
def test_contact_at_the_horizon_is_found(omega):
    """A vertex is then 1e-10 m inside a box, which is at rest or moves."""
    rng = np.random.default_rng(7)
    before = 0
    for k in range(150):
        body = BODIES[k % len(BODIES)] - rng.uniform(0, 2, 2)
        twist, own = (*rng.uniform(-2, 2, 2), omega), rng.uniform(-1, 1, 2) * (k % 2)
        horizon = rng.uniform(0.1, 3.0) / max(abs(omega), 1.0)
        vertex = posed(body, twist, horizon)[rng.integers(len(body))]
        inside = rng.choice([-1, 1]) * (0.15 - 1e-10), rng.uniform(-0.1, 0.1)
        box = 0.3 * (BOX - 0.5) + vertex + inside - horizon * own
        time = time_to_contact(body, twist, [box], horizon, [own])
        assert time <= horizon
        before += time < 0.99 * horizon
    assert before < 140, before


@pytest.mark.parametrize('omega', [0.0, 1e-12, 0.3, -4.0])
@pytest.mark.parametrize('tolerance', [1e-3, 1e-6])
def test_excluding_obstacles_beside_the_path_changes_nothing(omega, tolerance):
    """
    Bit by bit, however near they are, and if the centre of rotation is in a body.

    Obstacles with any velocity are not excluded.
    """
    rng = np.random.default_rng(5)
    met = {True: 0, False: 0}
    for k in range(150):
        body = BODIES[k % len(BODIES)] - [0.5, rng.choice([0.0, 0.5])]
        twist = (rng.choice([0.0, 1.0, rng.uniform(-2, 2)]), rng.choice([0.0, 0.5]), omega)
        beside = []
        for _ in range(6):
            there = posed(body, twist, rng.uniform(0, 3))
            off = rng.normal(0, rng.choice([1e-4, 0.02, 1]), 2)
            corner = there[rng.integers(len(there))] + off
            beside.append(0.3 * BODIES[rng.integers(len(BODIES))] + corner)
        for others in ([other] for other in beside):
            time = time_to_contact(body, twist, others, 3.0, tolerance=tolerance)
            assert time == time_to_contact(body, twist, others, 3.0, [(1e-300, 0)],
                                           tolerance=tolerance) or not any(twist)
            met[time < math.inf] += 1
    assert min(met.values()) > 100, met


def test_margin():
    assert within(1.0, BAR, (2, 0, 0), [(4, 0.6)]) == pytest.approx(1.1, abs=1e-12)
    assert within(1.0, BAR, (2, 0, 0), [(4, 1)]) == pytest.approx(1.5)
    assert within(1.0, BAR, (2, 0, 0), [(4, 1.001)]) == math.inf
    for margin in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match=f'margin {margin}'):
            within(margin, BAR, (2, 0, 0), [(4, 1)])


def test_straight_motion_of_non_convex_bodies():
    """Compared with `time_of_contact`."""
    rng = np.random.default_rng(4)
    met = 0
    for _ in range(200):
        body, other = (BODIES[4 + rng.integers(2)] + rng.uniform(-4, 4, 2) for _ in range(2))
        twist = (*rng.uniform(-3, 3, 2), 0.0)
        expected = time_of_contact(body, body + 2.0 * np.array(twist[:2]), other, other, 1e-12)
        time = time_to_contact(body, twist, [other], 2.0)
        assert time == pytest.approx(2.0 * or_never(expected), abs=1e-9)
        met += 0.0 < time < math.inf
    assert met > 30


@pytest.mark.parametrize('name', ['hair_gaps', 'one_ulp', 'edge_on_edge', 'vertex_on_edge',
                                  'points_and_segments', 'notched'])
def test_bodies_at_rest_are_decided_exactly(name):
    """Without a twist or a horizon."""
    times = set()
    for a, b in families.ALL[name](np.random.default_rng(6), 60, 7):
        expected = 0.0 if intersects(a, b) else math.inf
        assert time_to_contact(a, (0, 0, 0), [b], 3.0) == expected
        assert time_to_contact(a, (1, 2, 3), [b], 0.0) == expected
        assert (time_to_contact(a, (1, 2, 3), [b], 1.0) == 0.0) == (expected == 0.0)
        times.add(expected)
    assert times == {0.0, math.inf}


@pytest.mark.parametrize('twist, obstacle, expected', [
    ((2, 0, 0), (4, 0), 1.5),
    ((2, 0, 0), (7, 0), 3.0),
    ((2, 0, 0), (7.001, 0), math.inf),
    ((2, 0, 0), (4, 1e-9), math.inf),
    ((-2, 0, 0), (4, 0), math.inf),
    ((0, 0, 1), (0, 1), math.pi / 2),
    ((0, 0, -1), (0, -1), math.pi / 2),
    ((0, 0, 1), (0, 1.002), math.inf),
    ((0, 0, 1), (-0.5, -0.5), math.inf),
    ((0, 0, 2), (-0.5, -0.5), 5 * math.pi / 8),
    ((0, 2, 1), (-2, 2.5), math.pi / 2),
    ((0, 2, 1), (-2, 3.002), math.inf),
    ((0, 0, 100), (-1, 0), math.pi / 100),
], ids=['ahead', 'at the horizon', 'beyond it', 'beside', 'behind', 'left', 'right',
        'out of reach', 'too late', 'most of a turn', 'about a centre', 'outside that arc',
        'fast'])
def test_bar(twist, obstacle, expected):
    """From (0, 0) to (1, 0)."""
    time = time_to_contact(BAR, twist, [[obstacle]], 3.0)
    assert expected - (4e-3 / abs(twist[2]) if twist[2] else 1e-9) <= time <= expected or (
        time == expected)


def test_contact_between_an_arc_and_its_chord():
    """The tip touches in the middle of a piece of 0.1 rad."""
    for quarter in range(4):
        turn = 1j ** quarter
        tip, post = turn * np.exp(-0.05j), 0.9999 * turn
        time = time_to_contact([(0, 0), (tip.real, tip.imag)], (0, 0, 1),
                               [[(post.real, post.imag)]], 3.0, tolerance=1e-5)
        assert 0.05 - 2e-5 <= time <= 0.05


def test_very_fast_rotation():
    """Bodies within reach count, bodies beyond the bound do not."""
    assert 0.0 < time_to_contact(BAR, (0, 0, 1e5), [[(-0.9, 0)]], 3.0) <= math.pi / 1e5
    assert time_to_contact(BAR, (0, 0, 1e5), [[(1e9, 0)]], 3.0) == math.inf


@pytest.mark.parametrize('exponent, slower', [
    (-900, 0), (-200, 0), (200, 0), (900, 0), (0, -900), (0, 900), (-400, -500), (-400, 500),
    (400, -500), (400, 500)])
def test_scale_does_not_matter(exponent, slower):
    """Of lengths and of time, bit by bit, if the tolerance scales, too."""
    for body, _, omega, pose, twist, other in arcs(8, 60):
        scaled = [np.ldexp(one, exponent) for one in (body, other)]
        move = np.ldexp(twist, [exponent - slower, exponent - slower, -slower])
        place = np.ldexp(pose, [exponent, exponent, 0])
        tolerance = math.ldexp(1e-3, exponent)
        assert time_to_contact(scaled[0], move, scaled[1:], math.ldexp(3.0, slower), pose=place,
                               tolerance=tolerance) == math.ldexp(
            time_to_contact(body, twist, [other], 3.0, pose=pose), slower)


def test_never_late_for_the_least_turns():
    """Products with subnormal numbers are wrong by much more than an ulp."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        horizon = rng.uniform(0.5, 4.0) * 10.0 ** rng.integers(-3, 4)
        omega = 5e-324 * rng.integers(1, 2 ** 12) * rng.choice([-1, 1])
        speed, share = rng.uniform(0.5, 2.0), rng.uniform(0.05, 0.99)
        ahead = speed * horizon * share
        time = time_to_contact([(0, 0)], (speed, 0, omega), [[(ahead, -1), (ahead, 1)]], horizon)
        assert time <= ahead / speed * (1 + 1e-15)
        assert time >= (ahead - 1e-9 * horizon) / speed


def test_least_ways_are_not_lost():
    """A way below the least double may end at a body that is nearer than that, too."""
    assert time_to_contact([(0, 0)], (1e-300, 0, 0), [[(5e-324, 0)]], 1e-30) == 5e-324
    assert time_to_contact([(0, 0), (5e-324, 0)], (0, 0, 1e-9), [[(5e-324, 5e-324)]], 1.0) <= 1.0
    assert time_to_contact([(0, 0)], (1.0, 0, 0), [[(1e-30, 0)]], 1e300) <= 1e-30


@pytest.mark.parametrize('factor', [1e-300, 1e150, 1e300])
def test_huge_and_tiny_values(factor):
    """Contacts are found."""
    wall = factor * (BOX + [2, -0.5])
    for twist in ((0, 0, 1), (0, 0, 1e-300), (factor, 0, 0), (factor, 0, 1)):
        time = time_to_contact(factor * BAR, twist, [wall], 9.0)
        assert (time == math.inf) == (twist[0] == 0.0 or (factor, 0, 1) == twist)
    near = time_to_contact(factor * BAR, (0, 0, 1), [[(0, factor)]], 9.0, tolerance=5e-324)
    assert 1.5 < near <= math.pi / 2
    assert time_to_contact(factor * BAR, (0, 0, -1e-9), [[(factor, -1e-9 * factor)]], 9.0) <= 1.0


def test_wall_that_is_long_beyond_measure():
    """Its end is nearest at first, and no further than the wall's line, up to rounding."""
    body = np.array([(0.254, -0.326), (-1.0, 0.0043)])
    wall = [(0.019, 0.0328), (5.0325e7, 2.6552e7)]
    x, y, omega = twist = 0.017, 0.009, 3.7555
    time = time_to_contact(body, twist, [wall], 1.0)
    angle = omega * time
    c, s = math.cos(angle), math.sin(angle)
    ahead, aside = s / omega, (1.0 - c) / omega
    moved = body @ [(c, s), (-s, c)] + (ahead * x - aside * y, aside * x + ahead * y)
    assert 0.0 < separation(moved, wall) < 1e-3


def test_far_from_the_origin():
    """The pose of the base frame is the centre of rotation of a footprint in UTM."""
    east, north = 447_000.0, 5_411_000.0
    body = BOX + [east, north]
    post = [[(east - 0.4, north + 1.2)]]
    here = time_to_contact(BOX, (0.5, 0, 1), [[(-0.4, 1.2)]], 3.0)
    there = time_to_contact(body, (0.5, 0, 1), post, 3.0, pose=(east, north, 0.0))
    assert 0.0 < here < math.inf and there == pytest.approx(here, abs=1e-3)


def test_removed_rows_are_ignored():
    """Although they have a velocity."""
    rows = PolygonSet([[(3, 0)], [(5, 0)], [(5, 0), (5, 1)]])
    rows.remove(0)
    assert rows.first_contact(BAR, (1, 0, 0), 9.0) == (1, pytest.approx(4.0))
    assert rows.first_contact(BAR, (1, 0, 0), 9.0, [(0, 0), (1, 0), (-1, 0)]) == (
        2, pytest.approx(2.0))
    assert rows.first_contact(BAR, (0, 1, 0), 9.0) is None
    assert PolygonSet().first_contact(BAR, (1, 0, 0), 9.0) is None


@pytest.mark.parametrize('body, twist, post, velocity', [
    ([(0, 0), (1e300, 0)], (0, 0, 1e10), (0, 1e300), (0, 0)),
    ([(0, 0), (1.5e308, 0)], (0, 0, 3), (0, 1e300), (0, 0)),
    ([(0, 0), (1.5e308, 0)], (1.5e308, 0, 0), (1.7e308, 0), (0, 0)),
    ([(-1.7e308, 0)], (1e300, 0, 0), (1.7e308, 0), (0, 0)),
    (BAR, (1, 0, 0), (5, 0), (1.5e308, 0)),
], ids=['turn', 'arm', 'way', 'between', 'obstacle'])
def test_what_is_beyond_the_largest_double_is_refused(body, twist, post, velocity):
    """At 1e-8 of it all is well."""
    with pytest.raises(ValueError, match='beyond the largest double'):
        time_to_contact(body, twist, [[post]], 1.0, [velocity])
    smaller = [np.multiply(one, 1e-9) for one in (body, post, velocity, twist[:2])]
    time_to_contact(smaller[0], (*smaller[3], min(twist[2], 3)), [smaller[1:2]], 1.0, smaller[2:3])


@pytest.mark.parametrize('change, words', [
    ({'twist': (1, 0)}, 'twist .*three finite numbers: vx and vy in m/s, omega in rad/s'),
    ({'twist': (1, 0, math.nan)}, 'twist .*three finite numbers'),
    ({'twist': (1e300, 0, 0), 'horizon': 1e9}, 'twist .*beyond the largest double'),
    ({'twist': (0, 0, 1e300), 'horizon': 1e9}, 'twist .*beyond the largest double'),
    ({'pose': (1, 0)}, 'pose .*x and y in metres, yaw in rad'),
    ({'pose': (1, math.inf, 0)}, 'pose .*three finite numbers'),
    *(({'horizon': value}, f'horizon {value}') for value in (-1.0, math.nan, math.inf)),
    *(({'tolerance': value}, f'tolerance {value}') for value in (0.0, math.nan)),
    ({'velocities': (1, 0)}, r'velocities of shape \(2,\), but for 2 rows'),
    ({'velocities': [(1, 0)]}, r'velocities of shape \(1, 2\), but for 2 rows'),
    ({'velocities': [(1, 0), (0, math.nan)]}, 'velocity 1 is not finite'),
    ({'velocities': [(1, 0), (10**400, 0)]}, 'a velocity is beyond the largest double'),
    *(({name: value}, f'(?s){name} .* three finite numbers') for name in ('twist', 'pose')
      for value in ((0, 10**400, 0), ('1', '0', '0'), (True, False, False), (1j, 0, 0),
                    np.ma.masked_equal((1.0, 0, 0), 1))),
    *(({'velocities': [value] * 2}, f'velocities are not numbers but {kind}') for value, kind in (
        (('1', '0'), 'str'), ((True, False), 'bool'), ((1j, 0), 'complex128'))),
    ({'velocities': np.ma.masked_equal([(1.0, 0)] * 2, 1)}, 'velocities are a masked array'),
    *(({name: 10**400}, f'{name} .* finite') for name in ('horizon', 'tolerance')),
    ({'footprint': []}, 'no points'),
])
def test_invalid_arguments_are_refused(change, words):
    """With and without near obstacles."""
    given = {'footprint': BOX, 'twist': (1, 0, 0), 'horizon': 1.0}
    for obstacles in ([BOX + 9, BAR + 9], [BOX, BOX]):
        with pytest.raises(PolygonError if 'footprint' in change else ValueError, match=words):
            time_to_contact(**{**given, 'obstacles': obstacles, **change})


def test_no_velocities_of_no_obstacles():
    assert time_to_contact(BOX, (1, 0, 0), [], 1.0, []) == math.inf

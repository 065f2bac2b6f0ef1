# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Times of contact of moving bodies, against dense exact samples and simple cases."""

import math

import families
import numpy as np
import oracle
import pytest
from sat_collision import intersects, Polygon, PolygonError, separation, time_of_contact
import shapes
from shapes import PLUS

TOLERANCE = 1e-6
BOX = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
U = shapes.comb(2)
ROUND = shapes.hull(np.rint(8 * shapes.regular(np.random.default_rng(0), 1, 40)[0])) / 8
BODIES = [BOX[:1], BOX[:2], BOX[:3], BOX, U, PLUS, ROUND]
# Exact in doubles: all coordinates are multiples of 2^-9, all times of 2^-7.
TIMES = np.arange(129) / 128


def poses(start, end, times=TIMES):
    """Return the vertices at a time, (n, 2), or at each of some times, (times, n, 2)."""
    return start + np.multiply.outer(times, end - start)


def similar(rng, body):
    """Return a body on the lattice, and the same after rotation, scaling and translation."""
    body = body * rng.choice([1, 4, 8, 16]) / 16
    c, s = rng.integers(-3, 5), rng.integers(-4, 5)
    turned = np.column_stack([body[:, 0] * c - body[:, 1] * s, body[:, 0] * s + body[:, 1] * c])
    place = rng.integers(-32, 33, 2) / 8
    return body + place, turned / 4 - place + rng.integers(-8, 9, 2) / 8


def pairs(seed, count):
    """Yield starts and ends of two bodies each, (a0, a1, b0, b1); some of the latter rest."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        a = similar(rng, BODIES[rng.integers(len(BODIES))])
        b = similar(rng, BODIES[rng.integers(len(BODIES))])
        yield (*a, b[0], b[0] if rng.random() < 0.2 else b[1])


def outline_distance(a, b):
    """Return the distance of two outlines that do not cross."""
    least = math.inf
    for points, ring in ((a, b), (b, a)):
        along = np.roll(ring, -1, axis=0) - ring
        to = points[:, None] - ring
        size = np.maximum((along ** 2).sum(axis=1), 5e-324)
        share = np.clip((to * along).sum(axis=2) / size, 0, 1)
        least = min(least, np.hypot(*(to - share[..., None] * along).T).min())
    return least


def test_random_motion_against_dense_samples():
    """
    No contact is missed or late, and none is found where bodies are not near.

    Bodies of all kinds rotate, grow, shrink or are at rest.
    """
    outcomes = {None: 0, 'start': 0, 'later': 0, 'between samples': 0}
    for a0, a1, b0, b1 in pairs(1, 3000):
        time = time_of_contact(a0, a1, b0, b1)
        touching, _ = oracle.intersects_pairs(list(zip(poses(a0, a1), poses(b0, b1))))
        first = TIMES[touching.argmax()] if touching.any() else None
        assert (time == 0.0) == bool(touching[0]) == intersects(a0, b0)
        if time is None:
            assert first is None
            outcomes[None] += 1
            continue
        assert 0.0 <= time <= 1.0
        assert first is None or time <= first
        outcomes['between samples' if first is None else 'later' if time else 'start'] += 1
        if time:
            assert outline_distance(poses(a0, a1, time), poses(b0, b1, time)) <= TOLERANCE
    assert min(outcomes.values()) > 10, outcomes


def test_order_of_bodies_and_vertices_does_not_matter():
    """Bit by bit for bodies, within the tolerance for vertices."""
    for a0, a1, b0, b1 in pairs(2, 300):
        time = time_of_contact(a0, a1, b0, b1)
        assert time_of_contact(b0, b1, a0, a1) == time
        again = time_of_contact(np.roll(a0[::-1], 2, axis=0), np.roll(a1[::-1], 2, axis=0), b0, b1)
        assert (again is None) is (time is None)
        assert time is None or again == pytest.approx(time, abs=TOLERANCE)


def test_reversed_motion():
    """It has contact if the motion has, and first where the motion has last."""
    met = 0
    for a0, a1, b0, b1 in pairs(3, 300):
        there, back = time_of_contact(a0, a1, b0, b1), time_of_contact(a1, a0, b1, b0)
        assert (there is None) is (back is None)
        if there is not None:
            met += 1
            assert there <= 1.0 - back + TOLERANCE
    assert 30 < met < 270


@pytest.mark.parametrize('offset', [2.0 ** 22, -2.0 ** 40])
def test_offset_from_the_origin_does_not_matter(offset):
    """Bit by bit, if coordinates are exact."""
    for way in pairs(4, 100):
        assert time_of_contact(*(pose + [offset, -offset] for pose in way)) == (
            time_of_contact(*way))


@pytest.mark.parametrize('exponent', [-1060, -1022, -900, -200, 200, 900, 1018])
def test_scale_does_not_matter(exponent):
    """Bit by bit, if the tolerance scales, too."""
    tolerance = 2.0 ** -14
    for way in pairs(5, 100):
        scaled = [np.ldexp(pose, exponent) for pose in way]
        assert time_of_contact(*scaled, math.ldexp(tolerance, exponent)) == (
            time_of_contact(*way, tolerance))


@pytest.mark.parametrize('a, move, b, expected', [
    (BOX, (4, 0), BOX + [2.5, 0], 3 / 8),
    (BOX, (4, 0), BOX + [2.5, 1], 3 / 8),
    (BOX, (4, 0), BOX + [2.5, 1.001], None),
    (BOX, (4, 4), BOX + [3, 3], 1 / 2),
    (BOX, (4, -4), BOX + [3, -3], 1 / 2),
    (BOX, (0, 8), BOX + [0, 9], 1.0),
    (BOX, (0, 8), BOX + [0, 9.001], None),
    (BOX, (-4, 0), BOX + [2, 0], None),
    (BOX, (-4, 0), BOX + [1, 0], 0.0),
    (BOX, (0, 0), BOX + [1, 1], 0.0),
    (U, (0, 0), BOX + [0.5, 0.5], 0.0),
    (BOX[:1], (8, 0), [(3, 0)], 3 / 8),
    (BOX[:1], (8, 1), [(3, 0)], None),
    (BOX[:2], (0, 4), [(0.5, 3)], 3 / 4),
    (BOX[:2], (8, 0), [(6, 0)], 5 / 8),
    (BOX[:2], (8, 0), [(6, -1), (6, 1)], 5 / 8),
    (BOX[:1], (10, 0), [(4, -1), (4.001, -1), (4.001, 1), (4, 1)], 0.4),
    (0.5 * BOX + [1.25, 8], (0, -8), U, 7 / 8),
    (0.5 * BOX + [1.25, 8], (0, -6.9), U, None),
    (0.5 * BOX + [1.25, 1.5], (4, 0), U, 1 / 16),
], ids=['boxes', 'along an edge', 'past it', 'corner to corner', 'down', 'at the end', 'not quite',
        'away', 'away from contact', 'at rest in contact', 'at rest inside', 'points', 'past',
        'edge to point', 'end to point', 'crossbar', 'thin wall', 'into a U', 'not to its end',
        'to its side'])
def test_translations(a, move, b, expected):
    """Also if the common frame moves."""
    b = np.array(b, float)
    for frame in ((0, 0), (-16, 8)):
        time = time_of_contact(a, a + np.add(move, frame), b, b + frame)
        assert time == expected or time == pytest.approx(expected, rel=1e-12)


def test_bars_pass_posts_at_about_the_tolerance():
    """Contact is found below the tolerance, and none beyond it."""
    rng = np.random.default_rng(8)
    outcomes = {'met': 0, 'near': 0, 'passed': 0}
    for beyond in np.concatenate([rng.uniform(-3, 3, 200), rng.uniform(0.99, 1.01, 100)]):
        length, turned = rng.uniform(0.5, 5), rng.uniform(0.1, 2)
        middle = rng.uniform(-math.pi, math.pi)
        tips = [length * np.array([math.cos(middle + sign * turned / 2),
                                   math.sin(middle + sign * turned / 2)]) for sign in (-1, 1)]
        bar = [[(0, 0), tip] for tip in tips]
        reach = length * math.cos(turned / 2) + TOLERANCE * beyond
        post = [(reach * math.cos(middle), reach * math.sin(middle))]
        time = time_of_contact(*bar, post, post)
        if beyond < 0.0 or time is not None:
            assert beyond < 1.0 + 1e-6 and time <= 0.5 + TOLERANCE
            assert outline_distance(poses(*np.array(bar), time), np.array(post)) <= TOLERANCE
        outcomes['met' if beyond < 0.0 else 'passed' if time is None else 'near'] += 1
    assert min(outcomes.values()) > 10, outcomes


def test_pass_within_the_tolerance_is_a_contact():
    """Unless one axis proves the whole motion clear, as beside a straight wall."""
    wall = [(-9, 0), (9, 0)]
    assert time_of_contact(BOX + [-5, 1e-9], BOX + [5, 1e-9], wall, wall) is None
    bar, post = ([(0, 0), (1, 0)], [(0, 0), (0, 1)]), [(0.5 + 1e-7, 0.5 + 1e-7)]
    assert time_of_contact(*bar, post, post) == pytest.approx(0.5, abs=3 * TOLERANCE)
    assert time_of_contact(*bar, post, post, 1e-8) is None


def test_random_motion_within_a_margin():
    outcomes = {None: 0, 0.0: 0, 'later': 0}
    for k, (a0, a1, b0, b1) in enumerate(pairs(6, 300)):
        margin = (0.05, 0.3, 1.0)[k % 3]
        time = time_of_contact(a0, a1, b0, b1, margin=margin)
        times = TIMES[::8] if time is None else TIMES[::8][TIMES[::8] < time]
        for a, b in zip(poses(a0, a1, times), poses(b0, b1, times)):
            assert separation(a, b) > margin
        outcomes['later' if time else time] += 1
        if time is not None:
            assert separation(poses(a0, a1, time), poses(b0, b1, time)) <= margin + TOLERANCE
    assert min(outcomes.values()) > 10, outcomes


def test_end_of_a_nearly_parallel_wall():
    """Bodies are near at the returned time, however late the gap would close."""
    for end in np.arange(60, 105, 0.03):
        wall = [(-9, 0), (end, 0)]
        time = time_of_contact([(0, 1e-10)], [(1000, -9e-10)], wall, wall)
        assert time is None or 1000 * time <= end + TOLERANCE


def test_tolerance():
    times = [time_of_contact([(0, 0), (1, 0)], [(0, 0), (0, 1)], [(0.3, 0.3)], [(0.3, 0.3)], by)
             for by in (0.1, 1e-3, 1e-6, 1e-12)]
    errors = 0.5 - np.array(times)
    assert (errors >= 0).all() and (np.diff(errors) <= 0).all()
    assert (errors <= [0.2, 2e-3, 2e-6, 2e-12]).all()


@pytest.mark.parametrize('name', ['hair_gaps', 'one_ulp', 'edge_on_edge', 'vertex_on_edge', 'near',
                                  'points_and_segments', 'notched', 'interlocked_combs'])
def test_bodies_at_rest_are_decided_exactly(name):
    """Whatever the tolerance."""
    times = set()
    for a, b in families.ALL[name](np.random.default_rng(6), 100, 7):
        time = time_of_contact(a, a, b, b, 1.0)
        assert time == (0.0 if intersects(a, b) else None)
        times.add(time)
    assert name == 'interlocked_combs' or times == {None, 0.0}


def test_contact_at_the_start_is_decided_exactly():
    """Tiny gaps give a time above 0 if bodies approach, and none if they part."""
    for gap in (5e-324, 1e-17, 1e-12, 1e-7):
        assert 0.0 < time_of_contact([(0, 0)], [(1, 1)], [(gap, gap)], [(gap, gap)]) < 2e-7
        assert time_of_contact([(0, 0)], [(-1, -1)], [(gap, 0)], [(gap, 0)]) is None
    tilted = BOX @ np.array([(3, 4), (-4, 3)])
    for seed in range(50):
        rng = np.random.default_rng(seed)
        corner = rng.uniform(0.1, 0.9) * np.array([3.0, 4.0])
        corner += rng.integers(-2, 3, 2) * np.spacing(corner)
        body = corner + [(0, 0), (4, -3), (5, 1)]
        for move in ((-1, 2), (4, -3), (0, 0)):
            time = time_of_contact(tilted, tilted, body, body + move)
            assert (time == 0.0) is intersects(tilted, body)


EXTENDED = np.array([(0, 0), (4, 0), (4, 1), (7, 1), (7, 2), (4, 2), (4, 3), (0, 3)], float)
RETRACTED = np.where(EXTENDED == 7, 4, EXTENDED)


def test_extending_arm():
    """Retracted, its vertices are collinear, so the body is decomposed as extended."""
    with pytest.raises(PolygonError):
        Polygon(EXTENDED[[0, 1, 5, 2, 3, 4, 6, 7]])
    beside, ahead = BOX + [5, 2.25], BOX + [5.5, 1.25]
    for start, end in ((RETRACTED, EXTENDED), (EXTENDED, RETRACTED)):
        assert time_of_contact(start, end, beside, beside) is None
    assert time_of_contact(RETRACTED, EXTENDED, ahead, ahead) == 0.5
    assert time_of_contact(EXTENDED, RETRACTED, ahead, ahead) == 0.0


def winds_around(ring, point):
    """Tell whether an outline of integers goes around or through an integer point."""
    turns = 0
    for p, q in zip(ring, np.roll(ring, -1, axis=0).tolist()):
        side = oracle.orientation(p, q, point)
        if side == 0 and all(min(p[k], q[k]) <= point[k] <= max(p[k], q[k]) for k in (0, 1)):
            return True
        turns += (p[1] <= point[1] < q[1] and side > 0) - (q[1] <= point[1] < p[1] and side < 0)
    return turns != 0


def test_deforming_body():
    """Each vertex has its own motion: the outline may cross itself."""
    rng = np.random.default_rng(7)
    met = bent = 0
    while bent < 300:
        shape = (U, PLUS, EXTENDED, RETRACTED, families.SIMPLE['notched'])[rng.integers(4)]
        start, end = (2 * shape + rng.integers(-1, 2, shape.shape) * rng.integers(0, 2)
                      for _ in range(2))
        try:
            bodies = Polygon(start), Polygon(end)
        except PolygonError:
            continue
        bent += not all(body.is_convex for body in bodies)
        point = rng.integers(-2, 14, 2)
        time = time_of_contact(start, end, [point], [point])
        # Times 16 all coordinates are integers.
        for k, ring in enumerate(poses(16 * start, 16 * end, TIMES[::8]).astype(int).tolist()):
            if winds_around(ring, (16 * point).tolist()):
                assert time is not None and time <= k / 16
                met += 1
                break
    assert 30 < met


def test_decomposition_fills_the_recess_of_a_deforming_body():
    """Decomposed as at its end, it covers its recess at the start."""
    recessed = [(0, 0), (8, 0), (8, 4), (6, 2.5), (4, 1), (2, 2.5), (0, 4)]
    ridged = [(0, 0), (8, 0), (8, 4), (6, 1), (4, 4), (2, 1), (0, 4)]
    for angle in np.arange(16) * np.pi / 8:
        end = [(4 + 9 * math.cos(angle), 2 + 9 * math.sin(angle))]
        assert not intersects(recessed, [(4, 2)])
        assert time_of_contact(recessed, ridged, [(4, 2)], end) == 5e-324
    assert time_of_contact(recessed, ridged, [(4, 3)], [(4, 3)]) == 2 / 3


def test_vertex_on_a_cut():
    """It moves the boundary of a part of which it is no corner."""
    start = [(0, 2), (1, 1), (3, 1), (3, 3), (2, 2)]
    end = [*start[:-1], (1.5, 3.5)]
    time = time_of_contact(start, end, [(2, 2.5)], [(2, 2.5)])
    assert time == pytest.approx(2 / 7, abs=TOLERANCE)


def test_repeated_and_collinear_vertices_move():
    """A superfluous vertex at time 0 may be needed later."""
    start = [(0, 0), (2, 0), (2, 0), (2, 2), (1, 2), (0, 2)]
    end = [(0, 0), (2, 0), (6, 0), (2, 2), (1, 6), (0, 2)]
    assert time_of_contact(start, end, [(4, 0)], [(4, 0)]) == 0.5
    assert time_of_contact(start, end, [(1, 4)], [(1, 4)]) == 0.5
    assert time_of_contact([(0, 0)] * 4, BOX, [(0.5, 0.5)], [(0.5, 0.5)]) == 0.5
    for k in range(len(U)):
        middle, along = (U[k - 1] + U[k]) / 2, U[k] - U[k - 1]
        out = 0.25 * np.array([along[1], -along[0]]) / np.hypot(*along)
        start, end = (np.insert(U, k, middle + by * out, axis=0) for by in (0, 2))
        assert time_of_contact(start, end, [middle + out], [middle + out]) == 0.5
    recessed = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 1), (0, 1), (0, 0.5)]
    grown = [(0, 0), (4, 0), (4, 4), (2, 1), (0, 1), (-2, 1), (-2, 0.5)]
    assert time_of_contact(recessed, grown, [(-1, 0.75)], [(-1, 0.75)]) == 0.5


@pytest.mark.parametrize('name', families.EXTREME)
def test_overflow_and_underflow(name):
    """Contact at either end is found."""
    for a, b in families.EXTREME[name](np.random.default_rng(8), 40, 7):
        for start, end in ((a, a + b[0]), (a + b[0], a)):
            if np.isfinite([start, end]).all():
                time = time_of_contact(start, end, b, b)
                assert (time == 0.0) is intersects(start, b)
                assert time is not None or not intersects(end, b)
    far, origin = [(1.7e308, 1.7e308)], [(0, 0)]
    assert time_of_contact(origin, origin, far, origin) is not None


@pytest.mark.parametrize('arguments, error, words', [
    ((BOX, BOX[:3], BOX, BOX), ValueError, '4 vertices at time 0, but 3 at time 1'),
    ((BOX, BOX, BOX, [(0, np.nan)] * 4), PolygonError, 'not finite'),
    ((BOX, BOX[[0, 2, 1, 3]], BOX, BOX), PolygonError, 'meets the edge'),
    ((BOX, BOX, [], []), PolygonError, 'no points'),
    *((4 * (BOX,) + (value,), ValueError, f'tolerance {value}')
      for value in (0.0, np.nan, np.inf)),
    *((4 * (BOX,) + (1.0, value), ValueError, f'margin {value}')
      for value in (-1.0, np.nan, np.inf)),
])
def test_invalid_arguments_are_refused(arguments, error, words):
    """With and without near bodies."""
    with pytest.raises(error, match=words):
        time_of_contact(*arguments)

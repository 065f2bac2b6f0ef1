# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Where paths first meet obstacles, against shapely at many places and exact integers at poses."""

import argparse
from collections import Counter
from functools import partial
import math
from multiprocessing import Pool

import numpy as np
import oracle
import pytest
from sat_collision import first_contact_along, PathContact, Polygon, PolygonSet, separation
import shapes

BOX = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
BAR = BOX[:2]
L = np.array([(0, 0), (2, 0), (2, 0.5), (0.5, 0.5), (0.5, 2), (0, 2)])
_BODIES = [BOX[:1], BAR, BOX[:3], BOX, L, shapes.comb(2) / 4, shapes.star(5) / 4]
_NEAR = 1e-3 + 1e-9
TOGETHER = 1000


def place(points, x, y, yaw):
    """Return points of a body at a pose, rounded as documented."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([(a * c - b * s + x, a * s + b * c + y) for a, b in points])


def pose_at(poses, number):
    """Return the pose at a place of a path."""
    k = min(int(number), len(poses) - 2)
    return poses_between(poses[k], poses[k + 1], np.array([number - k]))[0]


def poses_between(start, end, shares):
    """Return the poses at some shares of a segment, (n, 3), the shorter way round."""
    (x, y, yaw), (end_x, end_y, end_yaw) = start, end
    turn = math.remainder(end_yaw - yaw, 2 * math.pi)
    if abs(turn) < 1e-9:
        return np.array(start) + np.outer(shares, [end_x - x, end_y - y, turn])
    # The centre sees both ends under the angle of the turn.
    high = 0.5 / math.tan(turn / 2)
    centre = complex(x + end_x, y + end_y) / 2 + high * 1j * complex(end_x - x, end_y - y)
    moved = centre + (complex(x, y) - centre) * np.exp(1j * turn * shares)
    return np.column_stack([moved.real, moved.imag, yaw + turn * shares])


def _geometries(body, poses):
    """Return the body at poses as geometries of shapely."""
    import shapely
    c, s = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    x, y = body.T
    points = np.stack([x * c - y * s + poses[:, :1], x * s + y * c + poses[:, 1:2]], axis=-1)
    if len(body) == 1:
        return shapely.points(points[:, 0])
    return shapely.linestrings(points) if len(body) == 2 else shapely.polygons(points)


def _geometry(body):
    return _geometries(np.asarray(body), np.zeros((1, 3)))[0]


def distance_at(body, poses, number, others):
    """Return how far a body at a place of a path is from the nearest of others."""
    import shapely
    there = _geometries(body, pose_at(poses, number)[None])[0]
    return min(shapely.distance(there, _geometry(other)) for other in others)


def least_distance(body, poses, other, samples=2000):
    """Return the least distance of a body on a path from another, at many places."""
    import shapely
    shares = np.linspace(0, 1, samples)
    return min(shapely.distance(_geometries(body, poses_between(*ends, shares)),
                                _geometry(other)).min() for ends in zip(poses, poses[1:]))


def random_path(rng):
    """Return a body, the poses of a path and obstacles."""
    body = _BODIES[rng.integers(len(_BODIES))] * rng.choice([0.5, 1]) - rng.integers(0, 3, 2) / 4
    count = rng.integers(2, 6)
    poses = rng.integers(-12, 13, (count, 3)) / 4.0
    poses[:, 2] = rng.choice([poses[0, 2], 0.0, 40.0], count) + rng.choice([0, 0.2, 3], count) * (
        rng.uniform(-1, 1, count))
    for k in range(1, count):
        kind = rng.integers(6)
        if kind == 0:
            poses[k] = poses[k - 1]
        elif kind == 1:
            poses[k, :2] = poses[k - 1, :2]
        elif kind == 2:
            poses[k, 2] = poses[k - 1, 2]
    others = [shapes.convex(shapes.polygons(rng, 1, 5))[0] * rng.choice([0.1, 0.5]) if kind > 4
              else _BODIES[kind] * 0.5 for kind in rng.integers(0, 7, rng.integers(1, 4))]
    return body, poses, [other + rng.uniform(-4, 4, 2) for other in others]


def check(count, seed, samples=64):
    """
    Compare the answers for random paths; return how many there were of each kind.

    Raise `AssertionError` where one is late, or early by more than is allowed.
    """
    import shapely
    rng = np.random.default_rng(seed)
    seen = Counter(none=0, first=0, between=0, margin=0)
    shares = np.linspace(0, 1, samples + 1)
    for number in range(count):
        body, poses, others = random_path(rng)
        margin = float(rng.choice([0.0, 0.0, 0.125]))
        found = first_contact_along(body, poses, others, margin)
        reached = math.inf if found is None else found.pose
        where = f'path {number} of seed {seed}: {found}'
        for k, ends in enumerate(zip(poses, poses[1:])):
            before = shares[k + shares < reached - 1e-12]
            between = poses_between(*ends, before)
            for other in others:
                # Where the origin is farther away nothing of the body comes near.
                centre = other[0]
                radius = np.hypot(*body.T).max() + np.hypot(*(other - centre).T).max()
                away = np.hypot(*(between[:, :2] - centre).T)
                moved = _geometries(body, between[away <= radius + margin + 1e-6])
                touched = shapely.distance(moved, _geometry(other)) <= margin - 1e-12 if (
                    margin) else shapely.intersects(moved, _geometry(other))
                assert not touched.any(), where
        if margin == 0.0:
            for k, pose in enumerate(poses):
                if any(oracle.intersects(place(body, *pose), other) for other in others):
                    assert reached <= k, where
                    break
            else:
                assert reached > 0.0, where
        if found is not None:
            near = distance_at(body, poses, found.pose, [others[found.row]])
            assert near <= margin + (_NEAR if reached else 0.0), (where, near)
            seen['margin'] += margin > 0.0
        seen['none' if found is None else 'between' if reached else 'first'] += 1
    return seen


TAU = 2 * math.pi
CART = BOX - [0.5, 0.5]
OTHERS = [BOX[:1], BAR, BOX[:3], BOX, L]


@pytest.mark.parametrize('count', [800, pytest.param(2000, marks=pytest.mark.long)])
def test_random_paths_against_shapely(count):
    """None is late, at the place found bodies are near, and place 0 is exact."""
    pytest.importorskip('shapely')
    seen = check(count, seed=1)
    assert min(seen.values()) > count / 40, seen


@pytest.mark.parametrize('margin', [0.0, 0.25])
def test_single_poses_are_decided_exactly(margin):
    rng = np.random.default_rng(3)
    answers = []
    for _ in range(400):
        body = rng.integers(-3, 4, (3, 2)) / 4
        if len(Polygon(body).vertices) < 3:
            continue
        pose = *rng.integers(-6, 7, 2) / 4, float(rng.choice([0.0, rng.uniform(-9, 9)]))
        placed = place(Polygon(body).vertices, *pose)
        other = OTHERS[rng.integers(len(OTHERS))] + rng.integers(-6, 7, 2) / 4
        expected = (oracle.intersects(placed, other) if margin == 0.0
                    else separation(placed, other) <= margin)
        found = first_contact_along(body, [pose], [other], margin)
        assert found == (PathContact(0.0, 0.0, 0) if expected else None)
        # It is the same for a path that begins there.
        found = first_contact_along(body, [pose, (9.0, 9.0, 0.0)], [other], margin)
        assert (found is not None and found.pose == 0.0) == expected
        answers.append(expected)
    assert 50 < sum(answers) < len(answers) - 50


def test_a_step_apart_at_the_first_pose():
    """One ulp decides, there and only there."""
    step = math.nextafter(1.0, 2.0)
    assert first_contact_along(BOX, [(1.0, 0.0, 0.0)], [BOX]).pose == 0.0
    assert first_contact_along(BOX, [(step, 0.0, 0.0)], [BOX]) is None
    assert first_contact_along(BOX, 3 * [(step, 0.0, 0.0)], [BOX]) is None
    assert first_contact_along(BOX, 3 * [(step, 0.0, 0.0)] + [(1.0, 0.0, 0.0)], [BOX]).pose >= 2


@pytest.mark.parametrize('poses, obstacle, pose, distance', [
    # Straight on, sideways and back; poses that are repeated.
    ([(0, 0, 0), (4, 0, 0)], [(2.5, 0)], 0.5, 2.0),
    ([(0, 0, 0), (0, 4, 0), (0, 4, 0), (0, 8, 0)], [(0, 6.5)], 2.5, 6.0),
    ([(0, 0, 0), (4, 0, 0), (-4, 0, 0)], [(-2.5, 0)], 1.75, 10.0),
    # A turn on the spot: the corner at 45 degrees reaches the axis.
    ([(0, 0, 0), (0, 0, math.pi / 2)], [(0, math.sqrt(0.5) - 1e-9), (0, 9)], 0.5, 0.0),
    ([(0, 0, 0), (0, 0, -math.pi / 2)], [(0, math.sqrt(0.5) - 1e-9), (0, 9)], 0.5, 0.0),
    # A quarter of a circle about (0, 4), 45 degrees of it to a wall across it.
    ([(0, 0, 0), (4, 4, math.pi / 2)],
     place([(0.5, -1), (0.5, 1)], 4 * math.sin(math.pi / 4), 4 - 4 * math.cos(math.pi / 4),
           math.pi / 4), 0.5, math.pi),
    # The shorter way round, over the cut of angles; the other way is blocked.
    ([(0, 0, 3.0), (0, 0, -3.0), (9, 0, -3.0)], [(0, 0.65)], None, None),
    ([(0, 0, 0), (0, 0, TAU), (0, 0, 0)], [(0.6, 0)], None, None),
])
def test_known_places(poses, obstacle, pose, distance):
    found = first_contact_along(CART, poses, [[(50, 50)], obstacle])
    if pose is None:
        assert found is None
        return
    assert found.row == 1
    assert pose - 2e-3 <= found.pose <= pose
    assert found.distance == pytest.approx(distance, abs=2e-2)


@pytest.mark.parametrize('turn', [math.pi, -math.pi, 3 * math.pi])
def test_half_a_turn_goes_either_way(turn):
    """A bar sweeps one of two half discs, so it meets one of two posts on both sides."""
    poses = [(0, 0, 0), (0, 0, turn)]
    posts = [[(0, 0.9)], [(0, -0.9)]]
    assert first_contact_along(BAR, poses, posts).pose == pytest.approx(0.5, abs=2e-3)
    assert sum(first_contact_along(BAR, poses, [post]) is None for post in posts) == 1
    assert first_contact_along(BAR, [(0, 0, 0), (2, 0, turn)],
                               [[(1, -3), (1, 3)]]).pose < 0.5


def test_between_poses_it_is_the_arc_and_not_the_chord():
    poses = [(0, 0, 0), (4, 4, math.pi / 2)]
    assert first_contact_along([(0, 0)], poses, [[(2, 2)]]) is None
    on_arc = 4 * math.sin(math.pi / 6), 4 - 4 * math.cos(math.pi / 6)
    found = first_contact_along([(0, 0)], poses, [[on_arc]], 1e-9)
    assert found.pose == pytest.approx(1 / 3, abs=1e-3)
    assert found.distance == pytest.approx(TAU / 3, abs=2e-3)


def test_bodies_inside_others_and_notches():
    """Within a notch nothing touches; within a body all does."""
    notch = np.array([(0, 0), (6, 0), (6, 6), (4, 6), (4, 2), (2, 2), (2, 6), (0, 6)])
    down = [(3, 9, 0), (3, 2.75, 0)]
    assert first_contact_along(CART, down, [notch]) is None
    found = first_contact_along(CART, down + [(3, 2, 0)], [notch])
    assert found.pose == pytest.approx(1 + 1 / 3, abs=2e-3)
    assert first_contact_along(CART, [(1, 1, 0), (1, 5, 0)], [notch]).pose == 0.0
    assert first_contact_along(notch, [(0, 0, 0), (0, -9, 0)], [[(3, 9)]]) is None
    assert first_contact_along(notch, [(0, 0, 0), (0, 9, 0)], [[(3, 9)]]).pose == pytest.approx(
        7 / 9, abs=1e-3)


def test_margin():
    poses = [(0, 0, 0), (8, 0, 0)]
    assert first_contact_along(CART, poses, [[(4, 1)]], 0.4999) is None
    assert first_contact_along(CART, poses, [[(4, 1)]], 0.5).pose <= 3.5 / 8
    found = first_contact_along(CART, poses, [[(4, -9), (4, 9)]], 0.5)
    assert found.distance == pytest.approx(3.0, abs=1e-9)


def test_refined_and_reversed_paths():
    """More poses on the same motion change nothing; nor does the direction."""
    pytest.importorskip('shapely')
    rng = np.random.default_rng(8)
    met = 0
    for _ in range(500):
        body, poses, others = random_path(rng)
        found = first_contact_along(body, poses, others)
        parts = int(rng.integers(2, 6))
        finer = [pose_at(poses, k / parts) for k in range(parts * (len(poses) - 1) + 1)]
        again = first_contact_along(body, finer, others)
        back = first_contact_along(body, poses[::-1], others)
        if found is None or again is None or back is None:
            # Grazed, within the bound.
            if not found == again == back:
                nearest = min(least_distance(body, poses, other) for other in others)
                assert nearest < 1.1e-3
            continue
        met += 1
        if abs(again.pose / parts - found.pose) > 1e-9:
            # Each place is within 1 mm of contact.
            for pose in (found.pose, again.pose / parts):
                assert distance_at(body, poses, pose, others) < 1e-3 + 1e-9
    assert met > 100


def test_sets_and_rows():
    """Rows are those of the set, also after removals; many obstacles are sorted out by boxes."""
    rng = np.random.default_rng(5)
    centres = rng.uniform(-20, 70, (3000, 2))
    centres = centres[abs(centres[:, 1]) > 1.5]
    obstacles = PolygonSet(CART + centre for centre in centres)
    poses = [(x, 0.3 * math.sin(x), 0.29 * math.cos(x)) for x in np.linspace(0, 50, 200)]
    assert first_contact_along(CART * [1, 0.5], poses, obstacles) is None
    for x in (41.0, 17.0, 29.0):
        row = obstacles.append([(x, -0.5), (x, 0.5)])
        found = first_contact_along(CART * [1, 0.5], poses, obstacles)
        assert found.row == row
        assert 0.3 < x - found.pose * 50 / 199 < 1.0
        assert found.distance > found.pose * 50 / 199
        obstacles.remove(row)
    assert first_contact_along(CART * [1, 0.5], poses, obstacles) is None


GOOD = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)]


@pytest.mark.parametrize('obstacles', [[], [BOX]])
@pytest.mark.parametrize('poses', [
    [(math.nan, 0, 0)], [(0, 0, math.inf)], [*GOOD, (0, -math.inf, 0)], [], (0.0, 0.0, 0.0),
    [(0.0, 0.0)], [(0, 0, 0, 1)], np.zeros((1, 1, 3)), np.zeros((0, 3)), [GOOD[0], (1, 0)],
    'abc', None, [(10 ** 400, 0, 0)], [('0', '0', '0')], [(True, False, False)], [(None, 0, 0)],
    [(1j, 0, 0)], np.array([(1j, 0, 0)], object), np.ma.masked_equal(GOOD, 1.0)])
def test_bad_poses(poses, obstacles):
    with pytest.raises(ValueError, match='pose'):
        first_contact_along(BOX, poses, obstacles)


@pytest.mark.parametrize('obstacles', [[], [BOX]])
@pytest.mark.parametrize('margin', [-1.0, math.nan, math.inf, 10 ** 400])
def test_bad_margins(margin, obstacles):
    with pytest.raises(ValueError, match='margin'):
        first_contact_along(BOX, GOOD, obstacles, margin)


@pytest.mark.parametrize('poses', [
    [(0, 0, 0), (1e308, 0, 0)], [(-1e308, 0, 0), (1e308, 0, 2)],
    [(1.7e308, 1.7e308, 1), (-1.7e308, 1.7e308, -2)], [(5, 5, 0), (1.7e308, 0, 3)]])
@pytest.mark.parametrize('margin', [0.0, 1.7e308])
def test_overflow_is_an_error_or_right(poses, margin):
    wall = [(5e307, -1e300), (5e307, 1e300)]
    try:
        found = first_contact_along(BOX, poses, [wall], margin)
    except ValueError as error:
        assert 'largest double' in str(error)
    else:
        assert found is not None


def test_large_and_small_coordinates():
    """Far away and with large yaws answers stay right, and so do the smallest ones."""
    for x in (1e6, 1e150):
        size = x * 1e-3
        poses = [(x, x, 0), (x + 8 * size, x, 0)]
        wall = [(x + 4 * size, x - size), (x + 4 * size, x + size)]
        assert first_contact_along(CART * size, poses, [wall]).pose == pytest.approx(3.5 / 8)
    turns = 10 ** 6 * TAU
    found = first_contact_along(CART, [(0, 0, turns), (8, 0, turns)], [[(4, -1), (4, 1)]])
    assert found.distance == pytest.approx(3.5, abs=1e-6)
    tiny = 5e-324
    assert first_contact_along([(0, 0)], [(0, 0, 0), (tiny, 0, 0)], [[(tiny, 0)]]) is not None


def test_turns_lost_in_rounding_are_none_that_are_missed():
    """Of yaws a full turn apart up to rounding, the second one decides the end."""
    seen = 0
    for yaw in np.linspace(0.1, 6.2, 400).tolist():
        start, end = (place([(1, 0)], 0.0, 0.0, one) for one in (yaw, yaw + TAU))
        if (start != end).any():
            found = first_contact_along([(1, 0)], [(0, 0, yaw), (0, 0, yaw + TAU)], [end])
            assert found is not None and found.pose > 0.0
            seen += 1
    assert seen > 100


def test_places_late_on_a_path_are_rounded_down():
    for x in np.linspace(3.0, 8.0, 50).tolist():
        ends, wall = [(0, 0, 0), (9, 0, 0)], [[(x, -1), (x, 1)]]
        alone = first_contact_along(CART, ends, wall).pose
        assert 0.0 <= alone - (first_contact_along(CART, 7 * ends[:1] + ends[1:], wall).pose - 6
                               ) < 1e-12


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--paths', type=float, default=1e5)
    parser.add_argument('--samples', type=int, default=10_000)
    given = parser.parse_args()
    seen = Counter()
    with Pool() as pool:
        seeds = range(2, 2 + math.ceil(given.paths / TOGETHER))
        for found in pool.imap_unordered(partial(check, TOGETHER, samples=given.samples), seeds):
            seen += found
            print(*(f'{kind}: {count}' for kind, count in seen.items()), '0 late', sep=', ',
                  flush=True)


if __name__ == '__main__':
    main()

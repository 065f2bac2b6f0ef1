# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A set with an index answers as one that scans its rows."""

import copy
import pickle
import sys

from bodies import random_body
import numpy as np
import pytest
from sat_collision import (
    first_contact_along, Polygon, PolygonError, PolygonSet, separation)
from sat_collision.geometry.body import box_index
from sat_collision.geometry.body.layout import FANOUT
from sat_collision.geometry.compiled.jit import COMPILED, indexable
from sat_collision.geometry.sets import polygon_set
from sat_collision.geometry.sets.packed_set import PackedSet

SQUARE = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
SIZES = [1, 2, FANOUT - 1, FANOUT, FANOUT + 1, 5 * FANOUT, FANOUT**2, FANOUT**2 + 1, 700]


def scattered(rng, count):
    side = 2.0 * count**0.5
    return rng.uniform(-side, side, (count, 1, 2)) + rng.uniform(0.1, 2.0, (count, 1, 1)) * SQUARE


def in_a_grid(rng, count):
    """Return squares with common edges and corners, in any order."""
    width = int(count**0.5) + 1
    places = rng.permutation(count)
    return np.stack([places // width, places % width], 1)[:, None] + SQUARE


KINDS = {
    'scattered': scattered,
    'clustered': lambda rng, count: SQUARE + rng.normal(0, 1.5, (count, 1, 2)) + (
        rng.uniform(-100, 100, (5, 1, 2))[rng.integers(0, 5, count)]),
    'equal': lambda rng, count: np.tile(SQUARE, (count, 1, 1)),
    'in a grid': in_a_grid,
    'points': lambda rng, count: rng.integers(-20, 20, (count, 1, 2)).astype(float),
    'long walls': lambda rng, count: rng.uniform(-50, 50, (count, 2, 2)),
    'tiny': lambda rng, count: 1e-310 * scattered(rng, count),
    'huge': lambda rng, count: 5e305 * scattered(rng, count),
    'of all sizes': lambda rng, count: scattered(rng, count) * 2.0 ** rng.integers(
        -900, 900, (count, 1, 1)),
}


def pair_of_sets(bodies, removed=()):
    """Return a set that scans, and the same with an index."""
    sets = PolygonSet.from_array(bodies), PolygonSet.from_array(bodies)
    for one in sets:
        for row in removed:
            one.remove(row)
    sets[1].index()
    assert sets[1]._snapshot()[1] == (len(bodies) > len(removed))
    return sets


def answers(bodies, body, extent):
    """Return all that can be asked about a body, in a set of some extent."""
    bodies._queries = 0  # so that a set that scans goes on scanning
    found = [bodies.intersecting_rows(body), bodies.intersects(body), bodies.nearest(body),
             bodies.nearest(body, range(0, len(bodies), 2))]
    for share in (0.0, 1e-3, 0.02, 0.3, 3.0):
        found.append(bodies.rows_within(body, min(share * extent, sys.float_info.max)))
    found.append(bodies.rows_within(body, np.inf))
    for twist, margin in (((1.0, 0.5, 0.0), 0.0), ((1.0, 0.0, 2.0), 0.01), ((0, 0, 0), 0.0)):
        speed = 0.05 * extent
        pose = (*body.vertices[0], 1.0)
        try:
            found.append(bodies.first_contact(
                body, (speed * twist[0], speed * twist[1], twist[2]), 1.0, pose=pose,
                tolerance=max(1e-3 * extent, 1e-300), margin=margin * extent))
            found.append(first_contact_along(
                body, [(0, 0, 0), (speed, speed, 0), (speed, 0, 1)], bodies, margin * extent))
        except ValueError as error:
            found.append(str(error))
    return [one.tolist() if isinstance(one, np.ndarray) else one for one in found]


def test_rows_at_exactly_the_margin_are_found():
    """A box grown by the margin might be rounded to less."""
    rng = np.random.default_rng(11)
    for a, b in rng.normal(size=(300, 2)) * 2.0 ** rng.integers(-30, 30, (300, 2)):
        for one in pair_of_sets(np.array([[(0.0, b)]])):
            assert one.rows_within([(0.0, a)], separation([(0.0, a)], [(0.0, b)])).tolist() == [0]


@pytest.mark.parametrize('kind', KINDS.values(), ids=KINDS)
def test_index_and_scan_agree(kind):
    """Same rows, same order, same values, with rows that were removed and without."""
    rng = np.random.default_rng(1)
    seen = set()
    for size in SIZES if COMPILED else SIZES[1:-2:2]:
        array = kind(rng, size)
        removed = rng.permutation(size)[:size // 3] if size % 2 else ()
        scanning, indexed = pair_of_sets(array, removed)
        extent = float(np.ptp(array.reshape(-1, 2) / 4.0, axis=0).max()) or 1.0
        for k in range(12 if COMPILED else 3):
            place = array[rng.integers(size)].mean(axis=0)
            scale = extent * 10.0 ** rng.uniform(-3, 0)
            shift = rng.normal(0, scale, 2) if k % 3 else 0.0
            body = Polygon(place + shift + scale * SQUARE if k % 4 else [place])
            found = answers(scanning, body, extent)
            assert answers(indexed, body, extent) == found
            seen.update(map(str, found))
    assert len(seen) > 15


def test_nonconvex_bodies():
    rng = np.random.default_rng(2)
    bodies = [random_body(rng) for _ in range(200)]
    scanning, indexed = PolygonSet(bodies), PolygonSet(bodies)
    indexed.index()
    for _ in range(40 if COMPILED else 5):
        body = random_body(rng)
        assert answers(indexed, body, 5.0) == answers(scanning, body, 5.0)


def test_more_near_rows_than_an_index_is_good_for():
    scanning, indexed = pair_of_sets(scattered(np.random.default_rng(3), 3000))
    for body in (Polygon(size * SQUARE) for size in (5.0, 20.0, 40.0, 1000.0)):
        assert answers(indexed, body, 9.0) == answers(scanning, body, 9.0)


@pytest.mark.parametrize('margin', [0.0, 0.4])
def test_motion_far_from_the_origin(margin):
    """Most bodies meet an obstacle on their way, half of them driving along x."""
    rng = np.random.default_rng(5)
    away = np.array((1000.0, -2000.0))
    scanning, indexed = pair_of_sets(scattered(rng, 300) + away)
    count = 60 if COMPILED else 16
    met = 0
    for k in range(count):
        pose = (*(away + rng.uniform(-25, 25, 2)), 0.0)
        body = Polygon(0.1 * SQUARE + pose[:2])
        twist = (6.0, 0.0, 0.0) if k % 2 else rng.normal(0, 5, 3)
        found = scanning.first_contact(body, twist, 2.0, pose=pose, margin=margin)
        assert indexed.first_contact(body, twist, 2.0, pose=pose, margin=margin) == found
        met += found is not None and found[1] > 0.0
    assert met > count / 4


def test_obstacles_that_move_are_not_left_out():
    """The index is of where the bodies are at first."""
    scanning, indexed = pair_of_sets(50.0 * np.arange(1, 101)[:, None, None] + SQUARE)
    velocities = np.zeros((100, 2))
    velocities[99] = -1000.0
    for bodies in (scanning, indexed):
        row, time = bodies.first_contact(Polygon(SQUARE), (1, 1, 0), 6.0, velocities)
        assert row == 99 and 4.9 < time < 5.0


def test_sets_without_a_body_have_no_index():
    for bodies in (PolygonSet(), PolygonSet([SQUARE])):
        if len(bodies):
            bodies.remove(0)
        bodies.index()
        assert bodies._snapshot()[1] == 0
        assert bodies.intersecting_rows(SQUARE).size == 0 and bodies.nearest(SQUARE) is None


@pytest.mark.parametrize('change', [
    lambda bodies: bodies.append(SQUARE + 90), lambda bodies: bodies.remove(5),
    lambda bodies: bodies.replace(7, SQUARE + 90)])
def test_changes_drop_the_index(change):
    bodies = PolygonSet.from_array(np.arange(30)[:, None, None] + SQUARE)
    expected = copy.deepcopy(bodies)
    bodies.index()
    change(bodies)
    change(expected)
    assert bodies._snapshot()[1] == 0 and bodies == expected
    for place in (5, 7, 90):
        assert bodies.intersecting_rows([(place, place)]).tolist() == (
            expected.intersecting_rows([(place, place)]).tolist())
    bodies.index()
    assert bodies.nearest([(90, 90)]) == expected.nearest([(90, 90)])


def test_refused_bodies_leave_the_index():
    bodies = PolygonSet.from_array(np.arange(30)[:, None, None] + SQUARE)
    bodies.index()
    with pytest.raises(PolygonError, match='not finite'):
        bodies.append([(0, np.nan)])
    assert bodies.intersecting_rows([(3, 3)]).tolist() == [3]


@pytest.mark.parametrize('change', [
    lambda bodies: bodies.hide(indexable(np.array([3]))), lambda bodies: bodies.remove(3),
    lambda bodies: bodies.place(3, Polygon(SQUARE - 50).packed, PolygonSet())])
def test_sets_of_one_thread_drop_the_index(change):
    bodies = PackedSet(np.arange(30)[:, None, None] + SQUARE)
    bodies.index()
    change(bodies)
    assert bodies._snapshot()[1] == 0
    assert bodies.nearest([(3, 3)])[0] != 3
    assert 3 not in bodies.intersecting_rows([(3, 3)])


@pytest.mark.skipif(not COMPILED, reason='plain Python builds it only when told to')
def test_unchanged_sets_get_an_index(monkeypatch):
    """After so many queries that it pays; a change puts that off, and small sets get none."""
    built = []

    def build(array):
        built.append(array)
        return box_index.build_index(array)
    monkeypatch.setattr(polygon_set, 'build_index', build)
    bodies = PolygonSet.from_array(scattered(np.random.default_rng(4), 1000))
    small = PolygonSet([SQUARE])
    expected = bodies.intersecting_rows(SQUARE).tolist()
    for _ in range(3):
        bodies.replace(0, bodies.polygon(0))
        for _ in range(polygon_set._QUERIES - 1):
            bodies.intersecting_rows(SQUARE)
            small.intersecting_rows(SQUARE)
    assert not built
    for _ in range(polygon_set._QUERIES):
        assert bodies.intersecting_rows(SQUARE).tolist() == expected
    assert len(built) == 1 and bodies._snapshot()[1] == 1
    # A copy has its own.
    again = pickle.loads(pickle.dumps(bodies))
    assert again == bodies and again._snapshot()[1] == 0

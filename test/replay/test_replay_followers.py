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

"""Which body of a set becomes which of the next, against a plain search of all pairs."""

import numpy as np
import pytest
from sat_collision.replay.motion.sets import SetTrail
from sat_collision.scene.obstacles import Obstacle

PERIOD = 10**8
PATIENCE = 10**9


def ring(points):
    """Return points as a message has them."""
    array = np.zeros((len(points), 3), np.float32)
    array[:, :2] = points
    return (array.tobytes(), 0, len(points)), None


def random_set(rng, count, extent):
    """Return rings of three or four points on a grid, so that distances are exact and may tie."""
    rings = []
    for x, y in rng.integers(-extent, extent + 1, (count, 2)):
        corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        rings.append(corners[:rng.integers(3, 5)])
    return rings


def centre(points):
    """Return the middle of the bounds, twice."""
    xs, ys = zip(*points)
    return min(xs) + max(xs), min(ys) + max(ys)


def nearest(points, others):
    """Return the first of those that are nearest."""
    x, y = centre(points)
    return min(range(len(others)), key=lambda j: sum(
        (a - b) ** 2 for a, b in zip((x, y), centre(others[j]))))


def expected_pairs(before, after):
    """Return which ring becomes which: nearest to each other, with as many points."""
    if not before or not after:
        return set()
    return {(i, j) for i, j in enumerate(nearest(one, after) for one in before)
            if nearest(after[j], before) == i and len(before[i]) == len(after[j])}


@pytest.mark.parametrize('extent', [2, 5, 30])
def test_bodies_of_sets_are_those_that_are_nearest_to_each_other(extent):
    """Many at one place, or few far apart; for how long something has no partner is counted."""
    rng = np.random.default_rng(extent)
    steps = []
    trail = SetTrail(PATIENCE, 256, lambda trail, step: steps.append(step))
    sets = [random_set(rng, rng.integers(0, 12), extent) for _ in range(300)]
    for number, rings in enumerate(sets, 1):
        trail.begin(number * PERIOD)
        for place, points in enumerate(rings):
            trail.place(Obstacle(None, 'lidar', place, place, 0), number * PERIOD, ring(points))
    trail.begin((len(sets) + 1) * PERIOD)
    assert len(steps) == len(sets)
    undecided = followed = 0
    for before, after, step in zip(sets, sets[1:], steps[1:]):
        pairs = expected_pairs(before, after)
        assert {pair for ways in step.ways for pair in zip(ways.rows, ways.next_rows)} == pairs
        undecided += PERIOD * (max(len(before), len(after)) > len(pairs))
        followed += len(pairs)
    assert trail.undecided == undecided
    assert followed > 300

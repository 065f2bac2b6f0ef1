# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Matching of bodies from one set to the next, compared with a search of all pairs."""

import numpy as np
import pytest
from sat_collision.geometry.body.packing import TRIPLE
from sat_collision.messages.ingest import Placement
from sat_collision.replay.motion.tracker import SetTracker
from sat_collision.scene.settings import ObstacleSettings

PERIOD = 10**8


def placement(stamp, points):
    """Return a placement at a whole number of periods."""
    array = np.zeros((len(points), 3), np.float32)
    array[:, :2] = np.reshape(points, (-1, 2))
    return Placement('lidar', stamp * PERIOD, 'map', (array.tobytes(), 0, len(points), TRIPLE),
                     None, None, listing=stamp, last_whole=stamp - 1)


def random_set(rng, count, extent):
    """Return rings of three or four points on a grid, so that distances are exact and may tie."""
    rings = {}
    for x, y in rng.integers(-extent, extent + 1, (count, 2)):
        corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        ring = tuple(corners[:rng.integers(3, 5)])
        rings[ring] = ring
    return list(rings)


def centre(points):
    """Return twice the centre of the bounds."""
    xs, ys = zip(*points)
    return min(xs) + max(xs), min(ys) + max(ys)


def nearest(points, others):
    """Return the index of the first of the nearest others."""
    x, y = centre(points)
    return min(range(len(others)), key=lambda j: sum(
        (a - b) ** 2 for a, b in zip((x, y), centre(others[j]))))


def expected_pairs(before, after):
    """Return which ring becomes which: mutually nearest, with the same number of points."""
    if not before or not after:
        return set()
    return {(i, j) for i, j in enumerate(nearest(one, after) for one in before)
            if nearest(after[j], before) == i and len(before[i]) == len(after[j])}


@pytest.mark.parametrize('extent', [2, 5, 30])
def test_bodies_are_matched_with_their_mutual_nearest(extent):
    """Dense and sparse sets; time counts where bodies of both sets have no match."""
    rng = np.random.default_rng(extent)
    steps = []
    tracker = SetTracker(ObstacleSettings('lidar', '/lidar'),
                         lambda tracker, step: steps.append(step), lambda listing: False)
    sets = [random_set(rng, rng.integers(0, 12), extent) for _ in range(300)]
    # The beginning of one more set ends the last one, which is whole then.
    for number, rings in enumerate([*sets, []], 1):
        for points in [*rings, ()]:
            tracker.place(placement(number, points))
    held = [step for step in steps if step.seen is None]
    steps = [step for step in steps if step.seen is not None]
    assert len(steps) == len(sets)
    assert sum(map(len, (step.gone for step in held))) == sum(
        len(before) - len(expected_pairs(before, after)) for before, after in zip(sets, sets[1:]))
    undetermined = followed = 0
    for before, after, step in zip(sets, sets[1:], steps[1:]):
        pairs = expected_pairs(before, after)
        assert {pair for motion in step.motions
                for pair in zip(motion.rows, motion.next_rows)} == pairs
        undetermined += PERIOD * (min(len(before), len(after)) > len(pairs))
        followed += len(pairs)
    assert sum(last - first for first, last in tracker.undetermined) == undetermined
    assert followed > 300

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Sets: processed together as one by one, and matched as by a search of all pairs."""

from builders import SECOND
import numpy as np
import pytest
from recordings import box, declared, STAMPS, START
from sat_collision.geometry.body.packing import TRIPLE
from sat_collision.messages.ingest import Placement
from sat_collision.replay.model.configuration import settings_of
from sat_collision.replay.model.result import FootprintResult
from sat_collision.replay.motion import contacts
from sat_collision.replay.motion.motion import RecordedMotion
from sat_collision.replay.motion.tracker import SetTracker
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import ObstacleSettings

SHAPES = [box(0.0), [(0, 0), (2, 0), (0.5, 1)], [(0, 0), (1.5, 0.5)], [*box(0.0), (0.0, 0.0)],
          [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]]
NAMES = 'robot', 'cart', 'lidar', 'radar', 'map'
SETTINGS = settings_of({
    'footprints': ['robot', 'cart'], 'obstacles': ['lidar', 'radar', 'map'], 'margin': 0.1,
    **declared(STAMPS, 'lidar', 'radar'), **{f'{name}.topic': f'/{name}' for name in NAMES}})


def placed(name, time, shape, **listed):
    """Return the placement of a body at a time in s, whose stamp is by default its listing."""
    points = np.zeros((len(shape), 3), np.float32)
    points[:, :2] = np.reshape(shape, (-1, 2))
    stamp = START + round(time * SECOND)
    return Placement(name, stamp, 'map', (points.tobytes(), 0, len(points), TRIPLE), None, None,
                     **listed or {'listing': stamp if name in ('lidar', 'radar') else 0})


def placements(name, rng, times, shapes):
    """Return bodies that drive past the origin or stand; a few are missing at each time."""
    places, speeds = rng.uniform(-9, 9, (2, len(shapes), 2))
    speeds *= rng.choice([0.1, 0.5]) * (rng.random((len(shapes), 1)) < 0.6)
    for time in times:
        for shape, place, speed in zip(shapes, places, speeds):
            if rng.random() < 0.9:
                yield placed(name, time, shape + place + speed * (time - 6.0))


def recorded(seed):
    rng = np.random.default_rng(seed)
    shapes = [np.array(shape, float) for shape in SHAPES]
    found = []
    for name in ('robot', 'cart'):
        times = np.arange(0.0, 12.0, 0.1) if rng.random() < 0.5 else np.cumsum(
            rng.uniform(0.01, 0.1, 200))
        times = times[(times < 4.0) | (times > 5.2)]
        found += placements(name, rng, times, [shapes[rng.integers(len(shapes) - 1)]])
    for name in ('lidar', 'radar'):
        found += placements(name, rng, np.arange(0.0, 12.0, rng.choice([0.1, 0.23])), [
            shapes[rng.integers(len(shapes) - (rng.random() < 0.8))] for _ in range(8)])
    if rng.random() < 0.5:
        found += placements('map', rng, np.cumsum(rng.uniform(0.2, 3.0, 5)), shapes)
    return sorted(found, key=lambda placement: placement.stamp)


def followed(found, together, alone=0):
    """Return results and motion of placements, some at a time after the first ones."""
    results = [FootprintResult(one.name, one.topic, True) for one in SETTINGS.footprints]
    motion = RecordedMotion(SETTINGS, Scene(SETTINGS), None, results)
    motion.place(found[:alone])
    for k in range(alone, len(found), together):
        motion.place(found[k:k + together])
    motion.finish(found[-1].stamp)
    return results, motion


def decided(found, together):
    """Return all results for placements, some at a time."""
    results, motion = followed(found, together)
    return repr((motion.contacts, [(one.least, one.separation) for one in results], [
        motion.undetermined_of[name] for name in NAMES], motion.undetermined))


@pytest.mark.parametrize('seed', range(8))
def test_placements_together_give_the_same_as_one_by_one(seed):
    found = recorded(seed)
    alone = decided(found, 1)
    assert {decided(found, together) for together in (7, 64, 500)} == {alone}


@pytest.mark.parametrize('together', (1, 500))
@pytest.mark.parametrize('x, comes_back, contacts', [
    (1.5, True, 0), (2.5, True, 1), (9.0, True, 2), (9.0, False, 1)],
    ids=['is near', 'touches', 'passes through and comes back', 'passes through'])
@pytest.mark.parametrize('when', range(1, 9))
def test_contact_on_any_piece_between_two_sets(together, x, comes_back, contacts, when):
    """Between two sets the robot's motion has eight pieces; on one it goes elsewhere."""
    found = []
    for k in range(25):
        is_away = k == 8 + when or k > 8 + when and not comes_back
        found.append(placed('robot', k / 8, box(x if is_away else 0.0)))
        if k % 8 == 0:
            found.append(placed('lidar', k / 8, box(3.0)))
    # Sets are processed together from the second on.
    _, motion = followed(found, together, alone=2)
    assert len(motion.contacts) == contacts


def test_first_sample_is_that_of_its_footprint():
    """It sets the frame of all footprints, too."""
    found = [placed('robot', 0.0, box(0.0)), placed('cart', 0.0, box(5.0)),
             placed('lidar', 0.0, box(0.5)), placed('robot', 0.1, box(2.0)),
             placed('cart', 0.1, box(5.0)), placed('lidar', 0.1, box(0.5))]
    _, motion = followed(found, 500)
    assert [(one.footprint, one.first) for one in motion.contacts] == [('robot', START)]


def test_most_steps_are_processed_together(monkeypatch):
    """Otherwise the tests above would test nothing."""
    answers = []
    decide = contacts.ContactTracker._decide_from_batch

    def noting(*arguments):
        answers.append(decide(*arguments))
        return answers[-1]
    monkeypatch.setattr(contacts.ContactTracker, '_decide_from_batch', noting)
    for seed in range(8):
        decided(recorded(seed), 500)
    assert sum(answers) > 300


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
    tracker = SetTracker(ObstacleSettings('lidar', '/lidar'), steps.append, lambda listing: False)
    sets = [random_set(rng, rng.integers(0, 12), extent) for _ in range(300)]
    # The beginning of one more set ends the last one, which is whole then.
    for number, rings in enumerate([*sets, []], 1):
        for points in [*rings, ()]:
            tracker.place(placed('lidar', number / 10, points, listing=number,
                                 last_whole=number - 1))
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
        undetermined += SECOND // 10 * (min(len(before), len(after)) > len(pairs))
        followed += len(pairs)
    assert sum(last - first for first, last in tracker.undetermined) == undetermined
    assert followed > 300

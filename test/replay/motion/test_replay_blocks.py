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

"""Sets that are described and decided together: the results are the same as one by one."""

import numpy as np
import pytest
from recordings import box, START
from sat_collision.messages.ingest import Placement
from sat_collision.replay.model.configuration import settings_of
from sat_collision.replay.model.result import FootprintResult
from sat_collision.replay.motion import contacts
from sat_collision.replay.motion.walk import Motion

SHAPES = [box(0.0), [(0, 0), (2, 0), (0.5, 1)], [(0, 0), (1.5, 0.5)], [*box(0.0), (0.0, 0.0)],
          [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]]
SETTINGS = settings_of({
    'footprints': ['robot', 'cart'], 'obstacles': ['lidar', 'radar'], 'margin': 0.1,
    **{f'{name}.topic': f'/{name}' for name in ('robot', 'cart', 'lidar', 'radar')}})


def placed(name, time, shape):
    """Return a body where it is at a time in s."""
    points = np.zeros((len(shape), 3), np.float32)
    points[:, :2] = shape
    return Placement(name, START + round(time * 1e9), True, 'map',
                     (points.tobytes(), 0, len(points)), None, None)


def placements(name, rng, times, shapes):
    """Return bodies that drive past the origin, or stand; of each time all, but for a few."""
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
    return sorted(found, key=lambda placement: placement.stamp)


def followed(found, together, alone=0):
    """Return results and motion of placements, so many taken at a time behind the first ones."""
    results = [FootprintResult(one.name, one.topic, True) for one in SETTINGS.footprints]
    motion = Motion(SETTINGS, None, results)
    motion.place(found[:alone])
    for k in range(alone, len(found), together):
        motion.place(found[k:k + together])
    motion.finish(found[-1].stamp)
    return results, motion


def decided(found, together):
    """Return all that is found of placements so many of which are taken at a time."""
    results, motion = followed(found, together)
    motion.draw_curves([])
    return repr((motion.contacts, [(one.least, one.separation) for one in results], [
        motion.undetermined(name) for name in ('robot', 'cart', 'lidar', 'radar')]))


@pytest.mark.parametrize('seed', range(8))
def test_what_is_taken_together_is_decided_as_one_after_the_other(seed):
    found = recorded(seed)
    alone = decided(found, 1)
    assert {decided(found, together) for together in (7, 64, 500)} == {alone}


@pytest.mark.parametrize('together', (1, 500))
@pytest.mark.parametrize('x, comes_back, contacts', [
    (1.5, True, 0), (2.5, True, 1), (9.0, True, 2), (9.0, False, 1)],
    ids=['is near', 'touches', 'passes through and comes back', 'passes through'])
@pytest.mark.parametrize('when', range(1, 9))
def test_what_happens_on_any_piece_between_two_sets(together, x, comes_back, contacts, when):
    """Eight pieces of the robot's way lead from a set to the next; on one it goes elsewhere."""
    found = []
    for k in range(25):
        is_away = k == 8 + when or k > 8 + when and not comes_back
        found.append(placed('robot', k / 8, box(x if is_away else 0.0)))
        if k % 8 == 0:
            found.append(placed('lidar', k / 8, box(3.0)))
    # Sets are described together from the second on.
    _, motion = followed(found, together, alone=2)
    assert len(motion.contacts) == contacts


def test_steps_are_looked_at_together(monkeypatch):
    """Most steps in which nothing touches, or the tests above test nothing."""
    answers = []
    look = contacts.ContactTracker._look_together

    def noting(*arguments):
        answers.append(look(*arguments))
        return answers[-1]
    monkeypatch.setattr(contacts.ContactTracker, '_look_together', noting)
    for seed in range(8):
        decided(recorded(seed), 500)
    assert sum(answers) > 300

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Random recorded motions, compared with dense samples decided by shapely."""

from builders import SECOND, serialised
import numpy as np
import pytest
from recordings import check, INSTANCE, STAMPS, START, write

shapely = pytest.importorskip('shapely')

# The tolerance of the sweep in m, with the error of a time rounded to ns at these speeds.
NEAR = 1.1e-6
SHAPES = [np.array(points, float) for points in (
    [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (2, 0), (0.5, 1)], [(0, 0), (1.5, 0.5)], [(0, 0)],
    [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)])]


class Recorded:
    """A body that drives past the origin and rotates, sampled at irregular times."""

    def __init__(self, rng, shape, duration):
        gaps = rng.uniform(0.05, 0.3, 100)
        self.times = np.cumsum(gaps)[np.cumsum(gaps) < duration]
        turn, spin = rng.uniform(-3, 3), rng.uniform(-1, 1)
        place, velocity = rng.uniform(-6, 6, 2), rng.uniform(-8, 8, 2)
        angles = turn + spin * self.times
        c, s = np.cos(angles), np.sin(angles)
        turned = np.stack([np.multiply.outer(c, shape[:, 0]) - np.multiply.outer(s, shape[:, 1]),
                           np.multiply.outer(s, shape[:, 0]) + np.multiply.outer(c, shape[:, 1])],
                          axis=2)
        places = place + np.multiply.outer(self.times - duration / 2, velocity)
        self.frames = (turned + places[:, None]).astype(np.float32).astype(float)
        self.stamps = START + np.rint(self.times * SECOND).astype(np.int64)

    def at(self, stamp):
        """Return it between two samples, each vertex on a straight line."""
        k = np.clip(np.searchsorted(self.stamps, stamp) - 1, 0, len(self.stamps) - 2)
        share = (stamp - self.stamps[k]) / (self.stamps[k + 1] - self.stamps[k])
        return self.frames[k] + share * (self.frames[k + 1] - self.frames[k])

    def messages(self, rng, topic, instance=None, max_delay=0.04):
        """Return its messages, each received some time after its stamp."""
        delays = rng.uniform(0, max_delay, len(self.times))
        return [(topic, time + delay, serialised(frame, int(stamp), instance=instance))
                for time, delay, frame, stamp in zip(self.times, delays, self.frames, self.stamps)]


def geometry(points):
    """Return the shapely geometry of vertices."""
    kind = {1: shapely.Point, 2: shapely.LineString}.get(len(points), shapely.Polygon)
    return kind(points[0] if len(points) == 1 else points)


def distance(a, b, stamp):
    return geometry(a.at(stamp)).distance(geometry(b.at(stamp)))


@pytest.mark.parametrize('samples', [200, pytest.param(2000, marks=pytest.mark.long)])
def test_bodies_with_ids_against_dense_samples(tmp_path, samples):
    """
    A sample in contact lies within a contact found, whose ends both touch.

    Footprint and obstacles have their own stamps and arrive in another order. In the last two
    recordings a robot of the shape of a U meets others with one arm and then with the other.
    """
    assert sum(compared(tmp_path / str(seed), seed, samples)
               for seed in (*range(12), 79, 89)) > 12


@pytest.mark.parametrize('seed', range(6))
def test_delays_do_not_change_contacts(tmp_path, seed):
    """Messages arrive in any order, up to three seconds late."""
    found = []
    for max_delay in (0.0, 3.0):
        rng = np.random.default_rng(seed)
        robot, *others = [Recorded(rng, SHAPES[(seed + k) % len(SHAPES)], 4.0) for k in range(6)]
        messages = robot.messages(rng, '/footprint', None, max_delay)
        for k, other in enumerate(others, 1):
            messages += other.messages(rng, '/tracks', k, max_delay)
        result = check(write(tmp_path / str(max_delay), messages, types={'/tracks': INSTANCE}),
                       set_end=None)
        assert not any(source.rejected for source in result.sources)
        found.append([(contact.obstacle, contact.first, contact.last, contact.depth)
                      for contact in result.contacts])
    assert found[0] == found[1]


def check_manifold(contact, own, other):
    """Check points and normal of a contact at its deepest moment."""
    assert np.hypot(*contact.normal) == pytest.approx(1.0, abs=1e-12)
    assert 1 <= len(contact.points) <= 2
    for point in contact.points:
        assert geometry(own).distance(shapely.Point(point)) < NEAR
    if max(len(own), len(other)) < 8:  # convex
        moved = own + (max(contact.depth, 0.0) + NEAR) * np.array(contact.normal)
        assert geometry(moved).distance(geometry(other)) > 0.0


def compared(path, seed, samples):
    """Compare the contacts of a random recording; return how many there are."""
    rng = np.random.default_rng(seed)
    duration = 4.0
    robot = Recorded(rng, SHAPES[seed % len(SHAPES)], duration)
    others = {k: Recorded(rng, SHAPES[rng.integers(len(SHAPES))], duration) for k in range(1, 9)}
    messages = robot.messages(rng, '/footprint')
    for k, other in others.items():
        messages += other.messages(rng, '/tracks', k)
    result = check(write(path, messages, types={'/tracks': INSTANCE}), set_end=None)
    assert result.problems == []
    met = 0
    for k, other in others.items():
        first = max(robot.stamps[0], other.stamps[0])
        last = min(robot.stamps[-1], other.stamps[-1])
        found = [contact for contact in result.contacts if contact.obstacle == f'tracks/{k}']
        met += len(found)
        for stamp in first + np.linspace(0, last - first, samples).astype(np.int64):
            gap = distance(robot, other, stamp)
            inside = any(contact.first <= stamp <= contact.last for contact in found)
            assert gap > 0.0 or inside, (k, stamp)
        for contact in found:
            assert first <= contact.first <= contact.last <= last
            for end in (contact.first, contact.last):
                assert distance(robot, other, end) < NEAR
            check_manifold(contact, robot.at(contact.deepest), other.at(contact.deepest))
            # Where they part by less between two samples, it need not be found.
            assert all(distance(robot, other, stamp) < 1.1e-3
                       for stamp in range(contact.first, contact.last, SECOND // 500))
    return met


@pytest.mark.parametrize('seed', [48, 801, 6624])
def test_outline_that_changes_its_shape_is_not_taken_for_its_hull(tmp_path, seed):
    """A scanner sees a U, and a small robot moves in its mouth, which parts of it leave open."""
    rng = np.random.default_rng(seed)
    outline = np.array([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (2.5, 2), (2.5, 1),
                        (2.5, 0.5), (1.5, 0.5), (0.5, 0.5), (0.5, 1), (0.5, 2), (0, 2), (0, 1)])
    seen = [outline + rng.normal(0, 0.08, outline.shape) for _ in range(2)]
    start = np.array([rng.uniform(0.6, 1.9), rng.uniform(0.55, 0.75)])
    robot = 0.3 * SHAPES[0] + start
    robots = [robot, robot + [rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)]]
    result = check(write(tmp_path / 'bag', [
        (topic, 0.1 * k, bodies[k].tolist())
        for k in range(2) for topic, bodies in (('/footprint', robots), ('/obstacles', seen))]),
        set_end=STAMPS)
    least = min(geometry(a + share * (b - a)).distance(geometry(c + share * (d - c)))
                for share in np.linspace(0.0, 1.0, 101) for (a, b), (c, d) in [(robots, seen)])
    assert least > 0.01 and result.contacts == []
    assert result.footprints[0].undetermined == 0

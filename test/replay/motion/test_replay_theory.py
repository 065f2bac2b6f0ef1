# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random recordings: the theory of docs/motion.md against an oracle, and shapely's dense samples.

`make motion` compares many more with the oracle.
"""

import argparse
from fractions import Fraction
import gc
from multiprocessing import Pool
from pathlib import Path
import sys
import tempfile
from time import perf_counter

from builders import SECOND, serialised
import numpy as np
import pytest
from random_recordings import compare, FORMS, is_in, METRE, NEAR, Recorded, times_of
from recordings import check, INSTANCE, MARKS, STAMPS, START, write

TOGETHER = 1000


def wrong_in(first):
    """Compare recordings from a number on; return what is wrong."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(first, first + TOGETHER):
            seed, k = divmod(number, len(FORMS))
            try:
                compare(seed, FORMS[k], Path(folder, 'recording'))
            except Exception as error:
                found.append(f'recording {seed}, {FORMS[k]}: {type(error).__name__}: {error}')
    gc.collect()
    return found


@pytest.mark.parametrize('first, end', [
    (0, 100), *(pytest.param(first, first + 275, marks=pytest.mark.long)
                for first in range(100, 1750, 275))])
@pytest.mark.parametrize('form', FORMS)
def test_recordings_agree_with_the_oracle(tmp_path, form, first, end):
    """Contacts, undetermined and clear times of random recordings (I2, I3)."""
    seen = sum(compare(seed, form, tmp_path / 'recording') for seed in range(first, end))
    assert form is None or (seen > 30).all()


@pytest.mark.parametrize('form', FORMS)
def test_delays_change_no_contact(tmp_path, form):
    """Topics are received late, each by a time of its own (I5)."""
    for seed in range(20):
        recorded = Recorded(seed, form)
        found = [times_of(recorded.result(tmp_path / f'{seed}{late}', (late, 3 * late)).contacts)
                 for late in (0, SECOND // 10)]
        assert found[0] == found[1]


@pytest.mark.parametrize('form', FORMS)
def test_samples_on_the_motion_change_nothing(tmp_path, form):
    """Halfway between each two samples of the footprint there is another one (I4)."""
    for seed in range(20):
        recorded = Recorded(seed, form)
        found = [recorded.result(tmp_path / f'{seed}a')]
        recorded.messages += [
            (name, (one.begin + one.end) // 2, 0, one.at(Fraction(one.begin + one.end, 2)))
            for name, own in recorded.own.items() for one in own
            if (one.begin + one.end) % 2 == 0]
        found.append(recorded.result(tmp_path / f'{seed}b'))
        for name in recorded.samples:
            for one, other in zip(*(times_of(one for one in result.contacts
                                             if one.footprint == name)
                                    for result in found), strict=True):
                assert one == pytest.approx(other, abs=1000)


@pytest.mark.parametrize('form', FORMS)
def test_part_has_the_contacts_of_the_whole(tmp_path, form):
    """A second is left out at the beginning and some at the end (I6)."""
    compared = 0
    for seed in range(12):
        recorded = Recorded(seed, form, most=64)
        whole = recorded.result(tmp_path / f'{seed}whole')
        part = recorded.result(tmp_path / f'{seed}part', start=1.0, duration=2.0)
        rng = np.random.default_rng(seed)
        times = rng.integers(part.start - START, part.end - START, 50).tolist()
        for name in recorded.samples:
            undecided, *contacts = (
                times_of(one for one in found if one.footprint == name) for found in (
                    [*part.unknown, *part.undetermined, *whole.undetermined],
                    part.contacts, whole.contacts))
            for time, distances in zip(times, recorded.distances(name, times)):
                if not is_in(undecided, time) and (
                        not distances or abs(min(distances) - METRE) > NEAR):
                    compared += 1
                    assert is_in(contacts[0], time) == is_in(contacts[1], time), (seed, name, time)
    assert compared > 20


@pytest.mark.parametrize('form', [MARKS, 'collection', 'ids', None])
def test_motion_has_each_contact_of_the_monitor(tmp_path, form):
    """
    Of obstacles that stand still, at the stamps of the footprint (I1).

    With new stamps the monitor knows only when a set begins that the one before it is whole. While
    sets are not whole it goes on to hold what is not in them.
    """
    compared = 0
    for seed in range(50):
        recorded = Recorded(seed, form, still=True, faults=True)
        live = recorded.result(tmp_path / f'{seed}live', as_live=True)
        motion = recorded.result(tmp_path / f'{seed}motion')
        for contact in live.contacts:
            stamps = {time for time, _ in recorded.samples[contact.footprint]}
            time = contact.first - START
            if time in stamps and not any(first <= time <= last
                                          for first, last in recorded.broken):
                compared += 1
                assert is_in(times_of(one for one in motion.contacts
                                      if one.footprint == contact.footprint), time), (seed, time)
    assert compared > 10


# The tolerance of the sweep in m, with the error of a time rounded to ns at these speeds.
CLOSE = 1.1e-6
SHAPES = [np.array(points, float) for points in (
    [(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (2, 0), (0.5, 1)], [(0, 0), (1.5, 0.5)], [(0, 0)],
    [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)])]


class Driven:
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
    shapely = pytest.importorskip('shapely')
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


def check_manifold(contact, own, other):
    """Check points and normal of a contact at its deepest moment."""
    assert np.hypot(*contact.normal) == pytest.approx(1.0, abs=1e-12)
    assert 1 <= len(contact.points) <= 2
    for point in contact.points:
        assert geometry(own).distance(geometry([point])) < CLOSE
    if max(len(own), len(other)) < 8:  # convex
        moved = own + (max(contact.depth, 0.0) + CLOSE) * np.array(contact.normal)
        assert geometry(moved).distance(geometry(other)) > 0.0


def compared(path, seed, samples):
    """Compare the contacts of a random recording; return how many there are."""
    rng = np.random.default_rng(seed)
    duration = 4.0
    robot = Driven(rng, SHAPES[seed % len(SHAPES)], duration)
    others = {k: Driven(rng, SHAPES[rng.integers(len(SHAPES))], duration) for k in range(1, 9)}
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
                assert distance(robot, other, end) < CLOSE
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


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--recordings', type=float, default=1e6)
    begin, done, wrong = perf_counter(), 0, 0
    last = int(parser.parse_args().recordings)
    # Garbage is collected after each thousand, which takes a tenth less time.
    with Pool(initializer=gc.disable) as pool:
        for found in pool.imap_unordered(wrong_in, range(0, last, TOGETHER)):
            done += TOGETHER
            wrong += len(found)
            rate = done / (perf_counter() - begin)
            print(*found, f'{done} recordings, {wrong} wrong, {rate:.0f} a second', sep='\n',
                  flush=True)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())

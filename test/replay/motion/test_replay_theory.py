# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The theory of docs/motion.md on random recordings, against an oracle."""

from fractions import Fraction

from builders import SECOND
import numpy as np
import pytest
from random_recordings import compare, FORMS, is_in, METRE, NEAR, Recorded, times_of
from recordings import MARKS, START


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

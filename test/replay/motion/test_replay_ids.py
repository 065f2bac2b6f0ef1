# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contacts in recorded motion with obstacles that have ids."""

from builders import SECOND, serialised
import pytest
from recordings import at, box, run, samples, START, times
from test_replay_motion import run_again


def track(time, number, x, delay=0.0, **place):
    """Return where an id is at a time, received later."""
    return '/tracks', time + delay, serialised(
        box(x, **place), START + round(time * SECOND), instance=number)


@pytest.mark.parametrize('first, second', [(5.0, 0.5), (0.5, 5.0), (0.5, 0.5)])
def test_both_places_of_an_id_count_until_its_next_stamp(tmp_path, first, second):
    """One of two with a stamp is linked to the next, the other stands until then, as live."""
    messages = samples([0.0] * 30) + [track(k / 10 + 0.03, 1, first if k == 10 else 5.0)
                                      for k in range(30)] + [track(1.03, 1, second, 0.001)]
    result = run(tmp_path, messages, None)
    assert times(result) == pytest.approx(
        [1.03 if first > 1 else 1.03 - 0.1 / 9, 1.13 if second < 1 else 1.03 + 0.1 / 9])
    assert not any(one.at_end for one in result.contacts)
    assert all(any(one.first <= contact.first <= one.last for one in result.contacts)
               for contact in run_again(tmp_path, as_live=True).contacts)


@pytest.mark.parametrize('timeout, sent, touches', [
    (0.5, [(0.0, 1, -5.0), (0.0, 2, 9.0), (0.45, 1, 5.0), (0.52, 2, 9.0), (0.9, 1, 5.0),
           (0.97, 2, 9.0)], [0.18, 0.27]),
    (0.5, [(0.95, 2, 9.0), (1.0, 1, 9.0), (1.0, 1, 0.5, 0.001), (1.48, 1, 9.0), (1.53, 2, 9.0)],
     [1.0, 1.48]),
    (0.05, [(0.1, 1, 0.5), *((0.12 + 0.02 * k, 2 + k, 9.0) for k in range(20))], [0.1, 0.16])],
    ids=['passes, and another one comes 70 ms after it, later than its timeout',
         'was in two places, and another one comes 50 ms after its next stamp',
         'is gone with the first message after a timeout shorter than those taken together'])
def test_an_id_touches_until_its_next_stamp_or_timeout(tmp_path, timeout, sent, touches):
    messages = samples([0.0] * 20) + [track(*one) for one in sent]
    result = run(tmp_path, messages, None, parameters={'tracks.timeout': timeout})
    assert times(result) == pytest.approx(touches)


def test_curve_is_of_all_ids_however_they_are_sent(tmp_path):
    """One at 2 m comes twice a second, another at 5 m ten times, for some time with it."""
    messages = samples([0.0] * 40) + [track(k / 10, 1, 6.0) for k in range(40)] + [
        track(k / 10, 2, 3.0) for k in range(40) if k % 5 == 0 or k < 10]
    footprint, = run(tmp_path, messages, None, parameters={'tracks.timeout': 1.0}).footprints
    assert {value for _, value in footprint.separation if value is not None} == {2.0}
    assert len(footprint.separation) > 35


def test_ids_are_matched_when_they_cross(tmp_path):
    messages = samples([0] * 30) + [
        track(k / 10 + 0.001 * number, number, x, 0.009 - 0.001 * number)
        for k in range(30) for number, x in ((7, k - 10), (8, 18 - k))]
    result = run(tmp_path, messages, None)
    assert [one.obstacle for one in result.contacts] == ['tracks/7', 'tracks/8']
    assert times(result) == pytest.approx([0.907, 1.107, 1.708, 1.908], abs=1e-6)


def test_obstacle_at_rest_with_an_id_is_one_contact(tmp_path):
    """The robot drives past, and both are sent 16 times per second."""
    messages = [message for k in range(128) for message in (
        at(k / 16, box(1.5 * k / 16), 0.01, '/footprint'),
        track(k / 16, 1, 6 + 1 / 64, 0.02, y=0.25, size=0.25))]
    found = [time + 0.01 for time in times(run(tmp_path, messages, None))]  # it begins at 10 ms
    assert found == pytest.approx([(5 + 1 / 64) / 1.5, (6 + 1 / 64 + 0.25) / 1.5], abs=1e-5)


@pytest.mark.parametrize('as_live', (False, True))
@pytest.mark.parametrize('refused, parameters', [
    (track(1.0, 2, float('nan')), {}), (track(1.0, 0, 9.0), {'tracks.max_count': 1})],
    ids=('invalid, with an id', 'more than max_count, without one'))
def test_refused_message_shows_that_the_publisher_is_alive(tmp_path, as_live, refused, parameters):
    """What the robot touches is held until one timeout after a message of another obstacle."""
    messages = samples([0.0] * 40) + [track(0.1, 1 if not parameters else 0, 0.5), refused]
    result = run(tmp_path, messages, None, as_live=as_live, parameters={
        'tracks.timeout': 1.0, **parameters})
    assert times(result) == pytest.approx([0.1, 2.0], abs=1e-6)


def test_refused_id_changes_nothing_about_those_of_its_map(tmp_path):
    """One id is in two places of a map, and another one between them is refused."""
    marked = {'tracks.timeout': 0.0, 'tracks.set_end': 'empty_polygon'}
    messages = samples([0.0] * 10) + [
        track(0.1, 1, 0.5), track(0.1, 2, float('nan'), 0.001), track(0.1, 1, 9.0, 0.002),
        ('/tracks', 0.103, serialised([], START + SECOND // 10, instance=1))]
    contact, = run(tmp_path, messages, None, parameters=marked).contacts
    assert contact.at_end

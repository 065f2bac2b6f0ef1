# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where motion is undetermined: neither clear nor a contact."""

import math

from builders import SECOND
import numpy as np
import pytest
from recordings import at, box, MARKS, run, samples, since, SOURCE, STAMPS, START, times
from sat_collision.replay.model.result import Options, Verdict


def test_changed_number_of_vertices_is_undetermined_motion(tmp_path):
    """The result says when, and is clear only where that is allowed."""
    messages = samples([0] * 10) + samples([-5] * 5, '/obstacles')
    messages += [('/obstacles', k / 10, box(5)[:3]) for k in range(5, 10)]
    result = run(tmp_path, messages)
    assert result.verdict is Verdict.UNKNOWN and result.contacts == []
    assert [source.undetermined for source in result.sources] == [0, SECOND // 10]
    assert times(result, result.undetermined) == pytest.approx([0.4, 0.5])
    one, = result.undetermined
    assert one.reasons == [f'it is not known how something of {SOURCE} moved']
    footprint, = result.footprints
    assert footprint.undetermined == SECOND // 10
    assert footprint.clear + footprint.unknown + footprint.undetermined == (
        result.end - result.start)
    for limit, verdict in ((0.1, Verdict.CLEAR), (0.099, Verdict.UNKNOWN)):
        result.options = Options(max_undetermined=limit)
        assert result.verdict is verdict


@pytest.mark.parametrize('moves', [True, False])
def test_polygon_that_may_have_moved_is_undetermined(tmp_path, moves):
    """Of sets without a declared end: one goes and one comes, or one comes to the other."""
    messages = samples([0.0] * 40) + samples([5.0] * (20 if moves else 40), '/obstacles')
    messages += [('/obstacles', k / 10, box(-5.0)) for k in range(20, 40)]
    result = run(tmp_path, messages, None,
                 parameters={f'{SOURCE}.timeout': 0.3, 'future_tolerance': 0.1})
    assert result.contacts == []
    found = [one for one in result.undetermined if one.reasons[0].endswith('obstacle moved')]
    assert times(result, found) == pytest.approx([1.9, 2.0] if moves else [])
    assert result.verdict is (Verdict.UNKNOWN if moves else Verdict.CLEAR)


def test_silence_of_a_source_that_never_sees_anything_is_undetermined(tmp_path):
    """Its publisher ends empty sets, but none for a second."""
    messages = samples([0.0] * 30) + [
        ('/obstacles', k / 10, []) for k in range(30) if not 10 < k < 20]
    result = run(tmp_path, messages, MARKS, parameters={f'{SOURCE}.timeout': 0.5})
    assert times(result, result.undetermined[:1]) == pytest.approx([1.0, 1.5])
    assert result.verdict is Verdict.UNKNOWN


def test_time_after_the_last_footprint_is_undetermined(tmp_path):
    """It is not clear, and does not fail the check as long as the footprint is not silent."""
    result = run(tmp_path, samples([0.0] * 20) + samples([5.0] * 24, '/obstacles'))
    footprint, = result.footprints
    assert result.verdict is Verdict.CLEAR
    assert footprint.undetermined == pytest.approx(0.4 * SECOND)
    assert footprint.clear == footprint.last - result.start - footprint.unknown


@pytest.mark.parametrize('x, undetermined', [(0.0, []), (10.0, [3.0, 48.0])])
def test_footprint_that_never_times_out_stands(tmp_path, x, undetermined):
    """It is silent for 45 s, and an obstacle touches it; then it is seen there, or elsewhere."""
    messages = [at(k / 10, box(0.0 if k < 40 else x), topic='/footprint')
                for k in (*range(31), *range(480, 500))]
    messages += [at(k / 10, box(0.5 if 100 <= k < 200 else 5.0, 9.0 * (k >= 200)))
                 for k in range(500)]
    result = run(tmp_path, messages, parameters={'footprint.timeout': 0.0})
    assert times(result) == pytest.approx([9.9, 20.0], abs=0.11)
    assert times(result, result.undetermined) == pytest.approx(undetermined)


@pytest.mark.parametrize('timeout', [0.0, 60.0])
def test_undetermined_time_counts_whatever_the_last_stamp_of_the_footprint_is(tmp_path, timeout):
    """Its number of vertices changes at 7.5 s; its last message is stamped 13 s back."""
    others = [(4, 0), (5, 0), (5, 1), (4.5, 1.2), (4, 1)]
    messages = [at(k / 10, box(0.0) if k < 75 else others, topic='/footprint')
                for k in range(201)] + samples([2.0] * 201, '/obstacles')
    result = run(tmp_path, [*messages, at(7.0, others, 13.05, '/footprint')],
                 parameters={'footprint.timeout': timeout})
    assert times(result, result.undetermined[:1]) == pytest.approx([7.4, 7.5])
    assert (result.verdict, result.footprints[0].last) == (Verdict.UNKNOWN, START + 20 * SECOND)


def test_footprint_stamped_by_another_clock_is_undetermined(tmp_path):
    """Its stamps are 11 s behind, and never compared with those of obstacles."""
    messages = [message for k in range(101) for message in (
        at(k / 10 - 11.0, box(0.0 if k < 50 else 0.01 * k), 11.0, '/footprint'),
        at(k / 10, box(3.0)))]
    result = run(tmp_path, messages, parameters={'footprint.timeout': 0.0})
    assert result.footprints[0].clear == 0 and result.verdict is Verdict.UNKNOWN


def test_bodies_older_than_the_timeout_are_not_linked_though_their_sets_are_nearer(tmp_path):
    """Each is 0.51 s after the one before; from one set to the next it is 0.49 s."""
    messages = samples([9.0] * 8) + [at(0.05, [])] + [
        at(time, box(x) if x else [], delay) for time, delay, x in (
            (0.12, 0.0, 3.0), (0.1, 0.021, 0.5), (0.12, 0.002, None),
            (0.63, 0.0, 3.5), (0.61, 0.021, 1.0), (0.63, 0.002, None))]
    result = run(tmp_path, messages, MARKS, parameters={'obstacle.timeout': 0.5})
    assert times(result, result.undetermined) == pytest.approx([0.12, 0.6], abs=1e-6)


@pytest.mark.parametrize('later', [[], [3.0, 3.1]])
def test_set_that_one_ends_all_of_which_is_refused_is_not_whole(tmp_path, later):
    """The fifth one lacks a polygon; after the refused one others come 2 s later, or none."""
    refused = [(float('nan'), 0.0)]
    messages = samples([9.0] * 35) + [at(time, box(0.0)) for time in (0, 0.2, 0.4, 0.6, 0.8)] + [
        at(0.8, refused), at(1.0, refused)] + [at(time, box(0.0)) for time in later]
    result = run(tmp_path, messages, STAMPS)
    assert since(result, result.undetermined[0].first) == [pytest.approx(0.6)]


@pytest.mark.parametrize('place, moments', [((0.0, 0.0), []), ((-0.5, -2.0), [0.305944724])])
def test_outline_that_crosses_itself_where_it_meets_something_is_undetermined(
        tmp_path, place, moments):
    """An L turns by 221 degrees between two messages; it may be valid as it meets a box."""
    shape = np.array([(-1, -1), (1, -1), (1, -0.8), (-0.8, -0.8), (-0.8, 1), (-1, 1)])
    c, s = math.cos(3.8577), math.sin(3.8577)
    ends = shape + [0.5, -3.5], shape @ [(c, s), (-s, c)] + [0.5, 4.5]
    met = np.add(box(0.0, size=0.3), place).tolist()
    messages = [message for k in range(8) for message in (
        at(k / 10, ends[k > 3].tolist(), 0.0, '/footprint'), at(k / 10, met))]
    result = run(tmp_path, messages)
    assert result.footprints[0].undetermined == SECOND // 10
    assert [since(result, one.first, one.last, one.deepest) for one in result.contacts] == [
        pytest.approx([moment] * 3) for moment in moments]
    assert result.verdict is (Verdict.COLLISION if moments else Verdict.UNKNOWN)

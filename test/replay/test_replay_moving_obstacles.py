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

"""Obstacles with ids that move, in recordings: as the monitor says, and by recorded motion."""

from fractions import Fraction
import math

from builders import SECOND, serialised
import pytest
from recordings import box, INSTANCE, nanoseconds, write
from sat_collision.messages.interfaces import deserialize, DiagnosticArray, Float64
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import Limits, Options
from sat_collision.replay.run import check

# A robot of 1 m at 1/2 m/s, 7 m before a person at 2 m/s, who would be met after 2.8 s; one who
# walks beside, and a box that stands behind the person. All that is sent is exact in float32.
ROBOT, PERSON, APART = Fraction(1, 2), Fraction(-2), 7
TICK = Fraction(1, 8)
IDS = {7: (lambda t: 1 + APART + PERSON * t, 0.0), 8: (lambda t: ROBOT * t, 9.0),
       9: (lambda t: Fraction(12), 0.0)}


def meeting(ticks=20, changed=None):
    """Return how they come towards each other; after a tick the one beside has another shape."""
    messages = []
    for k in range(ticks):
        time = k * TICK
        messages.append(('/footprint', float(time), box(float(ROBOT * time))))
        for number, (x, y) in IDS.items():
            corners = box(float(x(time)), y)
            if number == 8 and changed is not None and k >= changed:
                corners = corners[:3]
            messages.append(('/people', float(time), serialised(
                corners, nanoseconds(float(time)), instance=number)))
    return messages


def run(path, messages, moving=True, **options):
    result = check(write(path, messages, types={'/people': INSTANCE}), Options(
        footprints=('/footprint',), obstacles=('people:=/people',),
        parameters={'people.moving': moving, 'people.timeout': 0.5, 'horizon': 20.0}, **options))
    assert not result.problems and not result.contacts
    return result


def exact(time):
    """Return in how many seconds the person is met from a time on."""
    return APART / (ROBOT - PERSON) - time


@pytest.mark.parametrize('moving', [True, False])
def test_the_least_time_by_recorded_motion_is_exact(tmp_path, moving):
    """It knows how all move, whatever the monitor is told to assume."""
    result = run(tmp_path / 'bag', meeting(), moving, min_ttc=0.1)
    footprint, = result.footprints
    unknown = result.unknown[-1].last
    found = {Fraction(time - result.origin, SECOND): value
             for time, value in footprint.time_to_collision if time >= unknown}
    assert len(found) > 8
    for time, value in found.items():
        assert exact(time) - Fraction(1, 10**6) <= value <= exact(time)
    least = footprint.soonest
    assert (least.time, least.obstacle) == (nanoseconds(float(18 * TICK)), 'people/7')
    assert least.time_to_collision == min(found.values()) == pytest.approx(0.55, abs=1e-6)


def said(path, messages, moving=True):
    """Return what the monitor would have said: (s, time, values of the state)."""
    run(path / 'bag', messages, moving, as_live=True, write_bag=str(path / 'out'))
    topics = ['/footprint_monitor/footprint/time_to_collision', '/footprint_monitor/state']
    times, found = {}, []
    with Recording(path / 'out', Limits()) as recording:
        for topic, time, data in recording.messages(topics):
            if topic == topics[0]:
                times[time] = deserialize(data, Float64).data
            else:
                state = deserialize(data, DiagnosticArray).status[0]
                found.append((Fraction(time - nanoseconds(0.0), SECOND), times.get(time),
                              {one.key: one.value for one in state.values}))
    return found


def test_as_live_times_are_those_of_all_that_moves(tmp_path):
    """Never late, early by the gap of 1 mm at most, and none before each came twice."""
    known = 0
    for time, seconds, state in said(tmp_path, meeting()):
        if state['state'] == 'clear' and time > 2 * TICK:
            known += 1
            assert exact(time) - Fraction(1, 1000) <= seconds <= exact(time) + Fraction(1, 10**9)
            assert state['first contact with'] == 'people/7'
            assert state['obstacles of unknown motion'] == ''
    assert known > 10


def test_as_live_obstacles_stand_unless_they_move(tmp_path):
    """The robot alone comes at 1/2 m/s, to where the person was last; the box is out of reach."""
    known = 0
    for time, seconds, state in said(tmp_path, meeting(), moving=False):
        if state['state'] == 'clear' and seconds < math.inf:
            known += 1
            seen = time - time % TICK
            left = (APART + PERSON * seen - ROBOT * time) / ROBOT
            before = (APART + PERSON * (seen - TICK) - ROBOT * time) / ROBOT
            assert any(one - Fraction(1, 100) <= seconds <= one + Fraction(1, 10**9)
                       for one in (left, before))
    assert known > 5


def test_as_live_unknown_motion_is_named_and_there_is_no_time(tmp_path):
    """One beside has another shape once, and moves on in that: for a message it is not known."""
    states = [(time, seconds, state['obstacles of unknown motion'])
              for time, seconds, state in said(tmp_path, meeting(changed=12))
              if state['state'] == 'clear' and time > 2 * TICK]
    unknown = [time for time, _, names in states if names]
    assert {names for _, _, names in states} == {'', 'people/8'}
    assert unknown and 12 * TICK <= min(unknown) and max(unknown) <= 13 * TICK
    assert all(math.isnan(seconds) == bool(names) for _, seconds, names in states)

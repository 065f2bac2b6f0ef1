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

"""Times to collision in recordings: by commands, and among obstacles that move."""

from fractions import Fraction
import math
import struct

from builders import command, SECOND, serialised, transforms
import pytest
from recordings import box, INSTANCE, nanoseconds, SOURCE, write
from sat_collision.messages.interfaces import deserialize, DiagnosticArray, Float64
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import Limits, Options
from sat_collision.replay.run import check


def published(bag):
    """Return the times to collision and the values of the states in a bag, by their time in s."""
    topics = ['/footprint_monitor/footprint/time_to_collision', '/footprint_monitor/state']
    times, states = {}, {}
    with Recording(bag, Limits()) as recording:
        for topic, time, data in recording.messages(topics):
            time = Fraction(time - nanoseconds(0.0), SECOND)
            if topic == topics[0]:
                times[time] = deserialize(data, Float64).data
            else:
                status, = deserialize(data, DiagnosticArray).status
                states[time] = {one.key: one.value for one in status.values}
    return times, states


STAMPED = 'geometry_msgs/msg/TwistStamped'
TWIST = 'geometry_msgs/msg/Twist'
PARAMETERS = {'frame_id': 'odom', 'footprint.points': [-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5],
              'footprint.frame_id': 'base', 'footprint.cmd_vel': 'cmd_vel',
              'footprint.timeout': 0.5}
# The wall is 5 m to the left of the robot, which is turned and does not move.
YAW = 0.75
WALL = [(-9.0, 5.5), (9.0, 5.5), (9.0, 6.5), (-9.0, 6.5)]
SPEEDS = [Fraction(2 + k % 5) for k in range(100)]


def twist(vx, vy=0.0, omega=0.0):
    return b'\0\1\0\0' + struct.pack('<6d', vx, vy, 0.0, 0.0, 0.0, omega)


def told(kind, k, *velocity, **more):
    """Return a command, stamped with its tenth of a second if it has a stamp."""
    return '/cmd_vel', k / 10, (twist(*velocity) if kind == TWIST else command(
        *velocity, stamp=nanoseconds(k / 10), **more))


def stand(tenths, commands):
    """Return a robot that stands for so long, and is told what commands say, just after."""
    c, s = math.cos(YAW), math.sin(YAW)
    wall = [(c * x - s * y, s * x + c * y) for x, y in WALL]
    messages = [*commands]
    for k in range(tenths):
        messages += [
            ('/tf', k / 10, transforms(('odom', 'base', nanoseconds(k / 10), 0.0, 0.0, YAW))),
            *(('/obstacles', k / 10, serialised(points, nanoseconds(k / 10), 'odom'))
              for points in (wall, []))]
    return sorted(messages, key=lambda message: (message[1], message[0] == '/cmd_vel'))


def run(path, messages, kind, parameters=PARAMETERS, **options):
    result = check(write(path, messages, types={'/tf': 'tf2_msgs/msg/TFMessage',
                                                '/cmd_vel': kind}),
                   Options(parameters=parameters, obstacles=[f'{SOURCE}:=/obstacles'], **options))
    assert not result.problems
    return result


def samples(result):
    """Return the times to collision by tenths of a second since the recording begins."""
    return {round((time - result.origin) * 10 / SECOND): value
            for time, value in result.footprints[0].time_to_collision}


@pytest.mark.parametrize('kind', [STAMPED, TWIST])
@pytest.mark.parametrize('clock', ['receive', 'header'])
def test_recorded_motion_goes_on_as_it_was_told(tmp_path, kind, clock):
    """To its left, at another speed each time: 5 m by that; where it truly went, nowhere."""
    messages = stand(100, [told(kind, k, 0.0, float(speed)) for k, speed in enumerate(SPEEDS)])
    result = run(tmp_path / 'bag', messages, kind, min_ttc=0.1, clock=clock,
                 parameters={**PARAMETERS, f'{SOURCE}.timeout': 0.3})
    found = samples(result)
    assert found == {k: None if k < 1 or 5 / SPEEDS[k] > 3 else
                     pytest.approx(float(5 / SPEEDS[k]), abs=1e-5) for k in found}
    assert sum(value is not None for value in found.values()) >= 90
    # The wall is where float32 has it.
    assert all(value is None or value <= 5 / SPEEDS[k] + 1e-6 for k, value in found.items())
    least = result.footprints[0].soonest
    assert least.time_to_collision == pytest.approx(5 / 6, abs=1e-5)
    assert least.obstacle == f'{SOURCE}/0'
    source, = (one for one in result.sources if one.name == 'footprint.cmd_vel')
    assert (source.topic, source.received, source.rejected) == ('/cmd_vel', 100, {})


def test_by_the_motion_itself_it_stands(tmp_path):
    parameters = {**PARAMETERS}
    del parameters['footprint.cmd_vel']
    result = run(tmp_path / 'bag', stand(16, [told(TWIST, 0, 9.0)]), TWIST, parameters,
                 min_ttc=0.1)
    assert set(samples(result).values()) == {None}


def test_what_it_is_not_told_is_unknown(tmp_path):
    """Told for the last time at 0.4 s, which holds for 0.5 s; a bad one at 1.2 s ends all."""
    commands = [told(STAMPED, k, 0.0, 5.0) for k in range(5)]
    commands += [told(STAMPED, 11, 0.0, 5.0), told(STAMPED, 12, math.nan),
                 told(STAMPED, 13, 0.0, 5.0, frame_id='odom')]
    result = run(tmp_path / 'bag', stand(16, commands), STAMPED, min_ttc=0.1)
    known = {k for k, value in samples(result).items() if value is not None}
    assert known >= {3, 4, 5, 6, 7, 8, 11} and not known & {10, 12, 13, 14, 15}
    source, = (one for one in result.sources if one.name == 'footprint.cmd_vel')
    assert source.rejected == {'no velocity of a robot': 1, 'command in another frame': 1}
    assert source.examples['no velocity of a robot'].startswith(
        'footprint.cmd_vel: a message on /cmd_vel was rejected, no velocity of a robot: nan m/s')


@pytest.mark.parametrize('kind', [STAMPED, TWIST])
@pytest.mark.parametrize('clock', ['receive', 'header'])
def test_as_live_it_is_what_the_node_would_have_said(tmp_path, kind, clock):
    """In the bag that is written: time and velocity by the last command, until it expires."""
    out = tmp_path / 'out'
    messages = stand(30, [told(kind, k, 0.0, float(speed)) for k, speed in enumerate(SPEEDS[:16])])
    run(tmp_path / 'bag', messages, kind, as_live=True, write_bag=str(out), clock=clock)
    times, states = published(out)
    times = {round(10 * time): seconds for time, seconds in times.items()}
    velocities = {round(10 * time): state['velocity'] for time, state in states.items()}
    # What is written at a message's own time may come before or after it.
    for k in range(3, 15):
        near = {min(float(5 / speed), math.inf) for speed in SPEEDS[k - 1:k + 1]}
        assert any(times[k] == pytest.approx(seconds, abs=0.11) for seconds in near)
        assert velocities[k].endswith('0.000 rad/s by command')
    assert math.isnan(times[25])
    assert velocities[25] == 'unknown: no command on /cmd_vel for 1.0 s'


def test_a_twist_has_no_stamp_whatever_its_numbers(tmp_path):
    """The bytes of a speed that fades out make a stamp, by which nothing is put in order."""
    fading = struct.unpack('<d', struct.pack('<iI', 1_600_000_000, 7))[0]
    assert 0.0 < fading < 1e-100
    for clock in ('receive', 'header'):
        commands = [('/cmd_vel', k / 10, twist(fading, 5.0)) for k in range(16)]
        result = run(tmp_path / clock, stand(16, commands), TWIST, min_ttc=0.1, clock=clock)
        assert samples(result)[9] == pytest.approx(1.0, abs=1e-5)


def test_a_recording_without_commands_or_of_another_type(tmp_path):
    result = run(tmp_path / 'none', stand(16, []), STAMPED, min_ttc=0.1)
    assert 'footprint.cmd_vel: the recording has no topic /cmd_vel' in result.notes[0]
    messages = stand(16, [('/cmd_vel', 0.0, box(0))])
    result = check(write(tmp_path / 'other', messages, types={'/tf': 'tf2_msgs/msg/TFMessage'}),
                   Options(parameters=PARAMETERS, obstacles=[f'{SOURCE}:=/obstacles']))
    assert any('footprint.cmd_vel: /cmd_vel has the type geometry_msgs/msg/PolygonStamped, not '
               f'{STAMPED} or {TWIST}' in problem for problem in result.problems)


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


def meet(path, messages, moving=True, **options):
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
    result = meet(tmp_path / 'bag', meeting(), moving, min_ttc=0.1)
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
    """Yield what the node would have said: s, time to collision, values of the state."""
    meet(path / 'bag', messages, moving, as_live=True, write_bag=str(path / 'out'))
    times, states = published(path / 'out')
    return [(time, times.get(time), state) for time, state in states.items()]


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

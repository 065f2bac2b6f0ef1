# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Times to collision in recordings: by motion, by commands, and with moving obstacles."""

import csv
from fractions import Fraction
import json
import math
import struct
from xml.etree import ElementTree

from builders import command, SECOND, serialised, transforms
import numpy as np
import pytest
from recordings import (
    box, check, declared, INSTANCE, main, MARKS, nanoseconds, since, SOURCE, STAMPS, write)
from sat_collision.messages.rosbags_interfaces import STORE
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import Limits, Options, Verdict


def samples(result):
    """Return the times to collision by tenths of a second."""
    return {round((time - result.origin) * 10 / SECOND): value
            for time, value in result.footprints[0].time_to_collision}


def known(result):
    return {k: value for k, value in samples(result).items() if value is not None}


def approach(gap=Fraction(5), back=30):
    """Return a robot at 5/4 m/s before a wall, which drives back after some tenths."""
    messages = []
    for k in range(back + 20):
        x = Fraction(min(k, 2 * back - k), 8)
        messages += [('/footprint', k / 10, box(float(x))),
                     ('/obstacles', k / 10, box(float(1 + gap))), ('/obstacles', k / 10, [])]
    return messages


def test_time_until_within_the_margin(tmp_path):
    result = check(write(tmp_path / 'bag', approach()),
                   Options(min_ttc=0.5, parameters={'margin': 0.25}))
    found = samples(result)
    assert (found[29], found[9]) == (pytest.approx(0.9, abs=1e-9), pytest.approx(2.9, abs=1e-9))


def test_times_before_a_wall_are_exact(tmp_path):
    """Unknown at first, then 5 m at 5/4 m/s, and none while it drives back."""
    result = check(write(tmp_path / 'bag', approach()), Options(min_ttc=0.5))
    found = samples(result)
    assert result.unknown[0].last == nanoseconds(0.1) and found.pop(0) is None
    for k, value in found.items():
        exact = (5 - Fraction(k, 8)) / Fraction(5, 4)
        if 10 < k < 30:
            assert exact - Fraction(1, 10**9) < value <= exact
        elif k != 10:
            assert value is None
    least = result.footprints[0].soonest
    assert (least.time, least.obstacle) == (nanoseconds(2.9), f'{SOURCE}/0')
    assert least.time_to_collision == found[29] == pytest.approx(1.1, abs=1e-9)
    assert result.verdict is Verdict.CLEAR


def test_time_with_two_moving_bodies(tmp_path):
    """12 m apart at 2 m/s and 3 m/s, far from a body at rest; every tenth message is refused."""
    messages = []
    for k in range(20):
        own = box(k / 5) if k % 10 else [*box(k / 5), (math.nan, 0)]
        messages += [('/footprint', k / 10, own), ('/obstacles', k / 10, box(0, 90)),
                     ('/obstacles', k / 10, box(13 - 3 * k / 10)), ('/obstacles', k / 10, [])]
    result = check(write(tmp_path / 'bag', messages), Options(min_ttc=0.0))
    assert known(result) == {k: pytest.approx(2.4 - k / 10, abs=1e-5)
                             for k in (*range(1, 9), *range(11, 19))}
    assert result.footprints[0].refused == ['footprint']


@pytest.mark.parametrize('walls, first', [
    ({'walls': [7, 6]}, 'walls/1'), ({'far': [7], 'near': [6]}, 'near/0'),
    ({'near': [6], 'far': [7]}, 'near/0')])
def test_wall_that_is_met_first_is_named(tmp_path, walls, first):
    """At 2 m/s towards two walls, the one behind the other: of one set, or of two sources."""
    messages = []
    for k in range(16):
        messages += [('/footprint', k / 10, box(k / 5))] + [
            (f'/{name}', k / 10, wall) for name, places in walls.items()
            for wall in (*map(box, places), [])]
    result = check(write(tmp_path / 'bag', messages), Options(
        footprints=('/footprint',), obstacles=[f'{name}:=/{name}' for name in walls],
        min_ttc=0.0, parameters=declared(MARKS, *walls)))
    least = result.footprints[0].soonest
    assert (least.obstacle, least.time) == (first, nanoseconds(1.4))
    assert least.time_to_collision == pytest.approx(1.1, abs=1e-6)


@pytest.mark.parametrize('seed', range(4))
def test_times_on_arcs_are_never_late(tmp_path, seed):
    """Compared with constant twists sampled every millisecond."""
    shapely = pytest.importorskip('shapely')
    affine_transform = pytest.importorskip('shapely.affinity').affine_transform
    rng = np.random.default_rng(seed)
    speed, turn = rng.uniform(1, 3), rng.choice([-1, 1]) * rng.uniform(0.3, 1.0)
    outline = shapely.Polygon([(-0.5, -0.3), (1, -0.3), (1, 0.3), (-0.5, 0.3)])

    def placed(time):
        c, s = math.cos(turn * time), math.sin(turn * time)
        return affine_transform(outline, [c, -s, s, c, speed / turn * s, speed / turn * (1 - c)])

    x, y = placed(2.6).centroid.coords[0]
    wall = shapely.box(x - 0.4, y - 0.4, x + 0.4, y + 0.4)
    messages = []
    for k in range(15):
        messages += [('/footprint', k / 10, [*placed(k / 10).exterior.coords][:-1]),
                     ('/walls', k / 10, [*wall.exterior.coords][:-1])]
    result = check(write(tmp_path / 'bag', messages),
                   Options(footprints=('/footprint',), obstacles=('/walls',), min_ttc=0.0,
                           parameters=declared(STAMPS, 'walls')))
    touched = next(time for time in np.arange(0, 3.5, 1e-3) if placed(time).intersects(wall))
    found = known(result)
    assert len(found) >= 10
    for k, value in found.items():
        assert touched - 1e-3 - 2e-3 / speed <= value + k / 10 <= touched + 1e-4


def test_no_time_while_unknown(tmp_path):
    """Before the first whole set, and while the wall is silent."""
    messages = [(topic, time, content) for topic, time, content in approach(Fraction(3), back=20)
                if topic == '/footprint' or not 1.0 < time < 3.0]
    result = check(write(tmp_path / 'bag', messages),
                   Options(min_ttc=0.0, parameters={f'{SOURCE}.timeout': 0.5}))
    unknown = [(one.first, one.last) for one in result.unknown]
    assert len(unknown) == 2 and unknown[1][1] - unknown[1][0] > SECOND
    assert not any(first <= time < last for first, last in unknown for time, value in (
        result.footprints[0].time_to_collision) if value is not None)
    assert len(known(result)) > 5


def test_time_while_another_footprint_is_unknown(tmp_path):
    result = check(write(tmp_path / 'bag', [('/other', 0.0, box(0, 90)), *approach()]), Options(
        footprints=('/footprint', '/other'), min_ttc=0.0, parameters=declared(MARKS)))
    assert {one.footprint for one in result.unknown if one.last > nanoseconds(3.0)} == {'other'}
    assert samples(result)[29] == pytest.approx(1.1, abs=1e-9)


def test_times_at_the_first_message_of_each_tenth_of_a_second(tmp_path):
    """The footprint comes every 20 ms, and obstacles every 50 ms."""
    messages = [('/footprint', k / 50, box(k / 50)) for k in range(50)]
    for k in range(20):
        messages += [('/obstacles', k / 20, box(3)), ('/obstacles', k / 20, [])]
    result = check(write(tmp_path / 'bag', messages), Options(min_ttc=0.0))
    assert since(result, *(time for time, value in result.footprints[0].time_to_collision
                           if value is not None)) == [k / 10 for k in range(1, 10)]


def test_min_ttc(tmp_path, capsys):
    """It drives back 1.1 s before the wall."""
    bag = str(write(tmp_path / 'bag', approach()))
    files = {option: str(tmp_path / f'result.{option}') for option in ('json', 'csv', 'junit')}
    outputs = [part for option, path in files.items() for part in (f'--{option}', path)]
    assert main([bag, *outputs, '--max-unknown', '1']) == 0
    footprint, = json.load(open(files['json']))['bags'][0]['footprints']
    assert not {'soonest', 'time_to_collision'} & {*footprint}
    assert main([bag, '--min-ttc', '1']) == main([bag, '--min-ttc', '0']) == 0
    capsys.readouterr()
    page = tmp_path / 'page.html'
    assert main([bag, *outputs, '--plot', str(page), '--min-ttc', '1.5']) == 1
    assert '"ahead":[[0.0,null],[0.1,null],' in page.read_text()
    words = f'a collision with {SOURCE}/0 was 1.100 s ahead at 2.900 s, --min-ttc is 1.5 s'
    assert f'footprint: {words}' in capsys.readouterr().out
    failure = ElementTree.parse(files['junit']).find('.//testcase[@name="footprint"]/failure')
    assert failure.get('message') == words
    found, = json.load(open(files['json']))['bags']
    footprint, = found['footprints']
    assert (found['verdict'], found['min_ttc'], found['contacts']) == ('collision', 1.5, [])
    assert footprint['soonest'] == {'time_to_collision': pytest.approx(1.1, abs=1e-9),
                                    'time': nanoseconds(2.9), 'obstacle': f'{SOURCE}/0'}
    with open(files['csv'], newline='') as file:
        rows = [row for row in csv.DictReader(file) if row['kind'] == 'time to collision']
    assert [float(row['time_to_collision_s']) for row in rows] == [
        value for _, value in footprint['time_to_collision'] if value is not None]
    assert rows[-1]['first_ns'] == str(nanoseconds(2.9))
    assert main([bag, '--min-ttc', '1.5', '--expect', files['json']]) == 0


def test_min_ttc_needs_recorded_motion(capsys):
    with pytest.raises(SystemExit) as ended:
        main(['bag', '--min-ttc', '1', '--as-live'])
    assert ended.value.code == 3 and '--min-ttc' in capsys.readouterr().err


def published(bag):
    """Return the times to collision and the values of states in a bag, by their time in s."""
    topics = ['/footprint_monitor/footprint/time_to_collision', '/footprint_monitor/state']
    times, states = {}, {}
    with Recording(bag, Limits()) as recording:
        for topic, received, row in recording.rows(topics):
            for time, data in zip(received, row):
                time = Fraction(time - nanoseconds(0.0), SECOND)
                if topic == topics[0]:
                    times[time] = STORE.deserialize_cdr(data, 'std_msgs/msg/Float64').data
                else:
                    status, = STORE.deserialize_cdr(
                        data, 'diagnostic_msgs/msg/DiagnosticArray').status
                    states[time] = {one.key: one.value for one in status.values}
    return times, states


STAMPED = 'geometry_msgs/msg/TwistStamped'
TWIST = 'geometry_msgs/msg/Twist'
PARAMETERS = {'frame_id': 'odom', 'footprint.points': [-0.5, -0.5, 0.5, -0.5, 0.5, 0.5, -0.5, 0.5],
              'footprint.frame_id': 'base', 'footprint.cmd_vel': 'cmd_vel',
              'footprint.timeout': 0.5, **declared(MARKS)}
# The wall is 5 m to the left of the robot, which is rotated and does not move.
YAW = 0.75
WALL = [(-9.0, 5.5), (9.0, 5.5), (9.0, 6.5), (-9.0, 6.5)]
SPEEDS = [Fraction(2 + k % 5) for k in range(100)]


def twist(vx, vy=0.0, omega=0.0):
    return b'\0\1\0\0' + struct.pack('<6d', vx, vy, 0.0, 0.0, 0.0, omega)


def order(kind, k, *velocity, **more):
    """Return a command at a tenth of a second, stamped if its type has a stamp."""
    return '/cmd_vel', k / 10, (twist(*velocity) if kind == TWIST else command(
        *velocity, stamp=nanoseconds(k / 10), **more))


def stand(tenths, commands, is_upside_down=False):
    """Return a robot at rest for some tenths of a second, with commands."""
    c, s = math.cos(YAW), math.sin(YAW)
    half_c, half_s = math.cos(YAW / 2), math.sin(YAW / 2)
    pose = (0.0, half_c, half_s, 0.0, 0.0) if is_upside_down else (YAW,)
    wall = [(c * x - s * y, s * x + c * y) for x, y in WALL]
    messages = [*commands]
    for k in range(tenths):
        messages += [
            ('/tf', k / 10, transforms(('odom', 'base', nanoseconds(k / 10), 0.0, 0.0, *pose))),
            *(('/obstacles', k / 10, serialised(points, nanoseconds(k / 10), 'odom'))
              for points in (wall, []))]
    return sorted(messages, key=lambda message: (message[1], message[0] == '/cmd_vel'))


def run(path, messages, kind, parameters=PARAMETERS, **options):
    result = check(write(path, messages, types={'/tf': 'tf2_msgs/msg/TFMessage',
                                                '/cmd_vel': kind}),
                   Options(parameters=parameters, obstacles=[f'{SOURCE}:=/obstacles'], **options))
    assert not result.problems
    return result


@pytest.mark.parametrize('kind', [STAMPED, TWIST])
@pytest.mark.parametrize('clock', ['receive', 'header'])
@pytest.mark.parametrize('is_upside_down', [False, True])
def test_prediction_by_commands(tmp_path, kind, clock, is_upside_down):
    """To its left at a different speed each time; its true motion leads nowhere."""
    messages = stand(100, [order(kind, k, 0.0, float(-speed if is_upside_down else speed))
                           for k, speed in enumerate(SPEEDS)], is_upside_down)
    result = run(tmp_path / 'bag', messages, kind, min_ttc=0.1, clock=clock,
                 parameters={**PARAMETERS, f'{SOURCE}.timeout': 0.3})
    found = samples(result)
    assert found == {k: None if k < 1 or 5 / SPEEDS[k] > 3 else
                     pytest.approx(float(5 / SPEEDS[k]), abs=1e-5) for k in found}
    assert len(known(result)) >= 90
    # The wall is rounded to float32.
    assert all(value <= 5 / SPEEDS[k] + 1e-6 for k, value in known(result).items())
    least = result.footprints[0].soonest
    assert least.time_to_collision == pytest.approx(5 / 6, abs=1e-5)
    assert least.obstacle == f'{SOURCE}/0'
    source, = (one for one in result.sources if one.name == 'footprint.cmd_vel')
    assert (source.topic, source.received, source.rejected) == ('/cmd_vel', 100, {})


def test_prediction_without_commands_uses_the_motion(tmp_path):
    parameters = {name: PARAMETERS[name] for name in PARAMETERS if name != 'footprint.cmd_vel'}
    result = run(tmp_path / 'bag', stand(16, [order(TWIST, 0, 9.0)]), TWIST, parameters,
                 min_ttc=0.1)
    assert set(samples(result).values()) == {None}


def test_prediction_is_unknown_without_a_valid_command(tmp_path):
    """The command at 0.4 s holds for 0.5 s; an invalid one at 1.2 s ends the previous one."""
    commands = [order(STAMPED, k, 0.0, 5.0) for k in range(5)]
    commands += [order(STAMPED, 11, 0.0, 5.0), order(STAMPED, 12, math.nan),
                 order(STAMPED, 13, 0.0, 5.0, frame_id='odom')]
    result = run(tmp_path / 'bag', stand(16, commands), STAMPED, min_ttc=0.1)
    found = known(result).keys()
    assert found >= {3, 4, 5, 6, 7, 8, 11} and not found & {10, 12, 13, 14, 15}
    source, = (one for one in result.sources if one.name == 'footprint.cmd_vel')
    assert source.rejected == {'no velocity of a robot': 1, 'command in another frame': 1}
    assert source.examples['no velocity of a robot'].startswith(
        'footprint.cmd_vel: a message on /cmd_vel was rejected, no velocity of a robot: nan m/s')


@pytest.mark.parametrize('kind', [STAMPED, TWIST])
@pytest.mark.parametrize('clock', ['receive', 'header'])
def test_prediction_as_live_is_that_of_the_node(tmp_path, kind, clock):
    """In the written bag: time and velocity by the last command until it expires."""
    out = tmp_path / 'out'
    commands = [order(kind, k, 0.0, float(speed)) for k, speed in enumerate(SPEEDS[:16])]
    run(tmp_path / 'bag', stand(30, commands), kind, as_live=True, write_bag=str(out), clock=clock)
    times, states = published(out)
    times = {round(10 * time): seconds for time, seconds in times.items()}
    velocities = {round(10 * time): state['velocity'] for time, state in states.items()}
    # A sample at the time of a message may be written before or after it.
    for k in range(3, 15):
        near = {min(float(5 / speed), math.inf) for speed in SPEEDS[k - 1:k + 1]}
        assert any(times[k] == pytest.approx(seconds, abs=0.11) for seconds in near)
        assert velocities[k].endswith('0.000 rad/s by command')
    assert math.isnan(times[25])
    assert velocities[25] == 'unknown: no command on /cmd_vel for 1.0 s'


def test_twist_has_no_stamp(tmp_path):
    """The bytes of a tiny speed look like a stamp, but must not order messages."""
    fading = struct.unpack('<d', struct.pack('<iI', 1_600_000_000, 7))[0]
    assert 0.0 < fading < 1e-100
    for clock in ('receive', 'header'):
        commands = [('/cmd_vel', k / 10, twist(fading, 5.0)) for k in range(16)]
        result = run(tmp_path / clock, stand(16, commands), TWIST, min_ttc=0.1, clock=clock)
        assert samples(result)[9] == pytest.approx(1.0, abs=1e-5)


def test_missing_commands_are_reported(tmp_path):
    result = run(tmp_path / 'bag', stand(16, []), STAMPED, min_ttc=0.1)
    assert 'footprint.cmd_vel: the recording has no topic /cmd_vel' in result.notes[0]


# A robot of 1 m at 1/2 m/s, 7 m before a person at 2 m/s, who is met after 2.8 s; a person who
# walks beside, and a box at rest behind the first person. All numbers are exact in float32.
ROBOT, PERSON, APART = Fraction(1, 2), Fraction(-2), 7
TICK = Fraction(1, 8)
IDS = {7: (lambda t: 1 + APART + PERSON * t, 0.0), 8: (lambda t: ROBOT * t, 9.0),
       9: (lambda t: Fraction(12), 0.0)}


def approaching(ticks=20, changed=None):
    """Return their messages; after a tick the person beside has another shape."""
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


def replay(path, messages, moving=True, **options):
    result = check(write(path, messages, types={'/people': INSTANCE}), Options(
        footprints=('/footprint',), obstacles=('people:=/people',),
        parameters={'people.moving': moving, 'people.timeout': 0.3, 'future_tolerance': 0.05,
                    'horizon': 20.0}, **options))
    assert not result.problems and not result.contacts
    return result


def exact(time):
    """Return how many seconds before contact a time is."""
    return APART / (ROBOT - PERSON) - time


@pytest.mark.parametrize('moving', [True, False])
def test_least_time_to_collision_is_exact(tmp_path, moving):
    """Recorded motion counts, whatever `moving` is."""
    result = replay(tmp_path / 'bag', approaching(), moving, min_ttc=0.1)
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


def published_as_live(path, messages, moving=True):
    """Return what the node would publish while clear: time and time to collision in s, state."""
    replay(path / 'bag', messages, moving, as_live=True, write_bag=str(path / 'out'))
    times, states = published(path / 'out')
    return [(time, times.get(time), state) for time, state in states.items()
            if state['state'] == 'clear']


def test_times_with_moving_obstacles_as_live(tmp_path):
    """Never late, at most 1 mm early, and none before each body came twice."""
    found = [one for one in published_as_live(tmp_path, approaching()) if one[0] > 2 * TICK]
    assert len(found) > 10
    for time, seconds, state in found:
        assert exact(time) - Fraction(1, 1000) <= seconds <= exact(time) + Fraction(1, 10**9)
        assert state['first contact with'] == 'people/7'
        assert state['obstacles of unknown motion'] == ''


def test_obstacles_as_live_are_at_rest_unless_moving(tmp_path):
    """The robot comes to where the person last was; the box is out of reach."""
    found = [(time, seconds) for time, seconds, _ in published_as_live(
        tmp_path, approaching(), moving=False) if seconds < math.inf]
    assert len(found) > 5
    for time, seconds in found:
        seen = time - time % TICK
        left, before = ((APART + PERSON * last - ROBOT * time) / ROBOT
                        for last in (seen, seen - TICK))
        assert any(one - Fraction(1, 100) <= seconds <= one + Fraction(1, 10**9)
                   for one in (left, before))


def test_unknown_motion_as_live(tmp_path):
    """The person beside changes shape: for one message the motion is unknown."""
    states = [(time, seconds, state['obstacles of unknown motion'])
              for time, seconds, state in published_as_live(tmp_path, approaching(changed=12))
              if time > 2 * TICK]
    unknown = [time for time, _, names in states if names]
    assert {names for _, _, names in states} == {'', 'people/8'}
    assert unknown and 12 * TICK <= min(unknown) and max(unknown) <= 13 * TICK
    assert all(math.isnan(seconds) == bool(names) for _, seconds, names in states)

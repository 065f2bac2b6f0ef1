# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Plans in recordings: each is checked when it comes, by the code of the node."""

import csv
from dataclasses import replace
import json
import math
from xml.etree import ElementTree

from builders import odometry, path, serialised, transforms
import numpy as np
import pytest
from recordings import (
    box, check, declared, losses, LOST, LOST_TOPIC, main, MARKS, nanoseconds, SOURCE, write)
from sat_collision.messages.rosbags_interfaces import STORE
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import Limits, MAX_CONTACTS, Options, Verdict
from sat_collision.replay.output.page import write_page

TYPES = {'/tf': 'tf2_msgs/msg/TFMessage', '/plan': 'nav_msgs/msg/Path', LOST_TOPIC: LOST,
         '/odom': 'nav_msgs/msg/Odometry'}
PARAMETERS = {'frame_id': 'odom', 'footprint.frame_id': 'base',
              'footprint.points': [-0.5, -0.25, 0.5, -0.25, 0.5, 0.25, -0.5, 0.25],
              'footprint.path': '/plan', 'footprint.timeout': 0.5,
              **declared(MARKS)}
OPTIONS = Options(parameters=PARAMETERS, obstacles=[f'{SOURCE}:=/obstacles'])
# All poses are free, and what lies between the last two of them is not.
TOUCHING = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.0), (4.0, 0.0, 0.0), (8.0, 0.0, 0.0)]
FREE = TOUCHING[:3]


def plan(time, poses, stamp=None, **more):
    return '/plan', time, path(poses, nanoseconds(time) if stamp is None else stamp, **more)


def given(parameters=PARAMETERS):
    """Return what the command is told of the robot."""
    return [f'--obstacles={SOURCE}:=/obstacles',
            *(f'--param={name}:={value}' for name, value in parameters.items())]


def drive(*plans, end=2.0, x=0.0, square=5.0, obstacles_from=0.0, robot_until=9.0):
    """Return a robot that stands at x, and a square that begins somewhere on the x axis."""
    messages = [*plans]
    for k in range(round(10 * end) + 1):
        time = k / 10
        stamp = nanoseconds(time)
        frames = [('map', 'odom', stamp, 1.0, 0.0, 0.0)]
        if time < robot_until:
            frames.append(('odom', 'base', stamp, x, 0.0, 0.0))
        messages.append(('/tf', time, transforms(*frames)))
        if time >= obstacles_from:
            messages += [('/obstacles', time, serialised(points, stamp, 'odom'))
                         for points in (box(square, -0.5), [])]
    return messages


def counts(result):
    """Return how many plans of the one footprint were checked, and how many not, by reason."""
    footprint, = result.footprints
    return footprint.plans, footprint.plans_unknown


@pytest.fixture(params=[False, True], ids=['recorded motion', 'as live'])
def run(request, tmp_path):
    """Return what writes and checks a recording, in either way."""
    def run(messages, storage='mcap', latched=(), **options):
        bag = tmp_path / f'bag{len([*tmp_path.iterdir()])}'
        return check(write(bag, messages, storage, latched=latched, types=TYPES),
                     replace(OPTIONS, as_live=request.param, **options))
    return run


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@pytest.mark.parametrize('clock, early', [('receive', 0.0), ('header', 0.05)])
def test_plan_that_touches_between_two_poses(run, storage, clock, early):
    """By the clock of stamps it comes at the latest one before it."""
    result = run(drive(plan(0.55, FREE), plan(1.05, TOUCHING), plan(1.55, FREE)), storage,
                 clock=clock)
    one, = result.plan_contacts
    assert (one.footprint, one.obstacle, one.time, one.until) == (
        'footprint', f'{SOURCE}/0', nanoseconds(1.05 - early), nanoseconds(1.55 - early))
    assert (one.pose, one.metres) == pytest.approx((2.125, 4.5), abs=1e-3)
    assert counts(result) == (3, {})
    assert not (result.contacts or result.problems)
    # Listed, but no matter of the verdict unless that is asked for.
    assert result.verdict is Verdict.CLEAR


@pytest.mark.parametrize('stamp, times, refused', [
    *((stamp, [1.0], {}) for stamp in (-600.0, -5.0, 1.05)),
    *((stamp, [], {'the last path on /plan was refused: from the future': 1})
      for stamp in (5.0, 600.0))])
def test_stamps_of_plans_do_not_set_the_clock_of_stamps(run, stamp, times, refused):
    """One planned before began the check 600 s before the robot came; one ahead ended it late."""
    early, late = (plan(time, TOUCHING, nanoseconds(stamp)) for time in (0.0, 1.05))
    result = run(drive(early, late), clock='header')
    assert (result.start, result.end) == (nanoseconds(0.0), nanoseconds(2.0))
    assert [one.time for one in result.plan_contacts] == [*map(nanoseconds, times)]
    footprint, = result.footprints
    assert footprint.plans_unknown == {
        f'obstacle source {SOURCE} on /obstacles has not sent anything yet': 1, **refused}


def test_every_plan_of_before_the_clock_of_stamps_starts_counts(run):
    """The map and three plans come before the first odometry."""
    messages = [*(('/obstacles', 0.0, serialised(points, 0, 'odom'))
                  for points in (box(5.0, -0.5), [])),
                plan(0.1, TOUCHING), plan(0.2, []), plan(0.3, FREE),
                *(('/odom', k / 10, odometry('odom', 'base', nanoseconds(k / 10), 0.0, 0.0))
                  for k in range(4, 10))]
    result = run(messages, latched=['/obstacles'], clock='header', parameters={
        **PARAMETERS, 'footprint.odometry': '/odom', f'{SOURCE}.timeout': 0.0})
    assert counts(result) == (2, {})
    assert [(one.time, one.pose) for one in result.plan_contacts] == [
        (nanoseconds(0.4), pytest.approx(2.125, abs=1e-3))]


def test_motion_is_as_without_a_path(tmp_path):
    """That the scene decides contacts for plans changes nothing else."""
    bag = write(tmp_path / 'bag', drive(plan(1.05, TOUCHING)), types=TYPES)
    with_path = check(bag, OPTIONS)
    parameters = {name: value for name, value in PARAMETERS.items() if name != 'footprint.path'}
    without = check(bag, replace(OPTIONS, parameters=parameters))
    assert without.footprints[0].plans is None and not without.plan_contacts
    assert (with_path.contacts, with_path.unknown, with_path.footprints[0].separation) == (
        without.contacts, without.unknown, without.footprints[0].separation)


@pytest.mark.parametrize('release_delay', [0.0, 5.0])
def test_plan_counts_from_where_the_robot_is(run, release_delay):
    """What is behind the robot does not count, and metres are from it on."""
    behind = [(9.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 3.0, 0.0)]
    result = run(drive(plan(1.05, behind), plan(1.55, [(-2.0, 0.0, 0.0), (8.0, 0.0, 0.0)])),
                 parameters={**PARAMETERS, 'release_delay': release_delay})
    one, = result.plan_contacts
    assert (one.time, one.metres) == (nanoseconds(1.55), pytest.approx(4.5, abs=1e-3))
    assert one.pose == pytest.approx(0.65, abs=1e-3)


@pytest.mark.parametrize('until', [0.05, -1.0], ids=['too old', 'never there'])
def test_whole_plan_counts_where_the_robot_is_not_known(run, until):
    result = run(drive(plan(1.55, [(-2.0, 0.0, 0.0), (8.0, 0.0, 0.0)]), robot_until=until))
    one, = result.plan_contacts
    assert (one.pose, one.metres) == pytest.approx((0.65, 6.5), abs=1e-3)


def test_contact_of_long_ago_is_none_of_the_plan(run):
    """A robot that was in contact, and is not known now."""
    aside = [(0.0, 3.0, 0.0), (2.0, 3.0, 0.0)]
    result = run(drive(plan(1.55, aside), square=0.0, robot_until=0.05))
    assert result.contacts and not result.plan_contacts
    assert result.footprints[0].plans == 1


def test_robot_in_contact(run):
    one, = run(drive(plan(1.05, [(5.0, 0.0, 0.0), (8.0, 0.0, 0.0)]), x=4.5)).plan_contacts
    assert (one.pose, one.metres, one.way) == (0.0, 0.0, [])


@pytest.mark.parametrize('time, known', [(1.0, True), (1.05, True), (1.95, True), (2.05, False)])
def test_plan_in_another_frame(run, time, known):
    """The transform at its stamp may come after it, within transform_timeout."""
    shifted = [(x + 1.0, y, yaw) for x, y, yaw in TOUCHING]
    parameters = {**PARAMETERS, 'transform_timeout': 0.06}
    messages = drive(plan(time, shifted, frame_id='map'))
    result = run([*messages, ('/obstacles', 2.2, serialised([], nanoseconds(2.2), 'odom'))],
                 parameters=parameters)
    if known:
        assert counts(result) == (1, {})
        assert [(one.time, one.pose) for one in result.plan_contacts] == [
            (nanoseconds(time), pytest.approx(2.125, abs=1e-3))]
    else:
        plans, unknown = counts(result)
        (reason, count), = unknown.items()
        assert (plans, count) == (0, 1) and 'the path on /plan has no place' in reason


def test_plans_that_come_faster_than_transforms(run):
    """Each of them waits for its own, whatever comes meanwhile, and counts until the next one."""
    times = [1.02, 1.05, 1.08, 1.15]
    plans = [plan(time, poses, frame_id='map') for time, poses in zip(
        times, [[(x + 1.0, y, yaw) for x, y, yaw in poses]
                for poses in (TOUCHING, FREE, TOUCHING, TOUCHING)])]
    aside = plan(1.06, [(0.0, 0.0, 0.0), (8.0, 0.0, 0.0)])
    result = run(drive(*plans, aside))
    assert counts(result) == (5, {})
    assert [(one.time, one.until) for one in result.plan_contacts] == [
        (nanoseconds(time), nanoseconds(until))
        for time, until in ((1.02, 1.05), (1.06, 1.08), (1.08, 1.15), (1.15, 2.0))]


def test_transform_by_odometry_that_comes_after_the_plan(run):
    """As a local plan in the frame of the robot needs it."""
    messages = [(topic, time, data) for topic, time, data in drive() if topic != '/tf']
    messages += [('/odom', k / 10, odometry('odom', 'base', nanoseconds(k / 10), 1.0, 0.0))
                 for k in range(21)]
    messages.append(plan(1.05, TOUCHING, frame_id='base'))
    result = run(messages, parameters={**PARAMETERS, 'footprint.odometry': '/odom'})
    assert counts(result) == (1, {})
    assert [(one.time, one.metres) for one in result.plan_contacts] == [
        (nanoseconds(1.05), pytest.approx(3.5, abs=1e-3))]


def test_transform_that_comes_too_late(run):
    """There is none for longer than `transform_timeout`, and than is interpolated."""
    messages = [one for one in drive(plan(1.01, TOUCHING, frame_id='map'))
                if one[0] != '/tf' or not 1.05 < one[1] < 1.65]
    plans, unknown = counts(run(messages, parameters={**PARAMETERS, 'transform_timeout': 0.05}))
    (reason, count), = unknown.items()
    assert (plans, count) == (0, 1) and 'has no place' in reason


def test_transform_that_comes_later_than_live(tmp_path):
    """Recorded motion waits as long as it interpolates; as live it is `transform_timeout`."""
    messages = [one for one in drive(plan(1.01, TOUCHING, frame_id='map'))
                if one[0] != '/tf' or not 1.05 < one[1] < 1.25]
    bag = write(tmp_path / 'bag', messages, types=TYPES)
    for as_live, checked in ((True, 0), (False, 1)):
        assert counts(check(bag, replace(OPTIONS, as_live=as_live, parameters={
            **PARAMETERS, 'transform_timeout': 0.05})))[0] == checked


def test_empty_plan_is_none_and_ends_the_one_before(run):
    result = run(drive(plan(1.05, TOUCHING), plan(1.25, []), plan(1.55, FREE)))
    one, = result.plan_contacts
    assert (one.time, one.until) == (nanoseconds(1.05), nanoseconds(1.25))
    assert counts(result) == (2, {})


def test_plan_while_the_source_is_unknown(run):
    result = run(drive(plan(0.55, TOUCHING), plan(1.55, TOUCHING), obstacles_from=1.0))
    (reason, count), = result.footprints[0].plans_unknown.items()
    assert (result.footprints[0].plans, count) == (1, 1)
    assert f'{SOURCE} on /obstacles' in reason
    assert [one.time for one in result.plan_contacts] == [nanoseconds(1.55)]


def test_refused_plans(run):
    nan = float('nan')
    result = run(drive(plan(0.75, [(nan, 0.0, 0.0)]), plan(1.05, TOUCHING, frame_id=''),
                       plan(1.15, FREE, pose_frame='map'), plan(1.25, TOUCHING)),
                 parameters={**PARAMETERS, 'max_path_poses': 3})
    assert (result.footprints[0].plans, sum(result.footprints[0].plans_unknown.values())) == (0, 4)
    assert all('was refused' in reason for reason in result.footprints[0].plans_unknown)
    # They are no matter of whether anything touched.
    assert result.verdict is Verdict.CLEAR
    broken = run(drive(('/plan', 1.05, b'\0\1\0\0')))
    assert broken.verdict is Verdict.BAD_INPUT and 'cannot be decoded' in broken.problems[0]


def test_plans_that_the_recorder_lost_are_unknown(run):
    result = run(drive(plan(1.05, FREE), losses(1.5, plan=(1, 2), other=(5, 0))), fail_on='plan')
    assert counts(result) == (1, {'lost by the recorder': 3})
    assert result.verdict is Verdict.UNKNOWN


def test_every_plan_of_a_stamp_counts(run):
    result = run(drive(plan(1.05, TOUCHING), plan(1.05, FREE), plan(1.05, TOUCHING)))
    assert (result.footprints[0].plans, len(result.plan_contacts)) == (3, 2)


def test_plans_of_before_the_start_do_not_count(tmp_path):
    bag = write(tmp_path / 'bag', drive(plan(0.25, TOUCHING), plan(1.55, FREE)), types=TYPES,
                latched=['/plan'])
    result = check(bag, replace(OPTIONS, start=1.0))
    assert (result.footprints[0].plans, result.plan_contacts) == (1, [])


@pytest.mark.parametrize('start', [0.0, 1.0])
def test_plan_stamped_before_the_start_counts_when_received(run, start):
    """At its stamp nothing is known yet."""
    messages = drive(plan(1.75, TOUCHING, nanoseconds(start + 0.25)))
    result = run([one for one in messages if one[1] >= 0.3], start=start)
    assert counts(result) == (1, {})
    assert [one.time for one in result.plan_contacts] == [nanoseconds(1.75)]


@pytest.mark.parametrize('plans, verdict', [
    ([plan(1.05, FREE)], 0),
    ([plan(1.05, TOUCHING)], 1),
    ([plan(0.05, FREE), plan(1.05, FREE)], 2),
    ([plan(0.05, FREE), plan(1.05, TOUCHING)], 1),
    ([plan(1.05, [])], 2),
    ([], 2)])
def test_gate(tmp_path, capsys, plans, verdict):
    """A plan that is unknown, or none at all, does not count as clear."""
    arguments = [str(write(tmp_path / 'bag', drive(*plans, obstacles_from=0.3), types=TYPES)),
                 *given(), '--junit', str(tmp_path / 'junit.xml')]
    assert main(arguments) == 0
    cases = ElementTree.parse(tmp_path / 'junit.xml').findall('.//testcase')
    assert not any('plans' in case.get('name') for case in cases)
    capsys.readouterr()
    assert main([*arguments, '--fail-on', 'plan']) == verdict
    printed = capsys.readouterr().out
    assert ('plans in contact' in printed) is (verdict == 1)
    assert ('there is no plan' in printed) is (plans in ([], [plan(1.05, [])]))
    case, = ElementTree.parse(tmp_path / 'junit.xml').findall(
        './/testcase[@name="plans of footprint"]')
    assert bool(case.findall('failure')) is bool(verdict)


def test_plans_of_a_disabled_footprint_do_not_count(run):
    """Another one has free plans on the same topic."""
    parameters = {**PARAMETERS, 'footprints': ['footprint', 'small'],
                  'small.points': [-0.1, -0.1, 0.1, -0.1, 0.1, 0.1], 'small.path': '/plan',
                  'small.frame_id': 'base', 'footprint.enabled': False}
    beside = [(x, 0.7, 0.0) for x in (0.0, 2.0, 8.0)]
    result = run(drive(plan(1.05, beside), losses(1.5, plan=(0, 0))), parameters=parameters,
                 fail_on='plan')
    assert [one.plans for one in result.footprints] == [None, 1]
    assert (result.plan_contacts, result.verdict) == ([], Verdict.CLEAR)


@pytest.mark.parametrize('parameters', [
    {'footprints': '[footprint]'},
    {**PARAMETERS, 'footprints': '[footprint, other]', 'footprint.enabled': 'false'}],
    ids=['no path', 'disabled'])
def test_gate_needs_a_path(tmp_path, capsys, parameters):
    bag = str(write(tmp_path / 'bag', drive(plan(1.05, TOUCHING)), types=TYPES))
    assert main([bag, '--fail-on', 'plan', *given(parameters)]) == 3
    assert '--fail-on plan: no enabled footprint has a path' in capsys.readouterr().out


def test_results_for_machines(tmp_path, monkeypatch):
    """They are the same in other processes, and what differs is found."""
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '1')
    bags = [str(write(tmp_path / f'bag{k}', drive(plan(1.05, poses)), types=TYPES))
            for k, poses in enumerate((TOUCHING, FREE))]
    arguments = [*bags, *given()]
    files = {jobs: tmp_path / f'{jobs}.json' for jobs in '12'}
    for jobs, file in files.items():
        assert main([*arguments, '--jobs', jobs, '--json', str(file), '--csv',
                     str(tmp_path / 'rows.csv')]) == 0
    assert files['1'].read_text() == files['2'].read_text()
    stored = json.loads(files['1'].read_text())
    one, = stored['bags'][0]['plan_contacts']
    row, = (row for row in csv.DictReader((tmp_path / 'rows.csv').open()) if row['kind'] == 'plan')
    assert (float(row['pose']), float(row['along_m'])) == (one['pose'], one['metres'])
    assert main([*arguments, '--expect', str(files['1'])]) == 0
    one['metres'] -= 0.1
    files['1'].write_text(json.dumps(stored))
    assert main([*arguments, '--expect', str(files['1'])]) == 1


def test_written_bag_has_what_the_node_publishes(tmp_path):
    bag = write(tmp_path / 'bag', drive(plan(0.55, FREE), plan(1.05, TOUCHING)), types=TYPES)
    check(bag, replace(OPTIONS, as_live=True, write_bag=str(tmp_path / 'out')))
    topic = '/footprint_monitor/footprint/path_contact_distance'
    with Recording(tmp_path / 'out', Limits()) as recording:
        found = [(time, STORE.deserialize_cdr(data, 'std_msgs/msg/Float64').data)
                 for _, times, row in recording.rows([topic]) for time, data in zip(times, row)]
    assert all(math.isnan(metres) for time, metres in found if time < nanoseconds(0.5))
    assert {metres for time, metres in found
            if nanoseconds(0.6) <= time < nanoseconds(1.05)} == {math.inf}
    last = [metres for time, metres in found if time > nanoseconds(1.1)]
    assert last == pytest.approx([4.5] * len(last), abs=1e-3) and len(last) > 5


def test_page_has_plans_in_contact(tmp_path):
    """With the outline where it meets the obstacle, which is not at the robot."""
    long = [(0.001 * k, 0.0, 0.0) for k in range(9000)]
    bag = write(tmp_path / 'bag', drive(plan(0.55, FREE), plan(1.05, long)), types=TYPES)
    write_page([check(bag, replace(OPTIONS, keyframes=True))], str(tmp_path / 'page.html'))
    page = (tmp_path / 'page.html').read_text()
    data = json.loads(page.partition('type="application/json">')[2].partition('</script>')[0])
    recording, = data['recordings']
    one, = recording['plans']
    assert (one['footprint'], one['first'], one['last']) == (0, 1.05, 2.0)
    assert one['way'][:2] == [0.0, 0.0] and one['way'][-2:] == pytest.approx([4.5, 0.0], abs=1e-3)
    assert len(one['way']) == 400 and max(one['outline'][::2]) == pytest.approx(5.0, abs=1e-3)
    tables = {table['title']: table['rows'] for table in recording['tables']}
    row, = tables['Plans in contact']
    assert row == ['footprint', f'{SOURCE}/0', '1.050', '4500.00', '4.500']
    assert tables['Plans'] == [['footprint', '2', '0', '']]


def test_only_what_is_drawn_of_plans_is_kept(tmp_path):
    """However many there are, and however many poses they have."""
    plans = [plan(1.0 + k / 1000, [(x, 0.0, 0.0) for x in np.linspace(0.0, 9.0, 400)])
             for k in range(MAX_CONTACTS + 50)]
    bag = write(tmp_path / 'bag', drive(*plans), types=TYPES)
    found = check(bag, replace(OPTIONS, keyframes=True)).plan_contacts
    assert [len(one.way) for one in found] == MAX_CONTACTS * [200] + 50 * [0]
    assert found[0].way[0] == [0.0, 0.0] and found[0].way[-1] == pytest.approx(
        [4.5, 0.0], abs=1e-3)

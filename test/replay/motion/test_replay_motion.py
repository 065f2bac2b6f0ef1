# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contacts in recorded motion: between messages, at equal stamps, of late ones, and with ids."""

from builders import collection, SECOND, serialised
import numpy as np
from published import load
import pytest
import recordings
from recordings import (
    at, box, COLLECTION, declared, EACH, INSTANCE, main, MARKS, POLYGON, published, run, samples,
    since, SOURCE, STAMPS, START, times, write)
from sat_collision.replay.losses import UNSEEN
from sat_collision.replay.model.result import AT_A_SAMPLE, BETWEEN_SAMPLES, Options, Verdict

NAMES = *recordings.NAMES, 'commonroad_BEL_Zaventem-1_2_T-1'


def check(path, options=Options(), set_end=STAMPS):
    """Check a recording in which all obstacles of a set have one stamp."""
    return recordings.check(path, options, set_end=set_end)


def run_again(tmp_path, **options):
    """Check what `run` has written."""
    return check(tmp_path / 'bag', Options(**options))


@pytest.mark.parametrize('as_live', [False, True])
def test_last_sample_counts_beside_another_one_of_its_stamp(tmp_path, as_live):
    """The footprint comes twice at the end of the recording, and touches then, at 0.9 s."""
    messages = [at(time, points, topic=topic) for k in range(10) for time, topic, points in (
        (k / 10, '/footprint', box(0)), (k / 10 - 0.05, '/obstacles', box(3)))]
    result = run(tmp_path, [*messages, at(0.9, box(2.5), topic='/footprint')], as_live=as_live)
    assert times(result) == pytest.approx([0.95, 0.95])


def test_leader_at_constant_distance_is_not_touched(tmp_path):
    """
    Both drive at 2 m/s, 0.10 m apart; messages come at 10 Hz, the footprint's 20 ms earlier.

    As live the leader's previous position counts, which is 0.20 m back; so does it where nothing
    is known of its sets, and a note says that.
    """
    messages = []
    for k in range(40):
        t = k / 10
        messages += [at(t, box(2 * t), topic='/footprint'), at(t + 0.02, box(2 * t + 1.14))]
    bag = write(tmp_path / 'bag', messages)
    result = check(bag)
    assert result.verdict is Verdict.CLEAR and result.contacts == []
    values = [value for _, value in result.footprints[0].separation if value is not None]
    assert len(values) >= 38
    assert values == pytest.approx([0.1] * len(values), abs=1e-5)
    assert result.notes == [UNSEEN]
    assert check(bag, Options(as_live=True)).verdict is Verdict.COLLISION
    result = check(bag, set_end=None)
    assert result.verdict is Verdict.COLLISION
    assert [contact.obstacle for contact in result.contacts] == [f'{SOURCE}/0']
    assert any('may be with where an obstacle was' in note for note in result.notes)


@pytest.mark.parametrize('as_live', [False, True])
def test_footprint_monitors_only_its_sources(tmp_path, as_live):
    """The robot stands in its dock, which only the cart monitors, and which is silent once."""
    parameters = {'footprints': ['robot', 'cart'], 'obstacles': ['dock', 'walls'],
                  'robot.obstacles': ['walls'], 'cart.obstacles': [''],
                  **declared(STAMPS, 'dock', 'walls')}
    messages = []
    for k in range(20):
        messages += [(f'/{name}', k / 10, box(0)) for name in ('robot', 'cart')]
        messages += [('/walls', k / 10, box(3))]
        if not 2 < k < 15:
            messages += [('/dock', k / 10, box(0.5))]
    result = check(write(tmp_path / 'bag', messages),
                   Options(parameters={**parameters, 'dock.timeout': 0.5}, as_live=as_live))
    robot, cart = result.footprints
    assert {(contact.footprint, str(contact.obstacle)) for contact in result.contacts} == {
        ('cart', 'dock/0')}
    assert (robot.ever_known, robot.collision, robot.least.separation) == (True, 0, 2.0)
    assert {unknown.footprint for unknown in result.unknown
            if 'silent' in str(unknown.reasons)} == {'cart'}
    assert {one.footprint for one in result.undetermined if 'dock' in str(one.reasons)} == (
        set() if as_live else {'cart'})


@pytest.mark.parametrize('first', ['/footprint', '/obstacles'])
def test_order_within_a_stamp_does_not_matter(tmp_path, first):
    """Two cars 2 m apart that move 3 m between messages."""
    messages = []
    for k in range(50):
        frame = [('/footprint', k / 10, box(3 * k)), ('/obstacles', k / 10, box(3 * k + 3))]
        messages += frame if first == '/footprint' else frame[::-1]
    result = run(tmp_path, messages)
    assert (result.verdict, result.contacts) == (Verdict.CLEAR, [])
    assert [value for _, value in result.footprints[0].separation] == [2.0] * 50


def test_thin_wall_between_two_messages(tmp_path, capsys):
    """A robot of 0.5 m at 10 m/s and 10 Hz touches the wall in no message."""
    wall = [(20.6, -1), (20.61, -1), (20.61, 2), (20.6, 2)]
    messages = [message for k in range(41) for message in (
        ('/footprint', k / 10, [(k, 0), (k + 0.5, 0), (k + 0.5, 0.5), (k, 0.5)]),
        ('/obstacles', k / 10, wall))]
    bag = write(tmp_path / 'bag', messages)
    assert main([str(bag)], STAMPS) == 1
    assert 'between 2.000 and 2.100 s' in capsys.readouterr().out
    result = check(bag)
    contact, = result.contacts
    assert (contact.found, since(result, *contact.between)) == (BETWEEN_SAMPLES, [2.0, 2.1])
    assert times(result) == pytest.approx([2.01, 2.061], abs=1e-5)
    assert contact.depth == pytest.approx((0.5 + 0.01) / 2, abs=1e-5)
    assert result.footprints[0].collision == contact.last - contact.first


@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('name', NAMES)
def test_published_recordings_at_equal_stamps(name, clock):
    """Every separation, every minimum and every contact, compared with shapely."""
    moments = load('recordings')[name]['moments']
    result = check(published(name, 'sqlite3'), Options(
        clock=clock, parameters={'footprint.timeout': 3.0, f'{SOURCE}.timeout': 3.0}))
    curve = dict(result.footprints[0].separation)
    for moment in moments:
        assert max(curve[moment['stamp']], 0.0) == pytest.approx(moment['least'], abs=1e-9)
        touching = {f'{SOURCE}/{index}' for index in moment['touching']}
        found = [contact for contact in result.contacts if contact.found == AT_A_SAMPLE
                 and contact.first <= moment['stamp'] <= contact.last]
        assert len(found) == len(touching)
    assert (result.verdict is Verdict.COLLISION) == any(one['touching'] for one in moments)


def test_motion_of_both_bodies_counts(tmp_path):
    """The robot and an obstacle pass each other and touch half way, in no message."""
    result = run(tmp_path, samples([0, 0, 0, 4, 4, 4]) + samples([4, 4, 4, 0, 0, 0], '/obstacles'))
    contact, = result.contacts
    assert contact.found == BETWEEN_SAMPLES
    assert times(result) == pytest.approx([0.2375, 0.2625], abs=1e-6)
    assert contact.depth == pytest.approx(1.0, abs=1e-6)
    assert result.footprints[0].least.found == BETWEEN_SAMPLES


def test_obstacles_are_matched_in_any_order(tmp_path):
    """Two of them cross the robot's lane, sent in changing order."""
    messages = samples([0] * 10)
    for k in range(10):
        pair = [box(-9 + 2 * k, 0), box(30, 5)]
        messages += [('/obstacles', k / 10, points) for points in pair[::(-1) ** k]]
    result = run(tmp_path, messages)
    assert times(result) == pytest.approx([0.4, 0.5], abs=1e-6)
    assert all(source.undetermined == 0 for source in result.sources)


def test_changed_start_vertex_or_direction_is_no_motion(tmp_path):
    wall = [(2.0, -3), (2.1, -3), (2.1, 3), (2.0, 3)]
    result = run(tmp_path, samples([0] * 9) + [
        ('/obstacles', k / 10, (wall[k % 4:] + wall[:k % 4])[::(-1) ** (k // 2)])
        for k in range(9)])
    assert result.contacts == []
    assert [value for _, value in result.footprints[0].separation] == [1.0] * 9


@pytest.mark.parametrize('start, step', [(0, 1), (2, 1), (0, -1), (1, -1)])
def test_changed_start_vertex_hides_no_contact(tmp_path, start, step):
    """Matched vertex by vertex, the wall would shrink to a point half way."""
    wall = [(2.0, -3), (2.1, -3), (2.1, 3), (2.0, 3)]
    messages = [('/footprint', k / 10, [(x, 2), (x + 0.5, 2), (x + 0.5, 2.5), (x, 2.5)])
                for k, x in enumerate([0, 1.2, 2.4, 3.6])]
    messages += [('/obstacles', k / 10, (wall[start:] + wall[:start])[::step] if k % 2 else wall)
                 for k in range(4)]
    contact, = run(tmp_path, messages).contacts
    assert contact.found == BETWEEN_SAMPLES


def test_members_of_a_set_have_their_own_stamps(tmp_path):
    """Both keep 0.5 m from a robot at 10 m/s."""
    messages = []
    for k in range(20):
        messages += [at(k / 10, box(k), topic='/footprint'),
                     at(k / 10 + 0.03, box(k + 0.3 + 1.5), 0.01),
                     at(k / 10 + 0.04, box(k + 0.4 - 1.5), 0.01),
                     at(k / 10 + 0.04, [], 0.01)]
    result = run(tmp_path, messages, MARKS)
    assert result.contacts == []
    assert result.footprints[0].least.separation == pytest.approx(0.5, abs=1e-5)
    values = [value for _, value in result.footprints[0].separation if value is not None]
    assert len(values) >= 18 and values == pytest.approx([0.5] * len(values), abs=1e-5)


@pytest.mark.parametrize('timeout, set_end, stamp', [
    (0.0, MARKS, START), (0.0, MARKS, 0), (60.0, EACH, START), (60.0, EACH, 0),
    (60.0, STAMPS, START), (60.0, None, START), (60.0, None, 0)])
def test_obstacle_sent_once_is_at_rest(tmp_path, timeout, set_end, stamp):
    """The robot drives through a thin wall 30 s later, between two messages."""
    wall = serialised([(301.6, -1), (301.61, -1), (301.61, 2), (301.6, 2)], stamp)
    messages = [('/obstacles', 0.0, wall), *samples(range(330), size=0.5)]
    result = run(tmp_path, messages, set_end, parameters={f'{SOURCE}.timeout': timeout})
    contact, = result.contacts
    assert (contact.found, since(result, *contact.between)) == (BETWEEN_SAMPLES, [30.1, 30.2])
    assert times(result) == pytest.approx([30.11, 30.161], abs=1e-5)
    assert result.sources[1].known_by == {None: 'timeout', MARKS: 'empty polygon',
                                          STAMPS: 'new stamp', EACH: 'each message'}[set_end]
    assert min(value for _, value in result.footprints[0].separation) < 0.7


def passing(path, obstacles, parameters, **bag):
    """Return when a robot that drives from x = 0 to 10 in 10 s touches which obstacle."""
    robot = [('/footprint', k / 10, box(k / 10)) for k in range(101)]
    result = check(write(path / 'bag', [*obstacles, *robot], **bag), Options(parameters={
        f'{SOURCE}.{name}': value for name, value in parameters.items()}), MARKS)
    return [(contact.obstacle, *since(result, contact.first)) for contact in result.contacts]


def test_walls_of_a_map_have_stamps_of_their_own(tmp_path):
    walls = [('/obstacles', k / 5, box(3.0 * (k + 1))) for k in range(3)]
    walls.append(('/obstacles', 0.6, []))
    assert passing(tmp_path, walls, {'timeout': 0.0}, latched=['/obstacles']) == [
        ('obstacle/0', 2.0), ('obstacle/1', 5.0), ('obstacle/2', 8.0)]


@pytest.mark.parametrize('start, instance', [
    (None, None), (START, None), (START, 7), (START - 3600 * SECOND, None)],
    ids=['without stamps', 'with stamps', 'with ids', 'stamped long before'])
@pytest.mark.parametrize('refused', [False, True])
def test_map_is_replaced_by_a_whole_one(tmp_path, start, instance, refused):
    """Two walls are in the first map only; of the second one a wall may be refused."""
    def wall(time, points, number=0):
        stamp = 0 if start is None else start + round(time * SECOND)
        return '/obstacles', time, serialised(
            points, stamp, instance=instance and instance + number)
    bad = [wall(1.0, [(float('nan'), 0.0)], 2)] if refused else []
    walls = [wall(0.0, box(1.5)), wall(0.0, box(5), 3), wall(0.0, []),
             wall(1.0, box(8), 1), *bad, wall(1.0, [])]
    found = passing(tmp_path, walls, {'timeout': 0.0}, latched=['/obstacles'],
                    types={'/obstacles': INSTANCE if instance else POLYGON})
    assert [time for _, time in found] == ([0.5, 4.0, 7.0] if refused else [0.5, 7.0])


def test_wall_of_a_map_with_ids_jumps(tmp_path):
    """It is sent before the robot, and two seconds later behind it."""
    walls = [('/obstacles', time, serialised(points, START + round(time * SECOND), instance=7))
             for time, x in ((0.0, 6.0), (2.0, -6.0)) for points in (box(x), [])]
    assert passing(tmp_path, walls, {'timeout': 0.0}, latched=['/obstacles'],
                   types={'/obstacles': INSTANCE}) == []


def test_sets_of_one_message_are_matched(tmp_path):
    """Another robot at 100 Hz."""
    other = [('/obstacles', k / 100, box(20.0 - k / 50)) for k in range(1001)]
    result = run(tmp_path, samples([0.0] * 101) + other, EACH)
    assert [contact.obstacle for contact in result.contacts] == ['obstacle/0']
    assert result.sources[1].undetermined == 0


def test_set_is_what_comes_before_its_mark(tmp_path):
    """Sets come every 0.1 s, 0.25 s late, with stamps of their own; marks have none."""
    messages = samples([0.0] * 30)
    for k in range(30):
        walls = [box(5.0)[:3], box(2.0 + k % 2), box(-8.0)]
        messages += [at(k / 10 + i / 50, points, 0.25) for i, points in enumerate(walls)]
        messages.append(('/obstacles', k / 10 + 0.05 + 0.25, serialised([], 0)))
    result = run(tmp_path, messages, MARKS)
    assert result.verdict is Verdict.CLEAR and result.sources[1].undetermined == 0
    assert result.footprints[0].least.separation == pytest.approx(1.0, abs=1e-6)
    assert result.footprints[0].unknown < SECOND // 2


@pytest.mark.parametrize('period', [0.5, 0.6, 0.9])
@pytest.mark.parametrize('set_end', [MARKS, STAMPS, 'ids'])
def test_motion_is_decided_however_seldom_messages_come(tmp_path, period, set_end):
    """The timeout is 1 s; an obstacle passes the robot once at 4 m/s."""
    with_ids = set_end == 'ids'
    topic, last = ('/tracks' if with_ids else '/obstacles'), int(6.0 / period)
    messages = samples([0.0] * 61)
    for k in range(last + 1):
        time = k * period
        messages.append((topic, time, serialised(
            box(-12.0 + 4 * time), START + round(time * SECOND), instance=with_ids or None)))
        messages += [(topic, time, [])] if set_end == MARKS else []
    name = 'tracks' if with_ids else SOURCE
    result = run(tmp_path, messages, None if with_ids else set_end,
                 parameters={f'{name}.timeout': 1.0})
    assert times(result) == pytest.approx([2.75, 3.25], abs=1e-5)
    assert result.sources[1].undetermined <= 1e9 * (6.0 - last * period) + 1


def test_obstacle_at_rest_is_checked_at_every_footprint(tmp_path):
    """A wall sent once per second, and a robot at 10 Hz that touches it in one message."""
    messages = samples([0, 0, 0, 0, 1.5, 0, 0, 0, 0, 0, 0, 0])
    messages += [('/obstacles', 0.0, box(2)), ('/obstacles', 1.0, box(2))]
    result = run(tmp_path, messages)
    contact, = result.contacts
    assert (contact.found, contact.depth) == (AT_A_SAMPLE, 0.5)
    assert since(result, contact.deepest) == [0.4]
    assert dict(result.footprints[0].separation)[START + 3 * SECOND // 10] == 1.0


def test_margin_counts_between_messages(tmp_path):
    """A pass at 0.2 m."""
    messages = [('/footprint', k / 10, [(6 * k, 0), (6 * k + 0.5, 0), (6 * k + 0.5, 0.5)])
                for k in range(8)]
    messages += [('/obstacles', k / 10, [(21, 0.7), (21.1, 0.7), (21.1, 2)]) for k in range(8)]
    assert run(tmp_path, messages, parameters={'margin': 0.15}).contacts == []
    contact, = run_again(tmp_path, parameters={'margin': 0.25}).contacts
    assert contact.found == BETWEEN_SAMPLES and contact.depth == pytest.approx(-0.2)


@pytest.mark.parametrize('names', [('walls',), ('walls', 'others')])
def test_bodies_never_known_at_the_same_time_are_unknown(tmp_path, names):
    """The footprint is sent once, and walls only later; as live they collide."""
    options = {'obstacles': [f'{name}:=/{name}' for name in names],
               'parameters': declared(STAMPS, *names)}
    result = run(tmp_path, [('/footprint', 0.0, box(0)),
                            *(('/others', k / 10, box(9)) for k in range(9)),
                            *(('/walls', k / 10, box(0)) for k in range(1, 9))], **options)
    assert (result.verdict, result.contacts) == (Verdict.UNKNOWN, [])
    assert '--as-live' in ' '.join(result.notes)
    assert run_again(tmp_path, as_live=True, **options).verdict is Verdict.COLLISION


@pytest.mark.parametrize('middle', [(2,), (2, 2), (1, 2, 3)])
def test_every_footprint_of_a_stamp_counts(tmp_path, middle):
    """Only a footprint that is neither the first nor the last of its stamp touches the wall."""
    places = [(k / 10, 0.0) for k in range(20)]
    places[10:10] = [(1.0, 0.0), *((1.0, 1.0 * x) for x in middle)]
    assert times(run(tmp_path, [at(time, box(x), topic='/footprint') for time, x in places]
                     + [at(k / 10, box(2.5)) for k in range(20)])) == [1.0, 1.0]


@pytest.mark.parametrize('clock', ('receive', 'header'))
@pytest.mark.parametrize('as_live', (False, True))
def test_times_count_from_the_beginning_of_the_recording(tmp_path, capsys, clock, as_live):
    """Also with --start, and though a map comes first, which is stamped an hour before."""
    messages = [at(-3600.0, points, 3600.0 + k, '/walls') for k in range(10)
                for points in (box(50), [])]
    messages += samples([0] * 100) + samples([2] * 60 + [0.5] * 40, '/obstacles')
    bag = write(tmp_path / 'bag', messages)
    parameters = {**declared(STAMPS, 'seen'), **declared(MARKS, 'walls'), 'walls.timeout': 0.0}
    obstacles = 'seen:=/obstacles', 'walls:=/walls'
    result = check(bag, Options(start=5.0, clock=clock, as_live=as_live, parameters=parameters,
                                obstacles=obstacles))
    contact, = result.contacts
    assert result.since(result.start) == 5.0
    assert result.since(contact.deepest) == 6.0
    main([str(bag), '--start', '5', '--clock', clock, *(['--as-live'] if as_live else []),
          *(f'--obstacles={one}' for one in obstacles),
          *(f'--param={name}:={value}' for name, value in parameters.items())], None)
    assert 'seen/0 at 6.000 s' in capsys.readouterr().out


def test_obstacle_is_held_after_its_last_message(tmp_path):
    """The robot reaches where a moving one was last seen, within its timeout."""
    messages = samples(range(30)) + samples([x + 1.5 for x in range(20)], '/obstacles')
    assert times(run(tmp_path, messages)) == pytest.approx([1.95, 2.15])
    assert run_again(tmp_path, as_live=True).verdict is Verdict.COLLISION


@pytest.mark.parametrize('messages, set_end, timeouts, verdict, touches, undetermined', [
    pytest.param(
        samples([0] * 9) + samples([-3] * 3, '/obstacles') + [('/obstacles', 0.3, [])]
        + [('/obstacles', k / 10, box(3)) for k in range(4, 9)],
        STAMPS, {}, Verdict.CLEAR, [], [], id='not linked across an empty set'),
    pytest.param(
        [('/obstacles', 0.0, serialised(box(0), START, 'odom')),
         *(('/footprint', 0.5 + k / 10, box(0)) for k in range(30))],
        STAMPS, {}, Verdict.UNKNOWN, [], [],
        id='not in another frame, received before it is known'),
    pytest.param(
        samples([0.0] * 9 + [2.5] + [0.0] * 20) + [message for k in range(4) for message in [
            ('/obstacles', 0.6 * k, box(9.0)), *[('/obstacles', 0.6 * k, box(3.0))] * (k < 2),
            ('/obstacles', 0.6 * k, [])]],
        MARKS, {f'{SOURCE}.timeout': 1.0}, Verdict.COLLISION, [0.88, 0.92], [],
        id='held until the set without it'),
    pytest.param(
        samples([0.0] * 14) + [('/footprint', 3.0 + k / 5, box(0.0)) for k in range(5)]
        + [('/obstacles', time, box(x)) for time, x in ((1.0, 0.8), (1.0, 9.0), (2.95, 9.0))],
        STAMPS, {f'{SOURCE}.timeout': 0.5, 'footprint.timeout': 0.5}, Verdict.COLLISION,
        [1.0, 1.3], [], id='held before a silence, where the next set is late'),
    pytest.param(
        samples([0.0] * 23, every=2.0) + [at(0.5, [])] + [
            at(time, points, delay) for time in (1.0, 21.5)
            for points, delay in ((box(0.5), 0.0), ([], 0.001))],
        MARKS, {f'{SOURCE}.timeout': 20.0, 'footprint.timeout': 5.0}, Verdict.COLLISION,
        [1.0, 21.0, 21.5, 41.5], [1.0, 21.0],
        id='not linked across more than a timeout of 20 s, where it was')])
def test_obstacle_touches_while_it_is_held(
        tmp_path, messages, set_end, timeouts, verdict, touches, undetermined):
    result = run(tmp_path, messages, set_end, parameters=timeouts)
    assert result.verdict is verdict
    assert times(result) == pytest.approx(touches, abs=1e-6)
    assert times(result, result.undetermined) == pytest.approx(undetermined, abs=1e-6)


@pytest.mark.parametrize('every', [0.1, 0.01])
@pytest.mark.parametrize('places', [(3.0, 9.0), (9.0, 3.0)])
def test_marked_sets_are_linked_if_their_latest_stamps_are_near(tmp_path, places, every):
    """A body moves within the timeout, but its set comes later; whatever comes in between."""
    stamps = {3.0: recordings.nanoseconds(1.48), 9.0: recordings.nanoseconds(1.52)}
    first = [('/obstacles', 0.9, []), ('/obstacles', 1.0, box(-3.0)), ('/obstacles', 1.0, [])]
    second = [*(('/obstacles', 1.52, serialised(box(x), stamps[x])) for x in places),
              ('/obstacles', 1.52, [])]
    robot = samples([0.0] * round(1.9 / every), every=every)
    result = run(tmp_path, [*robot, *first, *second], MARKS, parameters={f'{SOURCE}.timeout': 0.5})
    assert result.contacts == []
    assert times(result, result.undetermined) == pytest.approx([1.0, 1.5])


def with_a_late_footprint(delay):
    """Return messages for 12 s; the one at 5 s, in which it touches, arrives after later ones."""
    return [message for k in range(121) for message in (
        at(k / 10, box(0.0 if k == 50 else 5.0), delay if k == 50 else 0.0, '/footprint'),
        at(k / 10, box(0.5)), at(k / 10, []))]


@pytest.mark.parametrize('delay', (0.15, 0.5, 5.0))
@pytest.mark.parametrize('clock', ('receive', 'header'))
def test_late_footprint_counts_at_its_stamp(tmp_path, delay, clock):
    result = run(tmp_path, with_a_late_footprint(delay), clock=clock)
    contact, = result.contacts
    assert result.verdict is Verdict.COLLISION
    assert contact.first < START + 5 * SECOND < contact.last and contact.found == AT_A_SAMPLE


@pytest.mark.parametrize('delay', (0.3, 2.1))
def test_late_obstacles_count_at_their_stamps(tmp_path, delay):
    """Those of two seconds arrive at once."""
    messages = []
    for k in range(101):
        late = 7.0 - k / 10 + delay if 50 <= k < 70 else 0.0
        messages += [at(k / 10, box(0.0), topic='/footprint'),
                     at(k / 10, box(0.5 if 55 <= k < 60 else 3.0), late), at(k / 10, [], late)]
    result = run(tmp_path, messages)
    contact, = result.contacts
    assert result.verdict is Verdict.COLLISION
    assert since(result, contact.deepest) == [5.5]
    assert result.footprints[0].unknown < SECOND // 2


@pytest.mark.parametrize('delay', [-0.01, 0.15])
def test_contact_at_the_first_stamp_counts(tmp_path, delay):
    """Whichever of the two is received first."""
    messages = []
    for k in range(20):
        messages += [at(1 + k / 10, box(0.0), delay, '/footprint'),
                     at(1 + k / 10, box(0.5) if k == 0 else box(5.0)[:3]),
                     at(1 + k / 10, [])]
    result = run(tmp_path, messages)
    assert result.verdict is Verdict.COLLISION
    assert since(result, result.contacts[0].first) == [pytest.approx(max(-delay, 0.0))]


def test_part_of_a_recording_is_selected_by_stamps(tmp_path):
    result = run(tmp_path, with_a_late_footprint(0.5), duration=5.2)
    assert result.verdict is Verdict.COLLISION
    for clock in ('receive', 'header'):
        result = run_again(tmp_path, duration=4.5, clock=clock)
        assert result.verdict is Verdict.CLEAR
        assert since(result, result.end) == [pytest.approx(4.5, abs=0.1)]


def test_robot_passes_both_prongs_of_a_fork_between_two_messages(tmp_path):
    """These are two contacts: half way they are apart, which is no undetermined time."""
    fork = [(0, -2), (1, -2), (1, 1), (0.75, 1), (0.75, -1), (0.25, -1), (0.25, 1), (0, 1)]
    messages = [message for k in range(21) for message in (
        at(k / 10, box(-20.0 if k < 10 else 20.0, 0.0, 0.125), topic='/footprint'),
        at(k / 10, fork), at(k / 10, []))]
    result = run(tmp_path, messages)
    for contact, left, right in zip(result.contacts, (0.0, 0.75), (0.25, 1.0), strict=True):
        first, deepest, last = (-20.0 + 400.0 * ((time - START) / SECOND - 0.9)
                                for time in (contact.first, contact.deepest, contact.last))
        assert (first, last) == pytest.approx((left - 0.125, right), abs=1e-5)
        assert first < deepest < last and contact.depth > 0.0
    assert result.footprints[0].undetermined == 0


def test_outline_of_many_vertices_passes_between_two_messages(tmp_path):
    """It has more than a polygon may have that nothing declares."""
    angles = np.linspace(0.0, 2.0 * np.pi, 1100, endpoint=False)
    disc = np.column_stack([np.cos(angles), np.sin(angles)])
    messages = [message for k in range(4) for message in (
        at(k / 10, box(9.0), topic='/footprint'), at(k / 10, disc + (6.0 * k, 0.5)),
        at(k / 10, []))]
    contact, = run(tmp_path, messages, parameters={'max_vertices': 2000}).contacts
    assert contact.found == BETWEEN_SAMPLES


def test_seesaw_under_the_robot_is_apart_between_two_messages(tmp_path):
    """Both are convex, and touch at both messages: first at one end of it, then at the other."""
    messages = [message for k in range(21) for message in (
        at(k / 10, [(-2, 0.25), (2, 0.25), (2, 1), (-2, 1)], topic='/footprint'),
        at(k / 10, [(-1, 0.3125), (1, -0.3125)] if k < 10 else [(-1, -0.3125), (1, 0.3125)]),
        at(k / 10, []))]
    result = run(tmp_path, messages)
    assert times(result) == pytest.approx([0.0, 0.91, 0.99, 2.0], abs=1e-6)
    assert result.footprints[0].undetermined == 0


def test_first_polygons_of_too_large_a_collection_count(tmp_path):
    """The obstacle touches in the one of three polygons, which is refused for the third."""
    messages = [message for k in range(20) for message in (
        at(k / 10, box(0.0), topic='/footprint'),
        ('/obstacles', k / 10, collection(
            [box(0.5), box(5.0), box(7.0)] if k == 10 else [box(5.0)], START + k * SECOND // 10)))]
    bag = write(tmp_path / 'bag', messages, types={'/obstacles': COLLECTION})
    result = check(bag, Options(parameters={f'{SOURCE}.max_count': 2}), None)
    assert times(result) == pytest.approx([1.0, 1.1])


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

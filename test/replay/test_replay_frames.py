# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recordings in moving frames, placed by the recorded /tf or odometry."""

import math
from random import Random

from builders import box, collection, odometry, SECOND, serialised, transforms
import numpy as np
import pytest
from recordings import (
    check, COLLECTION, declared, INSTANCE, MARKS, nanoseconds, POLYGON, SOURCE, STAMPS, START,
    write)
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.configuration import settings_of
from sat_collision.replay.model.result import HEADER, NODE, Options, Verdict
from sat_collision.scene.parameters import ParameterError

TYPES = {**dict.fromkeys(('/tf', '/tf_static'), 'tf2_msgs/msg/TFMessage'),
         '/odom': 'nav_msgs/msg/Odometry'}
PARAMETERS = {'frame_id': 'odom', f'{SOURCE}.timeout': 0.3, **declared(STAMPS)}
WITH_IDS = {'frame_id': 'odom', f'{SOURCE}.type': 'polygon_instance'}
POST = [(0, 0), (0.25, 0), (0.25, 0.25), (0, 0.25)]


def static(time=0.0):
    return '/tf_static', time, transforms(('base', 'laser', 0, 1.0, 0.0, math.pi))


def drive(delay=0.04, end=6.0):
    """
    Return a robot that drives along x at 1 m/s past a post at (3, 0), seen by its laser.

    The robot is a box ahead of its origin; its laser looks back. Transforms come at 20 Hz with
    a delay.
    """
    messages = [static(), *(
        ('/tf', k / 20 + delay, transforms(('odom', 'base', nanoseconds(k / 20), k / 20, 0.0)))
        for k in range(round(end * 20)))]
    for k in range(round(end * 10)):
        time = k / 10 + 0.03
        stamp = nanoseconds(time)
        seen = [(time - 2 - x, -y) for x, y in POST]
        messages += [('/footprint', time, serialised(box(0), stamp, 'base')),
                     ('/obstacles', time + 0.001, serialised(seen, stamp, 'laser'))]
    return messages


def run(path, messages, parameters=PARAMETERS, kind=POLYGON, latched=(), **options):
    """Check messages, with a kind of obstacles, which may be latched."""
    bag = write(path, messages, types={**TYPES, '/obstacles': kind}, latched=latched)
    return check(bag, Options(
        parameters=parameters, obstacles=[f'{SOURCE}:=/obstacles'], **options))


def seconds(time):
    return (time - START) / SECOND


def spans(intervals):
    """Return from when to when each is, in s."""
    return [(seconds(one.first), seconds(one.last)) for one in intervals]


@pytest.mark.parametrize('clock, begin', [('receive', 0.0), (HEADER, 0.03)])
@pytest.mark.parametrize('as_live, first, last', [
    (False, (2.0, 2.0), (3.25, 3.25)), (True, (2.03, 2.2), (3.23, 3.6))])
def test_contact_is_at_the_true_time_or_as_live_soon_after(
        tmp_path, clock, begin, as_live, first, last):
    """The robot extends from its origin to 1 m ahead: in contact from 2 to 3.25 s."""
    result = run(tmp_path / 'bag', drive(), clock=clock, as_live=as_live)
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    assert as_live or seconds(result.origin) == begin
    found = spans(result.contacts)
    assert first[0] - 1e-6 <= min(found)[0] <= first[1] + 1e-6
    assert last[0] - 1e-6 <= max(end for _, end in found) <= last[1] + 1e-6
    assert not any(source.rejected for source in result.sources)


@pytest.mark.parametrize('delay', (0.0, 0.2))
def test_contact_amid_messages_that_waited_together_is_found_as_live(tmp_path, delay):
    """A hole in /tf: of the footprints that wait for its end one touches, but not the last one."""
    messages = [('/tf', time, transforms(('odom', 'base', nanoseconds(time), x, 0.0)))
                for time, x in ((0.0, 0.0), (0.1, 0.0), (0.401, 9.0), (0.6, 9.0))]
    for k in range(5):
        stamp = nanoseconds(k / 10)
        messages += [('/obstacles', k / 10, serialised(box(3.5), stamp, 'odom')),
                     ('/footprint', k / 10, serialised(box(0), stamp, 'base'))]
    result = run(tmp_path / 'bag', messages, PARAMETERS | {
        'transform_timeout': 0.5, 'release_delay': delay}, as_live=True,
        write_bag=str(tmp_path / 'out'))
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    contact, = result.contacts
    assert spans([contact]) == [(0.401, 0.401)] and contact.depth > 0.0
    with Recording(tmp_path / 'out') as out:
        flags = [(time, data[-1]) for _, times, row in out.rows([f'{NODE}/footprint/collision'])
                 for time, data in zip(times, row)]
    assert (contact.first, 1) in flags
    assert delay or flags[flags.index((contact.first, 1)) + 1] == (contact.first, 0)


def test_delayed_transforms_delay_contacts_as_live(tmp_path):
    first, second = (min(spans(run(tmp_path / f'bag{delay}', drive(delay), as_live=True).contacts))
                     for delay in (0.0, 0.1))
    assert second[0] - first[0] == pytest.approx(0.1, abs=0.01)


def test_late_transforms_are_unknown_as_live(tmp_path):
    assert run(tmp_path / 'bag', drive(0.3)).verdict is Verdict.COLLISION, 'by the stamps'
    result = run(tmp_path / 'live', drive(0.3), as_live=True)
    assert result.verdict is Verdict.UNKNOWN and result.contacts == []
    for source in result.sources:
        assert set(source.rejected) == {'no transform', 'unknown frame'}
    assert 'the newest of base is' in result.sources[0].examples['no transform']


@pytest.mark.parametrize('as_live', [False, True])
def test_transforms_that_are_far_apart_place_what_is_received_late(tmp_path, as_live):
    """0.45 s apart, obstacles 0.5 s late: by the stamps each waits for the next transform."""
    messages = [('/tf', 0.45 * k, transforms(('odom', 'laser', nanoseconds(0.45 * k), 0.0, 0.0)))
                for k in range(20)]
    for k in range(80):
        stamp = nanoseconds(k / 10)
        messages += [('/footprint', k / 10, serialised(box(0), stamp, 'odom')),
                     ('/obstacles', k / 10 + 0.5, serialised(box(5), stamp, 'laser', 1))]
    messages.append(('/obstacles', 4.5, serialised(box(0.5), nanoseconds(4.0), 'laser', 2)))
    result = run(tmp_path / 'bag', messages, WITH_IDS, INSTANCE, as_live=as_live,
                 footprints=['footprint:=/footprint'])
    assert [one.obstacle for one in result.contacts] == [f'{SOURCE}/2']
    assert not any(source.rejected for source in result.sources)


@pytest.mark.parametrize('clock, begin', [('receive', 0.0), (HEADER, 0.03)])
def test_static_transforms_before_the_checked_part_are_used(tmp_path, clock, begin):
    result = run(tmp_path / 'bag', drive(), start=1.0, clock=clock)
    assert result.verdict is Verdict.COLLISION and seconds(result.origin) == begin
    assert all(set(source.rejected) <= {'no transform'} for source in result.sources)


def test_recordings_without_transforms_say_other_frame(tmp_path):
    messages = [message for message in drive() if not message[0].startswith('/tf')]
    result = run(tmp_path / 'bag', messages)
    assert result.verdict is Verdict.UNKNOWN
    assert {reason for source in result.sources for reason in source.rejected} == {'other frame'}


# An arm of 2 m that rotates about the origin of its frame, and posts that it passes.
ARM = '[[0.0, -0.001], [2.0, -0.001], [2.0, 0.001], [0.0, 0.001]]'
WITH_ARM = {'frame_id': 'odom', 'footprint.points': ARM, 'footprint.frame_id': 'base',
            'max_tf_gap': 2.0, f'{SOURCE}.timeout': 0.0, **declared(MARKS)}


def see(post, time=0.0):
    return '/obstacles', time, serialised([post], nanoseconds(0.0), 'odom')


def turn(posts, tf=True, every=0.5, until=4.0, speed=2.0):
    """Write how the arm rotates at 1 rad/s about a point that moves along x at 2 m/s."""
    messages = [see(post) for post in posts]
    for k in range(round(until / every) + 1):
        time = k * every
        pose = 'odom', 'base', nanoseconds(time), speed * time, 0.0, time
        messages.append(('/tf', time, transforms(pose)) if tf else (
            '/odom', time, odometry(*pose)))
    return messages


def post_passed_at(time, reach=1.99):
    """Return where the end of the arm is at a time."""
    return 2.0 * time + reach * math.cos(time), reach * math.sin(time)


def crossing_times(posts, speed=2.0, until=4.0):
    """Return when the arm's centre line truly crosses each post, sorted."""
    found = []
    for x, y in posts:
        def across(time):
            return y * math.cos(time) - (x - speed * time) * math.sin(time)
        for k in range(4000):
            begin, end = k * until / 4000, (k + 1) * until / 4000
            if across(begin) * across(end) < 0.0:
                for _ in range(50):
                    middle = 0.5 * (begin + end)
                    begin, end = (begin, middle) if across(begin) * across(middle) <= 0.0 else (
                        middle, end)
                along = (x - speed * begin) * math.cos(begin) + y * math.sin(begin)
                assert min(abs(along), abs(along - 2.0)) > 1e-3
                if 0.0 < along < 2.0:
                    found.append(begin)
    return sorted(found)


@pytest.mark.parametrize('tf', (True, False))
def test_rotation_between_two_transforms_is_uniform(tmp_path, tf):
    """Poses are half a radian apart; posts are met when the arm truly points there."""
    random = Random(4)
    posts = [(random.uniform(-1.0, 9.0), random.uniform(-1.9, 1.9)) for _ in range(40)]
    parameters = WITH_ARM if tf else {**WITH_ARM, 'footprint.odometry': '/odom'}
    result = run(tmp_path / 'bag', turn(posts, tf), parameters)
    assert result.problems == [] and result.verdict is Verdict.COLLISION
    times, found = crossing_times(posts), spans(result.contacts)
    # The arm is 2 mm wide, so two crossings in quick succession are one contact.
    assert len(times) >= len(found) >= 8
    for first, last in found:
        assert any(first - 1e-6 <= time <= last + 1e-6 for time in times) and last - first < 0.05
    assert all(any(first - 1e-6 <= time <= last + 1e-6 for first, last in found) for time in times)
    assert {contact.found for contact in result.contacts} == {'between samples'}


def test_motion_between_two_transforms_is_an_arc(tmp_path):
    """On straight lines the end of the arm would stay within 1.938 m."""
    def posts(reach):
        return [(reach * math.cos(angle), reach * math.sin(angle)) for angle in (1.25, 2.75)]
    result = run(tmp_path / 'outside', turn(posts(2.0005), speed=0.0), WITH_ARM)
    assert result.problems == result.contacts == []
    result = run(tmp_path / 'inside', turn(posts(1.9995), speed=0.0), WITH_ARM)
    assert [(one.first + one.last) / 2 for one in result.contacts] == [
        pytest.approx(nanoseconds(time), abs=1e4) for time in (1.25, 2.75)]


@pytest.mark.long
def test_recording_longer_than_the_transform_buffer(tmp_path):
    """A pose every half second for 40 s."""
    result = run(tmp_path / 'bag', turn([post_passed_at(0.61)], until=40.0), WITH_ARM)
    assert seconds(result.contacts[0].first) == pytest.approx(0.61, abs=0.05)
    assert not any(source.undetermined for source in result.sources)


def test_outline_as_live_does_not_move_between_transforms(tmp_path):
    """Posts between two poses are not met."""
    result = run(tmp_path / 'bag', turn([post_passed_at(0.61)]), WITH_ARM, as_live=True)
    assert result.contacts == []
    result = run(tmp_path / 'bag2', turn([post_passed_at(1.5)]), WITH_ARM, as_live=True)
    assert [seconds(contact.first) for contact in result.contacts] == [1.5]
    assert [(one.name, one.received) for one in result.sources] == [('footprint', 9), (SOURCE, 1)]


def test_rate_of_an_outline_does_not_coarsen_its_motion(tmp_path):
    posts = [post_passed_at(0.61), post_passed_at(1.77)]
    slow = {**WITH_ARM, 'footprint.rate': 2.0}
    results = [run(tmp_path / name, turn(posts, every=0.02), parameters)
               for name, parameters in (('all', WITH_ARM), ('some', slow))]
    assert [result.sources[0].received for result in results] == [201, pytest.approx(9, abs=2)]
    for one, other in zip(*(result.contacts for result in results)):
        assert [one.first, one.last] == pytest.approx([other.first, other.last], abs=1e3)
    assert [len(result.contacts) for result in results] == [3, 3]


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('frame', ['base', 'base_footprint'])
def test_outline_that_moves_by_tf_moves_the_clock_of_stamps(tmp_path, as_live, frame):
    """
    It drives on after obstacles have fallen silent.

    The transform of a cart, which moves by odometry, is stamped ahead.
    """
    messages = [('/tf_static', 0.0, transforms(('base_footprint', 'base', 0, 0.0, 0.0)))]
    for k in range(50):
        time = k / 10
        links = [('odom', frame, nanoseconds(time), time, 0.0),
                 ('odom', 'cart', nanoseconds(time + 0.9), 0.0, 0.0)]
        messages.append(('/tf', time, transforms(*links)))
        if time <= 1.0:
            messages += [('/obstacles', time, serialised(points, nanoseconds(time), 'odom'))
                         for points in (box(9.0), [])]
    result = run(tmp_path / 'bag', messages, {
        **PARAMETERS, **declared(MARKS), 'footprint.points': ARM, 'footprint.frame_id': 'base',
        'footprints': ['cart', 'footprint'], 'cart.points': ARM, 'cart.frame_id': 'cart',
        'cart.odometry': '/odometry'}, clock=HEADER, as_live=as_live)
    assert result.verdict is Verdict.UNKNOWN
    assert (result.start, result.end) == (nanoseconds(0.0), nanoseconds(4.9))
    assert seconds(result.unknown[-1].first) == pytest.approx(1.3, abs=1e-6)


def test_gap_between_transforms_is_undetermined(tmp_path):
    messages = [message for message in turn([post_passed_at(1.77)], every=0.1)
                if message[0] != '/tf' or not 1.5 < message[1] < 2.2]
    result = run(tmp_path / 'bag', messages, {**WITH_ARM, 'max_tf_gap': 0.5})
    assert result.contacts == []
    footprint = next(one for one in result.sources if one.name == 'footprint')
    assert footprint.undetermined == pytest.approx(0.7e9, rel=0.2)


def test_recording_of_a_loop(tmp_path):
    """The stamps begin again."""
    once = turn([post_passed_at(0.61)], every=0.1)
    again = [(topic, time + 10.0, data) for topic, time, data in once]
    assert run(tmp_path / 'bag', [*once, *again], WITH_ARM).problems == []


def test_missing_tf_is_unknown(tmp_path):
    result = run(tmp_path / 'bag', [see((50, 50)), see((50, 50), 3.0)], WITH_ARM)
    assert result.verdict is Verdict.UNKNOWN
    assert any(note.startswith('footprint: the recording has no topic /tf')
               for note in result.notes)


@pytest.mark.parametrize('as_live', [False, True])
def test_map_is_unknown_once_its_frame_is_too_old(tmp_path, as_live):
    """From one timeout of the footprint after the last transform, 1 s, on."""
    messages = [('/tf', 0.0, transforms(('odom', 'map', nanoseconds(0.0), 0.0, 0.0))),
                *(('/obstacles', 0.0, serialised(points, nanoseconds(0.0), 'map'))
                  for points in (box(9), [])),
                *(('/footprint', k / 10, serialised(box(0), nanoseconds(k / 10), 'odom'))
                  for k in range(20))]
    result = run(tmp_path / 'bag', messages, {**PARAMETERS, f'{SOURCE}.timeout': 0.0,
                 **declared(MARKS)}, latched=['/obstacles'], as_live=as_live)
    assert spans(one for one in result.unknown if 'transform is too old' in one.reasons[0]) == [
        (1.000000001, 1.9)]


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('kind', ['polygons', 'ids', 'collections'])
def test_map_moves_with_its_frame(tmp_path, kind, as_live):
    """It touches from 2 to 3 s, and again from 4.5 s on, as a map in the fixed frame."""
    def see(time, points, frame_id):
        stamp, number = nanoseconds(time), {'site': 1, 'odom': 2}[frame_id]
        return '/obstacles', time, (
            collection([points] if points else [], stamp, frame_id) if kind == 'collections' else
            serialised(points, stamp, frame_id, number if kind == 'ids' else None))

    ends = [] if kind == 'collections' else [()]
    messages = [see(time, points, frame_id) for time, frame_id, x in (
        (0.15, 'site', 0), (2.5, 'site', 0), (4.5, 'odom', 0.5)) for points in (box(x), *ends)]
    for k in range(50):
        time = k / 10
        messages += [('/tf', time, transforms(
            ('odom', 'site', nanoseconds(time), 0.5 if 2 <= time < 3 else 10.0, 0.0))),
            ('/footprint', time, serialised(box(0), nanoseconds(time), 'odom'))]
    parameters = {'frame_id': 'odom', f'{SOURCE}.timeout': 0.0, **(
        declared(MARKS) if ends else {f'{SOURCE}.type': 'polygon_collection'})}
    result = run(tmp_path / 'bag', messages, parameters,
                 {'polygons': POLYGON, 'ids': INSTANCE, 'collections': COLLECTION}[kind],
                 latched=['/obstacles'], as_live=as_live)
    assert result.problems == []
    assert spans(result.contacts) == [
        (2.0, pytest.approx(3.0, abs=1e-6)), (4.5, pytest.approx(4.9, abs=1e-2))]


@pytest.mark.parametrize('clock', ['receive', HEADER])
@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('moving', [(), (2.0,), (0.0, 1.0, 2.5, 3.0), (0.0, 3.0, 4.0)])
@pytest.mark.parametrize('start', [0.0, 1.5])
def test_corrected_static_transform_counts_from_then_on(tmp_path, as_live, clock, moving, start):
    """
    Those of other frames, and that of the same frame again, are valid at any time.

    The frame moves for a while from some of these times on.
    """
    sent = {0.0: 10.0, 1.0: 10.0, 2.0: 0.5, 2.5: 0.5, 3.0: 10.0, 4.0: 10.0}
    messages = []
    for k in range(50):
        time = k / 10
        last = max(one for one in sent if one <= time)
        messages += [('/tf', time, transforms(
            ('odom', 'site', nanoseconds(time), sent[last], 0.0))) for _ in range(last in moving)]
        messages += [('/tf_static', time, transforms(
            ('odom', 'site', 0, sent[time], 0.0))) for _ in range(time in {*sent} - {*moving})]
        messages += [(topic, time, serialised(points, nanoseconds(time), frame_id))
                     for topic, points, frame_id in (('/obstacles', box(0), 'site'),
                                                     ('/footprint', box(0), 'odom'))]
    result = run(tmp_path / 'bag', messages, clock=clock, as_live=as_live, start=start)
    assert spans(result.contacts) == [(pytest.approx(2.05, abs=0.15),
                                       pytest.approx(3.05, abs=0.15))]


@pytest.mark.parametrize('as_live', [False, True])
@pytest.mark.parametrize('x, contacts', [(0.0, [2.1, 2.4]), (10.0, [])])
def test_outline_jumps_with_a_corrected_static_transform(tmp_path, as_live, x, contacts):
    """From 0 to 20 m at 2.4 s; before that an obstacle appears where it stands, or halfway."""
    messages = [('/tf_static', time, transforms(('odom', 'base', 0, place, 0.0)))
                for time, place in ((0.0, 0.0), (2.4, 20.0))]
    messages += [('/obstacles', k / 20, serialised(points, nanoseconds(k / 20), 'odom', number))
                 for k in range(1, 80) for number, points in ((1, box(5, 50)), (2, box(x)))
                 if number == 1 or 42 <= k < 54]
    result = run(tmp_path / 'bag', messages, {
        **WITH_IDS, 'footprints': ['robot'], 'robot.radius': 0.5, 'robot.frame_id': 'base'},
        INSTANCE, as_live=as_live)
    assert [*sum(spans(result.contacts), ())] == pytest.approx(contacts, abs=0.01)


def test_invalid_outline_is_bad_input(tmp_path):
    result = run(tmp_path / 'bag', turn([(50, 50)]), {**WITH_ARM, 'frame_id': ''})
    assert 'needs the fixed frame' in result.problems[0]
    with pytest.raises(ParameterError, match='needs the fixed frame'):
        settings_of({**WITH_ARM, 'frame_id': ''})


@pytest.mark.parametrize('as_live', [False, True])
def test_simulation_that_was_reset_is_seen_by_its_transforms(tmp_path, as_live):
    """The footprint is an outline, and the obstacles are a map without stamps."""
    messages = [('/obstacles', 0.0, serialised(points, 0, 'odom')) for points in (box(9), [])]
    messages += [('/tf', k / 10, transforms(
        ('odom', 'base', nanoseconds((k - (4 if k > 30 else 0)) / 10), 0.0, 0.0)))
        for k in range(60)]
    result = run(tmp_path / 'bag', messages, WITH_ARM, latched=['/obstacles'], as_live=as_live,
                 clock=HEADER)
    problem, = result.problems
    assert "the stamps of frame 'base' on /tf go back by 0.3 s" in problem
    assert result.verdict is Verdict.BAD_INPUT


KINDS = {'sets': declared(MARKS), 'ids': {f'{SOURCE}.type': 'polygon_instance'}}
BODIES_EVERY, TRANSFORMS_EVERY, LAST = 1 / 16, 1 / 8, 8.0
# Their places at a time: without rotation each number is a float32 in either frame, and no contact
# begins or ends at the stamp of a message.
OBSTACLES = (lambda time: box(6 + 1 / 64, 0.25, 0.25, 0.25), lambda time: box(12.0 - time, 0.5),
             lambda time: box(4 + 3 / 64, 3.0 - time, 0.5, 0.25))


def written(points, time, frame_id, turning, number=None):
    """Write a body with points in the fixed frame as a message in another frame."""
    if frame_id == 'laser':
        angle = turning * time
        c, s = math.cos(angle), math.sin(angle)
        points = np.array(points) - (1.5 * time, 0.5)
        points = points if not angle else points @ [(c, -s), (s, c)]
    return serialised(points, nanoseconds(time), frame_id, number)


def recorded(path, kind, delay, turning, frames):
    """Replay footprint and obstacles in one frame each; transforms come late."""
    messages = []
    for k in range(round(LAST / TRANSFORMS_EVERY) + 1):
        time = k * TRANSFORMS_EVERY
        messages.append(('/tf', time + delay, transforms(
            ('odom', 'laser', nanoseconds(time), 1.5 * time, 0.5, turning * time))))
    for k in range(round(LAST / BODIES_EVERY)):
        time = k * BODIES_EVERY
        messages.append(('/footprint', time + 0.01,
                         written(box(1.5 * time, 0.0), time, frames[0], turning)))
        messages += [('/obstacles', time + 0.02 + 0.001 * i,
                      written(place(time), time, frames[1], turning, i if kind == 'ids' else None))
                     for i, place in enumerate(OBSTACLES, 1)]
        if kind == 'sets':
            messages.append(('/obstacles', time + 0.03, []))
    result = run(path, messages, {'frame_id': 'odom', **KINDS[kind]},
                 INSTANCE if kind == 'ids' else POLYGON, footprints=['footprint:=/footprint'])
    assert result.problems == [] and not any(source.rejected for source in result.sources)
    return result


def compare(moving, fixed, near):
    """Compare contacts and separations; near is a tolerance in m and in s."""
    assert len(moving.contacts) == len(fixed.contacts)
    for one, other in zip(moving.contacts, fixed.contacts):
        assert (one.obstacle, one.found) == (other.obstacle, other.found)
        assert [one.first, one.last, *filter(None, one.between)] == pytest.approx(
            [other.first, other.last, *filter(None, other.between)], rel=0.0, abs=near * 1e9)
        assert one.depth == pytest.approx(other.depth, abs=near)
    known = dict(fixed.footprints[0].separation)
    both = [(value, known[time]) for time, value in moving.footprints[0].separation
            if value is not None and known.get(time) is not None]
    assert len(both) > 0.9 * len(known)
    assert [one for one, _ in both] == pytest.approx([other for _, other in both], abs=near)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('delay', (0.0, 0.06))
@pytest.mark.parametrize('turning', (0.0, 0.4))
def test_motion_is_that_of_the_fixed_frame(tmp_path, kind, delay, turning):
    """Each body is placed at its own stamp, though others arrive while it waits."""
    fixed = recorded(tmp_path / 'fixed', kind, delay, turning, ('odom', 'odom'))
    assert [contact.obstacle for contact in fixed.contacts] == [
        f'{SOURCE}/{k + (kind == "ids")}' for k in (2, 0, 1)]
    for frames in (('odom', 'laser'), ('laser', 'odom'), ('laser', 'laser')):
        moving = recorded(tmp_path / '-'.join(frames), kind, delay, turning, frames)
        # Without rotation the numbers are identical.
        compare(moving, fixed, 1e-5 if turning else 0.0)

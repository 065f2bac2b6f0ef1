# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How bodies are followed from set to set, when that is undetermined, and their keyframes."""

import math

from builders import SECOND, serialised
import numpy as np
import pytest
from recordings import (
    at, box, check, declared, drive, INSTANCE, MARKS, nanoseconds, published, run, samples, since,
    SOURCE, STAMPS, START, times, write)
from sat_collision.geometry.body.packing import TRIPLE
from sat_collision.geometry.body.polygon import Polygon
from sat_collision.geometry.query import separation
from sat_collision.messages.ingest import Placement
from sat_collision.replay.model.configuration import settings_of
from sat_collision.replay.model.result import FootprintResult, moments_of, Options, Verdict
from sat_collision.replay.motion import contacts
from sat_collision.replay.motion.motion import RecordedMotion
from sat_collision.replay.motion.tracker import SetTracker
from sat_collision.replay.output.page import write_page
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import ObstacleSettings

SHAPES = [box(0.0), [(0, 0), (2, 0), (0.5, 1)], [(0, 0), (1.5, 0.5)], [*box(0.0), (0.0, 0.0)],
          [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]]
NAMES = 'robot', 'cart', 'lidar', 'radar', 'map'
SETTINGS = settings_of({
    'footprints': ['robot', 'cart'], 'obstacles': ['lidar', 'radar', 'map'], 'margin': 0.1,
    **declared(STAMPS, 'lidar', 'radar'), **{f'{name}.topic': f'/{name}' for name in NAMES}})


def placed(name, time, shape, **listed):
    """Return the placement of a body at a time in s, whose stamp is by default its listing."""
    points = np.zeros((len(shape), 3), np.float32)
    points[:, :2] = np.reshape(shape, (-1, 2))
    stamp = START + round(time * SECOND)
    return Placement(name, stamp, 'map', (points.tobytes(), 0, len(points), TRIPLE), None, None,
                     **listed or {'listing': stamp if name in ('lidar', 'radar') else 0})


def placements(name, rng, times, shapes):
    """Return bodies that drive past the origin or stand; a few are missing at each time."""
    places, speeds = rng.uniform(-9, 9, (2, len(shapes), 2))
    speeds *= rng.choice([0.1, 0.5]) * (rng.random((len(shapes), 1)) < 0.6)
    for time in times:
        for shape, place, speed in zip(shapes, places, speeds):
            if rng.random() < 0.9:
                yield placed(name, time, shape + place + speed * (time - 6.0))


def recorded(seed):
    rng = np.random.default_rng(seed)
    shapes = [np.array(shape, float) for shape in SHAPES]
    found = []
    for name in ('robot', 'cart'):
        times = np.arange(0.0, 12.0, 0.1) if rng.random() < 0.5 else np.cumsum(
            rng.uniform(0.01, 0.1, 200))
        times = times[(times < 4.0) | (times > 5.2)]
        found += placements(name, rng, times, [shapes[rng.integers(len(shapes) - 1)]])
    for name in ('lidar', 'radar'):
        found += placements(name, rng, np.arange(0.0, 12.0, rng.choice([0.1, 0.23])), [
            shapes[rng.integers(len(shapes) - (rng.random() < 0.8))] for _ in range(8)])
    if rng.random() < 0.5:
        found += placements('map', rng, np.cumsum(rng.uniform(0.2, 3.0, 5)), shapes)
    return sorted(found, key=lambda placement: placement.stamp)


def followed(found, together, alone=0):
    """Return results and motion of placements, some at a time after the first ones."""
    results = [FootprintResult(one.name, one.topic, True) for one in SETTINGS.footprints]
    motion = RecordedMotion(SETTINGS, Scene(SETTINGS), None, results)
    motion.place(found[:alone])
    for k in range(alone, len(found), together):
        motion.place(found[k:k + together])
    motion.finish(found[-1].stamp)
    return results, motion


def decided(found, together):
    """Return all results for placements, some at a time."""
    results, motion = followed(found, together)
    return repr((motion.contacts, [(one.least, one.separation) for one in results], [
        motion.undetermined_of[name] for name in NAMES], motion.undetermined))


@pytest.mark.parametrize('seed', range(8))
def test_placements_together_give_the_same_as_one_by_one(seed):
    found = recorded(seed)
    alone = decided(found, 1)
    assert {decided(found, together) for together in (7, 64, 500)} == {alone}


@pytest.mark.parametrize('together', (1, 500))
@pytest.mark.parametrize('x, comes_back, contacts', [
    (1.5, True, 0), (2.5, True, 1), (9.0, True, 2), (9.0, False, 1)],
    ids=['is near', 'touches', 'passes through and comes back', 'passes through'])
@pytest.mark.parametrize('when', range(1, 9))
def test_contact_on_any_piece_between_two_sets(together, x, comes_back, contacts, when):
    """Between two sets the robot's motion has eight pieces; on one it goes elsewhere."""
    found = []
    for k in range(25):
        is_away = k == 8 + when or k > 8 + when and not comes_back
        found.append(placed('robot', k / 8, box(x if is_away else 0.0)))
        if k % 8 == 0:
            found.append(placed('lidar', k / 8, box(3.0)))
    # Sets are processed together from the second on.
    _, motion = followed(found, together, alone=2)
    assert len(motion.contacts) == contacts


def test_first_sample_is_that_of_its_footprint():
    """It sets the frame of all footprints, too."""
    found = [placed('robot', 0.0, box(0.0)), placed('cart', 0.0, box(5.0)),
             placed('lidar', 0.0, box(0.5)), placed('robot', 0.1, box(2.0)),
             placed('cart', 0.1, box(5.0)), placed('lidar', 0.1, box(0.5))]
    _, motion = followed(found, 500)
    assert [(one.footprint, one.first) for one in motion.contacts] == [('robot', START)]


def test_most_steps_are_processed_together(monkeypatch):
    """Otherwise the tests above would test nothing."""
    answers = []
    decide = contacts.ContactTracker._decide_from_batch

    def noting(*arguments):
        answers.append(decide(*arguments))
        return answers[-1]
    monkeypatch.setattr(contacts.ContactTracker, '_decide_from_batch', noting)
    for seed in range(8):
        decided(recorded(seed), 500)
    assert sum(answers) > 300


def random_set(rng, count, extent):
    """Return rings of three or four points on a grid, so that distances are exact and may tie."""
    rings = {}
    for x, y in rng.integers(-extent, extent + 1, (count, 2)):
        corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        ring = tuple(corners[:rng.integers(3, 5)])
        rings[ring] = ring
    return list(rings)


def centre(points):
    """Return twice the centre of the bounds."""
    xs, ys = zip(*points)
    return min(xs) + max(xs), min(ys) + max(ys)


def nearest(points, others):
    """Return the index of the first of the nearest others."""
    x, y = centre(points)
    return min(range(len(others)), key=lambda j: sum(
        (a - b) ** 2 for a, b in zip((x, y), centre(others[j]))))


def expected_pairs(before, after):
    """Return which ring becomes which: mutually nearest, with the same number of points."""
    if not before or not after:
        return set()
    return {(i, j) for i, j in enumerate(nearest(one, after) for one in before)
            if nearest(after[j], before) == i and len(before[i]) == len(after[j])}


@pytest.mark.parametrize('extent', [2, 5, 30])
def test_bodies_are_matched_with_their_mutual_nearest(extent):
    """Dense and sparse sets; time counts where bodies of both sets have no match."""
    rng = np.random.default_rng(extent)
    steps = []
    tracker = SetTracker(ObstacleSettings('lidar', '/lidar'), steps.append, lambda listing: False)
    sets = [random_set(rng, rng.integers(0, 12), extent) for _ in range(300)]
    # The beginning of one more set ends the last one, which is whole then.
    for number, rings in enumerate([*sets, []], 1):
        for points in [*rings, ()]:
            tracker.place(placed('lidar', number / 10, points, listing=number,
                                 last_whole=number - 1))
    held = [step for step in steps if step.seen is None]
    steps = [step for step in steps if step.seen is not None]
    assert len(steps) == len(sets)
    assert sum(map(len, (step.gone for step in held))) == sum(
        len(before) - len(expected_pairs(before, after)) for before, after in zip(sets, sets[1:]))
    undetermined = followed = 0
    for before, after, step in zip(sets, sets[1:], steps[1:]):
        pairs = expected_pairs(before, after)
        assert {pair for motion in step.motions
                for pair in zip(motion.rows, motion.next_rows)} == pairs
        undetermined += SECOND // 10 * (min(len(before), len(after)) > len(pairs))
        followed += len(pairs)
    assert sum(last - first for first, last in tracker.undetermined) == undetermined
    assert followed > 300


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


@pytest.mark.parametrize('changed, missing', [(10, []), (13, [12])],
                         ids=['between two sets', 'before and after a set'])
def test_contact_ends_where_it_is_not_known_how_the_footprint_moved(tmp_path, changed, missing):
    """It stands in contact; one of its messages has another vertex, and is linked to none."""
    messages = samples([0.0] * 20) + samples([0.5] * 5, '/obstacles', 0.4)
    messages[changed] = '/footprint', changed / 10, [*box(0.0), (0.0, 0.5)]
    before, after = (changed - 1 - len(missing)) / 10, (changed + 1) / 10
    result = run(tmp_path, [one for k, one in enumerate(messages) if k not in missing])
    assert times(result) == pytest.approx([0.0, before, *[changed / 10] * 2, after, 1.9])
    assert [one.at_end for one in result.contacts] == [False, False, True]
    assert times(result, result.undetermined) == pytest.approx([before, after])


@pytest.mark.parametrize('x, contacts', [(-5.0, [1.86, 2.0]), (5.0, [])])
def test_motion_from_one_frame_to_another_is_undetermined(tmp_path, x, contacts):
    """
    None is fixed: the footprint is last seen in one at 2.0 s and first in the other at 2.5.

    The last set in the one, from 2.4 s on, is not known to be whole; the one before is of 1.5 s.
    """
    messages = [(topic, k / 10, serialised(
        box(place), nanoseconds(k / 10), 'map' if k < 25 else 'odom'))
        for topic, gap, place in (('/footprint', (21, 25), 0.0), ('/obstacles', (16, 25), 5.0))
        for k in range(50) if k not in range(*gap)]
    messages.append(('/obstacles', 2.4, box(x)))
    result = run(tmp_path, messages)
    assert times(result) == pytest.approx(contacts)
    assert times(result, result.undetermined) == pytest.approx([1.5, 2.0, 2.0, 2.5])
    assert result.verdict is (Verdict.COLLISION if contacts else Verdict.UNKNOWN)


@pytest.mark.parametrize('seen, undetermined', [
    ([(0, 20, 5.0), (20, 40, -5.0)], [1.9, 2.0]), ([(0, 40, 5.0), (20, 40, -5.0)], []),
    ([(0, 10, 5.0), (10, 15, -5.0), (15, 40, 8.0)], [0.9, 1.0, 1.4, 1.5]),
    ([(0, 38, 5.0), (38, 40, -5.0)], [3.7, 3.8]), ([(10, 11, 5.0), (10.5, 40, -5.0)], [])],
    ids=['goes', 'stays', 'goes twice', 'goes at the end', 'goes after it came with the other'])
def test_polygon_that_may_have_moved_is_undetermined(tmp_path, seen, undetermined):
    """Of sets without a declared end: one goes and one comes, or one comes to the other."""
    messages = samples([0.0] * 40) + [
        at(k / 10, box(x)) for begin, end, x in seen for k in np.arange(begin, end)]
    result = run(tmp_path, messages, None, max_unknown=1.5,
                 parameters={f'{SOURCE}.timeout': 0.3, 'future_tolerance': 0.1})
    assert result.contacts == []
    found = [one for one in result.undetermined if one.reasons[0].endswith('obstacle moved')]
    assert times(result, found) == pytest.approx(undetermined)
    assert result.verdict is (Verdict.UNKNOWN if undetermined else Verdict.CLEAR)


@pytest.mark.parametrize('place, undetermined, unknown', [
    (10, [0.9, 1.0], []), (11, [], [1.0, 1.1])], ids=['before', 'after'])
def test_refused_footprint_counts_before_or_after_a_valid_one_of_its_stamp(
        tmp_path, place, undetermined, unknown):
    """It breaks the way to that one; or the node does not know the state from there on."""
    messages = samples([0.0] * 20) + samples([5.0] * 20, '/obstacles')
    messages.insert(place, ('/footprint', 1.0, [(float('nan'), 0.0)]))
    result = run(tmp_path, messages)
    assert times(result, result.undetermined) == pytest.approx(undetermined)
    assert times(result, result.unknown[1:]) == pytest.approx(unknown)


def test_silence_of_a_source_that_never_sees_anything_is_undetermined(tmp_path):
    """Its publisher ends empty sets, but none for a second, which one footprint does not see."""
    messages = samples([0.0] * 30) + samples([9.0] * 12, '/gone') + [
        ('/obstacles', k / 10, []) for k in range(30) if not 10 < k < 20]
    result = run(tmp_path, messages, MARKS, footprints=('/footprint', '/gone'),
                 parameters={f'{SOURCE}.timeout': 0.5})
    assert {one.name: one.undetermined for one in result.sources} == {
        'footprint': 0, 'gone': 0, SOURCE: SECOND}
    assert times(result, result.undetermined[:1]) == pytest.approx([1.0, 1.5])
    assert result.verdict is Verdict.UNKNOWN


@pytest.mark.parametrize('clock', ['receive', 'header'])
@pytest.mark.parametrize('touches, marked', [((0.0, 2.0), 0.0), ((2.5, 3.0), 2.0)],
                         ids=['never marked', 'no longer marked'])
def test_set_that_stays_open_for_longer_than_its_timeout_touches(tmp_path, touches, marked, clock):
    """Its publisher forgets the marks: nothing is refused as too old, and no contact is lost."""
    messages = samples([0.0] * 51) + [
        ('/obstacles', k / 10, box(0.5 if touches[0] <= k / 10 < touches[1] else 5.0))
        for k in range(51)] + [('/obstacles', k / 10, []) for k in range(51) if k / 10 < marked]
    result = run(tmp_path, messages, MARKS, parameters={f'{SOURCE}.timeout': 2.0}, clock=clock)
    assert result.verdict is Verdict.COLLISION and not any(one.rejected for one in result.sources)
    assert times(result)[-1] == pytest.approx(touches[1] - 0.1 + 2.0)
    assert 'a whole set' in str(result.unknown) or 'not ended a set' in str(result.unknown)


def test_time_after_the_last_footprint_is_undetermined(tmp_path):
    """It is not clear, and does not fail the check as long as the footprint is not silent."""
    result = run(tmp_path, samples([0.0] * 20) + samples([5.0] * 24, '/obstacles'))
    footprint, = result.footprints
    assert result.verdict is Verdict.CLEAR
    assert footprint.undetermined == pytest.approx(0.4 * SECOND)
    assert footprint.clear == footprint.last - result.start - footprint.unknown


def test_check_ends_at_the_last_stamp_where_all_is_received_late(tmp_path):
    """In the 0.8 s until it was received no more is stamped, which is not unknown."""
    messages = [message for k in range(40) for message in (
        at(k / 10, box(0.0), 0.8, '/footprint'), at(k / 10, box(5.0), 0.8))]
    result = run(tmp_path, messages, parameters={
        f'{name}.timeout': 0.3 for name in ('footprint', SOURCE)})
    assert (result.end, result.unknown) == (nanoseconds(3.9), [])


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


def test_footprint_that_was_overtaken_leaves_the_motion_as_it_is(tmp_path):
    """It is received 13 s after its stamp, so it is not put in its place, but ignored."""
    messages = samples([0.0] * 201) + samples([2.0] * 201, '/obstacles')
    result = run(tmp_path, [*messages, at(2.0, box(9.0), 13.05, '/footprint')],
                 parameters={'footprint.timeout': 60.0})
    assert [*result.sources[0].rejected] == ['older than the last']
    assert (result.undetermined, result.verdict) == ([], Verdict.CLEAR)


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


RECORDINGS = ('autoware_ego_trajectory_boxes', 'commonroad_BEL_Zaventem-1_2_T-1',
              'commonroad_USA_Lanker-1_1_ego1247', 'tysik_front_scan_polygons')
WITH_IDS = {'obstacle.type': 'polygon_instance'}


def with_keyframes(path, set_end=MARKS, **options):
    """Return the result of a check with keyframes."""
    result = check(path, Options(keyframes=True, **options), set_end=set_end)
    assert not result.problems
    return result


def number_near(keyframes, time):
    """Return the number of the moment nearest to a time."""
    return min(range(len(keyframes.moments)),
               key=lambda number: abs(keyframes.moments[number] - nanoseconds(time)))


def places(keyframes, time, is_footprint=False):
    """Return left ends of bodies by name, and whether they are known, at a time."""
    number = number_near(keyframes, time)
    return {span.name: (span.ring[:, 0].min(), span.known) for body, span in keyframes.at(number)
            if body.is_footprint is is_footprint}


def agree(result, as_live):
    """Compare the separation of each pair in contact with its depth."""
    assert result.contacts
    found = {}
    for contact in result.contacts:
        found.setdefault(contact.deepest, []).append(contact)
    for time, at_once in found.items():
        number = result.keyframes.number(time)
        assert result.keyframes.moments[number] == time
        # As live, several contacts may be deepest at one time between messages; one is shown.
        for contact in at_once if not as_live else [max(at_once, key=lambda one: one.depth)]:
            own = result.keyframes.footprint(contact.footprint).at(number)
            other = result.obstacle_of(contact).at(number)
            assert own.known and other.known
            assert separation(Polygon(own.ring), Polygon(other.ring)) == -contact.depth


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
@pytest.mark.parametrize('name', RECORDINGS)
def test_keyframes_agree_with_the_depth_of_contacts(name, as_live):
    """Exactly, at the deepest moment of each."""
    agree(with_keyframes(published(name), STAMPS, as_live=as_live), as_live)


def test_keyframes_of_a_momentary_contact(tmp_path):
    """As live, the robot comes to where the person was, who leaves at the same time."""
    messages = []
    for tick in range(40):
        messages += [('/footprint', tick / 10, box(2.5 if tick >= 10 else 0.0)),
                     ('/obstacles', tick / 10, box(6.0 if tick >= 10 else 3.0)),
                     ('/obstacles', tick / 10, [])]
    result = with_keyframes(write(tmp_path / 'bag', messages), as_live=True)
    contact, = result.contacts
    assert contact.first == contact.last == contact.deepest and contact.depth == 0.5
    agree(result, True)


def test_bodies_are_interpolated_between_messages(tmp_path):
    """A footprint at 1 Hz and an obstacle with an id at 2 Hz."""
    messages = [('/footprint', time, box(2.0 * time)) for time in range(11)]
    messages += [('/obstacles', time / 2, serialised(box(30.0 - time), nanoseconds(time / 2),
                                                     instance=7)) for time in range(21)]
    result = with_keyframes(write(tmp_path / 'bag', messages, types={'/obstacles': INSTANCE}),
                            None, parameters=WITH_IDS)
    for time in (0.3, 4.5, 7.77):
        number = number_near(result.keyframes, time)
        moment = (result.keyframes.moments[number] - nanoseconds(0)) / 1e9
        found, = (span for body, span in result.keyframes.at(number) if body.is_footprint)
        assert found.known and found.ring[:, 0].min() == pytest.approx(2.0 * moment, abs=1e-5)
        (name, (x, known)), = places(result.keyframes, time).items()
        assert name.endswith('/7') and known and x == pytest.approx(30.0 - 2 * moment, abs=1e-5)


def test_unknown_body_stays_in_place_and_is_marked(tmp_path):
    """The footprint is silent from 4 s to 8 s."""
    messages = [message for message in drive(12.0, contact=(0, 0))
                if message[0] != '/footprint' or not 4.0 < message[1] < 8.0]
    result = with_keyframes(write(tmp_path / 'bag', messages))
    known = {time: places(result.keyframes, time, True)['footprint'][1] for time in (2, 6, 10)}
    assert known == {2: True, 6: False, 10: True}


def test_removed_obstacle_leaves_the_keyframes(tmp_path):
    messages = [message for k in range(101) for message in (
        ('/footprint', k / 10, box(0)), ('/obstacles', k / 10, box(3)),
        *([('/obstacles', k / 10, box(6))] if k < 50 else []), ('/obstacles', k / 10, []))]
    path = write(tmp_path / 'bag', messages)
    for as_live in (False, True):
        keyframes = with_keyframes(path, as_live=as_live).keyframes
        assert [len(places(keyframes, time)) for time in (2, 8)] == [2, 1]


def test_moments_are_dense_around_contacts_and_few_in_all(tmp_path):
    """Ten minutes with one contact of half a second."""
    result = with_keyframes(
        write(tmp_path / 'bag', drive(600.0, rate=2.0, contact=(300.0, 300.5))))
    moments = moments_of(result)
    assert moments == result.keyframes.moments == sorted(set(moments)) and len(moments) < 500
    near = [time for time in moments if abs(time - nanoseconds(300.0)) < 1e9]
    assert len(near) > 20
    assert max(b - a for a, b in zip(moments, moments[1:])) < 2e9


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
def test_fault_of_the_drawing_is_said_and_loses_nothing_else(tmp_path, as_live):
    """The recording is removed before the second pass."""
    path = write(tmp_path / 'bag', drive())
    plain = check(path, Options(as_live=as_live))
    result = check(path, Options(as_live=as_live, keyframes=True), lambda share: (
        path / 'bag.mcap').unlink(missing_ok=True))
    assert plain.problems == []
    assert 'read again to be drawn' in result.problems[0]
    assert result.contacts == plain.contacts != []


@pytest.mark.parametrize('as_live', (False, True), ids=('motion', 'live'))
def test_keyframes_do_not_change_the_result(tmp_path, as_live):
    """The second pass, which draws, counts no message or fault twice; progress goes on in it."""
    path = write(tmp_path / 'bag', drive())
    with (path / 'bag.mcap').open('r+b') as file:
        file.truncate(file.seek(0, 2) - 100)
    plain = check(path, Options(as_live=as_live))
    shares = []
    result = check(path, Options(as_live=as_live, keyframes=True), shares.append)
    assert plain.problems and plain.keyframes is None and result.keyframes
    assert sum(share < 0.5 for share in shares) == sum(share >= 0.5 for share in shares) > 0
    assert shares == sorted(shares) and shares[-1] <= 1.0
    assert result.keyframes.moments[-1] == moments_of(plain)[-1]
    result.keyframes = None
    assert plain == result


def test_bodies_that_come_and_go_between_two_moments_are_left_out(tmp_path):
    """There are moments every 0.25 s, and the page can be written."""
    messages = [message for k in range(1000) for message in (
        ('/footprint', k / 10, box(0)), ('/obstacles', k / 10, box(3 + k % 50)[:3 + k % 2]))]
    result = with_keyframes(write(tmp_path / 'bag', messages), STAMPS)
    assert all(body.spans for body in result.keyframes.bodies)
    write_page([result], tmp_path / 'page.html')

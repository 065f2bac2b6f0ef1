# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Transforms of frames, against matrices and recorded answers of tf2."""

import math

import numpy as np
from published import load
import pytest
from rationals import rounded
from sat_collision.scene import frames
from sat_collision.scene.frames import (
    BAD_NAMES, BAD_TRANSFORM, Frames, Mapped, NoTransform, OLD_TRANSFORM)
from sat_collision.scene.rotations import (
    accepted, affine_of, composed, fixed, IDENTITY, interpolated, relative, tilt)

SECOND = 10**9
START = 1000 * SECOND
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def nanoseconds(seconds):
    return START + round(seconds * SECOND)


def looked_up(buffer, target, source, stamp, *oldest):
    """Return the time, by default the newest, and the transform at that, or the NoTransform."""
    at = stamp or buffer.newest(target, source, *oldest)
    return at, at if isinstance(at, NoTransform) else buffer.lookup(target, source, at or 0)


class Tree:
    """Frames with short methods to insert transforms and look up positions."""

    def __init__(self, **limits):
        limits = {'max_gap': SECOND // 2, 'max_tilt': math.radians(5), **limits}
        self.frames = Frames(10 * SECOND, **limits)

    def moving(self, parent, child, *places, rotation=UPRIGHT):
        """Insert (time, x) of a child frame."""
        for time, x in places:
            assert self.frames.insert(parent, child, nanoseconds(time),
                                      (float(x), 0.0, 0.0, *rotation)) is None

    def static(self, parent, child, x=0.0, rotation=UPRIGHT):
        assert self.frames.insert(parent, child, 0, (x, 0.0, 0.0, *rotation), True) is None

    def where(self, source, time, target='odom'):
        """Return x of the source frame, or the NoTransform."""
        found = self.frames.lookup(target, source, nanoseconds(time))
        return found if isinstance(found, NoTransform) else rounded(found)[0]

    def newest(self, source, oldest, target='odom'):
        at, found = looked_up(self.frames, target, source, 0, nanoseconds(oldest))
        return found if isinstance(found, NoTransform) else (rounded(found)[0], at)

    def lookup_affine(self, source, time, target='odom'):
        return self.frames.lookup_affine(target, source, nanoseconds(time))


@pytest.fixture
def tree():
    """Return frames in which the base is at x = 0 at 0 s and moves by 1 m/s until 1 s."""
    tree = Tree()
    tree.moving('odom', 'base', *((k / 10, k / 10) for k in range(11)))
    tree.static('base', 'laser', 0.25)
    return tree


def test_stamp_newer_than_all_transforms_may_still_come_and_an_older_one_will_not(tree):
    words = 'no transform from laser to odom at its stamp: the {} of base is {} s {}'
    assert tree.where('laser', 1.3) == (
        frames.NO_TRANSFORM, words.format('newest', 0.3, 'older'), True)
    assert tree.where('laser', -0.02) == (
        frames.NO_TRANSFORM, words.format('oldest', 0.02, 'newer'), False)
    tree.moving('odom', 'base', (1.4, 1.4))
    assert tree.where('laser', 1.3) == pytest.approx(1.55)


def test_gap_longer_than_max_gap_is_not_interpolated(tree):
    tree.moving('odom', 'base', (1.51, 2))
    assert tree.where('base', 1.2) == (
        frames.GAP, 'no transform from base to odom at its stamp: the transforms of base around '
        'it are 0.51 s apart, more than 0.5 s', False)
    assert tree.where('base', 1.51) == 2.0 and tree.where('base', 1.0) == 1.0
    tree.moving('odom', 'base', (1.3, 1.3))
    assert tree.where('base', 1.2) == pytest.approx(1.2)


def test_a_chain_waits_while_one_of_its_frames_may_come(tree):
    """The map begins later than the stamp, but the chain from the base to the camera avoids it."""
    tree.moving('map', 'odom', (9.0, 0), (9.1, 0))
    tree.moving('odom', 'camera', (0.0, 5), (0.1, 5))
    assert tree.where('base', 0.35, target='camera').may_come
    tree.moving('odom', 'camera', (0.4, 5))
    assert tree.where('base', 0.35, target='camera') == pytest.approx(-4.65)


@pytest.mark.parametrize('source, target, named', [
    ('sonar', 'odom', 'sonar'), ('laser', 'map', 'map'), ('sonar', 'map', 'sonar or map')])
def test_unknown_frame_is_named_beside_those_that_are_known(tree, source, target, named):
    assert tree.where(source, 0.5, target) == (
        frames.UNKNOWN_FRAME, f'no transform from {source} to {target}: no good transform has '
        f'named {named} yet, only base, laser, odom', True)
    assert tree.newest(source, -9, target).reason == frames.UNKNOWN_FRAME


def test_frames_of_two_trees_are_not_connected(tree):
    tree.moving('world', 'crane', (0.0, 0), (1.0, 0))
    assert tree.where('crane', 1.0) == tree.newest('crane', -9) == (
        frames.NOT_CONNECTED, 'no transform from crane to odom: no transforms connect them', True)


def test_quaternion_is_normalised(tree):
    """As `static_transform_publisher --qz 0.7 --qw 0.7` sends it: a quarter turn to the left."""
    tree.static('laser', 'arm', 1.0, rotation=(0.0, 0.0, 0.7, 0.7))
    tree.static('arm', 'hand', 2.0)
    assert tree.lookup_affine('hand', 0.5).affine == (0.0, -1.0, 1.75, 1.0, 0.0, 2.0)


@pytest.mark.parametrize('name', ['', '/base'])
def test_invalid_frame_names(tree, name):
    found = tree.where(name, 0.5)
    assert (found.reason, found.may_come) == (frames.BAD_FRAME_ID, False)
    assert f"'{name}' is not a valid frame" in found.detail
    assert tree.where('base', 0.5, target=name).reason == frames.BAD_FRAME_ID


def test_loop_is_named(tree):
    tree.static('b', 'a')
    tree.static('d', 'b')
    tree.static('a', 'd')
    tree.static('b', 'c')
    for source, target in (('c', 'odom'), ('odom', 'c')):
        loop = (frames.LOOP, f'no transform from {source} to {target}: the parents of c lead in a '
                'circle: c, b, d, a', True)
        assert tree.where(source, 0.5, target) == tree.newest(source, -9, target) == loop
    # The two chains meet, but there is no root.
    assert tree.where('a', 0.5, target='c').reason == frames.LOOP
    assert tree.where('c', 0.5, target='a') == 0.0
    tree.static('odom', 'b', 7.0)
    assert tree.where('c', 0.5) == 7.0


@pytest.mark.parametrize('was_static', [False, True])
@pytest.mark.parametrize('is_static', [False, True])
def test_transform_that_was_sent_the_wrong_way_round_can_be_corrected(was_static, is_static):
    """The map was placed in odom, which is meant to be placed in the map."""
    tree = Tree()
    for time, parent, child, static in ((0.0, 'odom', 'map', was_static),
                                        (0.1, 'map', 'odom', is_static)):
        tree.static(parent, child, 1.0) if static else tree.moving(parent, child, (time, 1.0))
    tree.moving('map', 'wall', (0.1, 0.0))
    assert tree.where('map', 0.1) == tree.where('wall', 0.1) == -1.0
    assert tree.newest('map', 0.0)[0] == -1.0


def test_newest_is_the_newest_common_time(tree):
    tree.moving('map', 'odom', (0.85, 100), (2.0, 100))
    assert tree.newest('laser', 0.9, target='map') == (
        frames.GAP, 'no transform from laser to map at its stamp: the transforms of odom around '
        'it are 1.15 s apart, more than 0.5 s', False)
    tree.moving('map', 'odom', (1.1, 100))
    assert tree.newest('laser', 0.9, target='map') == (101.25, nanoseconds(1.0))


@pytest.mark.parametrize('now, at', [(23, 12), (24, 20), (29, 20), (30, 30), (99, 30)])
def test_newest_is_not_in_the_future_if_an_older_one_was_received_last(now, at):
    frames = Frames(10 * SECOND)
    for parent, child, *stamps in (('odom', 'base', 24, 36, 12), ('odom', 'map', 20, 30, 10),
                                   ('earth', 'odom', 1, 2)):
        for stamp in stamps:
            frames.insert(parent, child, stamp, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    for target, source in (('map', 'base'), ('base', 'map')):
        assert frames.newest(target, source, now=now) == at


def test_newest_past_the_timeout(tree):
    assert tree.newest('laser', 1.0) == (1.25, nanoseconds(1.0))
    assert tree.newest('laser', 1.75) == (
        frames.OLD_LATEST, 'no transform from laser to odom: the newest is past the timeout by '
        '0.75 s', True)


def test_static_frames_have_no_age(tree):
    assert tree.newest('laser', 1e9, target='base') == (0.25, None)
    assert tree.newest('base', 1e9, target='laser') == (-0.25, None)
    assert tree.newest('base', 1e9, target='base') == (0.0, None)


@pytest.mark.parametrize('degrees, good', [(0, True), (4.9, True), (-4.9, True), (5.1, False),
                                           (90, False), (180, True), (176, True), (174, False)])
def test_tilted_frame_is_not_projected(degrees, good):
    tree = Tree()
    half = math.radians(degrees) / 2
    tree.static('odom', 'ramp', 1.0, (math.sin(half), 0.0, 0.0, math.cos(half)))
    found = tree.lookup_affine('ramp', 0)
    assert isinstance(found, Mapped) == good
    if good:
        assert found.affine == pytest.approx(
            (1, 0, 1, 0, math.cos(math.radians(degrees)), 0), abs=1e-15)
    else:
        tilted = min(abs(degrees), 180 - abs(degrees))
        assert found == (frames.TILTED,
                         f'ramp is tilted by {tilted:.1f} degrees in odom, more than 5', False)
        assert tree.lookup_affine('ramp', 1.0).reason == frames.TILTED


def test_affine_is_cached_until_a_transform_changes(tree):
    first = tree.lookup_affine('laser', 0.53)
    tree.moving('odom', 'base', (1.1, 1.1))
    # Robot descriptions repeat static ones.
    tree.static('base', 'laser', 0.25)
    assert tree.lookup_affine('laser', 0.53) is first
    changes = [lambda: tree.moving('odom', 'base', (0.52, 0)),
               lambda: tree.moving('odom', 'base', (0.52, 1)),
               lambda: tree.static('base', 'laser', 0.5),
               lambda: tree.static('odom', 'base', 0.5),
               lambda: tree.moving('odom', 'base', (0.53, 8)),
               lambda: tree.frames.configure(SECOND, -1.0),
               lambda: tree.frames.clear()]
    for change in changes:
        change()
        after = tree.lookup_affine('laser', 0.53)
        assert after != first
        first = after
    assert first.reason == frames.UNKNOWN_FRAME


def test_cache_distinguishes_frames_and_stamps(tree):
    tree.moving('map', 'odom', *((k / 10, 100) for k in range(11)))
    affines = {tree.lookup_affine(*asked).affine[2] for asked in
               [('laser', 0.5), ('laser', 0.6), ('base', 0.5), ('laser', 0.5, 'map')]}
    assert len(affines) == 4


def test_cache_is_bounded(tree):
    for k in range(2000):
        assert isinstance(tree.lookup_affine('laser', k / 2000), Mapped)
    assert len(tree.frames._maps) <= 256


def test_buffer_is_bounded():
    """Ten seconds are kept, also if the clock stands still."""
    buffer = Frames(10 * SECOND)
    for k in range(10_000):
        stamp = START + min(k, 5000) * SECOND // 100
        buffer.insert('odom', 'base', stamp, (float(k), 0.0, 0.0, *UPRIGHT))
    track = buffer._moving['base']
    assert 1000 <= len(track.stamps) == len(track.links) <= 1004


@pytest.mark.parametrize('step', (1, -1), ids=('newer', 'older'))
def test_flood_of_transforms_is_bounded(step):
    """A frame that is sent far too often keeps its newest transforms."""
    buffer = Frames(10 * SECOND)
    stamps = range(START, START + 50_000)[::step]
    buffer.insert('odom', 'base', START + 50_000, (0.0, 0.0, 0.0, *UPRIGHT))
    for k in stamps:
        buffer.insert('odom', 'base', k, (0.0, 0.0, 0.0, *UPRIGHT))
        assert len(buffer._moving['base'].stamps) <= 20_001
    assert buffer._moving['base'].stamps[-1] == START + 50_000


def test_late_transform_prunes_the_buffer():
    """As in tf2, whether the late one is accepted or not: 1 s is more than 10 s before 20 s."""
    for late in (19, 5):
        tree = Tree(max_gap=frames.NEVER)
        tree.moving('odom', 'base', *((time, time) for time in (1, 9, 11, 20)))
        assert tree.where('base', 9) == 9.0
        tree.frames.insert('odom', 'base', nanoseconds(late), (9.0, 0.0, 0.0, *UPRIGHT))
        assert tree.where('base', 11) == 11.0
        assert tree.where('base', 9).reason == frames.NO_TRANSFORM


def test_last_transform_of_a_stamp_replaces_earlier_ones():
    tree = Tree()
    tree.moving('odom', 'base', (0.0, 0), (0.2, 2), (0.4, 4), (0.2, 12), (0.2, 22), (0.2, 22))
    assert [tree.where('base', time) for time in (0.1, 0.2, 0.3)] == [1.0, 22.0, 13.0]
    tree.moving('odom', 'base', (0.2, 2))
    assert tree.where('base', 0.2) == 2.0, 'the first one again'


@pytest.mark.parametrize('parent, child, transform, wanted', [
    *((*names, (0, 0, 0, *UPRIGHT), BAD_NAMES) for names in (
        ('base', 'base'), ('', 'base'), ('odom', ''), ('odom', '/'), ('/base', 'base'))),
    ('odom', 'base', (math.nan, 0, 0, *UPRIGHT), BAD_TRANSFORM),
    ('odom', 'base', (0, 0, 0, 0, 0, 0, 0), BAD_TRANSFORM)])
@pytest.mark.parametrize('static', (False, True))
def test_refused_transform_changes_nothing(tree, parent, child, transform, wanted, static):
    before = tree.where('base', 1.0)
    assert tree.frames.insert(parent, child, nanoseconds(1), transform, static) == wanted
    assert tree.where('base', 1.0) == before


def test_transform_older_than_the_buffer_is_refused(tree):
    tree.moving('odom', 'base', (20, 20))
    assert tree.frames.insert('odom', 'base', nanoseconds(9), (0.0,) * 3 + UPRIGHT) == (
        OLD_TRANSFORM)
    assert tree.frames.insert('odom', 'base', nanoseconds(11), (7.0, 0.0, 0.0, *UPRIGHT)) is None
    assert tree.where('base', 11) == 7.0


def test_refused_transform_the_wrong_way_round_drops_nothing(tree):
    """It is older than the buffer of its own frame, and newer than the right one."""
    tree.moving('map', 'odom', (20, 0))
    tree.moving('odom', 'plan', (1, 3.0))
    assert tree.frames.insert('plan', 'odom', nanoseconds(2), (0.0,) * 3 + UPRIGHT) == (
        OLD_TRANSFORM)
    assert tree.where('plan', 1) == 3.0


def about(axis, angle):
    """Return the matrix that turns by an angle about an axis of unit length (Rodrigues)."""
    x, y, z = axis
    cross = np.array([(0, -z, y), (z, 0, -x), (-y, x, 0)])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def turned(axis, angle, translation=(0.0, 0.0, 0.0)):
    """Return a received transform, and the same as a 4 x 4 matrix."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    matrix = np.eye(4)
    matrix[:3, :3] = about(axis, angle)
    matrix[:3, 3] = translation
    transform = (*map(float, translation), *(math.sin(angle / 2) * axis).tolist(),
                 math.cos(angle / 2))
    return transform, matrix


def matrix_of(transform):
    """Return the 4 x 4 matrix of a transform, found by mapping the unit vectors."""
    def taken(*point):
        return rounded(composed(transform, fixed((*point, 0.0, 0.0, 0.0, 1.0))))[:3]

    origin = np.array(taken(0.0, 0.0, 0.0))
    matrix = np.eye(4)
    matrix[:3, 3] = origin
    for k in range(3):
        matrix[:3, k] = np.array(taken(*np.eye(3)[k].tolist())) - origin
    return matrix


@pytest.fixture
def random_turns():
    rng = np.random.default_rng(1)
    return [turned(rng.normal(size=3), rng.uniform(-np.pi, np.pi), rng.normal(size=3))
            for _ in range(50)]


def test_composition_is_the_matrix_product(random_turns):
    for (outer, a), (inner, b) in zip(random_turns, random_turns[1:]):
        outer, inner = fixed(outer), fixed(inner)
        np.testing.assert_allclose(matrix_of(outer), a, atol=1e-14)
        np.testing.assert_allclose(matrix_of(composed(outer, inner)), a @ b, atol=1e-14)


def test_relative_transform_is_inverse_times_matrix(random_turns):
    for (source, a), (target, b) in zip(random_turns, random_turns[1:]):
        found = relative(fixed(target), fixed(source))
        np.testing.assert_allclose(matrix_of(found), np.linalg.inv(b) @ a, atol=1e-14)


@pytest.mark.parametrize('sign', (1.0, -1.0))
@pytest.mark.parametrize('angle', (0.0, 1e-9, 0.3, 1.0, 3.0))
def test_interpolation_of_angle_and_distance(angle, sign):
    """Also if one end is given by the opposite quaternion, which is the same rotation."""
    axis = np.array([1.0, 2.0, 2.0]) / 3
    one, start = turned(axis, 0.4, (1, 2, 3))
    two, _ = turned(axis, 0.4 + angle, (3, 2, 7))
    for passed in (0, 1, 2, 4):
        share = passed / 4
        found = interpolated(one, (*two[:3], *(sign * part for part in two[3:])), passed, 4)
        _, wanted = turned(axis, 0.4 + share * angle, (1 + 2 * share, 2, 3 + 4 * share))
        np.testing.assert_allclose(matrix_of(found), wanted, atol=1e-12)


def test_affine_is_part_of_the_matrix(random_turns):
    for transform, matrix in random_turns:
        np.testing.assert_allclose(affine_of(fixed(transform)), matrix[:2, [0, 1, 3]].ravel(),
                                   atol=1e-14)


@pytest.mark.parametrize('axis, angle, wanted', [
    ((0, 0, 1), 1.0, 0.0), ((1, 0, 0), 0.1, 0.1), ((0, 1, 0), -0.1, 0.1), ((1, 1, 0), 2e-7, 2e-7),
    ((1, 0, 0), math.pi, 0.0), ((0, 1, 0), 3.0, math.pi - 3.0),
    ((1, 0, 0), math.pi / 2, math.pi / 2)])
def test_tilt_is_the_angle_between_z_axes(axis, angle, wanted):
    """A laser mounted upside down sees the same plane."""
    heading, _ = turned((0, 0, 1), 0.7)
    transform, matrix = turned(axis, angle)
    transform = fixed(transform)
    assert tilt(transform) == pytest.approx(wanted, abs=1e-15)
    assert tilt(composed(fixed(heading), transform)) == pytest.approx(wanted, abs=1e-15)
    assert math.cos(wanted) == pytest.approx(abs(matrix[2, 2]), abs=1e-15)


@pytest.mark.parametrize('place, value', [
    *((place, value) for place in range(7) for value in (math.nan, math.inf, -math.inf)),
    (6, 0.0), (0, 1e302)])
def test_no_finite_rotation_and_translation_is_refused(place, value):
    transform = list(rounded(IDENTITY))
    transform[place] = value
    assert accepted(tuple(transform)) is None


@pytest.mark.parametrize('x, w', [
    (0.1, 1.0), (-1e6, 1.0), (1e250, 1.0), (-1e300, 1.0), (1.0, 5e-324)])
def test_translation_is_not_rounded(x, w):
    assert rounded(fixed(accepted((x, 0.0, 0.0, 0.0, 0.0, 0.0, w))))[0] == x


CASES = load('tf2_lookups')
ERRORS = {
    'ExtrapolationException': {frames.NO_TRANSFORM},
    'LookupException': {frames.UNKNOWN_FRAME},
    'InvalidArgumentException': {frames.BAD_FRAME_ID},
    'ConnectivityException': {frames.NOT_CONNECTED},
}
# Infinitely far away: tf2 accepts it.
NOT_TAKEN = {('refused', 'i')}


def assert_same(found, translation, quaternion):
    """Compare with what tf2 found; a quaternion and its opposite are one rotation."""
    transform = rounded(found)
    rotation = np.array(transform[3:])
    rotation *= 1 if rotation @ quaternion > 0 else -1
    np.testing.assert_allclose((*transform[:3], *rotation), (*translation, *quaternion),
                               rtol=0, atol=1e-9)


@pytest.mark.parametrize('case', CASES, ids=lambda case: case['name'].replace(' ', '_'))
def test_answers_recorded_from_tf2(case):
    buffer = Frames(round(case['cache_time'] * 1e9))
    for event in case['events']:
        if event['do'] == 'set':
            buffer.insert(event['parent'], event['child'], event['stamp'],
                          tuple(map(float, (*event['xyz'], *event['quaternion']))),
                          event['static'])
            continue
        target, source, stamp = event['target'], event['source'], event['stamp']
        at, found = looked_up(buffer, target, source, stamp)
        if (case['name'], source) in NOT_TAKEN:
            assert found.reason == frames.UNKNOWN_FRAME
        elif 'error' in event:
            assert found.reason in ERRORS[event['error']], event
        else:
            assert not isinstance(found, NoTransform), found
            assert_same(found, event['xyz'], event['quaternion'])
            assert source == target or (at or 0) == event['at']

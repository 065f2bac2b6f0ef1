# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""One footprint: age, refusals, sources of its own, when it is clear, and its velocity."""

from dataclasses import replace
import math

from builders import SECOND
from monitors import (
    CART, clear_stage, known_stage, LIDAR, NOT_RECEIVED, ROBOT, SILENT, Stage, TOO_OLD,
    UNTIMED_LIDAR, UNTIMED_ROBOT, with_robot)
import numpy as np
import pytest
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.velocity import (
    fitted, FOOTPRINTS, MotionTracker, ODOMETRY, TRANSFORMS, translated, Velocity)


@pytest.mark.parametrize('stamp, end', [(-0.4, 0.6), (1.0, 1.0), ('none', 1.0)])
def test_footprint_goes_stale_by_its_stamp(stamp, end):
    """By its arrival if it was stamped ahead, or not at all."""
    stage = with_robot(UNTIMED_LIDAR, footprints=[ROBOT], stamp=stamp)
    stage.end()
    assert stage.state().age == pytest.approx(1.0 - end)
    assert stage.at(end).status() == 'clear'
    assert stage.at(end + 0.001).told == ('unknown', (TOO_OLD,))
    assert stage.state().age == pytest.approx(1.001)
    stage.robot()
    assert stage.status() == 'clear'


def test_stale_footprint_in_contact_is_unknown():
    """Its last polygon is still drawn."""
    stage = with_robot(UNTIMED_LIDAR, footprints=[ROBOT]).send_all(0.5)
    state = stage.at(1.001).state()
    assert (state.status.value, state.contacts, state.reasons) == ('unknown', (), (TOO_OLD,))
    assert [name for name, _ in stage.scene.footprints] == ['robot']


def test_footprint_that_arrives_stale_is_stale_at_once():
    stage = clear_stage(UNTIMED_LIDAR)
    stage.at(2.5).robot(stamp=1.499)
    assert stage.told == ('unknown', (TOO_OLD,))
    stage.robot(stamp=1.5)
    assert stage.status() == 'clear'


def test_older_footprint_after_a_newer_one_is_refused():
    """Two messages arrive in the wrong order."""
    stage = clear_stage(UNTIMED_LIDAR)
    stage.at(0.5).robot(10.5)
    assert stage.robot(20, stamp=0.499) == 'older than the last'
    assert stage.status() == 'collision'
    assert stage.robot(20, stamp=0.5) is None
    assert stage.status() == 'clear'


@pytest.mark.parametrize('footprint', [ROBOT, UNTIMED_ROBOT])
def test_older_footprint_is_accepted_when_the_last_one_no_longer_counts(footprint):
    """The publisher's clock is set back; the last footprint is stale, refused or untimed."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[footprint])
    if footprint is ROBOT:
        assert stage.robot(10.5, stamp=-0.1) == 'older than the last'
        stage.at(1.001)
    assert stage.robot(10.5, stamp=stage.time - 0.1) is None
    assert stage.status() == 'collision'
    stage.refuse(name='robot')
    assert stage.robot(20, stamp=stage.time - 0.2) is None
    assert stage.status() == 'clear'


def test_footprint_stamped_ahead_does_not_block_later_ones():
    """Its time is that of its arrival."""
    stage = clear_stage()
    assert stage.robot(stamp=0.9) is None
    assert stage.at(0.1).robot(10.5, stamp=0.05) is None
    assert stage.status() == 'collision'
    assert stage.robot(20, stamp=0.04) == 'older than the last'


def test_footprint_counts_though_the_clock_went_back_a_little():
    """The last one is not ahead of it then, and its age is 0."""
    stage = clear_stage(UNTIMED_LIDAR)
    stage.at(0.9).robot()
    assert stage.at(0.0).state().age == 0.0
    assert stage.robot(10.5) is None
    assert stage.status() == 'collision'


def test_footprint_further_ahead_than_the_tolerance_is_refused():
    stage = clear_stage(UNTIMED_LIDAR, future_tolerance=0.5)
    assert stage.robot(stamp=0.5) is None
    assert stage.robot(stamp=0.501) == 'from the future'
    assert stage.state().reasons == ('footprint robot on /footprint was refused: from the future',)
    assert stage.robot() is None
    assert stage.status() == 'clear'


def test_footprint_without_a_publisher_is_unknown_at_once():
    """However long its timeout is."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[UNTIMED_ROBOT])
    assert stage.publish_by('a', name='robot').status() == 'clear'
    assert stage.publish_by(name='robot').state().reasons == (
        'footprint robot on /footprint has no publisher',
        'footprint robot on /footprint has not been received since its publisher changed')
    assert stage.publish_by('b', name='robot').status() == 'unknown'
    stage.restart('robot')
    stage.robot()
    assert stage.status() == 'clear'


def test_footprint_with_two_publishers_is_unknown():
    """Both are in the graph, or the message numbers show a second one."""
    stage = clear_stage(UNTIMED_LIDAR).publish_by('a', 'b', name='robot')
    stage.robot()
    assert stage.state().reasons == (
        'footprint robot on /footprint has 2 publishers, /a and /b, which cannot be told apart: '
        'give each a topic and a name here of its own',)
    stage.publish_by('a', name='robot')
    stage.robot()
    assert stage.status() == 'clear'
    stage.numbers['robot'] -= 2
    stage.robot()
    assert 'whose numbers are those of two publishers' in stage.state().reasons[0]
    assert stage.status() == 'unknown'
    for time, status in ((1.0, 'unknown'), (1.001, 'clear')):
        stage.at(time).robot()
        assert stage.status() == status


def test_footprint_is_unknown_after_a_refused_message_until_the_next_good_one():
    stage = with_robot().send_all(0.5)
    stage.refuse('not finite', name='robot')
    state = stage.state()
    assert (state.status.value, state.contacts, state.age) == ('unknown', (), None)
    assert state.reasons == ('footprint robot on /footprint was refused: not finite',)
    assert stage.scene.footprints == []
    stage.robot()
    assert stage.status() == 'collision'


def test_disabled_footprint_is_unknown_and_ignored():
    stage = clear_stage().use('robot', enabled=False)
    assert stage.robot() is None
    stage.refuse(name='robot')
    assert stage.state().reasons == ('footprint robot is disabled',)
    assert stage.use('robot', enabled=True).state().reasons == (NOT_RECEIVED,)
    stage.robot()
    assert stage.status() == 'clear'


def test_footprints_that_came_while_disabled_were_not_lost():
    stage = known_stage(LIDAR)
    for enabled in (False, True):
        stage.use('robot', enabled=enabled)
        stage.robot()
        stage.robot()
    assert stage.scene.lost() == {}
    stage.lose(name='robot')
    stage.robot()
    assert stage.scene.lost() == {'robot': 1}


DELAYED = 'clear for less than release_delay, 0.5 s'


def test_release_delay_starts_again_with_each_contact():
    """The flag stays up while a contact flickers."""
    stage = clear_stage(UNTIMED_LIDAR, footprints=[UNTIMED_ROBOT], release_delay=0.0)
    stage.use(release_delay=0.5)
    stage.see(0.5)
    assert stage.status() == 'collision'
    for time, x in ((0.1, 5), (0.5, 0.5), (0.6, 5)):
        assert stage.at(time).send_all(x).status() == 'collision'
    assert stage.state().contacts == ()
    assert stage.state().reasons == (DELAYED,)
    stage.scene.take_changes()
    assert stage.at(1.099).status() == 'collision' and not stage.scene.take_changes().changed
    assert stage.at(1.1).told == ('clear', ())
    assert stage.scene.take_changes().changed == ['robot']


def test_brief_contact_restarts_the_release_delay():
    """Even if no state was read during the contact."""
    stage = with_robot(release_delay=0.5)
    for time, x in ((0.0, 5), (0.3, 0.5), (0.4, 6)):
        stage.at(time).send_all(x)
    assert [stage.at(time).status() for time in (0.8, 0.9)] == ['collision', 'clear']


def test_release_delay_applies_to_unknown():
    """The flag does not flicker when a sensor drops out again and again."""
    stage = with_robot(UNTIMED_LIDAR, release_delay=0.5)
    assert stage.send_all(5).told == ('unknown', (DELAYED,))
    assert stage.at(0.5).status() == 'clear'


def test_timeout_and_release_delay_can_be_changed_live():
    stage = clear_stage(UNTIMED_LIDAR)
    assert stage.at(1.5).status() == 'unknown'
    stage.use(release_delay=0.5)
    assert stage.use('robot', timeout=0.0).state().reasons == (DELAYED,)
    assert stage.use(release_delay=0.0).status() == 'clear'
    assert stage.use('robot', timeout=1.0).state().reasons == (TOO_OLD,)


def test_release_delay_does_not_delay_collision_or_unknown():
    stage = with_robot(release_delay=0.5).send_all(5)
    assert stage.at(1.0).status() == 'clear'
    stage.see(0.5)
    assert stage.status() == 'collision'
    stage.refuse(name='robot')
    assert stage.status() == 'unknown'


def test_stamps_of_another_clock_are_reported_as_such():
    """A recording of last year is played without use_sim_time; later, old is just old."""
    stage = clear_stage(replace(LIDAR, timeout=1e5), start=1e5)
    stage.at(2.0).robot(stamp=-4000.0)
    reason, = stage.state().reasons
    assert 'footprint robot on /footprint has stamps' in reason and 'use_sim_time: true' in reason
    stage.robot(stamp=4000.0)
    reason, = stage.state().reasons
    assert 'was refused: from the future, more than an hour' in reason
    stage.see(10, stamp=4000.0)
    assert 'more than an hour' in stage.state().reasons[1]
    stage.end()
    stage.send_all(10)
    stage.robot()
    assert stage.status() == 'clear'
    assert stage.at(9000.0).state().reasons == (TOO_OLD,)


DOCK = replace(LIDAR, name='dock', topic='/dock', timeout=100.0)
WALLS = replace(LIDAR, name='walls', topic='/walls', timeout=100.0)
BOTH = DOCK, WALLS


def stage_of(*own):
    """Return a stage where the robot touches the dock and is far from the walls."""
    stage = with_robot(*BOTH, footprints=[replace(UNTIMED_ROBOT, obstacles=own)])
    stage.send_all(0.5, name='dock')
    stage.send_all(7.0, name='walls')
    return stage


def test_footprint_ignores_sources_that_it_does_not_monitor():
    """The dock is left out while docking and counts again afterwards."""
    stage = stage_of()
    assert stage.status() == 'collision'
    assert stage.use('robot', obstacles=('walls',)).status() == 'clear'
    assert stage.scene.nearest('robot')[:2] == (ObstacleId('walls', 0), 6.0)
    stage.robot(0.1)
    stage.see(0.2, name='dock')
    assert stage.status() == 'clear'
    assert stage.use('robot', obstacles=()).state().contacts == (ObstacleId('dock', 0),)
    assert stage.scene.nearest('robot')[0] == ObstacleId('dock', 0)


def test_contacts_with_monitored_sources():
    """The obstacle moves to the robot, the robot to the obstacle, and the margin grows."""
    stage = stage_of('walls')
    for x, status in ((0.9, 'collision'), (7.0, 'clear')):
        assert stage.send_all(x, name='walls').status() == status
    for x, status in ((6.5, 'collision'), (5.8, 'clear')):
        stage.robot(x)
        assert stage.status() == status
    assert stage.use(margin=0.5).state().contacts == (ObstacleId('walls', 0),)


def test_contacts_told_are_those_of_now():
    stage = with_robot(LIDAR)
    for places, keys in (((0.5,), [0]), ((0.5, 0.6), [0, 1]), ((9, 0.6), [1]), ((0.6,), [0])):
        stage.send_all(*places)
        assert [one.key for one in stage.state().contacts] == keys


def test_faults_of_other_sources_are_ignored():
    robot = replace(UNTIMED_ROBOT, obstacles=('walls',))
    cart = replace(CART, timeout=0.0, obstacles=('lidar', 'walls'))
    all_seeing = replace(CART, name='all', timeout=0.0)
    stage = Stage(*BOTH, LIDAR, footprints=[robot, cart, all_seeing])
    for name in ('robot', 'cart', 'all'):
        stage.robot(name=name)
    for name in ('dock', 'walls', 'lidar'):
        stage.send_all(9, name=name)
    assert stage.status('all') == 'clear'
    stage.at(2.001).refuse(name='dock')
    refused = ('obstacle source dock on /dock has not sent a whole set since a message was '
               'refused: not finite')
    assert stage.told == ('clear', ())
    assert stage.state('cart').reasons == (SILENT,)
    assert stage.state('all').reasons == (refused, SILENT)


def test_unknown_if_all_monitored_sources_are_disabled():
    """Though another source is enabled and known."""
    stage = stage_of('walls').use('walls', enabled=False)
    assert stage.told == ('unknown', ('none of its obstacle sources is enabled',))


# --- its velocity


SHAPE = np.array([(-0.5, -0.3), (0.5, -0.3), (0.6, 0.0), (0.5, 0.3), (-0.5, 0.3)])


def steered(vertices, twist, pose, seconds, steps=4096):
    """Follow a twist by small steps of the midpoint rule, independently of the closed form."""
    vx, vy, omega = twist
    x, y, yaw = pose
    step = seconds / steps
    for k in range(steps):
        middle = yaw + (k + 0.5) * omega * step
        x += (vx * math.cos(middle) - vy * math.sin(middle)) * step
        y += (vx * math.sin(middle) + vy * math.cos(middle)) * step
    c, s = math.cos(omega * seconds), math.sin(omega * seconds)
    return (vertices - pose[:2]) @ np.array([(c, s), (-s, c)]) + (x, y)


@pytest.mark.parametrize('seed', range(20))
def test_velocity_is_fitted_to_two_places_on_an_arc(seed):
    """Places 0.1 s apart determine the twist; it predicts the place a second later."""
    rng = np.random.default_rng(seed)
    twist, pose = rng.uniform(-2, 2, 3), rng.uniform(-50, 50, 3)
    places = [steered(SHAPE, twist, pose, seconds) for seconds in (0.0, 0.1, 1.1)]
    velocity = fitted(places[0], places[1], 0.1, FOOTPRINTS)
    assert velocity.twist[2] == pytest.approx(twist[2], abs=1e-9)
    assert velocity.carry(places[1], 1.0) == pytest.approx(places[2], abs=1e-5)
    given = Velocity(tuple(twist), tuple(pose), ODOMETRY)
    assert given.carry(places[0], 1.1) == pytest.approx(places[2], abs=1e-5)


def test_noise_of_a_centimetre_at_10_hz():
    """Common noise of all vertices gives 0.14 m/s; independent noise is averaged over them."""
    rng = np.random.default_rng(1)

    def spread(shape):
        errors = [fitted(SHAPE + rng.normal(0, 0.01, shape), SHAPE + rng.normal(0, 0.01, shape),
                         0.1, FOOTPRINTS).twist for _ in range(2000)]
        return np.std(errors, axis=0)
    common, independent = spread(2), spread(SHAPE.shape)
    assert common[:2] == pytest.approx(0.141, rel=0.1) and common[2] < 1e-9
    assert independent[:2] == pytest.approx(0.141 / math.sqrt(5), rel=0.1)
    assert independent[2] == pytest.approx(0.141 / np.linalg.norm(SHAPE - SHAPE.mean(0)), rel=0.1)


def test_no_velocity_if_the_shape_changes():
    """Another number of vertices, one vertex that moved alone, or an impossible speed."""
    tracker = MotionTracker()
    for stamp, place in ((0, SHAPE), (10**8, SHAPE[:-1])):
        tracker.place(stamp, place)
    assert tracker.velocity(10**8, FOOTPRINTS) is None and tracker.translation(10**8) is None
    assert fitted(SHAPE, SHAPE + [(0, 0), (0, 0), (0.5, 0), (0, 0), (0, 0)], 0.1, '') is None
    assert fitted(SHAPE, SHAPE + 1000, 0.1, FOOTPRINTS) is None
    assert fitted(SHAPE[:1], SHAPE[:1] + (0.1, 0), 0.1, FOOTPRINTS).twist == (
        pytest.approx((1, 0, 0)))


def tracked(*places):
    tracker = MotionTracker()
    for time, x in places:
        tracker.place(round(time * SECOND), SHAPE + (x, 0))
    return tracker.velocity(round(places[-1][0] * SECOND), TRANSFORMS)


def test_velocity_needs_two_places_at_different_times():
    """Not one place, two with one stamp, or two too far apart; a step back resets it."""
    for places in ([(1.0, 0)], [(1.0, 0), (1.0, 1)], [(1.0, 0), (3.1, 1)],
                   [(1.0, 0), (1.1, 1), (0.5, 2)]):
        assert tracked(*places) is None
    assert tracked((1.0, 0), (0.5, 2), (0.6, 2.1)).twist == pytest.approx((1, 0, 0))
    assert tracked((1.0, 0), (1.1, 0.1)) == (
        pytest.approx((1, 0, 0)), pytest.approx((*(SHAPE.mean(0) + (0.1, 0)), 0)), TRANSFORMS,
        False)


def test_places_within_a_millisecond_are_compared_with_an_earlier_one():
    assert tracked((1.0, 0), (1.1, 0.1), (1.1005, 0.2), (1.101, 0.3)).twist[0] == (
        pytest.approx(0.3 / 0.101))


def test_given_velocity_is_used_if_it_is_valid():
    """Only for the place that it came with."""
    tracker, given = MotionTracker(), Velocity((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), ODOMETRY)
    tracker.place(SECOND, SHAPE, given)
    assert tracker.velocity(SECOND, TRANSFORMS) is given
    assert tracker.velocity(SECOND + 1, TRANSFORMS) is None
    for nonsense in (math.nan, math.inf, -1e300):
        tracker.place(SECOND, SHAPE, given._replace(twist=(0.0, nonsense, 0.0)))
        assert tracker.velocity(SECOND, TRANSFORMS) is None
    tracker.place(2 * SECOND, SHAPE)
    assert tracker.velocity(2 * SECOND, TRANSFORMS).twist == (0, 0, 0)


def test_translation_that_overflows_is_unknown():
    """Two vertices change places across the whole range of float64."""
    before = np.array([(-1e308, 0.0), (1e308, 0.0), (0.0, 1.0)])
    after = np.array([(1e308, 0.0), (-1e308, 0.0), (0.0, 1.0)])
    with np.errstate(all='ignore'):
        assert translated(before, after, 1.0) is None

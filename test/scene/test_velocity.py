# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The velocity of a footprint: fitted to its last two places, or given with them."""

import math

import numpy as np
import pytest
from sat_collision.scene.velocity import (
    fitted, FOOTPRINTS, MotionTracker, ODOMETRY, TRANSFORMS, translated, Velocity)

SECOND = 10**9
ROBOT = np.array([(-0.5, -0.3), (0.5, -0.3), (0.6, 0.0), (0.5, 0.3), (-0.5, 0.3)])


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
    places = [steered(ROBOT, twist, pose, seconds) for seconds in (0.0, 0.1, 1.1)]
    velocity = fitted(places[0], places[1], 0.1, FOOTPRINTS)
    assert velocity.twist[2] == pytest.approx(twist[2], abs=1e-9)
    assert velocity.carry(places[1], 1.0) == pytest.approx(places[2], abs=1e-5)
    given = Velocity(tuple(twist), tuple(pose), ODOMETRY)
    assert given.carry(places[0], 1.1) == pytest.approx(places[2], abs=1e-5)


def test_noise_of_a_centimetre_at_10_hz():
    """Common noise of all vertices gives 0.14 m/s; independent noise is averaged over them."""
    rng = np.random.default_rng(1)

    def spread(shape):
        errors = [fitted(ROBOT + rng.normal(0, 0.01, shape), ROBOT + rng.normal(0, 0.01, shape),
                         0.1, FOOTPRINTS).twist for _ in range(2000)]
        return np.std(errors, axis=0)
    common, independent = spread(2), spread(ROBOT.shape)
    assert common[:2] == pytest.approx(0.141, rel=0.1) and common[2] < 1e-9
    assert independent[:2] == pytest.approx(0.141 / math.sqrt(5), rel=0.1)
    assert independent[2] == pytest.approx(0.141 / np.linalg.norm(ROBOT - ROBOT.mean(0)), rel=0.1)


def test_no_velocity_if_the_shape_changes():
    """Another number of vertices, one vertex that moved alone, or an impossible speed."""
    tracker = MotionTracker()
    for stamp, place in ((0, ROBOT), (10**8, ROBOT[:-1])):
        tracker.place(stamp, place)
    assert tracker.velocity(10**8, FOOTPRINTS) is None and tracker.translation(10**8) is None
    assert fitted(ROBOT, ROBOT + [(0, 0), (0, 0), (0.5, 0), (0, 0), (0, 0)], 0.1, '') is None
    assert fitted(ROBOT, ROBOT + 1000, 0.1, FOOTPRINTS) is None
    assert fitted(ROBOT[:1], ROBOT[:1] + (0.1, 0), 0.1, FOOTPRINTS).twist == (
        pytest.approx((1, 0, 0)))


def tracked(*places):
    tracker = MotionTracker()
    for time, x in places:
        tracker.place(round(time * SECOND), ROBOT + (x, 0))
    return tracker.velocity(round(places[-1][0] * SECOND), TRANSFORMS)


def test_velocity_needs_two_places_at_different_times():
    """Not one place, two with one stamp, or two too far apart; a step back resets it."""
    for places in ([(1.0, 0)], [(1.0, 0), (1.0, 1)], [(1.0, 0), (3.1, 1)],
                   [(1.0, 0), (1.1, 1), (0.5, 2)]):
        assert tracked(*places) is None
    assert tracked((1.0, 0), (0.5, 2), (0.6, 2.1)).twist == pytest.approx((1, 0, 0))
    assert tracked((1.0, 0), (1.1, 0.1)) == (
        pytest.approx((1, 0, 0)), pytest.approx((*(ROBOT.mean(0) + (0.1, 0)), 0)), TRANSFORMS,
        False)


def test_places_within_a_millisecond_are_compared_with_an_earlier_one():
    assert tracked((1.0, 0), (1.1, 0.1), (1.1005, 0.2), (1.101, 0.3)).twist[0] == (
        pytest.approx(0.3 / 0.101))


def test_given_velocity_is_used_if_it_is_valid():
    """Only for the place that it came with."""
    tracker, given = MotionTracker(), Velocity((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), ODOMETRY)
    tracker.place(SECOND, ROBOT, given)
    assert tracker.velocity(SECOND, TRANSFORMS) is given
    assert tracker.velocity(SECOND + 1, TRANSFORMS) is None
    for nonsense in (math.nan, math.inf, -1e300):
        tracker.place(SECOND, ROBOT, given._replace(twist=(0.0, nonsense, 0.0)))
        assert tracker.velocity(SECOND, TRANSFORMS) is None
    tracker.place(2 * SECOND, ROBOT)
    assert tracker.velocity(2 * SECOND, TRANSFORMS).twist == (0, 0, 0)


def test_translation_that_overflows_is_unknown():
    """Two vertices change places across the whole range of float64."""
    before = np.array([(-1e308, 0.0), (1e308, 0.0), (0.0, 1.0)])
    after = np.array([(1e308, 0.0), (-1e308, 0.0), (0.0, 1.0)])
    with np.errstate(all='ignore'):
        assert translated(before, after, 1.0) is None

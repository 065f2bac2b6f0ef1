# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Points moved through chains of frames, compared with exact integers."""

from fractions import Fraction

import frame_chains
import numpy as np
import pytest
from rationals import rounded
from sat_collision.scene.rotations import accepted, affine_of, composed, fixed

EVALUATIONS = 2000


@pytest.mark.parametrize('name', frame_chains.CHAINS)
def test_error_is_within_lemma_22(name):
    """A short search; `make adversary` runs a long one."""
    assert 0.3 < frame_chains.largest(name, EVALUATIONS) <= 1.0


@pytest.mark.parametrize('name', frame_chains.CHAINS)
def test_search_would_find_half_the_bound_wrong(name):
    assert frame_chains.largest(name, EVALUATIONS, seed=2) > 0.5


def test_robot_and_fixed_frame_in_utm():
    """Both are 5,000 km from the origin and a few metres apart."""
    robot = (448265.62, 5411930.91, 117.0, 0.0, 0.0, 0.6, 0.8)
    fixed_frame = (448262.37, 5411932.68, 117.2, 0.0, 0.0, 0.28, 0.96)
    ratio = frame_chains.evaluate('both under UTM',
                                  np.array([*robot, *fixed_frame, 1.5, -0.25]))
    (x, y, _), _, w = frame_chains.moved([robot], [fixed_frame], (1.5, -0.25))
    assert 3.0 < abs(x / w) + abs(y / w) < 6.0 and ratio <= 1.0


def test_oracle_of_rotations():
    """A quarter turn to the left by a quaternion of length 2, then 10 m along x."""
    (x, y, _), origin, w = frame_chains.moved(
        [(10.0, 0.0, 0.0, 0.0, 0.0, 2.0, 2.0)], [(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0)],
        (3.0, 4.0))
    assert (Fraction(x, w), Fraction(y, w)) == (-6, -2)
    assert (Fraction(origin[0], w), Fraction(origin[1], w)) == (-10, 1)


@pytest.mark.parametrize('length', (1e-300, 1e-9, 0.3, 0.99, 1.0, 1.5, 7.0, 1e200))
def test_quaternions_are_normalised(length):
    """As in tf2; `static_transform_publisher --qz 0.7 --qw 0.7` sends such ones."""
    found = accepted((1.0, 2.0, 3.0, 0.0, 0.0, 0.7 * length, 0.7 * length))
    quarter = 0.0, -1.0, 1.0, 1.0, 0.0, 2.0
    assert affine_of(fixed(found)) == pytest.approx(quarter, abs=2.0 ** -60)
    assert rounded(fixed(found))[5:] == pytest.approx((0.5 ** 0.5, 0.5 ** 0.5))


@pytest.mark.parametrize('length', (1 + 4e-10, 1.3, 0.8))
def test_ten_thousand_frames_in_a_chain_do_not_scale(length):
    """With quaternions of length 1, nearly 1, or other lengths."""
    pose = step = fixed(accepted((0.0, 0.0, 0.0, 0.0, 0.0, 0.6 * length, 0.8 * length)))
    for _ in range(9_999):
        pose = composed(step, pose)
    a, b, _, d, e, _ = affine_of(pose)
    assert a * a + b * b == pytest.approx(1.0, abs=1e-15) and (a, b) == (e, -d)
    assert max(part.bit_length() for part in pose) <= 130

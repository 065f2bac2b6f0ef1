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

"""Transforms against matrices, which know nothing of quaternions."""

import math

import numpy as np
import pytest
from sat_collision.scene.rotations import (
    accepted, composed, fixed, IDENTITY, interpolated, plane_map, relative, rounded, tilt)


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
    """Return the 4 x 4 matrix of a transform, column by column: where it takes the unit points."""
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


def test_one_after_the_other_is_the_product(random_turns):
    for (outer, a), (inner, b) in zip(random_turns, random_turns[1:]):
        outer, inner = fixed(outer), fixed(inner)
        np.testing.assert_allclose(matrix_of(outer), a, atol=1e-14)
        np.testing.assert_allclose(matrix_of(composed(outer, inner)), a @ b, atol=1e-14)


def test_from_one_frame_to_another_is_the_way_back_after_the_way_there(random_turns):
    for (source, a), (target, b) in zip(random_turns, random_turns[1:]):
        found = relative(fixed(target), fixed(source))
        np.testing.assert_allclose(matrix_of(found), np.linalg.inv(b) @ a, atol=1e-14)


@pytest.mark.parametrize('sign', (1.0, -1.0))
@pytest.mark.parametrize('angle', (0.0, 1e-9, 0.3, 1.0, 3.0))
def test_half_way_is_half_the_angle_and_half_the_distance(angle, sign):
    """Also where one is told by the opposite quaternion, which means the same rotation."""
    axis = np.array([1.0, 2.0, 2.0]) / 3
    one, start = turned(axis, 0.4, (1, 2, 3))
    two, _ = turned(axis, 0.4 + angle, (3, 2, 7))
    for passed in (0, 1, 2, 4):
        share = passed / 4
        found = interpolated(one, (*two[:3], *(sign * part for part in two[3:])), passed, 4)
        _, wanted = turned(axis, 0.4 + share * angle, (1 + 2 * share, 2, 3 + 4 * share))
        np.testing.assert_allclose(matrix_of(found), wanted, atol=1e-12)


def test_the_plane_is_mapped_by_the_matrix(random_turns):
    for transform, matrix in random_turns:
        np.testing.assert_allclose(plane_map(fixed(transform)), matrix[:2, [0, 1, 3]].ravel(),
                                   atol=1e-14)


@pytest.mark.parametrize('axis, angle, wanted', [
    ((0, 0, 1), 1.0, 0.0), ((1, 0, 0), 0.1, 0.1), ((0, 1, 0), -0.1, 0.1), ((1, 1, 0), 2e-7, 2e-7),
    ((1, 0, 0), math.pi, 0.0), ((0, 1, 0), 3.0, math.pi - 3.0),
    ((1, 0, 0), math.pi / 2, math.pi / 2)])
def test_tilt_is_the_angle_of_the_z_axes_as_lines(axis, angle, wanted):
    """A laser that hangs upside down sees the same plane."""
    heading, _ = turned((0, 0, 1), 0.7)
    transform, matrix = turned(axis, angle)
    transform = fixed(transform)
    assert tilt(transform) == pytest.approx(wanted, abs=1e-15)
    assert tilt(composed(fixed(heading), transform)) == pytest.approx(wanted, abs=1e-15)
    assert math.cos(wanted) == pytest.approx(abs(matrix[2, 2]), abs=1e-15)


@pytest.mark.parametrize('place', range(7))
@pytest.mark.parametrize('value', (math.nan, math.inf, -math.inf))
def test_what_is_not_finite_is_no_transform(place, value):
    transform = list(rounded(IDENTITY))
    transform[place] = value
    assert accepted(tuple(transform)) is None


def test_all_zero_is_no_rotation():
    assert accepted((1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0)) is None
    assert accepted((1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 5e-324)) is not None


def test_a_translation_of_any_size_is_kept_as_a_double():
    for x in (0.1, -1e6, 1e250, -1e300):
        assert rounded(fixed(accepted((x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))))[0] == x
    assert accepted((1e302, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)) is None

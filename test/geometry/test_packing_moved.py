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

"""Polygons of messages in another frame: which doubles their vertices become."""

from fractions import Fraction

import families
import numpy as np
import oracle
import pytest
from sat_collision import intersects, Polygon
from sat_collision.geometry.jit import indexable
from sat_collision.geometry.layout import packed_size
from sat_collision.geometry.packing import moved_points, pack_convex, pack_convex_moved

# But for coordinates that no message can carry.
ALL = {name: family for name, family in {**families.CONVEX, **families.SIMPLE}.items()
       if name != 'extreme_scales'}
UNMOVED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
U = Fraction(1, 2**53)


def random_plane(rng, reach=1e3):
    """Return a map of the plane: a turn, at times mirrored or tilted, and a translation."""
    angle = rng.uniform(-np.pi, np.pi)
    cosine, sine = np.cos(angle), np.sin(angle)
    squeezed = rng.choice([1.0, -1.0, 0.997])
    x, y = rng.uniform(-reach, reach, 2)
    return tuple(map(float, (cosine, -sine * squeezed, x, sine, cosine * squeezed, y)))


def message(ring):
    """Return points as they come: bytes, where they start and how many."""
    points = np.column_stack([ring, np.full(len(ring), 7.0)]).astype(np.float32)
    return b'head' + points.tobytes(), 4, len(points)


def received(ring):
    return np.asarray(ring).astype(np.float32).astype(float).tolist()


def rounded(value):
    """Return the double nearest to a rational, as a rational: what one operation gives."""
    return Fraction(float(value))


def moved_by_rationals(ring, plane):
    """Return the doubles that four roundings give, and the largest error in parts of its bound."""
    a, b, c, d, e, f = map(Fraction, plane)
    points = []
    worst = Fraction(0)
    for x, y in received(ring):
        x, y = Fraction(x), Fraction(y)
        point = []
        for p, q, r in ((a, b, c), (d, e, f)):
            found = rounded(rounded(rounded(p * x) + rounded(q * y)) + r)
            bound = U * abs(found) + (2 * U + U * U) * (abs(p * x) + abs(q * y))
            bound += Fraction(1, 2**1073)
            worst = max(worst, abs(found - (p * x + q * y + r)) / bound)
            point.append(float(found))
        points.append(point)
    return points, worst


@pytest.mark.parametrize('name', ALL)
def test_each_coordinate_is_rounded_four_times(name):
    """No more, no less, in this order; and the true one is as near as the lemma says."""
    rng = np.random.default_rng(11)
    largest = 0
    for ring, _ in ALL[name](rng, 40, 9):
        plane = random_plane(rng)
        wanted, error = moved_by_rationals(ring, plane)
        found = np.asarray(moved_points(*message(ring), plane)).reshape(-1, 2)
        assert found.tolist() == wanted
        largest = max(largest, error)
    assert 0.2 < largest <= 1


@pytest.mark.parametrize('name', ALL)
def test_the_answer_is_exact_for_the_moved_doubles(name):
    """Of convex bodies and of others, by integers of any length."""
    rng = np.random.default_rng(12)
    plane = random_plane(rng, 10.0)
    answers = set()
    for first, second in ALL[name](rng, 40, 7):
        moved = [moved_by_rationals(ring, plane)[0] for ring in (first, second)]
        bodies = []
        for ring, points in zip((first, second), moved):
            try:
                bodies.append(Polygon(points))
            except ValueError as error:
                with pytest.raises(ValueError, match=str(error)[:12]):
                    Polygon.from_float32(*message(ring), plane=plane)
                continue
            found = Polygon.from_float32(*message(ring), plane=plane)
            assert found.vertices.tolist() == bodies[-1].vertices.tolist()
        if len(bodies) == 2:
            answer = intersects(*bodies)
            assert answer == oracle.intersects(*(body.vertices for body in bodies))
            answers.add(answer)
    assert answers


@pytest.mark.parametrize('plane', [UNMOVED, random_plane(np.random.default_rng(13))])
def test_convex_bodies_of_messages_pack_as_polygons_do(plane):
    """What is not convex or refused has no vertices here; unmoved all is as without a map."""
    rng = np.random.default_rng(14)
    kinds = set()
    for _ in range(300):
        ring = rng.integers(-9, 9, (rng.integers(1, 6), 2))
        array = np.empty(packed_size(len(ring)))
        count = pack_convex_moved(*message(ring), indexable(array), 1000, plane)
        try:
            polygon = Polygon.from_float32(*message(ring), plane=plane)
        except ValueError:
            assert count == 0
            kinds.add('refused')
            continue
        assert count == (polygon.packed[1] if polygon.is_convex else 0)
        kinds.add(polygon.is_convex)
        if count:
            assert array[:packed_size(count)].tolist() == list(polygon.packed[0])
        if plane == UNMOVED:
            unmoved = np.empty(packed_size(len(ring)))
            assert count == pack_convex(*message(ring), indexable(unmoved), 1000)
            assert (array[:packed_size(count)] == unmoved[:packed_size(count)])[:count].all()
            assert polygon.vertices.tolist() == (
                Polygon.from_float32(*message(ring)).vertices.tolist())
    assert kinds == {True, False, 'refused'}


def test_a_mirrored_body_is_one_too():
    """A laser that hangs upside down sends them clockwise."""
    polygon = Polygon.from_float32(*message([(0, 0), (2, 0), (2, 1)]),
                                   plane=(1.0, 0.0, 5.0, 0.0, -1.0, 0.0))
    assert polygon.vertices.tolist() == [[5, 0], [7, -1], [7, 0]]


@pytest.mark.parametrize('coordinate', (np.nan, np.inf, -np.inf))
def test_coordinates_that_are_not_finite_stay_so(coordinate):
    rng = np.random.default_rng(15)
    for plane in (UNMOVED, random_plane(rng)):
        data = message([(0, 0), (1, coordinate), (1, 1)])
        assert pack_convex_moved(*data, indexable(np.empty(50)), 10, plane) == 0
        with pytest.raises(ValueError, match='not finite'):
            Polygon.from_float32(*data, plane=plane)


def test_a_map_that_leads_beyond_all_doubles_is_refused():
    with pytest.raises(ValueError, match='vertex 1 is not finite'):
        Polygon.from_float32(*message([(0, 0), (3e38, 0), (0, 1)]),
                             plane=(1e300, 0.0, 0.0, 0.0, 1.0, 0.0))

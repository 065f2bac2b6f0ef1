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

"""Every case of test/data, taken from the suites of JTS, GEOS, CGAL and others."""

import oracle
from published import load
import pytest

from sat_collision import intersects, intersects_pairs, Polygon, PolygonError, PolygonSet, Reason
from sat_collision.geometry.predicates import orientation

DEGENERATE = {'fewer-than-3-points', 'fewer-than-3-distinct', 'all-collinear',
              'duplicate-consecutive-point'}
SELF_INTERSECTING = {'self-intersection', 'self-touch', 'spike-or-foldback'}


@pytest.mark.parametrize('name', ['convex', 'nonconvex', 'near_touch'])
def test_pairs(name):
    cases = load('pairs')[name]
    expected = [case['intersects'] for case in cases]
    assert [intersects(case['a'], case['b']) for case in cases] == expected
    assert [intersects(case['b'], case['a']) for case in cases] == expected
    sets = [PolygonSet(Polygon(case[k]) for case in cases) for k in 'ab']
    assert intersects_pairs(*sets).tolist() == expected
    assert [oracle.intersects(case['a'], case['b']) for case in cases] == expected


def test_orientations_that_defeat_the_plain_determinant():
    for case in load('orientations'):
        assert orientation(case['a'], case['b'], case['c']) == case['sign_ccw']


def test_invalid_rings_are_refused_and_degenerate_ones_are_bodies():
    """Points and segments are legal, in whatever ring they come; the rest names its reason."""
    for case in load('outlines')['invalid']:
        reasons = set(case['reasons'])
        if reasons <= DEGENERATE:
            assert len(Polygon(case['polygon']).vertices) >= 1
            continue
        with pytest.raises(PolygonError) as caught:
            Polygon(case['polygon'])
        if reasons & SELF_INTERSECTING:
            assert caught.value.reason is Reason.SELF_INTERSECTING
        else:
            assert reasons == {'non-finite'}
            assert caught.value.reason is Reason.NOT_FINITE

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

"""Outlines as parameters: what is taken, and one line for each that makes no sense."""

import pytest
from sat_collision.scene.outlines import outline_of
from sat_collision.scene.parameters import declare_parameters, ParameterError, read_settings

SQUARE = ((0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25))
FLAT = [coordinate for point in SQUARE for coordinate in point]


def settings_of(**given):
    """Return the settings of a monitor whose footprint is given these parameters."""
    given = {'frame_id': 'odom', **{
        f'footprint.{name}' if name != 'fixed' else 'frame_id': value
        for name, value in {'frame_id': 'base_link', **given}.items()}}
    values = {}

    def declare(name, default, spec):
        values[name] = given.get(name, default)
        return values[name]
    return read_settings(*declare_parameters(declare), values.__getitem__, '/ns/{}'.format)


def outline(**given):
    settings = settings_of(**given)
    return outline_of(settings.footprints[0], settings.max_vertices)


@pytest.mark.parametrize('points', [
    FLAT, tuple(FLAT), '[[0.5, 0.25], [-0.5, 0.25], [-0.5, -0.25], [0.5, -0.25]]',
    ' [ [.5,25e-2],[-0.5,0.25],[-.5,-0.25], [0.5 , -0.25] ] '])
def test_points_are_numbers_or_what_nav2_has(points):
    assert outline(points=points) == SQUARE


def test_whole_numbers_are_numbers():
    """A parameter file has integers where nobody wrote a point."""
    assert outline(points=[1, 0, 0, 1, -1, 0]) == ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))


def test_a_footprint_may_be_a_point_or_a_segment():
    assert outline(points=[1.0, 0.0]) == ((1.0, 0.0),)
    assert outline(points='[[1, 0], [2, 0]]') == ((1.0, 0.0), (2.0, 0.0))


def test_its_topic_is_where_its_frame_is_told():
    assert settings_of(points=FLAT).footprints[0].topic == '/ns//tf'
    assert settings_of(points=FLAT, odometry='odom').footprints[0].topic == '/ns/odom'
    assert settings_of(frame_id='').footprints[0].topic == '/ns/footprint'


@pytest.mark.parametrize('given, words', [
    ({'points': '[[0, 0], [1, 1], [1, 0], [0, 1]]'},
     '^footprint.points are not a simple polygon: '),
    ({'points': [0.0, 0.0, float('nan'), 1.0, 1.0, 0.0]},
     '^footprint.points are not a simple polygon: '),
    ({'points': [0.0, 0.0, 1e300, 1.0, 1.0, 0.0]}, '^footprint.points are not a simple polygon: '),
    ({'points': [0.0, 1.0, 2.0]}, '^footprint.points has 3 numbers, but each point has two$'),
    ({'points': 'base'}, r"^footprint.points: a string must have the form '\[\[x1, y1\], "),
    ({'points': '[[0, 0], [1, 2, 3]]'}, '^footprint.points: a string must have the form'),
    ({'points': '[0, 0, 1, 2]'}, '^footprint.points: a string must have the form'),
    ({'points': '(' * 5000}, '^footprint.points: a string must have the form'),
    ({'points': 3}, "^parameter 'footprint.points' is 3, but must be a string or an array of"),
    ({'points': ['a']}, r"^parameter 'footprint.points' is \['a'\], but must be"),
    ({'points': FLAT, 'radius': 1.0},
     '^footprint.points and footprint.radius are both given: choose one$'),
    ({'points': FLAT, 'frame_id': ''}, '^footprint.frame_id: an outline needs the frame'),
    ({'points': FLAT, 'frame_id': '/base_link'}, 'without a slash before it$'),
    ({'radius': 1.0, 'fixed': ''},
     '^frame_id: the outline of footprint needs the fixed frame that it moves in, such as odom$'),
    ({}, '^footprint.frame_id is for an outline: give footprint.points or footprint.radius, too'),
    ({'frame_id': '', 'odometry': 'odom'}, '^footprint.odometry is for an outline: ')])
def test_what_makes_no_sense_is_told_in_one_line(given, words):
    with pytest.raises(ParameterError, match=words) as error:
        settings_of(**given)
    assert '\n' not in str(error.value)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Settings and the parameters that make them: meanings, defaults, names, outlines."""

from dataclasses import FrozenInstanceError, MISSING

from monitors import LIDAR, ROBOT
import pytest
from sat_collision.scene.parameters import (
    declare_parameters, outline_of, ParameterError, read_settings)
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, specs

KINDS = (Settings, FootprintSettings, ObstacleSettings)
TWO = {'obstacles': ['walls', 'dock'], 'footprints': ['a', 'b']}
EVERY_SETTING = [(kind, name) for kind in KINDS for name in specs(kind)]


@pytest.mark.parametrize('kind, name', EVERY_SETTING)
def test_default_is_valid(kind, name):
    """Numbers have limits and lie within them; a setting with choices has one of them."""
    default, spec = specs(kind)[name]
    assert spec.description
    assert (type(default) in (int, float)) == (spec.limits is not None)
    if spec.limits:
        least, greatest = spec.limits
        assert least <= default <= greatest
    if spec.choices:
        assert default in spec.choices


def test_only_names_and_topics_have_no_default():
    needed = {kind: [name for name, (default, _) in specs(kind).items() if default is MISSING]
              for kind in KINDS}
    assert needed == {Settings: ['footprints', 'obstacles'], FootprintSettings: ['topic'],
                      ObstacleSettings: ['topic']}


def test_settings_that_cannot_be_changed_live():
    fixed = {name for kind, name in EVERY_SETTING if not specs(kind)[name][1].live}
    assert fixed == {'assume_no_loss', 'cmd_vel', 'footprints', 'frame_id', 'lock_parameters',
                     'max_vertices', 'obstacles', 'odometry', 'path', 'radius_vertices',
                     'rate', 'set_end', 'tf_cache_time', 'topic', 'type'}


def test_settings_are_immutable():
    for settings in (ROBOT, LIDAR, Settings((ROBOT,), (LIDAR,))):
        with pytest.raises(FrozenInstanceError):
            settings.enabled = False


def declared(**given):
    """Return all values by name, the names of the footprints and those of the sources."""
    values = {}

    def declare(name, default, spec):
        values[name] = given.get(name.replace('.', '__'), default)
        return values[name]
    return values, *declare_parameters(declare)


def settings_of(resolve='/ns/{}'.format, **given):
    """Return the Settings for parameters; two underscores stand for the dot."""
    values, footprints, obstacles = declared(**given)
    return read_settings(footprints, obstacles, values.__getitem__, resolve)


def outlined(**given):
    """Return the Settings of a monitor whose footprint has an outline, as these parameters say."""
    return settings_of(**{'frame_id': 'odom', 'footprint__frame_id': 'base_link', **given})


def test_defaults():
    """One footprint and one source of obstacles."""
    assert settings_of(str) == Settings((FootprintSettings('footprint', 'footprint'),),
                                        (ObstacleSettings('obstacle', 'obstacles'),))


def test_every_footprint_and_source_has_its_own_parameters():
    values, footprints, obstacles = declared(footprints=['a', 'b'], obstacles=['c'])
    assert (footprints, obstacles) == (['a', 'b'], ['c'])
    assert set(values) == {*specs(Settings),
                           *(f'{name}.{field}' for name in 'ab'
                             for field in specs(FootprintSettings)),
                           *(f'c.{field}' for field in specs(ObstacleSettings))}


def test_given_parameters_are_set():
    settings = settings_of(str, obstacles=['map', 'people'], people__max_count=7, margin=0.5)
    assert settings.obstacles == (ObstacleSettings('map', 'map'),
                                  ObstacleSettings('people', 'people', max_count=7))
    assert settings.margin == 0.5
    assert settings_of(obstacle__moving=True,
                       obstacle__type='polygon_instance').obstacles[0].moving


def test_monitored_sources_are_given_by_name():
    """Empty names are ignored."""
    a, b = settings_of(**TWO, a__obstacles=['walls'], b__obstacles=['']).footprints
    assert (a.obstacles, b.obstacles) == (('walls',), ())


SQUARE = ((0.5, 0.25), (-0.5, 0.25), (-0.5, -0.25), (0.5, -0.25))
FLAT = [coordinate for point in SQUARE for coordinate in point]


@pytest.mark.parametrize('points, wanted', [
    (FLAT, SQUARE), (tuple(FLAT), SQUARE),
    ('[[0.5, 0.25], [-0.5, 0.25], [-0.5, -0.25], [0.5, -0.25]]', SQUARE),
    (' [ [.5,25e-2],[-0.5,0.25],[-.5,-0.25], [0.5 , -0.25] ] ', SQUARE),
    # As in a parameter file without decimal points.
    ([1, 0, 0, 1, -1, 0], ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))),
    # A point, and a segment.
    ([1.0, 0.0], ((1.0, 0.0),)), ('[[1, 0], [2, 0]]', ((1.0, 0.0), (2.0, 0.0)))])
def test_points_are_numbers_or_a_string_as_in_nav2(points, wanted):
    settings = outlined(footprint__points=points)
    assert outline_of(settings.footprints[0], settings.max_vertices) == wanted


@pytest.mark.parametrize('given, topic', [
    ({'footprint__points': FLAT}, '/ns//tf'),
    ({'footprint__points': FLAT, 'footprint__odometry': 'odom'}, '/ns/odom'),
    ({'footprint__frame_id': ''}, '/ns/footprint')])
def test_topic_is_resolved_and_of_an_outline_that_of_its_transforms(given, topic):
    assert outlined(**given).footprints[0].topic == topic


def test_topic_that_cannot_be_resolved_is_named():
    def refuse(topic):
        raise ValueError(f'{topic!r} is\nno topic')
    with pytest.raises(ParameterError, match="^footprint.topic: 'a b' is no topic$"):
        settings_of(refuse, footprint__topic='a b')


@pytest.mark.parametrize('given, words', [
    ({'footprints': ['left arm']}, "'left arm' cannot be a name: use letters"),
    ({'obstacles': ['größe']}, "'größe' cannot be a name: use letters"),
    ({'footprints': ['']}, "'' cannot be a name"),
    ({'obstacles': ['margin']}, "'margin' cannot be a name, because a parameter"),
    ({'footprints': ['use_sim_time']}, "'use_sim_time' cannot be a name, because a parameter"),
    ({'footprints': ['a'], 'obstacles': ['b', 'a']}, "'a' is used twice"),
    ({'obstacle__moving': True}, '^obstacle.moving: only ids .* polygon_instance$'),
    # The nearest name is suggested.
    ({**TWO, 'a__obstacles': ['dock', 'wals']},
     r"^a.obstacles: there is no obstacle source 'wals'; did you mean 'walls'\?$"),
    ({**TWO, 'b__obstacles': ['x']}, "^b.obstacles: there is no obstacle source 'x'$"),
    ({'footprint__radius': 1.0, 'footprint__frame_id': 'base_link'},
     '^frame_id: the outline of footprint needs the fixed frame that it moves in, such as odom$')])
def test_invalid_parameters_are_refused_in_one_line(given, words):
    """It says which one, why, and what to do."""
    with pytest.raises(ParameterError, match=words) as error:
        settings_of(**given)
    assert '\n' not in str(error.value)


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
    ({'points': "['12', '53', '90']"}, '^footprint.points: a string must have the form'),
    ({'points': '[[True, 0], [1, 1], [0, 1]]'}, '^footprint.points: a string must have the form'),
    ({'points': '{(0, 0), (1, 1), (0, 1)}'}, '^footprint.points: a string must have the form'),
    ({'points': '[{2, 1}, [1, 1], [0, 1]]'}, '^footprint.points: a string must have the form'),
    ({'points': '{(0, 0): 1, (1, 1): 2, (0, 1): 3}'}, '^footprint.points: a string must have'),
    ({'points': '(' * 5000}, '^footprint.points: a string must have the form'),
    ({'points': 3}, "^parameter 'footprint.points' is 3, but must be a string or an array of"),
    ({'points': ['a']}, r"^parameter 'footprint.points' is \['a'\], but must be"),
    ({'points': FLAT, 'radius': 1.0},
     '^footprint.points and footprint.radius are both given: choose one$'),
    ({'points': FLAT, 'frame_id': ''}, '^footprint.frame_id: an outline needs the frame'),
    ({'points': FLAT, 'frame_id': '/base_link'}, 'without a slash before it$'),
    ({'points': FLAT, 'odometry': 'odom', 'frame_id': 'odom'},
     '^footprint.frame_id: odom is the fixed frame, which no odometry moves: give the frame of'),
    ({}, '^footprint.frame_id is for an outline: give footprint.points or footprint.radius, too'),
    ({'frame_id': '', 'odometry': 'odom'}, '^footprint.odometry is for an outline: ')])
def test_invalid_outlines_are_refused_in_one_line(given, words):
    with pytest.raises(ParameterError, match=words) as error:
        outlined(**{f'footprint__{name}': value for name, value in given.items()})
    assert '\n' not in str(error.value)

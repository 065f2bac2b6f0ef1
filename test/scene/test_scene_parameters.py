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

"""Parameters by name, without any node: what is declared, and the Settings that it adds up to."""

import pytest
from sat_collision.scene.parameters import declare_parameters, ParameterError, read_settings
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, specs


def declared(**given):
    """Return all values by name, then the names of the footprints and those of the sources."""
    values = {}

    def declare(name, default, spec):
        values[name] = given.get(name.replace('.', '__'), default)
        return values[name]
    return values, *declare_parameters(declare)


def settings_of(resolve=str, **given):
    """Return the Settings that the given parameters make; two underscores stand for the dot."""
    values, footprints, obstacles = declared(**given)
    return read_settings(footprints, obstacles, values.__getitem__, resolve)


def test_nothing_given_makes_the_defaults():
    """One footprint and one source of obstacles."""
    assert settings_of() == Settings((FootprintSettings('footprint', 'footprint'),),
                                     (ObstacleSettings('obstacle', 'obstacles'),))


def test_every_source_has_parameters_of_its_own():
    """All its settings, by its name."""
    values, footprints, obstacles = declared(footprints=['a', 'b'], obstacles=['c'])
    assert (footprints, obstacles) == (['a', 'b'], ['c'])
    assert set(values) == {*specs(Settings),
                           *(f'{name}.{field}' for name in 'ab'
                             for field in specs(FootprintSettings)),
                           *(f'c.{field}' for field in specs(ObstacleSettings))}


def test_what_is_given_is_what_is_set():
    """Of one source among several, and of the monitor."""
    settings = settings_of(obstacles=['map', 'people'], people__max_count=7, margin=0.5)
    assert settings.obstacles == (ObstacleSettings('map', 'map'),
                                  ObstacleSettings('people', 'people', max_count=7))
    assert settings.margin == 0.5


def test_topics_are_resolved():
    """By whoever knows the namespace; where that fails, the error names the parameter."""
    assert settings_of('/robot/{}'.format).footprints[0].topic == '/robot/footprint'

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
    ({'footprints': ['a'], 'obstacles': ['b', 'a']}, "'a' is used twice")])
def test_senseless_names_are_refused(given, words):
    """The message says which one, why, and what to do."""
    with pytest.raises(ParameterError, match=words):
        declared(**given)


def test_only_ids_tell_what_has_moved():
    """Of other obstacles it is not known which one has become which."""
    assert settings_of(obstacle__moving=True,
                       obstacle__type='polygon_instance').obstacles[0].moving
    with pytest.raises(ParameterError, match='^obstacle.moving: only ids .* polygon_instance$'):
        settings_of(obstacle__moving=True)

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

"""The scene: states of footprints, deadlines, and parameters that change."""

from dataclasses import replace

from builders import box, SECOND, serialised
import pytest
from sat_collision.monitor import Monitor
from sat_collision.scene.footprints import Status
from sat_collision.scene.obstacles import ObstacleId
from sat_collision.scene.parameters import declare_parameters, ParameterError, read_settings
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, specs
from stage import (
    CART, clear_stage, LIDAR, NOT_RECEIVED, NOTHING_SENT, PATIENT_LIDAR, PATIENT_ROBOT, ROBOT,
    Stage, TOO_OLD)


def test_everything_is_unknown_before_any_message():
    """The node has just started."""
    stage = Stage()
    state = stage.state()
    assert stage.status() == 'unknown'
    assert state.contacts == ()
    assert state.reasons == (NOT_RECEIVED, NOTHING_SENT)
    assert state.age is None


def test_contact_begins_and_ends_with_the_obstacle():
    """A person walks up to the robot, touches it and walks away."""
    stage = clear_stage()
    for time, x, status in ((0.1, 5, 'clear'), (0.2, 1, 'collision'), (0.3, 0.3, 'collision'),
                            (0.4, -1.01, 'clear')):
        stage.wait_until(time)
        stage.see(x)
        stage.end()
        assert stage.status() == status


def test_contact_begins_and_ends_with_the_footprint():
    """The robot drives past obstacles that stand still."""
    stage = Stage()
    stage.send(0, 4, 5)
    for x, keys in ((2, []), (3, [1]), (4.5, [1, 2]), (6.5, []), (0, [0])):
        stage.robot(x)
        assert stage.state().contacts == tuple(ObstacleId('lidar', key) for key in keys)
        assert stage.status() == ('collision' if keys else 'clear')


def test_contacts_are_sorted_by_source_and_key():
    """Contacts come from several sources in any order."""
    stage = Stage(ObstacleSettings('radar', '/radar'), LIDAR)
    stage.robot()
    stage.send(0.1, 9, 0.2, name='radar')
    stage.send(0.3)
    assert [str(obstacle) for obstacle in stage.state().contacts] == [
        'lidar/0', 'radar/0', 'radar/2']


def test_footprints_are_judged_each_for_itself():
    """Two robots, one of them in contact."""
    stage = Stage(footprints=[ROBOT, CART])
    stage.robot(0)
    stage.robot(5, name='cart')
    stage.send(5.5)
    assert (stage.status('robot'), stage.status('cart')) == ('clear', 'collision')


def test_forgotten_obstacle_ends_its_contact():
    """An obstacle that nobody confirms stops counting, and with it the source that is silent."""
    stage = Stage(footprints=[PATIENT_ROBOT])
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'collision'
    stage.wait_until(2.001)
    assert stage.status() == 'unknown'
    assert stage.state().contacts == ()


def test_contact_outweighs_a_source_in_trouble():
    """A proved contact is one, whatever else is unknown; the reason is still given."""
    stage = Stage(LIDAR, ObstacleSettings('radar', '/radar'))
    stage.robot()
    stage.send(0.5)
    assert stage.status() == 'collision'
    assert stage.state().reasons == ('obstacle source radar on /radar has not sent anything yet',)
    stage.wait_until(0.1)
    stage.see(5)
    assert stage.status() == 'collision'
    stage.end()
    assert stage.status() == 'unknown'


def test_scene_disabled_knows_nothing_and_knows_all_when_enabled():
    """`enabled` is switched off and on: what came meanwhile counts."""
    stage = clear_stage()
    stage.scene.update(replace(stage.settings, enabled=False))
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons == ('checking is disabled',)
    stage.scene.update(stage.settings)
    assert stage.status() == 'collision'


def test_nothing_is_known_without_a_clock():
    """With use_sim_time the time is 0 until /clock comes; a latched map that came is kept."""
    stage = Stage(PATIENT_LIDAR, start=0.0)
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'unknown'
    assert stage.state().reasons[0].startswith('no clock yet')
    assert stage.scene.changes() == ['robot']
    stage.start = 1000.0
    stage.wait_until(0.0)
    assert stage.scene.changes() == ['robot']
    assert stage.state().reasons == (TOO_OLD,)
    stage.robot()
    assert stage.status() == 'collision'


def test_step_back_in_time_drops_everything():
    """A recording starts again: what was received lies in the future now."""
    stage = clear_stage(footprints=[PATIENT_ROBOT])
    stage.wait_until(-0.001)
    assert stage.scene.footprints == stage.scene.obstacles == []
    assert stage.status() == 'unknown'
    assert stage.state().reasons == (NOT_RECEIVED, NOTHING_SENT)
    stage.robot()
    stage.see(0.5)
    assert stage.status() == 'collision'


def test_step_back_is_noticed_with_the_first_message_too():
    """The message comes before the tick that would have noticed."""
    stage = clear_stage()
    stage.time = -5.0
    stage.see(20)
    assert stage.held == {0: 20}
    assert stage.state().reasons == (
        NOT_RECEIVED, 'obstacle source lidar on /polygons has not sent a whole set yet')


def test_nearest_obstacle():
    """The nearest of two, and none where there is none."""
    stage = Stage(footprints=(PATIENT_ROBOT,))
    assert stage.scene.nearest('robot') is None
    stage.robot(10000)
    assert stage.scene.nearest('robot') is None
    stage.send(10004, 9997)
    obstacle, separation, *_ = stage.scene.nearest('robot')
    assert (obstacle, separation) == (ObstacleId('lidar', 1), 2.0)


START = 1000 * SECOND


def test_set_that_is_older_than_the_one_before():
    """Its stamp is 1.8 s old when it comes: what it proves lasts for 0.2 s of a timeout of 2 s."""
    monitor = Monitor(Settings((FootprintSettings('robot', '/robot', timeout=0.0),),
                               (ObstacleSettings('lidar', '/polygons', timeout=2.0),)))
    monitor.receive('robot', serialised(box(0), START), START, 1)
    number = 0
    for now, stamp in ((START, START), (START + SECOND, START - 8 * SECOND // 10)):
        for points in (box(9), []):
            number += 1
            assert monitor.receive('lidar', serialised(points, stamp), now, number) is None
    for tenths, status in ((12, Status.CLEAR), (13, Status.UNKNOWN)):
        monitor.advance(START + tenths * SECOND // 10)
        assert monitor.scene.status('robot') is status


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


def test_only_ids_tell_what_has_moved():
    """Of other obstacles it is not known which one has become which."""
    assert settings_of(obstacle__moving=True,
                       obstacle__type='polygon_instance').obstacles[0].moving
    with pytest.raises(ParameterError, match='^obstacle.moving: only ids .* polygon_instance$'):
        settings_of(obstacle__moving=True)


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

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Parameters read without ROS, compared with a real node; topics found by type."""

from pathlib import Path

import pytest

pytest.importorskip('rosbags')

from recordings import INSTANCE, POLYGON, SOURCE  # noqa: E402
from sat_collision.replay.model.configuration import (  # noqa: E402
    parameter_of_text, parameters_of_file, settings_of)
from sat_collision.replay.model.configuration import settings_for  # noqa: E402
from sat_collision.scene.parameters import ParameterError  # noqa: E402

CONFIG = Path(__file__).resolve().parents[3] / 'config'
NODE = '/robot/footprint_monitor'
_ALSO = '/**:\n  ros__parameters:\n    footprint.timeout: 0.5\n'
FILES = {
    'all nodes': '/**:\n  ros__parameters:\n    footprint.timeout: 0.5\n',
    'nested': '/**:\n  ros__parameters:\n    footprint:\n      timeout: 0.5\n      topic: a\n',
    'by full name': f'{NODE}:\n  ros__parameters:\n    release_delay: 2.0\n',
    'by nested namespace': ('robot:\n  footprint_monitor:\n    ros__parameters:\n'
                            '      release_delay: 2.0\n'),
    'wildcard namespace': '/*/footprint_monitor:\n  ros__parameters:\n    release_delay: 2.0\n',
    'deep wildcard': '/**/footprint_monitor:\n  ros__parameters:\n    release_delay: 2.0\n',
    'wildcard name': '/robot/*:\n  ros__parameters:\n    release_delay: 2.0\n',
    'one token only': _ALSO + '/*:\n  ros__parameters:\n    release_delay: 2.0\n',
    'another node': _ALSO + '/other:\n  ros__parameters:\n    release_delay: 2.0\n',
    'name alone': _ALSO + 'footprint_monitor:\n  ros__parameters:\n    release_delay: 2.0\n',
    'later wins': ('/**:\n  ros__parameters:\n    release_delay: 2.0\n'
                   f'{NODE}:\n  ros__parameters:\n    release_delay: 3.0\n'),
    'sources': ('/**:\n  ros__parameters:\n    footprints: [a, b]\n    obstacles: [c]\n'
                '    c.type: polygon_instance\n    c.topic: ~/seen\n    b.topic: /b\n'
                '    c.moving: yes\n    c.max_count: 7\n    frame_id: "odom"\n'),
    'outline': ('/**:\n  ros__parameters:\n    frame_id: odom\n    footprint.radius: 0.5\n'
                '    footprint.frame_id: base\n    footprint.odometry: wheels\n'),
    'points': ('/**:\n  ros__parameters:\n    frame_id: odom\n    footprint.frame_id: base\n'
               '    footprint.points: [0.5, 0.0, 0.0, 1.0, -0.5, 0.0]\n'),
    'whole points': ('/**:\n  ros__parameters:\n    frame_id: odom\n    footprint:\n'
                     '      frame_id: base\n      points: [5, 0, 0, 1, -5, 0]\n'),
    'points of nav2': ('/**:\n  ros__parameters:\n    frame_id: odom\n    footprint:\n'
                       '      frame_id: base\n      points: "[[0.5, 0], [0, 1], [-0.5, 0]]"\n'),
    'exponent': '/**:\n  ros__parameters:\n    footprint.timeout: 1e1\n',
}


def node_settings(domain, *arguments, refusal=type):
    """Return the Settings of a real node with these arguments, or `refusal` of the error."""
    rclpy = pytest.importorskip('rclpy')
    from sat_collision.node.parameters import Parameters
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node('footprint_monitor', namespace='/robot', context=context,
                             cli_args=['--ros-args', *arguments])
    try:
        return Parameters(node).settings
    except ParameterError as error:
        return refusal(error)
    finally:
        node.destroy_node()
        context.shutdown()


@pytest.mark.parametrize('content', FILES.values(), ids=FILES)
def test_parameter_files_are_read_as_by_the_node(domain, tmp_path, content):
    """Wildcards, namespaces, nested and dotted names, types."""
    path = tmp_path / 'params.yaml'
    path.write_text(content)
    settings = settings_of(parameters_of_file(path, NODE), NODE)
    assert settings == node_settings(domain, '--params-file', str(path))


@pytest.mark.parametrize('name', ('footprint_monitor.yaml', 'nav2.yaml', 'outline.yaml'))
def test_shipped_parameter_files_are_read(domain, name):
    settings = settings_of(parameters_of_file(CONFIG / name, NODE), NODE)
    assert settings == node_settings(domain, '--params-file', str(CONFIG / name))


@pytest.mark.parametrize('text', [
    f'{SOURCE}.type:=circle', 'footprint.timeout:=soon', 'footprint.timeout:=1',
    'footprint.timeout:=-1.0', 'footprint.timeout:=.nan', f'{SOURCE}.max_count:=0',
    'publish_rate:=1000.0', 'footprints:=robot', 'footprints:=[left arm]', 'footprints:=[a, a]',
    'obstacles:=[footprint]', 'footprint.points:=3', 'footprint.points:=[a, b]',
    'footprint.points:=[1.0, 2.0]', "footprint.points:='[]'", 'footprint.frame_id:=base',
    'footprint.radius:=2.0', 'footprint.topic:=a b', "footprint.topic:=''", 'enabled:=1',
    'margin:=1', 'frame_id:=5', 'margn:=1.0', f'{SOURCE}.timout:=1.0',
    'scan.timeout:=1.0', 'colour:=red'])
def test_parameters_that_the_node_refuses(domain, text):
    """In one line that names the parameter."""
    name, value = parameter_of_text(text)
    with pytest.raises(ParameterError, match=name.partition('.')[0]) as error:
        settings_of({name: value})
    assert '\n' not in str(error.value)
    assert node_settings(domain, '-p', text) is ParameterError


@pytest.mark.parametrize('text, words', [
    ('margn:=1.0', "no parameter 'margn': did you mean margin?"),
    ('footprint.timout:=1.0', 'did you mean footprint.timeout?'),
    ('colour:=red', "no parameter 'colour'"),
    ('zzz.zzz:=1', "name 'zzz' in footprints or obstacles"),
    ('robot.topic:=a', "name 'robot' in footprints or obstacles, which name footprint, obst"),
    ('margin:=1', "'margin' is 1, but must be a double: write 1.0"),
    ('frame_id:=5', 'write "5", in quotes'), ('footprints:=robot', r'write \[robot\]'),
    ('footprint.points:=[]', "'footprint.points' has no value: give it one, or leave it out"),
    ('footprints:=[]', "'footprints' has no value")])
def test_refusals_are_those_of_the_node(domain, text, words):
    name, value = parameter_of_text(text)
    with pytest.raises(ParameterError, match=words) as error:
        settings_of({name: value})
    assert node_settings(domain, '-p', text, refusal=str) == str(error.value)


def test_parameters_of_rclpy_are_accepted(domain):
    """A dump of the node has them."""
    given = ['use_sim_time:=true', 'start_type_description_service:=false',
             'qos_overrides./obstacles.subscription.depth:=5']
    settings = settings_of(dict(map(parameter_of_text, given)), NODE)
    assert settings == node_settings(domain, *(part for text in given for part in ('-p', text)))


def test_parameters_of_sources_named_by_options_or_topics():
    """Unknown parameters are refused once all sources are known."""
    types = {'/footprint': POLYGON, '/people': POLYGON}
    for options in ({}, {'obstacles': ['/people']}):
        settings = settings_for(types, {'people.timeout': 7.0}, **options)
        assert settings.obstacles[0].timeout == 7.0
    with pytest.raises(ParameterError, match='did you mean people.timeout'):
        settings_for(types, {'people.timout': 7.0})


@pytest.mark.parametrize('content, words', [
    ('{:', 'params.yaml'), ('', 'not a parameter file'), ('a: 1', "no 'ros__parameters'"),
    ('/**:\n  ros__parameters: 3\n', 'has no parameters'), (b'\xff\xfe\xfd', 'params.yaml')])
def test_other_files_are_refused(tmp_path, content, words):
    path = tmp_path / 'params.yaml'
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ParameterError, match=words):
        parameters_of_file(path)
    with pytest.raises(ParameterError, match='nowhere'):
        parameters_of_file(tmp_path / 'nowhere')


def topics_of(types, parameters=None, **options):
    """Return the topics of footprints, and the topics and types of sources."""
    settings = settings_for(types, parameters or {}, **options)
    return ([footprint.topic for footprint in settings.footprints],
            [(source.topic, source.type) for source in settings.obstacles])


@pytest.mark.parametrize('types, found', [
    ({'/footprint': POLYGON, '/obstacles': POLYGON, '/zones': POLYGON},
     (['/footprint'], [('/obstacles', 'polygon')])),
    ({'/robot/footprint': POLYGON, '/seen': POLYGON, '/tf': 'tf2_msgs/msg/TFMessage'},
     (['/robot/footprint'], [('/seen', 'polygon')])),
    ({'/robot': POLYGON, '/tracks': INSTANCE}, (['/robot'], [('/tracks', 'polygon_instance')])),
    ({'/footprint': POLYGON, '/obstacles': INSTANCE},
     (['/footprint'], [('/obstacles', 'polygon_instance')])),
    ({'/robot/footprint': POLYGON}, (['/robot/footprint'], [('/obstacles', 'polygon')])),
    ({'/obstacles': POLYGON}, (['/footprint'], [('/obstacles', 'polygon')])),
    ({'/tf': 'tf2_msgs/msg/TFMessage'}, (['/footprint'], [('/obstacles', 'polygon')]))])
def test_unambiguous_topics_are_found(types, found):
    """The node's defaults, otherwise by type and name."""
    assert topics_of(types) == found


@pytest.mark.parametrize('types', [
    {'/a': POLYGON, '/b': POLYGON},
    {'/local/footprint': POLYGON, '/global/footprint': POLYGON},
    {'/robot/footprint': POLYGON, '/people': POLYGON, '/shelves': POLYGON},
    {'/footprint': POLYGON, '/people': POLYGON, '/shelves': POLYGON}])
def test_ambiguous_topics_are_listed(types):
    """With the options to choose."""
    with pytest.raises(ParameterError, match='--(footprint|obstacles)') as error:
        settings_for(types, {})
    assert all(topic in str(error.value) for topic in types if topic != '/footprint')


def test_refusal_names_given_topics_that_are_missing():
    with pytest.raises(ParameterError, match='^the recording has no topic /robt; cannot tell'):
        settings_for({'/robot': POLYGON, '/people': POLYGON}, {}, footprints=('/robt',))


def test_topics_can_be_given():
    """With and without a name; the others are still found."""
    types = {'/a': POLYGON, '/b': POLYGON, '/c': INSTANCE}
    assert topics_of(types, footprints=('/a',), obstacles=('b:=/b', 'c:=/c')) == (
        ['/a'], [('/b', 'polygon'), ('/c', 'polygon_instance')])
    assert topics_of({'/a': POLYGON, '/b': POLYGON}, footprints=('robot:=/b',)) == (
        ['/b'], [('/a', 'polygon')])
    with pytest.raises(ParameterError, match='used twice'):
        topics_of(types, footprints=('x:=/a', 'x:=/b'))
    with pytest.raises(ParameterError, match='name'):
        topics_of(types, footprints=(':=/a',))


def test_topic_named_like_a_parameter_uses_the_default_name():
    settings = settings_for({'/footprints': POLYGON, '/obstacles': POLYGON}, {},
                            footprints=['/footprints'], obstacles=['/obstacles'])
    assert [settings.footprints[0].name, settings.obstacles[0].name] == ['footprint', SOURCE]

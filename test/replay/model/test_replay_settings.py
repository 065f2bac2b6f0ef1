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
    parameter_of_text, parameters_of_file, settings_for, settings_of)
from sat_collision.scene.parameters import ParameterError  # noqa: E402

CONFIG = Path(__file__).resolve().parents[3] / 'config'
NODE = '/robot/footprint_monitor'
TIMEOUT, DELAY = 'footprint.timeout: 0.5', 'release_delay: 2.0'


def of(node, *lines):
    """Return a parameter file with lines for a node."""
    return ''.join((f'{node}:\n  ros__parameters:\n', *(f'    {line}\n' for line in lines)))


FILES = {
    'all nodes': of('/**', TIMEOUT),
    'nested': of('/**', 'footprint:', '  timeout: 0.5', '  topic: a'),
    'by full name': of(NODE, DELAY),
    'by nested namespace': ('robot:\n  footprint_monitor:\n    ros__parameters:\n'
                            f'      {DELAY}\n'),
    'wildcard namespace': of('/*/footprint_monitor', DELAY),
    'deep wildcard': of('/**/footprint_monitor', DELAY),
    'wildcard name': of('/robot/*', DELAY),
    'one token only': of('/**', TIMEOUT) + of('/*', DELAY),
    'another node': of('/**', TIMEOUT) + of('/other', DELAY),
    'name alone': of('/**', TIMEOUT) + of('footprint_monitor', DELAY),
    'later wins': of('/**', DELAY) + of(NODE, 'release_delay: 3.0'),
    'sources': of('/**', 'footprints: [a, b]', 'obstacles: [c]', 'c.type: polygon_instance',
                  'c.topic: ~/seen', 'b.topic: /b', 'c.moving: yes', 'c.max_count: 7',
                  'frame_id: "odom"'),
    'outline': of('/**', 'frame_id: odom', 'footprint.radius: 0.5', 'footprint.frame_id: base',
                  'footprint.odometry: wheels'),
    'points': of('/**', 'frame_id: odom', 'footprint.frame_id: base',
                 'footprint.points: [0.5, 0.0, 0.0, 1.0, -0.5, 0.0]'),
    'whole points': of('/**', 'frame_id: odom', 'footprint:', '  frame_id: base',
                       '  points: [5, 0, 0, 1, -5, 0]'),
    'points of nav2': of('/**', 'frame_id: odom', 'footprint:', '  frame_id: base',
                         '  points: "[[0.5, 0], [0, 1], [-0.5, 0]]"'),
    'exponent': of('/**', 'footprint.timeout: 1e1'),
    **{f'config/{name}': (CONFIG / name).read_text()
       for name in ('footprint_monitor.yaml', 'nav2.yaml', 'outline.yaml')},
}


def node_settings(domain, *arguments):
    """Return the Settings of a real node with these arguments, or why it refuses them."""
    rclpy = pytest.importorskip('rclpy')
    from sat_collision.node.parameters import Parameters
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = rclpy.create_node('footprint_monitor', namespace='/robot', context=context,
                             cli_args=['--ros-args', *arguments])
    try:
        return Parameters(node).settings
    except ParameterError as error:
        return str(error)
    finally:
        node.destroy_node()
        context.shutdown()


@pytest.mark.parametrize('content', FILES.values(), ids=FILES)
def test_parameter_files_are_read_as_by_the_node(domain, tmp_path, content):
    path = tmp_path / 'params.yaml'
    path.write_text(content)
    settings = settings_of(parameters_of_file(path, NODE), NODE)
    assert settings == node_settings(domain, '--params-file', str(path))


# Of a node in words of ROS.
REFUSED_BY_ROS = (
    f'{SOURCE}.type:=circle', 'footprint.timeout:=-1.0', 'footprint.timeout:=.nan',
    f'{SOURCE}.max_count:=0', 'publish_rate:=1000.0', 'footprint.topic:=a b',
    "footprint.topic:=''")


@pytest.mark.parametrize('text, words', [
    *((text, text.partition(':=')[0].partition('.')[0]) for text in (
        'footprint.timeout:=soon', 'footprint.timeout:=1', 'footprints:=[left arm]',
        'footprints:=[a, a]', 'obstacles:=[footprint]', 'footprint.points:=3',
        'footprint.points:=[a, b]', 'footprint.points:=[1.0, 2.0]', "footprint.points:='[]'",
        'footprint.frame_id:=base', 'footprint.radius:=2.0', 'enabled:=1',
        f'{SOURCE}.timout:=1.0', 'scan.timeout:=1.0', *REFUSED_BY_ROS)),
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
    """In one line that names the parameter."""
    name, value = parameter_of_text(text)
    with pytest.raises(ParameterError, match=words) as error:
        settings_of({name: value})
    assert '\n' not in str(error.value)
    refusal = node_settings(domain, '-p', text)
    assert refusal == str(error.value) or text in REFUSED_BY_ROS and isinstance(refusal, str)


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
    (b'{:', 'params.yaml'), (b'', 'not a parameter file'), (b'a: 1', "no 'ros__parameters'"),
    (b'/**:\n  ros__parameters: 3\n', 'has no parameters'), (b'\xff\xfe\xfd', 'params.yaml')])
def test_other_files_are_refused(tmp_path, content, words):
    path = tmp_path / 'params.yaml'
    path.write_bytes(content)
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

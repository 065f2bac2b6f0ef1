# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Parameters: declared, checked, set while running, and dumped."""

import dataclasses
import math
from pathlib import Path

import pytest
from rcl_interfaces.msg import ParameterType
import rclpy
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos_overriding_options import QoSOverridingOptions
from sat_collision.node.parameters import Parameters
from sat_collision.scene.parameters import ParameterError
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
from std_msgs.msg import Bool
import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
# All fields are parameters, except the names, which are in two lists.
NUMBER = len(dataclasses.fields(Settings)) + sum(
    len(dataclasses.fields(kind)) - 1 for kind in (FootprintSettings, ObstacleSettings))


@pytest.fixture
def declare(domain):
    """Return a function that declares all parameters of a new node, some with values."""
    context = rclpy.Context()
    context.init(domain_id=domain)
    nodes = []

    def declare(values=None, **options):
        overrides = [Parameter(name, value=value) for name, value in (values or {}).items()]
        node = rclpy.create_node('node', context=context, parameter_overrides=overrides, **options)
        nodes.append(node)
        return node, Parameters(node)

    yield declare
    for node in nodes:
        node.destroy_node()
    context.shutdown()


def set_one(node, name, value):
    """Set a parameter; return the reason of a refusal, None if accepted."""
    result, = node.set_parameters([Parameter(name, value=value)])
    return None if result.successful else result.reason


def test_shipped_parameter_file_has_the_defaults(declare):
    """And leaves none out."""
    _, defaults = declare()
    node, parameters = declare(cli_args=['--ros-args', '--params-file',
                                         str(CONFIG / 'footprint_monitor.yaml')])
    assert parameters.settings == defaults.settings
    assert len(node._parameter_overrides) == NUMBER


@pytest.mark.parametrize('name, topic, outline_in, frame_id', [
    ('fleet', '/robot1/local_costmap/published_footprint', '', 'map'),
    ('nav2', '/local_costmap/published_footprint', '', 'odom'),
    ('outline', '/tf', 'base_link', 'odom')])
def test_other_parameter_files(declare, name, topic, outline_in, frame_id):
    """They declare what ends a set, so no obstacle leaves a trail."""
    _, parameters = declare(cli_args=['--ros-args', '--params-file', str(CONFIG / f'{name}.yaml')])
    settings, footprint = parameters.settings, parameters.settings.footprints[0]
    assert 'none' not in [source.ending for source in settings.obstacles]
    assert (footprint.topic, footprint.frame_id, footprint.has_outline, settings.frame_id) == (
        topic, outline_in, bool(outline_in), frame_id)


OUTLINE = {'frame_id': 'odom', 'footprint.frame_id': 'base', 'footprint.points': [0.0, 0.0]}


def test_points_can_be_changed_live(declare):
    """As numbers or a string; invalid ones are refused in one line and change nothing."""
    node, parameters = declare(OUTLINE)
    changes = []
    parameters.on_change(changes.append)
    for points in ([1.0, 2.0], '[[1, 2], [3, 4]]', [5, 6]):
        assert set_one(node, 'footprint.points', points) is None
    assert [one.footprints[0].points for one in changes] == [
        (1.0, 2.0), '[[1, 2], [3, 4]]', (5.0, 6.0)]
    for name, value, words in (
            ('points', [1.0, 2.0, 3.0], 'footprint.points has 3 numbers'),
            ('points', f'[[{10**400}, 0], [1, 1]]', 'a string must have the form'),
            ('points', '[[0, 0], [1, 1], [1, 0], [0, 1]]', 'footprint.points are not a simple'),
            ('radius', 1.0, 'are both given'), ('points', '', 'footprint.frame_id is for an'),
            ('points', True, 'must be a string or an array of numbers')):
        assert words in set_one(node, f'footprint.{name}', value)
    assert len(changes) == 3
    node, parameters = declare({**OUTLINE, 'lock_parameters': True})
    parameters.on_change(pytest.fail)
    assert 'is locked' in set_one(node, 'footprint.points', [1.0, 2.0])


def test_every_setting_can_be_given(declare):
    footprints = (FootprintSettings('a', '/robot', timeout=0.5, enabled=False, obstacles=('d',)),
                  FootprintSettings('b', '/b', obstacles=('c', 'd')))
    obstacles = (ObstacleSettings('c', '/seen', 'polygon_instance', timeout=0.5, enabled=False,
                                  max_count=7, moving=True),
                 ObstacleSettings('d', '/d', set_end='empty_polygon', timeout=0.0))
    wanted = Settings(footprints, obstacles, frame_id='odom', transform_timeout=0.3,
                      max_tf_gap=1.0, max_tilt=0.2, tf_cache_time=5.0, future_tolerance=0.1,
                      clock_timeout=5.0, enabled=False,
                      unknown_is_collision=False, margin=0.1, resolution=0.01, release_delay=0.5,
                      max_vertices=16, publish_rate=20.0, marker_rate=5.0,
                      max_batch_delay=0.005)
    values = {'footprints': ['a', 'b'], 'obstacles': ['c', 'd']}
    for source in (*footprints, *obstacles):
        values.update({f'{source.name}.{key}': list(value) if key == 'obstacles' else value
                       for key, value in dataclasses.asdict(source).items() if key != 'name'})
    values.update({key: value for key, value in dataclasses.asdict(wanted).items()
                   if key not in values})
    _, parameters = declare(values)
    assert parameters.settings == wanted


def test_no_parameter_is_a_prefix_of_another(declare):
    """Such a parameter could not be written to a parameter file."""
    node, _ = declare({'footprints': ['a', 'b'], 'obstacles': ['c', 'obstacle']})
    names = node._parameters
    assert not [name for name in names if any(other.startswith(f'{name}.') for other in names)]


def test_no_source_is_named_like_a_parameter(declare):
    """Or like the prefix of one, including rclpy's own."""
    node, parameters = declare()
    node.create_subscription(Bool, 'topic', lambda _: None, 1,
                             qos_overriding_options=QoSOverridingOptions.with_default_policies())
    taken = {name.split('.')[0] for name in node._parameters} - {'footprint', 'obstacle'}
    assert {'margin', 'obstacles', 'use_sim_time', 'qos_overrides'} <= taken
    for name in taken:
        for kind in ('footprints', 'obstacles'):
            with pytest.raises(ParameterError, match=f"'{name}' cannot be a name"):
                declare({kind: [name]})


def test_default_topic_is_the_name(declare):
    """Except for the default names."""
    for footprints, obstacles in (
            ({'robot': '/robot', 'obstacle': '/obstacle'}, {'people': '/people'}),
            ({'footprint': '/footprint'}, {'people': '/people', 'obstacle': '/obstacles'})):
        settings = declare({'footprints': [*footprints], 'obstacles': [*obstacles]})[1].settings
        assert {one.name: one.topic for one in settings.footprints} == footprints
        assert {one.name: one.topic for one in settings.obstacles} == obstacles


def test_topics_are_resolved_in_the_namespace_and_remapped(declare):
    _, parameters = declare({'footprint.topic': 'base'}, namespace='robot',
                            cli_args=['--ros-args', '-r', 'obstacles:=/seen'])
    assert parameters.settings.footprints[0].topic == '/robot/base'
    assert parameters.settings.obstacles[0].topic == '/seen'


def test_every_parameter_is_described(declare):
    """With limits for every number."""
    node, _ = declare()
    ours = [name for name in node._parameters if name.split('.')[0] not in
            ('use_sim_time', 'start_type_description_service', 'qos_overrides')]
    assert len(ours) == NUMBER
    for descriptor in node.describe_parameters(ours):
        assert descriptor.description, descriptor.name
        assert (descriptor.type != ParameterType.PARAMETER_DOUBLE
                or descriptor.floating_point_range), descriptor.name
        assert (descriptor.type != ParameterType.PARAMETER_INTEGER
                or descriptor.integer_range), descriptor.name
    timeout, kind, end = node.describe_parameters(
        ['obstacle.timeout', 'obstacle.type', 'obstacle.set_end'])
    assert 'silent' in timeout.description and timeout.floating_point_range[0].from_value == 0
    assert kind.read_only and 'polygon_instance' in kind.additional_constraints
    for cost_or_cure in ('trail', 'two timeouts old', 'send an empty polygon after each set'):
        assert cost_or_cure in end.description


@pytest.mark.parametrize('values, words', [
    ({'obstacle.type': 'circle'}, 'circle.*polygon, polygon_instance'),
    ({'max_batch_delay': 1.0}, 'max_batch_delay'),
    ({'footprint.timeout': math.nan}, 'footprint.timeout.*range'),
    ({'publish_rate': 0.1}, 'publish_rate.*range'),
    ({'watchdog': 0.049}, 'watchdog is 0.049 s.*set 0.05 or more, or 0.0 for never'),
    ({'publish_rate': None}, 'publish_rate.*has no value'),
    ({'footprints': None}, 'footprints.*has no value'),
    ({'footprints': []}, 'footprints.*STRING_ARRAY'),
    ({'obstacle.set_quiet': 0.05}, 'set_quiet.* any more: write set_end: empty_polygon, and'),
    ({'obstacle.set_window': 0.1},
     'any more: write set_end: empty_polygon, .* each set; or write set_end: new_stamp, if'),
    ({'obstacle.settle_time': 2.0}, 'any more: write set_end: empty_polygon, .* of the map'),
    ({'obstacle.accumulate': True}, 'any more: remove it: each polygon counts until its timeout'),
    ({'obstacle.max_count': 1}, 'obstacle.max_count: 1 .*: write obstacle.set_end: each_message'),
    ({'obstacle.timeout': 0.0},
     'obstacle.timeout is 0.0, for a map.* obstacle.set_end to empty_polygon and send'),
    ({'obstacle.set_end': 'empty'}, 'empty.*none, empty_polygon, new_stamp, each_message'),
    ({'obstacle.type': 'polygon_collection', 'obstacle.set_end': 'empty_polygon'},
     'obstacle.set_end: .* leave set_end out'),
    ({'obstacle.type': 'polygon_instance', 'obstacle.moving': True,
      'obstacle.set_end': 'empty_polygon'}, 'obstacle.moving: .*: set obstacle.set_end to none'),
    ({'footprint.obstacles': ['obstacles']}, "'obstacles'; did you mean 'obstacle'"),
])
def test_invalid_values_at_the_start_are_refused_in_one_line(declare, values, words):
    with pytest.raises(ParameterError, match=words) as error:
        declare(values)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('name, value', [
    ('enabled', False), ('footprint.enabled', False), ('obstacle.enabled', False),
    ('footprint.timeout', 3.0), ('obstacle.timeout', 3.0), ('obstacle.max_count', 5),
    ('release_delay', 1.0),
    ('unknown_is_collision', False), ('publish_rate', 5.0), ('marker_rate', 1.0),
    ('margin', 0.5), ('resolution', 0.5), ('max_batch_delay', 0.0),
])
def test_live_parameters_can_be_changed(declare, name, value):
    """The new settings are reported at once and otherwise equal the old ones."""
    node, parameters = declare()
    before = parameters.settings
    changes = []
    parameters.on_change(changes.append)
    assert set_one(node, name, value) is None
    after, = changes
    assert after == parameters.settings != before
    source, _, field = name.rpartition('.')
    kinds = {'footprint': after.footprints, 'obstacle': after.obstacles}
    assert getattr(kinds[source][0] if source else after, field) == value


@pytest.mark.parametrize('name, value, words', [
    ('footprint.timeout', math.nan, 'range'),
    ('footprint.timeout', math.inf, 'range'),
    ('footprint.timeout', -0.1, 'range'),
    ('footprint.timeout', 'a', 'type'),
    ('footprint.timeout', None, 'undeclared'),
    ('obstacle.max_count', 0, 'range'),
    ('publish_rate', 0.0, 'range'),
    ('enabled', 1, 'type'),
    ('watchdog', 0.01, 'set 0.05 or more'),
    ('footprints', ['a'], 'read-only'), ('obstacles', ['a'], 'read-only'),
    ('footprint.topic', '/a', 'read-only'), ('obstacle.type', 'polygon_instance', 'read-only'),
    ('obstacle.set_end', 'empty_polygon', 'read-only'), ('frame_id', 'odom', 'read-only'),
    ('max_vertices', 5, 'read-only'),
])
def test_invalid_value_is_refused_and_changes_nothing(declare, name, value, words):
    node, parameters = declare()
    before = parameters.settings
    parameters.on_change(pytest.fail)
    assert words in set_one(node, name, value)
    assert parameters.settings == before


def test_sources_of_a_footprint_can_be_changed_live(declare):
    """An unknown name is refused with the nearest one; empty names are ignored."""
    node, parameters = declare({'obstacles': ['dock', 'walls']})
    parameters.on_change(lambda _: None)
    for given in (['walls'], [''], ['dock', 'walls']):
        assert set_one(node, 'footprint.obstacles', given) is None
        assert parameters.settings.footprints[0].obstacles == tuple(filter(None, given))
    assert set_one(node, 'footprint.obstacles', ['wall']) == (
        "footprint.obstacles: there is no obstacle source 'wall'; did you mean 'walls'?")
    assert 'type' in set_one(node, 'footprint.obstacles', [1])
    assert parameters.settings.footprints[0].obstacles == ('dock', 'walls')


def test_atomic_change_with_one_invalid_value_is_refused(declare):
    node, parameters = declare()
    result = node.set_parameters_atomically([Parameter('release_delay', value=2.0),
                                             Parameter('footprint.timeout', value=math.nan)])
    assert not result.successful
    assert parameters.settings.release_delay == 0.0


def dump(monitor, node):
    """Return all parameters of a node by name, read through its services."""
    client = AsyncParameterClient(monitor.node, node)
    monitor.until(client.services_are_ready, 'the parameter services')
    listed = client.list_parameters()
    monitor.until(listed.done, 'the names')
    names = list(listed.result().result.names)
    got = client.get_parameters(names)
    monitor.until(got.done, 'the values')
    return {name: parameter_value_to_python(value)
            for name, value in zip(names, got.result().values)}


@pytest.mark.parametrize('namespace', ['', '/robot1'])
def test_start_from_a_dump(start, tmp_path, namespace):
    node = f'{namespace}/footprint_monitor'
    remapped = ('-r', f'__ns:={namespace}') if namespace else ()
    dumped = dump(start(remapped), node)
    assert 'footprint.timeout' in dumped and dumped['use_sim_time'] is False
    path = tmp_path / 'dump.yaml'
    path.write_text(yaml.dump({node: {'ros__parameters': dumped}}))
    second = start((*remapped, '--params-file', str(path))).monitor
    assert {name: second.get_parameter(name).value for name in dumped} == dumped
    assert len(second._parameter_overrides) == len(dumped)

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

"""A node started from what `ros2 param dump` writes of another, by its parameter services."""

import pytest
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
import yaml


def nested(values):
    """Return values by dotted names as dictionaries in each other, as ros2 param dump does."""
    top = {}
    for name, value in values.items():
        *groups, last = name.split('.')
        inner = top
        for group in groups:
            inner = inner.setdefault(group, {})
        assert last not in inner, f'{name} is both a value and a group'
        inner[last] = value
    return top


def dump(monitor, node):
    """Return all parameters of a node by name, asked for by its services."""
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
    """It has the same parameters, the defaults, and comes to know the same."""
    node = f'{namespace}/footprint_monitor'
    remapped = ('-r', f'__ns:={namespace}') if namespace else ()
    first = start(remapped)
    dumped = dump(first, node)
    assert 'footprint.timeout' in dumped and dumped['use_sim_time'] is False
    path = tmp_path / 'dump.yaml'
    path.write_text(yaml.dump({node: {'ros__parameters': nested(dumped)}}))
    second = start((*remapped, '--params-file', str(path))).monitor
    assert {name: second.get_parameter(name).value for name in dumped} == dumped
    assert len(second._parameter_overrides) == len(dumped)

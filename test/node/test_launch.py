# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The launch file in a real launch: the effect of each argument on the node."""

import contextlib
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from compiled import plain_python
import pytest

pytest.importorskip('launch_ros', reason='apt install ros-jazzy-launch-ros')
pytest.importorskip('rclpy')

from rclpy.parameter_client import AsyncParameterClient  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT = 120.0
_LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import SetParameter
path, margin, *given = sys.argv[1:]
arguments = [argument.split(':=') for argument in given]
service = LaunchService()
service.include_launch_description(LaunchDescription([
    GroupAction([*([SetParameter('margin', float(margin))] if margin else []),
                 IncludeLaunchDescription(PythonLaunchDescriptionSource(path),
                                          launch_arguments=arguments)])]))
sys.exit(service.run())
"""


@pytest.fixture
def installed(tmp_path):
    """Return the environment of a workspace in which the package is installed."""
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    executable = tmp_path / 'lib' / 'sat_collision' / 'footprint_monitor'
    for folder in (index, executable.parent):
        folder.mkdir(parents=True)
    (index / 'sat_collision').touch()
    executable.write_text(f'#!/bin/sh\nexec {sys.executable} -m sat_collision.node "$@"\n')
    executable.chmod(0o755)
    return plain_python(AMENT_PREFIX_PATH=str(tmp_path),
                        PYTHONPATH=f'{ROOT}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')


@pytest.fixture
def launch(installed, domain):
    """Return a function that launches the node with arguments; it returns the process."""
    running = []

    def launch(*arguments, margin=''):
        running.append(subprocess.Popen(
            [sys.executable, '-c', _LAUNCH, ROOT / 'launch' / 'footprint_monitor.launch.py',
             margin, *arguments], env={**installed, 'ROS_DOMAIN_ID': str(domain)},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True))
        return running[-1]

    yield launch
    for process in running:
        # Ctrl-C reaches launch and node; after any other signal launch would leave the node.
        with contextlib.suppress(ProcessLookupError):  # it has ended by itself
            os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=60)


def parameters(peer, node, *names):
    """Return the values of parameters of a node, once it answers."""
    client = AsyncParameterClient(peer.node, node)
    peer.until(client.services_are_ready, f'the services of {node}', TIMEOUT)
    future = client.get_parameters(list(names))
    peer.until(future.done, 'an answer')
    return [value.double_value or value.bool_value for value in future.result().values]


def test_defaults(launch, peer):
    """A parameter set by SetParameter in the launch file counts."""
    launch(margin='0.25')
    assert parameters(peer, '/footprint_monitor', 'margin', 'use_sim_time') == [0.25, False]


@pytest.mark.parametrize('arguments, expected', [((), True), (('use_sim_time:=false',), False)])
def test_simulated_time_is_passed_only_if_given(launch, peer, tmp_path, arguments, expected):
    """Otherwise the parameter file decides."""
    params = tmp_path / 'params.yaml'
    params.write_text('/**:\n  ros__parameters: {use_sim_time: true, margin: 0.5}\n')
    launch(f'params_file:={params}', *arguments)
    assert parameters(peer, '/footprint_monitor', 'margin', 'use_sim_time') == [0.5, expected]


@pytest.mark.parametrize('config', ['footprint_monitor', 'nav2'])
def test_shipped_parameters_in_a_namespace(launch, peer, config):
    """With another node name; topics are in the namespace, too."""
    path = ROOT / 'config' / f'{config}.yaml'
    launch('name:=guard', 'namespace:=robot1', f'params_file:={path}')
    peer.name = 'robot1/guard'
    topic = {'nav2': 'local_costmap/published_footprint'}.get(config, 'footprint')
    peer.until(lambda: peer.node.count_subscribers(f'/robot1/{topic}')
               and peer.node.count_subscribers('/robot1/obstacles'), 'subscriptions', TIMEOUT)
    peer.until(lambda: peer.flag() is True, 'a flag', TIMEOUT)


def test_respawn(launch, peer):
    process = launch('respawn:=true', 'log_level:=warn')
    peer.until(lambda: peer.flag() is True, 'a flag', TIMEOUT)
    pids = []
    while len(pids) < 2:
        line = process.stdout.readline()
        assert line, 'launch has ended'
        assert '[INFO] [footprint_monitor]' not in line
        if started := re.search(r'process started with pid \[(\d+)\]', line):
            pids.append(int(started[1]))
            if len(pids) == 1:
                os.kill(pids[0], signal.SIGKILL)
    assert pids[0] != pids[1]


def test_missing_parameter_file_is_an_error(launch):
    process = launch('params_file:=/nowhere.yaml')
    output, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode and 'there is no file /nowhere.yaml' in output

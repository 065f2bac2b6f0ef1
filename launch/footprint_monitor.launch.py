# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Start the footprint monitor, with a parameter file or without."""

import os

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    'name': ('footprint_monitor', 'Name of the node'),
    'namespace': ('', 'Namespace of the node and of its relative topics'),
    'params_file': ('', 'Parameters of the node; without a file all have their defaults'),
    'use_sim_time': ('', 'Whether to take the time from /clock; not given: as the parameter file '
                         'and SetParameter say'),
    'log_level': ('info', 'Least severity that is logged'),
    'respawn': ('false', 'Whether to start the node again when it has ended'),
}


def generate_launch_description():
    """Declare the arguments and the node."""
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=description)
          for name, (default, description) in ARGUMENTS.items()),
        OpaqueFunction(function=start),
    ])


def start(context):
    """Return the node, with those parameters alone that were given."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    parameters = []
    if path := given['params_file']:
        # Launch would start the node without it.
        if not os.path.isfile(path):
            raise FileNotFoundError(f'params_file: there is no file {path}')
        parameters.append(path)
    if given['use_sim_time']:
        parameters.append({'use_sim_time': ParameterValue(LaunchConfiguration('use_sim_time'),
                                                          value_type=bool)})
    return [Node(
        package='sat_collision',
        executable='footprint_monitor',
        name=given['name'],
        namespace=given['namespace'],
        parameters=parameters,
        ros_arguments=['--log-level', given['log_level']],
        respawn=LaunchConfiguration('respawn'),
        respawn_delay=1.0,
        output='screen',
    )]

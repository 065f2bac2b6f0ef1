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

"""The node's command line: its own arguments, ROS arguments and unused parameter files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

USAGE = """\
usage: ros2 run sat_collision footprint_monitor [--help] [--version] [--ros-args ...]

Publishes whether robots' footprints meet obstacles. Parameters come in a file:

  ros2 run sat_collision footprint_monitor --ros-args --params-file my.yaml

Without ROS's commands: python3 -m sat_collision.node --ros-args --params-file my.yaml
config/footprint_monitor.yaml lists all parameters with their defaults.
"""


def split(args: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the node's own arguments and the ROS arguments, told apart as rcl does."""
    own: list[str] = []
    ros: list[str] = []
    taken_by = own
    for argument in args:
        if argument == '--ros-args':
            taken_by = ros
        elif argument == '--' and taken_by is ros:
            taken_by = own
        else:
            taken_by.append(argument)
    return own, ros


def unknown_arguments(own: Sequence[str]) -> str:
    """Return an error message for unknown arguments, which says what to type."""
    return (f"nothing takes '{' '.join(own)}': all arguments come after --ros-args, as in "
            '--ros-args --params-file my.yaml (--help says more)')


def unused_files(ros: Sequence[str], node: str) -> Iterator[str]:
    """
    Yield a warning for each parameter file that has no parameters for a node.

    `ros` has the ROS arguments, `node` is the full name of the node.
    """
    from sat_collision.scene.parameters import is_name_of, parameters_by_node
    import yaml  # a dependency of rclpy
    for option, path in zip(ros, ros[1:]):
        if option != '--params-file':
            continue
        with open(path) as file:
            names = [name for name, _ in parameters_by_node(yaml.safe_load(file))]
        if not any(is_name_of(name, node) for name in names):
            yield (f'{path} has no parameters for {node}, only for {", ".join(names) or "none"}: '
                   'call it /** there, which is any node')

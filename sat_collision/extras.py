# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What to say about an error: what to install, or what is wrong, in one line."""

from __future__ import annotations

from importlib.util import find_spec

_OF_PIP = {'argcomplete': 'argcomplete', 'backports': 'backports.zstd',
           'dask': "'dask[distributed]'", 'distributed': "'dask[distributed]'", 'lz4': 'lz4',
           'matplotlib': 'matplotlib', 'numpy': 'numpy', 'rosbags': 'rosbags', 'yaml': 'pyyaml'}
_OF_ROS = ('builtin_interfaces', 'rcl_interfaces', 'rclpy', '_msgs')


def missing(error: ModuleNotFoundError) -> str:
    """Say in one line which library is missing, and what to install."""
    library = str(error.name).partition('.')[0]
    if library in _OF_PIP:
        # Without ROS, which brings yaml, replay lacks this too.
        more = ' rosbags' if library == 'yaml' and not find_spec('rclpy') else ''
        return f'{library} is not installed: pip install {_OF_PIP[library]}{more}'
    if library.endswith(_OF_ROS):
        return (f'{library} is not installed: source /opt/ros/jazzy/setup.bash, or in a clone '
                "pip install '.[ros]'")
    return f'{error.name} is not installed'


def unexpected(error: BaseException) -> str:
    """Say in one line what an unexpected error of replay_check is."""
    return f'{type(error).__name__}: {in_one_line(error)} (--debug shows where)'


def in_one_line(error: BaseException) -> str:
    """Return an exception's message in one line, or its type if it has none."""
    return printable(' '.join(str(error).split())) or type(error).__name__


def printable(text: str) -> str:
    """Return a text in one line without control characters: names of recordings may have any."""
    return ''.join(one if one.isprintable() else '?' for one in text)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The entry point of the node's process, and its command line."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
import os
import stat
import sys

from sat_collision import __version__
from sat_collision.extras import missing
from sat_collision.node.signals import end_on_signals

_USAGE = """\
usage: ros2 run sat_collision footprint_monitor [--help] [--version] [--ros-args ...]

Publishes whether robots' footprints meet obstacles. Parameters come in a file:

  ros2 run sat_collision footprint_monitor --ros-args --params-file my.yaml

Without ROS's commands: .venv/bin/footprint_monitor --ros-args --params-file my.yaml
config/footprint_monitor.yaml lists all parameters with their defaults.
"""

_STDERR = 2
_STATUS_OF_BAD_ARGUMENTS = 2  # as in argparse


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the node until SIGINT, SIGTERM or SIGHUP; return the exit status.

    `args` excludes the program's name and defaults to the arguments of the process.
    """
    own, ros = _split(sys.argv[1:] if args is None else args)
    if '--version' in own:
        print(f'sat_collision {__version__}')
        return 0
    if '--help' in own or '-h' in own:
        print(_USAGE, end='')
        return 0
    if own:
        print(f"footprint_monitor: nothing takes '{' '.join(own)}': all arguments come after "
              '--ros-args, as in --ros-args --params-file my.yaml (--help says more)',
              file=sys.stderr)
        return _STATUS_OF_BAD_ARGUMENTS
    _fill_standard_streams()
    _never_wait_for_readers()
    end_on_signals()
    # Imported only now, because it takes so long that a signal may arrive meanwhile.
    try:
        from sat_collision.geometry import preparation
        preparation.begin()
        # Classes of rosbags would take the place of those that are missing, see `interfaces`.
        for kind in ('diagnostic', 'geometry', 'sensor', 'std', 'visualization'):
            import_module(f'{kind}_msgs.msg')
        from sat_collision.node.footprint_monitor import run
    except ModuleNotFoundError as error:
        print(f'footprint_monitor: cannot start: {missing(error)}', file=sys.stderr)
        return 1
    return run(ros)


def _split(args: Sequence[str]) -> tuple[list[str], list[str]]:
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


def _fill_standard_streams() -> None:
    """
    Open /dev/null as each standard stream that is closed.

    Otherwise the next file opened gets its descriptor, and output is written into that file: for
    example into the pipe that ends the node on signals.
    """
    while (opened := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        os.set_inheritable(opened, True)
    os.close(opened)


def _never_wait_for_readers() -> None:
    """
    Let lines be lost where nobody reads them: a full pipe, or a terminal that is held.

    ROS writes its log with the interpreter lock held, so no thread would publish a flag any more.
    The streams are opened anew, as others may share them.
    """
    for number in (1, _STDERR):
        mode = os.fstat(number).st_mode
        if stat.S_ISFIFO(mode) or os.isatty(number):
            with suppress(OSError):
                opened = os.open(f'/dev/fd/{number}', os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
                os.dup2(opened, number)
                os.close(opened)


if __name__ == '__main__':
    sys.exit(main())

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

"""Runs the node's process, from the initialisation of ROS until a signal ends it."""

from __future__ import annotations

from collections.abc import Sequence
import gc
import sys

import rclpy
from rclpy.context import Context
from rclpy.logging import (
    get_logger, get_logger_effective_level, get_logger_level, LoggingSeverity, set_logger_level)
from rclpy.signals import SignalHandlerOptions
from sat_collision.node.arguments import unused_files
from sat_collision.node.footprint_monitor import FootprintMonitor, NAME
from sat_collision.node.signals import Signalled
from sat_collision.scene.parameters import ParameterError


def run(args: Sequence[str]) -> int:
    """Run the node with ROS arguments until a signal ends it; return the exit status."""
    try:
        context = _begin_ros(args)
    except RuntimeError as error:  # raised by rcl for an unreadable parameter file
        print(f'{NAME}: cannot start: {_in_one_line(error)}', file=sys.stderr)
        return 1
    _quieten_rcl()
    try:
        node = FootprintMonitor(context=context)
    except ParameterError as error:
        get_logger(NAME).fatal(str(error))
        rclpy.shutdown(context=context)
        return 1
    for words in unused_files(args, node.get_fully_qualified_name()):
        node.get_logger().warning(words)
    # Exempt the objects made so far from later garbage collections, each of some 70 ms.
    gc.freeze()
    node.loop.run(Signalled())
    node.get_logger().info('stopped by a signal')
    node.loop.close()
    node.destroy_node()
    rclpy.shutdown(context=context)
    return 0


def _begin_ros(args: Sequence[str]) -> Context:
    """Initialise ROS, without a log file if none can be written."""
    def begin(*more: str) -> Context:
        context = Context()
        rclpy.init(args=['--ros-args', *args, *more], context=context,
                   signal_handler_options=SignalHandlerOptions.NO)
        return context
    try:
        return begin()
    except RuntimeError as error:
        if 'failed to initialize logging' not in str(error):
            raise
        print(f'{NAME}: the log goes to this stream only, not to a file: {_in_one_line(error)}',
              file=sys.stderr)
        return begin('--disable-external-lib-logs')


def _quieten_rcl() -> None:
    """Keep rcl, which then logs each take, from level debug unless its own level is given."""
    if get_logger_level('rcl') is LoggingSeverity.UNSET:
        set_logger_level('rcl', max(LoggingSeverity.INFO, get_logger_effective_level('rcl')))


def _in_one_line(error: Exception) -> str:
    return ' '.join(str(error).split())

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

"""The node in an executor of rclpy's, where this rclpy has not what `loop` stands on."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sat_collision.node.loop import Receiver

_LONGEST_WAIT = 0.1


class ExecutorLoop:
    """
    Runs a node in this thread, message by message: the same as `Loop`, slower.

    Parameters
    ----------
    node : rclpy.node.Node
        With subscriptions whose callbacks call the receiver themselves.
    receiver : Receiver

    """

    def __init__(self, node: Node, receiver: Receiver) -> None:
        self._node = node
        self._receiver = receiver
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._timer = node.create_timer(_LONGEST_WAIT, self._tick,
                                        clock=Clock(clock_type=ClockType.STEADY_TIME))

    def run(self, ended: Callable[[], bool]) -> None:
        """Run until `ended` is true, which is looked at after each message and tick."""
        while not ended():
            self._executor.spin_once(_LONGEST_WAIT)

    def close(self) -> None:
        """End what belongs to the loop, once it runs no more."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()

    def _tick(self) -> None:
        self._timer.timer_period_ns = round(self._receiver.tick() * 1e9)

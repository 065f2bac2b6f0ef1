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
import time

from rclpy.executors import ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.node import Node
from sat_collision.node.loop import HELD_UP
from sat_collision.node.receiver import Receiver

# How many messages are taken before a tick at most.
_MOST = 100


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
        self._next_tick = 0.0
        self._was_held_up = False

    def run(self, ended: Callable[[], bool]) -> None:
        """Run until `ended` is true, which is looked at after each message and tick."""
        is_busy = False
        while not ended():
            late = time.monotonic() - self._next_tick
            if late < 0.0:
                is_busy = self._do_one(0.0 if is_busy else -late)
            else:
                self._was_held_up = late > HELD_UP and not self._was_held_up
                now, is_all_taken = self._take_all()
                self._receiver.tick(now, is_all_taken and not self._was_held_up)
                self._next_tick = self._receiver.due(self._receiver.present(), time.monotonic())

    def close(self) -> None:
        """End what belongs to the loop, once it runs no more."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()

    def _take_all(self) -> tuple[int, bool]:
        """Take what has come; return the time until when, and whether that was all."""
        now, was_idle = self._receiver.present(), False
        for _ in range(_MOST):
            if not self._do_one(0.0):
                # The executor says so, too, when it is through with what it found before.
                if was_idle:
                    return now, True
                now, was_idle = self._receiver.present(), True
            else:
                was_idle = False
        return self._receiver.present(), False

    def _do_one(self, seconds: float) -> bool:
        """Do one thing as soon as it is ready, within so many s; tell whether there was one."""
        try:
            task, _, _ = self._executor.wait_for_ready_callbacks(seconds)
        except (ShutdownException, TimeoutException):
            return False
        task()
        task.result()
        return True

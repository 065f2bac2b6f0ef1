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

"""Which rclpy executor a node runs in, and how it runs there until a signal ends it."""

from __future__ import annotations

import signal
from types import FrameType

from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.task import Future
from sat_collision.scene.settings import EVENTS, SINGLE_THREADED

try:
    from rclpy.experimental import EventsExecutor
except ImportError:
    EventsExecutor = None

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_LONGEST_WAIT = 0.2


def available(kind: str) -> str:
    """Return the kind of executor named, or the one to take where this rclpy does not have it."""
    return SINGLE_THREADED if kind == EVENTS and EventsExecutor is None else kind


def create(kind: str, context: Context) -> Executor:
    """Return an executor of an available kind."""
    return (EventsExecutor if kind == EVENTS else SingleThreadedExecutor)(context=context)


def interrupt_on_signals() -> None:
    """Have SIGINT and SIGTERM raise KeyboardInterrupt: a long start-up can be broken off."""
    for number in _SIGNALS:
        signal.signal(number, signal.default_int_handler)


def ignore_signals() -> None:
    """Let nothing more disturb the end of the process."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def spin_until_signal(executor: Executor) -> None:
    """
    Run an executor until SIGINT or SIGTERM, which interrupts nothing; further ones are ignored.

    Every wait is bounded, because the events executor does not return from others; a wait for
    what never comes costs less a message than `spin_once`, which ends with each. A signal is seen
    when Python code next runs, so at the latest at the end of a wait.
    """
    signals: list[int] = []

    def take(number: int, frame: FrameType | None) -> None:
        ignore_signals()
        signals.append(number)

    for number in _SIGNALS:
        signal.signal(number, take)
    while not signals:
        executor.spin_until_future_complete(Future(), timeout_sec=_LONGEST_WAIT)

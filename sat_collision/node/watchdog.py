# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Watchdogs of the node's loop and clock, notification of systemd, and periodic timers."""

from __future__ import annotations

from collections.abc import Callable
import math
import os
import socket
import threading
import time

from rclpy.logging import get_logger

# How many times per period a stall is reported again.
_REPEATS = 4
_DATAGRAMS = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC | socket.SOCK_NONBLOCK


class Watchdog:
    """
    Reports a stall: that the node's loop has not turned for some time, by the steady clock.

    It runs in its own thread, which starts with the first turn. The GIL lets it run while the
    loop waits or computes in Python, and between two calls of compiled kernels, not during one.
    `on_stall` is called repeatedly from the thread, and `on_recovery` once from the loop; both
    receive the time in s since the last turn.
    """

    def __init__(self, on_stall: Callable[[float], None],
                 on_recovery: Callable[[float], None]) -> None:
        self._on_stall = on_stall
        self._on_recovery = on_recovery
        self._period = 0.0
        self._turned_at = 0.0
        self._stalled = False
        self._has_failed = False
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closed = False

    def use(self, period: float) -> None:
        """Set the time in s without a turn after which the loop is stalled, 0 for never."""
        with self._changed:
            self._period = period
            self._changed.notify()

    def turned(self) -> bool:
        """Record a turn of the loop; return whether that ends a stall."""
        now = time.monotonic()
        with self._changed:
            stalled, self._turned_at = now - self._turned_at, now
            was_stalled, self._stalled = self._stalled, False
        if was_stalled:
            self._on_recovery(stalled)
        if self._thread is None and not self._closed:
            self._thread = threading.Thread(target=self._watch, name='watchdog', daemon=True)
            self._thread.start()
        return was_stalled

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread:
            self._thread.join()

    def _watch(self) -> None:
        with self._changed:
            while not self._closed:
                stalled = time.monotonic() - self._turned_at
                if 0.0 < self._period <= stalled:
                    self._stalled = True
                    # Called with the lock held, so that it cannot follow the end of the stall.
                    try:
                        self._on_stall(stalled)
                    except Exception as error:  # whatever it is, the next stall counts, too
                        if not self._has_failed:
                            get_logger('watchdog').error(f'the watchdog failed: {error!r}')
                        self._has_failed = True
                    self._changed.wait(self._period / _REPEATS)
                else:
                    self._changed.wait(self._period - stalled if self._period else None)


class Systemd:
    """
    Notifies systemd, see sd_notify(3), for ``Type=notify`` with or without ``WatchdogSec``.

    Does nothing without the environment variables that systemd sets.
    """

    def __init__(self) -> None:
        self._address = os.environ.get('NOTIFY_SOCKET', '')
        # Twice as often as asked for, as sd_watchdog_enabled(3) recommends.
        self._period = int(os.environ.get('WATCHDOG_USEC', 0)) / 2e6
        self._ready = False
        self._alive = Every(self._period)

    def turned(self) -> None:
        """Notify that the node is ready, at the first call; then, when due, that it is alive."""
        if not self._address:
            return
        now = time.monotonic()
        self._ready = self._ready or self._say('READY=1')
        if self._period and self._alive.due(now):
            self._say('WATCHDOG=1')

    def ends(self) -> None:
        """Notify that the node stops on request."""
        if self._address:
            self._say('STOPPING=1')

    def _say(self, text: str) -> bool:
        """Return whether it was said: systemd may not listen for a while."""
        # A leading @ stands for the NUL byte of an abstract socket address.
        address = self._address
        if address.startswith('@'):
            address = '\0' + address[1:]
        try:
            with socket.socket(socket.AF_UNIX, _DATAGRAMS) as connection:
                connection.sendto(text.encode(), address)
        except OSError:
            return False
        return True


class Every:
    """A periodic timer, by a clock in seconds."""

    def __init__(self, period: float) -> None:
        self._period = period
        self.next = 0.0

    def due(self, now: float) -> bool:
        """Return whether it is due; if so, it is due again a period later."""
        if now < self.next:
            return False
        self.next += self._period
        if self.next <= now:
            self.next = now + self._period
        return True


class ClockWatch:
    """Detects that a clock stands still or is set, by comparison with a steady one."""

    def __init__(self) -> None:
        self._reading: int | None = None
        self._since = 0.0
        # By how much the clock was ahead of the steady one, in s; unknown at first.
        self._ahead = math.nan

    def steps(self, reading: int, now: float, tolerance: float) -> bool:
        """
        Return whether the clock was set by more than a tolerance in s since the last call.

        `now` is the time of the steady clock in s.
        """
        before, self._ahead = self._ahead, reading / 1e9 - now
        return abs(self._ahead - before) > tolerance

    def stands(self, reading: int, now: float, timeout: float) -> bool:
        """
        Return whether the reading has not changed for longer than a timeout in s, 0 for never.

        `now` is the time of the other clock in s.
        """
        if reading != self._reading:
            self._reading, self._since = reading, now
        return 0.0 < timeout < now - self._since

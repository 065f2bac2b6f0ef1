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

"""Notifies systemd, where it has started the node, that this is ready, and alive."""

from __future__ import annotations

import os
import socket
import time


class Systemd:
    """
    What sd_notify(3) does, for a service of ``Type=notify`` with or without ``WatchdogSec``.

    Without the variables that systemd sets it does nothing, and costs nothing.
    """

    def __init__(self) -> None:
        self._address = os.environ.get('NOTIFY_SOCKET', '')
        # Twice as often as asked for, as sd_watchdog_enabled(3) recommends.
        self._period = int(os.environ.get('WATCHDOG_USEC', 0)) / 2e6
        self._ready = False
        self._next = 0.0

    def turned(self) -> None:
        """Say that the node is ready, the first time; then, when it is due, that it is alive."""
        if not self._address:
            return
        now = time.monotonic()
        if not self._ready:
            self._ready = True
            self._say('READY=1')
        if self._period and now >= self._next:
            self._next = now + self._period
            self._say('WATCHDOG=1')

    def ends(self) -> None:
        """Notify that the node stops on request."""
        if self._address:
            self._say('STOPPING=1')

    def _say(self, text: str) -> None:
        # A leading @ stands for the zero byte of a name that is in no file system.
        address = self._address
        if address.startswith('@'):
            address = '\0' + address[1:]
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as connection:
            try:
                connection.sendto(text.encode(), address)
            except OSError:
                self._address = ''

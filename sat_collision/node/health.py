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

"""The health of the node as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue


class Health:
    """
    The message of /diagnostics: what came in, what was refused, and what a check costs.

    Parameters
    ----------
    node_name, hardware_id : str
    facts : dict
        What does not change while the node runs, such as the kernel in use.

    Attributes
    ----------
    check_times : list of float
        How many seconds the check of each message of the period took; to be appended to.

    """

    def __init__(self, node_name: str, hardware_id: str, facts: Mapping[str, str]) -> None:
        self._status = DiagnosticStatus(name=f'{node_name}: health', hardware_id=hardware_id)
        self._facts = facts
        self._incompatible: dict[str, str] = {}
        self._received: Counter[str] = Counter()
        self._refused = 0
        self._begun = time.monotonic()
        self.check_times: list[float] = []

    def incompatible_qos(self, topic: str, policy: str) -> None:
        """Note that a publisher on a topic cannot be heard."""
        self._incompatible[topic] = policy

    def message(self, stamp: Time, received: Counter[str],
                rejected: Counter[tuple[str, str]]) -> DiagnosticArray:
        """
        Return the message on the period that ends now, and begin the next.

        Parameters
        ----------
        stamp : builtin_interfaces.msg.Time
        received, rejected : collections.Counter
            Messages since the start: by source, and by source and reason.

        """
        now = time.monotonic()
        period = now - self._begun
        refused = rejected.total()
        times = self.check_times or [0.0]
        values = dict(self._facts)
        values['check time mean [ms]'] = f'{1e3 * sum(times) / len(times):.3f}'
        values['check time max [ms]'] = f'{1e3 * max(times):.3f}'
        for name, count in received.items():
            values[f'{name}: received'] = str(count)
            values[f'{name}: rate [Hz]'] = f'{(count - self._received[name]) / period:.1f}'
        for (name, reason), count in rejected.items():
            values[f'{name}: rejected, {reason}'] = str(count)
        for topic, policy in self._incompatible.items():
            values[f'{topic}: incompatible QoS'] = policy
        self._status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        problems = [f'incompatible QoS on {topic}' for topic in self._incompatible]
        if refused > self._refused:
            problems.append(f'messages rejected: {refused - self._refused}')
        self._status.level = DiagnosticStatus.WARN if problems else DiagnosticStatus.OK
        self._status.message = '; '.join(problems) or 'running'
        self._received = received.copy()
        self._refused = refused
        self._begun = now
        self.check_times.clear()
        message = DiagnosticArray(status=[self._status])
        message.header.stamp = stamp
        return message

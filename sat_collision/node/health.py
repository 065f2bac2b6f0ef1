# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The health of the node as diagnostic_msgs/DiagnosticArray."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from sat_collision.messages.interfaces import Bool
from sat_collision.monitor import Monitor
from sat_collision.node.loop import Backlog
from sat_collision.node.publishers import publishers_of_tf
from sat_collision.scene.frames import in_words
from sat_collision.scene.settings import TF

# A shorter backlog, in s, is a burst that is just being taken.
_NOTEWORTHY = 0.1
# If a frame's publishers take turns fewer times per period, one was only restarted.
_FEW_TURNS = 2
_MAX_NAMED = 10


class Health:
    """
    Publishes /diagnostics: messages received and rejected, the time per check, and the states.

    `facts` are values that stay the same while the node runs, such as the kernel in use;
    `changes` are those of parameters until now.
    """

    def __init__(self, node: Node, facts: dict[str, str], changes: Mapping[str, str]) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        name = node.get_fully_qualified_name()
        self._status = DiagnosticStatus(name=f'{name}: health', hardware_id=name)
        self.facts = facts
        self._changes = changes
        self._events: Counter[tuple[str, str]] = Counter()
        # What had been counted by the last message, see `_growth`.
        self._totals: Counter[object] = Counter()
        self._turns: Counter[str] = Counter()
        self._begun = time.monotonic()
        self._messages = 0
        self._seconds = 0.0
        self._longest = 0.0
        self._stalls = 0
        self._longest_stall = 0.0

    def count_stall(self, seconds: float) -> None:
        self._stalls += 1
        self._longest_stall = max(self._longest_stall, seconds)

    def count_event(self, topic: str, what: str, count: int) -> None:
        """Count violations of the QoS of a topic."""
        self._events[topic, what] += count

    def count_batch(self, messages: int, seconds: float) -> None:
        """Count messages that were checked together, and the time that took."""
        self._messages += messages
        self._seconds += seconds
        self._longest = max(self._longest, seconds)

    def publish(self, monitor: Monitor, backlogs: Mapping[str, Backlog],
                states: Iterable[DiagnosticStatus], faults: Iterable[str]) -> None:
        """Publish states of footprints, figures since the last message, and faults of /tf."""
        now = time.monotonic()
        period = now - self._begun
        transforms = monitor.transforms
        values = dict(self.facts)
        values['check time mean [ms]'] = f'{1e3 * self._seconds / max(self._messages, 1):.3f}'
        values['longest batch [ms]'] = f'{1e3 * self._longest:.3f}'
        for name, count in (monitor.received + transforms.received).items():
            values[f'{name}: received'] = str(count)
            values[f'{name}: rate [Hz]'] = f'{self._growth(name, count) / period:.1f}'
        if transforms.transforms:
            taken = self._growth('all transforms', transforms.transforms)
            values['transforms: rate [Hz]'] = f'{taken / period:.1f}'
        # How often the publishers of a frame took turns since the last message, if often.
        twice = {child: count - self._turns[child] for child, count in transforms.turns.items()
                 if count - self._turns[child] >= _FEW_TURNS}
        self._turns = transforms.turns.copy()
        for child, count in twice.items():
            values[f'transforms of {in_words(child)}: publishers took turns'] = str(count)
        for name, count in monitor.waiting.counts().items():
            values[f'{name}: waiting for transforms'] = str(count)
        for (child, reason), count in transforms.rejected.items():
            values[f'transforms of {child}: rejected, {reason}'] = str(count)
        for (name, reason), count in monitor.rejected.items():
            values[f'{name}: rejected, {reason}'] = str(count)
        for name, count in monitor.scene.lost().items():
            values[f'{name}: lost'] = str(count)
        for (topic, what), count in self._events.items():
            values[f'{topic}: {what}'] = str(count)
        for name, backlog in backlogs.items():
            values[f'{name}: behind'] = f'{backlog.seconds:.3f} s, {backlog.messages} messages'
        if self._stalls:
            values['stalls'] = f'{self._stalls}, the longest of {self._longest_stall:.1f} s'
        for name, change in self._changes.items():
            values[f'{name}: changed'] = change
        self._status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        problems = [*monitor.scene.source_faults, *faults]
        if twice:
            publishers = ', '.join(sorted(publishers_of_tf(self._node))) or 'unknown'
            frames = ', '.join(map(in_words, [*twice][:_MAX_NAMED]))
            problems.append(f'more than one publisher of {self._node.resolve_topic_name(TF)}, of '
                            f'{publishers}, sends {frames}')
        if not self._node.get_clock().ros_time_is_active and self._node.count_publishers('/clock'):
            problems.append('/clock is published, but not used here: set use_sim_time: true')
        for what, total in (
                ('rejected', monitor.rejected.total() + transforms.rejected.total()),
                ('lost', monitor.scene.lost().total())):
            if (count := self._growth(f'messages {what}', total)) > 0:
                problems.append(f'messages {what}: {count}')
        problems += [f'{name} is behind by {backlog.seconds:.3f} s'
                     for name, backlog in backlogs.items() if backlog.seconds > _NOTEWORTHY]
        problems += [f'{what} on {topic}: {count}' for (topic, what), total in self._events.items()
                     if (count := self._growth((topic, what), total))]
        self._status.level = DiagnosticStatus.WARN if problems else DiagnosticStatus.OK
        flags = sorted({one.topic_name for one in self._node.publishers if one.msg_type is Bool})
        if shared := [flag for flag in flags if self._node.count_publishers(flag) > 1]:
            self._status.level = DiagnosticStatus.ERROR
            problems.insert(0, f'others publish {", ".join(shared[:_MAX_NAMED])}, too: another '
                               'monitor of this name runs, or two flags have one topic, so that '
                               'they cannot be trusted: end it, or rename one')
        self._status.message = '; '.join(problems) or 'running'
        self._begun = now
        self._messages, self._seconds, self._longest = 0, 0.0, 0.0
        self._send([self._status, *states])

    def publish_stall(self, reason: str, states: Iterable[DiagnosticStatus]) -> None:
        """Publish that the node is stalled; may be called from another thread."""
        status = DiagnosticStatus(name=self._status.name, hardware_id=self._status.hardware_id,
                                  level=DiagnosticStatus.ERROR, message=reason)
        self._send([status, *states])

    def _send(self, statuses: list[DiagnosticStatus]) -> None:
        message = DiagnosticArray(status=statuses)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _growth(self, what: object, total: int) -> int:
        """Return by how much a total has grown since the last message."""
        before, self._totals[what] = self._totals[what], total
        return total - before

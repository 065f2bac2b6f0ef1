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

"""A bag of what the node would have published: its own outputs, given a stand-in for the node."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from sat_collision.messages.interfaces import serialize, Time, type_name
from sat_collision.messages.outputs import Outputs
from sat_collision.replay.bag.writer import BagWriter, new_bag
from sat_collision.scene.scene import Scene
from sat_collision.scene.settings import Settings

_SECOND = 10**9


class BagOutputs:
    """
    Writes flags, separations, states and markers to a new bag.

    Parameters
    ----------
    path : str
        Directory of the bag, which must not exist.
    node : str
        Full name of the node.
    settings : Settings
    scene : Scene

    Raises
    ------
    OutputError
        If the directory exists, or cannot be made.

    """

    def __init__(self, path: str, node: str, settings: Settings, scene: Scene) -> None:
        self._writer = new_bag(Path(path))
        self._clock = _Clock()
        self._outputs = Outputs(_Node(node, self._writer, self._clock), settings, scene)

    def change(self, names: Iterable[str], now: int) -> None:
        """Write what the node publishes at once when states change."""
        self._clock.time = now
        self._outputs.update(names)
        self._outputs.publish(names)

    def publish(self, now: int) -> None:
        """Write what the node publishes now and then: flags and states."""
        self._clock.time = now
        self._outputs.publish()

    def publish_markers(self, now: int) -> None:
        """Write the markers."""
        self._clock.time = now
        self._outputs.markers_current = False
        self._outputs.publish_markers()

    def close(self) -> None:
        """Finish the bag."""
        self._writer.close()


class _Clock:
    """The recording's time."""

    time = 0

    def now(self) -> _Clock:
        return self

    def to_msg(self) -> Any:
        return Time(sec=self.time // _SECOND, nanosec=self.time % _SECOND)


class _Node:
    """What Outputs asks of a node: a name, a clock, and publishers."""

    def __init__(self, name: str, writer: BagWriter, clock: _Clock) -> None:
        self._name = name
        self._writer = writer
        self._clock = clock

    def get_fully_qualified_name(self) -> str:
        return self._name

    def get_clock(self) -> _Clock:
        return self._clock

    def create_publisher(self, kind: type, topic: str, _depth: int) -> _Topic:
        return _Topic(self._writer, topic.replace('~', self._name, 1), type_name(kind),
                      self._clock)


class _Topic:
    """A topic of the bag, used as a publisher."""

    def __init__(self, writer: BagWriter, name: str, kind: str, clock: _Clock) -> None:
        self._writer = writer
        self._name = name
        writer.add_topic(name, kind)
        self._clock = clock

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: Any) -> None:
        data = message if isinstance(message, bytes) else serialize(message)
        self._writer.write(self._name, self._clock.time, data)

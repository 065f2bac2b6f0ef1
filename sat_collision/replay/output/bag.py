# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Writing bags: what the node would have published, by its own outputs, and the demo scene."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np
from sat_collision.demo import warehouse
from sat_collision.messages.interfaces import Point32, PolygonStamped, serialize, Time, type_name
from sat_collision.messages.outputs import Outputs
from sat_collision.monitor import Monitor
from sat_collision.replay.bag.storage import check_bag_writer, is_installed
from sat_collision.scene.settings import Settings

_SECOND = 10**9
# The example: its beginning, the period of messages (s), and their delay (ns).
_START = 1_700_000_000 * _SECOND
_PERIOD = 0.05
_STATIC_EVERY = 10
_DELAY = 2_000_000
_PARAMETERS = """\
# The warehouse scene: three robots, what does not move, and a person.
/**:
  ros__parameters:
    footprints: [{footprints}]
    obstacles: [warehouse, people]
    frame_id: {frame}
    warehouse.timeout: 3.0
    warehouse.set_end: empty_polygon  # which follows the last obstacle of each set
    people.timeout: 1.0
    people.set_end: empty_polygon
"""


class BagOutputs:
    """Writes flags, separations, states and markers to a new bag, as a stand-in for the node."""

    def __init__(self, path: str, node: str, settings: Settings, monitor: Monitor) -> None:
        self._node = node
        self._time = 0
        self.fault: Exception | None = None  # then nothing more is written
        self._writer = _new_bag(Path(path))
        self._scene = monitor.scene
        self._footprints = [one.name for one in settings.footprints]
        self._outputs = Outputs(self, settings, monitor.scene)
        self._paths = monitor.paths

    def change(self, names: Collection[str], now: int) -> None:
        """Write what the node publishes when states change."""
        self._time = now
        self._outputs.update(names)
        self._publish(names)

    def publish(self, now: int) -> None:
        """Write what the node publishes periodically: flags, states and what paths meet."""
        self._time = now
        self._publish(self._footprints)
        self._paths.check(now)
        for name in self._scene.path_checks:
            self._outputs.publish_path(name)

    def _publish(self, names: Collection[str]) -> None:
        self._outputs.publish_flags(names)
        for _ in self._outputs.publish_figures(names):
            pass

    def publish_markers(self, now: int) -> None:
        self._time = now
        self._outputs.markers_current = False
        self._outputs.publish_markers()

    def close(self) -> None:
        self._guard(self._writer.close)

    def _guard(self, action: Callable[..., None], *arguments: Any) -> None:
        """Call a method of the writer, and keep the first fault of the disk."""
        try:
            action(*arguments)
        except (OSError, RuntimeError) as error:  # the latter is whatever rosbag2 raises
            self.fault = self.fault or error

    # The methods of a node and of its clock that Outputs calls.

    def get_fully_qualified_name(self) -> str:
        return self._node

    def get_clock(self) -> BagOutputs:
        return self

    def now(self) -> BagOutputs:
        return self

    def to_msg(self) -> Any:
        return Time(sec=self._time // _SECOND, nanosec=self._time % _SECOND)

    def create_publisher(self, kind: type, topic: str, _depth: int) -> Any:
        name = topic.replace('~', self._node, 1)
        self._writer.add_topic(name, type_name(kind))

        def publish(message: Any) -> None:
            if not self.fault:
                self._guard(self._writer.write, name, self._time,
                            message if isinstance(message, bytes) else serialize(message))

        return SimpleNamespace(get_subscription_count=lambda: 1, publish=publish)


def write_example(path: str | Path) -> None:
    """Write the demo scene as a new bag of 16 s, with parameters to check it in params.yaml."""
    path = Path(path)
    writer = _new_bag(path)
    for name in (*warehouse.FOOTPRINTS, 'warehouse', 'people'):
        writer.add_topic(f'/{name}', type_name(PolygonStamped))
    for tick in range(round(warehouse.DURATION / _PERIOD) + 1):
        elapsed = tick * _PERIOD
        stamp = _START + round(elapsed * 1e9)
        outlines = [(name, warehouse.footprint(name, elapsed)) for name in warehouse.FOOTPRINTS]
        outlines += [('people', warehouse.person(elapsed)), ('people', warehouse.NOTHING)]
        if tick % _STATIC_EVERY == 0:
            outlines += [('warehouse', outline)
                         for outline in (*warehouse.STATIC, warehouse.NOTHING)]
        for name, outline in outlines:
            message = PolygonStamped()
            message.header.frame_id = warehouse.FRAME
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, _SECOND)
            message.polygon.points = [Point32(x=x, y=y)
                                      for x, y in outline.astype(np.float32).tolist()]
            writer.write(f'/{name}', stamp + _DELAY, bytes(serialize(message)))
    writer.close()
    (path / 'params.yaml').write_text(_PARAMETERS.format(
        footprints=', '.join(warehouse.FOOTPRINTS), frame=warehouse.FRAME))


def _new_bag(path: Path) -> _Writer:
    """Return a writer of MCAP storage in a new directory; OSError says why there is none."""
    check_bag_writer()
    if path.exists():
        raise FileExistsError(f'{path} already exists')
    path.parent.mkdir(parents=True, exist_ok=True)
    return _ByRosbags(path) if is_installed('rosbags.rosbag2') else _ByRosbag2(path)


class _ByRosbags:
    """The writer of rosbags; topics have types such as std_msgs/msg/Bool, times are in ns."""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from sat_collision.messages.rosbags_interfaces import STORE
        self._store = STORE
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self.close = self._writer.close
        self._connections: dict[str, Any] = {}

    def add_topic(self, topic: str, kind: str) -> None:
        self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)

    def write(self, topic: str, time: int, data: bytes) -> None:
        connection = self._connections[topic]
        # ROS leaves in padding what was in memory, and rosbags writes zeros.
        kind = connection.msgtype
        clean = self._store.serialize_cdr(self._store.deserialize_cdr(data, kind), kind)
        self._writer.write(connection, time, clean)


class _ByRosbag2:
    """The writer of ROS, with the same methods."""

    def __init__(self, path: Path) -> None:
        import rosbag2_py
        self._writer = rosbag2_py.SequentialWriter()
        try:
            self._writer.open(rosbag2_py.StorageOptions(uri=str(path), storage_id='mcap'),
                              rosbag2_py.ConverterOptions('', ''))
        except RuntimeError as error:  # whatever rosbag2 raises
            raise OSError(f'{path}: {error}') from error
        self.close = self._writer.close
        self._count = 0

    def add_topic(self, topic: str, kind: str) -> None:
        import rosbag2_py
        self._writer.create_topic(rosbag2_py.TopicMetadata(
            id=self._count, name=topic, type=kind, serialization_format='cdr'))
        self._count += 1

    def write(self, topic: str, time: int, data: bytes) -> None:
        self._writer.write(topic, data, time)


_Writer: TypeAlias = _ByRosbags | _ByRosbag2

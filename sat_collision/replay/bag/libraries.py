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

"""
Reading and writing with libraries.

rosbag2_py of ROS reads what cannot be decompressed here; rosbags, else rosbag2_py, writes bags.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, TypeAlias

from sat_collision.replay.bag.storage import (
    Faults, in_rows, in_words, is_installed, Message, Row, Scratch, Storage)


class Rosbag2Storage(Storage):
    """
    A directory or storage file read with rosbag2_py, up to the first damage.

    Compressed files are copied, because rosbag2 would decompress them beside the originals.
    `packed` says that files or messages are compressed one by one.
    """

    def __init__(self, path: Path, faults: Faults, packed: bool, scratch: Scratch) -> None:
        super().__init__(faults)
        self._packed = packed
        self._path = path
        if any(file.suffix == '.zstd' for file in _files_of(path)):
            self._path = max(map(scratch.copy, _files_of(path))).parent
        try:
            metadata = self._opened().get_metadata()
        except RuntimeError as error:  # whatever rosbag2 raises
            faults.damaged(in_words(error))
            return
        for topic in metadata.topics_with_message_count:
            self.topics[topic.topic_metadata.name] = topic.topic_metadata.type
            self.counts[topic.topic_metadata.name] = topic.message_count
        if metadata.message_count:
            self.start = metadata.starting_time.nanoseconds
            self.end = self.start + metadata.duration.nanoseconds

    def rows(self, topics: Collection[str], start: int | None = None,
             stop: int | None = None) -> Iterator[Row]:
        return in_rows(self._read(topics, start, stop))

    def _read(self, topics: Collection[str], start: int | None,
              stop: int | None) -> Iterator[Message]:
        import rosbag2_py
        there = [topic for topic in topics if topic in self.topics]
        if not there:
            return
        try:
            reader = self._opened()
            reader.set_filter(rosbag2_py.StorageFilter(topics=there))
            while reader.has_next():
                topic, data, time = reader.read_next()
                if (start is None or time >= start) and (stop is None or time < stop):
                    yield topic, time, data
        except RuntimeError as error:
            self._faults.damaged(in_words(error))

    def _opened(self) -> Any:
        import rosbag2_py
        reader = (rosbag2_py.SequentialCompressionReader() if self._packed
                  else rosbag2_py.SequentialReader())
        storage = '' if self._path.is_dir() else (
            'mcap' if self._path.suffix == '.mcap' else 'sqlite3')
        reader.open(rosbag2_py.StorageOptions(uri=str(self._path), storage_id=storage),
                    rosbag2_py.ConverterOptions('', ''))
        return reader


def _files_of(path: Path) -> list[Path]:
    return [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]


def check_bag_writer() -> None:
    """Raise OSError if no library that writes bags is installed."""
    if not (is_installed('rosbags.rosbag2') or is_installed('rosbag2_py')):
        raise OSError('writing a bag needs rosbags (pip install rosbags) or rosbag2_py of ROS')


def new_bag(path: Path) -> BagWriter:
    """
    Return a writer of a new bag, of MCAP storage, in a directory that must not exist.

    Raises
    ------
    OSError
        If it exists, or cannot be made, or no library that writes bags is installed.

    """
    check_bag_writer()
    if path.exists():
        raise FileExistsError(f'{path} already exists')
    path.parent.mkdir(parents=True, exist_ok=True)
    return _ByRosbags(path) if is_installed('rosbags.rosbag2') else _ByRosbag2(path)


class _ByRosbags:
    """The writer of rosbags."""

    def __init__(self, path: Path) -> None:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from sat_collision.messages.rosbags_interfaces import STORE
        self._store = STORE
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections: dict[str, Any] = {}

    def add_topic(self, topic: str, kind: str) -> None:
        """Add a topic of a type such as std_msgs/msg/Bool."""
        self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)

    def write(self, topic: str, time: int, data: bytes) -> None:
        """Write a serialised message at a time in ns."""
        self._writer.write(self._connections[topic], time, data)

    def close(self) -> None:
        """Finish the bag."""
        self._writer.close()


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
        self._count = 0

    def add_topic(self, topic: str, kind: str) -> None:
        import rosbag2_py
        self._writer.create_topic(rosbag2_py.TopicMetadata(
            id=self._count, name=topic, type=kind, serialization_format='cdr'))
        self._count += 1

    def write(self, topic: str, time: int, data: bytes) -> None:
        self._writer.write(topic, data, time)

    def close(self) -> None:
        self._writer.close()


BagWriter: TypeAlias = _ByRosbags | _ByRosbag2

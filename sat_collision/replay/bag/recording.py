# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recordings: bags opened once for reading; damaged ones are read as far as possible."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
import hashlib
from pathlib import Path
import re
from typing import Any, NamedTuple
import zlib

from sat_collision.extras import in_one_line
from sat_collision.replay.bag.mcap import McapFile
from sat_collision.replay.bag.sqlite import SqliteFile
from sat_collision.replay.bag.storage import (
    check_libraries, Damage, Faults, in_time_order, is_installed, Limits, Message, Row, Scratch,
    Storage, unpacked, ZSTD_MAGIC)
import yaml

_STORAGE = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')
_ROS_1 = b'#ROSBAG V'
# Transient local, as rosbag2 names and numbers it.
_LATCHED = 'transient_local', 1


class Recording(Storage):
    """
    A rosbag2 recording: a directory with metadata.yaml, or one storage file.

    It is a context manager. A damaged recording is read as far as possible, and every fault of a
    file is recorded. Its content is compared with metadata.yaml. `latched` are the topics whose
    publishers were transient local, `shared` those with several publishers, and how many.
    """

    def __init__(self, path: str | Path, limits: Limits = Limits()) -> None:
        self.path = Path(path)
        super().__init__(Faults(self.path))
        self.latched: set[str] = set()
        self.shared: dict[str, int] = {}
        self._limits = limits
        self._scratch = Scratch(limits.disk)
        self._all_faults: list[Faults] = [self._faults]
        self._metadata: Metadata | None = None
        self._parts: list[Storage] = []
        self._sums: Counter[str] = Counter()

    def __enter__(self) -> Recording:
        try:
            files = self._find()
            known = list(self._all_faults)
            for file in files:
                self._open(file)
            try:
                check_libraries(self.compressions)
            except Damage as missing:
                self._all_faults[:] = known
                self._open_by_rosbag2(str(missing))
        except OSError as error:
            self._faults.damaged(in_one_line(error))
        self._compare(self.counts)
        return self

    def __exit__(self, *_: object) -> None:
        for part in self._parts:
            part.close()
        self._scratch.close()

    @property
    def problems(self) -> list[str]:
        """The faults found so far, in one line for each file."""
        return [str(faults) for faults in self._all_faults if faults]

    @property
    def content(self) -> str | None:
        """The digest of messages read to be digested, the same for any storage; None without."""
        if not self._sums:
            return None
        return hashlib.sha256(repr(sorted(self._sums.items())).encode()).hexdigest()[:16]

    def rows(self, topics: Collection[str], start: int | None = None,
             stop: int | None = None, is_digested: bool = False) -> Iterator[Row]:
        """Yield messages as any storage does; those digested are a part of `content`."""
        read: Counter[str] = Counter()
        unfit = 0
        for row in in_time_order(self._parts, topics, start, stop):
            topic, times, messages = row
            # A message in CDR is less, by its first byte.
            if max(messages) >= ZSTD_MAGIC:
                for k, data in enumerate(messages):
                    if data.startswith(ZSTD_MAGIC):
                        try:
                            messages[k] = unpacked(data, 'zstd', self._limits.chunk)
                        except Damage:
                            unfit += 1
                            messages[k] = b''
            read[topic] += len(messages)
            if is_digested:
                # Of the times the lowest 32 bits count.
                self._sums[topic] += sum(map(zlib.crc32, messages, times))
            yield row
        if unfit:
            self._faults.differs('unfit', f'{unfit} messages are compressed and damaged')
        if start is None and stop is None:
            self._compare({**self.counts, **{topic: read[topic] for topic in topics}})

    def _faults_of(self, file: Path) -> Faults:
        self._all_faults.append(Faults(file))
        return self._all_faults[-1]

    def _find(self) -> list[Path]:
        """Return the storage files."""
        if not self.path.exists():
            raise FileNotFoundError('no such file or directory')
        if not self.path.is_dir():
            return [self.path]
        present = sorted(
            (file for file in self.path.iterdir() if file.name.endswith(_STORAGE)),
            key=lambda file: [int(part) if part.isdecimal() else part
                              for part in re.split(r'(\d+)', file.name)])
        metadata = self.path / 'metadata.yaml'
        faults = self._faults_of(metadata)
        if not present and not metadata.exists():
            bags = [file.parent for pattern in ('*/metadata.yaml', '*/*.mcap', '*/*.db3')
                    for file in self.path.glob(pattern)]
            if bags:
                self._faults.damaged(
                    f'a folder of recordings; name each of them, such as {min(bags)}')
                return []
        try:
            self._metadata = read_metadata(metadata, self._limits.metadata)
        except FileNotFoundError:
            faults.damaged("is missing; 'ros2 bag reindex' restores it")
        except (Damage, OSError) as error:
            faults.damaged(in_one_line(error))
        if not self._metadata:
            if not present:
                self._faults.damaged('no .mcap or .db3 file in this directory')
            return present
        for topic, profiles in self._metadata.profiles:
            self._note_profiles(topic, profiles)
        if self._metadata.packed:
            self.compressions.add('zstd')
        total = sum(self._metadata.counts.values())
        if total != self._metadata.total:
            faults.differs('total', f'announces {self._metadata.total} messages in all, but '
                                    f'{total} by topic')
        listed = [self.path / name for name in self._metadata.files]
        files = [file for file in listed if file.exists()]
        if missing := [file.name for file in listed if file not in files]:
            self._faults.differs('missing', f'{", ".join(missing)} is missing')
        if more := [file.name for file in present if file not in listed]:
            self._faults.differs('more', f'metadata.yaml does not list {", ".join(more)}')
        # A file that was decompressed beside the listed one is not read again.
        names = {file.name.removesuffix('.zstd') for file in files}
        return files + [file for file in present if file.name.removesuffix('.zstd') not in names]

    def _open(self, file: Path) -> None:
        """Open a storage file; if it is compressed as a whole, decompress it first."""
        faults = self._faults_of(file)
        plain = file
        try:
            if file.suffix == '.zstd':
                self.compressions.add('zstd')
                plain, damage = self._scratch.unpack(file)
                if damage:
                    faults.damaged(in_one_line(damage))
            if not plain.is_file():
                raise Damage('not a file')
            with plain.open('rb') as opened:
                if opened.read(len(_ROS_1)) == _ROS_1:
                    raise Damage(f'a ROS 1 bag; convert it first: rosbags-convert --src {file} '
                                 f'--dst {file.with_suffix("")}')
            if plain.suffix not in ('.db3', '.mcap'):
                raise Damage('neither a .mcap nor a .db3 file')
        except (Damage, OSError) as error:
            faults.damaged(in_one_line(error))
            return
        self._add(McapFile(plain, faults, self._limits) if plain.suffix == '.mcap' else
                  SqliteFile(plain, faults, self._scratch, self._limits))

    def _open_by_rosbag2(self, missing: str) -> None:
        """Read all with rosbag2_py instead, as nothing else here can decompress it."""
        for part in self._parts:
            part.close()
        self._parts.clear()
        self.topics, self.counts, self.start, self.end = {}, Counter(), None, None
        by_one = bool(self._metadata and self._metadata.packed)
        if is_installed('rosbag2_py'):
            self._add(Rosbag2Storage(self.path, self._faults, by_one, self._scratch))
        else:
            self._faults.damaged(missing)
            self._metadata = None

    def _add(self, part: Storage) -> None:
        self._parts.append(part)
        for topic, kind in part.topics.items():
            self._add_topic(topic, kind)
        self.counts.update(part.counts)
        self.compressions |= part.compressions
        self._extend(part.start, part.end)
        for topic, profiles in part.profiles:
            if len(profiles) <= self._limits.metadata:
                self._note_profiles(topic, profiles)

    def _note_profiles(self, topic: str, profiles: Any) -> None:
        """Note the QoS profiles of a topic's publishers, a list or its YAML text."""
        if isinstance(profiles, str):
            try:
                profiles = yaml.load(profiles, _Loader)
            except Exception:  # as in read_metadata
                return
        if not isinstance(profiles, list):
            return
        if len(profiles) > 1:
            self.shared[topic] = len(profiles)
        if any(isinstance(one, dict) and one.get('durability') in _LATCHED for one in profiles):
            self.latched.add(topic)

    def _compare(self, found: Mapping[str, int]) -> None:
        """Compare numbers of messages with those in metadata.yaml."""
        if self._metadata:
            self._faults.compare(found, self._metadata.counts, 'metadata.yaml announces {2} '
                                 'messages of {0}, but {1} are there')


class Metadata(NamedTuple):
    """The content of metadata.yaml."""

    files: list[str]  # the names of the storage files, in their order
    counts: dict[str, int]  # of messages, by topic
    total: int
    profiles: list[tuple[str, Any]]  # the QoS profiles of publishers, by topic
    packed: bool  # whether files or messages are compressed one by one


class _Loader(yaml.SafeLoader):
    """Refuses merge keys, by which some lines would fill all memory."""

    def flatten_mapping(self, node: Any) -> None:
        """Leave them as they are: no constructor knows them."""


def read_metadata(path: Path, max_bytes: int) -> Metadata:
    """Read metadata.yaml; raise Damage if it is not valid, or larger than a number of bytes."""
    if path.stat().st_size > max_bytes:
        raise Damage(f'more than {max_bytes} bytes')
    if not path.is_file():
        raise Damage('not a file')
    data = path.read_bytes()
    try:
        content = yaml.load(data.decode(), _Loader)
    except Exception as error:  # whatever the constructors of YAML's types raise
        raise Damage(f'is not YAML: {in_one_line(error)}') from error
    information = _entry(content, 'rosbag2_bagfile_information', dict)
    files = _entry(information, 'relative_file_paths', list)
    if not all(isinstance(name, str) for name in files):
        raise Damage("has 'relative_file_paths' that are no texts")
    counts: dict[str, int] = {}
    profiles = []
    for topic in _entry(information, 'topics_with_message_count', list):
        described = _entry(topic, 'topic_metadata', dict)
        name = _entry(described, 'name', str)
        counts[name] = counts.get(name, 0) + _entry(topic, 'message_count', int)
        profiles.append((name, described.get('offered_qos_profiles')))
    return Metadata([Path(name).name for name in files], counts,
                    _entry(information, 'message_count', int), profiles,
                    bool(information.get('compression_mode')))


def _entry(content: Any, key: str, kind: type) -> Any:
    value = content.get(key) if isinstance(content, dict) else None
    if type(value) is not kind or isinstance(value, int) and not 0 <= value < 2**63:
        raise Damage(f"has no '{key}' of the right type where it belongs")
    return value


class Rosbag2Storage(Storage):
    """
    A directory or storage file read with rosbag2_py of ROS, up to the first damage.

    Compressed files are copied, because rosbag2 would decompress them beside the originals.
    `packed` says that files or messages are compressed one by one.
    """

    def __init__(self, path: Path, faults: Faults, packed: bool, scratch: Scratch) -> None:
        super().__init__(faults)
        self._packed = packed
        self._path = path
        files = [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]
        if any(file.suffix == '.zstd' for file in files):
            self._path = scratch.copy(*files)
        try:
            metadata = self._opened().get_metadata()
        except RuntimeError as error:  # whatever rosbag2 raises
            faults.damaged(in_one_line(error))
            return
        for topic in metadata.topics_with_message_count:
            self.topics[topic.topic_metadata.name] = topic.topic_metadata.type
            self.counts[topic.topic_metadata.name] = topic.message_count
        if metadata.message_count:
            self.start = metadata.starting_time.nanoseconds
            self.end = self.start + metadata.duration.nanoseconds

    def _messages(self, topics: Collection[str], start: int | None,
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
            self._faults.damaged(in_one_line(error))

    def _opened(self) -> Any:
        import rosbag2_py
        reader = (rosbag2_py.SequentialCompressionReader() if self._packed
                  else rosbag2_py.SequentialReader())
        storage = '' if self._path.is_dir() else (
            'mcap' if self._path.suffix == '.mcap' else 'sqlite3')
        reader.open(rosbag2_py.StorageOptions(uri=str(self._path), storage_id=storage),
                    rosbag2_py.ConverterOptions('', ''))
        return reader

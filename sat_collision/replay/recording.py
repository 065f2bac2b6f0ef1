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

"""Recordings: what rosbags reads of a bag, and of a damaged one what is left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
import re
import tempfile
from types import TracebackType
from typing import Protocol, TypeAlias

from rosbags.interfaces import Connection, ConnectionExtRosbag2, QosDurability
from rosbags.rosbag2 import Reader
from sat_collision.replay.recovery import Damage, recovered, unpack, WRONG_TYPES

Message: TypeAlias = tuple[str, int, bytes]  # topic, time in ns, data

_STORAGE = ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd')


class Recording:
    """
    A rosbag2 recording: a directory with metadata.yaml, or one storage file.

    What rosbags does not open is read file by file for as far as that goes, and every fault is
    noted, so that a damaged recording still tells what it can. To be used as a context manager.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    problems : list of str
        The faults found so far, each with the file that has it.
    topics, counts : dict
        Type and number of messages of each topic.
    latched : set of str
        Topics whose publishers had what they sent last delivered to who came later.
    start, end : int
        Times of the first and the last message in ns, None if there is none.

    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.problems: list[str] = []
        self.topics: dict[str, str] = {}
        self.counts: Counter[str] = Counter()
        self.latched: set[str] = set()
        self.start: int | None = None
        self.end: int | None = None
        self._parts: list[_Part] = []
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Recording:
        if not self.path.exists():
            self.problems.append(f'{self.path}: no such file or directory')
        elif not self._open(self.path):
            for file in self._files():
                plain = self._unpacked(file)
                if plain == self.path or not self._open(plain, shown=file):
                    self._add(_Recovered(plain, file, self.problems))
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        for part in self._parts:
            part.close()
        if self._folder:
            self._folder.cleanup()

    def messages(self, topics: Collection[str], start: int | None = None,
                 stop: int | None = None) -> Iterator[Message]:
        """
        Yield (topic, time in ns, data) of some topics, from start on and before stop (ns).

        A fault ends what can be read of its file, and is noted.
        """
        for part in self._parts:
            yield from part.messages(topics, start, stop)

    def _open(self, path: Path, shown: Path | None = None) -> bool:
        """Open with rosbags; return whether that went well, and note the fault if not."""
        try:
            self._add(_Whole(path, shown or path, self.problems))
        except Exception as error:  # rosbags raises anything for damaged files
            problem = f'{shown or path}: {_in_words(error)}'
            if (path / 'metadata.yaml').is_file() or not path.is_dir():
                self.problems.append(problem)
            else:
                self.problems.append(f'{path / "metadata.yaml"} is missing; '
                                     "'ros2 bag reindex' restores it")
            return False
        return True

    def _add(self, part: _Part) -> None:
        self._parts.append(part)
        self.topics = {**part.topics, **self.topics}
        self.counts += part.counts
        self.latched |= part.latched
        times = [time for time in (self.start, self.end, part.start, part.end) if time is not None]
        if times:
            self.start, self.end = min(times), max(times)

    def _files(self) -> list[Path]:
        """Return the storage files that are there, in the order in which they were written."""
        if not self.path.is_dir():
            return [self.path]
        files = [file for file in self.path.iterdir() if file.name.endswith(_STORAGE)]
        if not files:
            self.problems.append(f'{self.path}: no .mcap or .db3 file in this directory')
        return sorted(files, key=lambda file: [int(part) if part.isdigit() else part
                                               for part in re.split(r'(\d+)', file.name)])

    def _unpacked(self, file: Path) -> Path:
        """Return a storage file itself or, compressed as a whole, what it holds."""
        if file.suffix != '.zstd':
            return file
        self._folder = self._folder or tempfile.TemporaryDirectory(prefix='replay_check_')
        plain = Path(self._folder.name, file.stem)
        try:
            unpack(file, plain)
        except Damage as damage:
            self.problems.append(f'{file}: {_in_words(damage)}')
        return plain


class _Part(Protocol):
    """What a recording is read from; the attributes are those of Recording."""

    topics: dict[str, str]
    counts: Counter[str]
    latched: set[str]
    start: int | None
    end: int | None

    def close(self) -> None:
        ...

    def messages(self, topics: Collection[str], start: int | None,
                 stop: int | None) -> Iterator[Message]:
        ...


class _Whole:
    """What rosbags opens: a bag or a storage file."""

    def __init__(self, path: Path, shown: Path, problems: list[str]) -> None:
        self._shown = shown
        self._problems = problems
        self._reader = Reader(path)
        self._reader.open()
        self.topics = {connection.topic: connection.msgtype
                       for connection in self._reader.connections}
        self.counts: Counter[str] = Counter()
        for connection in self._reader.connections:
            self.counts[connection.topic] += connection.msgcount
        self.latched = {connection.topic for connection in self._reader.connections
                        if _is_latched(connection)}
        empty = not self._reader.message_count
        self.start = None if empty else self._reader.start_time
        self.end = None if empty else self._reader.end_time - 1

    def close(self) -> None:
        self._reader.close()

    def messages(self, topics: Collection[str], start: int | None,
                 stop: int | None) -> Iterator[Message]:
        connections = [connection for connection in self._reader.connections
                       if connection.topic in topics]
        if not connections:
            return
        try:
            for connection, time, data in self._reader.messages(connections, start, stop):
                # SQLite's rows have no types, so damage may make anything of them.
                if not (isinstance(time, int) and isinstance(data, bytes)):
                    raise TypeError(WRONG_TYPES)
                yield connection.topic, time, data
        except Exception as error:  # as above
            self._problems.append(
                f'{self._shown}: could not be read to its end: {_in_words(error)}')


class _Recovered:
    """A storage file that rosbags does not open."""

    def __init__(self, path: Path, shown: Path, problems: list[str]) -> None:
        self._path = path
        self.topics: dict[str, str] = {}
        self.counts: Counter[str] = Counter()
        self.latched: set[str] = set()
        self.start: int | None = None
        self.end: int | None = None
        try:
            for topic, kind, time, _ in recovered(path):
                self.topics[topic] = kind
                self.counts[topic] += 1
                self.start = time if self.start is None else min(time, self.start)
                self.end = time if self.end is None else max(time, self.end)
        except Damage as damage:
            problems.append(f'{shown}: {damage}')
        except OSError as error:
            problems.append(f'{shown}: {_in_words(error)}')

    def close(self) -> None:
        pass

    def messages(self, topics: Collection[str], start: int | None,
                 stop: int | None) -> Iterator[Message]:
        try:
            for topic, _, time, data in recovered(self._path):
                if topic in topics and (start is None or time >= start) and (
                        stop is None or time < stop):
                    yield topic, time, data
        except (Damage, OSError):
            return  # noted when the file was first read


def _is_latched(connection: Connection) -> bool:
    """Tell whether a publisher of a topic had what it sent last delivered to late joiners."""
    offered = connection.ext
    return isinstance(offered, ConnectionExtRosbag2) and any(
        qos.durability is QosDurability.TRANSIENT_LOCAL for qos in offered.offered_qos_profiles)


def _in_words(error: Exception) -> str:
    """Return what an exception says, or its kind if it says nothing."""
    return ' '.join(str(error).split()) or type(error).__name__

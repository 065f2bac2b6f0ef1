# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Common to the readers: faults, and decompression within limits of memory and disk."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush
from importlib.util import find_spec
from math import inf
from pathlib import Path
import sys
import tempfile
from typing import Any, BinaryIO, TypeAlias

from sat_collision.extras import in_one_line, printable

Message: TypeAlias = tuple[str, int, bytes]  # topic, time in ns, data
# Consecutive messages of one topic: the topic, their times in ns, which do not fall, their data.
Row: TypeAlias = tuple[str, list[int], list[bytes]]

# Max messages in a row, all of which are in memory.
LONGEST_ROW = 128

EMPTY = ('the file is empty: nothing was recorded, or it was not copied whole; record or copy it '
         'again')
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_PIECE = 2**20
_LIBRARIES = {'zstd': 'backports.zstd', 'lz4': 'lz4'}
# Max differences reported for a file, and max characters about all its faults.
_MAX_DIFFERENCES = 3
_MAX_CHARACTERS = 1000


def is_installed(library: str) -> bool:
    """Return whether a library can be imported; a folder of the same name does not count."""
    try:
        spec = find_spec(library)
    except ModuleNotFoundError:  # its parent package
        return False
    return spec is not None and spec.origin is not None


def check_bag_writer() -> None:
    """Raise OSError if no library that writes bags is installed."""
    if not (is_installed('rosbags.rosbag2') or is_installed('rosbag2_py')):
        raise OSError('writing a bag needs rosbags (pip install rosbags) or rosbag2_py of ROS')


class Faults:
    """The faults of one file: places that are damaged, and numbers that differ."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._first = ''
        self._places: set[int] = set()  # hashes of descriptions
        self._differences: dict[object, str] = {}

    def damaged(self, where: str) -> None:
        """Record a damaged place, once; only the first one is described."""
        self._first = self._first or where
        self._places.add(hash(where))

    def differs(self, about: object, words: str) -> None:
        """Record that two things differ, once for each subject."""
        self._differences.setdefault(about, words)

    def compare(self, found: Mapping[Any, int], announced: Mapping[Any, int], words: str,
                names: Mapping[Any, str] = {}) -> None:
        """Record which numbers differ; the words have places for a name and for both numbers."""
        for key in sorted(found.keys() | announced.keys()):
            numbers = found.get(key, 0), announced.get(key, 0)
            if numbers[0] != numbers[1]:
                self.differs(('count', key), words.format(names.get(key, key), *numbers))

    def unknown(self, what: str, counts: Mapping[Any, int]) -> None:
        """Record the messages of topics or channels that are not announced, if any."""
        if counts:
            listed = ', '.join(str(key)[:20] for key in sorted(counts, key=str)[:3])
            self.differs('unknown',
                         f'{sum(counts.values())} messages of unknown {what} ({listed})')

    def __bool__(self) -> bool:
        return bool(self._first or self._differences)

    def __str__(self) -> str:
        more = f', and in {len(self._places) - 1} more places' if len(self._places) > 1 else ''
        differences = list(self._differences.values())
        parts = [self._first + more] * bool(self._first) + differences[:_MAX_DIFFERENCES]
        if differences[_MAX_DIFFERENCES:]:
            parts.append(f'and {len(differences) - _MAX_DIFFERENCES} more differences')
        # Names of topics come from the file, and may be anything.
        return f'{self._file}: {printable("; ".join(parts))[:_MAX_CHARACTERS]}'


class Damage(Exception):
    """Something cannot be read; the message says what is wrong."""


class Storage:
    """The content of a recording, or of one file of it; times in ns."""

    def __init__(self, faults: Faults) -> None:
        self.topics: dict[str, str] = {}  # types by name
        self.counts: Counter[str] = Counter()  # numbers of messages by topic
        # QoS profiles of publishers, in YAML: (topic, profiles).
        self.profiles: set[tuple[str, str]] = set()
        self.compressions: set[str] = set()
        self.start: int | None = None  # times of the first and the last message
        self.end: int | None = None
        self._faults = faults

    def rows(self, topics: Collection[str], start: int | None = None,
             stop: int | None = None) -> Iterator[Row]:
        """Yield the messages of some topics, from start on and before stop (ns)."""
        return in_rows(self._messages(topics, start, stop))

    def _messages(self, topics: Collection[str], start: int | None,
                  stop: int | None) -> Iterator[Message]:
        """Yield them one by one, where a storage does not have `rows` of its own."""
        raise NotImplementedError

    def close(self) -> None:
        """Close open files."""

    def _add_topic(self, topic: str, kind: str) -> None:
        if self.topics.setdefault(topic, kind) != kind:
            self._faults.differs(('type', topic),
                                 f'{topic} has the types {self.topics[topic]} and {kind}')

    def _extend(self, *times: int | None) -> None:
        """Extend start and end to include some times."""
        known = [time for time in (self.start, self.end, *times) if time is not None]
        if known:
            self.start, self.end = min(known), max(known)


def in_rows(messages: Iterable[Message]) -> Iterator[Row]:
    """Yield messages in rows, in the same order."""
    row: Row = '', [], []
    for topic, time, data in messages:
        last_topic, times, row_data = row
        if topic != last_topic or time < times[-1] or len(times) == LONGEST_ROW:
            if times:
                yield row
            row = topic, [time], [data]
        else:
            times.append(time)
            row_data.append(data)
    if row[1]:
        yield row


def in_time_order(files: Iterable[Storage], topics: Collection[str], start: int | None = None,
                  stop: int | None = None) -> Iterator[Row]:
    """
    Yield the rows of files in the order of time; of messages of one time those of earlier files.

    A file is read from where it begins on: of files that follow one another only one is in memory.
    """
    ordered = sorted(files, key=lambda file: file.start or 0)
    # The next time of each file, its number, its next row (empty before it begins), those after.
    heads: list[tuple[int, int, Row, Iterator[Row]]] = [
        (file.start or 0, number, ('', [], []), file.rows(topics, start, stop))
        for number, file in enumerate(ordered)]
    while heads:
        _, number, (topic, times, messages), rows = heappop(heads)
        limit, other = heads[0][:2] if heads else (inf, 0)
        end = (bisect_right if number < other else bisect_left)(times, limit)
        if end:
            yield topic, times[:end], messages[:end]
        if not heads:
            yield from rows
        elif end < len(times):
            heappush(heads, (times[end], number, (topic, times[end:], messages[end:]), rows))
        elif row := next(rows, None):
            heappush(heads, (row[1][0], number, row, rows))


@dataclass(frozen=True)
class Limits:
    """How much memory and disk a recording may take, in bytes."""

    memory: int = 2 * 10**9  # for decompressed data and indexes, without what Python itself takes
    disk: int = 4 * 10**9  # for decompressed storage files, and copies to be repaired

    @property
    def chunk(self) -> int:
        """Max bytes that are decompressed at a time."""
        # A message takes at least 31 bytes of a chunk, and about 200 as an entry of a list.
        return self.memory // 8

    @property
    def metadata(self) -> int:
        """Max bytes of a text in YAML."""
        return self.memory // 100


def unpacked(packed: bytes, compression: str, max_bytes: int) -> bytes:
    """Decompress data from 'zstd', 'lz4' or '' (none); Damage says what is wrong with them."""
    if not compression:
        return packed
    if compression not in _LIBRARIES:
        raise Damage(f"unknown compression '{compression}'")
    library = _library(compression)
    errors = RuntimeError, EOFError, getattr(library, 'ZstdError', RuntimeError)
    decompressor = (library.ZstdDecompressor if compression == 'zstd'
                    else library.LZ4FrameDecompressor)()
    try:
        content: bytes = decompressor.decompress(packed, max_length=max_bytes + 1)
    except errors as error:
        raise Damage(in_one_line(error)) from error
    if len(content) > max_bytes:
        raise Damage(f'it holds more than {max_bytes} bytes')
    if not decompressor.eof:
        raise Damage('compressed data that is cut off')
    return content


def check_libraries(compressions: set[str]) -> None:
    """Raise Damage if a library for some compressions is missing."""
    for compression in compressions & _LIBRARIES.keys():  # others are reported when read
        _library(compression)


def _library(compression: str) -> Any:
    """Return the module for a compression; raise Damage if it is not installed."""
    try:
        if compression == 'lz4':
            from lz4 import frame
            return frame
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
        return zstd
    except ImportError as error:
        name = _LIBRARIES[compression]
        raise Damage(f'it is compressed: unpacking {compression} needs {name} '
                     f'(pip install {name}) or rosbag2_py of ROS') from error


class Scratch:
    """A folder for temporary files, of at most `max_bytes` in all."""

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = self._left = max_bytes
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def close(self) -> None:
        """Remove the files."""
        if self._folder:
            self._folder.cleanup()

    def copy(self, *files: Path) -> Path:
        """Copy files to a new folder, and return it; raise Damage if they are too large."""
        folder = Path(tempfile.mkdtemp(dir=self._root))
        for file in files:
            with file.open('rb') as source:
                self._write(source, folder / file.name)
        return folder

    def unpack(self, packed: Path) -> tuple[Path, Damage | None]:
        """Decompress a zstd file; return the new file, and what is wrong if it is incomplete."""
        plain = self._root / packed.stem
        zstd = _library('zstd')
        try:
            with zstd.open(packed, 'rb') as source:
                self._write(source, plain)
        except (EOFError, zstd.ZstdError, Damage) as error:
            return plain, Damage(in_one_line(error))
        return plain, None

    @property
    def _root(self) -> Path:
        self._folder = self._folder or tempfile.TemporaryDirectory(prefix='replay_check_')
        return Path(self._folder.name)

    def _write(self, source: BinaryIO, path: Path) -> None:
        with path.open('wb') as target:
            while piece := source.read(_PIECE):
                if len(piece) > self._left:
                    raise Damage('temporary files would take more than '
                                 f'{self._max_bytes / 1e9:g} GB: allow more with --max-disk')
                self._left -= target.write(piece)

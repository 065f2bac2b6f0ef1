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

"""The records of an MCAP file: https://mcap.dev/spec."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
import os
import struct
from typing import NamedTuple
import zlib

from sat_collision.replay.faults import Faults
from sat_collision.replay.unpacking import Damage

MESSAGE = 5
MESSAGE_HEAD = struct.Struct('<HIQQ')
RECORD_HEAD = struct.Struct('<BQ')
SCHEMA, CHANNEL = 3, 4

_MAGIC = b'\x89MCAP0\r\n'
_FOOTER_KIND, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX, _STATISTICS, _DATA_END = 2, 6, 7, 8, 11, 15
_NAMES = {SCHEMA: 'schema', CHANNEL: 'channel', MESSAGE: 'message', _CHUNK: 'chunk',
          _MESSAGE_INDEX: 'index', _CHUNK_INDEX: 'index', _STATISTICS: 'statistics'}
_CHUNK_HEAD = struct.Struct('<QQQI')
_FOOTER = struct.Struct('<BQQQI')
_FOOTER_SIZE = _FOOTER.size + len(_MAGIC)
_LONGEST_RUN = 2**20
# About what an entry of a list or dict takes.
_ENTRY = 400


class Block(NamedTuple):
    """
    Messages that lie together: a chunk, or a run of them outside of any.

    `first` and `last` are the times of messages in ns that it announces, `at` and `size` say
    where its bytes are, `plain` how many these hold; `announced` is the number of messages that
    are indexed, None without an index.
    """

    first: int
    last: int
    where: int
    at: int
    size: int
    compression: str
    plain: int
    checksum: int
    announced: int | None = None


class Layout:
    """
    Where the messages of an MCAP file are, and what it announces of them.

    Parameters
    ----------
    file : int
        A file descriptor.
    faults : Faults
        Takes what is wrong.
    most : int
        So large may a record be that is read as a whole, in bytes.

    Attributes
    ----------
    blocks : list of Block
        In the order of the file.
    schemas : dict
        Type by id.
    channels : dict
        Topic and id of the schema by id.
    indexed : Counter
        Number of messages in the indexes of chunks, by channel.
    statistics : Counter or None
        Number of messages that the summary announces, by channel.
    channel_count : int
        Announced number of channels.

    """

    def __init__(self, file: int, faults: Faults, most: int) -> None:
        self._file = file
        self._faults = faults
        self._most = most
        self._left = 4 * most
        self._size = os.fstat(file).st_size
        self._chunks: dict[int, tuple[int, int]] = {}
        self._ends = False
        self.blocks: list[Block] = []
        self.schemas: dict[int, str] = {0: ''}
        self.channels: dict[int, tuple[str, int]] = {}
        self.indexed: Counter[int] = Counter()
        self.statistics: Counter[int] | None = None
        self.channel_count = 0
        if self.read(0, len(_MAGIC)) != _MAGIC:
            raise Damage('this is not an MCAP file')
        self._walk_summary()
        self._walk_data()

    def read(self, at: int, size: int) -> bytes:
        """Return bytes of the file."""
        if size > self._most:
            raise Damage(f'{size} bytes at once: allow more with --max-memory')
        data = os.pread(self._file, size, at)
        if len(data) < size:
            raise Damage(f'{size} bytes announced, {len(data)} left')
        return data

    def define(self, kind: int, content: bytes, where: int) -> None:
        """Take a schema or channel, which may be repeated but not changed."""
        try:
            key, = struct.unpack_from('<H', content)
            if kind == SCHEMA:
                name, _ = text(content, 2)
                known = self.schemas.setdefault(key, name)
                said = f'schema {key} is {known} and {name}'
            else:
                schema, = struct.unpack_from('<H', content, 2)
                topic, _ = text(content, 4)
                # Not only the topic: with another schema it has another type.
                known, name = str(self.channels.setdefault(key, (topic, schema))), str(
                    (topic, schema))
                said = f'channel {key} is {self.channels[key][0]} and {topic}'
        except (struct.error, ValueError):
            self._faults.damaged(f'damaged at byte {where}: invalid {_NAMES[kind]} record')
            return
        if known != name:
            self._faults.differs((kind, key), said)

    def _walk_summary(self) -> None:
        """Read what is behind the data, if the end of the file says that there is something."""
        try:
            footer = self.read(max(self._size - _FOOTER_SIZE, 0), _FOOTER_SIZE)
            kind, size, start, _, checksum = _FOOTER.unpack_from(footer)
            self._ends = (kind, size, footer[-len(_MAGIC):]) == (_FOOTER_KIND, 20, _MAGIC)
            if not self._ends:
                raise Damage('it is missing')
            if not start:
                return
            if start > self._size:
                raise Damage(f'it is said to begin at byte {start} of {self._size}')
            summary = self.read(start, max(self._size - len(_MAGIC) - 4 - start, 0))
            if checksum and zlib.crc32(summary) != checksum:
                self._faults.damaged('damaged in its summary: its checksum is wrong')
            for where, kind, size in self._framed(start, self._size - _FOOTER_SIZE):
                if kind in (SCHEMA, CHANNEL, _CHUNK_INDEX, _STATISTICS):
                    self._take(where, kind, self.read(where + RECORD_HEAD.size, size))
        except Damage as damage:
            self._faults.damaged(f'damaged at its end: {damage}')

    def _walk_data(self) -> None:
        """Find the blocks; behind a damaged place go on at the next chunk that is indexed."""
        where = len(_MAGIC)
        lost: set[int] = set()
        while True:
            try:
                for where, kind, size in self._framed(where, self._size):
                    if kind == _DATA_END:
                        break
                    self._visit(where, kind, size)
                else:
                    if self._ends:
                        self._faults.damaged('damaged at the end of its data, which is missing')
            except _Misplaced as damage:
                self._faults.damaged(f'damaged at byte {damage.where}: {damage}')
                lost.add(damage.where)
                where = min((at for at in self._chunks if at > damage.where), default=0)
                if where:
                    continue
            break
        found = {block.where: (block.first, block.last) for block in self.blocks}
        for where, times in self._chunks.items():
            if where not in lost and found.get(where) != times:
                self._faults.damaged(f'damaged at byte {where}: not the chunk that is indexed')

    def _framed(self, where: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield (place, kind, size of the content) of the records that follow one another."""
        while where < end:
            head = os.pread(self._file, RECORD_HEAD.size, where)
            if len(head) < RECORD_HEAD.size:
                raise _Misplaced(where, 'the head of a record is cut off')
            kind, size = RECORD_HEAD.unpack(head)
            left = end - where - RECORD_HEAD.size
            if not kind:
                raise _Misplaced(where, 'no record')
            if size > left:
                raise _Misplaced(where, f'{size} bytes announced, {left} left')
            yield where, kind, size
            where += RECORD_HEAD.size + size

    def _visit(self, where: int, kind: int, size: int) -> None:
        """Take a record of the data."""
        at = where + RECORD_HEAD.size
        try:
            if kind == MESSAGE:
                self._add_to_run(where, self.read(at, min(size, MESSAGE_HEAD.size)), size)
            elif kind == _CHUNK:
                self._account()
                head = self.read(at, min(size, 64))
                first, last, plain, checksum = _CHUNK_HEAD.unpack_from(head)
                compression, begin = text(head, _CHUNK_HEAD.size)
                packed, = struct.unpack_from('<Q', head, begin)
                if packed != size - begin - 8:
                    raise ValueError
                self.blocks.append(Block(first, last, where, at + begin + 8, packed, compression,
                                         plain, checksum))
            elif kind == _MESSAGE_INDEX:
                channel, length = struct.unpack('<HI', self.read(at, 6))
                if not self.blocks or length != size - 6:
                    raise ValueError
                block = self.blocks[-1]
                self.blocks[-1] = block._replace(announced=(block.announced or 0) + length // 16)
                self.indexed[channel] += length // 16
            elif kind in (SCHEMA, CHANNEL):
                self.define(kind, self.read(at, size), where)
        except (struct.error, ValueError, Damage):
            self._faults.damaged(f'damaged at byte {where}: invalid {_NAMES[kind]} record')

    def _take(self, where: int, kind: int, content: bytes) -> None:
        """Take a record of the summary."""
        try:
            if kind == _CHUNK_INDEX:
                self._account()
                first, last, begin = struct.unpack_from('<QQQ', content)
                self._chunks[begin] = first, last
            elif kind == _STATISTICS:
                self.channel_count, = struct.unpack_from('<I', content, 10)
                length, = struct.unpack_from('<I', content, 42)
                pairs = struct.iter_unpack('<HQ', content[46:46 + length])
                self.statistics = Counter(dict(pairs))
            else:
                self.define(kind, content, where)
        except struct.error:
            self._faults.damaged(f'damaged at byte {where}: invalid {_NAMES[kind]} record')

    def _add_to_run(self, where: int, head: bytes, size: int) -> None:
        """Take a message outside of chunks: it lengthens the run that it follows."""
        _, _, time, _ = MESSAGE_HEAD.unpack(head)
        run = self.blocks[-1] if self.blocks else None
        whole = RECORD_HEAD.size + size
        if run and not run.where and run.at + run.size == where and run.size < _LONGEST_RUN:
            self.blocks[-1] = run._replace(
                first=min(run.first, time), last=max(run.last, time), size=run.size + whole,
                plain=run.plain + whole)
        else:
            self._account()
            self.blocks.append(Block(time, time, 0, where, whole, '', whole, 0))

    def _account(self) -> None:
        """Keep what is kept of the file within the limit."""
        self._left -= _ENTRY
        if self._left < 0:
            raise Damage('too many chunks for --max-memory')


class _Misplaced(Damage):
    """Damage from which on records cannot be followed."""

    def __init__(self, where: int, words: str) -> None:
        super().__init__(words)
        self.where = where


def text(content: bytes, at: int) -> tuple[str, int]:
    """Return a string and where it ends."""
    size, = struct.unpack_from('<I', content, at)
    end = at + 4 + size
    if end > len(content):
        raise ValueError(f'a text of {size} bytes in a record of {len(content)}')
    return content[at + 4:end].decode(), end

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

"""MCAP storage files, whole or not, in the order of time; the format: https://mcap.dev/spec."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator
from operator import itemgetter
import os
from pathlib import Path
import struct
from typing import NamedTuple, TypeAlias
import zlib

from sat_collision.replay.bag.storage import Damage, Faults, in_words, Limits, Message, unpacked

_MESSAGE = 5
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_MESSAGE_RECORD = struct.Struct('<BQHIQQ')
_RECORD_HEAD = struct.Struct('<BQ')
_SCHEMA, _CHANNEL = 3, 4

_MAGIC = b'\x89MCAP0\r\n'
_FOOTER_KIND, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX, _STATISTICS, _DATA_END = 2, 6, 7, 8, 11, 15
_NAMES = {_SCHEMA: 'schema', _CHANNEL: 'channel', _MESSAGE: 'message', _CHUNK: 'chunk',
          _MESSAGE_INDEX: 'index', _CHUNK_INDEX: 'index', _STATISTICS: 'statistics'}
_CHUNK_HEAD = struct.Struct('<QQQI')
_FOOTER = struct.Struct('<BQQQI')
_FOOTER_SIZE = _FOOTER.size + len(_MAGIC)
_LONGEST_RUN = 2**20
_PIECE = 2**20
# About what an entry of a list or dict takes.
_ENTRY = 400
# Time in ns, block, where its data begins and ends in the block, channel, bytes of the block.
_Entry: TypeAlias = tuple[int, int, int, int, int, bytes]
_channel_of = itemgetter(4)


class McapFile:
    """
    An MCAP file.

    Chunks that cannot be unpacked or have a wrong checksum are left out, so that no coordinates
    are made up of damaged bytes. What was read is compared with what indexes and statistics
    announce. The attributes are those of `Recording`.

    Parameters
    ----------
    path : Path
    faults : Faults
        Takes what is wrong with it.
    limits : Limits

    """

    def __init__(self, path: Path, faults: Faults, limits: Limits) -> None:
        self._faults = faults
        self._limits = limits
        self._file: int | None = None
        self._layout: Layout | None = None
        self._surveyed = False
        self.topics: dict[str, str] = {}
        self.counts: Counter[str] = Counter()
        self.start: int | None = None
        self.end: int | None = None
        try:
            self._file = os.open(path, os.O_RDONLY)
            self._layout = layout = Layout(self._file, faults, limits.chunk)
        except (OSError, Damage) as error:
            faults.damaged(in_words(error))
            return
        counts = layout.statistics
        self._surveyed = counts is None or len(layout.channels) < layout.channel_count or any(
            schema not in layout.schemas for _, schema in layout.channels.values())
        if self._surveyed:
            counts = self._survey(layout)
        assert counts is not None
        for channel, (topic, schema) in layout.channels.items():
            kind = layout.schemas.get(schema, '')
            self.counts[topic] += counts[channel]
            if self.topics.setdefault(topic, kind) != kind:
                faults.differs(('type', topic),
                               f'{topic} has the types {self.topics[topic]} and {kind}')
        unknown = {channel: count for channel, count in counts.items()
                   if count and channel not in layout.channels}
        if unknown:
            listed = ', '.join(map(str, sorted(unknown)[:3]))
            faults.differs('unknown', f'{sum(unknown.values())} messages of unknown channels '
                                      f'({listed})')
        self._compare_indexes(layout)
        times = [time for block in layout.blocks if block.first <= block.last
                 for time in (block.first, block.last) if time]
        if times and self.start is None:
            self.start, self.end = min(times), max(times)

    @property
    def compressions(self) -> set[str]:
        """How chunks are compressed."""
        blocks = self._layout.blocks if self._layout else []
        return {block.compression for block in blocks} - {''}

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def messages(self, topics: Collection[str], start: int | None,
                 stop: int | None) -> Iterator[Message]:
        """Yield (topic, time in ns, data) of some topics, from start on and before stop (ns)."""
        layout = self._layout
        if layout is None:
            return
        # Faults have been recorded already where all was read before.
        faults = Faults(Path()) if self._surveyed else self._faults
        wanted = {channel: topic for channel, (topic, _) in layout.channels.items()
                  if topic in topics}
        first = 0 if start is None else start
        last = 2**64 if stop is None else stop
        blocks = sorted(block for block in layout.blocks
                        if block.last >= first and block.first < last or not block.last)
        pending: list[_Entry] = []
        read: Counter[int] = Counter()
        for number, block in enumerate(blocks):
            held = {entry[1]: len(entry[5]) for entry in pending}
            loaded = self._load(block, number, sum(held.values()), faults)
            read.update(map(_channel_of, loaded))
            pending += [entry for entry in loaded
                        if entry[4] in wanted and first <= entry[0] < last]
            pending.sort()
            until = blocks[number + 1].first if number + 1 < len(blocks) else 2**64
            ready = bisect_left(pending, (until,))
            for time, _, begin, end, channel, content in pending[:ready]:
                yield wanted[channel], time, content[begin:end]
            del pending[:ready]
        if start is None and stop is None and layout.statistics is not None:
            self._compare_statistics(read, layout.statistics, layout)

    def _survey(self, layout: Layout) -> Counter[int]:
        """Read all, of a file without a summary; return the counts by channel."""
        found: Counter[int] = Counter()
        for number, block in enumerate(layout.blocks):
            loaded = self._load(block, number, 0, self._faults)
            found.update(map(_channel_of, loaded))
            for time, *_ in loaded[:1] + loaded[-1:]:
                self.start = time if self.start is None else min(time, self.start)
                self.end = time if self.end is None else max(time, self.end)
        if layout.statistics is not None:
            self._compare_statistics(found, layout.statistics, layout)
        return found

    def _load(self, block: Block, number: int, held: int, faults: Faults) -> list[_Entry]:
        """Return the messages of a block, recording its faults."""
        assert self._layout
        entries: list[_Entry] = []
        try:
            self._fill(entries, block, number, held)
        except Damage as damage:
            faults.damaged(f'damaged in the chunk at byte {block.where or block.at}: {damage}')
            if not entries:
                return entries
        if block.announced not in (None, len(entries)):
            faults.damaged(f'damaged in the chunk at byte {block.where}: {len(entries)} messages, '
                           f'but its index has {block.announced}')
        entries.sort()
        if entries and not (block.first <= entries[0][0] and entries[-1][0] <= block.last):
            faults.damaged(f'damaged in the chunk at byte {block.where}: it has messages of '
                           'another time than it announces')
        return entries

    def _fill(self, entries: list[_Entry], block: Block, number: int, held: int) -> None:
        """Add the messages of a block up to any damage."""
        content = self._content(block, held)
        assert self._layout
        at, end = 0, len(content)
        whole = end - _MESSAGE_RECORD.size
        unpack, append = _MESSAGE_RECORD.unpack_from, entries.append
        while at < end:
            if at <= whole:
                kind, size, channel, _, time, _ = unpack(content, at)
                behind = at + _RECORD_HEAD.size + size
                if kind == _MESSAGE and size >= _MESSAGE_HEAD.size and behind <= end:
                    append((time, number, at + _MESSAGE_RECORD.size, behind, channel, content))
                    at = behind
                    continue
            if end - at < _RECORD_HEAD.size:
                raise Damage('the head of a record is cut off')
            kind, size = _RECORD_HEAD.unpack_from(content, at)
            at += _RECORD_HEAD.size
            if not kind or size > end - at:
                raise Damage(f'{size} bytes announced, {end - at} left' if kind else 'no record')
            if kind == _MESSAGE:
                raise Damage('invalid message record')
            if kind in (_SCHEMA, _CHANNEL):
                self._layout.define(kind, content[at:at + size], block.where)
            at += size

    def _content(self, block: Block, held: int) -> bytes:
        assert self._layout
        if block.plain + held > self._limits.chunk:
            raise Damage(f'{block.plain + held} bytes at once: allow more with --max-memory')
        content = unpacked(self._layout.read(block.at, block.size), block.compression,
                           block.plain)
        if len(content) != block.plain:
            raise Damage(f'{block.plain} bytes announced, it holds {len(content)}')
        if block.checksum and zlib.crc32(content) != block.checksum:
            raise Damage('its checksum is wrong')
        return content

    def _compare_indexes(self, layout: Layout) -> None:
        """Compare the numbers of statistics and indexes, if there are any of both."""
        if layout.indexed and layout.statistics is not None:
            self._compare(layout.indexed, layout.statistics, layout, 'are indexed')

    def _compare_statistics(self, read: Counter[int], statistics: Counter[int],
                            layout: Layout) -> None:
        self._compare(read, statistics, layout, 'can be read')

    def _compare(self, found: Counter[int], announced: Counter[int], layout: Layout,
                 how: str) -> None:
        for channel in sorted(found.keys() | announced.keys()):
            if found[channel] != announced[channel]:
                topic, _ = layout.channels.get(channel, (f'channel {channel}', 0))
                self._faults.differs(channel, f'{found[channel]} messages of {topic} {how}, but '
                                              f'its statistics announce {announced[channel]}')


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
        The largest record that is read as a whole, in bytes.

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
            if kind == _SCHEMA:
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
        """Read the summary behind the data, if the end of the file announces one."""
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
                if kind in (_SCHEMA, _CHANNEL, _CHUNK_INDEX, _STATISTICS):
                    self._take(where, kind, self.read(where + _RECORD_HEAD.size, size))
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
                        self._check_data(where, size)
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

    def _check_data(self, where: int, size: int) -> None:
        """Compare all that precedes the end of the data with the checksum given there, if any."""
        checksum = found = 0
        if size >= 4:
            checksum, = struct.unpack('<I', self.read(where + _RECORD_HEAD.size, 4))
        if checksum:
            for at in range(0, where, _PIECE):
                found = zlib.crc32(os.pread(self._file, min(_PIECE, where - at), at), found)
        if found != checksum:
            self._faults.damaged('damaged in its data: its checksum (data_section_crc) is wrong')

    def _framed(self, where: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield (place, kind, size of the content) of the records that follow one another."""
        while where < end:
            head = os.pread(self._file, _RECORD_HEAD.size, where)
            if len(head) < _RECORD_HEAD.size:
                raise _Misplaced(where, 'the head of a record is cut off')
            kind, size = _RECORD_HEAD.unpack(head)
            left = end - where - _RECORD_HEAD.size
            if not kind:
                raise _Misplaced(where, 'no record')
            if size > left:
                raise _Misplaced(where, f'{size} bytes announced, {left} left')
            yield where, kind, size
            where += _RECORD_HEAD.size + size

    def _visit(self, where: int, kind: int, size: int) -> None:
        """Take a record of the data."""
        at = where + _RECORD_HEAD.size
        try:
            if kind == _MESSAGE:
                self._add_to_run(where, self.read(at, min(size, _MESSAGE_HEAD.size)), size)
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
            elif kind in (_SCHEMA, _CHANNEL):
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
        _, _, time, _ = _MESSAGE_HEAD.unpack(head)
        run = self.blocks[-1] if self.blocks else None
        whole = _RECORD_HEAD.size + size
        if run and not run.where and run.at + run.size == where and run.size < _LONGEST_RUN:
            self.blocks[-1] = run._replace(
                first=min(run.first, time), last=max(run.last, time), size=run.size + whole,
                plain=run.plain + whole)
        else:
            self._account()
            self.blocks.append(Block(time, time, 0, where, whole, '', whole, 0))

    def _account(self) -> None:
        """Count an entry that is kept; raise Damage where they are too many."""
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

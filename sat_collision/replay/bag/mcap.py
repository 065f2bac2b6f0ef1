# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""MCAP storage files, whole or not, in the order of time; the format: https://mcap.dev/spec."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import groupby, zip_longest
import os
from pathlib import Path
import struct
from typing import Any, NamedTuple
import zlib

from sat_collision.extras import in_one_line
from sat_collision.replay.bag.storage import (
    Damage, EMPTY, Faults, Limits, LONGEST_ROW, Row, Storage, unpacked)

_MAGIC = b'\x89MCAP0\r\n'
_HEADER, _FOOTER_KIND, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = range(1, 8)
_CHUNK_INDEX, _STATISTICS, _DATA_END = 8, 11, 15
_NAMES = {_SCHEMA: 'schema', _CHANNEL: 'channel', _MESSAGE: 'message', _CHUNK: 'chunk',
          _MESSAGE_INDEX: 'index', _CHUNK_INDEX: 'index', _STATISTICS: 'statistics'}
_OF_DATA = _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX
# Of records that may be long only so many bytes are read.
_LONG, _LONGEST_HEAD = (_MESSAGE, _CHUNK, _MESSAGE_INDEX), 64
_OF_SUMMARY = _SCHEMA, _CHANNEL, _CHUNK_INDEX, _STATISTICS
_NOT_OF_SUMMARY = _HEADER, _FOOTER_KIND, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _DATA_END
_RECORD_HEAD = struct.Struct('<BQ')
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_MESSAGE_RECORD = struct.Struct('<BQH4xQ8x')
_CHUNK_HEAD = struct.Struct('<QQQI')
_FOOTER = struct.Struct('<BQQQI')
_FOOTER_SIZE = _FOOTER.size + len(_MAGIC)
_LONGEST_RUN = 2**20
_PIECE = 2**20
# The largest chunk that is read ahead: files that overlap in time all do so at once.
_MOST_AHEAD = 2**22
# Approximate memory of an entry of a list or dict, bytes.
_ENTRY = 400


class Chunk(NamedTuple):
    """Consecutive messages: a chunk, or a run of messages outside of chunks."""

    first: int  # announced times of messages, ns
    last: int
    where: int  # position of the chunk, 0 for a run
    at: int  # position of its data
    size: int
    compression: str
    plain: int  # decompressed size
    checksum: int
    announced: int | None = None  # number of indexed messages, None without an index


class McapFile(Storage):
    """
    An MCAP file.

    Chunks that cannot be decompressed or have a wrong checksum are skipped, so that no coordinates
    come from damaged bytes. The messages read are compared with the indexes and statistics.
    """

    def __init__(self, path: Path, faults: Faults, limits: Limits) -> None:
        super().__init__(faults)
        self._max_bytes = limits.chunk
        self._left = 4 * limits.chunk
        self._file = -1
        # In the order of the file.
        self._chunks: list[Chunk] = []
        # Types and topics by the ids that the file gives to schemas and channels.
        self._schemas: dict[int, str] = {0: ''}
        self._channels: dict[int, tuple[str, int]] = {}
        # From the summary: times of chunks by position, messages by channel, number of channels.
        self._chunk_index: dict[int, tuple[int, int]] = {}
        self._statistics: Counter[int] | None = None
        self._channel_count = 0
        # How many messages the indexes of chunks have, by channel.
        self._indexed: Counter[int] = Counter()
        self._is_surveyed = self._ends = False
        try:
            self._file = os.open(path, os.O_RDONLY)
            self._size = os.fstat(self._file).st_size
            if not self._size:
                raise Damage(EMPTY)
            begin = self._read(0, min(self._size, len(_MAGIC)))
            if not _MAGIC.startswith(begin):
                raise Damage('this is not an MCAP file')
            if self._size <= len(_MAGIC):
                raise Damage('it ends before its first record: the recorder was ended before it '
                             'wrote anything, or it was not copied whole; record or copy it again')
            self._walk_summary()
            self._walk_data()
        except (OSError, Damage) as error:
            self._chunks.clear()
            faults.damaged(in_one_line(error))
            return
        self.compressions = {chunk.compression for chunk in self._chunks} - {''}
        counts = self._statistics
        if counts is None or len(self._channels) < self._channel_count or any(
                schema not in self._schemas for _, schema in self._channels.values()
        ) or not all(map(self._is_indexed, self._chunks)):
            counts = self._survey()
        for channel, (topic, schema) in self._channels.items():
            self.counts[topic] += counts[channel]
            self._add_topic(topic, self._schemas.get(schema, ''))
        faults.unknown('channels', {channel: count for channel, count in counts.items()
                                    if count and channel not in self._channels})
        if self._indexed:
            self._compare(self._indexed, 'are indexed')
        if self.start is None:
            # Chunks without messages announce 0.
            self._extend(*(time for chunk in self._chunks
                           if chunk.first <= chunk.last and (chunk.last or chunk.announced != 0)
                           for time in (chunk.first, chunk.last)))

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def rows(self, topics: Collection[str], start: int | None = None,
             stop: int | None = None) -> Iterator[Row]:
        # If all was read before, the faults are already recorded.
        faults = Faults(Path()) if self._is_surveyed else self._faults
        pending = _Pending({channel: topic for channel, (topic, _) in self._channels.items()
                            if topic in topics}, start or 0, 2**64 if stop is None else stop)
        chunks = sorted(chunk for chunk in self._chunks
                        if chunk.last >= pending.first and chunk.first < pending.last
                        or not chunk.last)
        read: Counter[int] = Counter()
        ahead: Future[bytes] | None = None
        # A thread reads the next chunk, decompresses and verifies it without the interpreter lock.
        with ThreadPoolExecutor(1) as reader:
            for chunk, following in zip_longest(chunks, chunks[1:]):
                room = self._max_bytes - pending.size
                content = (ahead or reader.submit(self._content, chunk, room)).result
                left = min(room - chunk.plain, _MOST_AHEAD)
                ahead = (reader.submit(self._content, following, left)
                         if following and following.plain <= left else None)
                _, channels = self._load(chunk, content, pending,
                                         faults if chunk.plain <= room else self._faults)
                del content
                pending.places += [chunk.at] * (len(pending.times) - len(pending.places))
                read.update(channels)
                yield from pending.take(following.first if following else 2**64)
        if start is None and stop is None:
            self._compare(read, 'can be read')
            self._is_surveyed = True

    def _is_indexed(self, chunk: Chunk) -> bool:
        """Return whether the indexes confirm the times of a chunk, and that it has any if 0."""
        return not chunk.where or (
            self._chunk_index.get(chunk.where) == (chunk.first, chunk.last)
            and (chunk.last > 0 or chunk.announced is not None))

    def _survey(self) -> Counter[int]:
        """Read all of a file whose summary is not complete; return the counts by channel."""
        self._is_surveyed = True
        found: Counter[int] = Counter()
        for chunk in self._chunks:
            content = partial(self._content, chunk, self._max_bytes)
            times, channels = self._load(chunk, content, _Pending({}, 0, 0), self._faults)
            found.update(channels)
            if times:
                self._extend(min(times), max(times))
        self._compare(found, 'can be read')
        return found

    def _load(self, chunk: Chunk, content: Callable[[], bytes], pending: _Pending,
              faults: Faults) -> tuple[list[int], list[int]]:
        """Return times and channels of all messages of a chunk, recording its faults."""
        begun = len(pending.times)
        times: list[int] = []
        channels: list[int] = []
        problem = ''
        try:
            self._fill(chunk, content(), pending, times, channels)
        except Damage as damage:
            # Its traceback has the content, and what was submitted refers to it and to this frame.
            problem = str(damage.with_traceback(None))
        times += pending.times[begun:]
        channels += pending.channels[begun:]
        where = f'damaged in the chunk at byte {chunk.where or chunk.at}: '
        if problem:
            faults.damaged(where + problem)
        if chunk.announced not in (None, len(times)) and (times or not problem):
            faults.damaged(f'{where}{len(times)} messages, but its index has {chunk.announced}')
        if times and not (chunk.first <= min(times) and max(times) <= chunk.last):
            faults.damaged(f'{where}it has messages of another time than it announces')
        return times, channels

    def _fill(self, chunk: Chunk, content: bytes, pending: _Pending, times: list[int],
              channels: list[int]) -> None:
        """Add the messages of a chunk up to any damage, those not wanted to the lists."""
        topics, first, last = pending.topics, pending.first, pending.last
        add_time, add_channel, add_message = (
            pending.times.append, pending.channels.append, pending.messages.append)
        at, end = 0, len(content)
        head_size, least, record_size = (
            _RECORD_HEAD.size, _MESSAGE_HEAD.size, _MESSAGE_RECORD.size)
        whole, unpack = end - record_size, _MESSAGE_RECORD.unpack_from
        while at < end:
            if at <= whole:
                kind, size, channel, time = unpack(content, at)
                behind = at + head_size + size
                if kind == _MESSAGE and size >= least and behind <= end:
                    if channel in topics and first <= time < last:
                        add_time(time)
                        add_channel(channel)
                        add_message(content[at + record_size:behind])
                    else:
                        times.append(time)
                        channels.append(channel)
                    at = behind
                    continue
            if end - at < head_size:
                raise Damage('the head of a record is cut off')
            kind, size = _RECORD_HEAD.unpack_from(content, at)
            at += head_size
            if not kind or size > end - at:
                raise Damage(f'{size} bytes announced, {end - at} left' if kind else 'no record')
            if kind == _MESSAGE:
                raise Damage('invalid message record')
            if kind in (_SCHEMA, _CHANNEL):
                self._parse(chunk.where, kind, size, content[at:at + size])
            at += size

    def _content(self, chunk: Chunk, room: int) -> bytes:
        """Return the verified data of a chunk; raise Damage if they need more than the room."""
        if chunk.plain > room:
            raise Damage(f'{chunk.plain + self._max_bytes - room} bytes at once: allow more with '
                         '--max-memory')
        content = unpacked(self._read(chunk.at, chunk.size), chunk.compression, chunk.plain)
        if len(content) != chunk.plain:
            raise Damage(f'{chunk.plain} bytes announced, it holds {len(content)}')
        if chunk.checksum and zlib.crc32(content) != chunk.checksum:
            raise Damage('its checksum is wrong')
        return content

    def _compare(self, found: Counter[int], how: str) -> None:
        """Compare numbers of messages by channel with those of the statistics, if any."""
        if self._statistics is not None:
            names = {channel: self._channels.get(channel, (f'channel {channel}', 0))[0]
                     for channel in found | self._statistics}
            self._faults.compare(found, self._statistics, f'{{1}} messages of {{0}} {how}, but '
                                 'its statistics announce {2}', names)

    def _read(self, at: int, size: int) -> bytes:
        if size > self._max_bytes:
            raise Damage(f'{size} bytes at once: allow more with --max-memory')
        data = os.pread(self._file, size, at)
        if len(data) < size:
            raise Damage(f'{size} bytes announced, {len(data)} left')
        return data

    def _walk_summary(self) -> None:
        """Read the summary behind the data, if the end of the file announces one."""
        try:
            footer = self._read(max(self._size - _FOOTER_SIZE, 0), _FOOTER_SIZE)
            kind, size, start, _, checksum = _FOOTER.unpack_from(footer)
            self._ends = (kind, size, footer[-len(_MAGIC):]) == (_FOOTER_KIND, 20, _MAGIC)
            if not self._ends:
                raise Damage('it is missing')
            if not start:
                return
            if start > self._size:
                raise Damage(f'it is said to begin at byte {start} of {self._size}')
            summary = self._read(start, max(self._size - len(_MAGIC) - 4 - start, 0))
            if checksum and zlib.crc32(summary) != checksum:
                self._faults.damaged('damaged in its summary: its checksum is wrong')
            for where, kind, size in self._framed(start, self._size - _FOOTER_SIZE):
                if kind in _OF_SUMMARY:
                    self._take(where, kind, size)
        except Damage as damage:  # a misplaced one has its position first
            self._faults.damaged(f'damaged at its end: {damage.args[-1]}')

    def _walk_data(self) -> None:
        """Find the chunks; after a damaged place continue at the next indexed chunk."""
        where = len(_MAGIC)
        lost: set[int] = set()
        while where:
            try:
                for where, kind, size in self._framed(where, self._size):
                    if kind == _DATA_END:
                        self._check_data(where, size)
                        self._check_rest(where + _RECORD_HEAD.size + size)
                        break
                    if kind in _OF_DATA:
                        self._take(where, kind, size)
                else:
                    if self._ends:
                        self._faults.damaged('damaged at the end of its data, which is missing')
                break
            except _Misplaced as damage:
                begin, words = damage.args
                self._faults.damaged(f'damaged at byte {begin}: {words}')
                lost.add(begin)
                where = min((at for at in self._chunk_index if at > begin), default=0)
        found = {chunk.where: (chunk.first, chunk.last) for chunk in self._chunks}
        for where, times in self._chunk_index.items():
            if where not in lost and found.get(where) != times:
                self._faults.damaged(f'damaged at byte {where}: not the chunk that is indexed')

    def _check_data(self, where: int, size: int) -> None:
        """Compare the data with the checksum in the record that ends them, if any."""
        checksum = found = 0
        if size >= 4:
            checksum, = struct.unpack('<I', self._read(where + _RECORD_HEAD.size, 4))
        if checksum:
            for at in range(0, where, _PIECE):
                found = zlib.crc32(os.pread(self._file, min(_PIECE, where - at), at), found)
        if found != checksum:
            self._faults.damaged('damaged in its data: its checksum (data_section_crc) is wrong')

    def _check_rest(self, where: int) -> None:
        """Report data behind the end of the data, as where files were joined."""
        for where, kind, _ in self._framed(where, self._size - _FOOTER_SIZE):
            if kind in _NOT_OF_SUMMARY:
                raise _Misplaced(where, 'more data behind the end of the data, which are not read')

    def _framed(self, where: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield (position, kind, size of the content) of consecutive records."""
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

    def _take(self, where: int, kind: int, size: int) -> None:
        """Process a record of the data or of the summary."""
        try:
            read = min(size, _LONGEST_HEAD) if kind in _LONG else size
            self._parse(where, kind, size, self._read(where + _RECORD_HEAD.size, read))
        except Damage as damage:
            self._faults.damaged(f'damaged at byte {where}: {damage}')

    def _parse(self, where: int, kind: int, size: int, content: bytes) -> None:
        """Process the content of a record; of a long one, its head."""
        try:
            if kind == _MESSAGE:
                self._add_to_run(where, content, size)
            elif kind == _CHUNK:
                self._account()
                first, last, plain, checksum = _CHUNK_HEAD.unpack_from(content)
                compression, begin = _text(content, _CHUNK_HEAD.size)
                packed, = struct.unpack_from('<Q', content, begin)
                if packed != size - begin - 8:
                    raise ValueError
                at = where + _RECORD_HEAD.size + begin + 8
                self._chunks.append(
                    Chunk(first, last, where, at, packed, compression, plain, checksum))
            elif kind == _MESSAGE_INDEX:
                channel, length = struct.unpack_from('<HI', content)
                if not self._chunks or length != size - 6:
                    raise ValueError
                chunk = self._chunks[-1]
                self._chunks[-1] = chunk._replace(announced=(chunk.announced or 0) + length // 16)
                self._indexed[channel] += length // 16
            elif kind == _CHUNK_INDEX:
                self._account()
                first, last, begin = struct.unpack_from('<QQQ', content)
                self._chunk_index[begin] = first, last
            elif kind == _STATISTICS:
                self._channel_count, = struct.unpack_from('<I', content, 10)
                length, = struct.unpack_from('<I', content, 42)
                self._statistics = Counter(dict(
                    struct.iter_unpack('<HQ', content[46:46 + length])))
            elif kind == _SCHEMA:
                key, = struct.unpack_from('<H', content)
                name = _text(content, 2)[0]
                known = self._schemas.setdefault(key, name)
                if known != name:
                    self._faults.differs((kind, key), f'schema {key} is {known} and {name}')
            else:
                # With another schema the topic has another type.
                key, schema = struct.unpack_from('<HH', content)
                topic, at = _text(content, 4)
                before = self._channels.setdefault(key, (topic, schema))
                if before != (topic, schema):
                    self._faults.differs((kind, key), f'channel {key} is {before[0]} and {topic}')
                at = _text(content, at)[1] + 4
                while at < len(content):
                    name, at = _text(content, at)
                    value, at = _text(content, at)
                    if name == 'offered_qos_profiles':
                        self.profiles.add((topic, value))
        except (struct.error, ValueError):
            self._faults.damaged(f'damaged at byte {where}: invalid {_NAMES[kind]} record')

    def _add_to_run(self, where: int, head: bytes, size: int) -> None:
        """Add a message outside of chunks to the run that it follows, or begin a run."""
        _, _, time, _ = _MESSAGE_HEAD.unpack_from(head)
        run = self._chunks[-1] if self._chunks else None
        whole = _RECORD_HEAD.size + size
        if run and not run.where and run.at + run.size == where and run.size < _LONGEST_RUN:
            self._chunks[-1] = run._replace(
                first=min(run.first, time), last=max(run.last, time), size=run.size + whole,
                plain=run.plain + whole)
        else:
            self._account()
            self._chunks.append(Chunk(time, time, 0, where, whole, '', whole, 0))

    def _account(self) -> None:
        """Count an entry that is kept; raise Damage if there are too many."""
        self._left -= _ENTRY
        if self._left < 0:
            raise Damage('too many chunks for --max-memory')


class _Pending:
    """Messages of some channels, held until no earlier ones can follow."""

    def __init__(self, topics: dict[int, str], first: int, last: int) -> None:
        self.topics = topics  # by channel
        self.first, self.last = first, last  # ns
        # Not in one list: the garbage collector would visit a tuple for each again and again.
        self.times: list[int] = []
        self.channels: list[int] = []
        self.messages: list[bytes] = []
        self.places: list[int] = []  # positions of their chunks

    @property
    def size(self) -> int:
        """Bytes that the records of the messages have."""
        return sum(map(len, self.messages)) + _MESSAGE_RECORD.size * len(self.messages)

    def take(self, until: int) -> Iterator[Row]:
        """Yield and drop messages from before a time; those of equal times as in the file."""
        columns: tuple[list[Any], ...] = self.times, self.channels, self.messages, self.places
        if self.times != sorted(self.times) or self.places != sorted(self.places):
            order = sorted(range(len(self.times)), key=self.places.__getitem__)
            order.sort(key=self.times.__getitem__)
            for column in columns:
                column[:] = [column[k] for k in order]
        ready = bisect_left(self.times, until)
        begin = 0
        for channel, run in groupby(self.channels[:ready]):
            end = begin + len([*run])
            for k in range(begin, end, LONGEST_ROW):
                row = slice(k, min(k + LONGEST_ROW, end))
                yield self.topics[channel], self.times[row], self.messages[row]
            begin = end
        for column in columns:
            del column[:ready]


class _Misplaced(Damage):
    """Damage after which the next record cannot be found: its position, and what is wrong."""


def _text(content: bytes, at: int) -> tuple[str, int]:
    """Return a string, and the position after it."""
    size, = struct.unpack_from('<I', content, at)
    end = at + 4 + size
    if end > len(content):
        raise ValueError(f'a text of {size} bytes in a record of {len(content)}')
    return content[at + 4:end].decode(), end

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

"""MCAP storage files, whole or not, read in the order of time."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator
import os
from pathlib import Path
from typing import TypeAlias
import zlib

from sat_collision.replay.faults import Faults
from sat_collision.replay.mcap_layout import (
    Block, CHANNEL, Layout, MESSAGE, MESSAGE_HEAD, RECORD_HEAD, SCHEMA)
from sat_collision.replay.storage import Message
from sat_collision.replay.unpacking import Damage, in_words, Limits, unpacked

# Time in ns, block, where its data begins and ends in the block, channel, bytes of the block.
_Entry: TypeAlias = tuple[int, int, int, int, int, bytes]


class McapFile:
    """
    An MCAP file.

    Chunks that cannot be unpacked or have a wrong checksum are left out, so that no coordinates
    are made up of damaged bytes. What was read is compared with what indexes and statistics
    announce. The attributes are those of Storage.

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
        # What is wrong has been noted already where all was read before.
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
            read.update(entry[4] for entry in loaded)
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
        """Read all, where the file does not sum itself up; return the counts by channel."""
        found: Counter[int] = Counter()
        for number, block in enumerate(layout.blocks):
            loaded = self._load(block, number, 0, self._faults)
            found.update(entry[4] for entry in loaded)
            for time, *_ in loaded[:1] + loaded[-1:]:
                self.start = time if self.start is None else min(time, self.start)
                self.end = time if self.end is None else max(time, self.end)
        if layout.statistics is not None:
            self._compare_statistics(found, layout.statistics, layout)
        return found

    def _load(self, block: Block, number: int, held: int, faults: Faults) -> list[_Entry]:
        """Return the messages of a block, noting what is wrong with it."""
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
        while at < end:
            if end - at < RECORD_HEAD.size:
                raise Damage('the head of a record is cut off')
            kind, size = RECORD_HEAD.unpack_from(content, at)
            at += RECORD_HEAD.size
            if not kind or size > end - at:
                raise Damage(f'{size} bytes announced, {end - at} left' if kind else 'no record')
            if kind == MESSAGE:
                if size < MESSAGE_HEAD.size:
                    raise Damage('invalid message record')
                channel, _, time, _ = MESSAGE_HEAD.unpack_from(content, at)
                entries.append((time, number, at + MESSAGE_HEAD.size, at + size, channel, content))
            elif kind in (SCHEMA, CHANNEL):
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

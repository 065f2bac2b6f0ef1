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

"""What can still be read of storage files that rosbags refuses: cut off, or without an index."""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
import os
from pathlib import Path
import shutil
import sqlite3
import struct
import sys
import tempfile
from typing import BinaryIO, TypeAlias
import zlib

from lz4.frame import decompress as decompress_lz4
if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

TypedMessage: TypeAlias = tuple[str, str, int, bytes]  # topic, type, time in ns, data

WRONG_TYPES = 'a row has values of wrong types'

_MAGIC = b'\x89MCAP0\r\n'
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 3, 4, 5, 6, 15
_NAMES = {_SCHEMA: 'schema', _CHANNEL: 'channel', _MESSAGE: 'message'}
_RECORD_HEAD = struct.Struct('<BQ')
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_CHUNK_HEAD = struct.Struct('<QQQI')
_DECOMPRESS = {'': bytes, 'lz4': decompress_lz4, 'zstd': zstd.decompress}


class Damage(Exception):
    """Not all of the file can be read; the message says what is wrong, and where."""


def recovered(path: Path) -> Iterator[TypedMessage]:
    """
    Yield (topic, type, time in ns, data) in file order of all that can be read of a file.

    Raises
    ------
    Damage
        After the last message, if there should have been more.

    """
    if path.suffix == '.db3':
        yield from _rows(path)
    else:
        yield from _messages(path)


def unpack(packed: Path, plain: Path) -> None:
    """
    Write what a zstd-compressed file holds to another file, as far as it can be read.

    Raises
    ------
    Damage
        If that is not all.

    """
    try:
        with zstd.open(packed, 'rb') as source, plain.open('wb') as target:
            shutil.copyfileobj(source, target)
    except (EOFError, zstd.ZstdError) as error:
        raise Damage(str(error)) from error


def _rows(path: Path) -> Iterator[TypedMessage]:
    with path.open('rb') as file:
        page_size = int.from_bytes(file.read(18)[16:], 'big')
    if page_size < 512 or not (beyond := path.stat().st_size % page_size):
        yield from _rows_of_whole_pages(path)
        return
    # SQLite would read zeros where the last page is cut off, and so make up coordinates.
    with tempfile.TemporaryDirectory(prefix='replay_check_') as folder:
        copy = Path(shutil.copyfile(path, Path(folder, path.name)))
        os.truncate(copy, copy.stat().st_size - beyond)
        yield from _rows_of_whole_pages(copy)


def _rows_of_whole_pages(path: Path) -> Iterator[TypedMessage]:
    connection = sqlite3.connect(f'{path.resolve().as_uri()}?immutable=1', uri=True)
    count = 0
    try:
        # Without this SQLite refuses a file shorter than its header says.
        connection.execute('PRAGMA writable_schema = ON')
        topics = {key: (name, kind) for key, name, kind in
                  connection.execute('SELECT id, name, type FROM topics')}
        for topic, time, data in connection.execute(
                'SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id'):
            name, kind = topics[topic]
            # What SQLite reads of a damaged row may be of any type.
            if (type(name), type(kind), type(time), type(data)) != (str, str, int, bytes):
                raise Damage(f'damaged after {count} messages: {WRONG_TYPES}')
            yield name, kind, time, data
            count += 1
    except (sqlite3.DatabaseError, KeyError) as error:
        raise Damage(f'damaged after {count} messages: {error}') from error
    finally:
        connection.close()


def _messages(path: Path) -> Iterator[TypedMessage]:
    """Yield the messages of an MCAP file; records that make no sense are left out."""
    schemas = {0: ''}
    channels: dict[int, tuple[str, str]] = {}
    faults: list[str] = []
    with path.open('rb') as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise Damage('this is not an MCAP file')
        for where, kind, content in _records(file, faults):
            try:
                if kind == _MESSAGE:
                    channel, _, time, _ = _MESSAGE_HEAD.unpack_from(content)
                    topic, name = channels[channel]
                    yield topic, name, time, content[_MESSAGE_HEAD.size:]
                elif kind == _SCHEMA:
                    key, = struct.unpack_from('<H', content)
                    schemas[key] = _text(content, 2)[0]
                elif kind == _CHANNEL:
                    key, schema = struct.unpack_from('<HH', content)
                    channels[key] = _text(content, 4)[0], schemas[schema]
            except (struct.error, LookupError, ValueError):
                faults.append(f'at byte {where}: invalid {_NAMES[kind]} record')
    if faults:
        more = f', and in {len(faults) - 1} more places' if faults[1:] else ''
        raise Damage(f'damaged {faults[0]}{more}')


def _records(file: BinaryIO, faults: list[str]) -> Iterator[tuple[int, int, bytes]]:
    """Yield (place, kind, content) of all records up to the end of the data, noting faults."""
    try:
        for where, kind, content in _framed(file):
            if kind == _DATA_END:
                return
            if kind != _CHUNK:
                yield where, kind, content
                continue
            try:
                for _, inner, record in _framed(BytesIO(_decompressed(content))):
                    yield where, inner, record
            except Exception as error:  # damage makes decompressors raise anything
                faults.append(f'in the chunk at byte {where}: {error}')
    except Damage as damage:
        faults.append(str(damage))
    else:
        faults.append('at its end, which is missing')


def _framed(file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
    """
    Yield (place, kind, content) of the records that follow one another.

    Raises
    ------
    Damage
        If the last one is cut off.

    """
    where = file.tell()
    end = file.seek(0, os.SEEK_END)
    file.seek(where)
    while where < end:
        head = file.read(_RECORD_HEAD.size)
        if len(head) < _RECORD_HEAD.size:
            raise Damage(f'at byte {where}: the head of a record is cut off')
        kind, size = _RECORD_HEAD.unpack(head)
        left = end - file.tell()
        if size > left:
            raise Damage(f'at byte {where}: {size} bytes announced, {left} left')
        yield where, kind, file.read(size)
        where = file.tell()


def _decompressed(chunk: bytes) -> bytes:
    *_, checksum = _CHUNK_HEAD.unpack_from(chunk)
    compression, at = _text(chunk, _CHUNK_HEAD.size)
    if compression not in _DECOMPRESS:
        raise Damage(f"unknown compression '{compression}'")
    content: bytes = _DECOMPRESS[compression](chunk[at + 8:])
    if checksum and zlib.crc32(content) != checksum:
        raise Damage('its checksum is wrong')
    return content


def _text(content: bytes, at: int) -> tuple[str, int]:
    """Return a string and where it ends."""
    size, = struct.unpack_from('<I', content, at)
    end = at + 4 + size
    if end > len(content):
        raise ValueError(f'a text of {size} bytes in a record of {len(content)}')
    return content[at + 4:end].decode(), end

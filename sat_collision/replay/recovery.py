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

from io import BytesIO
import os
from pathlib import Path
import shutil
import sqlite3
import struct
import sys
import tempfile

from lz4.frame import decompress as decompress_lz4
if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAGIC = b'\x89MCAP0\r\n'
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _DATA_END = 3, 4, 5, 6, 15
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_DECOMPRESS = {'': bytes, 'lz4': decompress_lz4, 'zstd': zstd.decompress}


class Damage(Exception):
    """The file cannot be read beyond here."""


def recovered(path):
    """
    Yield (topic, type, time in ns, data) in file order for as long as a file can be read.

    Raises
    ------
    Damage
        Where it cannot be read any further; says where and why.

    """
    if path.suffix == '.db3':
        yield from _rows(path)
    else:
        yield from _messages(path)


def _rows(path):
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


def _rows_of_whole_pages(path):
    connection = sqlite3.connect(f'{path.resolve().as_uri()}?immutable=1', uri=True)
    count = 0
    try:
        # Without this SQLite refuses a file shorter than its header says.
        connection.execute('PRAGMA writable_schema = ON')
        topics = {key: (name, kind) for key, name, kind in
                  connection.execute('SELECT id, name, type FROM topics')}
        for topic, time, data in connection.execute(
                'SELECT topic_id, timestamp, data FROM messages NOT INDEXED ORDER BY id'):
            yield *topics[topic], time, data
            count += 1
    except (sqlite3.DatabaseError, KeyError) as error:
        raise Damage(f'after {count} messages: {error}') from error
    finally:
        connection.close()


def _messages(path):
    schemas = {}
    channels = {}
    with path.open('rb') as file:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise Damage('it does not begin as an MCAP file does')
        for kind, content in _records(file):
            if kind == _MESSAGE:
                channel, _, time, _ = _MESSAGE_HEAD.unpack_from(content)
                if channel in channels:
                    yield *channels[channel], time, content[_MESSAGE_HEAD.size:]
            elif kind == _SCHEMA:
                key, = struct.unpack_from('<H', content)
                schemas[key] = _text(content, 2)[0]
            elif kind == _CHANNEL:
                key, schema = struct.unpack_from('<HH', content)
                channels[key] = _text(content, 4)[0], schemas.get(schema, '')
            elif kind == _DATA_END:
                return
    raise Damage('it ends before its data do')


def _records(file):
    """Yield (kind, content) of the records of a file, those inside of chunks too."""
    while head := file.read(9):
        where = file.tell() - len(head)
        try:
            kind, size = struct.unpack('<BQ', head)
            content = file.read(size)
            if len(content) < size:
                raise ValueError(f'{size} bytes announced, {len(content)} left')
            chunk = _decompressed(content) if kind == _CHUNK else None
        except Exception as error:  # damage makes decompressors raise anything
            raise Damage(f'at byte {where}: {error}') from error
        if chunk is None:
            yield kind, content
        else:
            yield from _records(BytesIO(chunk))


def _decompressed(chunk):
    compression, at = _text(chunk, 28)
    return _DECOMPRESS[compression](chunk[at + 8:])


def _text(content, at):
    """Return a string and where it ends."""
    size, = struct.unpack_from('<I', content, at)
    end = at + 4 + size
    return content[at + 4:end].decode(), end

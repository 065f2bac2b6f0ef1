# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Storage files as recorders leave them and as damage does, written without rosbags."""

import shutil
import sqlite3
import struct

from builders import serialised
import pytest
from recordings import nanoseconds, POLYGON

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK = range(1, 7)
CHUNK_INDEX, STATISTICS, DATA_END = 8, 11, 15
_TABLES = """
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
  serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
  timestamp INTEGER NOT NULL, data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""


def storage_file(bag):
    """Return the one storage file of a bag."""
    file, = (path for path in bag.iterdir() if path.name != 'metadata.yaml')
    return file


def write_mcap(path, messages, chunk_size=2000, compression='', indexes='ALL', types=None,
               **options):
    """Write (topic, seconds, points) to an MCAP file with checksums and indexes; return it."""
    mcap = pytest.importorskip('mcap.writer')
    with path.open('wb') as file:
        writer = mcap.Writer(file, chunk_size,
                             mcap.CompressionType[compression.upper() or 'NONE'],
                             mcap.IndexType[indexes], **options)
        writer.start('ros2')
        schemas, channels = {}, {}
        for topic, time, content in messages:
            if topic not in channels:
                kind = (types or {}).get(topic, POLYGON)
                if kind not in schemas:
                    schemas[kind] = writer.register_schema(kind, 'ros2msg', b'')
                channels[topic] = writer.register_channel(topic, 'cdr', schemas[kind])
            stamp = nanoseconds(time)
            data = content if isinstance(content, bytes) else serialised(content, stamp)
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path


def records(data, start=len(MAGIC)):
    """Yield (place, kind, size) of the records of an MCAP file; the content follows 9 bytes on."""
    while start < len(data) - len(MAGIC):
        kind, size = struct.unpack_from('<BQ', data, start)
        yield start, kind, size
        start += 9 + size


def record(kind, content):
    """Return an MCAP record."""
    return struct.pack('<BQ', kind, len(content)) + content


def text(string):
    """Return a text as MCAP has it."""
    return struct.pack('<I', len(string)) + string


def schema(key=1, kind=POLYGON):
    """Return the record of a type."""
    return record(SCHEMA, struct.pack('<H', key) + text(kind.encode()) + text(b'') + text(b''))


def channel(key, topic, schema=1):
    """Return the record of a topic."""
    return record(CHANNEL, struct.pack('<HH', key, schema) + text(topic) + text(b'cdr')
                  + text(b''))


def message(key, points, time):
    """Return the record of a message of a channel."""
    stamp = nanoseconds(time)
    return record(MESSAGE, struct.pack('<HIQQ', key, 0, stamp, stamp) + serialised(points, stamp))


def mcap_of(*parts):
    """Return an MCAP file of records, without an index."""
    return b''.join([MAGIC, record(HEADER, text(b'ros2') + text(b'')), *parts,
                     record(DATA_END, bytes(4)), record(FOOTER, bytes(20)), MAGIC])


def create_db3(path, messages, pragmas=''):
    """Write (topic, seconds, points) to an SQLite storage; return the open connection."""
    connection = sqlite3.connect(path)
    connection.executescript(pragmas + _TABLES)
    add_rows(connection, messages)
    return connection


def add_rows(connection, messages):
    """Write more messages, and commit."""
    topics = {name: key for key, name in connection.execute('SELECT id, name FROM topics')}
    for topic, time, content in messages:
        if topic not in topics:
            topics[topic] = len(topics) + 1
            connection.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')",
                               (topics[topic], topic, POLYGON))
        stamp = nanoseconds(time)
        connection.execute('INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)',
                           (topics[topic], stamp, serialised(content, stamp)))
    connection.commit()


def killed_recorder(path, messages, in_file):
    """Write messages of which only some are in the file, all others in its write-ahead log."""
    path.parent.mkdir(exist_ok=True)
    alive = path.with_name('alive.db3')
    connection = create_db3(
        alive, messages[:in_file], 'PRAGMA journal_mode=WAL; PRAGMA wal_autocheckpoint=0;')
    connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    add_rows(connection, messages[in_file:])
    for end in ('', '-wal'):
        shutil.copy(f'{alive}{end}', f'{path}{end}')
    connection.close()
    alive.unlink()
    return path


def run_sql(path, *statements):
    """Change an SQLite storage; a statement may be one with its values."""
    connection = sqlite3.connect(path)
    for statement in statements:
        connection.execute(*([statement] if isinstance(statement, str) else statement))
    connection.commit()
    connection.close()

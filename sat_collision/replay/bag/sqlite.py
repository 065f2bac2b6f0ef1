# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""SQLite storage files (.db3), whole or damaged, with the log that a recorder left beside them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
import os
from pathlib import Path
import sqlite3
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sat_collision.extras import in_one_line
from sat_collision.replay.bag.storage import (
    Damage, EMPTY, Faults, Limits, Message, Scratch, Storage)

_COLUMNS = {'topics': {'id', 'name', 'type'}, 'messages': {'id', 'topic_id', 'timestamp', 'data'}}
_SURVEY = """
SELECT topic_id, timestamp, CASE typeof(data) WHEN 'blob' THEN length(data) ELSE 0 END
FROM messages NOT INDEXED"""
# A damaged file may have values of any type and size.
_READ = """
SELECT topic_id, timestamp, CASE WHEN typeof(data) = 'blob' AND length(data) <= {} THEN data END
FROM messages {} WHERE topic_id IN ({}) ORDER BY {}"""
# Of a write-ahead log, https://sqlite.org/fileformat2.html#walformat: magic, page size, number of
# checkpoints, salts.
_LOG_HEAD = struct.Struct('>I4x4I')
_LOG_MAGIC = 0x377F0682
_LOG_SIZE, _FRAME_SIZE = 32, 24  # without pages
_PIECE = 2**22
# SQLite calls back after so many steps, so that an interrupt is noticed.
_STEPS = 100_000


class SqliteFile(Storage):
    """
    A .db3 file, read with SQLite in the order of time; copied if it cannot be read in place.

    If SQLite finds the file damaged, it is read in the order of writing, up to the damage. Rows
    with a value of a wrong type are counted: data of a wrong type are yielded as b'', which is
    rejected because it cannot be decoded; a row without a time is skipped.
    """

    def __init__(self, path: Path, faults: Faults, scratch: Scratch, limits: Limits) -> None:
        super().__init__(faults)
        path = path.resolve()  # beside which SQLite has its logs
        log, journal = Path(f'{path}-wal'), Path(f'{path}-journal')
        size = sum(map(_size, (path, log, journal)))
        self._max_bytes = min(size, limits.chunk)
        self._whole = False  # whether the survey read all rows
        self._names: dict[object, str] = {}
        self._connection: sqlite3.Connection | None = None
        if not _size(path):
            faults.damaged(EMPTY)
            return
        try:
            # Only those that count: SQLite removes a write-ahead log without a transaction.
            logs = [journal] if _is_hot(journal) else []
            if _size(log):
                problem, has_transaction = _examined(log)
                if problem:
                    faults.damaged(f'damaged in its write-ahead log, {log.name}: {problem}')
                if has_transaction:
                    logs.append(log)
            self._connection = _connected(path, logs, scratch)
            self._read_topics(self._connection)
            self._survey(self._connection, size)
        except (sqlite3.Error, OSError, Damage) as error:
            faults.damaged(f'damaged after {self.counts.total()} messages: {_message_of(error)}')

    def close(self) -> None:
        if self._connection:
            self._connection.close()

    def _messages(self, topics: Collection[str], start: int | None,
                  stop: int | None) -> Iterator[Message]:
        if not self._connection:
            return
        read: Counter[str] = Counter()
        unfit = 0
        keys = [key for key, name in self._names.items() if name in topics]
        query = _READ.format(self._max_bytes, '' if self._whole else 'NOT INDEXED',
                             ', '.join('?' * len(keys)),
                             'timestamp, id' if self._whole else 'rowid')
        try:
            for key, time, data in self._connection.execute(query, keys):
                topic = self._names.get(key)
                if topic is None:  # an id that only SQLite takes for that of a topic
                    continue
                read[topic] += 1
                if type(time) is int and (start is None or time >= start) and (
                        stop is None or time < stop):
                    if data is None:
                        unfit += 1
                        data = b''
                    yield topic, time, data
        except sqlite3.Error as error:
            self._faults.damaged(f'damaged after {read.total()} messages: {_message_of(error)}')
        if unfit:
            self._faults.differs('types', f'{unfit} messages have values of wrong types')
        self._faults.compare(read, {topic: self.counts[topic] for topic in read},
                             '{1} messages of {0} can be read, but it has {2}')

    def _read_topics(self, connection: sqlite3.Connection) -> None:
        plain: dict[str, set[str]] = {}
        for table, columns in _COLUMNS.items():
            # A view or a computed column may be endless; a virtual table has no page.
            found = connection.execute(
                "SELECT type = 'table' AND rootpage != 0 FROM sqlite_master WHERE name = ?",
                (table,)).fetchall()
            plain[table] = {name for _, name, _, _, _, _, hidden in connection.execute(
                f'PRAGMA table_xinfo({table})') if not hidden}
            if found != [(True,)] or columns - plain[table]:
                raise Damage(f"'{table}' is not a table of a recording")
        # Early recorders write no QoS.
        qos = next(iter(plain['topics'] & {'offered_qos_profiles'}), 'NULL')
        for key, name, kind, profiles in connection.execute(
                f'SELECT id, name, type, {qos} FROM topics'):
            if not isinstance(name, str) or not isinstance(kind, str):
                self._faults.damaged('a topic whose name or type is not text')
                continue
            known = self._names.setdefault(key, name)
            if known != name:
                self._faults.differs(('id', key), f'topic {key} is {known} and {name}')
            self._add_topic(name, kind)
            if isinstance(profiles, str):
                self.profiles.add((name, profiles))

    def _survey(self, connection: sqlite3.Connection, size: int) -> None:
        """Count the messages, and find the first and the last time."""
        counts: dict[object, int] = dict.fromkeys(self._names, 0)
        announced = untimed = 0
        start, end = 2**63, -2**63 - 1
        try:
            for key, time, length in connection.execute(_SURVEY):
                counts[key] = counts.get(key, 0) + 1
                announced += length
                if type(time) is int:
                    if time < start:
                        start = time
                    if time > end:
                        end = time
                else:
                    untimed += 1
            self._whole = True
        finally:
            if start <= end:
                self._extend(start, end)
            if untimed:
                self._faults.differs('times', f'{untimed} messages have no time')
            for key, name in self._names.items():
                self.counts[name] += counts.pop(key)
            self._faults.unknown('topics', counts)
        # Rows that share pages could make a small file yield far more data than it has.
        if announced > size:
            self.close()
            self._connection = None
            raise Damage(f'its rows announce {announced} bytes, it has {size}')


def _examined(log: Path) -> tuple[str, bool]:
    """
    Return why SQLite would not read all of a write-ahead log, and if any transaction is whole.

    The reason is '' if it reads all; otherwise it says nothing.
    """
    has_transaction = False
    with log.open('rb') as file:
        head = file.read(_LOG_SIZE)
        if len(head) < _LOG_SIZE:
            return 'its header is cut off', False
        magic, page_size, checkpoints, *salts = _LOG_HEAD.unpack_from(head)
        order = '>u4' if magic & 1 else '<u4'
        words = np.frombuffer(head, '>u4').reshape(1, -1)
        before = words[:, 6:]
        sums = _checksums(np.zeros_like(before), words[:, :6].view(order))
        if (magic & ~1 != _LOG_MAGIC or not 512 <= page_size <= 65536
                or page_size & (page_size - 1) or (sums != before).any()):
            return 'its header is wrong', False
        size, where, whole = _FRAME_SIZE + page_size, _LOG_SIZE, True
        while piece := file.read(_PIECE // size * size):
            count, cut = divmod(len(piece), size)
            frames = np.frombuffer(piece, '>u4', count * size // 4).reshape(count, size // 4)
            read = 0
            if whole:
                words = frames.view(order)
                sums = _checksums(np.vstack((before, frames[:, 4:6]))[:count], words[:, :2],
                                  words[:, 6:])
                right = ((frames[:, 2:4] == salts) & (frames[:, 4:6] == sums)).all(axis=1)
                whole = bool(right.all())
                read = count if whole else int(right.argmin())
                # The last frame of a transaction has the number of pages after it.
                has_transaction |= bool(frames[:read, 1].any())
                before = frames[-1:, 4:6]
            # Frames of before a checkpoint may follow. It raised the first salt by one.
            if (salts[0] - frames[read:, 2] - 1 >= checkpoints).any():
                return f'it is wrong at byte {where + read * size}', has_transaction
            where += len(piece)
            if cut and whole:
                return 'it is cut off', has_transaction
    return '' if where > _LOG_SIZE else 'it is cut off', has_transaction


def _checksums(before: NDArray[Any], *words: NDArray[Any]) -> NDArray[Any]:
    """Return SQLite's checksum of each row, from the checksum before it, (n, 2)."""
    row = np.hstack((before, *words))
    # Each number is the sum of a word and the two numbers before, so words count by Fibonacci's.
    series = [0, 1]
    while len(series) < row.shape[1]:
        series.append((series[-1] + series[-2]) % 2**32)
    weights = np.array(series[::-1], np.uint32)
    return row @ np.stack((np.hstack((weights[2:0:-1], weights[2:])),
                           np.hstack((weights[1::-1], weights[1:-1]))), axis=1)


def _connected(path: Path, logs: list[Path], scratch: Scratch) -> sqlite3.Connection:
    with path.open('rb') as file:
        page_size = int.from_bytes(file.read(18)[16:], 'big')
    page_size = 65536 if page_size == 1 else page_size
    beyond = path.stat().st_size % page_size if page_size >= 512 else 0
    if not beyond:
        uri = path.as_uri()
        if not logs:
            return _opened(f'{uri}?immutable=1')
        try:
            if Path(f'{path}-shm').exists():  # a recorder may be running
                return _opened(f'{uri}?mode=ro&readonly_shm=1')
            # Alone, without locks, SQLite needs no file beside the log.
            return _opened(f'{uri}?mode=ro&vfs=unix-none', 'PRAGMA locking_mode = EXCLUSIVE')
        except sqlite3.Error:
            pass  # such as a journal, which SQLite cannot roll back without writing
    copy = scratch.copy(path, *logs) / path.name
    # Where the last page is cut off SQLite would read zeros, as if they were coordinates.
    os.truncate(copy, copy.stat().st_size - beyond)
    return _opened(copy.as_uri())


def _opened(uri: str, first: str = '') -> sqlite3.Connection:
    connection = sqlite3.connect(uri, uri=True)
    try:
        connection.execute(first)
        connection.set_progress_handler(lambda: 0, _STEPS)
        # Without this SQLite refuses a file shorter than its header says.
        connection.execute('PRAGMA writable_schema = ON')
        connection.execute('BEGIN')
        connection.execute('SELECT count(*) FROM sqlite_master').fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _is_hot(journal: Path) -> bool:
    """Return whether SQLite would roll back by a journal: its first byte is not zero."""
    if not journal.exists():
        return False
    with journal.open('rb') as file:
        return file.read(1) > b'\0'


def _message_of(error: Exception) -> str:
    """Return an error's message; an interrupt, which SQLite reports as an error, is raised."""
    if isinstance(error, sqlite3.OperationalError) and str(error) == 'interrupted':
        raise KeyboardInterrupt from error
    return in_one_line(error)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Damaged recordings are never clear: wrong counts, decompression bombs, wrong values."""

import contextlib
from importlib import import_module
import json
import os
import re
import signal
import sqlite3
import struct
import subprocess
import sys
import textwrap
import threading
import time
from xml.etree import ElementTree

from compiled import plain_python
import pytest
from recordings import box, check, drive, POLYGON, SOURCE, START, write
from sat_collision.replay.__main__ import main
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.bag.sqlite import SqliteFile
from sat_collision.replay.bag.storage import check_bag_writer, Faults, Limits, Scratch
from sat_collision.replay.model.result import Options, Verdict

from storages import (
    channel, CHUNK, CHUNK_INDEX, create_db3, DATA_END, FOOTER, HEADER, MAGIC, mcap_of, message,
    record, records, run_sql, schema, storage_file, text, write_mcap)

ALL = 3 * 101
CLEAR = drive(contact=(0, 0))
MB = 10**6
SECOND = 10**9
WITHOUT_SUMMARY = {'indexes': 'NONE', 'repeat_channels': False,
                   'repeat_schemas': False, 'use_statistics': False, 'use_summary_offsets': False}


def problem_of(path, messages=None):
    """Return the one problem of bad input, of which a number of messages is read."""
    result = check(path)
    problem, = result.problems
    assert result.verdict is Verdict.BAD_INPUT and messages in (None, result.messages)
    return problem


def offset(data, kind, number):
    """Return the offset of one of the records of a kind."""
    return [where for where, found, _ in records(data) if found == kind][number]


@pytest.mark.parametrize('indexed', (True, False))
@pytest.mark.parametrize('first, last', [(0, 1), (1, 9), (0, 9), (0, 60)])
def test_zeroed_chunk_is_reported(tmp_path, first, last, indexed):
    """Whichever part of a chunk's header is zero, the chunk is read or reported."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR, **{} if indexed else {
        'use_statistics': False, 'repeat_channels': False, 'repeat_schemas': False})
    data = bytearray(file.read_bytes())
    where = offset(data, CHUNK, 5)
    data[where + first:where + last] = bytes(last - first)
    file.write_bytes(data)
    result = check(file)
    assert result.verdict is Verdict.BAD_INPUT
    assert result.messages >= ALL - 30
    assert len(result.problems) == 1 and str(file) in result.problems[0]
    assert check(file, Options(start=1.0, duration=8.0)).verdict is Verdict.BAD_INPUT


def test_damaged_chunk_that_two_parts_have_is_reported_once(tmp_path):
    """As of a recording that is checked from a time on, for what came before."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR)
    data = bytearray(file.read_bytes())
    data[offset(data, CHUNK, 5) + 60] ^= 1
    file.write_bytes(data)
    middle = START + 5 * SECOND
    with Recording(file) as recording:
        for part in ((None, middle), (middle, None), (None, middle + SECOND)):
            assert list(recording.rows([*recording.topics], *part))
        problem, = recording.problems
    assert 'damaged in the chunk' in problem and 'more places' not in problem


def test_chunk_that_announces_no_time_is_read(tmp_path):
    """Whatever part of the recording is checked."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR)
    part = Options(start=1.0, duration=8.0)
    data, whole = bytearray(file.read_bytes()), check(file, part).messages
    where = offset(data, CHUNK, 5) + 9
    data[where:where + 16] = bytes(16)
    file.write_bytes(data)
    assert check(file, part).messages == whole


@pytest.mark.parametrize('start', (10**6, 2**63 - 1, 2**63, 2**64 - 1))
def test_summary_offset_beyond_the_file(tmp_path, start):
    file = write_mcap(tmp_path / 'a.mcap', CLEAR)
    data = bytearray(file.read_bytes())
    struct.pack_into('<Q', data, len(data) - len(MAGIC) - 20, start)
    file.write_bytes(data)
    problem = problem_of(file, ALL)
    assert 'at its end' in problem and str(start) in problem


def test_chunk_of_an_unknown_kind_is_noticed_by_the_message_count(tmp_path):
    """Records of unknown kinds are skipped, but statistics count their messages."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR)
    data = bytearray(file.read_bytes())
    fifth = offset(data, CHUNK, 5)
    for where, kind, _ in records(bytes(data)):
        if kind == CHUNK_INDEX or where == fifth:
            data[where] = 200
    file.write_bytes(data)
    result = check(file)
    problem, = result.problems
    assert result.verdict is Verdict.BAD_INPUT
    assert f'{2 * ALL // 3}' in problem and f'{result.sources[0].received}' in problem


@pytest.mark.parametrize('where', (7, 15), ids=('first', 'last'))
def test_wrong_time_of_a_chunk_without_index_is_reported(tmp_path, where):
    """Also for a part of the time, which that chunk would then be outside of."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR, indexes='NONE')
    data = bytearray(file.read_bytes())
    data[offset(data, CHUNK, 5) + 9 + where] ^= 64 if where == 7 else 0x17
    for content in (data, file.read_bytes()):
        file.write_bytes(content)
        for options in (Options(), Options(start=1.0, duration=8.0)):
            assert bool(check(file, options).problems) == (content is data)


@pytest.mark.parametrize('chunked', (False, True))
@pytest.mark.parametrize('behind', ('recording', 'end', 'message'))
def test_what_follows_the_end_of_the_data_is_reported(tmp_path, behind, chunked):
    """Two files in one, as of `cat`, of which the second one has the collision."""
    first, second = (write_mcap(
        tmp_path / f'{k}.mcap', drive(contact=contact), use_chunking=chunked, **WITHOUT_SUMMARY
    ).read_bytes() for k, contact in enumerate([(0, 0), (4.0, 5.0)]))
    end = record(DATA_END, bytes(4)) + record(FOOTER, bytes(20)) + MAGIC
    if behind == 'end':
        second = end
    elif behind == 'message':
        first, second = first[:-len(end)] + record(DATA_END, bytes(4)), (
            message(2, box(0.0), 3.0) + record(FOOTER, bytes(20)) + MAGIC)
    (tmp_path / 'both.mcap').write_bytes(first + second)
    assert 'behind the end of the data' in problem_of(tmp_path / 'both.mcap', ALL)


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_metadata_with_more_messages_is_bad_input(tmp_path, storage):
    """The numbers of both are reported, for the whole recording and for a part."""
    bag = write(tmp_path / 'bag', CLEAR, storage)
    metadata = bag / 'metadata.yaml'
    metadata.write_text(metadata.read_text().replace('message_count: 101', 'message_count: 113'))
    for options in (Options(), Options(start=3.0, duration=2.0)):
        result = check(bag, options)
        assert result.verdict is Verdict.BAD_INPUT
        own, whole = result.problems
        assert '113 messages of /footprint, but 101' in own
        assert '303 messages in all, but 315' in whole


def test_file_missing_in_metadata_is_reported(tmp_path):
    """And read: it has the collision."""
    bag = write(tmp_path / 'bag', CLEAR)
    write_mcap(bag / 'bag_1.mcap', drive())
    result = check(bag)
    problem, = result.problems
    assert result.verdict is Verdict.COLLISION and result.messages == 2 * ALL
    assert 'does not list bag_1.mcap' in problem


def messages_of(keys):
    """Return records of messages of channels, each with a box at another place."""
    return [message(key, box(3.0 * key), k / 10) for k, key in enumerate(keys)]


FOOTPRINT, OBSTACLES = channel(1, b'/footprint'), channel(2, b'/obstacles')


@pytest.mark.parametrize('parts, words', [
    ([FOOTPRINT, OBSTACLES, *messages_of(2 + k % 5 // 4 for k in range(30)),
      *messages_of([1] * 30)], '6 messages of unknown channels'),
    # Its second half would count for another topic.
    ([FOOTPRINT, OBSTACLES, *messages_of([1, 2] * 16), channel(2, b'/elsewhere'),
      *messages_of([1, 2] * 14)], 'channel 2 is /obstacles and /elsewhere'),
    ([schema(2, 'std_msgs/msg/Bool'), FOOTPRINT, OBSTACLES, channel(3, b'/obstacles', 2),
      *messages_of([1, 2, 3] * 10)], '/obstacles has the types')],
    ids=('missing channel', 'changed channel', 'topic of two types'))
def test_channels_that_contradict_each_other_are_reported(tmp_path, parts, words):
    file = tmp_path / 'a.mcap'
    file.write_bytes(mcap_of(schema(), *parts))
    assert words in problem_of(file)


@pytest.mark.parametrize('statements, words', [
    (['UPDATE messages SET topic_id = 7 WHERE id > 150 AND topic_id = 2'],
     '102 messages of unknown topics'),
    (["INSERT INTO topics SELECT 9, name, 'std_msgs/msg/Bool', 'cdr', '', '' "
      "FROM topics WHERE name = '/obstacles'",
      'UPDATE messages SET topic_id = 9 WHERE topic_id = 2 AND id > 100'],
     '/obstacles has the types')], ids=('missing topic', 'topic of two types'))
def test_tables_that_contradict_each_other_are_reported(tmp_path, statements, words):
    file = storage_file(write(tmp_path / 'bag', CLEAR, 'sqlite3'))
    run_sql(file, *statements)
    assert words in problem_of(file)


def with_columns(path, types, *statements):
    """Write a recording to SQLite tables whose id, topic_id and timestamp have some types."""
    create_db3(path, CLEAR).close()
    run_sql(path, 'CREATE TABLE old AS SELECT * FROM messages', 'DROP TABLE messages',
            'CREATE TABLE names AS SELECT * FROM topics', 'DROP TABLE topics',
            'CREATE TABLE topics(id {}, name TEXT, type TEXT)'.format(types[0]),
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id {}, timestamp {}, data BLOB)'
            .format(*types[1:]), 'INSERT INTO topics SELECT id, name, type FROM names',
            'INSERT INTO messages SELECT * FROM old', *statements)
    return path


@pytest.mark.parametrize('types, words', [
    ('TEXT INTEGER INTEGER', 'of unknown topics (1, 2)'),
    ('INTEGER TEXT INTEGER', 'of unknown topics (1, 2)'),
    ('INTEGER INTEGER REAL', 'have no time'), ('INTEGER INTEGER TEXT', 'have no time')])
def test_columns_of_other_types_are_reported(tmp_path, types, words):
    file = with_columns(tmp_path / 'a.db3', types.split())
    assert f'{ALL} messages {words}' in problem_of(file, 0)


def test_topic_id_of_two_topics_is_reported(tmp_path):
    file = with_columns(tmp_path / 'a.db3', ['INTEGER'] * 3, (
        'INSERT INTO topics VALUES (2, ?, ?)', ('/elsewhere', POLYGON)))
    assert 'topic 2 is /obstacles and /elsewhere' in problem_of(file, ALL)


@pytest.mark.parametrize('index', (
    'timestamp DESC', 'topic_id', 'topic_id, timestamp', 'timestamp, topic_id DESC'))
def test_messages_of_one_time_are_read_in_the_order_of_writing(tmp_path, index):
    """Whichever index SQLite takes."""
    written = [(topic, time // 1, points) for topic, time, points in drive()]
    create_db3(tmp_path / 'a.db3', written).close()
    run_sql(tmp_path / 'a.db3', 'DROP INDEX timestamp_idx', f'CREATE INDEX a ON messages({index})')
    storage = SqliteFile(tmp_path / 'a.db3', Faults(tmp_path), Scratch(0), Limits())
    with contextlib.closing(storage):
        topics = [topic for topic, times, _ in storage.rows({'/footprint', '/obstacles'})
                  for _ in times]
    assert topics == [topic for topic, *_ in written]


def test_topic_name_cannot_forge_a_line(tmp_path):
    file = tmp_path / 'a.mcap'
    file.write_bytes(mcap_of(schema(), channel(1, b'/a'), channel(1, b'/b\nall: CLEAR')))
    assert problem_of(file).endswith('channel 1 is /a and /b?all: CLEAR')


@pytest.mark.parametrize('change', [
    "data = 'seven'", 'data = 7', 'data = NULL', "timestamp = 'soon'", "timestamp = x'00'"])
def test_row_with_values_of_another_type_is_counted(tmp_path, change):
    """All other messages are read, and the collision after it is found."""
    connection = create_db3(tmp_path / 'a.db3', drive())
    connection.executescript('PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = '
                             "replace(sql, 'NOT NULL', '') WHERE name = 'messages'")
    connection.close()
    run_sql(tmp_path / 'a.db3', f'UPDATE messages SET {change} WHERE id IN (50, 60)')
    result = check(tmp_path / 'a.db3')
    is_kept = change.startswith('data')
    assert result.verdict is Verdict.COLLISION
    assert all('2 ' in problem for problem in result.problems)
    assert (len(result.problems), result.messages, result.sources[1].rejected) == (
        (2, ALL, {'undecodable': 2}) if is_kept else (1, ALL - 2, {}))


LOOP = '/**:\n  ros__parameters: &a\n    footprint: *a\n'
LAUGHS = '/**:\n  ros__parameters:\n    a0: &a0 {x: 1, y: 2}\n' + ''.join(
    f'    a{k}: &a{k} {{x: *a{k - 1}, y: *a{k - 1}}}\n' for k in range(1, 60))


@pytest.mark.parametrize('content', (LOOP, LAUGHS, '[' * 5000), ids=('loop', 'laughs', 'deep'))
def test_recursive_yaml_is_bad_input(tmp_path, capsys, content):
    """An alias that contains itself, or one that grows exponentially."""
    bag = write(tmp_path / 'bag', CLEAR)
    path = tmp_path / 'params.yaml'
    path.write_text(content)
    assert main([str(bag), '--params-file', str(path)]) == 3
    error = capsys.readouterr().err
    assert 'params.yaml' in error and error.count('\n') == 1


@pytest.mark.parametrize('kind', ('metadata', 'params'))
def test_yaml_runs_no_code(tmp_path, capsys, kind):
    """As the tags of Python's YAML would."""
    bag = write(tmp_path / 'bag', CLEAR)
    path = bag / 'metadata.yaml' if kind == 'metadata' else tmp_path / 'params.yaml'
    path.write_text(f"!!python/object/apply:os.mkdir ['{tmp_path}/made']")
    assert main([str(bag), *(['--params-file', str(path)] if kind == 'params' else [])]) == 3
    assert path.name in ''.join(capsys.readouterr()) and not (tmp_path / 'made').exists()


def merges(levels, times):
    """Return lines of YAML in which each merges the one before it many times."""
    return '\n'.join(['l0: &l0 {a: 1}'] + [
        f'l{k}: &l{k} {{<<: [{", ".join(times * [f"*l{k - 1}"])}]}}' for k in range(1, levels)])


@pytest.mark.parametrize('old, new, words', [
    *((r'(?s)\A.*', content, '') for content in (
        'rosbag2_bagfile_information: &a\n  topics_with_message_count: [*a]\n',
        'rosbag2_bagfile_information: &a [*a]\n', '[' * 5000, 'rosbag2_bagfile_information: 7',
        'rosbag2_bagfile_information:\n  relative_file_paths: 7\n', '{}', '{:',
        '? [a]\n: 2001-99-99')),
    # Nested merge keys would fill all memory.
    *((r'\A', f'{lines}\n', 'is not YAML') for lines in (merges(2, 1), merges(9, 50))),
    *((r'message_count: \d+', f'message_count: {number}', 'message_count')
      for number in ('9' * 4000, '-1', '1.5')),
    # Nested references would be written out by their names.
    (r'- bag.mcap', '- [bag.mcap]', 'relative_file_paths')])
def test_invalid_metadata_is_bad_input(tmp_path, old, new, words):
    """The storage files are read nevertheless."""
    metadata = write(tmp_path / 'bag', drive()) / 'metadata.yaml'
    content, count = re.subn(old, new, metadata.read_text())
    metadata.write_text(content)
    result = check(tmp_path / 'bag')
    problem, = result.problems
    assert count and (result.messages, result.verdict) == (ALL, Verdict.COLLISION)
    assert 'metadata.yaml' in problem and words in problem


def run_command(*arguments, **more):
    """Run the command in another process; it prints its peak memory in MB at the end."""
    program = textwrap.dedent("""
        import sys
        from sat_collision.replay.__main__ import main
        status = main(sys.argv[1:])
        # Not ru_maxrss, which includes memory of the parent process.
        with open('/proc/self/status') as file:
            print('took', int(file.read().split('VmHWM:')[1].split()[0]) // 1000)
        sys.exit(status)
    """)
    return subprocess.run([sys.executable, '-c', program, *map(str, arguments)],
                          capture_output=True, text=True, timeout=60, env=plain_python(**more))


def zstd_compressor():
    module = 'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
    return import_module(module).ZstdCompressor()


def bomb(path, compression, size, claim=None, chunks=1, checksum=0):
    """Write a recording with chunks of a few kB that unpack to very many zeros."""
    import lz4.frame
    if compression == 'zstd':
        compressor = zstd_compressor()
        packed = b''.join([*(compressor.compress(bytes(MB)) for _ in range(size // MB)),
                           compressor.flush()])
    else:
        lz4.frame.compress(b'')
        compressor = lz4.frame.LZ4FrameCompressor()
        packed = b''.join([compressor.begin(), *(compressor.compress(bytes(MB)) for _ in range(
            size // MB)), compressor.flush()])
    chunk = record(CHUNK, struct.pack('<QQQI', START, START, claim or size, checksum)
                   + text(compression.encode()) + struct.pack('<Q', len(packed)) + packed)
    path.write_bytes(mcap_of(*[chunk] * chunks))
    return path


def test_contents_of_damaged_chunks_are_not_kept(tmp_path):
    """One is held at a time, of 20 of 50 MB whose checksums are wrong."""
    done = run_command(bomb(tmp_path / 'a.mcap', 'zstd', 50 * MB, chunks=20, checksum=1))
    assert done.returncode == 3 and 'its checksum is wrong' in done.stdout, done.stderr
    assert int(done.stdout.split()[-1]) < 400


@pytest.mark.parametrize('compression, claim', [
    ('zstd', None), *(pytest.param(*one, marks=pytest.mark.long) for one in (
        ('lz4', None), ('zstd', 1000)))])
def test_chunk_that_would_fill_memory_is_refused(tmp_path, compression, claim):
    """1 GB in a few kB, announced or not."""
    file = bomb(tmp_path / 'a.mcap', compression, 1000 * MB, claim)
    done = run_command(file, '--max-memory', '0.5')
    assert done.returncode == 3, done.stderr
    assert int(done.stdout.split()[-1]) < 600
    assert 'a.mcap' in done.stdout


@pytest.mark.parametrize('summary', ({}, WITHOUT_SUMMARY))
def test_overlapping_chunks_respect_the_memory_limit(tmp_path, summary):
    """Every chunk reaches to the end of the recording, so none can be released."""
    messages = [('/footprint', time, box(0)) for k in range(50)
                for time in (k / 100, *[50.0 + k / 100] * 30)]
    file = write_mcap(tmp_path / 'a.mcap', messages, chunk_size=2900, **summary)
    assert check(file).problems == []
    few, = check(file, Options(limits=Limits(memory=8 * 20_000))).problems
    assert '--max-memory' in few


def test_chunks_too_large_to_be_held_two_at_a_time_are_read(tmp_path):
    """The next one is not read ahead then."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR, chunk_size=10_000)
    assert check(file, Options(limits=Limits(memory=8 * 15_000))).problems == []


def test_sqlite_pages_linked_to_a_cycle_are_bad_input(tmp_path):
    """A row of 2 MB announces 100 MB."""
    file = tmp_path / 'a.db3'
    create_db3(file, CLEAR).close()
    length, announced = 2_200_000, 100_000_000
    run_sql(file, ('INSERT INTO messages VALUES (999, 1, ?, ?)', (START, bytes(length))))
    data = bytearray(file.read_bytes())
    # The size of the row, which has 16 bytes besides, and the type of the value.
    for old, new in ((length + 16, announced + 16), (2 * length + 12, 2 * announced + 12)):
        at = data.index(varint(old))
        data[at:at + 4] = varint(new)
    size = int.from_bytes(data[16:18], 'big')
    chain = [at for at in range(0, len(data), size)
             if int.from_bytes(data[at:at + 4], 'big') == at // size + 2]
    last = chain[-1] + size
    data[last:last + 4] = (chain[1] // size + 1).to_bytes(4, 'big')
    file.write_bytes(data)
    assert 'announce 100' in problem_of(file)


def varint(value):
    """Return a number as SQLite's varint of four bytes."""
    return bytes((value >> shift & 127) | (128 if shift else 0) for shift in (21, 14, 7, 0))


def test_file_that_would_fill_the_disk_is_refused(tmp_path):
    """300 MB in a compressed storage file."""
    compressor = zstd_compressor()
    bag = tmp_path / 'a.mcap.zstd'
    bag.write_bytes(b''.join([compressor.compress(MAGIC + record(HEADER, text(b'ros2') + text(
        b'')))] + [compressor.compress(bytes(MB)) for _ in range(300)] + [compressor.flush()]))
    done = run_command(bag, '--max-disk', '0.1', TMPDIR=str(tmp_path))
    assert done.returncode == 3, done.stderr
    assert '--max-disk' in done.stdout


RECURSIVE = """
    WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)
    SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n"""
GENERATED = """
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
      data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)"""


@pytest.mark.parametrize('messages', (
    f'CREATE VIEW messages AS {RECURSIVE}', pytest.param(GENERATED, marks=pytest.mark.long),
    pytest.param('CREATE VIRTUAL TABLE messages USING fts4(x)', marks=pytest.mark.long)))
def test_only_tables_are_read(tmp_path, messages):
    """Views and generated columns may be endless."""
    create_db3(tmp_path / 'a.db3', CLEAR).close()
    run_sql(tmp_path / 'a.db3', 'DROP TABLE messages', messages)
    done = run_command(tmp_path / 'a.db3')
    assert done.returncode == 3, done.stderr
    assert 'table' in done.stdout


def interrupt_after(seconds):
    """Interrupt this process after some time, as from the keyboard."""
    threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT)).start()


def test_interrupt_ends_a_long_query(tmp_path):
    """Sorting a table without an index is a single call of SQLite."""
    connection = create_db3(tmp_path / 'a.db3', CLEAR, 'PRAGMA journal_mode=OFF;')
    connection.executescript("""
        DROP INDEX timestamp_idx;
        WITH RECURSIVE n(id) AS (SELECT 1000 UNION ALL SELECT id + 1 FROM n WHERE id < 800000)
        INSERT INTO messages SELECT id, 1, (id * 7919) % 800000, x'00' FROM n""")
    connection.close()
    faults, scratch = Faults(tmp_path), Scratch(0)
    storage = SqliteFile(tmp_path / 'a.db3', faults, scratch, Limits())
    begun = time.process_time()
    next(storage.rows({'/footprint'}, None, None))
    taken = time.process_time() - begun
    interrupt_after(taken / 10)
    begun = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        next(storage.rows({'/footprint'}, None, None))
    assert time.process_time() - begun < taken / 2
    storage.close()
    assert not faults


def test_interrupt_of_the_command(tmp_path, capsys):
    bag = str(write(tmp_path / 'bag', drive(100.0)))
    interrupt_after(0.3)
    assert main([bag] * 1000) == 2
    assert capsys.readouterr().err == 'replay_check: interrupted\n'


@pytest.mark.parametrize('as_live', (False, True))
def test_undecodable_message_is_bad_input(tmp_path, as_live):
    """Two bytes of the one message with the contact are changed."""
    create_db3(tmp_path / 'a.db3', drive(contact=(5.0, 5.1))).close()
    assert check(tmp_path / 'a.db3', Options(as_live=as_live)).verdict is Verdict.COLLISION
    (key, data), = (row for row in sqlite3.connect(tmp_path / 'a.db3').execute(
        'SELECT id, data FROM messages WHERE topic_id = 2 AND timestamp = ?',
        (START + 5 * SECOND,)) if len(row[1]) > 40)
    run_sql(tmp_path / 'a.db3', ('UPDATE messages SET data = ? WHERE id = ?',
                                 (b'\xff\xff' + data[2:], key)))
    result = check(tmp_path / 'a.db3', Options(as_live=as_live))
    problem, = result.problems
    assert result.verdict is Verdict.BAD_INPUT
    assert '1 messages on /obstacles cannot be decoded' in problem


@pytest.mark.parametrize('topic, refused', [('/obstacles', SOURCE), ('/footprint', 'footprint')])
@pytest.mark.parametrize('as_live', (False, True))
def test_refused_message_is_unknown_in_the_exit_status(tmp_path, as_live, topic, refused):
    """A NaN where the contact was, however short it is; it concerns one footprint of two."""
    messages = drive(contact=(5.0, 5.1) if topic == '/obstacles' else (0, 0))
    messages += [(f'/other{topic}', time, points) for topic, time, points in drive(contact=(0, 0))]
    messages.sort(key=lambda one: one[1])
    bad = messages.index((topic, 5.0, box(0.75 if topic == '/obstacles' else 0.0)))
    messages[bad] = topic, 5.0, [(float('nan'), 0.0), *box(0.75)[1:]]
    bag = write(tmp_path / 'bag', messages)
    parameters = {
        'footprints': ['footprint', 'other'], 'other.topic': '/other/footprint',
        'obstacles': [SOURCE, 'others'], 'others.topic': '/other/obstacles',
        'footprint.obstacles': [SOURCE], 'other.obstacles': ['others'],
        f'{SOURCE}.set_end': 'empty_polygon', 'others.set_end': 'empty_polygon'}
    junit, stored = tmp_path / 'a.xml', tmp_path / 'a.json'
    assert main([str(bag), f'--junit={junit}', f'--json={stored}', *['--as-live'] * as_live,
                 *(f'--param={name}:={json.dumps(value)}' for name, value in parameters.items())
                 ]) == 2
    failures = {case.get('name'): case.find('failure').text
                for case in ElementTree.parse(junit).iter('testcase') if len(case)}
    assert {*failures} == {'footprint', f'messages of {refused}'}
    assert 'not finite' in failures[f'messages of {refused}']
    assert f'messages of {refused} were refused' in failures['footprint']
    result, = json.loads(stored.read_text())['bags']
    assert {one['name']: one['refused'] for one in result['footprints']} == {
        'footprint': [refused], 'other': []}


@pytest.mark.parametrize('chunked', (True, False))
def test_checksum_of_the_data_section_is_compared(tmp_path, chunked):
    """One changed bit where no other checksum applies."""
    file = write_mcap(tmp_path / 'a.mcap', CLEAR, use_chunking=chunked, enable_crcs=False,
                      enable_data_crcs=True)
    assert check(file).verdict is Verdict.CLEAR
    data = bytearray(file.read_bytes())
    data[data.index(struct.pack('<f', 3.0))] ^= 1
    file.write_bytes(data)
    assert 'data_section_crc' in problem_of(file)


def test_folder_of_recordings_is_bad_input(tmp_path):
    write(tmp_path / 'bags' / 'one', CLEAR)
    problem = problem_of(tmp_path / 'bags')
    assert 'folder of recordings' in problem and str(tmp_path / 'bags' / 'one') in problem
    assert 'reindex' not in problem


@pytest.mark.parametrize('name, content, words', [
    ('a.mcap', b'', 'the file is empty: nothing was recorded, or it was not copied whole'),
    ('a.db3', b'', 'the file is empty: nothing was recorded, or it was not copied whole'),
    *(('a.mcap', b'\x89MCAP0\r\n'[:size], 'it ends before its first record: the recorder was '
       'ended before it wrote anything, or it was not copied whole') for size in (3, 8))])
def test_file_without_a_record(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    assert problem_of(tmp_path / name) == f'{tmp_path / name}: {words}; record or copy it again'


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_recording_without_topics_or_messages_is_unknown(tmp_path, storage):
    empty = write(tmp_path / 'bag', [], storage)
    create_db3(tmp_path / 'a.db3', CLEAR).close()
    run_sql(tmp_path / 'a.db3', 'DELETE FROM messages')
    for path in (empty, storage_file(empty), tmp_path / 'a.db3'):
        result = check(path)
        assert (result.verdict, result.problems) == (Verdict.UNKNOWN, [])
        assert 'the recording has no messages: were the topics published' in result.notes[-1]


def test_folder_named_like_a_library_is_not_imported(tmp_path, monkeypatch):
    """The message says what to install."""
    (tmp_path / 'rosbags').mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, 'path', [str(tmp_path)])
    for name in [name for name in sys.modules if name.partition('.')[0] == 'rosbags']:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(OSError, match='pip install rosbags'):
        check_bag_writer()

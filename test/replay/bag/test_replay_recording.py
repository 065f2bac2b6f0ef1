# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Reading recordings: of every storage, split, damaged or in order, and without libraries."""

from importlib.machinery import ModuleSpec
import json
import os
from pathlib import Path
import shutil
import struct
import sys
from types import ModuleType, SimpleNamespace
import zlib

from builders import SECOND, serialised
import numpy as np
import pytest
from recordings import (
    box, check, content_of, DECLARED, drive, main, nanoseconds, run_without, START, write)
from rosbags.highlevel import AnyReader
from sat_collision.replay.bag import storage as storages
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.model.result import Options, Verdict
from storages import (
    channel, CHUNK, mcap_of, MESSAGE, message, record, schema, storage_file, text, write_mcap)
import yaml

ALL = 3 * 101
INFORMATION = 'rosbag2_bagfile_information'


def long_drive():
    """Return messages that fill several chunks and pages: over 4 MB."""
    ring = [(5.0, k / 400) for k in range(400)] + [(6.0, 1.0), (6.0, 0.0)]
    return [(topic, k / 40, box(0.0) if topic == '/footprint' else ring)
            for k in range(1000) for topic in ('/footprint', '/obstacles')]


@pytest.mark.parametrize('storage, compression', [
    ('mcap', None), ('mcap', 'storage'), ('sqlite3', None), ('sqlite3', 'file'),
    ('sqlite3', 'message'), ('mcap', 'file'), ('mcap', 'message')])
def test_every_storage_and_compression_is_read(tmp_path, storage, compression):
    result = check(write(tmp_path / 'bag', drive(), storage, compression))
    assert (result.problems, result.messages) == ([], ALL)
    contact, = result.contacts
    assert contact.between == [result.start + 39 * 10**8, result.start + 5 * 10**9]
    assert contact.depth == 0.25


def split(bag, storage='mcap', compression=None):
    """Write a drive in parts of 5 s, the last with the contact; return the files."""
    bag.mkdir()
    files, parts = [], []
    for k in range(4):
        part = write(bag.parent / f'part_{k}', [
            one for one in drive(19.9, contact=(16.0, 17.0)) if 5 * k <= one[1] < 5 * k + 5],
            storage, compression)
        file = storage_file(part)
        files.append(file.rename(bag / file.name))
        parts.append(yaml.safe_load((part / 'metadata.yaml').read_text())[INFORMATION])
    whole = parts[0]
    whole['relative_file_paths'] = [file.name for file in files]
    for count in (whole, *whole['topics_with_message_count']):
        count['message_count'] *= 4
    (bag / 'metadata.yaml').write_text(yaml.safe_dump({INFORMATION: whole}))
    return files


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_split_recording_is_read_in_order(tmp_path, storage):
    """Storage files in one metadata.yaml, as ros2 bag record splits them."""
    files = split(tmp_path / 'bag', storage)
    result = check(tmp_path / 'bag')
    assert (result.problems, result.messages) == ([], 600)
    assert [contact.depth for contact in result.contacts] == [0.25]
    files[1].unlink()
    result = check(tmp_path / 'bag')
    assert result.messages == 450
    assert any(f'{files[1].name} is missing' in problem for problem in result.problems)


@pytest.mark.parametrize('is_unpacked', (False, True))
def test_file_of_several_that_was_renamed_is_read(tmp_path, is_unpacked):
    """It has the contact; or it was decompressed, with the others beside it."""
    file = split(tmp_path / 'bag', *['mcap', 'file'] * is_unpacked)[3]
    if is_unpacked:
        file.with_suffix('').write_bytes(storages.unpacked(file.read_bytes(), 'zstd', 10**9))
        beside = check(tmp_path / 'bag')
        assert beside.messages == 600 and 'does not list' in beside.problems[0]
        file.unlink()
    else:
        file.rename(file.with_name('other.mcap'))
    result = check(tmp_path / 'bag')
    problem, = result.problems
    assert (result.messages, result.verdict) == (600, Verdict.COLLISION)
    assert f'{file.name} is missing; metadata.yaml does not list' in problem


def test_digits_in_names_of_files_that_are_no_numbers(tmp_path):
    bag = write(tmp_path / 'bag', drive())
    storage_file(bag).rename(bag / 'run5²0.mcap')
    assert check(bag).messages == ALL


def test_metadata_that_cannot_be_read_is_not_called_invalid(tmp_path):
    """The message has the error; the storage files are read nevertheless."""
    metadata = write(tmp_path / 'bag', drive()) / 'metadata.yaml'
    metadata.unlink()
    metadata.symlink_to('/proc/self/mem')
    result = check(tmp_path / 'bag')
    problem, = result.problems
    assert problem.startswith(f'{metadata}: [Errno 5]') and result.messages == ALL


@pytest.mark.parametrize('as_live', (False, True))
@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
@pytest.mark.parametrize('file_of', (
    lambda k: 2 - k // 110, lambda k: k % 3, lambda k: k // 4 % 3, lambda k: (k + 150) // 200,
    lambda k: 1 - (k > 280 or 3 < k < 30)),
    ids=('backwards', 'by topic', 'by turns', 'in order', 'one within another'))
def test_files_are_merged_in_the_order_of_time(tmp_path, storage, file_of, as_live):
    """Whatever their names and order in metadata.yaml are, also where they overlap."""
    messages = drive()
    options = Options(as_live=as_live, content=True)
    whole = check(write(tmp_path / 'whole', messages, storage), options)
    split = tmp_path / 'split'
    split.mkdir()
    for number in range(3):
        part = [one for k, one in enumerate(messages) if file_of(k) == number]
        if part:
            file = storage_file(write(tmp_path / str(number), part, storage))
            shutil.copy(file, split / f'split_{number}{file.suffix}')
    found = check(split, options)
    assert (found.contacts, found.unknown, found.content) == (
        whole.contacts, whole.unknown, whole.content)
    assert [vars(one) for one in found.footprints] == [vars(one) for one in whole.footprints]


@pytest.mark.parametrize('seed', range(20))
def test_rows_of_files_are_in_the_order_of_time(tmp_path, seed):
    """And a file is not read before it is its turn."""
    rng = np.random.default_rng(seed)
    files, begun = [], []

    class File(storages.Storage):

        def __init__(self, messages):
            super().__init__(storages.Faults(tmp_path))
            self.messages = messages
            self._extend(*(time for _, time, _ in messages))

        def rows(self, topics, start=None, stop=None):
            begun.append(self)
            yield from storages.in_rows(self.messages)

    for number in range(rng.integers(1, 8)):
        times = np.sort(rng.integers(0, 40, rng.integers(0, 30))) + rng.integers(0, 100)
        files.append(File([(str(rng.integers(2)), int(time), b'%d %d' % (number, k))
                           for k, time in enumerate(times)]))
    seen = []
    for topic, times, row in storages.in_time_order(files, ()):
        assert all(one.start is None or one.start <= times[0] for one in begun)
        seen += zip([topic] * len(row), times, row)
    files.sort(key=lambda one: one.start or 0)
    assert seen == sorted((one for file in files for one in file.messages), key=lambda one: one[1])


@pytest.mark.parametrize('as_live', (False, True))
@pytest.mark.parametrize('messages, written, checked', [
    *(([(topic, time - START / SECOND, points) for topic, time, points in drive()],
       {'chunk_size': 10**6}, part) for part in ({}, {'start': 2.0, 'duration': 6.0})),
    ([('/elsewhere', -START / SECOND, []), *drive()], {'chunk_size': 10**6}, {}),
    *(([(topic, -START / SECOND, serialised(points, nanoseconds(time)))
        for topic, time, points in drive()], {'indexes': indexes}, {'clock': 'header'})
      for indexes in ('ALL', 'CHUNK', 'NONE'))],
    ids=('begins there', 'begins there, a part', 'one message of another topic', 'all, indexed',
         'all, with indexes of chunks', 'all, without indexes'))
def test_messages_received_at_zero(tmp_path, messages, written, checked, as_live):
    """As of a simulation; what is in the same chunk is checked nevertheless."""
    result = check(write_mcap(tmp_path / 'a.mcap', messages, **written),
                   Options(as_live=as_live, **checked))
    assert (result.problems, result.verdict) == ([], Verdict.COLLISION)
    assert 'start' in checked or result.messages == ALL
    assert result.origin == (START if 'clock' in checked else 0)


@pytest.mark.parametrize('clock', ('receive', 'header'))
def test_big_endian_recording_counts_by_its_stamps(tmp_path, clock):
    """The footprint is received late, when the obstacle is elsewhere."""
    found = []
    for order in '<>':
        messages = [(topic, time + (topic == '/footprint') * 3.0,
                     serialised(points, nanoseconds(time), order=order))
                    for topic, time, points in drive()]
        file = write_mcap(tmp_path / 'a.mcap', sorted(messages, key=lambda one: one[1]))
        result = check(file, Options(clock=clock))
        found.append((result.verdict, result.contacts, result.duration, result.notes))
    assert found[0] == found[1] and found[0][0] is Verdict.COLLISION


@pytest.mark.parametrize('seed', range(20))
def test_messages_of_one_time_are_in_the_order_of_the_file(tmp_path, seed):
    """Of chunks that overlap, too, some of which begin before the one that they follow."""
    rng = np.random.default_rng(seed)
    times = np.maximum.accumulate(np.arange(60) // 4 - rng.choice([0, 0, 2], 60) + 2)
    times -= rng.choice([0, 0, 0, 0, 1, 3], 60) * (times > 5)
    messages = [('/obstacles', int(time) / 10, b'%d' % k) for k, time in enumerate(times)]
    with Recording(write_mcap(tmp_path / 'a.mcap', messages, 150)) as recording:
        found = [data for *_, row in recording.rows(['/obstacles']) for data in row]
    assert found == [data for _, _, data in sorted(messages, key=lambda one: one[1])]


def test_chunks_without_messages_have_no_time(tmp_path):
    """The types and topics have chunks of their own, which announce 0."""
    with Recording(write_mcap(tmp_path / 'a.mcap', drive(), 1)) as recording:
        assert (recording.start, recording.end) == (START, nanoseconds(10.0))


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_missing_metadata_is_reported(tmp_path, storage):
    bag = write(tmp_path / 'bag', drive(contact=(0, 0)), storage)
    (bag / 'metadata.yaml').unlink()
    result = check(bag)
    problem, = result.problems
    assert (result.messages, result.verdict) == (ALL, Verdict.BAD_INPUT)
    assert str(bag / 'metadata.yaml') in problem and 'reindex' in problem


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_file_of_another_name_than_listed_is_read(tmp_path, storage):
    """And reported, if no listed file is there."""
    bag = write(tmp_path / 'bag', drive(), storage)
    file = storage_file(bag)
    file.rename(bag / f'renamed{file.suffix}')
    result = check(bag)
    assert (result.messages, result.verdict) == (ALL, Verdict.COLLISION)
    assert file.name in result.problems[0] and 'renamed' in result.problems[0]


@pytest.mark.parametrize('storage, compression, share', [
    *((storage, None, share) for storage in ('mcap', 'sqlite3') for share in (0.3, 0.7, 0.99)),
    ('mcap', 'file', 0.7)])
def test_truncated_file_is_read_up_to_its_end(tmp_path, storage, compression, share):
    """As from a killed recorder; in a zstd frame that is truncated, too."""
    bag = write(tmp_path / 'bag', long_drive(), storage, compression)
    file = storage_file(bag)
    data = file.read_bytes()
    file.write_bytes(data[:int(share * len(data))])
    result = check(bag)
    assert result.verdict is Verdict.BAD_INPUT
    assert any(str(file) in problem for problem in result.problems)
    assert 0.5 * share * 2000 < result.messages < 2000
    assert result.footprints[0].least.separation == 4.0


def test_unindexed_file_is_read(tmp_path):
    """An MCAP file whose footer names no index, and one without a footer."""
    bag = write(tmp_path / 'bag', drive())
    file = storage_file(bag)
    data = file.read_bytes()
    footer = len(data) - 8 - 20
    for content, is_reported in (
            (data[:footer] + bytes(20) + data[-8:], False), (data[:footer - 9], True)):
        file.write_bytes(content)
        result = check(bag)
        assert (result.messages, result.verdict) == (ALL, Verdict.COLLISION)
        assert bool(result.problems) is is_reported


@pytest.mark.parametrize('name, content', [
    ('a.mcap', b'nonsense' * 99), ('a.db3', b'nonsense' * 99), ('a.bag', b'#ROSBAG V2.0\n'),
    ('a.txt', b'text'), ('nowhere', None), ('', None)])
def test_other_paths_are_bad_input(tmp_path, name, content):
    if content:
        (tmp_path / name).write_bytes(content)
    result = check(tmp_path / name)
    assert result.verdict is Verdict.BAD_INPUT
    assert str(tmp_path / name) in result.problems[0]


def chunk(*records, compression=b''):
    """Return a chunk with its checksum."""
    content = b''.join(records)
    return record(CHUNK, struct.pack('<QQQI', 0, 2**63, len(content), zlib.crc32(content))
                  + text(compression) + struct.pack('<Q', len(content)) + content)


CHANNELS = channel(1, b'/footprint'), channel(2, b'/obstacles')
# Ten chunks of ten messages each.
PARTS = [message(1 + (topic == '/obstacles'), points, time)
         for topic, time, points in drive(contact=(0, 0))[:100]]
DRIVE = [chunk(*PARTS[k:k + 10]) for k in range(0, 100, 10)]
FLIPPED = DRIVE[3][:-20] + bytes([DRIVE[3][-20] ^ 64]) + DRIVE[3][-19:]


@pytest.mark.parametrize('parts, count, words', [
    ((*CHANNELS, *DRIVE), 100, None),
    ((*CHANNELS, *DRIVE[:3], FLIPPED, *DRIVE[4:]), 90, 'checksum'),
    ((*CHANNELS, *DRIVE[:3], chunk(b'junk', compression=b'zstd'), *DRIVE[3:]), 100, 'frame'),
    ((*CHANNELS, *DRIVE[:3], chunk(b'', compression=b'bzip2'), *DRIVE[3:]), 100, "'bzip2'"),
    ((*CHANNELS, *DRIVE[:3], record(MESSAGE, b'abc'), *DRIVE[3:]), 100, 'invalid message'),
    ((*CHANNELS, *DRIVE[:3], record(MESSAGE, bytes(30)), *DRIVE[3:]), 100,
     '1 messages of unknown'),
    ((CHANNELS[0], channel(2, b'/\xffbstacles'), *DRIVE), 34, 'invalid channel'),
    ((CHANNELS[0], CHANNELS[1][:-14] + b'\xff' * 14, *DRIVE), 34, '66 messages of unknown'),
    ((*CHANNELS, *DRIVE[:3], struct.pack('<BQ', 5, 2**63), *DRIVE[3:]), 30, 'announced'),
    ((*CHANNELS, *DRIVE[:3], b'abc'), 30, 'announced'),
], ids=('whole', 'checksum', 'zstd', 'compression', 'short message', 'no such channel',
        'topic that is no text', 'texts longer than their record', 'endless record', 'cut off'))
def test_damaged_part_of_a_file_is_reported_and_skipped(tmp_path, parts, count, words):
    """No message is made of damaged bytes, and the rest is read."""
    file = tmp_path / 'a.mcap'
    file.write_bytes(mcap_of(schema(), *parts))
    result = check(file)
    assert result.messages == count
    assert result.contacts == [] and not any(source.rejected for source in result.sources)
    if words is None:
        assert result.problems == []
    else:
        problem, = result.problems
        assert str(file) in problem and words in problem


@pytest.mark.parametrize('absolute', (False, True))
def test_files_outside_of_the_folder_are_not_read(tmp_path, absolute):
    """Metadata may name them, but only the name within the folder counts."""
    other = storage_file(write(tmp_path / 'other', drive()))
    bag = write(tmp_path / 'bag', drive())
    storage_file(bag).unlink()
    metadata = bag / 'metadata.yaml'
    content = yaml.safe_load(metadata.read_text())
    content[INFORMATION]['relative_file_paths'] = [
        str(other) if absolute else f'../other/{other.name}']
    metadata.write_text(yaml.safe_dump(content))
    result = check(bag)
    assert result.messages == 0 and any(other.name in problem for problem in result.problems)


@pytest.mark.parametrize('name', ('metadata.yaml', 'more.mcap', ''))
def test_pipe_in_place_of_a_file_is_damage(tmp_path, name):
    """Nothing waits for somebody to write into it."""
    bag = tmp_path / 'bag.mcap'
    if name:
        bag = storage_file(write(tmp_path / 'bag', drive())).parent
        (bag / 'metadata.yaml').unlink()
    os.mkfifo(bag / name)
    assert any('not a file' in problem for problem in check(bag).problems)


def test_content_has_the_times_of_messages(tmp_path):
    """Not only the bytes of two messages, but also which of them was received first."""
    both = [serialised(box(x), START) for x in (0.0, 5.0)]
    found = {check(write(tmp_path / str(k), [
        ('/footprint', time, data) for time, data in zip((0.0, 1.0), pair)]),
        Options(content=True)).content
        for k, pair in enumerate((both, both[::-1]))}
    assert len(found) == 2


HIDDEN = ('rosbags', 'lz4', 'backports', 'compression')
TOUCHING = drive(2.0, contact=(1.0, 1.5))
PACKED = [('sqlite3', 'file'), ('sqlite3', 'message'), ('mcap', 'file'), ('mcap', 'message'),
          ('mcap', 'storage')]


@pytest.mark.parametrize('names', (HIDDEN, (*HIDDEN, 'rclpy', 'geometry_msgs')))
def test_plain_recordings_need_no_library(tmp_path, names):
    """The results are the same, with and without ROS."""
    bags = [str(write(tmp_path / storage, TOUCHING, storage)) for storage in ('mcap', 'sqlite3')]
    files = tmp_path / 'a.json', tmp_path / 'b.json'
    assert main([*bags, '--json', str(files[0])]) == 1
    result = run_without(names, *bags, DECLARED, '--json', str(files[1]))
    assert (result.returncode, result.stderr) == (1, '')
    expected, found = (json.loads(file.read_text())['bags'] for file in files)
    assert found == expected


def test_compressed_recordings_name_the_missing_library(tmp_path):
    bags = [str(write(tmp_path / '_'.join(packed), TOUCHING, *packed)) for packed in PACKED]
    result = run_without(HIDDEN, *bags)
    assert (result.returncode, result.stderr) == (3, '')
    lines = [line for line in result.stdout.splitlines() if 'problem' in line]
    assert len(lines) == len(bags)
    assert all('unpacking zstd needs' in line and 'rosbag2_py' in line for line in lines)


def test_writing_names_the_missing_library(tmp_path):
    """Before the check."""
    bag = str(write(tmp_path / 'bag', TOUCHING))
    for arguments in ((bag, '--as-live', '--write-bag', str(tmp_path / 'out')),
                      ('--write-example', str(tmp_path / 'out'))):
        result = run_without(HIDDEN, *arguments)
        assert (result.returncode, result.stdout) == (3, '')
        assert 'needs rosbags' in result.stderr and result.stderr.count('\n') == 1
    assert not (tmp_path / 'out').exists()


class _Reader:
    """A stand-in for the documented interface of rosbag2_py, based on rosbags."""

    def open(self, storage, _):  # noqa: A003
        self._reader = AnyReader([Path(storage.uri)])
        try:
            self._reader.open()
        except Exception as error:
            raise RuntimeError(error) from error
        self._topics = None

    def get_metadata(self):
        reader = self._reader
        return SimpleNamespace(
            topics_with_message_count=[SimpleNamespace(
                topic_metadata=SimpleNamespace(name=name, type=topic.msgtype),
                message_count=topic.msgcount) for name, topic in reader.topics.items()],
            message_count=reader.message_count,
            starting_time=SimpleNamespace(nanoseconds=reader.start_time),
            duration=SimpleNamespace(nanoseconds=reader.duration - 1))

    def set_filter(self, wanted):
        self._messages = self._reader.messages(
            [one for one in self._reader.connections if one.topic in wanted.topics])
        self._next = next(self._messages, None)

    def has_next(self):
        return self._next is not None

    def read_next(self):
        (connection, time, data), self._next = self._next, next(self._messages, None)
        return connection.topic, data, time


@pytest.fixture(params=('real', 'stand-in'))
def rosbag2_py(request, monkeypatch):
    """Hide the libraries that unpack, and provide rosbag2_py or a stand-in."""
    if request.param == 'real':
        pytest.importorskip('rosbag2_py', reason='apt install ros-jazzy-rosbag2-py')
    else:
        stand_in = ModuleType('rosbag2_py')
        stand_in.__spec__ = ModuleSpec('rosbag2_py', None, origin='stand-in')
        stand_in.SequentialReader = stand_in.SequentialCompressionReader = _Reader
        stand_in.StorageOptions = stand_in.StorageFilter = SimpleNamespace
        stand_in.ConverterOptions = lambda *formats: formats
        monkeypatch.setitem(sys.modules, 'rosbag2_py', stand_in)

    def missing(compression):
        raise storages.Damage('it is hidden')

    monkeypatch.setattr(storages, '_library', missing)


@pytest.mark.parametrize('storage, compression', PACKED)
@pytest.mark.parametrize('part', ({}, {'start': 0.5, 'duration': 1.0}))
def test_compressed_recordings_are_read_by_rosbag2(
        tmp_path, rosbag2_py, storage, compression, part):
    """The results are the same, and no file is left beside them."""
    options = Options(**part, content=True)
    plain = check(write(tmp_path / 'plain', TOUCHING, storage), options)
    bag = write(tmp_path / 'bag', TOUCHING, storage, compression)
    before = sorted(bag.iterdir())
    result = check(bag, options)
    assert result.problems == [] and len(result.contacts) == 1
    assert (result.content, result.footprints, result.contacts, result.unknown) == (
        plain.content, plain.footprints, plain.contacts, plain.unknown)
    assert sorted(bag.iterdir()) == before


def test_recording_that_rosbag2_refuses_is_bad_input(tmp_path, rosbag2_py):
    bag = write(tmp_path / 'bag', TOUCHING, 'mcap', 'storage')
    file = bag / 'bag.mcap'
    file.write_bytes(file.read_bytes()[:2000])
    result = check(bag)
    assert result.verdict == 3 and len(result.problems) == 1


def test_bag_is_written_by_rosbag2(tmp_path):
    """If rosbags is missing; the messages are the same."""
    pytest.importorskip('rosbag2_py', reason='apt install ros-jazzy-rosbag2-py')
    bag = str(write(tmp_path / 'bag', TOUCHING))
    check(bag, Options(as_live=True, write_bag=str(tmp_path / 'a')))
    assert run_without(('rosbags',), bag, '--as-live', '--write-bag',
                       str(tmp_path / 'b')).returncode == 1
    assert content_of(tmp_path / 'a') == content_of(tmp_path / 'b')

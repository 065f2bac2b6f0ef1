# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Recordings where libraries are missing, and those that rosbag2_py reads and writes."""

from importlib.machinery import ModuleSpec
import json
from pathlib import Path
import sys
from types import ModuleType, SimpleNamespace

import pytest
from recordings import check, content_of, DECLARED, drive, main, run_without, write
from rosbags.highlevel import AnyReader
from sat_collision.replay.bag import storage as storages
from sat_collision.replay.model.result import Options

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

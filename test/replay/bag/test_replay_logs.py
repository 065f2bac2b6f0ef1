# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The logs of SQLite beside a recording: whole, damaged, of a recorder that was killed."""

import contextlib
import os
from pathlib import Path
import shutil
import struct
import tempfile

import pytest
from recordings import check, drive
from sat_collision.replay.bag.storage import Limits
from sat_collision.replay.model.result import Options, Verdict
from storages import add_rows, create_db3, killed_recorder

ALL = 3 * 101
CLEAR = drive(contact=(0, 0))


@pytest.mark.parametrize('in_file', (0, 120))
def test_write_ahead_log_of_a_killed_recorder_is_read(tmp_path, in_file):
    """The collision is in messages that are only in the log; all files stay as they are."""
    file = killed_recorder(tmp_path / 'bag' / 'a.db3', drive(contact=(7.0, 8.0)), in_file)
    before = files_of(file.parent)
    for recording in (file, file.parent):
        result = check(recording)
        assert (result.messages, result.verdict) == (ALL, Verdict.COLLISION)
    assert files_of(file.parent) == before


def test_write_ahead_log_of_a_running_recorder_is_read(tmp_path):
    """By the index that the recorder has beside it, and which stays."""
    recorder = create_db3(tmp_path / 'a.db3', drive(contact=(7.0, 8.0)),
                          'PRAGMA journal_mode=WAL; PRAGMA wal_autocheckpoint=0;')
    with contextlib.closing(recorder):
        names = {path.name for path in tmp_path.iterdir()}
        result = check(tmp_path / 'a.db3')
        assert {path.name for path in tmp_path.iterdir()} == names == {
            'a.db3', 'a.db3-wal', 'a.db3-shm'}
    assert (result.messages, result.verdict) == (ALL, Verdict.COLLISION)


def test_write_ahead_log_in_a_read_only_folder_is_read():
    """In place: SQLite is told that it needs no file beside it."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        killed_recorder(folder / 'a.db3', drive(contact=(7.0, 8.0)), 120)
        names = {path.name for path in folder.iterdir()}
        folder.chmod(0o555)
        stack.callback(folder.chmod, 0o755)
        if not os.geteuid():
            # Root could write anyway.
            os.seteuid(65534)
            stack.callback(os.seteuid, 0)
        result = check(folder / 'a.db3')
        few = check(folder / 'a.db3', Options(limits=Limits(disk=1000)))
        assert {path.name for path in folder.iterdir()} == names
    assert (result.messages, result.verdict) == (few.messages, few.verdict) == (
        ALL, Verdict.COLLISION)


@pytest.mark.parametrize('folder', (False, True))
def test_write_ahead_log_beside_the_target_of_a_link_is_read(tmp_path, folder):
    """The recording is a link to the file, or a folder with one."""
    (tmp_path / 'link').mkdir()
    link = tmp_path / 'link' / 'a.db3'
    link.symlink_to(killed_recorder(tmp_path / 'bag' / 'a.db3', drive(contact=(7.0, 8.0)), 120))
    result = check(link.parent if folder else link)
    assert (result.messages, result.verdict) == (ALL, Verdict.COLLISION)


def killed_while_writing(path, messages):
    """Return a recording with the journal of a recorder killed while it wrote into the file."""
    path.parent.mkdir()
    recorder = create_db3(path.with_name('alive.db3'), messages)
    with contextlib.closing(recorder):
        recorder.executescript("""
            PRAGMA cache_size = 1; BEGIN; DELETE FROM messages;
            INSERT INTO messages VALUES (1, 1, 0, zeroblob(200000))""")
        for end in ('', '-journal'):
            shutil.copy(path.with_name(f'alive.db3{end}'), f'{path}{end}')
    return path


def test_journal_beside_the_target_of_a_link_is_rolled_back(tmp_path):
    """As SQLite does; of two links whose targets have one name, too."""
    files = [killed_while_writing(tmp_path / str(k) / 'a.db3', messages)
             for k, messages in enumerate((drive(contact=(7.0, 8.0)), CLEAR))]
    (tmp_path / 'links').mkdir()
    for k, file in enumerate(files):
        (tmp_path / 'links' / f'{k}.db3').symlink_to(file)
    for path, count in ((files[0], ALL), (tmp_path / 'links' / '0.db3', ALL),
                        (tmp_path / 'links', 2 * ALL)):
        result = check(path)
        assert (result.messages, result.verdict) == (count, Verdict.COLLISION)


FRAME = 24 + 4096


def files_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def logged(folder):
    """Return a recording whose messages are only in its log, in several commits, and the log."""
    with contextlib.closing(create_db3(
            folder / 'alive.db3', [], 'PRAGMA journal_mode=WAL;')) as recorder:
        recorder.execute('PRAGMA wal_checkpoint(TRUNCATE)')
        for k in range(0, ALL, 30):
            add_rows(recorder, drive(contact=(7.0, 8.0))[k:k + 30])
        for end in ('', '-wal'):
            shutil.copy(folder / f'alive.db3{end}', folder / f'a.db3{end}')
    return folder / 'a.db3', folder / 'a.db3-wal'


def changed(where, zeros=0):
    """Return what changes one bit of a log, or zeroes a part of it."""
    def change(log):
        log = bytearray(log)
        for at in range(len(log))[where:][:zeros or 1]:
            log[at] = 0 if zeros else log[at] ^ 1
        return log
    return change


@pytest.mark.parametrize('change', [
    changed(0), changed(10), changed(9 * FRAME), changed(9 * FRAME + 32 + 8),
    changed(-FRAME), changed(-FRAME + 8), changed(-FRAME + 12), changed(-1),
    changed(0, zeros=32), changed(9 * FRAME, zeros=FRAME),
    changed(-FRAME, zeros=FRAME), lambda log: log[:len(log) // 3],
    lambda log: log[:2000], lambda log: log[:20], lambda log: log[:32],
    lambda _: b'rubbish' * 1000])
def test_damaged_write_ahead_log_is_reported(tmp_path, change):
    """All after the first damaged place is lost, and SQLite says nothing."""
    file, log = logged(tmp_path)
    log.write_bytes(change(log.read_bytes()))
    result = check(file)
    problem, = result.problems
    assert result.messages < ALL and result.verdict is not Verdict.CLEAR
    assert str(file) in problem and 'write-ahead log' in problem


@pytest.mark.parametrize('with_index', (False, True))
@pytest.mark.parametrize('path, change', [
    ('a.db3-wal', lambda log: log[:-7]), ('a.db3-wal', changed(10)),
    ('a.db3-wal', lambda log: log[:32 + FRAME] + bytes(len(log) - 32 - FRAME)),
    ('a.db3', lambda _: b''), ('a.db3-journal', lambda _: b'rubbish')],
    ids=('cut off', 'wrong header', 'wrong frames', 'empty recording', 'rubbish journal'))
def test_no_file_beside_a_recording_is_changed_or_removed(tmp_path, path, change, with_index):
    """Nor is a log without a whole transaction, which SQLite removes, so that all seems well."""
    file = killed_recorder(tmp_path / 'bag' / 'a.db3', drive(contact=(7.0, 8.0)), 120)
    path = file.parent / path
    path.write_bytes(change(path.read_bytes() if path.exists() else b''))
    if with_index:
        Path(f'{file}-shm').write_bytes(bytes(32768))
    before = files_of(file.parent)
    first, second = check(file), check(file)
    assert files_of(file.parent) == before
    assert first.problems == second.problems and first.messages == second.messages
    assert first.verdict is (Verdict.COLLISION if first.messages == ALL else Verdict.BAD_INPUT)


@pytest.mark.parametrize('end', ('-wal', '-journal'))
def test_log_beside_an_empty_recording_is_kept(tmp_path, end):
    """It is not shown to SQLite, which would remove it."""
    file = killed_recorder(tmp_path / 'bag' / 'a.db3', drive(contact=(7.0, 8.0)), 120)
    file.write_bytes(b'')
    Path(f'{file}-wal').rename(f'{file}{end}')
    before = files_of(file.parent)
    problem, = check(file).problems
    assert 'the file is empty' in problem and files_of(file.parent) == before


def in_other_order(log):
    """Return a log as a machine of the other byte order writes it, of pages of 4096 bytes."""
    log = bytearray(log)
    log[3] = 0x83
    sums = 0, 0
    for at, place in ((0, 24), *((at, at + 16) for at in range(32, len(log), FRAME))):
        content = log[at:at + 8] + log[at + 24:at + FRAME] if at else log[:24]
        for even, odd in struct.iter_unpack('>2I', content):
            even = (sums[0] + even + sums[1]) % 2**32
            sums = even, (sums[1] + odd + even) % 2**32
        struct.pack_into('>2I', log, place, *sums)
    return log


def test_write_ahead_log_of_the_other_byte_order_is_read(tmp_path):
    file, log = logged(tmp_path)
    log.write_bytes(in_other_order(log.read_bytes()))
    result = check(file)
    assert (result.problems, result.messages) == ([], ALL)


@pytest.mark.parametrize('page_size', (512, 4096, 65536))
def test_log_with_old_frames_and_without_its_last_commit_is_whole(tmp_path, page_size):
    """A log is written again from its beginning, and a recorder is killed before it commits."""
    messages = drive(contact=(7.0, 8.0))
    with contextlib.closing(create_db3(
            tmp_path / 'alive.db3', messages[:200], f'PRAGMA page_size={page_size};'
            'PRAGMA journal_mode=WAL; PRAGMA cache_size=1;')) as recorder:
        for first, last in ((200, 260), (260, 290), (290, ALL)):
            recorder.execute('PRAGMA wal_checkpoint(RESTART)')  # it is begun anew, and shorter
            add_rows(recorder, messages[first:last])
        for uncommitted in (False, True):
            if uncommitted:
                recorder.execute('INSERT INTO messages VALUES (999, 1, 0, zeroblob(200000))')
            for end in ('', '-wal'):
                shutil.copy(tmp_path / f'alive.db3{end}', tmp_path / f'a.db3{end}')
            result = check(tmp_path / 'a.db3')
            assert (result.problems, result.messages) == ([], ALL)

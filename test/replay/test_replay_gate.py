# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command as a release gate: unexpected errors are not verdicts, errors are one line."""

import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
from xml.etree import ElementTree

from compiled import plain_python
import pytest
from recordings import box, check, DECLARED, drive, main, write
from sat_collision.replay import command, parallel
from storages import killed_recorder, write_mcap

CLEAR = drive(2.0, contact=(0, 0))
TOUCHING = drive(2.0, contact=(1.0, 1.5))


@pytest.fixture
def bags(tmp_path):
    """Return a clear recording and one with a contact."""
    return (str(write(tmp_path / 'clear', CLEAR)), str(write(tmp_path / 'touching', TOUCHING)))


def fails(path, options, progress=None):
    """Check a recording, but raise an unexpected error for one of them."""
    if 'touching' in path:
        raise ZeroDivisionError('no result\nat all')
    return check(path, options, progress)


@pytest.mark.parametrize('debug', (True, False))
def test_unexpected_error_is_bad_input(bags, monkeypatch, capsys, debug):
    """Never status 1, which means collision; other recordings are checked."""
    monkeypatch.setattr(command, 'check_one', fails)
    monkeypatch.setattr(command, 'check_alone', fails)
    for given in ((bags[1],), (bags[1], bags[0])):
        assert main([*given, *['--debug'] * debug]) == 3
        out, error = capsys.readouterr()
        line, = (line for line in out.splitlines() if 'problem' in line)
        assert 'ZeroDivisionError: no result at all' in line and bags[1] in line
        assert ('clear: CLEAR' in out) is (len(given) > 1)
        assert ('Traceback' in error) is debug


def test_unexpected_error_in_an_output_is_bad_input(bags, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(command._WRITERS, 'json', lambda results, path: [][0])
    for more in ([], ['--debug']):
        assert main([bags[0], '--json', str(tmp_path / 'a.json'), *more]) == 3
        error = capsys.readouterr().err
        assert error.splitlines()[-1].startswith('replay_check: --json: IndexError: ')
        assert ('Traceback' in error) is bool(more)


def test_failed_picture_does_not_take_the_others_with_it(bags, tmp_path, monkeypatch, capsys):
    """The exit status says that one is missing, and standard error why."""
    figure = pytest.importorskip('matplotlib.figure')
    drawn = []

    def fails_once(result):
        drawn.append(result)
        if len(drawn) == 1:
            raise RuntimeError('no ink')
        return figure.Figure()

    monkeypatch.setattr('sat_collision.replay.output.figure.draw_picture', fails_once)
    other = str(write(tmp_path / 'other', CLEAR))
    assert main([bags[0], other, '--plot', str(tmp_path / 'plots')]) == 3
    out, error = capsys.readouterr()
    assert 'no ink' in error and 'problem' not in out and len(drawn) == 2


def refusal(capsys, *arguments):
    """Run the command; return the one line by which it refuses to check anything."""
    assert main(arguments) == 3
    out, error = capsys.readouterr()
    assert out == '' and error.startswith('replay_check: ') and error.count('\n') == 1
    return error


@pytest.mark.parametrize('arguments, words', [
    (['--params-file', 'nowhere.yaml'], 'nowhere.yaml'),
    (['-p', 'footprint.timeout:=-1.0'], 'footprint.timeout'),
    (['-p', 'footprint.timeout'], 'NAME:=VALUE'),
    (['--expect', 'nowhere.json'], 'nowhere.json')])
def test_invalid_options_are_refused_before_the_run(bags, capsys, arguments, words):
    assert words in refusal(capsys, bags[0], *arguments)


@pytest.mark.parametrize('option, path, words', [
    ('--json', 'clear/clear.mcap', 'is an input'),
    ('--csv', 'clear/metadata.yaml', 'is an input'),
    ('--junit', 'link.xml', 'is an input'),
    ('--plot', 'params.png', 'is an input'),
    ('--json', 'stored.json', 'is an input'),
    ('--json', 'nowhere/a.json', 'no directory'),
    ('--csv', 'clear', 'is a directory'),
    *(('--plot', name, 'should end in .html for a page, or in .png, .svg or .pdf for a picture')
      for name in ('a.mp4', 'a')),
    ('--write-bag', 'clear', 'already exists'),
    ('--write-bag', 'dangling', 'already exists')])
def test_invalid_output_paths_are_refused_before_the_run(
        bags, tmp_path, capsys, option, path, words):
    if option == '--plot':
        pytest.importorskip('matplotlib')
    (tmp_path / 'params.png').write_text('/**:\n  ros__parameters:\n    release_delay: 1.0\n')
    (tmp_path / 'stored.json').write_text('{}')
    (tmp_path / 'link.xml').symlink_to(tmp_path / 'clear' / 'clear.mcap')
    (tmp_path / 'dangling').symlink_to('nowhere')
    before = {file: file.read_bytes() for file in tmp_path.rglob('*') if file.is_file()}
    error = refusal(capsys, bags[0], '--params-file', str(tmp_path / 'params.png'), '--expect',
                    str(tmp_path / 'stored.json'), '--as-live', option, str(tmp_path / path))
    assert option in error and words in error
    assert before == {file: file.read_bytes() for file in tmp_path.rglob('*') if file.is_file()}


@pytest.mark.parametrize('end', ('', '-wal', '-shm', '-journal'))
def test_files_beside_a_storage_file_are_inputs(tmp_path, capsys, end):
    """Without its write-ahead log the same recording would be clear; it may be named by a link."""
    file = killed_recorder(tmp_path / 'bag' / 'a.db3', TOUCHING, 10)
    links = tmp_path / 'links'
    links.mkdir()
    (links / 'a.db3').symlink_to(file)
    there = Path(f'{file}{end}')
    there.touch()
    before = there.read_bytes()
    for recording in (file, links / 'a.db3', links):
        assert main([str(recording), '--json', str(there)]) == 3
        assert 'is an input' in capsys.readouterr().err and there.read_bytes() == before


@pytest.mark.parametrize('more', (
    [], ['--footprint', '/footprint'], ['--as-live', '--write-bag', 'out']))
def test_path_that_cannot_be_looked_at_is_bad_input(bags, tmp_path, monkeypatch, capsys, more):
    """All others are checked; here it is too long to be a name."""
    monkeypatch.chdir(tmp_path)
    assert main(['x' * 300, bags[1], '--json', 'a.json', *more]) == 1
    out = capsys.readouterr().out
    assert 'x: BAD INPUT\n' in out and 'touching: COLLISION\n' in out


def test_folder_that_cannot_be_listed_is_bad_input(bags, monkeypatch, capsys):
    """All others are checked."""
    def listed(folder):
        if folder == Path(bags[0]):
            raise PermissionError(13, 'Permission denied')
        return iterdir(folder)

    iterdir = Path.iterdir
    monkeypatch.setattr(Path, 'iterdir', listed)
    assert main([*bags, '--json', os.devnull]) == 1
    out = capsys.readouterr().out
    assert 'clear: BAD INPUT\n' in out and 'touching: COLLISION\n' in out


def test_recordings_of_one_name_are_not_written_to_one_place(bags, tmp_path, capsys):
    """Which of them would win depended on --jobs, and one picture replaced the other."""
    pytest.importorskip('matplotlib')
    other = str(write(tmp_path / 'more' / 'clear', CLEAR))
    assert main([bags[0], other]) == 0
    capsys.readouterr()
    for arguments in (['--as-live', '--write-bag', str(tmp_path / 'out')],
                      ['--plot', str(tmp_path / 'out')]):
        assert '2 recordings are called clear' in refusal(capsys, *bags, other, *arguments)
        assert not (tmp_path / 'out').exists()


def test_recordings_are_called_by_their_folder_or_file(tmp_path, monkeypatch):
    """All of the name of a folder, also of `.`; a file's without the ending of its storage."""
    pytest.importorskip('matplotlib')
    for name in ('run.1', 'run.2', 'here'):
        write(tmp_path / name, CLEAR)
    shutil.copy(tmp_path / 'here' / 'here.mcap', tmp_path / 'a.b.mcap')
    monkeypatch.chdir(tmp_path / 'here')
    assert main(['.', '../run.1', '../run.2', '../a.b.mcap', '--as-live', '--write-bag', '../bags',
                 '--plot', '../plots']) == 0
    names = {'here', 'run.1', 'run.2', 'a.b'}
    assert {path.name for path in (tmp_path / 'bags').iterdir()} == names
    assert {path.name for path in (tmp_path / 'plots').iterdir()} == {f'{n}.png' for n in names}


def test_output_paths_of_several_recordings_are_checked(bags, tmp_path, capsys):
    """A file or a picture where a folder is needed, and one file for two options."""
    pytest.importorskip('matplotlib')
    (tmp_path / 'file').write_text('')
    (tmp_path / 'dangling').symlink_to('nowhere')
    for arguments, words in (
            (['--plot', str(tmp_path / 'file')], 'not a directory'),
            (['--plot', str(tmp_path / 'all.SVG')], 'a picture shows one'),
            (['--as-live', '--write-bag', str(tmp_path / 'file' / 'a')], 'not a directory'),
            (['--as-live', '--write-bag', str(tmp_path / 'dangling')], 'not a directory'),
            (['--json', str(tmp_path / 'a'), '--csv', str(tmp_path / 'a')], 'the same file')):
        assert words in refusal(capsys, *bags, *arguments)


@pytest.mark.parametrize('arguments, words', [
    ([], 'at least one recording'), (['--what'], 'unrecognized'), (['--clock', 'sun'], "'sun'"),
    (['--jobs', '0'], 'whole number from 1'), (['--jobs', '1.5'], 'whole number'),
    (['--jobs', 'many'], 'whole number'), (['--start', 'soon'], 'number of seconds'),
    (['--start', '-1'], 'number of seconds'), (['--start', '1e308'], 'to 1e12'),
    (['--max-memory', '0'], 'number of GB'),
    (['--param-file', 'a.yaml'], 'did you mean --params-file?'),
    (['--footprint', 'amr=/amr'], 'amr:=/amr'),
    (['--write-bag', 'a'], '--as-live'),
    *((['--as-live', option, ''], f'{option}: is empty') for option in (
        '--expect', '--json', '--plot', '--write-bag', '--footprint', '--node', '--dask')),
    ([''], 'BAG: is empty'), (['--write-example', 'a'], 'only writes an example'),
    (['--obstacles', '/a', '/b'], '--obstacles A --obstacles B')])
def test_misuse_is_one_line_and_bad_input(bags, capsys, arguments, words):
    """The status 2 of argparse would mean unknown."""
    with pytest.raises(SystemExit) as stop:
        main([bags[0], *arguments] if arguments else [])
    error = capsys.readouterr().err
    assert stop.value.code == 3 and words in error and error.count('\n') == 1
    assert error.startswith('replay_check: ')


def test_parameter_file_without_this_node_is_bad_input(bags, tmp_path, capsys):
    """Its parameters would be ignored; the message lists its nodes."""
    params = tmp_path / 'params.yaml'
    params.write_text(
        '/monitors/front:\n  ros__parameters:\n    margin: 2.5\n'
        '/monitors/rear:\n  ros__parameters:\n    margin: 0.5\n')
    arguments = [bags[0], '--params-file', str(params), '--node']
    assert main([*arguments, '/monitors/front']) == 1
    capsys.readouterr()
    for name in ('/monitors/frontt', '/footprint_monitor'):
        assert '/monitors/front, /monitors/rear; did you mean --node /monitors/' in refusal(
            capsys, *arguments, name)


@pytest.mark.parametrize('topics, arguments, words', [
    (['/footprint', '/obstacles'], ['--footprint', '/footprints'],
     '/footprints; did you mean /footprint?'),
    # Not meant by any name, as each is given a slash.
    (['footprint', '/people'], ['--obstacles', '/people'],
     '/footprint; it has footprint (polygon): choose with --footprint'),
    (['/footprint', '/people'], ['--obstacles', '/persons'],
     '/persons; it has /people (polygon): choose with --obstacles'),
    (['/footprint', '/people'], ['--footprint', '/robot', '--obstacles', '/persons'],
     '/robot; it has /footprint (polygon), /people (polygon): choose with --footprint')],
    ids=['nearest name', 'topic without a slash', 'unused topic', 'unused topics'])
def test_missing_topic_is_reported_with_what_there_is(tmp_path, capsys, topics, arguments, words):
    bag = write_mcap(tmp_path / 'a.mcap', [(topic, 0.0, box(0)) for topic in topics])
    assert main([str(bag), *arguments], None) == 2
    missing = f'the recording has no topic {words.partition(" ")[0]}'
    line, = (line for line in capsys.readouterr().out.splitlines() if missing in line)
    assert line.endswith(words)


@pytest.mark.parametrize('module, arguments, library', [
    ('distributed', ['--dask', 'tcp://127.0.0.1:9'], "'dask[distributed]'"),
    ('matplotlib', ['--plot', 'a.png'], 'matplotlib')])
def test_missing_library_is_reported_with_what_to_install(
        bags, tmp_path, monkeypatch, capsys, module, arguments, library):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    assert main([bags[0], *arguments]) == 3
    out, error = capsys.readouterr()
    assert out == '' and error.endswith(f'{module} is not installed: pip install {library}\n')


def test_scheduler_that_does_not_answer(bags, capsys, monkeypatch):
    pytest.importorskip('distributed')
    monkeypatch.setattr(parallel, '_TIMEOUT', 1)
    assert main([bags[0], '--dask', 'tcp://127.0.0.1:9']) == 3
    lines = [line for line in capsys.readouterr().err.splitlines() if 'replay_check' in line]
    assert lines[0] == 'replay_check: connecting to tcp://127.0.0.1:9'
    assert 'no scheduler answers at tcp://127.0.0.1:9' in lines[-1]


def test_topic_taken_for_a_recording_is_reported(bags, capsys):
    """As in `--obstacles a b BAG`."""
    assert main(['--obstacles', '/obstacles', '/b', bags[0]]) == 3
    out, error = capsys.readouterr()
    assert '/b is taken for a recording' in error and error.count('\n') == 1
    assert f'{bags[0]}: CLEAR' in out


@pytest.mark.parametrize('name', ('a.bag', 'a.db3'))
def test_bag_of_ros_1_is_reported(tmp_path, capsys, name):
    (tmp_path / name).write_bytes(b'#ROSBAG V2.0\n' + bytes(5000))
    assert main([str(tmp_path / name)]) == 3
    line, = (line for line in capsys.readouterr().out.splitlines() if 'problem' in line)
    assert f'rosbags-convert --src {tmp_path / name} --dst {tmp_path / "a"}' in line


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_damaged_file_is_reported_once(tmp_path, capsys, storage):
    """However often it is read."""
    bag = write(tmp_path / 'bag', drive(), storage)
    file = bag / {'mcap': 'bag.mcap', 'sqlite3': 'bag.db3'}[storage]
    data = file.read_bytes()
    file.write_bytes(data[:len(data) * 2 // 3])
    assert main([str(file)]) in (1, 3)
    assert capsys.readouterr().out.count(f'problem: {file}') == 1


def test_momentary_contact_is_not_printed_as_0_s(tmp_path, capsys):
    """Contact in the last message; obstacles arrive 100 us after the footprint."""
    messages = [('/footprint', 0.0, box(0)), ('/obstacles', 1e-4, box(3)),
                ('/obstacles', 1e-4, []), ('/footprint', 0.5, box(0)),
                ('/obstacles', 0.5, box(0.5))]
    bag = write(tmp_path / 'bag', messages, latched=('/obstacles',))
    junit = tmp_path / 'result.xml'
    assert main([str(bag), '--as-live', '--junit', str(junit)]) == 1
    out = capsys.readouterr().out
    assert re.search(r'footprint +obstacle/0 +0.500 +moment\+ +0.5 ', out)
    assert 'reason' not in out
    assert 'in contact with obstacle/0 at 0.500 s, 0.5000 m deep' in junit.read_text()


@pytest.mark.parametrize('name, encoding', [
    ('b\udcffg\x01\nx', 'utf-8'), pytest.param('bäg', 'ascii', marks=pytest.mark.long)])
def test_paths_that_are_no_text(bags, tmp_path, name, encoding):
    """Bytes that are not UTF-8, control characters, or letters that the terminal does not have."""
    pytest.importorskip('matplotlib')
    shutil.copytree(bags[0], tmp_path / name)
    outputs = [tmp_path / f'a.{kind}' for kind in ('json', 'csv', 'junit')]
    options = [f'--{one}={path}' for one, path in zip(('json', 'csv', 'junit'), outputs)]
    for plot in ('a.html', 'a.png'):
        done = subprocess.run(
            [sys.executable, '-m', 'sat_collision.replay', tmp_path / name, DECLARED, *options,
             f'--plot={tmp_path / plot}'],
            capture_output=True, env=plain_python(PYTHONIOENCODING=f'{encoding}:strict'))
        assert (done.returncode, done.stderr) == (0, b'')
        assert done.stdout.splitlines()[0].endswith(b': CLEAR') and b'problem' not in done.stdout
        assert (tmp_path / plot).exists()
    assert ElementTree.parse(outputs[2]).getroot().tag == 'testsuites'


def test_closed_output_is_no_error(bags, tmp_path):
    """As in `replay_check ... | head -1`."""
    result = tmp_path / 'result.json'
    process = subprocess.Popen([sys.executable, '-m', 'sat_collision.replay', bags[1],
                                *[bags[0]] * 3, '--json', str(result)], env=plain_python(),
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.close()
    assert (process.stderr.read(), process.wait(60)) == ('', 1)
    assert len(json.loads(result.read_text())['bags']) == 4


@pytest.mark.long
def test_interrupt_ends_all_processes(tmp_path):
    """Waiting recordings are not started."""
    bag = str(write(tmp_path / 'bag', drive(60.0)))
    process = subprocess.Popen([sys.executable, '-m', 'sat_collision.replay', *[bag] * 2000,
                                '--jobs', '2'], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               text=True, env=plain_python())
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    output, error = process.communicate(timeout=120)
    assert (process.returncode, error) == (2, 'replay_check: interrupted\n')
    assert output.count('\n') < 1000


def test_recording_is_identified_by_its_content(bags, tmp_path, capsys):
    """Under another name, in another folder and in another storage."""
    stored = str(tmp_path / 'stored.json')
    assert main([*bags, '--json', stored]) == 1
    elsewhere = tmp_path / 'elsewhere'
    elsewhere.mkdir()
    moved = [str(write(elsewhere / 'touching', CLEAR, 'sqlite3')),
             str(shutil.copytree(bags[1], elsewhere / 'clear'))]
    capsys.readouterr()
    assert main([*moved, '--expect', stored]) == 0
    other = str(write(elsewhere / 'other', drive(3.0)))
    assert main([moved[1], other, '--expect', stored]) == 1
    out = capsys.readouterr().out
    assert 'clear: expected, but not checked' in out
    assert 'other: checked, but not expected' in out
    assert main([other, '--json', str(tmp_path / 'other.json')]) == 0
    content = json.loads((tmp_path / 'other.json').read_text())
    del content['bags'][0]['content']
    (tmp_path / 'other.json').write_text(json.dumps(content))
    assert main([other, '--expect', str(tmp_path / 'other.json')]) == 0, 'an earlier version'

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The command: options, outputs, and how it starts."""

import contextlib
import csv
import json
import os
from pathlib import Path
import pty
import re
import subprocess
import sys
from xml.etree import ElementTree

from builders import collection
from compiled import plain_python
import pytest
from recordings import (
    box, COLLECTION, DECLARED, drive, main, nanoseconds, run_without, SOURCE, STAMPS, START, write)
from rosbags.rosbag2 import Reader
from sat_collision.demo import warehouse
from sat_collision.replay.losses import UNSEEN
from sat_collision.replay.output.text import Progress
from storages import channel, mcap_of, message, schema

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def bags(tmp_path):
    """Return recordings by verdict."""
    bad = tmp_path / 'bad.mcap'
    bad.write_bytes(b'')
    return {'clear': str(write(tmp_path / 'clear', drive(contact=(0, 0)))),
            'collision': str(write(tmp_path / 'collision', drive())),
            'unknown': str(write(tmp_path / 'unknown', [('/footprint', 0.0, box(0)),
                                                        ('/footprint', 9.0, box(0))])),
            'bad': str(bad)}


@pytest.mark.parametrize('given, status', [
    (['clear'], 0), (['collision'], 1), (['unknown'], 2), (['bad'], 3), (['clear', 'clear'], 0),
    (['clear', 'unknown'], 2), (['unknown', 'bad', 'clear'], 3), (['bad', 'collision'], 1)])
def test_exit_status_is_the_verdict(bags, capsys, given, status):
    """Of several recordings the worst; a collision outweighs bad input."""
    assert main([bags[name] for name in given]) == status
    for name in given:
        assert bags[name] in capsys.readouterr().out or len(given) > 1


def test_parameters_may_hold_for_the_type_that_is_recorded(tmp_path):
    """Only as a collection a map needs no set_end."""
    messages = [('/obstacles', 0.0, collection([box(3)], nanoseconds(0.0))),
                *(('/footprint', k / 10, box(0)) for k in range(9))]
    bag = write(tmp_path / 'bag', messages, types={'/obstacles': COLLECTION})
    assert main([str(bag), '-p', f'{SOURCE}.timeout:=0.0'], set_end=None) == 0


def test_polygons_of_a_message_refused_for_several_reasons(tmp_path, capsys):
    """Each reason has its count; the example of one has that of the other."""
    crossing = [(5, 5), (6, 6), (6, 5), (5, 6)]
    messages = [('/footprint', 0.0, box(0)),
                ('/obstacles', 0.1, collection([box(3), [], crossing], nanoseconds(0.1)))]
    bag = write(tmp_path / 'bag', messages, types={'/obstacles': COLLECTION})
    assert main([str(bag)], set_end=None) == 2
    out = capsys.readouterr().out
    for reason in ('empty', 'self-intersecting'):
        assert f'1 messages rejected: {reason}' in out
    assert re.search(r'the first one: .*polygon 1: .*; polygon 2: ', out)


def test_text_output(bags, capsys):
    """Times, depth and position of the contact, coverage, and reasons."""
    main([bags['collision']])
    out = capsys.readouterr().out
    assert 'COLLISION' in out and f'303 messages (footprint 101, {SOURCE} 202)' in out
    assert 'recorded motion, 10.000 s by receive time' in out
    assert re.search(
        rf'footprint +99.00 % +8.978 +0.922 +0.100 +0.000 +-0.25 m from {SOURCE}/0', out)
    assert re.search(rf'footprint +{SOURCE}/0 +3.989 +0.922 +0.25 +0.875 +0.500 +at a sample', out)
    main([bags['collision'], '--as-live'])
    out = capsys.readouterr().out
    assert 'as live, 10.000 s by receive time' in out
    assert re.search(
        rf'footprint +{SOURCE}/0 +4.000 +1.000 +0.25 +0.875 +0.500 +at a message', out)
    main([bags['unknown']])
    out = capsys.readouterr().out
    assert 'has not sent anything yet' in out and 'no topic /obstacles' in out


def test_json_has_the_documented_schema(bags, tmp_path):
    """Every key is in docs/replay_json.md, and every number is valid JSON."""
    path = tmp_path / 'result.json'
    main([*bags.values(), '--json', str(path)])
    content = json.loads(path.read_text(), parse_constant=pytest.fail)
    assert content['schema'] == 'sat_collision.replay/5'
    assert (content['verdict'], content['exit_status']) == ('collision', 1)
    assert [bag['verdict'] for bag in content['bags']] == ['clear', 'collision', 'unknown',
                                                           'bad input']
    contact, = content['bags'][1]['contacts']
    first, last = contact.pop('first'), contact.pop('last')
    assert [first - START, last - START] == pytest.approx(
        [(3.9 + 0.2 / 2.25) * 10**9, (4.9 + 0.025 / 2.25) * 10**9], abs=1000)
    assert contact == {'footprint': 'footprint', 'obstacle': f'{SOURCE}/0', 'depth': 0.25,
                       'deepest': START + 4 * 10**9, 'x': 0.875, 'y': 0.5, 'at_end': False,
                       'normal': [-1.0, 0.0], 'points': [[1.0, 1.0], [1.0, 0.0]],
                       'found': 'at a sample', 'between': [START + 39 * 10**8, START + 5 * 10**9]}
    assert {bag['question'] for bag in content['bags']} == {'recorded motion'}
    documented = (ROOT / 'docs' / 'replay_json.md').read_text()
    for key in keys_of(content):
        assert f'`{key}`' in documented, key


def keys_of(content):
    """Return the keys of all objects, except those whose keys are names."""
    if isinstance(content, list):
        return set().union(*map(keys_of, content))
    if not isinstance(content, dict):
        return set()
    inner = [value for key, value in content.items()
             if key not in ('rejected', 'examples', 'verdicts')]
    return set(content).union(*map(keys_of, inner))


def test_csv_and_junit(bags, tmp_path):
    """A row per interval; a failure per contact, an error per problem."""
    table, suites = tmp_path / 'result.csv', tmp_path / 'result.xml'
    main([*bags.values(), '--csv', str(table), '--junit', str(suites)])
    with table.open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert [row['kind'] for row in rows if row['bag'] == bags['collision']] == [
        'contact', 'unknown']
    contact = next(row for row in rows if row['kind'] == 'contact')
    assert contact['depth_m'] == '0.25' and contact['found'] == 'at a sample'
    assert [contact[name] for name in (
        'normal_x', 'normal_y', 'point_x_m', 'point_y_m', 'second_point_x_m', 'second_point_y_m')
    ] == ['-1.0', '0.0', '1.0', '1.0', '1.0', '0.0']
    assert all('sent anything' in row['reason'] or 'older' in row['reason'] for row in rows
               if row['bag'] == bags['unknown'])
    root = ElementTree.parse(suites).getroot()
    counts = {suite.get('name'): (suite.get('tests'), suite.get('errors'), suite.get('failures'))
              for suite in root}
    assert counts == {bags['clear']: ('2', '0', '0'), bags['collision']: ('2', '0', '1'),
                      bags['unknown']: ('2', '0', '1'), bags['bad']: ('2', '1', '1')}
    assert f'{SOURCE}/0' in root.find('.//failure').get('message')


def test_junit_fails_where_no_footprint_is_enabled(bags, tmp_path):
    """The verdict is unknown, and it has no case of a footprint."""
    suites = tmp_path / 'result.xml'
    assert main([bags['clear'], '-p', 'footprint.enabled:=false', '--junit', str(suites)]) == 2
    failure, = ElementTree.parse(suites).getroot().iter('failure')
    assert failure.text == 'no footprint is enabled'


def test_baseline(bags, tmp_path, capsys):
    """An expected collision is no failure; a missing one is. JUnit says the same."""
    stored, junit = str(tmp_path / 'stored.json'), tmp_path / 'a.xml'

    def failed():
        return [case.get('classname') for case in ElementTree.parse(junit).iter('testcase')
                if case.find('failure') is not None]

    assert main([bags['collision'], bags['clear'], '--json', stored]) == 1
    assert main([bags['collision'], bags['clear'], '--expect', stored, '--junit', str(junit)]) == 0
    suite, = ElementTree.parse(junit).iter('testsuite')
    assert [suite.get(key) for key in ('tests', 'failures', 'errors')] == ['2', '0', '0']
    moved = tmp_path / 'elsewhere'
    moved.mkdir()
    again = [str(write(moved / 'collision', drive(contact=(0, 0)))), bags['clear']]
    capsys.readouterr()
    assert main([*again, '--expect', stored, '--junit', str(junit)]) == 1
    out = capsys.readouterr().out
    assert f'collision: contacts.footprint - {SOURCE}/0 #1 is missing' in out
    assert 'collision: verdict is "clear", expected "collision"' in out
    assert 'clear:' not in out.replace('is "clear"', '').replace(bags['clear'], '')
    assert failed() == ['collision']
    assert main([bags['clear'], '--expect', stored, '--junit', str(junit)]) == 1
    assert 'expected, but not checked' in capsys.readouterr().out
    assert failed() == ['collision']
    Path(stored).write_text('{"schema": "other"}')
    assert main([bags['clear'], '--expect', stored]) == 3


def test_problem_of_a_recording_is_no_expected_result(tmp_path, capsys):
    """Its contacts are as expected, and so is the verdict."""
    stored = str(tmp_path / 'stored.json')
    bag = write(tmp_path / 'bag', drive())
    assert main([str(bag), '--json', stored]) == 1
    (bag / 'other.mcap').write_bytes(b'no recording')
    assert main([str(bag), '--expect', stored]) == 1
    assert re.search('bag: number of problems is [12], expected 0', capsys.readouterr().out)


def test_missing_flag_of_an_imminent_collision_is_noted(tmp_path, capsys):
    bag = str(write(tmp_path / 'bag', drive(contact=(0, 0))))
    soon = '-p', 'footprint.min_time_to_collision:=4.0'
    assert main([bag, *soon]) == 0 and 'raises no flag' not in capsys.readouterr().out
    assert main([bag, *soon, '--as-live']) == 0
    assert 'note: footprint.min_time_to_collision raises no flag' in capsys.readouterr().out


def test_max_undetermined(tmp_path, capsys):
    """Where one obstacle disappears another appears, which may be the same."""
    messages = [(topic, k / 10, points) for k in range(10) for topic, points in (
        ('/footprint', box(0)), ('/obstacles', box(5) if k < 5 else box(5)[:3]))]
    path = str(write(tmp_path / 'bag', messages))
    assert main([path, '--max-undetermined', '0.1'], STAMPS) == 0
    assert re.search(f'0.400 +0.100 +it is not known how something of {SOURCE} moved',
                     capsys.readouterr().out)
    assert main([path], STAMPS) == 2


def test_plots(bags, tmp_path):
    """One file for one recording, a folder for several."""
    pytest.importorskip('matplotlib')
    picture = tmp_path / 'picture.png'
    main([bags['collision'], '--plot', str(picture)])
    assert picture.read_bytes().startswith(b'\x89PNG')
    main([*bags.values(), '--plot', str(tmp_path / 'plots')])
    assert {path.name for path in (tmp_path / 'plots').iterdir()} == {
        'clear.png', 'collision.png', 'unknown.png', 'bad.png'}


@pytest.mark.parametrize('name, status', (('clear', 3), ('collision', 1)))
def test_output_without_space_does_not_take_others_with_it(bags, tmp_path, capsys, name, status):
    """Each says why it is not there, and verdict, report and the other outputs are."""
    full = {end: tmp_path / f'full{end}' for end in ('.json', '.csv', '.xml', '.html')}
    for path in full.values():
        path.symlink_to('/dev/full')
    options = {'--json': '.json', '--csv': '.csv', '--junit': '.xml', '--plot': '.html'}
    for option, end in options.items():
        given = {one: str(full[end] if one == option else tmp_path / f'whole{end}')
                 for one, end in options.items()}
        assert main([bags[name], *(text for pair in given.items() for text in pair)]) == status
        out, err = capsys.readouterr()
        assert f'{bags[name]}: ' in out and 'known' in out
        assert f'replay_check: {option}: [Errno 28] No space left' in err
        for one, path in given.items():
            assert one == option or Path(path).stat().st_size > 300
            if one != option:
                Path(path).unlink()


@pytest.mark.parametrize('given', (['collision'], ['collision', 'clear'], ['clear', 'clear']))
@pytest.mark.parametrize('option', ('--json', '--plot'))
def test_output_without_space_is_bad_input_where_all_else_is_as_expected(
        bags, tmp_path, capsys, given, option):
    """Of one recording and of several: a contact that is expected does not hide it."""
    given, stored = [bags[name] for name in given], str(tmp_path / 'stored.json')
    full = tmp_path / 'full.html'
    full.symlink_to('/dev/full')
    main([*given, '--json', stored])
    assert main([*given, '--expect', stored, option, str(full)]) == 3
    assert f'replay_check: {option}: [Errno 28] No space left' in capsys.readouterr().err


@pytest.mark.parametrize('name, status', (('clear', 3), ('collision', 1)))
def test_report_without_space_does_not_take_the_outputs_with_it(bags, tmp_path, name, status):
    """Nor the verdict: where there is no contact it is that of an output that is missing."""
    path = tmp_path / 'result.json'
    with open('/dev/full', 'w') as full:
        done = subprocess.run(
            [sys.executable, '-m', 'sat_collision.replay', bags[name], DECLARED, '--json',
             str(path)], stdout=full, stderr=subprocess.PIPE, text=True, env=plain_python())
    assert done.returncode == status and json.loads(path.read_text())['verdict'] == name
    assert re.fullmatch('replay_check: standard output: .*No space left on device\n', done.stderr)


def run_limited(limit, least, most, *arguments):
    """Run the command in a process with a limit of the system."""
    program = (f'import resource, sys\nresource.setrlimit(resource.{limit}, ({least}, {most}))\n'
               'from sat_collision.replay.__main__ import main\nsys.exit(main(sys.argv[1:]))')
    return subprocess.run([sys.executable, '-c', program, *arguments], capture_output=True,
                          text=True, env=plain_python())


@pytest.mark.long
def test_bag_without_space_does_not_take_the_verdict_with_it(bags, tmp_path):
    """It is not kept, as a problem of the recording says, and is missed where all is expected."""
    stored = str(tmp_path / 'stored.json')
    main([bags['collision'], '--as-live', '--json', stored])
    for number, (more, status) in enumerate((([], 1), (['--expect', stored], 3))):
        out = run_limited(
            'RLIMIT_FSIZE', 10_000, 10_000, bags['collision'], DECLARED, '--as-live',
            '--write-bag', str(tmp_path / f'{number}'), *more)
        assert out.returncode == status, out.stderr
        assert '--write-bag: not written' in out.stdout and 'obstacle/0' in out.stdout
        assert not (tmp_path / f'{number}').exists()


def test_more_files_than_may_be_open_at_first(tmp_path):
    """A recording in 200 files where a shell allows 100 open ones, and a process itself more."""
    for k in range(200):
        (tmp_path / f'{k}.mcap').write_bytes(mcap_of(
            schema(), channel(1, b'/footprint'), message(1, box(0.0), k / 10)))
    done = run_limited('RLIMIT_NOFILE', 100, 300, tmp_path)
    assert 'Too many open files' not in done.stdout + done.stderr and '200 messages' in done.stdout


def test_example(tmp_path, capsys):
    """Its contacts are those that the scene is built to have."""
    example = str(tmp_path / 'example')
    assert main(['--write-example', example]) == 0
    result = tmp_path / 'result.json'
    assert main([example, '--params-file', f'{example}/params.yaml', '--json', str(result)],
                None) == 1
    bag, = json.loads(result.read_text())['bags']
    assert bag['notes'] == [UNSEEN]
    found = {(contact['footprint'], contact['obstacle']) for contact in bag['contacts']}
    assert found == {(name, f'{source}/{key}') for name, contacts in warehouse.CONTACTS.items()
                     for source, key in contacts}
    assert len(bag['contacts']) == len(found)
    capsys.readouterr()
    assert main([example]) == 3
    assert '/forklift' in capsys.readouterr().out
    assert main(['--write-example', example]) == 3


@pytest.mark.parametrize('folder, command', [
    ('bin', 'replay_check'), ('lib/sat_collision', 'ros2 run sat_collision replay_check')])
def test_command_shown_is_the_one_installed(tmp_path, capsys, monkeypatch, folder, command):
    monkeypatch.setattr(sys, 'argv', [str(tmp_path / folder / 'replay_check')])
    example = str(tmp_path / 'example')
    assert main(['--write-example', example]) == 0
    assert f'\n  {command} {example} --params-file' in capsys.readouterr().out


def test_written_bag_does_not_overwrite(bags, tmp_path, capsys):
    to_out = '--as-live', '--write-bag', str(tmp_path / 'out')
    assert main([bags['clear'], '--as-live', '--write-bag', str(tmp_path)]) == 3
    assert 'exists' in capsys.readouterr().err
    assert main([bags['clear'], bags['collision'], *to_out]) == 1
    for name in ('clear', 'collision'):
        with Reader(tmp_path / 'out' / name) as reader:
            assert reader.message_count > 100
    capsys.readouterr()
    assert main([bags['unknown'], bags['collision'], *to_out]) == 3
    out, error = capsys.readouterr()
    assert out == '' and f"{tmp_path / 'out' / 'collision'} already exists" in error


def test_progress_is_shown_on_a_terminal_only(monkeypatch):
    """The bar appears in long runs and is removed afterwards."""
    master, slave = pty.openpty()
    now = [0.0]
    monkeypatch.setattr('time.monotonic', lambda: now[0])
    with os.fdopen(slave, 'w') as terminal:
        progress = Progress('3 of 7: bag', terminal)
        for now[0], share in ((0.5, 0.1), (2.0, 0.25), (2.01, 0.26), (6.0, 0.75)):
            progress.show(share)
        progress.clear()
    shown = ''
    with contextlib.suppress(OSError):  # the end of a terminal
        while part := os.read(master, 1000):
            shown += part.decode()
    os.close(master)
    assert [part.split('  ')[-1] for part in shown.split('\r\033[K') if part] == [
        '6 s left', '2 s left']
    assert shown.count('3 of 7: bag [') == 2 and shown.endswith('\r\033[K')
    with open(os.devnull, 'w') as file:
        Progress(stream=file).show(0.5)


def run(*arguments, **environment):
    """Run the command in another process."""
    return subprocess.run([sys.executable, '-m', 'sat_collision.replay', *arguments],
                          capture_output=True, text=True, env=plain_python(**environment))


@pytest.mark.parametrize('missing', ('yaml', 'numpy', 'sat_collision.replay.check'))
def test_failed_import_is_bad_input(bags, missing):
    """Status 3 and one line; 1 would mean a collision."""
    result = run_without([missing, 'rclpy'], bags['clear'])
    assert (result.returncode, result.stdout) == (3, '')
    line, = result.stderr.splitlines()
    assert line.startswith(f'replay_check: cannot start: {missing} is not installed')
    assert ('pip install pyyaml rosbags' in line) is (missing == 'yaml')
    result = run_without([missing], bags['clear'], '--debug')
    assert result.returncode == 3 and 'Traceback' in result.stderr


def test_installed_command_is_the_module():
    assert "'replay_check = sat_collision.replay.__main__:main'" in (ROOT / 'setup.py').read_text()


def test_help_imports_neither_numpy_nor_numba():
    assert 'BAG' in run_without(['numba', 'numpy'], '--help').stdout


def test_shell_completion(tmp_path):
    """By argcomplete."""
    pytest.importorskip('argcomplete')
    found = []
    for line in ('replay_check --clo', 'replay_check --clock '):
        answer = tmp_path / 'answer'
        run(_ARGCOMPLETE='1', _ARGCOMPLETE_SHELL='bash', _ARGCOMPLETE_IFS='|', COMP_LINE=line,
            COMP_POINT=str(len(line)), COMP_TYPE='9', _ARGCOMPLETE_STDOUT_FILENAME=str(answer))
        found.append(answer.read_text().strip().split('|'))
    assert [name.strip() for name in found[0]] == ['--clock']
    assert set(found[1]) == {'receive', 'header'}


def on_terminal(*arguments, **environment):
    """Return the output of the command on a terminal."""
    master, slave = pty.openpty()
    with os.fdopen(slave, 'w') as terminal:
        process = subprocess.Popen(
            [sys.executable, '-m', 'sat_collision.replay', *arguments], stdout=terminal,
            stderr=subprocess.PIPE, text=True, env=plain_python(TERM='xterm') | environment)
    shown = b''
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:  # the end of a terminal
            break
        shown += part
    os.close(master)
    assert process.stderr.read() == '' and process.wait(60) == 1
    process.stderr.close()
    return shown.decode()


@pytest.mark.long
def test_verdicts_have_colours_on_a_terminal_only(bags):
    """Unless NO_COLOR is set or the terminal is dumb."""
    given = bags['clear'], bags['collision']
    shown = on_terminal(*given, NO_COLOR='')
    assert re.search(r'clear: \033\[1;32mCLEAR\033\[0m', shown)
    assert shown.count('\033[1;31mCOLLISION\033[0m') == 2, 'of the recording and of both'
    for plain in (on_terminal(*given, NO_COLOR='1'), on_terminal(*given, TERM='dumb'),
                  run(*given).stdout):
        assert '\033' not in plain and 'collision: COLLISION' in plain


@pytest.mark.parametrize('storage', ('mcap', 'sqlite3'))
def test_names_of_a_recording_do_not_control_the_terminal(tmp_path, capfd, storage):
    """Neither in what was found nor in an error."""
    name = '/obstacles\x1b[2J\x07'
    bag = write(tmp_path / 'bag', [(name if topic == '/obstacles' else topic, time, points)
                                   for topic, time, points in drive()], storage)
    for arguments in ([], ['--obstacles', name]):
        main([str(bag), *arguments], set_end=None)
        out, err = capfd.readouterr()
        assert '\x1b' not in out + err and '\x07' not in out + err
        assert 'obstacles?[2J?' in out + err

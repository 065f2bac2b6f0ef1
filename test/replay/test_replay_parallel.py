# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Many recordings at once: on local processes and on a Dask cluster over TCP."""

import contextlib
from dataclasses import replace
import functools
from itertools import permutations
import multiprocessing
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import threading
import time

import pytest
from recordings import check, declared, drive, main, MARKS, write
from sat_collision.replay import command, parallel
from sat_collision.replay.model.result import Options, Verdict
from sat_collision.replay.output.bag import BagOutputs

OPTIONS = Options(parameters=declared(MARKS))
CHECK_ONE = parallel.check_one


@pytest.fixture(scope='module', autouse=True)
def plain_processes():
    """Let processes start in plain Python, which takes a third of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('NUMBA_DISABLE_JIT', '1')
        yield


@pytest.fixture
def bags(tmp_path):
    """Return recordings, every second one with a contact."""
    return [str(write(tmp_path / f'bag{k}', drive(2.0, contact=(1.0, 1.5 if k % 2 else 1.0))))
            for k in range(4)]


def summed(results):
    return {result.bag: (result.verdict, result.messages, len(result.contacts))
            for result in results}


def dies():
    os.kill(os.getpid(), signal.SIGKILL)


def fails():
    raise OSError('the disk is away')


def faulty(path, options, marks, fault, forever=False):
    """Check a recording, but with a fault at the first attempt, or at every one."""
    mark = Path(marks, f'mark_of_{Path(path).name}')
    if path.endswith('bag3') and (forever or not mark.exists()):
        mark.touch()
        fault()
    return check(path, options)


@pytest.fixture(scope='module')
def long_bags(tmp_path_factory):
    """Return recordings of ten minutes, which are unpacked before they are read."""
    folder = tmp_path_factory.mktemp('long')
    return [str(write(folder / f'bag{k}', drive(600.0), 'sqlite3', 'file')) for k in range(2)]


@pytest.fixture(scope='module')
def cluster():
    """Return the address of a Dask cluster of two worker processes, started again if they die."""
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True,
                                  protocol='tcp', dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def test_progress_of_several_jobs_counts_recordings(bags, monkeypatch):
    """Bars of single processes would overwrite each other."""
    shown = []
    monkeypatch.setattr(command.Progress, 'show', lambda _, share: shown.append(share))
    assert main([*bags, '--jobs', '2']) == 1
    assert shown == [0.25, 0.5, 0.75]


def checked(bags, options, request, on_cluster):
    """Return the results of several processes, here or on a cluster."""
    return [*(parallel.check_on_cluster(bags, options, request.getfixturevalue('cluster'))
              if on_cluster else parallel.check_here(bags, options, 2))]


@pytest.mark.parametrize('on_cluster', [False, True])
def test_several_processes_give_the_same_results(bags, request, on_cluster):
    alone = [parallel.check_one(bag, OPTIONS) for bag in bags]
    assert summed(checked(bags, OPTIONS, request, on_cluster)) == summed(alone)
    assert [result.verdict for result in alone] == [Verdict.CLEAR, Verdict.COLLISION] * 2


@pytest.mark.parametrize('fault, on_cluster', [(dies, True), *(
    pytest.param(*one, marks=pytest.mark.long)
    for one in ((fails, True), (dies, False), (fails, False)))])
def test_lost_process_is_retried(bags, tmp_path, monkeypatch, request, fault, on_cluster):
    """No result is lost or doubled."""
    monkeypatch.setattr(parallel, 'check_one', functools.partial(
        faulty, marks=str(tmp_path), fault=fault))
    results = checked(bags, OPTIONS, request, on_cluster)
    assert sorted(result.bag for result in results) == bags
    assert all(not result.problems for result in results)


def with_a_bag(path, options, marks):
    """Check a recording, but die at the first attempt, before the end of a bag is written."""
    mark = Path(marks, f'mark_of_{Path(path).name}')
    if path.endswith('bag3') and not mark.exists():
        mark.touch()
        BagOutputs.close = lambda _: dies()
    return CHECK_ONE(path, options)


@pytest.mark.long
@pytest.mark.parametrize('on_cluster', [False, True])
def test_bag_of_a_lost_process_is_written_anew(bags, tmp_path, monkeypatch, request, on_cluster):
    monkeypatch.setattr(parallel, 'check_one', functools.partial(with_a_bag, marks=str(tmp_path)))
    options = replace(OPTIONS, as_live=True, write_bag=str(tmp_path / 'out'))
    results = checked(bags, options, request, on_cluster)
    assert [result.problems for result in results] == [[]] * 4
    for bag in bags:
        assert check(tmp_path / 'out' / Path(bag).name).problems == []
    assert on_cluster or len([*(tmp_path / 'out').iterdir()]) == 4, 'its part is removed'


def test_recording_whose_result_was_lost_is_checked_again_beside_its_bag(bags, tmp_path):
    """It was with a worker that died later, as another recording was checked."""
    options = replace(OPTIONS, as_live=True, write_bag=str(tmp_path / 'out'))
    for _ in range(2):
        assert parallel.check_one(bags[0], options).problems == []
        assert check(tmp_path / 'out' / 'bag0').problems == []
        assert [path.name for path in (tmp_path / 'out').iterdir()] == ['bag0']


@pytest.mark.parametrize('place', ('file/out', 'link'))
def test_bag_that_cannot_be_written_does_not_take_contacts_with_it(bags, tmp_path, place):
    """Its folder cannot be made, or it cannot be moved to its place: a problem beside them."""
    (tmp_path / 'file').touch()
    (tmp_path / 'link').symlink_to('nowhere')
    result = parallel.check_alone(
        bags[1], replace(OPTIONS, as_live=True, write_bag=str(tmp_path / place)))
    problem, = result.problems
    assert problem.startswith(f'{bags[1]}: --write-bag: not written: ')
    assert result.contacts and result.verdict is Verdict.COLLISION
    assert [*tmp_path.glob('.unfinished*')] == []


def test_bag_of_a_check_that_stops_early_is_not_kept(bags, tmp_path, monkeypatch):
    """It has no end, though nothing was wrong with writing it."""
    monkeypatch.setattr('sat_collision.replay.check.Timeline.finish', lambda *_: fails())
    out = tmp_path / 'out' / 'bag'
    result = parallel.check_alone(bags[0], replace(OPTIONS, as_live=True, write_bag=str(out)))
    assert result.problems == [f'{bags[0]}: the disk is away']
    assert [*out.parent.iterdir()] == []


def test_bag_of_one_recording_is_where_it_is_asked_for_on_a_cluster_too(bags, tmp_path, cluster):
    """Several have a folder in which each has its own."""
    out = tmp_path / 'out'
    assert main([bags[0], '--as-live', '--write-bag', str(out), '--dask', cluster]) == 0
    assert {path.name for path in out.iterdir()} == {'out.mcap', 'metadata.yaml'}


def dies_or_lasts(path, options, marks):
    """Die at the first attempt, and let the second one last."""
    if not Path(marks, 'died').exists():
        Path(marks, 'died').touch()
        dies()
    Path(marks, 'lasts').touch()
    time.sleep(20.0)


def test_interrupt_ends_a_check_that_is_run_again(tmp_path, monkeypatch):
    """The command would not end before it."""
    def interrupt():
        while not Path(tmp_path, 'lasts').exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(parallel, 'check_one', functools.partial(
        dies_or_lasts, marks=str(tmp_path)))
    other = multiprocessing.get_context('spawn').Process(target=time.sleep, args=(60.0,))
    other.start()
    children = multiprocessing.active_children()
    threading.Thread(target=interrupt).start()
    with pytest.raises(KeyboardInterrupt):
        next(parallel.check_here(['bag'], OPTIONS, 2))
    assert {*multiprocessing.active_children()} == {*children}, 'those of others go on'
    other.terminate()
    other.join()


@pytest.mark.long
def test_recording_that_kills_every_process(bags, tmp_path, monkeypatch):
    """It is bad input after three attempts; all others are checked."""
    monkeypatch.setattr(parallel, 'check_one', functools.partial(
        faulty, marks=str(tmp_path), fault=dies, forever=True))
    results = {result.bag: result for result in parallel.check_here(bags, OPTIONS, 2)}
    assert sorted(results) == bags
    assert [bag for bag in bags if results[bag].problems] == [bags[3]]
    assert '3 attempts' in results[bags[3]].problems[0]


@pytest.mark.long
def test_cluster_without_workers_left_is_reported(bags, tmp_path, monkeypatch):
    """Instead of waiting for ever: here its one worker dies, and nothing starts it again."""
    distributed = pytest.importorskip('distributed')
    monkeypatch.setattr(parallel, '_NO_WORKER', 2.0)
    monkeypatch.setattr(parallel, 'check_one', functools.partial(
        faulty, marks=str(tmp_path), fault=dies, forever=True))
    with distributed.LocalCluster(n_workers=0, protocol='tcp', dashboard_address=None) as cluster:
        worker = subprocess.Popen(
            [sys.executable, '-m', 'distributed.cli.dask_worker', cluster.scheduler_address,
             '--no-nanny', '--nthreads', '1', '--no-dashboard'],
            env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}, stderr=subprocess.PIPE)
        cluster.wait_for_workers(1)
        results = {result.bag: result for result in parallel.check_on_cluster(
            bags, OPTIONS, cluster.scheduler_address)}
        worker.communicate()
    assert sorted(results) == bags
    assert 'the cluster has no worker left' in results[bags[3]].problems[0]


@pytest.mark.long
def test_relative_paths_are_those_of_the_command(bags, cluster, tmp_path, monkeypatch, capsys):
    """Workers are in another folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'bad.mcap').write_bytes(b'none')
    given = [*(Path(bag).name for bag in bags), 'bad.mcap']
    outs = []
    for number, more in enumerate(([], ['--dask', cluster])):
        assert main([*given, '--as-live', '--write-bag', f'out{number}', *more]) == 1
        outs.append(capsys.readouterr().out)
        assert {path.name for path in Path(f'out{number}').iterdir()} == {*given[:-1]}
    assert outs[0] == outs[1] and 'bad.mcap: BAD INPUT' in outs[0] and str(tmp_path) not in outs[0]


def begun(arguments, folder, ending, count=1, **environment):
    """Start the command in a session of its own; return it when so many files are there."""
    process = subprocess.Popen(
        [sys.executable, '-m', 'sat_collision.replay', *arguments], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        env={**os.environ, **environment})
    while len([*folder.rglob(f'*.{ending}')]) < count:
        assert process.poll() is None
        time.sleep(0.01)
    return process


def is_interrupted(process):
    """Wait until it ends; return whether it does so as interrupted, without a traceback."""
    _, error = process.communicate(timeout=120)
    return process.returncode == 2 and error.endswith('replay_check: interrupted\n') and all(
        line.startswith('replay_check: ') for line in error.splitlines())


@pytest.mark.parametrize('number, jobs', (
    (signal.SIGINT, '2'), (signal.SIGTERM, '1'),
    *(pytest.param(*one, marks=pytest.mark.long)
      for one in ((signal.SIGINT, '1'), (signal.SIGTERM, '2')))))
def test_signal_leaves_no_temporary_files(long_bags, tmp_path, number, jobs):
    """Whether it comes from the terminal, to all processes, or to the command only."""
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    process = begun([*long_bags * 3, '--jobs', jobs], temporary, 'db3', int(jobs),
                    TMPDIR=str(temporary))
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    assert is_interrupted(process)
    assert [*temporary.iterdir()] == []


def test_killed_command_leaves_no_process(long_bags, tmp_path):
    """Its workers end with it; they have its standard output open as long as they run."""
    process = begun([*long_bags, '--jobs', '2'], tmp_path, 'db3', 2, TMPDIR=str(tmp_path))
    try:
        process.kill()
        process.communicate(timeout=60)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.parametrize('count', (1, pytest.param(2, marks=pytest.mark.long)))
def test_interrupt_leaves_no_part_of_a_bag(long_bags, tmp_path, count):
    """Neither under its name nor in a hidden folder, though it ends the processes of jobs, too."""
    process = begun([*long_bags[:count], '--jobs', f'{count}', '--as-live', '--write-bag',
                     str(tmp_path / 'out')], tmp_path, 'mcap', count)
    os.killpg(process.pid, signal.SIGINT)
    assert is_interrupted(process)
    assert [*tmp_path.rglob('*')] == [tmp_path / 'out'] * (count - 1)


@pytest.mark.long
def test_reports_are_in_the_order_of_the_command(bags, monkeypatch, capsys):
    """Whichever is checked first, and if one is given twice."""
    given = [bags[2], bags[0], bags[2], bags[1]]
    assert main(given) == 1
    alone = capsys.readouterr().out
    assert [line.split(':')[0] for line in alone.splitlines()
            if line.startswith(tuple(given))] == given
    for order in {*permutations(given)}:
        monkeypatch.setattr(command, 'check_here', lambda _, options, jobs: (
            parallel.check_one(bag, options) for bag in order))
        assert main([*given, '--jobs', '2']) == 1
        assert capsys.readouterr().out == alone


def test_recording_has_one_name_however_it_is_given(bags, tmp_path, monkeypatch, capsys, cluster):
    """With slashes and dots, and in two ways at once: none is left out, and none is another's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'there' / 'inside').mkdir(parents=True)
    Path('link').symlink_to('there/inside')
    write(tmp_path / 'there' / 'bag0', drive(2.0, contact=(1.0, 1.5)))
    for given in (['bag0', './bag1', 'bag1'], ['bag1/', './/bag0', 'link/../bag0']):
        outs = []
        for more in (['--jobs', '1'], ['--jobs', '2'], ['--dask', cluster]):
            assert main([*given, *more]) == 1
            outs.append(capsys.readouterr().out)
        assert outs[0] == outs[1] == outs[2] and '  2 contacts, ' in outs[0]
        assert re.findall('(.*): (CLEAR|COLLISION)', outs[0]) == [
            (str(Path(bag)), 'CLEAR' if bag.endswith('bag0') and 'link' not in bag else
             'COLLISION') for bag in given]

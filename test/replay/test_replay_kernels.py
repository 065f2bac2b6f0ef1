# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""When kernels are compiled before a check, and the messages about it."""

import math
import os
import subprocess
import sys

from builders import collection, polygon_2d, serialised
from compiled import COMPILED_FILES, copy_package, MARK
import pytest
from recordings import (
    box, COLLECTION, DECLARED, drive, INSTANCE, main, POLYGON_2D, SOURCE, STAMPS, START, write)
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.replay import kernels
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.bag.storage import Limits

pytestmark = pytest.mark.skipif(not COMPILED, reason='nothing is compiled here')

INTERSECTS = 'from sat_collision import intersects; print(intersects([(0, 0)], [(0, 0)]))'


@pytest.fixture
def start(tmp_path, request):
    """Run a program in a folder where no kernels, or only absent ones, are to be compiled yet."""
    copy_package(tmp_path, getattr(request, 'param', COMPILED_FILES))

    def start(*arguments, **environment):
        return subprocess.run(
            [sys.executable, *arguments], cwd=tmp_path, capture_output=True, text=True,
            env={**os.environ, 'PYTHONPATH': str(tmp_path), 'NUMBA_CACHE_DIR': '',
                 'HOME': str(tmp_path / 'home'), **environment})
    return start


def compiled(folder):
    return {path.name for path in (folder / 'sat_collision').rglob('*.nbc')}


def long_recording(path, count=None):
    """Return a recording, by default too long for plain Python."""
    pairs = (count or kernels._FEW) // 2 + 1
    return str(write(path, [(topic, k / 1000, box(x)) for k in range(pairs)
                            for topic, x in (('/footprint', 0), ('/obstacles', 3))]))


@pytest.mark.long
def test_prepared_kernels_are_all_that_commands_need(start, tmp_path):
    """After preparation neither replay nor the library compiles anything."""
    small = str(write(tmp_path / 'small', drive(1.0)))
    result = start('-m', 'sat_collision.replay', small, DECLARED)
    assert (result.returncode, result.stderr, compiled(tmp_path)) == (0, '', set()), (
        'a check of few messages is done before kernels would be compiled')
    result = start('-m', 'sat_collision.replay.kernels')
    assert (result.returncode, result.stderr) == (0, '')
    assert 'the first start after an installation compiles them' in result.stdout
    folder = tmp_path / 'sat_collision' / 'geometry' / 'compiled' / '__pycache__'
    assert f'kept in {folder}' in result.stdout
    prepared = compiled(tmp_path)
    assert len(prepared) > 20
    assert any(name.startswith('nearness.nearest_in_steps') for name in prepared), (
        'of sets taken together')
    for arguments in (('-m', 'sat_collision.replay', small),
                      ('-m', 'sat_collision.replay', long_recording(tmp_path / 'long'),
                       f'--param={SOURCE}.set_end:={STAMPS}'),
                      ('-m', 'sat_collision.replay', '--as-live', small),
                      ('-c', INTERSECTS)):
        assert start(*arguments).stderr == ''
    assert compiled(tmp_path) == prepared


def test_plain_python_has_no_kernels_to_prepare(start):
    result = start('-m', 'sat_collision.replay.kernels', NUMBA_DISABLE_JIT='1')
    assert (result.returncode, result.stderr) == (0, '')
    assert result.stdout.startswith('nothing to do') and result.stdout.count('\n') == 1


@pytest.mark.long
@pytest.mark.parametrize('start', [('intersection.*.nb?', 'distance.*.nb?')], indirect=True,
                         ids=['without two kernels'])
def test_library_says_that_it_compiles(start, tmp_path):
    """Before each wait, first with the folder of the cache; nothing without a compiler."""
    before = compiled(tmp_path)
    result = start('-c', INTERSECTS, NUMBA_DISABLE_JIT='1')
    assert (result.stdout, result.stderr, compiled(tmp_path)) == ('True\n', '', before)
    measures = INTERSECTS + '; import sat_collision; sat_collision.separation([(0, 0)], [(1, 0)])'
    first, *others = start('-c', measures).stderr.splitlines()
    assert str(tmp_path) in first
    assert first.startswith('sat_collision: compiling kernels, for arrays_meet, some seconds')
    assert others == ['sat_collision: compiling kernels, for measure_arrays']
    result = start('-c', measures)
    assert (result.stdout, result.stderr) == ('True\n', '')


@pytest.mark.long
@pytest.mark.parametrize('start', [(MARK,)], indirect=True, ids=['without the mark'])
def test_program_that_has_kernels_may_check_a_recording(start, tmp_path):
    """Plain Python is not chosen for few messages where kernels are in use already."""
    small = str(write(tmp_path / 'small', drive(1.0)))
    result = start('-c', f"""{INTERSECTS}
from sat_collision.replay.__main__ import main
print(main([{small!r}, {DECLARED!r}]))
import sat_collision
print(sat_collision.separation([(0, 0)], [(1, 0)]))
""")
    lines = result.stdout.splitlines()
    assert (lines[0], lines[-2:]) == ('True', ['0', '1.0']), result.stdout + result.stderr


def test_plain_python_takes_polygons_of_many_vertices(start, tmp_path, capsys):
    """As kernels do: what is refused must not depend on whether any are compiled."""
    star = [((1 + k % 2) * math.cos(2 * math.pi * k / 130),
             (1 + k % 2) * math.sin(2 * math.pi * k / 130)) for k in range(130)]
    bag = str(write(tmp_path / 'bag', [
        sent for k in range(3) for sent in (('/footprint', k / 10, box(0)),
                                            ('/obstacles', k / 10, star),
                                            ('/obstacles', k / 10, []))]))
    results = [tmp_path / name for name in ('compiled.json', 'plain.json')]
    assert main([bag, DECLARED, '--json', str(results[0])]) == 1, capsys.readouterr().out
    plain = start('-m', 'sat_collision.replay', bag, DECLARED, '--json', str(results[1]),
                  NUMBA_DISABLE_JIT='1')
    assert plain.returncode == 1, plain.stdout
    assert results[0].read_bytes() == results[1].read_bytes()


@pytest.fixture
def unprepared(tmp_path, monkeypatch):
    """Pretend that no kernels are cached, and undo the choice afterwards."""
    monkeypatch.setattr(kernels, '_mark', lambda: tmp_path / 'mark')
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    return tmp_path


@pytest.mark.parametrize('kind, message, count, is_long', [
    (INSTANCE, lambda stamp: serialised(box(0), stamp, 'map', 7), 1100, True),
    (POLYGON_2D, lambda stamp: polygon_2d(box(0), stamp), 1100, True),
    (COLLECTION, lambda stamp: collection(300 * [box(0)], stamp), 4, True),
    (COLLECTION, lambda stamp: collection(300 * [box(0)], stamp), 2, False)])
def test_polygons_of_all_types_are_compiled_for(unprepared, monkeypatch, kind, message, count,
                                                is_long):
    """Of a collection each polygon counts, as they are what takes time."""
    monkeypatch.setattr(kernels, '_FEW', 1000)
    bag = write(unprepared / 'bag', [('/obstacles', k / 1000, message(START + k * 10**6))
                                     for k in range(count)], types={'/obstacles': kind})
    assert kernels.choose([str(bag)], Limits()) == is_long


@pytest.mark.parametrize('problem', [None, 'no space left on device'])
def test_mark_says_that_kernels_are_kept(unprepared, monkeypatch, problem):
    monkeypatch.setattr(kernels, 'kernel_problem', lambda: problem)
    monkeypatch.setattr(kernels, '_warm_up', lambda: None)
    kernels.prepare(lambda *_: None)
    assert (unprepared / 'mark').exists() == (problem is None)


def test_long_recordings_are_compiled_for(unprepared, monkeypatch):
    """One, or several together; cached kernels are always used."""
    assert not kernels.choose([long_recording(unprepared / 'drive', 5_000)], Limits())
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    small = str(write(unprepared / 'small', drive(1.0)))
    monkeypatch.setattr(kernels, '_FEW', 1000)
    long = long_recording(unprepared / 'long')
    assert kernels.choose([small, long], Limits())
    assert os.environ['NUMBA_DISABLE_JIT'] == '0'
    monkeypatch.setattr(kernels, '_FEW', 60)
    assert not kernels.choose([small], Limits())
    assert os.environ['NUMBA_DISABLE_JIT'] == '1', 'for processes that it starts, too'
    monkeypatch.setenv('NUMBA_DISABLE_JIT', '0')
    assert kernels.choose([small, small], Limits())
    (unprepared / 'mark').touch()
    assert not kernels.choose([small], Limits())
    assert os.environ['NUMBA_DISABLE_JIT'] == '0'


def test_recording_that_cannot_be_counted_is_not_compiled_for(unprepared, monkeypatch):
    """Its check says why, and those of others go on, after an unexpected error, too."""
    def opened(recording):
        if recording.path.name == 'broken':
            raise ValueError('broken')
        return enter(recording)

    enter = Recording.__enter__
    monkeypatch.setattr(Recording, '__enter__', opened)
    monkeypatch.setattr(kernels, '_FEW', 60)
    small = str(write(unprepared / 'small', drive(1.0)))
    assert kernels.choose(['broken', small, small], Limits())
    assert not kernels.choose(['broken', small], Limits())

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The scene of the demo has exactly its listed contacts; the demo and the first try report."""

import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from conftest import locked_domain
import numpy as np
import pytest
from sat_collision.demo import publish, warehouse

shapely = pytest.importorskip('shapely')


@pytest.mark.parametrize('name', warehouse.FOOTPRINTS)
def test_contacts_of_the_scene(name):
    """Finely sampled and as float32, each robot touches its obstacles in the listed order."""
    static = [shapely.Polygon(p) if len(p) > 2 else shapely.LineString(p)
              for p in warehouse.STATIC]
    touched = []
    for time in np.arange(0.0, warehouse.DURATION, 0.01):
        robot = shapely.Polygon(warehouse.footprint(name, time).astype(np.float32))
        now = [('warehouse', k) for k, body in enumerate(static) if robot.intersects(body)]
        if robot.intersects(shapely.Polygon(warehouse.person(time).astype(np.float32))):
            now.append(('people', 0))
        if not touched or touched[-1] != now:
            touched.append(now)
    expected = [[]]
    for contact in warehouse.CONTACTS[name]:
        expected += [[contact], []]
    assert touched == expected


def test_robot_would_hit_the_person_without_braking():
    """Whenever it starts in the first 2.5 s."""
    for start in (0.0, 2.5):
        touched = [shapely.intersects(shapely.Polygon(warehouse.courier(1.2 * time)),
                                      shapely.Polygon(warehouse.person(start + time)))
                   for time in np.arange(0.0, 5.0, 0.01)]
        assert any(touched) and not touched[0]


def test_first_demo_does_not_wait_for_the_compiler(tmp_path):
    """After an installation the node runs in plain Python."""
    pytest.importorskip('numba')
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)}
    environment.pop('NUMBA_DISABLE_JIT', None)
    first = subprocess.run(
        [sys.executable, '-c', 'import os, sat_collision.demo.__main__ as demo\n'
         'demo.compile_nothing()\nprint(os.environ.get("NUMBA_DISABLE_JIT"))'],
        env=environment, capture_output=True, text=True, timeout=60, check=True)
    assert first.stdout == '1\n'


@pytest.fixture
def viewer():
    """Skip tests of the viewer where its libraries are missing."""
    pytest.importorskip('rclpy')
    pytest.importorskip('matplotlib')


def test_demo_and_tests_do_not_hear_each_other(viewer):
    """A monitor of a test that runs beside the demo publishes in another domain."""
    from sat_collision.demo.show import DOMAINS
    for _ in range(200):
        with locked_domain() as number:
            assert number not in DOMAINS


@pytest.mark.long
def test_demo_succeeds(viewer, tmp_path):
    """Node, publisher and viewer run as three processes over DDS."""
    from PIL import Image
    picture, movie = tmp_path / 'demo.png', tmp_path / 'demo.gif'
    result = subprocess.run([sys.executable, '-m', 'sat_collision.demo', '--picture', picture,
                             '--movie', movie], capture_output=True, text=True, timeout=240)
    assert result.returncode == 0, result.stdout + result.stderr
    assert 'the flags are right' in result.stdout
    times = [float(time) for time in re.findall(r'^ *([0-9.]+) s ', result.stdout, re.MULTILINE)]
    assert times[0] == 0.0 and times == sorted(times)
    assert picture.read_bytes().startswith(b'\x89PNG')
    with Image.open(movie) as frames:
        assert frames.format == 'GIF' and frames.n_frames > 20
        # The first frame shows a contact in red.
        red, green, blue = np.moveaxis(np.asarray(frames.convert('RGB')), 2, 0)
        assert ((red > 200) & (green < 60) & (blue < 60)).any()
    assert movie.stat().st_size < 3e6


@pytest.fixture
def demo(viewer, run, tmp_path):
    """Return the process of the demo, with its children in a session of its own."""
    return run('-m', 'sat_collision.demo', '--picture', str(tmp_path / 'demo.png'),
               '--movie', str(tmp_path / 'demo.gif'), start_new_session=True,
               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def test_demo_is_interrupted_while_it_loads(demo):
    """Nothing is printed."""
    while 'matplotlib' not in Path(f'/proc/{demo.pid}/maps').read_text():
        assert demo.poll() is None
    demo.send_signal(signal.SIGINT)
    assert demo.communicate(timeout=60)[0] == ''
    assert demo.returncode == -signal.SIGINT


@pytest.mark.parametrize('send, number', [(os.killpg, signal.SIGINT), (os.kill, signal.SIGTERM)],
                         ids=['interrupt of all', 'end of the first'])
def test_demo_is_ended_while_the_scene_plays(demo, send, number):
    """All of its processes end, without a traceback."""
    while 'collision: False' not in (line := demo.stdout.readline()):
        assert line
    send(demo.pid, number)
    output, _ = demo.communicate(timeout=60)
    assert 'Traceback' not in output and 'Error' not in output, output
    assert demo.returncode == 128 + number
    with pytest.raises(ProcessLookupError):
        os.killpg(demo.pid, 0)


@pytest.mark.parametrize('option', ['--picture', '--movie'])
def test_demo_needs_a_folder_for_its_pictures(viewer, tmp_path, option):
    """It says so at once, not after the scene."""
    result = subprocess.run([sys.executable, '-m', 'sat_collision.demo', option,
                             tmp_path / 'nowhere' / 'x.png'],
                            capture_output=True, text=True, timeout=60)
    assert result.returncode == 2
    assert result.stderr.splitlines()[-1].startswith('sat_collision_demo: error: cannot write')


def test_what_the_first_try_does_is_printed(capsys, monkeypatch):
    """Without publishing anything."""
    monkeypatch.setattr(sys, 'argv', ['publish.py', '--help'])
    with pytest.raises(SystemExit):
        publish.main()
    assert 'a robot that drives into a post' in capsys.readouterr().out


def test_what_the_node_says_is_printed(start, run):
    """A contact and its end, from publishers in a process of their own, until an interrupt."""
    pytest.importorskip('rclpy')
    start()
    process = run('-m', 'sat_collision.demo.publish', stdout=subprocess.PIPE, text=True)
    said = [process.stdout.readline() for _ in range(2)]
    while not ('/footprint_monitor: in contact with obstacle/0\n' in said
               and said[-1] == '/footprint_monitor: clear\n'):
        said.append(process.stdout.readline())
        assert said[-1], said
    assert said[0].startswith('publishing /footprint')
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 0

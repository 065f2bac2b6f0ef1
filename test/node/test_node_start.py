# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Starts of the node and of other entry points: no write access, no compiler, no kernels yet."""

import math
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time

from builders import box
from compiled import COMPILED_FILES, copy_package, FOR_DISTANCES
from hardship import allow_writing, forbid_writing, without_privileges
from harness import lines_until
import pytest
from sat_collision.geometry.compiled.jit import COMPILED

# Far less than the time to compile all kernels, in s.
TO_END = 20.0


@pytest.fixture
def place(tmp_path, request):
    """
    Return a folder with the package and an empty home.

    Nothing is compiled of the package, or what the test does not name as absent.
    """
    copy_package(tmp_path, getattr(request, 'param', COMPILED_FILES))
    yield tmp_path
    allow_writing(tmp_path)


@pytest.fixture
def start(place, domain):
    """Start a program there, without help from the user's environment."""
    started = []

    def start(*arguments, **environment):
        started.append(subprocess.Popen(
            [sys.executable, *arguments], cwd=place / 'home', text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=without_privileges,
            env={**os.environ, 'HOME': str(place / 'home'), 'ROS_LOG_DIR': '',
                 'PYTHONPATH': str(place), 'ROS_DOMAIN_ID': str(domain), 'NUMBA_CACHE_DIR': '',
                 'XDG_CACHE_HOME': '', 'PYTHONUNBUFFERED': '1', **environment}))
        return started[-1]
    yield start
    for process in started:
        process.kill()
        process.communicate()


def stopped(node):
    """Stop a node by a signal; return its exit status and the rest of its output."""
    node.terminate()
    rest, _ = node.communicate(timeout=60)
    return node.returncode, rest


def await_ends(helpers, sent):
    """Wait until processes have ended to whose parent a signal was sent then."""
    while any(is_running(helper) for helper in helpers):
        assert time.monotonic() - sent < TO_END, 'the helper goes on'
        time.sleep(0.01)


def without_distances(test):
    """Run a long test where all is compiled but the kernels for distances."""
    for mark in (pytest.mark.long, pytest.mark.skipif(not COMPILED, reason='nothing is compiled'),
                 pytest.mark.parametrize('place', [FOR_DISTANCES], indirect=True,
                                         ids=['without distances'])):
        test = mark(test)
    return test


def test_node_without_write_access(start, place):
    """It logs one line for each folder, runs, and stops on a signal."""
    forbid_writing(place)
    node = start('-m', 'sat_collision.node', NUMBA_DISABLE_JIT='1')
    lines = lines_until(node, 'on /obstacles')
    assert sum('log' in line and 'not to a file' in line for line in lines) == 1, lines
    status, rest = stopped(node)
    assert status == 0 and 'Traceback' not in ''.join([*lines, rest])


@pytest.mark.parametrize('arguments', [('-c', 'from sat_collision import intersects'),
                                       ('-m', 'sat_collision.replay', 'nowhere')])
def test_import_and_replay_without_write_access(start, place, arguments):
    """One line about kernels if any are compiled, and no traceback."""
    forbid_writing(place)
    output, _ = start(*arguments).communicate(timeout=120)
    lines = [line for line in output.splitlines() if 'compiled kernels' in line]
    assert len(lines) == COMPILED and 'Traceback' not in output, output


@pytest.mark.parametrize('broken', [False, True], ids=['missing', 'broken'])
def test_node_without_a_compiler(start, place, peer, broken):
    """
    The log names plain Python as its kernel, with a warning only if it is broken.

    What would take plain Python too long is refused.
    """
    if broken:
        pytest.importorskip('numba')
        (place / 'llvmlite.py').write_text("raise OSError('no libllvmlite.so')")
    else:
        (place / 'numba.py').write_text("raise ModuleNotFoundError('no numba', name='numba')")
    node = start('-m', 'sat_collision.node')
    text = ''.join(lines_until(node, 'on /obstacles'))
    assert 'ready' in text and ('WARN' in text) is broken
    assert ('plain Python: OSError: no libllvmlite.so' if broken else '(plain Python)') in text
    peer.send('obstacles', [((1 + k % 2) * math.cos(2 * math.pi * k / 130),
                             (1 + k % 2) * math.sin(2 * math.pi * k / 130)) for k in range(130)])
    lines_until(node, '130 vertices, but at most 128')
    assert stopped(node)[0] == 0


@without_distances
def test_flags_are_published_before_distances_can_be_measured(start, peer):
    """A first start publishes flags early, and separations once their kernels are compiled."""
    # If an answer waited for the compiler, a watchdog would raise the flag, too.
    node = start('-m', 'sat_collision.node', '--ros-args', '-p', 'watchdog:=0.0')
    lines_until(node, 'distances are measured later')
    flags, separations = peer.listen('~/collision'), peer.listen('~/footprint/separation')
    states, markers = peer.listen('~/state'), peer.listen('~/markers')

    def publishes(x, collides):
        peer.send('footprint', box(0.0))
        peer.send_set('obstacles', box(x))
        peer.spin(0.05)
        return flags and flags[-1].data is collides
    peer.until(lambda: publishes(9.0, False), 'a clear flag')
    # Setting a parameter that needs no distances does not wait for their kernels.
    assert peer.set_parameters(marker_rate=20.0) == [None]
    peer.until(lambda: publishes(0.5, True), 'a raised flag')
    del separations[:]
    peer.until(lambda: len(separations) > 3)
    assert all(math.isnan(one.data) for one in separations) and not markers
    peer.until(lambda: states[-1].status[0].message.endswith(
        '; distances are not measured yet: their kernels are being compiled'), 'why in the state')
    lines_until(node, 'distances are measured after')
    peer.until(lambda: publishes(9.0, False) and markers
               and separations[-1].data == pytest.approx(8.0, abs=1e-9)
               and states[-1].status[0].message == 'clear', 'the separation')
    assert stopped(node)[0] == 0


@without_distances
def test_margin_needs_distances_from_the_start(start):
    """A first start with a margin publishes no flag before it can measure."""
    node = start('-m', 'sat_collision.node', '--ros-args', '-p', 'margin:=0.5')
    assert 'distances are measured after' in ''.join(lines_until(node, 'on /obstacles'))
    assert stopped(node)[0] == 0


@pytest.mark.long
@pytest.mark.parametrize('number', (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
def test_signal_during_the_first_start(start, number):
    """While kernels compile in this process and in its helper, both end with status 0."""
    pytest.importorskip('numba')
    rng = random.Random(number)
    node = start('-m', 'sat_collision.node')
    lines = lines_until(node, 'preparing kernels')
    time.sleep(rng.uniform(0.0, 6.0))
    helpers = children(node.pid)
    sent = time.monotonic()
    node.send_signal(number)
    rest, _ = node.communicate(timeout=60)
    assert time.monotonic() - sent < TO_END
    assert (node.returncode, 'Traceback' in ''.join([*lines, rest])) == (0, False), rest
    assert 'distances are measured after' not in rest, 'it went on to the end'
    await_ends(helpers, sent)


@without_distances
def test_no_process_is_left_when_the_node_has_ended(start, peer):
    """It is stopped while others still compile the kernels for distances."""
    node = start('-m', 'sat_collision.node')
    peer.until(peer.status, 'it runs')
    helpers = children(node.pid)
    assert stopped(node)[0] == 0
    assert helpers and not any(is_running(helper) for helper in helpers)


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='plain Python has the verdict by then')
@pytest.mark.parametrize('seed', range(3))
def test_interrupt_during_the_first_replay(start, place, seed):
    """While kernels compile, in callbacks that swallow exceptions; there is no verdict."""
    pytest.importorskip('rosbags')
    from recordings import drive, write
    # Enough messages for kernels to be compiled.
    bag = write(place / 'bag', drive(200.0, 40.0))
    replay = start('-m', 'sat_collision.replay', str(bag))
    time.sleep(random.Random(seed).uniform(1.5, 6.0))
    sent = time.monotonic()
    replay.send_signal(signal.SIGINT)
    output, _ = replay.communicate(timeout=60)
    assert time.monotonic() - sent < TO_END, output
    assert (replay.returncode, output.splitlines()[-1]) == (2, 'replay_check: interrupted')
    assert 'Traceback' not in output, output


@pytest.mark.skipif(not COMPILED, reason='nothing is compiled')
def test_interrupt_while_kernels_are_prepared(start):
    """Nothing more is printed, and no process is left."""
    process = start('-m', 'sat_collision.replay.kernels')
    lines_until(process, 'preparing kernels')
    helpers = children(process.pid)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=TO_END)
    assert (process.returncode, output) == (-signal.SIGINT, '')
    await_ends(helpers, time.monotonic())


def test_interrupt_within_generated_code(start, place):
    """With a half-made object whose destructor fails; only the interrupt is reported."""
    (place / 'home' / 'interrupted.py').write_text("""
import os, signal, sys
from sat_collision.replay import __main__
from sat_collision.replay import arguments

class HalfMade:
    def __init__(self):
        os.kill(os.getpid(), signal.SIGINT)
        self.pointer = None

    def __del__(self):
        del self.pointer

arguments.parse = lambda args: exec('HalfMade()')
sys.exit(__main__.main([]))
""")
    replay = start('-m', 'interrupted')
    output, _ = replay.communicate(timeout=60)
    assert (replay.returncode, output.splitlines()) == (2, ['replay_check: interrupted'])


def children(pid):
    """Return the processes that a process has started."""
    return [int(child) for child in Path(f'/proc/{pid}/task/{pid}/children').read_text().split()]


def is_running(pid):
    try:
        return ') Z ' not in Path(f'/proc/{pid}/stat').read_text()
    except FileNotFoundError:
        return False

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Starts of the node and of other entry points, with nothing prepared; its clocks and ticks."""

from functools import partial
import itertools
import math
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

from builders import box, serialised
from compiled import (
    allow_writing, COMPILED_FILES, copy_package, FOR_DISTANCES, forbid_writing, without_privileges)
from harness import APART, health, LASTING, lines_until, SECOND, to_parameters, to_time, TOUCHING
import pytest
import rclpy
from rosgraph_msgs.msg import Clock
from sat_collision.geometry.compiled.jit import COMPILED
from sat_collision.node.footprint_monitor import FootprintMonitor
from sat_collision.scene.streams import Endpoint

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
def launch(place, domain):
    """Start a program there, without help from the user's environment."""
    started = []

    def launch(*arguments, **environment):
        started.append(subprocess.Popen(
            [sys.executable, *arguments], cwd=place / 'home', text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=without_privileges,
            env={**os.environ, 'HOME': str(place / 'home'), 'ROS_LOG_DIR': '',
                 'PYTHONPATH': str(place), 'ROS_DOMAIN_ID': str(domain), 'NUMBA_CACHE_DIR': '',
                 'XDG_CACHE_HOME': '', 'PYTHONUNBUFFERED': '1', **environment}))
        return started[-1]
    yield launch
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


def test_node_without_write_access(launch, place):
    """It logs one line for each folder, runs, and stops on a signal."""
    forbid_writing(place)
    node = launch('-m', 'sat_collision.node', NUMBA_DISABLE_JIT='1')
    lines = lines_until(node, 'on /obstacles')
    assert sum('log' in line and 'not to a file' in line for line in lines) == 1, lines
    status, rest = stopped(node)
    assert status == 0 and 'Traceback' not in ''.join([*lines, rest])


@pytest.mark.parametrize('arguments', [('-c', 'from sat_collision import intersects'),
                                       ('-m', 'sat_collision.replay', 'nowhere')])
def test_import_and_replay_without_write_access(launch, place, arguments):
    """One line about kernels if any are compiled, and no traceback."""
    forbid_writing(place)
    output, _ = launch(*arguments).communicate(timeout=120)
    lines = [line for line in output.splitlines() if 'compiled kernels' in line]
    assert len(lines) == COMPILED and 'Traceback' not in output, output


@pytest.mark.parametrize('broken', [False, True], ids=['missing', 'broken'])
def test_node_without_a_compiler(launch, place, peer, broken):
    """
    The log names plain Python as its kernel, with a warning only if it is broken.

    What would take plain Python too long is refused.
    """
    if broken:
        pytest.importorskip('numba')
        (place / 'llvmlite.py').write_text("raise OSError('no libllvmlite.so')")
    else:
        (place / 'numba.py').write_text("raise ModuleNotFoundError('no numba', name='numba')")
    node = launch('-m', 'sat_collision.node')
    text = ''.join(lines_until(node, 'on /obstacles'))
    assert 'ready' in text and ('WARN' in text) is broken
    assert ('plain Python: OSError: no libllvmlite.so' if broken else '(plain Python)') in text
    peer.send('obstacles', [((1 + k % 2) * math.cos(2 * math.pi * k / 130),
                             (1 + k % 2) * math.sin(2 * math.pi * k / 130)) for k in range(130)])
    lines_until(node, '130 vertices, but at most 128')
    assert stopped(node)[0] == 0


@without_distances
def test_flags_are_published_before_distances_can_be_measured(launch, peer):
    """A first start publishes flags early, and separations once their kernels are compiled."""
    # If an answer waited for the compiler, a watchdog would raise the flag, too.
    node = launch('-m', 'sat_collision.node', '--ros-args', '-p', 'watchdog:=0.0')
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
def test_margin_needs_distances_from_the_start(launch):
    """A first start with a margin publishes no flag before it can measure."""
    node = launch('-m', 'sat_collision.node', '--ros-args', '-p', 'margin:=0.5')
    assert 'distances are measured after' in ''.join(lines_until(node, 'on /obstacles'))
    assert stopped(node)[0] == 0


@pytest.mark.long
@pytest.mark.parametrize('number', (signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
def test_signal_during_the_first_start(launch, number):
    """While kernels compile in this process and in its helper, both end with status 0."""
    pytest.importorskip('numba')
    rng = random.Random(number)
    node = launch('-m', 'sat_collision.node')
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
def test_no_process_is_left_when_the_node_has_ended(launch, peer):
    """It is stopped while others still compile the kernels for distances."""
    node = launch('-m', 'sat_collision.node')
    peer.until(peer.status, 'it runs')
    helpers = children(node.pid)
    assert stopped(node)[0] == 0
    assert helpers and not any(is_running(helper) for helper in helpers)


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='plain Python has the verdict by then')
@pytest.mark.parametrize('seed', range(3))
def test_interrupt_during_the_first_replay(launch, place, seed):
    """While kernels compile, in callbacks that swallow exceptions; there is no verdict."""
    pytest.importorskip('rosbags')
    from recordings import drive, write
    # Enough messages for kernels to be compiled.
    bag = write(place / 'bag', drive(200.0, 40.0))
    replay = launch('-m', 'sat_collision.replay', str(bag))
    time.sleep(random.Random(seed).uniform(1.5, 6.0))
    sent = time.monotonic()
    replay.send_signal(signal.SIGINT)
    output, _ = replay.communicate(timeout=60)
    assert time.monotonic() - sent < TO_END, output
    assert (replay.returncode, output.splitlines()[-1]) == (2, 'replay_check: interrupted')
    assert 'Traceback' not in output, output


@pytest.mark.skipif(not COMPILED, reason='nothing is compiled')
def test_interrupt_while_kernels_are_prepared(launch):
    """Nothing more is printed, and no process is left."""
    process = launch('-m', 'sat_collision.replay.kernels')
    lines_until(process, 'preparing kernels')
    helpers = children(process.pid)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=TO_END)
    assert (process.returncode, output) == (-signal.SIGINT, '')
    await_ends(helpers, time.monotonic())


def test_interrupt_within_generated_code(launch, place):
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
    replay = launch('-m', 'interrupted')
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


HOUR = 3600 * SECOND


def begin(monitor, obstacle, state):
    """Let the simulated time begin, and the monitor be in a state by an obstacle."""
    monitor.set_clock(HOUR)
    monitor.send_both(obstacle, stamp=HOUR)
    monitor.await_state(state)


def test_ages_count_in_simulated_time(start):
    """All is unknown before it begins; while it stands still, messages stay fresh."""
    monitor = start(use_sim_time=True)
    monitor.send_both(APART, stamp=HOUR)
    monitor.until(lambda: monitor.received.total() == 3)
    monitor.await_state('unknown')
    assert 'clock' in monitor.reason()
    monitor.until_flags(True)
    monitor.further('~/state')
    begin(monitor, APART, 'clear')
    monitor.further('~/collision', 14)
    assert monitor.state() == 'clear', 'the clock stands still'
    monitor.set_clock(HOUR + 3 * SECOND // 2)
    monitor.await_state('unknown')
    assert monitor.value('age') == '1.500'


def test_clock_before_1970_is_refused(start):
    """It ended the node, because rclpy has no such time."""
    monitor = start(use_sim_time=True)
    monitor.set_clock(HOUR)
    monitor.publisher('/clock', Clock).publish(Clock(clock=to_time(-SECOND)))
    assert monitor.logged('/clock', 'refused')
    monitor.send_both(APART, stamp=HOUR)
    monitor.await_state('clear')


def test_stopped_clock_is_unknown(start):
    """The simulation hangs: ages no longer grow."""
    monitor = start(use_sim_time=True, clock_timeout=0.5)
    monitor.set_clock(HOUR)
    monitor.send_both(APART, stamp=HOUR)
    monitor.until_reason('stands still')
    assert monitor.state() == 'unknown'
    stamps = itertools.count(HOUR + SECOND // 100, SECOND // 100)
    monitor.until(lambda: monitor.set_clock(next(stamps)) or monitor.state() == 'clear')


def test_clock_without_a_publisher_is_unknown(start):
    """The simulator has ended: time may go on without it."""
    monitor = start(use_sim_time=True, clock_timeout=0.0, **LASTING)
    begin(monitor, APART, 'clear')
    monitor.leave('/clock')
    monitor.until_reason('/clock has no publisher')
    assert monitor.state() == 'unknown'
    monitor.set_clock(HOUR)
    monitor.await_state('clear')


@pytest.mark.parametrize('step', [-60, 3], ids=['back', 'ahead'])
def test_clock_that_steps_drops_everything(start, step):
    """A recording starts again, or its player skips a part; log and health tell it."""
    monitor = start(use_sim_time=True, footprint__timeout=0.0, obstacle__timeout=2.0,
                    future_tolerance=0.6)
    begin(monitor, TOUCHING, 'collision')
    later = HOUR + step * SECOND
    monitor.set_clock(later, at_once=True)
    monitor.await_state('unknown')
    assert monitor.value('age') == ''
    monitor.logged('clock was set by more than future_tolerance')
    monitor.until(lambda: health(monitor).get('the clock: steps beyond future_tolerance') == '1')
    # What was told before counts for one timeout more.
    for tenths, state in ((1, 'collision'), (10, 'collision'), (19, 'collision'), (21, 'clear')):
        monitor.set_clock(later + tenths * SECOND // 10)
        monitor.send_both(APART, stamp=later + tenths * SECOND // 10)
        monitor.await_state(state)


def test_clock_that_comes_once_in_future_tolerance_is_not_set(start):
    """By one ns more it is; the log says what to do if it only comes seldom."""
    monitor = start(use_sim_time=True, **LASTING)
    assert monitor.set_parameters(future_tolerance=0.5) == [None]
    begin(monitor, APART, 'clear')
    half = SECOND // 2
    for later, wanted in ((HOUR + half, ('clear', '0.500')), (HOUR, ('clear', '0.000')),
                          (HOUR + half + 1, ('unknown', ''))):
        monitor.set_clock(later, at_once=True)
        monitor.until(lambda: (monitor.state(), monitor.value('age')) == wanted, wanted)
    monitor.logged('if /clock only comes that seldom, raise future_tolerance')


def test_step_of_the_system_clock_begins_anew(start, monkeypatch):
    """It was set by 5 s, as by NTP at the start of a robot without a battery for its clock."""
    offset = 0
    time_ns = time.time_ns
    monkeypatch.setattr('sat_collision.node.footprint_monitor.time', SimpleNamespace(
        **{**vars(time), 'time_ns': lambda: time_ns() + offset}))
    monitor = start(future_tolerance=4.0, **LASTING)
    monitor.become('clear', APART)
    offset = 5 * SECOND
    monitor.await_state('unknown')
    monitor.until_reason('since the clock was set')
    for _ in range(2):
        monitor.send_both(APART, stamp=time_ns() + offset)
    monitor.await_state('clear')


def test_simulated_time_can_be_switched_on_and_off(start):
    """Each switch drops what was received by the other clock."""
    monitor = start()
    monitor.repeat_until('clear', lambda: monitor.send_both(APART))
    assert monitor.set_parameters(use_sim_time=True) == [None]
    monitor.until_reason('no clock yet')
    begin(monitor, TOUCHING, 'collision')
    assert monitor.set_parameters(use_sim_time=False) == [None]
    monitor.await_state('unknown')
    monitor.repeat_until('clear', lambda: monitor.send_both(APART, stamp=monitor.now()))


def test_recording_played_without_simulated_time(start):
    """State, log and health name the parameter to set."""
    monitor = start(footprint__timeout=1.0)
    monitor.send_both(APART, stamp=monitor.now() - 365 * 24 * HOUR)
    monitor.logged('/obstacles was rejected, too old', 'set use_sim_time: true')
    monitor.until(lambda: monitor.reason().count('set use_sim_time: true') == 2, 'a reason')
    clock = monitor.node.create_publisher(Clock, '/clock', 1)
    monitor.until(monitor.health)
    monitor.until(lambda: '/clock is published' in monitor.health().message, 'a warning')
    monitor.node.destroy_publisher(clock)
    monitor.until(lambda: '/clock is published' not in monitor.health().message, 'no warning')


def test_tick_is_due_at_the_next_deadline(domain):
    """As when a source falls silent; not later, and not at once."""
    context = rclpy.Context()
    context.init(domain_id=domain)
    node = FootprintMonitor(context=context, parameter_overrides=to_parameters(
        {'watchdog': 0.0, 'obstacle.timeout': 0.1, 'obstacle.set_end': 'each_message'}))
    steady = time.monotonic()
    now = node.present(steady)
    node.tick(now)
    node._monitor.update_publishers('obstacle', [Endpoint('its gid', '/mapper')])
    # However long it took here.
    ticked = node._tick_ended = node._ticked
    assert node.due(now, steady) == ticked + 0.1, 'nothing changes by itself'
    node.receive('obstacle', [serialised(APART, now)], now, 1, now)
    about = partial(pytest.approx, rel=0.0, abs=1e-6)
    # As if some time had passed by both clocks.
    late = ticked + 0.03
    assert node.due(now + SECOND // 20, late) == about(late + 0.05)
    assert node.due(now + SECOND // 10, late) == about(late)
    assert node.due(now + SECOND, late) == about(ticked + 0.02), 'no more often than that'
    node._tick_ended = ticked + 0.03
    assert node.due(now + SECOND, late) == about(ticked + 0.06), 'as long again as the last took'
    node._ticked = node._tick_ended = ticked + 0.08
    assert node.due(now - SECOND, late) == about(ticked + 0.1), 'flags are due, whatever ticked'
    node.destroy_node()
    context.shutdown()

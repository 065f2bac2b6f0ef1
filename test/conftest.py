# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Fixtures of all tests: DDS that stays on this machine, and nodes that end with the test."""

import contextlib
import fcntl
import itertools
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import types

from discovery import discover_promptly
import pytest

ROOT = Path(__file__).parents[1]

# Each test has another domain, so that no message reaches the next test. The demo has those above.
_COUNT = 70
_DOMAINS = itertools.cycle((os.getpid() + k) % _COUNT + 1 for k in range(_COUNT))


def pytest_configure(config):
    """Set the environment."""
    # A shell makes background processes ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    config.ros_files = tempfile.TemporaryDirectory(prefix='sat_collision_test_')
    discover_promptly(config.ros_files.name)
    os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


def pytest_collection_modifyitems(config, items):
    """Give long tests more time, if pytest-timeout is installed."""
    if config.pluginmanager.hasplugin('timeout'):
        for item in items:
            if item.get_closest_marker('long'):
                item.add_marker(pytest.mark.timeout(10 * float(config.getini('timeout'))))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport():
    """Make a failure of a skip that the gate does not allow."""
    report = (yield).get_result()
    if report.skipped and (allowed := os.environ.get('ALLOWED_SKIPS')):
        reason = report.longrepr[2].removeprefix('Skipped: ')
        if reason not in (ROOT / allowed).read_text().splitlines():
            report.outcome = 'failed'
            report.longrepr = f'{allowed} does not have the reason of this skip: {reason}'


pytest_make_collect_report = pytest_runtest_makereport


def pytest_unconfigure(config):
    config.ros_files.cleanup()


@contextlib.contextmanager
def locked_domain():
    """Yield a DDS domain id, locked against test sessions that run at the same time."""
    for number in _DOMAINS:
        lock = os.open(Path(tempfile.gettempdir(), f'sat_collision_domain_{number}.lock'),
                       os.O_CREAT | os.O_RDWR, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            continue
        else:
            yield number
            return
        finally:
            os.close(lock)


@pytest.fixture
def without_tf2_msgs(monkeypatch):
    """Make tf2_msgs not installed, as where ROS comes from pip."""
    monkeypatch.setitem(sys.modules, 'tf2_msgs', None)
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)


@pytest.fixture
def domain():
    """Return a DDS domain id of the test's own."""
    with locked_domain() as number:
        yield number


@pytest.fixture
def start(domain, run):
    """
    Start a monitor with parameters, whose dots are written as double underscores.

    It leaves before the processes of `run` are killed; see `Rig.close`.
    """
    from harness import RunningMonitor
    running = []

    def start(arguments=(), **parameters):
        running.append(RunningMonitor(domain, arguments, parameters))
        return running[-1]

    yield start
    for monitor in running:
        monitor.close()


@pytest.fixture
def join(domain, run):
    """Start another peer, whose node may have its own name; it leaves as monitors do."""
    from harness import Peer
    peers = []

    def join(own_name='peer'):
        peers.append(Peer(domain, own_name=own_name))
        return peers[-1]

    yield join
    for peer in peers:
        peer.close()


@pytest.fixture
def peer(join):
    """Return a peer of what runs in the domain."""
    return join()


@pytest.fixture
def run(domain):
    """
    Run Python in the domain, with arguments and more environment; it ends with the test.

    It runs in plain Python, which starts in a third of the time, unless told otherwise.
    """
    from compiled import plain_python
    started = []

    def run(*arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={}, **options):
        started.append(subprocess.Popen(
            [sys.executable, *arguments], cwd=ROOT, stdout=stdout,
            stderr=stderr, env=plain_python(ROS_DOMAIN_ID=str(domain)) | env, **options))
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def start_with_tf(start, monkeypatch):
    """Start a monitor that finds a stand-in for tf2_msgs."""
    from geometry_msgs.msg import PolygonStamped
    messages = types.ModuleType('tf2_msgs.msg')
    messages.TFMessage = PolygonStamped
    monkeypatch.setitem(sys.modules, 'tf2_msgs', types.ModuleType('tf2_msgs'))
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', messages)
    return lambda **parameters: start(frame_id='odom', **parameters)

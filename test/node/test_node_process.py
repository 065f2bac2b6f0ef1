# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The node as a process: how it starts and ends, by itself and with the launch file."""

import contextlib
import functools
import os
from pathlib import Path
import re
import shlex
import signal
import subprocess
import sys
import time

from geometry_msgs.msg import PolygonStamped
from harness import lines_until, TOUCHING
import pytest
from rclpy.parameter_client import AsyncParameterClient
from sat_collision.node.__main__ import main
from sat_collision.node.footprint_monitor import unused_files
import yaml

ROOT = Path(__file__).resolve().parents[2]

ALL_KINDS_OF_MESSAGES = """
from dataclasses import replace
import math, sys, time
sys.path.insert(0, 'test/support')
from harness import box, polygon_message
import rclpy
from rclpy.serialization import serialize_message
from sat_collision.messages.markers import Markers
from sat_collision.node.footprint_monitor import FootprintMonitor

def receive(name, data):
    before = node._monitor.received[name]
    now = time.time_ns()
    node.receive(name, [data], now, None, now)
    assert node._monitor.received[name] == before + 1

def compiled():
    return {(name, key): len(value.signatures)
            for name, module in sys.modules.items() if name.startswith('sat_collision')
            for key, value in vars(module).items() if hasattr(value, 'signatures')}

rclpy.init()
node = FootprintMonitor()
before = compiled()
circle = [(math.cos(k), math.sin(k)) for k in range(6)]
polygons = [[], [(2, 2)], [(0, 0), (1, 1)], [(0, 0), (1, 1), (2, 2)], box(0, 0), box(9, 9), circle,
            [(0, 0), (2, 0), (2, 2), (1, 1), (0, 2)], [(0, 0), (1, 1), (1, 0), (0, 1)],
            [(math.nan, 0)]]
for stamp in (0, time.time_ns(), time.time_ns() + 10**9):
    messages = [serialize_message(polygon_message(polygon, stamp)) for polygon in polygons]
    for footprint in messages:
        receive('footprint', footprint)
        for obstacle in messages:
            receive('obstacle', obstacle)
            Markers().message(node._scene)
        node._scene.nearest('footprint')
footprint, = node._scene.settings.footprints
own = replace(footprint, obstacles=('obstacle',))
node._scene.update(replace(node._scene.settings, footprints=(own,)))
node._scene.update(replace(node._scene.settings, margin=0.1))
receive('footprint', messages[-3])
assert compiled() == before
"""


@pytest.fixture
def launch(run):
    """Start the node's process with some arguments; its output goes to a pipe."""
    return functools.partial(run, '-m', 'sat_collision.node', '--ros-args', stdout=subprocess.PIPE,
                             stderr=subprocess.STDOUT, text=True)


WITH_KERNELS = {'NUMBA_DISABLE_JIT': '0'}


@pytest.fixture
def launch_ready(launch):
    """Start the node's process and wait until it has subscribed."""
    def launch_ready(*arguments, **options):
        process = launch(*arguments, **options)
        lines_until(process, 'obstacle: ')
        return process
    return launch_ready


def ended(process):
    """Wait for the end of the process; return exit status and output."""
    output, _ = process.communicate(timeout=60)
    return process.returncode, output


@pytest.mark.long
def test_what_to_try_works(launch, run, peer):
    """The log names a command that publishes what the node checks."""
    process = launch()
    line = lines_until(process, 'nothing is published yet')[-1]
    python, *command = shlex.split(line.rpartition(': ')[2])
    assert python == sys.executable
    for number in (signal.SIGINT, signal.SIGTERM):
        publisher = run(*command, stderr=subprocess.PIPE)
        for state in ('clear', 'collision', 'clear'):
            peer.await_state(state)
        publisher.send_signal(number)
        assert publisher.communicate(timeout=60)[1] == b''
        assert publisher.returncode == 0


def test_nothing_to_try_is_named_where_something_is_published(launch, peer):
    peer.node.create_publisher(PolygonStamped, 'footprint', 1)
    process = launch()
    lines_until(process, '/obstacles has no publisher')
    process.send_signal(signal.SIGINT)
    assert 'nothing is published' not in ended(process)[1]


@pytest.mark.parametrize('number', (signal.SIGINT, *(
    pytest.param(one, marks=pytest.mark.long) for one in (signal.SIGTERM, signal.SIGHUP))))
def test_one_signal_ends_a_busy_node_cleanly(launch_ready, peer, number):
    """Status 0, a log line, and no traceback."""
    process = launch_ready('-p', 'footprint.timeout:=0.0', env=WITH_KERNELS)

    peer.repeat_until('collision', lambda: peer.send_both(TOUCHING))
    for _ in range(20):
        peer.send_set('obstacles', TOUCHING)
    process.send_signal(number)
    status, output = ended(process)
    assert (status, 'Traceback' in output) == (0, False), output
    assert 'stopped by a signal' in output


def test_repeated_signals(launch_ready, peer):
    """One per millisecond until it has ended, as `ros2 launch` and users may send."""
    process = launch_ready(env=WITH_KERNELS)
    peer.until(peer.flag)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.001)
    status, output = ended(process)
    assert 'Traceback' not in output and 'Exception' not in output, output
    assert status in (0, -signal.SIGINT), 'the interpreter itself may be ending already'


SIGNALS_AT_ONCE = """
import os, signal
from sat_collision.node.signals import end_on_signals, Signalled
end_on_signals()
has_ended = Signalled()
both = signal.SIGINT, signal.SIGTERM
signal.pthread_sigmask(signal.SIG_BLOCK, both)
for number in both:
    os.kill(os.getpid(), number)
signal.pthread_sigmask(signal.SIG_UNBLOCK, both)
assert has_ended()
for number in both:
    assert signal.getsignal(number) is signal.SIG_IGN, 'not even while the interpreter ends'
"""


WITHOUT_OUTPUT = """
import os, sys
os.close(1)
os.close(2)
os.execv(sys.executable, [sys.executable, '-m', 'sat_collision.node'])
"""


def test_two_signals_at_once(run):
    """An interrupt of the terminal while a supervisor ends the node: nothing is printed."""
    process = run('-c', SIGNALS_AT_ONCE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                  text=True)
    assert ended(process) == (0, '')


def test_signal_while_the_node_starts(launch):
    process = launch(env=WITH_KERNELS)
    lines_until(process, 'kernels')
    process.send_signal(signal.SIGINT)
    status, output = ended(process)
    assert (status, 'Traceback' in output) == (0, False), output


def test_signal_that_the_shell_ignores(launch_ready, peer):
    """As for a process started with & in a script."""
    process = launch_ready(preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN))
    peer.until(peer.flag)
    process.send_signal(signal.SIGINT)
    assert ended(process)[0] == 0


@pytest.mark.parametrize('arguments, words', [
    (['-p', 'footprint.timeout:=soon'], 'footprint.timeout'),
    (['-p', 'qos_overrides./footprint.subscription.durability:=latched'], 'latched'),
    (['-p', 'qos_overrides./footprint.subscription.depth:=many'], 'depth'),
    (['-p', 'use_sim_time:=soon'], 'use_sim_time'),
    (['-p', 'obstacle.topic:=/rosout'], 'in no other type'),
    (['-p', 'footprints:=[' + 240 * 'a' + ']'], 'topic length'),
    (['--params-file', 'nowhere.yaml'], 'nowhere.yaml'),
    (['--bogus', '-x'], "cannot start: unknown arguments ['--bogus', '-x']"),
    # Subscribers that follow README's rule could not use such rare flags.
    (['-p', 'publish_rate:=0.1'], 'publish_rate'),
])
def test_invalid_parameters_end_the_process_with_an_error(launch, arguments, words):
    """Status 1 and one line, no traceback."""
    status, output = ended(launch(*arguments))
    assert status == 1 and 'Traceback' not in output
    assert any(words in line and 'footprint_monitor' in line for line in output.splitlines())


def test_version(capsys):
    """The source tree alone has none."""
    assert main(['--version']) == 0
    assert re.fullmatch(r'sat_collision \S+\n', capsys.readouterr().out)


@pytest.mark.parametrize('arguments', (
    ['--params-file', 'my.yaml'], ['use_sim_time:=true'], ['--ros-args', '--', 'my.yaml']))
def test_unused_arguments_are_refused(capsys, arguments):
    """Without --ros-args rcl ignores them, and the node would run with its defaults."""
    assert main(arguments) == 2
    out, error = capsys.readouterr()
    line, = error.splitlines()
    assert not out
    assert arguments[-1] in line and '--ros-args --params-file my.yaml' in line


@pytest.mark.parametrize('option', ('--help', '-h'))
def test_help(capsys, option):
    assert main([option]) == 0
    out = capsys.readouterr().out
    assert out.startswith('usage: ')
    assert 'footprint_monitor --ros-args --params-file my.yaml\n' in out


@pytest.mark.parametrize('library, remedy', [
    *((name, 'source /opt/ros') for name in (
        'rclpy', 'diagnostic_msgs', 'geometry_msgs', 'sensor_msgs', 'std_msgs',
        'visualization_msgs')),
    ('yaml', 'pip install pyyaml\n')])
def test_missing_library_is_reported(library, remedy):
    """With what to install, whether or not rosbags, which only replay needs, has the classes."""
    program = (f'import sys; sys.modules["{library}"] = None\n'
               'from sat_collision.node.__main__ import main; sys.exit(main([]))')
    result = subprocess.run([sys.executable, '-c', program], cwd=ROOT, capture_output=True,
                            text=True)
    line, = result.stderr.splitlines(keepends=True)
    assert result.returncode == 1
    assert line.startswith(
        f'footprint_monitor: cannot start: {library} is not installed: {remedy}')


@pytest.mark.parametrize('names, is_used', [
    ({'/**': {}}, True), ({'footprint_monitor': {}}, True), ({'/ns/*': {}}, False),
    ({'/*': {}}, True), ({'ns': {'footprint_monitor': {}}}, False),
    ({'/**/footprint_monitor': {}, 'other': {}}, True), ({'collision_monitor': {}}, False)])
def test_parameter_file_without_this_node_is_found(tmp_path, names, is_used):
    """Names as rcl reads them: nested, with wildcards for one name or any number of names."""
    def with_parameters(below):
        return {name: with_parameters(one) if one else {'ros__parameters': {'margin': 1.0}}
                for name, one in below.items()}
    path = tmp_path / 'a.yaml'
    path.write_text(yaml.safe_dump(with_parameters(names)))
    words = list(unused_files(['-p', 'a:=1', '--params-file', str(path)], '/footprint_monitor'))
    assert not words if is_used else f'{path} has no parameters for' in words[0]


@pytest.mark.parametrize('value', ['2026-99-99', '=', '!ours text', 'é'])
def test_parameter_file_may_have_any_value(tmp_path, value):
    """Those of other nodes need not be valid YAML 1.1; rcl takes all of these as texts."""
    path = tmp_path / 'a.yaml'
    path.write_text(f'other: {{ros__parameters: {{one: {value}}}}}\n', encoding='utf-8')
    assert len(list(unused_files(['--params-file', str(path)], '/footprint_monitor'))) == 1


def test_parameter_file_that_is_a_pipe(tmp_path):
    """It is not opened again: nobody writes it twice."""
    os.mkfifo(tmp_path / 'a.yaml')
    assert not list(unused_files(['--params-file', str(tmp_path / 'a.yaml')], '/any'))


def test_parameter_file_for_other_nodes_is_warned_of(launch, tmp_path):
    """On the console, with the nodes that the file is for."""
    path = tmp_path / 'a.yaml'
    path.write_text('robot:\n  monitor: {ros__parameters: {margin: 1.0}}\n')
    process = launch('--params-file', str(path))
    lines_until(process, f'{path} has no parameters for /footprint_monitor, only for '
                         '/robot/monitor')


def test_node_runs_with_closed_output(run, peer):
    """Some supervisors start it without stdout and stderr."""
    process = run('-c', WITHOUT_OUTPUT)
    peer.until(peer.flag)
    process.terminate()
    assert process.wait(60) == 0


def test_log(launch, peer):
    """The debug level does not apply to rcl: it would log two lines per message."""
    process = launch('-r', 'obstacles:=/seen', '--log-level', 'debug')
    for words in ('kernels', 'footprint: PolygonStamped on /footprint',
                  'obstacle: PolygonStamped on /seen'):
        lines_until(process, words)
    process.terminate()
    assert '[rcl]' not in ended(process)[1]


@pytest.mark.long
def test_no_kernel_is_compiled_after_the_start(domain):
    pytest.importorskip('numba')
    subprocess.run([sys.executable, '-c', ALL_KINDS_OF_MESSAGES], cwd=ROOT, check=True,
                   env={**os.environ, 'ROS_DOMAIN_ID': str(domain)})


# Launch and the node need more time than other processes, in s.
TIMEOUT = 120.0
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import SetParameter
path, margin, *given = sys.argv[1:]
arguments = [argument.split(':=') for argument in given]
service = LaunchService()
service.include_launch_description(LaunchDescription([
    GroupAction([*([SetParameter('margin', float(margin))] if margin else []),
                 IncludeLaunchDescription(PythonLaunchDescriptionSource(path),
                                          launch_arguments=arguments)])]))
sys.exit(service.run())
"""


@pytest.fixture
def launch_file(run, tmp_path):
    """Launch the node of a workspace in which the package is installed, with arguments."""
    pytest.importorskip('launch_ros', reason='apt install ros-jazzy-launch-ros')
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    executable = tmp_path / 'lib' / 'sat_collision' / 'footprint_monitor'
    for folder in (index, executable.parent):
        folder.mkdir(parents=True)
    (index / 'sat_collision').touch()
    executable.write_text(f'#!/bin/sh\nexec {sys.executable} -m sat_collision.node "$@"\n')
    executable.chmod(0o755)
    installed = {'AMENT_PREFIX_PATH': str(tmp_path),
                 'PYTHONPATH': f'{ROOT}{os.pathsep}{os.environ.get("PYTHONPATH", "")}'}
    running = []

    def launch_file(*arguments, margin=''):
        running.append(run('-c', LAUNCH, ROOT / 'launch' / 'footprint_monitor.launch.py', margin,
                           *arguments, env=installed, stdout=subprocess.PIPE,
                           stderr=subprocess.STDOUT, text=True, start_new_session=True))
        return running[-1]

    yield launch_file
    for process in running:
        # Ctrl-C reaches launch and node; after any other signal launch would leave the node.
        with contextlib.suppress(ProcessLookupError):  # it has ended by itself
            os.killpg(process.pid, signal.SIGINT)
        process.communicate(timeout=60)


def parameters(peer, node, *names):
    """Return the values of parameters of a node, once it answers."""
    client = AsyncParameterClient(peer.node, node)
    peer.until(client.services_are_ready, f'the services of {node}', TIMEOUT)
    future = client.get_parameters(list(names))
    peer.until(future.done, 'an answer')
    return [value.double_value or value.bool_value for value in future.result().values]


def test_launch_with_defaults(launch_file, peer):
    """A parameter set by SetParameter in the launch file counts."""
    launch_file(margin='0.25')
    assert parameters(peer, '/footprint_monitor', 'margin', 'use_sim_time') == [0.25, False]


@pytest.mark.parametrize('arguments, expected', [((), True), (('use_sim_time:=false',), False)])
def test_launch_passes_simulated_time_only_if_given(
        launch_file, peer, tmp_path, arguments, expected):
    """Otherwise the parameter file decides."""
    params = tmp_path / 'params.yaml'
    params.write_text('/**:\n  ros__parameters: {use_sim_time: true, margin: 0.5}\n')
    launch_file(f'params_file:={params}', *arguments)
    assert parameters(peer, '/footprint_monitor', 'margin', 'use_sim_time') == [0.5, expected]


@pytest.mark.parametrize('config', ['footprint_monitor', 'nav2'])
def test_launch_of_shipped_parameters_in_a_namespace(launch_file, peer, config):
    """With another node name; topics are in the namespace, too."""
    path = ROOT / 'config' / f'{config}.yaml'
    launch_file('name:=guard', 'namespace:=robot1', f'params_file:={path}')
    peer.name = 'robot1/guard'
    topic = {'nav2': 'local_costmap/published_footprint'}.get(config, 'footprint')
    peer.until(lambda: peer.node.count_subscribers(f'/robot1/{topic}')
               and peer.node.count_subscribers('/robot1/obstacles'), 'subscriptions', TIMEOUT)
    peer.until(lambda: peer.flag() is True, 'a flag', TIMEOUT)


def test_launch_respawns(launch_file, peer):
    process = launch_file('respawn:=true', 'log_level:=warn')
    peer.until(lambda: peer.flag() is True, 'a flag', TIMEOUT)
    pids = []
    while len(pids) < 2:
        line = process.stdout.readline()
        assert line, 'launch has ended'
        assert '[INFO] [footprint_monitor]' not in line
        if started := re.search(r'process started with pid \[(\d+)\]', line):
            pids.append(int(started[1]))
            if len(pids) == 1:
                os.kill(pids[0], signal.SIGKILL)
    assert pids[0] != pids[1]


def test_launch_without_its_parameter_file_is_an_error(launch_file):
    process = launch_file('params_file:=/nowhere.yaml')
    output, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode and 'there is no file /nowhere.yaml' in output


def test_flags_go_on_where_nobody_reads_the_log(run, peer):
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)
    with pytest.raises(BlockingIOError):
        while True:
            os.write(write_end, bytes(4096))
    os.set_blocking(write_end, True)
    monitor = run('-m', 'sat_collision.node', stderr=write_end)
    peer.until(lambda: len(peer.listen('~/collision')) > 3, 'flags')
    monitor.terminate()
    assert monitor.wait(60) == 0
    os.close(read_end)
    os.close(write_end)


ENDS_BY_AN_ERROR = """\
import os
import sys
from sat_collision.node import footprint_monitor

tick = footprint_monitor.FootprintMonitor.tick

def fail(self, now):
    tick(self, now)
    if os.path.exists(sys.argv[1]):
        raise KeyError('an error')

footprint_monitor.FootprintMonitor.tick = fail
footprint_monitor.run(['-p', 'unknown_is_collision:=false'])
"""


def test_last_flag_of_a_node_that_ends_by_an_error_is_raised(run, peer, tmp_path):
    monitor = run('-c', ENDS_BY_AN_ERROR, str(tmp_path / 'error'))
    flags = peer.listen('~/collision')
    peer.until(lambda: len(flags) > 3 and not flags[-1].data, 'flags')
    (tmp_path / 'error').touch()
    peer.until(lambda: monitor.poll() == 1 and flags[-1].data, 'the end')

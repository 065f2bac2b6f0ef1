# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The node as a process under traffic, compared with shapely in a callback and with the floor.

The floor is a node that only receives and publishes, in Python, see `peers`, and in C++. While
transforms come, the node is compared with a monitor that ignores /tf. Processor time is that of
all threads of the process, as the kernel's scheduler counts it.
"""

import contextlib
import os
from pathlib import Path
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

from _shared import ROOT
from builders import box, collection, serialised, transforms
from discovery import discover_promptly
from geometry_msgs.msg import PolygonStamped
from matplotlib import pyplot
from matplotlib.ticker import LogLocator
import numpy as np
import rclpy
from std_msgs.msg import Bool
from traffic import head, regular, SET_RATE, STAMPED, Traffic, until

_PEERS = str(ROOT / 'benchmarks' / 'peers.py')
_MONITOR = ['-m', 'sat_collision.node', '--ros-args', '-p', 'obstacle.set_end:=empty_polygon']
NODES = {'monitor': _MONITOR, 'whole_floor': [_PEERS, 'whole_floor'],
         'whole': [*_MONITOR[:2], '--ros-args', '-p', 'obstacle.type:=polygon_collection', '-p',
                   'footprint.timeout:=0.0'],
         'plain': _MONITOR, 'floor': [_PEERS, 'floor'],
         'rival': [_PEERS, 'shapely'], 'frames': [_PEERS, 'frames'],
         'frames_floor': [_PEERS, 'frames_floor']}
TITLES = {'monitor': 'sat_collision', 'floor': 'empty rclpy node',
          'rival': 'shapely in a callback'}
_ENVIRONMENTS = {'plain': {'NUMBA_DISABLE_JIT': '1'}}
# Of a run; each figure is of some runs.
SECONDS = 3.0
REPEATS = 3
OBSTACLES = 10, 100, 1000
WHOLE_OBSTACLES = 10, 100, 1000, 10_000
VERTICES = 4, 32
RATES = 10_000, 20_000, 30_000, 60_000
PLAIN_RATES = RATES[:2]
TRANSFORM_RATE = 100
TRANSFORMS = 1, 5, 20
ROBOTS = 20
_FRAMES = {'frame_id': 'odom', 'footprint.timeout': '0.0', 'obstacle.timeout': '0.0',
           'obstacle.set_end': 'each_message'}
_OUTLINE = {'footprint.points': '[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]',
            'footprint.frame_id': 'base'}
# ROS domains; tests use others.
_DOMAINS = range(215, 233)


@contextlib.contextmanager
def ros():
    """Run ROS on this machine only, in a domain of its own, with prompt discovery."""
    with tempfile.TemporaryDirectory() as folder:
        discover_promptly(folder, announces=False)
        os.environ['ROS_DOMAIN_ID'] = str(_DOMAINS[os.getpid() % len(_DOMAINS)])
        rclpy.init()
        try:
            yield
        finally:
            rclpy.shutdown()


@contextlib.contextmanager
def running(kind, parameters={}, **environment):
    """Run a node of some kind, or a built one, as a process; yield its id."""
    words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    command = [sys.executable, *NODES[kind]] if kind in NODES else [kind]
    process = subprocess.Popen(
        [*command, *(['--ros-args', *words] if words else ())],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env={**os.environ, **_ENVIRONMENTS.get(kind, {}), **environment})
    try:
        yield process.pid
    finally:
        process.terminate()
        process.wait(30)


def cpu_time(pid):
    """Return the processor time in s that all threads of a process have used."""
    return sum(int(path.read_text().split()[0])
               for path in Path(f'/proc/{pid}/task').glob('*/schedstat')) / 1e9


def load(kind, obstacles, vertices, burst=False, rate=SET_RATE):
    """Run traffic against a node on one core; return its cost a message, latencies and losses."""
    with running(kind) as pid, contextlib.closing(Traffic(obstacles, vertices)) as traffic:
        traffic.connect()
        pin(pid)
        traffic.run(0.5, burst, rate)
        count = traffic.taken()
        used = cpu_time(pid)
        footprints, sent, latencies = traffic.run(SECONDS, burst, rate)
        used = cpu_time(pid) - used
        taken = traffic.taken() - count
    return {'cpu_us': 1e6 * used / (taken + len(latencies)), 'core': used / SECONDS,
            'sent_per_second': sent / SECONDS, 'lost': sent - taken,
            'unanswered': footprints - len(latencies),
            **_percentiles(1e3 * np.array(latencies), p50_ms=50, p99_ms=99, max_ms=100)}


def _percentiles(values, **shares):
    return {name: float(np.percentile(values, share)) for name, share in shares.items()}


def together(nodes, make, repeats=REPEATS):
    """
    Return processor time in us a message of nodes that share a core, and first to last as a ratio.

    They receive the same messages at once, because the machine's speed changes from one second to
    the next by more than they differ. They are restarted for each repeat, because the one that is
    discovered first warms the caches for the other. All are medians. `nodes` are kinds and
    parameters; `make` returns what sends the messages, such as `Traffic`.
    """
    costs = []
    for _ in range(repeats):
        with contextlib.ExitStack() as stack:
            pids = [stack.enter_context(running(*node)) for node in nodes]
            traffic = stack.enter_context(contextlib.closing(make()))
            traffic.connect(len(pids))
            for pid in pids:
                pin(pid)
            traffic.send(0.5)
            before = [cpu_time(pid) for pid in pids]
            count = traffic.send(SECONDS)
            costs.append([1e6 * (cpu_time(pid) - used) / count
                          for pid, used in zip(pids, before)])
    return *map(statistics.median, zip(*costs)), statistics.median(
        first / last for first, *_, last in costs)


def pin(pid):
    """Pin all threads of a process to the last core."""
    core = max(os.sched_getaffinity(0))
    for thread in os.listdir(f'/proc/{pid}/task'):
        os.sched_setaffinity(int(thread), {core})


def _by_turns(kinds, *arguments, **options):
    """Return medians of runs in turns; the greatest latency and losses are of all runs."""
    runs = [{kind: load(kind, *arguments, **options) for kind in kinds} for _ in range(REPEATS)]
    combine = {'lost': sum, 'unanswered': sum, 'max_ms': max}
    return {kind: {name: combine.get(name, statistics.median)([run[kind][name] for run in runs])
                   for name in runs[0][kind]} for kind in kinds}


def measure():
    """Return the cost of each node under each load, bursts, and the rate that one core handles."""
    def beside_the_floor(*load):
        return together([('monitor',), ('floor',)], lambda: Traffic(*load), 3 * REPEATS)[-1]
    return {
        'loads': [{'obstacles': obstacles, 'vertices': vertices,
                   'together': {'times_floor': beside_the_floor(obstacles, vertices)},
                   **_by_turns(TITLES, obstacles, vertices)}
                  for vertices in VERTICES for obstacles in OBSTACLES],
        'bursts': [{'obstacles': obstacles,
                    **_by_turns(('monitor', 'floor'), obstacles, 4, burst=True)}
                   for obstacles in OBSTACLES[1:]],
        'rates': [{'kind': kind, 'asked_per_second': rate,
                   **load(kind, 1000, 4, rate=rate / 1000)}
                  for kind, rates in (('monitor', RATES), ('plain', PLAIN_RATES))
                  for rate in rates]}


def build_floor(folder):
    """Build the floor in C++; return the program's path, or None after saying what is missing."""
    configure = ['cmake', '-S', str(ROOT / 'benchmarks' / 'floor'), '-B', str(folder),
                 '-DCMAKE_BUILD_TYPE=Release']
    result = shutil.which('cmake') and subprocess.run(configure, capture_output=True, text=True)
    if not result or result.returncode:
        # CMake's own words, unless it finds no rclcpp.
        why = result.stderr if result and 'Findrclcpp.cmake' not in result.stderr else ''
        print(f'{why}skipped the node in C++, which needs rclcpp: apt install cmake g++ '
              'ros-jazzy-rclcpp, and source /opt/ros/jazzy/setup.bash', file=sys.stderr)
        return None
    subprocess.run(['cmake', '--build', str(folder)], stdout=subprocess.DEVNULL, check=True)
    return str(Path(folder) / 'floor')


def measure_cpp():
    """Return the cost of the monitor beside the floor in rclpy and in C++, None without rclcpp."""
    with tempfile.TemporaryDirectory() as folder:
        if not (program := build_floor(folder)):
            return None
        rows = []
        for obstacles in OBSTACLES:
            us, floor, cpp, ratio = together([('monitor',), ('floor',), (program,)],
                                             lambda: Traffic(obstacles, VERTICES[0]), 3 * REPEATS)
            rows.append({'obstacles': obstacles, 'us': us, 'floor_us': floor, 'cpp_us': cpp,
                         'ratio': ratio})
        return rows


class Sender:
    """Sends numbered messages to nodes, `rate` a second, and receives the flags of one of them."""

    def __init__(self, rate=0.0, **kinds):
        self.rate = rate
        self._node = rclpy.create_node('sender')
        self._flags = []
        self._node.create_subscription(Bool, '/footprint_monitor/footprint/collision',
                                       lambda flag: self._flags.append(flag.data), 100)
        self.publishers = {topic: self._node.create_publisher(kind, f'/{topic}', 100)
                           for topic, kind in kinds.items()}

    def close(self):
        self._node.destroy_node()

    def _until(self, condition):
        until(condition, lambda: rclpy.spin_once(self._node, timeout_sec=0.001))

    def connect(self, nodes=1):
        """Wait until a number of nodes are connected and one has sent a flag."""
        self._until(lambda: self._flags and all(
            publisher.get_subscription_count() == nodes
            for publisher in self.publishers.values()))

    def send(self, seconds):
        """Send for some seconds; return how many messages."""
        begin = time.monotonic()
        count = round(seconds * self.rate)
        for k in range(count):
            time.sleep(max(begin + k / self.rate - time.monotonic(), 0.0))
            self.publish(k)
        return count

    def latencies(self, count, pause):
        """Return the ms from each message, of which those of odd numbers raise the flag, to it."""
        def is_clear():
            self.publish(0)
            time.sleep(pause)
            return not self._flags[-1]
        self._until(is_clear)
        times = []
        for k in range(1, count + 1):
            time.sleep(pause)
            begin = time.perf_counter()
            self.publish(k)
            self._until(lambda: self._flags[-1] == bool(k % 2))
            times.append(1e3 * (time.perf_counter() - begin))
        return times


class Transforms(Sender):
    """
    Sends /tf: for each group of children a message, `TRANSFORM_RATE` times a second.

    All are at the first x and at the second in turns. Messages have a stand-in for the type
    TFMessage, see `peers`.
    """

    def __init__(self, groups, places=(0.0, 0.0)):
        super().__init__(TRANSFORM_RATE * len(groups), tf=PolygonStamped,
                         obstacles=PolygonStamped)
        self._groups, self._places = groups, places

    def publish(self, number):
        stamp, x = time.time_ns(), self._places[number % 2]
        self.publishers['tf'].publish(transforms(*(
            ('odom', child, stamp, x, 0.0)
            for child in self._groups[number % len(self._groups)])))


def measure_frames():
    """Return the cost of transforms, and the ms until a flag follows one."""
    def cost(*groups, **parameters):
        us, floor, ratio = together(
            [('frames', {**_FRAMES, **parameters}), ('frames_floor', _FRAMES)],
            lambda: Transforms(groups))
        return {'monitor_us': us, 'floor_us': floor, 'ratio': ratio,
                'core': us * TRANSFORM_RATE * len(groups) / 1e6}
    children = ['base', *(f'frame{k}' for k in range(1, ROBOTS))]
    with running('frames', {**_FRAMES, **_OUTLINE}), \
            contextlib.closing(Transforms([['base']], (9.0, -5.0))) as sender:
        sender.connect()
        sender.publishers['obstacles'].publish(serialised(box(-5.0), time.time_ns(), 'odom'))
        latencies = sender.latencies(100 * REPEATS, 0.03)
    return {'sizes': [{'transforms': size, **cost(children[:size])} for size in TRANSFORMS],
            'outline': cost(['base'], **_OUTLINE),
            'robots': cost(*([child] for child in children)),
            'latency': _percentiles(latencies, p50_ms=50, p99_ms=99)}


class Collections(Sender):
    """Sends sets in one message each, `SET_RATE` times a second, to meet a footprint."""

    def __init__(self, obstacles):
        # The type only with these messages, which not every environment has.
        from polygon_msgs.msg import Polygon2DCollection
        super().__init__(SET_RATE, obstacles=Polygon2DCollection, footprint=PolygonStamped)
        rng = np.random.default_rng(1)
        self._sets = []
        for k in range(8):
            centres = rng.uniform(5.0, 200.0, (obstacles, 2))
            # The footprint meets one in every other set.
            centres[0] = (0.0, 0.0) if k % 2 else (-9.0, 0.0)
            self._sets.append(
                collection([regular(4, x, y, 0.5) for x, y in centres], 0)[STAMPED:])

    def connect(self, nodes=1):
        super().connect(nodes)
        self.publishers['footprint'].publish(serialised(box(0), time.time_ns(), 'map'))

    def publish(self, number):
        self.publishers['obstacles'].publish(
            head(time.time_ns()) + self._sets[number % len(self._sets)])


def measure_whole_sets():
    """Return the cost and latency of sets in one message, beside the empty node."""
    rows = []
    with running('whole', {'obstacle.timeout': '0.0'}) as pid, (
            contextlib.closing(Collections(1))) as traffic:
        traffic.connect()
        pin(pid)
        used = cpu_time(pid)
        time.sleep(SECONDS)
        idle = 1e6 * (cpu_time(pid) - used) / (SECONDS * SET_RATE)
    for obstacles in WHOLE_OBSTACLES:
        us, floor, _ = together([('whole',), ('whole_floor',)], lambda: Collections(obstacles))
        with running('whole') as pid, contextlib.closing(Collections(obstacles)) as traffic:
            traffic.connect()
            pin(pid)
            latencies = traffic.latencies(30 * REPEATS, 1 / SET_RATE)
        rows.append({'obstacles': obstacles, 'us': us, 'floor_us': floor,
                     'idle_us': idle, 'core': us * SET_RATE / 1e6,
                     **_percentiles(latencies, p50_ms=50, p99_ms=99)})
    return rows


def _first_flag(kind, **environment):
    """Return the seconds from the start of a node to its first flag."""
    with contextlib.closing(Sender()) as sender:
        start = time.monotonic()
        with running(kind, **environment):
            sender.connect()
            return time.monotonic() - start


def measure_startup():
    """Return seconds to the first flag: kernels to compile, kernels cached, and of the floor."""
    with tempfile.TemporaryDirectory() as cache:
        cold = _first_flag('monitor', NUMBA_CACHE_DIR=cache)
        subprocess.run([sys.executable, '-m', 'sat_collision.replay.kernels'], check=True,
                       stdout=subprocess.DEVNULL, env={**os.environ, 'NUMBA_CACHE_DIR': cache})
        runs = [(_first_flag('monitor', NUMBA_CACHE_DIR=cache), _first_flag('floor'))
                for _ in range(REPEATS)]
    warm, floor = map(statistics.median, zip(*runs))
    return {'cold_s': cold, 'warm_s': warm, 'floor_s': floor}


def plot(figures, path):
    """Draw processor time a message and latency against the number of obstacles."""
    figure, axes = pyplot.subplots(1, 2, figsize=(9.6, 4.2), layout='constrained')
    loads = [one for one in figures['loads'] if one['vertices'] == VERTICES[0]]
    sizes = [one['obstacles'] for one in loads]
    for (kind, title), style in zip(TITLES.items(), ('o-', 's--', '^:')):
        axes[0].loglog(sizes, [one[kind]['cpu_us'] for one in loads], style, label=title)
        axes[1].loglog(sizes, [one[kind]['p99_ms'] for one in loads], style, label=title)
    axes[0].set(xlabel='obstacles at 10 Hz', ylabel='processor time a message [µs]')
    axes[1].set(xlabel='obstacles at 10 Hz', ylabel='publish() to flag, 99 of 100 below [ms]')
    for one in axes:
        one.set_xticks(sizes, [f'{size:,}' for size in sizes])
        one.yaxis.set_minor_locator(LogLocator(subs=(2, 3, 5)))
        one.yaxis.set_major_formatter('{x:g}')
        one.yaxis.set_minor_formatter('{x:g}')
        one.grid(alpha=0.3, which='both')
    figure.legend(*axes[0].get_legend_handles_labels(), loc='outside lower center', ncols=4)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)

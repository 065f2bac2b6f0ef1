# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A monitor's process, processes that publish to it, and a subscriber of its flag."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import math
import os
from pathlib import Path
import random
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from publishers import Publisher, suspended, World
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from std_msgs.msg import Bool

ROOT = Path(__file__).resolve().parents[2]
# README's rule for subscribers: without a flag for this time, it counts as raised, in s.
TOO_OLD = 0.3
# How much later the flag may fall on a busy machine, in s.
SLACK = 30.0
_TIMEOUT = 120.0
# How long the flag must stay down, in s.
_STAYS = 1.5
# On a busy machine a fault begins up to this much later than requested, in s.
_BEGINS = 1.0
_LASTS = 2.0
FAKETIME = next(Path('/usr/lib').glob('*/faketime/libfaketimeMT.so.1'), None)

# The node with a stand-in for tf2_msgs, which pip lacks; raw bytes need no real type. Its loop
# hangs while a file exists.
_PROGRAM = """
import os, sys, time, types
from geometry_msgs.msg import PolygonStamped
sys.modules['tf2_msgs'] = types.ModuleType('tf2_msgs')
sys.modules['tf2_msgs.msg'] = types.ModuleType('tf2_msgs.msg')
sys.modules['tf2_msgs.msg'].TFMessage = PolygonStamped
from sat_collision.node.footprint_monitor import FootprintMonitor
from sat_collision.node.__main__ import main
tick = FootprintMonitor.tick
def tick_or_hang(self, *arguments):
    while os.path.exists(sys.argv[1]):
        time.sleep(0.001)
    return tick(self, *arguments)
FootprintMonitor.tick = tick_or_hang
sleep = time.sleep
def sleep_or_return(seconds):
    try:
        sleep(seconds)
    except OSError:
        pass
# libfaketime says that sleep until a time just passed is invalid, where Linux returns at once.
time.sleep = sleep_or_return
sys.exit(main(sys.argv[2:]))
"""


class Outcome(NamedTuple):
    """The result of a situation; times are in seconds."""

    drivable: float  # time in which the robot might drive, from 0.3 s after contact began
    recovered: float  # from the end of fault and contact until the flag falls; inf if never
    detected: float  # until the flag counts as raised, where the fault began while it was clear
    wrong_clears: int  # flags that say clear during such a fault, later than 1 s after it began


class Rig:
    """
    A monitor process, publishers, and a node that receives flags in a thread of its own.

    `flags` has when each flag was published, and whether it is raised. Parameters are those of
    the monitor; `length` multiplies how often or how long a fault is done.
    """

    def __init__(self, parameters: dict[str, Any], domain: int, length: float = 1.0) -> None:
        self.domain = domain
        self.length = length
        self.world = World()
        self.random = random.Random(1)
        self.flags: list[tuple[float, bool]] = []
        # What the last state says.
        self.message = ''
        self.publishers: list[Publisher] = []
        self._parameters = parameters
        self._folder = tempfile.TemporaryDirectory(prefix='sat_collision_faults_')
        self._hanging, self._clock = (Path(self._folder.name, name) for name in ('hang', 'clock'))
        self._detected, self._wrong_clears = 0.0, 0
        self._processes: list[subprocess.Popen[bytes]] = []
        self._context = rclpy.Context()
        self._context.init(domain_id=domain)
        self.node = rclpy.create_node('witness', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.node.create_subscription(
            Bool, '/footprint_monitor/collision', self._receive_flag, 1000)
        self.node.create_subscription(
            DiagnosticArray, '/footprint_monitor/state', self._receive_state, 1000)
        self._is_open = True
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()
        self.contact()

    def run(self, *command: str) -> subprocess.Popen[bytes]:
        """Run a process until all is closed."""
        self._processes.append(subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env={**os.environ, 'ROS_DOMAIN_ID': str(self.domain)}))
        return self._processes[-1]

    def start_monitor(self) -> None:
        """Start the monitor's process, with the clock that was set, if any."""
        clock = ['env', f'LD_PRELOAD={FAKETIME}', f'FAKETIME_TIMESTAMP_FILE={self._clock}',
                 'FAKETIME_NO_CACHE=1', 'FAKETIME_DONT_FAKE_MONOTONIC=1'
                 ] if self._clock.exists() else []
        arguments = [word for name, value in self._parameters.items()
                     for word in ('-p', f'{name}:={value}')]
        self.monitor = self.run(*clock, sys.executable, '-c', _PROGRAM, str(self._hanging),
                                '--ros-args', *arguments)
        self.until(lambda: self.flags)

    def set_clock(self, seconds: float) -> None:
        """Set the offset of the clock of monitors that are started after the first time."""
        new = self._clock.with_suffix('.new')
        new.write_text(f'{seconds:+}')
        new.replace(self._clock)

    def publish(self, script: Callable[..., None], topic: str = '/obstacles',
                node: str = 'perception', **options: Any) -> Publisher:
        """Start a process that publishes; see `Publisher`."""
        self.publishers.append(Publisher(self.world, self.domain, script, topic, node, **options))
        return self.publishers[-1]

    def respawn(self, script: Callable[..., None], **options: Any) -> None:
        """Start a process in place of one that has ended, and wait for its first message."""
        publisher = self.publish(script, **options)
        self.until(lambda: publisher.sent)

    def await_publishers(self, topic: str, count: int) -> None:
        """Wait until all processes should have found some publishers."""
        self.until(lambda: self.node.count_publishers(topic) == count)
        self.wait(0.5)

    def contact(self, after: float = 0.0) -> None:
        """Let the robot touch the obstacle; it counts now or some time later."""
        self._begun = time.time() + after
        self._ended = math.inf
        self.world.touching.value = 1

    def leave(self) -> None:
        """End the contact."""
        if self.world.touching.value:
            self._ended = time.time()
        self.world.touching.value = 0

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)

    def await_clear(self) -> None:
        """Wait for the flag to fall."""
        since = time.time()
        self.until(lambda: self._falls(since) < math.inf)

    def is_clear(self) -> bool:
        """Tell whether a subscriber that follows the rule may consider the robot clear."""
        when, raised = self.flags[-1] if self.flags else (0.0, True)
        return not raised and time.time() - when < TOO_OLD

    def detect(self) -> None:
        """Wait until a fault is detected, and for some time more."""
        begun = time.time()
        self._detected = self.until(lambda: not self.is_clear())
        self.wait(_LASTS)
        self._wrong_clears = sum(not raised for when, raised in self.flags
                                 if when > begun + _BEGINS)

    def outcome(self, promise: float) -> Outcome:
        """Wait until the flag has fallen and stays down, and return the outcome."""
        since = time.time()
        with contextlib.suppress(TimeoutError):
            self.until(lambda: time.time() - self._falls(since) > _STAYS,
                       promise + SLACK + _STAYS + 1.0)
        return Outcome(drivable(self.flags, self._begun + TOO_OLD, self._ended),
                       self._falls(since) - since, self._detected, self._wrong_clears)

    def set_enabled(self, enabled: bool) -> None:
        """Enable or disable the source of obstacles."""
        client = AsyncParameterClient(self.node, 'footprint_monitor')
        self.until(client.services_are_ready)
        self.until(client.set_parameters([Parameter('obstacle.enabled', value=enabled)]).done)

    def stop_repeatedly(self, pid: int) -> None:
        """Suspend a process for 60 to 300 ms at random moments."""
        for _ in range(round(20 * self.length)):
            self.wait(self.random.uniform(0.05, 0.35))
            with suspended(pid):
                self.wait(self.random.uniform(0.06, 0.3))

    @contextlib.contextmanager
    def hanging(self) -> Iterator[None]:
        """Let the loop of the monitor hang meanwhile."""
        self._hanging.touch()
        try:
            yield
        finally:
            self._hanging.unlink()

    @contextlib.contextmanager
    def busy(self, pid: int, niceness: int = 0) -> Iterator[None]:
        """Run four busy processes on the only core that a process may use."""
        busy = [self.run(sys.executable, '-c', 'while True: pass') for _ in range(4)]
        threads = [int(name) for name in os.listdir(f'/proc/{pid}/task')]
        for one in (*threads, *(process.pid for process in busy)):
            os.sched_setaffinity(one, {0})
        for thread in threads:
            before = os.getpriority(os.PRIO_PROCESS, thread)
            os.setpriority(os.PRIO_PROCESS, thread, before + niceness)
        try:
            yield
        finally:
            for process in busy:
                process.kill()
            for thread in threads:
                with contextlib.suppress(ProcessLookupError):
                    os.sched_setaffinity(thread, range(os.cpu_count() or 1))

    def until(self, condition: Callable[[], object], timeout: float = _TIMEOUT) -> float:
        """Wait for a condition, and return for how long; fail if it never holds."""
        begun = time.monotonic()
        while not condition():
            if time.monotonic() - begun > timeout:
                raise TimeoutError('what was awaited did not happen')
            time.sleep(0.002)
        return time.monotonic() - begun

    def close(self) -> None:
        """
        Stop all threads and processes.

        The node leaves first: Fast DDS 2.14.5 ends a process whose participant leaves within
        about a second after one that it shares memory with was killed while sending.
        """
        self._is_open = False
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.shutdown()
        for process in self._processes:
            process.kill()
            process.wait()
        for publisher in self.publishers:
            publisher.kill()
        self._folder.cleanup()

    def _spin(self) -> None:
        while self._is_open:
            self._executor.spin_once(timeout_sec=0.1)

    def _receive_flag(self, flag: Bool, info: dict[str, int]) -> None:
        # This process may be late; but it has the clock of the machine.
        when = info['received_timestamp' if self._clock.exists() else 'source_timestamp']
        self.flags.append((when / 1e9, flag.data))

    def _receive_state(self, states: DiagnosticArray) -> None:
        self.message = states.status[0].message

    def _falls(self, since: float) -> float:
        """Return when the flag fell for the last time, infinity if it is raised or old."""
        flags = [(when, raised) for when, raised in list(self.flags) if when > since]
        if not flags or flags[-1][1] or time.time() - flags[-1][0] > TOO_OLD:
            return math.inf
        raised = [k for k, (_, raised) in enumerate(flags) if raised]
        return flags[raised[-1] + 1 if raised else 0][0]


def drivable(flags: Sequence[tuple[float, bool]], begun: float, ended: float) -> float:
    """Return how long a robot might drive within a time span, by flags and their times."""
    nexts = [when for when, _ in flags[1:]] + [math.inf]
    return sum(max(min(after, when + TOO_OLD, ended) - max(when, begun), 0.0)
               for (when, raised), after in zip(list(flags), nexts) if not raised)

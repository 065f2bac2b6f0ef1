# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Faults of a real node process over DDS: how soon each is detected, and how soon it recovers.

``make faults`` does each several times and writes the table of docs/reliability.md; the test suite
does each once. Clocks are stepped if libfaketime is installed.
"""

import argparse
from collections.abc import Callable
import contextlib
from functools import partial
import os
from pathlib import Path
import signal
import statistics
import sys
import tempfile
import threading
import time
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'support'), str(ROOT / 'docs')]

from builders import box, serialised  # noqa: E402
from geometry_msgs.msg import PolygonStamped  # noqa: E402
from page_parts import replace_part  # noqa: E402
from rclpy.duration import Duration  # noqa: E402
from rclpy.event_handler import SubscriptionEventCallbacks  # noqa: E402
from rclpy.qos import LivelinessPolicy, QoSProfile  # noqa: E402
from witness import TOO_OLD, Witness  # noqa: E402

_PERIOD = 0.02
_TIMEOUT = 0.5
# Obstacles per set.
_COUNT = 20
# How many messages a publisher keeps for a monitor that does not receive them.
_DEPTH = 5 * _COUNT
_STEP = 10.0
# On a busy machine a fault begins up to this much later than requested, in s.
_BEGINS = 1.0
_FAKETIME = next(Path('/usr/lib').glob('*/faketime/libfaketimeMT.so.1'), None)

# The node, with a loop that hangs while a file exists.
_PROGRAM = """
import os, sys, time
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
    """How a fault went."""

    # Seconds from the fault until a subscriber that follows README's rule considers the flag
    # raised, and from the end of the fault until the flag falls again.
    detected: float
    recovered: float
    # Flags that say clear during the fault, later than 1 s after it began.
    wrong_clears: int


class Rig(Witness):
    """A node process, publishers of a robot and of far obstacles, and a subscriber of the flag."""

    def __init__(self, domain: int) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix='sat_collision_faults_')
        self.hanging = Path(self._folder.name, 'hang')
        self._clock = Path(self._folder.name, 'clock')
        super().__init__(
            domain, QoSProfile(depth=100, deadline=Duration(seconds=0.35),
                               liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                               liveliness_lease_duration=Duration(seconds=0.6)),
            event_callbacks=SubscriptionEventCallbacks(
                deadline=lambda event: None, liveliness=lambda event: None))
        self._publishers = {name: self.node.create_publisher(PolygonStamped, name, _DEPTH)
                            for name in ('footprint', 'obstacles')}
        self.x = {'footprint': 0.0, 'obstacles': 5.0}
        self.silent: set[str] = set()
        self.damaged: set[str] = set()
        self._one_at_a_time = threading.Lock()
        self._ended = threading.Event()
        self._sender = threading.Thread(target=self._publish)
        self._sender.start()

    def start(self, *command: str) -> None:
        """Start the node's process, optionally through another command."""
        self.process = self.run(
            [*command, sys.executable, '-c', _PROGRAM, str(self.hanging), '--ros-args',
             '-p', f'footprint.timeout:={_TIMEOUT}', '-p', f'obstacle.timeout:={_TIMEOUT}',
             '-p', 'obstacle.set_end:=empty_polygon'])

    def restart(self, *command: str) -> None:
        self.kill()
        # Drop the flags of the old process.
        time.sleep(0.2)
        self.flags.clear()
        self.start(*command)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def start_with_own_clock(self) -> None:
        """Restart the node's process with a clock that can be stepped."""
        self.step_clock(0.0)
        self.restart('env', f'LD_PRELOAD={_FAKETIME}', f'FAKETIME_TIMESTAMP_FILE={self._clock}',
                     'FAKETIME_NO_CACHE=1', 'FAKETIME_DONT_FAKE_MONOTONIC=1')

    def step_clock(self, seconds: float) -> None:
        """Set the offset of the node's clock."""
        new = self._clock.with_suffix('.new')
        new.write_text(f'{seconds:+}')
        new.replace(self._clock)

    def publish(self, name: str) -> None:
        """Publish a footprint or a set of obstacles, possibly damaged."""
        stamp = time.time_ns()
        polygons: list[list[tuple[float, float]]] = [box(self.x[name], 0)]
        if name == 'obstacles':
            polygons += [box(self.x[name] + 2 * k, 0) for k in range(1, _COUNT)] + [[]]
        with self._one_at_a_time:
            for polygon in polygons:
                data = serialised(polygon, stamp)
                self._publishers[name].publish(data[:-5] if name in self.damaged else data)

    def close(self) -> None:
        """Stop all threads and processes."""
        self._ended.set()
        self._sender.join()
        super().close()
        self._folder.cleanup()

    def _publish(self) -> None:
        while not self._ended.wait(_PERIOD):
            for name in self._publishers:
                if name not in self.silent:
                    self.publish(name)

    def time_of(self, info: dict[str, int]) -> float:
        """Return when a message is received, since the clock of the node may be stepped."""
        return time.monotonic()

    def is_clear(self) -> bool:
        """Tell whether a subscriber that follows the rule may consider the robot clear."""
        if not self.flags:
            return False
        when, raised = self.flags[-1]
        return not raised and time.monotonic() - when < TOO_OLD


def outcome(rig: Rig, begin: Callable[[], object], end: Callable[[], object],
            lasting: float = 2.0) -> Outcome:
    """Cause a fault in a rig that is clear."""
    rig.until(rig.is_clear)
    begun = time.monotonic()
    begin()
    detected = rig.until(lambda: not rig.is_clear())
    time.sleep(lasting)
    wrong = sum(not raised for when, raised in rig.flags if when > begun + _BEGINS)
    end()
    return Outcome(detected, rig.until(rig.is_clear), wrong)


def _bad(kind: str, name: str) -> Callable[[Rig], Outcome]:
    """Make a topic silent or damaged."""
    return lambda rig: outcome(rig, lambda: getattr(rig, kind).add(name), getattr(rig, kind).clear)


def _clock_stepped(seconds: float) -> Callable[[Rig], Outcome]:
    def fault(rig: Rig) -> Outcome:
        rig.start_with_own_clock()
        try:
            return outcome(rig, lambda: rig.step_clock(seconds), lambda: rig.step_clock(0.0))
        finally:
            rig.restart()
    return fault


def _contact_in_flood(rig: Rig) -> Outcome:
    """Let the robot touch an obstacle while another publisher floods the topic."""
    flooded = threading.Event()
    # Created only with the fault: a topic with two publishers is unknown.
    noise = []

    def flood() -> None:
        while not flooded.wait(0.001):
            for _ in range(10):
                noise[0].publish(b'no message')
    thread = threading.Thread(target=flood)

    def begin() -> None:
        rig.x['footprint'] = 5.0
        noise.append(rig.node.create_publisher(PolygonStamped, 'obstacles', 1000))
        thread.start()

    def end() -> None:
        flooded.set()
        thread.join()
        rig.node.destroy_publisher(noise[0])
        rig.x['footprint'] = 0.0
    try:
        return outcome(rig, begin, end)
    finally:
        flooded.set()


FAULTS: dict[str, Callable[[Rig], Outcome]] = {
    'no fault: the robot touches an obstacle': lambda rig: outcome(
        rig, partial(rig.x.update, footprint=5.0), partial(rig.x.update, footprint=0.0)),
    'the monitor is killed and started again': lambda rig: outcome(rig, rig.kill, rig.start),
    'the monitor is stopped and goes on (SIGSTOP, SIGCONT)': lambda rig: outcome(
        rig, partial(rig.process.send_signal, signal.SIGSTOP),
        partial(rig.process.send_signal, signal.SIGCONT)),
    'the loop of the monitor hangs': lambda rig: outcome(
        rig, rig.hanging.touch, rig.hanging.unlink),
    'the footprint is silent (timeout 0.5 s)': _bad('silent', 'footprint'),
    'the obstacles are silent (timeout 0.5 s)': _bad('silent', 'obstacles'),
    'footprints come damaged': _bad('damaged', 'footprint'),
    'obstacles come damaged': _bad('damaged', 'obstacles'),
    'the robot touches while 10,000 messages/s of no use come': _contact_in_flood,
    **({f'the clock of the monitor is stepped by {step:+g} s, and back': _clock_stepped(step)
        for step in (_STEP, -_STEP)} if _FAKETIME else {}),
}


@contextlib.contextmanager
def rig(domain: int):
    """Yield a rig whose node has been clear once."""
    made = Rig(domain)
    try:
        made.start()
        made.until(made.is_clear)
        yield made
    finally:
        made.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--repeat', type=int, default=10)
    parser.add_argument('--write', metavar='FILE', type=Path,
                        help='a page whose table is to be replaced')
    arguments = parser.parse_args()
    rows = ['| fault | detected after | recovered after | wrong clears |', '|---|---|---|---|']
    with rig(int(os.environ.get('ROS_DOMAIN_ID', 0))) as made:
        for name, fault in FAULTS.items():
            outcomes = [fault(made) for _ in range(arguments.repeat)]
            cells = [f'{statistics.median(times):.2f} s (at most {max(times):.2f} s)'
                     for times in list(zip(*outcomes))[:2]]
            wrong = sum(one.wrong_clears for one in outcomes)
            rows.append(f'| {name} | {cells[0]} | {cells[1]} | {wrong} of {len(outcomes)} |')
            print(rows[-1], flush=True)
    if arguments.write:
        replace_part(arguments.write, 'faults', '\n'.join(rows))


if __name__ == '__main__':
    main()

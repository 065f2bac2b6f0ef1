# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
How the node bears floods on a second topic of obstacles.

While one topic is flooded, a footprint is by turns on and off an obstacle of the other: how late
is its flag, how regular are the flags, and how long does the node take to end.
"""

import argparse
import contextlib
from pathlib import Path
import signal
import subprocess
import sys
import threading
import time

from flooder import FLOODS
from node import ros
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Bool
from traffic import Traffic

_FLOODER = Path(__file__).parent / 'flooder.py'
_NODE = ['-m', 'sat_collision.node', '--ros-args', '-p', 'obstacles:=[obstacle, flood]',
         '-p', 'obstacle.topic:=obstacles', '-p', 'flood.topic:=flood',
         '-p', 'unknown_is_collision:=false']
_SETTLING = 2.0
_FAREWELL = 2.0


class Listener:
    """Notes when flags come, in a thread of its own."""

    def __init__(self):
        self._node = rclpy.create_node('listener')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._arrivals = []
        self._node.create_subscription(
            Bool, '/footprint_monitor/collision',
            lambda flag: self._arrivals.append(time.monotonic()), 100)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()

    def longest_gap(self, since):
        """Return the longest time in s without a flag."""
        return float(np.diff([since, *(t for t in self._arrivals if t > since),
                              time.monotonic()]).max())

    def close(self):
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()


def bear(kind, seconds):
    """
    Flood a node.

    Returns
    -------
    dict
        Messages offered a second, latencies in ms, longest gap between flags, time to the end in
        s, exit status.

    """
    node = subprocess.Popen([sys.executable, *_NODE], stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL)
    with contextlib.closing(Traffic(1, 4, 1)) as traffic, contextlib.closing(
            Listener()) as listener:
        traffic.connect()
        flooder = subprocess.Popen(
            [sys.executable, str(_FLOODER), kind, str(_SETTLING + seconds + _FAREWELL)],
            stdout=subprocess.PIPE, text=True)
        traffic.run(_SETTLING)
        since = time.monotonic()
        footprints, _, latencies = traffic.run(seconds)
        gap = listener.longest_gap(since)
        asked = time.monotonic()
        node.send_signal(signal.SIGTERM)
        status = node.wait(30)
        ending = time.monotonic() - asked
        still_flooded = flooder.poll() is None
        offered = int(flooder.communicate()[0])
    return {'offered_per_second': offered, 'answered': len(latencies) / footprints,
            'p50_ms': 1e3 * float(np.percentile(latencies, 50)),
            'p99_ms': 1e3 * float(np.percentile(latencies, 99)), 'gap_s': gap,
            'end_s': ending if still_flooded else float('nan'), 'status': status}


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--only', choices=FLOODS, action='append')
    arguments = parser.parse_args()
    head = ('flood', 'offered/s', 'answered', 'p50 ms', 'p99 ms', 'longest gap s', 'end s',
            'status')
    print('| ' + ' | '.join(head) + ' |\n' + '|---' * len(head) + '|')
    with ros():
        for kind in arguments.only or FLOODS:
            row = bear(kind, arguments.seconds)
            print(f'| {kind} | {row["offered_per_second"]:,} | {row["answered"]:.0%} '
                  f'| {row["p50_ms"]:.1f} | {row["p99_ms"]:.1f} | {row["gap_s"]:.2f} '
                  f'| {row["end_s"]:.2f} | {row["status"]} |', flush=True)


if __name__ == '__main__':
    main()

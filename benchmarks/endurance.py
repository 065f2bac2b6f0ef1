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
Does the node last: starts and stops, publishers that come and go; for a soak see soak.py.

Memory, threads and open files of the process that has the node are printed as it goes; none of
them must grow once the first tenth is over.
"""

import argparse
import contextlib
import os
from pathlib import Path
import threading
import time

from geometry_msgs.msg import PolygonStamped
from node import ros
import rclpy
from rclpy.node import Node
from sat_collision.node.footprint_monitor import FootprintMonitor
from traffic import pack, PATIENCE, regular

_REPORTS = 10


def held(pid):
    """Return memory in MB, threads and open files of a process."""
    status = dict(line.split(':', 1) for line in
                  Path(f'/proc/{pid}/status').read_text().splitlines())
    return {'MB': int(status['VmRSS'].split()[0]) / 1e3, 'threads': int(status['Threads']),
            'files': len(os.listdir(f'/proc/{pid}/fd'))}


@contextlib.contextmanager
def monitor():
    """Run a node in a thread, in a context of its own."""
    context = rclpy.Context()
    context.init()
    node = FootprintMonitor(context=context)
    stop = threading.Event()
    thread = threading.Thread(target=node.loop.run, args=(stop.is_set,))
    thread.start()
    try:
        yield node
    finally:
        stop.set()
        thread.join()
        node.loop.close()
        node.destroy_node()
        context.shutdown()


def start_and_stop():
    """Start a node, have it tick, and stop it."""
    with monitor() as node:
        ticked = threading.Event()
        tick = node.tick
        node.tick = lambda *arguments: (ticked.set(), tick(*arguments))[1]
        if not ticked.wait(PATIENCE):
            raise TimeoutError('the node does not tick')


def come_and_go(node, peer):
    """Let a publisher come, be heard by a node, and go."""
    before = node._monitor.received['obstacle']
    publisher = peer.create_publisher(PolygonStamped, 'obstacles', 10)
    end = time.monotonic() + PATIENCE
    while node._monitor.received['obstacle'] == before:
        if time.monotonic() > end:
            raise TimeoutError('the publisher is not heard')
        publisher.publish(pack(regular(4, 5.0, 5.0, 0.5), time.time_ns()))
        time.sleep(0.002)
    peer.destroy_publisher(publisher)


def repeat(what, count, action):
    """Do something so often and print what this process holds after each tenth."""
    begun = time.monotonic()
    for k in range(count):
        action()
        if (k + 1) % max(count // _REPORTS, 1) == 0:
            print(f'{what} {k + 1:6,}  {in_words(os.getpid())}  '
                  f'{(time.monotonic() - begun) / (k + 1):.3f} s each', flush=True)


def in_words(pid):
    """Return what a process has, as `held` finds it, in words."""
    return '  '.join(f'{value:6.1f} {name}' if name == 'MB' else f'{value:3} {name}'
                     for name, value in held(pid).items())


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--starts', type=int, default=1000)
    parser.add_argument('--publishers', type=int, default=1000)
    arguments = parser.parse_args()
    with ros():
        repeat('starts', arguments.starts, start_and_stop)
        if arguments.publishers:
            with monitor() as node:
                peer = Node('peer')
                repeat('publishers', arguments.publishers, lambda: come_and_go(node, peer))
                peer.destroy_node()


if __name__ == '__main__':
    main()

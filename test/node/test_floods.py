# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A flooded node; nodes and publishers that come and go without leaking threads or files."""

import os
import signal

from harness import APART, box, ROBOT, RunningMonitor, values
import pytest
from sat_collision.geometry.compiled.jit import COMPILED

NODE = ['-m', 'sat_collision.node', '--ros-args', '-p', 'obstacles:=[obstacle, flood]',
        '-p', 'obstacle.topic:=obstacles', '-p', 'obstacle.set_end:=empty_polygon', '-p',
        'flood.topic:=flood']
# The flood ends by itself after this time in s.
FLOODED = 240.0
# Messages per second; with more, the middleware loses messages of other topics, too.
MAX_RATE = 10_000
# Longer than DDS takes to repeat messages that the flood displaced, in s.
SOON = 40.0


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='a comb takes plain Python seconds')
@pytest.mark.parametrize('kind', ['1024-gons', 'combs of 1024', '4-gons', 'truncated', 'NaN'])
def test_flood_on_one_topic_does_not_block_others(run, peer, kind):
    """Contacts on the other topic are seen soon, and so is a signal."""
    node = run(*NODE, env={'NUMBA_DISABLE_JIT': '0'})
    peer.until(peer.status, 'a state')
    flooder = run('test/node/flooder.py', kind, str(FLOODED), f'--max={MAX_RATE}')
    peer.until(lambda: (health := peer.health())
               and int(values(health).get('flood: received', 0)) > 100, 'a flood')
    near, far = (box(1, 1), ['obstacle/0']), (box(5, 5), [])
    for polygon, met in (near, far, near):
        def seen():
            peer.send_set('obstacles', polygon)
            peer.send('footprint', ROBOT)
            peer.spin(0.03)
            return peer.contacts() == met
        peer.until(seen, f'contact with {met}', SOON)
    received = peer.listen('~/collision')
    before = len(received)
    peer.until(lambda: len(received) > before + 10, 'regular flags', SOON)
    node.send_signal(signal.SIGTERM)
    assert node.wait(timeout=SOON) == 0
    assert flooder.poll() is None, 'it was flooded to the end'


def resources():
    """Return the number of threads and open files of this process."""
    return len(os.listdir('/proc/self/task')), len(os.listdir('/proc/self/fd'))


def test_repeated_starts_do_not_leak(domain):
    counts = []
    for _ in range(12):
        monitor = RunningMonitor(domain, (), {})
        monitor.until(monitor.flag)
        monitor.close()
        counts.append(resources())
    assert counts[-1] <= counts[3]


def test_publishers_that_come_and_go_do_not_leak(start):
    monitor = start()
    counts = []
    for _ in range(60):
        before = monitor.received['obstacle']
        publisher = monitor.publisher('obstacles')

        def received():
            monitor.send_set('obstacles', APART)
            return monitor.received['obstacle'] > before
        monitor.until(received, 'a message')
        monitor.node.destroy_publisher(publisher)
        monitor._publishers.clear()
        counts.append(resources())
    assert counts[-1] <= counts[9]

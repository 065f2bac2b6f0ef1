# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A flooded node; nodes and publishers that come and go without leaking threads or files."""

import math
import os
import signal

from builders import serialised
from harness import APART, health, RunningMonitor, TOUCHING
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

# Publishes all of a message but its stamp, given as hexadecimal digits, at a rate in Hz.
FLOODER = """
import struct, sys, time
from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.qos import QoSProfile
content, rate, seconds = bytes.fromhex(sys.argv[1]), *map(float, sys.argv[2:])
rclpy.init()
publisher = rclpy.create_node('flooder').create_publisher(
    PolygonStamped, '/flood', QoSProfile(depth=1000))
begun = time.monotonic()
sent = 0
while (passed := time.monotonic() - begun) < seconds:
    if sent >= passed * rate:
        time.sleep(0.001)
    stamp = struct.pack('<4sII', b'\\0\\1\\0\\0', *divmod(time.time_ns(), 10**9))
    publisher.publish(stamp + content)
    sent += 1
"""


def circle(count):
    return [(500.0 + math.cos(2.0 * math.pi * k / count), math.sin(2.0 * math.pi * k / count))
            for k in range(count)]


def comb(count):
    """Return a polygon whose vertices are mostly the tips and roots of its teeth."""
    teeth = [(500.0 + 0.01 * k, 1.0 + 4.0 * (k % 2)) for k in range(1, count - 2)]
    width = 0.01 * (count - 2)
    return [(500.0, 0.0), *teeth, (500.0 + width, 0.0), (500.0 + width / 2, -1.0)][::-1]


@pytest.mark.long
@pytest.mark.skipif(not COMPILED, reason='a comb takes plain Python seconds')
@pytest.mark.parametrize('points, rate, length', [
    (circle(1024), MAX_RATE, None), (comb(1024), 1_000, None), (circle(4), MAX_RATE, None),
    (circle(4), MAX_RATE, -7), ([(math.nan, 0.0), *circle(3)], MAX_RATE, None)],
    ids=['1024-gons', 'combs of 1024', '4-gons', 'truncated', 'NaN'])
def test_flood_on_one_topic_does_not_block_others(run, peer, points, rate, length):
    """Contacts on the other topic are seen soon, and so is a signal."""
    node = run(*NODE, env={'NUMBA_DISABLE_JIT': '0'})
    peer.until(peer.status, 'a state')
    flooder = run('-c', FLOODER, serialised(points, 0)[12:length].hex(), str(rate), str(FLOODED))
    peer.until(lambda: int(health(peer).get('flood: received', 0)) > 100, 'a flood')
    for polygon, met in ((TOUCHING, ['obstacle/0']), (APART, []), (TOUCHING, ['obstacle/0'])):
        peer.repeat(lambda: peer.send_both(polygon), lambda: peer.contacts() == met,
                    f'contact with {met}', SOON)
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
        monitor.repeat(lambda: monitor.send_set('obstacles', APART),
                       lambda: monitor.received['obstacle'] > before, 'a message')
        monitor.leave('obstacles')
        counts.append(resources())
    assert counts[-1] <= counts[9]

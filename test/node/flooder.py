# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Publishes on /flood for some time, at a given rate or as fast as it can."""

import argparse
import itertools
import math
import struct
import time

from geometry_msgs.msg import PolygonStamped
import rclpy
from rclpy.qos import QoSProfile

_FAR = 500.0
_LONGEST = 300.0
_BURST = 0.001


def _circle(count):
    return [(_FAR + math.cos(2.0 * math.pi * k / count), math.sin(2.0 * math.pi * k / count))
            for k in range(count)]


def _comb(count):
    """Return a polygon whose vertices are mostly the tips and roots of its teeth."""
    teeth = [(_FAR + 0.01 * k, 1.0 + 4.0 * (k % 2)) for k in range(1, count - 2)]
    width = 0.01 * (count - 2)
    return [(_FAR, 0.0), *teeth, (_FAR + width, 0.0), (_FAR + width / 2, -1.0)][::-1]


# Polygon, messages per second, and the number of bytes cut off each message.
FLOODS = {
    '1024-gons': (_circle(1024), 100_000, 0),
    'combs of 1024': (_comb(1024), 1_000, 0),
    '4-gons': (_circle(4), 85_000, 0),
    'truncated': (_circle(4), 75_000, 7),
    'NaN': ([(math.nan, 0.0), *_circle(3)], 84_000, 0)}


def _body(points, cut):
    """Serialise all of a message but its stamp."""
    data = struct.pack('<I4sI', 4, b'map\0', len(points)) + b''.join(
        struct.pack('<3f', x, y, 0.0) for x, y in points)
    return data[:len(data) - cut]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('kind', choices=FLOODS)
    parser.add_argument('seconds', type=float)
    parser.add_argument('--max', type=float, default=math.inf, help='messages per second')
    arguments = parser.parse_args()
    points, rate, cut = FLOODS[arguments.kind]
    rate = min(rate, arguments.max)
    body = _body(points, cut)
    rclpy.init()
    node = rclpy.create_node('flooder')
    publisher = node.create_publisher(PolygonStamped, '/flood', QoSProfile(depth=1000))
    begun = time.monotonic()
    end = begun + min(arguments.seconds, _LONGEST)
    for sent in itertools.count():
        now = time.monotonic()
        if now >= end:
            break
        if sent >= (now - begun) * rate:
            time.sleep(_BURST)
        publisher.publish(struct.pack('<4sII', b'\0\1\0\0', *divmod(time.time_ns(), 10**9)) + body)
    print(f'{sent / (time.monotonic() - begun):.0f}')
    rclpy.shutdown()


if __name__ == '__main__':
    main()

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Random bytes, polygons and parameters: unexpected errors and wrong results.

- bytes: a changed message is refused with a reason, or read as rclpy's own decoder does.
- polygons: random numbers give a body whose parts cover its area, or a PolygonError.
- parameters: values of all types are refused in one line, or a monitor runs with them.
"""

import argparse
import math
from pathlib import Path
import random
import sys
import time

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / 'test' / 'support')]

from builders import box, serialised  # noqa: E402
from geometry_msgs.msg import PolygonStamped  # noqa: E402
import numpy as np  # noqa: E402
from rclpy.serialization import deserialize_message as deserialize  # noqa: E402
from sat_collision.geometry.body.polygon import Polygon, PolygonError  # noqa: E402
from sat_collision.messages.cdr import decode, MessageError  # noqa: E402
from sat_collision.monitor import Monitor, Rejection  # noqa: E402
from sat_collision.replay.model.configuration import settings_of  # noqa: E402
from sat_collision.scene.footprints import Status  # noqa: E402
from sat_collision.scene.parameters import declare_parameters, ParameterError  # noqa: E402
from sat_collision.scene.settings import POLYGON_INSTANCE, SET_ENDS  # noqa: E402

_NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-45, 3.4e38, -3.4e38, 16777216.0, 0.1, math.inf, math.nan)
_VALUES = (*_NUMBERS, None, True, False, 0, 1, -1, 7, 10**6, 10**30, 1e-3, 0.3, 50.0, 1e9, '',
           'a b', '/x', '~', '~/x', 'x' * 300, '\n', '{', 'obstacles', 'map', 'polygon',
           'polygon_instance', *SET_ENDS, [], ['a'], ['a', 'b'], ['a', 'a'], ['margin'], [1],
           ['a\nb'], {}, b'x')
_NAMES = ['no_such', 'a.topic', 'b.timeout']
declare_parameters(lambda name, default, spec: (_NAMES.append(name), default)[1])


def fuzz_bytes(rng, monitor):
    """Give a monitor a damaged message."""
    data = bytearray(serialised(box(rng.random(), 0), order=rng.choice('<>'),
                                frame_id=rng.choice(('map', 'a', 'odom' * 9))))
    for _ in range(rng.randrange(4)):
        data[rng.randrange(len(data))] = rng.choice((0, 1, 255, rng.randrange(256)))
    if rng.random() < 0.2:
        data = data[:rng.randrange(len(data) + 1)]
    if rng.random() < 0.1:
        data += rng.randbytes(rng.randrange(1, 9))
    check_message(bytes(data), rng.choice(('footprint', 'obstacle')), monitor)


def check_message(data, name, monitor):
    """Give a monitor bytes, which it refuses or reads as rclpy's own decoder does."""
    rejection = monitor.receive(name, data, 10**18)
    assert rejection is None or (isinstance(rejection, Rejection)
                                 and rejection.text.isprintable() and len(rejection.text) < 900)
    try:
        stamp, frame_id, (points, start, count, _), _ = decode(data, False)
    except MessageError:
        return
    message = deserialize(data, PolygonStamped)
    assert message.header.frame_id == frame_id and len(message.polygon.points) == count
    numbers = np.frombuffer(points, np.float32, 3 * count, start).reshape(-1, 3)
    theirs = np.float32([(p.x, p.y, p.z) for p in message.polygon.points]).reshape(-1, 3)
    assert np.array_equal(numbers, theirs, equal_nan=True)


def fuzz_polygon(rng, monitor):
    """Make a polygon of few different numbers, or of any."""
    count = rng.randrange(1, 12)
    if rng.random() < 0.7:
        points = [(rng.randrange(4), rng.randrange(4)) for _ in range(count)]
    else:
        points = [(rng.choice(_NUMBERS), rng.choice(_NUMBERS)) for _ in range(count)]
    try:
        body = Polygon(points)
    except PolygonError as error:
        assert str(error).isprintable()
        return
    if max(map(abs, body.bounds)) < 1e6:
        parts = sum(_area(part.vertices) for part in body.parts)
        assert abs(parts - _area(body.vertices)) <= 1e-9 * max(1.0, parts), points


def fuzz_parameters(rng, monitor):
    """Run a monitor with values of any type."""
    given = {rng.choice(_NAMES): rng.choice(_VALUES) for _ in range(rng.randrange(1, 4))}
    try:
        settings = settings_of(given)
    except ParameterError as error:
        assert '\n' not in str(error) and str(error)
        return
    made = Monitor(settings)
    for k in range(3):
        now = 10**18 + rng.choice((0, 1, 10**8, 10**10)) * k
        for one in (*settings.footprints, *settings.obstacles):
            instance = 1 if getattr(one, 'type', '') == POLYGON_INSTANCE else None
            made.receive(one.name, serialised(box(0.5 * k, 0), stamp=now, instance=instance), now,
                         k + 1)
        made.advance(now + 1)
        made.scene.take_changes()
    for one in settings.footprints:
        if not (settings.enabled and one.enabled):
            assert made.scene.status(one.name) is Status.UNKNOWN


def _area(vertices):
    x, y = vertices[:, 0], vertices[:, 1]
    return 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


FUZZERS = {'bytes': fuzz_bytes, 'polygons': fuzz_polygon, 'parameters': fuzz_parameters}


def fuzz(name, count, seed):
    """Run a fuzzer on a number of inputs; a failure can be repeated with its seed."""
    monitor = Monitor(settings_of({}))
    for k in range(count):
        try:
            FUZZERS[name](random.Random(f'{seed} {k}'), monitor)
        except BaseException:
            print(f'{name}: input {k} of seed {seed}', file=sys.stderr)
            raise


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--inputs', type=float, default=1e7, help='of all fuzzers together')
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    for name in FUZZERS:
        begun = time.monotonic()
        count = round(arguments.inputs / len(FUZZERS))
        fuzz(name, count, arguments.seed)
        print(f'{name}: {count:,} inputs, {time.monotonic() - begun:.0f} s', flush=True)


if __name__ == '__main__':
    main()

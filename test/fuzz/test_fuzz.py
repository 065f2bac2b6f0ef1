# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Random bytes, polygons, parameters and files: unexpected errors and wrong results.

- bytes: a changed message is refused with a reason, or read as rclpy's own decoder does.
- polygons: random numbers give a body whose parts cover its area, or a PolygonError.
- parameters: values of all types are refused in one line, or a monitor runs with them.
- files: no damage of a recording, a parameter file or a stored result raises an unexpected error,
  and a recording without reported problems has every message. If the format has checksums the
  messages are identical, unless the damage sets a checksum to 0, which in MCAP means that there is
  none.

``make fuzz`` is the long form, and lets atheris choose bytes, guided by the lines that they reach.
"""

import argparse
import contextlib
from io import BytesIO
import json
import math
from pathlib import Path
import random
import shutil
import sys
import tempfile
import time

from builders import box, odometry, serialised, transforms
from geometry_msgs.msg import PolygonStamped
import numpy as np
import pytest
from rclpy.serialization import deserialize_message as deserialize
from sat_collision.geometry.body.polygon import Polygon, PolygonError
from sat_collision.messages.cdr import (
    decode, decode_odometry, decode_transforms, MessageError)
from sat_collision.messages.transform_listener import TF, TF_STATIC
from sat_collision.monitor import Monitor, Rejection
from sat_collision.replay.check import check
from sat_collision.replay.model.configuration import parameters_of_file, settings_of
from sat_collision.replay.output.formats import (
    BaselineError, differences_from, read_baseline, write_json)
from sat_collision.scene.footprints import Status
from sat_collision.scene.parameters import declare_parameters, ParameterError
from sat_collision.scene.settings import POLYGON_INSTANCE, SET_ENDS

pytest.importorskip('mcap')

from mcap.records import Chunk, DataEnd, Footer  # noqa: E402, I100
from mcap.stream_reader import StreamReader  # noqa: E402
from recordings import write  # noqa: E402
from sat_collision.replay.bag.recording import Recording  # noqa: E402
from sat_collision.replay.bag.storage import Limits  # noqa: E402
from storages import write_mcap  # noqa: E402

_NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-45, 3.4e38, -3.4e38, 16777216.0, 0.1, math.inf, math.nan)
_VALUES = (*_NUMBERS, None, True, False, 0, 1, -1, 7, 10**6, 10**30, 1e-3, 0.3, 50.0, 1e9, '',
           'a b', '/x', '~', '~/x', 'x' * 300, '\n', '{', 'obstacles', 'map', 'polygon',
           'polygon_instance', *SET_ENDS, [], ['a'], ['a', 'b'], ['a', 'a'], ['margin'], [1],
           ['a\nb'], {}, b'x')
_NAMES = ['no_such', 'a.topic', 'b.timeout']
declare_parameters(lambda name, default, spec: (_NAMES.append(name), default)[1])
TOPICS = {'/footprint', '/obstacles'}
MESSAGES = [(topic, k / 10, box(x)) for k in range(40)
            for topic, x in (('/footprint', 0.0), ('/obstacles', 0.5))]
LIMITS = Limits(10**8, 10**8)
EDGES = [b'\0' * 8, b'\xff' * 8, b'\xff' * 4, b'\1' + bytes(7), b'\0\0\0\x80', b'*a', b'&a', b': ']
PARAMETERS = b"""\
/**:
  ros__parameters: {frame_id: "map", enabled: true}
/robot/footprint_monitor:
  ros__parameters:
    footprints: [a, b]
    obstacles: [c]
    c.type: polygon_instance
    c: {topic: ~/seen, timeout: 1e1, max_count: 7}
    a.timeout: 0.5
"""
PLAIN = Monitor(settings_of({}))
PLACING = Monitor(settings_of({'frame_id': 'map'}), transforms=True)


def fuzz_bytes(rng, _):
    """Give a monitor a damaged message."""
    data = bytearray(serialised(box(rng.random(), 0), order=rng.choice('<>'),
                                frame_id=rng.choice(('map', 'a', 'odom' * 9))))
    for _ in range(rng.randrange(4)):
        data[rng.randrange(len(data))] = rng.choice((0, 1, 255, rng.randrange(256)))
    if rng.random() < 0.2:
        data = data[:rng.randrange(len(data) + 1)]
    if rng.random() < 0.1:
        data += rng.randbytes(rng.randrange(1, 9))
    check_message(bytes(data), rng.choice(('footprint', 'obstacle')), PLAIN)


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


def fuzz_polygon(rng, _):
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


def fuzz_parameters(rng, _):
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


def mutated(data, rng):
    """Return bytes with a few random faults."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        if not data:
            break
        at = rng.randrange(len(data))
        end = min(len(data), at + rng.choice((1, 2, 8, 30, 200)))
        match rng.randrange(8):
            case 0 | 1:
                data[at] ^= 1 << rng.randrange(8)
            case 2:
                data[at:end] = bytes(end - at)
            case 3:
                data[at:end] = rng.randbytes(end - at)
            case 4:
                del data[at:end]
            case 5:
                data[at:at] = data[at:end]
            case 6:
                edge = rng.choice(EDGES)
                data[at:at + len(edge)] = edge
            case 7:
                if rng.random() < 0.2:
                    del data[at:]
    return bytes(data)


def read(path):
    """Return the topics, the messages and the problems of a recording."""
    with Recording(path, LIMITS) as recording:
        messages = [(topic, time, data) for topic, times, row in recording.rows(TOPICS)
                    for time, data in zip(times, row)]
        return dict(recording.topics), messages, recording.problems


def absent_checksums(data):
    """Return how many checksums of an MCAP file are 0."""
    fields = {Chunk: 'uncompressed_crc', DataEnd: 'data_section_crc', Footer: 'summary_crc'}
    records = StreamReader(BytesIO(data), emit_chunks=True).records
    return sum(getattr(record, fields.get(type(record), ''), None) == 0 for record in records)


class Bag:
    """A recording of which one file is damaged; `exact` if checksums protect its messages."""

    def __init__(self, bag, name, exact):
        self._bag, self._file, self._exact = bag, bag / name, exact
        self._data = self._file.read_bytes()
        self.name = f'{bag.name}/{name}'
        self._topics, self._messages, problems = read(bag)
        assert not problems and len(self._messages) == len(MESSAGES)

    def try_one(self, rng):
        """Damage the file and read it; sometimes check it, too."""
        data = mutated(self._data, rng)
        self._file.write_bytes(data)
        topics, messages, problems = read(self._bag)
        if not problems:
            if self._exact and (topics, messages) != (self._topics, self._messages):
                assert absent_checksums(data) > absent_checksums(self._data)
            assert len(messages) == len(MESSAGES)
        if rng.random() < 0.05:
            check(self._bag)


class Text:
    """A file of which each damage is read without an error, or with one of a kind."""

    def __init__(self, file, data, take, error):
        self._file, self._data, self._take, self._error = file, data, take, error
        self.name = file.name

    def try_one(self, rng):
        """Damage the file and read it."""
        self._file.write_bytes(mutated(self._data, rng))
        with contextlib.suppress(self._error):
            self._take(self._file)


def parameters(folder):
    """Return a parameter file."""
    return Text(folder / 'params.yaml', PARAMETERS,
                lambda file: settings_of(parameters_of_file(file, '/robot/footprint_monitor')),
                ParameterError)


def expectation(folder, bag):
    """Return a stored result of a recording."""
    file, results = folder / 'stored.json', [check(bag)]
    write_json(results, str(file))
    stored = json.loads(file.read_text())
    stored['bags'][0]['footprints'][0]['separation'] = []
    return Text(file, json.dumps(stored).encode(),
                lambda file: differences_from(read_baseline(str(file)), results), BaselineError)


def targets(folder):
    """Return all files to damage."""
    made = []
    for name, storage, compression in (
            ('rows', 'sqlite3', None), ('packed rows', 'sqlite3', 'message'),
            ('chunks', 'mcap', None)):
        bag = write(folder / name, MESSAGES, storage, compression)
        for file in sorted(path.name for path in bag.iterdir()):
            copy = Path(shutil.copytree(bag, folder / f'{name} {file}'))
            # Damage of metadata.yaml does not change the messages.
            made.append(Bag(copy, file, exact=file == 'metadata.yaml'))
    for name, options in (('plain', {}), ('zstd', {'compression': 'zstd'}),
                          ('lz4', {'compression': 'lz4'}),
                          ('unindexed', {'use_statistics': False, 'repeat_channels': False})):
        bag = folder / name
        bag.mkdir()
        write_mcap(bag / 'a.mcap', MESSAGES, **options)
        metadata = (folder / 'chunks' / 'metadata.yaml').read_text()
        (bag / 'metadata.yaml').write_text(metadata.replace('chunks.mcap', 'a.mcap'))
        made.append(Bag(bag, 'a.mcap', True))
    return [*made, parameters(folder), expectation(folder, folder / 'rows')]


def files(folder):
    """Return a fuzzer that damages these files by turns."""
    made = targets(folder)

    def fuzz_file(rng, number):
        """Damage one of the files."""
        target = made[number % len(made)]
        try:
            target.try_one(rng)
        except Exception as error:
            raise AssertionError(target.name) from error
    return fuzz_file


FUZZERS = {'bytes': fuzz_bytes, 'polygons': fuzz_polygon, 'parameters': fuzz_parameters}


def fuzz(fuzzer, numbers, seed):
    """Run a fuzzer on inputs, each of which its number and the seed determine."""
    for number in numbers:
        try:
            fuzzer(random.Random(f'{seed} {number}'), number)
        except BaseException:
            print(f'{fuzzer.__name__}: input {number} of seed {seed}', file=sys.stderr)
            raise


@pytest.mark.parametrize('name', FUZZERS)
def test_fuzz(name):
    fuzz(FUZZERS[name], range(2000), seed=7)


@pytest.mark.parametrize('numbers, seed', [
    pytest.param(range(200), 7, id='200'),
    pytest.param(range(1000), 7, id='1000', marks=pytest.mark.long),
    pytest.param([525], 904164853, id='zeroed checksum of a chunk')])
def test_damaged_files(tmp_path, numbers, seed):
    fuzz(files(tmp_path), numbers, seed)


def take(data):
    """Receive bytes as the kind of message that their first one selects."""
    kind, data = data[:1], bytes(data[1:])
    if kind in (b'f', b'o'):
        check_message(data, 'footprint' if kind == b'f' else 'obstacle', PLACING)
        return
    try:
        decode_odometry(data) if kind == b'p' else decode_transforms(data)
    except MessageError as error:
        assert str(error).isprintable()
    for one in PLACING.receive_transforms(TF if kind == b't' else TF_STATIC, data, 10**18):
        assert one.text.isprintable()


def guide(folder, runs):
    """Let atheris choose bytes, from valid messages on."""
    import atheris
    good = {'f': serialised(box(0.0)), 'o': serialised(box(3.0), order='>'),
            't': transforms(('map', 'odom', 1, 2.0, 3.0)),
            's': transforms(('odom', 'base', 1, 2.0, 3.0)),
            'p': odometry('map', 'base', 1, 2.0, 3.0)}
    for kind, data in good.items():
        (folder / kind).write_bytes(kind.encode() + data)
    atheris.instrument_all()
    atheris.Setup([sys.argv[0], f'-runs={runs}', str(folder)], take)
    atheris.Fuzz()


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--inputs', type=float, default=1e7, help='other than files')
    parser.add_argument('--files', type=float, default=1e5)
    parser.add_argument('--guided', type=float, help='only so many inputs that atheris chooses')
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.guided:
            guide(Path(folder), round(arguments.guided))
        fuzzers = [(one, arguments.inputs / len(FUZZERS)) for one in FUZZERS.values()]
        for fuzzer, count in (*fuzzers, (files(Path(folder)), arguments.files)):
            begun = time.monotonic()
            fuzz(fuzzer, range(round(count)), arguments.seed)
            print(f'{fuzzer.__name__}: {count:,.0f} inputs, {time.monotonic() - begun:.0f} s',
                  flush=True)


if __name__ == '__main__':
    main()

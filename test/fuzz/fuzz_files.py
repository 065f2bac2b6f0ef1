# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Randomly damaged recordings and parameter files: python test/fuzz/fuzz_files.py --help.

No damage raises an unexpected error, and a recording without reported problems has every message.
If the format has checksums the messages are identical, unless the damage sets a checksum to 0,
which in MCAP means that there is none.
"""

import argparse
import contextlib
from io import BytesIO
import json
from pathlib import Path
import random
import shutil
import sys
import tempfile
import time

from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader
from recordings import box, write
from sat_collision.replay.bag.recording import Recording
from sat_collision.replay.bag.storage import Limits
from sat_collision.replay.check import check
from sat_collision.replay.model.configuration import parameters_of_file, settings_of
from sat_collision.replay.output.formats import (
    BaselineError, differences_from, read_baseline, write_json)
from sat_collision.scene.parameters import ParameterError
from storages import write_mcap

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


def fuzz(numbers, seed, report=lambda text: None):
    """Try the damaged files of some numbers; a failure names its target, seed and number."""
    with tempfile.TemporaryDirectory() as folder:
        made = targets(Path(folder))
        begun = time.monotonic()
        for number in numbers:
            target = made[number % len(made)]
            try:
                target.try_one(random.Random(f'{seed} {number}'))
            except Exception as error:
                raise AssertionError(f'{target.name}, seed {seed}, number {number}') from error
            if number % 10000 == 9999:
                report(f'{number + 1} files, {time.monotonic() - begun:.0f} s')


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=lambda text: int(float(text)), default=100_000)
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args()
    fuzz(range(options.count), options.seed, print)
    print(f'{options.count} damaged files: no unexpected error, no missed message')


if __name__ == '__main__':
    sys.exit(main())

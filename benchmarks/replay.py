# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How fast recordings are checked beside reading them, and what is found in damaged ones.

The recording of the first has a robot that drives among obstacles, a set of polygons ten times a
second; figures are processor time. That of the second has a robot that an obstacle touches again
and again; it is damaged at random, and the same check counts the contacts in what each library
reads until its first error.
"""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
import random
import tempfile
import time

import _shared  # noqa: F401
from builders import collection, serialised
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer as McapWriter
import numpy as np
from recordings import COLLECTION, TYPES
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from sat_collision.messages.rosbags_interfaces import STORE
from sat_collision.replay.check import check
from sat_collision.replay.model.result import Options
import shapes

SIZES = 10, 100
STORAGES = 'MCAP', 'SQLITE3'
_START = 1_700_000_000 * 10**9
_SECOND = 10**9
_KIND = 'geometry_msgs/msg/PolygonStamped'
_TOPICS = '/footprint', '/obstacles'
_PARAMETERS = {'obstacle.set_end': 'new_stamp'}
_ROBOT = np.array([(-0.5, -0.4), (0.9, -0.4), (0.9, 0.4), (-0.5, 0.4)])
# Bytes of a chunk of the recordings that are damaged, which have many as long recordings do.
_CHUNK = 20_000
# An obstacle touches the robot in the first half of each.
_PERIOD = 2 * _SECOND


def measure(messages, runs):
    """Return the µs a message of reading with rosbags and mcap, of decoding, and of checking."""
    return [_measure(storage, size, messages, runs) for storage in STORAGES for size in SIZES]


def _measure(storage, size, messages, runs):
    tasks = {'reading_us': _read_all, 'decoding_us': partial(_read_all, decode=True),
             'live_us': partial(check, options=Options(_PARAMETERS, as_live=True)),
             'motion_us': partial(check, options=Options(_PARAMETERS))}
    if storage == 'MCAP':
        tasks['mcap_us'] = _read_with_mcap
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'drive')
        count = _write_drive(path, storage, size, messages)
        return {'storage': storage, 'obstacles': size, **_timed(tasks, path, count, runs)}


def _timed(tasks, path, count, runs):
    """Return the least processor time of each task on a recording, in µs of each of `count`."""
    least = dict.fromkeys(tasks, float('inf'))
    for _ in range(runs):
        for name, task in tasks.items():
            begun = time.process_time()
            task(path)
            least[name] = min(least[name], time.process_time() - begun)
    return {name: 1e6 * seconds / count for name, seconds in least.items()}


def _write_drive(path, storage, size, messages):
    """Write a robot among boxes and other convex polygons, and return the number of messages."""
    outlines = _outlines(size, 40, 8)
    frames = messages // (size + 1)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        footprint, obstacles = (writer.add_connection(topic, _KIND, typestore=STORE)
                                for topic in _TOPICS)
        for frame in range(frames):
            stamp = _START + frame * _SECOND // 10
            drift = np.array([np.sin(frame / 300), np.cos(frame / 300)])
            writer.write(footprint, stamp, serialised(_ROBOT + 2 * drift, stamp))
            for k, outline in enumerate(outlines):
                writer.write(obstacles, stamp + k + 1, serialised(outline + 0.1 * drift, stamp))
    return frames * (size + 1)


def _outlines(count, farthest, kinds):
    """Return convex polygons around the robot, of four and, up to so many kinds, more vertices."""
    rng = np.random.default_rng(0)
    return [rng.uniform(3, farthest) * np.array([np.cos(k), np.sin(k)]) + rng.uniform(0.3, 2.0)
            * shapes.regular(rng, 1, 4 + k % kinds)[0] for k in range(count)]


def measure_collections(messages, runs):
    """Return the µs of reading and checking a footprint and 1,000 obstacles in one message."""
    outlines = _outlines(1000, 400, 1)
    tasks = {'mcap_us': _read_with_mcap, 'motion_us': check,
             'live_us': partial(check, options=Options(as_live=True))}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'collections.mcap')
        _write_mcap(path, _with_collections(outlines, messages), 2**20, COLLECTION)
        return {'obstacles': len(outlines), **_timed(tasks, path, messages, runs)}


def _with_collections(outlines, messages):
    """Yield (topic, stamp, bytes) of a robot among polygons that drift, ten times a second."""
    for tick in range(messages):
        stamp = _START + tick * _SECOND // 10
        drift = np.array([np.sin(tick / 300), np.cos(tick / 300)])
        yield _TOPICS[0], stamp, serialised(_ROBOT + 2 * drift, stamp)
        yield _TOPICS[1], stamp + 1, collection([one + 0.1 * drift for one in outlines], stamp)


def _read_all(path, decode=False):
    with Reader(path) as reader:
        for _, _, data in reader.messages():
            if decode:
                STORE.deserialize_cdr(data, _KIND)


def _read_with_mcap(path):
    for _ in _mcap(path / f'{path.name}.mcap' if path.is_dir() else path):
        pass


def measure_damaged(recordings):
    """Return the share of contacts found in damaged recordings, by what reads them."""
    rng = random.Random(1)
    found = {'sat_collision': 0, 'rosbags': 0, 'mcap': 0}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'damaged.mcap')
        _write_mcap(path, _touched_again_and_again())
        whole, contacts = path.read_bytes(), _contacts_in(path)
        for _ in range(recordings):
            path.write_bytes(_damaged(whole, rng))
            found['sat_collision'] += len(contacts & _contacts_in(path))
            for name, reading in (('rosbags', _rosbags), ('mcap', _mcap)):
                messages = []
                with suppress(Exception):  # whatever ends reading, what came before counts
                    messages.extend(reading(path))
                again = path.with_name('read.mcap')
                _write_mcap(again, messages)
                found[name] += len(contacts & _contacts_in(again))
    return {'recordings': recordings, 'contacts': len(contacts),
            **{name: count / recordings / len(contacts) for name, count in found.items()}}


def _touched_again_and_again():
    """Yield (topic, stamp, bytes) of a minute in which an obstacle touches every two seconds."""
    for tick in range(600):
        stamp = _START + tick * _SECOND // 10
        yield _TOPICS[0], stamp, serialised(_ROBOT, stamp)
        is_touching = (stamp - _START) % _PERIOD < _PERIOD // 2
        for k in range(20):
            x = 0.8 if is_touching and k == 0 else 3.0 + k
            yield _TOPICS[1], stamp, serialised(_ROBOT + (x, 0.0), stamp)


def _contacts_in(path):
    """Return the numbers of the periods with a contact."""
    result = check(path, Options(_PARAMETERS, footprints=_TOPICS[:1], obstacles=_TOPICS[1:],
                                 as_live=True))
    return {(moment - _START) // _PERIOD for contact in result.contacts
            for moment in range(contact.first, contact.last + 1, _SECOND // 10)}


def _write_mcap(path, messages, chunk=_CHUNK, obstacles=_KIND):
    with path.open('wb') as file:
        writer = McapWriter(file, chunk, CompressionType.NONE)
        writer.start('ros2')
        channels = {topic: writer.register_channel(topic, 'cdr', writer.register_schema(
            kind, 'ros2msg', TYPES.generate_msgdef(kind)[0].encode()))
            for topic, kind in zip(_TOPICS, (_KIND, obstacles))}
        for topic, stamp, data in messages:
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()


def _rosbags(path) -> Iterator:
    with Reader(path) as reader:
        for connection, stamp, data in reader.messages():
            yield connection.topic, stamp, data


def _mcap(path) -> Iterator:
    with path.open('rb') as file:
        for _, channel, message in make_reader(file).iter_messages():
            yield channel.topic, message.log_time, message.data


def _damaged(data, rng):
    """Return bytes with one to four places lost, overwritten or cut off."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        place, size = rng.randrange(len(data)), rng.choice((1, 8, 64, 512))
        match rng.randrange(8):
            case 0:
                del data[place:]
            case 1 | 2:
                del data[place:place + size]
            case _:
                data[place:place + size] = rng.randbytes(size)
    return bytes(data)

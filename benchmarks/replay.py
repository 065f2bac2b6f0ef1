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
second. That of the second has a robot that an obstacle touches again and again; it is damaged at
random, and the same check counts the contacts in what each library reads until its first error.
"""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
import itertools
from pathlib import Path
import random
import tempfile
import time

import _shared  # noqa: F401
from builders import collection, SECOND, serialised
from mcap.reader import make_reader
import numpy as np
from recordings import COLLECTION, nanoseconds, POLYGON, START, write
from rosbags.rosbag2 import Reader
from sat_collision.messages.rosbags_interfaces import STORE
from sat_collision.replay.check import check
from sat_collision.replay.model.result import Options
import shapes
from storages import storage_file, write_mcap

SIZES = 10, 100
STORAGES = 'mcap', 'sqlite3'
_PARAMETERS = {'obstacle.set_end': 'new_stamp'}
_ROBOT = np.array([(-0.5, -0.4), (0.9, -0.4), (0.9, 0.4), (-0.5, 0.4)])
# Bytes of a chunk of the recordings that are damaged, which have many as long recordings do.
_CHUNK = 20_000
# In s; an obstacle touches the robot in the first half of each.
_PERIOD = 2


def measure(messages=200_000):
    """Return the µs a message of reading with rosbags and mcap, of decoding, and of checking."""
    tasks = {'reading_us': _read_all, 'decoding_us': partial(_read_all, decode=True),
             'live_us': partial(check, options=Options(_PARAMETERS, as_live=True)),
             'motion_us': partial(check, options=Options(_PARAMETERS))}
    rows = []
    for storage, size in itertools.product(STORAGES, SIZES):
        drive = [*_drive(_outlines(size, 40, 8), messages // (size + 1))]
        its = {**tasks, 'mcap_us': _read_with_mcap} if storage == 'mcap' else tasks
        rows.append({'storage': storage.upper(), 'obstacles': size,
                     **_timed(its, len(drive), 3, partial(
                         write, messages=drive, storage=storage))})
    return rows


def measure_collections(frames=3000):
    """Return the µs of reading and checking a footprint and 1,000 obstacles in one message."""
    outlines = _outlines(1000, 400, 1)
    tasks = {'mcap_us': _read_with_mcap, 'motion_us': check,
             'live_us': partial(check, options=Options(as_live=True))}
    return {'obstacles': len(outlines), **_timed(tasks, frames, 9, partial(
        write_mcap, messages=_drive(outlines, frames, in_one_message=True), chunk_size=2**20,
        types={'/obstacles': COLLECTION}))}


def _timed(tasks, count, runs, write_to):
    """Return the least time of each task on a recording, in µs of each of `count`."""
    least = dict.fromkeys(tasks, float('inf'))
    with tempfile.TemporaryDirectory() as folder:
        path = write_to(Path(folder, 'drive.mcap'))
        for _ in range(runs):
            for name, task in tasks.items():
                begun = time.perf_counter()
                task(path)
                least[name] = min(least[name], time.perf_counter() - begun)
    return {name: 1e6 * seconds / count for name, seconds in least.items()}


def _drive(outlines, frames, in_one_message=False):
    """Yield messages of a robot among obstacles, all of which drift, ten frames a second."""
    for frame in range(frames):
        time = frame / 10
        stamp = nanoseconds(time)
        drift = np.array([np.sin(frame / 300), np.cos(frame / 300)])
        yield '/footprint', time, _ROBOT + 2 * drift
        moved = [outline + 0.1 * drift for outline in outlines]
        for k, data in enumerate([collection(moved, stamp)] if in_one_message else [
                serialised(outline, stamp) for outline in moved], 1):
            yield '/obstacles', time + k * 1e-9, data


def _outlines(count, farthest, kinds):
    """Return convex polygons around the robot, of four and, up to so many kinds, more vertices."""
    rng = np.random.default_rng(0)
    return [rng.uniform(3, farthest) * np.array([np.cos(k), np.sin(k)]) + rng.uniform(0.3, 2.0)
            * shapes.regular(rng, 1, 4 + k % kinds)[0] for k in range(count)]


def _read_all(path, decode=False):
    with Reader(path) as reader:
        for _, _, data in reader.messages():
            if decode:
                STORE.deserialize_cdr(data, POLYGON)


def _read_with_mcap(path):
    for _ in _mcap(storage_file(path) if path.is_dir() else path):
        pass


def measure_damaged(recordings=100):
    """Return the share of contacts found in damaged recordings, by what reads them."""
    rng = random.Random(1)
    found = {'sat_collision': 0, 'rosbags': 0, 'mcap': 0}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'damaged.mcap')
        write_mcap(path, _touched_again_and_again(), _CHUNK)
        whole, contacts = path.read_bytes(), _contacts_in(path)
        for _ in range(recordings):
            path.write_bytes(_damaged(whole, rng))
            found['sat_collision'] += len(contacts & _contacts_in(path))
            for name, reading in (('rosbags', _rosbags), ('mcap', _mcap)):
                messages = []
                with suppress(Exception):  # whatever ends reading, what came before counts
                    messages.extend(reading(path))
                again = path.with_name('read.mcap')
                write_mcap(again, messages, _CHUNK)
                found[name] += len(contacts & _contacts_in(again))
    return {'recordings': recordings, 'contacts': len(contacts),
            **{name: count / recordings / len(contacts) for name, count in found.items()}}


def _touched_again_and_again():
    """Yield messages of a minute in which an obstacle touches every two seconds."""
    for tick in range(600):
        time = tick / 10
        yield '/footprint', time, _ROBOT
        for k in range(20):
            x = 0.8 if time % _PERIOD < _PERIOD / 2 and k == 0 else 3.0 + k
            yield '/obstacles', time, _ROBOT + (x, 0.0)


def _contacts_in(path):
    """Return the numbers of the periods with a contact."""
    result = check(path, Options(_PARAMETERS, footprints=('/footprint',),
                                 obstacles=('/obstacles',), as_live=True))
    return {(moment - START) // (_PERIOD * SECOND) for contact in result.contacts
            for moment in range(contact.first, contact.last + 1, SECOND // 10)}


def _rosbags(path) -> Iterator:
    with Reader(path) as reader:
        for connection, stamp, data in reader.messages():
            yield connection.topic, (stamp - START) / SECOND, data


def _mcap(path) -> Iterator:
    with path.open('rb') as file:
        for _, channel, message in make_reader(file).iter_messages():
            yield channel.topic, (message.log_time - START) / SECOND, message.data


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

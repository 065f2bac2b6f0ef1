# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
How fast recordings are checked, as live and by recorded motion, beside reading with rosbags.

The recording has a robot that drives among obstacles: a set of polygons ten times a second. All
figures are processor time of one process, the least of some runs, in turn.
"""

import argparse
from pathlib import Path
import tempfile
import time

import _shared  # noqa: F401
from builders import serialised
import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from sat_collision.geometry.compiled.jit import KERNEL
from sat_collision.messages.rosbags_interfaces import STORE
from sat_collision.replay.check import check
from sat_collision.replay.model.result import Options
import shapes

_START = 1_700_000_000 * 10**9
_KIND = 'geometry_msgs/msg/PolygonStamped'
_TOPICS = '/footprint', '/obstacles'
_PARAMETERS = {'obstacle.set_end': 'new_stamp'}


def write(path, messages, per_set, storage):
    """Write a recording: boxes and other convex polygons, one set in 0.1 s."""
    rng = np.random.default_rng(0)
    outlines = [rng.uniform(3, 40) * np.array([np.cos(k), np.sin(k)]) + rng.uniform(0.3, 2.0)
                * shapes.regular(rng, 1, 4 + k % 8)[0] for k in range(per_set)]
    robot = np.array([(-0.5, -0.4), (0.9, -0.4), (0.9, 0.4), (-0.5, 0.4)])
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        footprint, obstacles = (writer.add_connection(topic, _KIND, typestore=STORE)
                                for topic in _TOPICS)
        for frame in range(messages // (per_set + 1)):
            stamp = _START + frame * 10**8
            drift = np.array([np.sin(frame / 300), np.cos(frame / 300)])
            writer.write(footprint, stamp, serialised(robot + 2 * drift, stamp))
            for k, outline in enumerate(outlines):
                writer.write(obstacles, stamp + k + 1, serialised(outline + 0.1 * drift, stamp))


def iterate(path):
    """Read every message, and nothing else."""
    with Reader(path) as reader:
        return sum(1 for _ in reader.messages(
            [connection for connection in reader.connections if connection.topic in _TOPICS]))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--messages', type=int, default=200_000)
    parser.add_argument('--per-set', type=int, default=20)
    parser.add_argument('--runs', type=int, default=3)
    options = parser.parse_args()
    print(f'{KERNEL}; {options.messages} messages, {options.per_set} obstacles a set')
    with tempfile.TemporaryDirectory() as folder:
        for storage in ('MCAP', 'SQLITE3'):
            path = Path(folder, storage)
            write(path, options.messages, options.per_set, storage)
            tasks = {'iterate': iterate,
                     **{name: lambda path, as_live=as_live: check(path, Options(
                         _PARAMETERS, as_live=as_live)).messages
                        for name, as_live in (('as live', True), ('motion', False))}}
            least = dict.fromkeys(tasks, float('inf'))
            for _ in range(options.runs):
                for name, task in tasks.items():
                    begun = time.process_time()
                    count = task(path)
                    least[name] = min(least[name], time.process_time() - begun)
            for name, value in least.items():
                print(f'{storage:8} {name:8} {1e6 * value / count:7.2f} us a message, '
                      f'{count / value:9.0f} messages/s, '
                      f'{value / least["iterate"]:6.2f} times iterating')


if __name__ == '__main__':
    main()

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
Where the node's time goes under load, by cProfile, to be compared with what it was before.

cProfile makes every call dearer, so the figures show shares, not what a message really costs.
"""

import argparse
import json
from pathlib import Path
import pstats
import tempfile
from unittest import mock

import node

STORED = Path(__file__).parents[1] / 'docs' / 'benchmarks' / 'profile.json'
OBSTACLES = 1000
_SHOWN = 12
_WAITING = 'wait', 'sleep'


def measure(seconds):
    """Return the functions in which most of the time goes, own time in us a message."""
    cost = node.load('monitor', OBSTACLES, 4, seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'profile')
        command = ['-m', 'cProfile', '-o', str(path), '-m', 'sat_collision.node']
        with mock.patch.dict(node.NODES, monitor=command):
            node.load('monitor', OBSTACLES, 4, seconds)
        functions = pstats.Stats(str(path)).stats
    messages = sum(value[0] for (file, _, name), value in functions.items()
                   if name == 'take' and file.endswith('teller.py'))
    own = [{'function': _title(*key), 'calls': value[1] / messages,
            'own_us': 1e6 * value[2] / messages}
           for key, value in functions.items()
           if not key[2].endswith(_WAITING) and value[1] > messages // 2]
    return {'cpu_us': cost['cpu_us'], 'obstacles': OBSTACLES,
            'profiled_us': sum(row['own_us'] for row in own),
            'functions': sorted(own, key=lambda row: -row['own_us'])[:_SHOWN]}


def _title(file, _, name):
    # Built-in functions come with their address.
    return name.partition(' of ')[0].strip('<') if file == '~' else f'{Path(file).name}: {name}'


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('name', help='what to store the profile as: before, after')
    parser.add_argument('--seconds', type=float, default=5.0)
    arguments = parser.parse_args()
    stored = json.loads(STORED.read_text()) if STORED.exists() else {}
    with node.ros():
        stored[arguments.name] = measure(arguments.seconds)
    STORED.write_text(json.dumps(stored, indent=1) + '\n')


if __name__ == '__main__':
    main()

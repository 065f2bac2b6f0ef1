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
Measure all and write docs/benchmarks: `make bench`.

With --written tables and plots are made again from the figures stored there.
"""

import argparse
import json
import os
from pathlib import Path
import sys
import tempfile
import time

# Compile the kernels as they are now: numba's cache does not see a change of what a kernel calls.
FRESH_CACHE = tempfile.TemporaryDirectory()
os.environ['NUMBA_CACHE_DIR'] = FRESH_CACHE.name
ROOT = Path(__file__).parents[1]
sys.path += [str(ROOT / 'benchmarks' / 'report'), str(ROOT / 'docs')]

from bench_tables import TABLES  # noqa: E402, I100
import frames  # noqa: E402
import kernel  # noqa: E402
import machine  # noqa: E402
import node  # noqa: E402
import scene  # noqa: E402
from words import with_tables  # noqa: E402

DIRECTORY = ROOT / 'docs' / 'benchmarks'
PACKAGES = 'numpy', 'numba', 'shapely', 'rclpy'
PARTS = 'kernel', 'scene', 'node', 'frames', 'startup'


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--quick', action='store_true', help='fewer pairs and repeats')
    parser.add_argument('--only', choices=PARTS, action='append',
                        help='measure these parts; others stay as stored')
    parser.add_argument('--written', action='store_true',
                        help='only write tables and plots from the figures stored before')
    arguments = parser.parse_args()
    stored = DIRECTORY / 'figures.json'
    figures = json.loads(stored.read_text())
    if not arguments.written:
        figures |= measure(arguments.seed, arguments.quick, arguments.only or PARTS)
        stored.write_text(json.dumps(figures, indent=1) + '\n')
    for part in (kernel, scene, node):
        part.plot(figures[part.__name__], DIRECTORY / f'{part.__name__}.png')
    page = DIRECTORY / 'README.md'
    page.write_text(with_tables(page.read_text(), TABLES, figures))


def measure(seed, quick, parts):
    """Return the figures of some parts."""
    start = time.perf_counter()
    seconds, repeats = (1.0, 1) if quick else (3.0, 3)
    measures = {
        'kernel': lambda: kernel.measure(*((2_000, 3) if quick else (20_000, 7)), seed),
        'scene': lambda: scene.measure(seed, 5 if quick else 25),
        'node': lambda: node.measure(seconds, repeats),
        'frames': lambda: frames.measure(seconds, repeats),
        'startup': lambda: node.measure_startup(repeats)}
    figures = {'seed': seed, 'machine': machine.describe(*PACKAGES)}
    with node.ros():
        for name in parts:
            print(f'{time.perf_counter() - start:6.0f} s  {name}', file=sys.stderr)
            figures[name] = measures[name]()
    print(f'{time.perf_counter() - start:6.0f} s', file=sys.stderr)
    return figures


if __name__ == '__main__':
    main()

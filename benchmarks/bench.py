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

import frames  # noqa: E402, I100
import kernel  # noqa: E402
import machine  # noqa: E402
import node  # noqa: E402
import scene  # noqa: E402
from words import table, with_tables  # noqa: E402

DIRECTORY = ROOT / 'docs' / 'benchmarks'
PACKAGES = 'numpy', 'numba', 'shapely', 'rclpy'
PARTS = 'kernel', 'scene', 'node', 'frames', 'startup'
_KERNELS = {'monitor': 'numba', 'plain': 'plain Python'}


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


def _machine(figures):
    return table(figures['machine'], [figures['machine'].values()])


def _costs(figures):
    return table(
        ['obstacles', 'vertices', *node.TITLES.values(), 'times the empty node',
         'shapely, times ours'],
        [[f'{one["obstacles"]:,}', one['vertices'],
          *(f'{one[kind]["cpu_us"]:.0f}' for kind in node.TITLES),
          f'{one["together"]["times_floor"]:.1f}',
          f'{one["rival"]["cpu_us"] / one["monitor"]["cpu_us"]:.1f}']
         for one in figures['node']['loads']])


def _latencies(figures):
    loads = figures['node']['loads'] + [{**one, 'vertices': '4, all at once'}
                                        for one in figures['node']['bursts']]
    return table(['obstacles', 'vertices', *node.TITLES.values()], [
        [f'{one["obstacles"]:,}', one['vertices'],
         *(_latency(one[kind]) if kind in one else '–' for kind in node.TITLES)]
        for one in loads])


def _latency(run):
    times = ' / '.join(f'{run[name]:.1f}' for name in ('p50_ms', 'p99_ms', 'max_ms'))
    lost = run['lost'] + run['unanswered']
    return f'{times}, {lost:,} lost' if lost else times


def _rates(figures):
    return table(['kernel', 'sent a second', 'lost', 'share of the core'], [
        [_KERNELS[rate['kind']], f'{rate["sent_per_second"]:,.0f}', f'{rate["lost"]:,}',
         f'{rate["core"]:.0%}'] for rate in figures['node']['rates']])


def _scene(figures):
    return table(['obstacles', 'sat_collision', 'STRtree, built before', 'STRtree, built anew'], [
        [f'{row["obstacles"]:,}', f'{row["us"]:.1f}', f'{row["tree_us"]:.1f}',
         f'{row["tree_build_us"]:,.0f}'] for row in figures['scene']['one']])


def _messages(figures):
    return table(['obstacles', 'obstacle message, alone', 'one of 64', 'footprint message'], [
        [f'{row["obstacles"]:,}', f'{row["obstacle_us"]:.1f}', f'{row["together_us"]:.1f}',
         f'{row["footprint_us"]:.1f}']
        for row in figures['scene']['message']])


def _memory(figures):
    return table(['vertices', 'bytes an obstacle'], [
        [row['vertices'], f'{row["scene"]:,.0f}'] for row in figures['scene']['memory']])


def _kernel(figures):
    return table(
        ['pairs', 'vertices', 'sat_collision', 'shapely', 'shapely, times ours', 'make a polygon',
         'different answers'],
        [[row['load'].replace('_', ' '), f'{row["vertices"]:,}', f'{row["ours"]:,.0f}',
          f'{row["shapely"]:,.0f}', f'{row["shapely"] / row["ours"]:.1f}',
          f'{1e3 * row["setup"]:,.0f}', row['wrong']] for row in figures['kernel']])


def _transforms(figures):
    loads = {**{f'{row["transforms"]} in a message': row for row in figures['frames']['sizes']},
             '1 in a message, and an outline in its frame': figures['frames']['outline'],
             '1 in each of 20 messages': figures['frames']['robots']}
    return table(['transforms at 100 Hz', 'sat_collision', 'empty', 'ratio', 'share of a core'], [
        [name, f'{row["monitor_us"]:.0f}', f'{row["floor_us"]:.0f}', f'{row["ratio"]:.2f}',
         f'{row["core"]:.1%}'] for name, row in loads.items()])


def _frames(figures):
    other, latency = figures['frames']['other_frame'], figures['frames']['latency']
    return table(['message in the fixed frame', 'in another frame', 'transform to flag'], [
        [f'{other["fixed_us"]:.1f} µs', f'{other["fixed_us"] + other["more_us"]:.1f} µs',
         f'{latency["p50_ms"]:.1f} ms, 99 of 100 below {latency["p99_ms"]:.1f} ms']])


def _startup(figures):
    return table(['first start', 'later starts', 'empty rclpy node'], [
        [f'{figures["startup"][name]:.1f} s' for name in ('cold_s', 'warm_s', 'floor_s')]])


TABLES = {'machine': _machine, 'costs': _costs, 'latencies': _latencies, 'rates': _rates,
          'scene': _scene, 'messages': _messages, 'memory': _memory, 'kernel': _kernel,
          'transforms': _transforms, 'frames': _frames, 'start-up': _startup}


if __name__ == '__main__':
    main()

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

"""The tables of docs/benchmarks; the sentences around them are written by hand."""

from node import TITLES
from words import table

_KERNELS = {'monitor': 'numba', 'plain': 'plain Python'}


def _machine(figures):
    return table(figures['machine'], [figures['machine'].values()])


def _costs(figures):
    return table(
        ['obstacles', 'vertices', *TITLES.values(), 'times the empty node', 'shapely, times ours'],
        [[f'{one["obstacles"]:,}', one['vertices'],
          *(f'{one[kind]["cpu_us"]:.0f}' for kind in TITLES),
          f'{one["together"]["times_floor"]:.1f}',
          f'{one["rival"]["cpu_us"] / one["monitor"]["cpu_us"]:.1f}']
         for one in figures['node']['loads']])


def _latencies(figures):
    node = figures['node']
    bursts = [{**one, 'vertices': '4, all at once'} for one in node['bursts']]
    return table(['obstacles', 'vertices', *TITLES.values()], [
        [f'{one["obstacles"]:,}', one['vertices'],
         *(_latency(one[kind]) if kind in one else '–' for kind in TITLES)]
        for one in node['loads'] + bursts])


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
    return table(['obstacles', 'obstacle message', 'footprint message'], [
        [f'{row["obstacles"]:,}', f'{row["obstacle_us"]:.1f}', f'{row["footprint_us"]:.1f}']
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

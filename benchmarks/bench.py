# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Measure all and write docs/benchmarks: `make bench`.

With --only but no parts tables and plots are made from the figures stored there.
"""

import argparse
import json
import sys
import time

from _shared import describe, duration, ROOT, table, table_of
import node
from page_parts import with_tables
import replay
import scene

PACKAGES = 'numpy', 'numba', 'shapely', 'rclpy'
PLOTS = {'kernel': scene.plot, 'node': node.plot}
_US = {name: f'{name}_us' for name in ('reading', 'decoding', 'live', 'motion')}
_KERNELS = {'monitor': 'numba', 'plain': 'plain Python'}
MEASURES = {
    'kernel': scene.measure_pairs, 'scene': scene.measure, 'maps': scene.measure_maps,
    'plans': scene.measure_plans, 'node': node.measure, 'cpp': node.measure_cpp,
    'whole_sets': node.measure_whole_sets, 'frames': node.measure_frames,
    'other_frame': scene.measure_other_frame, 'startup': node.measure_startup,
    'replay': replay.measure, 'collections': replay.measure_collections,
    'damaged': replay.measure_damaged}


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--only', choices=MEASURES, nargs='*',
                        help='measure these parts, or none; others stay as stored')
    parts = parser.parse_args().only
    page = ROOT / 'docs' / 'benchmarks' / 'README.md'
    stored = page.with_name('figures.json')
    figures = json.loads(stored.read_text())
    if parts is None:
        # Parts measured later leave the line of the machine as it is.
        figures['machine'] = describe(*PACKAGES)
    start = time.perf_counter()
    with node.ros():
        for name in MEASURES if parts is None else parts:
            print(f'{time.perf_counter() - start:6.0f} s  {name}', file=sys.stderr)
            # None of what this machine cannot measure, which stays as stored.
            if (found := MEASURES[name]()) is not None:
                figures[name] = found
    print(f'{time.perf_counter() - start:6.0f} s', file=sys.stderr)
    stored.write_text(json.dumps(figures, indent=1) + '\n')
    for part, plot in PLOTS.items():
        plot(figures[part], page.with_name(f'{part}.png'))
    page.write_text(with_tables(page.read_text(), TABLES, figures))


def _latencies(figures):
    def cell(run):
        lost = run['lost'] + run['unanswered']
        return '{p50_ms:.1f} / {p99_ms:.1f} / {max_ms:.1f}'.format(**run) + (
            f', {lost:,} lost' if lost else '')
    loads = figures['node']['loads'] + [{**one, 'vertices': '4, all at once'}
                                        for one in figures['node']['bursts']]
    return table_of(loads, {
        'obstacles': '{obstacles:,}', 'vertices': '{vertices}',
        **{title: lambda one, kind=kind: cell(one[kind]) if kind in one else '–'
           for kind, title in node.TITLES.items()}})


def _transforms(figures):
    found = figures['frames']
    names = [*(f'{row["transforms"]} in a message' for row in found['sizes']),
             '1 in a message, and an outline in its frame', '1 in each of 20 messages']
    rows = [*found['sizes'], found['outline'], found['robots']]
    return table_of([{'name': name, **row} for name, row in zip(names, rows)], {
        'transforms at 100 Hz': '{name}', 'sat_collision': '{monitor_us:.0f}',
        'empty': '{floor_us:.0f}', 'ratio': '{ratio:.2f}', 'share of a core': '{core:.1%}'})


TABLES = {
    'machine': lambda figures: table(figures['machine'], [figures['machine'].values()]),
    'latencies': _latencies, 'transforms': _transforms,
    'costs': lambda figures: table_of(figures['node']['loads'], {
        'obstacles': '{obstacles:,}', 'vertices': '{vertices}',
        **{title: f'{{{kind}[cpu_us]:.0f}}' for kind, title in node.TITLES.items()},
        'times the empty node': '{together[times_floor]:.1f}',
        'shapely, times ours': lambda one: '{:.1f}'.format(
            one['rival']['cpu_us'] / one['monitor']['cpu_us'])}),
    'cpp': lambda figures: table_of(figures['cpp'], {
        'obstacles': '{obstacles:,}', 'sat_collision': '{us:.0f}',
        'empty rclpy node': '{floor_us:.0f}', 'empty rclcpp node': '{cpp_us:.0f}',
        'sat_collision, times the rclcpp node': '{ratio:.1f}'}),
    'kernel': lambda figures: table_of(figures['kernel'], {
        'pairs': lambda row: row['load'].replace('_', ' '), 'vertices': '{vertices:,}',
        'sat_collision': '{ours:,.0f}', 'shapely': '{shapely:,.0f}',
        'shapely, times ours': lambda row: f'{row["shapely"] / row["ours"]:.1f}',
        'make a polygon': lambda row: f'{1e3 * row["setup"]:,.0f}',
        'different answers': '{wrong}'}),
    'frames': lambda figures: table_of([
        {**figures['other_frame'], **figures['frames']['latency']}], {
        'message in the fixed frame': '{fixed_us:.1f} µs',
        'in another frame': lambda one: f'{one["fixed_us"] + one["more_us"]:.1f} µs',
        'transform to flag': '{p50_ms:.1f} ms, 99 of 100 below {p99_ms:.1f} ms'}),
    'whole-sets': lambda figures: table_of(figures['whole_sets'], {
        'obstacles': '{obstacles:,}', 'sat_collision': '{us:,.0f}',
        'while nothing comes': '{idle_us:,.0f}',
        'empty rclpy node': '{floor_us:,.0f}',
        'a set, times the empty node': lambda one: (
            f'{(one["us"] - one["idle_us"]) / one["floor_us"]:.2f}'),
        'a set, for each obstacle': lambda one: (
            f'{(one["us"] - one["idle_us"]) / one["obstacles"]:.2f}'),
        'share of a core': '{core:.1%}',
        'publish() to flag': '{p50_ms:.1f} ms, 99 of 100 below {p99_ms:.1f} ms'}),
    'rates': lambda figures: table_of(figures['node']['rates'], {
        'kernel': lambda rate: _KERNELS[rate['kind']], 'sent a second': '{sent_per_second:,.0f}',
        'lost': '{lost:,}', 'share of the core': '{core:.0%}'}),
    'maps': lambda figures: table_of(figures['maps'], {
        'obstacles': '{obstacles:,}', 'with an index': '{indexed_us:.1f}',
        'STRtree': '{tree_us:.1f}', 'without an index': '{scan_us:.1f}',
        'nearest, with an index': '{nearest_us:.1f}',
        'build the index': lambda one: duration(1e3 * one['build_us']),
        'build the STRtree': lambda one: duration(1e3 * one['tree_build_us'])}),
    'plans': lambda figures: table_of(figures['plans'], {
        'obstacles': '{obstacles:,}', 'sat_collision': '{us:,.0f} µs',
        **{title: lambda one, kind=kind: '{:,.1f} times ours'.format(one[kind] / one['us'])
           for kind, title in (('one_by_one_us', 'STRtree, polygon by polygon'),
                               ('at_once_us', 'STRtree, all polygons at once'),
                               ('grid_us', 'outline on a grid'))}}),
    'threads': lambda figures: table_of(figures['scene']['threads'], {
        'of two sets of 1,000': '{query}', 'one thread': '{one_us:,.0f}',
        'two threads': '{two_us:,.0f}',
        'times as fast': lambda one: f'{one["one_us"] / one["two_us"]:.2f}'}),
    'messages': lambda figures: table_of(figures['scene']['message'], {
        'obstacles': '{obstacles:,}', 'obstacle message, alone': '{obstacle_us:.1f}',
        'one of 64': '{together_us:.1f}', 'footprint message': '{footprint_us:.1f}'}),
    'memory': lambda figures: table_of(figures['scene']['memory'], {
        'vertices': '{vertices}', 'bytes an obstacle': '{scene:,.0f}'}),
    'start-up': lambda figures: table_of([figures['startup']], {
        'first start': '{cold_s:.1f} s', 'later starts': '{warm_s:.1f} s',
        'empty rclpy node': '{floor_s:.1f} s'}),
    'replay': lambda figures: table_of(figures['replay'], {
        'storage': '{storage}', 'obstacles': '{obstacles}', 'read by rosbags': '{reading_us:.1f}',
        'and decoded': '{decoding_us:.1f}',
        'read by mcap': lambda one: f'{one["mcap_us"]:.1f}' if 'mcap_us' in one else '–',
        'checked as live': '{live_us:.1f}', 'and between messages': '{motion_us:.1f}',
        **{f'{of} ÷ {to}': lambda one, of=of, to=to: f'{one[_US[of]] / one[_US[to]]:.2f}'
           for of in ('reading', 'decoding') for to in ('live', 'motion')}}),
    'collections': lambda figures: table_of([figures['collections']], {
        'read by mcap': '{mcap_us:.0f}', 'checked as live': '{live_us:.0f}',
        'and between messages': '{motion_us:.0f}',
        'obstacles a second, live': lambda one: (
            f'{one["obstacles"] / one["live_us"]:.1f} million')}),
    'damaged': lambda figures: table_of([figures['damaged']], {
        name: f'{{{name}:.0%}}' for name in ('sat_collision', 'rosbags', 'mcap')})}


if __name__ == '__main__':
    main()

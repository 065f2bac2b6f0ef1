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
The collision decision alone: nanoseconds a pair, beside shapely in the same process.

Distinct random pairs in random order, a third far, a third within 0.1 of touching, a third
overlapping, are streamed through one call of each side. Touching pairs are the worst load that
an adversary could send: no sign can be told from plain doubles.
"""

from pathlib import Path
import statistics
import sys
import time

import matplotlib
import numpy as np
from sat_collision import intersects_pairs, Polygon, PolygonSet
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))

import shapes  # noqa: E402

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100

VERTICES = (4, 8, 16, 32, 64, 256, 1024)


def random_pairs(rng, count, n):
    """
    Return unit-sized pairs: a third 1 to 5 apart, a third 0.1 to -0.1, a third -0.2 to -0.8.

    That is the gap between their shadows on a random axis, so they are at least so far apart, and
    overlap by no more.
    """
    a, b = (shapes.polygons(rng, count, n) for _ in range(2))
    axes = shapes.directions(rng, count)
    touching = (a @ axes[..., None]).max(axis=1) - (b @ axes[..., None]).min(axis=1)
    low, high = np.array([(1.0, 5.0), (-0.1, 0.1), (-0.8, -0.2)])[rng.permutation(count) % 3].T
    places = rng.uniform(-50, 50, (count, 1, 2))
    moves = (touching[:, 0] + rng.uniform(low, high))[:, None] * axes
    return list(zip(a + places, b + places + moves[:, None]))


def abutting_boxes(rng, count, _):
    """Return boxes of a grid with a neighbour each, edge on edge or corner on corner."""
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    steps = np.array([(1, 0), (0, 1), (1, 1), (-1, 0), (0, -1), (-1, 1)])
    corners = rng.integers(-1000, 1000, (count, 2))
    return [(square + corner, square + corner + step)
            for corner, step in zip(corners, steps[rng.integers(0, 6, count)])]


def shared_edges(rng, count, n):
    """Return regular polygons with their reflection in the middle of an edge, all exact."""
    angles = 2.0 * np.pi / n * (np.arange(n) + rng.uniform(0, 1, (count, 1)))
    rings = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=2) * 2.0**40) / 2.0**40
    edges = rng.integers(0, n - 1, count)
    return [(ring, ring[edge] + ring[edge + 1] - ring) for ring, edge in zip(rings, edges)]


LOADS = [(random_pairs, n) for n in VERTICES] + [(abutting_boxes, 4), (shared_edges, 1024)]


def measure(pairs=20_000, repeats=7, seed=1):
    """Return for each load median ns a pair, setup in us a polygon, and different answers."""
    rng = np.random.default_rng(seed)
    for load, n in LOADS:
        _measure_load(load, rng, 10, n, 1)  # whatever has to be compiled is compiled now
    return [_measure_load(load, rng, pairs, n, repeats) for load, n in LOADS]


def _measure_load(load, rng, count, n, repeats):
    a, b = zip(*load(rng, count, n))
    start = time.perf_counter()
    ours = [PolygonSet(map(Polygon, side)) for side in (a, b)]
    setup = time.perf_counter() - start
    theirs = [np.array([shapely.Polygon(ring) for ring in side]) for side in (a, b)]
    times = {'ours': [], 'shapely': []}
    for _ in range(repeats):
        for name, decide, sides in (('ours', intersects_pairs, ours),
                                    ('shapely', shapely.intersects, theirs)):
            start = time.perf_counter()
            answers = decide(*sides)
            times[name].append((time.perf_counter() - start) / count * 1e9)
            times[name + ' answers'] = answers
    return {
        'load': load.__name__, 'vertices': n,
        'ours': statistics.median(times['ours']),
        'shapely': statistics.median(times['shapely']),
        'setup': setup / (2 * count) * 1e6,
        'wrong': int((times['ours answers'] != times['shapely answers']).sum()),
    }


def plot(figures, path):
    """Draw time against vertices, log-log, with the ratio between."""
    figure, axes = pyplot.subplots(figsize=(8.0, 4.6), layout='constrained')
    rows = [row for row in figures if row['load'] == 'random_pairs']
    n = [row['vertices'] for row in rows]
    axes.loglog(n, [row['shapely'] for row in rows], 's--', color='#d55e00',
                label='shapely, vectorised')
    axes.loglog(n, [row['ours'] for row in rows], 'o-', color='#0072b2', linewidth=2.5,
                markersize=8, label='sat_collision')
    for row in rows:
        axes.plot(2 * [row['vertices']], [1.2 * row['ours'], row['shapely'] / 1.2], ':',
                  color='#999999')
        axes.annotate(f'{row["shapely"] / row["ours"]:.0f} times\nfaster',
                      (row['vertices'], (row['shapely'] * row['ours']) ** 0.5), ha='center',
                      va='center', fontsize=10, bbox={'facecolor': 'white', 'linewidth': 0})
    axes.set_xticks(n, [f'{k:,}' for k in n])
    axes.set_yticks([100, 1000, 10_000], ['100 ns', '1 µs', '10 µs'])
    axes.minorticks_off()
    axes.set(xlim=(2.9, 1450), ylim=(20, 20_000), ylabel='time per pair (median, lower is better)',
             xlabel='vertices of each of the two convex polygons',
             title='Do two polygons meet? 20,000 distinct pairs in one call, on one core')
    axes.grid(alpha=0.3)
    axes.legend(loc='upper left', fontsize=11)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)

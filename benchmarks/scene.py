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
The scene as it grows: one footprint against many obstacles, a message's cost, memory.

Obstacles are scattered over a map of fixed size. The rival is the query of shapely's STRtree, in
the same process, on the same bodies and by turns with ours.
"""

import time
import tracemalloc

import matplotlib
import numpy as np
from sat_collision import Polygon
from sat_collision.geometry.polygon_set import PolygonSet
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings
import shapely
from traffic import pack, regular

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402, I100

SIZES = 10, 100, 1_000, 10_000, 100_000
MESSAGE_SIZES = 10, 100, 1_000, 10_000
MAP = 200.0
_FOOTPRINTS = 100
_START = 1_700_000_000 * 10**9
# The most that the node takes in one call.
_TOGETHER = 64
_PERIOD = 10**8


def measure(seed, repeats):
    """Return all figures of this part; times are medians of repeats."""
    rng = np.random.default_rng(seed)
    footprints = _outlines(rng, _FOOTPRINTS, 4, 1.0)
    return {
        'map': MAP,
        'one': [_one_against_many(rng, footprints, size, repeats) for size in SIZES],
        'message': [_message(rng, size, repeats) for size in MESSAGE_SIZES],
        'memory': [_memory(rng, vertices) for vertices in (4, 32, 256)]}


def _outlines(rng, count, vertices, radius):
    centres = rng.uniform(-MAP / 2, MAP / 2, (count, 2))
    return [regular(vertices, x, y, radius) for x, y in centres]


def _by_turns(functions, repeats):
    """Return the median time in s of each function, run by turns."""
    times = {name: [] for name in functions}
    for _ in range(repeats + 1):
        for name, function in functions.items():
            start = time.perf_counter()
            function()
            times[name].append(time.perf_counter() - start)
    return {name: float(np.median(values[1:])) for name, values in times.items()}


def _one_against_many(rng, footprints, size, repeats):
    outlines = _outlines(rng, size, 4, 0.5)
    bodies = PolygonSet(Polygon(outline) for outline in outlines)
    polygons = shapely.polygons(np.array(outlines))
    tree = shapely.STRtree(polygons)
    own = [Polygon(outline) for outline in footprints]
    theirs = [shapely.Polygon(outline) for outline in footprints]
    for body, other in zip(own, theirs):
        found = np.sort(tree.query(other, predicate='intersects'))
        assert np.array_equal(bodies.intersecting_rows(body), found)

    def scan():
        for body in own:
            bodies.intersecting_rows(body)

    def query():
        for body in theirs:
            tree.query(body, predicate='intersects')

    times = _by_turns({'scan': scan, 'query': query}, repeats)
    build = _by_turns({'build': lambda: shapely.STRtree(polygons).query(theirs[0])},
                      min(repeats, 5))['build']
    return {'obstacles': size, 'us': 1e6 * times['scan'] / len(own),
            'tree_us': 1e6 * times['query'] / len(own), 'tree_build_us': 1e6 * build}


def _monitor(size):
    """Return a monitor for so many obstacles."""
    return Monitor(Settings((FootprintSettings('footprint', '/footprint'),),
                            (ObstacleSettings('obstacles', '/obstacles', max_count=size),)))


def _rounds(rng, size, vertices, count):
    """Yield (now, messages) of sets of obstacles."""
    outlines = np.array(_outlines(rng, size, vertices, 0.5))
    for k in range(count):
        now = _START + k * _PERIOD
        yield now, [pack(outline, now) for outline in outlines + 0.01 * (k % 8)]


def _message(rng, size, repeats):
    """Return what a message costs in a scene of some size, from bytes to the changed state."""
    monitor = _monitor(size)
    count = 2 + 2 * repeats * max(1, 500 // size)
    times, footprint_times = {'alone': [], 'together': []}, []
    monitor.receive('footprint', pack(regular(4, 0.0, 0.0, 1.0), _START), _START)
    for now, messages in _rounds(rng, size, 4, count):
        how = 'together' if len(times['together']) < len(times['alone']) else 'alone'
        most = 1 if how == 'alone' else _TOGETHER
        messages = [*messages, pack(np.empty((0, 2)), now)]
        start = time.perf_counter()
        for k in range(0, len(messages), most):
            monitor.receive_batch('obstacles', messages[k:k + most], now)
            monitor.scene.changes()
        times[how].append((time.perf_counter() - start) / len(messages))
        for outline in _outlines(rng, 10, 4, 1.0):
            message = pack(outline, now)
            start = time.perf_counter()
            monitor.receive('footprint', message, now)
            monitor.scene.changes()
            footprint_times.append(time.perf_counter() - start)
    return {'obstacles': size, 'obstacle_us': 1e6 * float(np.median(times['alone'][1:])),
            'together_us': 1e6 * float(np.median(times['together'][1:])),
            'footprint_us': 1e6 * float(np.median(footprint_times[20:]))}


def _memory(rng, vertices, size=2_000):
    """Return the bytes an obstacle that the scene allocates."""
    messages = [pack(outline, _START) for outline in _outlines(rng, size, vertices, 0.5)]
    monitor = _monitor(size)
    tracemalloc.start()
    for message in messages:
        monitor.receive('obstacles', message, _START)
    allocated, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {'vertices': vertices, 'scene': allocated / size}


def plot(figures, path):
    """Draw a query against the number of obstacles."""
    figure, axes = pyplot.subplots(figsize=(6.4, 4.0), layout='constrained')
    sizes = [one['obstacles'] for one in figures['one']]
    axes.loglog(sizes, [one['us'] for one in figures['one']], 'o-', label='sat_collision, scan')
    axes.loglog(sizes, [one['tree_us'] for one in figures['one']], 's--',
                label='shapely STRtree, built before')
    axes.loglog(sizes, [one['tree_build_us'] for one in figures['one']], '^:',
                label='shapely STRtree, with building it')
    axes.set(xlabel='obstacles', ylabel='one footprint against all [µs]')
    axes.grid(alpha=0.3)
    axes.legend()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The decision alone, beside shapely, and the scene as it grows, beside shapely's STRtree.

Touching pairs are the worst load that an adversary could send: doubles decide no sign. Two threads
are compared with one that does the work of both. A plan of 200 poses over 50 m is free, so that
all of it is looked at; its rivals look at places 5 cm apart and miss what is between: the polygons
of the footprint against an STRtree, and its outline on a grid of 5 cm.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
import time
import tracemalloc

from _shared import medians, times
from builders import box, serialised, transforms
import families
from matplotlib import pyplot
import numpy as np
from sat_collision import first_contact_along, intersects_pairs, Polygon, PolygonSet, separations
from sat_collision.monitor import Monitor
from sat_collision.scene.settings import FootprintSettings, ObstacleSettings, Settings, TF
import shapely
import shapes
from traffic import regular

VERTICES = (4, 8, 16, 32, 64, 256, 1024)
MAP_SIZES = 100, 1_000, 10_000, 100_000, 400_000, 1_000_000
PLAN_SIZES = 1_000, 100_000
MESSAGE_SIZES = 10, 100, 1_000, 10_000
MAP = 200.0
_FOOTPRINTS = 100
_REPEATS = 25
_MAP_REPEATS = 15
# Queries of a map that is not to get an index.
_SCANS = 10
_START = 1_700_000_000 * 10**9
# As many messages as the node processes in one call.
_TOGETHER = 64
_PERIOD = 10**8
_BODY = np.array([(-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (-0.5, 0.3)])
_POSES, _LENGTH, _STEP = 200, 50.0, 0.05
# The half diagonal of an obstacle, a square on a corner; one is in four square metres.
_RADIUS = 0.5
_AREA = 4.0


def random_pairs(rng, count, n):
    """
    Return unit-sized pairs: a third 1 to 5 apart, a third 0.1 to -0.1, a third -0.2 to -0.8.

    That is the gap between their projections on a random axis, a lower bound of their separation.
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
    rings = np.round(shapes.regular(rng, count, n) * 2.0**40) / 2.0**40
    edges = rng.integers(0, n - 1, count)
    return [(ring, ring[edge] + ring[edge + 1] - ring) for ring, edge in zip(rings, edges)]


LOADS = [(random_pairs, n) for n in VERTICES] + [(abutting_boxes, 4), (shared_edges, 1024)]


def measure_pairs():
    """Return for each load median ns a pair, setup in us a polygon, and different answers."""
    rng = np.random.default_rng(1)
    for load, n in LOADS:
        _measure_load(load, rng, n, 10, 1)  # whatever has to be compiled is compiled now
    return [_measure_load(load, rng, n) for load, n in LOADS]


def _measure_load(load, rng, n, count=20_000, repeats=7):
    a, b = zip(*load(rng, count, n))
    start = time.perf_counter()
    ours = [PolygonSet(map(Polygon, side)) for side in (a, b)]
    setup = time.perf_counter() - start
    theirs = [np.array([shapely.Polygon(ring) for ring in side]) for side in (a, b)]
    tasks = {'ours': partial(intersects_pairs, *ours),
             'shapely': partial(shapely.intersects, *theirs)}
    answers, others = (task() for task in tasks.values())
    return {'load': load.__name__, 'vertices': n, 'wrong': int((answers != others).sum()),
            'setup': setup / (2 * count) * 1e6,
            **{name: 1e9 * seconds / count for name, seconds in medians(tasks, repeats).items()}}


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


def measure():
    """Return all figures of this part; times are medians of repeats."""
    rng = np.random.default_rng(1)
    return {
        'message': [_message(rng, size) for size in MESSAGE_SIZES],
        'threads': _threads(rng),
        'memory': [_memory(rng, vertices) for vertices in (4, 32, 256)]}


def _outlines(rng, count, vertices, radius):
    centres = rng.uniform(-MAP / 2, MAP / 2, (count, 2))
    return [regular(vertices, x, y, radius) for x, y in centres]


def measure_maps():
    """Return for maps of one obstacle in four square metres the µs a query, ms to build."""
    rng = np.random.default_rng(1)
    return [_map(rng, size) for size in MAP_SIZES]


def _map(rng, size):
    side = 2.0 * size ** 0.5
    outlines, footprints = (
        np.array([regular(4, 0.0, 0.0, radius)]) + rng.uniform(0, side, (count, 1, 2))
        for count, radius in ((size, 0.5), (_FOOTPRINTS, 1.0)))
    bodies, indexed = PolygonSet.from_array(outlines), PolygonSet.from_array(outlines)
    polygons = shapely.polygons(outlines)
    tree = shapely.STRtree(polygons)
    own = [Polygon(outline) for outline in footprints]
    theirs = [shapely.Polygon(outline) for outline in footprints]

    def build():
        indexed.replace(0, indexed.polygon(0))  # drops the index
        indexed.index()
    build()
    tasks = {'indexed': lambda: [indexed.intersecting_rows(body) for body in own],
             'tree': lambda: [tree.query(body, predicate='intersects') for body in theirs],
             'nearest': lambda: [indexed.nearest(body) for body in own]}
    for found, other, _ in zip(*(task() for task in tasks.values())):
        assert np.array_equal(found, np.sort(other))
    # Fewer queries than make it build an index; by themselves, because they flush the caches.
    scan = {'scan': lambda: [bodies.intersecting_rows(body) for body in own[:_SCANS]]}
    builds = {'build': build, 'tree_build': lambda: shapely.STRtree(polygons).query(theirs[0])}
    return {'obstacles': size, **{
        f'{name}_us': 1e6 * seconds / queries
        for some, queries in ((tasks, len(own)), (scan, _SCANS), (builds, 1))
        for name, seconds in medians(some, _MAP_REPEATS).items()}}


def _threads(rng):
    """Return for queries on sets the µs of one thread, and of two threads that each do half."""
    sets = [PolygonSet(side) for side in zip(*families.random_pairs(rng, 1_000, 64))]
    figures = []
    with ThreadPoolExecutor(2) as pool:
        for query in (intersects_pairs, separations):
            def ask(calls):
                for _ in range(calls):
                    query(*sets)
            single, = times({'single': lambda: ask(1)}, 5).values()
            calls = max(1, round(0.05 / min(single)))
            found = times({'one_us': lambda: ask(2 * calls),
                           'two_us': lambda: [*pool.map(ask, (calls, calls))]}, _REPEATS)
            # The best, because whatever else runs takes a core from two threads first.
            figures.append({'query': query.__name__, **{
                name: 1e6 * min(taken) / (2 * calls) for name, taken in found.items()}})
    return figures


def monitor_of(size):
    """Return a monitor of one footprint and of a set of some size."""
    return Monitor(Settings((FootprintSettings('footprint', '/footprint'),),
                            (ObstacleSettings('obstacles', '/obstacles', max_count=size,
                                              set_end='empty_polygon', assume_no_loss=True),)))


def _message(rng, size):
    """Return the cost of a message in a scene of some size, from bytes to the changed state."""
    monitor = monitor_of(size)
    times, footprint_times = {1: [], _TOGETHER: []}, []
    obstacles = np.array(_outlines(rng, size, 4, 0.5))
    monitor.receive('footprint', serialised(regular(4, 0.0, 0.0, 1.0), _START), _START)
    for number in range(2 + 2 * _REPEATS * max(1, 500 // size)):
        now = _START + number * _PERIOD
        messages = [serialised(outline, now)
                    for outline in (*(obstacles + 0.01 * (number % 8)), np.empty((0, 2)))]
        taken = _TOGETHER if number % 2 else 1
        start = time.perf_counter()
        for k in range(0, len(messages), taken):
            monitor.receive_batch('obstacles', messages[k:k + taken], now)
            monitor.scene.take_changes()
        times[taken].append((time.perf_counter() - start) / len(messages))
        for outline in _outlines(rng, 10, 4, 1.0):
            message = serialised(outline, now)
            start = time.perf_counter()
            monitor.receive('footprint', message, now)
            monitor.scene.take_changes()
            footprint_times.append(time.perf_counter() - start)
    return {'obstacles': size, 'obstacle_us': 1e6 * float(np.median(times[1][1:])),
            'together_us': 1e6 * float(np.median(times[_TOGETHER][1:])),
            'footprint_us': 1e6 * float(np.median(footprint_times[20:]))}


def measure_other_frame(repeats=15, count=5000):
    """Return us a message of the fixed frame, and of another one whose map is cached."""
    monitor = Monitor(Settings(
        frame_id='odom', footprints=(FootprintSettings('robot', TF, timeout=0.0),),
        obstacles=(ObstacleSettings('seen', '/seen', set_end='each_message', timeout=60.0),)),
        transforms=True)
    for k in range(10):
        now = _START + k * _PERIOD // 10
        monitor.receive_transforms(TF, transforms(('odom', 'base', now, k / 8, 0.0)), now)
    seen = {frame: serialised(box(20.0), now - _PERIOD // 20, frame)
            for frame in ('odom', 'base')}
    costs = {frame: [] for frame in seen}
    for _ in range(repeats + 1):
        for frame, message in seen.items():
            begin = time.process_time()
            for _ in range(count):
                monitor.receive('seen', message, now)
            costs[frame].append(1e6 * (time.process_time() - begin) / count)
    if monitor.rejected or monitor.waiting.counts():
        raise RuntimeError('the messages were not taken')
    fixed, other = (np.array(costs[frame][1:]) for frame in seen)
    return {'fixed_us': float(np.median(fixed)), 'more_us': float(np.median(other - fixed))}


def _memory(rng, vertices, size=2_000):
    """Return the bytes an obstacle that the scene allocates."""
    messages = [serialised(outline, _START) for outline in _outlines(rng, size, vertices, 0.5)]
    monitor = monitor_of(size)
    tracemalloc.start()
    for message in messages:
        monitor.receive('obstacles', message, _START)
    allocated, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return {'vertices': vertices, 'scene': allocated / size}


def measure_plans():
    """Return for each number of obstacles the median µs of each way to check the plan."""
    rng = np.random.default_rng(1)
    return [_among(rng, size) for size in PLAN_SIZES]


def _among(rng, size):
    side = (_AREA * size) ** 0.5
    poses = _plan(side)
    centres = rng.uniform(0.0, side, (size, 2))
    square = _RADIUS * np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
    body = Polygon(_BODY)
    while True:
        bodies = PolygonSet.from_array(centres[:, None] + square)
        found = first_contact_along(body, poses, bodies, margin=2.0 * _STEP)
        if found is None:
            break
        centres[found.row] = rng.uniform(0.0, side, 2)
    if size > min(PLAN_SIZES):
        bodies.index()
    tree = shapely.STRtree(shapely.polygons(centres[:, None] + square))
    tasks = {'us': partial(first_contact_along, body, poses, bodies),
             'one_by_one_us': partial(_one_by_one, tree, poses),
             'at_once_us': partial(_at_once, tree, poses),
             'grid_us': partial(_on_grid, _grid(centres, side), poses)}
    assert not any(task() for task in tasks.values())
    return {'obstacles': size, **{name: 1e6 * seconds
                                  for name, seconds in medians(tasks, _REPEATS).items()}}


def _plan(side):
    """Return poses along a winding way through the middle of a square."""
    step = _LENGTH / (_POSES - 1)
    yaw = 0.8 * np.sin(np.arange(_POSES) * step / 4.0)
    x, y = (np.cumsum(step * part(yaw)) for part in (np.cos, np.sin))
    return np.column_stack([x - x.mean() + side / 2.0, y - y.mean() + side / 2.0, yaw])


def _places(poses, points):
    """Return points of the body at places up to 5 cm apart."""
    parts = int(np.ceil(_LENGTH / (_POSES - 1) / _STEP))
    shares = np.arange(parts * (len(poses) - 1) + 1) / parts
    x, y, yaw = (np.interp(shares, np.arange(len(poses)), part) for part in poses.T)
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    px, py = points.T
    return np.stack([c * px - s * py + x[:, None], s * px + c * py + y[:, None]], axis=2)


def _one_by_one(tree, poses):
    return any(len(tree.query(shapely.Polygon(outline), predicate='intersects'))
               for outline in _places(poses, _BODY))


def _at_once(tree, poses):
    return tree.query(shapely.polygons(_places(poses, _BODY)), predicate='intersects').size > 0


def _grid(centres, side):
    """Return which cells of a grid have their middle in an obstacle."""
    grid = np.zeros((int(side / _STEP) + 1,) * 2, bool)
    reach = np.arange(-int(_RADIUS / _STEP) - 1, int(_RADIUS / _STEP) + 2)
    near = np.stack(np.meshgrid(reach, reach), axis=2).reshape(-1, 2)
    for some in np.array_split(centres, -(-len(centres) // 1000)):
        cells = np.floor(some / _STEP).astype(int)[:, None] + near
        off = np.abs((cells + 0.5) * _STEP - some[:, None]).sum(axis=2)
        x, y = cells[(off <= _RADIUS) & (cells >= 0).all(axis=2)
                     & (cells < len(grid)).all(axis=2)].T
        grid[x, y] = True
    return grid


def _on_grid(grid, poses):
    sides = np.roll(_BODY, -1, axis=0) - _BODY
    outline = np.vstack([
        corner + side * np.linspace(0.0, 1.0, round(np.hypot(*side) / _STEP), False)[:, None]
        for corner, side in zip(_BODY, sides)])
    x, y = (_places(poses, outline) / _STEP).astype(int).reshape(-1, 2).T
    return bool(grid[x, y].any())

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

"""Speed against error: every method on every kind of pair, by number of vertices."""

import functools
import json
import os
import pickle
import subprocess
import sys
import tempfile

import bodies
import clock
from methods import (
    applicable, BOX_AXES, find_centres, Pairs, pymunk_shape, queries, run, shapely_shape)
import numpy as np
from sat_collision import intersects, Polygon
from sat_collision.geometry.jit import COMPILED
import shapely

REPEATS = 7
SHAPES = *bodies.SIDES, bodies.RECTANGLES


def measure(rng, scale=1.0):
    """Return rows of figures for both kernels, with what the kernels disagree in."""
    rows, small = [], []
    for shape in SHAPES:
        n = 4 if shape == bodies.RECTANGLES else shape
        for kind in bodies.KINDS:
            pairs, meet = bodies.sample(rng, shape, kind, _count(n, scale))
            rows += rows_of(shape, kind, pairs, meet, REPEATS)
            few = max(2, min(60, 2000 // n))
            small.append((shape, kind, pairs[:few], meet[:few], 3 if n < 256 else 1))
        print(f'speed: {shape}', file=sys.stderr)
    plain = _in_plain_python(small)
    different = compared = 0
    for (shape, kind, pairs, *_), rows_there in zip(small, plain):
        here = Pairs(pairs)
        for row in rows_there:
            answers = run(row['method'], here)[0]
            different += int((answers != np.array(row.pop('answers'), bool)).sum())
            compared += len(pairs)
    return {'compiled': rows, 'plain': sum(plain, []),
            'kernels': {'compared': compared, 'different': different}}


def rows_of(shape, kind, pairs, meet, repeats, keep_answers=False):
    """Return a row of figures for each method that applies, all measured in turns."""
    prepared = Pairs(pairs)
    names = applicable(shape)
    results = {name: run(name, prepared) for name in names}
    seconds = clock.medians({name: functools.partial(run, name, prepared) for name in names},
                            repeats)
    rows = []
    for name, (answers, axes) in results.items():
        row = {'shape': shape, 'kind': kind, 'method': name, 'pairs': len(pairs),
               'apart': int((~meet).sum()), 'false_collisions': int((answers & ~meet).sum()),
               'false_clears': int((~answers & meet).sum()),
               'ns': [round(value / len(pairs) * 1e9, 1) for value in seconds[name]]}
        if name == 'improved' and COMPILED:
            axes, unsure = queries(prepared)
            row['exact_stage'] = int(unsure.sum())
            row['without_axis'] = int((axes == BOX_AXES).sum())
        if axes is not None:
            row['axes'] = float(axes.mean())
        if keep_answers:
            row['answers'] = answers.tolist()
        rows.append(row)
    return rows


def preparation(rng, scale=1.0):
    """Return what it costs to make ready a body, and to ask for one pair from Python, in ns."""
    rows = []
    for n in bodies.SIDES:
        pairs, _ = bodies.sample(rng, n, 'near', _count(n, 0.1 * scale))
        prepared = Pairs(pairs)
        rings = prepared.sides[0]
        made = {
            'Polygon': lambda: [Polygon(ring) for ring in rings],
            'shapely': lambda: [shapely_shape(ring) for ring in rings],
            'pymunk': lambda: [pymunk_shape(ring) for ring in rings],
            'centre of gravity, compiled': lambda: find_centres(prepared),
        }
        asked = {
            'intersects': lambda: [intersects(a, b) for a, b in zip(*prepared.polygons)],
            'shapely.intersects': lambda: [shapely.intersects(a, b)
                                           for a, b in zip(*prepared.shapely)],
            'cpShapesCollide': functools.partial(run, 'pymunk', prepared),
        }
        for task in (*made.values(), *asked.values()):
            task()
        for stage, tasks in (('body', made), ('call', asked)):
            for name, seconds in clock.medians(tasks, REPEATS).items():
                rows.append({'n': n, 'stage': stage, 'what': name,
                             'ns': round(seconds[0] / len(rings) * 1e9, 1)})
    return rows


def _count(n, scale):
    """Return how many pairs: enough for rates of a per cent, and seconds for a method."""
    count = {256: 2000, 1024: 256}.get(n, min(6000, 200_000 // n))
    return max(8, int(count * scale) // 2 * 2)


def _in_plain_python(samples):
    """Return the rows that this module, run as a program without numba's compiler, prints."""
    with tempfile.NamedTemporaryFile() as file:
        pickle.dump(samples, file)
        file.flush()
        path = os.pathsep.join(entry for entry in sys.path if entry)
        printed = subprocess.run(
            [sys.executable, __file__, file.name], check=True, stdout=subprocess.PIPE,
            env={**os.environ, 'NUMBA_DISABLE_JIT': '1', 'PYTHONPATH': path}).stdout
    return json.loads(printed)


if __name__ == '__main__':
    with open(sys.argv[1], 'rb') as file:
        print(json.dumps([rows_of(*sample, keep_answers=True)
                          for sample in pickle.load(file)]))

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

import clock
from methods import (
    applicable, chipmunk_shape, find_centres, Pairs, run, shapely_shape, UNTIMED)
import numpy as np
import samples
from sat_collision import intersects, Polygon
from sat_collision.geometry.jit import COMPILED
import shapely
import stages

REPEATS = 5
SHAPES = *samples.SIDES, samples.RECTANGLES
PLAIN_SIDES = 4, 16, 64
PREPARED_SIDES = 4, 16, 64, 256


def measure(seeds, scale=1.0):
    """Return rows of figures for both kernels, with what the kernels disagree in."""
    rows, small = [], []
    for shape in SHAPES:
        n = 4 if shape == samples.RECTANGLES else shape
        for kind in samples.KINDS:
            runs = []
            for seed in seeds:
                rng = np.random.default_rng([seed, n])
                pairs, meet = samples.sample(rng, shape, kind, _count(n, scale))
                runs.append(_run_all(shape, pairs, meet, REPEATS))
            rows += [{'shape': shape, 'kind': kind, **row} for row in _pooled(runs)]
            if shape in PLAIN_SIDES:
                few = max(4, int(scale * min(120, 4000 // n)))
                small.append((shape, kind, pairs[:few], meet[:few]))
        print(f'speed: {shape}', file=sys.stderr)
    plain = _in_plain_python(small)
    different = compared = 0
    for (_, _, pairs, _), rows_there in zip(small, plain):
        here = Pairs(pairs)
        for row in rows_there:
            answers = run(row['method'], here)[0]
            different += int((answers != np.array(row.pop('answers'), bool)).sum())
            compared += len(pairs)
    return {'compiled': rows, 'plain': sum(plain, []),
            'kernels': {'compared': compared, 'different': different}}


def preparation(rng, scale=1.0):
    """Return what it costs to make ready a body, and to ask for one pair from Python, in ns."""
    rows = []
    for n in PREPARED_SIDES:
        pairs, _ = samples.sample(rng, n, 'near', _count(n, scale))
        prepared = Pairs(pairs)
        rings = prepared.sides[0]
        made = {
            'Polygon': lambda: [Polygon(ring) for ring in rings],
            'shapely': lambda: [shapely_shape(ring) for ring in rings],
            'Chipmunk': lambda: [chipmunk_shape(ring) for ring in rings],
            'centre of gravity, compiled': lambda: find_centres(prepared),
        }
        asked = {
            'improved': lambda: [intersects(a, b) for a, b in zip(*prepared.polygons)],
            'shapely': lambda: [shapely.intersects(a, b) for a, b in zip(*prepared.shapely)],
            'Chipmunk': functools.partial(run, 'chipmunk', prepared),
        }
        if 'chipmunk' not in applicable():
            del made['Chipmunk'], asked['Chipmunk']
        for task in (*made.values(), *asked.values()):
            task()
        for stage, tasks in (('body', made), ('call', asked)):
            for name, seconds in clock.medians(tasks, REPEATS).items():
                rows.append({'n': n, 'stage': stage, 'what': name,
                             'ns': round(seconds / len(rings) * 1e9, 1)})
    return rows


def _run_all(shape, pairs, meet, repeats):
    """Return for each method that applies the answers' counts, the axes and all times in ns."""
    prepared = Pairs(pairs)
    names = applicable(shape)
    with np.errstate(all='ignore'):
        results = {name: run(name, prepared) for name in names}
    taken = clock.times({name: functools.partial(run, name, prepared)
                         for name in names if name not in UNTIMED}, repeats)
    rows = {}
    for name, (answers, axes) in results.items():
        row = {'pairs': len(pairs), 'apart': int((~meet).sum()),
               'false_collisions': int((answers & ~meet).sum()),
               'false_clears': int((~answers & meet).sum()),
               'ns': [seconds / len(pairs) * 1e9 for seconds in taken.get(name, ())],
               'answers': answers}
        if name == 'improved' and COMPILED:
            axes, exact = stages.tried(*prepared.polygons)
            row['exact'] = int(exact.sum())
        if axes is not None:
            row['axes'] = float(axes.mean())
        rows[name] = row
    return rows


def _pooled(runs):
    """
    Return a row a method of the runs with several seeds.

    Its times are median, quartiles, and the least and greatest of the seeds' medians.
    """
    for name in runs[0]:
        of = [run_[name] for run_ in runs]
        row = {'method': name, **{key: sum(one[key] for one in of) for key in (
            'pairs', 'apart', 'false_collisions', 'false_clears', 'exact') if key in of[0]}}
        row['wrong_by_seed'] = [one['false_collisions'] + one['false_clears'] for one in of]
        times = [one['ns'] for one in of]
        if times[0]:
            each = [float(np.median(ns)) for ns in times]
            row['ns'] = [round(value, 1) for value in (
                *np.quantile(np.concatenate(times), [0.5, 0.25, 0.75]), min(each), max(each))]
        if 'axes' in of[0]:
            row['axes'] = round(float(np.mean([one['axes'] for one in of])), 2)
        yield row


def _count(n, scale):
    """Return how many pairs a seed: enough for rates of a per cent, and seconds for a method."""
    return max(8, int(scale * min(1200, max(300, 40_000 // n))) // 2 * 2)


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


def _plain_rows(shape, kind, pairs, meet):
    rows = _run_all(shape, pairs, meet, 1)
    return [{'shape': shape, 'kind': kind, 'method': name, 'pairs': row['pairs'],
             'ns': [round(row['ns'][0], 1)], 'answers': row['answers'].tolist()}
            for name, row in rows.items()]


if __name__ == '__main__':
    with open(sys.argv[1], 'rb') as file:
        print(json.dumps([_plain_rows(*sample) for sample in pickle.load(file)]))

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
from methods import applicable, Pairs, run, run_once, UNTIMED
import numpy as np
import samples
from sat_collision.geometry.jit import COMPILED
import stages

REPEATS = 5
SHAPES = *samples.SIDES, samples.RECTANGLES
PLAIN_SIDES = 4, 16, 64
ONCE_SIDES = 4, 16, 64


def measure(seeds, scale=1.0):
    """Return rows of figures for both kernels, whose answers must be the same."""
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
    for (*_, pairs, _), rows_there in zip(small, plain):
        here = Pairs(pairs)
        for row in rows_there:
            if (run(row['method'], here)[0] != row.pop('answers')).any():
                raise AssertionError(f'{row["method"]} answers otherwise in plain Python')
    return {'compiled': rows, 'plain': sum(plain, [])}


def once(rng, scale=1.0):
    """Return the time of near pairs in ns where what a body needs is made for each pair."""
    rows = []
    for n in ONCE_SIDES:
        pairs = samples.sample(rng, n, 'near', _count(n, scale))[0]
        # Of those whose vertices rounding has not made fewer, so that shapely takes an array.
        prepared = Pairs([pair for pair in pairs if len(pair[0]) == len(pair[1]) == n])
        tasks = {name: functools.partial(run_once, name, prepared) for name in applicable()
                 if name not in UNTIMED}
        for name, task in tasks.items():
            if (task() != run(name, prepared)[0]).any():
                raise AssertionError(f'{name} answers otherwise where bodies are used once')
        rows += [{'method': name, 'n': n, 'ns': round(seconds / len(prepared) * 1e9, 1)}
                 for name, seconds in clock.medians(tasks, REPEATS).items()]
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

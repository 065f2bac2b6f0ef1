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
import sys

from measuring import medians, times
from methods import applicable, counts, Pairs, run, run_once, UNTIMED
import numpy as np
import samples

REPEATS = 5
ONCE_SIDES = 4, 16, 64


def measure(seeds, scale=1.0):
    """Return rows of figures: answers and times of each method, of the runs with all seeds."""
    rows = []
    for n in samples.SIDES:
        for kind in samples.KINDS:
            runs = []
            for seed in seeds:
                rng = np.random.default_rng([seed, n])
                runs.append(_run_all(*samples.sample(rng, n, kind, _count(n, scale))))
            rows += [{'n': n, 'kind': kind, **row} for row in _pooled(runs)]
        print(f'speed: {n}', file=sys.stderr)
    return rows


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
                 for name, seconds in medians(tasks, REPEATS).items()]
    return rows


def _run_all(pairs, meet):
    """Return for each method the answers' counts and all times in ns."""
    prepared = Pairs(pairs)
    with np.errstate(all='ignore'):
        answers = {name: run(name, prepared)[0] for name in applicable()}
    taken = times({name: functools.partial(run, name, prepared)
                   for name in answers if name not in UNTIMED}, REPEATS)
    return {name: {**counts(answer, meet), 'ns': [seconds / len(pairs) * 1e9
                                                  for seconds in taken.get(name, ())]}
            for name, answer in answers.items()}


def _pooled(runs):
    """Return a row a method of the runs with several seeds; its times are median, quartiles."""
    for name in runs[0]:
        of = [run_[name] for run_ in runs]
        row = {'method': name, **{key: sum(one[key] for one in of) for key in (
            'pairs', 'apart', 'false_collisions', 'false_clears')}}
        taken = np.concatenate([one['ns'] for one in of])
        if len(taken):
            row['ns'] = [round(value, 1) for value in np.quantile(taken, [0.5, 0.25, 0.75])]
        yield row


def _count(n, scale):
    """Return how many pairs a seed: enough for rates of a per cent, and seconds for a method."""
    return max(8, int(scale * min(1200, max(300, 40_000 // n))) // 2 * 2)

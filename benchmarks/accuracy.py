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
Compare millions of answers with the exact oracle, over all hard families: `make accuracy`.

Bodies go through the checked constructor and the compiled bulk decision, as the node runs them;
the oracle (test/support/oracle.py) does not use separating axes. Any wrong answer is a failure.
Also measured: how often floating point left the decision to the exact stage, and its cost.
"""

import argparse
from collections import Counter
import json
from pathlib import Path
import sys
import time

from _shared import describe
import families
import numpy as np
import oracle
import samples
from sat_collision import intersects_pairs, Polygon, PolygonSet
from scenes import tried
import tables

SIDES = 3, 4, 5, 6, 8, 16, 32, 64, 256, 1024
CHECKED = 1000  # one in so many of the answers the filter proved is also decided in integers


def main():
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--pairs', type=lambda text: int(float(text)), default=20_000_000)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--json', type=Path)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    _compare(rng, families.near(rng, 1, 3))  # compiles everything
    start = time.perf_counter()
    results, wrong, done = {}, [], 0
    for k, (family, n, count) in enumerate(_shares(arguments.pairs)):
        name = family.__name__
        rng = np.random.default_rng([arguments.seed, k])
        total = results.setdefault(name, Counter())
        for part in samples.chunks(count, n):
            counts, examples = _compare(rng, family(rng, part, n))
            total.update(counts)
            for a, b in examples:
                print(f'\nwrong in {name}: {a} against {b}', file=sys.stderr)
                wrong.append({'family': name, 'a': a, 'b': b})
            done += part
            print(f'\r{done:>12,} of {arguments.pairs:,} pairs, '
                  f'{time.perf_counter() - start:6.0f} s, {name:<22}',
                  end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    total = Counter()
    for counts in results.values():
        total.update(counts)  # unlike a sum, keeps zeros
    results['all'] = total
    print(tables.long_run(results))
    if arguments.json:
        arguments.json.write_text(json.dumps({
            'seed': arguments.seed, 'seconds': round(time.perf_counter() - start),
            'machine': describe('numpy'), 'families': results, 'wrong': wrong},
            indent=1) + '\n')
    return 1 if wrong else 0


def _shares(pairs):
    """Return (family, n, count): equal shares for the families, less for `MANY`; by 1 / n."""
    named = [*families.CONVEX.values(), *families.EXTREME.values(), *families.SIMPLE.values()]
    shares = []
    for family in named:
        share, sides = pairs // len(named), SIDES
        if family.__name__ in samples.MANY:
            share, sides = share // 50, samples.MANY[family.__name__]
        elif family.__name__ in families.SIMPLE:
            sides = SIDES[:-2]
        whole = sum(1 / n for n in sides)
        shares += [(family, n, max(1, int(share / n / whole))) for n in sides]
    left = pairs - sum(count for _, _, count in shares)
    return [(*shares[0][:2], shares[0][2] + left), *shares[1:]]


def _compare(rng, pairs):
    expected, unknown = oracle.intersects_pairs(pairs)
    checked = np.flatnonzero(~unknown & (rng.random(len(pairs)) < 1 / CHECKED))
    if any(oracle.intersects(*pairs[i]) != expected[i] for i in checked):
        raise AssertionError('the filtered oracle contradicts the exact one')
    a, b = ([Polygon(pair[k]) for pair in pairs] for k in (0, 1))
    _, unsure = tried(a, b)
    answers, seconds = np.empty(len(pairs), np.bool_), {}
    for exact in (False, True):
        rows = np.flatnonzero(unsure == exact)
        sets = [PolygonSet(polygons[i] for i in rows) for polygons in (a, b)]
        start = time.perf_counter()
        answers[rows] = intersects_pairs(*sets)
        seconds[exact] = time.perf_counter() - start
    wrong = np.flatnonzero(answers != expected)
    return Counter({
        'pairs': len(pairs), 'meet': int(expected.sum()), 'wrong': len(wrong),
        'oracle_in_integers': int(unknown.sum()), 'oracle_checked': len(checked),
        'exact': int(unsure.sum()), 'seconds': seconds[False], 'exact_seconds': seconds[True],
    }), [[body.tolist() for body in pairs[i]] for i in wrong]


if __name__ == '__main__':
    sys.exit(main())

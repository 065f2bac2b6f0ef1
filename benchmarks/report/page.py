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

"""The report's page: what to know first, then the sections of the other modules."""

import lookup
from methods import LABELS, METHODS
import page_cost
import page_errors
import page_paper
import page_time
from words import (
    compared, counted, duration, listed, none_wrong, power, ratio, share, spread, table, wrapped)

SHOWN = 4, 16, 64
RATED = 16


def text(figures):
    """Return the page in Markdown."""
    sections = [_first(figures), _theorem(), page_errors.condition(figures),
                page_errors.growth(figures), page_time.time(figures), page_cost.cost(figures),
                page_cost.left_out(figures),
                page_paper.claims(figures), _methods(figures), _measured(figures)]
    return wrapped('\n\n'.join(sections)) + '\n'


def _first(figures):
    return f"""# Speed against error

{_right(figures)} {_fast(figures)} {_published(figures)}

![Wrong answers against time a pair, for near and for hard pairs](speed_error.png)

*A line a method, through n = {listed(map(str, lookup.sides(figures)))} vertices (written once);
left and low is good, and in the green band nothing is wrong. Bars are quartiles of the time and
Wilson's intervals of the share, 95 %.*

{_table(figures)}

Median times a pair; wrong answers of pairs with n = {RATED}; c, the
[backward error](#when-a-method-is-wrong), in units of u D. What each method does is said
[below](#the-methods); [long tables](appendix.md) are in an appendix."""


def _right(figures):
    rows = lookup.rows(figures, 'improved')
    wrong, asked = lookup.wrong(rows), sum(r['pairs'] for r in rows)
    if wrong:
        return (f'The improved method of this package is WRONG in {counted(wrong, asked)} '
                f'answers.')
    text = (f'The improved method of this package is right in all of {asked:,} answers here, half '
            f'of them about near or hard pairs')
    run = figures['accuracy']
    if not run:
        return f'{text}.'
    total = run['families']['all']
    if total['wrong']:
        return f'{text}, and WRONG in {total["wrong"]} of {total["pairs"]:,} of the long run.'
    return (f'{text}, and in all of {total["pairs"]:,} of the [long run](appendix.md#the-long-run)'
            f': a rate {none_wrong(total["pairs"])}.')


def _fast(figures):
    times = [duration(lookup.ns(figures, n, 'improved', kinds=('near',))) for n in SHOWN]
    return (f'For a near pair with {listed(map(str, SHOWN))} vertices it takes {listed(times)}, '
            f'{_against(figures, "near")}, the fastest rival that is never wrong; for a hard pair '
            f'it is {_against(figures, "hard")}.')


def _against(figures, kind):
    """Compare improved with the fastest other method that is always right, at each n shown."""
    rivals = [m for m in lookup.always_right(figures)
              if m != 'improved' and m in lookup.timed(figures)]
    ratios, names = [], []
    for n in SHOWN:
        times = {m: lookup.ns(figures, n, m, kinds=(kind,)) for m in rivals}
        best = min(times, key=times.get)
        ratios.append(times[best] / lookup.ns(figures, n, 'improved', kinds=(kind,)))
        names.append(LABELS[best])
    factors = [ratio(max(value, 1 / value)) for value in ratios]
    words = ['fast' if value >= 1 else 'slow' for value in ratios]
    if len(set(names)) > 1:
        return listed(f'{compared(1, value)} {name}' for value, name in zip(ratios, names))
    if len(set(words)) > 1:
        each = listed(f'{factor} times as {word}' for factor, word in zip(factors, words))
        return f'{each} as {names[0]}'
    return f'{listed(factors)} times as {words[0]} as {names[0]}'


def _published(figures):
    a = lookup.row(figures, 64, 'near', 'published_a')
    b = lookup.row(figures, 64, 'near', 'published_b')
    hard = {m: lookup.rows(figures, m, 'hard') for m in ('traditional', 'gjk')}
    wrong = {m: share(lookup.wrong(rows), sum(r['pairs'] for r in rows))
             for m, rows in hard.items()}
    return (f'Of near pairs with 64 vertices the published shortcut calls '
            f'{share(*lookup.parts(a, "false_collisions"))} of those apart colliding in its one '
            f'reading and misses {share(*lookup.parts(b, "false_clears"))} of the collisions in '
            f'the other; on hard pairs rounding makes '
            + listed(f'{LABELS[m]} wrong in {value}' for m, value in wrong.items()) + '.')


def _table(figures):
    lines = []
    for method in lookup.timed(figures):
        worst = figures['condition']['backward'].get(method, 0.0)
        lines.append([LABELS[method], *(
            duration(lookup.ns(figures, n, method, kinds=('near',))) for n in SHOWN), *(
            lookup.rate_of(lookup.row(figures, RATED, kind, method)) for kind in ('near', 'hard')),
            power(worst) if worst else '–'])
    return table(['', *(f'n = {n}, near' for n in SHOWN), 'wrong, near', 'wrong, hard', 'c'],
                 lines)


def _theorem():
    return """## The theorem

*Let P and Q be simple polygons, segments or points, closed sets whose coordinates are any finite
IEEE 754 doubles. On a machine that rounds to nearest, underflows gradually and contracts no
operations, `intersects(P, Q)` is true just when P and Q have a point in common.*

No tolerance decides an answer: a value in plain floating point decides only what exceeds its
proved error bound, and exact orientations decide the rest. The proof, lemma by lemma with the
function and the constant of each, is in [exactness.md](../exactness.md)."""


def _methods(figures):
    lines = [f'- **{method.label}**: {method.what}.' for name, method in METHODS.items()
             if name in lookup.methods(figures) or name == 'rectangles']
    return '## The methods\n\n' + '\n'.join(lines) + """

The rivals from binary-search SAT to filtered orientations are kernels of our own, compiled as
improved is, and begin with the boxes as it does; the first two look up support vertices in
logarithmic time, and the exact stage of the two filters is improved's. Libraries in C were
measured elsewhere: the best inexact GJK takes 25 ns at n = 4 to improved's 30, and 2.6 to 17 times
as long from n = 16 on."""


def _measured(figures):
    facts = figures['machine']
    counts = {n: lookup.row(figures, n, 'near', 'improved')['pairs']
              for n in lookup.sides(figures)}
    versions = ', '.join(f'{name} {facts[name]}' for name in facts
                         if name not in ('processor', 'cores', 'system', 'kernel'))
    return f"""## How it was measured

{facts["processor"]}, {facts["cores"]} cores, {facts["system"]}; {versions}. One thread. `make
report` measures everything again in {figures["seconds"] / 60:.0f} minutes and writes this page,
sentences included, from [`figures.json`](figures.json).

- **Bodies** have n vertices each, on ellipses of half axes 1 m and 0.1 to 1 m, the angles between
  vertices uneven. The rates of the published methods depend on this: bodies of another shape would
  change them, not their cause.
- **Pairs** are of four kinds. *Clear*: 0.2 to 4 m apart. *Near*: within 0.1 m of touching, half of
  them apart. *Deep*: overlapping, their distance at most 0.9 of that where they touch. *Hard*: in
  equal shares gaps of 10⁻¹⁷ to 10⁻⁹, distances to 10⁸ m from the origin, slivers, lattice contacts
  of three kinds, one ulp beside contact, flat arcs and float32 round trips; half apart. Of each
  kind {spread(counts.values(), "{:,}".format)} pairs for each n.
- **The truth** is exact: integer arithmetic over edge crossings and vertex containment
  (`test/support/oracle.py`), which shares nothing with the separating axis theorem.
- **Five seeds** drew the pairs. {_seeds(figures)}
- **Times** are medians of five runs a seed over all its pairs, the methods taking turns in one
  process, so every pair is another one to the caches and the branch predictor. What a body needs
  once (boxes, centres of gravity, packed polygons, shapely's shapes) is made before; what that
  costs is in the [appendix](appendix.md#before-and-around-a-decision). All decide all pairs in one
  compiled call; shapely's bodies are not "prepared", since each is met once."""


def _seeds(figures):
    times, rates = [], []
    for method in lookup.timed(figures):
        for row in lookup.rows(figures, method):
            median, _, _, least, most = row['ns']
            times.append((most - least) / median)
            each = [wrong * len(row['wrong_by_seed']) / row['pairs']
                    for wrong in row['wrong_by_seed']]
            rates.append(max(each) - min(each))
    times.sort()
    return (f'From the fastest to the slowest of the seeds a median time differs by '
            f'{share(times[len(times) // 2])} of itself in half of the measurements and by up to '
            f'{share(times[-1])}; the share of wrong answers by up to '
            f'{100 * max(rates):.1f} percentage points.')

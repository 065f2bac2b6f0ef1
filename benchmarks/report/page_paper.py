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

"""The section on what the paper claims."""

from claims import DRAWN_SIDES
import lookup
from methods import LABELS, RECTANGLES
from words import compared, counted, listed, ratio, share, spread, table

READINGS = 'published_a', 'published_b', 'hybrid', 'closest', 'literal'


def claims(figures):
    return f"""## What the paper claims, and what we measured

Liang and Liu can be read in two ways: *A*, sections 3.1 and 3.2; *B*, section 4 to the letter. A
third, charitable one is measured too, *hybrid*: the centre line with all vertices as in A, then
the two normals of B; so are equations 3 and 4 by brute force, and the vertices that equation 5 as
printed chooses. Near pairs, false "collision" of those apart / false "clear" of those in contact:

{_table(figures)}

- **"Improve the accuracy"** (section 6) {_accuracy(figures)}
- **"Shorten the average time"** (section 6) {_shorter(figures)}
- **"Only four potential separating axes … no overlap, collide otherwise"** (sections 3.1, 4) is
  the step that is wrong: the separating axis may be the normal of an edge that was not tried.
  {_misses(figures)}
- **Equation 5** as printed, OE = OB / cos ∠BOE, grows without bound as OB turns away from the
  centre line, and chooses worse: {_literal(figures)}
- **Equations 3 and 4**, which the paper calls undesirable, are the one reading that is complete:
  {_closest(figures)}
- **Before them** the paper tells of two accelerations. {_boxed(figures)}
  {_rectangles(figures)}

{_axes(figures)}

![A false collision of reading A and a missed collision of reading B, drawn](examples.png)

*Left, of all near pairs with n = {DRAWN_SIDES} that reading A calls colliding, the one furthest
apart. Middle and right, of those that reading B misses, the one that overlaps most: on the centre
line the four vertices end before those of the other body begin, other vertices reach further.*"""


def _table(figures):
    sides = lookup.sides(figures)
    lines = [[LABELS[method], *(' / '.join(
        share(*lookup.parts(lookup.row(figures, n, 'near', method), what))
        for what in ('false_collisions', 'false_clears')) for n in sides)]
        for method in READINGS]
    return table(['', *(f'n = {n}' for n in sides)], lines)


def _accuracy(figures):
    rows = {m: lookup.rows(figures, m, 'near') for m in ('traditional', *READINGS[:3])}
    wrong = lookup.wrong(rows['traditional'])
    pairs = sum(row['pairs'] for row in rows['traditional'])
    worse = [m for m in READINGS[:3] if lookup.wrong(rows[m]) > wrong]
    verdict = 'is false' if len(worse) == 3 else 'is true of some readings here'
    cause = '' if wrong else ', so rounding is not the cause'
    readings = listed(counted(lookup.wrong(rows[m]), pairs) for m in READINGS[:3])
    return (f'{verdict}: traditional is wrong on {counted(wrong, pairs)} of the same '
            f'pairs{cause}, the readings on {readings}.')


def _shorter(figures):
    sides = lookup.sides(figures)
    parts, slower = [], {}
    for method in ('published_a', 'published_b', 'hybrid', 'improved'):
        ratios = {n: lookup.ns(figures, n, method) / lookup.ns(figures, n, 'traditional')
                  for n in sides}
        slower[method] = [n for n, value in ratios.items() if value >= 1]
        parts.append(f'{ratio(ratios[4])} and {ratio(ratios[16])} times for {LABELS[method]}')
    exceptions = [f'{LABELS[m]} for n = {listed(map(str, of))}' for m, of in slower.items() if of]
    verdict = 'holds for every n here' if not exceptions else (
        f'holds here but for {"; ".join(exceptions)}')
    return (f'{verdict}. On equal shares of clear, near and deep pairs, centres of gravity made '
            f'in advance, the time of traditional becomes, for n = 4 and n = 16, {listed(parts)}. '
            f'Traditional takes O(n²) where these take O(n) and improved O(log n), so any large n '
            f'makes any large factor.')


def _misses(figures):
    misses = {}
    for row in figures['steps']:
        for step in row['steps']:
            key = row['method'], step['step']
            misses[key] = misses.get(key, 0) + step['false_clears']
    total = sum(misses.values())
    sentences = [f'{counted(count, total)} misses come from {LABELS[method]}, step "{step}".'
                 for (method, step), count in misses.items() if count]
    if any(count and step == 'centre line, four vertices' for (_, step), count in misses.items()):
        sentences.append('There a vertex other than the four may reach further along the centre '
                         'line than they do.')
    lines = sum(step['clears'] for row in figures['steps'] for step in row['steps']
                if step['step'] == 'lines to the nearest points')
    apart = sum(row['apart'] for row in figures['steps'] if row['method'] == 'published_a')
    sentences.append(f'The lines to the nearest points, central to the paper, separate {lines:,} '
                     f'of {apart:,} pairs apart where the steps before do not: a line that ends '
                     f'inside an edge is the normal of that edge, tried before.')
    return ' '.join(sentences)


def _literal(figures):
    rows = {m: lookup.row(figures, 16, 'near', m) for m in ('literal', 'published_a')}
    return ' against '.join(f'{lookup.rate_of(row, "false_collisions")} of {LABELS[m]}'
                            for m, row in rows.items()) + ' for n = 16.'


def _closest(figures):
    near = lookup.rows(figures, 'closest', 'near')
    hard = lookup.rows(figures, 'closest', 'hard')
    slow = lookup.ns(figures, 16, 'closest') / lookup.ns(figures, 16, 'traditional')
    return (f'{counted(lookup.wrong(near), sum(r["pairs"] for r in near))} near pairs wrong, but '
            f'{counted(lookup.wrong(hard), sum(r["pairs"] for r in hard))} hard ones, in '
            f'{ratio(slow)} times the time of traditional for n = 16.')


def _boxed(figures):
    ratios = [lookup.ns(figures, n, 'boxed') / lookup.ns(figures, n, 'traditional')
              for n in lookup.sides(figures)]
    return (f'Testing bounding boxes first (section 1) leaves {spread(ratios, ratio)} of its '
            f'time.')


def _rectangles(figures):
    merged, whole, ours = (lookup.ns(figures, RECTANGLES, m)
                           for m in ('rectangles', 'traditional', 'improved'))
    hard = lookup.row(figures, RECTANGLES, 'hard', 'rectangles')
    return (f'Of rectangles two axes each will do (section 2.3): that is '
            f'{compared(merged, whole)} traditional, wrong in {lookup.rate_of(hard)} of '
            f'rectangles that share an edge but for rounding; improved, which does not know that '
            f'they are rectangles, is {compared(ours, merged)} it.')


def _axes(figures):
    spans = {m: lookup.axes(figures, m) for m in (
        'traditional', 'published_a', 'published_b', 'improved')}
    return ('**Axes tried** a decision, from n = {} to n = {}: '.format(
        lookup.sides(figures)[0], lookup.sides(figures)[-1])
        + listed(f'{LABELS[m]} {spread(values, "{:.1f}".format)}' for m, values in spans.items())
        + ' (boxes counted as two).')

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

"""The sections on what the paper claims, and on the axes that each method tries."""

from claims import DRAWN_SIDES
import lookup
from methods import LABELS
from sat_collision.geometry.layout import SCAN_LIMIT
from words import listed, ratio, share, spread, table


def claims(figures):
    return f"""## What the paper claims, and what we measured

Reading A takes the paper's sections 3.1 and 3.2: all vertices on the centre line, the normals of
the edges at the two potential nearest points, the lines to the nearest points. Reading B takes the
steps of section 4 to the letter: four vertices on the centre line, the normals of the two edges it
crosses.

![Time relative to the traditional method, and wrong answers on near pairs](claims.png)

{_shorter(figures)}

{_accuracy(figures)}

**"Only four potential separating axes … no overlap, collide otherwise"** (sections 3.1, 4). This
is the step that is wrong. Near pairs by the step that calls them clear; what no step calls clear
is called a collision:

{_steps(figures)}

{_causes(figures)}

![A false collision of reading A and a missed collision of reading B, drawn](examples.png)

*Left, of all near pairs with n = {DRAWN_SIDES} that reading A calls colliding, the one furthest
apart. Right, of those that reading B misses, the one that overlaps most: the four vertices end
before those of the other body begin, other vertices reach further.*"""


def _shorter(figures):
    sides = lookup.shapes(figures)
    lines, slower = [], {}
    for method in ('boxed', 'published_a', 'published_b', 'improved'):
        ratios = {n: lookup.time(figures, n, method) / lookup.time(figures, n, 'traditional')
                  for n in sides}
        lines.append([LABELS[method], *map(ratio, ratios.values())])
        slower[method] = [n for n, value in ratios.items() if value >= 1]
    centres = {row['n']: row['ns'] for row in figures['preparation']
               if row['what'].startswith('centre of gravity')}
    lines.append(['published A, centres included', *(ratio(
        (lookup.time(figures, n, 'published_a') + 2 * centres[n])
        / lookup.time(figures, n, 'traditional')) for n in sides)])
    exceptions = [f'{LABELS[m]} for n = {listed(map(str, of))}' for m, of in slower.items() if of]
    verdict = ('holds for every n here' if not any(slower[m] for m in slower if m != 'boxed')
               else 'does not hold everywhere')
    notes = (f' Not faster than the traditional method: {"; ".join(exceptions)}.' if exceptions
             else '')
    return f"""**"Shorten the average time"** (section 6) {verdict}, on the mix and with
centres of gravity made in advance.{notes} Time relative to the traditional method; the last line
adds two centres of gravity for each pair (section 5: "mainly takes the time" for these):

{table(["", *(f"n = {n}" for n in sides)], lines)}"""


def _accuracy(figures):
    rates = {}
    for method, what, whole in (('published_a', 'false_collisions', 'apart'),
                                ('published_b', 'false_collisions', 'apart'),
                                ('published_b', 'false_clears', 'meet'),
                                ('published_a', 'false_clears', 'meet')):
        rates[method, what] = [row[what] / row[whole] for row in figures['steps']
                               if row['method'] == method]
    wrong = sum(row['traditional_wrong'] for row in figures['steps']
                if row['method'] == 'published_a')
    pairs = sum(row['apart'] + row['meet'] for row in figures['steps']
                if row['method'] == 'published_a')
    verdict = 'is false' if max(map(max, rates.values())) > wrong / pairs else 'holds here'
    cause = '' if wrong else ', so rounding is not the cause'
    sides = [row['n'] for row in figures['steps'] if row['method'] == 'published_a']
    return f"""**"Improve the accuracy"** (section 6) {verdict}. The traditional method is wrong
on {wrong} of the same {pairs:,} near pairs{cause}. From n = {sides[0]} to n = {sides[-1]},
reading A calls {spread(rates["published_a", "false_collisions"], share)} of the pairs apart
colliding and misses {spread(rates["published_a", "false_clears"], share)} of those in contact;
reading B calls {spread(rates["published_b", "false_collisions"], share)} of those apart colliding
and misses {spread(rates["published_b", "false_clears"], share)} of those in contact."""


def _steps(figures):
    lines = []
    sides = [row['n'] for row in figures['steps'] if row['method'] == 'published_a']
    for method in ('published_a', 'published_b'):
        rows = [row for row in figures['steps'] if row['method'] == method]
        for k, step in enumerate(rows[0]['steps']):
            lines.append([f'{LABELS[method]}: {step["step"]}', *(_right_and_wrong(
                row['steps'][k]['clears'], row['apart'],
                row['steps'][k]['false_clears'], row['meet']) for row in rows)])
        lines.append([f'{LABELS[method]}: no step, false "collision"',
                      *(share(row['false_collisions'], row['apart']) for row in rows)])
    return (table(['', *(f'n = {n}' for n in sides)], lines)
            + '\n\nIn shares of the pairs apart; after a slash, wrongly, in shares of those in '
              'contact.')


def _right_and_wrong(right, apart, wrong, meet):
    text = share(right, apart)
    return f'{text} / {share(wrong, meet)}' if wrong else text


def _causes(figures):
    sentences = ['So the false collisions come from the conclusion "collide otherwise": the '
                 'separating axis may be the normal of an edge that was not tried.']
    misses = {}
    for row in figures['steps']:
        for step in row['steps']:
            key = row['method'], step['step']
            misses[key] = misses.get(key, 0) + step['false_clears']
    causes = [(key, count) for key, count in misses.items() if count]
    total = sum(misses.values())
    for (method, step), count in causes:
        sentences.append(f'{count:,} of all {total:,} misses come from {LABELS[method]}, step '
                         f'"{step}".')
    if any(step == 'centre line, four vertices' for (_, step), _ in causes):
        sentences.append('There a vertex other than the four may reach further along the centre '
                         'line than they do.')
    lines = sum(step['clears'] for row in figures['steps'] for step in row['steps']
                if step['step'] == 'lines to the nearest points')
    apart = sum(row['apart'] for row in figures['steps'] if row['method'] == 'published_a')
    sentences.append(f'The lines to the nearest points, central to the paper, separate {lines:,} '
                     f'of the {apart:,} near pairs apart where the steps before do not: a line '
                     f'that ends inside an edge is the normal of that edge, tried before.')
    return ' '.join(sentences)


def axes(figures):
    sides = lookup.shapes(figures)
    lines = []
    for method in ('traditional', 'boxed', 'published_a', 'published_b', 'improved'):
        values = [lookup.axes(figures, n, method) for n in sides]
        lines.append([LABELS[method], *(f'{value:.1f}' for value in values)])
    hard = [lookup.axes(figures, n, 'improved', ('hard',)) for n in sides]
    lines.append(['improved, hard pairs', *(f'{value:.1f}' for value in hard)])
    improved = [lookup.axes(figures, n, 'improved') for n in sides]
    traditional = [lookup.axes(figures, n, 'traditional') for n in sides]
    return f"""## Axes tested

![Mean number of axes a decision by number of vertices](axes.png)

Mean number of axes a decision, on the mix unless said otherwise. The traditional method tries
{spread(traditional, lambda x: f"{x:.1f}")}, the improved one
{spread(improved, lambda x: f"{x:.1f}")}. A bounding box counts as two axes, where one is tested.
An axis is not the same work everywhere: the traditional method projects all vertices on it, the
improved one asks each body for one support vertex, which costs up to {SCAN_LIMIT} projections on
bodies of up to {SCAN_LIMIT} vertices and a look-up with a few steps on larger ones. Exact
orientation tests, where the axes left a pair undecided, are not counted.
{_without_axis(figures)}

{table(["", *(f"n = {n}" for n in sides)], lines)}"""


def _without_axis(figures):
    parts = []
    for kind in ('clear', 'near', 'deep', 'hard'):
        rows = [row for row in figures['speed']['compiled']
                if row['kind'] == kind and row['method'] == 'improved']
        part = sum(row['without_axis'] for row in rows), sum(row['pairs'] for row in rows)
        parts.append(f'{share(*part)} of the {kind} ones')
    return f'The improved method decides {listed(parts)} without an axis besides the boxes.'

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

"""The report: its summary, how it was measured, and the sections of the other modules."""

import lookup
from methods import LABELS
import page_errors
import page_paper
import page_speed
from words import (
    compared, compared_ends, counted, duration, listed, metres, none_wrong, share, table, wrapped)


def text(figures):
    """Return the page in Markdown."""
    sections = [_head(figures), _summary(figures), _measured(figures),
                page_speed.speed_against_error(figures), page_speed.rectangles(figures),
                page_speed.plain(figures), page_speed.around(figures),
                page_paper.claims(figures), page_paper.axes(figures),
                page_errors.families(figures), page_errors.growth(figures),
                page_errors.float32(figures), page_errors.bounds(figures),
                page_errors.separation(figures), page_errors.accuracy(figures)]
    return wrapped('\n\n'.join(sections)) + '\n'


def _head(figures):
    return f"""# Speed against error

The traditional separating axis method, both readings of the published shortcut (Liang and Liu),
the improved method of this package and two rivals: what an answer costs, how often it is wrong,
and why. `make report` measures everything again and writes this page, sentences included, from
[`figures.json`](figures.json); `make accuracy` makes the long run shown last. Seed
{figures["seed"]}."""


def _summary(figures):
    sides = lookup.shapes(figures)
    first, last = sides[0], sides[-1]
    times = {m: {n: lookup.time(figures, n, m) for n in sides}
             for m in ('improved', 'traditional', 'published_a', 'published_b', 'shapely')}
    rows = figures['speed']['compiled']
    wrong = {m: lookup.wrong([r for r in rows if r['method'] == m]) for m in LABELS}
    asked = {m: sum(r['pairs'] for r in rows if r['method'] == m) for m in LABELS}
    lines = [
        f'**Improved is right**: {wrong["improved"]} wrong of {asked["improved"]:,} answers '
        f'here{_long_run(figures)}.' if wrong['improved'] == 0 else
        f'**Improved is WRONG** in {counted(wrong["improved"], asked["improved"])} answers.',
        f'**Its speed**: {duration(times["improved"][first])} a pair for n = {first}, '
        f'{duration(times["improved"][last])} for n = {last}. That is '
        f'{compared_ends(first, last, times["improved"], times["traditional"])} the traditional '
        f'method, and {compared_ends(first, last, times["improved"], times["shapely"])} shapely.',
        _published(figures, times), _rounding(figures),
        '**The rivals**: ' + listed(
            f'{LABELS[m]} was wrong in {counted(wrong[m], asked[m])}'
            for m in ('shapely', 'pymunk') if asked[m]) + '.']
    return '## Summary\n\n' + '\n'.join(f'- {line}' for line in lines)


def _published(figures, times):
    step = {(r['method'], r['n']): r for r in figures['steps']}
    n = max(r['n'] for r in figures['steps'] if r['n'] <= 64)
    a, b = step['published_a', n], step['published_b', n]
    return (f'**The published shortcut**, among near pairs with n = {n}: reading A calls '
            f'{share(a["false_collisions"], a["apart"])} of those apart colliding, reading B '
            f'misses {share(b["false_clears"], b["meet"])} of those in contact. The improved '
            f'method is {compared(times["improved"][n], times["published_a"][n])} reading A and '
            f'{compared(times["improved"][n], times["published_b"][n])} reading B there.')


def _rounding(figures):
    rows = [r for r in figures['speed']['compiled'] if r['method'] == 'traditional']
    hard = [r for r in rows if r['kind'] == 'hard']
    other = [r for r in rows if r['kind'] != 'hard']
    return (f'**The traditional method and rounding**: in float64 it is wrong in '
            f'{counted(lookup.wrong(hard), sum(r["pairs"] for r in hard))} hard pairs and in '
            f'{counted(lookup.wrong(other), sum(r["pairs"] for r in other))} others. What it '
            f'misjudges grows with the distance from the origin, to gaps of '
            f'{metres(_widest(figures, "traditional"))} at the furthest measured.')


def _long_run(figures):
    if not figures['accuracy']:
        return ''
    total = figures['accuracy']['families']['all']
    text = f', {total["wrong"]} of {total["pairs"]:,} in the [long run](#the-long-run)'
    return text if total['wrong'] else f'{text}: a rate {none_wrong(total["pairs"])}'


def _widest(figures, method):
    return max((r['widest'] for r in figures['by_offset'] if r['method'] == method), default=0.0)


def _measured(figures):
    facts = figures['machine']
    rows = figures['speed']['compiled']
    counts = {n: next(r['pairs'] for r in rows if r['shape'] == n) for n in lookup.shapes(figures)}
    versions = ', '.join(f'{name} {facts[name]}' for name in facts
                         if name not in ('processor', 'cores', 'system', 'kernel'))
    return f"""## How it was measured

{facts["processor"]}, {facts["cores"]} cores, {facts["system"]}; {versions}. One thread.

- **Bodies** have n vertices each, on ellipses of half axes 1 m and 0.1 to 1 m, the angles between
  vertices uneven. The rates of the published methods depend on this: bodies of another shape would
  change them, not their cause.
- **Pairs** are of four kinds. *Clear*: 0.2 to 4 m apart. *Near*: within 0.1 m of touching, half of
  them apart. *Deep*: overlapping, their distance at most 0.9 of that where they touch. *Hard*: in
  equal shares gaps of 10⁻¹⁷ to 10⁻⁹, distances to 10⁸ m from the origin, slivers, lattice contacts
  of three kinds, one ulp beside contact, flat arcs and float32 round trips; half apart. So half of
  all pairs are apart, and so are half of the *mix*, equal shares of clear, near and deep.
- **The truth** is exact: integer arithmetic over edge crossings and vertex containment
  (`test/oracle.py`), which shares nothing with the separating axis theorem.
- **Times** are medians of seven runs over all pairs of a kind, the methods taking turns in one
  process, so every pair is another one to the caches and the branch predictor; `figures.json` has
  the quartiles. What a body needs once (boxes, centres of gravity, packed records, the rivals'
  shapes) is made before; [its cost](#before-and-around-a-decision) is below. Our methods and
  shapely decide all pairs in one compiled call; shapely's bodies are not "prepared", since each is
  met once. pymunk is asked from Python, pair by pair, through Chipmunk's `cpShapesCollide`, so its
  time holds a Python call each.

{table(["n", *counts], [["pairs of each kind", *(f"{count:,}" for count in counts.values())]])}"""

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

"""The appendix: the long tables."""

import lookup
from methods import LABELS, LIBRARIES, METHODS
from samples import FEWEST_TIMED
from words import (
    counted, distance, duration, durations, listed, metres, none_wrong, share, table, wrapped)

# One small and one large n that the page does not show.
_KIND_SIDES = 8, 256


def text(figures):
    """Return the appendix in Markdown."""
    sections = ['# Speed against error: tables\n\nTo the [report](README.md).',
                _times(figures), _wrong(figures), _plain(figures), _around(figures),
                _steps(figures), _families(figures), _offsets(figures), _float32(figures),
                _separation(figures), _long_run(figures)]
    return wrapped('\n\n'.join(sections)) + '\n'


def _times(figures):
    sides = lookup.sides(figures)
    mix = [[LABELS[m], *(duration(lookup.ns(figures, n, m)) for n in sides)]
           for m in lookup.timed(figures)]
    columns = [(n, kind) for n in _KIND_SIDES for kind in ('clear', 'near', 'deep', 'hard')]
    kinds = [[LABELS[m], *(_quartiles(lookup.row(figures, n, kind, m)) for n, kind in columns)]
             for m in lookup.timed(figures)]
    parts = []
    for kind in ('clear', 'near', 'deep', 'hard'):
        of = lookup.rows(figures, 'improved', kind)
        parts.append(f'{share(sum(r["exact"] for r in of), sum(r["pairs"] for r in of))} of the '
                     f'{kind} ones')
    return f"""## Times

Median time a pair, mix of clear, near and deep:

{table(["", *(f"n = {n}" for n in sides)], mix)}

By kind of pair, with the quartiles of all runs:

{table(["", *(f"n = {n}, {kind}" for n, kind in columns)], kinds)}

Improved left {listed(parts)} to its exact stage."""


def _quartiles(row):
    return durations(*row['ns'][:3])


def _wrong(figures):
    sides = lookup.sides(figures)
    lines = []
    for method in lookup.methods(figures):
        rows = [lookup.row(figures, n, 'hard', method) for n in sides]
        if lookup.wrong(rows):
            lines.append([LABELS[method], *(' / '.join(
                share(*lookup.parts(row, what)) for what in ('false_collisions', 'false_clears'))
                for row in rows)])
    easy = []
    for kind in ('clear', 'deep'):
        for method in lookup.methods(figures):
            of = lookup.rows(figures, method, kind)
            if lookup.wrong(of):
                easy.append(f'{LABELS[method]} in '
                            f'{counted(lookup.wrong(of), sum(r["pairs"] for r in of))} {kind} '
                            f'pairs')
    return f"""## Wrong answers on hard pairs

False "collision" of those apart / false "clear" of those in contact, of the methods that are
wrong at all:

{table(["", *(f"n = {n}" for n in sides)], lines)}

On clear and deep pairs {f"these were wrong: {listed(easy)}" if easy else "none was wrong"}."""


def _plain(figures):
    rows = figures['speed']['plain']
    sides = list(dict.fromkeys(row['shape'] for row in rows))
    columns = [(n, kind) for n in sides for kind in ('near', 'hard')]
    lines = [[LABELS[m], *(duration(lookup.ns(figures, n, m, 'plain', (kind,)))
                           for n, kind in columns)]
             for m in METHODS if any(row['method'] == m for row in rows)]
    kernels = figures['speed']['kernels']
    agree = ('the same in both' if kernels['different'] == 0
             else f'different in {kernels["different"]} cases')
    pairs = {n: next(row['pairs'] for row in rows if row['shape'] == n) for n in sides}
    return f"""## Without numba

The same source as plain Python, on {listed(f"{count} pairs for n = {n}" for n, count in
                                            pairs.items())} of each kind. All
{kernels["compared"]:,} answers given in both kernels, by all methods, were {agree}. (float32 is
not measured here: Python's floats are doubles.)

{table(["", *(f"n = {n}, {kind}" for n, kind in columns)], lines)}"""


def _around(figures):
    rows = figures['preparation']
    sides = list(dict.fromkeys(row['n'] for row in rows))
    names = dict.fromkeys((row['stage'], row['what']) for row in rows)
    what = {'body': 'making', 'call': 'asking'}
    lines = [[f'{what[stage]}: {name}', *(duration(next(
        r['ns'] for r in rows if (r['n'], r['what'], r['stage']) == (n, name, stage)))
        for n in sides)] for stage, name in names]
    return f"""## Before and around a decision

Making a body from its vertices, once, from Python; and asking for one near pair from Python, the
call included. `Polygon` checks exactly that the polygon is simple, cleans it and finds convex
parts; the {listed(LABELS[m] for m in LIBRARIES)} shapes are made without such a check.

{table(["", *(f"n = {n}" for n in sides)], lines)}"""


def _steps(figures):
    lines = []
    sides = list(dict.fromkeys(row['n'] for row in figures['steps']))
    for method in ('published_a', 'published_b'):
        rows = [row for row in figures['steps'] if row['method'] == method]
        for k, step in enumerate(rows[0]['steps']):
            lines.append([f'{LABELS[method]}: {step["step"]}', *(_right_and_wrong(
                row['steps'][k]['clears'], row['apart'],
                row['steps'][k]['false_clears'], row['meet']) for row in rows)])
    return f"""## The published readings, step by step

Near pairs by the step that calls them clear, in shares of those apart; after a slash, wrongly, in
shares of those in contact. What no step calls clear is called a collision.

{table(["", *(f"n = {n}" for n in sides)], lines)}"""


def _right_and_wrong(right, apart, wrong, meet):
    text = share(right, apart)
    return f'{text} / {share(wrong, meet)}' if wrong else text


def _families(figures):
    rows = figures['families']
    methods = [m for m in METHODS if any(row['method'] == m for row in rows)]
    lines = []
    for name in dict.fromkeys(row['family'] for row in rows):
        of = {row['method']: row for row in rows if row['family'] == name}
        lines.append([name.replace('_', ' '), f'{of["improved"]["pairs"]:,}', *(
            f'{of[m]["false_collisions"]:,} / {of[m]["false_clears"]:,}' if m in of
            and lookup.wrong([of[m]]) else '0' if m in of else '' for m in methods)])
    right = [LABELS[m] for m in methods
             if not lookup.wrong([row for row in rows if row['method'] == m])]
    return f"""## Wrong answers by family

Each family of `test/support/families.py` is a generator of cases on which collision tests go
wrong: false "collision" / false "clear"; empty is where a method does not apply. Merged axes are
for rectangles, and only two of the methods take bodies that are not convex, the last two families.
Right on all: {listed(right) if right else "none"}.

{table(["family", "pairs", *(LABELS[m] for m in methods)], lines)}"""


def _offsets(figures):
    lines = []
    for offset in sorted({row['offset'] for row in figures['by_offset']}):
        of = [row for row in figures['by_offset'] if row['offset'] == offset]
        lines.append([distance(offset), *(lookup.rate_of(row) for row in of)])
    last = figures['by_offset'][-1]['offset']
    methods = [LABELS[row['method']] for row in figures['by_offset'] if row['offset'] == last]
    return f"""## Wrong answers by distance from the origin

Pairs with gaps and overlaps of 10⁻¹⁶ to 1 m, the exponent uniform, moved away from the origin and
rounded there; the truth is that of the rounded coordinates.

{table(["", *methods], lines)}"""


def _float32(figures):
    rows, warning = figures['float32'], figures['warning']
    lines = [[distance(row['distance']), metres(row['step']), f'{row["pairs"]:,}',
              f'{row["changed"]:,}', metres(row['widest']) if row['widest'] else '–',
              f'{row["refused"]:,}'] for row in rows]
    head = 'distance from the origin', 'step', 'pairs', 'answer changed', 'widest', 'refused'
    worst = max(row['widest'] / row['step'] for row in rows)
    return f"""## What float32 messages do

ROS polygons carry float32. The node's answers are exact for the coordinates received, and these
are what is left after rounding. Pairs with gaps and overlaps of 10⁻⁵ to 1 m, sent as float32: in
how many the exact answer is another one, and the widest gap or overlap lost in this way. It was up
to {worst:.2g} steps; two vertices each moved by at most 0.71 steps can close 1.41. *Refused*:
rounding made the outline cross or touch itself, which the monitor reports.

{table(head, lines)}

What the monitor says: where the step exceeds the parameter `resolution`,
{metres(warning["resolution"])} by default, that is from {distance(warning["from"])} from the
origin on, a clear footprint has level {("OK", "WARN", "ERROR", "STALE")[warning["level"]]} in
`~/state`, with these words:

> {warning["message"]}"""


def _separation(figures):
    rows = figures['separations']
    worst = max(row['worst_ulp'] for row in rows)
    signs = sum(row['wrong_signs'] for row in rows)
    pairs = sum(row['pairs'] for row in rows)
    lines = [[row['family'].replace('_', ' '), row['pairs'], f'{row["worst_ulp"]:.2g}',
              row['wrong_signs']] for row in rows]
    return f"""## Accuracy of the separation

`separation` against rational arithmetic: the worst error is {worst:.2g} ulp of the largest
coordinate, and the sign disagrees with the exact answer in {counted(signs, pairs)} pairs.

{table(["family", "pairs", "worst error, ulp of the largest coordinate", "wrong signs"], lines)}"""


def _long_run(figures):
    run = figures['accuracy']
    if not run:
        return """## The long run

Not made yet: `make accuracy`."""
    total = run['families']['all']
    head = 'family', 'pairs', 'in contact', 'wrong', 'exact stage', 'without it', 'with it'
    lines = []
    for name, of in run['families'].items():
        exact = of['exact']
        lines.append([name.replace('_', ' '), f'{of["pairs"]:,}', share(of['meet'], of['pairs']),
                      of['wrong'], share(exact, of['pairs']),
                      _each(of['seconds'], of['pairs'] - exact),
                      _each(of['exact_seconds'], exact)])
    verdict = (f'No answer was wrong: a rate {none_wrong(total["pairs"])}.' if not total['wrong']
               else f'{total["wrong"]} answers were WRONG.')
    return f"""## The long run

`make accuracy`, seed {run["seed"]}: {total["pairs"]:,} pairs of all families, decided as the node
decides them and compared with the exact oracle. {verdict} The oracle itself left
{counted(total["oracle_in_integers"], total["pairs"])} to integer arithmetic, and
{total["oracle_checked"]:,} of its answers proved in floating point were decided again in integers.
The exact stage was needed for {share(total["exact"], total["pairs"])} of these pairs, chosen to
need it. ({run["machine"]["processor"]}, {run["machine"]["kernel"]}, {run["seconds"] / 60:.0f}
min.)

{table(head, lines)}"""


def _each(seconds, pairs):
    """Return the time a pair, unless there are too few to tell."""
    return duration(seconds * 1e9 / pairs) if pairs >= FEWEST_TIMED else '–'

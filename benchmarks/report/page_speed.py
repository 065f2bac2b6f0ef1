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

"""The sections on speed."""

import lookup
from methods import LABELS, RIVALS, STYLES
from words import compared, counted, duration, listed, ratio, share, spread, table

_KIND_SIDES = 8, 64


def speed_against_error(figures):
    sides = lookup.shapes(figures)
    rows = figures['speed']['compiled']
    times = [[LABELS[m], *(duration(lookup.time(figures, n, m)) for n in sides)]
             for m in _measured(figures)]
    ratios = [[LABELS[m], *(' / '.join(ratio(_ratio(figures, n, m, other))
                                       for other in ('traditional', 'shapely')) for n in sides)]
              for m in _measured(figures)]
    wrong = {m: [r for r in rows if r['method'] == m] for m in _measured(figures)}
    always = [LABELS[m] for m, of in wrong.items() if not lookup.wrong(of)]
    fastest = {n: min(_measured(figures), key=lambda m: lookup.time(figures, n, m))
               for n in sides}
    return f"""## Speed against error

![Wrong answers against time a pair, for clear, near, deep and hard pairs](speed_error.png)

*A point a method and n, from {sides[0]} to {sides[-1]} vertices; left and low is good. The points
in the green band are without a wrong answer, a lane a method in the order of the legend.*

Without a wrong answer on any of {sum(r["pairs"] for r in wrong["improved"]):,} pairs:
{listed(always)}. The fastest on the mix: {_fastest(fastest)}.

Median time a pair, mix of clear, near and deep, compiled:

{table(["", *(f"n = {n}" for n in sides)], times)}

The same as a ratio to the traditional method / to shapely; below 1 is faster:

{table(["", *(f"n = {n}" for n in sides)], ratios)}

By kind of pair, for n = {_KIND_SIDES[0]} and for n = {_KIND_SIDES[1]}:

{_by_kind(figures)}

Wrong answers on near pairs, false "collision" of those apart / false "clear" of those in contact:

{_rates(figures, "near", sides)}

And on hard pairs:

{_rates(figures, "hard", sides)}

{_easy(figures)} {_exact_stage(figures)}"""


def _by_kind(figures):
    columns = [(n, kind) for n in _KIND_SIDES for kind in ('clear', 'near', 'deep', 'hard')]
    return table(['', *(f'n = {n}, {kind}' for n, kind in columns)], [
        [LABELS[m], *(duration(lookup.row(figures, n, kind, m)['ns'][0]) for n, kind in columns)]
        for m in _measured(figures)])


def _measured(figures):
    return [m for m in STYLES if any(r['method'] == m and r['shape'] != 'rectangles'
                                     for r in figures['speed']['compiled'])]


def _ratio(figures, n, method, other):
    times = lookup.time(figures, n, method), lookup.time(figures, n, other)
    return None if None in times else times[0] / times[1]


def _fastest(fastest):
    groups = {}
    for n, method in fastest.items():
        groups.setdefault(method, []).append(str(n))
    return '; '.join(f'{LABELS[method]} for n = {listed(sides)}'
                     for method, sides in groups.items())


def _rates(figures, kind, sides):
    lines = []
    for method in _measured(figures):
        rows = [lookup.row(figures, n, kind, method) for n in sides]
        lines.append([LABELS[method], *(' / '.join(
            share(lookup.rate(row, what)) for what in ('false_collisions', 'false_clears'))
            for row in rows)])
    return table(['', *(f'n = {n}' for n in sides)], lines)


def _easy(figures):
    rows = figures['speed']['compiled']
    found = []
    for kind in ('clear', 'deep'):
        for method in STYLES:
            of = [r for r in rows if r['kind'] == kind and r['method'] == method]
            if of and lookup.wrong(of):
                found.append(f'{LABELS[method]} in '
                             f'{counted(lookup.wrong(of), sum(r["pairs"] for r in of))} '
                             f'{kind} pairs')
    if not found:
        return 'On clear and deep pairs no method was wrong.'
    return f'On clear and deep pairs these were wrong: {listed(found)}; no other method was.'


def _exact_stage(figures):
    parts = []
    for kind in ('clear', 'near', 'deep', 'hard'):
        of = [r for r in figures['speed']['compiled']
              if r['kind'] == kind and r['method'] == 'improved']
        parts.append(f'{share(sum(r["exact_stage"] for r in of), sum(r["pairs"] for r in of))} '
                     f'of the {kind} ones')
    return f'The improved method left {listed(parts)} to its exact stage.'


def rectangles(figures):
    lines = []
    for method in STYLES:
        rows = [lookup.row(figures, 'rectangles', kind, method) for kind in ('near', 'hard')]
        if None in rows:
            continue
        time = lookup.time(figures, 'rectangles', method)
        lines.append([LABELS[method], duration(time),
                      ratio(time / lookup.time(figures, 'rectangles', 'traditional')),
                      *(' / '.join(share(lookup.rate(row, what)) for what in (
                          'false_collisions', 'false_clears')) for row in rows)])
    merged, whole = (lookup.time(figures, 'rectangles', m) for m in ('rectangles', 'traditional'))
    improved = lookup.time(figures, 'rectangles', 'improved')
    return f"""### Rectangles with merged axes

Of turned rectangles two axes each will do (section 2.3 of the paper). That is
{compared(merged, whole)} the traditional method; improved, which does not know that they are
rectangles, is {compared(improved, merged)} it. The hard pairs here share an edge, but for
rounding.

{table(["", "time, mix", "to traditional", "wrong, near", "wrong, hard"], lines)}"""


def plain(figures):
    sides = lookup.shapes(figures)
    methods = [m for m in STYLES if m not in RIVALS
               and lookup.time(figures, sides[0], m, 'plain') is not None]
    lines = [[LABELS[m], *(duration(lookup.time(figures, n, m, 'plain')) for n in sides)]
             for m in methods]
    slower = [lookup.time(figures, n, 'improved', 'plain') / lookup.time(figures, n, 'improved')
              for n in sides]
    kernels = figures['speed']['kernels']
    agree = ('the same in both kernels' if kernels['different'] == 0
             else f'different between the kernels in {kernels["different"]} cases')
    return f"""### Without numba

The same source as plain Python, fewer of the same pairs: improved takes {spread(slower, ratio)}
times as long as compiled. All {kernels["compared"]:,} answers given in both were
{agree}. (float32 is not measured here: Python's floats are doubles. From n = 256 on each time
is of one run.)

![Median time a pair by number of vertices, compiled and plain](time.png)

{table(["", *(f"n = {n}" for n in sides)], lines)}"""


def around(figures):
    rows = figures['preparation']
    sides = list(dict.fromkeys(row['n'] for row in rows))

    def lines(stage):
        names = dict.fromkeys(row['what'] for row in rows if row['stage'] == stage)
        return [[name, *(duration(next(r['ns'] for r in rows if r['n'] == n and r['what'] == name
                                       and r['stage'] == stage)) for n in sides)]
                for name in names]

    head = [f'n = {n}' for n in sides]
    return f"""### Before and around a decision

Making a body from its vertices, once, from Python; centres of gravity in a compiled loop.
`Polygon` checks exactly that the polygon is simple, cleans it and finds convex parts; shapely and
pymunk check no such thing here.

{table(["", *head], lines("body"))}

Asking for one near pair from Python, the call included:

{table(["", *head], lines("call"))}"""

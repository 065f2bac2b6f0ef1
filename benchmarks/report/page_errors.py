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

"""The sections on stability: families, growth of errors, float32, bounds, the long run."""

import lookup
from methods import LABELS, STYLES
from sat_collision.geometry.predicates import ORIENTATION_BOUND
from sat_collision.geometry.separating_axis import PRODUCT_BOUND, SUPPORT_BOUND
from words import counted, distance, duration, listed, metres, none_wrong, share, table

U = 2.0 ** -53
U_FLOAT32 = 2.0 ** -24


def families(figures):
    rows = figures['families']
    methods = [m for m in STYLES if any(row['method'] == m for row in rows)]
    lines = []
    for name in dict.fromkeys(row['family'] for row in rows):
        of = {row['method']: row for row in rows if row['family'] == name}
        any_row = of['improved']
        lines.append([name.replace('_', ' '), f'{any_row["pairs"]:,}', *(
            f'{of[m]["false_collisions"]:,} / {of[m]["false_clears"]:,}' if m in of else ''
            for m in methods)])
    totals = {m: (lookup.wrong([r for r in rows if r['method'] == m]),
                  sum(r['pairs'] for r in rows if r['method'] == m)) for m in methods}
    right = [LABELS[m] for m, (wrong, _) in totals.items() if not wrong]
    return f"""## Stability: wrong answers by family

![Share of wrong answers by family and method](families.png)

Each family of `test/families.py` is a generator of cases on which collision tests go wrong. The
table counts false "collision" / false "clear"; empty is where a method does not apply: merged axes
are for rectangles, and only two of the methods take bodies that are not convex, the last two
families. Right on all: {listed(right) if right else "none"}. For float32 the coordinates are
rounded first, so it is also wrong where that changes the bodies.

{table(["family", "pairs", *(LABELS[m] for m in methods)], lines)}"""


def growth(figures):
    rows = [row for row in figures['by_offset'] if row['offset'] >= 1]
    bounds = {'traditional': 4 * U, 'traditional_float32': 6 * U_FLOAT32}
    kept = {m: max(row['widest'] / (bound * (row['offset'] + 4)) for row in rows
                   if row['method'] == m) for m, bound in bounds.items()}
    last = max(row['offset'] for row in rows)
    at_last = [f'{LABELS[row["method"]]} {metres(row["widest"]) if row["widest"] else "nothing"}'
               for row in rows if row['offset'] == last]
    lines = []
    for offset in sorted({row['offset'] for row in figures['by_offset']}):
        of = [row for row in figures['by_offset'] if row['offset'] == offset]
        lines.append([distance(offset), *(f'{share(lookup.wrong([row]), row["pairs"])}'
                                          for row in of)])
    methods = [LABELS[row['method']] for row in figures['by_offset']
               if row['offset'] == last]
    sides = [row['n'] for row in figures['by_sides'] if row['method'] == 'traditional']
    shares = [lookup.wrong([row]) / row['pairs'] for row in figures['by_sides']
              if row['method'] == 'traditional']
    return f"""## How errors grow

![Widest gap misjudged by distance, and wrong answers by number of vertices](growth.png)

Pairs with gaps and overlaps of 10⁻¹⁶ to 1 m, the exponent uniform, moved away from the origin and
rounded there; the truth is that of the rounded coordinates. With D the distance from the origin
and u = 2⁻⁵³ (2⁻²⁴ in float32), a projection x uₓ + y u_y on an axis of length L errs by at most 2
u D L (two products, one sum, Cauchy–Schwarz; first order in u), so a gap, the difference of two,
by 4 u D. Rounding the coordinates to float32 moves each by up to u D more: 6 u D. The widest gap
misjudged was {share(kept["traditional"])} of this bound in float64 and
{share(kept["traditional_float32"])} in float32{_bound_kept(kept)}. At {distance(last)} the widest
misjudged were: {listed(at_last)}.

Share of wrong answers by distance from the origin:

{table(["", *methods], lines)}

By number of vertices, {distance(figures["sides_offset"])} from the origin, the traditional method
is wrong in {share(min(shares))} to {share(max(shares))} of these pairs:
{_by_sides(sides, shares)}."""


def _bound_kept(kept):
    return (', so it explains what was seen' if max(kept.values()) <= 1
            else '; more than 100 %, so there is another cause')


def _by_sides(sides, shares):
    first, last = shares[0], shares[-1]
    if max(shares) < 2 * max(min(shares), 1e-9):
        return (f'from n = {sides[0]} to n = {sides[-1]} it changes by less than a factor of two, '
                f'while D enters in proportion')
    return (f'{share(first)} for n = {sides[0]}, {share(last)} for n = {sides[-1]}')


def float32(figures):
    rows, warning = figures['float32'], figures['warning']
    lines = [[distance(row['distance']), metres(row['step']), f'{row["pairs"]:,}',
              f'{row["changed"]:,}', metres(row['widest']) if row['widest'] else '–',
              f'{row["refused"]:,}'] for row in rows]
    head = 'distance from the origin', 'step', 'pairs', 'answer changed', 'widest', 'refused'
    ten = next(row for row in rows if row['distance'] == 1e4)
    worst = max(row['widest'] / row['step'] for row in rows)
    return f"""## What float32 messages do

ROS polygons carry float32. The node's answers are exact for the coordinates received, and these
are what is left after rounding: at 10 km in steps of {metres(ten["step"])}. Pairs with gaps and
overlaps of 10⁻⁵ to 1 m, sent as float32: in how many the exact answer is another one, and the
widest gap or overlap lost in this way. It was up to {worst:.2g} steps; two vertices each moved by
at most 0.71 steps can close 1.41. *Refused*: rounding made the outline cross or touch itself,
which the monitor reports.

![Step of float32, and the widest gap it hid, by distance from the origin](float32.png)

{table(head, lines)}

What the monitor says: where the step exceeds the parameter `resolution`,
{metres(warning["resolution"])} by default, that is from {distance(warning["from"])} from the
origin on, a clear footprint has level {("OK", "WARN", "ERROR", "STALE")[warning["level"]]} in
`~/state`, with these words:

> {warning["message"]}"""


def bounds(figures):
    return f"""## Error bounds of the improved method

With u = 2⁻⁵³. No tolerance decides an answer: below its bound a floating-point value decides
nothing, and exact arithmetic does.

{_bound_table()}

Comparisons are strict, so that an overflow or a NaN proves nothing. Where the search is not sure,
two convex bodies are apart just when some edge of one has all of the other strictly outside it,
each test by the exact sign of `orient`: error-free differences and products where they suffice
(Dekker 1971), else the six products of the determinant in a fixed-point accumulator over the whole
exponent range (Kulisch). The derivations stand in `sat_collision/predicates.py` and
`sat_collision/improved.py`."""


def _bound_table():
    lines = [
        ('sign of `orient(a, b, c)`', f'{ORIENTATION_BOUND / U:.4g} u (|l| + |r|), l and r the '
         'two products', 'Shewchuk 1997, bound A: differences, products and their difference'),
        ('turn between two vectors of the search; rise along an edge',
         f'{PRODUCT_BOUND / U:g} u (|l| + |r|)',
         'twice 4 u + O(u²), the bound of a sum of two products of rounded differences'),
        ('an axis (uₓ, u_y) separates', f'the same + {SUPPORT_BOUND / U:g} u M, '
         'M = |uₓ| max|x| + |u_y| max|y|', 'the vertex found may fall short of the true support '
         'vertex: by 4 u M where all are projected, by 24 u M where the boundary is climbed '
         '(edges whose rise rounding hid, inside a box); of two bodies 48 u M'),
        ('each of these', '+ 2⁻¹⁰⁶⁰, the last + 2⁻¹⁰⁴⁰',
         'products that underflow lose at most 2⁻¹⁰⁷⁵ each'),
        ('overlap of discs inside both bodies', 'their radii, each shortened by 2⁻⁴⁵ of itself '
         'and of the sides of the bounding box', 'the distance of an edge errs by 4 u of the '
         'sides and some 3 u of itself, the comparison by a few u; 2⁻⁴⁵ is 256 u')]
    head = 'what is decided', 'accepted when it exceeds', 'why'
    return '\n'.join('| ' + ' | '.join(cell.replace('|', '\\|') for cell in line) + ' |'
                     for line in (head, ('---', '---', '---'), *lines))


def separation(figures):
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


def accuracy(figures):
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
                      duration(of['seconds'] * 1e9 / max(1, of['pairs'] - exact)),
                      duration(of['exact_seconds'] * 1e9 / exact) if exact else '–'])
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

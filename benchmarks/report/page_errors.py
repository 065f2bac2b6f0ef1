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

"""The sections on when and how far a method is wrong."""

from methods import LABELS
from words import distance, listed, metres, power, share

U = 2.0 ** -53
U_FLOAT32 = 2.0 ** -24
# Methods whose only errors are those of rounding a projection.
PROJECTING = 'traditional', 'binary'


def condition(figures):
    found = figures['condition']
    worst = found['backward']
    projecting = max(worst[m] for m in PROJECTING)
    nearest = listed(f'{LABELS[m]} is wrong up to c = {power(worst[m])}'
                     for m in ('closest', 'gjk'))
    never = [LABELS[m] for m, value in worst.items() if not value]
    return f"""## When a method is wrong

![Share of wrong answers by gap, of traditional by family and of the methods](condition.png)

*Bins of half a decade with at least 20 pairs, of {found["pairs"]:,} of all families of convex
bodies; bands are Wilson's intervals. The notch at 2 u D is of points one ulp apart, whose
difference is exact.*

Let g be the signed separation of two bodies, here computed in integers, D the largest of their
coordinates and u = 2⁻⁵³. The question whether they meet has the condition number κ = u D / |g|.
Whatever the family, the wrong answers of a method end at one cliff in 1/κ = |g| / (u D): right of
it there is none, and left of it they soon are the rule.

- **Backward error.** A wrong answer is right for bodies moved by |g| / 2 each, so by c u D with
  c = |g| / (2 u D). {_capital(listed(LABELS[m] for m in PROJECTING))}, which round projections
  alone, stay at c = {projecting:.2g} or less: they answer exactly, for coordinates changed in
  their last place.
- **Nearest points** lose half of the digits: the line through two points that are g apart, each
  off by some u D, is off by an angle of u D / g, and separates no more where g falls below about
  √u D, 10⁸ u D. {_capital(nearest)}. A tolerance only moves that cliff.
- **The published readings** have no cliff: their c of up to {power(worst["published_a"])} moves
  bodies by {share(worst["published_a"] * U)} of D, since it is no rounding that makes them wrong.
- **Never wrong** here: {listed(never) if never else "none"}."""


def _capital(text):
    return text[0].upper() + text[1:]


def growth(figures):
    rows = [row for row in figures['by_offset'] if row['offset'] >= 1]
    bounds = {'traditional': 4 * U, 'traditional_float32': 6 * U_FLOAT32}
    kept = {m: max(row['widest'] / (bound * (row['offset'] + 4)) for row in rows
                   if row['method'] == m) for m, bound in bounds.items()}
    last = max(row['offset'] for row in rows)
    at_last = [f'{LABELS[row["method"]]} {metres(row["widest"]) if row["widest"] else "nothing"}'
               for row in rows if row['offset'] == last]
    return f"""So errors grow with the distance from the origin:

![Widest gap or overlap misjudged, by distance from the origin](growth.png)

A projection x uₓ + y u_y on an axis of length L errs by at most 2 u D L (two products, one sum,
Cauchy–Schwarz; first order in u), so a gap, the difference of two, by 4 u D, and where coordinates
were rounded to float32 before, u = 2⁻²⁴, by 6 u D. The widest gap misjudged was
{share(kept["traditional"])} of this bound in float64 and {share(kept["traditional_float32"])} in
float32{_bound_kept(kept)}. At {distance(last)} the widest were: {listed(at_last)}. GJK computes
with differences of coordinates, so the distance hardly matters to it."""


def _bound_kept(kept):
    return (', so it explains what was seen' if max(kept.values()) <= 1
            else '; more than 100 %, so there is another cause')

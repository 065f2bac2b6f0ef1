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

"""What the plots and the tables ask of the figures."""

import math

from words import rate

MIX = 'clear', 'near', 'deep'


def row(figures, n, kind, method):
    """Return the row of one measurement, or None."""
    return next((r for r in figures['speed'] if r['n'] == n and r['kind'] == kind
                 and r['method'] == method), None)


def rows(figures, method, kind):
    """Return the rows of a method and of one kind of pairs."""
    return [r for r in figures['speed'] if r['method'] == method and r['kind'] == kind]


def ns(figures, n, method, kinds=MIX):
    """Return the median time a pair in ns, the mean over kinds of pairs, or None."""
    found = [row(figures, n, kind, method) for kind in kinds]
    if None in found or not all('ns' in r for r in found):
        return None
    return math.fsum(r['ns'][0] for r in found) / len(found)


def parts(row, what):
    """Return false collisions and the pairs apart, or false clears and the others, or both."""
    if what == 'wrong':
        return row['false_collisions'] + row['false_clears'], row['pairs']
    return row[what], row['apart'] if what == 'false_collisions' else row['pairs'] - row['apart']


def rate_of(row, what='wrong'):
    """Return such a share in words, with its interval."""
    return rate(*parts(row, what))


def sides(figures):
    """Return the numbers of vertices measured, in order."""
    return list(dict.fromkeys(r['n'] for r in figures['speed']))


def methods(figures):
    """Return the methods measured, in order."""
    return list(dict.fromkeys(r['method'] for r in figures['speed']))


def timed(figures):
    """Return those of them that were timed."""
    return list(dict.fromkeys(r['method'] for r in figures['speed'] if 'ns' in r))


def wrong(rows):
    """Return the number of wrong answers in rows."""
    return sum(r['false_collisions'] + r['false_clears'] for r in rows)

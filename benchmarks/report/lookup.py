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

"""What the plots and the page ask of the figures."""

MIX = 'clear', 'near', 'deep'


def row(figures, shape, kind, method, kernel='compiled'):
    """Return the row of one measurement, or None."""
    return next((r for r in figures['speed'][kernel] if r['shape'] == shape
                 and r['kind'] == kind and r['method'] == method), None)


def time(figures, shape, method, kernel='compiled', kinds=MIX):
    """Return the median time a pair in ns, the mean over kinds of pairs, or None."""
    return _mean(figures, shape, method, kernel, kinds, lambda r: r['ns'][0])


def axes(figures, shape, method, kinds=MIX):
    """Return the mean number of axes a decision, the mean over kinds of pairs, or None."""
    return _mean(figures, shape, method, 'compiled', kinds, lambda r: r.get('axes'))


def rate(row, what):
    """Return false collisions as a share of the pairs apart, or false clears of those not."""
    whole = row['apart'] if what == 'false_collisions' else row['pairs'] - row['apart']
    return row[what] / whole if whole else None


def shapes(figures):
    """Return the numbers of vertices measured, in order; rectangles are left out."""
    return list(dict.fromkeys(r['shape'] for r in figures['speed']['compiled']
                              if r['shape'] != 'rectangles'))


def wrong(rows):
    """Return the number of wrong answers in rows."""
    return sum(r['false_collisions'] + r['false_clears'] for r in rows)


def _mean(figures, shape, method, kernel, kinds, value):
    rows = [row(figures, shape, kind, method, kernel) for kind in kinds]
    if None in rows or None in map(value, rows):
        return None
    return sum(map(value, rows)) / len(rows)

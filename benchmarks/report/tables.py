# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The tables of the report; the sentences around them are written by hand."""

import math

from _shared import (
    distance, duration, durations, length, power, rate, share, table, table_of)
from libraries import LABELS as LIBRARIES
from methods import LABELS

MIX = 'clear', 'near', 'deep'
SHOWN = 4, 16, 64
RATED = 16
READINGS = 'published_a', 'published_b', 'hybrid', 'closest', 'literal'
# Of the long tables: one small and one large n that the page does not show.
_KIND_SIDES = 8, 256
_KINDS = *MIX, 'hard'
# The long run gives no time for fewer pairs than this.
_FEWEST_TIMED = 1000


def distinct(rows, key):
    """Return the distinct values of rows for a key, in order."""
    return list(dict.fromkeys(row[key] for row in rows if key in row))


def speed_row(figures, n, kind, method):
    """Return the row of one measurement of speed, or None."""
    return next((row for row in figures['speed'] if row['n'] == n and row['kind'] == kind
                 and row['method'] == method), None)


def parts(row):
    """Return the wrong answers and the pairs."""
    return row['false_collisions'] + row['false_clears'], row['pairs']


def count_wrong(rows):
    """Return the number of wrong answers in rows."""
    return sum(parts(row)[0] for row in rows)


def _rate(row):
    """Return the share of wrong answers in words, with its interval."""
    return rate(*parts(row))


def _both_errors(row):
    return (f'{share(row["false_collisions"], row["apart"])} / '
            f'{share(row["false_clears"], row["pairs"] - row["apart"])}')


def _time(figures, n, method, kinds=MIX):
    """Return the median time a pair in words, the mean over kinds of pairs."""
    rows = [speed_row(figures, n, kind, method) for kind in kinds]
    return duration(math.fsum(row['ns'][0] for row in rows) / len(rows))


def _timed(figures):
    """Return the titles of the timed methods by name, improved in bold."""
    timed = distinct([row for row in figures['speed'] if 'ns' in row], 'method')
    return {name: f'**{LABELS[name]}**' if name == 'improved' else LABELS[name] for name in timed}


def _sides(figures):
    return distinct(figures['speed'], 'n')


def _by_sides(sides, labels, cell):
    """Return a table with a row for each label and a column for each number of vertices."""
    return table(['', *(f'n = {n}' for n in sides)],
                 [[label, *(cell(n, name) for n in sides)] for name, label in labels.items()])


def _speed(figures):
    lines = []
    for method, label in _timed(figures).items():
        worst = figures['condition']['backward'].get(method, 0.0)
        lines.append([label, *(_time(figures, n, method, ('near',)) for n in SHOWN), *(
            _rate(speed_row(figures, RATED, kind, method)) for kind in ('near', 'hard')),
            power(worst) if worst else '–'])
    return table(['', *(f'n = {n}, near' for n in SHOWN), 'wrong, near', 'wrong, hard', 'c'],
                 lines)


def _asked(figures):
    lines = []
    for name in distinct(figures['decisions'], 'library'):
        rows = [row for row in figures['decisions'] if row['library'] == name]
        times = {row['n']: row for row in rows if 'n' in row}
        wrong = {row['kind']: row for row in rows if 'kind' in row}
        lines.append([LIBRARIES[name], *(
            f'{duration(times[n]["make"])}, {duration(times[n]["ask"])}' if n in times else '–'
            for n in SHOWN), *(_rate(wrong[kind]) if kind in wrong else 'crashes'
                               for kind in ('near', 'hard'))])
    return table(['make, ask', *(f'n = {n}' for n in SHOWN), 'wrong, near', 'wrong, hard'], lines)


def _separation(figures):
    lines = []
    for name in distinct(figures['separations'], 'library'):
        rows = [row for row in figures['separations'] if row['library'] == name]
        times = {row['n']: row['ask'] for row in rows if 'n' in row}
        near = [row for row in rows if row.get('family') == 'near']
        others = [row for row in rows if row.get('family', 'near') != 'near']
        lines.append([LIBRARIES[name], *(duration(times.get(n)) for n in SHOWN),
                      *_errors(near), *(_errors(others) if others else ('crashes', '–'))])
    return table(['', *(f'n = {n}' for n in SHOWN), 'near: error', 'wrong sign', 'hard: error',
                  'wrong sign or none'], lines)


def _errors(rows):
    worst = max(row['worst_ulp'] for row in rows)
    bad = sum(row['wrong_signs'] + row['unusable'] for row in rows)
    return f'{power(worst)} ulp', rate(bad, sum(row['pairs'] for row in rows))


def _separation_families(figures):
    rows = {(row['family'], row['library']): row for row in figures['separations']
            if 'family' in row and row['library'] != 'box2d'}
    names = distinct(rows.values(), 'library')
    return table(['family', *(LIBRARIES[name] for name in names)], [
        [family.replace('_', ' '), *(
            f'{power(of["worst_ulp"])} ulp, {of["wrong_signs"]} and {of["unusable"]} of '
            f'{of["pairs"]}' if of['pairs'] else '–'
            for of in (rows[family, name] for name in names))]
        for family in distinct(rows.values(), 'family')])


def _non_convex(figures):
    rows = figures['non_convex']
    sides = distinct(rows, 'n')
    lines = []
    for what in ('make', 'ask'):
        for name in distinct(rows, 'library'):
            of = [row for row in rows if row['library'] == name]
            lines.append([f'{what}: {LIBRARIES[name]}', *(duration(row[what]) for row in of),
                          sum(row['wrong'] for row in of) if what == 'ask' else ''])
    return table(['', *(f'n = {n}' for n in sides), 'wrong'], lines)


def _stars(figures):
    rows = figures['stars']
    return table(['centres apart', *(f'n = {n:,}' for n in distinct(rows, 'n'))], [
        [f'{apart} radii', *(duration(row['ns']) for row in rows if row['apart'] == apart)]
        for apart in distinct(rows, 'apart')])


def _measured_on(figures):
    facts = figures['machine']
    versions = ', '.join(f'{name} {facts[name]}' for name in facts
                         if name not in ('processor', 'cores', 'system', 'kernel'))
    counts = [speed_row(figures, n, 'near', 'improved')['pairs'] for n in _sides(figures)]
    return table(['machine', 'versions', 'pairs for each n and kind', 'minutes'], [[
        f'{facts["processor"]}, {facts["cores"]} cores, {facts["system"]}', versions,
        f'{min(counts):,} to {max(counts):,}', f'{figures["seconds"] / 60:.0f}']])


def _times_by_kind(figures):
    columns = [(n, kind) for n in _KIND_SIDES for kind in _KINDS]
    return table(['', *(f'n = {n}, {kind}' for n, kind in columns)], [
        [LABELS[m], *(durations(*speed_row(figures, n, kind, m)['ns'][:3])
                      for n, kind in columns)] for m in _timed(figures)])


def _wrong_on_hard(figures):
    hard = [row for row in figures['speed'] if row['kind'] == 'hard']
    labels = {m: LABELS[m] for m in distinct(hard, 'method')
              if count_wrong(row for row in hard if row['method'] == m)}
    return _by_sides(_sides(figures), labels, lambda n, method: _both_errors(
        speed_row(figures, n, 'hard', method)))


def _steps(figures):
    rows = {(row['n'], row['method']): row for row in figures['steps']}
    sides = distinct(figures['steps'], 'n')
    labels = {(method, k): f'{LABELS[method]}: {step["step"]}'
              for method in ('published_a', 'published_b')
              for k, step in enumerate(rows[sides[0], method]['steps'])}

    def cell(n, step):
        row = rows[n, step[0]]
        found = row['steps'][step[1]]
        return (f'{share(found["clears"], row["apart"])} / '
                f'{share(found["false_clears"], row["meet"])}')
    return _by_sides(sides, labels, cell)


def _families(figures):
    rows = {(row['family'], row['method']): row for row in figures['families']}
    wrong = [method for method in LABELS if count_wrong(
        row for row in rows.values() if row['method'] == method)]

    def cell(row):
        return '' if row is None else '0' if not count_wrong([row]) else (
            f'{row["false_collisions"]:,} / {row["false_clears"]:,}')
    return table(['family', 'pairs', *(LABELS[m] for m in wrong)], [
        [name.replace('_', ' '), f'{rows[name, "improved"]["pairs"]:,}',
         *(cell(rows.get((name, m))) for m in wrong)] for name in distinct(rows.values(),
                                                                           'family')])


def _offsets(figures):
    rows = figures['by_offset']
    return table(['', *(LABELS[m] for m in distinct(rows, 'method'))], [
        [distance(offset), *(_rate(row) for row in rows if row['offset'] == offset)]
        for offset in sorted(distinct(rows, 'offset'))])


def _long_run(figures):
    def each(seconds, pairs):
        return duration(seconds * 1e9 / pairs) if pairs >= _FEWEST_TIMED else '–'
    families = figures['accuracy']['families']
    return table_of([{'family': name.replace('_', ' '), **of} for name, of in families.items()], {
        'family': '{family}', 'pairs': '{pairs:,}',
        'in contact': lambda of: share(of['meet'], of['pairs']), 'wrong': '{wrong}',
        'exact stage': lambda of: share(of['exact'], of['pairs']),
        'without it': lambda of: each(of['seconds'], of['pairs'] - of['exact']),
        'with it': lambda of: each(of['exact_seconds'], of['exact'])})


TABLES = {
    'speed against error': _speed, 'asked from Python': _asked,
    'separation': _separation, 'non convex': _non_convex, 'stars': _stars,
    'measured on': _measured_on,
    'times by kind': _times_by_kind, 'wrong on hard pairs': _wrong_on_hard, 'steps': _steps,
    'families': _families, 'distance from the origin': _offsets,
    'separation by family': _separation_families, 'long run': _long_run,
    'bodies used once': lambda figures: _by_sides(
        SHOWN, _timed(figures), lambda n, method: next(
            duration(row['ns']) for row in figures['once']
            if row['n'] == n and row['method'] == method)),
    'times': lambda figures: _by_sides(
        _sides(figures), {method: LABELS[method] for method in _timed(figures)},
        lambda n, method: _time(figures, n, method)),
    'readings of the paper': lambda figures: _by_sides(
        _sides(figures), {method: LABELS[method] for method in READINGS},
        lambda n, method: _both_errors(speed_row(figures, n, 'near', method))),
    'time of contact': lambda figures: table_of(figures['contact_times'], {
        '': lambda row: LIBRARIES[row['library']], 'n': '{n}',
        'time': lambda row: duration(row['ask']), 'missed': '{missed} of {contacts}',
        'invented': lambda row: f'{row["invented"]} of {row["pairs"] - row["contacts"]}',
        'median error': lambda row: length(row['median']),
        'greatest error': lambda row: length(row['worst'])}),
    'stepping': lambda figures: table_of(figures['stepping'], {
        '': lambda row: f'steps of {row["step"]:g} s' if row['step'] else '**continuous**',
        'missed': '{missed:,} of {contacts:,}',
        'late, mean': lambda row: duration(1e9 * row['mean']) if row['step'] else '0',
        'late, at most': lambda row: duration(1e9 * row['worst']) if row['step'] else '0',
        'an obstacle': lambda row: duration(row['ns'])}),
    'scenes': lambda figures: table_of(figures['cost'], {
        'scene': '{scene}', 'pairs': '{pairs:,}', 'in contact': '{contacts:,}',
        'boxes or discs decide': lambda row: share(row['boxes'], row['pairs']),
        'exact stage': lambda row: share(row['exact'], row['pairs']),
        'of the time': lambda row: share(row['exact_time']),
        'a pair': lambda row: duration(row['ns'])}),
    'float32': lambda figures: table_of(figures['float32'], {
        'distance from the origin': lambda row: distance(row['distance']),
        'step': lambda row: length(row['step']), 'pairs': '{pairs:,}',
        'answer changed': '{changed:,}',
        'widest': lambda row: length(row['widest']) if row['widest'] else '–',
        'refused': '{refused:,}'})}

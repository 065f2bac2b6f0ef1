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

"""The tables of the report; the sentences around them are written by hand."""

from libraries import LABELS as LIBRARY_LABELS
import lookup
from methods import LABELS, METHODS
from samples import FEWEST_TIMED
from words import distance, duration, durations, length, power, rate, share, table

SHOWN = 4, 16, 64
RATED = 16
READINGS = 'published_a', 'published_b', 'hybrid', 'closest', 'literal'
# Of the long tables: one small and one large n that the page does not show.
_KIND_SIDES = 8, 256
_KINDS = 'clear', 'near', 'deep', 'hard'


def _speed(figures):
    lines = []
    for method in lookup.timed(figures):
        worst = figures['condition']['backward'].get(method, 0.0)
        lines.append([_name(method), *(
            duration(lookup.ns(figures, n, method, kinds=('near',))) for n in SHOWN), *(
            lookup.rate_of(lookup.row(figures, RATED, kind, method)) for kind in ('near', 'hard')),
            power(worst) if worst else '–'])
    return table(['', *(f'n = {n}, near' for n in SHOWN), 'wrong, near', 'wrong, hard', 'c'],
                 lines)


def _once(figures):
    times = {(row['method'], row['n']): row['ns'] for row in figures['once']}
    return table(['', *(f'n = {n}' for n in SHOWN)], [
        [_name(m), *(duration(times[m, n]) for n in SHOWN)] for m in lookup.timed(figures)])


def _name(method):
    return f'**{LABELS[method]}**' if method == 'improved' else LABELS[method]


def _asked(figures):
    rows = figures['decisions']
    lines = []
    for name in _libraries(rows):
        timed = {row['n']: row for row in rows if row['library'] == name and 'n' in row}
        wrong = {row['kind']: row for row in rows if row['library'] == name and 'kind' in row}
        lines.append([LIBRARY_LABELS[name], *(
            f'{duration(timed[n]["make"])}, {duration(timed[n]["ask"])}' if n in timed else '–'
            for n in SHOWN), *(lookup.rate_of(wrong[kind]) if kind in wrong else 'crashes'
                               for kind in ('near', 'hard'))])
    return table(['make, ask', *(f'n = {n}' for n in SHOWN), 'wrong, near', 'wrong, hard'], lines)


def _libraries(rows):
    return list(dict.fromkeys(row['library'] for row in rows))


def _separation(figures):
    rows = figures['separations']
    lines = []
    for name in _libraries(rows):
        of = [row for row in rows if row['library'] == name]
        timed = {row['n']: row['ask'] for row in of if 'n' in row}
        near = [row for row in of if row.get('family') == 'near']
        others = [row for row in of if row.get('family', 'near') != 'near']
        lines.append([LIBRARY_LABELS[name], *(duration(timed.get(n)) for n in SHOWN),
                      *_errors(near), *(_errors(others) if others else ('crashes', '–'))])
    return table(['', *(f'n = {n}' for n in SHOWN), 'near: error', 'wrong sign', 'hard: error',
                  'wrong sign or none'], lines)


def _errors(rows):
    worst = max(row['worst_ulp'] for row in rows)
    bad = sum(row['wrong_signs'] + row['unusable'] for row in rows)
    return f'{power(worst)} ulp', rate(bad, sum(row['pairs'] for row in rows))


def _separation_families(figures):
    rows = [row for row in figures['separations'] if 'family' in row]
    names = [name for name in _libraries(rows) if name != 'box2d']
    lines = []
    for family in dict.fromkeys(row['family'] for row in rows):
        of = {row['library']: row for row in rows if row['family'] == family}
        lines.append([family.replace('_', ' '), *(
            f'{power(of[name]["worst_ulp"])} ulp, {of[name]["wrong_signs"]} and '
            f'{of[name]["unusable"]} of {of[name]["pairs"]}' if of[name]['pairs'] else '–'
            for name in names)])
    return table(['family', *(LIBRARY_LABELS[name] for name in names)], lines)


def _time_of_contact(figures):
    return table(['', 'n', 'time', 'missed', 'invented', 'median error', 'greatest error'], [
        [LIBRARY_LABELS[row['library']], row['n'], duration(row['ask']),
         f'{row["missed"]} of {row["contacts"]}',
         f'{row["invented"]} of {row["pairs"] - row["contacts"]}', length(row['median']),
         length(row['worst'])] for row in figures['contact_times']])


def _stepping(figures):
    return table(['', 'missed', 'late, mean', 'late, at most', 'an obstacle'], [
        [f'steps of {row["step"]:g} s' if row['step'] else '**continuous**',
         f'{row["missed"]:,} of {row["contacts"]:,}',
         *(duration(1e9 * row[what]) if row['step'] else '0' for what in ('mean', 'worst')),
         duration(row['ns'])] for row in figures['stepping']])


def _non_convex(figures):
    rows = figures['non_convex']
    sides = list(dict.fromkeys(row['n'] for row in rows))
    lines = []
    for what in ('make', 'ask'):
        for name in _libraries(rows):
            of = {row['n']: row for row in rows if row['library'] == name}
            lines.append([f'{what}: {LIBRARY_LABELS[name]}',
                          *(duration(of[n][what]) for n in sides),
                          sum(row['wrong'] for row in of.values()) if what == 'ask' else ''])
    return table(['', *(f'n = {n}' for n in sides), 'wrong'], lines)


def _readings(figures):
    sides = lookup.sides(figures)
    return table(['', *(f'n = {n}' for n in sides)], [[LABELS[method], *(
        _both_errors(lookup.row(figures, n, 'near', method)) for n in sides)]
        for method in READINGS])


def _both_errors(row):
    return ' / '.join(share(*lookup.parts(row, what))
                      for what in ('false_collisions', 'false_clears'))


def _scenes(figures):
    return table(['scene', 'pairs', 'in contact', 'boxes or discs decide', 'exact stage',
                  'of the time', 'a pair'], [
        [row['scene'], f'{row["pairs"]:,}', f'{row["contacts"]:,}',
         share(row['boxes'], row['pairs']), share(row['exact'], row['pairs']),
         share(row['exact_time']), duration(row['ns'])] for row in figures['cost']])


def _ages(figures):
    return table(['scene', 'a frame every', 'fastest', 'a frame before', 'between two frames',
                  'float32'], [
        [row['scene'], f'{1e3 * row["spacing"]:.0f} ms', f'{row["speed"]:.2g} m/s',
         *(' to '.join(map(length, row[what])) for what in ('before', 'between')),
         length(row['coordinates'])] for row in figures['ages'] if row['speed']])


def _measured_on(figures):
    facts = figures['machine']
    versions = ', '.join(f'{name} {facts[name]}' for name in facts
                         if name not in ('processor', 'cores', 'system', 'kernel'))
    counts = [lookup.row(figures, n, 'near', 'improved')['pairs'] for n in lookup.sides(figures)]
    return table(['machine', 'versions', 'pairs for each n and kind', 'minutes'], [[
        f'{facts["processor"]}, {facts["cores"]} cores, {facts["system"]}', versions,
        f'{min(counts):,} to {max(counts):,}', f'{figures["seconds"] / 60:.0f}']])


def _times(figures):
    sides = lookup.sides(figures)
    return table(['', *(f'n = {n}' for n in sides)], [
        [LABELS[m], *(duration(lookup.ns(figures, n, m)) for n in sides)]
        for m in lookup.timed(figures)])


def _times_by_kind(figures):
    columns = [(n, kind) for n in _KIND_SIDES for kind in _KINDS]
    return table(['', *(f'n = {n}, {kind}' for n, kind in columns)], [
        [LABELS[m], *(durations(*lookup.row(figures, n, kind, m)['ns'][:3])
                      for n, kind in columns)] for m in lookup.timed(figures)])


def _wrong_on_hard(figures):
    sides = lookup.sides(figures)
    rows = {m: [lookup.row(figures, n, 'hard', m) for n in sides]
            for m in lookup.methods(figures)}
    return table(['', *(f'n = {n}' for n in sides)], [
        [LABELS[m], *map(_both_errors, of)] for m, of in rows.items() if lookup.wrong(of)])


def _steps(figures):
    lines = []
    sides = list(dict.fromkeys(row['n'] for row in figures['steps']))
    for method in ('published_a', 'published_b'):
        rows = [row for row in figures['steps'] if row['method'] == method]
        for k, step in enumerate(rows[0]['steps']):
            lines.append([f'{LABELS[method]}: {step["step"]}', *(
                f'{share(row["steps"][k]["clears"], row["apart"])} / '
                f'{share(row["steps"][k]["false_clears"], row["meet"])}' for row in rows)])
    return table(['', *(f'n = {n}' for n in sides)], lines)


def _families(figures):
    rows = figures['families']
    methods = [m for m in METHODS if any(row['method'] == m for row in rows)]
    wrong = [m for m in methods if lookup.wrong([row for row in rows if row['method'] == m])]
    lines = []
    for name in dict.fromkeys(row['family'] for row in rows):
        of = {row['method']: row for row in rows if row['family'] == name}
        lines.append([name.replace('_', ' '), f'{of["improved"]["pairs"]:,}', *(
            f'{of[m]["false_collisions"]:,} / {of[m]["false_clears"]:,}' if m in of
            and lookup.wrong([of[m]]) else '0' if m in of else '' for m in wrong)])
    return table(['family', 'pairs', *(LABELS[m] for m in wrong)], lines)


def _offsets(figures):
    rows = figures['by_offset']
    methods = list(dict.fromkeys(row['method'] for row in rows))
    return table(['', *(LABELS[m] for m in methods)], [
        [distance(offset), *(lookup.rate_of(row) for row in rows if row['offset'] == offset)]
        for offset in sorted({row['offset'] for row in rows})])


def _float32(figures):
    head = 'distance from the origin', 'step', 'pairs', 'answer changed', 'widest', 'refused'
    return table(head, [
        [distance(row['distance']), length(row['step']), f'{row["pairs"]:,}',
         f'{row["changed"]:,}', length(row['widest']) if row['widest'] else '–',
         f'{row["refused"]:,}'] for row in figures['float32']])


def _long_run(figures):
    head = 'family', 'pairs', 'in contact', 'wrong', 'exact stage', 'without it', 'with it'
    return table(head, [
        [name.replace('_', ' '), f'{of["pairs"]:,}', share(of['meet'], of['pairs']), of['wrong'],
         share(of['exact'], of['pairs']), _each(of['seconds'], of['pairs'] - of['exact']),
         _each(of['exact_seconds'], of['exact'])]
        for name, of in figures['accuracy']['families'].items()])


def _each(seconds, pairs):
    """Return the time a pair, unless there are too few to tell."""
    return duration(seconds * 1e9 / pairs) if pairs >= FEWEST_TIMED else '–'


TABLES = {
    'speed against error': _speed, 'bodies used once': _once, 'asked from Python': _asked,
    'separation': _separation, 'time of contact': _time_of_contact, 'stepping': _stepping,
    'non convex': _non_convex, 'readings of the paper': _readings, 'scenes': _scenes,
    'ages': _ages,
    'measured on': _measured_on, 'times': _times, 'times by kind': _times_by_kind,
    'wrong on hard pairs': _wrong_on_hard, 'steps': _steps,
    'families': _families, 'distance from the origin': _offsets, 'float32': _float32,
    'separation by family': _separation_families, 'long run': _long_run}

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Shared by benchmarks: module paths, timing, the machine, and how figures are written."""

import gc
from importlib import metadata
import json
import math
import os
from pathlib import Path
import platform
import sys
import time

import numpy as np
from sat_collision import KERNEL

ROOT = Path(__file__).resolve().parents[1]
sys.path += [str(ROOT / place) for place in (
    'benchmarks', 'benchmarks/report', 'docs', 'test/support')]
# Plots need no screen.
os.environ.setdefault('MPLBACKEND', 'Agg')
# A task that takes longer than this is not repeated, in seconds.
_LONG = 0.25
_UNITS = {'ns': 1, 'µs': 1e3, 'ms': 1e6, 's': 1e9}


def times(tasks, repeats):
    """
    Run functions without arguments `repeats` times, in turns; return the seconds of each run.

    Each must have run before, so that nothing is compiled now; functions that take long run once.
    """
    taken = {name: [] for name in tasks}
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeats):
            for name, task in tasks.items():
                if not taken[name] or taken[name][0] < _LONG:
                    start = time.perf_counter()
                    task()
                    taken[name].append(time.perf_counter() - start)
    finally:
        gc.enable()
    return taken


def medians(tasks, repeats):
    """Run functions as `times` does, and return the median seconds by name."""
    return {name: float(np.median(taken)) for name, taken in times(tasks, repeats).items()}


def describe(*packages):
    """Return processor, system and versions, of the named distributions too; no host name."""
    return {
        'processor': _processor(), 'cores': os.cpu_count(),
        'system': f'{platform.system()} {platform.machine()}',
        'python': platform.python_version(), 'kernel': KERNEL,
        **{package: metadata.version(package) for package in packages}}


def _processor():
    """Return the processor's name with its family, model and stepping, which a name may hide."""
    lines = [line.partition(':') for line in Path('/proc/cpuinfo').read_text().splitlines()]
    facts = {key.strip(): value.strip() for key, _, value in reversed(lines)}
    numbers = [f'{key.split()[-1]} {facts[key]}' for key in ('cpu family', 'model', 'stepping')
               if key in facts]
    return ', '.join(filter(None, [facts.get('model name', platform.machine()),
                                   ' '.join(numbers)]))


def table(head, rows):
    """Return a Markdown table; the first column is text, the others are numbers."""
    lines = [head, ['---'] + ['---:'] * (len(head) - 1), *rows]
    return '\n'.join('| ' + ' | '.join(map(str, line)) + ' |' for line in lines)


def table_of(rows, columns):
    """Return a table of dicts: for each title a format of what they have, or a function."""
    return table([*columns], [[form.format(**row) if isinstance(form, str) else form(row)
                               for form in columns.values()] for row in rows])


def duration(ns):
    """Return a time given in ns with three figures and its unit; a dash for None."""
    if ns is None:
        return '–'
    unit = next((unit for unit, size in _UNITS.items() if float(f'{ns / size:.3g}') < 1000), 's')
    return f'{_three_figures(ns / _UNITS[unit])} {unit}'


def durations(middle, low, high):
    """Return a time in ns with a range around it, all in one unit."""
    text, unit = duration(middle).split()
    low, high = (_three_figures(end / _UNITS[unit]) for end in (low, high))
    return f'{text} ({low}–{high}) {unit}'


def share(part, whole=1.0):
    """Return a share as a percentage; 0 and 100 % are written only if they are exact."""
    if part is None or not whole:
        return '–'
    if part == 0:
        return '0'
    per_cent = 100 * part / whole
    if 99.5 <= per_cent < 100:
        return f'{math.floor(10 * per_cent) / 10:g} %'
    return f'{per_cent:.2g} %' if per_cent < 10 else f'{per_cent:.0f} %'


def wilson(part, whole, z=1.96):
    """Return Wilson's interval of 95 % confidence for a share."""
    middle = (part + z * z / 2) / (whole + z * z)
    half = z / (whole + z * z) * math.sqrt(part * (whole - part) / whole + z * z / 4)
    return max(middle - half, 0.0) if part else 0.0, min(middle + half, 1.0)


def rate(part, whole):
    """Return a share with Wilson's interval: '34 % (32–36)', or '0 (< 0.1 %)'."""
    if not whole:
        return '–'
    low, high = wilson(part, whole)
    if part == 0:
        return f'0 (< {share(high)})'
    return f'{share(part, whole)} ({100 * low:.2g}–{100 * high:.2g})'


def length(value):
    """Return a length in m, with two figures."""
    return f'{value:.2g} m' if 1e-3 <= value < 100 or value == 0 else f'{power(value)} m'


def distance(value):
    """Return a distance in m or km."""
    if value < 1000:
        return f'{value:g} m'
    return f'{value / 1000:,.3f}'.rstrip('0').rstrip('.') + ' km'


def compact(value, depth=0):
    """Return JSON in which a row of figures, a list of numbers or a flat dict, is one line."""
    if isinstance(value, dict) and any(isinstance(v, (dict, list)) for v in value.values()):
        parts = [f'{json.dumps(str(key))}: {compact(v, depth + 1)}' for key, v in value.items()]
        opening, closing = '{', '}'
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        parts, opening, closing = [json.dumps(v) for v in value], '[', ']'
    else:
        return json.dumps(value)
    space = ' ' * (depth + 1)
    return f'{opening}\n{space}' + f',\n{space}'.join(parts) + f'\n{" " * depth}{closing}'


def power(value):
    """Return a number with two figures, by a power of ten where that is shorter."""
    if 0.01 <= value < 1000:
        return f'{value:.2g}' if value < 100 else f'{value:.0f}'
    mantissa, exponent = f'{value:.1e}'.split('e')
    raised = str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹')
    return f'{mantissa}·10{str(int(exponent)).translate(raised)}'


def _three_figures(value):
    return f'{value:.{max(0, 2 - len(str(int(value))) + 1)}f}' if value >= 1 else f'{value:.2f}'

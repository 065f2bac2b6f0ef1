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

"""What differs between a result and one stored before: a regression gate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import json
import math
from pathlib import PurePath
from typing import Any

from sat_collision.replay.formats import as_dict, SCHEMA
from sat_collision.replay.result import Result

# Separations are rounded: another processor or NumPy may round otherwise.
_TOLERANCE = 1e-9
_PLACES = {'x', 'y', 'depth', 'separation'}
_LEFT_OUT = {'bag', 'problems', 'notes', 'max_unknown'}


class ExpectationError(ValueError):
    """The file is not a result that --json wrote."""


def differences(results: list[Result], path: str) -> list[str]:
    """
    Return lines that say what differs from a file that --json wrote.

    Recordings are known by the last part of their path, and contacts and unknown intervals by
    footprint and obstacle, in order. The words of problems and notes are not compared.

    Raises
    ------
    ExpectationError
        If the file is anything else.

    """
    try:
        with open(path, encoding='utf-8') as file:
            stored = json.load(file)
        if stored['schema'] != SCHEMA:
            raise ExpectationError(
                f'{path} has the schema {stored["schema"]}, this version needs {SCHEMA}')
        expected = _by_name(stored['bags'])
    except ExpectationError:
        raise
    except OSError as error:
        raise ExpectationError(f'cannot read {path}: {error.strerror}') from error
    except (ValueError, KeyError, TypeError) as error:
        raise ExpectationError(f'{path} is not a result that --json wrote') from error
    found = _by_name(as_dict(results)['bags'])
    lines = [f'{name}: expected, but not checked' for name in expected if name not in found]
    lines += [f'{name}: checked, but not expected' for name in found if name not in expected]
    for name in found:
        if name in expected:
            lines += [f'{name}: {line}' for line in _compared('', expected[name], found[name])]
    return lines


def _by_name(bags: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return what is to be compared of each recording, by name."""
    named: dict[str, dict[str, Any]] = {}
    for bag in bags:
        name = PurePath(bag['bag']).name
        while name in named:
            name += "'"
        named[name] = {
            **{key: value for key, value in bag.items() if key not in _LEFT_OUT},
            'footprints': {footprint['name']: {key: value for key, value in footprint.items()
                                               if key != 'separation'}
                           for footprint in bag['footprints']},
            'sources': {source['name']: {key: value for key, value in source.items()
                                         if key != 'examples'} for source in bag['sources']},
            'contacts': _numbered(bag['contacts'], 'footprint', 'obstacle'),
            'unknown': _numbered(bag['unknown'], 'footprint')}
    return named


def _numbered(intervals: Iterable[dict[str, Any]], *keys: str) -> dict[str, Any]:
    """Return intervals by what they are about and how often that has been before."""
    named: dict[str, Any] = {}
    for interval in intervals:
        about = ' - '.join(interval[key] for key in keys)
        count = 1
        while f'{about} #{count}' in named:
            count += 1
        named[f'{about} #{count}'] = interval
    return named


def _compared(where: str, expected: Any, found: Any) -> Iterator[str]:
    """Yield a line for each difference below a place in the result."""
    if isinstance(expected, dict) and isinstance(found, dict):
        for key in [*expected, *(key for key in found if key not in expected)]:
            below = f'{where}.{key}' if where else key
            if key not in found:
                yield f'{below} is missing, expected {_short(expected[key])}'
            elif key not in expected:
                yield f'{below} is new: {_short(found[key])}'
            else:
                yield from _compared(below, expected[key], found[key])
    elif not _same(where, expected, found):
        yield f'{where} is {_short(found)}, expected {_short(expected)}'


def _same(where: str, expected: Any, found: Any) -> bool:
    if where.rpartition('.')[2] in _PLACES and isinstance(expected, float) and (
            isinstance(found, (int, float))):
        return math.isclose(expected, found, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    return bool(expected == found)


def _short(value: Any) -> str:
    return json.dumps(value)

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

"""What differs between a result and a baseline, stored before: a regression gate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import json
import math
from pathlib import PurePath
from typing import Any, TypeAlias

from sat_collision.replay.model.result import Result
from sat_collision.replay.output.formats import as_dict, SCHEMA

_Bag: TypeAlias = dict[str, Any]

# Separations are rounded: another processor or NumPy may round otherwise.
_TOLERANCE = 1e-9
_PLACES = {'x', 'y', 'depth', 'separation', 'time_to_collision'}
# Where two normals are equally good, rounding decides which.
_MANIFOLD = {'normal', 'points'}
_CURVES = {'separation', 'time_to_collision'}
_LEFT_OUT = {'bag', 'content', 'problems', 'notes', 'max_unknown', 'max_undetermined',
             'min_ttc'}


class BaselineError(ValueError):
    """The file is not a result that --json wrote."""


class Baseline:
    """
    A result stored before, read from a file that --json wrote.

    Parameters
    ----------
    path : str

    Raises
    ------
    BaselineError
        If the file is anything else.

    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            with open(path, encoding='utf-8') as file:
                stored = json.load(file)
            if stored['schema'] != SCHEMA:
                raise BaselineError(
                    f'{path} has the schema {stored["schema"]}, this version needs {SCHEMA}')
            self._bags = [(_name(bag), bag, _comparable(bag)) for bag in stored['bags']]
        except OSError as error:
            raise BaselineError(f'cannot read {path}: {error.strerror}') from error
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            if isinstance(error, BaselineError):
                raise
            raise BaselineError(f'{path} is not a result that --json wrote') from error

    def differences(self, results: list[Result]) -> list[tuple[str, list[str]]]:
        """
        Return each recording's name, with lines that say what differs.

        Recordings are matched by their content, wherever and however they are stored; others
        by the last part of their path. Contacts and unknown intervals are matched by footprint and
        obstacle, in order. The words of problems and notes, normals and points of contact are not
        compared.
        """
        checked: list[_Bag] = as_dict(results)['bags']
        left = list(self._bags)
        partners: dict[int, _Bag] = {}
        for conditions in ((_same_content, _same_name), (_same_content,), (_same_name,)):
            for place, bag in enumerate(checked):
                found = [number for number, (_, other, _) in enumerate(left)
                         if all(is_same(other, bag) for is_same in conditions)]
                if found and place not in partners:
                    partners[place] = left.pop(found[0])[2]
        differences = [(name, ['expected, but not checked']) for name, _, _ in left]
        for place, bag in enumerate(checked):
            lines = [*_compared('', partners[place], _comparable(bag))] if place in partners else [
                'checked, but not expected']
            differences.append((_name(bag), lines))
        return differences


def _same_content(bag: _Bag, other: _Bag) -> bool:
    return bag.get('content') is not None and bag['content'] == other['content']


def _same_name(bag: _Bag, other: _Bag) -> bool:
    return _name(bag) == _name(other)


def _name(bag: _Bag) -> str:
    return PurePath(bag['bag']).name


def _comparable(bag: _Bag) -> _Bag:
    """Return what is to be compared of a recording."""
    return {
        **{key: value for key, value in bag.items() if key not in _LEFT_OUT},
        'footprints': {footprint['name']: {key: value for key, value in footprint.items()
                                           if key not in _CURVES}
                       for footprint in bag['footprints']},
        'sources': {source['name']: {key: value for key, value in source.items()
                                     if key != 'examples'} for source in bag['sources']},
        'contacts': _numbered([{key: value for key, value in contact.items()
                                if key not in _MANIFOLD} for contact in bag['contacts']],
                              'footprint', 'obstacle'),
        'unknown': _numbered(bag['unknown'], 'footprint')}


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

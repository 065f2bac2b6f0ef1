# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Results for machines: JSON, CSV and JUnit XML; and what differs from JSON written before.

docs/replay_json.md has the schema.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
import csv
import dataclasses
from itertools import chain
import json
import math
from operator import attrgetter
from pathlib import PurePath
import re
from typing import Any, NamedTuple, TypeAlias
from xml.etree import ElementTree

from sat_collision.replay.model.result import (
    FootprintResult, Options, overall, Result, WRITING)
from sat_collision.replay.output.text import (
    how_found, how_soon, lasting, plan_failures, report, summary)

SCHEMA = 'sat_collision.replay/5'
_MANIFOLD_COLUMNS = ('normal_x', 'normal_y', 'point_x_m', 'point_y_m', 'second_point_x_m',
                     'second_point_y_m')
_COLUMNS = ('bag', 'kind', 'footprint', 'obstacle', 'first_ns', 'last_ns', 'duration_s', 'depth_m',
            'deepest_ns', 'x_m', 'y_m', 'reason', 'found', *_MANIFOLD_COLUMNS,
            'time_to_collision_s', 'pose', 'along_m')
# A test case: recording, subject, how it would fail (error or failure), and what is wrong.
_Case: TypeAlias = tuple[str, str, str, list[str]]
_Values: TypeAlias = dict[str, Any]

# Paths may have these.
_NOT_IN_XML = re.compile('[\0-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]')

# These are rounded, on another processor or by another NumPy maybe otherwise.
_ROUNDED = {'x', 'y', 'depth', 'separation', 'time_to_collision', 'pose', 'metres'}
_TOLERANCE = 1e-9
# Not compared, because where two normals are equally good rounding chooses one.
_MANIFOLD = {'normal', 'points'}
_CURVES = {'separation', 'time_to_collision'}
_LEFT_OUT = {'bag', 'content', 'problems', 'notes', 'max_unknown', 'max_undetermined',
             'min_ttc', 'fail_on'}


def as_dict(results: list[Result]) -> _Values:
    """Return results as what --json writes."""
    verdict = overall(results)
    return {'schema': SCHEMA, 'verdict': verdict.words, 'exit_status': int(verdict),
            'summary': summary(results), 'bags': [_bag(result) for result in results]}


def write_json(results: list[Result], path: str) -> None:
    """Write results as JSON."""
    with open(path, 'w', encoding='utf-8') as file:
        json.dump(as_dict(results), file, indent=1, allow_nan=False)
        file.write('\n')


def write_csv(results: list[Result], path: str) -> None:
    """Write a row for each contact, unknown or undetermined time, prediction and plan."""
    with open(path, 'w', encoding='utf-8', errors='backslashreplace', newline='') as file:
        writer = csv.DictWriter(file, _COLUMNS)
        writer.writeheader()
        for result in results:
            writer.writerows({'bag': result.bag, **row} for row in _rows(result))


def _rows(result: Result) -> Iterator[_Values]:
    """Yield the rows of a table, without cells that are empty."""
    for contact in result.contacts:
        yield {**_interval('contact', contact.footprint, contact.first, contact.last),
               'obstacle': contact.obstacle, 'depth_m': contact.depth,
               'deepest_ns': contact.deepest, 'x_m': contact.x, 'y_m': contact.y,
               'found': contact.found, **dict(zip(
                   _MANIFOLD_COLUMNS, chain(contact.normal, *contact.points)))}
    for kind, intervals in result.undecided.items():
        for one in intervals:
            yield {**_interval(kind, one.footprint, one.first, one.last),
                   'reason': '; '.join(one.reasons)}
    for footprint in result.footprints:
        for time, seconds in footprint.time_to_collision:
            if seconds is not None:
                yield {'kind': 'time to collision', 'footprint': footprint.name,
                       'first_ns': time, 'last_ns': time, 'time_to_collision_s': seconds}
    for plan in result.plan_contacts:
        yield {**_interval('plan', plan.footprint, plan.time, plan.until),
               'obstacle': plan.obstacle, 'pose': plan.pose, 'along_m': plan.metres}


def _interval(kind: str, footprint: str, first: int, last: int) -> _Values:
    return {'kind': kind, 'footprint': footprint, 'first_ns': first, 'last_ns': last,
            'duration_s': (last - first) / 1e9}


def write_junit(results: list[Result], path: str) -> None:
    """Write a test suite for each recording: one case for it and one for each footprint."""
    suites = []
    for result in results:
        cases = [('recording', 'error', result.problems)]
        if not result.problems and not any(one.enabled for one in result.footprints):
            cases.append(('footprints', 'failure', ['no footprint is enabled']))
        cases += [(f'messages of {source.name}', 'failure', [*source.examples.values()])
                  for source in result.sources if source.refused]
        cases += [(f'plans of {footprint.name}', 'failure', plan_failures(footprint, result))
                  for footprint in result.planners]
        cases += [(footprint.name, 'failure', [*_failures(footprint, result)])
                  for footprint in result.footprints if footprint.enabled]
        suite = _suite(result.bag, [(result.bag, *case) for case in cases])
        suite.set('time', f'{result.duration:.3f}')
        ElementTree.SubElement(suite, 'system-out').text = '\n'.join(report(result))
        suites.append(suite)
    _write_suites(suites, path)


def write_junit_of_differences(differences: list[tuple[str, list[str]]], baseline: str,
                               path: str) -> None:
    """Write a test case for each recording that was compared with a baseline."""
    cases = [(name, 'as expected', 'failure', lines) for name, lines in differences]
    _write_suites([_suite(f'as expected by {baseline}', cases)], path)


def _suite(name: str, cases: list[_Case]) -> ElementTree.Element:
    suite = ElementTree.Element('testsuite', name=name, tests=str(len(cases)))
    for kind in ('error', 'failure'):
        count = sum(bool(faults) for _, _, of_kind, faults in cases if of_kind == kind)
        suite.set(f'{kind}s', str(count))
    for bag, about, kind, faults in cases:
        case = ElementTree.SubElement(suite, 'testcase', classname=bag, name=about)
        if faults:
            ElementTree.SubElement(case, kind, message=faults[0]).text = '\n'.join(faults)
    return suite


def _write_suites(suites: list[ElementTree.Element], path: str) -> None:
    root = ElementTree.Element('testsuites', name='replay_check')
    root.extend(suites)
    ElementTree.indent(root)
    text = _NOT_IN_XML.sub('?', ElementTree.tostring(root, 'unicode'))
    with open(path, 'w', encoding='utf-8') as file:
        file.write(f"<?xml version='1.0' encoding='utf-8'?>\n{text}")


def _failures(footprint: FootprintResult, result: Result) -> Iterator[str]:
    for contact in result.contacts:
        if contact.footprint == footprint.name:
            since = f'{result.since(contact.first):.3f} s'
            duration = lasting(contact.last - contact.first)
            when = f'at {since}' if duration == 'moment' else f'from {since} on for {duration} s'
            yield (f'in contact with {contact.obstacle} {when}, {contact.depth:.4f} m deep, '
                   f'found {how_found(contact, result)}')
    if footprint in result.too_soon:
        yield how_soon(footprint, result)
    if footprint in result.too_unknown:
        yield f'unknown for {footprint.unknown / 1e9:.3f} s'
    if footprint in result.too_undetermined:
        yield (f'undetermined for {result.undetermined_of(footprint) / 1e9:.3f} s, in which it is '
               'not known how something moved; --max-undetermined is '
               f'{result.options.max_undetermined:g} s')
    for name in footprint.refused:
        yield f'messages of {name} were refused: a contact may have been missed'


def _bag(result: Result) -> _Values:
    options = result.options
    bag: _Values = {
        'bag': result.bag, 'question': 'as live' if options.as_live else 'recorded motion',
        'verdict': result.verdict.words, 'duration': result.duration,
        'messages': result.messages, 'clock': options.clock, 'max_unknown': options.max_unknown,
        'max_undetermined': options.max_undetermined, 'min_ttc': options.min_ttc,
        'fail_on': options.fail_on,
        **dataclasses.asdict(dataclasses.replace(result, keyframes=None, options=Options()))}
    del bag['keyframes'], bag['options']
    for contact in bag['contacts']:
        del contact['deepest_as']
    for plan in bag['plan_contacts']:
        del plan['way'], plan['outline']
    for footprint, values in zip(result.footprints, bag['footprints']):
        values['coverage'] = footprint.coverage
        if options.min_ttc is None:
            del values['soonest'], values['time_to_collision']
        if footprint.plans is None:
            del values['plans'], values['plans_unknown']
    return bag


class BaselineError(ValueError):
    """The file is not a result that --json wrote."""


class BaselineBag(NamedTuple):
    """The result of a recording, as far as it is compared."""

    name: str
    content: object  # identifies the recording; without a digest it equals no other
    values: _Values


def read_baseline(path: str) -> list[BaselineBag]:
    """Return the recordings in a file that --json wrote; raise BaselineError if it is not one."""
    try:
        with open(path, encoding='utf-8') as file:
            stored = json.load(file)
        if (schema := stored['schema']) == SCHEMA:
            return [*map(_compared_part, stored['bags'])]
    except OSError as error:
        raise BaselineError(f'cannot read {path}: {error.strerror}') from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BaselineError(f'{path} is not a result that --json wrote') from error
    raise BaselineError(f'{path} has the schema {schema}, this version needs {SCHEMA}')


def differences_from(baseline: list[BaselineBag], results: list[Result]
                     ) -> list[tuple[str, list[str]]]:
    """
    Return each recording's name, with lines that say what differs.

    Recordings are matched by their content, wherever and however they are stored; others by the
    last part of their path. Contacts and unknown intervals are matched by footprint and obstacle,
    in order. The words of problems and notes, limits, curves, normals and points of contact are
    not compared.
    """
    checked = [*map(_compared_part, as_dict(results)['bags'])]
    left = list(baseline)
    expected: dict[int, _Values] = {}
    for key in attrgetter('content', 'name'), attrgetter('content'), attrgetter('name'):
        for place, bag in enumerate(checked):
            found = [number for number, other in enumerate(left) if key(other) == key(bag)]
            if found and place not in expected:
                expected[place] = left.pop(found[0]).values
    return [(bag.name, ['expected, but not checked']) for bag in left] + [
        (bag.name, [*_compared('', expected[place], bag.values)] if place in expected
         else ['checked, but not expected'])
        for place, bag in enumerate(checked)]


def _compared_part(bag: _Values) -> BaselineBag:
    return BaselineBag(PurePath(bag['bag']).name, bag.get('content') or object(), {
        **_without(bag, _LEFT_OUT),
        # A bag that cannot be written has a status of its own.
        'number of problems': sum(WRITING not in problem for problem in bag['problems']),
        'footprints': {one['name']: _without(one, _CURVES | {'refused'})
                       for one in bag['footprints']},
        'sources': {one['name']: _without(one, {'examples'}) for one in bag['sources']},
        'contacts': _numbered([_without(one, _MANIFOLD) for one in bag['contacts']],
                              'footprint', 'obstacle'),
        **{key: _numbered(bag[key], 'footprint')
           for key in ('plan_contacts', 'unknown', 'undetermined')}})


def _without(values: _Values, keys: set[str]) -> _Values:
    return {key: value for key, value in values.items() if key not in keys}


def _numbered(intervals: Iterable[_Values], *keys: str) -> _Values:
    """Return intervals by subject, those of the same subject numbered from 1."""
    named: _Values = {}
    counts: Counter[str] = Counter()
    for interval in intervals:
        about = ' - '.join(interval[key] for key in keys)
        counts[about] += 1
        named[f'{about} #{counts[about]}'] = interval
    return named


def _compared(where: str, expected: Any, found: Any) -> Iterator[str]:
    """Yield a line for each difference below a place in the result."""
    if isinstance(expected, dict) and isinstance(found, dict):
        for key in [*expected, *(key for key in found if key not in expected)]:
            below = f'{where}.{key}' if where else key
            if key not in found:
                yield f'{below} is missing, expected {json.dumps(expected[key])}'
            elif key not in expected:
                yield f'{below} is new: {json.dumps(found[key])}'
            else:
                yield from _compared(below, expected[key], found[key])
    elif not _same(where, expected, found):
        yield f'{where} is {json.dumps(found)}, expected {json.dumps(expected)}'


def _same(where: str, expected: Any, found: Any) -> bool:
    if where.rpartition('.')[2] in _ROUNDED and isinstance(expected, float) and (
            isinstance(found, (int, float))):
        return math.isclose(expected, found, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    return bool(expected == found)

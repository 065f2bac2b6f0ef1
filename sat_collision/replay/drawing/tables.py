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

"""What a page says in tables, in the words of the report on a terminal."""

from __future__ import annotations

from typing import Any

from sat_collision.replay.drawing.words import distance, name_of
from sat_collision.replay.film import MOST_CONTACTS
from sat_collision.replay.report import CLOCKS, how_found, lasting
from sat_collision.replay.result import Contact, FootprintResult, GRAVITY, Result

_MOST_DOUBTS = 200


def worst_first(results: list[Result]) -> list[Result]:
    """Return results by gravity of the verdict, of equal ones the least separation first."""
    def badness(result: Result) -> tuple[int, float]:
        return (-GRAVITY.index(result.verdict),
                result.least.separation if result.least else float('inf'))
    return sorted(results, key=badness)


def index_of(results: list[Result]) -> dict[str, Any]:
    """Return a table with a row for each result."""
    return {'head': ['recording', 'verdict', 'contacts', 'least separation', 'unknown [s]',
                     'duration [s]'],
            'rows': [[name_of(result), result.verdict.words, str(len(result.contacts)),
                      _least(result), f'{_unknown(result):.3f}', f'{result.duration:.3f}']
                     for result in results]}


def facts_of(result: Result) -> list[str]:
    """Return what was checked, and how, in short phrases."""
    if result.start is None:
        return [result.bag]
    facts = ['what the monitor would have said' if result.as_live else 'recorded motion',
             f'{result.duration:.3f} s by {CLOCKS[result.clock]}', f'{result.messages} messages',
             result.bag]
    if result.film:
        most = max(later - time for time, later in zip(
            result.film.moments, [*result.film.moments[1:], result.film.moments[-1]]))
        facts.insert(3, f'drawn at {len(result.film.moments)} moments, at least every '
                        f'{most / 1e9:.2g} s')
    return facts


def tables_of(result: Result, contacts: list[Contact]) -> list[dict[str, Any]]:
    """Return the tables of a result; in that of contacts each row is one of those given."""
    more = len(result.contacts) - len(contacts)
    deepest = f'the {MOST_CONTACTS} deepest; {more} more are in what --csv and --json write'
    longest = f'the {_MOST_DOUBTS} longest of {len(result.unknown)}'
    doubts = sorted(result.unknown, key=lambda one: one.first - one.last)[:_MOST_DOUBTS]
    return [{
        'title': 'Contacts', 'jumps': True, 'note': deepest if more else '',
        'head': ['footprint', 'obstacle', 'first [s]', 'duration [s]', 'depth [m]', 'x [m]',
                 'y [m]', 'found'],
        'rows': [[contact.footprint, contact.obstacle, f'{result.since(contact.first):.3f}',
                  lasting(contact.last - contact.first) + ('+' if contact.at_end else ''),
                  f'{contact.depth:.4g}', f'{contact.x:.3f}', f'{contact.y:.3f}',
                  how_found(contact, result)] for contact in contacts],
    }, {
        'title': 'Unknown', 'note': longest if len(doubts) < len(result.unknown) else '',
        'head': ['footprint', 'first [s]', 'duration [s]', 'reason'],
        'rows': [[one.footprint, f'{result.since(one.first):.3f}',
                  lasting(one.last - one.first), '; '.join(one.reasons)]
                 for one in sorted(doubts, key=lambda one: one.first)],
    }, {
        'title': 'Footprints', 'note': '',
        'head': ['footprint', 'topic', 'known', 'clear [s]', 'collision [s]', 'unknown [s]',
                 'least separation'],
        'rows': [_footprint(footprint, result) for footprint in result.footprints],
    }, {
        'title': 'Messages', 'note': '',
        'head': ['source', 'topic', 'received', 'rejected', 'motion not known [s]'],
        'rows': [[source.name, source.topic, str(source.received),
                  '; '.join(f'{count}: {reason} ({source.examples.get(reason, "")})'
                            for reason, count in source.rejected.items()) or '0',
                  f'{source.undecided / 1e9:.3f}'] for source in result.sources],
    }]


def _footprint(footprint: FootprintResult, result: Result) -> list[str]:
    coverage, least = footprint.coverage, footprint.least
    return [footprint.name, footprint.topic, '-' if coverage is None else f'{coverage:.2%}',
            *(f'{time / 1e9:.3f}'
              for time in (footprint.clear, footprint.collision, footprint.unknown)),
            f'{distance(least.separation)}, {least.obstacle}, at {result.since(least.time):.3f} s'
            if least else '-']


def _least(result: Result) -> str:
    least = result.least
    if least is None:
        return '-'
    whose = next(one.name for one in result.footprints if one.least is least)
    return f'{distance(least.separation)}: {whose} and {least.obstacle}'


def _unknown(result: Result) -> float:
    return sum(footprint.unknown for footprint in result.footprints) / 1e9

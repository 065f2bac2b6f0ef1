# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Results as one self-contained page for a browser."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from html import escape
from importlib.resources import files
import json
from math import inf
from typing import Any

import numpy as np
from sat_collision.replay.model.keyframes import Floats, Keyframes, ShownBody
from sat_collision.replay.model.result import (
    Contact, deepest_contacts, joined, least_of_all, MAX_CONTACTS, overall, PlanContact, Result,
    Sample, SEVERITY, spread, Unknown)
from sat_collision.replay.output.text import (
    CLOCKS, colours, distance, first_and_duration, INTERVAL, lanes_of, name_of, Table, tables_of,
    unknown_times)

_SCRIPTS = ('page.js', 'timeline.js', 'scene.js')
# Max characters of a page's data; the rest of the page is small.
_MAX_DATA = 7_500_000
# Coordinates are rounded to this, m.
_UNIT = 1e-4
# Max samples in all curves of a recording.
_MAX_SAMPLES = 40_000
_FEWEST_MOMENTS = 24
# Min characters of a recording's data for each sample of its curves, and each place of a plan.
_PER_SAMPLE, _PER_PLACE = 100, 20_000
# Characters: two numbers of two digits, and commas.
_LEAST_OF_VERTEX = 6


def write_page(results: list[Result], path: str) -> None:
    """
    Write a page of results of checks with `keyframes`, of at most 8 MB for up to 2,000 of them.

    The worst verdict comes first, of equal ones the least separation. Each recording has an equal
    share, of which tables and curves take up to three quarters: there are fewer rows where that
    would not do. Where the bodies would take more than the rest, they are shown at fewer moments,
    and then only those that come nearest to a footprint.
    """
    ordered = sorted(results, key=lambda result: (
        -SEVERITY.index(result.verdict), result.nearest[1].separation if result.nearest else inf))
    title = name_of(ordered[0]) if len(ordered) == 1 else (
        f'{len(ordered)} recordings: {overall(ordered).words}')
    index = _as_json(_index_of(ordered) if len(ordered) > 1 else None)
    share = (_MAX_DATA - len(index)) // len(ordered)
    recordings = [_fitted(result, share) for result in ordered]
    source = files(__package__)
    parts = {
        'title': escape(title),
        'style': source.joinpath('page.css').read_text('utf-8'),
        'data': f'{{"index":{index},"recordings":[{",".join(recordings)}]}}',
        'script': '\n'.join(source.joinpath(name).read_text('utf-8') for name in _SCRIPTS)}
    page = source.joinpath('page.html').read_text('utf-8')
    pieces = page.split('@@')
    with open(path, 'w', encoding='utf-8', errors='backslashreplace') as file:
        file.writelines(parts[piece] if k % 2 else piece for k, piece in enumerate(pieces))


def _as_json(value: Any) -> str:
    # '<' is escaped, as '</script>' would end the element that holds the data.
    return json.dumps(value, separators=(',', ':'), allow_nan=False).replace('<', '\\u003c')


def _fitted(result: Result, limit: int) -> str:
    """Return a recording as JSON of at most `limit` characters."""
    keyframes = result.keyframes or Keyframes([])
    most, without_bodies = MAX_CONTACTS, 3 * limit // 4
    while most > 1 and without_bodies < (
            size := len(_as_json(_recording(result, keyframes, [], [], limit, most)))):
        most = max(min(3 * most // 4, most * without_bodies // size), 1)
    needed = {keyframes.number(time) for contact in deepest_contacts(result)[:most]
              for time in (contact.first, contact.deepest)}
    numbers = list(range(len(keyframes.moments)))
    bodies = keyframes.bodies
    while True:
        # A lower bound of the size: what is surely too large need not be encoded.
        least = sum(_LEAST_OF_VERTEX * len(body.spans[0].ring) * min(len(body.spans), len(numbers))
                    for body in bodies)
        if least <= limit or not bodies:
            text = _as_json(_recording(result, keyframes, numbers, bodies, limit, most))
            if len(text) <= limit or not bodies:
                return text
        if len(numbers) > _FEWEST_MOMENTS:
            kept = [k for place, k in enumerate(numbers) if k in needed or place % 2 == 0]
            numbers = kept if len(kept) < 0.8 * len(numbers) else numbers[::2]
        else:
            bodies = _nearest_half(bodies)


def _nearest_half(bodies: list[ShownBody]) -> list[ShownBody]:
    """Return the footprints, and that half of the others which comes nearest to their paths."""
    own = [body for body in bodies if body.is_footprint]
    paths = np.array([span.ring[0] for body in own for span in body.spans] or [(0.0, 0.0)])
    paths = paths[::max(len(paths) // 200, 1)]

    def nearness(body: ShownBody) -> float:
        places = np.array([span.ring[0] for span in body.spans])
        return float(np.min(np.hypot(*(places[:, None] - paths).T)))

    others = sorted((body for body in bodies if not body.is_footprint), key=nearness)
    kept = set(own) | set(others[:len(others) // 2]) if others else set()
    return [body for body in bodies if body in kept]


def _recording(result: Result, keyframes: Keyframes, numbers: list[int],
               bodies: list[ShownBody], limit: int, most: int) -> dict[str, Any]:
    """Return a recording with `most` rows in a table; the limit is for curves and plans."""
    rows = {body: row for row, body in enumerate(bodies)}
    names = {footprint.name: k for k, footprint in enumerate(result.footprints)}
    contacts = sorted(deepest_contacts(result)[:most], key=lambda contact: contact.first)
    places = {id(contact): k for k, contact in enumerate(contacts)}
    name, least = result.nearest or ('', None)
    moments = [keyframes.moments[k] for k in numbers]
    count = max(min(_MAX_SAMPLES, limit // _PER_SAMPLE) // max(len(names), 1), 16)
    longest = max(limit // _PER_PLACE, 2)
    return {
        'name': name_of(result), 'verdict': result.verdict.words, 'asLive': result.options.as_live,
        'problems': _first(result.problems, most), 'notes': _first(result.notes, most),
        'facts': _facts_of(result, moments, len(keyframes.bodies) - len(bodies)),
        'tables': _tables_of(result, contacts, most),
        'start': result.since(result.start or 0), 'end': result.since(result.end or 0),
        'footprints': [
            {'name': footprint.name, 'colour': colour,
             'times': [time for time, _ in samples], 'values': [value for _, value in samples],
             'ahead': _curve(result, footprint.time_to_collision, count),
             'unknown': _unknown_of(result, footprint.name, most)}
            for footprint, colour in zip(result.footprints, colours(result).values())
            for samples in [_curve(result, footprint.separation, count)]],
        'lanes': [{**lane._asdict(), 'bars': [
            {**bar._asdict(), 'contact': places.get(id(bar.contact))} for bar in lane.bars]}
            for lane in lanes_of(result, most)],
        'contacts': [_contact(contact, result, rows, names) for contact in contacts],
        'plans': [_plan(one, result, names, longest) for one in result.plan_contacts[:most]],
        'times': [round(result.since(time), 6) for time in moments], 'unit': _UNIT,
        'bodies': [_body(body, names, numbers) for body in bodies],
        'begin': result.since(least.time if least else result.start or 0),
        'beginAt': [names[name], least.x, least.y] if least else None}


def _curve(result: Result, samples: list[Sample], limit: int) -> list[tuple[float, float | None]]:
    """Return at most `limit` rounded samples, the least of each run of neighbours."""
    step = max(-(-len(samples) // limit), 1)
    runs = [samples[k:k + step] for k in range(0, len(samples), step)]
    leasts = [(run[0][0], least_of_all(value for _, value in run)) for run in runs]
    return [(round(result.since(time), 6), value and float(f'{value:.6g}'))
            for time, value in leasts]


def _more(which: str, shown: int, count: int) -> str:
    """Return what is to be said of a table that does not show all, empty if it does."""
    return (f'the {which} {shown}; {count - shown} more are in what --json writes'
            if count > shown else '')


def _first(texts: list[str], most: int) -> list[str]:
    """Return the first texts, and which they are if these are not all."""
    return [*texts[:most], *filter(None, [_more('first', most, len(texts))])]


def _unknown_of(result: Result, name: str, most: int) -> list[tuple[float, float, str]]:
    """Return when a footprint is unknown or undetermined, in s, and why; many are joined."""
    found = [(result.since(one.first), result.since(one.last),
              f'{state}: {"; ".join(one.reasons)}')
             for state, intervals in result.undecided.items()
             for one in intervals if one.footprint == name]
    if len(found) <= most:
        return found
    return [(first, last, f'{state}: for several reasons, see the table')
            for first, last, state in unknown_times(result, name, most)]


def _contact(contact: Contact, result: Result, rows: dict[ShownBody, int],
             names: dict[str, int]) -> dict[str, Any]:
    keyframes = result.keyframes or Keyframes([])
    bodies = keyframes.footprint(contact.footprint), result.obstacle_of(contact)
    return {
        'footprint': names[contact.footprint], 'obstacle': contact.obstacle,
        'words': distance(contact.least.separation), 'value': contact.least.separation,
        'x': contact.x, 'y': contact.y,
        'points': contact.points, 'normal': contact.normal,
        'first': result.since(contact.first), 'last': result.since(contact.last),
        'deepest': result.since(contact.deepest),
        'bodies': [rows[body] for body in bodies if body in rows]}


def _plan(contact: PlanContact, result: Result, names: dict[str, int],
          limit: int) -> dict[str, Any]:
    way = spread(contact.way, limit)
    return {'footprint': names[contact.footprint], 'first': result.since(contact.time),
            'last': result.since(contact.until),
            **{key: np.round(places, 4).ravel().tolist()
               for key, places in (('way', way), ('outline', contact.outline))}}


def _body(body: ShownBody, names: dict[str, int], numbers: Sequence[int]) -> dict[str, Any]:
    """
    Return where a body is, as spans [first, end, name, known, ring].

    The name is null where it is that of the span before. A ring is 1 and x and y in turn, in
    units; or 0 and how much they differ from the ring before, of as many vertices.
    """
    spans: list[list[Any]] = []
    name: str | None = None
    last: Any = ()
    for span in body.spans:
        first, end = bisect_left(numbers, span.first), bisect_left(numbers, span.end)
        if first == end:
            continue
        ring = _ring(span.ring)
        differs = len(last) != len(ring)
        spans.append([first, end, None if span.name == name else span.name, span.known,
                      [int(differs), *(ring if differs else ring - last).tolist()]])
        name, last = span.name, ring
    return {'footprint': names[body.spans[0].name] if body.is_footprint else None, 'spans': spans}


def _ring(ring: Floats) -> Any:
    """Return x and y in turn, in units, anticlockwise."""
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    area = float(x[:-1] @ y[1:] - y[:-1] @ x[1:])
    return np.rint((ring if area >= 0 else ring[::-1]) / _UNIT).ravel().astype(np.int64)


def _index_of(results: list[Result]) -> dict[str, Any]:
    """Return a table with a row for each result."""
    rows = []
    for result in results:
        name, least = result.nearest or ('', None)
        rows.append([
            name_of(result), result.verdict.words, str(len(result.contacts)),
            f'{distance(least.separation)}: {name} and {least.obstacle}' if least else '-',
            f'{sum(one.unknown for one in result.footprints) / 1e9:.3f}',
            f'{result.duration:.3f}'])
    return {'head': ['recording', 'verdict', 'contacts', 'least separation', 'unknown [s]',
                     'duration [s]'], 'rows': rows}


def _facts_of(result: Result, moments: list[int], left_out: int) -> list[str]:
    """Return what was checked, and how, in short phrases."""
    if result.start is None:
        return [result.bag]
    facts = ['what the monitor would have said' if result.options.as_live else 'recorded motion',
             f'{result.duration:.3f} s by {CLOCKS[result.options.clock]}',
             f'{result.messages} messages']
    if moments:
        most = max(later - time for time, later in zip(moments, [*moments[1:], moments[-1]]))
        facts.append(f'drawn at {len(moments)} moments, at least every {most / 1e9:.2g} s, and '
                     'between them on straight lines')
    if left_out:
        facts.append(f'{left_out} more distant obstacles are not drawn')
    return [*facts, result.bag]


def _longest(result: Result, intervals: list[Unknown], most: int) -> tuple[str, Table]:
    """Return a note and the longest times, one row for the footprints of each time and reason."""
    times: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for one in intervals:
        for reason in one.reasons:
            times.setdefault((one.footprint, reason), []).append((one.first, one.last))
    names: dict[tuple[int, int, str], list[str]] = {}
    for (name, reason), found in times.items():
        for first, last in joined(found, 0):
            names.setdefault((first, last, reason), []).append(name)
    longest = sorted(names.items(), key=lambda item: item[0][0] - item[0][1])[:most]
    return (_more('longest', most, len(names)), Table(INTERVAL, [
        (', '.join(own), *first_and_duration(Unknown('', first, last, []), result), reason)
        for (first, last, reason), own in sorted(longest)]))


def _tables_of(result: Result, contacts: list[Contact], most: int) -> list[dict[str, Any]]:
    """Return the tables of a result; in that of contacts each row is one of those given."""
    found = tables_of(result, contacts)
    deepest = _more('deepest', len(contacts), len(result.contacts))
    sample = '' if result.options.as_live else (
        'found at a sample: at the stamp of a message; else in the motion between two messages')
    footprints = found['footprints']
    tables = [
        ('Contacts', '; '.join(filter(None, (deepest, sample))), found['contacts']),
        ('Plans in contact', '', found['plans in contact']),
        ('Plans', '', found['plans checked']),
        *((state.capitalize(), *_longest(result, intervals, most))
          for state, intervals in result.undecided.items()),
        ('Footprints', '', Table((*footprints.head, 'topic'), [
            (*row, one.topic) for row, one in zip(footprints.rows, result.footprints)])),
        ('Least time to collision', '', found['least time to collision']),
        ('Messages', '', Table(
            ('source', 'topic', 'received', 'lost', 'motion undetermined [s]'),
            [(source.name, source.topic, str(source.received), str(source.lost),
              f'{source.undetermined / 1e9:.3f}') for source in result.sources])),
        ('Rejections', '', Table(('source', 'messages', 'reason', 'the first one'), [
            (source.name, str(count), reason, source.examples.get(reason, ''))
            for source in result.sources for reason, count in source.rejected.items()]))]
    return [{'title': title, 'note': note or _more('first', most, len(table.rows)),
             'head': table.head, 'rows': table.rows[:most]} for title, note, table in tables]

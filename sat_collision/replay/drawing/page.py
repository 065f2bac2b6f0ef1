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

"""Results as one page to look at in a browser, with nothing to be loaded from elsewhere."""

from __future__ import annotations

from html import escape
from importlib.resources import files
import json
from typing import Any

from plotly.offline import get_plotlyjs
from sat_collision.replay.drawing.bands import Lane, lanes_of
from sat_collision.replay.drawing.tables import facts_of, index_of, tables_of, worst_first
from sat_collision.replay.drawing.words import colours, distance, name_of
from sat_collision.replay.film import deepest_contacts, Film, FilmedBody, Floats
from sat_collision.replay.result import Contact, overall, Result

_SCRIPTS = ('page.js', 'timeline.js', 'scene.js', 'start.js')
# Decimals of coordinates, m.
_FINENESS = 4


def write_page(results: list[Result], path: str) -> None:
    """
    Write a page of results, the worst first.

    Parameters
    ----------
    results : list of Result
        Of checks with `film`.
    path : str

    """
    ordered = worst_first(results)
    title = name_of(ordered[0]) if len(ordered) == 1 else (
        f'{len(ordered)} recordings: {overall(ordered).words}')
    data = {'index': index_of(ordered) if len(ordered) > 1 else None,
            'recordings': [_recording(result) for result in ordered]}
    source = files(__package__)
    parts = {
        'title': escape(title),
        'style': source.joinpath('page.css').read_text('utf-8'),
        'library': get_plotlyjs(),
        # What would end the script that holds it is written in another way.
        'data': json.dumps(data, separators=(',', ':'), allow_nan=False).replace('<', '\\u003c'),
        'script': '\n'.join(source.joinpath(name).read_text('utf-8') for name in _SCRIPTS)}
    page = source.joinpath('page.html').read_text('utf-8')
    pieces = page.split('@@')
    with open(path, 'w', encoding='utf-8') as file:
        file.writelines(parts[piece] if k % 2 else piece for k, piece in enumerate(pieces))


def _recording(result: Result) -> dict[str, Any]:
    film = result.film or Film([])
    rows = {body: row for row, body in enumerate(film.bodies)}
    names = {footprint.name: k for k, footprint in enumerate(result.footprints)}
    contacts = deepest_contacts(result)
    contacts.sort(key=lambda contact: contact.first)
    numbers = {id(contact): k for k, contact in enumerate(contacts)}
    least = result.least
    return {
        'name': name_of(result), 'verdict': result.verdict.words, 'asLive': result.as_live,
        'problems': result.problems, 'notes': result.notes, 'facts': facts_of(result),
        'tables': tables_of(result, contacts),
        'start': result.since(result.start or 0),
        'end': result.since(result.end or 0),
        'footprints': [
            {'name': footprint.name, 'colour': colour,
             'times': [round(result.since(time), 6) for time, _ in footprint.separation],
             'values': [value for _, value in footprint.separation],
             'unknown': [[film.number(one.first), film.number(one.last), '; '.join(one.reasons)]
                         for one in result.unknown if one.footprint == footprint.name]}
            for footprint, colour in zip(result.footprints, colours(result).values())],
        'lanes': [_lane(lane, numbers) for lane in lanes_of(result)],
        'contacts': [_contact(contact, film, rows, names) for contact in contacts],
        'times': [round(result.since(time), 6) for time in film.moments],
        'bodies': [_body(body, names) for body in film.bodies],
        'begin': film.number(least.time) if least else 0,
        'beginAt': next(([names[one.name], least.x, least.y] for one in result.footprints
                         if least and one.least is least), None)}


def _lane(lane: Lane, numbers: dict[int, int]) -> dict[str, Any]:
    return {'name': lane.name, 'first': lane.first, 'end': lane.end,
            'bands': [{'row': band.row, 'first': band.first, 'last': band.last,
                       'text': band.text, 'contact': numbers.get(id(band.contact))}
                      for band in lane.bands]}


def _contact(contact: Contact, film: Film, rows: dict[FilmedBody, int],
             names: dict[str, int]) -> dict[str, Any]:
    bodies = film.footprint(contact.footprint), film.obstacle(contact)
    return {
        'footprint': names[contact.footprint], 'obstacle': contact.obstacle,
        'words': distance(0.0 - contact.depth), 'value': 0.0 - contact.depth,
        'x': contact.x, 'y': contact.y,
        # Numbers of the moments that it lasts, and of the deepest one.
        'first': film.number(contact.first), 'end': film.number(contact.last + 1),
        'deepest': film.number(contact.deepest),
        'bodies': [rows[body] for body in bodies if body is not None]}


def _body(body: FilmedBody, names: dict[str, int]) -> dict[str, Any]:
    return {'footprint': names[body.spans[0].name] if body.is_footprint else None,
            'spans': [[span.first, span.end, span.name, span.known, _ring(span.ring)]
                      for span in body.spans]}


def _ring(ring: Floats) -> list[float]:
    """Return x and y in turn, anticlockwise: rings drawn as one shape must run the same way."""
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    area = float(x[:-1] @ y[1:] - y[:-1] @ x[1:])
    numbers: list[float] = (ring if area >= 0 else ring[::-1]).round(_FINENESS).ravel().tolist()
    return numbers

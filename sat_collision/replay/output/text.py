# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Results for people: the report, its words and tables, colours, rows of a chart, progress."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import colorsys
import os
from pathlib import Path
import re
import sys
import time
from typing import Any, NamedTuple, TextIO

from sat_collision.extras import printable
from sat_collision.replay.model.result import (
    BETWEEN_SAMPLES, Contact, deepest_contacts, FootprintResult, joined, MAX_CONTACTS, overall,
    Result, Unknown, Verdict)

_MAX_ROWS = 20
_MAX_WORST = 5
_NO_PLAN = 'there is no plan'
_MOMENT = 500_000
# A cell that is aligned to the right.
_NUMBER = re.compile(r'(-?\d+(\.\d+)?(e[-+]\d+)?|moment)?[+ %]*')
INTERVAL = 'footprint', 'first [s]', 'duration [s]', 'reason'
# Green, red, yellow and magenta.
_COLOURS = {Verdict.CLEAR: 32, Verdict.COLLISION: 31, Verdict.UNKNOWN: 33, Verdict.BAD_INPUT: 35}
# Widths of the progress bar: a longer line would wrap and could not be removed.
_LONGEST = 25
_BAR = 30
_DELAY = 1.0
_REDRAW = 0.1
CLOCKS = {'receive': 'receive time', 'header': 'header stamps'}
# Colours of pictures and pages; red means contact, grey unknown.
RED, GREY, OBSTACLE, INK = '#d62728', '#9aa0a6', '#5b7089', '#2b3138'
_LINES = ('#1f77b4', '#e08214', '#7b52ab', '#1a9e96', '#8c564b', '#3f8f3f', '#c2559d', '#6b7a1f')
# Of more footprints: hues from orange to violet.
_FIRST_HUE, _LAST_HUE = 0.08, 0.9
# Max rows of a footprint in a chart, for bars that overlap in time.
_MAX_BAR_ROWS = 4
# More unknown times than this for each contact that may be shown are joined across short gaps.
_TIMES_A_CONTACT = 5


class Progress:
    """A bar on a terminal that appears when a run takes long, and vanishes after it."""

    def __init__(self, what: str = '', stream: TextIO = sys.stderr) -> None:
        self._what = f'{what[:_LONGEST]} ' if what else ''
        self._stream = stream
        self._begun = time.monotonic()
        self._next = self._begun + _DELAY if stream.isatty() else float('inf')
        self._shown = False

    def show(self, share: float) -> None:
        """Show that a share of the work is done."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + _REDRAW
        self._shown = True
        bar = f'{self._what}[{"#" * round(_BAR * share):{_BAR}}] {share:4.0%}'
        if share:
            bar += f'  {(now - self._begun) * (1.0 / share - 1.0):.0f} s left'
        print(f'\r\033[K{bar}', end='', file=self._stream, flush=True)

    def clear(self) -> None:
        """Remove the bar."""
        if self._shown:
            print('\r\033[K', end='', file=self._stream, flush=True)
            self._shown = False


def with_colour(lines: list[str], verdict: Verdict, stream: TextIO) -> list[str]:
    """Return lines with the verdict at their ends coloured, if the stream supports it."""
    # https://no-color.org: whatever it is set to, unless it is empty.
    if os.environ.get('NO_COLOR') or os.environ.get('TERM') == 'dumb' or not stream.isatty():
        return lines
    word = verdict.words.upper()
    coloured = f'\033[1;{_COLOURS[verdict]}m{word}\033[0m'
    return [line.removesuffix(word) + coloured if line.endswith(f' {word}') else line
            for line in lines]


def report(result: Result) -> list[str]:
    """Return the lines of the report on one recording."""
    lines = [f'{result.bag}: {result.verdict.words.upper()}']
    lines += [f'  problem: {problem}' for problem in result.problems]
    lines += [f'  note: {note}' for note in result.notes]
    if result.start is None:
        return lines
    question = 'as live' if result.options.as_live else 'recorded motion'
    sources = ', '.join(f'{source.name} {source.received}' for source in result.sources)
    lines.append(f'  {question}, {result.duration:.3f} s by {CLOCKS[result.options.clock]}, '
                 f'{result.messages} messages ({sources})')
    for source in result.sources:
        for reason, count in source.rejected.items():
            lines.append(f'  {source.name}: {count} messages rejected: {reason}')
            # A message gives one example, also if its polygons are refused for several reasons.
            if reason in source.examples:
                lines.append(f'    the first one: {source.examples[reason]}')
    lines += [f'  {source.name}: {source.lost} messages lost when it was recorded'
              for source in result.sources if source.lost]
    lines += [f'  {one.name}: {how_soon(one, result)}' for one in result.too_soon]
    for title, table in tables_of(result, result.contacts).items():
        lines += _in_lines(title, table)
    for state, intervals in result.undecided.items():
        lines += _in_lines(state, Table(INTERVAL, [
            (one.footprint, *first_and_duration(one, result), '; '.join(one.reasons))
            for one in intervals if one.last - one.first >= _MOMENT]))
    return lines


def how_soon(footprint: FootprintResult, result: Result) -> str:
    """Return in words how much too soon a footprint would have collided."""
    least = footprint.soonest
    return '' if least is None else (
        f'a collision with {least.obstacle} was {least.time_to_collision:.3f} s ahead at '
        f'{result.since(least.time):.3f} s, --min-ttc is {result.options.min_ttc:g} s')


class Table(NamedTuple):
    """The head and the rows of a table."""

    head: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]


def tables_of(result: Result, contacts: Sequence[Contact]) -> dict[str, Table]:
    """Return what was found, with some of the contacts, as tables by title."""
    footprints = result.footprints
    return {
        'footprints': Table(
            ('footprint', 'known', 'clear [s]', 'collision [s]', 'unknown [s]',
             'undetermined [s]', 'least separation'),
            [(one.name + ('' if one.enabled else ' (disabled)'),
              '' if one.coverage is None else f'{100 * one.coverage:.2f} %',
              *(f'{time / 1e9:.3f}'
                for time in (one.clear, one.collision, one.unknown, one.undetermined)),
              'none known' if (least := one.least) is None else
              f'{least.separation:.4g} m from {least.obstacle} at {result.since(least.time):.3f} s'
              ) for one in footprints]),
        'least time to collision': Table(
            ('footprint', 'obstacle', 'at [s]', 'time to collision [s]'),
            [(one.name, soonest.obstacle, f'{result.since(soonest.time):.3f}',
              f'{soonest.time_to_collision:.3f}')
             for one in footprints if (soonest := one.soonest)]),
        'plans checked': Table(
            ('footprint', 'plans', 'unknown', 'why'),
            [(one.name, str(one.plans), str(sum(one.plans_unknown.values())),
              ', '.join(f'{reason} ({count})' for reason, count in one.plans_unknown.items())
              or ('' if one.plans else _NO_PLAN))
             for one in footprints if one.plans is not None]),
        'plans in contact': Table(
            ('footprint', 'obstacle', 'at [s]', 'pose', 'after [m]'),
            [(one.footprint, one.obstacle, f'{result.since(one.time):.3f}', f'{one.pose:.2f}',
              f'{one.metres:.3f}') for one in result.plan_contacts]),
        'contacts': Table(
            ('footprint', 'obstacle', 'first [s]', 'duration [s]', 'depth [m]', 'x [m]', 'y [m]',
             'found'),
            [(one.footprint, one.obstacle, *first_and_duration(one, result, one.at_end),
              f'{one.depth:.4g}', f'{one.x:.3f}', f'{one.y:.3f}', how_found(one, result))
             for one in contacts])}


def first_and_duration(one: Contact | Unknown, result: Result, goes_on: bool = False
                       ) -> tuple[str, str]:
    """Return when an interval begins, and how long it is."""
    return (f'{result.since(one.first):.3f}',
            lasting(one.last - one.first) + ('+' if goes_on else ''))


def plan_failures(footprint: FootprintResult, result: Result) -> list[str]:
    """Return in words which plans of a footprint are in contact or unknown, or that none was."""
    found = [f'the plan at {result.since(one.time):.3f} s is in contact with {one.obstacle} at '
             f'pose {one.pose:.2f}, after {one.metres:.3f} m'
             for one in result.plan_contacts if one.footprint == footprint.name]
    found += [f'{count} plans are unknown: {reason}'
              for reason, count in footprint.plans_unknown.items()]
    return found or ([] if footprint.plans else [_NO_PLAN])


def lasting(duration: int) -> str:
    """Return a duration in ns as text in s; 'moment' where it would be rounded to 0."""
    return f'{duration / 1e9:.3f}' if duration >= _MOMENT else 'moment'


def how_found(contact: Contact, result: Result) -> str:
    """Return in words how a contact was found: at a sample, or between which times."""
    before, after = contact.between
    if contact.found != BETWEEN_SAMPLES or before is None or after is None:
        return contact.found
    return f'between {result.since(before):.3f} and {result.since(after):.3f} s'


def name_of(result: Result) -> str:
    """Return the name of a recording, as text that can be drawn."""
    return printable(Path(result.bag).name or result.bag)


def distance(separation: float) -> str:
    """Return a separation in words."""
    if separation > 0.0:
        return f'{separation:.3g} m apart'
    return f'{-separation:.3g} m deep' if separation < 0.0 else 'touching'


def report_all(results: list[Result]) -> list[str]:
    """Return the lines of the summary of several recordings."""
    figures = summary(results)
    counts = ', '.join(f'{count} {word}' for word, count in figures['verdicts'].items())
    rate = figures['contacts_per_hour']
    an_hour = '' if rate is None else f', {rate:.4g} an hour'
    return [
        f'{figures["bags"]} recordings, {figures["duration"] / 3600:.4g} h: {counts}',
        f'  {figures["contacts"]} contacts{an_hour}',
        *_in_lines('worst separations', Table(
            ('recording', 'footprint', 'obstacle', 'separation [m]'),
            [(worst['bag'], worst['footprint'], worst['obstacle'],
              f'{worst["separation"]:.4g}') for worst in figures['worst']])),
        f'  {overall(results).words.upper()}']


def summary(results: list[Result]) -> dict[str, Any]:
    """Return the figures over several recordings, the least separations among them."""
    hours = sum(result.duration for result in results) / 3600
    contacts = sum(len(result.contacts) for result in results)
    verdicts = Counter(result.verdict for result in results)
    leasts = [(one.least.separation, result.bag, one.name, one.least.obstacle)
              for result in results for one in result.footprints if one.least]
    return {
        'bags': len(results), 'duration': 3600 * hours, 'contacts': contacts,
        'contacts_per_hour': contacts / hours if hours else None,
        'verdicts': {verdict.words: count for verdict, count in sorted(verdicts.items())},
        'worst': [dict(zip(('separation', 'bag', 'footprint', 'obstacle'), one))
                  for one in sorted(leasts)[:_MAX_WORST]]}


def _in_lines(title: str, table: Table) -> list[str]:
    """Return the lines of a table, of the first _MAX_ROWS rows only."""
    rows = table.rows
    if not rows:
        return []
    shown = [table.head, *rows[:_MAX_ROWS]]
    widths = [max(map(len, column)) for column in zip(*shown)]
    aligned = ['>' if all(map(_NUMBER.fullmatch, column[1:])) else '<' for column in zip(*shown)]
    lines = [f'  {title}'] + ['    ' + '  '.join(
        f'{cell:{align}{width}}' for cell, align, width in zip(row, aligned, widths)).rstrip()
        for row in shown]
    if len(rows) > _MAX_ROWS:
        lines.append(f'    and {len(rows) - _MAX_ROWS} more; --json and --csv have all')
    return lines


def colours(result: Result) -> dict[str, str]:
    """Return the colour of each footprint, another one for each."""
    names = [footprint.name for footprint in result.footprints]
    if len(names) <= len(_LINES):
        return dict(zip(names, _LINES))
    found = {}
    for k, name in enumerate(names):
        hue = _FIRST_HUE + (_LAST_HUE - _FIRST_HUE) * k / len(names)
        parts = colorsys.hls_to_rgb(hue, (0.38, 0.5, 0.6)[k % 3], 0.6)
        found[name] = '#' + ''.join(f'{round(255 * part):02x}' for part in parts)
    return found


class Bar(NamedTuple):
    """A contact, or a time (s since the recording begins) as unknown_times has them."""

    row: int  # from above, counted over all footprints
    first: float
    last: float
    text: str
    contact: Contact | None


class Lane(NamedTuple):
    """The rows of a footprint, from the first until before the end, and their bars."""

    name: str
    first: int
    end: int
    bars: list[Bar]


def lanes_of(result: Result, most: int = MAX_CONTACTS) -> list[Lane]:
    """Return the lane of each footprint, in whose rows the `most` deepest contacts come first."""
    found = []
    first = 0
    for footprint in result.footprints:
        bars = [*(Bar(0, result.since(one.first), result.since(one.last), one.obstacle, one)
                  for one in deepest_contacts(result)[:most] if one.footprint == footprint.name),
                *(Bar(0, *interval, None)
                  for interval in unknown_times(result, footprint.name, most))]
        rows: list[list[Bar]] = [[] for _ in range(_MAX_BAR_ROWS)]
        for bar in bars:
            # They overlap only where all rows are taken.
            free = (k for k, taken in enumerate(rows) if all(
                bar.last <= other.first or other.last <= bar.first for other in taken))
            k = next(free, _MAX_BAR_ROWS - 1)
            rows[k].append(bar._replace(row=first + k))
        end = first + max(sum(map(bool, rows)), 1)
        found.append(Lane(footprint.name, first, end, [bar for row in rows for bar in row]))
        first = end
    return found


def unknown_times(result: Result, name: str, most: int) -> list[tuple[float, float, str]]:
    """
    Return when a footprint is unknown or undetermined for any reason, in s, and which.

    There are about five times `most` of them at most.
    """
    times = []
    many = _TIMES_A_CONTACT * most
    for state, intervals in result.undecided.items():
        found = [(result.since(one.first), result.since(one.last)) for one in intervals
                 if one.footprint == name]
        # Gaps between very many are too short to be seen.
        gap = result.duration / many if len(found) > many else 0.0
        times += [(first, last, state) for first, last in joined(found, gap)]
    return times

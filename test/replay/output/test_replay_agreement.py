# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
All outputs of a check say the same.

Random recordings are checked by the command, as recorded motion and as live. From each output are
read back the verdict, contacts, unknown and undetermined times of each footprint, plans in contact
and losses: from JSON, CSV, JUnit, the report, the data of the page and messages of the bag. Each
is compared with JSON, whose verdict and totals follow from its times.
"""

import csv
import json
import re
from typing import NamedTuple
from xml.etree import ElementTree

from builders import path as plan, SECOND, serialised, transforms
import numpy as np
import pytest
from random_recordings import FORMS, METRE, outline, Recorded
from recordings import (
    COLLECTION, INSTANCE, losses, LOST, LOST_TOPIC, main, MARKS, STAMPS, START, write)
from rosbags.highlevel import AnyReader
from sat_collision.replay.model.result import joined

# How far apart are two times, one of which is rounded to ms.
NEAR = SECOND // 2000 + 1
TYPES = {'/tf': 'tf2_msgs/msg/TFMessage', '/plan': 'nav_msgs/msg/Path', LOST_TOPIC: LOST}
FOOTPRINTS = 'tall', 'short', 'carrier'
UNDECIDED = 'unknown', 'undetermined'


class Case(NamedTuple):
    """A recording, and what follows."""

    form: str | None
    seed: int
    verdict: str
    away: int = 0  # how far all footprints are from where obstacles are, m
    has_losses: bool = False
    is_damaged: bool = False
    max_unknown: float = 0.5
    max_undetermined: float = 0.0
    fail_on: str | None = None


CASES = {
    **{f'contact {form}': Case(form, 3, 'collision', has_losses=True) for form in FORMS},
    'contact at the start': Case('ids', 6, 'collision', has_losses=True, max_unknown=0.2),
    'clear': Case(MARKS, 1, 'clear', away=-100, max_unknown=100.0, max_undetermined=100.0),
    'unknown': Case('ids', 1, 'unknown', away=-100),
    'damaged': Case(None, 3, 'bad input', away=-100, is_damaged=True),
    'plan': Case(STAMPS, 3, 'collision', away=-100, has_losses=True, fail_on='plan')}


class Checked:
    """A random recording with three footprints, one of them with plans, and its outputs."""

    def __init__(self, case, as_live, folder):
        form = case.form
        self.bag = folder / 'bag'
        self._write(case)
        parameters = {
            'footprints': [*FOOTPRINTS], 'obstacles': ['walls'], 'frame_id': 'map',
            'tall.topic': '/footprint', 'short.topic': '/short', 'carrier.path': '/plan',
            'carrier.frame_id': 'carrier',
            'carrier.points': [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0], 'future_tolerance': 0.1,
            **{f'{name}.timeout': 0.5 for name in (*FOOTPRINTS, 'walls')}}
        if form in (MARKS, STAMPS):
            parameters['walls.set_end'] = form
        limits = {name: getattr(case, name) for name in (
            'max_unknown', 'max_undetermined', 'fail_on')}
        self.paths = {kind: folder / f'result.{kind}' for kind in ('json', 'csv', 'junit', 'html')}
        self.written = folder / 'written'
        params = folder / 'params.yaml'
        params.write_text(json.dumps({'/**': {'ros__parameters': parameters}}))
        self.arguments = [
            str(self.bag), f'--params-file={params}',
            *(['--as-live', f'--write-bag={self.written}'] if as_live else []),
            *(f'--{name.replace("_", "-")}={limit}' for name, limit in limits.items() if limit),
            *(f'--{kind.replace("html", "plot")}={path}' for kind, path in self.paths.items())]

    def _write(self, case):
        recorded, short, carrier = (Recorded(case.seed + k, case.form, most=64) for k in range(3))
        away = case.away
        recorded.messages = [
            (topic, time, k, x + METRE * away if topic == 'footprint' else x)
            for topic, time, k, x in recorded.messages if topic != 'second']
        messages = [(f'/{topic}', time / SECOND, data)
                    for topic, time, data in recorded.messages_of_bag()]
        # These two meet obstacles of one lane only.
        messages += [('/short', time / SECOND, serialised(
            outline(x + METRE * away, 0, 0, 1), START + time))
            for time, x in short.samples['footprint']]
        messages += [('/tf', time / SECOND, transforms(
            ('map', 'carrier', START + time, x / METRE + away, 1000.0)))
            for time, x in carrier.samples['footprint']]
        # From where it is through all places of the obstacles of its lane.
        way = [(x, 1000.0, 0.0) for x in (away - 9.0, 9.0)]
        messages += [('/plan', time, plan(way, START + round(time * SECOND), 'map'))
                     for time in np.arange(0.3, recorded.end / SECOND, 0.4).tolist()]
        if case.has_losses:
            messages.append(losses(1.0, walls=(1, 2), plan=(1, 0)))
        types = {'collection': {'/walls': COLLECTION}, 'ids': {'/walls': INSTANCE}}
        write(self.bag, messages, types={**TYPES, **types.get(case.form, {})})
        if case.is_damaged:
            file = self.bag / 'bag.mcap'
            file.write_bytes(file.read_bytes()[:-3000])


def times(intervals, *keys):
    """Return the intervals of JSON as (what its keys say, first, last)."""
    return sorted((*(one[key] for key in keys), one['first'], one['last']) for one in intervals)


def total(intervals):
    return sum(last - first for first, last in joined(intervals))


def without(intervals, others):
    """Return how long it is in some intervals but in no other ones."""
    return total([*intervals, *others]) - total(others)


def matches(found, expected):
    """Return whether tuples that end with two times are the same, but for rounding to ms."""
    return len(found) == len(expected) and all(
        one[:-2] == other[:-2] and one[-2:] == pytest.approx(other[-2:], abs=2 * NEAR)
        for one, other in zip(sorted(found), sorted(expected)))


def of_footprint(bag, name):
    """Return when a footprint is in contact, unknown and undetermined, according to JSON."""
    return [[(first, last) for of, first, last in times(bag[key], 'footprint') if of == name]
            for key in ('contacts', *UNDECIDED)]


def verdict_of(bag, failures):
    """Return the verdict that follows from JSON, with what fails by footprint."""
    if bag['contacts'] or bag['fail_on'] == 'plan' and bag['plan_contacts']:
        return 'collision'
    return 'bad input' if bag['problems'] else 'unknown' if failures else 'clear'


def failures_of(bag):
    """Return (footprint, state, ns) where that is longer than allowed by the docs."""
    found = []
    for one in bag['footprints']:
        known_from = bag['start'] + one['start_up']
        contact, unknown, undetermined = of_footprint(bag, one['name'])
        late = without(unknown, [(bag['start'], known_from), *contact])
        if late > SECOND * bag['max_unknown'] or not one['ever_known']:
            found.append((one['name'], 'unknown', one['unknown']))
        end = one['last'] or 0
        limited = without([(max(first, known_from), min(last, end)) for first, last in undetermined
                           if max(first, known_from) < min(last, end)], contact)
        if limited > SECOND * bag['max_undetermined']:
            found.append((one['name'], 'undetermined', limited))
        if 'plans' in one and bag['fail_on'] and (one['plans_unknown'] or not one['plans']):
            found.append((one['name'], 'plans', sum(one['plans_unknown'].values())))
    return found


def agrees_json(bag):
    """Compare the totals of footprints with their intervals, and the verdict with all."""
    for one in bag['footprints']:
        contact, unknown, undetermined = of_footprint(bag, one['name'])
        assert one['collision'] == total(contact)
        assert one['unknown'] == without(unknown, contact)
        assert one['undetermined'] == without(undetermined, [*contact, *unknown])
        assert sum(one[key] for key in ('clear', 'collision', *UNDECIDED)) == (
            bag['end'] - bag['start'])
    assert bag['verdict'] == verdict_of(bag, failures_of(bag))


def agrees_csv(bag, path):
    with path.open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert all(round(SECOND * float(row['duration_s'])) == int(row['last_ns']) - int(
        row['first_ns']) for row in rows)
    for kind, key, first, last in (
            *((state, state, 'first', 'last') for state in UNDECIDED),
            ('contact', 'contacts', 'first', 'last'), ('plan', 'plan_contacts', 'time', 'until')):
        assert [(row['footprint'], row['obstacle'], int(row['first_ns']), int(row['last_ns']))
                for row in rows if row['kind'] == kind] == [
            (one['footprint'], one.get('obstacle', ''), one[first], one[last])
            for one in bag[key]]


def since(bag, text):
    """Return a time of JSON in ns for one in s since the recording begins."""
    return bag['origin'] + round(float(text) * SECOND)


def interval(bag, first, duration):
    """Return an interval in ns of a beginning and a duration as the report prints them."""
    first = since(bag, first)
    return first, first + round(0 if 'moment' in duration else float(
        duration.rstrip('+')) * SECOND)


def agrees_report(bag, lines):
    """Compare verdict, problems, losses, and the tables, which have the first rows only."""
    assert lines[0] == f'{bag["bag"]}: {bag["verdict"].upper()}'
    assert [line[11:] for line in lines if line.startswith('  problem: ')] == bag['problems']
    assert [line for line in lines if line.endswith('messages lost when it was recorded')] == [
        f'  {one["name"]}: {one["lost"]} messages lost when it was recorded'
        for one in bag['sources'] if one['lost']]
    tables, rows = {}, []
    for line in lines:
        if line.startswith('    '):
            rows.append(re.split('  +', line.strip()))
        else:
            rows = tables[line.strip()] = []
    shown = {name: rows[1:21] for name, rows in tables.items() if rows}
    counts = {name: len(rows) - 1 if len(rows) < 22 else 20 + int(rows[-1][0].split()[1])
              for name, rows in tables.items() if rows}
    for one, row in zip(bag['footprints'], shown['footprints'], strict=True):
        assert row[0] == one['name'] and [SECOND * float(cell) for cell in row[2:6]] == (
            pytest.approx([one[key] for key in ('clear', 'collision', *UNDECIDED)], abs=NEAR))
    expected = {
        'contacts': [(one['footprint'], one['obstacle'], one['first'], one['last'])
                     for one in bag['contacts']],
        **{state: [(one['footprint'], one['first'], one['last']) for one in bag[state]
                   if one['last'] - one['first'] >= SECOND // 2000] for state in UNDECIDED}}
    for name, intervals in expected.items():
        place = 2 if name == 'contacts' else 1
        assert counts.get(name, 0) == len(intervals)
        assert matches([(*row[:place], *interval(bag, *row[place:place + 2]))
                        for row in shown.get(name, [])], intervals[:20])
    assert [(row[0], row[1], since(bag, row[2])) for row in shown.get('plans in contact', [])] == [
        (one['footprint'], one['obstacle'], pytest.approx(one['time'], abs=NEAR))
        for one in bag['plan_contacts'][:20]]


def agrees_junit(bag, path, lines):
    """Compare the failures of its cases, which decide the verdict, and the report in it."""
    suite, = ElementTree.parse(path).getroot()
    assert suite.find('system-out').text.splitlines() == lines
    cases = {case.get('name'): case for case in suite.iter('testcase')}
    wrong = {name: faults[0].text.splitlines() for name, case in cases.items()
             if (faults := [*case])}
    assert wrong.pop('recording', []) == bag['problems']
    contacts, others = [], []
    for name, faults in wrong.items():
        for fault in faults:
            if found := re.match(r'in contact with (\S+) (?:at|from) (\S+) s(?: on for (\S+) s)?',
                                 fault):
                obstacle, first, duration = found.groups()
                contacts.append((name, obstacle, *interval(bag, first, duration or 'moment')))
            elif found := re.match(r'(unknown|undetermined) for (\S+) s', fault):
                others.append((name, found[1], round(float(found[2]) * SECOND)))
    assert matches(contacts, times(bag['contacts'], 'footprint', 'obstacle'))
    failures = failures_of(bag)
    for name, state, duration in failures:
        if state == 'plans':
            assert f'plans of {name}' in wrong
        else:
            assert (name, state, pytest.approx(duration, abs=NEAR)) in others
    assert len(others) == sum(state != 'plans' for _, state, _ in failures)
    touching = [fault for fault in wrong.get('plans of carrier', []) if 'is in contact' in fault]
    assert len(touching) == (len(bag['plan_contacts']) if bag['fail_on'] else 0)
    assert bag['verdict'] == ('collision' if contacts or touching else 'bad input'
                              if suite.get('errors') != '0' else 'unknown' if wrong else 'clear')


def agrees_page(bag, path):
    """Compare the bars, what it says at each time, and its tables."""
    text = path.read_text().partition('type="application/json">')[2].partition('</script>')[0]
    shown, = json.loads(text)['recordings']
    names = [one['name'] for one in shown['footprints']]
    assert (shown['verdict'], shown['problems']) == (bag['verdict'], bag['problems'])
    assert [since(bag, shown[key]) for key in ('start', 'end')] == [bag['start'], bag['end']]
    contacts = [(names[one['footprint']], one['obstacle'], since(bag, one['first']),
                 since(bag, one['last'])) for one in shown['contacts']]
    assert sorted(contacts) == times(bag['contacts'], 'footprint', 'obstacle')
    for state in UNDECIDED:
        assert sorted((one['name'], since(bag, first), since(bag, last))
                      for one in shown['footprints'] for first, last, words in one['unknown']
                      if words.startswith(f'{state}: ')) == times(bag[state], 'footprint')
    bars = [(lane['name'], bar['text'], since(bag, bar['first']), since(bag, bar['last']), bar)
            for lane in shown['lanes'] for bar in lane['bars']]
    assert all(bar[:4] == contacts[bar[4]['contact']] for bar in bars
               if bar[4]['contact'] is not None)
    assert sorted(bar[:4] for bar in bars) == bars_of(bag)
    tables = {table['title']: table['rows'] for table in shown['tables']}
    assert matches([(*row[:2], *interval(bag, *row[2:4])) for row in tables['Contacts']], contacts)
    for state in UNDECIDED:
        for name in names:
            rows = [interval(bag, *row[1:3]) for row in tables[state.capitalize()]
                    if name in row[0].split(', ')]
            assert total(rows) == pytest.approx(total(
                (one['first'], one['last']) for one in bag[state] if one['footprint'] == name),
                abs=NEAR * (2 * len(rows) + 1))
    for one, row in zip(bag['footprints'], tables['Footprints'], strict=True):
        assert row[0] == one['name'] and [SECOND * float(cell) for cell in row[2:6]] == (
            pytest.approx([one[key] for key in ('clear', 'collision', *UNDECIDED)], abs=NEAR))
    assert [(names[one['footprint']], row[1], since(bag, one['first']), since(bag, one['last']))
            for one, row in zip(shown['plans'], tables['Plans in contact'], strict=True)] == [
        (one['footprint'], one['obstacle'], one['time'], one['until'])
        for one in bag['plan_contacts']]
    assert [(row[0], int(row[2]), int(row[3])) for row in tables['Messages']] == [
        (one['name'], one['received'], one['lost']) for one in bag['sources']]


def bars_of(bag):
    """Return the bars of a chart: (footprint, words, first, last)."""
    bars = times(bag['contacts'], 'footprint', 'obstacle')
    for state in UNDECIDED:
        for one in bag['footprints']:
            bars += [(one['name'], state, *found) for found in joined(
                (first, last) for name, first, last in times(bag[state], 'footprint')
                if name == one['name'])]
    return sorted(bars)


def agrees_written(bag, path):
    """Compare flags and states of the node, each from its message until the next."""
    states, flags = {}, {}
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            topic = connection.topic.removeprefix('/footprint_monitor')
            if topic == '/state':
                for status in reader.deserialize(data, connection.msgtype).status:
                    values = {pair.key: pair.value for pair in status.values}
                    states.setdefault(status.name.rpartition(' ')[2], []).append((
                        time, values['state'], values['obstacles in contact'].split(', ')))
            elif topic.endswith('/collision'):
                flags.setdefault(topic[1:-10].rstrip('/'), []).append(
                    (time, reader.deserialize(data, connection.msgtype).data))
    contacts, raised = [], {}
    for one in bag['footprints']:
        name, open_contacts, unknown = one['name'], {}, []
        for (time, state, obstacles), (until, *_) in zip(
                states[name], [*states[name][1:], (bag['end'],)]):
            obstacles = {*obstacles} - {''}
            contacts += [(name, obstacle, open_contacts.pop(obstacle), time)
                         for obstacle in open_contacts.keys() - obstacles]
            open_contacts.update((obstacle, time) for obstacle in obstacles
                                 if obstacle not in open_contacts)
            if state == 'unknown':
                unknown.append((time, until))
            if state != 'clear':
                raised.setdefault(name, []).append((time, until))
        contacts += [(name, obstacle, first, bag['end'])
                     for obstacle, first in open_contacts.items()]
        listed = [(first, last) for of, first, last in times(bag['unknown'], 'footprint')
                  if of == name]
        assert [both for both in joined(unknown) if both[0] < both[1]] == joined(listed)
        assert one['clear'] + one['collision'] + one['unknown'] - total(raised.get(name, [])) == (
            one['clear'])
    assert sorted(contacts) == times(bag['contacts'], 'footprint', 'obstacle')
    raised[''] = [both for intervals in raised.values() for both in intervals]
    for name, found in flags.items():
        held = joined((time, until) for (time, flag), (until, _) in zip(
            found, [*found[1:], (bag['end'], None)]) if flag)
        assert held == joined(raised.get(name, []))


@pytest.mark.parametrize('as_live', [False, True], ids=['recorded motion', 'as live'])
@pytest.mark.parametrize('case', [pytest.param(case, id=name) for name, case in CASES.items()])
def test_all_outputs_say_the_same(tmp_path, capsys, case, as_live):
    checked = Checked(case, as_live, tmp_path)
    main(checked.arguments, None)
    lines = capsys.readouterr().out.splitlines()
    result = json.loads(checked.paths['json'].read_text())
    bag, = result['bags']
    assert bag['verdict'] == case.verdict
    assert bag['unknown'] and as_live != bool(bag['undetermined'])
    assert bool(bag['contacts']) is not bool(case.away)
    assert bool(bag['problems']) is case.is_damaged
    assert any(one['lost'] for one in bag['sources']) is case.has_losses
    assert (result['verdict'], result['summary']['verdicts'], result['summary']['contacts']) == (
        bag['verdict'], {bag['verdict']: 1}, len(bag['contacts']))
    agrees_json(bag)
    agrees_csv(bag, checked.paths['csv'])
    agrees_report(bag, lines)
    agrees_junit(bag, checked.paths['junit'], lines)
    agrees_page(bag, checked.paths['html'])
    if as_live:
        agrees_written(bag, checked.written)

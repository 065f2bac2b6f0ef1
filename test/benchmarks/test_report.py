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

"""The report says what its figures say, also where they go the other way."""

import copy
import json
from pathlib import Path
import re
import sys

import pytest

ROOT = Path(__file__).parents[2]
STORED = ROOT / 'docs' / 'report'
sys.path.append(str(ROOT / 'benchmarks' / 'report'))

import appendix  # noqa: E402, I100
import condition  # noqa: E402
import methods  # noqa: E402
import page  # noqa: E402
import words  # noqa: E402


@pytest.fixture
def figures():
    """Return the stored figures, the accuracy run's among them, free to be changed."""
    figures = json.loads((STORED / 'figures.json').read_text())
    figures['accuracy'] = json.loads((STORED / 'accuracy.json').read_text())
    return figures


def read(figures):
    """Return the page and its appendix, with single spaces."""
    return ' '.join(page.text(figures).split()), ' '.join(appendix.text(figures).split())


def test_stored_pages_are_what_their_figures_say(figures):
    """Nobody edited the pages by hand, and they were written after the figures."""
    assert page.text(figures) == (STORED / 'README.md').read_text()
    assert appendix.text(figures) == (STORED / 'appendix.md').read_text()


def test_stored_plots_are_all_on_the_pages(figures):
    """Each picture stored is shown, and each shown is stored."""
    shown = set(re.findall(r'\]\((\w+\.png)\)', page.text(figures) + appendix.text(figures)))
    assert shown == {path.name for path in STORED.glob('*.png')}


def test_links_between_the_pages_lead_to_headings(figures):
    texts = {'README.md': page.text(figures), 'appendix.md': appendix.text(figures)}
    anchors = {name: {line.lstrip('# ').lower().replace(' ', '-') for line in text.splitlines()
                      if line.startswith('#')} for name, text in texts.items()}
    for name, text in texts.items():
        for target, anchor in re.findall(r'\]\(([\w.]*)#([\w-]+)\)', text):
            assert anchor in anchors[target or name], anchor


def test_a_method_has_one_name(figures):
    """No table has a row or column for a method that the list of methods does not know."""
    rows = re.findall(r'^\| ([^|]*?) \|', page.text(figures), re.MULTILINE)
    known = set(methods.LABELS.values()) | {row['scene'] for row in figures['cost']['scenes']}
    assert set(rows) <= known | {'', '---', 'scene'}


def test_sentences_follow_the_figures(figures):
    """A wrong answer, a slow improved method and a wrong long run turn the sentences around."""
    other = copy.deepcopy(figures)
    for row in other['speed']['compiled']:
        if row['method'] == 'improved':
            row['false_clears'] = 1
            row['ns'] = [1e9, 1e9, 1e9, 1e9, 1e9]
    other['accuracy']['families']['all']['wrong'] = 3
    other['condition']['backward']['improved'] = 1.0
    other['speed']['kernels']['different'] = 2
    (before, tables_before), (after, tables_after) = map(read, (figures, other))
    assert 'WRONG' not in before + tables_before
    assert 'is right in all of' in before and 'is WRONG in' in after
    assert '3 answers were WRONG' in tables_after
    assert re.search(r'times as slow as \w', after)
    assert 'improved and shapely.' in before and 'improved and shapely' not in after
    assert 'were the same in both' in tables_before and 'different in 2 cases' in tables_after
    other['accuracy'] = None
    assert 'Not made yet: `make accuracy`.' in read(other)[1]


def test_page_does_without_recordings(figures):
    figures['cost']['recorded'] = []
    figures['cost']['scenes'] = [row for row in figures['cost']['scenes']
                                 if 'dock' in row['scene'] or 'rack' in row['scene']]
    assert 'The recordings were not there to be measured.' in read(figures)[0]


def test_figures_are_stored_a_row_a_line_and_unchanged():
    value = {'rows': [{'n': 3, 'ns': [1.5, 2.0]}, {'n': 4, 'ns': []}], 'some': {'none': None},
             'nested': {'rows': [[1, 2], [3, 4]], 'deep': {'er': {'x': 1}}}, 'empty': []}
    assert json.loads(words.compact(value)) == value
    assert '{"n": 3, "ns": [1.5, 2.0]},\n' in words.compact(value)


@pytest.mark.parametrize('value, text', [
    (None, '–'), (0.5, '0.50 ns'), (59.49, '59.5 ns'), (999.6, '1.00 µs'), (12_345, '12.3 µs'),
    (999_600, '1.00 ms'), (2.5e9, '2.50 s')])
def test_durations_have_three_figures(value, text):
    assert words.duration(value) == text


def test_ranges_of_times_have_one_unit():
    assert words.durations(1500, 900, 2100) == '1.50 (0.90–2.10) µs'


@pytest.mark.parametrize('part, whole, text', [
    (0, 10, '0'), (0, 0, '–'), (1, 10_000, '0.01 %'), (1, 3, '33 %'), (None, 1, '–'),
    (999, 1000, '99.9 %'), (10, 10, '100 %')])
def test_shares_never_round_to_none_or_all(part, whole, text):
    assert words.share(part, whole) == text


@pytest.mark.parametrize('part, whole, low, high', [
    (0, 100, 0.0, 0.0370), (1, 10, 0.0179, 0.4042), (50, 100, 0.4038, 0.5962), (9, 9, 0.7008, 1)])
def test_intervals_are_wilsons(part, whole, low, high):
    assert words.wilson(part, whole) == (pytest.approx(low, abs=2e-4),
                                         pytest.approx(high, abs=2e-4))


def test_rates_of_none_have_an_upper_end():
    assert words.rate(0, 100) == '0 (< 3.7 %)'
    assert words.rate(50, 100) == '50 % (40–60)'


def test_comparison_names_the_faster():
    assert words.compared(10, 25) == '2.5 times as fast as'
    assert words.compared(25, 10) == '2.5 times as slow as'


@pytest.mark.parametrize('units', [1e-9, 0.3, 3.0, 1e9, 1e40])
def test_bins_hold_what_is_put_into_them(units):
    middle = condition.centre_of_bin(condition.bin_of(units))
    inside = 10 ** condition.FIRST < units < 10 ** condition.LAST
    assert 10 ** -0.26 < units / middle < 10 ** 0.26 or not inside

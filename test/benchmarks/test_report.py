# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The tables of the report match its figures, and so does its text."""

import json
from pathlib import Path
import re
import sys

from page_parts import with_tables
import pytest

ROOT = Path(__file__).parents[2]
STORED = ROOT / 'docs' / 'report'
PAGES = 'README.md', 'appendix.md'
sys.path += [str(ROOT / 'benchmarks'), str(ROOT / 'benchmarks' / 'report')]
pytest.importorskip('numba')

import _shared as shared  # noqa: E402, I100
import stability  # noqa: E402
import tables  # noqa: E402


@pytest.fixture(scope='module')
def figures():
    """Return the stored figures, including those of the accuracy run."""
    figures = json.loads((STORED / 'figures.json').read_text())
    figures['accuracy'] = json.loads((STORED / 'accuracy.json').read_text())
    return figures


def text_of(name):
    return (STORED / name).read_text()


@pytest.mark.parametrize('name', PAGES)
def test_stored_tables_match_their_figures(figures, name):
    assert with_tables(text_of(name), tables.TABLES, figures) == text_of(name)


def test_stored_benchmarks_match_their_figures():
    pytest.importorskip('rclpy')
    import bench
    page = ROOT / 'docs' / 'benchmarks' / 'README.md'
    figures = json.loads(page.with_name('figures.json').read_text())
    assert with_tables(page.read_text(), bench.TABLES, figures) == page.read_text()


def test_each_table_is_on_a_page_once():
    text = ''.join(map(text_of, PAGES))
    names = re.findall('<!-- (.*?) -->', text)
    assert sorted(name for name in names if name != 'until here') == sorted(tables.TABLES)


def test_stored_plots_are_all_on_the_page():
    shown = set(re.findall(r'\]\((\w+\.png)\)', text_of('README.md')))
    assert shown == {path.name for path in STORED.glob('*.png')}


def test_claims_of_the_text_hold_in_the_figures(figures):
    """If a new measurement disagrees, the text must be changed."""
    rows = figures['speed']
    wrong = {method: tables.count_wrong(row for row in rows if row['method'] == method)
             for method in tables.distinct(rows, 'method')}
    assert {method for method, count in wrong.items() if not count} == {
        'improved', 'filtered', 'shapely'}
    assert not tables.count_wrong(row for row in rows if row['kind'] == 'near'
                                  and row['method'] == 'traditional')
    total = figures['accuracy']['families']['all']
    assert total['wrong'] == 0 and total['pairs'] == 20_000_000
    backward = figures['condition']['backward']
    assert max(backward['traditional'], backward['binary']) < 1 < 1e7 < backward['gjk'] < 1e8
    assert all(figure['wrong'] == 0 for figure in figures['non_convex'])
    assert not any(row['missed'] + row['invented'] for row in figures['contact_times']
                   if row['library'] == 'improved')
    assert {row['step'] for row in figures['stepping']
            if not row['missed'] and not row['worst']} == {0.0}
    assert not any(step['clears'] for row in figures['steps'] for step in row['steps']
                   if step['step'] == 'lines to the nearest points')


def test_figures_are_stored_one_row_per_line():
    value = {'rows': [{'n': 3, 'ns': [1.5, 2.0]}, {'n': 4, 'ns': []}], 'some': {'none': None},
             'nested': {'rows': [[1, 2], [3, 4]], 'deep': {'er': {'x': 1}}}, 'empty': []}
    assert json.loads(shared.compact(value)) == value
    assert '{"n": 3, "ns": [1.5, 2.0]},\n' in shared.compact(value)


@pytest.mark.parametrize('write, figures, text', [
    (shared.duration, (None,), '–'), (shared.duration, (0.5,), '0.50 ns'),
    (shared.duration, (59.49,), '59.5 ns'), (shared.duration, (999.6,), '1.00 µs'),
    (shared.duration, (12_345,), '12.3 µs'), (shared.duration, (999_600,), '1.00 ms'),
    (shared.duration, (2.5e9,), '2.50 s'),
    # A range has one unit.
    (shared.durations, (1500, 900, 2100), '1.50 (0.90–2.10) µs'),
    # Not rounded to 0 or 100 %.
    (shared.share, (0, 10), '0'), (shared.share, (0, 0), '–'), (shared.share, (None, 1), '–'),
    (shared.share, (1, 10_000), '0.01 %'), (shared.share, (1, 3), '33 %'),
    (shared.share, (999, 1000), '99.9 %'), (shared.share, (10, 10), '100 %'),
    # A rate of 0 has an upper bound.
    (shared.rate, (0, 100), '0 (< 3.7 %)'), (shared.rate, (50, 100), '50 % (40–60)')])
def test_figures_as_text(write, figures, text):
    assert write(*figures) == text


@pytest.mark.parametrize('part, whole, low, high', [
    (0, 100, 0.0, 0.0370), (1, 10, 0.0179, 0.4042), (50, 100, 0.4038, 0.5962), (9, 9, 0.7008, 1)])
def test_wilson_intervals(part, whole, low, high):
    assert shared.wilson(part, whole) == pytest.approx((low, high), abs=2e-4)


@pytest.mark.parametrize('units', [1e-9, 0.3, 3.0, 1e9, 1e40])
def test_centre_of_a_bin_is_near_its_values(units):
    middle = stability.centre_of_bin(stability.bin_of(units))
    inside = 10 ** stability.FIRST < units < 10 ** stability.LAST
    assert 10 ** -0.26 < units / middle < 10 ** 0.26 or not inside

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
import sys

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
STORED = ROOT / 'docs' / 'report'
sys.path.append(str(ROOT / 'benchmarks' / 'report'))

import bodies  # noqa: E402, I100
import methods  # noqa: E402
import page  # noqa: E402
import words  # noqa: E402


@pytest.fixture
def figures():
    """Return the stored figures, the accuracy run's among them, free to be changed."""
    figures = json.loads((STORED / 'figures.json').read_text())
    figures['accuracy'] = json.loads((STORED / 'accuracy.json').read_text())
    return figures


def test_stored_page_is_what_its_figures_say(figures):
    """Nobody edited the page by hand, and it was written after the figures."""
    assert page.text(figures) == (STORED / 'README.md').read_text()


def test_stored_plots_are_all_on_the_page(figures):
    """Each picture stored is shown, and each shown is stored."""
    shown = {part.split(')')[0] for part in page.text(figures).split('](') if '.png' in part}
    assert shown == {path.name for path in STORED.glob('*.png')}


def test_sentences_follow_the_figures(figures):
    """A wrong answer, a slow improved method and an exact rival turn the sentences around."""
    other = copy.deepcopy(figures)
    for row in other['speed']['compiled']:
        if row['method'] == 'improved':
            row['false_clears'] = 1
            row['ns'] = [1e9, 1e9, 1e9]
        if row['method'] == 'pymunk':
            row['false_clears'] = row['false_collisions'] = 0
    other['accuracy']['families']['all']['wrong'] = 3
    before, after = (' '.join(page.text(each).split()) for each in (figures, other))
    assert 'Improved is right' in before and 'Improved is WRONG' in after
    assert '3 answers were WRONG' in after and 'WRONG' not in before
    assert 'as slow as the traditional method' in after
    assert 'pymunk (Chipmunk) was wrong in 0 of' in after
    other['accuracy'] = None
    assert 'Not made yet: `make accuracy`.' in page.text(other)


@pytest.mark.parametrize('value, text', [
    (None, '–'), (0.5, '0.50 ns'), (59.49, '59.5 ns'), (999.6, '1.00 µs'), (12_345, '12.3 µs'),
    (999_600, '1.00 ms'), (2.5e9, '2.50 s')])
def test_durations_have_three_figures(value, text):
    assert words.duration(value) == text


@pytest.mark.parametrize('part, whole, text', [
    (0, 10, '0'), (0, 0, '–'), (1, 10_000, '0.01 %'), (1, 3, '33 %'), (None, 1, '–'),
    (999, 1000, '99.9 %'), (10, 10, '100 %')])
def test_shares_never_round_to_none_or_all(part, whole, text):
    assert words.share(part, whole) == text


def test_comparison_names_the_faster():
    assert words.compared(10, 25) == '2.5 times as fast as'
    assert words.compared(25, 10) == '2.5 times as slow as'
    times = {3: 10, 4: 30}
    assert (words.compared_ends(3, 4, times, {3: 20, 4: 90})
            == '2 (n = 3) to 3 times (n = 4) as fast as')
    assert (words.compared_ends(3, 4, times, {3: 5, 4: 10})
            == '2 (n = 3) to 3 times (n = 4) as slow as')
    assert (words.compared_ends(3, 4, times, {3: 20, 4: 15})
            == '2 times as fast as (n = 3) and 2 times as slow as (n = 4)')


@pytest.mark.parametrize('kind', bodies.KINDS)
@pytest.mark.parametrize('shape', [8, bodies.RECTANGLES])
def test_kinds_have_the_pairs_they_promise(kind, shape):
    """Clear pairs are all apart, deep ones all meet, half of the others; improved is right."""
    pairs, meet = bodies.sample(np.random.default_rng(1), shape, kind, 40)
    assert meet.sum() == {'clear': 0, 'deep': 40}.get(kind, 20)
    assert (methods.run('improved', methods.Pairs(pairs))[0] == meet).all()

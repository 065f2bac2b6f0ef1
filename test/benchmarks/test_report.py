# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The report: its methods against the oracle, its tables and text against its figures."""

from fractions import Fraction
from functools import cache
import json
from pathlib import Path
import re
import sys

import families
import numpy as np
import oracle
from page_parts import with_tables
from published import load
import pytest
from sat_collision import intersects, PolygonSet
from sat_collision.geometry.compiled.jit import COMPILED, indexable

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / 'benchmarks'), str(ROOT / 'benchmarks' / 'report')]
if not COMPILED:
    pytest.skip('the report compares compiled kernels', allow_module_level=True)

import _shared as shared  # noqa: E402, I100
import libraries  # noqa: E402
import methods  # noqa: E402
import rivals  # noqa: E402
import scenes  # noqa: E402
import shapes  # noqa: E402
import stability  # noqa: E402
import tables  # noqa: E402

INEXACT = 'traditional', 'binary', 'gjk', 'closest'
SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
HARD = ('hair_gaps', 'far_offsets', 'slivers', 'one_ulp', 'rectangles_on_edge', 'collinear_edges',
        'points_and_segments', 'extreme_scales')


def pairs_of(name, count, n):
    return families.CONVEX[name](np.random.default_rng(5), count, n)


@cache
def judged(name, count=500, n=5):
    """Return pairs of a family, and whether they meet."""
    pairs = pairs_of(name, count, n)
    return pairs, oracle.intersects_pairs(pairs)[0]


def answers(method, pairs):
    with np.errstate(all='ignore'):
        return methods.run(method, methods.Pairs(pairs))


@pytest.mark.parametrize('count', [50, pytest.param(300, marks=pytest.mark.long)])
@pytest.mark.parametrize('n', [3, 24])
@pytest.mark.parametrize('name', families.CONVEX)
def test_filtered_orientations_are_never_wrong(name, n, count):
    pairs, truth = judged(name, count, n)
    np.testing.assert_array_equal(answers('filtered', pairs), truth)


@pytest.mark.parametrize('exponent', [-1060, -700, 700, 1015])
def test_filtered_orientations_with_overflow_and_underflow(exponent):
    pairs = [(np.ldexp(a, exponent), np.ldexp(b, exponent))
             for name in ('near', 'hair_gaps', 'points_and_segments')
             for a, b in pairs_of(name, 60, 5)]
    truth = [oracle.intersects(a, b) for a, b in pairs]
    np.testing.assert_array_equal(answers('filtered', pairs), truth)


@pytest.mark.long
@pytest.mark.parametrize('name', HARD)
@pytest.mark.parametrize('method', INEXACT)
def test_inexact_rivals_are_wrong_on_hard_pairs_and_right_on_near_ones(method, name):
    hard, truth = judged(name)
    assert (answers(method, hard) != truth).any()
    near, truth = judged('near')
    assert (answers(method, near) == truth).all()


# The nearest vertex B = (6, 7) of P ends two edges, but not the separating one, from (0, 1) to
# (5, 4).
APART = np.array([[0, 1], [5, 4], [6, 7.0]]), np.array([[4, 3], [11, 5], [11, 6.0]])
# The centre line crosses the edges (4, 1)-(1, 8) and (8, 9)-(3, 4), whose ends are apart along it;
# but the vertex (2, 1) of Q, which is not one of the four, lies within P.
OVERLAPPING = np.array([[0, 2], [4, 1], [1, 8.0]]), np.array([[2, 1], [8, 9], [3, 4.0]])


@pytest.mark.parametrize('n', [3, 4, 7, 16, 40])
@pytest.mark.parametrize('method', ['traditional', 'boxed'])
@pytest.mark.parametrize('family', [families.clear, families.near, families.deep])
def test_traditional_is_complete_away_from_contact(method, family, n):
    pairs = family(np.random.default_rng(2), 200, n)
    np.testing.assert_array_equal(answers(method, pairs), oracle.intersects_pairs(pairs)[0])


def test_traditional_on_points_and_segments():
    bodies = [np.array(body, float) for body in (
        [[0, 0]], [[2, 0]], [[0, 0], [2, 0]], [[3, 0], [4, 0]], [[1, -1], [1, 1]],
        [[0, 0], [2, 2]], [[3, 3], [4, 4]], [[0, 1]], [[0, 0], [4, 0], [0, 4]])]
    pairs = [(p, q) for p in bodies for q in bodies]
    np.testing.assert_array_equal(answers('traditional', pairs), oracle.intersects_pairs(pairs)[0])


@pytest.mark.long
def test_float32_is_less_exact_than_float64():
    """The traditional method is compiled for either."""
    pairs, truth = judged('float32_round_trip', 1000, 4)
    wrong, wrong_single = (np.sum(answers(method, pairs) != truth)
                           for method in ('traditional', 'traditional_float32'))
    assert wrong < wrong_single / 10


@pytest.mark.long
@pytest.mark.parametrize('method, pair', [('published_a', APART), ('published_b', OVERLAPPING)])
def test_published_readings_are_wrong_on_their_examples(method, pair):
    truth = oracle.intersects(*pair)
    assert intersects(*pair) == answers('traditional', [pair])[0] == truth
    assert answers(method, [pair])[0] != truth


@pytest.mark.parametrize('n', [pytest.param(4, marks=pytest.mark.long), 16, 64])
def test_published_a_errs_in_one_direction_and_b_in_both(n):
    pairs, truth = judged('near', 2000, n)
    a, b = (answers(method, pairs) for method in ('published_a', 'published_b'))
    assert (a & ~truth).any() and not (~a & truth).any()
    assert (b & ~truth).any() and (~b & truth).any()


def test_steps_of_the_published_readings():
    """Near pairs are called apart by the centre line or by normals, never by lines to a point."""
    pairs = methods.Pairs(pairs_of('near', 500, 8))
    for method in ('published_a', 'published_b'):
        assert set(methods.steps(method, pairs).tolist()) == {0, 1, 2}


@pytest.mark.long
def test_hybrid_misses_no_collision_but_invents_some():
    pairs, meet = judged('near', 1000, 16)
    hybrid, to_the_letter = (answers(method, pairs) for method in ('hybrid', 'published_b'))
    assert hybrid[meet].all() and not to_the_letter[meet].all()
    assert hybrid[~meet].any()


@pytest.mark.long
def test_equation_5_as_printed_is_worse():
    pairs, meet = judged('near', 1000, 16)
    printed, meant = (answers(method, pairs)[~meet].sum() for method in ('literal', 'published_a'))
    assert printed > 2 * meant > 0


@pytest.mark.parametrize('move, time', [((-4, 0), Fraction(1, 2)), ((-2, 0), 1), ((-1, 0), None),
                                        ((-4, 2), Fraction(1, 2)), ((-4, -4.5), None),
                                        ((-8, 3), Fraction(1, 4))])
def test_oracle_of_contact_times(move, time):
    """Two unit squares 2 m apart: head on, too short, corner on corner, and past each other."""
    assert libraries._first_contact(SQUARE, SQUARE + (3.0, 0.0), np.array(move, float)) == time


@pytest.mark.parametrize('n', [3, 8, 9, 10, 33, 257])
def test_binary_search_finds_the_support_vertex(n):
    """Of bodies with evenly spaced vertices, and of arcs with all vertices on one side."""
    rng = np.random.default_rng(n)
    half = shapes.at_angles(np.linspace(0, 1.5, n))
    turned = [np.roll(half, k, axis=0) for k in range(0, n, max(1, n // 9))]
    for body in (*shapes.convex(shapes.polygons(rng, 30, n)), *turned):
        for axis in shapes.directions(rng, 30):
            k = rivals.support(indexable(body), *axis.tolist())
            assert body[k] @ axis >= (body @ axis).max() - 1e-14


def test_gjk_reports_contact_within_its_tolerance():
    turned = np.array([(0.0, 0.5), (1.0, -0.5), (2.0, 0.5), (1.0, 1.5)])
    for gap, collides in ((1e-12, True), (1e-3, False)):
        apart = turned + (0.5 + gap, 1.0 + gap)
        assert not oracle.intersects(SQUARE, apart)
        assert answers('gjk', [(SQUARE, apart)])[0] == collides


@pytest.mark.parametrize('exponent', [0, -512, -514, -530, 500, 1000])
def test_semi_static_filter_is_exact_near_a_line(exponent):
    """Rounding, underflow or overflow give the plain determinant the wrong sign."""
    rng = np.random.default_rng(2)
    wrong = 0
    b, c, share = rng.uniform(-1, 1, (2000, 2)), rng.uniform(-1, 1, (2000, 2)), rng.random(2000)
    a = c + share[:, None] * (b - c)
    for a, b, c in np.ldexp(np.stack([a, b, c], axis=1), exponent).tolist():
        exact = oracle.orientation(*oracle.integers([c, a, b])[0])
        plain = oracle.orientation(c, a, b)
        sign = (exact > 0) - (exact < 0)
        assert rivals.semi_static_orient(*a, *b, *c) == sign
        wrong += ((plain > 0) - (plain < 0)) != sign
    assert wrong > 100


def test_touching_bodies_have_no_gap():
    for other in (SQUARE + (1.0, 0.0), SQUARE[:1], SQUARE[:2] + (0.25, 0.0)):
        assert stability.bin_of(stability.gap_in_units(SQUARE, other, True)) == -1
    assert stability.gap_in_units(SQUARE, SQUARE + (2.0**-50, 0.0), True) > 0


@pytest.mark.long
def test_exact_stage_is_used_only_for_touching_bodies():
    others = [SQUARE + move for move in ((3.0, 0.0), (0.5, 0.5), (0.9, 0.8), (1.0, 0.0))]
    found = scenes.stages(PolygonSet([SQUARE] * 4), PolygonSet(others))
    assert found.tolist() == [scenes.BOXES, scenes.BOXES, scenes.AXES, scenes.EXACT]


@pytest.mark.parametrize('scene, angle', [(scenes.docking, 0.0), (scenes.racks, 0.0),
                                          (scenes.racks, 0.5)])
def test_scenes_have_contacts_and_clear_pairs(scene, angle):
    """Aligned with the axes they touch exactly, and the exact stage decides."""
    frames = scene(angle)[::40]
    pairs = [(footprint, obstacle) for footprint, obstacles in frames for obstacle in obstacles]
    meet = np.array([oracle.intersects(*pair) for pair in pairs])
    assert 0 < meet.mean() < 0.5
    found = scenes.stages(*map(PolygonSet, zip(*pairs)))
    assert (found == scenes.EXACT).any() or angle


@pytest.mark.parametrize('name', scenes.NAMES)
def test_recorded_scenes_have_their_known_contacts(name):
    meet = [sum(oracle.intersects(footprint, obstacle) for obstacle in obstacles)
            for _, footprint, obstacles in scenes.stamped(name)]
    assert meet == [len(moment['hits']) for moment in load('recordings')[name]['contacts']]


@pytest.mark.parametrize('kind', methods.KINDS)
def test_kinds_of_samples(kind):
    """Clear pairs are apart, deep ones meet, half of the others do; improved is right."""
    pairs, meet = methods.sample(np.random.default_rng(1), 8, kind, 40)
    assert meet.sum() == {'clear': 0, 'deep': 40}.get(kind, 20)
    assert (answers('improved', pairs) == meet).all()


STORED = ROOT / 'docs' / 'report'
PAGES = 'README.md', 'appendix.md'


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

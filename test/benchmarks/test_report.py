# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The report: methods against the oracle, pages against figures; verdicts on a node."""

import contextlib
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
rclpy = pytest.importorskip('rclpy')
pytest.importorskip('matplotlib')

import _shared as shared  # noqa: E402, I100
import libraries  # noqa: E402
import methods  # noqa: E402
import node  # noqa: E402
import rivals  # noqa: E402
import scenes  # noqa: E402
import shapes  # noqa: E402
from soak import judge, judge_times, Times, Verdict  # noqa: E402
import stability  # noqa: E402
import tables  # noqa: E402
from traffic import Traffic  # noqa: E402

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
    families = {(row['family'], row['method']): row for row in figures['families']}
    for method in INEXACT:
        assert all(tables.count_wrong([families[name, method]]) for name in HARD)
        assert not tables.count_wrong([families['near', method]])
    near = {method: families['near', method] for method in tables.READINGS}
    assert near['literal']['false_collisions'] > 2 * near['published_a']['false_collisions'] > 0
    assert near['hybrid']['false_collisions'] and not near['hybrid']['false_clears']
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


CHANGES = [(0.0, True), (1.0, False), (2.0, True), (3.0, False)]
GOOD = [(0.01, False), (0.02, True), (0.5, True), (1.01, True), (1.02, False), (1.9, False),
        (2.1, True), (3.1, False)]


@pytest.mark.parametrize('flags, expected', [
    (GOOD, Verdict(2, 0, 0, 2, 0, 0)),
    ([one for one in GOOD if one != (2.1, True)], Verdict(2, 1, 0, 2, 0, 0)),
    (sorted([*GOOD, (0.7, False), (0.8, False)]), Verdict(2, 0, 2, 2, 0, 0)),
    (sorted([*GOOD, (1.5, True)]), Verdict(2, 0, 0, 2, 0, 1)),
    ([one for one in GOOD if one[0] < 3.0], Verdict(2, 0, 0, 2, 1, 0)),
    ([], Verdict(2, 2, 0, 2, 2, 0)),
], ids=['good', 'missed', 'wrong clears', 'false collision', 'delayed', 'silence'])
def test_verdict_on_flags(flags, expected):
    """A flag may be late while the robot stays, but not after that."""
    assert judge(CHANGES, flags) == expected


NAN = float('nan')
STAYS = [(0.0, None), (1.0, 3.5), (2.0, None)]
FLAGS = [(0.01, True), (1.01, False), (2.01, True)]
TIMES = [(0.01, NAN), (0.02, 0.0), (0.9, 0.0), (1.01, 0.0), (1.2, 2.31), (1.5, 2.01), (2.2, 0.0)]


@pytest.mark.parametrize('times, flags, expected', [
    (TIMES, FLAGS, Times(2, 0, 0, 0, pytest.approx(10.0))),
    ([*TIMES, (2.3, 0.5)], FLAGS, Times(2, 1, 0, 0, pytest.approx(10.0))),
    ([(1.2, 2.5), (1.5, 2.3), (1.6, 1.5)], FLAGS, Times(3, 2, 1, 0, pytest.approx(200.0))),
    (TIMES, [(0.01, True), (1.25, False), (2.01, True)], Times(2, 0, 0, 0, pytest.approx(10.0))),
    (TIMES, [(0.01, True), (1.4, False), (2.01, True)], Times(2, 0, 0, 1, pytest.approx(10.0))),
    ([(1.5, NAN)], [(0.01, True)], Times(0, 0, 0, 0, pytest.approx(NAN, nan_ok=True))),
], ids=['good', 'in contact', 'late and early', 'delayed flag', 'late flag', 'none'])
def test_verdict_on_times(times, flags, expected):
    """Times in the first moments of a stay may belong to the one before."""
    assert judge_times(STAYS, flags, times) == expected


TOPICS = ('/footprint_monitor/collision', '/footprint_monitor/footprint/collision', '/diagnostics')


def test_skipped_with_a_word_without_rclcpp(monkeypatch, capsys):
    monkeypatch.setenv('PATH', '')
    assert node.measure_cpp() is None
    assert 'apt install cmake g++ ros-jazzy-rclcpp' in capsys.readouterr().err


@pytest.mark.long
def test_floor_in_cpp_publishes_and_counts_as_in_python(tmp_path, monkeypatch, domain):
    program = node.build_floor(tmp_path)
    if not program:
        pytest.skip('apt install ros-jazzy-rclcpp')
    monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
    rclpy.init()
    try:
        assert published_by(program) == published_by('floor')
    finally:
        rclpy.shutdown()


def published_by(kind):
    """Return the QoS of what a node publishes, which must answer and count its obstacles."""
    with node.running(kind), contextlib.closing(Traffic(10, 4)) as traffic:
        traffic.connect()
        before = traffic.taken()
        _, sent, _ = traffic.run(0.5)
        assert traffic.received[-1][1] is traffic.changes[-1][1]
        assert traffic.taken() - before == sent
        found = {topic: traffic.node.get_publishers_info_by_topic(topic) for topic in TOPICS}
        return {topic: [str(info.qos_profile) for info in infos] for topic, infos in found.items()}

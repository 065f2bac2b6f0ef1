# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Bodies and sets used by several threads, sent to other processes, and compared by value."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
import copy
import importlib
import multiprocessing
import pickle
import pkgutil
import sys
import threading

from bodies import random_body
import families
import numpy as np
import pytest
import sat_collision
from sat_collision import Polygon, PolygonError, PolygonSet, Reason
from sat_collision.geometry.compiled.jit import COMPILED
import shapes

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
QUERIES = {
    'intersecting_rows': lambda bodies, body: bodies.intersecting_rows(body).tolist(),
    'rows_within': lambda bodies, body: bodies.rows_within(body, 2.0).tolist(),
    'nearest': PolygonSet.nearest,
    'first_contact': lambda bodies, body: bodies.first_contact(body, (3.0, 1.0, 1.0), 2.0),
    'intersects': lambda bodies, body: bodies.intersects(body).tolist(),
    'intersects_pairs': lambda bodies, body: bodies.intersects_pairs(
        PolygonSet([body] * len(bodies))).tolist(),
    'separations': lambda bodies, body: bodies.separations(
        PolygonSet([body] * len(bodies))).tolist(),
}


@pytest.fixture
def frequent_switches():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize('times', [60, pytest.param(1000, marks=pytest.mark.long)])
@pytest.mark.parametrize('query', QUERIES.values(), ids=QUERIES)
def test_queries_of_one_set_from_several_threads(query, times, frequent_switches):
    """Each thread gets the answers that one thread gets."""
    rng = np.random.default_rng(1)
    bodies = PolygonSet(random_body(rng) for _ in range(60))
    asked = [random_body(rng) for _ in range(8)]
    expected = [query(bodies, body) for body in asked]
    assert len({*map(str, expected)}) > 3

    def ask(k):
        return sum(query(bodies, asked[k]) != expected[k]
                   for _ in range(times if COMPILED else times // 50))
    with ThreadPoolExecutor(len(asked)) as pool:
        assert [*pool.map(ask, range(len(asked)))] == [0] * len(asked)


@pytest.mark.parametrize('change', [
    lambda bodies: bodies.append(SQUARE), lambda bodies: bodies.remove(0),
    lambda bodies: bodies.replace(0, [(9, 9)]), lambda bodies: bodies.replace(1, L_SHAPE)])
def test_changes_during_a_query(change):
    """The query reads on what was there before; without one nothing is copied."""
    bodies = PolygonSet([SQUARE, [(1, 1)]])
    array, _ = bodies._snapshot()
    before = np.array(array)
    change(bodies)
    np.testing.assert_array_equal(np.asarray(array), before)
    array = bodies._rows.packed
    bodies.replace(1, [(7, 7)])
    assert np.shares_memory(array, np.asarray(bodies._array))
    assert 1 in bodies.intersecting_rows([(7, 7)])


@pytest.mark.parametrize('indexed', [False, True])
def test_queries_while_another_thread_changes_the_set(indexed, frequent_switches):
    """Rows that stay are always found, those that are elsewhere never."""
    forms = [Polygon(SQUARE), Polygon(L_SHAPE)]
    bodies = PolygonSet([*forms, *([(9.0 + k, 9.0)] for k in range(600))])
    ended = threading.Event()

    def ask():
        wrong = 0
        while not ended.is_set():
            rows = bodies.intersecting_rows([(0.5, 0.5)]).tolist()
            wrong += rows[:2] != [0, 1] or not {*rows[2:]} <= {602}
            wrong += bodies.nearest([(1.0, 1.0)], [602])[0] not in (0, 1)
            wrong += bodies.intersecting_rows([(509.0, 9.0)]).tolist() != [502]
        return wrong
    with ThreadPoolExecutor(3) as pool:
        answers = [pool.submit(ask) for _ in range(3)]
        try:
            for k in range((1000 if indexed else 3000) if COMPILED else 100):
                bodies.replace(k % 2, forms[k // 2 % 2])
                if indexed:
                    bodies.index()
                bodies.remove(bodies.append(forms[k % 2]))
        finally:
            ended.set()
        assert [answer.result() for answer in answers] == [0, 0, 0]


def test_changes_by_several_threads(frequent_switches):
    """None is lost."""
    bodies = PolygonSet()

    def change(k):
        rows = [bodies.append([(k, i)]) for i in range(200)]
        for row in rows[::2]:
            bodies.remove(row)
        for i, row in enumerate(rows[1::2]):
            bodies.replace(row, [(k, -i)])
    with ThreadPoolExecutor(4) as pool:
        [*pool.map(change, range(4))]
    rows = bodies.intersecting_rows([(-1, -300), (5, -300), (5, 300), (-1, 300)]).tolist()
    assert len(bodies) == len(rows) == 400
    assert {tuple(bodies.polygon(row).vertices[0]) for row in rows} == {
        (k, -i) for k in range(4) for i in range(100)}


@pytest.mark.skipif(not COMPILED, reason='plain Python holds the interpreter lock')
def test_kernels_release_the_interpreter_lock():
    """Another thread goes on before one has returned."""
    circle = shapes.at_angles(np.linspace(0, 2 * np.pi, 500, endpoint=False))
    sets = [PolygonSet([Polygon(circle)] * 300) for _ in range(2)]
    sets[0].separations(sets[1])
    begun, ended = threading.Event(), threading.Event()

    def measure():
        begun.set()
        sets[0].separations(sets[1])
        ended.set()
    before = sys.getswitchinterval()
    # No thread is asked for the lock: it has to release it.
    sys.setswitchinterval(100.0)
    try:
        thread = threading.Thread(target=measure)
        thread.start()
        begun.wait()
        assert not ended.is_set()
    finally:
        sys.setswitchinterval(before)
    thread.join()


def test_equal_polygons():
    """The start, the order and superfluous vertices do not matter."""
    square = Polygon(SQUARE)
    same = [Polygon(SQUARE[2:] + SQUARE[:2]), Polygon(SQUARE[::-1]), Polygon([(1, 0), *SQUARE[1:],
            (-0.0, 0)]), Polygon(square), copy.deepcopy(square)]
    others = [Polygon(SQUARE[:3]), Polygon([*SQUARE[:3], (0, np.nextafter(2, 3))]),
              Polygon(L_SHAPE), Polygon([(0, 0)])]
    assert {square, *same} == {square} and all(square == one for one in same)
    assert all(square != one for one in others) and len({square, *others}) == 5
    assert square != SQUARE and square != None and square in [1, square]  # noqa: E711


def test_equal_sets():
    """The same rows, those without a body too, have equal bodies, whatever was there before."""
    bodies = PolygonSet([SQUARE, L_SHAPE, [(1, 1)]])
    other = PolygonSet([L_SHAPE, SQUARE, [(1, 1)], SQUARE])
    assert bodies != other and bodies != [SQUARE, L_SHAPE, [(1, 1)]]
    other.remove(3)
    other.replace(0, SQUARE)
    other.replace(1, L_SHAPE)
    assert bodies != other
    bodies.remove(bodies.append([(5, 5)]))
    assert bodies == other
    other.replace(2, [(1, 2)])
    assert bodies != other
    with pytest.raises(TypeError, match='unhashable'):
        hash(bodies)


def test_polygons_are_pickled():
    """Of each family, and with more vertices than accepted by default; to the same bits."""
    rng = np.random.default_rng(2)
    bodies = [Polygon(ring) for family in families.ALL.values() for ring, _ in family(rng, 3, 20)]
    bodies.append(Polygon(shapes.at_angles(np.linspace(0, 6, 1500)), 2000))
    for body in bodies:
        for again in (pickle.loads(pickle.dumps(body)), copy.copy(body)):
            assert again == body and hash(again) == hash(body)
            assert np.asarray(again.packed[0]).tobytes() == np.asarray(body.packed[0]).tobytes()
    again = pickle.loads(pickle.dumps(PolygonSet(bodies)))
    assert [again.polygon(row) for row in range(len(bodies))] == bodies


def test_sets_are_pickled():
    """Rows removed are given again in the same order, and a copy is a set of its own."""
    rng = np.random.default_rng(3)
    bodies = PolygonSet(random_body(rng) for _ in range(80))
    for row in (70, 3, 79, 12):
        bodies.remove(row)
    for again in (pickle.loads(pickle.dumps(bodies)), copy.deepcopy(bodies)):
        assert again == bodies and len(again) == 76
        assert [again.append([(k, 0)]) for k in range(5)] == [12, 79, 3, 70, 80]
        assert again != bodies and len(bodies) == 76
    assert pickle.loads(pickle.dumps(PolygonSet())) == PolygonSet()


def errors():
    """Return one of each kind of error of the package that can be imported here."""
    for module in pkgutil.walk_packages(sat_collision.__path__, 'sat_collision.'):
        if not module.name.endswith('__main__'):
            try:
                importlib.import_module(module.name)
            except ModuleNotFoundError as error:
                assert not (error.name or '').startswith('sat_collision')
    kinds = [Exception]
    for kind in kinds:
        kinds += [one for one in kind.__subclasses__() if one not in kinds]
    first = {PolygonError: [Reason.EMPTY]}
    return [one(*first.get(one, ()), 'two  words')
            for one in kinds if one.__module__.startswith('sat_collision')]


def test_errors_are_pickled():
    found = errors()
    assert len(found) > 3
    for error in found:
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error) and str(again) == str(error)
        assert vars(again) == vars(error)


def rows_of_set(bodies, body):
    return bodies.intersecting_rows(body), body


def test_process_pools():
    """Bodies, sets, answers and errors reach the other process and come back."""
    bodies = PolygonSet([SQUARE, L_SHAPE, [(9, 9)]])
    with ProcessPoolExecutor(1, multiprocessing.get_context('spawn')) as pool:
        rows, body = pool.submit(rows_of_set, bodies, Polygon(SQUARE)).result()
        assert rows.tolist() == [0, 1] and body == Polygon(SQUARE)
        with pytest.raises(PolygonError, match='meets the edge') as error:
            pool.submit(Polygon, [(0, 0), (1, 1), (1, 0), (0, 1)]).result()
        assert error.value.reason is Reason.SELF_INTERSECTING
        assert pool.submit(abs, -1).result() == 1

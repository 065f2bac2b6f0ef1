# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The public API of the library: names, help, examples, shapely geometries and errors."""

import doctest
from fractions import Fraction
from functools import partial
import importlib
from io import StringIO
import os
import pydoc
import subprocess
import sys
import warnings

from bodies import as_shapely, random_body
import numpy as np
import pytest
import sat_collision
from sat_collision import (
    contact, first_contact_along, intersects, intersects_many, intersects_pairs, Polygon,
    PolygonError, PolygonSet, Reason, separation, separations, time_of_contact)

shapely = pytest.importorskip('shapely')

SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]


def test_completion_and_help_show_all_public_names():
    """They are imported lazily."""
    assert {*sat_collision.__all__, '__version__'} <= {*dir(sat_collision)}
    text = pydoc.plain(pydoc.render_doc(sat_collision))
    for name in sat_collision.__all__:
        assert f' {name}(' in text or f' {name} = ' in text, name
    assert sorted(sat_collision.__all__) == sat_collision.__all__


@pytest.mark.parametrize('name', [name for name in sat_collision.__all__ if name != 'KERNEL'])
def test_docstrings_have_working_examples(name):
    thing = getattr(sat_collision, name)
    names = vars(importlib.import_module(thing.__module__))
    found = doctest.DocTestFinder().find(thing, name, globs=names)
    assert found and found[0].examples
    said = StringIO()
    for example in found:
        doctest.DocTestRunner().run(example, out=said.write)
    assert said.getvalue() == ''


def test_help_of_prepare_kernels_prepares_nothing():
    result = subprocess.run([sys.executable, '-m', 'sat_collision.replay.kernels', '--help'],
                            capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, '')
    assert 'Compile all kernels ahead.' in result.stdout


def test_kernels_are_prepared_without_optional_libraries():
    absent = ['argcomplete', 'lz4', 'rclpy', 'rosbags', 'yaml']
    program = (f'import sys; sys.modules.update(dict.fromkeys({absent}))\n'
               'from sat_collision.replay.kernels import main; sys.exit(main())')
    result = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                            env={**os.environ, 'NUMBA_DISABLE_JIT': '1'})
    assert (result.returncode, result.stderr) == (0, '')
    assert 'without replay_check: yaml is not installed: pip install pyyaml' in result.stdout


def test_shapely_geometries_are_accepted():
    """Polygons, rings, segments and points, with and without z, with shapely's answers."""
    rng = np.random.default_rng(2)
    bodies = [random_body(rng) for _ in range(60)]
    shapes = [as_shapely(body) for body in bodies]
    for one, other in zip(shapes, shapes[1:]):
        assert intersects(one, other) is one.intersects(other)
        assert max(separation(one, other), 0.0) == pytest.approx(one.distance(other), abs=1e-12)
    rows = PolygonSet(shapes)
    assert rows.intersects(shapes[0]).tolist() == shapely.intersects(shapes[0], shapes).tolist()
    assert intersects(shapely.LineString([(0, 0, 9), (2, 2, 9)]), shapely.Point(1, 1, 5))
    assert intersects(shapely.LinearRing(SQUARE), shapely.Point(1, 1))
    moving = shapely.Polygon(SQUARE)
    assert time_of_contact(moving, shapely.affinity.translate(moving, 4), shapely.Point(4, 1),
                           shapely.Point(4, 1)) == 0.5


def test_polygons_convert_to_shapely():
    """By `__geo_interface__`, of each kind."""
    for points in (SQUARE, SQUARE[:2], SQUARE[:1]):
        polygon = Polygon(points)
        assert shapely.geometry.shape(polygon).equals(as_shapely(polygon))
        assert Polygon(polygon).vertices.tolist() == polygon.vertices.tolist()


def test_separations_of_many_pairs():
    """Of sets and of lists, one value per pair."""
    rng = np.random.default_rng(3)
    a, b = ([random_body(rng) for _ in range(40)] for _ in range(2))
    expected = [separation(*pair) for pair in zip(a, b)]
    assert separations(a, b).tolist() == expected
    rows = PolygonSet(a)
    assert rows.separations(PolygonSet(b)).tolist() == expected
    assert intersects_pairs(a, b).tolist() == [value <= 0.0 for value in expected]
    rows.remove(3)
    assert separations(rows, b)[3] == np.inf
    with pytest.raises(ValueError, match='40 rows cannot be paired with 39'):
        separations(a, b[1:])


@pytest.mark.parametrize('points, words', [
    ([('0', '0'), ('1', '1')], 'not numbers but str'),
    ([(True, False), (False, True)], 'not numbers but bool'),
    (np.array([(0, 0), (1, None)]), 'not numbers but object'),
    (np.array([(0, 0), (1, '1')], object), 'not numbers but object'),
    (np.array([(0, 0), (1, 1)], 'datetime64[s]'), 'not numbers but datetime64'),
    ([(0, 1, 2), (0, 0, 1)], r'shape \(2, 3\).*transpose'),
    (shapely.box(0, 0, 3, 3) - shapely.box(1, 1, 2, 2), 'polygon with holes'),
    (shapely.LineString([(0, 0), (1, 0), (1, 1)]), 'LineString of 3 points'),
    (shapely.MultiPoint([(0, 0), (1, 1)]), 'a MultiPoint, but a body is one'),
    (shapely.Polygon(), 'no points'),
    (shapely.Point(), 'no points'),
])
def test_invalid_bodies_are_refused(points, words):
    """The message names the type or shape that was given."""
    for use in (Polygon, lambda body: intersects(body, [(0, 0)]),
                lambda body: contact([(0, 0)], body), lambda body: PolygonSet([[(0, 0)], body]),
                lambda body: time_of_contact(body, body, [(0, 0)], [(0, 0)])):
        with pytest.raises(PolygonError, match=words) as error:
            use(points)
        assert error.value.reason in (Reason.WRONG_SHAPE, Reason.EMPTY)


class Geometry:
    """Has a `__geo_interface__` that is given, or raised."""

    def __init__(self, interface):
        self.interface = interface

    @property
    def __geo_interface__(self):
        if isinstance(self.interface, BaseException):
            raise self.interface
        return self.interface


@pytest.mark.parametrize('interface', [
    None, 7, 'Polygon', [], {}, {'type': 'Polygon'}, {'coordinates': [(0, 0)]},
    {'type': ['Polygon'], 'coordinates': [SQUARE]}, {'type': {}, 'coordinates': ()},
    *({'type': kind, 'coordinates': at}
      for kind in ('Polygon', 'LineString', 'LinearRing', 'Point')
      for at in (None, 7, 'text', {}, [None], [[None]], [[[None, 1]]], [[()]], [[(1,)]], {1: 2},
                 [['ab', 'cd']], object(), [[SQUARE]], [{}],
                 [[(0, 1), (1,)]], [[(0, 0), (0, '1')]], [[(0, 1j), (1, 1)]], Geometry(None))),
    RuntimeError('lost'), KeyError('lost'), TypeError(), RecursionError(), MemoryError(),
    ZeroDivisionError()])
def test_broken_geometries_are_refused(interface):
    """With the same kind of error, whatever is broken."""
    for use in (Polygon, lambda body: PolygonSet([body]), lambda body: intersects(body, SQUARE)):
        with pytest.raises(PolygonError) as error:
            use(Geometry(interface))
        assert error.value.reason in (Reason.WRONG_SHAPE, Reason.EMPTY) and str(error.value)
    with pytest.raises(TypeError, match='one Geometry, but a set'):
        PolygonSet(Geometry(interface))


def test_geometries_of_arrays_are_accepted():
    """Their coordinates may be of NumPy."""
    square = np.array(SQUARE)
    for kind, at in (('Polygon', square[None]), ('LinearRing', square), ('LineString', square[:2]),
                     ('Point', square[0])):
        assert intersects(Geometry({'type': kind, 'coordinates': at}), [(0, 0)])


@pytest.mark.parametrize('use, error, words', [
    # Holes as a second argument, as shapely.Polygon accepts them.
    *((partial(Polygon, SQUARE, holes), TypeError, 'max_vertices has to be an integer.*holes')
      for holes in ([[(0.5, 0.5), (1, 0.5), (1, 1)]], True)),
    # Vertices of a Polygon are reordered, so those of two poses may not match.
    (partial(time_of_contact, Polygon(SQUARE), Polygon(SQUARE), SQUARE, SQUARE), PolygonError,
     'a Polygon, which has dropped and reordered vertices'),
    # Even if nothing would be found.
    *((partial(PolygonSet([SQUARE]).rows_within, [(9, 9)], margin), ValueError,
       'margin .* 0 or more') for margin in (-1.0, -1e-300, float('nan'), -10 ** 400)),
    # It is not taken as a set of its vertices.
    *((partial(use, *[one] * count), TypeError,
       'one Polygon, but a set is made of several bodies')
      for one in (Polygon(SQUARE), shapely.Polygon(SQUARE))
      for use, count in ((PolygonSet, 1), (partial(intersects_many, SQUARE), 1),
                         (separations, 2)))])
def test_misuse_is_refused(use, error, words):
    with pytest.raises(error, match=words):
        use()


@pytest.mark.parametrize('number', [np.float16, np.float32, np.longdouble, Fraction])
def test_numbers_of_any_type_are_taken_as_doubles(number):
    """Without a warning, or a kernel for each type; infinity is refused in each."""
    obstacles = PolygonSet([[(1, 1)]])
    uses = [lambda value: obstacles.first_contact([(0, 0)], (1, 0, 0.5), value),
            lambda value: obstacles.first_contact([(0, 0)], (1, 0, 0.5), 3.0, margin=value),
            lambda value: obstacles.first_contact([(0, 0)], (1, 0, 0.5), 3.0, tolerance=value),
            lambda value: time_of_contact(SQUARE, SQUARE, [(4, 1)], [(3, 1)], tolerance=value),
            lambda value: time_of_contact(SQUARE, SQUARE, [(4, 1)], [(3, 1)], margin=value)]
    for use in uses:
        with warnings.catch_warnings():
            warnings.simplefilter('error')
            assert use(number(2)) == use(2.0)
            with pytest.raises(ValueError, match='finite'):
                use(10 ** 400 if number is Fraction else number('inf'))


@pytest.mark.parametrize('value', [
    '1.0', b'1', True, np.True_, 1j, None, [1.0], np.ma.masked, np.ma.masked_greater(1.0, 2.0)])
def test_what_is_no_number_is_refused(value):
    """By one rule, as coordinates are, whatever numpy or float() would make of it."""
    obstacles = PolygonSet([[(1, 1)]])
    for name, use in [
            ('horizon', lambda: obstacles.first_contact([(0, 0)], (1, 0, 0.5), value)),
            ('margin', lambda: obstacles.first_contact([(0, 0)], (1, 0, 0), 3.0, margin=value)),
            ('tolerance', lambda: time_of_contact(SQUARE, SQUARE, [(4, 1)], [(3, 1)], value)),
            ('margin', lambda: first_contact_along(SQUARE, [(0, 0, 0)], obstacles, value)),
            ('margin', lambda: obstacles.rows_within(SQUARE, value))]:
        with pytest.raises(ValueError, match=f'{name} .* has to be a number'):
            use()

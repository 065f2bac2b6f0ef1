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

"""
The methods compared, each as a loop over many pairs prepared for it.

What a body needs once is made before: packed arrays, boxes, centres of gravity, shapely's shapes.
Running a method then returns its answers and, of all kernels but improved,
how many axes each took.
"""

from functools import cached_property
from typing import NamedTuple

import filters
from libraries import shapely_shape
import numpy as np
import readings
import rivals
from sat_collision import intersects_pairs, Polygon, PolygonSet
from sat_collision.geometry import sat_methods
from sat_collision.geometry.intersection import convex_meet
from sat_collision.geometry.jit import borrowed, COMPILED, kernel, scratch
from sat_collision.geometry.layout import Packed, packed_size
from sat_collision.geometry.packing import pack
import shapely

RECTANGLES = 'rectangles'


class Method(NamedTuple):
    """
    A method: its one name, how it is drawn, its kernel and what that takes of each body.

    The colours are safe for the colour-blind (Okabe and Ito, and Tol).
    """

    label: str
    colour: str
    marker: str
    kernel: object = None
    prepared: str = None
    what: str = ''


METHODS = {
    'traditional': Method('traditional', '#000000', 'o', sat_methods.traditional_axes, None,
                          'the normals of all edges, every vertex projected (section 2.3)'),
    'traditional_float32': Method('traditional, float32', '#7f7f7f', 's',
                                  sat_methods.traditional_axes, None,
                                  'the same on coordinates rounded to float32, in float32'),
    'boxed': Method('box pre-test', '#56B4E9', '^', sat_methods.boxed_axes, 'bounds',
                    'bounding boxes, then traditional (section 1)'),
    'rectangles': Method('merged axes', '#882255', 'P', sat_methods.rectangles_axes, None,
                         'two axes a rectangle (section 2.3)'),
    'published_a': Method('published A', '#D55E00', 'v', sat_methods.published_a_axes, 'centres',
                          'sections 3.1 and 3.2: all vertices on the centre line, the edge '
                          'normals at the potential nearest points, the lines to the nearest '
                          'points'),
    'published_b': Method('published B', '#CC79A7', 'D', sat_methods.published_b_axes, 'centres',
                          'section 4 to the letter: four vertices on the centre line, the '
                          'normals of the two edges it crosses'),
    'hybrid': Method('published, hybrid', '#AA4499', '<', readings.hybrid_axes, 'centres',
                     'all vertices on the centre line, then the two normals of section 4'),
    'closest': Method('published, Eq. 3–4', '#999933', '>', readings.closest_axes, None,
                      'the line through the closest points, by brute force'),
    'literal': Method('published, Eq. 5', '#CC6677', 'd', readings.literal_axes, 'centres',
                      'reading A with B and C chosen by equation 5 as printed'),
    'binary': Method('binary-search SAT', '#E69F00', 'h', rivals.binary_axes, 'heads',
                     'the normals of all edges, each by a support vertex'),
    'gjk': Method('GJK', '#332288', 'p', rivals.gjk_axes, 'heads',
                  f'with a tolerance of {rivals.GJK_TOLERANCE:g} of the largest difference'),
    'interval': Method('interval filter', '#88CCEE', 'H', filters.interval_axes, 'heads',
                       'edges by interval arithmetic, the pair exactly where it is undecided'),
    'filtered': Method('filtered orientations', '#117733', '8', filters.filtered_axes, 'heads',
                       'edges by orientations, each filtered as in CGAL, with exact fallback'),
    'improved': Method('improved', '#009E73', '*', None, None, 'what this package runs'),
    'shapely': Method('shapely', '#0072B2', 'X', None, None,
                      'a general geometry library, on GEOS'),
}
LABELS = {name: method.label for name, method in METHODS.items()}
EXACT = 'interval', 'filtered', 'improved', 'shapely'
# Measured for wrong answers alone.
UNTIMED = 'traditional_float32',


class Pairs:
    """Pairs of convex bodies, prepared for each method when first needed."""

    def __init__(self, pairs):
        self.sides = [a for a, _ in pairs], [b for _, b in pairs]

    def __len__(self):
        return len(self.sides[0])

    @cached_property
    def packed(self):
        return [_pack(bodies, np.float64) for bodies in self.sides]

    @cached_property
    def packed_float32(self):
        with np.errstate(over='ignore'):
            return [_pack(bodies, np.float32) for bodies in self.sides]

    @cached_property
    def views(self):
        return [[memoryview(body) for body in bodies] for bodies in self.sides]

    @cached_property
    def bounds(self):
        return _each(sat_methods.bounds, self.sides)

    @cached_property
    def centres(self):
        return _each(sat_methods.centre_of_gravity, self.sides)

    @cached_property
    def heads(self):
        """Return a bounding box and a centre of gravity a body."""
        heads = [np.hstack(parts) for parts in zip(self.bounds, self.centres)]
        return heads if COMPILED else [head.tolist() for head in heads]

    @cached_property
    def polygons(self):
        return [[Polygon(body) for body in bodies] for bodies in self.sides]

    @cached_property
    def sets(self):
        return [PolygonSet(polygons) for polygons in self.polygons]

    @cached_property
    def shapely(self):
        return [np.array([shapely_shape(body) for body in bodies]) for bodies in self.sides]


def run(name, pairs):
    """Return the answers of a method, and how many axes it took or None."""
    if name == 'improved':
        return intersects_pairs(*pairs.sets), None
    if name == 'shapely':
        return shapely.intersects(*pairs.shapely), None
    method, prepared = METHODS[name].kernel, METHODS[name].prepared
    extra = getattr(pairs, prepared) if prepared else None
    answers, axes = np.empty(len(pairs), np.bool_), np.empty(len(pairs), np.int64)
    if not COMPILED:
        _loop(method, *pairs.views, extra, answers, axes)
        return answers, axes
    (a, a_ends), (b, b_ends) = (pairs.packed_float32 if name == 'traditional_float32'
                                else pairs.packed)
    if extra is None:
        _stream(method, a, a_ends, b, b_ends, answers, axes)
    else:
        _stream_prepared(method, a, a_ends, extra[0], b, b_ends, extra[1], answers, axes)
    return answers, axes


def applicable(shape=None):
    """Return the methods for a shape: merged axes are for rectangles only."""
    return [name for name in METHODS
            if (name != 'rectangles' or shape == RECTANGLES)
            and (COMPILED or name not in ('traditional_float32', 'shapely'))]


def run_once(name, pairs):
    """Return the answers of a method for bodies used once: what it needs of each is made, too."""
    if name == 'shapely':
        return shapely.intersects(*(shapely.polygons(np.stack(bodies)) for bodies in pairs.sides))
    answers = np.empty(len(pairs), np.bool_)
    (a, a_ends), (b, b_ends) = pairs.packed
    if name == 'improved':
        _pack_and_meet(a, a_ends, b, b_ends, answers)
    elif METHODS[name].prepared is None:
        _stream(METHODS[name].kernel, a, a_ends, b, b_ends, answers,
                np.empty(len(pairs), np.int64))
    else:
        _stream_once(METHODS[name].kernel, _PREPARING[METHODS[name].prepared], a, a_ends,
                     b, b_ends, answers)
    return answers


def _each(function, sides):
    """Return function of each body: an array a side, or lists of floats for plain Python."""
    arrays = [np.array([function(body) for body in bodies]) for bodies in sides]
    return arrays if COMPILED else [array.tolist() for array in arrays]


def _pack(bodies, dtype):
    ends = np.cumsum([0] + [len(body) for body in bodies])
    return np.concatenate(bodies).astype(dtype), ends


def _loop(method, a, b, extra, answers, axes):
    """Do the same in plain Python, which indexes memoryviews several times faster."""
    if extra is None:
        for i, (p, q) in enumerate(zip(a, b)):
            answers[i], axes[i] = method(p, q)
    else:
        for i, (p, q, of_p, of_q) in enumerate(zip(a, b, *extra)):
            answers[i], axes[i] = method(p, q, of_p, of_q)


@kernel
def _stream(method, a, a_ends, b, b_ends, answers, axes):
    # Without reference counts, which would cost the quicker methods more than they do themselves.
    a, b = borrowed(a), borrowed(b)
    for i in range(len(answers)):
        answers[i], axes[i] = method(a[a_ends[i]:a_ends[i + 1]], b[b_ends[i]:b_ends[i + 1]])


@kernel
def _stream_prepared(method, a, a_ends, of_a, b, b_ends, of_b, answers, axes):
    a, b, of_a, of_b = borrowed(a), borrowed(b), borrowed(of_a), borrowed(of_b)
    for i in range(len(answers)):
        answers[i], axes[i] = method(a[a_ends[i]:a_ends[i + 1]], b[b_ends[i]:b_ends[i + 1]],
                                     of_a[i], of_b[i])


@kernel
def _stream_once(method, prepare, a, a_ends, b, b_ends, answers):
    a, b = borrowed(a), borrowed(b)
    for i in range(len(answers)):
        p = a[a_ends[i]:a_ends[i + 1]]
        q = b[b_ends[i]:b_ends[i + 1]]
        answers[i], _ = method(p, q, prepare(p), prepare(q))


@kernel
def _pack_and_meet(a, a_ends, b, b_ends, answers):
    """Check, clean and pack convex bodies as those of messages are, and decide."""
    for i in range(len(answers)):
        n, m = a_ends[i + 1] - a_ends[i], b_ends[i + 1] - b_ends[i]
        p, q = scratch(packed_size(n)), scratch(packed_size(m))
        _, n, _, _, _ = pack(a[a_ends[i]:a_ends[i + 1]].ravel(), p, n, 0)
        _, m, _, _, _ = pack(b[b_ends[i]:b_ends[i + 1]].ravel(), q, m, 0)
        answers[i] = convex_meet(Packed(p, 0, n), Packed(q, 0, m))


@kernel
def _head(body):
    low_x, low_y, high_x, high_y = sat_methods.bounds(body)
    x, y = sat_methods.centre_of_gravity(body)
    return low_x, low_y, high_x, high_y, x, y


# What makes ready a body for a method, by the name of what the method takes.
_PREPARING = {'bounds': sat_methods.bounds, 'centres': sat_methods.centre_of_gravity,
              'heads': _head}

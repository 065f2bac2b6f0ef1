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

What a body needs once is made before: arrays, boxes, centres of gravity, packed polygons, the
rivals' own shapes. Running a method then returns its answers and, of the methods of
`sat_collision.geometry.sat_methods`, how many axes each took.
"""

from functools import cached_property

import numpy as np
from sat_collision import intersects_pairs, Polygon, PolygonSet
from sat_collision.geometry import sat_methods
from sat_collision.geometry.jit import borrowed, COMPILED, kernel
from sat_collision.geometry.layout import Packed
from sat_collision.geometry.separating_axis import boxes_apart, find_separating_axis, UNCERTAIN
import shapely

try:
    # The C function under Shape.shapes_collide, which in pymunk 7.3 asserts on separate shapes.
    from pymunk import Body, Poly, Segment
    from pymunk._chipmunk_cffi import lib as chipmunk
except ImportError:
    chipmunk = None

# name: (label, colour, marker), the same in all plots. The colours are safe for the
# colour-blind (Okabe and Ito, one of Tol).
STYLES = {
    'traditional': ('traditional', '#000000', 'o'),
    'traditional_float32': ('traditional, float32', '#7f7f7f', 's'),
    'boxed': ('box pre-test', '#56B4E9', '^'),
    'rectangles': ('rectangles, merged axes', '#882255', 'P'),
    'published_a': ('published A', '#D55E00', 'v'),
    'published_b': ('published B', '#CC79A7', 'D'),
    'improved': ('improved', '#009E73', '*'),
    'shapely': ('shapely', '#0072B2', 'X'),
    'pymunk': ('pymunk (Chipmunk)', '#E69F00', 'h'),
}
LABELS = {name: style[0] for name, style in STYLES.items()}
RIVALS = 'shapely', 'pymunk'
# Testing bounding boxes counts as trying two axes.
BOX_AXES = 2


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
    def polygons(self):
        return [[Polygon(body) for body in bodies] for bodies in self.sides]

    @cached_property
    def sets(self):
        return [PolygonSet(polygons) for polygons in self.polygons]

    @cached_property
    def shapely(self):
        return [np.array([shapely_shape(body) for body in bodies]) for bodies in self.sides]

    @cached_property
    def pymunk(self):
        return [[pymunk_shape(body) for body in bodies] for bodies in self.sides]


def _each(function, sides):
    """Return function of each body: an array a side, or lists of floats for plain Python."""
    arrays = [np.array([function(body) for body in bodies]) for bodies in sides]
    return arrays if COMPILED else [array.tolist() for array in arrays]


def run(name, pairs):
    """Return the answers of a method, and how many axes it took or None."""
    if name == 'improved':
        return intersects_pairs(*pairs.sets), None
    if name == 'shapely':
        return shapely.intersects(*pairs.shapely), None
    if name == 'pymunk':
        collide = chipmunk.cpShapesCollide
        return np.array([collide(a._shape, b._shape).count > 0
                         for a, b in zip(*pairs.pymunk)], np.bool_), None
    method, prepared = _KERNELS[name]
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


def applicable(shape):
    """Return the methods for a shape: merged axes are for rectangles only."""
    return [name for name in STYLES
            if (name != 'rectangles' or shape == 'rectangles')
            and (name != 'pymunk' or chipmunk is not None)
            and (COMPILED or name not in ('traditional_float32', *RIVALS))]


def queries(pairs):
    """Return how many axes improved takes, the boxes counted as two, and where it is unsure."""
    counts, unsure = np.empty(len(pairs), np.int64), np.empty(len(pairs), np.bool_)
    _count(*_packed_bodies(pairs.polygons[0]), *_packed_bodies(pairs.polygons[1]), counts, unsure)
    return counts, unsure


def find_centres(pairs):
    """Return the centres of gravity of the first bodies of pairs, compiled."""
    centres = np.empty((len(pairs), 2))
    _find_centres(*pairs.packed[0], centres)
    return centres


def shapely_shape(body):
    if len(body) > 2:
        return shapely.Polygon(body)
    return shapely.LineString(body) if len(body) == 2 else shapely.Point(body[0])


def pymunk_shape(body):
    place = Body(body_type=Body.STATIC)
    points = body.tolist()
    shape = Poly(place, points) if len(body) > 2 else Segment(place, points[0], points[-1], 0)
    shape.cache_bb()
    return shape


# name: (kernel, what it takes of each body besides the vertices)
_KERNELS = {
    'traditional': (sat_methods.traditional_axes, None),
    'traditional_float32': (sat_methods.traditional_axes, None),
    'boxed': (sat_methods.boxed_axes, 'bounds'),
    'rectangles': (sat_methods.rectangles_axes, None),
    'published_a': (sat_methods.published_a_axes, 'centres'),
    'published_b': (sat_methods.published_b_axes, 'centres'),
}


def _pack(bodies, dtype):
    ends = np.cumsum([0] + [len(body) for body in bodies])
    return np.concatenate(bodies).astype(dtype), ends


def _packed_bodies(polygons):
    packed = [polygon.packed[0] for polygon in polygons]
    starts = np.cumsum([0] + [len(body) for body in packed[:-1]])
    return np.concatenate(packed), starts, np.array([polygon.packed[1] for polygon in polygons])


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
def _find_centres(points, ends, centres):
    points = borrowed(points)
    for i in range(len(centres)):
        centres[i, 0], centres[i, 1] = sat_methods.centre_of_gravity(points[ends[i]:ends[i + 1]])


@kernel
def _count(a, a_starts, a_counts, b, b_starts, b_counts, counts, unsure):
    for i in range(len(counts)):
        counts[i] = BOX_AXES
        unsure[i] = False
        p = Packed(a, a_starts[i], a_counts[i])
        q = Packed(b, b_starts[i], b_counts[i])
        if not boxes_apart(p, q):
            verdict, _, _, tried = find_separating_axis(p, q)
            counts[i] += tried
            unsure[i] = verdict == UNCERTAIN

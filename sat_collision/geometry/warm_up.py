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
Kernels compiled, or loaded, before they are needed, so that no message has to wait for them.

Compiling takes seconds where nothing is kept from an earlier process, see `kernel_cache`. Two
processes may share the work, as what one has compiled the other finds on disk: while one prepares
contacts and convex parts, ``python -m sat_collision.geometry.warm_up`` prepares packing, says so
by a line, and goes on with distances, until it is done or its standard input ends, which the
other one holds; see `preparation`.
"""

import os
import threading

import numpy as np
from sat_collision.geometry.contact import contact, contact_of_arrays
from sat_collision.geometry.convex_parts import convex_parts
from sat_collision.geometry.jit import COMPILED, indexable
from sat_collision.geometry.layout import packed_size
from sat_collision.geometry.packing import pack_convex
from sat_collision.geometry.plane import centroid
from sat_collision.geometry.polygon import Polygon, UNMOVED
from sat_collision.geometry.polygon_set import PackedSet, PolygonSet
from sat_collision.geometry.query import (
    closest_points, intersects, intersects_pairs, separations)
from sat_collision.geometry.sweep import time_of_contact

_TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
_NOTCHED = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0)]


def is_prepared() -> bool:
    """Return whether an earlier process has left the kernels compiled; without numba they are."""
    if not COMPILED:
        return True
    # It imports numba, which may not be there, or not work.
    from sat_collision.geometry.kernel_cache import is_kept
    return is_kept(contact_of_arrays)


def prepare_packing() -> None:
    """Have ready what makes polygons of messages."""
    packed = indexable(np.empty(packed_size(len(_TRIANGLE))))
    points = _TRIANGLE.tobytes(), 0, len(_TRIANGLE)
    pack_convex(*points, packed, len(_TRIANGLE), UNMOVED)
    Polygon(_TRIANGLE)
    Polygon.from_float32(*points)
    message = np.array((0, len(_TRIANGLE)), np.uint32).tobytes() + points[0]
    ends = indexable(np.array((len(message),)))
    bodies = PackedSet([_origin()])
    bodies.place_run((2 * message, ends, 1, 4, UNMOVED, len(_TRIANGLE), packed),
                     indexable(np.zeros(1, np.int64)), 0, 1, PackedSet(), 0.0)


def prepare_parts() -> None:
    """Have ready what cuts bodies into convex parts, and finds their centroids."""
    # Not by a Polygon, whose packing may still be in the making.
    outline = indexable(np.array(_NOTCHED).ravel())
    convex_parts(outline)
    centroid(outline, len(_NOTCHED))


def prepare_contacts() -> None:
    """Have ready what finds the bodies of a set that a body meets."""
    point = _origin()
    bodies = PackedSet()
    bodies.place(bodies.new_row(), point.packed, bodies)


def prepare_distances() -> None:
    """Have ready what finds the nearest body of a set, those within a margin, and contacts."""
    point = _origin()
    bodies = PackedSet([point])
    bodies.nearest(point)
    bodies.place(0, point.packed, PolygonSet([point]), 1.0)
    bodies.rows_within(point, 1.0)
    bodies.first_contact(point, (1, 0, 1), 1.0)
    # Last: `is_prepared` asks for it.
    contact(point, point)


def prepare_pairs() -> None:
    """Have ready what only the functions on two bodies, or two sets, need."""
    body = Polygon(_TRIANGLE)
    bodies = PolygonSet([body])
    intersects(body, body)
    intersects_pairs(bodies, bodies)
    separations(bodies, bodies)
    closest_points(body, body)
    time_of_contact(_TRIANGLE, _TRIANGLE + 2, _TRIANGLE + 4, _TRIANGLE)


def _origin() -> Polygon:
    """Return a point packed by hand, because packing may still be in the making."""
    return Polygon._of_packed(np.zeros(packed_size(1)), 1)


def _end_with_input() -> None:
    # Not by sys.stdin, whose lock would be held when the interpreter ends.
    os.read(0, 1)
    os._exit(0)


if __name__ == '__main__':
    threading.Thread(target=_end_with_input, daemon=True).start()
    prepare_packing()
    print('what decides is ready', flush=True)
    prepare_distances()

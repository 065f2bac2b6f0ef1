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
contacts, ``python -m sat_collision.geometry.warm_up`` prepares all the others, packing first,
and says so.
"""

import numpy as np
from sat_collision.geometry import kernel_cache
from sat_collision.geometry.jit import COMPILED, indexable
from sat_collision.geometry.layout import packed_size
from sat_collision.geometry.packing import pack_convex
from sat_collision.geometry.polygon import Polygon
from sat_collision.geometry.polygon_set import PolygonSet
from sat_collision.geometry.query import closest_points, intersects, intersects_pairs
from sat_collision.geometry.scan import nearest_row
from sat_collision.geometry.sweep import time_of_contact

_TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
_NOTCHED = [(0, 0), (4, 0), (4, 4), (2, 1)]


def is_prepared() -> bool:
    """Tell whether an earlier process has left the kernels compiled; without numba they are."""
    return not COMPILED or kernel_cache.is_kept(nearest_row)


def prepare_packing() -> None:
    """Have ready what makes polygons of messages; needed for the first flag."""
    packed = indexable(np.empty(packed_size(len(_TRIANGLE))))
    pack_convex(_TRIANGLE.tobytes(), 0, len(_TRIANGLE), packed, len(_TRIANGLE))
    Polygon(_TRIANGLE)


def prepare_contacts() -> None:
    """Have ready what finds the bodies of a set that a body meets; needed for the first flag."""
    # A point in the origin, packed by hand, because packing may still be in the making.
    point = indexable(np.zeros(packed_size(1))), 1
    bodies = PolygonSet()
    bodies.place(bodies.new_row(), point, bodies)
    bodies.is_same(0, point)


def prepare_rest() -> None:
    """Have ready what need not precede the first flag: convex parts, separation, pairs, sweeps."""
    body = Polygon(_NOTCHED)
    bodies = PolygonSet([body])
    bodies.place(0, body.packed, PolygonSet(), 1.0)
    bodies.intersecting_rows(body)
    bodies.rows_within(body, 1.0)
    bodies.nearest(body)
    intersects(body, body)
    closest_points(body, body)
    body.centroid
    intersects_pairs(bodies, bodies)
    time_of_contact(_NOTCHED, _NOTCHED, [(0, 4)], [(2, 3)])


if __name__ == '__main__':
    prepare_packing()
    print('packing', flush=True)
    prepare_rest()

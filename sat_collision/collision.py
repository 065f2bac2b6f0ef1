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
"""The collision decision for any two bodies."""

from sat_collision.exact import bodies_meet
from sat_collision.jit import indexable
from sat_collision.polygon import as_polygon
from sat_collision.polygon_set import PolygonSet


def intersects(a, b):
    """
    Tell whether two bodies share a point; touching counts.

    Exact for the coordinates given, whatever they are, as long as they are finite doubles.

    Parameters
    ----------
    a, b : Polygon or (n, 2) array_like
        Polygons, segments or points, convex or not, in one frame; metres.

    Returns
    -------
    bool

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    """
    a_block, n = as_polygon(a).block
    b_block, m = as_polygon(b).block
    return bool(bodies_meet(indexable(a_block), 0, n, indexable(b_block), 0, m))


def intersects_many(a, others):
    """
    Tell for each of many bodies whether it shares a point with one; touching counts.

    Parameters
    ----------
    a : Polygon or (n, 2) array_like
        The one body.
    others : PolygonSet or sequence of Polygon or (n, 2) array_like
        The m other bodies.

    Returns
    -------
    (m,) ndarray of bool

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    """
    if not isinstance(others, PolygonSet):
        others = PolygonSet(as_polygon(other) for other in others)
    return others.intersects(as_polygon(a))


def intersects_pairs(a, b):
    """
    Tell for each pair of bodies of two sets whether they share a point; touching counts.

    Parameters
    ----------
    a, b : PolygonSet
        The k-th of a is compared with the k-th of b; of equal length.

    Returns
    -------
    (k,) ndarray of bool

    Raises
    ------
    ValueError
        The sets differ in length.

    """
    return a.intersects_pairwise(b)

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

"""What is asked of any two bodies: do they touch, and how far apart or how deep are they."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.distance import measure_arrays
from sat_collision.geometry.intersection import arrays_meet
from sat_collision.geometry.polygon import as_polygon, Polygon
from sat_collision.geometry.polygon_set import PolygonSet


def intersects(a: Polygon | ArrayLike, b: Polygon | ArrayLike) -> bool:
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
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    return bool(arrays_meet(p, n, q, m))


def intersects_many(a: Polygon | ArrayLike,
                    others: PolygonSet | Iterable[Polygon | ArrayLike]) -> NDArray[np.bool_]:
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
        others = PolygonSet(others)
    return others.intersects(a)


def intersects_pairs(a: PolygonSet, b: PolygonSet) -> NDArray[np.bool_]:
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
    return a.intersects_pairs(b)


def separation(a: Polygon | ArrayLike, b: Polygon | ArrayLike) -> float:
    """
    Return the signed distance of two bodies in metres.

    Parameters
    ----------
    a, b : Polygon or (n, 2) array_like
        Polygons, segments or points, convex or not, in one frame; metres, below 8e307.

    Returns
    -------
    float
        Right to 8 ulp of the largest coordinate, and the same whatever the start vertices and
        the order of the bodies. Apart: the distance, > 0. Touching: 0. Overlapping: minus the
        penetration depth, the length of the shortest translation after which they only touch; of
        bodies that are not convex, minus the greatest depth of a pair of their convex parts, which
        that translation is at least as long as. It is > 0 just when `intersects` is false.

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    """
    return _measure(a, b)[0]


def closest_points(a: Polygon | ArrayLike, b: Polygon | ArrayLike
                   ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return the two points that realise the separation of two bodies.

    Parameters
    ----------
    a, b : Polygon or (n, 2) array_like
        As for `separation`.

    Returns
    -------
    (2,) ndarray, (2,) ndarray
        A point of a and one of b. Apart: no two points are nearer. Overlapping: moving a by the
        second minus the first ends the overlap (of the deepest pair of convex parts).

    """
    _, ax, ay, bx, by = _measure(a, b)
    return np.array([ax, ay]), np.array([bx, by])


def _measure(a: Polygon | ArrayLike,
             b: Polygon | ArrayLike) -> tuple[float, float, float, float, float]:
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    found: tuple[float, float, float, float, float] = measure_arrays(p, n, q, m)
    return found

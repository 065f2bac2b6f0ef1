# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Queries on bodies: whether they touch, how far apart or deep they are, and when they meet.

All raise `PolygonError` for points that do not make a polygon.
"""

from __future__ import annotations

from collections.abc import Iterable
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sat_collision.geometry.body.polygon import as_polygon, BodyLike
from sat_collision.geometry.pair.distance import measure_arrays
from sat_collision.geometry.pair.intersection import arrays_meet
from sat_collision.geometry.sets.polygon_set import PolygonSet


def intersects(a: BodyLike, b: BodyLike) -> bool:
    """
    Return whether two bodies share a point; touching counts.

    Exact for all coordinates that are finite doubles.

    Parameters
    ----------
    a, b : Polygon, (n, 2) array_like or geometry
        Polygons, segments or points, convex or not, in one frame; metres.

    Returns
    -------
    bool

    Raises
    ------
    PolygonError
        Points that do not make a polygon.

    Examples
    --------
    >>> intersects([(0, 0), (1, 0), (1, 1), (0, 1)], [(1, 1), (2, 3)])
    True

    """
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    return bool(arrays_meet(p, n, q, m))


def intersects_many(a: BodyLike, others: PolygonSet | Iterable[BodyLike]) -> NDArray[np.bool_]:
    """
    Return for each of many bodies whether it shares a point with another one; touching counts.

    Parameters
    ----------
    a : Polygon, (n, 2) array_like or geometry
    others : PolygonSet or sequence of Polygon, (n, 2) array_like or geometry

    Returns
    -------
    (m,) ndarray of bool

    Examples
    --------
    >>> intersects_many([(0, 0), (2, 0), (2, 2)], [[(1, 0)], [(0, 1)]])
    array([ True, False])

    """
    return _as_set(others).intersects(a)


def intersects_pairs(a: PolygonSet | Iterable[BodyLike],
                     b: PolygonSet | Iterable[BodyLike]) -> NDArray[np.bool_]:
    """
    Return for each pair of bodies of two sets whether they share a point; touching counts.

    Parameters
    ----------
    a, b : PolygonSet or sequence of Polygon, (n, 2) array_like or geometry
        The k-th of a is compared with the k-th of b; of equal length.

    Returns
    -------
    (k,) ndarray of bool

    Raises
    ------
    PolygonError
        Points that do not make a polygon.
    ValueError
        The sets differ in length.

    Examples
    --------
    >>> intersects_pairs([[(0, 0), (2, 2)], [(0, 0)]], [[(1, 1)], [(1, 1)]])
    array([ True, False])

    """
    return _as_set(a).intersects_pairs(_as_set(b))


def separations(a: PolygonSet | Iterable[BodyLike],
                b: PolygonSet | Iterable[BodyLike]) -> NDArray[np.float64]:
    """
    Return for each pair of bodies of two sets their signed distance in metres.

    Parameters
    ----------
    a, b : PolygonSet or sequence of Polygon, (n, 2) array_like or geometry
        As for `intersects_pairs`, which raises the same errors.

    Returns
    -------
    (k,) ndarray
        As returned by `separation`.

    Examples
    --------
    >>> separations([[(0, 0), (2, 2)], [(0, 0)]], [[(1, 1)], [(3, 4)]])
    array([0., 5.])

    """
    return _as_set(a).separations(_as_set(b))


def _as_set(bodies: PolygonSet | Iterable[BodyLike]) -> PolygonSet:
    return bodies if isinstance(bodies, PolygonSet) else PolygonSet(bodies)


def separation(a: BodyLike, b: BodyLike) -> float:
    """
    Return the signed distance of two bodies in metres.

    Parameters
    ----------
    a, b : Polygon, (n, 2) array_like or geometry
        As for `intersects`, which raises the same errors.

    Returns
    -------
    float
        Apart: the distance, > 0. Touching: 0. Overlapping: minus the penetration depth, the length
        of the shortest translation after which they only touch. For non-convex bodies the depth is
        the greatest of a pair of their convex parts, a lower bound of that length; it is 0 for a
        point on a cut between parts, such as the inner diagonal of an L. The value is > 0 if and
        only if `intersects` is false. Its error is at most 2^-52 of itself plus 2^-96 of the
        largest coordinate; it does not depend on the start vertices or the order of the bodies,
        and is infinite if it is beyond the largest double.

    Examples
    --------
    >>> separation([(0, 0), (1, 0), (1, 1), (0, 1)], [(4, 5), (5, 5)])
    5.0

    """
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    return float(measure_arrays(p, n, q, m)[0])


def closest_points(a: BodyLike, b: BodyLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """
    Return the two points that realise the separation of two bodies.

    Parameters
    ----------
    a, b : Polygon, (n, 2) array_like or geometry
        As for `separation`.

    Returns
    -------
    (2,) ndarray, (2,) ndarray
        A point of a and one of b, up to rounding. Apart: no two points are nearer. Touching:
        a common point. Overlapping: moving a by the second minus the first ends the overlap (of
        the deepest pair of convex parts).

    Examples
    --------
    >>> closest_points([(0, 0), (0, 4)], [(3, 1)])
    (array([0., 1.]), array([3., 1.]))

    """
    p, n = as_polygon(a).packed
    q, m = as_polygon(b).packed
    _, (ax, ay, bx, by, _, _) = measure_arrays(p, n, q, m)
    return np.array([ax, ay]), np.array([bx, by])


def time_to_contact(footprint: BodyLike, twist: ArrayLike,
                    obstacles: PolygonSet | Iterable[BodyLike], horizon: float,
                    velocities: ArrayLike | None = None, pose: ArrayLike = (0.0, 0.0, 0.0),
                    tolerance: float = 1e-3) -> float:
    """
    Return when a body that moves with a constant twist first shares a point with an obstacle.

    The motion is checked at all times, not in steps. `PolygonSet.first_contact` also returns which
    obstacle it is.

    Parameters
    ----------
    footprint : Polygon, (n, 2) array_like or geometry
        The body at time 0, convex or not, in the frame of the obstacles; metres.
    twist : (3,) array_like
        vx and vy (m/s) along the axes of the body's own frame, x ahead and y to the left, which
        turn with it, and omega (rad/s, counter-clockwise).
    obstacles : PolygonSet or sequence of Polygon, (n, 2) array_like or geometry
        The m bodies that it may meet, where they are at time 0.
    horizon : float
        How far to look ahead, in seconds, including the end.
    velocities : (m, 2) array_like, optional
        vx and vy (m/s) of each obstacle in the common frame; they do not turn. By default all
        are at rest.
    pose : (3,) array_like, optional
        x, y (m) and yaw (rad) of the body's own frame at time 0; the body turns about the moving
        origin of this frame. By default the frame of the coordinates.
    tolerance : float, optional
        If the body turns: how far, in metres, it may be from the obstacle at the time returned.

    Returns
    -------
    float
        Seconds. 0.0: they share a point at time 0, if and only if `intersects` says so. Infinity:
        they share none up to the horizon. Otherwise a time no later than the first contact. If the
        body moves straight it is that time, up to rounding: the bodies are then within 2^-40 of
        the coordinates and path lengths. If it turns they are within that plus the tolerance, or
        plus 2^-25 a T^2 if this is more: T is the horizon and a = |omega| (|v| + |omega| r) bounds
        the accelerations, with r the distance of the farthest vertex from the origin of the pose.
        Underflow adds 2^-1058, and no time is below the least double above 0.

    Raises
    ------
    PolygonError
        Points that do not make a polygon.
    ValueError
        A twist or pose that is not three finite numbers; a horizon that is negative or not finite;
        velocities that are not finite or not one per obstacle; a tolerance that is not positive
        and finite; a path beyond the largest double, or a sixteenth of it, also with the distance
        of an obstacle added.

    Examples
    --------
    >>> round(time_to_contact([(0, 0), (1, 0), (1, 1)], (2, 0, 0), [[(4, 0), (4, 1)]], 3.0), 9)
    1.5

    """
    found = _as_set(obstacles).first_contact(footprint, twist, horizon, velocities, pose,
                                             tolerance)
    return math.inf if found is None else found[1]

# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
When two bodies that move between two poses come into contact.

Conservative advancement (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems",
1996) with the motion bounded along the separating axis. For a fixed axis u, the position of a
vertex along u is linear in time, so the gap between two convex parts along u, the least position
of one minus the greatest of the other, is concave: if it is positive at two times it is so between
them. For the axis of the separation at a time proved clear, the last time at which this axis still
separates is found; until then all is clear, and there the next axis is taken. No step is shorter
than the separation divided by the speed of the fastest relative vertex.

Gaps are rounded; see `_MARGIN` for why they are proofs all the same. Coordinates are taken
relative to a point near the bodies, so that a distant origin costs no accuracy; if they are of
extreme magnitude they are multiplied by a power of two, so that nothing overflows or underflows.
"""

from __future__ import annotations

import math

from numpy.typing import ArrayLike
from sat_collision.geometry.body.moving import (
    boxes_stay_apart, moving_body, Part, relative, STRIDE)
from sat_collision.geometry.body.polygon import coordinates, double, Polygon
from sat_collision.geometry.compiled.jit import elements, inlined, inner, kernel
from sat_collision.geometry.numeric.predicates import UNDERFLOW_BOUND
from sat_collision.geometry.numeric.vectors import LEAST, nearest_of_segment
from sat_collision.geometry.pair.distance import measure_arrays
from sat_collision.geometry.pair.intersection import arrays_meet

# A gap counts as positive if it exceeds this fraction of the largest relative coordinate M, and
# its error is at most 74 u M: docs/exactness.md, lemma 21.
_MARGIN = 128.0 * 2.0 ** -53
# A relative vertex moves by at most 4 sqrt(2) M.
_FASTEST = 6.0


def time_of_contact(a0: ArrayLike, a1: ArrayLike, b0: ArrayLike, b1: ArrayLike,
                    tolerance: float = 1e-6, margin: float = 0.0) -> float | None:
    """
    Return the first time at which two moving bodies share a point.

    Every vertex moves on a straight line at constant speed: a body that turns by an angle shrinks
    midway to the cosine of half the angle, so pass long motions in pieces. Vertices are matched by
    their order. A non-convex body moves as its convex parts do; if its shape changes so that these
    do not stay convex, or its outline crosses itself on the way, their whole convex hulls count.

    Parameters
    ----------
    a0, a1 : (n, 2) array_like
        Vertices of one body at times 0 and 1: a polygon, segment or point; metres.
    b0, b1 : (m, 2) array_like
        Vertices of the other, in the same frame.
    tolerance : float, optional
        Bodies that come nearer than this may count as in contact, metres.
    margin : float, optional
        Bodies no further apart than this count as in contact, metres.

    Returns
    -------
    float or None
        None: proved to share no point at any time from 0 to 1. 0.0: they share one at time 0, if
        and only if `intersects` says so. A time in (0, 1]: they share no point before it, up to
        rounding, and at it they are within the tolerance, or within 1e-12 of the extent of both
        paths if that is more. The order of the bodies does not matter.

    Raises
    ------
    PolygonError
        Vertices that do not make a polygon at time 0 or at time 1.
    ValueError
        A body with different numbers of vertices; a tolerance that is not positive and finite; a
        margin that is negative or not finite.

    Examples
    --------
    >>> time_of_contact([(0, 0), (0, 1)], [(4, 0), (4, 1)], [(3, 1)], [(1, 0)])
    0.5

    """
    tolerance, margin = limits(tolerance, margin)
    p0, p1, q0, q1 = (coordinates(pose) for pose in (a0, a1, b0, b1))
    a_start, a_end, b_start, b_end = (Polygon(pose, len(pose)) for pose in (p0, p1, q0, q1))
    a, a_ends = moving_body(p0, p1, a_start, a_end)
    b, b_ends = moving_body(q0, q1, b_start, b_end)
    if arrays_meet(*a_start.packed, *b_start.packed) or (
            margin > 0.0 and measure_arrays(*a_start.packed, *b_start.packed)[0] <= margin):
        return 0.0
    time = float(first_contact(a, a_ends, b, b_ends, tolerance, margin))
    return None if time == math.inf else time


def limits(tolerance: float, margin: float) -> tuple[float, float]:
    """Return tolerance and margin as doubles; raise `ValueError` if they are not valid."""
    # A kernel is compiled again for an integer.
    limit, apart = double(tolerance), double(margin)
    if not 0.0 < limit < math.inf:
        raise ValueError(f'tolerance {tolerance}, but it has to be a number, positive and finite')
    if not 0.0 <= apart < math.inf:
        raise ValueError(f'margin {margin}, but it has to be a number, 0 or more, and finite')
    return limit, apart


@kernel
def first_contact(a, a_ends, b, b_ends, tolerance, apart):
    """
    Return when two moving bodies that are further apart at time 0 come within a distance.

    At that time they may be further apart by the tolerance. The time is as for `time_of_contact`,
    but never 0, and infinity instead of None.
    """
    if ((_stands(a) and _stands(b))
            or boxes_stay_apart(Part(a, 0, len(a)), Part(b, 0, len(b)), apart)):
        return math.inf
    return first_contact_of_moving(a, a_ends, b, b_ends, tolerance, apart)


@inner
def first_contact_of_moving(a, a_ends, b, b_ends, tolerance, apart):
    """
    Return what `first_contact` does, for bodies at least one of which moves.

    For bodies that are within the distance at time 0 it is the least time above 0.
    """
    a, b, extent, scale = relative(a, b)
    apart *= scale
    # A greater tolerance is of no use, and might overflow when multiplied.
    tolerance = min(tolerance, 8.0 * extent) * scale
    time = math.inf
    first = 0
    for i in range(len(a_ends)):
        p = Part(a, first, a_ends[i])
        first = p.end
        other_first = 0
        for j in range(len(b_ends)):
            q = Part(b, other_first, b_ends[j])
            other_first = q.end
            if not boxes_stay_apart(p, q, apart):
                time = min(time, _first_contact_of_parts(p, q, tolerance, apart, time))
    return time


@inner
def _stands(array):
    for k in range(0, len(array), STRIDE):
        if array[k] != array[k + 2] or array[k + 1] != array[k + 3]:
            return False
    return True


@inner
def _first_contact_of_parts(p, q, tolerance, apart, before):
    """Return what `first_contact` does, for two parts; infinity, too, if not before `before`."""
    p = Part(elements(p.array), p.first, p.end)
    q = Part(elements(q.array), q.first, q.end)
    reach = max(_reach(p), _reach(q))
    margin = _MARGIN * (reach + apart) + UNDERFLOW_BOUND
    near = apart + max(tolerance / 2.0, 8.0 * margin)
    clear = touching = 0.0
    while clear < before:
        distance, ux, uy = _separation(p, q, clear, margin)
        if distance <= near and clear > 0.0:
            # The time at which the gap closes, if they are sure to be within the tolerance then.
            return min(touching, clear + (near - apart) / (_FASTEST * reach))
        last = clear
        clear, touching = _separated_until(p, q, clear, ux, uy, margin, apart)
        if clear == 1.0:
            return math.inf
        if not clear > last:
            return max(clear, LEAST)
    return math.inf


@inner
def _reach(p):
    reach = 0.0
    for k in range(p.first, p.end):
        reach = max(reach, abs(p.array[k]))
    return reach


@inner
def _separation(p, q, time, enough):
    """
    Return the distance of two parts at a time and, if they are apart, the unit axis that shows it.

    The nearest point of the Minkowski difference is sought as in `convex_distance`. The vertices
    of a part need not be in order, nor all on its hull.
    """
    wx, wy = _between(p, p.first, q, q.first, time)
    ax = bx = wx
    ay = by = wy
    distance, ux, uy = nearest_of_segment(ax, ay, bx, by)
    while True:
        wx, wy = _between(p, _support(p, ux, uy, time), q, _support(q, -ux, -uy, time), time)
        to_a, to_a_x, to_a_y = nearest_of_segment(ax, ay, wx, wy)
        to_b, to_b_x, to_b_y = nearest_of_segment(wx, wy, bx, by)
        gap = wx * ux + wy * uy
        if gap >= distance - enough:
            return distance, ux, uy
        if not min(to_a, to_b) < distance:
            # Rounding hides which is nearer: across a long edge the axis may show a greater gap.
            vx, vy = (to_a_x, to_a_y) if to_a <= to_b else (to_b_x, to_b_y)
            along, _, _ = _gap(p, q, vx, vy, time)
            return (distance, vx, vy) if along > gap else (distance, ux, uy)
        if to_a <= to_b:
            distance, ux, uy = to_a, to_a_x, to_a_y
            bx, by = wx, wy
        else:
            distance, ux, uy = to_b, to_b_x, to_b_y
            ax, ay = wx, wy


@inner
def _separated_until(p, q, clear, ux, uy, margin, apart):
    """
    Return until when, from a clear time on, an axis proves two parts further apart than `apart`.

    Returned with it is when the gap closes, up to rounding. The gap is the least of those of pairs
    of vertices, which are linear in time. From time 1 on, the next time to try is that at which
    the pair with the least gap has a gap of twice the margin (Newton's method); as the gap is
    concave, times decrease until that is the least gap. If nothing is proved, `clear` is returned.
    """
    touching = clear
    if not _gap(p, q, ux, uy, clear)[0] - apart > 3.0 * margin:
        return clear, touching
    time = 1.0
    while True:
        late, i, j = _gap(p, q, ux, uy, time)
        late -= apart
        if late > margin:
            return time, touching
        wx, wy = _between(p, i, q, j, clear)
        early = wx * ux + wy * uy - apart
        touching = min(clear + (time - clear) * (early / (early - late)), 1.0)
        sooner = clear + (time - clear) * ((early - 2.0 * margin) / (early - late))
        if not sooner < time:
            return clear, touching
        time = sooner


@inner
def _gap(p, q, ux, uy, time):
    """Return the gap between two parts along an axis, and the vertices at its ends."""
    i, j = _support(p, ux, uy, time), _support(q, -ux, -uy, time)
    wx, wy = _between(p, i, q, j, time)
    return wx * ux + wy * uy, i, j


@inner
def _support(p, ux, uy, time):
    """Return the index of the vertex of a part that is furthest along an axis at a time."""
    v = p.array
    summit = p.first
    most = -math.inf
    for k in range(p.first, p.end, STRIDE):
        along = (v[k] + time * (v[k + 2] - v[k])) * ux + (
            v[k + 1] + time * (v[k + 3] - v[k + 1])) * uy
        if along > most:
            most = along
            summit = k
    return summit


@inlined
def _between(p, i, q, j, time):
    """Return the offset from the vertex of P at i to that of Q at j, at a time."""
    v, w = p.array, q.array
    return (w[j] + time * (w[j + 2] - w[j]) - (v[i] + time * (v[i + 2] - v[i])),
            w[j + 1] + time * (w[j + 3] - w[j + 1]) - (v[i + 1] + time * (v[i + 3] - v[i + 1])))

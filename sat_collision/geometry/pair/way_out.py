# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The shortest move that takes one body out of another, over all directions.

Moved by t, a convex part of P meets one of Q if and only if t is in their difference {q - p}, a
convex polygon whose sides are parallel to theirs. P overlaps Q for the t inside the union of the
differences of all pairs of parts, so the way out is to the point outside that is nearest to the
origin. It is on a side of some difference: each side is followed from where it is nearest, to the
first point that no difference covers.

A difference is held as half-planes that are moved out, by more than what rounding takes, so that
differences of parts with a common cut overlap, and what is outside is outside for certain. The
line along a side is a little further out, so that its own difference does not cover it. See
docs/exactness.md, lemma 25. Coordinates are relative to a point near the bodies.
"""

import math
from typing import Any, NamedTuple

from sat_collision.geometry.body.layout import convex_part, first_vertex, outline_of
from sat_collision.geometry.body.moving import Part, parts_about, write_relative
from sat_collision.geometry.compiled.jit import elements, inner, scratch, scratch_integers
from sat_collision.geometry.numeric.vectors import reach_along, scale_to_one, unit
from sat_collision.geometry.pair.convex_distance import reach_of
from sat_collision.geometry.pair.distance import open_pairs

# The most work, the sum of the squares of the numbers of sides of differences, for which all
# directions count. Two bodies of 64 vertices need less, as they have up to 62 triangles each.
_MOST_WORK = 100 * 64 * 64
# How far lines along sides are moved out, relative to the extent of both bodies; the half-planes
# of differences by most of it; the ends of lines by more.
_CLEAR = 2.0 ** -45
_HALF_PLANES = 0.875
_ENDS = 1.125


class Differences(NamedTuple):
    """Differences of pairs of parts."""

    # Flat array of float64, or its `elements`: of each half-plane {t: u . t <= h} the unit vector
    # u and h, difference after difference.
    sides: Any
    ends: Any  # array of int64, or its `elements`: the index at which each difference ends
    used: int


class Way(NamedTuple):
    """A move: its length and direction."""

    length: float
    ux: float
    uy: float


class Line(NamedTuple):
    """A line, by its point nearest to the origin, and the direction in which it is followed."""

    x: float
    y: float
    wx: float
    wy: float


@inner
def way_out(p, q):
    """
    Return the shortest move that takes P out of Q.

    If too many differences are within reach, see `_MOST_WORK`, it is the shortest along an axis or
    a normal of a side after which a straight line is between the bodies.
    """
    i, j = p.start, q.start
    x, y = min(p.array[i + 2], q.array[j + 2]), min(p.array[i + 3], q.array[j + 3])
    scale = scale_to_one(reach_of(p, q))
    best = _straight_way(_outline(p, x, y, scale), _outline(q, x, y, scale))
    clear = _CLEAR * max(max(p.array[i + 4], q.array[j + 4]) * scale - x * scale,
                         max(p.array[i + 5], q.array[j + 5]) * scale - y * scale)
    pairs = open_pairs(p, q, (best.length + 2.0 * clear) / scale)
    parts = max(1, -q.n)
    size = work = 0
    for pair in pairs:
        a, b = convex_part(p, pair // parts), convex_part(q, pair % parts)
        size += a.n + b.n + 4
        work += (a.n + b.n + 4) ** 2
        if work > _MOST_WORK:
            break
    if work <= _MOST_WORK:
        # The way to a line is longer by `clear`, and that is subtracted in the end.
        best = Way(best.length + clear, best.ux, best.uy)
        found = _differences(parts_about(p, x, y, scale), parts_about(q, x, y, scale), pairs, size,
                             clear, best.length)
        best = _nearest(found, clear, best)
        best = Way(best.length - clear, best.ux, best.uy)
    return Way(best.length / scale, best.ux, best.uy)


@inner
def _outline(p, x, y, scale):
    """Return the vertices of a body relative to x, y, times a power of two."""
    outline = outline_of(p)
    first = first_vertex(outline)
    array = scratch(2 * outline.n)
    write_relative(Part(p.array, first, first + 2 * outline.n), x, y, scale, array, 0)
    return array


@inner
def _straight_way(v, w):
    """Return the shortest way along an axis or a normal of a side, given the vertices of both."""
    sides = scratch(3 * (4 + (len(v) + len(w)) // 2))
    best = Way(math.inf, 0.0, 0.0)
    for k in range(0, _write_sides(Part(v, 0, len(v)), Part(w, 0, len(w)), sides, 0), 3):
        if sides[k + 2] < best.length:
            best = Way(sides[k + 2], sides[k], sides[k + 1])
    return best


@inner
def _write_sides(a, b, sides, place):
    """
    Write half-planes that have in them all q - p, with p a vertex of A and q one of B.

    Return where they end. They are along both axes and the normals of all sides.
    """
    a = Part(elements(a.array), a.first, a.end)
    b = Part(elements(b.array), b.first, b.end)
    for ux, uy in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
        place = _write_side(a, b, ux, uy, sides, place)
    for sign, body in ((1.0, b), (-1.0, a)):
        v = body.array
        before = body.end - 2
        for k in range(body.first, body.end if before > body.first else body.first, 2):
            ex, ey = unit(v[k] - v[before], v[k + 1] - v[before + 1])
            # Vertices may have become one by rounding.
            if ex != 0.0 or ey != 0.0:
                place = _write_side(a, b, sign * ey, -sign * ex, sides, place)
            before = k
    return place


@inner
def _write_side(a, b, ux, uy, sides, place):
    """Write the half-plane with a normal; return where it ends."""
    sides[place], sides[place + 1] = ux, uy
    sides[place + 2] = (reach_along(b.array, b.first, b.end, ux, uy)
                        + reach_along(a.array, a.first, a.end, -ux, -uy))
    return place + 3


@inner
def _differences(a, b, pairs, size, clear, length):
    """Return the differences, moved out, of those pairs of parts that are nearer than a length."""
    v, v_ends = a
    w, w_ends = b
    sides = scratch(3 * size)
    ends = scratch_integers(len(pairs))
    count = place = 0
    for pair in pairs:
        i, j = pair // len(w_ends), pair % len(w_ends)
        start = place
        place = _write_sides(Part(v, v_ends[i - 1] // 2 if i > 0 else 0, v_ends[i] // 2),
                             Part(w, w_ends[j - 1] // 2 if j > 0 else 0, w_ends[j] // 2),
                             sides, place)
        near = True
        for k in range(start, place, 3):
            sides[k + 2] += _HALF_PLANES * clear
            near = near and sides[k + 2] > -length
        if near:
            ends[count] = place
            count += 1
        else:
            place = start
    return Differences(sides, ends, count)


@inner
def _nearest(differences, clear, best):
    """Return the way to the nearest point in no difference, if it is shorter than the best."""
    s = elements(differences.sides)
    ends = elements(differences.ends)
    latest = first = 0
    for i in range(differences.used):
        end = ends[i]
        for k in range(first, end, 3):
            nx, ny = s[k], s[k + 1]
            height = s[k + 2] + (1.0 - _HALF_PLANES) * clear
            if not 0.0 < height < best.length:
                continue
            low, high = _stretch(Part(s, first, end), k, height, (_ENDS - _HALF_PLANES) * clear)
            for sign in (1.0, -1.0):
                start = max(low if sign > 0.0 else -high, 0.0)
                stop = min(high if sign > 0.0 else -low, math.sqrt(
                    max(best.length - height, 0.0) * (best.length + height)))
                if not start < stop:
                    continue
                line = Line(nx * height, ny * height, -sign * ny, sign * nx)
                aside, latest = _uncovered(Differences(s, ends, differences.used), line, start,
                                           stop, latest)
                x, y = line.x + aside * line.wx, line.y + aside * line.wy
                found = math.sqrt(x * x + y * y)
                if aside < stop and found < best.length:
                    ux, uy = (nx, ny) if aside == 0.0 else unit(x, y)
                    best = Way(found, ux, uy)
        first = end
    return best


@inner
def _stretch(difference, k, height, more):
    """
    Return from where to where the line along a side is in its difference, moved out some more.

    Places are to the left of the line's point nearest to the origin, whose height is given.
    """
    s = difference.array
    nx, ny = s[k], s[k + 1]
    low, high = -math.inf, math.inf
    for m in range(difference.first, difference.end, 3):
        reach = s[m + 2] + more - (s[m] * nx + s[m + 1] * ny) * height
        growth = s[m + 1] * nx - s[m] * ny
        if m != k and growth > 0.0:
            high = min(high, reach / growth)
        elif m != k and growth < 0.0:
            low = max(low, reach / growth)
    return low, high


@inner
def _uncovered(differences, line, aside, stop, latest):
    """
    Return the first place on a line that is in no difference, from a place on; `stop` if none is.

    The difference that was the latest to cover a place is tried first, and returned.
    """
    s, ends, count = differences
    i = latest
    tried = 0
    while tried < count:
        x, y = line.x + aside * line.wx, line.y + aside * line.wy
        left = math.inf
        for k in range(ends[i - 1] if i > 0 else 0, ends[i], 3):
            reach = s[k + 2] - (s[k] * x + s[k + 1] * y)
            growth = s[k] * line.wx + s[k + 1] * line.wy
            if reach < 0.0:
                left = 0.0
                break
            if growth > 0.0:
                left = min(left, reach / growth)
        tried += 1
        if aside + left > aside:
            aside += left
            if aside >= stop:
                return stop, i
            latest = i
            tried = 0
        i = i + 1 if i + 1 < count else 0
    return aside, latest

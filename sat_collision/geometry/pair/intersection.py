# Copyright 2026 The sat_collision Authors
#
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Exact intersection tests: a search in plain doubles, and exact signs where it is undecided."""

from sat_collision.geometry.body.layout import (
    convex_part, first_vertex, Packed, packed_polygon, vertex_after, vertex_before)
from sat_collision.geometry.compiled.floating_point import require_nearest
from sat_collision.geometry.compiled.jit import elements, inlined, inner, kernel
from sat_collision.geometry.numeric.predicates import orient, segments_meet
from sat_collision.geometry.pair.separating_axis import (
    boxes_apart, find_separating_axis, MEET, SEPARATE, UNCERTAIN)


@kernel
def arrays_meet(p, n, q, m):
    """Return `bodies_meet` of two bodies, each in an array of its own, with counts n and m."""
    require_nearest(n)
    return bodies_meet(packed_polygon(p, n), packed_polygon(q, m))


@kernel
def bodies_meet(p, q):
    """Decide exactly whether packed polygons, convex or not, share a point; touching counts."""
    if boxes_apart(p, q):
        return False
    for i in range(max(1, -p.n)):
        a = convex_part(p, i)
        if boxes_apart(a, q):
            continue
        for j in range(max(1, -q.n)):
            if convex_meet(a, convex_part(q, j)):
                return True
    return False


@inlined
def filtered_verdict(p, q):
    """
    Return the verdict of the search in plain doubles: SEPARATE, MEET or UNCERTAIN.

    A count of 0 means no body. Non-convex bodies whose boxes meet are UNCERTAIN.
    """
    if p.n == 0 or q.n == 0 or boxes_apart(p, q):
        return SEPARATE
    if p.n < 0 or q.n < 0:
        return UNCERTAIN
    return find_separating_axis(p, q)[0]


@kernel
def convex_meet(p, q):
    """Decide exactly whether two convex polygons share a point."""
    p = Packed(elements(p.array), p.start, p.n)
    q = Packed(elements(q.array), q.start, q.n)
    if boxes_apart(p, q):
        return False
    verdict, i, j, _ = find_separating_axis(p, q)
    if verdict != UNCERTAIN:
        return verdict == MEET
    return meet_near(p, q, i, j)


@kernel
def meet_near(p, q, i, j):
    """
    Decide exactly whether two convex polygons share a point, where the search was UNCERTAIN.

    Two convex polygons are separate iff some edge of one has every vertex of the other strictly
    outside it (a segment counts as two edges, there and back). Two bodies without area may be
    separate along their common line only, so those are compared as segments (docs/exactness.md,
    lemma 11). Most touching pairs are recognised by edges at i and j, where the search ended.
    """
    v, w = p.array, q.array
    i, j = max(i, first_vertex(p)), max(j, first_vertex(q))
    for a in (vertex_before(p, i), i):
        b = vertex_after(p, a)
        for c in (vertex_before(q, j), j):
            d = vertex_after(q, c)
            if segments_meet(v[a], v[a + 1], v[b], v[b + 1], w[c], w[c + 1], w[d], w[d + 1]):
                return True
    if p.n <= 2 and q.n <= 2:
        return False
    return not (_some_edge_separates(p, q, i, j, 0) or _some_edge_separates(q, p, j, i, 0))


@kernel
def interiors_apart(p, q):
    """Decide exactly whether an edge of one convex polygon has no point of the other inside it."""
    i, j = first_vertex(p), first_vertex(q)
    return _some_edge_separates(p, q, i, j, 1) or _some_edge_separates(q, p, j, i, 1)


@inner
def _some_edge_separates(p, q, i, j, inner):
    """Decide exactly whether, for some edge of P, `orient` of all of Q is less than inner."""
    if p.n < 2:
        return False
    v, w = p.array, q.array
    a = vertex_before(p, i)
    c = j
    for _ in range(p.n):
        b = vertex_after(p, a)
        for _ in range(q.n):
            if orient(v[a], v[a + 1], v[b], v[b + 1], w[c], w[c + 1]) >= inner:
                break
            c = vertex_after(q, c)
        else:
            return True
        a = b
    return False

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
The exact answer for any two bodies, for where the search in plain doubles is not sure.
"""

from sat_collision.geometry.jit import inlined, kernel, unchecked_view
from sat_collision.geometry.layout import convex_part, HEADER, table_size
from sat_collision.geometry.predicates import orient, segments_meet
from sat_collision.geometry.separating_axis import (
    boxes_apart, find_separating_axis, MEET, SEPARATE, UNCERTAIN)


@kernel
def bodies_meet(p, p_start, n, q, q_start, m):
    """
    Tell exactly whether two bodies share a point; touching counts.

    Parameters
    ----------
    p, q : flat arrays of float64
        Hold the bodies' packeds, from p_start and q_start on.
    n, m : int
        The number of vertices of a convex body, minus the number of parts of another.

    """
    if boxes_apart(p, p_start, q, q_start):
        return False
    for i in range(max(1, -n)):
        a, a_count = convex_part(p, p_start, n, i)
        for j in range(max(1, -m)):
            b, b_count = convex_part(q, q_start, m, j)
            if convex_meet(p, a, a_count, q, b, b_count):
                return True
    return False


@inlined
def filtered_verdict(p, p_start, n, q, q_start, m):
    """
    Return what the search in plain doubles says of two bodies: SEPARATE, MEET or UNCERTAIN.

    The parameters are those of `bodies_meet`; a count of 0 stands for no body. Bodies that are
    not convex and may meet are left UNCERTAIN.
    """
    p = unchecked_view(p)
    q = unchecked_view(q)
    if n == 0 or m == 0 or boxes_apart(p, p_start, q, q_start):
        return SEPARATE
    if n < 0 or m < 0:
        return UNCERTAIN
    verdict, _, _, _ = find_separating_axis(p, p_start, n, q, q_start, m)
    return verdict


@kernel
def convex_meet(p, p_start, n, q, q_start, m):
    """Tell exactly whether two convex polygons, packed, share a point."""
    p = unchecked_view(p)
    q = unchecked_view(q)
    if boxes_apart(p, p_start, q, q_start):
        return False
    verdict, i, j, _ = find_separating_axis(p, p_start, n, q, q_start, m)
    if verdict != UNCERTAIN:
        return verdict == MEET
    return meet_near(p, p_start, n, q, q_start, m, i, j)


@kernel
def meet_near(p, p_start, n, q, q_start, m, i, j):
    """Tell the same where the find_separating_axis, which ended at i and j in p and q, was not sure."""
    p = unchecked_view(p)
    q = unchecked_view(q)
    first_p = p_start + HEADER + table_size(n)
    first_q = q_start + HEADER + table_size(m)
    i = (i - first_p) // 2 if i >= first_p else 0
    j = (j - first_q) // 2 if j >= first_q else 0
    return _meet_by_edges(p, first_p, n, q, first_q, m, i, j)


@kernel
def _meet_by_edges(p, ps, n, q, qs, m, i, j):
    """
    Decide by exact orientations; i and j are vertices near the contact, if there is one.

    Two convex polygons are separate iff some edge of one has every vertex of the other strictly
    outside it (a segment counts as two edges, there and back). Two bodies without area may be
    separate along their common line only, so those are compared as segments. Most touching pairs
    are recognised by their edges next to i and j.
    """
    for a in ((i + n - 1) % n, i):
        b = (a + 1) % n
        for c in ((j + m - 1) % m, j):
            d = (c + 1) % m
            if segments_meet(p[ps + 2 * a], p[ps + 2 * a + 1], p[ps + 2 * b], p[ps + 2 * b + 1],
                             q[qs + 2 * c], q[qs + 2 * c + 1], q[qs + 2 * d], q[qs + 2 * d + 1]):
                return True
    if n <= 2 and m <= 2:
        return False
    return not (_some_edge_separates(p, ps, n, q, qs, m, i, j, 0)
                or _some_edge_separates(q, qs, m, p, ps, n, j, i, 0))


@kernel
def interiors_apart(p, p_start, n, q, q_start, m):
    """Tell exactly whether some edge of two convex polygons has the other nowhere inside it."""
    ps = p_start + HEADER + table_size(n)
    qs = q_start + HEADER + table_size(m)
    return (_some_edge_separates(p, ps, n, q, qs, m, 0, 0, 1)
            or _some_edge_separates(q, qs, m, p, ps, n, 0, 0, 1))


@kernel
def _some_edge_separates(p, ps, n, q, qs, m, i, j, inner):
    """Tell exactly whether all of Q is on the right of an edge of P: its turns less than inner."""
    if n < 2:
        return False
    inside = j
    for s in range(n):
        a = (i + n - 1 + s) % n
        b = (a + 1) % n
        separates = True
        for t in range(m):
            k = (inside + t) % m
            if orient(p[ps + 2 * a], p[ps + 2 * a + 1], p[ps + 2 * b], p[ps + 2 * b + 1],
                      q[qs + 2 * k], q[qs + 2 * k + 1]) >= inner:
                inside = k
                separates = False
                break
        if separates:
            return True
    return False
